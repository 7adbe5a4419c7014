//! What a file may ask for before it is refused: a few bytes of JSON can claim terabytes.

/// Most vertices of all distinct primitives together, after strips are split and seams are cut (1.2 GB).
pub const VERTEX_COUNT_MAX: usize = 1 << 24;
/// Most indices of all distinct primitives together.
pub const INDEX_COUNT_MAX: usize = 1 << 26;
/// Most draws: instances times primitives.
pub const DRAW_COUNT_MAX: usize = 1 << 16;
/// Most vertex-times-morph-target and vertex-times-joint steps; bounds the time a file can take.
pub const POSE_STEP_COUNT_MAX: usize = 1 << 28;
/// Largest edge of an image in texels; what every wgpu adapter of the default limits takes is half of it.
pub const IMAGE_EDGE_MAX: u32 = 16_384;
/// Most texels of all used images together (1 GB decoded).
pub const TEXEL_COUNT_MAX: usize = 1 << 28;
/// Most bytes of JSON text.
pub const JSON_BYTES_MAX: usize = 1 << 28;
/// Most objects in the JSON text; sixteen for each of the most draws.
pub const JSON_OBJECT_COUNT_MAX: usize = 1 << 20;
/// Most materials, which are the largest entries of all tables (2 KB).
pub const MATERIAL_COUNT_MAX: usize = 1 << 16;
/// Most values in the JSON text, which has no vertices in it.
pub const JSON_VALUE_COUNT_MAX: usize = 1 << 23;
/// Most notes kept; a file with more repeats itself.
pub const NOTE_COUNT_MAX: usize = 256;
/// Most channels of all animations together.
pub const CHANNEL_COUNT_MAX: usize = 1 << 16;
/// Most times and values of all curves together (128 MB): channels may name one accessor many times.
pub const CURVE_VALUE_COUNT_MAX: usize = 1 << 25;
/// Most joints of a skin; vertices name them by 16 bits.
pub const JOINT_COUNT_MAX: usize = 1 << 16;
/// Most vertices of all morph targets together (600 MB).
pub const MORPH_DELTA_COUNT_MAX: usize = 1 << 24;
/// Most instances of all draws together (40 MB).
pub const INSTANCE_COUNT_MAX: usize = 1 << 20;
