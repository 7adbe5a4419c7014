// Reading material textures.

import lib::vector::normalize_or;

// Texture coordinate of a texture placed by two rows of a material: row.xyz transforms, u_row.w picks the
// UV set (0 or 1). KHR_texture_transform.
fn texture_coordinate(u_row: vec4f, v_row: vec4f, uv0: vec2f, uv1: vec2f) -> vec2f {
    let uv = vec3f(select(uv0, uv1, u_row.w > 0.5), 1.0);
    return vec2f(dot(u_row.xyz, uv), dot(v_row.xyz, uv));
}

// Interpolated vectors of a vertex's frame, not normalised, as MikkTSpace asks: the baker of the normal map
// interpolated them the same way. `tangent.w` is the bitangent's sign.
struct TangentFrame {
    normal: vec3f,
    tangent: vec4f,
}

// World normal of a normal map's texel, unit length. glTF 2.0, section 3.9.3: `scale` applies to x and y.
fn mapped_normal(tangent_frame: TangentFrame, texel: vec3f, scale: f32) -> vec3f {
    let n = tangent_frame.normal;
    let t = tangent_frame.tangent.xyz;
    let b = tangent_frame.tangent.w * cross(n, t);
    let m = (texel * 2.0 - 1.0) * vec3f(scale, scale, 1.0);
    // A mid-grey texel, or a vertex without a tangent, leaves the normal as it is.
    return normalize_or(m.x * t + m.y * b + m.z * n, normalize_or(n, vec3f(0.0, 1.0, 0.0)));
}

// Occlusion of mirror reflections by ambient occlusion. Lagarde and de Rousiers 2014.
fn specular_occlusion(n_dot_v: f32, occlusion: f32, alpha: f32) -> f32 {
    // pow has no value at 0; a fully occluded grazing view gives 0 or less, hence black, all the same.
    let base = max(n_dot_v + occlusion, 1e-6);
    return saturate(pow(base, exp2(-16.0 * alpha - 1.0)) - 1.0 + occlusion);
}
