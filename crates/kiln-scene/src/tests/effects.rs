//! Effects come from values, never from the presence of an extension.

use serde_json::{Value, json};

use super::build::File;
use super::{pack_alone, scene_of};
use crate::{AlphaMode, Effect, variant_name};

/// Variant of a triangle with this material and textures of these single texels.
#[track_caller]
fn variant(material: Value, texels: &[[u8; 4]]) -> String {
    let file = texels.iter().fold(File::with_material(material), |file, &texel| file.texture(texel));
    let packed = pack_alone(&file.bytes());
    let messages: Vec<String> = packed.diagnostics.iter().map(ToString::to_string).collect();
    assert!(packed.glb.is_some(), "{messages:#?}");
    variant_name(&packed.effects[0].effects)
}

fn extension(name: &str, values: Value) -> Value {
    json!({ "extensions": { name: values } })
}

#[test]
fn every_effect_has_one_name() {
    for effect in Effect::ALL {
        assert_eq!(Effect::from_name(effect.name()), Some(effect));
    }
    assert!(Effect::ALL.is_sorted_by_key(|effect| effect.name()));
    assert_eq!(Effect::from_name("glow"), None);
}

#[test]
fn variant_name_sorts_by_name_and_calls_nothing_base() {
    assert_eq!(
        variant_name(&[Effect::Sheen, Effect::AlphaMask, Effect::Clearcoat].into()),
        "alpha_mask+clearcoat+sheen"
    );
    assert_eq!(variant_name(&[].into()), "base");
}

#[test]
fn clearcoat_needs_a_factor_and_a_texture_that_is_not_black() {
    let coat = |factor: f64| extension("KHR_materials_clearcoat", json!({"clearcoatFactor": factor}));
    assert_eq!(variant(coat(0.0), &[]), "base");
    assert_eq!(variant(coat(0.5), &[]), "clearcoat");
    let textured = || {
        extension(
            "KHR_materials_clearcoat",
            json!({"clearcoatFactor": 1.0, "clearcoatTexture": {"index": 0}}),
        )
    };
    assert_eq!(variant(textured(), &[[0, 255, 255, 255]]), "base");
    assert_eq!(variant(textured(), &[[1, 0, 0, 255]]), "clearcoat");
}

#[test]
fn sheen_of_black_is_no_sheen() {
    let sheen = |color: [f64; 3]| extension("KHR_materials_sheen", json!({"sheenColorFactor": color}));
    assert_eq!(variant(sheen([0.0; 3]), &[]), "base");
    assert_eq!(variant(sheen([0.0, 0.1, 0.0]), &[]), "sheen");
}

#[test]
fn emission_needs_light_in_factor_texture_and_strength() {
    let glow = |strength: f64| {
        json!({"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0},
            "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": strength}}})
    };
    assert_eq!(variant(glow(2.0), &[[0, 9, 0, 255]]), "emission");
    assert_eq!(variant(glow(2.0), &[[0, 0, 0, 255]]), "base");
    assert_eq!(variant(glow(0.0), &[[9, 9, 9, 255]]), "base");
}

#[test]
fn flat_normal_map_and_white_occlusion_are_nothing() {
    let material = || json!({"normalTexture": {"index": 0}, "occlusionTexture": {"index": 1}});
    assert_eq!(variant(material(), &[[128, 127, 255, 255], [255; 4]]), "base");
    assert_eq!(variant(material(), &[[140, 127, 250, 255], [254; 4]]), "normal_map+occlusion");
}

#[test]
fn ior_and_specular_count_only_away_from_their_defaults_and_not_on_metal() {
    let material = |ior: f64, metallic: f64| json!({"pbrMetallicRoughness": {"metallicFactor": metallic}, "extensions": {"KHR_materials_ior": {"ior": ior}}});
    assert_eq!(variant(material(1.5, 0.0), &[]), "base");
    assert_eq!(variant(material(1.33, 0.0), &[]), "specular");
    assert_eq!(variant(material(1.33, 1.0), &[]), "base");
}

#[test]
fn specular_extension_counts_where_it_dims_or_tints() {
    let layer = |values: Value| dielectric(json!({ "specular": values }));
    assert_eq!(variant(layer(json!({})), &[]), "base");
    assert_eq!(variant(layer(json!({"specularFactor": 1, "specularColorFactor": [1, 1, 1]})), &[]), "base");
    assert_eq!(variant(layer(json!({"specularFactor": 0.5})), &[]), "specular");
    assert_eq!(variant(layer(json!({"specularColorFactor": [1, 1, 0.5]})), &[]), "specular");
    let dimmed = || layer(json!({"specularTexture": {"index": 0}}));
    assert_eq!(variant(dimmed(), &[[0, 0, 0, 255]]), "base", "only alpha is read");
    assert_eq!(variant(dimmed(), &[[255, 255, 255, 254]]), "specular");
    let tinted = || layer(json!({"specularColorTexture": {"index": 0}}));
    assert_eq!(variant(tinted(), &[[255, 255, 255, 0]]), "base", "alpha is not read");
    assert_eq!(variant(tinted(), &[[255, 254, 255, 255]]), "specular");
    assert_eq!(variant(dielectric(json!({"ior": {}})), &[]), "base");
    assert_eq!(variant(dielectric(json!({"ior": {"ior": 0}})), &[]), "specular");
}

#[test]
fn transmission_needs_a_factor_a_texture_with_red_and_no_metal() {
    let glass = |factor: f64| dielectric(json!({"transmission": {"transmissionFactor": factor}}));
    assert_eq!(variant(glass(0.0), &[]), "base");
    assert_eq!(variant(glass(0.5), &[]), "transmission");
    let mut metal = glass(1.0);
    metal["pbrMetallicRoughness"]["metallicFactor"] = json!(1);
    assert_eq!(variant(metal, &[]), "base");
    let textured = || {
        dielectric(json!({"transmission": {"transmissionFactor": 1, "transmissionTexture": {"index": 0}}}))
    };
    assert_eq!(variant(textured(), &[[0, 255, 255, 255]]), "base");
    assert_eq!(variant(textured(), &[[1, 0, 0, 255]]), "transmission");
}

#[test]
fn sheen_textures_and_scales_of_zero_are_nothing() {
    let cloth =
        || dielectric(json!({"sheen": {"sheenColorFactor": [1, 1, 1], "sheenColorTexture": {"index": 0}}}));
    assert_eq!(variant(cloth(), &[[0, 0, 0, 255]]), "base");
    assert_eq!(variant(cloth(), &[[0, 1, 0, 255]]), "sheen");
    let bumpy = |scale: f64| json!({"normalTexture": {"index": 0, "scale": scale}});
    assert_eq!(variant(bumpy(0.0), &[[160, 120, 240, 255]]), "base");
    let dark = |strength: f64| json!({"occlusionTexture": {"index": 0, "strength": strength}});
    assert_eq!(variant(dark(0.0), &[[0; 4]]), "base");
    assert_eq!(variant(dark(0.5), &[[0; 4]]), "occlusion");
    let coat = |scale: f64| {
        extension(
            "KHR_materials_clearcoat",
            json!({"clearcoatFactor": 1, "clearcoatNormalTexture": {"index": 0, "scale": scale}}),
        )
    };
    let mapped = |scale| {
        let file = File::with_material(coat(scale)).texture([160, 120, 240, 255]);
        scene_of(&file.bytes()).materials[0].clearcoat_normal_texture.is_some()
    };
    assert_eq!([mapped(1.0), mapped(0.0)], [true, false]);
}

#[test]
fn specular_glossiness_alone_calls_for_nothing() {
    let plain = || extension("KHR_materials_pbrSpecularGlossiness", json!({}));
    assert_eq!(variant(plain(), &[]), "base");
    let mut glowing = plain();
    glowing["emissiveFactor"] = json!([0, 0, 1]);
    assert_eq!(variant(glowing, &[]), "emission");
}

#[test]
fn unlit_keeps_alpha_and_vertex_colours() {
    let mut material = extension("KHR_materials_unlit", json!({}));
    material["alphaMode"] = json!("BLEND");
    assert_eq!(variant(material.clone(), &[]), "unlit");
    material["pbrMetallicRoughness"] = json!({"baseColorFactor": [1, 1, 1, 0.5]});
    assert_eq!(variant(material, &[]), "alpha_blend+unlit");
}

#[test]
fn transmission_is_an_effect_without_a_note() {
    let mut material = extension("KHR_materials_transmission", json!({"transmissionFactor": 1.0}));
    material["pbrMetallicRoughness"] = json!({"metallicFactor": 0.0});
    let packed = pack_alone(&File::with_material(material).bytes());
    assert!(packed.calls_for(Effect::Transmission));
    assert!(
        !packed.diagnostics.iter().any(|it| it.message.contains("transmission is")),
        "{:?}",
        packed.diagnostics
    );
}

/// A dielectric with these extensions of `KHR_materials_…`.
fn dielectric(extensions: Value) -> Value {
    let named = extensions.as_object().unwrap().iter();
    let named: serde_json::Map<String, Value> =
        named.map(|(name, values)| (format!("KHR_materials_{name}"), values.clone())).collect();
    json!({ "pbrMetallicRoughness": {"metallicFactor": 0.0}, "extensions": named })
}

#[test]
fn anisotropy_needs_strength_and_a_texture_with_blue() {
    let brush = |strength: f64| dielectric(json!({"anisotropy": {"anisotropyStrength": strength}}));
    assert_eq!(variant(brush(0.0), &[]), "base");
    assert_eq!(variant(brush(-1.0), &[]), "base");
    assert_eq!(variant(brush(0.5), &[]), "anisotropy");
    let textured =
        || dielectric(json!({"anisotropy": {"anisotropyStrength": 1, "anisotropyTexture": {"index": 0}}}));
    assert_eq!(variant(textured(), &[[255, 128, 0, 255]]), "base");
    assert_eq!(variant(textured(), &[[255, 128, 9, 255]]), "anisotropy");
}

#[test]
fn brush_gets_tangents_along_the_first_coordinates_where_the_mesh_has_none() {
    let material = dielectric(json!({"anisotropy": {"anisotropyStrength": 0.5, "anisotropyRotation": 0.25}}));
    let scene = scene_of(&File::with_material(material).bytes());
    assert_eq!(scene.materials[0].anisotropy_rotation, 0.25);
    for vertex in &scene.primitives[0].vertices {
        super::check_within("tangent", &vertex.tangent[..3], &[1.0, 0.0, 0.0], 1e-6);
        assert_eq!(vertex.uv0, [0.0; 2], "nothing else reads them");
    }
}

#[test]
fn brush_on_a_mesh_with_tangents_asks_for_no_coordinates() {
    let mut file = File::with_material(dielectric(json!({"anisotropy": {"anisotropyStrength": 0.5}})));
    let tangents = file.floats(&[[0.0, 1.0, 0.0, 1.0]; 3]);
    file.primitive()["attributes"]["TANGENT"] = json!(tangents);
    file.primitive()["attributes"].as_object_mut().unwrap().remove("TEXCOORD_0");
    let scene = scene_of(&file.bytes());
    assert_eq!(scene.notes, Vec::<String>::new());
    assert_eq!(scene.primitives[0].vertices[0].tangent, [0.0, 1.0, 0.0, 1.0]);
}

#[test]
fn iridescence_needs_a_factor_a_texture_with_red_and_a_film_that_is_not_nothing() {
    let film = |values: Value| dielectric(json!({ "iridescence": values }));
    assert_eq!(variant(film(json!({"iridescenceFactor": 0})), &[]), "base");
    assert_eq!(variant(film(json!({"iridescenceFactor": 1})), &[]), "iridescence");
    let thin = |max: f64| json!({"iridescenceFactor": 1, "iridescenceThicknessMaximum": max});
    assert_eq!(variant(film(thin(0.0)), &[]), "base", "without a texture the maximum counts alone");
    let textured = || film(json!({"iridescenceFactor": 1, "iridescenceTexture": {"index": 0}}));
    assert_eq!(variant(textured(), &[[0, 255, 255, 255]]), "base");
    assert_eq!(variant(textured(), &[[1, 0, 0, 255]]), "iridescence");
    let minimum = || {
        film(json!({"iridescenceFactor": 1, "iridescenceThicknessMaximum": 0,
            "iridescenceThicknessTexture": {"index": 0}}))
    };
    assert_eq!(variant(minimum(), &[[0, 255, 0, 255]]), "base");
    assert_eq!(variant(minimum(), &[[0, 254, 0, 255]]), "iridescence");
}

#[test]
fn volume_needs_thickness_and_light_that_enters() {
    let inside = |thickness: f64, transmission: f64| {
        dielectric(
            json!({"volume": {"thicknessFactor": thickness}, "transmission": {"transmissionFactor": transmission}}),
        )
    };
    assert_eq!(variant(inside(0.0, 1.0), &[]), "transmission");
    assert_eq!(variant(inside(0.5, 0.0), &[]), "base", "nobody sees the inside of what is opaque");
    assert_eq!(variant(inside(0.5, 1.0), &[]), "transmission+volume");
    let textured = || {
        dielectric(json!({"transmission": {"transmissionFactor": 1},
            "volume": {"thicknessFactor": 1, "thicknessTexture": {"index": 0}}}))
    };
    assert_eq!(variant(textured(), &[[255, 0, 255, 255]]), "transmission");
    assert_eq!(variant(textured(), &[[0, 1, 0, 255]]), "transmission+volume");
    let mut metal = inside(0.5, 1.0);
    metal["pbrMetallicRoughness"] = json!({});
    assert_eq!(variant(metal, &[]), "base");
}

#[test]
fn dispersion_needs_a_volume_that_transmits_and_refracts() {
    let prism = |dispersion: f64, thickness: f64, ior: f64| {
        dielectric(json!({"dispersion": {"dispersion": dispersion}, "volume": {"thicknessFactor": thickness},
            "ior": {"ior": ior}, "transmission": {"transmissionFactor": 1}}))
    };
    assert_eq!(variant(prism(0.0, 1.0, 1.5), &[]), "transmission+volume");
    assert_eq!(variant(prism(2.0, 0.0, 1.5), &[]), "transmission");
    assert_eq!(variant(prism(2.0, 1.0, 1.0), &[]), "specular+transmission+volume");
    assert_eq!(variant(prism(2.0, 1.0, 1.5), &[]), "dispersion+transmission+volume");
}

#[test]
fn diffuse_transmission_needs_a_factor_and_a_texture_with_alpha() {
    let leaf = |factor: f64| {
        dielectric(
            json!({"diffuse_transmission": {"diffuseTransmissionFactor": factor}, "volume": {"thicknessFactor": 1}}),
        )
    };
    assert_eq!(variant(leaf(0.0), &[]), "base");
    assert_eq!(variant(leaf(0.5), &[]), "diffuse_transmission+volume");
    let textured = || {
        dielectric(json!({"diffuse_transmission":
            {"diffuseTransmissionFactor": 1, "diffuseTransmissionTexture": {"index": 0}}}))
    };
    assert_eq!(variant(textured(), &[[255, 255, 255, 0]]), "base");
    assert_eq!(variant(textured(), &[[0, 0, 0, 1]]), "diffuse_transmission");
}

#[test]
fn values_of_the_transmitting_effects_and_their_absence_reach_the_material() {
    let values = json!({
        "transmission": {"transmissionFactor": 1},
        "volume": {"thicknessFactor": 0.5, "attenuationDistance": 2.5, "attenuationColor": [0.5, 0.25, 1.0]},
        "dispersion": {"dispersion": 3},
        "diffuse_transmission": {"diffuseTransmissionFactor": 0.75, "diffuseTransmissionColorFactor": [1, 0.5, 0.25]},
        "iridescence": {"iridescenceFactor": 0.5, "iridescenceIor": 1.75, "iridescenceThicknessMinimum": 200,
            "iridescenceThicknessMaximum": 700}
    });
    let materials = scene_of(&File::with_material(dielectric(values)).bytes()).materials;
    let it = &materials[0];
    assert_eq!((it.thickness_factor, it.attenuation_distance), (0.5, 2.5));
    assert_eq!((it.attenuation_color, it.dispersion), ([0.5, 0.25, 1.0], 3.0));
    assert_eq!(it.diffuse_transmission_factor, 0.75);
    assert_eq!(it.diffuse_transmission_color_factor, [1.0, 0.5, 0.25]);
    assert_eq!((it.iridescence_factor, it.iridescence_ior), (0.5, 1.75));
    assert_eq!((it.iridescence_thickness_minimum, it.iridescence_thickness_maximum), (200.0, 700.0));
    let it = &scene_of(&File::with_material(dielectric(json!({}))).bytes()).materials[0];
    assert_eq!((it.thickness_factor, it.attenuation_distance), (0.0, f32::INFINITY));
}

#[test]
fn unlit_ends_every_other_effect() {
    let material = json!({"emissiveFactor": [1, 1, 1], "extensions":
        {"KHR_materials_unlit": {}, "KHR_materials_clearcoat": {"clearcoatFactor": 1.0}}});
    let packed = pack_alone(&File::with_material(material).bytes());
    assert_eq!(variant_name(&packed.effects[0].effects), "unlit");
    assert_eq!(packed.effects[0].reads, crate::LightReads::default());
}

#[test]
fn alpha_modes_count_only_where_alpha_can_matter() {
    let material = |mode: &str, alpha: f64| json!({"alphaMode": mode, "pbrMetallicRoughness": {"baseColorFactor": [1.0, 1.0, 1.0, alpha]}});
    assert_eq!(variant(material("BLEND", 1.0), &[]), "base");
    assert_eq!(variant(material("BLEND", 0.5), &[]), "alpha_blend");
    assert_eq!(variant(material("MASK", 0.6), &[]), "base");
    assert_eq!(variant(material("MASK", 0.4), &[]), "alpha_mask");
    let scene = scene_of(&File::with_material(material("MASK", 0.6)).bytes());
    assert_eq!(scene.materials[0].alpha_mode, AlphaMode::Opaque);
}

#[test]
fn vertex_colours_of_white_are_no_effect() {
    let colored = |color: [f32; 4]| {
        let mut file = File::triangle();
        let accessor = file.floats(&[[1.0; 4], [1.0; 4], color]);
        file.primitive()["attributes"]["COLOR_0"] = json!(accessor);
        variant_name(&pack_alone(&file.bytes()).effects[0].effects)
    };
    assert_eq!(colored([1.0; 4]), "base");
    assert_eq!(colored([1.0, 0.5, 1.0, 1.0]), "vertex_color");
}

#[test]
fn roughness_interval_covers_texture_and_coat() {
    let material = json!({"pbrMetallicRoughness": {"roughnessFactor": 0.5, "metallicRoughnessTexture": {"index": 0}},
        "extensions": {"KHR_materials_clearcoat": {"clearcoatFactor": 1.0, "clearcoatRoughnessFactor": 0.1}}});
    let packed = pack_alone(&File::with_material(material).texture([0, 204, 0, 255]).bytes());
    super::check_within("roughness", &packed.effects[0].reads.ggx.unwrap(), &[0.1, 0.4], 1e-6);
    assert_eq!(packed.effects[0].reads.charlie, None);
}

#[test]
fn refracted_light_is_read_sharper_in_thin_media_and_sheen_by_its_own_roughness() {
    let glass = |ior: f64, dispersion: f64| {
        json!({"pbrMetallicRoughness": {"roughnessFactor": 0.5, "metallicFactor": 0.0}, "extensions": {
            "KHR_materials_transmission": {"transmissionFactor": 1.0}, "KHR_materials_ior": {"ior": ior},
            "KHR_materials_volume": {"thicknessFactor": 1.0}, "KHR_materials_dispersion": {"dispersion": dispersion},
            "KHR_materials_sheen": {"sheenColorFactor": [1, 1, 1], "sheenRoughnessFactor": 0.8}}})
    };
    let reads = |ior, dispersion| {
        pack_alone(&File::with_material(glass(ior, dispersion)).texture([0, 0, 0, 255]).bytes()).effects[0]
            .reads
    };
    super::check_within("window glass", &reads(1.5, 0.0).ggx.unwrap(), &[0.5, 0.5], 1e-6);
    super::check_within("thin medium", &reads(1.2, 0.0).ggx.unwrap(), &[0.2, 0.5], 1e-6);
    super::check_within("dispersing medium", &reads(1.2, 4.0).ggx.unwrap(), &[0.18, 0.5], 1e-6);
    super::check_within("sheen", &reads(1.5, 0.0).charlie.unwrap(), &[0.8, 0.8], 1e-6);
}

#[test]
fn materials_that_nothing_uses_are_not_there() {
    let mut file = File::with_material(json!({"name": "used"}));
    file.root["materials"].as_array_mut().unwrap().push(extension("KHR_materials_unlit", json!({})));
    let packed = pack_alone(&file.bytes());
    assert_eq!(packed.effects.len(), 1);
    assert_eq!(packed.effects[0].material, "used");
}

#[test]
fn specular_glossiness_of_a_pure_metal_and_of_a_dielectric_convert_back() {
    let convert = |diffuse: [f64; 4], specular: [f64; 3]| {
        let values = json!({"diffuseFactor": diffuse, "specularFactor": specular, "glossinessFactor": 0.75});
        let scene =
            scene_of(&File::with_material(extension("KHR_materials_pbrSpecularGlossiness", values)).bytes());
        assert!(scene.notes.iter().any(|note| note.contains("converted")));
        let material = &scene.materials[0];
        let [r, g, b, _] = material.base_color_factor;
        [r, g, b, material.metallic_factor, material.roughness_factor]
    };
    super::check_within(
        "metal",
        &convert([0.0, 0.0, 0.0, 1.0], [1.0, 0.7, 0.3]),
        &[1.0, 0.7, 0.3, 1.0, 0.25],
        1e-3,
    );
    let dielectric = convert([0.5, 0.25, 0.1, 1.0], [0.04; 3]);
    super::check_within("dielectric", &dielectric, &[0.5, 0.25, 0.1, 0.0, 0.25], 1e-3);
}
