//! What a compiled shader offers and asks for, by name.

use serde::{Deserialize, Serialize};

/// Interface of a compiled module.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Reflection {
    /// Entry points in source order.
    pub entry_points: Vec<EntryPoint>,
    /// Resources that at least one entry point uses, sorted by group and binding.
    pub bindings: Vec<Binding>,
    /// Constants that a pipeline may set, in source order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub overrides: Vec<Override>,
    /// What the author offers to be changed while one looks, in source order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parameters: Vec<Parameter>,
}

impl Reflection {
    /// WGSL type of one of its parameters.
    pub fn parameter_type(&self, parameter: &Parameter) -> Option<&str> {
        let ParameterPlace::Member { uniform } = &parameter.place else {
            let constant = self.overrides.iter().find(|constant| constant.name == parameter.name)?;
            return Some(&constant.ty);
        };
        let BindingKind::Uniform { members, .. } =
            &self.bindings.iter().find(|binding| binding.name == *uniform)?.kind
        else {
            return None;
        };
        members.iter().find(|member| member.name == parameter.name).map(|member| member.ty.as_str())
    }
}

/// A constant that a pipeline may set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Override {
    /// Its name.
    pub name: String,
    /// `@id`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub id: Option<u16>,
    /// WGSL type: `bool`, `f32`, `i32` or `u32`.
    pub ty: String,
    /// Its value unless a pipeline sets it, if that is a literal; 0 and 1 for `bool`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub default: Option<f64>,
}

/// An override or a uniform's member that the author annotated, as `// @slider(0, 1, 0.5)`, or a uniform of GLSL with
/// an initial value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Parameter {
    /// Its name.
    pub name: String,
    /// Where its value goes.
    pub place: ParameterPlace,
    /// How one changes it.
    pub widget: Widget,
    /// Its first value, component by component.
    pub default: Vec<f64>,
    /// What it does, in the author's words; may be empty.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub label: String,
}

/// Where a parameter's value goes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ParameterPlace {
    /// Into the pipeline.
    Override,
    /// Into a uniform buffer.
    Member {
        /// The variable's name.
        uniform: String,
    },
}

/// How a parameter is changed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Widget {
    /// Any numbers, as many as the first value has.
    Number,
    /// A number between two.
    Slider {
        /// The least value.
        least: f64,
        /// The greatest.
        greatest: f64,
    },
    /// A linear Rec. 709 colour.
    Color,
    /// 0 or 1.
    Toggle,
    /// The number of one of these.
    Choice {
        /// What the numbers from 0 on stand for.
        names: Vec<String>,
    },
}

/// Shader stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[expect(missing_docs, reason = "names say it")]
pub enum Stage {
    Vertex,
    Fragment,
    Compute,
}

/// One entry point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EntryPoint {
    /// Its name.
    pub name: String,
    /// Its stage.
    pub stage: Stage,
    /// Vertex inputs by location; empty for other stages.
    pub inputs: Vec<VertexInput>,
    /// Workgroup size; `[0, 0, 0]` unless compute.
    pub workgroup_size: [u32; 3],
}

/// A user-defined vertex input.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct VertexInput {
    /// `@location`.
    pub location: u32,
    /// Its name, as `position`.
    pub name: String,
    /// WGSL type, as `vec3<f32>`.
    pub ty: String,
}

/// A resource the shader uses.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Binding {
    /// `@group`.
    pub group: u32,
    /// `@binding`.
    pub binding: u32,
    /// The variable's name: what Kiln binds by.
    pub name: String,
    /// What it is.
    pub kind: BindingKind,
    /// Stages that use it.
    pub stages: Vec<Stage>,
}

/// Kinds of resources.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BindingKind {
    /// A uniform buffer: its size and members (flattened one level: a struct's direct members).
    Uniform {
        /// Size in bytes, rounded up to the struct's alignment.
        size_bytes: u32,
        /// Direct members with their offsets.
        members: Vec<Member>,
    },
    /// A storage buffer.
    Storage {
        /// Whether the shader only reads it.
        read_only: bool,
        /// Smallest size in bytes.
        size_bytes: u32,
    },
    /// A sampled texture.
    Texture {
        /// `1d`, `2d`, `2d_array`, `3d`, `cube`, `cube_array`.
        dimension: String,
        /// `float`, `depth`, `sint` or `uint`.
        sample: String,
        /// Whether it is multisampled.
        multisampled: bool,
    },
    /// A storage texture, with its format as WGSL spells it and access `read`, `write` or `read_write`.
    StorageTexture {
        /// `1d`, `2d`, `2d_array`, `3d`.
        dimension: String,
        /// Texel format.
        format: String,
        /// Access.
        access: String,
    },
    /// A sampler.
    Sampler {
        /// Whether it compares depths.
        comparison: bool,
    },
}

/// A member of a uniform struct.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Member {
    /// Its name: what Kiln fills it by.
    pub name: String,
    /// WGSL type, as `vec4<f32>` or `array<vec4<f32>, 9>`.
    pub ty: String,
    /// Offset in bytes.
    pub offset_bytes: u32,
    /// Size in bytes.
    pub size_bytes: u32,
}
