//! Both halves of the wire: over real sockets, and message by message.

#![expect(clippy::print_stderr, reason = "what was skipped and what a long run found is said")]

mod control;
mod fuzz;
mod python;
mod queue;
mod requests;
mod simulation;
mod tcp;
mod throughput;

use std::collections::{BTreeMap, HashMap};
use std::io::{Read as _, Write as _};
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use kiln_build::Digest;
use serde_json::json;

use crate::session::ClientSession;
use crate::wire::{Message, SERVER_FRAME_BYTES_MAX};
use crate::*;

const LIMIT: Duration = Duration::from_secs(20);

fn table(number: u64, contents: &[&[u8]]) -> RevisionTable {
    let part = |(index, bytes): (usize, &&[u8])| Part {
        name: format!("mip{index}"),
        digest: Digest::of(bytes),
        bytes: bytes.len() as u64,
    };
    let target = Target {
        kind: "cube".into(),
        state: TargetState::Fresh,
        meta: json!({"size": 1}),
        parts: contents.iter().enumerate().map(part).collect(),
    };
    let targets = BTreeMap::from([("env/a/specular".to_owned(), target)]);
    RevisionTable { number, targets, ..RevisionTable::default() }
}

struct Bench {
    server: Server,
    events: Receiver<ServerEvent>,
    socket: std::path::PathBuf,
    _folder: tempfile::TempDir,
}

fn serve(contents: &[&[u8]]) -> Bench {
    let folder = tempfile::tempdir().unwrap();
    let socket = folder.path().join("test.sock");
    let blobs: HashMap<Digest, Arc<[u8]>> =
        contents.iter().map(|bytes| (Digest::of(bytes), Arc::from(*bytes))).collect();
    let (sender, events) = channel();
    let blobs = Box::new(move |digest: &Digest| blobs.get(digest).cloned());
    let events_out = Box::new(move |event| drop(sender.send(event)));
    let server = Server::bind(&socket, "test", blobs, events_out).unwrap();
    Bench { server, events, socket, _folder: folder }
}

fn next_revision(client: &Client) -> Arc<Revision> {
    loop {
        match client.events().recv_timeout(LIMIT).expect("a revision in time") {
            ClientEvent::Revision(revision) => return revision,
            ClientEvent::Disconnected { reason } => panic!("{reason}"),
            ClientEvent::Connected { .. } | ClientEvent::Progress { .. } | ClientEvent::Answer(_) => {}
        }
    }
}

#[test]
fn two_clients_get_whole_revisions_over_the_socket() {
    let big = vec![7; 3 << 20];
    let bench = serve(&[b"small", &big]);
    bench.server.publish(Arc::new(table(1, &[b"small", &big])));
    let clients = [Client::connect(bench.socket.clone(), "a"), Client::connect(bench.socket.clone(), "b")];
    for client in &clients {
        let revision = next_revision(client);
        assert_eq!(revision.table.number, 1);
        assert_eq!(revision.part("env/a/specular", "mip1").unwrap().len(), big.len());
    }
    bench.server.publish(Arc::new(table(2, &[b"small"])));
    for client in &clients {
        assert_eq!(next_revision(client).table.number, 2);
    }
}

#[test]
fn client_reconnects_to_the_next_daemon_on_the_same_socket() {
    let bench = serve(&[b"x"]);
    bench.server.publish(Arc::new(table(1, &[b"x"])));
    let client = Client::connect(bench.socket.clone(), "a");
    assert_eq!(next_revision(&client).table.number, 1);
    drop(bench.server);
    let gone = client.events().recv_timeout(LIMIT).unwrap();
    assert!(matches!(gone, ClientEvent::Disconnected { .. }), "{gone:?}");
    let server =
        Server::bind(&bench.socket, "test", Box::new(|_| Some(Arc::from(*b"x"))), Box::new(drop)).unwrap();
    server.publish(Arc::new(table(5, &[b"x"])));
    loop {
        match client.events().recv_timeout(LIMIT).unwrap() {
            ClientEvent::Revision(revision) => break assert_eq!(revision.table.number, 5),
            ClientEvent::Connected { .. }
            | ClientEvent::Disconnected { .. }
            | ClientEvent::Progress { .. }
            | ClientEvent::Answer(_) => {}
        }
    }
}

#[test]
fn frame_reports_reach_the_daemon() {
    let bench = serve(&[]);
    bench.server.publish(Arc::new(table(1, &[])));
    let client = Client::connect(bench.socket.clone(), "viewer");
    next_revision(&client);
    let report = FrameReport { revision: 1, received_unix_ms: 1.0, ready_unix_ms: 2.0, drawn_unix_ms: 3.5 };
    client.report_frame(report.clone());
    let connected = bench.events.recv_timeout(LIMIT).unwrap();
    assert_eq!(connected, ServerEvent::Connected { client: 1, name: "viewer".into() });
    assert_eq!(bench.events.recv_timeout(LIMIT).unwrap(), ServerEvent::Frame { client: 1, report });
}

#[test]
fn stuck_client_does_not_hold_up_the_others() {
    let big = vec![1; 8 << 20];
    let bench = serve(&[&big]);
    let mut stuck = UnixStream::connect(&bench.socket).unwrap();
    let hello = ClientMessage::Hello(Hello::new("stuck", &[capability::REVISIONS]));
    stuck.write_all(&hello.encode()).unwrap();
    bench.server.publish(Arc::new(table(0, &[&big])));
    stuck.write_all(&ClientMessage::Fetch(vec![Digest::of(&big)]).encode()).unwrap();
    assert!(matches!(bench.events.recv_timeout(LIMIT).unwrap(), ServerEvent::Connected { .. }));
    let client = Client::connect(bench.socket.clone(), "quick");
    for number in 1..=50 {
        bench.server.publish(Arc::new(table(number, &[&big])));
    }
    while next_revision(&client).table.number < 50 {}
}

#[test]
fn peer_of_another_version_is_told_so() {
    let bench = serve(&[]);
    let mut stream = UnixStream::connect(&bench.socket).unwrap();
    let hello = ClientMessage::Hello(Hello { protocol: PROTOCOL_VERSION + 1, ..Hello::new("new", &[]) });
    stream.write_all(&hello.encode()).unwrap();
    let mut answer = Vec::new();
    stream.set_read_timeout(Some(LIMIT)).unwrap();
    stream.read_to_end(&mut answer).unwrap();
    let mut decoder = Decoder::default();
    decoder.push(&answer);
    let message = decoder.next_message::<ServerMessage>().unwrap().unwrap();
    assert!(ClientSession::default().receive(message).is_ok());
    let gone = bench.events.recv_timeout(LIMIT).unwrap();
    assert!(matches!(&gone, ServerEvent::Gone { reason, .. } if reason.contains("protocol")), "{gone:?}");
    let other = ServerMessage::Hello(Hello { protocol: PROTOCOL_VERSION + 1, ..Hello::new("p", &[]) });
    assert!(ClientSession::default().receive(other).is_err_and(|reason| reason.contains("update")));
}

#[test]
fn messages_survive_being_cut_anywhere() {
    let messages = [
        ServerMessage::Hello(Hello::new("p", &["x"])),
        ServerMessage::Revision(table(3, &[b"a", b"b"])),
        ServerMessage::Chunk { digest: Digest::of(b"a"), offset: 0, total: 1, bytes: b"a".to_vec() },
        ServerMessage::Missing(Digest::of(b"z")),
        ServerMessage::Progress(ProgressReport { done: 1, total: 2, current: "x".into() }),
    ];
    let bytes: Vec<u8> = messages.iter().flat_map(Message::encode).collect();
    for step in [1, 3, 7, 64, bytes.len()] {
        let mut decoder = Decoder::default();
        let mut got = Vec::new();
        for piece in bytes.chunks(step) {
            decoder.push(piece);
            while let Some(message) = decoder.next_message::<ServerMessage>().unwrap() {
                got.push(message);
            }
        }
        assert_eq!(got, messages, "step {step}");
    }
}

#[test]
fn hostile_frames_are_refused() {
    let too_long = u32::try_from(SERVER_FRAME_BYTES_MAX + 1).unwrap().to_le_bytes();
    let cases: [&[u8]; 5] = [
        &too_long,
        &[0, 0, 0, 0],
        &[1, 0, 0, 0, 200],
        &[3, 0, 0, 0, 67, 1, 2],
        &[3, 0, 0, 0, 66, b'{', b'}'],
    ];
    for case in cases {
        let mut decoder = Decoder::default();
        decoder.push(case);
        assert!(decoder.next_message::<ServerMessage>().is_err(), "{case:?}");
        assert!(decoder.next_message::<ClientMessage>().is_err(), "{case:?}");
    }
}

fn greeted() -> ClientSession {
    let mut session = ClientSession::default();
    session.receive(ServerMessage::Hello(Hello::new("p", &[]))).unwrap();
    session
}

fn chunk(name: &[u8], bytes: &[u8]) -> ServerMessage {
    ServerMessage::Chunk {
        digest: Digest::of(name),
        offset: 0,
        total: bytes.len() as u64,
        bytes: bytes.to_vec(),
    }
}

#[test]
fn revision_is_delivered_only_when_whole() {
    let mut session = greeted();
    let reaction = session.receive(ServerMessage::Revision(table(1, &[b"a", b"b"]))).unwrap();
    assert!(reaction.events.is_empty());
    assert_eq!(reaction.send, [ClientMessage::Fetch(vec![Digest::of(b"a"), Digest::of(b"b")])]);
    assert!(session.receive(chunk(b"a", b"a")).unwrap().events.is_empty());
    let events = session.receive(chunk(b"b", b"b")).unwrap().events;
    assert!(matches!(&events[..], [ClientEvent::Revision(revision)] if revision.table.number == 1));
}

#[test]
fn newer_revision_replaces_one_that_is_not_whole_and_known_contents_are_not_fetched_again() {
    let mut session = greeted();
    session.receive(ServerMessage::Revision(table(1, &[b"a", b"b"]))).unwrap();
    session.receive(chunk(b"a", b"a")).unwrap();
    let reaction = session.receive(ServerMessage::Revision(table(2, &[b"a"]))).unwrap();
    assert!(reaction.send.is_empty());
    assert!(matches!(&reaction.events[..], [ClientEvent::Revision(revision)] if revision.table.number == 2));
}

#[test]
fn daemon_that_lies_about_contents_is_left() {
    let mut session = greeted();
    session.receive(ServerMessage::Revision(table(1, &[b"a"]))).unwrap();
    assert!(session.receive(chunk(b"a", b"z")).is_err_and(|reason| reason.contains("other bytes")));
    assert!(greeted().receive(chunk(b"a", b"a")).is_err_and(|reason| reason.contains("without being asked")));
    assert!(
        ClientSession::default().receive(chunk(b"a", b"a")).is_err_and(|reason| reason.contains("greeting"))
    );
}

#[test]
fn second_lock_names_the_holder() {
    let folder = tempfile::tempdir().unwrap();
    let socket = folder.path().join("p.sock");
    let held = ProjectLock::take(&socket).unwrap();
    let error = ProjectLock::take(&socket).unwrap_err();
    assert!(error.to_string().contains(&std::process::id().to_string()), "{error}");
    drop(held);
    ProjectLock::take(&socket).unwrap();
}

#[test]
fn shader_asked_for_in_the_middle_of_a_cube_comes_within_a_few_chunks() {
    let (cube, shader) = (vec![1; 60_000_000], b"fn main() {}");
    let bench = serve(&[&cube, shader]);
    let mut revision = table(1, &[&cube]);
    let compiled = Target { kind: "shader".into(), ..table(1, &[shader]).targets["env/a/specular"].clone() };
    revision.targets.insert("shader/pbr/base".to_owned(), compiled);
    bench.server.publish(Arc::new(revision));
    let mut stream = UnixStream::connect(&bench.socket).unwrap();
    stream.set_read_timeout(Some(LIMIT)).unwrap();
    let hello = ClientMessage::Hello(Hello::new("raw", &[capability::REVISIONS]));
    stream.write_all(&hello.encode()).unwrap();
    let (mut decoder, mut buffer) = (Decoder::default(), vec![0; 64 << 10]);
    let mut next = |stream: &mut UnixStream| loop {
        if let Some(message) = decoder.next_message::<ServerMessage>().unwrap() {
            return message;
        }
        let count = stream.read(&mut buffer).unwrap();
        assert!(count > 0, "the server hung up");
        decoder.push(&buffer[..count]);
    };
    while !matches!(next(&mut stream), ServerMessage::Revision(_)) {}
    stream.write_all(&ClientMessage::Fetch(vec![Digest::of(&cube)]).encode()).unwrap();
    while !matches!(next(&mut stream), ServerMessage::Chunk { .. }) {}
    stream.write_all(&ClientMessage::Fetch(vec![Digest::of(shader)]).encode()).unwrap();
    let mut overtaken_bytes = 0;
    loop {
        match next(&mut stream) {
            ServerMessage::Chunk { digest, .. } if digest == Digest::of(shader) => break,
            ServerMessage::Chunk { bytes, .. } => overtaken_bytes += bytes.len(),
            _ => {}
        }
    }
    // What was in the socket already, and a thread that the system lets wait while this one reads on.
    assert!(overtaken_bytes < 16 << 20, "{overtaken_bytes} bytes of the cube came first");
}
