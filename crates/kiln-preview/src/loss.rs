//! What becomes of the window when its graphics device is lost: a driver that was reset or renewed, a card that was pulled out.
//!
//! egui's renderer lives as long as its device, so the window is closed and opened anew on a new one, as it was.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use anyhow::bail;
use kiln_gpu::Gpu;

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

/// What is kept of a window in case its device is lost.
#[derive(Debug, Default)]
pub(crate) struct LossSlot(Mutex<Kept>);

#[derive(Debug, Default)]
struct Kept {
    gpu: Option<Gpu>,
    saved: Option<Saved>,
    reason: Option<String>,
}

impl LossSlot {
    fn lock(&self) -> MutexGuard<'_, Kept> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// How the window is now.
    pub fn keep(&self, gpu: &Gpu, saved: Saved) {
        let mut kept = self.lock();
        kept.gpu.get_or_insert_with(|| gpu.clone());
        kept.saved = Some(saved);
    }

    /// The device is lost, and the window about to close.
    pub fn note(&self, reason: String, saved: Saved) {
        let mut kept = self.lock();
        (kept.reason, kept.saved) = (Some(reason), Some(saved));
    }

    /// Why the device was lost, if it was, and how the window was.
    fn take(&self) -> Option<(String, Option<Saved>)> {
        let Kept { gpu, saved, reason } = std::mem::take(&mut *self.lock());
        let reason = reason.or_else(|| {
            let gpu = gpu?;
            // The loss is told to whoever asks the device next.
            drop(gpu.device.poll(wgpu::PollType::Poll));
            gpu.lost()
        });
        Some((reason?, saved))
    }
}

/// Opens windows until the user closes one.
pub(crate) fn survive_losses(opening: Opening) -> anyhow::Result<()> {
    let Opening { mut options, mut saved, mut file, mut note } = opening;
    let mut short_lives = 0;
    loop {
        let (loss, begun) = (Arc::new(LossSlot::default()), Instant::now());
        let opening =
            Opening { options: options.clone(), saved: saved.clone(), file: file.take(), note: note.take() };
        // egui's renderer panics where a lost device gives it no memory: a window of which nothing is kept but what it was like.
        let closed = catch_unwind(AssertUnwindSafe(|| open_window(opening, &loss)));
        let Some((reason, last)) = loss.take() else {
            return closed.unwrap_or_else(|panic| resume_unwind(panic));
        };
        short_lives = if begun.elapsed() < LASTING { short_lives + 1 } else { 0 };
        if short_lives > SHORT_LIVES_MAX {
            bail!("the graphics device was lost {short_lives} times in a row, at last so: {reason}");
        }
        saved = last.unwrap_or(saved);
        file = options.state.clone().map(|path| SavedFile::new(path, saved.clone()));
        note = Some(format!("the graphics device was lost ({reason}); this window was opened anew"));
        options.lose_device_after_frames = None;
    }
}
