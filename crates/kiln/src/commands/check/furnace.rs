//! White balls in uniform white light, drawn with a project's own shaders through the whole pipeline: bake, upload, frame.

use std::f64::consts::{PI, TAU};
use std::path::Path;

use anyhow::Context as _;
use kiln_build::Engine;
use kiln_check::{Subject, check_furnace};
use kiln_gpu::Gpu;
use kiln_image::{Cancelled, Image, hdr};
use kiln_preview::{HeadlessViewer, Selection};
use kiln_project::{EnvConfig, Project, Role, parse_project};
use serde_json::json;

use super::Session;
use crate::commands::export::with_progress;
use crate::place;

/// Rows and columns of the white environment: what is constant is so at any size.
const PANORAMA: [usize; 2] = [16, 32];
/// Steps around a ball's axis and from pole to pole.
const STEPS: [usize; 2] = [48, 24];
/// Perceptual roughness of the balls; once as metal, once as a dielectric.
const ROUGHNESSES: [f64; 4] = [0.1, 0.4, 0.7, 1.0];
/// Pixels of the frame.
const SIZE: [u32; 2] = [480, 270];
/// Names that no project has.
const ENVIRONMENT: &str = "kiln-furnace";

/// Draws one furnace for each shader that scenes' materials have.
pub(super) fn check(all: &mut Session, engine: &Engine, project: &Project) -> anyhow::Result<()> {
    let shaders = project.shaders.iter().filter(|(_, shader)| shader.role == Role::Material);
    for (shader, _) in shaders {
        let name = format!("furnace/{shader}");
        let skip = |all: &mut Session, reason: String| {
            let mut subject = Subject::new(name.as_str(), "furnace");
            subject.skip("furnace", reason);
            all.subjects.push(subject);
        };
        if all.args.no_furnace {
            skip(all, "`--no-furnace` leaves it out".to_owned());
            continue;
        }
        // One device a frame: an error that it reports is that shader's.
        let gpu = match Gpu::headless() {
            Ok(gpu) => gpu,
            Err(error) => {
                skip(all, format!("there is no graphics device: {error}"));
                continue;
            }
        };
        match draw(all, engine.folder(), project, shader, gpu)? {
            Ok(frame) => {
                let with_picture = all.with_pictures();
                all.add(&name, "furnace", |_| Ok::<_, Cancelled>(check_furnace(&name, &frame, with_picture)));
            }
            Err(reason) => skip(all, reason),
        }
    }
    Ok(())
}

/// The radiance of the furnace's frame, or why there is none.
fn draw(
    all: &Session,
    project_folder: &Path,
    project: &Project,
    shader: &str,
    gpu: Gpu,
) -> anyhow::Result<Result<Image, String>> {
    let folder = tempfile::tempdir().context("making a folder for the furnace")?;
    link_entries(project_folder, folder.path()).context("linking the project's files")?;
    let white = Image::new(PANORAMA[1], PANORAMA[0], vec![1.0; 3 * PANORAMA[0] * PANORAMA[1]])?;
    write(folder.path(), "hdr", &hdr::encode(&white))?;
    let (gltf, bin) = balls();
    write(folder.path(), "gltf", gltf.as_bytes())?;
    write(folder.path(), "bin", &bin)?;
    let text = format!(
        "version = 1\n[env.furnace]\nsource = \"{ENVIRONMENT}.hdr\"\nsize = 64\nskybox_size = 16\n\
         [scene.furnace]\nsource = \"{ENVIRONMENT}.gltf\"\nenv = \"furnace\"\nshader = \"furnace\"\n[shader.furnace]\nsource = \"none.wgsl\"\n"
    );
    let mut furnace = parse_project(&text).0;
    furnace.shaders.clone_from(&project.shaders);
    for scene in furnace.scenes.values_mut() {
        shader.clone_into(&mut scene.shader);
    }
    let envs: Vec<&EnvConfig> = furnace.envs.values().collect();
    anyhow::ensure!(envs.len() == 1 && furnace.scenes.len() == 1, "the furnace's own project has errors");
    let own = Engine::open(folder.path(), place::open_store()?).context("opening the cache")?;
    let _hold = own.store().hold();
    let built = with_progress(&all.args.run, |options| kiln_project::build_apart(&own, &furnace, options));
    let built = built.context("building the furnace")?.context("the build was cancelled")?;
    let prefix = format!("shader/{shader}/");
    if !built.targets.keys().any(|name| name.starts_with(&prefix)) {
        return Ok(Err("the shader does not compile".to_owned()));
    }
    let revision = kiln_daemon::to_revision(&own, built).context("reading what was built")?;
    let mut viewer = HeadlessViewer::new(gpu, SIZE);
    viewer.apply(&revision);
    let selection = Selection {
        scene: Some("furnace".to_owned()),
        env: Some("furnace".to_owned()),
        ..Selection::default()
    };
    let applied = viewer.select(selection);
    if applied.shown.scene.is_none() {
        let said: Vec<String> =
            applied.diagnostics.iter().map(|diagnostic| diagnostic.message.clone()).collect();
        return Ok(Err(format!("the shader cannot draw it: {}", said.join("; "))));
    }
    let frame = viewer.render_radiance().context("reading a frame")?;
    let errors = viewer.gpu().take_errors();
    Ok(if errors.is_empty() {
        Ok(frame)
    } else {
        Err(format!("the graphics device reported: {}", errors.join("; ")))
    })
}

fn write(folder: &Path, extension: &str, bytes: &[u8]) -> anyhow::Result<()> {
    let path = folder.join(ENVIRONMENT).with_extension(extension);
    std::fs::write(&path, bytes).with_context(|| format!("writing {}", path.display()))
}

/// Every entry of the project under its name, so that shaders find what they import.
fn link_entries(from: &Path, to: &Path) -> std::io::Result<()> {
    for entry in from.read_dir()? {
        let entry = entry?;
        #[cfg(unix)]
        std::os::unix::fs::symlink(entry.path(), to.join(entry.file_name()))?;
        #[cfg(windows)]
        if entry.path().is_dir() {
            std::os::windows::fs::symlink_dir(entry.path(), to.join(entry.file_name()))?;
        } else {
            std::os::windows::fs::symlink_file(entry.path(), to.join(entry.file_name()))?;
        }
    }
    Ok(())
}

/// Two rows of white balls, metal above: the .gltf text and its .bin.
fn balls() -> (String, Vec<u8>) {
    let [around, down] = STEPS;
    let mut bin: Vec<u8> = Vec::new();
    for row in 0..=down {
        for column in 0..=around {
            let (theta, phi) = (PI * row as f64 / down as f64, TAU * column as f64 / around as f64);
            let point = [theta.sin() * phi.sin(), theta.cos(), theta.sin() * phi.cos()];
            point.iter().for_each(|value| bin.extend_from_slice(&(*value as f32).to_le_bytes()));
        }
    }
    let points = (around + 1) * (down + 1);
    let (positions_bytes, mut count) = (bin.len(), 0);
    for row in 0..down {
        for column in 0..around {
            let at = |row: usize, column: usize| (row * (around + 1) + column) as u16;
            let (a, b) = (at(row, column), at(row, column + 1));
            let (c, d) = (at(row + 1, column), at(row + 1, column + 1));
            // A triangle at a pole has no area, and is left out.
            let upper = (row > 0).then_some([a, d, b]);
            let lower = (row + 1 < down).then_some([a, c, d]);
            for index in upper.into_iter().chain(lower).flatten() {
                bin.extend_from_slice(&index.to_le_bytes());
                count += 1;
            }
        }
    }
    let attributes = json!({"POSITION": 0, "NORMAL": 0});
    let (mut materials, mut meshes, mut nodes) = (Vec::new(), Vec::new(), Vec::new());
    for (row, metallic) in [1.0, 0.0].into_iter().enumerate() {
        for (column, roughness) in ROUGHNESSES.into_iter().enumerate() {
            let index = materials.len();
            materials.push(
                json!({"pbrMetallicRoughness": {"metallicFactor": metallic, "roughnessFactor": roughness}}),
            );
            meshes.push(json!({"primitives": [{"attributes": attributes, "indices": 1, "material": index}]}));
            let place = [2.3 * (column as f64 - 1.5), 1.15 - 2.3 * row as f64, 0.0];
            nodes.push(json!({"mesh": index, "translation": place}));
        }
    }
    let root = json!({
        "asset": {"version": "2.0", "generator": "kiln check"},
        "scene": 0,
        "scenes": [{"nodes": (0..nodes.len()).collect::<Vec<_>>()}],
        "nodes": nodes, "meshes": meshes, "materials": materials,
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": points, "min": [-1, -1, -1], "max": [1, 1, 1]},
            {"bufferView": 1, "componentType": 5123, "type": "SCALAR", "count": count},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": positions_bytes, "target": 34962},
            {"buffer": 0, "byteOffset": positions_bytes, "byteLength": bin.len() - positions_bytes, "target": 34963},
        ],
        "buffers": [{"uri": format!("{ENVIRONMENT}.bin"), "byteLength": bin.len()}],
    });
    (root.to_string(), bin)
}
