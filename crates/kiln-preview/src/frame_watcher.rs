//! When the device finished the first frame of a revision: what the user calls latency.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;

use anyhow::Context as _;
use kiln_gpu::Submitted;
use kiln_link::FrameReport;

use crate::worker::{Ready, unix_ms};

/// How long a frame may take before nobody waits for it any more.
const FRAME_TIMEOUT: Duration = Duration::from_secs(20);

/// A frame whose end the daemon wants to know.
pub(crate) struct Watched {
    pub submitted: Submitted,
    pub ready: Ready,
    pub noticed_unix_ms: f64,
}

/// A frame that the device has finished.
pub(crate) struct Finished {
    pub report: FrameReport,
    /// From noticing the change; `None` where there was none.
    pub latency_ms: Option<f64>,
}

/// Waits for frames on its own thread and reports when the device was done with them.
pub(crate) struct FrameWatcher {
    frames: Sender<Watched>,
    finished: Receiver<Finished>,
}

impl FrameWatcher {
    /// Starts the thread; `wake` is called whenever [`FrameWatcher::finished`] has something new.
    pub fn spawn(
        report: impl Fn(FrameReport) + Send + 'static,
        wake: impl Fn() + Send + 'static,
    ) -> anyhow::Result<Self> {
        let (frames, watched) = channel::<Watched>();
        let (sender, finished) = channel();
        let thread = std::thread::Builder::new().name("frames".into());
        let watch = move || {
            for frame in watched {
                let frame = await_frame(frame);
                report(frame.report.clone());
                // The other end belongs to the window: when it is gone, so is the need.
                if sender.send(frame).is_err() {
                    return;
                }
                wake();
            }
        };
        thread.spawn(watch).context("starting a thread")?;
        Ok(FrameWatcher { frames, finished })
    }

    /// Waits for `frame`.
    pub fn watch(&self, frame: Watched) {
        // The thread ends only with the window.
        drop(self.frames.send(frame));
    }

    /// The frames that were waited for, each once.
    pub fn finished(&self) -> impl Iterator<Item = Finished> {
        self.finished.try_iter()
    }
}

fn await_frame(frame: Watched) -> Finished {
    // A lost device shows in the panel; its frame counts as drawn now.
    frame.submitted.wait(FRAME_TIMEOUT);
    let drawn_unix_ms = unix_ms();
    let Ready { prepared, received_unix_ms, ready_unix_ms } = frame.ready;
    let revision = prepared.report.revision;
    let latency_ms = (frame.noticed_unix_ms > 0.0).then_some(drawn_unix_ms - frame.noticed_unix_ms);
    let report = FrameReport { revision, received_unix_ms, ready_unix_ms, drawn_unix_ms };
    Finished { report, latency_ms }
}
