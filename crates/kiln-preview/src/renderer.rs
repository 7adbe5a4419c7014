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
use crate::inspector::{Inspector, LastFrame};
use crate::picture::Picture;
use crate::pose::Pose;
use crate::prepare::Prepared;
use crate::program::{Program, Raster, SAMPLE_COUNT};
use crate::scene_color::{Downsampler, SceneColor};
use crate::scene_gpu::GpuScene;
use crate::shadow::{Contents, Frustum, ShadowMap, ShadowReader};
use crate::sun::{Sun, SunValues};
use crate::uniform::FrameValues;
use crate::view::{AnimationTime, Background, Ground, View};

mod channels;

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
    backdrop: BySamples<Backdrop>,
    /// Made for the first view with a floor.
    ground: BySamples<GroundPainter>,
    inspector: Inspector,
    /// Whether probes may ask for the depth of frames.
    pub keeps_depth: bool,
}

/// What passes of several samples a pixel are drawn with, and those of one.
type BySamples<T> = [OnceCell<T>; 2];

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
    /// Of each program of the draws that show channels.
    inspect: Vec<FrameBinding>,
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

/// What the scene is drawn with in a pass, and over what.
struct Look<'a> {
    label: &'static str,
    draws: &'a DrawList,
    /// Of each of the draw list's programs.
    frames: &'a [FrameBinding],
    /// What stands behind it, of the preview's own or the environment; `None` leaves that empty.
    behind: Option<&'a Behind<'a>>,
    /// Whether what is blended is; else it hides what lies behind.
    blends: bool,
    /// What is seen where nothing is drawn.
    empty: wgpu::Color,
    /// Whether the samples are read later.
    keeps_samples: bool,
}

impl Renderer {
    /// A renderer that shows nothing yet. `size` is width and height in pixels.
    pub fn new(gpu: &Gpu, size: [u32; 2]) -> Self {
        let picture = Picture::new(gpu, size, SAMPLE_COUNT);
        Renderer {
            gpu: gpu.clone(),
            picture,
            shown: None,
            downsampler: OnceCell::new(),
            shadow_reader: OnceCell::new(),
            backdrop: BySamples::default(),
            ground: BySamples::default(),
            inspector: Inspector::new(gpu),
            keeps_depth: false,
        }
    }

    /// Changes the picture's size, limited to what the device takes; true if it changed.
    pub fn resize(&mut self, size: [u32; 2]) -> bool {
        self.resize_sampled(size, self.picture.sample_count)
    }

    /// The same with so many samples a pixel: 1 or [`SAMPLE_COUNT`].
    pub fn resize_sampled(&mut self, size: [u32; 2], sample_count: u32) -> bool {
        let size = Picture::allowed_size(&self.gpu, size);
        if (size, sample_count) == (self.picture.size, self.picture.sample_count) {
            return false;
        }
        self.picture = Picture::new(&self.gpu, size, sample_count);
        if let Some(shown) = self.shown.take() {
            self.show(shown.prepared);
        }
        true
    }

    /// Replaces what is shown.
    pub fn show(&mut self, prepared: Arc<Prepared>) {
        let Prepared { draws, environment, inspect, .. } = &*prepared;
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
        let of_channels = inspect.programs.iter().map(|binding| bind(&binding.program, behind)).collect();
        self.shown = Some(Shown {
            background: prepared.background.as_ref().map(|(_, program)| bind(program, None)),
            programs: draws.programs.iter().map(|binding| bind(&binding.program, behind)).collect(),
            tonemap: bind(&prepared.tonemap, Some(&self.picture.hdr)),
            scene_color,
            pose: prepared.scene.as_deref().map(Pose::at_rest),
            written: None,
            shadow,
            inspect: of_channels,
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

    /// Width and height in pixels.
    pub fn size(&self) -> [u32; 2] {
        self.picture.size
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
        let of_materials = || shown.programs.iter().chain(&shown.inspect);
        for frame in shown.background.iter().chain(of_materials()).chain([&shown.tonemap]) {
            frame.write(&self.gpu, &values, &view.parameters);
        }
        if let (Some(scene), Some(pose)) = (&shown.prepared.scene, &shown.pose) {
            let lights = &pose.posed.lights;
            of_materials().for_each(|frame| frame.write_lights(&self.gpu, &scene.scene, lights));
        }
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        shown.sort_copies(&self.gpu, values.camera_position);
        self.inspector.begin();
        self.draw_shadow(&mut encoder, shown, &values, view);
        let behind = self.behind(shown, &values, view);
        let eye = values.camera_position;
        let channel = view.channel.filter(|_| !shown.inspect.is_empty());
        match channel {
            None => self.draw_picture(&mut encoder, shown, view, &behind, eye),
            Some(channel) => self.draw_channel(&mut encoder, shown, channel, &behind, eye),
        }
        self.inspector.end(&mut encoder);
        let mut submission = self.gpu.queue.submit([encoder.finish()]);
        self.inspector.submitted();
        // Faults are those of samples.
        if let Some(limit) = view.fault_limit.filter(|_| self.picture.sample_count == SAMPLE_COUNT) {
            submission = self.mark_faults(shown, limit, eye).unwrap_or(submission);
        }
        let world_from_clip = values.clip_from_world.inverse();
        self.inspector.note_frame(LastFrame { channel, world_from_clip, exposure_ev: view.exposure_ev });
        Some(submission)
    }

    fn draw_picture(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        shown: &Shown,
        view: &View,
        behind: &Behind<'_>,
        eye: Vec3,
    ) {
        let look = |label| Look {
            label,
            draws: &shown.prepared.draws,
            frames: &shown.programs,
            behind: Some(behind),
            blends: true,
            empty: wgpu::Color::BLACK,
            keeps_samples: view.fault_limit.is_some() && shown.inspect.is_empty(),
        };
        match (&shown.scene_color, self.downsampler.get()) {
            (Some(scene_color), Some(downsampler)) => {
                self.draw_scene_color(encoder, shown, (scene_color, downsampler), behind, eye);
                let rest = look("transmissive and blended");
                self.draw_scene(encoder, shown, &rest, Stage::Rest, Some(&self.picture.hdr), eye);
            }
            _ => self.draw_scene(encoder, shown, &look("scene"), Stage::Whole, Some(&self.picture.hdr), eye),
        }
        self.draw_tonemap(encoder, shown);
    }

    /// Draws what is opaque, and its smoother levels, for what transmits light.
    fn draw_scene_color(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        shown: &Shown,
        (scene_color, downsampler): (&SceneColor, &Downsampler),
        behind: &Behind<'_>,
        eye: Vec3,
    ) {
        // Without a background nothing else makes the picture opaque.
        let alpha = if behind.backdrop.is_some() || shown.background.is_some() { 0.0 } else { 1.0 };
        let look = Look {
            label: "opaque",
            draws: &shown.prepared.draws,
            frames: &shown.programs,
            behind: Some(behind),
            blends: true,
            empty: wgpu::Color { a: alpha, ..wgpu::Color::BLACK },
            keeps_samples: true,
        };
        self.draw_scene(encoder, shown, &look, Stage::Opaque, Some(scene_color.base()), eye);
        if self.picture.sample_count == 1 {
            scene_color.copy_base(encoder, &self.picture.radiance);
        }
        downsampler.run(encoder, scene_color, self.inspector.timer.as_ref());
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
            .then(|| self.by_samples(&self.backdrop, Backdrop::new));
        if let Some(backdrop) = backdrop {
            backdrop.write(&self.gpu, view);
        }
        let ground = shown.floor(view).map(|floor| {
            let painter = self.by_samples(&self.ground, GroundPainter::new);
            painter.write(&self.gpu, floor, values, view.background);
            (painter, view.ground)
        });
        Behind { backdrop, ground }
    }

    fn by_samples<'a, T>(&self, made: &'a BySamples<T>, make: impl FnOnce(&Gpu, u32) -> T) -> &'a T {
        let sample_count = self.picture.sample_count;
        made[usize::from(sample_count == 1)].get_or_init(|| make(&self.gpu, sample_count))
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
        let mut pass = shadow.begin(encoder, self.inspector.timed("sun shadow"));
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
        look: &Look<'_>,
        stage: Stage,
        resolved: Option<&wgpu::TextureView>,
        eye: Vec3,
    ) {
        // Samples are the picture then.
        let is_single = self.picture.sample_count == 1;
        let store_if = |is_kept| if is_kept { wgpu::StoreOp::Store } else { wgpu::StoreOp::Discard };
        let color_load =
            if stage == Stage::Rest { wgpu::LoadOp::Load } else { wgpu::LoadOp::Clear(look.empty) };
        let depth_load = if stage == Stage::Rest { wgpu::LoadOp::Load } else { wgpu::LoadOp::Clear(1.0) };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some(look.label),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &self.picture.samples,
                depth_slice: None,
                resolve_target: resolved.filter(|_| !is_single),
                ops: wgpu::Operations { load: color_load, store: store_if(look.keeps_samples || is_single) },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &self.picture.depth,
                depth_ops: Some(wgpu::Operations {
                    load: depth_load,
                    store: store_if(stage == Stage::Opaque || self.keeps_depth),
                }),
                stencil_ops: None,
            }),
            timestamp_writes: self.inspector.timed(look.label),
            ..Default::default()
        });
        // Opaque draws from near to far, so that depth saves shading; others from far to near.
        let Some(pose) = &shown.pose else {
            return look.behind.into_iter().for_each(|behind| self.draw_background(&mut pass, shown, behind));
        };
        let distance = |item: &DrawItem| pose.draws[item.draw].center.distance_squared(eye);
        let near_first = |items| visible(items, pose, |a, b| distance(a).total_cmp(&distance(b)));
        let far_first = |items| visible(items, pose, |a, b| distance(b).total_cmp(&distance(a)));
        let DrawList { opaque, transmissive, blended, .. } = look.draws;
        if stage != Stage::Rest {
            self.draw_items(&mut pass, shown, look, near_first(opaque));
        }
        if stage != Stage::Opaque {
            if let Some(behind) = look.behind {
                self.draw_background(&mut pass, shown, behind);
                self.draw_ground(&mut pass, shown, behind);
            }
            self.draw_items(&mut pass, shown, look, far_first(transmissive));
            self.draw_items(&mut pass, shown, look, far_first(blended));
        }
    }

    /// Fills what is still open. The viewport puts it on the far plane, at whatever depth its author chose.
    fn draw_background(&self, pass: &mut wgpu::RenderPass<'_>, shown: &Shown, behind: &Behind<'_>) {
        if let Some(backdrop) = behind.backdrop {
            return backdrop.draw(pass);
        }
        let (Some((pipeline, program)), Some(frame)) = (&shown.prepared.background, &shown.background) else {
            return;
        };
        let [width, height] = self.picture.size.map(|pixels| pixels as f32);
        pass.set_viewport(0.0, 0.0, width, height, 1.0, 1.0);
        if self.picture.sample_count == SAMPLE_COUNT {
            pass.set_pipeline(pipeline);
        } else {
            let raster = Raster { sample_count: self.picture.sample_count, ..Raster::FULL_SCREEN };
            pass.set_pipeline(&program.pipeline(&self.gpu.device, raster));
        }
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

    fn draw_items(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        shown: &Shown,
        look: &Look<'_>,
        items: Vec<&DrawItem>,
    ) {
        let (Some(scene), Some(pose)) = (&shown.prepared.scene, &shown.pose) else { return };
        for item in items {
            self.draw_item(pass, look, scene, item, pose.draws[item.draw].mirrored);
        }
    }

    fn draw_item(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        look: &Look<'_>,
        scene: &GpuScene,
        item: &DrawItem,
        mirrored: bool,
    ) {
        let blend = item.raster.blend && look.blends;
        let sample_count = self.picture.sample_count;
        let raster = Raster { front_face: front_face(mirrored), blend, sample_count, ..item.raster };
        if raster == item.raster {
            pass.set_pipeline(&item.pipeline);
        } else {
            // Made when an animation first turns the draw inside out, a channel first shows what is blended, or a moving picture
            // first has one sample a pixel.
            let program = &look.draws.programs[item.program].program;
            pass.set_pipeline(&program.pipeline(&self.gpu.device, raster));
        }
        draw_geometry(pass, look.frames, scene, item);
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
            timestamp_writes: self.inspector.timed("tonemap"),
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
        self.prepared.inspect.write(gpu, scene, pose);
        self.written = Some(time);
    }
}
