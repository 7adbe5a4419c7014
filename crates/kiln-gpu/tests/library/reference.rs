//! Lobes in `f64` that no crate has, in another form than the shaders' where there is one.

use std::f64::consts::PI;

/// (1 − x)⁵ of a cosine that may have been rounded above 1.
pub fn weight(x: f64) -> f64 {
    (1.0 - x).clamp(0.0, 1.0).powi(5)
}

/// Smith's Λ of GGX from tan²θ · α² (Walter et al. 2007; Heitz 2014, eq. 72).
pub fn lambda(tan2_alpha2: f64) -> f64 {
    // (√(1 + x) − 1)/2 without a difference.
    0.5 * tan2_alpha2 / (1.0 + (1.0 + tan2_alpha2).sqrt())
}

/// tan²θ α² of a direction in the frame of a brush.
pub fn stretched([x, y, z]: [f64; 3], [a, b]: [f64; 2]) -> f64 {
    (a * a * x * x + b * b * y * y) / (z * z)
}

/// tan²θ α² of a cosine.
pub fn isotropic(cosine: f64, alpha: f64) -> f64 {
    alpha * alpha * ((1.0 - cosine) * (1.0 + cosine)).max(0.0) / (cosine * cosine)
}

pub fn d_anisotropic([x, y, z]: [f64; 3], [a, b]: [f64; 2]) -> f64 {
    // Burley 2012: sin² and cos² of the azimuth over the widths, plus cos²θ.
    let sum = x * x / (a * a) + y * y / (b * b) + z * z;
    1.0 / (PI * a * b * sum * sum)
}

/// Disney's diffuse lobe with F_D90, as the course notes have it.
pub fn burley(n_dot_l: f64, n_dot_v: f64, v_dot_h: f64, roughness: f64) -> f64 {
    let f_d90 = 0.5 + 2.0 * v_dot_h * v_dot_h * roughness;
    (1.0 + (f_d90 - 1.0) * weight(n_dot_l)) * (1.0 + (f_d90 - 1.0) * weight(n_dot_v)) / PI
}

/// Fresnel's equations by Snell's law.
pub fn f_dielectric(cosine: f64, ior: f64) -> f64 {
    let c = cosine.clamp(0.0, 1.0);
    let sin2_inside = (1.0 - c * c) / (ior * ior);
    if sin2_inside >= 1.0 {
        return 1.0;
    }
    let inside = (1.0 - sin2_inside).sqrt();
    let s = (c - ior * inside) / (c + ior * inside);
    let p = (ior * c - inside) / (ior * c + inside);
    0.5 * (s * s + p * p)
}

/// Λ of Charlie with the parameters of Estevez and Kulla 2017, table 1.
pub fn charlie_lambda(cosine: f64, alpha: f64) -> f64 {
    let l = |x: f64| {
        let t = (1.0 - alpha) * (1.0 - alpha);
        let [a, b, c, d, e] = [
            [25.3245, 21.5473],
            [3.32435, 3.82987],
            [0.16801, 0.19823],
            [-1.27393, -1.97760],
            [-4.85967, -4.32054],
        ]
        .map(|[smooth, rough]| t * smooth + (1.0 - t) * rough);
        a / (1.0 + b * x.powf(c)) + d * x + e
    };
    if cosine < 0.5 { l(cosine).exp() } else { (2.0 * l(0.5) - l(1.0 - cosine)).exp() }
}

/// A thin film's reflectance; as the shader has it, in f64.
pub fn iridescence(cosine: f64, base_f0: [f64; 3], film_ior: f64, thickness_nm: f64) -> [f64; 3] {
    let cosine = cosine.clamp(0.0, 1.0);
    let t = (thickness_nm / 0.03).clamp(0.0, 1.0);
    let ior = 1.0 + (film_ior - 1.0) * (t * t * (3.0 - 2.0 * t));
    let inside2 = 1.0 - (1.0 - cosine * cosine) / (ior * ior);
    if inside2 < 0.0 {
        return [1.0; 3];
    }
    let inside = inside2.sqrt();
    let f0 = |far: f64, near: f64| ((far - near) / (far + near)).powi(2);
    let schlick = |f0: f64, cosine: f64| f0 + (1.0 - f0) * weight(cosine);
    let r12 = schlick(f0(ior, 1.0), cosine);
    let path = 2.0 * ior * thickness_nm * inside;
    let channel = |i: usize| {
        let root = base_f0[i].clamp(0.0, 0.9999).sqrt();
        let base_ior = (1.0 + root) / (1.0 - root);
        let r23 = schlick(f0(base_ior, ior), inside);
        let phase = if ior < 1.0 { 0.0 } else { PI } + if base_ior < ior { PI } else { 0.0 };
        let r123 = (r12 * r23).clamp(1e-5, 0.9999);
        (r23, r123, phase)
    };
    let channels: [(f64, f64, f64); 3] = std::array::from_fn(channel);
    let mut sum = channels.map(|(r23, r123, _)| r12 + (1.0 - r12).powi(2) * r23 / (1.0 - r123));
    for bounce in 1..=2 {
        let m = f64::from(bounce);
        let seen = sensitivity(m * path, channels.map(|(_, _, phase)| m * phase));
        for i in 0..3 {
            let (r23, r123, _) = channels[i];
            let r_s = (1.0 - r12).powi(2) * r23 / (1.0 - r123);
            sum[i] += 2.0 * (r_s - (1.0 - r12)) * r123.sqrt().powi(bounce) * seen[i];
        }
    }
    sum.map(|value| value.max(0.0))
}

fn sensitivity(path_nm: f64, shift: [f64; 3]) -> [f64; 3] {
    let phase = 2.0 * PI * path_nm * 1e-9;
    let peak = |height: f64, position: f64, variance: f64, shift: f64| {
        height
            * (2.0 * PI * variance).sqrt()
            * (position * phase + shift).cos()
            * (-variance * phase * phase).exp()
    };
    let xyz = [
        peak(5.4856e-13, 1.6810e6, 4.3278e9, shift[0]) + peak(9.7470e-14, 2.2399e6, 4.5282e9, shift[0]),
        peak(4.4201e-13, 1.7953e6, 9.3046e9, shift[1]),
        peak(5.2481e-13, 2.2084e6, 6.6121e9, shift[2]),
    ];
    const REC709: [[f64; 3]; 3] = [
        [3.2404542, -1.5371385, -0.4985314],
        [-0.9692660, 1.8760108, 0.0415560],
        [0.0556434, -0.2040259, 1.0572252],
    ];
    REC709.map(|row| row.iter().zip(xyz).map(|(weight, value)| weight * value / 1.0685e-7).sum())
}
