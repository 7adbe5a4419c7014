//! System packages that the tests need: software Vulkan, a virtual display, and reference compilers of shaders.

use std::path::Path;
use std::process::Command;

use crate::shell::{has_program, output_of};

/// Debian's package, and how to see that what it brings is there.
type Package = (&'static str, fn() -> bool);

const NEEDED: [Package; 4] = [
    ("mesa-vulkan-drivers", has_vulkan_driver),
    ("xvfb", || has_program("Xvfb")),
    ("spirv-tools", || has_program("spirv-val")),
    ("glslang-tools", || has_program("glslangValidator")),
];

fn has_vulkan_driver() -> bool {
    let folders = ["/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d", "/usr/local/share/vulkan/icd.d"];
    let has_entry =
        |folder: &str| Path::new(folder).read_dir().is_ok_and(|mut entries| entries.next().is_some());
    folders.iter().any(|folder| has_entry(folder))
}

/// What is missing, by package.
fn missing() -> Vec<&'static str> {
    NEEDED.iter().filter(|(_, is_there)| !is_there()).map(|(package, _)| *package).collect()
}

/// Installs what is missing where that is allowed (as root, or with sudo that asks no password, on a system
/// with apt); says what to install otherwise. Returns what is still missing.
pub(crate) fn install_missing() -> Vec<&'static str> {
    let packages = missing();
    if packages.is_empty() || !has_program("apt-get") {
        return packages;
    }
    let Some(prefix) = privilege() else { return packages };
    println!("installing {}", packages.join(", "));
    let apt = |arguments: &[&str]| {
        let mut command = Command::new(prefix.first().copied().unwrap_or("apt-get"));
        if !prefix.is_empty() {
            command.args(&prefix[1..]).arg("apt-get");
        }
        command.args(arguments).env("DEBIAN_FRONTEND", "noninteractive");
        output_of(&mut command)
    };
    // The lists may be old or absent; an update that fails can still be followed by an install that works.
    if let Err(error) = apt(&["update", "-qq"]) {
        eprintln!("apt-get update: {error}");
    }
    let mut install = vec!["install", "-y", "-qq", "--no-install-recommends"];
    install.extend(&packages);
    if let Err(error) = apt(&install) {
        eprintln!("apt-get install: {error}");
    }
    missing()
}

fn privilege() -> Option<Vec<&'static str>> {
    let is_root = output_of(Command::new("id").arg("-u")).is_ok_and(|id| id.trim() == "0");
    if is_root {
        return Some(Vec::new());
    }
    let may_sudo = has_program("sudo") && output_of(Command::new("sudo").args(["-n", "true"])).is_ok();
    may_sudo.then(|| vec!["sudo", "-n"])
}
