//! The thread that talks to the daemon and wakes the window.

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, TryRecvError, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use kiln_link::{Answer, Ask, Client, ClientEvent, FrameReport};

use crate::worker::unix_ms;

/// How often a finished frame is looked for while the daemon waits for one; its times are taken elsewhere.
const REPORT_POLL: Duration = Duration::from_millis(20);
/// How often the thread looks whether the window is gone.
const IDLE_POLL: Duration = Duration::from_millis(250);

/// Something from the daemon, with when it came.
#[derive(Debug)]
pub(crate) struct Heard {
    pub event: ClientEvent,
    pub unix_ms: f64,
}

/// Both directions of the talk, as the window sees them.
#[derive(Debug)]
pub(crate) struct Connection {
    heard: Receiver<Heard>,
    reports: Sender<FrameReport>,
    /// Its end tells the thread that the window is gone: others keep senders of reports.
    wants: Option<Sender<Vec<String>>>,
    thread: Option<JoinHandle<()>>,
    requests: Sender<Ask>,
}

impl Connection {
    /// Connects; `wake` is called whenever [`Connection::next`] has something new.
    pub fn open(socket: PathBuf, wake: impl Fn() + Send + 'static) -> std::io::Result<Self> {
        let (sender, heard) = channel();
        let (reports, reported) = channel();
        let (wants, wanted) = channel();
        let (requests, asked) = channel();
        let thread = std::thread::Builder::new().name("link".into());
        let thread = thread.spawn(move || {
            forward(
                &Client::connect(socket, "preview, window"),
                &sender,
                &Told { reported, wanted, asked },
                wake,
            );
        })?;
        Ok(Connection { heard, reports, wants: Some(wants), thread: Some(thread), requests })
    }

    /// The oldest event not yet taken.
    pub fn next(&self) -> Option<Heard> {
        self.heard.try_recv().ok()
    }

    /// Tells the daemon what is shown: its contents come first.
    pub fn want(&self, targets: Vec<String>) {
        // The thread ends only with the window.
        self.wants.iter().for_each(|wants| drop(wants.send(targets.clone())));
    }

    /// Asks the daemon to change the project; the answer is heard as [`ClientEvent::Answer`].
    pub fn request(&self, ask: Ask) {
        // The thread ends only with the window.
        drop(self.requests.send(ask));
    }

    /// Where finished frames are reported.
    pub fn reports(&self) -> Sender<FrameReport> {
        self.reports.clone()
    }
}

impl Drop for Connection {
    fn drop(&mut self) {
        drop(self.wants.take());
        if let Some(thread) = self.thread.take() {
            // It has nothing to return.
            drop(thread.join());
        }
    }
}

/// What the window has to say.
struct Told {
    reported: Receiver<FrameReport>,
    wanted: Receiver<Vec<String>>,
    asked: Receiver<Ask>,
}

/// Passes events on and reports back until the window is gone. The client's receiver cannot be shared between
/// threads, so one thread serves both directions, and polls for reports only while one is due.
fn forward(client: &Client, heard: &Sender<Heard>, told: &Told, wake: impl Fn()) {
    let mut newest_sent = 0;
    let mut newest_reported = 0;
    loop {
        let poll = if newest_sent > newest_reported { REPORT_POLL } else { IDLE_POLL };
        match client.events().recv_timeout(poll) {
            Ok(event) => {
                if let ClientEvent::Revision(revision) = &event {
                    newest_sent = revision.table.number;
                }
                if heard.send(Heard { event, unix_ms: unix_ms() }).is_err() {
                    return;
                }
                wake();
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return,
        }
        loop {
            match told.wanted.try_recv() {
                Ok(targets) => client.want(targets),
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) => return,
            }
        }
        for ask in told.asked.try_iter() {
            // Nobody else will answer it.
            if let Err(reason) = client.request(ask) {
                let event = ClientEvent::Answer(Answer::refused(0, *reason));
                if heard.send(Heard { event, unix_ms: unix_ms() }).is_err() {
                    return;
                }
                wake();
            }
        }
        for report in told.reported.try_iter() {
            newest_reported = report.revision;
            client.report_frame(report);
        }
    }
}
