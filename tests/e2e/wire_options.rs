//! `kiln watch --listen` and `--log`.

use std::process::Stdio;

use kiln_link::{Client, ClientEvent, Endpoint, Token};
use serde_json::Value;

use crate::harness::{LIMIT, Project, text};

#[test]
fn what_the_command_line_may_not_ask_for_is_named() {
    let project = Project::sample();
    for (arguments, named) in [
        (["--listen", "0.0.0.0:0"], "can be reached from other machines"),
        (["--listen", "here"], "no address with a port"),
        (["--log", "loud"], "`loud` is no level"),
        (["--log", "sea=info"], "watch, build, wire, request"),
    ] {
        let output = project.run(&["watch", "DIR", arguments[0], arguments[1]]);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}");
        assert!(text(&output.stderr).contains(named), "{}", text(&output.stderr));
    }
    let output = project.command(&["watch", "DIR"]).env("KILN_LOG", "loud").output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("KILN_LOG: `loud` is no level"), "{}", text(&output.stderr));
}

#[test]
fn client_by_tcp_is_served_and_the_log_stands_beside_clean_lines() {
    let project = Project::sample();
    let mut command = project.command(&["watch", "DIR", "--json", "--listen", "127.0.0.1:0"]);
    command.args(["--log", "info,wire=debug"]).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut stdout = std::io::BufReader::new(child.stdout.take().unwrap());
    let mut line = String::new();
    std::io::BufRead::read_line(&mut stdout, &mut line).unwrap();
    let listening: Value = serde_json::from_str(&line).unwrap();
    let address = listening["address"].as_str().unwrap().parse().unwrap();
    let token_file = listening["token_file"].as_str().unwrap();
    let token = Token::read(token_file.as_ref()).unwrap();
    let client = Client::connect(Endpoint::Tcp { address, token }, "far viewer");
    loop {
        match client.events().recv_timeout(LIMIT).expect("a revision in time") {
            ClientEvent::Revision(revision) => break assert!(revision.table.targets.contains_key("project")),
            ClientEvent::Disconnected { reason } => panic!("{reason}"),
            _ => {}
        }
    }
    drop(client);
    assert_eq!(project.run(&["stop", "DIR"]).status.code(), Some(0));
    let mut rest = String::new();
    std::io::Read::read_to_string(&mut stdout, &mut rest).unwrap();
    assert!(rest.lines().all(|line| serde_json::from_str::<Value>(line).is_ok()), "{rest}");
    let output = child.wait_with_output().unwrap();
    let log = text(&output.stderr);
    assert!(log.contains("far viewer") && log.contains("DEBUG wire") && log.contains("INFO build"), "{log}");
    assert!(!log.contains("DEBUG build"), "{log}");
}
