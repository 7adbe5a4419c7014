//! Drawing with a vertex and a fragment stage: resources, uniform members and attributes by name, whatever group, block or
//! location a front end gave them.

use kiln_gpu::Gpu;
use kiln_image::Cube;
use kiln_shader::{BindingKind, Compiled, Stage};
use kiln_sphere::cube_direction;

use crate::cubes::{cube_texture, read_cube};
use crate::passes::Setting;

/// A compiled program of both stages.
pub struct Program {
    compiled: Compiled,
    module: wgpu::ShaderModule,
}

/// What a draw reads.
pub struct Scene<'a> {
    /// Values of each vertex, in a row: name, how many a vertex has, values.
    pub attributes: Vec<(&'a str, usize, Vec<f32>)>,
    pub textures: Vec<(&'a str, wgpu::TextureView)>,
    /// The one sampler of all textures.
    pub sampler: wgpu::Sampler,
    pub values: Vec<(&'a str, Setting)>,
}

impl Program {
    #[track_caller]
    pub fn new(gpu: &Gpu, compiled: Compiled) -> Self {
        let descriptor = wgpu::ShaderModuleDescriptor {
            label: None,
            source: wgpu::ShaderSource::Wgsl(compiled.wgsl.as_str().into()),
        };
        let (module, error) = gpu.catch_errors(|| gpu.device.create_shader_module(descriptor));
        assert_eq!(error, None);
        Self { compiled, module }
    }

    fn entry_point(&self, stage: Stage) -> &kiln_shader::EntryPoint {
        let found = self.compiled.reflection.entry_points.iter().find(|entry| entry.stage == stage);
        found.expect("both stages are there")
    }

    /// Draws triangles into `target`.
    #[track_caller]
    pub fn draw(
        &self,
        gpu: &Gpu,
        scene: &Scene<'_>,
        target: &wgpu::TextureView,
        format: wgpu::TextureFormat,
    ) {
        let (_, error) = gpu.catch_errors(|| self.try_draw(gpu, scene, target, format));
        assert_eq!(error, None);
    }

    fn try_draw(
        &self,
        gpu: &Gpu,
        scene: &Scene<'_>,
        target: &wgpu::TextureView,
        format: wgpu::TextureFormat,
    ) {
        let vertex = self.entry_point(Stage::Vertex);
        let read: Vec<_> = vertex
            .inputs
            .iter()
            .map(|input| {
                let found = scene.attributes.iter().find(|(name, ..)| *name == input.name);
                let (_, count, values) =
                    found.unwrap_or_else(|| panic!("no attribute is called {}", input.name));
                (input.location, *count, values)
            })
            .collect();
        let attributes: Vec<[wgpu::VertexAttribute; 1]> = read
            .iter()
            .map(|&(shader_location, count, _)| {
                let format =
                    if count == 3 { wgpu::VertexFormat::Float32x3 } else { wgpu::VertexFormat::Float32x2 };
                [wgpu::VertexAttribute { format, offset: 0, shader_location }]
            })
            .collect();
        let layouts: Vec<_> = read
            .iter()
            .zip(&attributes)
            .map(|(&(_, count, _), attributes)| {
                Some(wgpu::VertexBufferLayout {
                    array_stride: count as u64 * 4,
                    step_mode: wgpu::VertexStepMode::Vertex,
                    attributes,
                })
            })
            .collect();
        let pipeline = gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: None,
            layout: None,
            vertex: wgpu::VertexState {
                module: &self.module,
                entry_point: Some(&vertex.name),
                compilation_options: Default::default(),
                buffers: &layouts,
            },
            fragment: Some(wgpu::FragmentState {
                module: &self.module,
                entry_point: Some(&self.entry_point(Stage::Fragment).name),
                compilation_options: Default::default(),
                targets: &[Some(format.into())],
            }),
            primitive: Default::default(),
            depth_stencil: None,
            multisample: Default::default(),
            multiview_mask: None,
            cache: None,
        });
        let buffers: Vec<wgpu::Buffer> = read
            .iter()
            .map(|(.., values)| gpu.buffer(bytemuck::cast_slice(values), wgpu::BufferUsages::VERTEX))
            .collect();
        let groups = self.bind_groups(gpu, scene, &pipeline);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: target,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations::default(),
                })],
                ..Default::default()
            });
            pass.set_pipeline(&pipeline);
            for (index, group) in groups.iter().enumerate() {
                pass.set_bind_group(index as u32, group, &[]);
            }
            for (index, buffer) in buffers.iter().enumerate() {
                pass.set_vertex_buffer(index as u32, buffer.slice(..));
            }
            let (_, count, values) = &scene.attributes[0];
            pass.draw(0..(values.len() / count) as u32, 0..1);
        }
        gpu.queue.submit([encoder.finish()]);
    }

    fn bind_groups(
        &self,
        gpu: &Gpu,
        scene: &Scene<'_>,
        pipeline: &wgpu::RenderPipeline,
    ) -> Vec<wgpu::BindGroup> {
        let is_drawn_with =
            |binding: &&kiln_shader::Binding| binding.stages.iter().any(|stage| *stage != Stage::Compute);
        let bindings: Vec<_> = self.compiled.reflection.bindings.iter().filter(is_drawn_with).collect();
        let count = bindings.iter().map(|binding| binding.group + 1).max().unwrap_or(0);
        let uniforms: Vec<wgpu::Buffer> = bindings
            .iter()
            .map(|binding| gpu.buffer(&uniform(binding, scene), wgpu::BufferUsages::UNIFORM))
            .collect();
        let group = |group: u32| {
            let entries: Vec<wgpu::BindGroupEntry<'_>> = bindings
                .iter()
                .zip(&uniforms)
                .filter(|(binding, _)| binding.group == group)
                .map(|(binding, uniform)| {
                    let resource = match binding.kind {
                        BindingKind::Texture { .. } => {
                            let found = scene.textures.iter().find(|(name, _)| *name == binding.name);
                            let view =
                                found.unwrap_or_else(|| panic!("no texture is called {}", binding.name));
                            wgpu::BindingResource::TextureView(&view.1)
                        }
                        BindingKind::Sampler { .. } => wgpu::BindingResource::Sampler(&scene.sampler),
                        _ => uniform.as_entire_binding(),
                    };
                    wgpu::BindGroupEntry { binding: binding.binding, resource }
                })
                .collect();
            gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: None,
                layout: &pipeline.get_bind_group_layout(group),
                entries: &entries,
            })
        };
        (0..count).map(group).collect()
    }

    /// Draws the inside of a cube into each of the faces of a cube map. Pixel (x, y) of a face looks along the direction
    /// of its texel: `view` turns the face's right, up and backwards to x, y and z, `projection` is 90° wide.
    #[track_caller]
    pub fn draw_faces<'a>(
        &self,
        gpu: &Gpu,
        mut scene: Scene<'a>,
        position: &'a str,
        face_size: usize,
    ) -> Cube {
        let target = cube_texture(gpu, face_size, 1);
        let projection = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, -0.5, -1.0], [0.0; 4]];
        scene.attributes = vec![(position, 3, cube_corners())];
        for face in 0..6 {
            let view = face_view(face);
            let product = product(projection, view);
            let matrices = [("projection", projection), ("view", view), ("mvp", product)];
            scene.values.retain(|(name, _)| !matrices.iter().any(|(matrix, _)| matrix == name));
            scene.values.extend(matrices.map(|(name, matrix)| (name, Setting::Matrix(matrix))));
            let layer = target.create_view(&wgpu::TextureViewDescriptor {
                dimension: Some(wgpu::TextureViewDimension::D2),
                base_array_layer: face as u32,
                array_layer_count: Some(1),
                ..Default::default()
            });
            self.draw(gpu, &scene, &layer, target.format());
        }
        read_cube(gpu, &target, 0)
    }
}

/// Bytes of a uniform block, or of a uniform that is one value; something for everything else.
fn uniform(binding: &kiln_shader::Binding, scene: &Scene<'_>) -> Vec<u8> {
    let BindingKind::Uniform { size_bytes, members } = &binding.kind else { return vec![0; 4] };
    let mut bytes = vec![0; *size_bytes as usize];
    // A three-component vector comes in the room of four, whose last may be the next member's.
    let mut put = |name: &str, offset: u32, size: u32| {
        let found = scene.values.iter().find(|(value, _)| *value == name);
        let (_, value) = found.unwrap_or_else(|| panic!("no value is called {name}"));
        let (start, count) = (offset as usize, value.bytes().len().min(size as usize));
        bytes[start..start + count].copy_from_slice(&value.bytes()[..count]);
    };
    if members.is_empty() {
        put(&binding.name, 0, *size_bytes);
    }
    for member in members {
        put(&member.name, member.offset_bytes, member.size_bytes);
    }
    bytes
}

/// Columns of the rotation of a face's right, up and backwards to x, y and z.
fn face_view(face: usize) -> [[f32; 4]; 4] {
    let forward = cube_direction(face, 0.0, 0.0);
    let side = |s: f64, t: f64| {
        let corner = cube_direction(face, s, t);
        std::array::from_fn::<f64, 3, _>(|i| corner[i] * 2.0_f64.sqrt() - forward[i])
    };
    let (right, up) = (side(1.0, 0.0), side(0.0, -1.0));
    let mut columns = [[0.0; 4]; 4];
    for (i, column) in columns.iter_mut().take(3).enumerate() {
        *column = [right[i] as f32, up[i] as f32, -forward[i] as f32, 0.0];
    }
    columns[3][3] = 1.0;
    columns
}

fn product(a: [[f32; 4]; 4], b: [[f32; 4]; 4]) -> [[f32; 4]; 4] {
    b.map(|column| std::array::from_fn(|row| (0..4).map(|k| a[k][row] * column[k]).sum()))
}

/// The twelve triangles of the cube [−1, 1]³.
fn cube_corners() -> Vec<f32> {
    let mut corners = Vec::new();
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            for [a, b] in [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]] {
                let mut corner = [0.0; 3];
                (corner[axis], corner[(axis + 1) % 3], corner[(axis + 2) % 3]) = (side, a, b);
                corners.extend(corner);
            }
        }
    }
    corners
}

/// Two triangles over all of clip space: positions (x, y, 0) and texture coordinates from the top left.
pub fn screen() -> (Vec<f32>, Vec<f32>) {
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, -1.0], [1.0, 1.0], [-1.0, 1.0_f32]];
    let positions = corners.iter().flat_map(|&[x, y]| [x, y, 0.0]).collect();
    let coordinates = corners.iter().flat_map(|&[x, y]| [0.5 * x + 0.5, 0.5 - 0.5 * y]).collect();
    (positions, coordinates)
}
