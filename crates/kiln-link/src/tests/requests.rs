//! Requests and their answers, over real sockets.

use std::io::{Read as _, Write as _};
use std::os::unix::net::{UnixListener, UnixStream};

use kiln_diagnostic::Diagnostic;

use super::{Bench, LIMIT, serve};
use crate::request::{PARAMETERS_MAX, PATHS_MAX, REQUESTS_MAX};
use crate::wire::Message as _;
use crate::*;

fn write(value: f64) -> Ask {
    let (shader, name) = ("pbr".to_owned(), "wetness".to_owned());
    Ask::WriteParameters { parameters: vec![ParameterWrite { shader, name, value: vec![value] }] }
}

fn answer(client: &Client) -> Answer {
    loop {
        match client.events().recv_timeout(LIMIT).expect("an answer in time") {
            ClientEvent::Answer(answer) => return answer,
            ClientEvent::Connected { .. }
            | ClientEvent::Disconnected { .. }
            | ClientEvent::Progress { .. }
            | ClientEvent::Revision(_) => {}
        }
    }
}

fn connected(socket: &std::path::Path) -> Client {
    let client = Client::connect(socket.to_owned(), "asks");
    let first = client.events().recv_timeout(LIMIT).expect("an event in time");
    assert!(matches!(first, ClientEvent::Connected { .. }), "{first:?}");
    client
}

fn next_request(bench: &Bench) -> (u64, Request) {
    loop {
        if let ServerEvent::Asked { client, request } = bench.events.recv_timeout(LIMIT).unwrap() {
            return (client, request);
        }
    }
}

#[test]
fn requests_reach_the_daemon_and_answers_their_own_request() {
    let bench = serve(&[]);
    let client = connected(&bench.socket);
    let ids = [write(0.25), write(0.5)].map(|ask| client.request(ask).unwrap());
    let asked = [next_request(&bench), next_request(&bench)];
    assert_eq!((asked[0].1.id, &asked[0].1.ask), (ids[0], &write(0.25)));
    for (number, (who, request)) in asked.iter().rev().enumerate() {
        let message = format!("done {number}");
        bench.server.answer(*who, Answer { id: request.id, message, ..Answer::default() });
    }
    let answers = [answer(&client), answer(&client)];
    assert_eq!(answers.clone().map(|answer| answer.id), [ids[1], ids[0]]);
    assert!(answers.iter().all(Answer::is_done));
}

#[test]
fn one_question_gets_its_answer_and_hangs_up() {
    let bench = serve(&[]);
    let socket = bench.socket.clone();
    let asking =
        std::thread::spawn(move || ask(&socket, Ask::AddFiles { paths: vec!["/a.hdr".into()] }, LIMIT));
    let (client, request) = next_request(&bench);
    assert_eq!(request.ask, Ask::AddFiles { paths: vec!["/a.hdr".into()] });
    bench.server.answer(client, Answer::refused(request.id, Diagnostic::error("no")));
    let answer = asking.join().unwrap().unwrap();
    assert!(!answer.is_done());
    assert_eq!(answer.diagnostics[0].message, "no");
}

#[test]
fn request_that_is_open_when_the_daemon_goes_is_answered_by_that() {
    let bench = serve(&[]);
    let client = connected(&bench.socket);
    let id = client.request(write(0.5)).unwrap();
    next_request(&bench);
    drop(bench.server);
    let answer = answer(&client);
    assert_eq!((answer.id, answer.is_done()), (id, false));
    assert!(answer.diagnostics[0].message.contains("ended before the daemon answered"));
}

#[test]
fn without_a_daemon_that_takes_requests_none_is_sent() {
    let folder = tempfile::tempdir().unwrap();
    let socket = folder.path().join("old.sock");
    let client = Client::connect(socket.clone(), "asks");
    let error = client.request(write(0.5)).unwrap_err();
    assert_eq!(error.message, "there is no daemon to do this");
    let listener = UnixListener::bind(&socket).unwrap();
    let (mut stream, _) = listener.accept().unwrap();
    let hello = ServerMessage::Hello(Hello::new("old", &[capability::REVISIONS]));
    stream.write_all(&hello.encode()).unwrap();
    while !matches!(client.events().recv_timeout(LIMIT).unwrap(), ClientEvent::Connected { .. }) {}
    let error = client.request(write(0.5)).unwrap_err();
    assert_eq!(error.message, "this daemon is older and takes no requests");
    let asking = std::thread::spawn(move || ask(&socket, write(0.5), LIMIT));
    let (mut stream, _) = listener.accept().unwrap();
    stream.write_all(&hello.encode()).unwrap();
    assert!(matches!(asking.join().unwrap(), Err(ControlError::NoRequests)));
}

#[test]
fn more_open_requests_than_allowed_are_refused_here_and_end_the_connection_there() {
    let bench = serve(&[]);
    let client = connected(&bench.socket);
    for _ in 0..REQUESTS_MAX {
        client.request(write(0.5)).unwrap();
    }
    assert!(client.request(write(0.5)).unwrap_err().message.contains("wait for their answer"));
    let mut flood = UnixStream::connect(&bench.socket).unwrap();
    let mut bytes = ClientMessage::Hello(Hello::new("flood", &[])).encode();
    for id in 0..=REQUESTS_MAX as u64 {
        bytes.extend(ClientMessage::Request(Request { id, ask: write(0.5) }).encode());
    }
    flood.write_all(&bytes).unwrap();
    flood.set_read_timeout(Some(LIMIT)).unwrap();
    let mut heard = Vec::new();
    flood.read_to_end(&mut heard).unwrap();
    assert!(status(&bench.socket, LIMIT).is_ok(), "the others go on");
}

#[test]
fn request_over_a_limit_is_refused_and_an_unknown_one_is_heard() {
    let frame = |ask| ClientMessage::Request(Request { id: 1, ask }).encode();
    let decode = |bytes: &[u8]| ClientMessage::decode(bytes[4], &bytes[5..]);
    let parameter = |value: Vec<f64>| ParameterWrite { shader: "s".into(), name: "n".into(), value };
    let long = ParameterWrite { name: "n".repeat(257), ..parameter(vec![]) };
    for ask in [
        Ask::AddFiles { paths: vec!["/a".into(); PATHS_MAX + 1] },
        Ask::AddFiles { paths: vec!["/a".repeat(3000)] },
        Ask::WriteParameters { parameters: vec![parameter(vec![1.0]); PARAMETERS_MAX + 1] },
        Ask::WriteParameters { parameters: vec![parameter(vec![1.0; 5])] },
        Ask::WriteParameters { parameters: vec![long] },
    ] {
        assert!(decode(&frame(ask)).is_err());
    }
    assert!(decode(&frame(Ask::AddFiles { paths: vec!["/a".into(); PATHS_MAX] })).is_ok());
    let unknown = ClientMessage::decode(9, br#"{"id":3,"ask":"polish","how":"well"}"#).unwrap();
    assert_eq!(unknown, ClientMessage::Request(Request { id: 3, ask: Ask::Unknown }));
    assert!(ClientMessage::decode(9, br#"{"id":3,"ask":"write_parameters"}"#).is_err());
}
