//! Meshes: names, formats and lengths of attributes, morph targets and indices.

use std::collections::BTreeMap;

use super::storage::Claims;
use super::{Findings, Used};
use crate::json::Json;

/// Most textures of one material that are looked at.
const TEXTURE_COUNT_MAX: usize = 64;

/// What all meshes are compared with.
struct File<'a> {
    root: &'a Json<'a>,
    materials: Vec<Wants>,
    quantized: bool,
}

/// What a material wants of attributes.
struct Wants {
    /// Paths of its textures and the set that each reads.
    sets: Vec<(String, usize)>,
    /// Directions that no normal texture defines.
    tangents: bool,
}

impl Wants {
    fn of(material: &Json<'_>) -> Self {
        let mut sets = Vec::new();
        texture_sets(material, "", 0, &mut sets);
        let extension = |name| material.get("extensions").and_then(|it| it.get(name));
        let coat = extension("KHR_materials_clearcoat").and_then(|it| it.get("clearcoatNormalTexture"));
        let bent = coat.is_some() || extension("KHR_materials_anisotropy").is_some();
        Wants { sets, tangents: bent && material.get("normalTexture").is_none() }
    }
}

const BYTE: u32 = 5120;
const UNSIGNED_BYTE: u32 = 5121;
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;
const FLOAT: u32 = 5126;

pub(super) fn check(root: &Json<'_>, used: &Used<'_>, findings: &mut Findings) {
    let materials = root.table("materials").iter().map(Wants::of).collect();
    let file = File { root, materials, quantized: used.contains("KHR_mesh_quantization") };
    for (mesh, source) in root.table("meshes").iter().enumerate() {
        let primitives = source.table("primitives");
        let targets = primitives.first().map_or(0, |first| first.table("targets").len());
        for (at, primitive) in primitives.iter().enumerate() {
            let place = format!("/meshes/{mesh}/primitives/{at}");
            if primitive.table("targets").len() != targets {
                let reason = format!("the mesh's first primitive has {targets} morph targets");
                findings.push(format!("{place}/targets"), reason);
            }
            check_primitive(&file, primitive, &place, findings);
        }
        let weights = source.get("weights").map(|weights| weights.list().len());
        if let Some(count) = weights.filter(|&count| count != targets) {
            let reason = format!("{count} weights for {targets} morph targets; the rest counts as 0");
            findings.push(format!("/meshes/{mesh}/weights"), reason);
        }
    }
}

fn check_primitive(file: &File<'_>, primitive: &Json<'_>, place: &str, findings: &mut Findings) {
    let Some(attributes) = primitive.get("attributes") else { return };
    let root = file.root;
    let base = attributes.index_at("POSITION").and_then(|index| Claims::of(root, index));
    let mut views = BTreeMap::new();
    for (name, index) in attributes.members() {
        let place = format!("{place}/attributes/{}", escape(name));
        check_name(name, &place, findings);
        let Some(claims) = index.index().and_then(|index| Claims::of(root, index)) else { continue };
        check_format(file, name, &claims, &place, findings);
        if let Some(base) = base.filter(|base| base.count != claims.count) {
            findings.push(place.clone(), format!("{} elements for {} vertices", claims.count, base.count));
        }
        if let Some(view) = claims.view.filter(|_| claims.stride(root).is_none())
            && views.insert(view, index.index()).is_some_and(|other| other != index.index())
        {
            findings.push(place, "it shares a buffer view without a stride; read without gaps");
        }
    }
    check_sets(attributes, place, findings);
    check_indices(root, primitive, place, findings);
    for (at, target) in primitive.table("targets").iter().enumerate() {
        for (name, index) in target.members() {
            let place = format!("{place}/targets/{at}/{}", escape(name));
            check_target(root, attributes, name, index, (&place, base.as_ref()), findings);
        }
    }
    check_material(file, primitive, attributes, place, findings);
}

fn escape(name: &str) -> String {
    name.replace('~', "~0").replace('/', "~1")
}

/// Name without the number of its set, and the number.
fn split_set(name: &str) -> (&str, Option<&str>) {
    match name.rsplit_once('_') {
        Some((stem, set)) if ["TEXCOORD", "COLOR", "JOINTS", "WEIGHTS"].contains(&stem) => (stem, Some(set)),
        _ => (name, None),
    }
}

fn check_name(name: &str, place: &str, findings: &mut Findings) {
    let (stem, set) = split_set(name);
    let known = match set {
        Some(set) => set.parse::<usize>().is_ok_and(|number| number.to_string() == set),
        None => stem.starts_with('_') || ["POSITION", "NORMAL", "TANGENT"].contains(&stem),
    };
    if !known {
        findings.push(place, "glTF has no such attribute; it was ignored");
    }
}

/// Sets are numbered from 0 without gaps, and joints come with weights.
fn check_sets(attributes: &Json<'_>, place: &str, findings: &mut Findings) {
    let count =
        |wanted: &str| attributes.members().iter().filter(|(name, _)| split_set(name).0 == wanted).count();
    for stem in ["TEXCOORD", "COLOR", "JOINTS", "WEIGHTS"] {
        let gap = (0..count(stem)).find(|set| attributes.get(&format!("{stem}_{set}")).is_none());
        if let Some(set) = gap {
            findings.push(format!("{place}/attributes"), format!("{stem}_{set} is missing before others"));
        }
    }
    let (joints, weights) = (count("JOINTS"), count("WEIGHTS"));
    if joints != weights {
        let reason = format!("{joints} sets of joints for {weights} of weights; the rest was ignored");
        findings.push(format!("{place}/attributes"), reason);
    }
}

fn check_format(file: &File<'_>, name: &str, claims: &Claims<'_>, place: &str, findings: &mut Findings) {
    let (root, quantized) = (file.root, file.quantized);
    let (stem, code, normal) = (split_set(name).0, claims.component_type, claims.normalized);
    let narrow = matches!(code, UNSIGNED_BYTE | UNSIGNED_SHORT);
    let fits = match stem {
        "POSITION" => claims.kind == "VEC3" && (code == FLOAT || quantized && code != UNSIGNED_INT),
        "NORMAL" => claims.kind == "VEC3" && (code == FLOAT || quantized && normal && !narrow),
        "TANGENT" => claims.kind == "VEC4" && (code == FLOAT || quantized && normal && !narrow),
        "TEXCOORD" => {
            claims.kind == "VEC2" && (code == FLOAT || narrow && normal || quantized && code >= BYTE)
        }
        "COLOR" => ["VEC3", "VEC4"].contains(&claims.kind) && (code == FLOAT || narrow && normal),
        "JOINTS" => claims.kind == "VEC4" && narrow && !normal,
        "WEIGHTS" => claims.kind == "VEC4" && (code == FLOAT || narrow && normal),
        _ => code != UNSIGNED_INT,
    };
    if !fits {
        findings.push(place, format!("{} is no format of {stem}", claims.format()));
    }
    let stride = claims.stride(root).unwrap_or(0);
    if claims.view.is_some() && (!claims.total_offset(root).is_multiple_of(4) || !stride.is_multiple_of(4)) {
        findings.push(place, "vertex data must lie at multiples of 4 bytes; read as it is");
    }
    let no_stride = claims.stride(root).is_none() && claims.view.is_some();
    let components = claims.kind.strip_prefix("VEC").and_then(|count| count.parse().ok()).unwrap_or(1);
    if no_stride && !(claims.component_bytes() * components).is_multiple_of(4) {
        findings.push(place, "elements must lie at multiples of 4 bytes; read without gaps");
    }
    if name == "POSITION" && (claims.json.get("min").is_none() || claims.json.get("max").is_none()) {
        findings.push(place, "it lacks `min` or `max`; its bounds were computed");
    }
}

fn check_indices(root: &Json<'_>, primitive: &Json<'_>, place: &str, findings: &mut Findings) {
    let Some(claims) = primitive.index_at("indices").and_then(|index| Claims::of(root, index)) else {
        return;
    };
    let place = format!("{place}/indices");
    let unsigned = matches!(claims.component_type, UNSIGNED_BYTE | UNSIGNED_SHORT | UNSIGNED_INT);
    if claims.kind != "SCALAR" || !unsigned || claims.normalized {
        findings.push(place.clone(), format!("{} is no format of indices", claims.format()));
    }
    if claims.stride(root).is_some() {
        findings.push(place, "its buffer view has a stride, which indices must not have; it was followed");
    }
}

fn check_target(
    root: &Json<'_>,
    attributes: &Json<'_>,
    name: &str,
    index: &Json<'_>,
    (place, base): (&str, Option<&Claims<'_>>),
    findings: &mut Findings,
) {
    check_name(name, place, findings);
    if attributes.get(name).is_none() {
        findings.push(place, format!("the primitive has no {name} to add it to; it was ignored"));
    }
    let Some(claims) = index.index().and_then(|index| Claims::of(root, index)) else { return };
    if let Some(base) = base.filter(|base| base.count != claims.count) {
        findings.push(place, format!("{} elements for {} vertices", claims.count, base.count));
    }
    if name == "POSITION" && (claims.json.get("min").is_none() || claims.json.get("max").is_none()) {
        findings.push(place, "it lacks `min` or `max`; its bounds were computed");
    }
}

fn check_material(
    file: &File<'_>,
    primitive: &Json<'_>,
    attributes: &Json<'_>,
    place: &str,
    findings: &mut Findings,
) {
    let Some(wants) = primitive.index_at("material").and_then(|at| file.materials.get(at)) else { return };
    for (path, set) in &wants.sets {
        if attributes.get(&format!("TEXCOORD_{set}")).is_none() {
            let reason = format!("{path} wants TEXCOORD_{set}, which is missing; 0 is read");
            findings.push(format!("{place}/material"), reason);
        }
    }
    if wants.tangents && attributes.get("TANGENT").is_none() {
        let reason = "it wants tangents, which are missing; they follow the texture coordinates";
        findings.push(format!("{place}/material"), reason);
    }
}

fn texture_sets(value: &Json<'_>, path: &str, depth: usize, sets: &mut Vec<(String, usize)>) {
    for (name, value) in value.members().iter().filter(|_| depth < 4) {
        let path = format!("{path}/{name}");
        if name.ends_with("Texture") && value.get("index").is_some() && sets.len() < TEXTURE_COUNT_MAX {
            let moved = value.get("extensions").and_then(|it| it.get("KHR_texture_transform"));
            let moved = moved.and_then(|it| it.index_at("texCoord"));
            sets.push((path, moved.or(value.index_at("texCoord")).unwrap_or(0)));
        } else if name != "extras" {
            texture_sets(value, &path, depth + 1, sets);
        }
    }
}
