//! Textures of the tiled ball: glazed tiles with worn edges, some of brass, between dull joints.
//!
//! 512 × 512, repeating in both directions. Made from formulas and a fixed hash: the same bytes everywhere.

/// Edge of the images in texels.
pub(crate) const SIZE: usize = 512;
/// Tiles along the image's edge.
const TILES: usize = 4;
/// Half the joint's width, in tiles.
const JOINT: f64 = 0.035;
/// Width of the rounded edge, in tiles.
const BEVEL: f64 = 0.10;
/// Radius of a tile's corners, in tiles.
const CORNER: f64 = 0.12;
/// Height of a tile over the joint, in tiles.
const RISE: f64 = 0.055;

/// Three interleaved 8-bit images, row 0 at the top.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tiles {
    /// sRGB.
    pub base_color: Vec<u8>,
    /// Tangent space, +Y up in the image.
    pub normal: Vec<u8>,
    /// Red occlusion, green roughness, blue metalness.
    pub occlusion_roughness_metallic: Vec<u8>,
}

/// Draws the textures.
pub(crate) fn tiles() -> Tiles {
    let capacity = SIZE * SIZE * 3;
    let mut tiles = Tiles {
        base_color: Vec::with_capacity(capacity),
        normal: Vec::with_capacity(capacity),
        occlusion_roughness_metallic: Vec::with_capacity(capacity),
    };
    for (y, x) in (0..SIZE).flat_map(|y| (0..SIZE).map(move |x| (y, x))) {
        let at = [x, y].map(|texel| (texel as f64 + 0.5) / SIZE as f64);
        let surface = surface(at);
        tiles.base_color.extend(surface.color.map(|value| code(linear_to_srgb(value))));
        tiles.normal.extend(normal(at).map(|value| code(0.5 + 0.5 * value)));
        tiles
            .occlusion_roughness_metallic
            .extend([surface.occlusion, surface.roughness, surface.metallic].map(code));
    }
    tiles
}

struct Texel {
    color: [f64; 3],
    occlusion: f64,
    roughness: f64,
    metallic: f64,
}

fn surface(at: [f64; 2]) -> Texel {
    const JOINT_COLOR: [f64; 3] = [0.30, 0.27, 0.23];
    const BRASS: [f64; 3] = [0.91, 0.68, 0.32];
    const GLAZES: [[f64; 3]; 3] = [[0.012, 0.105, 0.135], [0.020, 0.165, 0.180], [0.74, 0.69, 0.58]];
    let tile = tile(at);
    let [kind, shade, gloss] = [0, 1, 2].map(|salt| hash(tile.column, tile.row, salt));
    let is_brass = (tile.column + 2 * tile.row).is_multiple_of(5);
    let glaze = GLAZES[if kind < 0.42 {
        0
    } else if kind < 0.78 {
        1
    } else {
        2
    }];
    let tint = 0.88 + 0.24 * shade;
    // The glaze thins out over the rounded edge and lets the lighter clay through.
    let worn = 0.55 * (1.0 - smooth(0.35, 1.0, tile.height));
    let glazed: [f64; 3] = std::array::from_fn(|i| mix(glaze[i] * tint, 0.42 * [1.0, 0.84, 0.66][i], worn));
    let face = if is_brass { BRASS } else { glazed };
    let cover = smooth(0.02, 0.30, tile.height);
    let face_roughness = if is_brass { 0.26 + 0.10 * gloss } else { 0.10 + 0.12 * gloss + 0.35 * worn };
    Texel {
        color: std::array::from_fn(|i| mix(JOINT_COLOR[i], face[i], cover)),
        occlusion: mix(0.45, 1.0, smooth(0.0, 0.9, tile.height)),
        roughness: mix(0.88, face_roughness, cover),
        metallic: if is_brass { cover } else { 0.0 },
    }
}

/// Central differences over one texel; the pattern repeats, so the border needs no care.
fn normal([u, v]: [f64; 2]) -> [f64; 3] {
    let step = 1.0 / SIZE as f64;
    // Heights are in tiles, so distances must be too.
    let slope = |a: f64, b: f64| (a - b) / (2.0 * step * TILES as f64);
    let along_u = slope(relief([u + step, v]), relief([u - step, v]));
    let along_v = slope(relief([u, v + step]), relief([u, v - step]));
    // v grows downwards in the image, +Y of the normal texture upwards.
    let (x, y) = (-along_u, along_v);
    let length = libm::sqrt(x * x + y * y + 1.0);
    [x / length, y / length, 1.0 / length]
}

/// Height in tiles: the tile's rise, a slight tilt of its own and soft hammer marks.
fn relief(at: [f64; 2]) -> f64 {
    let tile = tile(at);
    let [tilt_x, tilt_y] = [3, 4].map(|salt| 0.03 * (hash(tile.column, tile.row, salt) - 0.5));
    let [x, y] = tile.within;
    let marks = 0.0035 * waves(at);
    tile.height * (RISE + tilt_x * x + tilt_y * y + marks)
}

/// Sines of whole frequencies, so that they repeat with the image.
fn waves([u, v]: [f64; 2]) -> f64 {
    use std::f64::consts::TAU;
    let wave = |fu: f64, fv: f64, phase: f64| libm::sin(TAU * (fu * u + fv * v) + phase);
    wave(9.0, 4.0, 0.3) + wave(-5.0, 11.0, 1.9) + wave(13.0, -7.0, 4.1) + wave(3.0, 14.0, 2.6)
}

struct TilePoint {
    column: usize,
    row: usize,
    /// From the tile's centre, −0.5 … 0.5.
    within: [f64; 2],
    /// 0 in the joint, 1 on the face.
    height: f64,
}

fn tile([u, v]: [f64; 2]) -> TilePoint {
    let count = TILES as f64;
    let [x, y] = [u, v].map(|value| (value - libm::floor(value)) * count);
    let within = [x, y].map(|value| value - libm::floor(value) - 0.5);
    // Distance to the edge of a square with rounded corners.
    let half = 0.5 - JOINT - CORNER;
    let outside = within.map(|value| value.abs() - half);
    let corner = libm::hypot(outside[0].max(0.0), outside[1].max(0.0));
    let distance = corner + outside[0].max(outside[1]).min(0.0) - CORNER;
    let height = smooth(0.0, BEVEL, -distance);
    TilePoint { column: x as usize % TILES, row: y as usize % TILES, within, height }
}

fn mix(a: f64, b: f64, t: f64) -> f64 {
    a + (b - a) * t
}

fn smooth(low: f64, high: f64, value: f64) -> f64 {
    let t = ((value - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Uniform in [0, 1): the finaliser of SplitMix64 (Steele, Lea, Flood 2014).
fn hash(column: usize, row: usize, salt: u64) -> f64 {
    let mut bits = (column as u64) << 32 ^ (row as u64) << 16 ^ salt ^ 0x9e37_79b9_7f4a_7c15;
    bits = (bits ^ bits >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ bits >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((bits ^ bits >> 31) >> 11) as f64 / (1u64 << 53) as f64
}

fn linear_to_srgb(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * libm::pow(linear, 1.0 / 2.4) - 0.055 }
}

fn code(value: f64) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}
