//! `cargo xtask corpus`: the same commands on real files that nobody of this project made.

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Instant;

use crate::shell::{cargo, kiln, output_of, step};

/// Folders of panoramas below the corpus.
const PANORAMAS: [&str; 4] = ["hdr/polyhaven-bevy", "hdr/polyhaven-pmndrs", "hdr/nvpro", "exr/pmndrs-npm"];
/// Scenes below `gltf/khronos-sample-assets`.
const SCENES: [&str; 6] = [
    "ToyCar/glTF/ToyCar.gltf",
    "ClearCoatTest/glTF/ClearCoatTest.gltf",
    "SheenCloth/glTF/SheenCloth.gltf",
    "UnlitTest/glTF/UnlitTest.gltf",
    "MetalRoughSpheresNoTextures/glTF-Binary/MetalRoughSpheresNoTextures.glb",
    "Fox/glTF/Fox.gltf",
];

/// A daemon that ends with this value.
struct Daemon(Child);

impl Drop for Daemon {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Bakes every panorama and renders every scene into `out`.
pub(crate) fn run(out: &str) -> Result<(), String> {
    let corpus = std::env::var_os("KILN_CORPUS").ok_or("KILN_CORPUS must name the folder of real files")?;
    step("build", &mut cargo(&["build", "--release"]))?;
    let out = Path::new(out);
    let project = out.join("project");
    write_project(Path::new(&corpus), &project)?;
    let start = Instant::now();
    step("bake", Command::new(kiln()).arg("bake").arg("--keep-going").arg(&project))?;
    println!("{:.1} s for all panoramas and scenes", start.elapsed().as_secs_f64());
    let daemon =
        Command::new(kiln()).arg("watch").arg(&project).arg("--no-output").stdout(Stdio::null()).spawn();
    let _daemon = Daemon(daemon.map_err(|error| format!("cannot start the daemon: {error}"))?);
    for scene in SCENES {
        let name = name_of(scene);
        let mut render = Command::new(kiln());
        render
            .args(["preview", "--headless", "--size", "960x540", "--scene", &name, "--out"])
            .arg(out.join(&name));
        println!("{}", output_of(render.arg(&project))?.trim());
    }
    Ok(())
}

/// The corpus' panoramas: names for environments, and files relative to the corpus.
pub(crate) fn panoramas(corpus: &Path) -> Result<Vec<(String, String)>, String> {
    let mut panoramas = Vec::new();
    for folder in PANORAMAS {
        let entries = corpus.join(folder).read_dir().map_err(|error| format!("{folder}: {error}"))?;
        let mut files: Vec<String> = entries
            .filter_map(|entry| Some(entry.ok()?.file_name().to_string_lossy().into_owned()))
            .collect();
        files.sort();
        for file in files.iter().filter(|file| file.ends_with(".hdr") || file.ends_with(".exr")) {
            let kind = if file.ends_with(".exr") { "exr-" } else { "" };
            panoramas.push((format!("{kind}{}", name_of(file)), format!("{folder}/{file}")));
        }
    }
    Ok(panoramas)
}

/// A file's name as names in kiln.toml are spelt.
pub(crate) fn name_of(path: &str) -> String {
    let stem = Path::new(path).file_stem().unwrap_or_default().to_string_lossy();
    stem.chars().map(|character| if character.is_ascii_alphanumeric() { character } else { '_' }).collect()
}

/// The project reads the corpus in place, through a link.
fn write_project(corpus: &Path, project: &Path) -> Result<(), String> {
    let text = |error: std::io::Error| format!("{}: {error}", project.display());
    if !project.join("kiln.toml").is_file() {
        let project = project.to_string_lossy();
        output_of(Command::new(kiln()).args(["init", &project, "--panorama-width", "64"]))?;
    }
    let link = project.join("corpus");
    if !link.exists() {
        std::os::unix::fs::symlink(corpus, &link).map_err(text)?;
    }
    let mut toml = "version = 1\n[project]\nname = \"corpus\"\n".to_owned();
    for (name, file) in panoramas(corpus)? {
        toml.push_str(&format!("[env.{name}]\nsource = \"corpus/{file}\"\n"));
    }
    for scene in SCENES {
        let source = format!("corpus/gltf/khronos-sample-assets/{scene}");
        toml.push_str(&format!("[scene.{}]\nsource = \"{source}\"\nenv = \"studio\"\n", name_of(scene)));
    }
    for shader in ["pbr", "background", "tonemap"] {
        toml.push_str(&format!("[shader.{shader}]\nsource = \"shaders/pbr/{shader}.wgsl\"\n"));
    }
    std::fs::write(project.join("kiln.toml"), toml).map_err(text)
}
