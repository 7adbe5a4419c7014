//! The shaders that a new project starts with: the repository's own, compiled in.

/// Path in the project and text; every file of the repository's `shaders/pbr` and `shaders/lib`.
pub(crate) const SHADERS: &[(&str, &str)] = &[
    ("shaders/lib/anisotropy.wgsl", include_str!("../../../shaders/lib/anisotropy.wgsl")),
    ("shaders/lib/brdf.wgsl", include_str!("../../../shaders/lib/brdf.wgsl")),
    ("shaders/lib/colour.wgsl", include_str!("../../../shaders/lib/colour.wgsl")),
    ("shaders/lib/constants.wgsl", include_str!("../../../shaders/lib/constants.wgsl")),
    ("shaders/lib/environment.wgsl", include_str!("../../../shaders/lib/environment.wgsl")),
    ("shaders/lib/frame.wgsl", include_str!("../../../shaders/lib/frame.wgsl")),
    ("shaders/lib/fullscreen.wgsl", include_str!("../../../shaders/lib/fullscreen.wgsl")),
    ("shaders/lib/iridescence.wgsl", include_str!("../../../shaders/lib/iridescence.wgsl")),
    ("shaders/lib/material.wgsl", include_str!("../../../shaders/lib/material.wgsl")),
    ("shaders/lib/sampling.wgsl", include_str!("../../../shaders/lib/sampling.wgsl")),
    ("shaders/lib/sheen.wgsl", include_str!("../../../shaders/lib/sheen.wgsl")),
    ("shaders/lib/sphere.wgsl", include_str!("../../../shaders/lib/sphere.wgsl")),
    ("shaders/lib/vector.wgsl", include_str!("../../../shaders/lib/vector.wgsl")),
    ("shaders/lib/volume.wgsl", include_str!("../../../shaders/lib/volume.wgsl")),
    ("shaders/pbr/background.wgsl", include_str!("../../../shaders/pbr/background.wgsl")),
    ("shaders/pbr/lobes.wgsl", include_str!("../../../shaders/pbr/lobes.wgsl")),
    ("shaders/pbr/pbr.wgsl", include_str!("../../../shaders/pbr/pbr.wgsl")),
    ("shaders/pbr/tonemap.wgsl", include_str!("../../../shaders/pbr/tonemap.wgsl")),
];
