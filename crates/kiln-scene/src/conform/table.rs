//! Properties of glTF 2.0 and what their values must be, as tables.
//!
//! Source: Khronos glTF 2.0 specification, chapter 5 (properties reference), and the extension registry.

use std::fmt;

/// What a value must be.
pub(super) enum Kind {
    Any,
    Bool,
    Text,
    OneOf(&'static [&'static str]),
    Codes(&'static [u32]),
    Number(Number),
    /// Into this table of the file.
    Index(&'static str),
    /// Of so many entries at least.
    List(&'static Kind, usize),
    /// Free names, at least one.
    Map(&'static Kind),
    /// The name says where extensions may stand.
    Object(&'static str, &'static [Property]),
}

impl Kind {
    pub fn words(&self) -> &'static str {
        match self {
            Kind::Any => "anything",
            Kind::Bool => "true or false",
            Kind::Text | Kind::OneOf(_) => "a text",
            Kind::Codes(_) | Kind::Number(_) => "a number",
            Kind::Index(_) => "an index",
            Kind::List(..) => "a list",
            Kind::Map(_) | Kind::Object(..) => "an object",
        }
    }
}

/// The numbers that a property may have.
pub(super) struct Number {
    min: f64,
    max: f64,
    /// Whether `min` itself is excluded.
    above: bool,
    /// 0: any number.
    step: f64,
    /// Outside the interval, but allowed.
    or: Option<f64>,
}

impl Number {
    pub fn holds(&self, number: f64) -> bool {
        let inside = number <= self.max && if self.above { number > self.min } else { number >= self.min };
        let stepped = self.step == 0.0 || number % self.step == 0.0;
        inside && stepped || self.or == Some(number)
    }
}

impl fmt::Display for Number {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let least = if self.above { "more than" } else { "at least" };
        write!(formatter, "{least} {}", self.min)?;
        if self.max.is_finite() {
            write!(formatter, ", at most {}", self.max)?;
        }
        if self.step > 0.0 {
            write!(formatter, ", a multiple of {}", self.step)?;
        }
        Ok(())
    }
}

/// A property of an object.
pub(super) struct Property {
    pub name: &'static str,
    pub kind: &'static Kind,
    pub required: bool,
    /// Without which this one means nothing.
    pub needs: Option<&'static str>,
    /// Beside which this one must not stand.
    pub excludes: &'static [&'static str],
}

const fn may(name: &'static str, kind: &'static Kind) -> Property {
    Property { name, kind, required: false, needs: None, excludes: &[] }
}

const fn must(name: &'static str, kind: &'static Kind) -> Property {
    Property { required: true, ..may(name, kind) }
}

const fn needing(name: &'static str, kind: &'static Kind, other: &'static str) -> Property {
    Property { needs: Some(other), ..may(name, kind) }
}

const fn alone(name: &'static str, kind: &'static Kind, others: &'static [&'static str]) -> Property {
    Property { excludes: others, ..may(name, kind) }
}

const fn between(min: f64, max: f64) -> Kind {
    Kind::Number(Number { min, max, above: false, step: 0.0, or: None })
}

const fn above(min: f64) -> Kind {
    Kind::Number(Number { min, max: f32::MAX as f64, above: true, step: 0.0, or: None })
}

const fn whole(min: f64, max: f64, step: f64) -> Kind {
    Kind::Number(Number { min, max, above: false, step, or: None })
}

const INF: f64 = f64::INFINITY;
static NUMBER: Kind = between(-INF, INF);
static UNIT: Kind = between(0.0, 1.0);
static POSITIVE: Kind = between(0.0, INF);
static ABOVE_ZERO: Kind = above(0.0);
static COUNT: Kind = whole(1.0, INF, 1.0);
static OFFSET: Kind = whole(0.0, INF, 1.0);
static TEXCOORD: Kind = whole(0.0, INF, 1.0);
static NUMBERS: Kind = Kind::List(&NUMBER, 1);
static UNITS_3: Kind = Kind::List(&UNIT, 3);
static UNITS_4: Kind = Kind::List(&UNIT, 4);
static POSITIVES_3: Kind = Kind::List(&POSITIVE, 3);
static ANGLE: Kind = between(0.0, std::f64::consts::FRAC_PI_2);

static ACCESSOR_INDEX: Kind = Kind::Index("accessors");
static VIEW_INDEX: Kind = Kind::Index("bufferViews");
static NODE_INDEX: Kind = Kind::Index("nodes");
static MESH_INDEX: Kind = Kind::Index("meshes");
static MATERIAL_INDEX: Kind = Kind::Index("materials");
static NODES: Kind = Kind::List(&NODE_INDEX, 1);
static ATTRIBUTES: Kind = Kind::Map(&ACCESSOR_INDEX);

pub(super) static ROOT: Kind = Kind::Object(
    "root",
    &[
        must(
            "asset",
            &Kind::Object("asset", &[must("version", &Kind::Text), may("minVersion", &Kind::Text)]),
        ),
        may("accessors", &Kind::List(&ACCESSOR, 1)),
        may("animations", &Kind::List(&ANIMATION, 1)),
        may("buffers", &Kind::List(&BUFFER, 1)),
        may("bufferViews", &Kind::List(&BUFFER_VIEW, 1)),
        may("cameras", &Kind::List(&CAMERA, 1)),
        may("extensionsUsed", &Kind::List(&Kind::Text, 1)),
        may("extensionsRequired", &Kind::List(&Kind::Text, 1)),
        may("images", &Kind::List(&IMAGE, 1)),
        may("materials", &Kind::List(&MATERIAL, 1)),
        may("meshes", &Kind::List(&MESH, 1)),
        may("nodes", &Kind::List(&NODE, 1)),
        may("samplers", &Kind::List(&SAMPLER, 1)),
        may("scene", &Kind::Index("scenes")),
        may("scenes", &Kind::List(&Kind::Object("scene", &[may("nodes", &NODES)]), 1)),
        may("skins", &Kind::List(&SKIN, 1)),
        may("textures", &Kind::List(&TEXTURE, 1)),
    ],
);

static ACCESSOR: Kind = Kind::Object(
    "accessor",
    &[
        may("bufferView", &VIEW_INDEX),
        needing("byteOffset", &OFFSET, "bufferView"),
        must("componentType", &Kind::Codes(&[5120, 5121, 5122, 5123, 5125, 5126])),
        must("count", &COUNT),
        must("type", &Kind::OneOf(&["SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"])),
        may("normalized", &Kind::Bool),
        may("min", &NUMBERS),
        may("max", &NUMBERS),
        may("sparse", &SPARSE),
    ],
);

static SPARSE: Kind = Kind::Object(
    "sparse",
    &[
        must("count", &COUNT),
        must(
            "indices",
            &Kind::Object(
                "sparse indices",
                &[
                    must("bufferView", &VIEW_INDEX),
                    may("byteOffset", &OFFSET),
                    must("componentType", &Kind::Codes(&[5121, 5123, 5125])),
                ],
            ),
        ),
        must(
            "values",
            &Kind::Object("sparse values", &[must("bufferView", &VIEW_INDEX), may("byteOffset", &OFFSET)]),
        ),
    ],
);

static ANIMATION: Kind = Kind::Object(
    "animation",
    &[must("channels", &Kind::List(&CHANNEL, 1)), must("samplers", &Kind::List(&ANIMATION_SAMPLER, 1))],
);
static CHANNEL: Kind = Kind::Object("channel", &[must("sampler", &OFFSET), must("target", &TARGET)]);
static TARGET: Kind = Kind::Object("target", &[may("node", &NODE_INDEX), must("path", &Kind::Text)]);
static ANIMATION_SAMPLER: Kind = Kind::Object(
    "animation sampler",
    &[
        must("input", &ACCESSOR_INDEX),
        must("output", &ACCESSOR_INDEX),
        may("interpolation", &Kind::OneOf(&["LINEAR", "STEP", "CUBICSPLINE"])),
    ],
);

static BUFFER: Kind = Kind::Object("buffer", &[may("uri", &Kind::Text), must("byteLength", &COUNT)]);
static BUFFER_VIEW: Kind = Kind::Object(
    "buffer view",
    &[
        must("buffer", &Kind::Index("buffers")),
        may("byteOffset", &OFFSET),
        must("byteLength", &COUNT),
        may("byteStride", &whole(4.0, 252.0, 4.0)),
        may("target", &Kind::Codes(&[34962, 34963])),
    ],
);

static CAMERA: Kind = Kind::Object(
    "camera",
    &[
        must("type", &Kind::OneOf(&["perspective", "orthographic"])),
        alone("perspective", &PERSPECTIVE, &["orthographic"]),
        may("orthographic", &ORTHOGRAPHIC),
    ],
);
static PERSPECTIVE: Kind = Kind::Object(
    "perspective",
    &[
        may("aspectRatio", &ABOVE_ZERO),
        must("yfov", &ABOVE_ZERO),
        must("znear", &ABOVE_ZERO),
        may("zfar", &ABOVE_ZERO),
    ],
);
static ORTHOGRAPHIC: Kind = Kind::Object(
    "orthographic",
    &[must("xmag", &NUMBER), must("ymag", &NUMBER), must("znear", &POSITIVE), must("zfar", &ABOVE_ZERO)],
);

static IMAGE: Kind = Kind::Object(
    "image",
    &[
        alone("uri", &Kind::Text, &["bufferView"]),
        Property { needs: Some("mimeType"), ..may("bufferView", &VIEW_INDEX) },
        may("mimeType", &Kind::Text),
    ],
);
static TEXTURE: Kind = Kind::Object(
    "texture",
    &[may("sampler", &Kind::Index("samplers")), may("source", &Kind::Index("images"))],
);
static WRAP: Kind = Kind::Codes(&[33071, 33648, 10497]);
static SAMPLER: Kind = Kind::Object(
    "sampler",
    &[
        may("magFilter", &Kind::Codes(&[9728, 9729])),
        may("minFilter", &Kind::Codes(&[9728, 9729, 9984, 9985, 9986, 9987])),
        may("wrapS", &WRAP),
        may("wrapT", &WRAP),
    ],
);

static MESH: Kind =
    Kind::Object("mesh", &[must("primitives", &Kind::List(&PRIMITIVE, 1)), may("weights", &NUMBERS)]);
static PRIMITIVE: Kind = Kind::Object(
    "primitive",
    &[
        must("attributes", &ATTRIBUTES),
        may("indices", &ACCESSOR_INDEX),
        may("material", &MATERIAL_INDEX),
        may("mode", &Kind::Codes(&[0, 1, 2, 3, 4, 5, 6])),
        may("targets", &Kind::List(&ATTRIBUTES, 1)),
    ],
);

static NODE: Kind = Kind::Object(
    "node",
    &[
        may("camera", &Kind::Index("cameras")),
        may("children", &NODES),
        may("mesh", &MESH_INDEX),
        needing("skin", &Kind::Index("skins"), "mesh"),
        needing("weights", &NUMBERS, "mesh"),
        alone("matrix", &Kind::List(&NUMBER, 16), &["translation", "rotation", "scale"]),
        may("translation", &Kind::List(&NUMBER, 3)),
        may("rotation", &Kind::List(&between(-1.0, 1.0), 4)),
        may("scale", &Kind::List(&NUMBER, 3)),
    ],
);
static SKIN: Kind = Kind::Object(
    "skin",
    &[may("inverseBindMatrices", &ACCESSOR_INDEX), may("skeleton", &NODE_INDEX), must("joints", &NODES)],
);

static TEXTURE_INFO: Kind =
    Kind::Object("texture info", &[must("index", &Kind::Index("textures")), may("texCoord", &TEXCOORD)]);
static NORMAL_TEXTURE: Kind = Kind::Object(
    "texture info",
    &[must("index", &Kind::Index("textures")), may("texCoord", &TEXCOORD), may("scale", &NUMBER)],
);
static OCCLUSION_TEXTURE: Kind = Kind::Object(
    "texture info",
    &[must("index", &Kind::Index("textures")), may("texCoord", &TEXCOORD), may("strength", &UNIT)],
);
static MATERIAL: Kind = Kind::Object(
    "material",
    &[
        may("pbrMetallicRoughness", &METALLIC_ROUGHNESS),
        may("normalTexture", &NORMAL_TEXTURE),
        may("occlusionTexture", &OCCLUSION_TEXTURE),
        may("emissiveTexture", &TEXTURE_INFO),
        may("emissiveFactor", &UNITS_3),
        may("alphaMode", &Kind::OneOf(&["OPAQUE", "MASK", "BLEND"])),
        may("alphaCutoff", &POSITIVE),
        may("doubleSided", &Kind::Bool),
    ],
);
static METALLIC_ROUGHNESS: Kind = Kind::Object(
    "pbrMetallicRoughness",
    &[
        may("baseColorFactor", &UNITS_4),
        may("baseColorTexture", &TEXTURE_INFO),
        may("metallicFactor", &UNIT),
        may("roughnessFactor", &UNIT),
        may("metallicRoughnessTexture", &TEXTURE_INFO),
    ],
);

/// Where an extension may stand, and what it must be there.
pub(super) struct Extension {
    pub name: &'static str,
    pub home: &'static str,
    pub kind: &'static Kind,
}

const fn extension(name: &'static str, home: &'static str, kind: &'static Kind) -> Extension {
    Extension { name, home, kind }
}

static VARIANTS: Kind = Kind::Object(
    "",
    &[must("variants", &Kind::List(&Kind::Object("variant", &[must("name", &Kind::Text)]), 1))],
);

static VARIANT_MAPPINGS: Kind = Kind::Object(
    "",
    &[must(
        "mappings",
        &Kind::List(
            &Kind::Object(
                "variant mapping",
                &[
                    must("material", &Kind::Index("materials")),
                    must("variants", &Kind::List(&Kind::Index("variants"), 1)),
                ],
            ),
            1,
        ),
    )],
);

pub(super) static EXTENSIONS: &[Extension] = &[
    extension("EXT_mesh_gpu_instancing", "node", &Kind::Object("", &[must("attributes", &ATTRIBUTES)])),
    extension("EXT_texture_webp", "texture", &Kind::Object("", &[may("source", &Kind::Index("images"))])),
    extension("KHR_animation_pointer", "target", &Kind::Object("", &[must("pointer", &Kind::Text)])),
    extension("KHR_lights_punctual", "root", &Kind::Object("", &[must("lights", &Kind::List(&LIGHT, 1))])),
    extension("KHR_lights_punctual", "node", &Kind::Object("", &[must("light", &Kind::Index("lights"))])),
    extension("KHR_materials_anisotropy", "material", &ANISOTROPY),
    extension("KHR_materials_clearcoat", "material", &CLEARCOAT),
    extension("KHR_materials_diffuse_transmission", "material", &DIFFUSE_TRANSMISSION),
    extension("KHR_materials_dispersion", "material", &Kind::Object("", &[may("dispersion", &POSITIVE)])),
    extension(
        "KHR_materials_emissive_strength",
        "material",
        &Kind::Object("", &[may("emissiveStrength", &POSITIVE)]),
    ),
    extension("KHR_materials_ior", "material", &Kind::Object("", &[may("ior", &IOR)])),
    extension("KHR_materials_iridescence", "material", &IRIDESCENCE),
    extension("KHR_materials_pbrSpecularGlossiness", "material", &SPECULAR_GLOSSINESS),
    extension("KHR_materials_sheen", "material", &SHEEN),
    extension("KHR_materials_specular", "material", &SPECULAR),
    extension("KHR_materials_transmission", "material", &TRANSMISSION),
    extension("KHR_materials_unlit", "material", &Kind::Object("", &[])),
    extension("KHR_materials_variants", "root", &VARIANTS),
    extension("KHR_materials_variants", "primitive", &VARIANT_MAPPINGS),
    extension("KHR_materials_volume", "material", &VOLUME),
    extension("KHR_mesh_quantization", "nowhere", &Kind::Any),
    extension("KHR_node_visibility", "node", &Kind::Object("", &[may("visible", &Kind::Bool)])),
    extension("KHR_texture_transform", "texture info", &TEXTURE_TRANSFORM),
];

/// 0 asks for a reflectance of one.
static IOR: Kind = Kind::Number(Number { min: 1.0, max: INF, above: false, step: 0.0, or: Some(0.0) });
static LIGHT: Kind = Kind::Object(
    "light",
    &[
        must("type", &Kind::OneOf(&["directional", "point", "spot"])),
        may("color", &UNITS_3),
        may("intensity", &POSITIVE),
        may("range", &ABOVE_ZERO),
        may("spot", &Kind::Object("spot", &[may("innerConeAngle", &ANGLE), may("outerConeAngle", &ANGLE)])),
    ],
);
static ANISOTROPY: Kind = Kind::Object(
    "",
    &[
        may("anisotropyStrength", &UNIT),
        may("anisotropyRotation", &NUMBER),
        may("anisotropyTexture", &TEXTURE_INFO),
    ],
);
static CLEARCOAT: Kind = Kind::Object(
    "",
    &[
        may("clearcoatFactor", &UNIT),
        may("clearcoatTexture", &TEXTURE_INFO),
        may("clearcoatRoughnessFactor", &UNIT),
        may("clearcoatRoughnessTexture", &TEXTURE_INFO),
        may("clearcoatNormalTexture", &NORMAL_TEXTURE),
    ],
);
static DIFFUSE_TRANSMISSION: Kind = Kind::Object(
    "",
    &[
        may("diffuseTransmissionFactor", &UNIT),
        may("diffuseTransmissionTexture", &TEXTURE_INFO),
        may("diffuseTransmissionColorFactor", &POSITIVES_3),
        may("diffuseTransmissionColorTexture", &TEXTURE_INFO),
    ],
);
static IRIDESCENCE: Kind = Kind::Object(
    "",
    &[
        may("iridescenceFactor", &UNIT),
        may("iridescenceTexture", &TEXTURE_INFO),
        may("iridescenceIor", &between(1.0, INF)),
        may("iridescenceThicknessMinimum", &POSITIVE),
        may("iridescenceThicknessMaximum", &POSITIVE),
        may("iridescenceThicknessTexture", &TEXTURE_INFO),
    ],
);
static SPECULAR_GLOSSINESS: Kind = Kind::Object(
    "",
    &[
        may("diffuseFactor", &UNITS_4),
        may("diffuseTexture", &TEXTURE_INFO),
        may("specularFactor", &UNITS_3),
        may("glossinessFactor", &UNIT),
        may("specularGlossinessTexture", &TEXTURE_INFO),
    ],
);
static SHEEN: Kind = Kind::Object(
    "",
    &[
        may("sheenColorFactor", &UNITS_3),
        may("sheenColorTexture", &TEXTURE_INFO),
        may("sheenRoughnessFactor", &UNIT),
        may("sheenRoughnessTexture", &TEXTURE_INFO),
    ],
);
static SPECULAR: Kind = Kind::Object(
    "",
    &[
        may("specularFactor", &UNIT),
        may("specularTexture", &TEXTURE_INFO),
        may("specularColorFactor", &POSITIVES_3),
        may("specularColorTexture", &TEXTURE_INFO),
    ],
);
static TRANSMISSION: Kind =
    Kind::Object("", &[may("transmissionFactor", &UNIT), may("transmissionTexture", &TEXTURE_INFO)]);
static VOLUME: Kind = Kind::Object(
    "",
    &[
        may("thicknessFactor", &POSITIVE),
        may("thicknessTexture", &TEXTURE_INFO),
        may("attenuationDistance", &ABOVE_ZERO),
        may("attenuationColor", &UNITS_3),
    ],
);
static TEXTURE_TRANSFORM: Kind = Kind::Object(
    "",
    &[
        may("offset", &Kind::List(&NUMBER, 2)),
        may("rotation", &NUMBER),
        may("scale", &Kind::List(&NUMBER, 2)),
        may("texCoord", &TEXCOORD),
    ],
);
