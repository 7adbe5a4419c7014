//! Estimates of memory against a counting allocator. One test, since the count is the process's.
#![allow(unsafe_code, reason = "an allocator cannot be written without")]

use kiln_bake::{
    Analysis, AnalysisRequest, BAND_LIMIT_MAX, Cancel, TexelFormat, analyse, encode_level, irradiance,
    memory, panorama_of_cube, skybox, skybox_of_cube, specular_level,
};
use kiln_image::{
    Cube, Environment, Image, Limits, Panorama, TexelPolicy, Texels, decode_environment, hdr, ktx2,
};
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// The system's allocator, with an account of what is out and what was at most.
struct Counting;

static CURRENT: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

impl Counting {
    fn take(size: usize) {
        PEAK.fetch_max(CURRENT.fetch_add(size, Relaxed) + size, Relaxed);
    }

    fn give(size: usize) {
        CURRENT.fetch_sub(size, Relaxed);
    }
}

// SAFETY: every call goes to `System` unchanged; the account allocates nothing.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        Self::take(layout.size());
        // SAFETY: the caller's promise is `System`'s condition.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        Self::take(layout.size());
        // SAFETY: as above.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        Self::give(layout.size());
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // Both are there while the system copies.
        Self::take(size);
        Self::give(layout.size());
        // SAFETY: as above.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const WANTED: &str = "nobody cancels";

/// Waits until what was to be freed later is freed: rayon starts jobs from outside in their order, and a broadcast
/// reaches a worker when it has ended its job.
fn settle() {
    rayon::scope(|_| ());
    rayon::broadcast(|_| ());
}

/// Peak memory of `step`; it allocates its own inputs, so that they are counted.
fn peak_of<T>(step: impl FnOnce() -> T) -> usize {
    settle();
    let floor = CURRENT.load(Relaxed);
    PEAK.store(floor, Relaxed);
    drop(step());
    PEAK.load(Relaxed) - floor
}

/// Why an estimate is no good, if it is none.
fn complaint(estimate: usize, peak: usize) -> Option<&'static str> {
    if peak > estimate {
        Some("the estimate is too small")
    } else if 4 * peak < estimate {
        Some("the estimate is over four times too large")
    } else {
        None
    }
}

/// Noise with peaks, and with contrast enough that every degree is wanted.
fn panorama(width: usize, height: usize) -> Panorama {
    let value = |index: usize| {
        let mixed = (index as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let mixed = (mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let uniform = (mixed >> 40) as f32 / (1u32 << 24) as f32;
        if uniform > 0.999 { 500.0 } else { uniform }
    };
    let rgb = (0..width * height * 3).map(value).collect();
    Panorama::new(Image::new(width, height, rgb).expect("sizes fit")).expect("2:1")
}

/// A panorama or a cube as the store holds it.
fn stored(map: &impl Texels) -> Vec<u8> {
    map.rgb().iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>()
}

#[test]
fn estimates_cover_the_counted_peak_and_are_no_more_than_four_times_it() {
    // The small one with the most degrees there are, the large one with fewer, for the time it takes.
    for (width, height, alpha, band_limit_min) in
        [(512, 256, 0.002, BAND_LIMIT_MAX), (2048, 1024, 0.004, 1200)]
    {
        let request = AnalysisRequest { alpha_min: alpha, sheen_alpha_min: None, error: 1e-4 };
        let (map, never, face_size) = (panorama(width, height), Cancel::NEVER, width / 8);
        let analysis = analyse(&map, &request, never).expect(WANTED);
        assert!(analysis.band_limit() >= band_limit_min, "{}", analysis.band_limit());
        let (file, blob) = (hdr::encode(map.image()), analysis.to_bytes(never).expect(WANTED));
        assert!(blob.len() <= memory::ANALYSIS_BYTES_MAX);
        drop(analysis);
        let prefilter = |alpha: Option<f64>| {
            let stored = blob.clone();
            let analysis = Analysis::from_bytes(&stored, never).expect(WANTED);
            let map = match alpha {
                Some(alpha) => specular_level(&analysis, alpha, face_size, never),
                None => irradiance(&analysis, face_size, never),
            };
            let map = map.expect(WANTED);
            let level = encode_level(&map.cube, TexelFormat::Rgba16Float, 0, never).expect(WANTED);
            (stored, analysis, map, level)
        };
        let decode = || {
            let file = file.clone();
            let mut image = kiln_image::decode(&file, &Limits::default(), never).expect("just encoded").image;
            TexelPolicy::Repair.apply(&mut image, never).expect(WANTED);
            let map = Panorama::new(image).expect("2:1");
            (file, stored(&map), map)
        };
        let analyse = || {
            let (map, input) = (map.clone(), stored(&map));
            let analysis = analyse(&map, &request, never).expect(WANTED);
            (input, analysis.to_bytes(never).expect(WANTED), map, analysis)
        };
        let skybox = || {
            let (map, input) = (map.clone(), stored(&map));
            let levels = skybox(&map, face_size, never).expect(WANTED);
            let encode = |level| encode_level(level, TexelFormat::Rgba16Float, 0, never).expect(WANTED);
            let encoded: Vec<_> = levels.iter().map(encode).collect();
            (input, map, levels, encoded)
        };
        let steps = [
            ("decode", memory::decode(file.len()), peak_of(decode)),
            ("analyse", memory::analyse(width, height), peak_of(analyse)),
            ("skybox", memory::skybox(width, height, face_size), peak_of(skybox)),
            (
                "specular level",
                memory::specular_level(blob.len(), request.error, alpha, face_size),
                peak_of(|| prefilter(Some(alpha))),
            ),
            (
                "rough level",
                memory::specular_level(blob.len(), request.error, 0.25, face_size),
                peak_of(|| prefilter(Some(0.25))),
            ),
            (
                "irradiance",
                memory::irradiance(blob.len(), request.error, face_size),
                peak_of(|| prefilter(None)),
            ),
        ];
        report(&format!("{width} x {height}"), &steps);
    }
    cubes();
    assert!(complaint(99, 100).is_some() && complaint(401, 100).is_some(), "the check itself");
}

#[expect(clippy::print_stdout, reason = "the figures are what one wants to read")]
fn report(size: &str, steps: &[(&str, usize, usize)]) {
    for (name, estimate, peak) in steps {
        println!("{size} {name}: peak {peak}, estimate {estimate}");
        assert_eq!(complaint(*estimate, *peak), None, "{size} {name}: {peak} of {estimate}");
    }
}

/// Steps from a cube, and from files that hold no panorama.
fn cubes() {
    let never = Cancel::NEVER;
    let size = 256;
    let cube =
        Cube::new(size, panorama(4 * size, 2 * size).rgb()[..18 * size * size].to_vec()).expect("it fits");
    let through_panorama = || {
        let (cube, input) = (cube.clone(), stored(&cube));
        let map = panorama_of_cube(&cube, never).expect(WANTED);
        (input, stored(&map), cube, map)
    };
    let sky = |face_size: usize| {
        let (cube, input) = (cube.clone(), stored(&cube));
        let levels = skybox_of_cube(&cube, face_size, never).expect(WANTED);
        let encode = |level| encode_level(level, TexelFormat::Rgba16Float, 0, never).expect(WANTED);
        let encoded: Vec<_> = levels.iter().map(encode).collect();
        (input, cube, levels, encoded)
    };
    let blocks = ktx2::Format::BC6H_UFLOAT_BLOCK;
    let level = encode_level(&cube, TexelFormat::Bc6hUfloat, 0, never).expect(WANTED).bytes;
    let container = ktx2::write(&ktx2::Texture {
        format: blocks,
        width: size,
        height: size,
        faces: 6,
        levels: vec![&level],
        key_values: Vec::new(),
    });
    let octahedral =
        hdr::encode(&Image::new(512, 512, panorama(1024, 512).rgb()[..3 << 18].to_vec()).expect("it fits"));
    let decode = |file: &Vec<u8>, layout: Option<kiln_image::Layout>| {
        let file = file.clone();
        let mut decoded = decode_environment(&file, layout, &Limits::default(), never).expect("just encoded");
        TexelPolicy::Repair.apply(&mut decoded, never).expect(WANTED);
        let is_cube = matches!(decoded.environment, Environment::Cube(_));
        assert_eq!(is_cube, layout.is_none());
        (file, stored(&decoded), decoded)
    };
    let steps = [
        ("panorama", memory::panorama_of_cube(size), peak_of(through_panorama)),
        ("sky box, same", memory::skybox_of_cube(size, 256), peak_of(|| sky(256))),
        ("sky box, half", memory::skybox_of_cube(size, 128), peak_of(|| sky(128))),
        ("sky box, larger", memory::skybox_of_cube(size, 384), peak_of(|| sky(384))),
        ("sky box, smaller", memory::skybox_of_cube(size, 100), peak_of(|| sky(100))),
        ("container", memory::decode_container(container.len()), peak_of(|| decode(&container, None))),
        (
            "octahedral",
            memory::decode_octahedral(octahedral.len()),
            peak_of(|| decode(&octahedral, Some(kiln_image::Layout::Octahedral))),
        ),
    ];
    report("6 x 256 x 256", &steps);
}
