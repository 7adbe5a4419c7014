// Layouts of the sphere: panorama, cube map, octahedral map, spherical harmonics. Right-handed, +Y up. Positions are
// measured from the top left; directions have unit length.

import lib::constants::PI;

// Direction seen at a panorama's position in [0, 1]²: the centre column looks along -Z, its right half towards +X, the top is +Y.
// Equirectangular projection; Snyder 1987, "Map Projections: A Working Manual", equations 12-1 and 12-2.
fn panorama_direction(uv: vec2f) -> vec3f {
    let theta = PI * uv.y;
    let phi = 2.0 * PI * (uv.x - 0.5);
    return vec3f(sin(theta) * sin(phi), cos(theta), -sin(theta) * cos(phi));
}

// Undoes panorama_direction. At the poles, where every u is right, u is 1/2.
fn panorama_uv(direction: vec3f) -> vec2f {
    let horizontal = length(direction.xz);
    let is_pole = horizontal < 1e-18;
    // atan2 has no value where both arguments are 0.
    let phi = atan2(select(direction.x, 0.0, is_pole), select(-direction.z, 1.0, is_pole));
    // By atan2 and not acos(y), which keeps half of the digits near the poles.
    let theta = atan2(horizontal, direction.y);
    return vec2f(0.5 + phi / (2.0 * PI), theta / PI);
}

// A place on a cube map: a face in KTX2's order +X -X +Y -Y +Z -Z and (s, t) in [-1, 1]².
struct CubePlace {
    face: u32,
    st: vec2f,
}

// Unit direction seen at (s, t) of a face. Vulkan 1.3 specification, table "Cube map face and coordinate selection".
fn cube_direction(face: u32, st: vec2f) -> vec3f {
    var d: vec3f;
    switch face {
        case 0u: { d = vec3f(1.0, -st.y, -st.x); }
        case 1u: { d = vec3f(-1.0, -st.y, st.x); }
        case 2u: { d = vec3f(st.x, 1.0, st.y); }
        case 3u: { d = vec3f(st.x, -1.0, -st.y); }
        case 4u: { d = vec3f(st.x, -st.y, 1.0); }
        default: { d = vec3f(-st.x, -st.y, -1.0); }
    }
    return d * inverseSqrt(1.0 + dot(st, st));
}

// Undoes cube_direction, for directions of any length but 0 (which is told to look along +Z). Where faces meet, Z wins over Y
// and Y over X, as Vulkan recommends.
fn cube_place(direction: vec3f) -> CubePlace {
    let d = direction;
    let size = abs(d);
    // An axis shorter than this is no axis: dividing by it would be dividing by 0.
    let axis = max(max(size.x, size.y), max(size.z, 1e-30));
    if size.z >= size.x && size.z >= size.y {
        let is_front = d.z >= 0.0;
        return CubePlace(select(5u, 4u, is_front), vec2f(select(-d.x, d.x, is_front), -d.y) / axis);
    }
    if size.y >= size.x {
        let is_up = d.y >= 0.0;
        return CubePlace(select(3u, 2u, is_up), vec2f(d.x, select(-d.z, d.z, is_up)) / axis);
    }
    let is_right = d.x >= 0.0;
    return CubePlace(select(1u, 0u, is_right), vec2f(select(d.z, -d.z, is_right), -d.y) / axis);
}

// (s, t) of the centre of a face's texel.
fn cube_texel_centre(texel: vec2u, face_size: u32) -> vec2f {
    return (2.0 * vec2f(texel) + 1.0) / f32(max(face_size, 1u)) - 1.0;
}

// Solid angle of a cube texel around (s, t), to second order in its size: its area (2 / size)² on the face times the Jacobian
// (1 + s² + t²)^(-3/2). Manson and Sloan 2016, "Fast Filtering of Reflection Probes", section 3.
fn cube_texel_solid_angle_sr(st: vec2f, face_size: u32) -> f32 {
    let edge = 2.0 / f32(max(face_size, 1u));
    let r = inverseSqrt(1.0 + dot(st, st));
    return edge * edge * r * r * r;
}

// Direction at a position of an octahedral map: +Y in the middle, +X at the right, -Z at the top. Engelhardt and Dachsbacher
// 2008, "Octahedron Environment Maps"; Cigolle et al. 2014, "A Survey of Efficient Representations for Independent Unit Vectors"
// (there with +Z up).
fn octahedral_direction(uv: vec2f) -> vec3f {
    let ab = 2.0 * uv - 1.0;
    let y = 1.0 - abs(ab.x) - abs(ab.y);
    let xz = select(octahedral_fold(ab), ab, y >= 0.0);
    // At least 1/√3 long.
    return normalize(vec3f(xz.x, y, xz.y));
}

// Undoes octahedral_direction, for directions of any length but 0.
fn octahedral_uv(direction: vec3f) -> vec2f {
    let norm = abs(direction.x) + abs(direction.y) + abs(direction.z);
    let ab = direction.xz / max(norm, 1e-30);
    return 0.5 * select(octahedral_fold(ab), ab, direction.y >= 0.0) + 0.5;
}

// Mirrors a triangle at the diamond's edge; its own inverse. (sign would be 0 on the axes.)
fn octahedral_fold(ab: vec2f) -> vec2f {
    return (1.0 - abs(ab.yx)) * select(vec2f(-1.0), vec2f(1.0), ab >= vec2f(0.0));
}

// Real spherical harmonics Y_lm of a unit direction at index l (l + 1) + m, l ≤ 2: orthonormal, without Condon-Shortley sign, polar
// axis z. Ramamoorthi and Hanrahan 2001, "An Efficient Representation for Irradiance Environment Maps", equation 3.
fn spherical_harmonics(direction: vec3f) -> array<f32, 9> {
    let x = direction.x;
    let y = direction.y;
    let z = direction.z;
    return array<f32, 9>(
        0.28209479,
        0.48860251 * y,
        0.48860251 * z,
        0.48860251 * x,
        1.09254843 * x * y,
        1.09254843 * y * z,
        // 3z² - 1 as 2z² - x² - y²: keeps its digits where it vanishes.
        0.31539157 * (2.0 * z * z - x * x - y * y),
        1.09254843 * x * z,
        0.54627422 * (x * x - y * y),
    );
}

// Σ c_lm Y_lm in a unit direction; may be negative where the light is strong on the other side.
fn evaluate_harmonics(coefficients: array<vec3f, 9>, direction: vec3f) -> vec3f {
    let c = coefficients;
    let basis = spherical_harmonics(direction);
    return c[0] * basis[0] + c[1] * basis[1] + c[2] * basis[2]
        + c[3] * basis[3] + c[4] * basis[4] + c[5] * basis[5]
        + c[6] * basis[6] + c[7] * basis[7] + c[8] * basis[8];
}

// Radiance up to degree 2 into irradiance over π in a direction: each degree times Lambert's 1, 2/3, 1/4. Ramamoorthi and Hanrahan
// 2001, equations 8 and 13, over π.
fn irradiance_of_harmonics(coefficients: array<vec3f, 9>, normal: vec3f) -> vec3f {
    let c = coefficients;
    let basis = spherical_harmonics(normal);
    let first = c[1] * basis[1] + c[2] * basis[2] + c[3] * basis[3];
    let second = c[4] * basis[4] + c[5] * basis[5] + c[6] * basis[6] + c[7] * basis[7] + c[8] * basis[8];
    return max(c[0] * basis[0] + first * (2.0 / 3.0) + second * 0.25, vec3f(0.0));
}
