// What the material's functions tell of a fragment when it is looked into, and the channel of it that is asked for. Every lobe is what it
// adds to the picture, what lies above it taken off: they sum up to the radiance.

import lib::inspect::{CHANNEL_ALPHA, CHANNEL_BASE_COLOR, CHANNEL_FAULTS, CHANNEL_MIP, CHANNEL_UV0, CHANNEL_UV1, CHANNEL_VARIANT};
import lib::inspect::{faults, inspect};
@if(!unlit) import lib::inspect::{CHANNEL_CLEARCOAT, CHANNEL_DIFFUSE, CHANNEL_EMISSION, CHANNEL_F0, CHANNEL_GEOMETRIC_NORMAL};
@if(!unlit) import lib::inspect::{CHANNEL_METALNESS, CHANNEL_OCCLUSION, CHANNEL_PUNCTUAL, CHANNEL_ROUGHNESS};
@if(!unlit) import lib::inspect::{CHANNEL_SHADING_NORMAL, CHANNEL_SHEEN, CHANNEL_SPECULAR, CHANNEL_TANGENT, CHANNEL_TRANSMISSION};

struct Seen {
    base_color: vec4f,
    uv0: vec2f,
    uv1: vec2f,
    mip: f32,
    @if(!unlit) roughness: f32,
    @if(!unlit) metalness: f32,
    @if(!unlit) occlusion: f32,
    @if(!unlit) f0: vec3f,
    @if(!unlit) geometric_normal: vec3f,
    @if(!unlit) shading_normal: vec3f,
    @if((anisotropy || clearcoat || normal_map) && !unlit) tangent: vec3f,
    @if(!unlit) lobes: Lobes,
}

@if(!unlit)
struct Lobes {
    diffuse: vec3f,
    specular: vec3f,
    transmission: vec3f,
    sheen: vec3f,
    emission: vec3f,
    clearcoat: vec3f,
    // The share of all of them that the scene's own lights and the sun have.
    punctual: vec3f,
}

var<private> seen: Seen;

// A layer above leaves this share of the lobes so far.
@if(!unlit)
fn cover(left: f32) {
    seen.lobes.diffuse *= left;
    seen.lobes.specular *= left;
    seen.lobes.transmission *= left;
    seen.lobes.sheen *= left;
    seen.lobes.emission *= left;
    seen.lobes.punctual *= left;
}

// With alpha 0 where this variant has no such value: nothing is drawn there then.
// `pixel` is where it is, in pixels.
fn inspected(radiance: vec3f, alpha: f32, pixel: vec2f) -> vec4f {
    // Pixels are not negative: this is the channel. Why it is asked of them too, `pbr::tonemap` says.
    let channel = inspect.channel + u32(max(-pixel.x, 0.0));
    switch channel {
        case CHANNEL_FAULTS: { return faults(radiance, inspect.radiance_max); }
        case CHANNEL_BASE_COLOR: { return vec4f(seen.base_color.rgb, 1.0); }
        case CHANNEL_ALPHA: { return vec4f(vec3f(seen.base_color.a), 1.0); }
        case CHANNEL_UV0: { return vec4f(seen.uv0, 0.0, 1.0); }
        case CHANNEL_UV1: { return vec4f(seen.uv1, 0.0, 1.0); }
        case CHANNEL_MIP: { return vec4f(vec3f(seen.mip), 1.0); }
        case CHANNEL_VARIANT: { return vec4f(inspect.variant_color, 1.0); }
        default: {
            @if(unlit) return vec4f(0.0);
            @else return inspected_lit(channel, alpha);
        }
    }
}

@if(!unlit)
fn inspected_lit(channel: u32, alpha: f32) -> vec4f {
    switch channel {
        case CHANNEL_ROUGHNESS: { return vec4f(vec3f(seen.roughness), 1.0); }
        case CHANNEL_METALNESS: { return vec4f(vec3f(seen.metalness), 1.0); }
        case CHANNEL_OCCLUSION: { return vec4f(vec3f(seen.occlusion), 1.0); }
        case CHANNEL_F0: { return vec4f(seen.f0, 1.0); }
        case CHANNEL_GEOMETRIC_NORMAL: { return vec4f(seen.geometric_normal, 1.0); }
        case CHANNEL_SHADING_NORMAL: { return vec4f(seen.shading_normal, 1.0); }
        case CHANNEL_TANGENT: {
            @if(anisotropy || clearcoat || normal_map) return vec4f(seen.tangent, 1.0);
            @else return vec4f(0.0);
        }
        case CHANNEL_EMISSION: { return vec4f(seen.lobes.emission, alpha); }
        case CHANNEL_DIFFUSE: { return vec4f(seen.lobes.diffuse, alpha); }
        case CHANNEL_SPECULAR: { return vec4f(seen.lobes.specular, alpha); }
        case CHANNEL_CLEARCOAT: { return vec4f(seen.lobes.clearcoat, alpha); }
        case CHANNEL_SHEEN: { return vec4f(seen.lobes.sheen, alpha); }
        case CHANNEL_TRANSMISSION: { return vec4f(seen.lobes.transmission, alpha); }
        case CHANNEL_PUNCTUAL: { return vec4f(seen.lobes.punctual, alpha); }
        default: { return vec4f(0.0); }
    }
}
