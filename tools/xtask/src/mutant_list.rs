//! The guards that `cargo xtask mutants` takes away.

/// A guard and the same code without it.
pub(crate) struct Mutant {
    pub(crate) name: &'static str,
    pub(crate) file: &'static str,
    /// Text of the file; the first place counts.
    pub(crate) guard: &'static str,
    pub(crate) without: &'static str,
    /// Why no test can notice; empty where one must.
    pub(crate) unseen: &'static str,
}

impl Mutant {
    /// Whether it needs no compiler of ours.
    pub(crate) fn is_shader(&self) -> bool {
        self.file.ends_with(".wgsl")
    }
}

const fn mutant(
    name: &'static str,
    file: &'static str,
    guard: &'static str,
    without: &'static str,
) -> Mutant {
    Mutant { name, file, guard, without, unseen: "" }
}

impl Mutant {
    /// The same, known to change nothing that a test here could see.
    const fn unseen(self, why: &'static str) -> Mutant {
        Mutant { unseen: why, ..self }
    }
}

/// WGSL leaves the value open, and other devices have had NaN there.
const OPEN: &str = "WGSL leaves it open; llvmpipe has log(0) = -inf and goes on rightly";

const BRDF: &str = "shaders/lib/brdf.wgsl";
const SAMPLING: &str = "shaders/lib/sampling.wgsl";
const COLOUR: &str = "shaders/lib/colour.wgsl";
const ANISOTROPY: &str = "shaders/lib/anisotropy.wgsl";

pub(crate) const MUTANTS: [Mutant; 41] = [
    mutant("GGX: least α", BRDF, "let a = max(alpha, ALPHA_MIN);", "let a = alpha;"),
    mutant(
        "GGX: least denominator",
        BRDF,
        "a / max(a * a * n_dot_h * n_dot_h + n_cross_h_squared, ALPHA_MIN * ALPHA_MIN)",
        "a / (a * a * n_dot_h * n_dot_h + n_cross_h_squared)",
    ),
    mutant(
        "GGX: sin² from the cosine",
        BRDF,
        "max(a * a * n_dot_h * n_dot_h + n_cross_h_squared,",
        "max(a * a * n_dot_h * n_dot_h + 1.0 - n_dot_h * n_dot_h,",
    ),
    mutant(
        "Smith, correlated: least denominator",
        BRDF,
        "0.5 / max(light + view, GRAZING_MIN)",
        "0.5 / (light + view)",
    ),
    mutant(
        "Smith, separable: least denominator",
        BRDF,
        "1.0 / max(smith_half(n_dot_l, alpha) * smith_half(n_dot_v, alpha), GRAZING_MIN)",
        "1.0 / (smith_half(n_dot_l, alpha) * smith_half(n_dot_v, alpha))",
    ),
    mutant(
        "Schlick-GGX: least denominator",
        BRDF,
        "0.25 / max(light * view, GRAZING_MIN)",
        "0.25 / (light * view)",
    ),
    mutant("Charlie: least α", BRDF, "1.0 / max(alpha, ALPHA_MIN)", "1.0 / alpha"),
    mutant(
        "Charlie: least sin²",
        BRDF,
        "log2(max(n_cross_h_squared, 1.1754944e-38))",
        "log2(n_cross_h_squared)",
    )
    .unseen(OPEN),
    mutant(
        "Ashikhmin: least denominator",
        BRDF,
        "0.25 / max(n_dot_l + n_dot_v - n_dot_l * n_dot_v, GRAZING_MIN)",
        "0.25 / (n_dot_l + n_dot_v - n_dot_l * n_dot_v)",
    ),
    mutant(
        "Charlie's shadowing: least denominator",
        BRDF,
        "0.25 / max(shadowing * n_dot_l * n_dot_v, GRAZING_MIN)",
        "0.25 / (shadowing * n_dot_l * n_dot_v)",
    ),
    mutant("Charlie's shadowing: least base", BRDF, "pow(max(x, 1.1754944e-38), c)", "pow(x, c)")
        .unseen(OPEN),
    mutant("Schlick: cosine above one", "shaders/lib/vector.wgsl", "saturate(1.0 - x)", "1.0 - x"),
    mutant(
        "normalize_or: no length",
        "shaders/lib/vector.wgsl",
        "length_squared < 1e-30",
        "length_squared < 0.0",
    ),
    mutant(
        "radical inverse: 24 bits",
        SAMPLING,
        "f32(reverseBits(index) >> 8u) * 5.9604645e-8",
        "f32(reverseBits(index)) * 2.3283064e-10",
    ),
    mutant("Hammersley: count 0", SAMPLING, "f32(max(count, 1u))", "f32(count)"),
    mutant("basis: sign of z", SAMPLING, "select(-1.0, 1.0, normal.z >= 0.0)", "1.0"),
    mutant(
        "GGX sample: least α",
        SAMPLING,
        "let a = max(alpha, ALPHA_MIN);\n    let cosine2",
        "let a = alpha;\n    let cosine2",
    ),
    mutant(
        "GGX sample: least length",
        SAMPLING,
        "inverseSqrt(max(cosine2 + sine2, 1e-30))",
        "inverseSqrt(cosine2 + sine2)",
    )
    .unseen("the least α keeps the length above 0 already; this is for whoever lowers that"),
    mutant(
        "visible normals: least α",
        SAMPLING,
        "let a = max(alpha, ALPHA_MIN);\n    let stretched",
        "let a = alpha;\n    let stretched",
    ),
    mutant(
        "visible normals: sine of a rounded depth",
        SAMPLING,
        "sqrt(max(depth * (2.0 - depth), 0.0))",
        "sqrt(depth * (2.0 - depth))",
    )
    .unseen("only a view of rounded length and u next to 1 bring it below 0"),
    mutant(
        "visible normals: depth below the pole",
        SAMPLING,
        "let depth = u.y * (1.0 + stretched.z);",
        "let depth = 1.0 - ((1.0 - u.y) * (1.0 + stretched.z) - stretched.z);",
    ),
    mutant(
        "visible normals: least denominator",
        SAMPLING,
        "max(smith_half(n_dot_v, alpha), ALPHA_MIN)",
        "smith_half(n_dot_v, alpha)",
    ),
    mutant(
        "Charlie sample: least α",
        SAMPLING,
        "let a = max(alpha, ALPHA_MIN);\n    // ln sin",
        "let a = alpha;\n    // ln sin",
    ),
    mutant("Charlie sample: u of 0", SAMPLING, "log(max(u.y, 1.1754944e-38))", "log(u.y)").unseen(OPEN),
    mutant("brush: least widths", ANISOTROPY, "max(alpha_tb, vec2f(ALPHA_MIN))", "alpha_tb"),
    mutant(
        "brush: a half vector of less than unit length",
        ANISOTROPY,
        "max(dot(scaled, scaled), 1.0)",
        "dot(scaled, scaled)",
    ),
    mutant("brush: grazing", ANISOTROPY, "0.5 / max(light + view, GRAZING_MIN)", "0.5 / (light + view)"),
    mutant(
        "filter level: density of 0",
        "shaders/bake/source.wgsl",
        "1.0 / max(f32(count) * pdf, 1e-12)",
        "1.0 / (f32(count) * pdf)",
    ),
    mutant(
        "filter level: below level 0",
        "shaders/bake/source.wgsl",
        "return max(0.5 * log2(sample_sr / texel_sr) + bias, 0.0);",
        "return 0.5 * log2(sample_sr / texel_sr) + bias;",
    ),
    mutant("sRGB: out of range", COLOUR, "let x = saturate(linear);", "let x = linear;"),
    mutant("within f16", COLOUR, "clamp(radiance, vec3f(0.0), vec3f(65504.0))", "radiance"),
    mutant("ACES: squares of suns", COLOUR, "let x = min(v, vec3f(1e6));", "let x = v;"),
    mutant(
        "multiple scattering: all of it lost",
        "shaders/lib/environment.wgsl",
        "/ max(1.0 - f_average * missing, vec3f(1e-3))",
        "/ (1.0 - f_average * missing)",
    ),
    mutant(
        "half vector of no length",
        "shaders/lib/punctual.wgsl",
        "normalize_or(light + view, normal)",
        "normalize(light + view)",
    ),
    mutant(
        "Smith in f64: 0/0",
        "crates/kiln-brdf/src/lobes.rs",
        "smith_denominator(alpha, n_dot_v, n_dot_l).max(f64::MIN_POSITIVE)",
        "smith_denominator(alpha, n_dot_v, n_dot_l)",
    ),
    mutant(
        "radical inverse in f64: 24 bits",
        "crates/kiln-brdf/src/sampling.rs",
        "f64::from(index.reverse_bits() >> 8) / f64::from(1 << 24)",
        "f64::from(index.reverse_bits()) / 4294967295.0",
    ),
    mutant(
        "a chain of one level",
        "crates/kiln-bake/src/law.rs",
        "if level_count < 2 { 0.0 } else",
        "if level_count < 1 { 0.0 } else",
    ),
    mutant(
        "saturation of halves",
        "crates/kiln-bake/src/encode.rs",
        "f16::from_f64(value.clamp(low, high))",
        "f16::from_f64(value)",
    ),
    mutant(
        "scale of bright maps",
        "crates/kiln-bake/src/encode.rs",
        "while scaled > HALF_SAFE_MAX && s < 128",
        "while scaled > 1e30 && s < 128",
    ),
    mutant(
        "shared exponent: saturation",
        "crates/kiln-image/src/texel/rgb9e5.rs",
        ".max(0.0).min(f64::from(MAX))",
        ".max(0.0)",
    ),
    mutant(
        "limit of each channel",
        "crates/kiln-image/src/texels/limit.rs",
        "(f64::from(*value) * scale) as f32",
        "value.min(max)",
    ),
];
