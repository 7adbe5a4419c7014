//! `KHR_materials_variants` and `EXT_texture_webp`.

use serde_json::json;

use super::build::File;
use super::{pack_alone, refusal, scene_of};
use crate::{Effect, VariantMaterial, pack};

/// A plain triangle that is coated in variant 1.
fn shoe() -> File {
    let mut file = File::with_material(json!({"name": "matt", "extensions": {"KHR_materials_unlit": {}}}));
    let list = file.root["materials"].as_array_mut().unwrap();
    list.push(json!({"name": "coated", "normalTexture": {"index": 0},
        "extensions": {"KHR_materials_clearcoat": {"clearcoatFactor": 1}}}));
    list.push(json!({"name": "unused", "emissiveFactor": [1, 1, 1]}));
    file.root["extensions"] =
        json!({"KHR_materials_variants": {"variants": [{"name": "day"}, {"name": "night"}]}});
    file.root["extensionsUsed"] = json!(["KHR_materials_variants"]);
    file.primitive()["extensions"] = json!({"KHR_materials_variants":
        {"mappings": [{"material": 1, "variants": [1]}, {"material": 0, "variants": [0]}]}});
    file.texture([160, 120, 240, 255])
}

#[test]
fn materials_of_variants_count_and_draws_take_them() {
    let packed = pack_alone(&shoe().bytes());
    let names: Vec<&str> = packed.effects.iter().map(|it| it.material.as_str()).collect();
    assert_eq!(names, ["matt", "coated"]);
    assert!(packed.calls_for(Effect::Clearcoat) && !packed.calls_for(Effect::Emission));
    assert!(packed.effects[1].reads.ggx.is_some() && packed.effects[0].reads.ggx.is_none());
    let scene = scene_of(&shoe().bytes());
    assert_eq!(scene.variants, ["day", "night"]);
    assert_eq!((scene.primitives[0].material, scene.images.len()), (0, 1));
    let of = |material, variants| VariantMaterial { primitive: 0, material, variants };
    assert_eq!(scene.variant_materials, [of(1, vec![1]), of(0, vec![0])]);
    // What the coated material reads is there although the default reads nothing.
    super::check_within("tangent", &scene.primitives[0].vertices[0].tangent, &[1.0, 0.0, 0.0, -1.0], 1e-6);
    assert_eq!(scene.primitives[0].vertices[1].uv0, [1.0, 0.0]);
    let of_variant = |variant| scene.material_of(&scene.draws[0], variant);
    assert_eq!([None, Some(0), Some(1), Some(2)].map(of_variant), [0, 0, 1, 0]);
    assert_eq!(scene.notes, Vec::<String>::new());
}

#[test]
fn pack_of_a_pack_with_variants_is_the_same_pack() {
    let mut file = shoe();
    file.root["nodes"] = json!([{"mesh": 0}, {"mesh": 0, "scale": [-1, 1, 1]}]);
    file.root["scenes"][0]["nodes"] = json!([0, 1]);
    let first = pack_alone(&file.bytes());
    let glb = first.glb.unwrap();
    let again = pack("again.glb", &glb, &mut |_| None);
    assert!(again.glb.as_ref() == Some(&glb), "{}", super::first_difference(&again.glb.unwrap(), &glb));
    assert_eq!(again.effects, first.effects);
}

#[test]
fn variants_that_do_not_exist_or_contradict_are_refused() {
    let mapped = |mappings: serde_json::Value| {
        let mut file = shoe();
        file.primitive()["extensions"]["KHR_materials_variants"]["mappings"] = mappings;
        refusal(&file.bytes())
    };
    let place = "/meshes/0/primitives/0/extensions/KHR_materials_variants/mappings/";
    for (mappings, wanted) in [
        (json!([{"material": 1, "variants": [2]}]), "0/variants/0: variant 2 does not exist, the file has 2"),
        (
            json!([{"material": 1, "variants": [0]}, {"material": 2, "variants": [1, 0]}]),
            "1/variants/1: variant 0 already",
        ),
        (json!([{"material": 9, "variants": [0]}]), "0/material: material 9 does not exist"),
    ] {
        let message = mapped(mappings);
        assert!(message.contains(&format!("{place}{wanted}")), "{message}");
    }
}

/// A file whose texture 0 has `webp` by its extension, and a grey PNG beside it where `fallback` says so.
fn webp(bytes: &[u8], fallback: bool) -> Vec<u8> {
    let material = json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}});
    let mut file = File::with_material(material).texture([90, 90, 90, 255]);
    let view = file.view(bytes);
    file.root["images"].as_array_mut().unwrap().push(json!({"bufferView": view, "mimeType": "image/webp"}));
    file.root["textures"] = json!([{"extensions": {"EXT_texture_webp": {"source": 1}}}]);
    if fallback {
        file.root["textures"][0]["source"] = json!(0);
    } else {
        file.root["extensionsRequired"] = json!(["EXT_texture_webp"]);
    }
    file.bytes()
}

fn encoded(texel: [u8; 4]) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image::RgbaImage::from_pixel(2, 2, image::Rgba(texel))
        .write_to(&mut bytes, image::ImageFormat::WebP)
        .unwrap();
    bytes.into_inner()
}

#[test]
fn webp_is_decoded_and_packed_for_readers_without_it() {
    let scene = scene_of(&webp(&encoded([10, 20, 30, 255]), false));
    assert_eq!((scene.images[0].width, &scene.images[0].rgba[..4]), (2, &[10, 20, 30, 255][..]));
    let glb = pack_alone(&webp(&encoded([10, 20, 30, 255]), true)).glb.unwrap();
    assert!(pack("again.glb", &glb, &mut |_| None).glb.unwrap() == glb);
    assert!(!String::from_utf8_lossy(&glb).contains("webp"));
}

#[test]
fn damaged_webp_gives_way_to_the_other_image_and_says_so() {
    let mut damaged = encoded([10, 20, 30, 255]);
    damaged.truncate(damaged.len() / 2);
    let packed = pack_alone(&webp(&damaged, true));
    assert!(
        packed.diagnostics[0].to_string().contains("the texture's other image is drawn"),
        "{:?}",
        packed.diagnostics
    );
    assert_eq!(crate::load(&packed.glb.unwrap()).unwrap().images[0].rgba, [90, 90, 90, 255]);
    let packed = pack_alone(&webp(&damaged, false));
    assert!(packed.diagnostics[0].to_string().contains("neutral texture"), "{:?}", packed.diagnostics);
}

#[test]
fn webp_that_claims_a_huge_size_is_refused_before_it_is_decoded() {
    // A VP8X header of 16 777 216 × 16 777 216 texels and nothing behind it.
    let mut bytes = b"RIFF\x16\0\0\0WEBPVP8X\x0a\0\0\0\0\0\0\0".to_vec();
    bytes.extend([0xff; 6]);
    let packed = pack_alone(&webp(&bytes, true));
    assert!(packed.glb.is_some());
    assert!(packed.diagnostics[0].message.contains("cannot be read"), "{:?}", packed.diagnostics);
}
