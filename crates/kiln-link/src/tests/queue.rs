//! The order of contents.

use std::collections::BTreeMap;
use std::sync::Arc;

use kiln_build::Digest;
use serde_json::json;

use crate::queue::{SendQueue, Step};
use crate::wire::{CHUNK_BYTES, Message as _};
use crate::{ClientMessage, Decoder, Part, Quality, RevisionTable, Target, TargetState, Wants};

fn target(kind: &str, contents: &[Vec<u8>]) -> Target {
    let part =
        |bytes: &Vec<u8>| Part { name: "p".into(), digest: Digest::of(bytes), bytes: bytes.len() as u64 };
    Target {
        kind: kind.into(),
        state: TargetState::Fresh,
        meta: json!({}),
        parts: contents.iter().map(part).collect(),
    }
}

/// Contents of these lengths, all different.
fn content(length: usize, seed: u8) -> Vec<u8> {
    vec![seed; length]
}

struct Bench {
    queue: SendQueue,
    contents: Vec<Arc<[u8]>>,
    digests: Vec<Digest>,
}

impl Bench {
    fn new(targets: &[(&str, &str, Vec<u8>)]) -> Bench {
        let contents: Vec<Arc<[u8]>> = targets.iter().map(|(_, _, bytes)| bytes.as_slice().into()).collect();
        let digests = contents.iter().map(|bytes| Digest::of(bytes)).collect();
        let mut bench = Bench { queue: SendQueue::default(), contents, digests };
        bench.tell(targets);
        bench
    }

    fn tell(&mut self, targets: &[(&str, &str, Vec<u8>)]) {
        let target = |(name, kind, bytes): &(&str, &str, Vec<u8>)| {
            ((*name).to_owned(), target(kind, std::slice::from_ref(bytes)))
        };
        let targets: BTreeMap<String, Target> = targets.iter().map(target).collect();
        self.queue.tell(Arc::new(RevisionTable { targets, ..RevisionTable::default() }));
    }

    fn fetch(&mut self, indices: &[usize]) {
        self.queue.fetch(indices.iter().map(|&index| self.digests[index]));
    }

    /// The index of the content that the next piece belongs to; `None` if nothing waits.
    fn write_piece(&mut self) -> Option<usize> {
        let index = |digest| self.digests.iter().position(|known| *known == digest).unwrap();
        match self.queue.next()? {
            Step::Read(digest) => {
                self.queue.begin(digest, self.contents[index(digest)].clone());
                self.write_piece()
            }
            Step::Chunk { digest, offset, end, .. } => {
                assert!(end - offset <= CHUNK_BYTES);
                let index = index(digest);
                self.queue.written(digest, end);
                Some(index)
            }
            Step::Missing(_) => panic!("something is missing"),
        }
    }

    fn order(&mut self) -> Vec<usize> {
        let mut order: Vec<usize> = std::iter::from_fn(|| self.write_piece()).collect();
        order.dedup();
        order
    }
}

#[test]
fn shader_overtakes_a_cube_of_60_mb_after_one_chunk() {
    let mut bench = Bench::new(&[
        ("env/a/specular", "cube", content(60_000_000, 1)),
        ("shader/pbr/base", "shader", content(2000, 2)),
    ]);
    bench.fetch(&[0]);
    assert_eq!([bench.write_piece(), bench.write_piece()], [Some(0), Some(0)]);
    bench.fetch(&[1]);
    assert_eq!(bench.write_piece(), Some(1));
    let mut pieces = 2;
    while let Some(index) = bench.write_piece() {
        assert_eq!(index, 0);
        pieces += 1;
    }
    assert_eq!(pieces, 60_000_000_usize.div_ceil(CHUNK_BYTES), "it goes on where it stepped back");
}

#[test]
fn shaders_come_first_then_what_is_shown_then_coarse_levels() {
    let mut bench = Bench::new(&[
        ("env/a/specular", "cube", content(100, 1)),
        ("env/b/specular", "cube", content(400, 2)),
        ("env/b/irradiance", "cube", content(300, 3)),
        ("shader/pbr/base", "shader", content(9000, 4)),
    ]);
    bench.queue.set_wants(Wants { targets: vec!["env/b".into()], ..Wants::default() });
    bench.fetch(&[0, 1, 2, 3]);
    assert_eq!(bench.order(), [3, 2, 1, 0]);
}

#[test]
fn new_wants_reorder_what_waits() {
    let mut bench =
        Bench::new(&[("env/a/sky", "cube", content(100, 1)), ("env/b/sky", "cube", content(400, 2))]);
    bench.fetch(&[0, 1]);
    bench.queue.set_wants(Wants { targets: vec!["env/b".into()], ..Wants::default() });
    assert_eq!(bench.order(), [1, 0]);
}

#[test]
fn group_of_wanted_targets_ends_at_a_slash() {
    let wants = Wants { targets: vec!["env/sky".into()], ..Wants::default() };
    assert!(wants.include("env/sky") && wants.include("env/sky/specular"));
    assert!(!wants.include("env/skyline/specular") && !wants.include("env"));
}

#[test]
fn content_that_the_newest_table_does_without_is_called_missing() {
    let big = content(3 * CHUNK_BYTES, 1);
    let mut bench = Bench::new(&[("env/a/sky", "cube", big.clone())]);
    bench.fetch(&[0]);
    assert_eq!(bench.write_piece(), Some(0));
    bench.tell(&[("env/a/sky", "cube", content(10, 2))]);
    assert_eq!(bench.queue.next(), Some(Step::Missing(Digest::of(&big))));
    bench.queue.forget(&Digest::of(&big));
    assert_eq!(bench.queue.next(), None);
}

#[test]
fn content_that_no_table_named_is_not_read() {
    let mut queue = SendQueue::default();
    let secret = Digest::of(b"of another project");
    queue.fetch([secret]);
    assert_eq!(queue.next(), Some(Step::Missing(secret)));
}

#[test]
fn few_contents_are_held_in_memory_however_often_a_more_urgent_one_comes() {
    let sizes: Vec<usize> = (0..8).map(|step| (9 - step) * 2 * CHUNK_BYTES).collect();
    let names: Vec<String> = (0..8).map(|index| format!("env/{index}/sky")).collect();
    let targets: Vec<(&str, &str, Vec<u8>)> = (0..8_u8)
        .map(|index| {
            let at = usize::from(index);
            (names[at].as_str(), "cube", content(sizes[at], index))
        })
        .collect();
    let mut bench = Bench::new(&targets);
    let mut touched = Vec::new();
    for index in 0..8 {
        bench.fetch(&[index]);
        touched.push(bench.write_piece().unwrap());
    }
    assert_eq!(touched[..4], [0, 1, 2, 3], "each was more urgent than the one before");
    assert!(touched[4..].iter().all(|index| *index == 3), "no fifth was begun: {touched:?}");
}

#[test]
fn content_that_a_newer_table_names_again_is_not_said_to_be_missing() {
    let table = |number, bytes: &[u8]| {
        let targets = BTreeMap::from([("env/a".to_owned(), target("cube", &[bytes.to_vec()]))]);
        Arc::new(RevisionTable { number, targets, ..RevisionTable::default() })
    };
    let mut queue = SendQueue::default();
    queue.tell(table(1, b"other"));
    queue.fetch([Digest::of(b"back")]);
    assert_eq!(queue.next(), Some(Step::Missing(Digest::of(b"back"))), "this table does without it");
    queue.tell(table(2, b"back"));
    assert_eq!(queue.next(), Some(Step::Read(Digest::of(b"back"))));
}

#[test]
fn most_demanding_client_decides_how_good_a_target_must_be() {
    let wants = |pairs: &[(&str, Quality)]| Wants {
        targets: pairs.iter().map(|(name, _)| (*name).to_owned()).collect(),
        qualities: pairs.iter().map(|(name, quality)| ((*name).to_owned(), *quality)).collect(),
    };
    let one = wants(&[("env/sky", Quality::Draft), ("env/dusk", Quality::Preview)]);
    let other = wants(&[("env/sky", Quality::Preview), ("env/dusk", Quality::Final)]);
    let both = Wants::together([&one, &other]);
    assert_eq!(both.quality_of("env/sky/specular"), Some(Quality::Preview));
    assert_eq!(both.quality_of("env/dusk"), Some(Quality::Final));
    assert_eq!(both.quality_of("env/skyline"), None);
    assert!(!both.qualities.contains_key("env/dusk"), "what is final goes without saying");
    let unknown: Wants = serde_json::from_str(r#"{"targets":["a"],"qualities":{"a":"perfect"}}"#).unwrap();
    assert_eq!(unknown.quality_of("a"), Some(Quality::Final));
    let stray = ClientMessage::Wants(Wants { targets: Vec::new(), ..one }).encode();
    let mut decoder = Decoder::default();
    decoder.push(&stray);
    assert!(decoder.next_message::<ClientMessage>().is_err(), "a quality of what is not wanted");
}
