//! From a revision to device resources, away from the thread that draws.

use std::collections::HashMap;
use std::sync::Arc;

use kiln_diagnostic::Diagnostic;
use kiln_gpu::Gpu;
use kiln_link::{Revision, Target};
use kiln_scene::{Effect, EffectSet, Material, variant_name};
use kiln_shader::Reflection;

use crate::draw_list::DrawList;
use crate::harmonics;
use crate::inspect::{self, InspectionState};
use crate::keeper::{Keeper, Key};
use crate::material_list;
use crate::neutral;
use crate::own::OwnTextures;
use crate::parameter::{OfferedParameter, ParameterValues};
use crate::program::{Program, Raster};
use crate::report::{ApplyReport, choose, describe};
use crate::scene_gpu::{GpuScene, all_draws};
use crate::sun::Sun;
use crate::target::{CubeMeta, LutMeta, ProjectMeta, Role, SceneMeta, ShaderMeta, read_meta};
use crate::texture::{CubeTexture, LutTexture, create_trilinear_sampler};
use crate::upload::Uploader;
use crate::view::{DiffuseSource, Selection};

/// The environment as shaders read it.
#[derive(Clone, Debug)]
pub(crate) struct Environment {
    pub skybox: Arc<CubeTexture>,
    pub irradiance: Arc<CubeTexture>,
    pub specular: Arc<CubeTexture>,
    pub sheen: Arc<CubeTexture>,
    pub lut_ggx: Arc<LutTexture>,
    pub lut_charlie: Arc<LutTexture>,
    pub sampler: wgpu::Sampler,
    /// If it is a light of its own.
    pub sun: Option<Sun>,
}

/// One selection of a revision, ready to be drawn.
#[derive(Debug)]
pub(crate) struct Prepared {
    pub report: ApplyReport,
    pub environment: Environment,
    pub scene: Option<Arc<GpuScene>>,
    pub draws: DrawList,
    pub background: Option<(wgpu::RenderPipeline, Arc<Program>)>,
    pub tonemap: Arc<Program>,
    pub tonemap_pipeline: wgpu::RenderPipeline,
    /// Whether a shader in use reads the time.
    pub is_animated: bool,
    /// The same scene with the variants that show channels; empty where nobody asked for them.
    pub inspect: DrawList,
}

/// Makes [`Prepared`]s and keeps what several of them share.
#[derive(Debug)]
pub(crate) struct Preparer {
    uploader: Uploader,
    cubes: Keeper<CubeTexture>,
    luts: Keeper<LutTexture>,
    scenes: Keeper<GpuScene>,
    programs: Keeper<Program>,
    /// What pipelines are made with.
    parameters: ParameterValues,
    neutral_cube: Arc<CubeTexture>,
    neutral_lut: Arc<LutTexture>,
    neutral_tonemap: Option<Arc<Program>>,
    sampler: wgpu::Sampler,
}

impl Preparer {
    /// Makes the neutral resources.
    pub fn new(gpu: &Gpu) -> Self {
        let uploader = Uploader::new(gpu);
        let (tonemap, _) = gpu.catch_errors(|| {
            let (wgsl, reflection) = (neutral::TONEMAP_WGSL, neutral::tonemap_reflection());
            let own = OwnTextures::none(gpu);
            Program::new(gpu, "built-in tonemap", Role::Tonemap, (wgsl, &reflection), &own)
        });
        Preparer {
            cubes: Keeper::default(),
            luts: Keeper::default(),
            scenes: Keeper::default(),
            programs: Keeper::default(),
            parameters: ParameterValues::default(),
            neutral_cube: Arc::new(CubeTexture::neutral(&uploader)),
            neutral_lut: Arc::new(LutTexture::neutral(&uploader)),
            neutral_tonemap: tonemap.ok().map(Arc::new),
            sampler: create_trilinear_sampler(gpu),
            uploader,
        }
    }

    /// Runs `work` whenever the device is done with a piece of what it needs.
    #[cfg(test)]
    pub fn after_piece(&mut self, work: impl Fn() + Send + 'static) {
        self.uploader.after_piece(work);
    }

    /// Makes everything that drawing the selection needs, or takes it over from earlier, with these values of overrides. `None`
    /// only if the device does not even accept the built-in tonemap.
    pub fn prepare(
        &mut self,
        revision: &Revision,
        selection: &Selection,
        parameters: &ParameterValues,
    ) -> Option<Prepared> {
        self.parameters = parameters.overrides();
        let mut report = describe(revision);
        let scene_name = choose(selection.scene.as_deref(), None, &report.scenes, "scene", &mut report.notes);
        let meta = scene_name.as_ref().and_then(|name| scene_meta(revision, name, &mut report));
        let scene = scene_name.as_ref().and_then(|name| self.scene(revision, name, &mut report));
        let scene_env = meta.as_ref().and_then(|meta| meta.env.as_deref());
        let env = choose(selection.env.as_deref(), scene_env, &report.envs, "environment", &mut report.notes);
        let is_cloth = |material: &Material| material.effects.contains(&Effect::Sheen);
        let has_cloth = scene.as_ref().is_some_and(|scene| scene.scene.materials.iter().any(is_cloth));
        let mut environment = self.environment(revision, env.as_deref(), has_cloth, &mut report);
        if let (DiffuseSource::Harmonics, Some(env)) = (selection.diffuse, &env) {
            let harmonics = self.harmonics(revision, &format!("env/{env}/sh"), &mut report);
            environment.irradiance = harmonics.unwrap_or(environment.irradiance);
        }
        let tonemap = self.full_screen_program(revision, Role::Tonemap, &mut report);
        let tonemap = tonemap.or_else(|| self.neutral_tonemap.clone())?;
        let tonemap_pipeline = tonemap.pipeline(&self.uploader.gpu.device, Raster::FULL_SCREEN);
        let background = self.full_screen_program(revision, Role::Background, &mut report).map(|program| {
            let pipeline = program.pipeline(&self.uploader.gpu.device, Raster::FULL_SCREEN);
            (pipeline, program)
        });
        let shader = meta.map_or_else(|| "pbr".to_owned(), |meta| meta.shader);
        let variant = scene.as_ref().and_then(|scene| {
            report.describe_scene(&scene.scene);
            choose_variant(selection.variant.as_deref(), &mut report)
        });
        let sun = environment.sun.and(env.as_deref());
        report.has_sun = sun.is_some();
        let inspect = scene.as_ref().map(|scene| {
            let wish = Wish { variant, shader: &shader, sun };
            self.inspect_draws(revision, scene, &wish, &mut report)
        });
        let draws = scene.as_ref().map(|scene| {
            let wish = Wish { variant, shader: &shader, sun };
            self.draws(revision, scene, &wish, &mut report)
        });
        let variant = variant.map(|index| report.variants[index].clone());
        report.shown = Selection { scene: scene_name, env, variant, diffuse: selection.diffuse };
        // A scene's notes stand in its facts and in its GLB.
        let mut said = std::collections::BTreeSet::new();
        report.notes.retain(|note| said.insert(note.clone()));
        self.forget(revision, &report.shown);
        let draws = draws.unwrap_or_default();
        let of_draws = draws.programs.iter().map(|binding| &binding.program);
        let of_background = background.iter().map(|(_, program)| program);
        let is_animated = of_draws.chain(of_background).chain([&tonemap]).any(|program| program.reads_time());
        report.uploaded = self.uploader.finish();
        Some(Prepared {
            report,
            environment,
            scene,
            draws,
            background,
            tonemap,
            tonemap_pipeline,
            is_animated,
            inspect: inspect.unwrap_or_default(),
        })
    }

    fn scene(&mut self, revision: &Revision, name: &str, report: &mut ApplyReport) -> Option<Arc<GpuScene>> {
        let target_name = format!("scene/{name}");
        let target = revision.table.targets.get(&target_name)?;
        let (uploader, gpu) = (&self.uploader, &self.uploader.gpu);
        let resolved = self.scenes.resolve(gpu, &target_name, Key::of(target), || {
            let glb = revision.part(&target_name, "glb");
            let glb =
                glb.ok_or_else(|| Diagnostic::error(format!("target `{target_name}` has no part `glb`")))?;
            GpuScene::upload(uploader, name, glb)
        });
        let scene = report.take(&target_name, resolved);
        if let Some(scene) = &scene {
            report.notes.extend(scene.scene.notes.iter().cloned());
        }
        scene
    }

    fn environment(
        &mut self,
        revision: &Revision,
        env: Option<&str>,
        has_cloth: bool,
        report: &mut ApplyReport,
    ) -> Environment {
        let mut cube = |map: &str| match env {
            Some(env) => self.cube(revision, &format!("env/{env}/{map}"), report),
            None => Arc::clone(&self.neutral_cube),
        };
        let [skybox, irradiance, specular] = ["skybox", "irradiance", "specular"].map(&mut cube);
        // Only cloth reads it, and what keeps it from being made is said where that happens.
        let sheen = env.map(|env| format!("env/{env}/sheen"));
        let sheen = sheen.filter(|name| revision.table.targets.contains_key(name));
        if let (Some(env), None, true) = (env, &sheen, has_cloth) {
            report.notes.push(format!(
                "sheen is lit by even grey: no scene with sheen names env/{env}; `sheen = true` there bakes its chain"
            ));
        }
        let sheen = sheen.map(|name| self.cube(revision, &name, report));
        let sheen = sheen.unwrap_or_else(|| Arc::clone(&self.neutral_cube));
        if sheen.levels > 1 && sheen.scale.to_bits() != specular.scale.to_bits() {
            report.notes.push("sheen is shown too bright or too dark: its map has another scale".to_owned());
        }
        let lut_ggx = self.lut(revision, "lut/ggx", report);
        let lut_charlie = match revision.table.targets.contains_key("lut/charlie") {
            true => self.lut(revision, "lut/charlie", report),
            false => Arc::clone(&self.neutral_lut),
        };
        let sampler = self.sampler.clone();
        let sun = env.map_or(Ok(None), |env| Sun::of(revision, env)).unwrap_or_else(|fault| {
            report.diagnostics.push(fault);
            None
        });
        Environment { skybox, irradiance, specular, sheen, lut_ggx, lut_charlie, sampler, sun }
    }

    fn cube(&mut self, revision: &Revision, name: &str, report: &mut ApplyReport) -> Arc<CubeTexture> {
        let Some(target) = revision.table.targets.get(name) else {
            if project_meta(revision).unread.contains(name) {
                return Arc::clone(&self.neutral_cube);
            }
            let last_good = self.cubes.last_good(name);
            report.notes.push(absent(name, revision, last_good.is_some()));
            return last_good.unwrap_or_else(|| Arc::clone(&self.neutral_cube));
        };
        let (uploader, gpu) = (&self.uploader, &self.uploader.gpu);
        let resolved = self.cubes.resolve(gpu, name, Key::of(target), || {
            let meta: CubeMeta = read_meta(name, target, "cube")?;
            CubeTexture::upload(uploader, name, target, revision, &meta)
        });
        let cube = report.take(name, resolved);
        let cube = cube.unwrap_or_else(|| Arc::clone(&self.neutral_cube));
        report.notes.extend(cube.notes.iter().cloned());
        cube
    }

    fn harmonics(
        &mut self,
        revision: &Revision,
        name: &str,
        report: &mut ApplyReport,
    ) -> Option<Arc<CubeTexture>> {
        let Some(target) = revision.table.targets.get(name) else {
            report.notes.push(format!("`{name}` is absent: diffuse light is read from the map"));
            return None;
        };
        let (uploader, gpu) = (&self.uploader, &self.uploader.gpu);
        let resolved = self.cubes.resolve(gpu, name, Key::of(target), || {
            let json = revision.part(name, "json");
            let json =
                json.ok_or_else(|| Diagnostic::error(format!("target `{name}` has no part `json`")))?;
            let (texels, scale_log2) = harmonics::irradiance_cube(name, json)?;
            Ok(CubeTexture::of_one_level(uploader, name, harmonics::FACE_SIZE as u32, &texels, scale_log2))
        });
        report.take(name, resolved)
    }

    fn lut(&mut self, revision: &Revision, name: &str, report: &mut ApplyReport) -> Arc<LutTexture> {
        let Some(target) = revision.table.targets.get(name) else {
            if project_meta(revision).unread.contains(name) {
                return Arc::clone(&self.neutral_lut);
            }
            let last_good = self.luts.last_good(name);
            report.notes.push(absent(name, revision, last_good.is_some()));
            return last_good.unwrap_or_else(|| Arc::clone(&self.neutral_lut));
        };
        let (uploader, gpu) = (&self.uploader, &self.uploader.gpu);
        let resolved = self.luts.resolve(gpu, name, Key::of(target), || {
            let meta: LutMeta = read_meta(name, target, "lut")?;
            let texels = revision.part(name, "texels");
            let texels =
                texels.ok_or_else(|| Diagnostic::error(format!("target `{name}` has no part `texels`")))?;
            LutTexture::upload(uploader, name, texels, &meta)
        });
        report.take(name, resolved).unwrap_or_else(|| Arc::clone(&self.neutral_lut))
    }

    /// The project's background or tonemap: the first shader with that role.
    fn full_screen_program(
        &mut self,
        revision: &Revision,
        role: Role,
        report: &mut ApplyReport,
    ) -> Option<Arc<Program>> {
        let has_role = |target: &Target| ShaderMeta::is_of_role(target, role);
        let name =
            revision.targets_under("shader/").find(|(_, target)| has_role(target)).map(|(name, _)| name);
        let Some(name) = name else {
            report.notes.push(format!("this project has no {role} shader that works yet"));
            return None;
        };
        self.program(revision, name, role, report)
    }

    fn program(
        &mut self,
        revision: &Revision,
        name: &str,
        role: Role,
        report: &mut ApplyReport,
    ) -> Option<Arc<Program>> {
        let target = revision.table.targets.get(name)?;
        let (uploader, gpu) = (&self.uploader, &self.uploader.gpu);
        let resolved = self.programs.resolve(gpu, name, Key::of(target), || {
            let meta: ShaderMeta = read_meta(name, target, "shader")?;
            if meta.role != role {
                return Err(Diagnostic::error(format!(
                    "`{name}` is a {} shader, not a {role} shader",
                    meta.role
                )));
            }
            let (wgsl, reflection) = read_shader(revision, name)?;
            let own = OwnTextures::upload(uploader, revision, name, &meta.srgb_textures)?;
            let program = Program::new(gpu, name, role, (&wgsl, &reflection), &own)?;
            // Made here, because only a pipeline shows whether module and layout fit.
            program.pipeline(&gpu.device, Raster::of_role(role));
            Ok(program)
        });
        let program = report.take(name, resolved);
        self.adopt(program.as_deref(), report);
        program
    }

    /// Gives a program that will be drawn with the overrides' values, and offers its parameters.
    fn adopt(&self, program: Option<&Program>, report: &mut ApplyReport) {
        let Some(program) = program else { return };
        report.diagnostics.extend(program.specialise(&self.uploader.gpu, &self.parameters).err());
        report.notes.extend(program.notes.iter().cloned());
        for parameter in &program.parameters {
            // Variants of a shader share their parameters.
            let is_it = |other: &OfferedParameter| other.full_name() == parameter.full_name();
            if !report.parameters.iter().any(is_it) {
                report.parameters.push(parameter.clone());
            }
        }
    }

    fn draws(
        &mut self,
        revision: &Revision,
        scene: &GpuScene,
        wish: &Wish<'_>,
        report: &mut ApplyReport,
    ) -> DrawList {
        let &Wish { variant, shader, sun } = wish;
        let mut found: HashMap<String, Option<Arc<Program>>> = HashMap::new();
        let gpu = self.uploader.gpu.clone();
        let overrides = project_meta(revision).effects;
        let is_there = |name: &String| revision.table.targets.contains_key(name);
        let mut is_without_sun = false;
        let mut find = |effects: &EffectSet| {
            let effects = overrides.apply(effects);
            let in_sun = overrides.under_sun(&effects);
            let has_sun = sun.is_some() && in_sun != effects;
            // The scene may be shown in the light of an environment that it was not planned for.
            let sets = if has_sun { [&in_sun, &effects] } else { [&effects, &in_sun] };
            let names = sets.map(|effects| format!("shader/{shader}/{}", variant_name(effects)));
            let name = names.iter().find(|name| is_there(name)).unwrap_or(&names[0]).clone();
            if !found.contains_key(&name) {
                let program = self.variant(revision, shader, &name, report);
                found.insert(name.clone(), program);
            }
            let program = found[&name].clone();
            is_without_sun |= has_sun && program.as_ref().is_some_and(|program| !program.reads_sun());
            program
        };
        let (draws, fault) =
            gpu.catch_errors(|| DrawList::new(&gpu, scene, variant, sun.is_some(), &mut find));
        let faulty =
            |fault: String| Diagnostic::error("the scene cannot be bound to its shaders").with_note(fault);
        report.diagnostics.extend(fault.map(faulty));
        for (effect, count) in &draws.unread {
            let effect = effect.name();
            report.notes.push(format!(
                "`{effect}` of {count} draws is not drawn: `shader/{shader}` reads nothing of it, see docs/shader-interface.md"
            ));
        }
        if let Some(env) = sun.filter(|_| is_without_sun) {
            report.notes.push(format!(
                "the sun that was taken out of env/{env} does not light all of the scene: `shader/{shader}` reads no `sun`, or has no variant for it, see docs/shader-interface.md"
            ));
        }
        let count = scene.scene.lights.len();
        let capacities = found.values().flatten().filter_map(|program| program.light_capacity());
        if let Some(capacity) = capacities.min().filter(|capacity| count > *capacity) {
            report.notes.push(format!(
                "{count} punctual lights: the {} weakest are left out, `shader/{shader}` has room for {capacity}",
                count - capacity
            ));
        }
        draws
    }

    /// The scene with variants that show channels, as far as they are there.
    fn inspect_draws(
        &mut self,
        revision: &Revision,
        scene: &GpuScene,
        wish: &Wish<'_>,
        report: &mut ApplyReport,
    ) -> DrawList {
        let &Wish { variant, shader, sun } = wish;
        let overrides = project_meta(revision).effects;
        let lit = |effects: &EffectSet| match sun {
            Some(_) => overrides.under_sun(effects),
            None => effects.clone(),
        };
        let of_draw =
            |draw| lit(&overrides.apply(&scene.scene.effects(draw, scene.scene.material_of(draw, variant))));
        let sets = all_draws(&scene.scene).map(of_draw).collect();
        report.materials = material_list::list(&scene.scene, variant, &|own| lit(&overrides.apply(own)));
        report.inspection = inspect::describe(revision, shader, &sets);
        if report.inspection.state != InspectionState::Ready {
            return DrawList::default();
        }
        let gpu = self.uploader.gpu.clone();
        let mut find = |effects: &EffectSet| {
            // The scene may be shown in the light of an environment that it was not planned for.
            let effects = overrides.apply(effects);
            let name = |effects: &EffectSet| format!("{}/{shader}/{}", inspect::GROUP, variant_name(effects));
            let in_its_light = name(&lit(&effects));
            let is_there = revision.table.targets.contains_key(&in_its_light);
            let name = if is_there { in_its_light } else { name(&effects) };
            let program = self.program(revision, &name, Role::Material, report);
            program.or_else(|| self.programs.last_good(&name))
        };
        let (draws, fault) = gpu.catch_errors(|| DrawList::new(&gpu, scene, variant, false, &mut find));
        let faulty = |fault: String| {
            Diagnostic::error("the scene cannot be bound to the shaders that show channels").with_note(fault)
        };
        report.diagnostics.extend(fault.map(faulty));
        draws
    }

    /// The variant, its last good form, or the shader without features: something close beats nothing.
    fn variant(
        &mut self,
        revision: &Revision,
        shader: &str,
        name: &str,
        report: &mut ApplyReport,
    ) -> Option<Arc<Program>> {
        if let Some(program) = self.program(revision, name, Role::Material, report) {
            return Some(program);
        }
        if let Some(program) = self.programs.last_good(name) {
            self.adopt(Some(&program), report);
            report.notes.push(absent(name, revision, true));
            return Some(program);
        }
        let program = self.program(revision, &format!("shader/{shader}/base"), Role::Material, report);
        let instead = if program.is_some() { "drawn without its effects" } else { "not drawn" };
        report.notes.push(format!("`{name}` is absent: what needs it is {instead}"));
        program
    }

    /// Drops what neither this revision nor the picture uses.
    fn forget(&mut self, revision: &Revision, shown: &Selection) {
        let env = format!("env/{}/", shown.env.as_deref().unwrap_or_default());
        let is_kept = |name: &str| revision.table.targets.contains_key(name) || name.starts_with(&env);
        self.cubes.retain(&revision.table, is_kept);
        self.luts.retain(&revision.table, |_| true);
        self.scenes.retain(&revision.table, is_kept);
        self.programs.retain(&revision.table, |_| true);
    }
}

/// How a scene is to be drawn.
struct Wish<'a> {
    /// Index of the material variant.
    variant: Option<usize>,
    shader: &'a str,
    /// The environment, if its sun is a light.
    sun: Option<&'a str>,
}

fn project_meta(revision: &Revision) -> ProjectMeta {
    let project = revision.table.targets.get("project");
    project.and_then(|project| read_meta("project", project, "project").ok()).unwrap_or_default()
}

fn scene_meta(revision: &Revision, name: &str, report: &mut ApplyReport) -> Option<SceneMeta> {
    let target_name = format!("scene/{name}");
    let Some(target) = revision.table.targets.get(&target_name) else {
        report.notes.push(absent(&target_name, revision, false));
        return None;
    };
    match read_meta::<SceneMeta>(&target_name, target, "scene") {
        Ok(meta) => {
            report.notes.extend(meta.notes.iter().cloned());
            Some(meta)
        }
        Err(diagnostic) => {
            report.diagnostics.push(diagnostic);
            None
        }
    }
}

/// Index of the variant asked for; what is not there is said.
fn choose_variant(asked: Option<&str>, report: &mut ApplyReport) -> Option<usize> {
    let asked = asked?;
    let found = report.variants.iter().position(|name| name == asked);
    if found.is_none() {
        let known = if report.variants.is_empty() { "none".to_owned() } else { report.variants.join(", ") };
        report.notes.push(format!("there is no material variant `{asked}`; the scene has {known}"));
    }
    found
}

fn absent(name: &str, revision: &Revision, has_last_good: bool) -> String {
    let instead = if has_last_good { "its last good form is shown" } else { "a neutral one stands in" };
    format!("`{name}` is absent from revision {}: {instead}", revision.table.number)
}

fn read_shader(revision: &Revision, name: &str) -> Result<(String, Reflection), Diagnostic> {
    let part = |part: &str| {
        let bytes = revision.part(name, part);
        bytes.ok_or_else(|| Diagnostic::error(format!("target `{name}` has no part `{part}`")))
    };
    let wgsl = String::from_utf8(part("wgsl")?.to_vec())
        .map_err(|error| Diagnostic::error(format!("the text of `{name}` is not UTF-8: {error}")))?;
    let reflection = serde_json::from_slice(part("reflection")?)
        .map_err(|error| Diagnostic::error(format!("the interface of `{name}` is malformed: {error}")))?;
    Ok((wgsl, reflection))
}
