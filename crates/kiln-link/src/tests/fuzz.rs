//! Seeded damage to the wire: decoder, both state machines, whole server and whole client.
//!
//! `cargo xtask fuzz wire 1000000 7` makes a long run of it, with another seed (`KILN_FUZZ_COUNT`, `KILN_FUZZ_SEED`).

use std::io::{Read as _, Write as _};
use std::os::unix::net::{UnixListener, UnixStream};
use std::sync::Arc;

use kiln_build::Digest;
use kiln_diagnostic::Diagnostic;

use super::{Bench, LIMIT, chunk, greeted, next_revision, serve, table};
use crate::session::ClientSession;
use crate::wire::{CLIENT_FRAME_BYTES_MAX, FETCH_DIGESTS_MAX, Message};
use crate::*;

/// Damaged talks in the suite.
const TALKS: u64 = 2000;
/// One in so many is also held over a real socket.
const OVER_SOCKETS: u64 = 20;

const CONTENTS: [&[u8]; 3] = [b"first", b"second content", b""];

pub(super) fn number(variable: &str, otherwise: u64) -> u64 {
    match std::env::var(variable) {
        Ok(text) => text.parse().unwrap_or_else(|_| panic!("{variable}={text} is no number")),
        Err(_) => otherwise,
    }
}

fn talk_count() -> u64 {
    number("KILN_FUZZ_COUNT", TALKS)
}

/// SplitMix64.
pub(super) struct Random(u64);

impl Random {
    pub(super) fn new(stream: u64) -> Random {
        Random(number("KILN_FUZZ_SEED", 20_261_122).wrapping_add(stream << 32))
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut mixed = self.0;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ (mixed >> 31)
    }

    pub(super) fn below(&mut self, end: usize) -> usize {
        (self.next() % end.max(1) as u64) as usize
    }

    /// A talk with one to four faults.
    fn damage(&mut self, talk: &[u8]) -> Vec<u8> {
        let mut bytes = talk.to_vec();
        for _ in 0..=self.below(4) {
            let at = self.below(bytes.len());
            match self.below(6) {
                0 if !bytes.is_empty() => bytes[at] ^= 1 << self.below(8),
                1 => bytes.truncate(at),
                2 => bytes.insert(at, self.next() as u8),
                3 if !bytes.is_empty() => _ = bytes.remove(at),
                4 => bytes.extend(talk.iter().skip(at).take(64)),
                _ => {
                    let extreme = [0, 1, u32::MAX, 1 << 23, 1 << 26][self.below(5)].to_le_bytes();
                    bytes.iter_mut().skip(at).zip(extreme).for_each(|(byte, new)| *byte = new);
                }
            }
        }
        bytes
    }

    /// The bytes in pieces of any length.
    fn pieces<'a>(&mut self, mut bytes: &'a [u8]) -> Vec<&'a [u8]> {
        let mut pieces = Vec::new();
        while !bytes.is_empty() {
            let (piece, rest) = bytes.split_at(1 + self.below(bytes.len()));
            pieces.push(piece);
            bytes = rest;
        }
        pieces
    }
}

fn write_request(id: u64) -> ClientMessage {
    let write = ParameterWrite { shader: "pbr".into(), name: "wetness".into(), value: vec![0.25] };
    ClientMessage::Request(Request { id, ask: Ask::WriteParameters { parameters: vec![write] } })
}

fn client_talk() -> Vec<u8> {
    let messages = [
        ClientMessage::Hello(Hello::new("fuzz", &[capability::REVISIONS])),
        ClientMessage::Wants(Wants { targets: vec!["env/a".into()], ..Wants::default() }),
        ClientMessage::Fetch(CONTENTS.iter().map(|bytes| Digest::of(bytes)).collect()),
        ClientMessage::Ping(7),
        ClientMessage::Pong(1),
        ClientMessage::Frame(FrameReport {
            revision: 1,
            received_unix_ms: 1.0,
            ready_unix_ms: 2.0,
            drawn_unix_ms: 3.0,
        }),
        ClientMessage::Status,
        write_request(1),
        ClientMessage::Request(Request { id: 2, ask: Ask::AddFiles { paths: vec!["/a.hdr".into()] } }),
    ];
    messages.iter().flat_map(Message::encode).collect()
}

fn server_messages() -> Vec<ServerMessage> {
    let mut messages = vec![
        ServerMessage::Hello(Hello::new("p", &[])),
        ServerMessage::Revision(table(1, &CONTENTS)),
        ServerMessage::Ping(1),
        ServerMessage::Progress(ProgressReport::default()),
        ServerMessage::Pong(1),
        ServerMessage::Status(Box::default()),
        ServerMessage::Answer(Answer::refused(1, Diagnostic::error("no"))),
    ];
    messages.extend(CONTENTS.map(|bytes| chunk(bytes, bytes)));
    messages
}

fn server_talk() -> Vec<u8> {
    server_messages().iter().flat_map(Message::encode).collect()
}

/// What came of a talk with a session.
#[derive(Debug, Default, PartialEq, Eq)]
struct Outcome {
    revisions: usize,
    refused: bool,
}

/// Feeds a daemon's bytes to a session; every revision that comes of it must be whole and true.
fn hear<'a>(session: &mut ClientSession, pieces: impl IntoIterator<Item = &'a [u8]>) -> Outcome {
    let mut decoder = Decoder::default();
    let mut outcome = Outcome::default();
    for piece in pieces {
        decoder.push(piece);
        loop {
            let reaction = match decoder.next_message::<ServerMessage>() {
                Ok(None) => break,
                Ok(Some(message)) => session.receive(message),
                Err(error) => Err(error.to_string()),
            };
            let Ok(reaction) = reaction else { return Outcome { refused: true, ..outcome } };
            for event in reaction.events {
                let ClientEvent::Revision(revision) = event else { continue };
                for part in revision.table.targets.values().flat_map(|target| &target.parts) {
                    assert_eq!(Digest::of(revision.bytes(part)), part.digest, "a content is another's");
                }
                outcome.revisions += 1;
            }
        }
    }
    outcome
}

#[test]
fn damaged_talk_of_a_daemon_gives_true_revisions_or_none() {
    let talk = server_talk();
    let mut random = Random::new(1);
    let (mut refused, mut revisions) = (0, 0);
    for _ in 0..talk_count() {
        let damaged = random.damage(&talk);
        let outcome = hear(&mut ClientSession::default(), random.pieces(&damaged));
        refused += usize::from(outcome.refused);
        revisions += outcome.revisions;
    }
    eprintln!(
        "{} talks of a daemon damaged: {refused} refused, {revisions} revisions, all true",
        talk_count()
    );
    assert!(refused > 0 && revisions > 0, "the damage is too weak or too strong to show anything");
}

/// The failing twin: a session that did not compare digests would deliver this.
#[test]
fn content_with_one_other_bit_is_refused() {
    let mut session = greeted();
    session.receive(ServerMessage::Revision(table(1, &[b"abc"]))).unwrap();
    assert!(session.receive(chunk(b"abc", b"abb")).is_err());
}

#[test]
fn talk_cut_at_any_byte_is_taken_up_by_the_next_connection() {
    let talk = server_talk();
    for cut in 0..=talk.len() {
        let mut session = ClientSession::default();
        let before = hear(&mut session, [&talk[..cut]]);
        assert!(!before.refused, "cut at {cut}");
        session.reset();
        let fetched = fetches_after_reset(&mut session);
        // Only what is still missing may come now.
        let chunks = CONTENTS.iter().filter(|bytes| fetched.contains(&Digest::of(bytes)));
        let rest: Vec<u8> = chunks.flat_map(|bytes| chunk(bytes, bytes).encode()).collect();
        let after = hear(&mut session, [rest.as_slice()]);
        let is_known = fetched.is_empty();
        assert!(!after.refused && (after.revisions == 1 || is_known), "cut at {cut}: {after:?}");
    }
}

/// Greets a session again and tells it the same table; returns what it asks for.
fn fetches_after_reset(session: &mut ClientSession) -> Vec<Digest> {
    let mut fetched = Vec::new();
    for message in [ServerMessage::Hello(Hello::new("p", &[])), ServerMessage::Revision(table(1, &CONTENTS))]
    {
        for answer in session.receive(message).unwrap().send {
            let ClientMessage::Fetch(digests) = answer else { continue };
            fetched.extend(digests);
        }
    }
    fetched
}

#[test]
fn damaged_talk_of_a_client_is_decoded_or_refused() {
    let talk = client_talk();
    let mut random = Random::new(2);
    let mut refused = 0;
    for _ in 0..talk_count() {
        let damaged = random.damage(&talk);
        let mut decoder = Decoder::default();
        'talk: for piece in random.pieces(&damaged) {
            decoder.push(piece);
            loop {
                match decoder.next_message::<ClientMessage>() {
                    Ok(Some(_)) => {}
                    Ok(None) => break,
                    Err(_) => {
                        refused += 1;
                        break 'talk;
                    }
                }
            }
        }
    }
    eprintln!("{} talks of a client damaged: {refused} refused", talk_count());
    assert!(refused > 0);
}

/// Holds a talk with a server, reads what it answers until it or we hang up.
fn attack(bench: &Bench, bytes: &[u8]) {
    let mut stream = UnixStream::connect(&bench.socket).unwrap();
    stream.set_read_timeout(Some(LIMIT)).unwrap();
    // It may hang up in the middle.
    let _ = stream.write_all(bytes);
    let _ = stream.shutdown(std::net::Shutdown::Write);
    let mut answer = Vec::new();
    if let Err(error) = stream.read_to_end(&mut answer) {
        assert_eq!(error.kind(), std::io::ErrorKind::ConnectionReset, "it neither answered nor hung up");
    }
}

/// What was done to a server did it no harm.
fn serves_still(bench: &Bench, number: u64) {
    bench.server.publish(Arc::new(table(number, &CONTENTS)));
    let client = Client::connect(bench.socket.clone(), "good");
    wait_for_revision(&client, number);
}

/// Over as many connections as it takes: one may be refused while others that are leaving crowd the server.
fn wait_for_revision(client: &Client, number: u64) {
    loop {
        match client.events().recv_timeout(LIMIT).expect("the revision in time") {
            ClientEvent::Revision(revision) if revision.table.number == number => return,
            ClientEvent::Revision(_)
            | ClientEvent::Connected { .. }
            | ClientEvent::Disconnected { .. }
            | ClientEvent::Progress { .. }
            | ClientEvent::Answer(_) => {}
        }
    }
}

#[test]
fn server_survives_damaged_talks_while_it_serves_a_good_client() {
    let bench = serve(&CONTENTS);
    bench.server.publish(Arc::new(table(1, &CONTENTS)));
    let good = Client::connect(bench.socket.clone(), "good");
    next_revision(&good);
    let talk = client_talk();
    let mut random = Random::new(3);
    for number in 2..2 + talk_count() / OVER_SOCKETS {
        attack(&bench, &random.damage(&talk));
        bench.server.publish(Arc::new(table(number, &CONTENTS)));
        while next_revision(&good).table.number < number {}
    }
}

#[test]
fn server_survives_a_client_that_leaves_at_any_byte() {
    let bench = serve(&CONTENTS);
    bench.server.publish(Arc::new(table(1, &CONTENTS)));
    let talk = client_talk();
    for cut in 0..talk.len() {
        let mut stream = UnixStream::connect(&bench.socket).unwrap();
        // The server may have closed already when it is crowded by those that are leaving.
        let _ = stream.write_all(&talk[..cut]);
    }
    serves_still(&bench, 2);
}

#[test]
fn client_survives_damaged_daemons_and_finds_the_good_one() {
    let folder = tempfile::tempdir().unwrap();
    let talk = server_talk();
    let mut random = Random::new(4);
    // Each daemon costs the client's wait before it connects again.
    for round in 0..(talk_count() / 1000).clamp(1, 100) {
        let socket = folder.path().join(format!("{round}.sock"));
        let listener = UnixListener::bind(&socket).unwrap();
        let client = Client::connect(socket.clone(), "good");
        for _ in 0..3 {
            let (mut stream, _) = listener.accept().unwrap();
            // The client may hang up in the middle.
            let _ = stream.write_all(&random.damage(&talk));
        }
        drop(listener);
        let blobs = |digest: &Digest| {
            CONTENTS.iter().find(|bytes| Digest::of(bytes) == *digest).map(|bytes| Arc::from(*bytes))
        };
        let server = Server::bind(&socket, "test", Box::new(blobs), Box::new(drop)).unwrap();
        server.publish(Arc::new(table(1000, &CONTENTS)));
        wait_for_revision(&client, 1000);
    }
}

#[test]
fn floods_and_oversize_messages_end_their_connection_alone() {
    let bench = serve(&CONTENTS);
    bench.server.publish(Arc::new(table(1, &CONTENTS)));
    let hello = ClientMessage::Hello(Hello::new("flood", &[capability::REVISIONS])).encode();
    let too_long = u32::try_from(CLIENT_FRAME_BYTES_MAX + 1).unwrap().to_le_bytes().to_vec();
    let many_digests: Vec<Digest> =
        (0..=FETCH_DIGESTS_MAX as u32).map(|index| Digest::of(&index.to_le_bytes())).collect();
    let wants = |targets| ClientMessage::Wants(Wants { targets, ..Wants::default() }).encode();
    let hostile: [Vec<u8>; 4] = [
        too_long,
        ClientMessage::Fetch(many_digests).encode(),
        wants(vec!["x".into(); 1001]),
        wants(vec!["x".repeat(257)]),
    ];
    for attack_bytes in hostile {
        attack(&bench, &[hello.clone(), attack_bytes].concat());
        let gone = bench.events.iter().find(|event| matches!(event, ServerEvent::Gone { .. })).unwrap();
        let ServerEvent::Gone { reason, .. } = gone else { unreachable!("only those were asked for") };
        assert!(reason.contains("frame") || reason.contains("asked for more"), "{reason}");
    }
    let harmless: Vec<u8> = std::iter::repeat_n(
        [ClientMessage::Ping(1), ClientMessage::Pong(1), ClientMessage::Status]
            .map(|message| message.encode())
            .concat(),
        20_000,
    )
    .flatten()
    .collect();
    attack(&bench, &[hello, harmless].concat());
    serves_still(&bench, 2);
}

#[test]
fn deep_json_is_refused_and_does_not_exhaust_the_stack() {
    let deep = "[".repeat(1 << 20);
    let meta =
        format!(r#"{{"number":1,"targets":{{"a":{{"kind":"k","state":"fresh","parts":[],"meta":{deep}"#);
    assert!(ServerMessage::decode(66, meta.as_bytes()).is_err());
    assert!(ClientMessage::decode(4, format!(r#"{{"targets":{deep}"#).as_bytes()).is_err());
    assert!(ClientMessage::decode(2, deep.as_bytes()).is_err());
}
