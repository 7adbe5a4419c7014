//! How well moving frames are drawn: as well as keeps them fluent, and whole again when nothing moves.
//!
//! The samples of a pixel go first: on a CPU each small triangle that touches one of them costs a block of pixels, so
//! that one sample for each pixel takes a third to a fifth of the time (`cargo xtask bench render`).

use std::time::{Duration, Instant};

use crate::program::SAMPLE_COUNT;

/// What a moving frame may take.
const FRAME_MS: f64 = 33.0;
/// Share of the picture's width below which one sees nothing any more.
const SCALE_MIN: f64 = 0.25;
/// Sizes differ by no less than this share: each new one costs new images.
const STEP: f64 = 0.125;
/// Without a change for this long the picture is at rest.
const REST: Duration = Duration::from_millis(180);

/// What a frame is drawn with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FrameQuality {
    /// Share of the picture's width and height.
    pub scale: f64,
    /// Samples a pixel.
    pub sample_count: u32,
}

impl FrameQuality {
    /// Nothing is saved.
    pub const WHOLE: FrameQuality = FrameQuality { scale: 1.0, sample_count: SAMPLE_COUNT };
}

/// Decides on the quality of frames from how long those before took.
#[derive(Debug)]
pub(crate) struct Scaling {
    /// What a whole frame takes, milliseconds; `None` before the first.
    whole_ms: Option<f64>,
    /// The same with one sample a pixel.
    single_ms: Option<f64>,
    changed: Option<Instant>,
}

impl Scaling {
    /// Knows nothing yet.
    pub fn new() -> Self {
        Scaling { whole_ms: None, single_ms: None, changed: None }
    }

    /// Another scene or size: frames may take another time.
    pub fn forget(&mut self) {
        (self.whole_ms, self.single_ms) = (None, None);
    }

    /// A frame of this quality took so long.
    pub fn note(&mut self, quality: FrameQuality, ms: f64) {
        let ms = ms / (quality.scale * quality.scale);
        let noted = if quality.sample_count == 1 { &mut self.single_ms } else { &mut self.whole_ms };
        // Of two frames in a row, so that one that was held up decides little.
        *noted = Some(noted.map_or(ms, |before| (before * ms).sqrt()));
    }

    /// Something that is seen changed at this time.
    pub fn change(&mut self, now: Instant) {
        self.changed = Some(now);
    }

    /// How long until the picture is at rest; `None` if it is.
    pub fn rest_in(&self, now: Instant) -> Option<Duration> {
        REST.checked_sub(now.saturating_duration_since(self.changed?)).filter(|left| !left.is_zero())
    }

    /// What to draw with now.
    pub fn quality(&self, now: Instant) -> FrameQuality {
        if self.rest_in(now).is_some() { self.moving_quality() } else { FrameQuality::WHOLE }
    }

    /// What moving frames are drawn with.
    pub fn moving_quality(&self) -> FrameQuality {
        match self.whole_ms {
            Some(whole_ms) if moving_scale(whole_ms) < 1.0 => {
                let scale = moving_scale(self.single_ms.unwrap_or(whole_ms));
                FrameQuality { scale, sample_count: 1 }
            }
            _ => FrameQuality::WHOLE,
        }
    }
}

/// Time goes with the number of pixels.
fn moving_scale(whole_ms: f64) -> f64 {
    let fitting = (FRAME_MS / whole_ms.max(1e-3)).sqrt();
    ((fitting / STEP).floor() * STEP).clamp(SCALE_MIN, 1.0)
}
