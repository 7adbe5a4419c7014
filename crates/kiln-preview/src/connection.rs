//! The talk with the daemon, which wakes the window.

use std::sync::mpsc::{Receiver, Sender, channel};

use kiln_link::{Answer, Ask, Client, ClientEvent, Endpoint, FrameReporter};

use crate::worker::unix_ms;

/// Something from the daemon, with when it came.
#[derive(Debug)]
pub(crate) struct Heard {
    pub event: ClientEvent,
    pub unix_ms: f64,
}

/// Both directions of the talk, as the window sees them. Nothing waits for a turn: what comes is heard from the thread that reads it,
/// and what the window says is written at once.
#[derive(Debug)]
pub(crate) struct Connection {
    client: Client,
    heard: Receiver<Heard>,
    /// What is refused here is heard as if the daemon had.
    own: Sender<Heard>,
}

impl Connection {
    /// Connects; `wake` is called whenever [`Connection::next`] has something new.
    pub fn open(endpoint: impl Into<Endpoint>, wake: impl Fn() + Send + 'static) -> Self {
        let (own, heard) = channel();
        let sender = own.clone();
        let client = Client::connect_and_tell(endpoint, "preview, window", move |event| {
            let is_heard = sender.send(Heard { event, unix_ms: unix_ms() }).is_ok();
            wake();
            is_heard
        });
        Connection { client, heard, own }
    }

    /// The oldest event not yet taken.
    pub fn next(&self) -> Option<Heard> {
        self.heard.try_recv().ok()
    }

    /// Tells the daemon what is shown: its contents come first.
    pub fn want(&self, targets: Vec<String>) {
        self.client.want(targets);
    }

    /// Asks the daemon to change the project; the answer is heard as [`ClientEvent::Answer`].
    pub fn request(&self, ask: Ask) {
        // Nobody else will answer it.
        if let Err(reason) = self.client.request(ask) {
            let event = ClientEvent::Answer(Answer::refused(0, *reason));
            // The window has the receiver.
            drop(self.own.send(Heard { event, unix_ms: unix_ms() }));
        }
    }

    /// Where finished frames are reported.
    pub fn reporter(&self) -> FrameReporter {
        self.client.reporter()
    }
}
