//! Which glTF extensions are known, and what is said about the others.

use crate::schema::{Material, Root};
use crate::{SceneError, SpecularGlossinessAs};

/// Drawn, or harmless to a picture. Formats of textures that are absent may have a fallback that is drawn: a file
/// that requires them has none.
const SUPPORTED: &[&str] = &[
    "EXT_mesh_gpu_instancing",
    "EXT_texture_webp",
    "KHR_animation_pointer",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_node_visibility",
    "KHR_texture_transform",
    // Metadata: nothing to draw.
    "EXT_mesh_features",
    "EXT_mesh_manifold",
    "EXT_structural_metadata",
    "FB_ngon_encoding",
    "KHR_xmp",
    "KHR_xmp_json_ld",
];

/// Noted by value where a drawn material has them, see [`material_notes`]; or where data is missing.
const NOTED_ELSEWHERE: &[&str] = &[
    "EXT_meshopt_compression",
    "KHR_draco_mesh_compression",
    "KHR_meshopt_compression",
    "KHR_texture_basisu",
];

/// Refuses a file that cannot be drawn right without an extension that is not known.
///
/// # Errors
/// The first required extension that is not supported, by name.
pub(crate) fn check_required(root: &Root) -> Result<(), SceneError> {
    let unknown = root.extensions_required.iter().position(|name| !SUPPORTED.contains(&name.as_str()));
    let Some(at) = unknown else { return Ok(()) };
    let name = &root.extensions_required[at];
    let help = if name.contains("draco") || name.contains("meshopt") {
        "export the file without mesh compression"
    } else if name.contains("texture") {
        "export the textures as PNG or JPEG"
    } else {
        "export the file without this extension"
    };
    let reason = format!("the file requires the extension {name}, which is not supported");
    Err(SceneError::new(format!("/extensionsRequired/{at}"), reason).with_help(help))
}

/// Sentences about the file as a whole.
pub(crate) fn file_notes(root: &Root) -> Vec<String> {
    let is_unknown =
        |name: &&String| !SUPPORTED.contains(&name.as_str()) && !NOTED_ELSEWHERE.contains(&name.as_str());
    let unknown = root.extensions_used.iter().filter(is_unknown);
    unknown.map(|name| format!("the extension {name} is not supported and was ignored")).collect()
}

/// What a drawn material asks for and does not get as the specification says.
pub(crate) fn material_notes(
    name: &str,
    material: &Material,
    specular_glossiness: SpecularGlossinessAs,
) -> Vec<String> {
    let ext = &material.extensions;
    if ext.unlit.is_some() || ext.specular_glossiness.is_none() {
        return Vec::new();
    }
    let model = match specular_glossiness {
        SpecularGlossinessAs::MetallicRoughness => "metallic-roughness",
        SpecularGlossinessAs::Specular => "KHR_materials_specular",
    };
    vec![format!("material `{name}`: specular-glossiness was converted to {model}")]
}
