// Light from the environment: prefiltered maps and the split sum.

import lib::frame::{frame, env_irradiance, env_sampler, env_sheen, env_skybox, env_specular};
import lib::frame::{lut_charlie, lut_ggx, lut_sampler};

// Lookup direction of a world direction; need not have unit length.
fn environment_direction(direction: vec3f) -> vec3f {
    return (frame.environment_from_world * vec4f(direction, 0.0)).xyz;
}

// Radiance of the unfiltered environment.
fn skybox_radiance(direction: vec3f) -> vec3f {
    let texel = textureSampleLevel(env_skybox, env_sampler, environment_direction(direction), 0.0);
    return texel.rgb * (frame.skybox_scale * frame.environment_intensity);
}

// Irradiance over π around a normal: what a white Lambert surface radiates.
fn irradiance_over_pi(normal: vec3f) -> vec3f {
    let texel = textureSampleLevel(env_irradiance, env_sampler, environment_direction(normal), 0.0);
    return texel.rgb * (frame.irradiance_scale * frame.environment_intensity);
}

// Radiance convolved with the GGX lobe of a perceptual roughness.
fn specular_radiance(direction: vec3f, perceptual_roughness: f32) -> vec3f {
    let level = perceptual_roughness * frame.specular_level_max;
    let texel = textureSampleLevel(env_specular, env_sampler, environment_direction(direction), level);
    return texel.rgb * (frame.specular_scale * frame.environment_intensity);
}

// Radiance convolved with the Charlie lobe of a perceptual roughness. Its chain has the scale of the other.
fn sheen_radiance(direction: vec3f, perceptual_roughness: f32) -> vec3f {
    let level = perceptual_roughness * frame.specular_level_max;
    let texel = textureSampleLevel(env_sheen, env_sampler, environment_direction(direction), level);
    return texel.rgb * (frame.specular_scale * frame.environment_intensity);
}

// Directional albedo of the Charlie lobe. The model gives more light than it gets at grazing views of smooth fibres:
// no more is taken from below than there is.
fn sheen_albedo(n_dot_v: f32, perceptual_roughness: f32) -> f32 {
    return min(textureSampleLevel(lut_charlie, lut_sampler, vec2f(n_dot_v, perceptual_roughness), 0.0).r, 1.0);
}

// Where the lobe around the mirror direction r has its weight: rough lobes lean towards the normal.
// Lagarde and de Rousiers 2014, "Moving Frostbite to Physically Based Rendering". Not normalised.
fn dominant_direction(normal: vec3f, r: vec3f, perceptual_roughness: f32) -> vec3f {
    let alpha = perceptual_roughness * perceptual_roughness;
    // saturate: an alpha rounded above 1 would leave the square root's domain.
    let smoothness = saturate(1.0 - alpha);
    return mix(normal, r, smoothness * (sqrt(smoothness) + alpha));
}

// Scale and bias of the split sum: directional albedo = f0 · x + f90 · y.
fn ggx_scale_bias(n_dot_v: f32, perceptual_roughness: f32) -> vec2f {
    return textureSampleLevel(lut_ggx, lut_sampler, vec2f(n_dot_v, perceptual_roughness), 0.0).rg;
}

// Directional albedos of a GGX lobe: light that left after one bounce, and after several.
struct GgxAlbedo {
    single: vec3f,
    multiple: vec3f,
}

// Fdez-Agüera 2019, "A Multiple-Scattering Microfacet Model for Real-Time Image-based Lighting" (JCGT 8(1)).
// Single scattering is f0 · scale + f90 · bias alone: the table integrates Schlick's
// term already, so the roughness-dependent Fresnel of the paper's listing would count grazing light twice.
fn ggx_albedo(f0: vec3f, f90: f32, scale_bias: vec2f) -> GgxAlbedo {
    let single = f0 * scale_bias.x + f90 * scale_bias.y;
    // Rounding of the table may put the sum a little above 1, and energy cannot be negative.
    let missing = max(1.0 - (scale_bias.x + scale_bias.y), 0.0);
    // Average of Schlick's term over the hemisphere.
    let f_average = f0 + (vec3f(f90) - f0) / 21.0;
    // The sum of a series over bounces. Its denominator is at least scale + bias, which no roughness brings
    // below 0.3; the bound keeps a table of zeros, bound before the first bake, from dividing zero by zero.
    let multiple = single * f_average * missing / max(1.0 - f_average * missing, vec3f(1e-3));
    return GgxAlbedo(single, multiple);
}
