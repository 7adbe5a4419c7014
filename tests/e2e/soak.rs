//! Edits, typing mistakes, kills and reconnections in random order, beside a model of what must be published after each.
//!
//! `KILN_SOAK_EDITS` and `KILN_SOAK_SEED` make it longer and another one (`cargo xtask soak`).

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;
use std::time::Instant;

use kiln_build::TargetState;
use kiln_image::Image;
use kiln_link::{ClientEvent, Revision};

use crate::harness::{LIMIT, Project, Viewer, Watch};

const EDITS: usize = 500;
const SHADER: &str = "shader/flat/base";
const MAP: &str = "env/room/specular";
/// What a daemon may grow by in its life, in KiB: allocators keep some of what they had.
const GROWTH_KIB_MAX: u64 = 24 * 1024;
/// Edits after which its memory is that of one at work.
const WARM: usize = 40;

const TOML: &str = "version = 1
[project]
name = \"soak\"
[env.room]
source = \"room.hdr\"
size = 8
irradiance_size = 4
bake = \"all\"
[shader.flat]
source = \"flat.wgsl\"
role = \"engine\"
";

/// What the project says, and what must therefore be published.
#[derive(Clone, Debug, Default, PartialEq)]
struct Model {
    number: u32,
    /// The last number that was no typing mistake.
    good: u32,
    is_broken: bool,
    sky: usize,
}

impl Model {
    fn shader(&self) -> String {
        let mistake = if self.is_broken { "(" } else { "" };
        format!(
            "import lib::tint::tint;
@vertex fn vs_main(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {{ return vec4f(f32(i)); }}
@fragment fn fs_main() -> @location(0) vec4f {{ return vec4f(tint() * {}.0{mistake}); }}",
            self.number
        )
    }

    /// What keeps a revision from being what it must be; `digests` learns what each sky's map is called.
    fn misfit(&self, revision: &Revision, digests: &mut BTreeMap<usize, String>) -> Option<String> {
        let table = &revision.table;
        if !table.building.is_empty() {
            return Some(format!("{:?} are being made", table.building));
        }
        let state = table.targets.get(SHADER).map(|target| target.state);
        let expected = if self.is_broken { TargetState::Stale } else { TargetState::Fresh };
        if state != Some(expected) {
            return Some(format!("{SHADER} is {state:?}, not {expected:?}"));
        }
        let text = revision.part(SHADER, "wgsl").map(|bytes| String::from_utf8_lossy(bytes).into_owned());
        let number = format!("{}", self.good);
        if !text.as_ref().is_some_and(|text| text.split(|c: char| !c.is_ascii_digit()).any(|it| it == number))
        {
            return Some(format!("{SHADER} does not hold {number}: {text:?}"));
        }
        let says = table.diagnostics.iter().any(|said| said.file.as_deref() == Some("flat.wgsl"));
        if says != self.is_broken {
            return Some(format!("the diagnostics are {:?}", table.diagnostics));
        }
        let Some(map) = table.targets.get(MAP).map(|target| target.digest().to_string()) else {
            return Some(format!("there is no {MAP}"));
        };
        let is_of_another = digests.iter().any(|(sky, digest)| *sky != self.sky && *digest == map);
        let is_unlike = digests.get(&self.sky).is_some_and(|known| *known != map);
        if is_of_another || is_unlike {
            return Some(format!("{MAP} is not that of sky {}", self.sky));
        }
        digests.insert(self.sky, map);
        None
    }
}

/// What was done, for the report.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Deed {
    Edit,
    Burst,
    Mistake,
    Sky,
    Reconnection,
    Kill,
}

impl fmt::Display for Deed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Deed::Edit => "edits of a shader",
            Deed::Burst => "bursts of edits",
            Deed::Mistake => "typing mistakes",
            Deed::Sky => "other panoramas",
            Deed::Reconnection => "clients that came anew",
            Deed::Kill => "daemons killed (-9) and started again",
        })
    }
}

/// Marsaglia's xorshift.
struct Random(u64);

impl Random {
    fn below(&mut self, end: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0 % end
    }
}

struct Soak {
    project: Project,
    model: Model,
    watch: Option<Watch>,
    viewer: Viewer,
    /// The last revision it got.
    last: Option<Arc<Revision>>,
    digests: BTreeMap<usize, String>,
    /// Of the living daemon: edits it saw, and its memory when it was warm.
    life: (usize, Option<u64>),
    growth_kib: Vec<u64>,
}

impl Soak {
    fn begin() -> Soak {
        let project = Project::sample();
        project.write("kiln.toml", TOML);
        std::fs::create_dir_all(project.path("lib")).unwrap();
        project.write("lib/tint.wgsl", "fn tint() -> vec4f { return vec4f(1.0, 0.5, 0.25, 1.0); }");
        let model = Model::default();
        project.write("flat.wgsl", model.shader());
        project.write("room.hdr", sky(0));
        let watch = project.watch();
        let viewer = watch.client("soak");
        let (digests, growth_kib) = (BTreeMap::new(), Vec::new());
        Soak { project, model, watch: Some(watch), viewer, last: None, digests, life: (0, None), growth_kib }
    }

    fn deed(&mut self, random: &mut Random) -> Deed {
        match random.below(200) {
            0..120 => {
                self.edit(random, false);
                Deed::Edit
            }
            120..140 => {
                for _ in 0..4 {
                    self.edit(random, false);
                }
                Deed::Burst
            }
            140..160 => {
                self.edit(random, true);
                Deed::Mistake
            }
            160..180 => {
                self.model.sky = 1 - self.model.sky;
                self.project.write("room.hdr", sky(self.model.sky));
                Deed::Sky
            }
            180..198 => {
                (self.viewer, self.last) = (self.watch.as_ref().unwrap().client("soak"), None);
                Deed::Reconnection
            }
            _ => {
                self.end_life();
                self.watch.take().unwrap().kill();
                // What is saved while nobody looks is seen by the next.
                self.edit(random, false);
                let watch = self.project.watch();
                (self.viewer, self.last) = (watch.client("soak"), None);
                self.watch = Some(watch);
                Deed::Kill
            }
        }
    }

    fn edit(&mut self, random: &mut Random, is_broken: bool) {
        // No number of the shader's others, and never the same again.
        self.model.number += 1 + random.below(9) as u32 + if self.model.number == 0 { 100 } else { 0 };
        self.model.is_broken = is_broken;
        if !is_broken {
            self.model.good = self.model.number;
        }
        self.project.write("flat.wgsl", self.model.shader());
    }

    /// Waits until what must be published is; a second mistake after the first may change nothing.
    fn settle(&mut self, deed: Option<Deed>) {
        let deadline = Instant::now() + LIMIT;
        loop {
            let misfit = self.last.as_ref().map(|last| self.model.misfit(last, &mut self.digests));
            if misfit == Some(None) {
                break;
            }
            let left = deadline.saturating_duration_since(Instant::now());
            match self.viewer.0.events().recv_timeout(left) {
                Ok(ClientEvent::Revision(revision)) => self.last = Some(revision),
                Ok(_) => {}
                Err(error) => panic!("{:?} was lost after {deed:?}, {error}: {misfit:?}", self.model),
            }
        }
        self.life.0 += 1;
        if self.life.0 == WARM {
            self.life.1 = self.memory_kib();
        }
    }

    fn end_life(&mut self) {
        if let (Some(warm), Some(now)) = (self.life.1, self.memory_kib()) {
            self.growth_kib.push(now.saturating_sub(warm));
        }
        self.life = (0, None);
    }

    /// Resident memory of the daemon, where the system tells it.
    fn memory_kib(&self) -> Option<u64> {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.watch.as_ref()?.id())).ok()?;
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
        line.split_ascii_whitespace().next()?.parse().ok()
    }
}

/// One of two panoramas.
fn sky(index: usize) -> Vec<u8> {
    let texel = |at: usize| (1 + index) as f32 * (0.25 + (at % 7) as f32 * 0.125);
    kiln_image::hdr::encode(&Image::new(16, 8, (0..16 * 8 * 3).map(texel).collect()).unwrap())
}

fn number(name: &str, default: u64) -> u64 {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(default)
}

#[test]
fn no_edit_is_lost_whoever_comes_goes_or_dies_and_memory_stays_flat() {
    let count = number("KILN_SOAK_EDITS", EDITS as u64) as usize;
    let mut random = Random(number("KILN_SOAK_SEED", 0x5EED).max(1));
    let mut soak = Soak::begin();
    soak.model.good = soak.model.number;
    soak.settle(None);
    let mut done: BTreeMap<Deed, usize> = BTreeMap::new();
    let begun = Instant::now();
    for _ in 0..count {
        let deed = soak.deed(&mut random);
        *done.entry(deed).or_default() += 1;
        soak.settle(Some(deed));
    }
    soak.end_life();
    let worst = soak.growth_kib.iter().copied().max().unwrap_or(0);
    for (deed, times) in &done {
        eprintln!("{times:>7} {deed}");
    }
    eprintln!(
        "{count} in {:.1} s, none lost; {} lives of daemons, the largest growth of one {:.1} MiB",
        begun.elapsed().as_secs_f64(),
        soak.growth_kib.len(),
        worst as f64 / 1024.0
    );
    assert!(worst <= GROWTH_KIB_MAX, "a daemon grew by {worst} KiB");
    assert!(done.len() == 6 || count < EDITS, "{done:?}");
}

#[test]
fn model_sees_a_lost_edit_a_missing_error_and_another_sky() {
    let mut soak = Soak::begin();
    soak.settle(None);
    let revision = soak.watch.as_ref().unwrap().client("soak").revision();
    let mut misfit = |change: &dyn Fn(&mut Model)| {
        let mut model = soak.model.clone();
        change(&mut model);
        model.misfit(&revision, &mut soak.digests).unwrap_or_default()
    };
    assert_eq!(misfit(&|_| ()), "");
    assert!(misfit(&|model| model.good = 77).contains("does not hold 77"));
    assert!(misfit(&|model| model.is_broken = true).contains("not Stale"));
    soak.digests.insert(1, "of another".to_owned());
    let model = Model { sky: 1, ..soak.model.clone() };
    assert!(model.misfit(&revision, &mut soak.digests).is_some_and(|it| it.contains("not that of sky 1")));
}
