//! The crate's two entry points.

use std::collections::BTreeSet;
use std::sync::Arc;

use kiln_diagnostic::{Diagnostic, Severity};
use serde::{Deserialize, Serialize};

use crate::import::{Imported, import};
use crate::uri::References;
use crate::{Effect, EffectSet, Scene, SceneError, SpecularGlossinessAs, document, write};

/// What [`pack`] makes of a file.
#[derive(Clone, Debug)]
pub struct Packed {
    /// One normalised GLB without outside references: equal inputs give equal bytes, and packing it again
    /// gives the same bytes. `None` if the file cannot be drawn.
    pub glb: Option<Vec<u8>>,
    /// What draws call for: each material with each distinct set of geometry effects that it is drawn with, in the order
    /// of [`Scene::materials`], then of sets; materials of variants count.
    pub effects: Vec<MaterialEffects>,
    /// Counts and extent, for people and planners.
    pub summary: SceneSummary,
    /// Errors if there is no GLB; else what is not drawn as asked for, then where the file is not as glTF 2.0
    /// wants it.
    pub diagnostics: Vec<Diagnostic>,
}

/// What one material calls for where it is drawn: a shader variant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MaterialEffects {
    /// Its name; not unique if the file's names are not.
    pub material: String,
    /// Its effects and those of the geometry that has it, see [`Scene::effects`].
    pub effects: EffectSet,
    /// What it reads of the environment that lights it.
    pub reads: LightReads,
}

/// Which lobes of an environment a material is lit by, with the smallest and largest perceptual roughness that its factors
/// and textures give. A renderer that filters normals reads rougher levels besides. Unlit materials read nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LightReads {
    /// GGX: base layer, clear coat and refracted light; with it the irradiance.
    pub ggx: Option<[f32; 2]>,
    /// Charlie: sheen.
    pub charlie: Option<[f32; 2]>,
}

/// A scene in numbers.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SceneSummary {
    /// Distinct geometry.
    pub primitives: usize,
    /// Primitives placed in the world; copies of one that are drawn together count once.
    pub draws: usize,
    /// Vertices of distinct geometry.
    pub vertices: usize,
    /// Triangles as drawn, instances counted.
    pub triangles: usize,
    /// Materials in use.
    pub materials: usize,
    /// Images in use.
    pub images: usize,
    /// Texels of the images in use.
    pub texels: usize,
    /// Names of cameras.
    pub cameras: Vec<String>,
    /// Punctual lights that ever shine.
    pub lights: usize,
    /// World bounds, smallest then largest coordinates.
    pub bounds: Option<[[f32; 3]; 2]>,
}

impl MaterialEffects {
    /// Name of the shader variant that it is drawn with.
    pub fn variant_name(&self) -> String {
        crate::variant_name(&self.effects)
    }
}

impl Packed {
    /// All effects that any material calls for.
    pub fn all_effects(&self) -> EffectSet {
        self.effects.iter().flat_map(|material| material.effects.iter().copied()).collect::<EffectSet>()
    }

    /// Whether any material calls for `effect`.
    pub fn calls_for(&self, effect: Effect) -> bool {
        self.effects.iter().any(|material| material.effects.contains(&effect))
    }
}

/// What a project decides about its glTF files.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PackOptions {
    /// Folders outside the project whose files may be referred to, as `../library`, relative to the project and without
    /// `..` after the first name, or as `/srv/assets`. A relative one is for relative references, an absolute one for
    /// absolute paths and `file:` URIs: what is read does not depend on where the project is.
    pub allowed_folders: Vec<String>,
    /// How materials of the old model are drawn.
    pub specular_glossiness: SpecularGlossinessAs,
}

/// [`pack_with`] that reads nothing outside the project and draws metallic-roughness.
pub fn pack(file: &str, bytes: &[u8], resolve: &mut dyn FnMut(&str) -> Option<Arc<[u8]>>) -> Packed {
    pack_with(&PackOptions::default(), file, bytes, resolve)
}

/// Packs a .gltf or .glb into one normalised GLB and says what it calls for.
///
/// `file` is its name relative to the project, for messages and as the base of what it refers to. `resolve`
/// returns the bytes of a file by its [`crate::Uri::path`]; it is asked for buffers, and for images in use.
pub fn pack_with(
    options: &PackOptions,
    file: &str,
    bytes: &[u8],
    resolve: &mut dyn FnMut(&str) -> Option<Arc<[u8]>>,
) -> Packed {
    let text = document::text_of(bytes);
    let diagnose = |severity, error: SceneError| error.into_diagnostic(severity, file, text);
    let refuse = |errors: Vec<SceneError>| Packed {
        glb: None,
        effects: Vec::new(),
        summary: SceneSummary::default(),
        diagnostics: errors.into_iter().map(|error| diagnose(Severity::Error, error)).collect(),
    };
    let document = match document::parse(bytes) {
        Ok(document) => document,
        Err(error) => return refuse(vec![error]),
    };
    let references = References { file, allowed_folders: &options.allowed_folders, read: resolve };
    let mut imported = match import(references, options.specular_glossiness, &document) {
        Ok(imported) => imported,
        Err(errors) => return refuse(errors),
    };
    let glb = match write::write(&imported) {
        Ok(glb) => glb,
        Err(error) => {
            return refuse(vec![SceneError::new("", format!("the pack cannot be written: {error}"))]);
        }
    };
    let warn = |error| diagnose(Severity::Warning, error);
    let warnings = std::mem::take(&mut imported.warnings).into_iter().map(warn);
    let faults = std::mem::take(&mut imported.faults).into_iter().map(warn);
    let notes = imported.scene.notes.iter().map(|note| Diagnostic::note(note).in_file(file));
    Packed {
        glb: Some(glb),
        effects: effects(&imported),
        summary: summary(&imported.scene),
        diagnostics: warnings.chain(notes).chain(faults).collect(),
    }
}

/// Reads a self-contained GLB, above all one that [`pack`] made.
///
/// # Errors
/// The first thing that is wrong. Images that cannot be read are not: the neutral texture stands in.
pub fn load(glb: &[u8]) -> Result<Scene, SceneError> {
    let document = document::parse(glb)?;
    let references = References { file: "", allowed_folders: &[], read: &mut |_| None };
    let imported = import(references, SpecularGlossinessAs::default(), &document);
    let imported = imported.map_err(|errors| {
        let first = errors.into_iter().next();
        first.unwrap_or_else(|| SceneError::new("", "the file cannot be read"))
    })?;
    let Imported { mut scene, warnings, faults, .. } = imported;
    scene.notes.extend(warnings.iter().chain(&faults).map(ToString::to_string));
    Ok(scene)
}

fn effects(imported: &Imported) -> Vec<MaterialEffects> {
    let scene = &imported.scene;
    let mut materials: Vec<Vec<usize>> = scene.primitives.iter().map(|it| vec![it.material]).collect();
    for variant in &scene.variant_materials {
        materials[variant.primitive].push(variant.material);
    }
    let draws = scene.draws.iter().chain(&scene.hidden);
    let pairs = draws.flat_map(|draw| materials[draw.primitive].iter().map(|&it| (it, draw.effects())));
    let distinct: BTreeSet<(usize, EffectSet)> = pairs.collect();
    let of_pair = |(material, geometry): (usize, EffectSet)| MaterialEffects {
        material: scene.materials[material].name.clone(),
        effects: scene.materials[material].effects.union(&geometry).copied().collect(),
        reads: imported.reads[material],
    };
    distinct.into_iter().map(of_pair).collect()
}

fn summary(scene: &Scene) -> SceneSummary {
    let triangles =
        |draw: &crate::Draw| scene.primitives[draw.primitive].indices.len() / 3 * draw.instances.len().max(1);
    SceneSummary {
        primitives: scene.primitives.len(),
        draws: scene.draws.len(),
        vertices: scene.primitives.iter().map(|primitive| primitive.vertices.len()).sum(),
        triangles: scene.draws.iter().map(triangles).sum(),
        materials: scene.materials.len(),
        images: scene.images.len(),
        texels: scene.images.iter().map(|image| image.rgba.len() / 4).sum(),
        cameras: scene.cameras.iter().map(|camera| camera.name.clone()).collect(),
        lights: scene.lights.len(),
        bounds: scene.bounds.map(|bounds| [bounds.min.to_array(), bounds.max.to_array()]),
    }
}
