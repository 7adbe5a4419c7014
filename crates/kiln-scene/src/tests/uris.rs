//! Outside references.

use serde_json::json;

use crate::uri::{data_payload, resolve};
use crate::{PackOptions, UriKind, external_uris, pack, pack_with};

fn path_of(uri: &str) -> Result<String, String> {
    path_with(&[], "scenes/car/car.gltf", uri)
}

fn path_with(allowed: &[&str], file: &str, uri: &str) -> Result<String, String> {
    let allowed: Vec<String> = allowed.iter().map(ToString::to_string).collect();
    resolve(file, &allowed, "/images/0/uri", uri).map(|(path, _)| path).map_err(|error| error.reason)
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
        "file:/etc/passwd",
        "file://host/etc/passwd",
        "file:x.png",
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

#[test]
fn references_into_allowed_folders_are_taken_by_the_spelling_of_kiln_toml() {
    let car = "scenes/car/car.gltf";
    let library = |uri| path_with(&["../library"], car, uri);
    assert_eq!(library("../../../library/wood/oak.png").unwrap(), "../library/wood/oak.png");
    assert_eq!(library("../../../library/wood/../oak.png").unwrap(), "../library/oak.png");
    assert_eq!(library("%2e%2e/../../library/a%20b.png").unwrap(), "../library/a b.png");
    let assets = |uri| path_with(&["/srv/assets/"], car, uri);
    assert_eq!(assets("/srv/assets/oak.png").unwrap(), "/srv/assets/oak.png");
    for uri in [
        "file:///srv/assets/o%20k.png",
        "file:/srv/assets/o%20k.png",
        "file://localhost/srv/assets/o%20k.png",
    ] {
        assert_eq!(assets(uri).unwrap(), "/srv/assets/o k.png");
    }
    assert_eq!(path_with(&["../.."], car, "../../../../else/oak.png").unwrap(), "../../else/oak.png");
}

#[test]
fn references_beside_allowed_folders_are_refused() {
    for (folder, uri) in [
        ("../library", "../../../library2/oak.png"),
        ("../library", "../../../oak.png"),
        ("../library", "../../../library/../oak.png"),
        ("../library", "../../../library/%2e%2e/%2e%2e/oak.png"),
        ("../library", "../../../library/..%2foak.png"),
        ("../library", "../../../../library/oak.png"),
        ("../library", "/library/oak.png"),
        ("library", "../../../library/oak.png"),
        ("/srv/assets", "/srv/assets/../oak.png"),
        ("/srv/assets", "/../srv/assets/../oak.png"),
        ("/srv/assets", "../../../srv/assets/oak.png"),
        ("/srv/assets", "file://host/srv/assets/oak.png"),
        ("/srv/assets", "http://localhost/srv/assets/oak.png"),
        ("..", "../../../../oak.png"),
    ] {
        let taken = path_with(&[folder], "scenes/car/car.gltf", uri);
        assert!(taken.is_err(), "{uri:?} was taken as {taken:?} though only {folder} is allowed");
    }
}

#[test]
fn files_beside_a_scene_outside_the_project_need_its_folder_allowed() {
    assert_eq!(path_with(&["/srv/cars"], "/srv/cars/car.gltf", "car.bin").unwrap(), "/srv/cars/car.bin");
    assert!(path_with(&[], "/srv/cars/car.gltf", "car.bin").unwrap_err().contains("absolute"));
    assert_eq!(path_with(&["../cars"], "../cars/car.gltf", "car.bin").unwrap(), "../cars/car.bin");
    assert!(path_with(&[], "../cars/car.gltf", "car.bin").unwrap_err().contains("leaves the project"));
}

#[test]
fn refused_reference_says_what_to_allow_and_then_is_asked_for() {
    let file = json!({"asset": {"version": "2.0"}, "buffers": [{"byteLength": 1, "uri": "../../library/my%20car.bin"}]});
    let file = serde_json::to_vec_pretty(&file).unwrap();
    let refused = pack("cars/car.gltf", &file, &mut |path| panic!("{path} was asked for"));
    let help = refused.diagnostics[0].help.as_ref().unwrap();
    assert!(help.contains("allow_folders = [\"../library\"]"), "{help}");
    let options = PackOptions { allowed_folders: vec!["../library".to_owned()], ..PackOptions::default() };
    let mut asked = Vec::new();
    pack_with(&options, "cars/car.gltf", &file, &mut |path| {
        asked.push(path.to_owned());
        None
    });
    assert_eq!(asked, ["../library/my car.bin"]);
}

#[test]
fn file_named_by_many_entries_is_read_once() {
    let view = |buffer| json!({"buffer": buffer, "byteLength": 36});
    let accessor = |view| json!({"bufferView": view, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]});
    let texture = json!({"baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 1}});
    let file = json!({
        "asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1}, "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": texture}],
        "textures": [{"source": 0}, {"source": 1}],
        "images": [{"uri": "a.png"}, {"uri": "a.png"}],
        "accessors": [accessor(0), accessor(1)], "bufferViews": [view(0), view(1)],
        "buffers": [{"byteLength": 36, "uri": "a.bin"}, {"byteLength": 36, "uri": "a.bin"}],
    });
    let mut png = std::io::Cursor::new(Vec::new());
    image::RgbaImage::from_pixel(1, 1, image::Rgba([9; 4]))
        .write_to(&mut png, image::ImageFormat::Png)
        .unwrap();
    let mut asked = Vec::new();
    let corners: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let packed = pack("x.gltf", &serde_json::to_vec(&file).unwrap(), &mut |path| {
        asked.push(path.to_owned());
        let corners = corners.map(f32::to_le_bytes);
        Some(if path == "a.bin" { corners.as_flattened() } else { png.get_ref().as_slice() }.into())
    });
    assert!(packed.glb.is_some(), "{:?}", packed.diagnostics);
    assert_eq!(asked, ["a.bin", "a.png"]);
}
