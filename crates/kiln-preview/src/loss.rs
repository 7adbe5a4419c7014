//! What becomes of the window when its graphics device is lost: a driver that was reset or renewed, a card that was pulled out.
//!
//! egui's renderer lives as long as its device, so the window is closed and opened anew on a new one, as it was. A device that goes
//! while egui writes its buffers, between a frame's panels and its submission, ends the program: egui's renderer panics there.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use anyhow::bail;

use crate::saved::{Saved, SavedFile};
use crate::window::{WindowOptions, open_window};

/// A device that is lost sooner than this after the window was opened is not one that lasts.
const LASTING: Duration = Duration::from_secs(10);
/// Such devices in a row after which no other is tried.
const SHORT_LIVES_MAX: u32 = 3;

/// All that a window begins with.
pub(crate) struct Opening {
    pub options: WindowOptions,
    pub saved: Saved,
    pub file: Option<SavedFile>,
    /// What the window has to say of itself.
    pub note: Option<String>,
}

/// Why a window closed by itself, and how it was.
#[derive(Debug, Default)]
pub(crate) struct LossSlot(Mutex<Option<(String, Saved)>>);

impl LossSlot {
    /// The device is lost, and the window about to close.
    pub fn note(&self, reason: String, saved: Saved) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some((reason, saved));
    }

    fn take(&self) -> Option<(String, Saved)> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

/// Opens windows until the user closes one.
pub(crate) fn survive_losses(mut opening: Opening) -> anyhow::Result<()> {
    let mut options = opening.options.clone();
    options.lose_device_after_frames = None;
    let mut short_lives = 0;
    loop {
        let (loss, begun) = (Arc::new(LossSlot::default()), Instant::now());
        open_window(opening, &loss)?;
        let Some((reason, saved)) = loss.take() else { return Ok(()) };
        short_lives = if begun.elapsed() < LASTING { short_lives + 1 } else { 0 };
        if short_lives > SHORT_LIVES_MAX {
            bail!("the graphics device was lost {short_lives} times in a row, at last so: {reason}");
        }
        let file = options.state.clone().map(|path| SavedFile::new(path, saved.clone()));
        let note = Some(format!("the graphics device was lost ({reason}); this window was opened anew"));
        opening = Opening { options: options.clone(), saved, file, note };
    }
}
