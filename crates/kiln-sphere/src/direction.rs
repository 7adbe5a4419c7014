//! Directions of the two texel layouts: equirectangular panorama and cube map.

use std::f64::consts::PI;

/// Direction seen at the panorama position (`u`, `v`), both in [0, 1].
///
/// `u` = 0.5 looks along −Z and 0.75 along +X; `v` = 0 is +Y and 1 is −Y. Of unit length up to rounding.
pub fn panorama_direction(u: f64, v: f64) -> [f64; 3] {
    let (sin_theta, cos_theta) = libm::sincos(PI * v);
    let (sin_phi, cos_phi) = libm::sincos(2.0 * PI * (u - 0.5));
    [sin_theta * sin_phi, cos_theta, -sin_theta * cos_phi]
}

/// Panorama position of a direction of any length but zero; undoes [`panorama_direction`].
///
/// Returns (`u`, `v`) in [0, 1]². At the poles, where every `u` is right, `u` is 0.5.
pub fn panorama_uv(direction: [f64; 3]) -> [f64; 2] {
    let [x, y, z] = direction;
    let horizontal = libm::hypot(x, z);
    let phi = if horizontal > 0.0 { libm::atan2(x, -z) } else { 0.0 };
    [0.5 + phi / (2.0 * PI), libm::atan2(horizontal, y) / PI]
}

/// Unit direction seen at (`s`, `t`) in [−1, 1]² of a cube face, from the face's top left.
///
/// Faces in KTX2 order +X −X +Y −Y +Z −Z, oriented as Vulkan samples them (Vulkan 1.3 specification,
/// table "Cube map face and coordinate selection"). Panics if `face` is not below 6.
pub fn cube_direction(face: usize, s: f64, t: f64) -> [f64; 3] {
    let [x, y, z] = match face {
        0 => [1.0, -t, -s],
        1 => [-1.0, -t, s],
        2 => [s, 1.0, t],
        3 => [s, -1.0, -t],
        4 => [s, -t, 1.0],
        5 => [-s, -t, -1.0],
        _ => panic!("a cube has 6 faces, asked for face {face}"),
    };
    let inverse_length = 1.0 / (1.0 + s * s + t * t).sqrt();
    [x * inverse_length, y * inverse_length, z * inverse_length]
}

/// Face and (`s`, `t`) at which a direction of any length but zero meets the cube; undoes [`cube_direction`].
///
/// Where faces meet, Z wins over Y and Y over X, as Vulkan recommends.
pub fn cube_face_st(direction: [f64; 3]) -> (usize, [f64; 2]) {
    let [x, y, z] = direction;
    let (ax, ay, az) = (x.abs(), y.abs(), z.abs());
    if az >= ax && az >= ay {
        let s = if z >= 0.0 { x } else { -x };
        (if z >= 0.0 { 4 } else { 5 }, [s / az, -y / az])
    } else if ay >= ax {
        let t = if y >= 0.0 { z } else { -z };
        (if y >= 0.0 { 2 } else { 3 }, [x / ay, t / ay])
    } else {
        let s = if x >= 0.0 { -z } else { z };
        (if x >= 0.0 { 0 } else { 1 }, [s / ax, -y / ax])
    }
}

/// (`s` or `t`) of the centre of texel `index` in a row of `face_size` texels.
pub fn cube_texel_centre(face_size: usize, index: usize) -> f64 {
    (2 * index + 1) as f64 / face_size as f64 - 1.0
}

/// Solid angle of texel (`x`, `y`) of a cube face with `face_size` texels along its edge; the same on all
/// faces. The texels of the six faces sum to 4π.
///
/// The corner integral is atan(s t / √(1 + s² + t²)), the solid angle of the rectangle from the face's
/// centre to (s, t); the texel is the alternating sum over its four corners.
pub fn cube_texel_solid_angle_sr(face_size: usize, x: usize, y: usize) -> f64 {
    let edge = |index: usize| 2.0 * index as f64 / face_size as f64 - 1.0;
    let corner = |s: f64, t: f64| libm::atan2(s * t, (1.0 + s * s + t * t).sqrt());
    let (s0, s1, t0, t1) = (edge(x), edge(x + 1), edge(y), edge(y + 1));
    corner(s0, t0) - corner(s1, t0) - corner(s0, t1) + corner(s1, t1)
}

/// The solid angles of all texels of a face, for those who need many: see [`cube_texel_solid_angle_sr`].
pub struct CubeSolidAngles {
    /// The corner integral at (s, t) of edges (x, y), both from the face's centre outwards.
    corners: Vec<f64>,
    face_size: usize,
}

impl CubeSolidAngles {
    /// Of faces with `face_size` texels along their edges.
    pub fn new(face_size: usize) -> Self {
        let edge = |index: usize| 2.0 * index as f64 / face_size as f64 - 1.0;
        let half = face_size / 2;
        let stride = face_size + 1;
        let mut corners = vec![0.0; stride * stride];
        // The integral is odd in s and in t and does not change when they are swapped.
        for y in half..=face_size {
            for x in y..=face_size {
                let (s, t) = (edge(x), edge(y));
                let value = libm::atan2(s * t, (1.0 + s * s + t * t).sqrt());
                for (x, y) in [(x, y), (y, x)] {
                    let (mirrored_x, mirrored_y) = (face_size - x, face_size - y);
                    corners[y * stride + x] = value;
                    corners[y * stride + mirrored_x] = -value;
                    corners[mirrored_y * stride + x] = -value;
                    corners[mirrored_y * stride + mirrored_x] = value;
                }
            }
        }
        Self { corners, face_size }
    }

    /// Of texel (`x`, `y`), in steradians.
    #[inline]
    pub fn at(&self, x: usize, y: usize) -> f64 {
        let stride = self.face_size + 1;
        let corner = |x: usize, y: usize| self.corners[y * stride + x];
        corner(x, y) - corner(x + 1, y) - corner(x, y + 1) + corner(x + 1, y + 1)
    }
}
