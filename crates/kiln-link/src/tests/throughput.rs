//! How fast contents cross the socket, beside a plain copy over a socket and SHA-256 alone. `cargo xtask bench wire` prints it.

use std::io::{Read as _, Write as _};
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::time::Instant;

use kiln_build::Digest;

use super::{next_revision, serve, table};
use crate::Client;

const MIB: usize = 1 << 20;

/// MiB of a revision: `KILN_WIRE_MIB`, else a few.
fn revision_mib() -> usize {
    std::env::var("KILN_WIRE_MIB").ok().and_then(|text| text.parse().ok()).unwrap_or(8)
}

/// Runs, of which the best counts: the machine may be busy.
fn runs() -> usize {
    if std::env::var_os("KILN_WIRE_MIB").is_some() { 12 } else { 3 }
}

fn best(mut run: impl FnMut() -> f64) -> f64 {
    (0..runs()).map(|_| run()).fold(f64::INFINITY, f64::min)
}

/// Seconds that the bytes take through a pair of sockets into memory that is there, in writes of a chunk.
fn plain_copy(bytes: &[u8]) -> f64 {
    let (mut out, mut into) = UnixStream::pair().unwrap();
    let mut room = vec![0; bytes.len()];
    let begun = Instant::now();
    std::thread::scope(|scope| {
        scope.spawn(move || {
            bytes.chunks(crate::wire::CHUNK_BYTES).for_each(|chunk| out.write_all(chunk).unwrap());
        });
        into.read_exact(&mut room).unwrap();
    });
    begun.elapsed().as_secs_f64()
}

/// A revision of `count` contents, from its publication until a client has it whole, every digest checked.
fn revision(contents: &[&[u8]]) -> f64 {
    let bench = serve(contents);
    bench.server.publish(Arc::new(table(1, &[])));
    let client = Client::connect(bench.socket.clone(), "measures");
    next_revision(&client);
    let table = Arc::new(table(2, contents));
    let begun = Instant::now();
    bench.server.publish(table);
    assert_eq!(next_revision(&client).table.number, 2);
    begun.elapsed().as_secs_f64()
}

#[test]
fn revision_crosses_the_socket_about_as_fast_as_it_can_be_hashed() {
    let mib = revision_mib();
    // Nothing repeats, so that no two contents are one.
    let mut state = 1_u64;
    let mut word = || {
        state = state.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(0x1405_7b7e_f767_814f);
        state.to_le_bytes()
    };
    let bytes: Vec<u8> = (0..mib * MIB / 8).flat_map(|_| word()).collect();
    let gb_per_s = |seconds: f64| bytes.len() as f64 / seconds / 1e9;
    let socket = best(|| plain_copy(&bytes));
    let hash = best(|| {
        let begun = Instant::now();
        std::hint::black_box(Digest::of(&bytes));
        begun.elapsed().as_secs_f64()
    });
    let whole = best(|| revision(&[&bytes]));
    let parts: Vec<&[u8]> = bytes.chunks(bytes.len() / 8).collect();
    let digests: std::collections::BTreeSet<Digest> = parts.iter().map(|part| Digest::of(part)).collect();
    assert_eq!(digests.len(), parts.len());
    let in_parts = best(|| revision(&parts));
    eprintln!(
        "{mib} MiB, best of {}: one content {:.2} GB/s, eight contents {:.2} GB/s; a plain copy over a socket {:.2} GB/s, SHA-256 alone {:.2} GB/s",
        runs(),
        gb_per_s(whole),
        gb_per_s(in_parts),
        gb_per_s(socket),
        gb_per_s(hash)
    );
    // On two idle cores it is as fast as the slower of both; on a busy machine they take turns, and everything else does too.
    assert!(whole < 6.0 * (socket + hash), "{whole} s against {socket} s and {hash} s");
}
