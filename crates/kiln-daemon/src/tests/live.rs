//! Whole daemons on a project of one small environment.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use kiln_link::{RevisionTable, TargetState};

use super::LIMIT;
use crate::{Daemon, DaemonOptions, Notice};

/// A panorama of 16×8 texels of this mantissa.
pub(super) fn hdr(mantissa: u8) -> Vec<u8> {
    let mut bytes = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8 +X 16\n".to_vec();
    bytes.extend([mantissa, mantissa, mantissa, 128].repeat(16 * 8));
    bytes
}

pub(super) struct Running {
    folder: tempfile::TempDir,
    notices: Receiver<Notice>,
    pub(super) socket: PathBuf,
    thread: Option<JoinHandle<()>>,
    /// The first revision.
    first: Option<Arc<RevisionTable>>,
}

impl Running {
    /// A daemon that has published its first revision.
    pub(super) fn start(poll: Option<Duration>, source: impl Fn(&Path)) -> Running {
        let folder = tempfile::tempdir().unwrap();
        let project = folder.path().join("project");
        fs::create_dir(&project).unwrap();
        let text = "version = 1\n[env.sky]\nsource = \"sky.hdr\"\nsize = 64\nbake = \"all\"\n";
        fs::write(project.join("kiln.toml"), text).unwrap();
        source(folder.path());
        let options = DaemonOptions {
            folder: project,
            cache: folder.path().join("cache"),
            // One, so that the order of actions is that of their urgency.
            jobs: 1,
            memory_bytes: 1 << 30,
            cache_bytes_max: 1 << 30,
            write_outputs: false,
            poll,
            listen: None,
        };
        let daemon = Daemon::start(&options).unwrap();
        let socket = daemon.socket().to_owned();
        let (sender, notices) = channel();
        let thread = std::thread::spawn(move || daemon.run(&mut |notice| drop(sender.send(notice))));
        let mut running = Running { folder, notices, socket, thread: Some(thread), first: None };
        let first = running.published();
        assert!(!has_error(&first), "{:?}", first.diagnostics);
        running.first = Some(first);
        running
    }

    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(super) fn notice(&self) -> Notice {
        self.notices.recv_timeout(LIMIT).expect("a notice in time")
    }

    /// Asks until the daemon is as wanted.
    pub(super) fn wait_until(&self, is_wanted: impl Fn(&kiln_link::DaemonStatus) -> bool) {
        let deadline = std::time::Instant::now() + LIMIT;
        while !is_wanted(&kiln_link::status(&self.socket, LIMIT).unwrap()) {
            assert!(std::time::Instant::now() < deadline);
        }
    }

    pub(super) fn published(&self) -> Arc<RevisionTable> {
        loop {
            if let Notice::Published(table) = self.notice() {
                return table;
            }
        }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        if std::thread::panicking() {
            return;
        }
        kiln_link::stop(&self.socket, LIMIT).unwrap();
        self.thread.take().unwrap().join().unwrap();
        // Only this test's own: the folder of the socket is the user's.
        fs::remove_file(self.socket.with_extension("lock")).unwrap();
    }
}

fn has_error(table: &RevisionTable) -> bool {
    table.diagnostics.iter().any(kiln_diagnostic::Diagnostic::is_error)
}

fn digests(table: &RevisionTable) -> Vec<kiln_build::Digest> {
    table.targets.values().flat_map(|target| &target.parts).map(|part| part.digest).collect()
}

fn plain(folder: &Path) {
    fs::write(folder.join("project/sky.hdr"), hdr(100)).unwrap();
}

#[test]
fn half_written_panorama_is_tried_again_and_its_error_never_published() {
    let daemon = Running::start(None, plain);
    let new = hdr(200);
    let mut file = fs::File::create(daemon.path("project/sky.hdr")).unwrap();
    file.write_all(&new[..new.len() / 2]).unwrap();
    loop {
        match daemon.notice() {
            Notice::Unfinished { files } => break assert_eq!(files, ["sky.hdr"]),
            Notice::Published(table) => panic!("half a file was published: {:?}", table.diagnostics),
            _ => {}
        }
    }
    file.write_all(&new[new.len() / 2..]).unwrap();
    drop(file);
    let table = daemon.published();
    assert!(!has_error(&table), "{:?}", table.diagnostics);
    assert!(table.targets.values().all(|target| target.state == TargetState::Fresh));
}

/// The twin: what stays broken is said, once.
#[test]
fn panorama_that_stays_half_is_reported_once() {
    let daemon = Running::start(None, plain);
    let new = hdr(200);
    let mut file = fs::File::create(daemon.path("project/sky.hdr")).unwrap();
    file.write_all(&new[..new.len() / 2]).unwrap();
    let table = daemon.published();
    assert!(has_error(&table), "whoever writes has stopped, and keeps the file open");
    let targets = table.targets.iter().filter(|(name, _)| name.starts_with("env/sky"));
    assert!(targets.into_iter().all(|(_, target)| target.state == TargetState::Stale));
    file.write_all(&new[new.len() / 2..]).unwrap();
    drop(file);
    assert!(!has_error(&daemon.published()));
}

#[cfg(unix)]
#[test]
fn change_that_nobody_tells_of_is_found_by_polling() {
    use std::os::unix::fs::symlink;
    // Two links one after the other: the folder of the second is not watched.
    let daemon = Running::start(Some(Duration::from_millis(50)), |folder| {
        for name in ["links", "one", "two"] {
            fs::create_dir(folder.join(name)).unwrap();
        }
        fs::write(folder.join("one/sky.hdr"), hdr(100)).unwrap();
        fs::write(folder.join("two/sky.hdr"), hdr(200)).unwrap();
        symlink(folder.join("one/sky.hdr"), folder.join("links/sky.hdr")).unwrap();
        symlink(folder.join("links/sky.hdr"), folder.join("project/sky.hdr")).unwrap();
    });
    let before = kiln_link::status(&daemon.socket, LIMIT).unwrap();
    assert_eq!(before.revision, 1);
    fs::remove_file(daemon.path("links/sky.hdr")).unwrap();
    symlink(daemon.path("two/sky.hdr"), daemon.path("links/sky.hdr")).unwrap();
    let mut table = daemon.published();
    // It may have looked between the two steps.
    if has_error(&table) {
        table = daemon.published();
    }
    assert!(!has_error(&table) && table.number > 1);
}

#[test]
fn stop_ends_a_daemon_and_frees_the_project() {
    let daemon = Running::start(None, plain);
    let status = kiln_link::status(&daemon.socket, LIMIT).unwrap();
    assert_eq!((status.pid, status.revision, status.stale.len()), (std::process::id(), 1, 0));
    let socket = daemon.socket.clone();
    drop(daemon);
    assert!(!socket.exists());
}

#[test]
fn folder_in_place_of_a_source_is_an_error_until_the_file_is_back() {
    let daemon = Running::start(None, plain);
    let sky = daemon.path("project/sky.hdr");
    fs::remove_file(&sky).unwrap();
    fs::create_dir(&sky).unwrap();
    let broken = daemon.published();
    assert!(has_error(&broken));
    fs::remove_dir(&sky).unwrap();
    fs::write(&sky, hdr(200)).unwrap();
    let mut mended = daemon.published();
    while has_error(&mended) {
        mended = daemon.published();
    }
    assert_ne!(digests(&broken), digests(&mended), "the last good content was of the first panorama");
}

/// A triangle in a shader that knows the feature `inspect`.
fn with_scene(folder: &Path) {
    plain(folder);
    let write = |name: &str, text: &str| fs::write(folder.join("project").join(name), text).unwrap();
    write(
        "kiln.toml",
        "version = 1\n[env.sky]\nsource = \"sky.hdr\"\nsize = 64\n[scene.quad]\nsource = \"quad.gltf\"\nenv = \"sky\"\n\
         shader = \"flat\"\n[shader.flat]\nsource = \"flat.wgsl\"\n",
    );
    write(
        "flat.wgsl",
        "@vertex fn vs_main() -> @builtin(position) vec4f { return vec4f(0.0); }
@fragment fn fs_main() -> @location(0) vec4f {
    @if(inspect) return vec4f(0.5);
    @else return vec4f(1.0);
}",
    );
    write(
        "quad.gltf",
        r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}],
"bufferViews":[{"buffer":0,"byteLength":36}],"buffers":[{"uri":"quad.bin","byteLength":36}]}"#,
    );
    let corners: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    fs::write(folder.join("project/quad.bin"), corners.map(f32::to_le_bytes).as_flattened()).unwrap();
}

#[test]
fn shaders_that_show_channels_come_when_a_client_wants_them_and_go_with_it() {
    let daemon = Running::start(None, with_scene);
    let inspected = |table: &RevisionTable| table.targets.contains_key("inspect/flat/base");
    let first = kiln_link::Client::connect(daemon.socket.clone(), "looks");
    first.want(vec!["scene/quad".to_owned(), "inspect".to_owned()]);
    assert!(inspected(&daemon.published()));
    let second = kiln_link::Client::connect(daemon.socket.clone(), "looks too");
    second.want(vec!["inspect".to_owned()]);
    let begun = std::time::Instant::now();
    let is_heard = || {
        let clients = kiln_link::status(&daemon.socket, LIMIT).unwrap().clients;
        clients.iter().any(|client| client.name == "looks too" && client.wants == ["inspect"])
    };
    while !is_heard() {
        assert!(begun.elapsed() < LIMIT, "the second client is not heard");
    }
    first.want(vec!["scene/quad".to_owned()]);
    // As long as one client wants them they stay: the next revision is that of the last one's leaving.
    drop(second);
    let table = daemon.published();
    assert!(!inspected(&table), "nobody wants them");
    assert_eq!(table.number, 3);
    drop(first);
}

/// Two environments of one file, so that one edit is about both.
fn two(folder: &Path) {
    let project = folder.join("project");
    let toml = fs::read_to_string(project.join("kiln.toml")).unwrap();
    let other = "[env.dusk]\nsource = \"sky.hdr\"\nsize = 32\nbake = \"all\"\n";
    fs::write(project.join("kiln.toml"), toml + other).unwrap();
    fs::write(project.join("sky.hdr"), hdr(100)).unwrap();
}

/// Edits both environments and returns what is published then, up to the whole.
fn edit_both(daemon: &Running) -> Vec<Arc<RevisionTable>> {
    let new = daemon.path("new.hdr");
    fs::write(&new, hdr(200)).unwrap();
    fs::rename(new, daemon.path("project/sky.hdr")).unwrap();
    let mut tables = vec![daemon.published()];
    while !tables.last().is_some_and(|table| table.building.is_empty()) {
        tables.push(daemon.published());
    }
    tables
}

#[test]
fn what_a_client_shows_is_published_before_the_rest_is_made() {
    let daemon = Running::start(None, two);
    let before = daemon.first.clone().unwrap();
    let client = kiln_link::Client::connect(daemon.socket.clone(), "shows dusk");
    client.want(vec!["env/dusk".to_owned()]);
    daemon.wait_until(|status| status.clients.iter().any(|client| !client.wants.is_empty()));
    let tables = edit_both(&daemon);
    let of = |table: &RevisionTable, name: &str| table.targets[name].parts.clone();
    let last = tables.last().unwrap();
    assert!(last.targets.keys().all(|name| last.targets[name].state == TargetState::Fresh));
    let [early, _] = &tables[..] else { panic!("{} revisions: {:?}", tables.len(), last.work.ran) };
    assert_eq!(of(early, "env/dusk/specular"), of(last, "env/dusk/specular"));
    assert_ne!(of(early, "env/dusk/specular"), of(&before, "env/dusk/specular"));
    assert!(early.building.iter().all(|name| name.starts_with("env/sky/")), "{:?}", early.building);
    assert_eq!(of(early, "env/sky/specular"), of(&before, "env/sky/specular"));
    assert_ne!(of(last, "env/sky/specular"), of(&before, "env/sky/specular"));
}

#[test]
fn without_a_client_that_shows_something_nothing_is_published_early() {
    let daemon = Running::start(None, two);
    assert!(edit_both(&daemon).iter().all(|table| table.building.is_empty()));
}
