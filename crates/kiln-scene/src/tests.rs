//! Tests of the whole way: bytes in, scene and pack out.

mod animation;
mod build;
mod built_in;
mod conform;
mod corpus;
mod deforming;
mod effects;
mod geometry;
mod hostile;
mod lights;
mod motion;
mod packing;
mod playing;
mod second_reader;
mod specular_glossiness;
mod uris;
mod variants;

use std::sync::Arc;

use crate::{Packed, Scene, load, pack};

/// Packs a file that stands alone.
fn pack_alone(bytes: &[u8]) -> Packed {
    pack("scenes/test.gltf", bytes, &mut |_| None)
}

/// Packs and loads a file that stands alone; fails with its diagnostics.
#[track_caller]
fn scene_of(bytes: &[u8]) -> Scene {
    let packed = pack_alone(bytes);
    let messages: Vec<String> = packed.diagnostics.iter().map(ToString::to_string).collect();
    load(&packed.glb.unwrap_or_else(|| panic!("not packed: {messages:#?}"))).unwrap()
}

/// Packs a file that must be refused and returns its error's message.
#[track_caller]
fn refusal(bytes: &[u8]) -> String {
    let packed = pack_alone(bytes);
    assert!(packed.glb.is_none(), "it was packed");
    let errors: Vec<String> =
        packed.diagnostics.iter().filter(|it| it.is_error()).map(ToString::to_string).collect();
    assert!(!errors.is_empty(), "refused without a reason");
    errors.join("\n")
}

/// Passes only when `|actual - expected| <= tol`; written with `<=`, so NaN fails.
#[track_caller]
fn check_within(what: &str, actual: &[f32], expected: &[f32], tol: f32) {
    assert_eq!(actual.len(), expected.len(), "{what}");
    for (actual, expected) in actual.iter().zip(expected) {
        let error = (actual - expected).abs();
        assert!(error <= tol, "{what}: got {actual}, want {expected}, error {error} over {tol}");
    }
}

fn shared(bytes: &[u8]) -> Arc<[u8]> {
    Arc::from(bytes)
}

/// Where two packs differ, past the header with its lengths.
fn first_difference(a: &[u8], b: &[u8]) -> String {
    let at = (20..a.len().min(b.len())).find(|&at| a[at] != b[at]).unwrap_or(20);
    let around =
        |bytes: &[u8]| String::from_utf8_lossy(&bytes[at - 20..(at + 60).min(bytes.len())]).into_owned();
    format!("at {at}: {:?} and {:?}", around(a), around(b))
}
