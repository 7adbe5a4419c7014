// The split sum's table by importance sampling: x = n·v, y = perceptual roughness, at texel centres; red = scale, green = bias.
// Karis 2013, "Real Shading in Unreal Engine 4", section "Environment BRDF". 1024 samples leave 1e-2 at grazing views;
// `kiln bake` integrates to 1e-5. The feature `schlick` takes Schlick's masking with k = alpha / 2, as tutorials do; `separable`
// takes Smith's for both directions apart.

@if(schlick) import lib::brdf::{schlick_k_environment, v_schlick_ggx};
@if(separable) import lib::brdf::v_smith_separable;
@if(!schlick && !separable) import lib::brdf::v_smith_height_correlated;
import lib::sampling::{hammersley, sample_ggx, spherical_direction};
import lib::vector::one_minus_pow5;

struct Settings {
    sample_count: u32,
    // Azimuth of the view in the samples' frame, as a share of a turn: 0 here, 1/4 in tutorials, jittered in some.
    view_turn: f32,
}

@group(0) @binding(0) var table: texture_storage_2d<rgba32float, write>;
@group(0) @binding(1) var<uniform> settings: Settings;

@if(schlick)
fn visibility(n_dot_l: f32, n_dot_v: f32, alpha: f32) -> f32 {
    return v_schlick_ggx(n_dot_l, n_dot_v, schlick_k_environment(alpha));
}
@if(separable)
fn visibility(n_dot_l: f32, n_dot_v: f32, alpha: f32) -> f32 {
    return v_smith_separable(n_dot_l, n_dot_v, alpha);
}
@if(!schlick && !separable)
fn visibility(n_dot_l: f32, n_dot_v: f32, alpha: f32) -> f32 {
    return v_smith_height_correlated(n_dot_l, n_dot_v, alpha);
}

// Means of 4 V (n·l) (v·h) / (n·h), split by Schlick's weight (1 - v·h)⁵.
fn scale_bias(n_dot_v: f32, perceptual_roughness: f32) -> vec2f {
    let alpha = clamp(perceptual_roughness * perceptual_roughness, 1e-6, 1.0);
    let sine = sqrt(saturate((1.0 - n_dot_v) * (1.0 + n_dot_v)));
    let view = spherical_direction(sine, n_dot_v, settings.view_turn);
    let count = max(settings.sample_count, 1u);
    var sum = vec2f(0.0);
    for (var i = 0u; i < count; i++) {
        let h = sample_ggx(hammersley(i, count), alpha);
        let v_dot_h = saturate(dot(view, h));
        let n_dot_l = 2.0 * v_dot_h * h.z - n_dot_v;
        if n_dot_l > 0.0 {
            let weight = 4.0 * visibility(n_dot_l, n_dot_v, alpha) * n_dot_l * v_dot_h / max(h.z, 1e-6);
            let fresnel = one_minus_pow5(v_dot_h);
            sum += weight * vec2f(1.0 - fresnel, fresnel);
        }
    }
    return sum / f32(count);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(table);
    if all(id.xy < size) {
        let at = (vec2f(id.xy) + 0.5) / vec2f(size);
        textureStore(table, id.xy, vec4f(scale_bias(at.x, at.y), 0.0, 1.0));
    }
}
