//! GLSL's own names: types, older spellings, what naga lacks and how to do without.

/// A combined texture and sampler type, taken apart.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Combined {
    /// The combined type, which is also the constructor that joins both: `sampler2D`.
    pub constructor: String,
    /// The texture's type: `texture2D`.
    pub texture: String,
    /// The sampler's type: `sampler` or `samplerShadow`.
    pub sampler: &'static str,
}

/// Takes the type `sampler2D` and its like apart.
pub fn combined(ty: &str) -> Option<Combined> {
    let (kind, rest) = match ty.as_bytes().first()? {
        b'i' | b'u' => ty.split_at(1),
        _ => ("", ty),
    };
    let shape = rest.strip_prefix("sampler").filter(|shape| !shape.is_empty())?;
    let (shape, is_shadow) = match shape.strip_suffix("Shadow") {
        Some(shape) => (shape, true),
        None => (shape, false),
    };
    let shapes: &[&str] = if is_shadow {
        &["2D", "2DArray", "Cube", "CubeArray"]
    } else {
        &["1D", "2D", "3D", "Cube", "2DArray", "CubeArray", "2DMS"]
    };
    (shapes.contains(&shape) && (kind.is_empty() || !is_shadow)).then(|| Combined {
        constructor: ty.to_owned(),
        texture: format!("{kind}texture{shape}"),
        sampler: if is_shadow { "samplerShadow" } else { "sampler" },
    })
}

/// Whether `ty` is a texture, sampler or image: something without a value.
pub fn is_opaque(ty: &str) -> bool {
    let bare = ty.strip_prefix(['i', 'u']).unwrap_or(ty);
    let prefixes = ["sampler", "texture", "image"];
    prefixes.iter().any(|prefix| ty.starts_with(prefix) || bare.starts_with(prefix))
}

/// Whether `word` is a type of GLSL's own that has values.
pub fn is_value_type(word: &str) -> bool {
    matches!(word, "float" | "int" | "uint" | "bool") || vector_len(word).is_some() || columns(word).is_some()
}

/// Components of a vector type.
pub fn vector_len(ty: &str) -> Option<u32> {
    let (kind, len) = ty.split_once("vec")?;
    let len = len.parse().ok().filter(|len| (2..=4).contains(len))?;
    ["", "i", "u", "b"].contains(&kind).then_some(len)
}

/// Columns of a matrix type.
pub fn columns(ty: &str) -> Option<u32> {
    let size = ty.strip_prefix("mat")?;
    let (columns, rows) = size.split_once('x').unwrap_or((size, size));
    let in_range = |text: &str| text.parse().ok().filter(|count| (2..=4_u32).contains(count));
    in_range(rows)?;
    in_range(columns)
}

/// Rows of a matrix type.
pub fn rows(ty: &str) -> Option<u32> {
    columns(ty)?;
    ty.bytes().last().filter(u8::is_ascii_digit).map(|digit| u32::from(digit - b'0'))
}

/// Whether `ty` has two columns of two rows.
pub fn is_mat2(ty: &str) -> bool {
    ty == "mat2" || ty == "mat2x2"
}

/// The present name of a function that older versions spell otherwise.
pub fn modern(name: &str) -> Option<&'static str> {
    Some(match name {
        "texture1D" | "texture2D" | "texture3D" | "textureCube" | "texture2DArray" | "shadow2D" => "texture",
        "texture1DLod" | "texture2DLod" | "texture3DLod" | "textureCubeLod" | "texture2DLodEXT"
        | "textureCubeLodEXT" | "texture1DLodEXT" | "texture3DLodEXT" | "shadow2DLod"
        | "texture2DArrayLod" => "textureLod",
        "texture1DProj" | "texture2DProj" | "texture3DProj" | "shadow2DProj" => "textureProj",
        "texture1DProjLod" | "texture2DProjLod" | "texture3DProjLod" | "texture2DProjLodEXT" => {
            "textureProjLod"
        }
        "texture2DGrad" | "textureCubeGrad" | "texture2DGradEXT" | "textureCubeGradEXT"
        | "texture2DGradARB" | "textureCubeGradARB" => "textureGrad",
        _ => return None,
    })
}

/// The function that takes the level as its last argument: stages without derivatives read level 0.
pub fn with_level(name: &str) -> Option<(&'static str, usize)> {
    match name {
        "texture" => Some(("textureLod", 2)),
        "textureProj" => Some(("textureProjLod", 2)),
        _ => None,
    }
}

/// Functions that naga or its WGSL writer lacks, as text that defines `kiln_` and the name.
pub fn polyfill(name: &str) -> Option<String> {
    // Compares bits, because a compiler may assume that no value is NaN or infinite.
    let bits = |operator: &str, function: &str| {
        format!(
            "bool kiln_{function}(float x) {{ return (floatBitsToUint(x) & 0x7fffffffu) {operator} 0x7f800000u; }}\n\
             bvec2 kiln_{function}(vec2 x) {{ return bvec2(kiln_{function}(x.x), kiln_{function}(x.y)); }}\n\
             bvec3 kiln_{function}(vec3 x) {{ return bvec3(kiln_{function}(x.xy), kiln_{function}(x.z)); }}\n\
             bvec4 kiln_{function}(vec4 x) {{ return bvec4(kiln_{function}(x.xyz), kiln_{function}(x.w)); }}\n"
        )
    };
    Some(match name {
        "isnan" => bits(">", "isnan"),
        "isinf" => bits("==", "isinf"),
        "modf" => ["float", "vec2", "vec3", "vec4"]
            .map(|ty| format!("{ty} kiln_modf({ty} x, out {ty} i) {{ i = trunc(x); return x - i; }}\n"))
            .concat(),
        "outerProduct" => outer_products(),
        // Layers of array textures; a comparison's reference may stand behind.
        "layer" => "vec3 kiln_layer(vec3 p) { return vec3(p.xy, floor(p.z + 0.5)); }\n\
                    vec4 kiln_layer(vec4 p) { return vec4(p.xy, floor(p.z + 0.5), p.w); }\n"
            .to_owned(),
        "cube_layer" => "vec4 kiln_cube_layer(vec4 p) { return vec4(p.xyz, floor(p.w + 0.5)); }\n".to_owned(),
        "mat2" => {
            let others =
                ["float", "mat2", "mat2x3", "mat2x4", "mat3x2", "mat3", "mat3x4", "mat4x2", "mat4x3", "mat4"];
            let others = others.map(|ty| format!("mat2 kiln_mat2({ty} v) {{ return mat2(v); }}\n")).concat();
            format!("mat2 kiln_mat2(vec4 v) {{ return mat2(v.xy, v.zw); }}\n{others}")
        }
        "matrixCompMult" => [2, 3, 4].into_iter().map(component_product).collect(),
        _ => return None,
    })
}

fn outer_products() -> String {
    let mut text = String::new();
    for columns in 2..=4 {
        for rows in 2..=4 {
            let terms: Vec<&str> = ["c * r.x", "c * r.y", "c * r.z", "c * r.w"][..columns].to_vec();
            text.push_str(&format!(
                "mat{columns}x{rows} kiln_outerProduct(vec{rows} c, vec{columns} r) {{ return mat{columns}x{rows}({}); }}\n",
                terms.join(", ")
            ));
        }
    }
    text
}

fn component_product(size: usize) -> String {
    let terms: Vec<String> = (0..size).map(|column| format!("a[{column}] * b[{column}]")).collect();
    let terms = terms.join(", ");
    format!("mat{size} kiln_matrixCompMult(mat{size} a, mat{size} b) {{ return mat{size}({terms}); }}\n")
}

/// Whether the function compares with neighbouring pixels.
pub fn is_derivative(name: &str) -> bool {
    ["dFdx", "dFdy", "fwidth"].iter().any(|prefix| name.starts_with(prefix))
}

/// Types that people write most, for "did you mean".
pub const TYPES: [&str; 20] = [
    "bool", "float", "int", "uint", "vec2", "vec3", "vec4", "ivec2", "ivec3", "ivec4", "uvec2", "uvec3",
    "uvec4", "bvec2", "bvec3", "bvec4", "mat2", "mat3", "mat4", "void",
];

/// Statements of memory order alone: a `barrier()` of WGSL orders memory too.
pub const MEMORY_BARRIERS: [&str; 6] = [
    "memoryBarrier",
    "memoryBarrierShared",
    "memoryBarrierBuffer",
    "memoryBarrierImage",
    "memoryBarrierAtomicCounter",
    "groupMemoryBarrier",
];

/// Variables of GLSL that come through as they are.
pub const VARIABLES: [&str; 12] = [
    "gl_Position",
    "gl_FragCoord",
    "gl_FragDepth",
    "gl_FrontFacing",
    "gl_GlobalInvocationID",
    "gl_LocalInvocationID",
    "gl_LocalInvocationIndex",
    "gl_NumWorkGroups",
    "gl_WorkGroupID",
    // These are made: see `lower`.
    "gl_PointSize",
    "gl_FragColor",
    "gl_FragData",
];

/// Variables whose type or name differs in naga, with the expression to write.
pub fn variable(name: &str) -> Option<&'static [&'static str]> {
    Some(match name {
        "gl_VertexID" | "gl_VertexIndex" => &["int", "(", "gl_VertexIndex", ")"],
        "gl_InstanceID" | "gl_InstanceIndex" => &["int", "(", "gl_InstanceIndex", ")"],
        _ => return None,
    })
}

/// What begins a name that is refused wherever it stands, and what to do instead.
const REFUSED_PREFIXES: [(&str, &str); 16] = [
    ("subgroup", "Kiln compiles for devices without subgroups; use shared memory"),
    ("textureGather", "read the four texels with `texelFetch`"),
    ("interpolateAt", "declare the varying `centroid` or `sample`"),
    ("imageAtomic", "write this pass in WGSL"),
    ("atomic", "write this pass in WGSL, whose atomics Kiln compiles"),
    ("float16_t", "use `float`: Kiln compiles for devices without 16-bit floats"),
    ("f16vec", "use `vec2` … `vec4`: Kiln compiles for devices without 16-bit floats"),
    ("f16mat", "use `mat2` … `mat4`: Kiln compiles for devices without 16-bit floats"),
    ("int64_t", "use `int`"),
    ("uint64_t", "use `uvec2`"),
    ("dvec", "use `vec2` … `vec4`: there are no doubles in WGSL"),
    ("dmat", "use `mat2` … `mat4`: there are no doubles in WGSL"),
    ("subpass", "read a texture that an earlier pass wrote"),
    ("accelerationStructure", "use a storage buffer"),
    ("rayQuery", "use a storage buffer"),
    ("EmitStream", "build the geometry before"),
];

/// Names that are refused, and what to do instead.
const REFUSED: [(&str, &str); 65] = [
    ("double", "use `float`: there are no doubles in WGSL"),
    ("subroutine", "use a feature macro or a `switch`"),
    ("buffer_reference", "use a storage buffer and an index"),
    ("textureQueryLod", "compute the level from `dFdx` and `dFdy`"),
    ("textureSamples", "pass the count as a uniform"),
    ("EmitVertex", "build the geometry before"),
    ("EndPrimitive", "build the geometry before"),
    ("frexp", "use `floor(log2(abs(x)))` and `exp2`"),
    ("uaddCarry", "compare the sum with an operand"),
    ("usubBorrow", "compare the operands"),
    ("umulExtended", "multiply 16-bit halves"),
    ("imulExtended", "multiply 16-bit halves"),
    ("packDouble2x32", "there are no doubles in WGSL"),
    ("unpackDouble2x32", "there are no doubles in WGSL"),
    ("noise1", "write the noise as a function"),
    ("noise2", "write the noise as a function"),
    ("noise3", "write the noise as a function"),
    ("noise4", "write the noise as a function"),
    ("ftransform", "write `clip_from_world * world_from_object * vec4(position, 1.0)`"),
    ("gl_Vertex", "declare `in vec3 position;`"),
    ("gl_Normal", "declare `in vec3 normal;`"),
    ("gl_Color", "declare `in vec4 color;`"),
    ("gl_MultiTexCoord0", "declare `in vec2 uv0;`"),
    ("gl_MultiTexCoord1", "declare `in vec2 uv1;`"),
    ("gl_TexCoord", "declare a varying of your own"),
    ("gl_FrontColor", "declare a varying of your own"),
    ("gl_ModelViewProjectionMatrix", "declare `uniform mat4 clip_from_world, world_from_object;`"),
    ("gl_ModelViewMatrix", "declare `uniform mat4 world_from_object;`"),
    ("gl_ProjectionMatrix", "declare `uniform mat4 clip_from_world;`"),
    ("gl_NormalMatrix", "declare `uniform mat4 world_from_object_normal;`"),
    ("gl_LightSource", "declare uniforms of your own"),
    ("gl_FrontMaterial", "declare uniforms of your own"),
    ("gl_ClipDistance", "discard fragments by a varying"),
    ("gl_CullDistance", "discard fragments by a varying"),
    ("gl_ClipVertex", "discard fragments by a varying"),
    ("gl_PointCoord", "draw a quad and pass its coordinates as a varying"),
    ("gl_PrimitiveID", "pass the number as a `flat` varying"),
    ("gl_Layer", "draw each layer by itself"),
    ("gl_ViewportIndex", "draw each viewport by itself"),
    ("gl_DrawID", "pass the number as a uniform"),
    ("gl_BaseVertex", "pass the number as a uniform"),
    ("gl_BaseInstance", "pass the number as a uniform"),
    ("gl_SampleID", "shade once per pixel"),
    ("gl_SamplePosition", "shade once per pixel"),
    ("gl_SampleMask", "write alpha instead"),
    ("gl_SampleMaskIn", "shade once per pixel"),
    ("gl_NumSamples", "pass the count as a uniform"),
    ("gl_HelperInvocation", "take derivatives before branches"),
    ("gl_DepthRange", "depth is 0 … 1"),
    ("gl_in", "build the geometry before"),
    ("gl_out", "build the geometry before"),
    ("gl_InvocationID", "build the geometry before"),
    ("gl_TessLevelOuter", "tessellate the mesh before"),
    ("gl_TessLevelInner", "tessellate the mesh before"),
    ("gl_TessCoord", "tessellate the mesh before"),
    ("sampler2DRect", "use `sampler2D` and coordinates 0 … 1"),
    ("sampler1DArray", "use `sampler2DArray`"),
    ("sampler1DShadow", "use `sampler2DShadow`"),
    ("sampler1DArrayShadow", "use `sampler2DArrayShadow`"),
    ("samplerBuffer", "use a storage buffer"),
    ("sampler2DMSArray", "use one `sampler2DMS` each"),
    ("imageBuffer", "use a storage buffer"),
    ("imageCube", "use `image2DArray` with six layers"),
    ("image2DMS", "write to a texture with one sample"),
    ("samplerExternalOES", "use `sampler2D`"),
];

/// What to do instead of the name `word`, if neither naga nor WGSL has what it stands for.
pub fn replacement(word: &str) -> Option<&'static str> {
    let bare =
        word.strip_prefix(['i', 'u']).filter(|bare| bare.starts_with("sampler") || bare.starts_with("image"));
    let bare = bare.filter(|bare| !bare.starts_with("imageAtomic")).unwrap_or(word);
    let listed = REFUSED.iter().find(|(name, _)| *name == bare);
    // `atomicAdd` and `atomic_uint`, but not a name of the author's, as `atomicity`.
    let prefixed = REFUSED_PREFIXES.iter().find(|(prefix, _)| {
        word.strip_prefix(prefix)
            .is_some_and(|rest| !rest.starts_with(|c: char| c.is_ascii_lowercase()) || prefix.len() > 10)
    });
    listed.or(prefixed).map(|(_, help)| *help)
}

/// Functions that come through as they are.
pub const FUNCTIONS: [&str; 91] = [
    "abs",
    "acos",
    "acosh",
    "all",
    "any",
    "asin",
    "asinh",
    "atan",
    "atanh",
    "barrier",
    "bitCount",
    "bitfieldExtract",
    "bitfieldInsert",
    "bitfieldReverse",
    "ceil",
    "clamp",
    "cos",
    "cosh",
    "cross",
    "dFdx",
    "dFdxCoarse",
    "dFdxFine",
    "dFdy",
    "dFdyCoarse",
    "dFdyFine",
    "degrees",
    "determinant",
    "distance",
    "dot",
    "equal",
    "exp",
    "exp2",
    "faceforward",
    "findLSB",
    "findMSB",
    "floatBitsToInt",
    "floatBitsToUint",
    "floor",
    "fma",
    "fract",
    "fwidth",
    "greaterThan",
    "greaterThanEqual",
    "imageLoad",
    "imageSize",
    "imageStore",
    "intBitsToFloat",
    "inverse",
    "inversesqrt",
    "isinf",
    "isnan",
    "ldexp",
    "length",
    "lessThan",
    "lessThanEqual",
    "log",
    "log2",
    "matrixCompMult",
    "max",
    "min",
    "mix",
    "mod",
    "modf",
    "normalize",
    "not",
    "notEqual",
    "outerProduct",
    "pow",
    "radians",
    "reflect",
    "refract",
    "round",
    "sign",
    "sin",
    "sinh",
    "smoothstep",
    "sqrt",
    "step",
    "tan",
    "tanh",
    "texelFetch",
    "texture",
    "textureGrad",
    "textureLod",
    "textureOffset",
    "textureProj",
    "textureQueryLevels",
    "textureSize",
    "transpose",
    "trunc",
    "uintBitsToFloat",
];
