//! What a window remembers of a project from one run to the next: a small file in the user's state folder.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::look::Look;
use crate::panel::PanelState;
use crate::panel::scene::{NAMED_VIEWS_MAX, NamedView};
use crate::view::{Selection, View};

/// Number of the format; a file of another one is passed over.
const FORMAT: u32 = 1;
/// No window writes more.
const BYTES_MAX: u64 = 1 << 20;
/// How often a change is written.
const INTERVAL: Duration = Duration::from_secs(2);

/// Everything that is remembered. What a file does not say is as in [`Saved::default`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct Saved {
    kiln_window: u32,
    pub look: Look,
    pub layout: Layout,
    pub turntable_degrees_per_s: f32,
    pub named_views: Vec<NamedView>,
}

/// How the window is laid out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct Layout {
    pub theme: ThemeChoice,
    /// Size of panels and texts, 1 = as the screen says.
    pub zoom: f32,
    /// Width and height of the window at zoom 1; `None` = as it first opens.
    pub window_points: Option<[f32; 2]>,
    /// Width of the panel beside the picture, in points.
    pub side_points: f32,
    /// Height of the panel below it, in points.
    pub timeline_points: f32,
    pub are_panels_hidden: bool,
}

/// Colours of the panels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum ThemeChoice {
    /// As the system has it; dark where it does not say.
    #[default]
    System,
    Dark,
    Light,
}

impl Default for Layout {
    fn default() -> Self {
        Layout {
            theme: ThemeChoice::System,
            zoom: 1.0,
            window_points: None,
            side_points: 296.0,
            timeline_points: 148.0,
            are_panels_hidden: false,
        }
    }
}

impl Default for Saved {
    fn default() -> Self {
        Saved {
            kiln_window: FORMAT,
            look: Look::default(),
            layout: Layout::default(),
            turntable_degrees_per_s: 30.0,
            named_views: Vec::new(),
        }
    }
}

impl Saved {
    /// What is to be remembered of a window.
    pub fn of(state: &PanelState) -> Self {
        // The clock of moving shaders is the window's own.
        let view = View { time_s: 0.0, ..state.view.clone() };
        let selection = state.selection.clone();
        let layout = Layout { are_panels_hidden: state.are_panels_hidden, ..state.layout.clone() };
        Saved {
            kiln_window: FORMAT,
            look: Look { selection, view },
            layout,
            turntable_degrees_per_s: state.turntable.degrees_per_s,
            named_views: state.named_views.clone(),
        }
    }

    /// Gives a new window what is remembered.
    pub fn restore(self, state: &mut PanelState) {
        (state.selection, state.view) = (self.look.selection, self.look.view);
        state.are_panels_hidden = self.layout.are_panels_hidden;
        state.layout = self.layout;
        state.turntable.degrees_per_s = self.turntable_degrees_per_s;
        state.named_views = self.named_views;
    }

    /// What the command line says wins: names that it gives, and of `view` all that is not as in [`View::default`].
    #[must_use]
    pub fn with_given(mut self, selection: &Selection, view: &View) -> Self {
        let remembered = &mut self.look;
        if selection.scene.is_some() && selection.scene != remembered.selection.scene {
            // Camera, light and variant were chosen for another scene.
            remembered.selection = selection.clone();
            (remembered.view.camera, remembered.view.scene_camera, remembered.view.animation) =
                (None, 0, None);
        }
        let Selection { env, variant, .. } = selection.clone();
        remembered.selection.env = env.or(remembered.selection.env.take());
        remembered.selection.variant = variant.or(remembered.selection.variant.take());
        remembered.view = merged(&remembered.view, view);
        self
    }

    /// Reads what is remembered; the default, and why, where that cannot be used. Nothing there is no reason.
    pub fn read(path: &Path) -> (Self, Option<String>) {
        let refused = |reason: String| {
            let note =
                format!("what was remembered of this window is not used: {}: {reason}", path.display());
            (Saved::default(), Some(note))
        };
        match std::fs::metadata(path) {
            Err(error) if error.kind() == ErrorKind::NotFound => return (Saved::default(), None),
            Err(error) => return refused(error.to_string()),
            Ok(file) if file.len() > BYTES_MAX => return refused(format!("it has {} bytes", file.len())),
            Ok(_) => {}
        }
        let text = match std::fs::read_to_string(path) {
            Ok(text) => text,
            Err(error) => return refused(error.to_string()),
        };
        match Saved::parse(&text) {
            Ok(saved) => (saved, None),
            Err(reason) => refused(reason),
        }
    }

    fn parse(text: &str) -> Result<Self, String> {
        // A format without a number is no format of ours.
        let value: Value = serde_json::from_str(text).map_err(|error| error.to_string())?;
        if value.get("kiln_window") != Some(&Value::from(FORMAT)) {
            return Err(format!("it is not of format {FORMAT}"));
        }
        let saved: Saved = serde_json::from_value(value).map_err(|error| error.to_string())?;
        saved.look.view.check()?;
        let Layout { zoom, side_points, timeline_points, window_points, .. } = &saved.layout;
        let [width, height] = window_points.unwrap_or([1280.0, 760.0]);
        let in_range = (0.2..=5.0).contains(zoom)
            && (100.0..=4000.0).contains(side_points)
            && (20.0..=4000.0).contains(timeline_points)
            && [width, height].iter().all(|side| (100.0..=20_000.0).contains(side))
            && saved.turntable_degrees_per_s.abs() <= 360.0
            && saved.named_views.len() <= NAMED_VIEWS_MAX
            && saved.named_views.iter().all(|view| view.camera.is_usable());
        if in_range { Ok(saved) } else { Err("a number in it is out of its range".to_owned()) }
    }

    /// Writes it whole. Without a sync: what a crash loses is a view.
    fn write(&self, path: &Path) -> std::io::Result<()> {
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)?;
        }
        // Two windows of one project may write at once.
        let temporary = path.with_extension(format!("{}.tmp", std::process::id()));
        std::fs::write(&temporary, serde_json::to_string_pretty(self)? + "\n")?;
        std::fs::rename(&temporary, path)
    }
}

/// `view`, with everything in `given` that is not as at first.
fn merged(view: &View, given: &View) -> View {
    let all = [view, given, &View::default()].map(|view| serde_json::to_value(view).unwrap_or_default());
    let [Value::Object(mut view_fields), Value::Object(given_fields), first] = all else {
        return view.clone();
    };
    for (name, value) in given_fields {
        if first.get(&name) != Some(&value) {
            view_fields.insert(name, value);
        }
    }
    serde_json::from_value(Value::Object(view_fields)).unwrap_or_else(|_| view.clone())
}

/// Keeps the file as the window is, without writing at every change.
pub(crate) struct SavedFile {
    path: PathBuf,
    written: Saved,
    last_write: Instant,
}

impl SavedFile {
    /// `read` is what the file holds.
    pub fn new(path: PathBuf, read: Saved) -> Self {
        SavedFile { path, written: read, last_write: Instant::now() }
    }

    /// Writes `saved` if it is something else and nothing was written lately, or at once if it `is_last`. Returns after how
    /// long it wants to be asked again. A folder that cannot be written costs only the memory.
    pub fn keep(&mut self, saved: Saved, is_last: bool) -> Option<Duration> {
        if saved == self.written {
            return None;
        }
        let left = INTERVAL.saturating_sub(self.last_write.elapsed());
        if !left.is_zero() && !is_last {
            return Some(left);
        }
        self.last_write = Instant::now();
        if saved.write(&self.path).is_ok() {
            self.written = saved;
            return None;
        }
        (!is_last).then_some(INTERVAL)
    }
}
