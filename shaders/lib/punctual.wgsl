// Light from points and from afar. KHR_lights_punctual. A light is an environment of one direction: what a lobe f makes of it is
// f · E · n·l, where the prefiltered maps hold the integral of f · L · n·l. Directions have unit length and point away from the surface.

import lib::anisotropy::{d_ggx_anisotropic, v_smith_anisotropic};
import lib::brdf::{d_charlie, d_ggx, v_ashikhmin, v_smith_height_correlated};
import lib::frame::PunctualLight;
import lib::vector::normalize_or;

// A mirror would show a point that no pixel hits. This alpha spreads it as wide as the sun's disc: a reflection turns by twice
// the half vector's 0.002 rad, which is 0.23°.
const ALPHA_PUNCTUAL_MIN: f32 = 0.002;

// Distances in world units, metres in glTF. Closer than a millimetre to a lamp one is inside of it; beyond 10⁹ its light is gone, and
// the product with 1 / range² stays an f32.
const DISTANCE_SQUARED_MIN: f32 = 1e-6;
const DISTANCE_SQUARED_MAX: f32 = 1e18;

// Width of a lobe under a punctual light.
fn punctual_alpha(perceptual_roughness: f32) -> f32 {
    return max(perceptual_roughness * perceptual_roughness, ALPHA_PUNCTUAL_MIN);
}

// Share of an intensity that arrives: 1 / d², windowed so that it ends at the range: max(min(1 - (d / range)⁴, 1), 0) / d².
fn distance_attenuation(distance_squared: f32, inverse_range_squared: f32) -> f32 {
    let d2 = clamp(distance_squared, DISTANCE_SQUARED_MIN, DISTANCE_SQUARED_MAX);
    let ratio = min(d2 * inverse_range_squared, 1.0);
    return (1.0 - ratio * ratio) / d2;
}

// Share of a spot's intensity `from_light` its axis: the squared ramp over cosines of KHR_lights_punctual. In 1 - cosine, which is
// half the squared chord: cosines near 1 have no digits left to tell the angles of narrow cones.
fn cone_attenuation(from_light: vec3f, axis: vec3f, outer_versine: f32, scale: f32) -> f32 {
    let chord = from_light - axis;
    let ramp = saturate((outer_versine - 0.5 * dot(chord, chord)) * scale);
    return ramp * ramp;
}

// What arrives of a light: where it comes from, and the irradiance of a surface that faces it.
struct IncidentLight {
    direction: vec3f,
    irradiance: vec3f,
}

fn incident_light(light: PunctualLight, position: vec3f) -> IncidentLight {
    let to_light = light.position.xyz - light.position.w * position;
    let direction = normalize_or(to_light, -light.direction);
    if light.position.w == 0.0 {
        return IncidentLight(direction, light.intensity);
    }
    let share = distance_attenuation(dot(to_light, to_light), light.inverse_range_squared)
        * cone_attenuation(-direction, light.direction, light.outer_versine, light.cone_scale);
    return IncidentLight(direction, share * light.intensity);
}

// Opposite directions have none of their own; the normal's lobe is then as good as any, for n·l or n·v is 0 or less.
fn half_vector(light: vec3f, view: vec3f, normal: vec3f) -> vec3f {
    return normalize_or(light + view, normal);
}

// D · V · n·l of GGX, to be multiplied by Fresnel's term; 0 behind the surface.
fn ggx_reflected(normal: vec3f, view: vec3f, light: vec3f, alpha: f32) -> f32 {
    let n_dot_l = saturate(dot(normal, light));
    let h = half_vector(light, view, normal);
    let n_cross_h = cross(normal, h);
    let d = d_ggx(saturate(dot(normal, h)), dot(n_cross_h, n_cross_h), alpha);
    return n_dot_l * d * v_smith_height_correlated(n_dot_l, saturate(dot(normal, view)), alpha);
}

// The same of a brushed surface, in the frame of its brush: tangent, bitangent, normal.
fn ggx_reflected_anisotropic(tbn_v: vec3f, tbn_l: vec3f, alpha_tb: vec2f) -> f32 {
    let h = half_vector(tbn_l, tbn_v, vec3f(0.0, 0.0, 1.0));
    let n_dot_l = saturate(tbn_l.z);
    let v = v_smith_anisotropic(vec3f(tbn_l.xy, n_dot_l), vec3f(tbn_v.xy, saturate(tbn_v.z)), alpha_tb);
    return n_dot_l * d_ggx_anisotropic(h, alpha_tb) * v;
}

// GGX of light from behind a thin wall, as KHR_materials_transmission has it: what a light mirrored to the front would reflect.
fn ggx_transmitted(normal: vec3f, view: vec3f, light: vec3f, alpha: f32) -> f32 {
    return ggx_reflected(normal, view, reflect(light, normal), alpha);
}

// D · V · n·l of cloth: Charlie's distribution with the visibility that the albedo table was made with.
fn charlie_reflected(normal: vec3f, view: vec3f, light: vec3f, alpha: f32) -> f32 {
    let n_dot_l = saturate(dot(normal, light));
    let n_cross_h = cross(normal, half_vector(light, view, normal));
    let d = d_charlie(saturate(dot(n_cross_h, n_cross_h)), alpha);
    return n_dot_l * d * v_ashikhmin(n_dot_l, saturate(dot(normal, view)));
}
