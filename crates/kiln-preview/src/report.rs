//! What a revision offers, and what came of it.

use std::sync::Arc;

use kiln_diagnostic::Diagnostic;
use kiln_link::{Revision, TargetState};
use kiln_scene::{Animation, Scene};

use crate::camera::OrbitCamera;
use crate::inspect::Inspection;
use crate::keeper::Resolved;
use crate::material_list::ListedMaterial;
use crate::parameter::OfferedParameter;
use crate::target::{ProjectMeta, read_meta};
use crate::upload::Uploaded;
use crate::view::Selection;

/// What came of a revision.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ApplyReport {
    /// Its number.
    pub revision: u64,
    /// The project's name.
    pub project: String,
    /// Scenes to choose from.
    pub scenes: Vec<String>,
    /// Environments to choose from.
    pub envs: Vec<String>,
    /// The shown scene's animations.
    pub animations: Vec<OfferedAnimation>,
    /// Names of the shown scene's material variants.
    pub variants: Vec<String>,
    /// Names of the shown scene's cameras that can be looked through.
    pub cameras: Vec<String>,
    /// What is shown, whatever was asked for.
    pub shown: Selection,
    /// What the authors of the shaders in use offer to be changed, by shader.
    pub parameters: Vec<OfferedParameter>,
    /// What is approximate or replaced, a line each.
    pub notes: Vec<String>,
    /// What the preview could not use; the project's own diagnostics are in the revision's table.
    pub diagnostics: Vec<Diagnostic>,
    /// Targets that are older than their sources.
    pub stale: Vec<String>,
    /// Targets whose resources were made anew; what is not here was reused or not needed.
    pub made: Vec<String>,
    /// What these took to the device.
    pub uploaded: Uploaded,
    /// Whether the environment's sun is a light of its own, which casts shadows.
    pub has_sun: bool,
    /// Which channels can be shown.
    pub inspection: Inspection,
    /// What the shown scene is made of.
    pub materials: Vec<ListedMaterial>,
}

/// An animation to choose.
#[derive(Clone, Debug, PartialEq)]
pub struct OfferedAnimation {
    /// Its name, or `animation N` where the file has none.
    pub name: String,
    /// Time of its last key.
    pub duration_s: f64,
}

impl ApplyReport {
    /// Takes over what a scene offers.
    pub(crate) fn describe_scene(&mut self, scene: &Scene) {
        let offered = |(index, animation): (usize, &Animation)| OfferedAnimation {
            name: match animation.name.as_str() {
                "" => format!("animation {index}"),
                name => name.to_owned(),
            },
            duration_s: f64::from(animation.duration_s()),
        };
        self.animations = scene.animations.iter().enumerate().map(offered).collect();
        self.variants = scene.variants.clone();
        self.cameras = OrbitCamera::names(scene);
    }

    /// The resource of a target, after noting what came of it.
    pub(crate) fn take<T>(&mut self, name: &str, resolved: Resolved<T>) -> Option<Arc<T>> {
        self.diagnostics.extend(resolved.diagnostic);
        if resolved.made {
            self.made.push(name.to_owned());
        }
        resolved.resource
    }
}

/// What a revision says about itself.
pub(crate) fn describe(revision: &Revision) -> ApplyReport {
    let table = &revision.table;
    let mut report = ApplyReport { revision: table.number, ..Default::default() };
    let project = table.targets.get("project").map(|target| read_meta("project", target, "project"));
    let project: ProjectMeta = match project {
        Some(Ok(project)) => project,
        Some(Err(diagnostic)) => {
            report.diagnostics.push(diagnostic);
            ProjectMeta::default()
        }
        None => ProjectMeta::default(),
    };
    report.project = project.name;
    report.scenes = or_published(project.scenes, revision, "scene/");
    report.envs = or_published(project.envs, revision, "env/");
    let stale = table.targets.iter().filter(|(_, target)| target.state == TargetState::Stale);
    report.stale = stale.map(|(name, _)| name.clone()).collect();
    report
}

/// The names the project lists; without a list those that targets have.
fn or_published(listed: Vec<String>, revision: &Revision, prefix: &str) -> Vec<String> {
    if !listed.is_empty() {
        return listed;
    }
    let name = |target: &str| target[prefix.len()..].split('/').next().unwrap_or_default().to_owned();
    let mut names: Vec<String> = revision.targets_under(prefix).map(|(target, _)| name(target)).collect();
    names.dedup();
    names
}

/// `asked` if it exists, else `preferred`, else the first.
pub(crate) fn choose(
    asked: Option<&str>,
    preferred: Option<&str>,
    names: &[String],
    what: &str,
    notes: &mut Vec<String>,
) -> Option<String> {
    let exists = |name: &&str| names.iter().any(|other| other == name);
    if let Some(missing) = asked.filter(|name| !exists(name)) {
        notes.push(format!("there is no {what} `{missing}` in this project"));
    }
    let chosen = asked.filter(exists).or(preferred.filter(exists));
    chosen.map(str::to_owned).or_else(|| names.first().cloned())
}
