//! How large moving frames are drawn: as large as keeps them fluent, and whole again when nothing moves.

use std::time::{Duration, Instant};

/// What a moving frame may take.
const FRAME_MS: f64 = 33.0;
/// Share of the picture's width below which one sees nothing any more.
const SCALE_MIN: f64 = 0.25;
/// Sizes differ by no less than this share: each new one costs new images.
const STEP: f64 = 0.125;
/// Without a change for this long the picture is at rest.
const REST: Duration = Duration::from_millis(180);

/// Decides on the size of frames from how long those before took.
#[derive(Debug)]
pub(crate) struct Scaling {
    /// What a frame of the whole size takes, milliseconds; `None` before the first.
    whole_ms: Option<f64>,
    changed: Option<Instant>,
}

impl Scaling {
    /// Knows nothing yet.
    pub fn new() -> Self {
        Scaling { whole_ms: None, changed: None }
    }

    /// Another scene or size: frames may take another time.
    pub fn forget(&mut self) {
        self.whole_ms = None;
    }

    /// A frame of this scale took so long.
    pub fn note(&mut self, scale: f64, ms: f64) {
        let whole_ms = ms / (scale * scale);
        // Of two frames in a row, so that one that was held up decides little.
        self.whole_ms = Some(self.whole_ms.map_or(whole_ms, |before| (before * whole_ms).sqrt()));
    }

    /// Something that is seen changed at this time.
    pub fn change(&mut self, now: Instant) {
        self.changed = Some(now);
    }

    /// How long until the picture is at rest; `None` if it is.
    pub fn rest_in(&self, now: Instant) -> Option<Duration> {
        REST.checked_sub(now.saturating_duration_since(self.changed?)).filter(|left| !left.is_zero())
    }

    /// The share of the picture's width and height to draw now.
    pub fn scale(&self, now: Instant) -> f64 {
        match (self.rest_in(now), self.whole_ms) {
            (Some(_), Some(whole_ms)) => moving_scale(whole_ms),
            _ => 1.0,
        }
    }

    /// The share that moving frames have.
    pub fn moving_scale(&self) -> f64 {
        self.whole_ms.map_or(1.0, moving_scale)
    }
}

/// Time goes with the number of pixels.
fn moving_scale(whole_ms: f64) -> f64 {
    let fitting = (FRAME_MS / whole_ms.max(1e-3)).sqrt();
    ((fitting / STEP).floor() * STEP).clamp(SCALE_MIN, 1.0)
}
