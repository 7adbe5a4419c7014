//! What was built while the window was open: for each revision what, why, and how long every stage took.

use std::collections::VecDeque;

use kiln_link::{FrameReport, RevisionTable, TargetState, Work};

/// Revisions that are kept.
pub(crate) const BUILDS_MAX: usize = 50;
/// Actions kept of one build; the first build of a large project has thousands.
const ACTIONS_MAX: usize = 2000;

/// A revision that was received, and what became of it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Build {
    /// Tells it from others for as long as the window is open: revisions count from 1 again when a daemon does.
    pub serial: u64,
    pub revision: u64,
    pub work: Work,
    /// Actions beyond those in `work`.
    pub actions_left_out: usize,
    pub errors: usize,
    pub stale: usize,
    pub received_unix_ms: f64,
    /// When pipelines and uploads were done, and when the device had drawn it; `None` if a newer one came first.
    pub shown_unix_ms: Option<(f64, f64)>,
}

/// A part of the way from the edit to the picture, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stage {
    Plan,
    Run,
    Publish,
    Receive,
    Prepare,
    Draw,
}

impl Stage {
    /// All of them, in order.
    pub const ALL: [Stage; 6] =
        [Stage::Plan, Stage::Run, Stage::Publish, Stage::Receive, Stage::Prepare, Stage::Draw];

    /// In a word.
    pub fn name(self) -> &'static str {
        match self {
            Stage::Plan => "plan",
            Stage::Run => "run",
            Stage::Publish => "publish",
            Stage::Receive => "receive",
            Stage::Prepare => "prepare",
            Stage::Draw => "draw",
        }
    }

    /// What happens in it.
    pub fn help(self) -> &'static str {
        match self {
            Stage::Plan => "from noticing the change to knowing what must run",
            Stage::Run => "the actions",
            Stage::Publish => "from the last action to the published revision",
            Stage::Receive => "from there until all its contents were here",
            Stage::Prepare => "pipelines and uploads",
            Stage::Draw => "until the device had drawn the first frame",
        }
    }
}

impl Build {
    /// Milliseconds of each stage that took place.
    pub fn stages(&self) -> Vec<(Stage, f64)> {
        let Work { plan_ms, run_ms, noticed_unix_ms, published_unix_ms, .. } = self.work;
        let mut stages = vec![(Stage::Plan, plan_ms), (Stage::Run, run_ms)];
        // A first build follows no change.
        if noticed_unix_ms > 0.0 {
            stages.push((Stage::Publish, published_unix_ms - noticed_unix_ms - plan_ms - run_ms));
        }
        // Whoever connects later gets what was published long before.
        if noticed_unix_ms > 0.0 && published_unix_ms > 0.0 {
            stages.push((Stage::Receive, self.received_unix_ms - published_unix_ms));
        }
        if let Some((ready, drawn)) = self.shown_unix_ms {
            stages.extend([(Stage::Prepare, ready - self.received_unix_ms), (Stage::Draw, drawn - ready)]);
        }
        // Clocks are set back now and then.
        stages.into_iter().map(|(stage, ms)| (stage, ms.max(0.0))).collect()
    }

    /// Milliseconds of all stages.
    pub fn total_ms(&self) -> f64 {
        self.stages().iter().map(|(_, ms)| ms).sum()
    }

    /// Which files changed, in a few words.
    pub fn cause(&self) -> String {
        match self.work.changed_files.as_slice() {
            [] => "first build".to_owned(),
            [file] => file.clone(),
            [file, rest @ ..] => format!("{file} and {} more", rest.len()),
        }
    }
}

/// The newest builds, oldest first.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct History {
    builds: VecDeque<Build>,
    /// Chosen by the user; `None` = the newest.
    chosen: Option<u64>,
    received: u64,
}

impl History {
    /// Takes over a revision.
    pub fn receive(&mut self, table: &RevisionTable, received_unix_ms: f64) {
        let mut work = table.work.clone();
        let actions_left_out = work.ran.len().saturating_sub(ACTIONS_MAX);
        work.ran.truncate(ACTIONS_MAX);
        self.received += 1;
        self.builds.push_back(Build {
            serial: self.received,
            revision: table.number,
            work,
            actions_left_out,
            errors: table.diagnostics.iter().filter(|diagnostic| diagnostic.is_error()).count(),
            stale: table.targets.values().filter(|target| target.state == TargetState::Stale).count(),
            received_unix_ms,
            shown_unix_ms: None,
        });
        if self.builds.len() > BUILDS_MAX {
            self.builds.pop_front();
        }
    }

    /// Notes when a revision was drawn.
    pub fn note_frame(&mut self, report: &FrameReport) {
        let build = self.builds.iter_mut().rev().find(|build| build.revision == report.revision);
        if let Some(build) = build.filter(|build| build.shown_unix_ms.is_none()) {
            build.shown_unix_ms = Some((report.ready_unix_ms, report.drawn_unix_ms));
        }
    }

    /// When the change that led to a revision was noticed; 0 if none did.
    pub fn noticed_unix_ms(&self, revision: u64) -> f64 {
        let build = self.newest_first().find(|build| build.revision == revision);
        build.map_or(0.0, |build| build.work.noticed_unix_ms)
    }

    /// Newest first.
    pub fn newest_first(&self) -> impl Iterator<Item = &Build> {
        self.builds.iter().rev()
    }

    /// The one whose actions are shown.
    pub fn chosen(&self) -> Option<&Build> {
        let chosen = self.chosen.and_then(|serial| self.builds.iter().find(|build| build.serial == serial));
        chosen.or(self.builds.back())
    }

    /// Chooses one; the newest again, and those to come, if it is the newest.
    pub fn choose(&mut self, serial: u64) {
        let is_newest = self.builds.back().is_some_and(|build| build.serial == serial);
        self.chosen = (!is_newest).then_some(serial);
    }
}
