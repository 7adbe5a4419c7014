//! `docs/protocol.md` is enough to write a client: `tests/client.py` was, with the standard library alone.

use std::process::Command;
use std::sync::Arc;

use serde_json::Value;

use super::{serve, table};

#[test]
fn client_written_from_the_document_gets_everything() {
    let big: Vec<u8> = (0..1_000_000_u32).map(|index| (index % 251) as u8).collect();
    let contents: [&[u8]; 3] = [b"small", &big, b""];
    let bench = serve(&contents);
    bench.server.publish(Arc::new(table(3, &contents)));
    let out = tempfile::tempdir().unwrap();
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/client.py");
    let run = Command::new("python3").arg(script).arg(&bench.socket).arg(out.path()).output();
    let run = match run {
        Ok(run) => run,
        Err(error) => {
            return eprintln!("SKIPPED: client_written_from_the_document_gets_everything: python3: {error}");
        }
    };
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let said: Value = serde_json::from_slice(&run.stdout).unwrap();
    assert_eq!(said["revision"], 3);
    assert_eq!(said["status"]["clients"][0]["name"], "python");
    assert_eq!(said["status"]["clients"][0]["wants"][0], "env/a");
    for (index, content) in contents.iter().enumerate() {
        let written = std::fs::read(out.path().join(format!("env/a/specular/mip{index}"))).unwrap();
        assert!(written == *content, "part {index} came with other bytes");
    }
}
