//! What GLSL cannot express.
//!
//! naga knows a part of it by version. The rest it would write all the same, and no compiler of GLSL would take
//! it: found by running each of WGSL's functions through `glslangValidator`, see `tests::emit`.

use naga::back::glsl::Features;
use naga::valid::{FunctionInfo, ModuleInfo};
use naga::{Expression, Handle, ImageClass, MathFunction, Module, TypeInner};

use super::Language;

/// What to do about most of it.
pub const HELP: &str = "put it under an `@if` and leave that feature out here, or write another language";

/// What `language` lacks to express a module with one entry point, if anything.
pub fn gap(module: &Module, info: &ModuleInfo, language: Language) -> Option<String> {
    let functions = module.functions.iter().map(|(handle, function)| (function, &info[handle]));
    let entries = module.entry_points.iter().enumerate();
    let entries = entries.map(|(index, entry)| (&entry.function, info.get_entry_point(index)));
    let is_es = language == Language::GlslEs;
    if is_es && module.types.iter().any(|(_, ty)| is_multisampled(&ty.inner)) {
        return Some("multisampled textures".to_owned());
    }
    functions.chain(entries).find_map(|(function, info)| {
        let mut expressions = function.expressions.iter();
        expressions.find_map(|(_, expression)| in_expression(module, info, expression, is_es))
    })
}

fn is_multisampled(inner: &TypeInner) -> bool {
    matches!(
        inner,
        TypeInner::Image {
            class: ImageClass::Sampled { multi: true, .. } | ImageClass::Depth { multi: true },
            ..
        }
    )
}

fn in_expression(
    module: &Module,
    info: &FunctionInfo,
    expression: &Expression,
    is_es: bool,
) -> Option<String> {
    let is_depth = |image: &Handle<Expression>| {
        matches!(
            info[*image].ty.inner_with(&module.types),
            TypeInner::Image { class: ImageClass::Depth { .. }, .. }
        )
    };
    let what = match expression {
        Expression::ImageSample { image, depth_ref: None, .. } if is_depth(image) => {
            "a depth texture that is read without a comparison"
        }
        Expression::ImageLoad { image, .. } if is_depth(image) => "`textureLoad` of a depth texture",
        Expression::ImageSample { gather: Some(_), .. } if is_es => "`textureGather`",
        Expression::Math { fun, .. } if is_es => {
            return missing_function(*fun).map(|name| format!("`{name}`"));
        }
        _ => return None,
    };
    Some(what.to_owned())
}

/// Functions that GLSL ES has from version 3.10 on.
fn missing_function(function: MathFunction) -> Option<&'static str> {
    Some(match function {
        MathFunction::Ldexp => "ldexp",
        MathFunction::CountOneBits => "countOneBits",
        MathFunction::CountTrailingZeros => "countTrailingZeros",
        MathFunction::ExtractBits => "extractBits",
        MathFunction::InsertBits => "insertBits",
        MathFunction::ReverseBits => "reverseBits",
        MathFunction::FirstLeadingBit => "firstLeadingBit",
        MathFunction::FirstTrailingBit => "firstTrailingBit",
        MathFunction::Pack4x8snorm => "pack4x8snorm",
        MathFunction::Pack4x8unorm => "pack4x8unorm",
        MathFunction::Dot4I8Packed => "dot4I8Packed",
        MathFunction::Dot4U8Packed => "dot4U8Packed",
        MathFunction::Unpack4xI8 => "unpack4xI8",
        MathFunction::Unpack4xU8 => "unpack4xU8",
        _ => return None,
    })
}

/// What naga knows to be missing in a version, in words.
pub fn describe(features: Features) -> String {
    let named = FEATURES.iter().filter(|(feature, _)| features.contains(*feature));
    let names: Vec<&str> = named.map(|(_, name)| *name).collect();
    if names.is_empty() { format!("{features:?}") } else { names.join(" and ") }
}

const FEATURES: [(Features, &str); 21] = [
    (Features::COMPUTE_SHADER, "compute shaders"),
    (Features::BUFFER_STORAGE, "storage buffers"),
    (Features::IMAGE_LOAD_STORE, "storage textures"),
    (Features::FULL_IMAGE_FORMATS, "this storage texture's format"),
    (Features::ARRAY_OF_ARRAYS, "arrays of arrays"),
    (Features::DYNAMIC_ARRAY_SIZE, "arrays without a size"),
    (Features::DOUBLE_TYPE, "numbers of 64 bits"),
    (Features::MULTISAMPLED_TEXTURES, "multisampled textures"),
    (Features::MULTISAMPLED_TEXTURE_ARRAYS, "arrays of multisampled textures"),
    (Features::CUBE_TEXTURES_ARRAY, "cube arrays"),
    (Features::TEXTURE_SAMPLES, "`textureNumSamples`"),
    (Features::TEXTURE_LEVELS, "`textureNumLevels`"),
    (Features::IMAGE_SIZE, "`textureDimensions` of a storage texture"),
    (Features::TEXTURE_ATOMICS, "atomic operations on textures"),
    (Features::TEXTURE_SHADOW_LOD, "`textureSampleCompareLevel` of a cube array"),
    (Features::NOPERSPECTIVE_QUALIFIER, "`@interpolate(linear)`"),
    (Features::SAMPLE_QUALIFIER, "interpolation per sample"),
    (Features::SAMPLE_VARIABLES, "`@builtin(sample_index)`"),
    (Features::CLIP_DISTANCE, "clip distances"),
    (Features::CULL_DISTANCE, "cull distances"),
    (Features::DUAL_SOURCE_BLENDING, "two colours at one location"),
];

/// An extension that naga asks for but reference compilers do not have.
pub const SHADOW_LOD: &str = "#extension GL_EXT_texture_shadow_lod";
