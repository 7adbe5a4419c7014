//! A daemon's and a client's half talk over a wire that delays and breaks as a seeded die says, against a simple model: whatever
//! happens, the client gets whole and true revisions only, never an older one after a newer one, and at rest the newest.
//!
//! `KILN_FUZZ_COUNT` and `KILN_FUZZ_SEED` make a long run of it.

use std::collections::{HashMap, VecDeque};
use std::sync::Arc;

use kiln_build::Digest;

use super::fuzz::{Random, number};
use super::table;
use crate::outbox::{OutboxState, Turn};
use crate::queue::Step;
use crate::session::ClientSession;
use crate::*;

/// Talks in the suite.
const TALKS: u64 = 300;
/// What happens in one of them.
const STEPS: usize = 400;
/// Messages that are on their way to the client at most, as if the socket's buffer were full then.
const ON_THEIR_WAY_MAX: usize = 6;

/// What is wrong with the daemon on purpose.
#[derive(Clone, Copy, PartialEq)]
enum Fault {
    None,
    /// Who connects again is not told the newest table.
    ForgetsTheTable,
    /// Contents are another's.
    MixesContents,
}

struct Simulation {
    random: Random,
    fault: Fault,
    /// What the daemon's store has.
    store: HashMap<Digest, Arc<[u8]>>,
    contents: Vec<Arc<[u8]>>,
    latest: Arc<RevisionTable>,
    daemon: OutboxState,
    client: ClientSession,
    to_client: VecDeque<ServerMessage>,
    to_daemon: VecDeque<ClientMessage>,
    /// The newest revision that the client has.
    shown: u64,
}

impl Simulation {
    fn new(mut random: Random, fault: Fault) -> Simulation {
        // Some of several chunks, some of none.
        let lengths = [0, 1, 40, 9000, (256 << 10) + 1, 600 << 10];
        let content = |(index, length): (usize, &usize)| Arc::from(vec![index as u8 + 1; *length]);
        let contents: Vec<Arc<[u8]>> = lengths.iter().enumerate().map(content).collect();
        let store = contents.iter().map(|bytes| (Digest::of(bytes), bytes.clone())).collect();
        let latest = Arc::new(table(1, &[&contents[random.below(lengths.len())]]));
        let mut simulation = Simulation {
            random,
            fault: Fault::None,
            store,
            contents,
            latest,
            daemon: OutboxState::default(),
            client: ClientSession::default(),
            to_client: VecDeque::new(),
            to_daemon: VecDeque::new(),
            shown: 0,
        };
        simulation.connect();
        simulation.fault = fault;
        simulation
    }

    /// Begins a connection; what the old one had on its way is lost.
    fn connect(&mut self) {
        self.client.reset();
        self.daemon = OutboxState::default();
        self.daemon.follows = true;
        self.daemon.table = Some(self.latest.clone()).filter(|_| self.fault != Fault::ForgetsTheTable);
        self.to_daemon.clear();
        self.to_client = VecDeque::from([ServerMessage::Hello(Hello::new("p", &[]))]);
    }

    fn publish(&mut self) {
        let mut chosen: Vec<&[u8]> = self.contents.iter().map(|bytes| &**bytes).collect();
        chosen.retain(|_| self.random.below(2) == 0);
        self.latest = Arc::new(table(self.latest.number + 1, &chosen));
        self.daemon.table = Some(self.latest.clone());
    }

    /// The store loses a content: the daemon makes it anew when somebody misses it, and publishes.
    fn heal(&mut self, digest: Digest) {
        let known = self.contents.iter().find(|bytes| Digest::of(bytes) == digest);
        self.store.extend(known.map(|bytes| (digest, bytes.clone())));
        let again = RevisionTable { number: self.latest.number + 1, ..(*self.latest).clone() };
        self.latest = Arc::new(again);
        self.daemon.table = Some(self.latest.clone());
    }

    /// The daemon's writing thread: false if it has nothing to write or no room.
    fn write(&mut self) -> bool {
        if self.to_client.len() >= ON_THEIR_WAY_MAX {
            return false;
        }
        let Some(turn) = self.daemon.next() else { return false };
        match turn {
            Turn::Message(message) => self.to_client.push_back(message),
            Turn::Table(table) => self.to_client.push_back(ServerMessage::Revision((*table).clone())),
            Turn::Content(Step::Missing(digest)) => self.say_missing(digest),
            Turn::Content(Step::Read(digest)) => match self.store.get(&digest).cloned() {
                Some(bytes) => self.daemon.queue.begin(digest, bytes),
                None => {
                    self.say_missing(digest);
                    self.heal(digest);
                }
            },
            Turn::Content(Step::Chunk { digest, bytes, offset, end }) => {
                self.daemon.queue.written(digest, end);
                let (total, mut bytes) = (bytes.len() as u64, bytes[offset..end].to_vec());
                if self.fault == Fault::MixesContents {
                    bytes.fill(99);
                }
                self.to_client.push_back(ServerMessage::Chunk {
                    digest,
                    offset: offset as u64,
                    total,
                    bytes,
                });
            }
        }
        true
    }

    fn say_missing(&mut self, digest: Digest) {
        self.daemon.queue.forget(&digest);
        self.to_client.push_back(ServerMessage::Missing(digest));
    }

    /// The client reads a message: false if there is none.
    fn hear(&mut self) -> bool {
        let Some(message) = self.to_client.pop_front() else { return false };
        let reaction = self.client.receive(message).expect("a daemon that keeps to the protocol");
        self.to_daemon.extend(reaction.send);
        for event in reaction.events {
            let ClientEvent::Revision(revision) = event else { continue };
            let parts = revision.table.targets.values().flat_map(|target| &target.parts);
            parts.for_each(|part| assert_eq!(Digest::of(revision.bytes(part)), part.digest));
            let number = revision.table.number;
            assert!(number <= self.latest.number, "nobody published it");
            assert!(number >= self.shown, "an older revision after a newer one");
            self.shown = number;
        }
        true
    }

    /// The daemon reads a message: false if there is none.
    fn listen(&mut self) -> bool {
        match self.to_daemon.pop_front() {
            Some(ClientMessage::Fetch(digests)) => self.daemon.queue.fetch(digests),
            Some(ClientMessage::Pong(number)) => self.daemon.take_pong(number),
            Some(_) => {}
            None => return false,
        }
        true
    }

    fn step(&mut self) {
        match self.random.below(40) {
            0 | 1 => self.publish(),
            2 => self.connect(),
            3 => {
                let lost = Digest::of(&self.contents[self.random.below(self.contents.len())]);
                self.store.remove(&lost);
            }
            4 => self.daemon.queue.set_wants(Wants { targets: vec!["env/a".into()], ..Wants::default() }),
            5..=16 => _ = self.write(),
            17..=28 => _ = self.hear(),
            _ => _ = self.listen(),
        }
    }

    /// All messages arrive; then the client must have the newest revision.
    fn rest(&mut self) {
        let mut steps = 0;
        while self.write() | self.hear() | self.listen() {
            steps += 1;
            assert!(steps < 10_000, "they never come to rest");
        }
        assert_eq!(self.shown, self.latest.number, "the client is behind for ever");
    }
}

fn talks(fault: Fault, count: u64) {
    for talk in 0..count {
        let mut simulation = Simulation::new(Random::new(100 + talk), fault);
        for step in 0..STEPS {
            simulation.step();
            if step % 100 == 99 {
                simulation.rest();
            }
        }
    }
}

#[test]
fn client_is_true_and_at_rest_current_whatever_is_published_lost_delayed_or_cut() {
    talks(Fault::None, number("KILN_FUZZ_COUNT", TALKS * 10) / 10);
}

#[test]
#[should_panic(expected = "the client is behind for ever")]
fn simulation_finds_a_daemon_that_forgets_to_tell() {
    talks(Fault::ForgetsTheTable, 20);
}

#[test]
#[should_panic(expected = "a daemon that keeps to the protocol")]
fn simulation_finds_a_daemon_that_mixes_contents() {
    talks(Fault::MixesContents, 20);
}
