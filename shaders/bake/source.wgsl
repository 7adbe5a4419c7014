// What a pass reads: an environment as a cube map with mips, and how far up to read it.

import lib::constants::PI;

@group(0) @binding(1) var environment: texture_cube<f32>;
@group(0) @binding(2) var environment_sampler: sampler;

fn environment_radiance(direction: vec3f, level: f32) -> vec3f {
    return textureSampleLevel(environment, environment_sampler, direction, level).rgb;
}

// The level whose texels are as large as the share of the sphere that one of `count` samples of density `pdf` stands for.
// Colbert and Křivánek 2007, "GPU-Based Importance Sampling" (GPU Gems 3, chapter 20), section 20.4; `bias` is 1 in Křivánek and
// Colbert 2008, "Real-Time Shading with Filtered Importance Sampling", and 0 in most tutorials.
fn filter_level(pdf: f32, count: u32, bias: f32) -> f32 {
    let size = f32(textureDimensions(environment).x);
    let texel_sr = 4.0 * PI / (6.0 * size * size);
    // Where no sample falls the density is 0, and so is what it stands for.
    let sample_sr = 1.0 / max(f32(count) * pdf, 1e-12);
    // kiln: allow(domain) the density has an end: no sample stands for less than 1e-12 of a texel
    return max(0.5 * log2(sample_sr / texel_sr) + bias, 0.0);
}
