//! Draws what was prepared into an offscreen picture.

use std::cell::OnceCell;
use std::cmp::Ordering;
use std::sync::Arc;

use glam::{Mat4, Vec3};
use kiln_gpu::Gpu;

use crate::backdrop::Backdrop;
use crate::binding::{FrameBinding, Shared};
use crate::camera::OrbitCamera;
use crate::draw_list::{DrawItem, DrawList, front_face};
use crate::ground::{Floor, GroundPainter};
use crate::pose::Pose;
use crate::prepare::Prepared;
use crate::program::{DEPTH_FORMAT, HDR_FORMAT, OUTPUT_FORMAT, Program, Raster, SAMPLE_COUNT};
use crate::scene_color::{Downsampler, SceneColor};
use crate::scene_gpu::GpuScene;
use crate::shadow::{Contents, Frustum, ShadowMap, ShadowReader};
use crate::sun::{Sun, SunValues};
use crate::uniform::FrameValues;
use crate::view::{AnimationTime, Background, Ground, View};

/// Draws one prepared revision after another; what it shows changes only by [`Renderer::show`].
#[derive(Debug)]
pub(crate) struct Renderer {
    gpu: Gpu,
    picture: Picture,
    shown: Option<Shown>,
    /// Made for the first scene that transmits light.
    downsampler: OnceCell<Downsampler>,
    /// Made for the first program that reads the sun.
    shadow_reader: OnceCell<ShadowReader>,
    /// Made for the first view with another background than the environment.
    backdrop: OnceCell<Backdrop>,
    /// Made for the first view with a floor.
    ground: OnceCell<GroundPainter>,
}

/// What is shown, bound to the picture.
#[derive(Debug)]
struct Shown {
    prepared: Arc<Prepared>,
    background: Option<FrameBinding>,
    /// Of each of the draw list's programs.
    programs: Vec<FrameBinding>,
    tonemap: FrameBinding,
    /// If a program reads it.
    scene_color: Option<SceneColor>,
    pose: Option<Pose>,
    /// What the device has of the pose; `None` = not known.
    written: Option<Option<AnimationTime>>,
    /// If something reads it.
    shadow: Option<ShadowMap>,
}

/// How the scene is drawn: at once, or with a picture of what is opaque between.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Whole,
    Opaque,
    Rest,
}

/// What a view has behind the scene, of the preview's own.
struct Behind<'a> {
    /// Instead of the environment.
    backdrop: Option<&'a Backdrop>,
    ground: Option<(&'a GroundPainter, Ground)>,
}

/// The images a frame goes through.
#[derive(Debug)]
struct Picture {
    size: [u32; 2],
    /// Linear radiance, several samples a pixel.
    samples: wgpu::TextureView,
    /// Linear radiance.
    radiance: wgpu::Texture,
    hdr: wgpu::TextureView,
    depth: wgpu::TextureView,
    output: wgpu::Texture,
    output_view: wgpu::TextureView,
}

impl Renderer {
    /// A renderer that shows nothing yet. `size` is width and height in pixels.
    pub fn new(gpu: &Gpu, size: [u32; 2]) -> Self {
        let picture = Picture::new(gpu, size);
        Renderer {
            gpu: gpu.clone(),
            picture,
            shown: None,
            downsampler: OnceCell::new(),
            shadow_reader: OnceCell::new(),
            backdrop: OnceCell::new(),
            ground: OnceCell::new(),
        }
    }

    /// Changes the picture's size, limited to what the device takes; true if it changed.
    pub fn resize(&mut self, size: [u32; 2]) -> bool {
        let size = Picture::allowed_size(&self.gpu, size);
        if size == self.picture.size {
            return false;
        }
        self.picture = Picture::new(&self.gpu, size);
        if let Some(shown) = self.shown.take() {
            self.show(shown.prepared);
        }
        true
    }

    /// Replaces what is shown.
    pub fn show(&mut self, prepared: Arc<Prepared>) {
        let Prepared { draws, environment, .. } = &*prepared;
        let scene_color = draws.reads_scene_color().then(|| {
            let downsampler = self.downsampler.get_or_init(|| Downsampler::new(&self.gpu));
            SceneColor::new(&self.gpu, downsampler, self.picture.size)
        });
        let reader = draws.reads_sun_shadow() || environment.sun.is_some();
        let reader = reader.then(|| self.shadow_reader.get_or_init(|| ShadowReader::new(&self.gpu)));
        let shadow = reader.filter(|_| environment.sun.is_some());
        let shadow = shadow.map(|reader| ShadowMap::new(&self.gpu, &prepared, reader));
        let read = reader.map(|reader| reader.source(shadow.as_ref()));
        let bind = |program: &Program, picture| {
            FrameBinding::new(&self.gpu, program, &Shared { environment, picture, shadow: read })
        };
        let behind = scene_color.as_ref().map(|scene| &scene.view);
        self.shown = Some(Shown {
            background: prepared.background.as_ref().map(|(_, program)| bind(program, None)),
            programs: draws.programs.iter().map(|binding| bind(&binding.program, behind)).collect(),
            tonemap: bind(&prepared.tonemap, Some(&self.picture.hdr)),
            scene_color,
            pose: prepared.scene.as_deref().map(Pose::at_rest),
            written: None,
            shadow,
            prepared,
        });
    }

    /// Whether frames go through a picture of the opaque scene.
    #[cfg(test)]
    pub fn draws_scene_color(&self) -> bool {
        self.shown.as_ref().is_some_and(|shown| shown.scene_color.is_some())
    }

    /// Whether frames have a pass for what the sun does not reach.
    #[cfg(test)]
    pub fn draws_shadow(&self) -> bool {
        self.shown.as_ref().is_some_and(|shown| shown.shadow.is_some())
    }

    /// The finished picture: `Rgba8Unorm`, sRGB-encoded values.
    pub fn output(&self) -> &wgpu::Texture {
        &self.picture.output
    }

    /// The picture before exposure and tone mapping: `Rgba16Float`, linear.
    pub fn radiance(&self) -> &wgpu::Texture {
        &self.picture.radiance
    }

    /// The same as a view.
    pub fn output_view(&self) -> &wgpu::TextureView {
        &self.picture.output_view
    }

    /// Width / height.
    pub fn aspect(&self) -> f32 {
        self.picture.size[0] as f32 / self.picture.size[1] as f32
    }

    /// Where everything is in the last frame.
    pub fn pose(&self) -> Option<&Pose> {
        self.shown.as_ref()?.pose.as_ref()
    }

    /// Poses the scene anew with the next frame: another renderer posed what they share.
    pub fn forget_pose(&mut self) {
        if let Some(shown) = &mut self.shown {
            shown.written = None;
        }
    }

    /// The camera that `view` asks for.
    pub fn camera(&self, view: &View) -> Option<OrbitCamera> {
        let of_scene = || {
            let shown = self.shown.as_ref()?;
            let bounds = shown.prepared.scene.as_ref()?.scene.bounds;
            let cameras = &shown.pose.as_ref()?.posed.cameras;
            Some(OrbitCamera::for_scene(bounds, cameras, view.scene_camera, self.aspect()))
        };
        view.camera.or_else(of_scene)
    }

    /// Draws a frame and submits it; `None` if nothing was ever shown.
    pub fn render(&mut self, view: &View) -> Option<wgpu::SubmissionIndex> {
        self.shown.as_mut()?.take_pose(&self.gpu, view.animation);
        let shown = self.shown.as_ref()?;
        let values = self.frame_values(shown, view);
        for frame in shown.background.iter().chain(&shown.programs).chain([&shown.tonemap]) {
            frame.write(&self.gpu, &values, &view.parameters);
        }
        if let (Some(scene), Some(pose)) = (&shown.prepared.scene, &shown.pose) {
            let lights = &pose.posed.lights;
            shown.programs.iter().for_each(|frame| frame.write_lights(&self.gpu, &scene.scene, lights));
        }
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        shown.sort_copies(&self.gpu, values.camera_position);
        self.draw_shadow(&mut encoder, shown, &values, view);
        let behind = self.behind(shown, &values, view);
        let eye = values.camera_position;
        match (&shown.scene_color, self.downsampler.get()) {
            (Some(scene_color), Some(downsampler)) => {
                self.draw_scene(&mut encoder, shown, &behind, Stage::Opaque, scene_color.base(), eye);
                downsampler.run(&mut encoder, scene_color);
                self.draw_scene(&mut encoder, shown, &behind, Stage::Rest, &self.picture.hdr, eye);
            }
            _ => self.draw_scene(&mut encoder, shown, &behind, Stage::Whole, &self.picture.hdr, eye),
        }
        self.draw_tonemap(&mut encoder, shown);
        Some(self.gpu.queue.submit([encoder.finish()]))
    }

    fn frame_values(&self, shown: &Shown, view: &View) -> FrameValues {
        let prepared = &shown.prepared;
        let environment = &prepared.environment;
        let bounds = shown.pose.as_ref().and_then(|pose| pose.bounds);
        // What is drawn on the floor reaches farther than the scene.
        let floor = shown.floor(view);
        let bounds = bounds.map(|bounds| floor.map_or(bounds, |floor| floor.beside(bounds)));
        let camera = self.camera(view).unwrap_or(OrbitCamera::BACKGROUND_ONLY);
        FrameValues {
            clip_from_world: camera.clip_from_world(bounds, self.aspect()),
            camera_position: camera.position(),
            exposure: view.exposure_ev.exp2(),
            // The lookup turns the other way round.
            environment_from_world: Mat4::from_rotation_y(-view.environment_rotation_rad),
            environment_intensity: view.environment_intensity,
            specular_level_max: (environment.specular.levels - 1) as f32,
            skybox_scale: environment.skybox.scale,
            irradiance_scale: environment.irradiance.scale,
            specular_scale: environment.specular.scale,
            background_blur: environment.specular.nearest_roughness(view.background_blur),
            viewport_size: self.picture.size.map(|pixels| pixels as f32),
            time_s: view.time_s,
            sun: self.sun(shown, view).map(|(sun, frustum)| SunValues::new(sun, frustum)).unwrap_or_default(),
        }
    }

    /// What the view has behind the scene, its values written.
    fn behind(&self, shown: &Shown, values: &FrameValues, view: &View) -> Behind<'_> {
        let backdrop = (view.background != Background::Environment)
            .then(|| self.backdrop.get_or_init(|| Backdrop::new(&self.gpu)));
        if let Some(backdrop) = backdrop {
            backdrop.write(&self.gpu, view);
        }
        let ground = shown.floor(view).map(|floor| {
            let painter = self.ground.get_or_init(|| GroundPainter::new(&self.gpu));
            painter.write(&self.gpu, floor, values, view.background);
            (painter, view.ground)
        });
        Behind { backdrop, ground }
    }

    /// The sun, and the light that falls on the scene.
    fn sun(&self, shown: &Shown, view: &View) -> Option<(Sun, Frustum)> {
        let sun = shown.prepared.environment.sun?.in_view(view);
        let bounds = shown.pose.as_ref()?.bounds?;
        Some((sun, Frustum::around(bounds, sun.direction)))
    }

    /// Fills the shadow map, if anything reads it.
    fn draw_shadow(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        shown: &Shown,
        values: &FrameValues,
        view: &View,
    ) {
        let (Some(shadow), Some((_, frustum))) = (&shown.shadow, self.sun(shown, view)) else { return };
        if !(shown.prepared.draws.reads_sun_shadow() || view.ground.catches_shadow) {
            return;
        }
        let (Some(scene), Some(pose)) = (&shown.prepared.scene, &shown.pose) else { return };
        // Most frames move the eye alone.
        let animation = shown.written.flatten();
        let contents = Contents { frustum, animation, parameters: view.parameters.clone() };
        if !shadow.takes(contents) && !shown.prepared.is_animated {
            return;
        }
        let values = frustum.values(values);
        shadow.frames.iter().for_each(|frame| frame.write(&self.gpu, &values, &view.parameters));
        let mut pass = shadow.begin(encoder);
        for item in shown.prepared.draws.opaque.iter().filter(|item| pose.draws[item.draw].visible) {
            if let Some(pipeline) = &item.shadow_pipeline {
                pass.set_pipeline(pipeline);
                draw_geometry(&mut pass, &shadow.frames, scene, item);
            }
        }
    }

    fn draw_scene(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        shown: &Shown,
        behind: &Behind<'_>,
        stage: Stage,
        resolved: &wgpu::TextureView,
        eye: Vec3,
    ) {
        // Without a background nothing else makes the picture opaque.
        let empty = wgpu::Color {
            a: if stage == Stage::Opaque && (behind.backdrop.is_some() || shown.background.is_some()) {
                0.0
            } else {
                1.0
            },
            ..wgpu::Color::BLACK
        };
        let store = if stage == Stage::Opaque { wgpu::StoreOp::Store } else { wgpu::StoreOp::Discard };
        let color_load = if stage == Stage::Rest { wgpu::LoadOp::Load } else { wgpu::LoadOp::Clear(empty) };
        let depth_load = if stage == Stage::Rest { wgpu::LoadOp::Load } else { wgpu::LoadOp::Clear(1.0) };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("scene"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &self.picture.samples,
                depth_slice: None,
                resolve_target: Some(resolved),
                ops: wgpu::Operations { load: color_load, store },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &self.picture.depth,
                depth_ops: Some(wgpu::Operations { load: depth_load, store }),
                stencil_ops: None,
            }),
            ..Default::default()
        });
        // Opaque draws from near to far, so that depth saves shading; others from far to near.
        let Some(pose) = &shown.pose else { return self.draw_background(&mut pass, shown, behind) };
        let distance = |item: &DrawItem| pose.draws[item.draw].center.distance_squared(eye);
        let near_first = |items| visible(items, pose, |a, b| distance(a).total_cmp(&distance(b)));
        let far_first = |items| visible(items, pose, |a, b| distance(b).total_cmp(&distance(a)));
        let DrawList { opaque, transmissive, blended, .. } = &shown.prepared.draws;
        if stage != Stage::Rest {
            self.draw_items(&mut pass, shown, near_first(opaque));
        }
        if stage != Stage::Opaque {
            self.draw_background(&mut pass, shown, behind);
            self.draw_ground(&mut pass, shown, behind);
            self.draw_items(&mut pass, shown, far_first(transmissive));
            self.draw_items(&mut pass, shown, far_first(blended));
        }
    }

    /// Fills what is still open. The viewport puts it on the far plane, at whatever depth its author chose.
    fn draw_background(&self, pass: &mut wgpu::RenderPass<'_>, shown: &Shown, behind: &Behind<'_>) {
        if let Some(backdrop) = behind.backdrop {
            return backdrop.draw(pass);
        }
        let (Some((pipeline, _)), Some(frame)) = (&shown.prepared.background, &shown.background) else {
            return;
        };
        let [width, height] = self.picture.size.map(|pixels| pixels as f32);
        pass.set_viewport(0.0, 0.0, width, height, 1.0, 1.0);
        pass.set_pipeline(pipeline);
        frame.set(pass);
        pass.draw(0..3, 0..1);
        pass.set_viewport(0.0, 0.0, width, height, 0.0, 1.0);
    }

    fn draw_ground(&self, pass: &mut wgpu::RenderPass<'_>, shown: &Shown, behind: &Behind<'_>) {
        let Some((painter, ground)) = behind.ground else { return };
        let shadow = shown.shadow.as_ref();
        let shadow = shadow.and_then(|map| Some(self.shadow_reader.get()?.source(Some(map))));
        painter.draw(&self.gpu, pass, ground, &shown.prepared.environment, shadow.as_ref());
    }

    fn draw_items(&self, pass: &mut wgpu::RenderPass<'_>, shown: &Shown, items: Vec<&DrawItem>) {
        let (Some(scene), Some(pose)) = (&shown.prepared.scene, &shown.pose) else { return };
        for item in items {
            self.draw_item(pass, shown, scene, item, pose.draws[item.draw].mirrored);
        }
    }

    fn draw_item(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        shown: &Shown,
        scene: &GpuScene,
        item: &DrawItem,
        mirrored: bool,
    ) {
        let raster = Raster { front_face: front_face(mirrored), ..item.raster };
        if raster == item.raster {
            pass.set_pipeline(&item.pipeline);
        } else {
            // Made when an animation first turns the draw inside out.
            let program = &shown.prepared.draws.programs[item.program].program;
            pass.set_pipeline(&program.pipeline(&self.gpu.device, raster));
        }
        draw_geometry(pass, &shown.programs, scene, item);
    }

    fn draw_tonemap(&self, encoder: &mut wgpu::CommandEncoder, shown: &Shown) {
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("tonemap"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &self.picture.output_view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations::default(),
            })],
            ..Default::default()
        });
        pass.set_pipeline(&shown.prepared.tonemap_pipeline);
        shown.tonemap.set(&mut pass);
        pass.draw(0..3, 0..1);
    }
}

/// Draws with the pipeline that is set. `frames` are those of each program.
fn draw_geometry(
    pass: &mut wgpu::RenderPass<'_>,
    frames: &[FrameBinding],
    scene: &GpuScene,
    item: &DrawItem,
) {
    frames[item.program].set(pass);
    if let Some(group) = &item.material_group {
        pass.set_bind_group(1, group, &[]);
    }
    if let Some(group) = &item.draw_group {
        pass.set_bind_group(2, group, item.draw_offset.as_slice());
    }
    let mesh = &scene.meshes[item.mesh];
    pass.set_vertex_buffer(0, mesh.vertices.slice(..));
    if let Some(influences) = &item.influences {
        pass.set_vertex_buffer(1, influences.slice(..));
    }
    pass.set_index_buffer(mesh.indices.slice(..), wgpu::IndexFormat::Uint32);
    pass.draw_indexed(0..mesh.index_count, 0, 0..item.instance_count);
}

/// What is to be seen, in this order.
fn visible<'a>(
    items: &'a [DrawItem],
    pose: &Pose,
    order: impl Fn(&DrawItem, &DrawItem) -> Ordering,
) -> Vec<&'a DrawItem> {
    let mut items: Vec<&DrawItem> = items.iter().filter(|item| pose.draws[item.draw].visible).collect();
    items.sort_by(|a, b| order(a, b));
    items
}

impl Shown {
    /// Orders copies that are blended over each other; those of one draw are drawn in the order of their matrices.
    fn sort_copies(&self, gpu: &Gpu, eye: Vec3) {
        let (Some(scene), Some(pose)) = (&self.prepared.scene, &self.pose) else { return };
        for item in self.prepared.draws.blended.iter().filter(|item| item.instance_count > 1) {
            scene.sort_copies(gpu, item.draw, pose.draws[item.draw].world, eye);
        }
    }

    /// The floor that the view asks for.
    fn floor(&self, view: &View) -> Option<Floor> {
        let scene = self.prepared.scene.as_ref().filter(|_| view.ground != Ground::default())?;
        scene.scene.bounds.map(Floor::below)
    }

    /// Poses the scene if it is not posed so already; at rest, and without animations, nothing is written.
    fn take_pose(&mut self, gpu: &Gpu, time: Option<AnimationTime>) {
        let (Some(scene), Some(pose)) = (&self.prepared.scene, &mut self.pose) else { return };
        let time = time.filter(|time| time.index < scene.scene.animations.len());
        if scene.scene.animations.is_empty() || self.written == Some(time) {
            return;
        }
        pose.update(scene, time);
        scene.write_deformation(gpu, &pose.posed);
        self.prepared.draws.write(gpu, scene, pose);
        self.written = Some(time);
    }
}

impl Picture {
    fn allowed_size(gpu: &Gpu, size: [u32; 2]) -> [u32; 2] {
        size.map(|pixels| pixels.clamp(1, gpu.device.limits().max_texture_dimension_2d))
    }

    fn new(gpu: &Gpu, size: [u32; 2]) -> Self {
        let size = Self::allowed_size(gpu, size);
        let attachment = wgpu::TextureUsages::RENDER_ATTACHMENT;
        let read = attachment | wgpu::TextureUsages::TEXTURE_BINDING;
        let create = |label, format, sample_count, usage| {
            gpu.device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage,
                view_formats: &[],
            })
        };
        let view = |texture: &wgpu::Texture| texture.create_view(&wgpu::TextureViewDescriptor::default());
        let output = create("output", OUTPUT_FORMAT, 1, read | wgpu::TextureUsages::COPY_SRC);
        let radiance = create("hdr", HDR_FORMAT, 1, read | wgpu::TextureUsages::COPY_SRC);
        Picture {
            size,
            samples: view(&create("samples", HDR_FORMAT, SAMPLE_COUNT, attachment)),
            hdr: view(&radiance),
            radiance,
            depth: view(&create("depth", DEPTH_FORMAT, SAMPLE_COUNT, attachment)),
            output_view: view(&output),
            output,
        }
    }
}
