// The environment's extracted sun and what stands before it. The shadow map takes the sun alone, never the environment.

import lib::frame::{sun, sun_shadow, sun_shadow_sampler};

// Half the width in texels of what `sun_visibility` reads: one tap to each side, each of which mixes two texels.
const SUN_FILTER_RADIUS: f32 = 2.0;

// Irradiance of a surface that faces the sun, behind what stands before it. `normal` is the surface's own, of unit length.
fn sunlight(position: vec3f, normal: vec3f) -> vec3f {
    let n_dot_l = dot(normal, sun.direction);
    // From a plane, a filter of r texels reaches r · tan(θ) deep along the light, and d along the normal lifts by d / cos(θ). The
    // diagonal is √2 longer; what is left of a texel is for curved surfaces.
    let sine = sqrt(saturate(1.0 - n_dot_l * n_dot_l));
    let lift = sun.shadow_texel * (1.4143 * SUN_FILTER_RADIUS * sine + 0.5);
    // Light from behind passes through the surface; its other side is what the map saw.
    let lifted = position + select(-lift, lift, n_dot_l >= 0.0) * normal;
    return sun_visibility((sun.shadow_from_world * vec4f(lifted, 1.0)).xyz) * sun.irradiance;
}

// Share of the sun that is seen, from 3 × 3 comparisons that mix 2 × 2 texels each (Reeves, Salesin and Cook 1987). What lies
// outside of the map is lit: everything that casts a shadow lies inside.
fn sun_visibility(place: vec3f) -> f32 {
    let texel = 1.0 / f32(textureDimensions(sun_shadow).x);
    // The map's farthest depth is 1, where nothing stands; so is what lies behind it.
    let depth = saturate(place.z);
    var sum = 0.0;
    for (var index = 0u; index < 9u; index++) {
        let offset = vec2f(f32(index % 3u), f32(index / 3u)) - vec2f(1.0);
        sum += textureSampleCompareLevel(sun_shadow, sun_shadow_sampler, place.xy + offset * texel, depth);
    }
    let is_inside = all(place.xy >= vec2f(0.0)) && all(place.xy <= vec2f(1.0));
    return select(1.0, sum / 9.0, is_inside);
}
