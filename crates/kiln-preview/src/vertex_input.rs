//! What a vertex shader reads of vertex buffers, by name.

use std::mem::offset_of;

use kiln_diagnostic::Diagnostic;
use kiln_scene::{Influence, Vertex};
use kiln_shader::Reflection;

use crate::target::Role;
use crate::uniform::long_type_name;

/// What a program reads of the two vertex buffers: 0 holds [`Vertex`], 1 [`Influence`].
#[derive(Debug, Default)]
pub(crate) struct VertexInputs {
    vertex: Vec<wgpu::VertexAttribute>,
    influence: Vec<wgpu::VertexAttribute>,
}

impl VertexInputs {
    /// Those of `vs_main`.
    pub fn new(shader: &str, role: Role, reflection: &Reflection) -> Result<Self, Diagnostic> {
        let vertex = reflection.entry_points.iter().find(|point| point.name == "vs_main");
        let read = vertex.map_or(&[][..], |point| &point.inputs);
        if role != Role::Material && !read.is_empty() {
            let message = format!("`{shader}` reads the vertex input `{}`", read[0].name);
            return Err(Diagnostic::error(message)
                .with_note("background and tonemap draw one triangle by `@builtin(vertex_index)` alone"));
        }
        let mut inputs = VertexInputs::default();
        for input in read {
            inputs.push(shader, &input.name, &input.ty, input.location)?;
        }
        Ok(inputs)
    }

    /// Whether buffer 1 must be set.
    pub fn reads_influences(&self) -> bool {
        !self.influence.is_empty()
    }

    /// Layouts of the buffers that materials are drawn with.
    pub fn layouts(&self) -> Vec<Option<wgpu::VertexBufferLayout<'_>>> {
        let layout = |array_stride: usize, attributes| {
            let step_mode = wgpu::VertexStepMode::Vertex;
            Some(wgpu::VertexBufferLayout { array_stride: array_stride as u64, step_mode, attributes })
        };
        let influence =
            self.reads_influences().then(|| layout(size_of::<Influence>(), self.influence.as_slice()));
        [layout(size_of::<Vertex>(), &self.vertex)].into_iter().chain(influence).collect()
    }

    fn push(&mut self, shader: &str, input: &str, ty: &str, shader_location: u32) -> Result<(), Diagnostic> {
        use wgpu::VertexFormat::{Float32x2, Float32x3, Float32x4, Uint16x4};
        let is_influence = matches!(input, "joints" | "weights");
        let (format, offset, expected) = match input {
            "position" => (Float32x3, offset_of!(Vertex, position), "vec3<f32>"),
            "normal" => (Float32x3, offset_of!(Vertex, normal), "vec3<f32>"),
            "tangent" => (Float32x4, offset_of!(Vertex, tangent), "vec4<f32>"),
            "uv0" => (Float32x2, offset_of!(Vertex, uv0), "vec2<f32>"),
            "uv1" => (Float32x2, offset_of!(Vertex, uv1), "vec2<f32>"),
            "color" => (Float32x4, offset_of!(Vertex, color), "vec4<f32>"),
            "joints" => (Uint16x4, offset_of!(Influence, joints), "vec4<u32>"),
            "weights" => (Float32x4, offset_of!(Influence, weights), "vec4<f32>"),
            _ => {
                return Err(Diagnostic::error(format!(
                    "`{shader}` reads the unknown vertex input `{input}`"
                ))
                .with_help("use position, normal, tangent, uv0, uv1, color, joints or weights"));
            }
        };
        if long_type_name(ty) != expected {
            let message = format!("`{shader}` reads the vertex input `{input}` as {ty}; it is a {expected}");
            return Err(Diagnostic::error(message));
        }
        let attribute = wgpu::VertexAttribute { format, offset: offset as u64, shader_location };
        if is_influence { &mut self.influence } else { &mut self.vertex }.push(attribute);
        Ok(())
    }
}
