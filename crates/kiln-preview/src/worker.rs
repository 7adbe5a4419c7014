//! The thread that prepares revisions, so that the one that draws never waits.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{SystemTime, UNIX_EPOCH};

use kiln_gpu::Gpu;
use kiln_link::Revision;

use crate::parameter::ParameterValues;
use crate::prepare::{Prepared, Preparer};
use crate::view::Selection;

/// Preparing may go deep into a shader compiler.
const STACK_BYTES: usize = 16 << 20;

/// What to prepare.
#[derive(Debug)]
pub(crate) struct Request {
    pub revision: Arc<Revision>,
    pub selection: Selection,
    /// What overrides are set to.
    pub overrides: ParameterValues,
    /// When the whole revision was here.
    pub received_unix_ms: f64,
}

/// A prepared revision with its times.
#[derive(Debug)]
pub(crate) struct Ready {
    pub prepared: Arc<Prepared>,
    pub received_unix_ms: f64,
    /// When pipelines and uploads were done.
    pub ready_unix_ms: f64,
}

/// Prepares the newest request; older ones that did not begin are dropped.
#[derive(Debug)]
pub(crate) struct Worker {
    requests: Option<Sender<Request>>,
    ready: Arc<Mutex<Option<Ready>>>,
    thread: Option<JoinHandle<()>>,
}

impl Worker {
    /// Starts the thread; `wake` is called whenever [`Worker::take`] has something new.
    pub fn spawn(gpu: Gpu, wake: impl Fn() + Send + 'static) -> std::io::Result<Self> {
        let (requests, receiver) = channel();
        let ready = Arc::new(Mutex::new(None));
        let slot = Arc::clone(&ready);
        let thread = std::thread::Builder::new().name("prepare".into()).stack_size(STACK_BYTES);
        let thread = thread.spawn(move || prepare_newest(&gpu, &receiver, &slot, wake))?;
        Ok(Worker { requests: Some(requests), ready, thread: Some(thread) })
    }

    /// Asks for a revision and selection.
    pub fn request(&self, request: Request) {
        if let Some(requests) = &self.requests {
            // The thread ends only with this sender, unless it panicked: then the last picture stays.
            drop(requests.send(request));
        }
    }

    /// The newest prepared revision, once.
    pub fn take(&self) -> Option<Ready> {
        self.ready.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        drop(self.requests.take());
        if let Some(thread) = self.thread.take() {
            // It has nothing to return.
            drop(thread.join());
        }
    }
}

fn prepare_newest(gpu: &Gpu, requests: &Receiver<Request>, ready: &Mutex<Option<Ready>>, wake: impl Fn()) {
    let mut preparer = Preparer::new(gpu);
    while let Ok(request) = requests.recv() {
        let request = requests.try_iter().last().unwrap_or(request);
        let Request { revision, selection, overrides, .. } = &request;
        let Some(prepared) = preparer.prepare(revision, selection, overrides) else { continue };
        *ready.lock().unwrap_or_else(PoisonError::into_inner) = Some(Ready {
            prepared: Arc::new(prepared),
            received_unix_ms: request.received_unix_ms,
            ready_unix_ms: unix_ms(),
        });
        wake();
    }
}

/// Now, in milliseconds since 1970; the daemon compares it with the time of the save.
pub(crate) fn unix_ms() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64() * 1e3)
}
