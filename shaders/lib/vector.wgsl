// Vectors at the edge of their domain.

// v / |v|, or `otherwise` where v is too short to have a direction: below 1e-15 its squared length
// nears the smallest normal f32 (1.2e-38) and a GPU may flush it to zero.
fn normalize_or(v: vec3f, otherwise: vec3f) -> vec3f {
    let length_squared = dot(v, v);
    if length_squared < 1e-30 {
        return otherwise;
    }
    return v * inverseSqrt(length_squared);
}

fn max_component(v: vec3f) -> f32 {
    return max(v.x, max(v.y, v.z));
}

// (1 - x)^5 for x in [0, 1], by multiplications: pow is undefined at base 0.
fn one_minus_pow5(x: f32) -> f32 {
    let y = saturate(1.0 - x);
    let y2 = y * y;
    return y2 * y2 * y;
}
