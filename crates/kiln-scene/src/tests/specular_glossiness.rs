//! Materials of the old model as `KHR_materials_specular`.

use serde_json::{Value, json};

use super::build::File;
use super::{check_within, corpus::corpus, shared};
use crate::{
    Effect, Image8, Material, PackOptions, Packed, Scene, SpecularGlossinessAs, TextureRef, load, pack,
    pack_with,
};

const EXTENSION: &str = "KHR_materials_pbrSpecularGlossiness";
/// Half a step of 8 bits.
const HALF_CODE: f64 = 0.5 / 255.0;

fn options(specular_glossiness: SpecularGlossinessAs) -> PackOptions {
    PackOptions { specular_glossiness, ..PackOptions::default() }
}

fn pack_as(form: SpecularGlossinessAs, bytes: &[u8]) -> (Packed, Scene) {
    let packed = pack_with(&options(form), "test.gltf", bytes, &mut |_| None);
    let glb = packed.glb.as_ref().unwrap_or_else(|| panic!("{:?}", packed.diagnostics));
    let scene = load(glb).unwrap();
    (packed, scene)
}

fn material(values: Value) -> Value {
    json!({"extensions": {EXTENSION: values}})
}

fn texel(scene: &Scene, texture: Option<TextureRef>) -> [u8; 4] {
    let texture = &scene.textures[texture.unwrap().texture];
    scene.images[texture.image].rgba[..4].try_into().unwrap()
}

#[test]
fn factors_are_kept_and_reflectance_is_the_specular_colour() {
    let values = json!({"diffuseFactor": [0.5, 0.25, 0.125, 1.0], "specularFactor": [0.9, 0.5, 0.02], "glossinessFactor": 0.75});
    let file = File::with_material(material(values)).bytes();
    let (packed, scene) = pack_as(SpecularGlossinessAs::Specular, &file);
    assert_eq!(packed.effects[0].variant_name(), "specular");
    let found = &scene.materials[0];
    assert_eq!(found.base_color_factor, [0.5, 0.25, 0.125, 1.0]);
    assert_eq!((found.metallic_factor, found.roughness_factor), (0.0, 0.25));
    assert_eq!(f0(found, [1.0; 3]), [0.9, 0.5, 0.02]);
    // Reflectance at 90°.
    assert_eq!(found.specular_factor, 1.0);
    assert!(packed.diagnostics.iter().any(|it| it.message.contains("converted to KHR_materials_specular")));
    let (packed, scene) = pack_as(SpecularGlossinessAs::MetallicRoughness, &file);
    assert!(!packed.calls_for(Effect::Specular));
    assert!(scene.materials[0].metallic_factor > 0.5);
}

/// Reflectance at normal incidence as `shaders/pbr/specular.wgsl` computes it, of a texel with this linear colour.
fn f0(material: &Material, texel: [f32; 3]) -> [f32; 3] {
    let ratio = (material.ior - 1.0) / (material.ior + 1.0);
    std::array::from_fn(|at| (ratio * ratio * material.specular_color_factor[at] * texel[at]).min(1.0))
}

#[test]
fn textures_are_split_into_colour_and_roughness() {
    let values = json!({
        "diffuseTexture": {"index": 0}, "specularGlossinessTexture": {"index": 1}, "glossinessFactor": 0.5,
        "specularFactor": [1.0, 0.5, 1.0],
    });
    let file = File::with_material(material(values)).texture([10, 20, 30, 255]).texture([200, 100, 50, 128]);
    let (packed, scene) = pack_as(SpecularGlossinessAs::Specular, &file.bytes());
    let found = &scene.materials[0];
    assert_eq!(texel(&scene, found.base_color_texture), [10, 20, 30, 255]);
    assert_eq!(texel(&scene, found.specular_color_texture), [200, 100, 50, 255]);
    assert_eq!(found.specular_color_factor, [1.0, 0.5, 1.0]);
    assert_eq!(found.roughness_factor, 1.0);
    let [_, roughness, metal, _] = texel(&scene, found.metallic_roughness_texture);
    assert_eq!(metal, 0);
    let wanted = 1.0 - 0.5 * 128.0 / 255.0;
    check_within("roughness", &[f32::from(roughness) / 255.0], &[wanted as f32], HALF_CODE as f32 + 1e-6);
    let read = packed.effects[0].reads.ggx.unwrap();
    check_within("interval", &read, &[wanted as f32; 2], HALF_CODE as f32 + 1e-6);
    let glb = packed.glb.unwrap();
    assert!(pack("again.glb", &glb, &mut |_| None).glb.unwrap() == glb, "packing it again changes it");
}

#[test]
fn factor_alone_of_an_unreadable_texture_is_kept() {
    let values = json!({"specularGlossinessTexture": {"index": 7}, "glossinessFactor": 0.25, "specularFactor": [0.1, 0.2, 0.3]});
    let (_, scene) = pack_as(SpecularGlossinessAs::Specular, &File::with_material(material(values)).bytes());
    let found = &scene.materials[0];
    assert_eq!((found.roughness_factor, found.specular_color_factor), (0.75, [0.1, 0.2, 0.3]));
    assert!(found.specular_color_texture.is_none());
}

/// Each texel of the corpus' textured model beside its source, all 8 bits of both.
#[test]
fn texels_of_a_real_model_are_exact() {
    let Some(corpus) = corpus() else { return };
    let folder = corpus.join("gltf/assimp/BoxTextured-glTF-pbrSpecularGlossiness");
    let bytes = std::fs::read(folder.join("BoxTextured.gltf")).unwrap();
    let mut read = |path: &str| std::fs::read(folder.join(path)).ok().map(|bytes| shared(&bytes));
    let packed = pack_with(&options(SpecularGlossinessAs::Specular), "BoxTextured.gltf", &bytes, &mut read);
    assert!(packed.calls_for(Effect::Specular), "{:?}", packed.diagnostics);
    let scene = load(packed.glb.as_ref().unwrap()).unwrap();
    let found = &scene.materials[0];
    let source: Value = serde_json::from_slice(&bytes).unwrap();
    let old = &source["materials"][0]["extensions"][EXTENSION];
    let glossiness = old["glossinessFactor"].as_f64().unwrap_or(1.0);
    let image = |table: &str| {
        let texture = old[table]["index"].as_u64()?;
        let image = &source["textures"][texture as usize]["source"];
        let uri = source["images"][image.as_u64()? as usize]["uri"].as_str()?;
        crate::decode_image(&std::fs::read(folder.join(uri)).unwrap()).ok()
    };
    let picture = |texture: Option<TextureRef>| Some(&scene.images[scene.textures[texture?.texture].image]);
    assert_eq!(image("diffuseTexture").as_ref(), picture(found.base_color_texture));
    match image("specularGlossinessTexture") {
        None => check_within("roughness", &[found.roughness_factor], &[1.0 - glossiness as f32], 1e-6),
        Some(old) => {
            let color = picture(found.specular_color_texture).unwrap();
            check_split(&old, glossiness, color, picture(found.metallic_roughness_texture).unwrap());
        }
    }
}

#[track_caller]
fn check_split(old: &Image8, factor: f64, color: &Image8, rough: &Image8) {
    let texels = |image: &Image8| image.rgba.as_chunks::<4>().0.to_vec();
    assert_eq!((old.width, old.height), (color.width, color.height));
    for ((old, color), rough) in texels(old).iter().zip(texels(color)).zip(texels(rough)) {
        assert_eq!(old[..3], color[..3]);
        let error = f64::from(rough[1]) / 255.0 - (1.0 - factor * f64::from(old[3]) / 255.0);
        assert!(error.abs() <= HALF_CODE + 1e-9, "roughness is off by {error}");
    }
}

#[test]
#[should_panic(expected = "roughness is off")]
fn split_check_rejects_one_code_of_roughness() {
    let image = |rgba| Image8 { width: 1, height: 1, rgba };
    let color = image(vec![1, 2, 3, 255]);
    check_split(&image(vec![1, 2, 3, 100]), 1.0, &color, &image(vec![255, 156, 0, 255]));
}
