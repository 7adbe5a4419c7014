//! What each encoding says it cost, against its bytes read back.

use super::environments::{check_within, encode_level, random, skybox};
use crate::{Cancel, TexelFormat};
use kiln_image::Cube;

/// The level as a reader sees it: three channels.
fn read_back(format: TexelFormat, size: usize, bytes: &[u8]) -> Vec<f32> {
    let values = format.ktx2().decode_image(size, size, bytes).expect("its own bytes");
    values.chunks(format.ktx2().channels()).flat_map(|texel| texel[..3].to_vec()).collect()
}

/// RMS, largest change and clamped flux by their definitions.
fn measure(cube: &Cube, back: &[f32], format: TexelFormat) -> [f64; 3] {
    let pairs = || cube.rgb.iter().zip(back).map(|(&a, &b)| (f64::from(a), f64::from(b)));
    let sum = |f: &dyn Fn(f64, f64) -> f64| pairs().map(|(a, b)| f(a, b)).sum::<f64>();
    let mean = sum(&|a, _| a.abs()) / back.len() as f64;
    let rms = (sum(&|a, b| (a - b) * (a - b)) / sum(&|a, _| a * a)).sqrt();
    let largest = pairs().map(|(a, b)| (a - b).abs() / (a.abs() + mean)).fold(0.0, f64::max);
    let outside = cube.rgb.iter().enumerate().map(|(index, &value)| {
        let [low, high] = format.range(index % 3);
        (low - f64::from(value)).max(f64::from(value) - high).max(0.0)
    });
    [rms, largest, outside.sum::<f64>() / sum(&|a, _| a.abs())]
}

#[test]
fn stated_errors_are_those_of_the_bytes() {
    let mut cube = skybox(&random(64, 32, 4), 13).remove(0);
    for (index, value) in cube.rgb.iter_mut().enumerate() {
        match index % 97 {
            0 => *value = -0.3,
            1 => *value = 70_000.0,
            _ => {}
        }
    }
    for format in TexelFormat::ALL {
        let level = encode_level(&cube, format, 0);
        let [rms, largest, clamped] = measure(&cube, &read_back(format, 13, &level.bytes), format);
        check_within("rms", level.rounding_rms, rms, 1e-12);
        check_within("max", level.rounding_max, largest, 1e-12);
        check_within("clamped", level.clamped_flux, clamped, 1e-12);
        assert_eq!(
            clamped > 0.0,
            format != TexelFormat::Rgba32Float,
            "the check itself: something was clamped"
        );
    }
}

#[test]
fn each_format_keeps_the_error_it_is_known_for() {
    let mut map = skybox(&random(64, 32, 4), 32).remove(0);
    // Smooth, as prefiltered maps are: block compression is made for that.
    for (index, value) in map.rgb.iter_mut().enumerate() {
        *value = 1.0 + 0.5 * libm::sinf(index as f32 * 1e-3);
    }
    let limits = [3e-4, 0.0, 2e-3, 8e-3, 8e-3];
    for (format, limit) in TexelFormat::ALL.into_iter().zip(limits) {
        let level = encode_level(&map, format, 0);
        assert!(level.rounding_rms <= limit, "{format:?}: {}", level.rounding_rms);
        assert!(
            level.rounding_max <= 4.0 * limit && level.clamped_flux == 0.0,
            "{format:?}: {}",
            level.rounding_max
        );
        assert_eq!(level.bytes.len(), format.ktx2().level_bytes(32, 32, 6, 0).expect("small"), "{format:?}");
    }
}

#[test]
fn black_infinite_and_nan_levels_are_encoded_and_said() {
    for format in TexelFormat::ALL {
        let black = encode_level(&Cube { face_size: 4, rgb: vec![0.0; 288] }, format, 0);
        assert_eq!([black.rounding_rms, black.rounding_max, black.clamped_flux], [0.0; 3]);
        let mut rgb = vec![1.0; 288];
        rgb[17] = f32::NAN;
        let nan = encode_level(&Cube { face_size: 4, rgb: rgb.clone() }, format, 0);
        assert!(nan.rounding_rms <= 0.01 && nan.clamped_flux == 0.0, "{format:?}");
        rgb[17] = f32::INFINITY;
        let infinite = encode_level(&Cube { face_size: 4, rgb }, format, 0);
        assert!(infinite.clamped_flux > 0.9, "{format:?}: {}", infinite.clamped_flux);
    }
}

#[test]
fn blocks_do_not_depend_on_the_number_of_threads() {
    let map = skybox(&random(64, 32, 9), 30).remove(0);
    let encode =
        || crate::encode_level(&map, TexelFormat::Bc6hUfloat, 0, Cancel::NEVER).expect("nobody cancels");
    let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
    let levels = [1, 2, 7].map(|threads| pool(threads).install(encode));
    assert!(levels[0] == levels[1] && levels[1] == levels[2]);
    assert_ne!(encode_level(&map, TexelFormat::Bc6hUfloat, 1).bytes, levels[0].bytes, "the check itself");
}

/// Real panoramas: what BC6H and its peers leave, printed with `--nocapture`.
#[test]
#[expect(clippy::print_stderr, reason = "a skipped test has to be seen, and figures are for people")]
fn real_panoramas_lose_little() {
    let Some(folder) = std::env::var_os("KILN_CORPUS") else {
        eprintln!("SKIPPED: real_panoramas_lose_little needs KILN_CORPUS, the folder of real files");
        return;
    };
    for name in ["hdr/polyhaven-bevy", "hdr/polyhaven-pmndrs"] {
        let folder = std::path::Path::new(&folder).join(name);
        let mut files: Vec<_> =
            std::fs::read_dir(folder).expect("a folder").map(|e| e.expect("an entry").path()).collect();
        files.sort();
        let Some(file) = files.into_iter().find(|file| file.extension().is_some_and(|e| e == "hdr")) else {
            continue;
        };
        let bytes = std::fs::read(&file).expect("a file");
        let limits = kiln_image::Limits::default();
        let image = kiln_image::decode(&bytes, &limits, Cancel::NEVER).expect("an image").image;
        let panorama = kiln_image::Panorama::new(image).expect("twice as wide");
        let chain = skybox(&panorama, 256);
        let scale = crate::scale_log2(panorama.max_value());
        for format in TexelFormat::ALL {
            let levels: Vec<_> = chain.iter().map(|level| encode_level(level, format, scale)).collect();
            let rms = levels.iter().map(|level| level.rounding_rms).fold(0.0, f64::max);
            let max = levels.iter().map(|level| level.rounding_max).fold(0.0, f64::max);
            eprintln!(
                "{} {format:?}: rms {:.2e} at level 0, {rms:.2e} at worst, max {max:.2e}",
                file.display(),
                levels[0].rounding_rms
            );
            // Sixteen colours on one or two lines: a block over leaves and sky is coarse, a prefiltered one is not.
            let limit = if format == TexelFormat::Bc6hUfloat { 0.2 } else { 0.01 };
            assert!(rms <= limit && levels[0].clamped_flux <= 1e-3, "{format:?}: {rms}");
        }
    }
}
