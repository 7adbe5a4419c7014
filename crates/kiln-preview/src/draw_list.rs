//! What to draw, with which pipeline and bindings.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{Mat4, Vec3};
use kiln_gpu::Gpu;
use kiln_scene::{AlphaMode, Draw, Material};

use crate::binding::{draw_group, material_group};
use crate::program::{Program, Raster};
use crate::scene_gpu::GpuScene;
use crate::uniform::{draw_member, fill_block};

/// One indexed draw.
#[derive(Debug)]
pub(crate) struct DrawItem {
    pub pipeline: wgpu::RenderPipeline,
    pub material_group: Option<wgpu::BindGroup>,
    /// Index into [`DrawList::programs`].
    pub program: usize,
    /// Offset of its `draw` block.
    pub draw_offset: u32,
    /// Index into [`GpuScene::meshes`].
    pub mesh: usize,
    /// Middle of its bounds in the world, to sort by.
    pub center: Vec3,
}

/// What all draws of a program share.
#[derive(Debug)]
pub(crate) struct ProgramBinding {
    pub program: Arc<Program>,
    pub draw_group: Option<wgpu::BindGroup>,
}

/// Everything to draw of a scene.
#[derive(Debug, Default)]
pub(crate) struct DrawList {
    pub programs: Vec<ProgramBinding>,
    /// Hide what lies behind; any order.
    pub opaque: Vec<DrawItem>,
    /// Show what is opaque behind them; to be drawn after it, from far to near.
    pub transmissive: Vec<DrawItem>,
    /// Blended over what lies behind; to be drawn from far to near.
    pub blended: Vec<DrawItem>,
}

/// The program for a material, if there is one.
pub(crate) type FindProgram<'a> = &'a mut dyn FnMut(&Material) -> Option<Arc<Program>>;

impl DrawList {
    /// Whether anything reads what is opaque behind it.
    pub fn reads_scene_color(&self) -> bool {
        self.programs.iter().any(|binding| binding.program.reads_scene_color())
    }

    /// Resolves every draw of the scene; materials without a program are left out.
    pub fn new(gpu: &Gpu, scene: &GpuScene, find_program: FindProgram<'_>) -> Self {
        let mut builder = Builder { gpu, scene, programs: Vec::new(), material_groups: HashMap::new() };
        let mut list = DrawList::default();
        for draw in &scene.scene.draws {
            let Some(primitive) = scene.scene.primitives.get(draw.primitive) else { continue };
            let Some(material) = scene.scene.materials.get(primitive.material) else { continue };
            let Some(program) = find_program(material) else { continue };
            let items = builder.items(draw, primitive.material, material, &program);
            let group = match material.alpha_mode {
                AlphaMode::Blend => &mut list.blended,
                _ if program.reads_scene_color() => &mut list.transmissive,
                _ => &mut list.opaque,
            };
            group.extend(items);
        }
        list.programs = builder.bindings();
        list
    }
}

struct Builder<'a> {
    gpu: &'a Gpu,
    scene: &'a GpuScene,
    /// Programs in use with the `draw` blocks of their draws.
    programs: Vec<(Arc<Program>, Vec<u8>)>,
    material_groups: HashMap<(usize, usize), Option<wgpu::BindGroup>>,
}

impl Builder<'_> {
    fn items(
        &mut self,
        draw: &Draw,
        material_index: usize,
        material: &Material,
        program: &Arc<Program>,
    ) -> Vec<DrawItem> {
        let index = self.program_index(program);
        let draw_offset = self.push_draw_block(index, draw.world);
        let group = self.material_groups.entry((material_index, index));
        let group = group.or_insert_with(|| material_group(self.gpu, program, self.scene, material)).clone();
        let bounds = self.scene.scene.primitives[draw.primitive].bounds;
        let item = |raster| DrawItem {
            pipeline: program.pipeline(&self.gpu.device, raster),
            material_group: group.clone(),
            program: index,
            draw_offset,
            mesh: draw.primitive,
            center: draw.world.transform_point3((bounds.min + bounds.max) / 2.0),
        };
        rasters(draw.world, material).into_iter().map(item).collect()
    }

    fn program_index(&mut self, program: &Arc<Program>) -> usize {
        let known = self.programs.iter().position(|(other, _)| Arc::ptr_eq(other, program));
        known.unwrap_or_else(|| {
            self.programs.push((Arc::clone(program), Vec::new()));
            self.programs.len() - 1
        })
    }

    fn push_draw_block(&mut self, program: usize, world: Mat4) -> u32 {
        let (program, blocks) = &mut self.programs[program];
        let Some((size_bytes, members)) = program.groups[2].first().and_then(|bound| bound.block.as_ref())
        else {
            return 0;
        };
        let offset = blocks.len();
        blocks.extend(fill_block(*size_bytes, members, |name| draw_member(world, name)));
        let alignment = self.gpu.device.limits().min_uniform_buffer_offset_alignment as usize;
        blocks.resize(blocks.len().next_multiple_of(alignment), 0);
        offset as u32
    }

    fn bindings(self) -> Vec<ProgramBinding> {
        let gpu = self.gpu;
        let bind = |(program, blocks): (Arc<Program>, Vec<u8>)| {
            let draw_group = draw_group(gpu, &program, &blocks);
            ProgramBinding { program, draw_group }
        };
        self.programs.into_iter().map(bind).collect()
    }
}

/// How to rasterise a draw. A mirroring transform turns triangles around. A blended surface with two sides is drawn
/// twice, its far side first, because blending needs that order.
fn rasters(world: Mat4, material: &Material) -> Vec<Raster> {
    let mirrored = world.determinant() < 0.0;
    let front_face = if mirrored { wgpu::FrontFace::Cw } else { wgpu::FrontFace::Ccw };
    let blend = material.alpha_mode == AlphaMode::Blend;
    let raster = |cull| Raster { cull, front_face, blend };
    match (material.double_sided, blend) {
        (true, true) => vec![raster(Some(wgpu::Face::Front)), raster(Some(wgpu::Face::Back))],
        (true, false) => vec![raster(None)],
        (false, _) => vec![raster(Some(wgpu::Face::Back))],
    }
}
