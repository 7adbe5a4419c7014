//! The panoramas a bench looks at: real ones of the corpus, exact suns, and larger versions of either.

use kiln_bake::Cancel;
use kiln_image::{Image, Limits, Panorama, TexelPolicy, decode};
use std::f64::consts::PI;
use std::path::{Path, PathBuf};

const WANTED: &str = "nobody cancels";

/// Folders of the corpus with panoramas of real places.
const FOLDERS: [&str; 5] =
    ["hdr/polyhaven-bevy", "hdr/polyhaven-pmndrs", "hdr/nvpro", "hdr/loadersgl", "exr/pmndrs-npm"];
/// The one that times are taken with: lamps, windows, nothing of one colour.
const STUDIO: &str = "hdr/polyhaven-pmndrs/studio.hdr";

pub(crate) struct Named {
    pub(crate) name: String,
    pub(crate) panorama: Panorama,
}

/// All real panoramas whose name holds `only`; says what it passes over.
pub(crate) fn real(only: &str) -> Vec<Named> {
    let Some(root) = std::env::var_os("KILN_CORPUS").map(PathBuf::from) else {
        println!("SKIPPED: all real panoramas: KILN_CORPUS is not set");
        return Vec::new();
    };
    let mut found = Vec::new();
    for folder in FOLDERS {
        let Ok(entries) = std::fs::read_dir(root.join(folder)) else {
            println!("SKIPPED: {folder} is not in the corpus");
            continue;
        };
        let mut files: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
        files.sort();
        for file in files.iter().filter(|file| is_image(file)) {
            let name = format!("{folder}/{}", file.file_name().unwrap_or_default().to_string_lossy());
            if !name.contains(only) {
                continue;
            }
            match read(file) {
                Ok(panorama) => found.push(Named { name, panorama }),
                Err(reason) => println!("SKIPPED: {name}: {reason}"),
            }
        }
    }
    found
}

fn is_image(file: &Path) -> bool {
    file.extension().is_some_and(|extension| extension == "hdr" || extension == "exr")
}

fn read(file: &Path) -> Result<Panorama, String> {
    let text = |error: &dyn std::fmt::Display| error.to_string();
    let bytes = std::fs::read(file).map_err(|error| text(&error))?;
    let mut image = decode(&bytes, &Limits::default(), Cancel::NEVER).map_err(|error| text(&error))?.image;
    TexelPolicy::Repair.apply(&mut image, Cancel::NEVER).map_err(|error| text(&error))?;
    Panorama::new(image).map_err(|error| text(&error))
}

/// The studio of the corpus, or a sky with lamps where there is none.
pub(crate) fn studio() -> Named {
    let file = std::env::var_os("KILN_CORPUS").map(|root| Path::new(&root).join(STUDIO));
    match file.map(|file| read(&file)) {
        Some(Ok(panorama)) => Named { name: STUDIO.to_owned(), panorama },
        _ => Named { name: "made lamps (no corpus)".to_owned(), panorama: lamps(1024) },
    }
}

/// Smooth light with twelve rectangular lamps.
fn lamps(width: usize) -> Panorama {
    panorama(width, |u, v| {
        let sky = 0.3 + 0.2 * libm::cos(PI * v) + 0.05 * libm::sin(2.0 * PI * 7.0 * u);
        let (s, t) = ((6.0 * u).fract(), (2.0 * v).fract());
        let lamp = if (s - 0.5).abs() < 0.05 && (t - 0.6).abs() < 0.04 { 400.0 } else { 0.0 };
        [sky + lamp, sky + 0.9 * lamp, 1.2 * sky + 0.7 * lamp]
    })
}

/// The sun's diameter, in radians.
const SUN_DIAMETER: f64 = 0.53 * PI / 180.0;

/// A sun of 0.53° at a place of no special position, at a pole, beside it and on the wrap column; radiance 10⁵ and 10⁷ over 1 and 0.
pub(crate) fn suns(width: usize, only: &str) -> Vec<Named> {
    let places = [
        ("sun", [1.137, 2.071]),
        ("sun at the pole", [0.0, 0.0]),
        ("sun beside the pole", [0.011, 0.7]),
        ("sun on the wrap", [1.3, 0.0]),
    ];
    let mut found = Vec::new();
    for (place, centre) in places {
        for radiance in [1e5, 1e7] {
            for around in [1.0, 0.0] {
                let name = format!("{place}, {radiance:e} over {around}");
                if name.contains(only) {
                    found.push(Named { name, panorama: sun(width, centre, radiance, around) });
                }
            }
        }
    }
    found
}

/// A disc around [θ, λ]; a texel holds the mean of what it covers.
fn sun(width: usize, centre: [f64; 2], radiance: f64, around: f64) -> Panorama {
    let height = width / 2;
    let mut rgb = Vec::with_capacity(width * height * 3);
    for row in 0..height {
        let theta = [row, row + 1].map(|row| PI * row as f64 / height as f64);
        let covered = covered(width, theta, centre);
        for share in covered {
            let value = around + (radiance - around) * share;
            rgb.extend([value as f32; 3]);
        }
    }
    from_rgb(width, rgb)
}

/// Share of each texel of a row that the disc covers: its chord on many parallels, which is exact.
fn covered(width: usize, theta: [f64; 2], [theta_sun, lambda_sun]: [f64; 2]) -> Vec<f64> {
    const PARALLELS: usize = 400;
    let radius = 0.5 * SUN_DIAMETER;
    let mut shares = vec![0.0; width];
    if theta[1] < theta_sun - radius || theta[0] > theta_sun + radius {
        return shares;
    }
    let mut total = 0.0;
    for index in 0..PARALLELS {
        let at = theta[0] + (theta[1] - theta[0]) * (index as f64 + 0.5) / PARALLELS as f64;
        let weight = libm::sin(at);
        total += weight;
        // cos radius = cos θ cos θ_s + sin θ sin θ_s cos Δλ
        let across = libm::sin(at) * libm::sin(theta_sun);
        let lit = libm::cos(radius) - libm::cos(at) * libm::cos(theta_sun);
        let half = match (lit / across.max(f64::MIN_POSITIVE)).clamp(-1.0, 1.0) {
            cosine if cosine > -1.0 => libm::acos(cosine),
            _ => PI,
        };
        let cell = 2.0 * PI / width as f64;
        for turn in [-2.0 * PI, 0.0, 2.0 * PI] {
            let (start, end) = (lambda_sun + turn - half, lambda_sun + turn + half);
            let first = (start / cell).floor().max(0.0) as usize;
            let last = ((end / cell).ceil().max(0.0) as usize).min(width);
            for (column, share) in shares.iter_mut().enumerate().take(last).skip(first) {
                let (left, right) = (cell * column as f64, cell * (column + 1) as f64);
                *share += weight * (end.min(right) - start.max(left)).max(0.0) / cell;
            }
        }
    }
    for share in &mut shares {
        *share = (*share / total).min(1.0);
    }
    shares
}

/// The panorama at another width, bilinear: its fine detail is less than a real one's, its light the same.
pub(crate) fn resized(source: &Panorama, width: usize) -> Panorama {
    panorama(width, |u, v| bilinear(source, u, v).map(f64::from))
}

/// What a texture unit reads: wrapped around, clamped at the poles.
pub(crate) fn bilinear(source: &Panorama, u: f64, v: f64) -> [f32; 3] {
    let (width, height) = (source.width(), source.height());
    let (x, y) = (u * width as f64 - 0.5, v * height as f64 - 0.5);
    let (column, row) = (x.floor(), y.floor());
    let (s, t) = ((x - column) as f32, (y - row) as f32);
    let columns = [column as isize, column as isize + 1].map(|x| x.rem_euclid(width as isize) as usize);
    let rows = [row as isize, row as isize + 1].map(|y| y.clamp(0, height as isize - 1) as usize);
    let rgb = source.rgb();
    let texel = |x: usize, y: usize| &rgb[3 * (y * width + x)..3 * (y * width + x) + 3];
    let (a, b) = (texel(columns[0], rows[0]), texel(columns[1], rows[0]));
    let (c, d) = (texel(columns[0], rows[1]), texel(columns[1], rows[1]));
    std::array::from_fn(|i| (1.0 - t) * ((1.0 - s) * a[i] + s * b[i]) + t * ((1.0 - s) * c[i] + s * d[i]))
}

fn panorama(width: usize, at: impl Fn(f64, f64) -> [f64; 3]) -> Panorama {
    let height = width / 2;
    let place = |index: usize, count: usize| (index as f64 + 0.5) / count as f64;
    let texels = (0..height).flat_map(|row| (0..width).map(move |column| (row, column)));
    let rgb = texels.flat_map(|(row, column)| at(place(column, width), place(row, height)).map(|x| x as f32));
    from_rgb(width, rgb.collect())
}

fn from_rgb(width: usize, rgb: Vec<f32>) -> Panorama {
    let image = Image::new(width, width / 2, rgb).expect("sizes that fit");
    Panorama::new(image).expect(WANTED)
}
