//! A compiled shader: its interface checked by name, its layouts, and its pipelines per raster state.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use kiln_diagnostic::Diagnostic;
use kiln_gpu::Gpu;
use kiln_shader::{Binding, BindingKind, Member, Override, Reflection, Stage};

use crate::keeper::make_checked;
use crate::lights;
use crate::own::{OwnGroup, OwnTextures};
use crate::parameter::{OfferedParameter, ParameterValues, offered};
use crate::slot::Slot;
use crate::sun::SunValues;
use crate::target::Role;
use crate::uniform::{FrameValues, InspectValues, Value, draw_member, long_type_name, material_member};
use crate::vertex_input::VertexInputs;

/// Format of the image that material and background shaders write.
pub(crate) const HDR_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;
/// Format of the image that the tonemap writes: sRGB-encoded values in a texture that does not encode.
pub(crate) const OUTPUT_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
/// Format of the depth buffer; 0 is near.
pub(crate) const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
/// Samples a pixel of the image that material and background shaders write.
pub(crate) const SAMPLE_COUNT: u32 = 4;

/// Largest uniform block accepted; wgpu's default limit.
const UNIFORM_BYTES_MAX: u32 = 65536;

/// Groups of `docs/shader-interface.md`.
const GROUP_COUNT: usize = 4;

/// How triangles of a material are rasterised and blended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Raster {
    pub cull: Option<wgpu::Face>,
    pub front_face: wgpu::FrontFace,
    pub blend: bool,
    /// Samples a pixel.
    pub sample_count: u32,
}

impl Raster {
    /// For the triangle that covers the screen.
    pub const FULL_SCREEN: Raster =
        Raster { cull: None, front_face: wgpu::FrontFace::Ccw, blend: false, sample_count: SAMPLE_COUNT };

    /// The one that a shader of this role is most likely drawn with.
    pub fn of_role(role: Role) -> Self {
        match role {
            Role::Material => Raster { cull: Some(wgpu::Face::Back), ..Self::FULL_SCREEN },
            Role::Background | Role::Tonemap => Self::FULL_SCREEN,
        }
    }
}

/// A binding whose name is known.
#[derive(Clone, Debug)]
pub(crate) struct Bound {
    pub binding: u32,
    pub slot: Slot,
    /// The variable's name.
    pub name: String,
    /// Of uniforms: size and members.
    pub block: Option<(u32, Vec<Member>)>,
}

impl Bound {
    /// Whether it is the frame's block and has the time.
    pub fn reads_time(&self) -> bool {
        let members = self.block.as_ref().map_or(&[][..], |(_, members)| members);
        self.slot == Slot::Frame && members.iter().any(|member| member.name == "time_s")
    }

    /// How many lights fit, if it is their block.
    pub fn light_capacity(&self) -> Option<usize> {
        let (size_bytes, members) = self.block.as_ref().filter(|_| self.slot == Slot::Lights)?;
        lights::capacity(*size_bytes, members).ok()
    }
}

/// A shader module ready to make pipelines.
#[derive(Debug)]
pub(crate) struct Program {
    /// Of the target.
    name: String,
    role: Role,
    module: wgpu::ShaderModule,
    inputs: VertexInputs,
    /// Bindings by group.
    pub groups: [Vec<Bound>; GROUP_COUNT],
    /// Layouts by group; `None` where nothing is declared.
    pub layouts: [Option<wgpu::BindGroupLayout>; GROUP_COUNT],
    /// Group 3: the author's parameters and textures.
    pub own_group: Option<Arc<OwnGroup>>,
    /// What the author offers to be changed.
    pub parameters: Vec<OfferedParameter>,
    /// What of it cannot be.
    pub notes: Vec<String>,
    overrides: Vec<Override>,
    pipeline_layout: wgpu::PipelineLayout,
    pipelines: Mutex<Pipelines>,
}

/// Pipelines with one set of constants: a slider on its way leaves none behind.
#[derive(Debug)]
struct Pipelines {
    constants: Vec<(String, f64)>,
    by_raster: HashMap<Raster, wgpu::RenderPipeline>,
    /// Depth alone, by whether fragments may be discarded.
    of_shadow: HashMap<bool, wgpu::RenderPipeline>,
}

impl Program {
    /// Checks the interface and creates module and layouts. Faults that wgpu finds go to the error scope.
    pub fn new(
        gpu: &Gpu,
        name: &str,
        role: Role,
        (wgsl, reflection): (&str, &Reflection),
        own: &OwnTextures,
    ) -> Result<Self, Diagnostic> {
        let device = &gpu.device;
        check_entry_points(name, reflection)?;
        let inputs = VertexInputs::new(name, role, reflection)?;
        let groups = check_bindings(name, role, &reflection.bindings)?;
        check_storage(gpu, name, &groups[2])?;
        own.check(name, &groups[3])?;
        let layouts =
            [0, 1, 2, 3].map(|group| create_layout(device, name, group, &groups[group], reflection));
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(name),
            bind_group_layouts: &layouts.each_ref().map(Option::as_ref),
            immediate_size: 0,
        });
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(name),
            source: wgpu::ShaderSource::Wgsl(wgsl.into()),
        });
        let (parameters, notes) = offered(shader_of(name), reflection);
        let own_group = own.group(gpu, layouts[3].as_ref(), &groups[3], &parameters).map(Arc::new);
        let overrides = reflection.overrides.clone();
        let constants = constants(&parameters, &overrides, &ParameterValues::default());
        Ok(Program {
            name: name.to_owned(),
            role,
            module,
            inputs,
            groups,
            layouts,
            own_group,
            parameters,
            notes,
            overrides,
            pipeline_layout,
            pipelines: Mutex::new(Pipelines {
                constants,
                by_raster: HashMap::new(),
                of_shadow: HashMap::new(),
            }),
        })
    }

    /// Makes pipelines with these values of the overrides from now on; with the ones before where the device refuses.
    pub fn specialise(&self, gpu: &Gpu, values: &ParameterValues) -> Result<(), Diagnostic> {
        let constants = constants(&self.parameters, &self.overrides, values);
        if self.pipelines().constants == constants {
            return Ok(());
        }
        let raster = Raster::of_role(self.role);
        // Made without holding the lock: it may take long.
        let made =
            make_checked(gpu, &self.name, || Ok(self.create_pipeline(&gpu.device, raster, &constants)));
        let pipeline = made.map_err(|fault| {
            let set: Vec<String> =
                constants.iter().map(|(name, value)| format!("{name} = {value}")).collect();
            fault.with_note(format!("its overrides were set: {}", set.join(", ")))
        })?;
        *self.pipelines() =
            Pipelines { constants, by_raster: [(raster, pipeline)].into(), of_shadow: HashMap::new() };
        Ok(())
    }

    fn pipelines(&self) -> MutexGuard<'_, Pipelines> {
        self.pipelines.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The pipeline for a raster state, created on first use.
    pub fn pipeline(&self, device: &wgpu::Device, raster: Raster) -> wgpu::RenderPipeline {
        let mut pipelines = self.pipelines();
        let Pipelines { constants, by_raster, .. } = &mut *pipelines;
        by_raster.entry(raster).or_insert_with(|| self.create_pipeline(device, raster, constants)).clone()
    }

    /// The pipeline that draws depth alone, created on first use. Both sides of a surface cast its shadow; `is_masked` runs the
    /// fragment stage for what it discards.
    pub fn shadow_pipeline(&self, device: &wgpu::Device, is_masked: bool) -> wgpu::RenderPipeline {
        let mut pipelines = self.pipelines();
        let Pipelines { constants, of_shadow, .. } = &mut *pipelines;
        let create = || self.create_shadow_pipeline(device, is_masked, constants);
        of_shadow.entry(is_masked).or_insert_with(create).clone()
    }

    /// Whether it reads the sun.
    pub fn reads_sun(&self) -> bool {
        self.groups[0].iter().any(|bound| bound.slot == Slot::Sun)
    }

    /// Whether it reads what the sun does not reach.
    pub fn reads_sun_shadow(&self) -> bool {
        self.groups[0].iter().any(|bound| bound.slot == Slot::SunShadow)
    }

    /// Name of its target.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Whether pictures change with time.
    pub fn reads_time(&self) -> bool {
        self.groups[0].iter().any(Bound::reads_time)
    }

    /// Whether it reads what is drawn before it.
    pub fn reads_scene_color(&self) -> bool {
        self.groups[0].iter().any(|bound| bound.slot == Slot::SceneColor)
    }

    /// How many punctual lights it draws, if it draws any.
    pub fn light_capacity(&self) -> Option<usize> {
        self.groups[0].iter().find_map(Bound::light_capacity)
    }

    /// Whether it reads the joints that vertices hang on.
    pub fn reads_influences(&self) -> bool {
        self.inputs.reads_influences()
    }

    /// Whether it declares `slot` in group 2.
    pub fn reads_of_draw(&self, slot: Slot) -> bool {
        self.groups[2].iter().any(|bound| bound.slot == slot)
    }

    fn create_pipeline(
        &self,
        device: &wgpu::Device,
        raster: Raster,
        constants: &[(String, f64)],
    ) -> wgpu::RenderPipeline {
        let constants: Vec<(&str, f64)> =
            constants.iter().map(|(name, value)| (name.as_str(), *value)).collect();
        let options = wgpu::PipelineCompilationOptions { constants: &constants, ..Default::default() };
        let buffers = self.inputs.layouts();
        let is_tonemap = self.role == Role::Tonemap;
        device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: None,
            layout: Some(&self.pipeline_layout),
            vertex: wgpu::VertexState {
                module: &self.module,
                entry_point: Some("vs_main"),
                compilation_options: options.clone(),
                buffers: if self.role == Role::Material { &buffers } else { &[] },
            },
            primitive: wgpu::PrimitiveState {
                cull_mode: raster.cull,
                front_face: raster.front_face,
                ..Default::default()
            },
            depth_stencil: (!is_tonemap).then(|| self.depth_state(raster)),
            multisample: wgpu::MultisampleState {
                count: if is_tonemap { 1 } else { raster.sample_count },
                ..Default::default()
            },
            fragment: Some(wgpu::FragmentState {
                module: &self.module,
                entry_point: Some("fs_main"),
                compilation_options: options,
                targets: &[Some(wgpu::ColorTargetState {
                    format: if is_tonemap { OUTPUT_FORMAT } else { HDR_FORMAT },
                    blend: raster.blend.then_some(wgpu::BlendState::ALPHA_BLENDING),
                    write_mask: wgpu::ColorWrites::ALL,
                })],
            }),
            multiview_mask: None,
            cache: None,
        })
    }

    fn create_shadow_pipeline(
        &self,
        device: &wgpu::Device,
        is_masked: bool,
        constants: &[(String, f64)],
    ) -> wgpu::RenderPipeline {
        let constants: Vec<(&str, f64)> =
            constants.iter().map(|(name, value)| (name.as_str(), *value)).collect();
        let options = wgpu::PipelineCompilationOptions { constants: &constants, ..Default::default() };
        let buffers = self.inputs.layouts();
        device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("sun shadow"),
            layout: Some(&self.pipeline_layout),
            vertex: wgpu::VertexState {
                module: &self.module,
                entry_point: Some("vs_main"),
                compilation_options: options.clone(),
                buffers: &buffers,
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: Some(self.depth_state(Raster::of_role(Role::Material))),
            multisample: wgpu::MultisampleState::default(),
            fragment: is_masked.then_some(wgpu::FragmentState {
                module: &self.module,
                entry_point: Some("fs_main"),
                compilation_options: options,
                targets: &[],
            }),
            multiview_mask: None,
            cache: None,
        })
    }

    /// The background lies on the far plane, where the cleared depth is too, and hides nothing.
    fn depth_state(&self, raster: Raster) -> wgpu::DepthStencilState {
        let is_material = self.role == Role::Material;
        let compare =
            if is_material { wgpu::CompareFunction::Less } else { wgpu::CompareFunction::LessEqual };
        wgpu::DepthStencilState {
            format: DEPTH_FORMAT,
            depth_write_enabled: Some(is_material && !raster.blend),
            depth_compare: Some(compare),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }
    }
}

/// `pbr` of `shader/pbr/base`.
fn shader_of(target: &str) -> &str {
    target.split('/').nth(1).unwrap_or(target)
}

/// Pipeline constants by what WGSL knows them by, their `@id` if they have one. Those that are as the shader has them are left out.
fn constants(
    parameters: &[OfferedParameter],
    overrides: &[Override],
    values: &ParameterValues,
) -> Vec<(String, f64)> {
    let constant = |parameter: &OfferedParameter| {
        let declared = overrides.iter().find(|constant| constant.name == parameter.name)?;
        let value = *values.of(parameter).first()?;
        let key = declared.id.map_or_else(|| declared.name.clone(), |id| id.to_string());
        (declared.default != Some(value)).then_some((key, value))
    };
    parameters.iter().filter(|parameter| parameter.is_override).filter_map(constant).collect()
}

fn check_entry_points(name: &str, reflection: &Reflection) -> Result<(), Diagnostic> {
    for (entry, stage) in [("vs_main", Stage::Vertex), ("fs_main", Stage::Fragment)] {
        if !reflection.entry_points.iter().any(|point| point.name == entry && point.stage == stage) {
            return Err(Diagnostic::error(format!("`{name}` has no entry point `{entry}`")).with_note(
                "every shader needs the vertex entry `vs_main` and the fragment entry `fs_main`",
            ));
        }
    }
    Ok(())
}

/// Devices of the OpenGL ES 3.0 class have no storage buffers, at least none in vertex shaders.
fn check_storage(gpu: &Gpu, name: &str, of_draw: &[Bound]) -> Result<(), Diagnostic> {
    let names: Vec<&str> =
        of_draw.iter().filter(|bound| bound.slot.is_stored()).map(|bound| bound.name.as_str()).collect();
    let flags = gpu.adapter.get_downlevel_capabilities().flags;
    let has_any = flags.contains(wgpu::DownlevelFlags::VERTEX_STORAGE);
    let count_max = if has_any { gpu.device.limits().max_storage_buffers_per_shader_stage } else { 0 };
    if names.len() <= count_max as usize {
        return Ok(());
    }
    let read = names.join(", ");
    let message = format!("`{name}` reads the storage buffers {read}; vertex shaders have {count_max} here");
    let help = "forbid skin, morph or instancing in [effects], or draw on another device";
    Err(Diagnostic::error(message).with_note(gpu.description()).with_help(help))
}

fn check_bindings(
    shader: &str,
    role: Role,
    bindings: &[Binding],
) -> Result<[Vec<Bound>; GROUP_COUNT], Diagnostic> {
    let mut groups: [Vec<Bound>; GROUP_COUNT] = Default::default();
    for binding in bindings {
        let slot = check_binding(shader, role, binding)?;
        let block = match &binding.kind {
            BindingKind::Uniform { size_bytes, members } => {
                check_members(shader, slot, &binding.name, *size_bytes, members)?;
                Some((*size_bytes, members.clone()))
            }
            _ => None,
        };
        let name = binding.name.clone();
        groups[slot.group() as usize].push(Bound { binding: binding.binding, slot, name, block });
    }
    Ok(groups)
}

fn check_binding(shader: &str, role: Role, binding: &Binding) -> Result<Slot, Diagnostic> {
    let name = &binding.name;
    if let Some(own) = Slot::of_own(binding) {
        return Ok(own);
    }
    let Some(slot) = Slot::from_name(name) else {
        return Err(Diagnostic::error(format!("`{shader}` declares `{name}`, which Kiln does not know"))
            .with_help(
                "names that can be bound are listed in docs/shader-interface.md; your own stand in group 3",
            ));
    };
    let is_of_material = [1, 2].contains(&slot.group())
        || matches!(
            slot,
            Slot::Lights
                | Slot::Inspect
                | Slot::SceneColor
                | Slot::Sun
                | Slot::SunShadow
                | Slot::SunShadowSampler
        );
    if is_of_material && role != Role::Material {
        return Err(Diagnostic::error(format!("`{shader}` declares `{name}`, which only materials have")));
    }
    if slot == Slot::HdrColor && role != Role::Tonemap {
        return Err(Diagnostic::error(format!(
            "`{shader}` declares `{name}`, which only a tonemap can read"
        )));
    }
    if binding.group != slot.group() {
        let message =
            format!("`{shader}` declares `{name}` in group {}; its group is {}", binding.group, slot.group());
        return Err(Diagnostic::error(message));
    }
    if !slot.accepts(&binding.kind) {
        let message = format!("`{shader}` declares `{name}` as something else than a {}", slot.expects());
        return Err(Diagnostic::error(message).with_note(format!("it declares {:?}", binding.kind)));
    }
    Ok(slot)
}

fn check_members(
    shader: &str,
    slot: Slot,
    block: &str,
    size_bytes: u32,
    members: &[Member],
) -> Result<(), Diagnostic> {
    if size_bytes == 0 || size_bytes > UNIFORM_BYTES_MAX {
        let message =
            format!("`{shader}` declares `{block}` of {size_bytes} bytes; 1 to {UNIFORM_BYTES_MAX} fit");
        return Err(Diagnostic::error(message));
    }
    if slot == Slot::Params {
        return Ok(());
    }
    if slot == Slot::Lights {
        let declares = |expected| format!("`{shader}` declares `{block}` otherwise than as {expected}");
        return lights::capacity(size_bytes, members)
            .map(drop)
            .map_err(|expected| Diagnostic::error(declares(expected)));
    }
    // A leading underscore marks padding: it stays zero.
    for member in members.iter().filter(|member| !member.name.starts_with('_')) {
        let name = &member.name;
        let Some(value) = example_of(slot, name) else {
            let message = format!("`{shader}` declares `{block}.{name}`, which Kiln does not know");
            return Err(Diagnostic::error(message)
                .with_help("members are listed in docs/shader-interface.md; padding begins with `_`"));
        };
        if long_type_name(&member.ty) != value.wgsl_type() {
            let message = format!(
                "`{shader}` declares `{block}.{name}` as {}; it is a {}",
                member.ty,
                value.wgsl_type()
            );
            return Err(Diagnostic::error(message));
        }
    }
    Ok(())
}

/// Some value of the member, for its type.
fn example_of(slot: Slot, member: &str) -> Option<Value> {
    match slot {
        Slot::Frame => FrameValues::default().member(member),
        Slot::Inspect => InspectValues::default().member(member),
        Slot::Material => material_member(&crate::neutral::material(), member),
        Slot::Sun => SunValues::default().member(member),
        Slot::Draw => draw_member(glam::Mat4::IDENTITY, member),
        _ => None,
    }
}

fn create_layout(
    device: &wgpu::Device,
    name: &str,
    group: usize,
    bounds: &[Bound],
    reflection: &Reflection,
) -> Option<wgpu::BindGroupLayout> {
    if bounds.is_empty() {
        return None;
    }
    let stages = |binding: u32| {
        let found =
            reflection.bindings.iter().find(|other| (other.group, other.binding) == (group as u32, binding));
        found.map_or(wgpu::ShaderStages::NONE, |binding| shader_stages(&binding.stages))
    };
    let entry = |bound: &Bound| wgpu::BindGroupLayoutEntry {
        binding: bound.binding,
        visibility: stages(bound.binding),
        ty: binding_type(bound),
        count: None,
    };
    let entries: Vec<_> = bounds.iter().map(entry).collect();
    Some(
        device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some(name),
            entries: &entries,
        }),
    )
}

fn shader_stages(stages: &[Stage]) -> wgpu::ShaderStages {
    let one = |stage: &Stage| match stage {
        Stage::Vertex => wgpu::ShaderStages::VERTEX,
        Stage::Fragment => wgpu::ShaderStages::FRAGMENT,
        Stage::Compute => wgpu::ShaderStages::COMPUTE,
    };
    stages.iter().map(one).fold(wgpu::ShaderStages::NONE, |all, stage| all | stage)
}

fn binding_type(bound: &Bound) -> wgpu::BindingType {
    let texture = |view_dimension| wgpu::BindingType::Texture {
        sample_type: wgpu::TextureSampleType::Float { filterable: true },
        view_dimension,
        multisampled: false,
    };
    match bound.slot {
        Slot::Frame
        | Slot::Lights
        | Slot::Inspect
        | Slot::Sun
        | Slot::Material
        | Slot::Draw
        | Slot::Params => {
            wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Uniform,
                // Draws share one buffer, each at its own offset.
                has_dynamic_offset: bound.slot == Slot::Draw,
                min_binding_size: bound.block.as_ref().and_then(|(size, _)| u64::from(*size).try_into().ok()),
            }
        }
        Slot::JointMatrices | Slot::MorphDeltas | Slot::MorphWeights | Slot::Instances => {
            wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Storage { read_only: true },
                has_dynamic_offset: false,
                min_binding_size: None,
            }
        }
        Slot::EnvSkybox | Slot::EnvIrradiance | Slot::EnvSpecular | Slot::EnvSheen => {
            texture(wgpu::TextureViewDimension::Cube)
        }
        Slot::LutGgx
        | Slot::LutCharlie
        | Slot::HdrColor
        | Slot::SceneColor
        | Slot::MaterialTexture(_)
        | Slot::OwnTexture => texture(wgpu::TextureViewDimension::D2),
        Slot::SunShadow => wgpu::BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Depth,
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        },
        Slot::SunShadowSampler => wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Comparison),
        Slot::EnvSampler | Slot::LutSampler | Slot::MaterialSampler(_) | Slot::OwnSampler => {
            wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering)
        }
    }
}
