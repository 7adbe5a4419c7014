//! Outside references.

use serde_json::json;

use crate::uri::{data_payload, resolve};
use crate::{UriKind, external_uris};

fn path_of(uri: &str) -> Result<String, String> {
    resolve("scenes/car/car.gltf", "/images/0/uri", uri).map(|(path, _)| path).map_err(|error| error.reason)
}

#[test]
fn references_are_relative_to_the_file_and_decoded() {
    assert_eq!(path_of("paint.png").unwrap(), "scenes/car/paint.png");
    assert_eq!(path_of("./a%20b/%E2%9D%A4.png").unwrap(), "scenes/car/a b/❤.png");
    assert_eq!(path_of("../../shared/wood.png").unwrap(), "shared/wood.png");
}

#[test]
fn references_out_of_the_project_are_refused() {
    for uri in [
        "../../../secret",
        "%2e%2e/%2e%2e/%2e%2e/secret",
        "/etc/passwd",
        "%2Fetc/passwd",
        "file:///etc/passwd",
        "http://example.org/a.png",
        "C:\\a.png",
        "c:/a.png",
        "..\\..\\a.png",
        "a%00b",
        "bad%zz",
        "",
    ] {
        assert!(path_of(uri).is_err(), "{uri:?} was taken as {:?}", path_of(uri));
    }
}

#[test]
fn external_uris_lists_each_file_once_and_skips_data() {
    let file = json!({
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": 1, "uri": "a.bin"}, {"byteLength": 1, "uri": "data:;base64,AA=="}, {"byteLength": 1}],
        "images": [{"uri": "a.png"}, {"uri": "a.png"}, {"uri": "/root.png"}, {"bufferView": 0}],
    });
    let (uris, diagnostics) = external_uris("s/x.gltf", &serde_json::to_vec_pretty(&file).unwrap());
    let found: Vec<(UriKind, &str)> = uris.iter().map(|uri| (uri.kind, uri.path.as_str())).collect();
    assert_eq!(found, [(UriKind::Buffer, "s/a.bin"), (UriKind::Image, "s/a.png")]);
    assert_eq!(diagnostics.len(), 1);
    assert!(diagnostics[0].span.as_ref().unwrap().source_line.contains("/root.png"), "{}", diagnostics[0]);
}

#[test]
fn data_uris_decode_with_and_without_padding() {
    assert_eq!(data_payload("data:application/octet-stream;base64,SGFsbG8=").unwrap(), b"Hallo");
    assert_eq!(data_payload("data:;base64,SGFsbG8").unwrap(), b"Hallo");
    assert_eq!(data_payload("data:,a%20b").unwrap(), b"a b");
    assert_eq!(data_payload("data:;base64,SGFsb*8="), None);
    assert_eq!(data_payload("data:;base64,S"), None);
    assert_eq!(data_payload("data:nothing"), None);
}
