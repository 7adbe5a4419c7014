//! Waiting for the device on one thread while others draw.

use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use crate::Gpu;

/// How often the device is asked whether it is done.
const ASK_INTERVAL: Duration = Duration::from_millis(1);

/// Becomes done when the device is with what was submitted before this was made.
///
/// [`Gpu::wait`] waits inside wgpu and keeps a lock there that presenting and submitting on other threads need; this asks again
/// and again instead, and holds up nobody.
#[derive(Debug)]
pub struct Submitted {
    device: wgpu::Device,
    done: Receiver<()>,
}

impl Gpu {
    /// What was submitted so far.
    pub fn submitted(&self) -> Submitted {
        let (sender, done) = channel();
        // Nobody may be waiting any more.
        self.queue.on_submitted_work_done(move || sender.send(()).unwrap_or_default());
        Submitted { device: self.device.clone(), done }
    }
}

impl Submitted {
    /// Waits until it is done; false if `limit` passed or the device is lost.
    pub fn wait(&self, limit: Duration) -> bool {
        let deadline = Instant::now() + limit;
        while Instant::now() < deadline && self.device.poll(wgpu::PollType::Poll).is_ok() {
            match self.done.recv_timeout(ASK_INTERVAL) {
                Ok(()) => return true,
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return false,
            }
        }
        false
    }
}
