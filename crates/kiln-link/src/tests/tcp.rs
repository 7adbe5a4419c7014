//! TCP on this machine: who shows the token is served as at the socket, and nobody else hears anything.

use std::io::{Read as _, Write as _};
use std::net::{SocketAddr, TcpStream};
use std::os::unix::fs::PermissionsExt as _;
use std::path::PathBuf;
use std::sync::Arc;

use super::{Bench, LIMIT, next_revision, serve, table};
use crate::wire::Message as _;
use crate::*;

const CONTENT: &[u8] = b"texels";

fn listening() -> (Bench, SocketAddr, PathBuf) {
    let mut bench = serve(&[CONTENT]);
    let (address, file) = bench.server.listen("127.0.0.1:0".parse().unwrap()).unwrap();
    bench.server.publish(Arc::new(table(1, &[CONTENT])));
    (bench, address, file)
}

/// What the daemon says to this greeting before it hangs up, or waits for more.
fn answer_to(address: SocketAddr, hello: &Hello) -> Vec<u8> {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(LIMIT)).unwrap();
    stream.write_all(&ClientMessage::Hello(hello.clone()).encode()).unwrap();
    let mut heard = vec![0; 4096];
    // Closed while something of ours is unread, it may end with a reset.
    let count = stream.read(&mut heard).unwrap_or(0);
    heard.truncate(count);
    heard
}

fn disconnected(client: &Client) -> String {
    loop {
        match client.events().recv_timeout(LIMIT).expect("it is refused in time") {
            ClientEvent::Disconnected { reason } => return reason,
            ClientEvent::Revision(_) | ClientEvent::Connected { .. } => panic!("it is served"),
            ClientEvent::Progress { .. } | ClientEvent::Answer(_) => {}
        }
    }
}

#[test]
fn client_with_the_token_gets_everything_by_tcp() {
    let (bench, address, file) = listening();
    let token = Token::read(&file).unwrap();
    let client = Client::connect(Endpoint::Tcp { address, token }, "far");
    let revision = next_revision(&client);
    assert_eq!(&**revision.part("env/a/specular", "mip0").unwrap(), CONTENT);
    client.want(vec!["env/a".into()]);
    while bench.server.wanted().targets != ["env/a"] {
        bench.events.recv_timeout(LIMIT).expect("what it wants is heard");
    }
    // The token is the user's alone, and of no use when the daemon is gone.
    assert_eq!(std::fs::metadata(&file).unwrap().permissions().mode() & 0o777, 0o600);
    drop(bench);
    assert!(!file.exists());
}

#[test]
fn without_the_token_nobody_hears_even_the_projects_name() {
    let (bench, address, file) = listening();
    let hello = Hello::new("stranger", &[capability::REVISIONS]);
    assert!(answer_to(address, &hello).is_empty(), "no token");
    let wrong = Some(Token::of_text(&"0".repeat(64)));
    assert!(answer_to(address, &Hello { token: wrong, ..hello.clone() }).is_empty(), "another token");
    let part = serde_json::to_value(Token::read(&file).unwrap()).unwrap();
    let part = Token::of_text(&part.as_str().unwrap()[..63]);
    assert!(answer_to(address, &Hello { token: Some(part), ..hello.clone() }).is_empty(), "a part of it");
    let right = Some(Token::read(&file).unwrap());
    assert!(!answer_to(address, &Hello { token: right, ..hello }).is_empty(), "the twin: the token");
    let client = Client::connect(Endpoint::Tcp { address, token: Token::of_text(&"0".repeat(64)) }, "far");
    let reason = disconnected(&client);
    assert!(reason.contains("is the token that of this daemon?"), "{reason}");
    drop(bench);
}

#[test]
fn addresses_that_other_machines_reach_are_refused() {
    let mut bench = serve(&[]);
    for address in ["0.0.0.0:0", "192.0.2.1:0", "[::]:0"] {
        let error = bench.server.listen(address.parse().unwrap()).unwrap_err();
        assert!(error.to_string().contains("can be reached from other machines"), "{address}: {error}");
    }
    assert!(bench.server.listen("127.0.0.1:0".parse().unwrap()).is_ok(), "the twin");
}

#[test]
fn peer_of_another_version_is_told_so_by_tcp_too() {
    let (_bench, address, file) = listening();
    let token = Some(Token::read(&file).unwrap());
    let hello = Hello { protocol: PROTOCOL_VERSION + 1, token, ..Hello::new("newer", &[]) };
    let mut decoder = Decoder::default();
    decoder.push(&answer_to(address, &hello));
    let Some(ServerMessage::Hello(theirs)) = decoder.next_message().unwrap() else { panic!("no greeting") };
    assert_eq!(theirs.protocol, PROTOCOL_VERSION);
}

#[test]
fn token_file_that_others_can_read_or_of_other_content_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("token");
    let write = |text: &str, mode| {
        std::fs::write(&path, text).unwrap();
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(mode)).unwrap();
        Token::read(&path).map_err(|error| error.to_string())
    };
    let text = "0123456789abcdef".repeat(4);
    assert!(write(&text, 0o600).is_ok());
    assert!(write(&text, 0o644).unwrap_err().contains("chmod 600"));
    assert!(write("none", 0o600).unwrap_err().contains("64 hexadecimal digits"));
    assert!(!Token::of_text(&text).is(&Token::of_text(&text[1..])));
}

#[test]
fn who_does_not_greet_cannot_fill_the_daemons_memory() {
    let (_bench, address, _) = listening();
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(LIMIT)).unwrap();
    // The length of a frame that a client may send, and what never becomes one.
    let mut sent = stream.write_all(&(8_u32 << 20).to_le_bytes());
    for _ in 0..64 {
        sent = sent.and_then(|()| stream.write_all(&[1; 64 << 10]));
    }
    assert!(sent.is_err() || stream.read(&mut [0; 1]).unwrap_or(0) == 0, "it goes on listening");
}
