//! What to draw, with which pipeline and bindings.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::Arc;

use kiln_gpu::Gpu;
use kiln_scene::{AlphaMode, Draw, Effect, EffectSet, Material, Scene, Target};

use crate::binding::{DrawBlocks, MaterialBinding, draw_group};
use crate::pose::Pose;
use crate::program::{Program, Raster};
use crate::scene_gpu::{GpuScene, all_draws};
use crate::slot::Slot;

/// One indexed draw.
#[derive(Debug)]
pub(crate) struct DrawItem {
    /// With the raster state it has at rest.
    pub pipeline: wgpu::RenderPipeline,
    pub raster: Raster,
    pub material_group: Option<wgpu::BindGroup>,
    pub draw_group: Option<wgpu::BindGroup>,
    /// Index into [`DrawList::programs`].
    pub program: usize,
    /// Offset of its `draw` block.
    pub draw_offset: Option<u32>,
    /// Index into [`GpuScene::meshes`].
    pub mesh: usize,
    /// Joints of its vertices, if its program reads them.
    pub influences: Option<wgpu::Buffer>,
    /// Index into [`Pose::draws`].
    pub draw: usize,
    pub instance_count: u32,
    /// Draws its depth for the sun; `None` where none shines or the draw casts no shadow.
    pub shadow_pipeline: Option<wgpu::RenderPipeline>,
}

/// What all draws of a program share.
#[derive(Debug)]
pub(crate) struct ProgramBinding {
    pub program: Arc<Program>,
    blocks: Option<DrawBlocks>,
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
    /// How many draws ask their shader for something that it does not read.
    pub unread: BTreeMap<Effect, usize>,
    /// Materials that some animation changes, by their index in the scene.
    animated_materials: Vec<(usize, MaterialBinding)>,
}

/// The program for a set of effects, if there is one.
pub(crate) type FindProgram<'a> = &'a mut dyn FnMut(&EffectSet) -> Option<Arc<Program>>;

impl DrawList {
    /// Whether anything reads what the sun does not reach.
    pub fn reads_sun_shadow(&self) -> bool {
        self.programs.iter().any(|binding| binding.program.reads_sun_shadow())
    }

    /// Whether anything reads what is opaque behind it.
    pub fn reads_scene_color(&self) -> bool {
        self.programs.iter().any(|binding| binding.program.reads_scene_color())
    }

    /// Resolves every draw of the scene with the materials that it has in `variant`; draws without a program are left out.
    /// `has_sun` if some of them cast shadows.
    pub fn new(
        gpu: &Gpu,
        scene: &GpuScene,
        variant: Option<usize>,
        has_sun: bool,
        find_program: FindProgram<'_>,
    ) -> Self {
        let mut plan = Plan { has_sun, ..Plan::default() };
        for (index, draw) in all_draws(&scene.scene).enumerate() {
            let material = scene.scene.material_of(draw, variant);
            if let Some(program) = find_program(&scene.scene.effects(draw, material)) {
                plan.push(index, material, &program);
            }
        }
        plan.bind(gpu, scene)
    }

    /// Writes where draws are, how they are deformed, and the materials that move.
    pub fn write(&self, gpu: &Gpu, scene: &GpuScene, pose: &Pose) {
        for blocks in self.programs.iter().filter_map(|binding| binding.blocks.as_ref()) {
            blocks.write(gpu, pose);
        }
        for (index, binding) in &self.animated_materials {
            let moved = pose.posed.materials.get(index);
            binding.write(gpu, moved.unwrap_or(&scene.scene.materials[*index]));
        }
    }
}

/// Which draw has which material and program.
#[derive(Default)]
struct Plan {
    /// Draw, material, program.
    draws: Vec<(usize, usize, usize)>,
    /// With the numbers of their draws.
    programs: Vec<(Arc<Program>, Vec<usize>)>,
    has_sun: bool,
}

impl Plan {
    fn push(&mut self, draw: usize, material: usize, program: &Arc<Program>) {
        let known = self.programs.iter().position(|(other, _)| Arc::ptr_eq(other, program));
        let index = known.unwrap_or_else(|| {
            self.programs.push((Arc::clone(program), Vec::new()));
            self.programs.len() - 1
        });
        self.programs[index].1.push(draw);
        self.draws.push((draw, material, index));
    }

    fn bind(self, gpu: &Gpu, scene: &GpuScene) -> DrawList {
        let pose = Pose::at_rest(scene);
        let bind = |(program, draws): (Arc<Program>, Vec<usize>)| {
            let blocks = DrawBlocks::new(gpu, &program, draws, &pose);
            ProgramBinding { program, blocks }
        };
        let programs = self.programs.into_iter().map(bind).collect();
        let mut list = DrawList { programs, ..DrawList::default() };
        let mut groups = Groups { gpu, scene, materials: HashMap::new(), draws: HashMap::new() };
        let draws: Vec<&Draw> = all_draws(&scene.scene).collect();
        for (index, material, program) in self.draws {
            let draw = draws[index];
            let ProgramBinding { program: shared, blocks } = &list.programs[program];
            for effect in unread(draw, shared) {
                *list.unread.entry(effect).or_default() += 1;
            }
            let material_group = groups.of_material((material, program), shared);
            let draw_group = groups.of_draw((index, program), shared, blocks.as_ref(), draw);
            let copies = if shared.reads_of_draw(Slot::Instances) { draw.instances.len().max(1) } else { 1 };
            let influences = shared.reads_influences().then(|| scene.influences(gpu, draw.primitive));
            let material = &scene.scene.materials[material];
            let casts_shadow =
                self.has_sun && material.alpha_mode != AlphaMode::Blend && !shared.reads_scene_color();
            let is_masked = matches!(material.alpha_mode, AlphaMode::Mask { .. });
            let item = |raster| DrawItem {
                pipeline: shared.pipeline(&gpu.device, raster),
                raster,
                material_group: material_group.clone(),
                draw_group: draw_group.clone(),
                program,
                draw_offset: blocks.as_ref().map(|blocks| blocks.offset_of(index)),
                mesh: draw.primitive,
                influences: influences.clone(),
                draw: index,
                instance_count: copies as u32,
                shadow_pipeline: casts_shadow.then(|| shared.shadow_pipeline(&gpu.device, is_masked)),
            };
            let items = rasters(pose.draws[index].mirrored, material).into_iter().map(item);
            let group = match material.alpha_mode {
                AlphaMode::Blend => &mut list.blended,
                _ if shared.reads_scene_color() => &mut list.transmissive,
                _ => &mut list.opaque,
            };
            group.extend(items);
        }
        let animated = animated_materials(&scene.scene);
        let bindings = groups.materials.into_iter().map(|((material, _), binding)| (material, binding));
        list.animated_materials = bindings.filter(|(material, _)| animated.contains(material)).collect();
        list
    }
}

/// Bind groups that draws may share.
struct Groups<'a> {
    gpu: &'a Gpu,
    scene: &'a GpuScene,
    /// By material and program.
    materials: HashMap<(usize, usize), MaterialBinding>,
    /// By program, and by draw where each has its own.
    draws: HashMap<(usize, Option<usize>), Option<wgpu::BindGroup>>,
}

impl Groups<'_> {
    fn of_material(&mut self, key: (usize, usize), program: &Program) -> Option<wgpu::BindGroup> {
        let material = &self.scene.scene.materials[key.0];
        let binding = self.materials.entry(key);
        let binding =
            binding.or_insert_with(|| MaterialBinding::new(self.gpu, program, self.scene, material));
        binding.group.clone()
    }

    fn of_draw(
        &mut self,
        (index, program_index): (usize, usize),
        program: &Program,
        blocks: Option<&DrawBlocks>,
        draw: &Draw,
    ) -> Option<wgpu::BindGroup> {
        let has_its_own = program.groups[2].iter().any(|bound| bound.slot.is_stored());
        let group = self.draws.entry((program_index, has_its_own.then_some(index)));
        group.or_insert_with(|| draw_group(self.gpu, program, blocks, self.scene, (index, draw))).clone()
    }
}

/// What a draw's geometry calls for and its program knows nothing of.
fn unread(draw: &Draw, program: &Program) -> impl Iterator<Item = Effect> {
    let is_read = |effect: &Effect| match effect {
        Effect::Skin => program.reads_of_draw(Slot::JointMatrices),
        Effect::Morph => program.reads_of_draw(Slot::MorphDeltas),
        Effect::Instancing => program.reads_of_draw(Slot::Instances),
        _ => true,
    };
    draw.effects().into_iter().filter(move |effect| !is_read(effect))
}

fn animated_materials(scene: &Scene) -> BTreeSet<usize> {
    let channels = scene.animations.iter().flat_map(|animation| &animation.channels);
    let material = |target: Target| match target {
        Target::Material { material, .. } => Some(material),
        _ => None,
    };
    channels.filter_map(|channel| material(channel.target)).collect()
}

/// How to rasterise a draw. A blended surface with two sides is drawn twice, its far side first, because blending needs
/// that order.
fn rasters(mirrored: bool, material: &Material) -> Vec<Raster> {
    let blend = material.alpha_mode == AlphaMode::Blend;
    let raster = |cull| Raster { cull, front_face: front_face(mirrored), blend, ..Raster::FULL_SCREEN };
    match (material.double_sided, blend) {
        (true, true) => vec![raster(Some(wgpu::Face::Front)), raster(Some(wgpu::Face::Back))],
        (true, false) => vec![raster(None)],
        (false, _) => vec![raster(Some(wgpu::Face::Back))],
    }
}

/// A mirroring transform turns triangles around.
pub(crate) fn front_face(mirrored: bool) -> wgpu::FrontFace {
    if mirrored { wgpu::FrontFace::Cw } else { wgpu::FrontFace::Ccw }
}
