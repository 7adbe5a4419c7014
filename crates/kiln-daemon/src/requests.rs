//! The thread that changes sources for clients that ask, one request after another. Building is none of its business: the watcher
//! tells of what it wrote as of any edit.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};

use kiln_build::{Digest, Engine};
use kiln_diagnostic::Diagnostic;
use kiln_link::{Answer, Ask, ParameterWrite, Request, Server};
use kiln_project::{ParameterValue, add_files, describe_written, write_parameters};

pub(crate) struct Requests {
    /// Bounded by what the server lets each client have open.
    asked: Option<Sender<(u64, Request)>>,
    stopping: Arc<AtomicBool>,
    thread: Option<std::thread::JoinHandle<()>>,
}

impl Requests {
    /// Starts the thread; it ends when this is dropped.
    pub(crate) fn start(engine: Arc<Engine>, server: Arc<Server>) -> Requests {
        let (asked, received) = channel();
        let stopping = Arc::new(AtomicBool::new(false));
        let worker = Worker { engine, written: BTreeMap::new() };
        let stop = stopping.clone();
        let thread = std::thread::spawn(move || worker.run(&received, &server, &stop));
        Requests { asked: Some(asked), stopping, thread: Some(thread) }
    }

    /// Does what a client asks, when it is its turn, and answers it.
    pub(crate) fn ask(&self, client: u64, request: Request) {
        if let Some(asked) = &self.asked {
            // The thread lives as long as this does.
            let _ = asked.send((client, request));
        }
    }
}

impl Drop for Requests {
    /// Waits for the thread, so that nothing is half written.
    fn drop(&mut self) {
        self.stopping.store(true, Ordering::SeqCst);
        drop(self.asked.take());
        if let Some(thread) = self.thread.take() {
            // A panic in it has been answered as a failure already.
            let _ = thread.join();
        }
    }
}

struct Worker {
    engine: Arc<Engine>,
    /// What it wrote: whoever writes two values one after the other does not wait for the build between them.
    written: BTreeMap<String, Digest>,
}

impl Worker {
    fn run(mut self, asked: &Receiver<(u64, Request)>, server: &Server, stopping: &AtomicBool) {
        while let Ok((client, request)) = asked.recv() {
            if stopping.load(Ordering::SeqCst) {
                return;
            }
            let work = std::panic::AssertUnwindSafe(|| self.answer(&request));
            let panicked =
                |_| Answer::refused(0, Diagnostic::error("the daemon failed to do this; its log says more"));
            let answer = std::panic::catch_unwind(work).unwrap_or_else(panicked);
            let (id, is_done) = (request.id, answer.is_done());
            tracing::info!(target: "request", client, id, is_done, message = answer.message, "answered");
            server.answer(client, Answer { id: request.id, ..answer });
        }
    }

    fn answer(&mut self, request: &Request) -> Answer {
        match &request.ask {
            Ask::WriteParameters { parameters } => self.write(parameters),
            Ask::AddFiles { paths } => self.add(paths),
            // The loop itself does that.
            Ask::BakeAtError { .. } | Ask::Unknown => {
                let fault = Diagnostic::error("this daemon does not know what it is asked to do");
                Answer::refused(0, fault.with_help("end it with `kiln stop` and start the newer one"))
            }
        }
    }

    fn write(&mut self, parameters: &[ParameterWrite]) -> Answer {
        let value = |write: &ParameterWrite| ParameterValue {
            shader: write.shader.clone(),
            name: write.name.clone(),
            value: write.value.clone(),
        };
        let values: Vec<ParameterValue> = parameters.iter().map(value).collect();
        match write_parameters(&self.engine, &values, &self.written) {
            Ok(written) => {
                let message = describe_written(&written);
                self.written.extend(written.into_iter().map(|source| (source.path, source.digest)));
                Answer { message, ..Answer::default() }
            }
            Err(fault) => Answer::refused(0, *fault),
        }
    }

    fn add(&self, paths: &[String]) -> Answer {
        let paths: Vec<PathBuf> = paths.iter().map(PathBuf::from).collect();
        if let Some(path) = paths.iter().find(|path| !path.is_absolute()) {
            let message = format!("`{}` is no absolute path", path.display());
            return Answer::refused(0, Diagnostic::error(message));
        }
        let added = add_files(self.engine.folder(), &paths);
        let message = added.messages.join("; ");
        Answer { message, diagnostics: added.refused, targets: added.targets, ..Answer::default() }
    }
}
