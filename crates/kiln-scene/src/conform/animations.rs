//! Animations: channels, samplers, times and rotations.

use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};

use super::Findings;
use super::storage::Claims;
use crate::accessor::Data;
use crate::json::Json;

const FLOAT: u32 = 5126;
/// Quantised rotations are this far from length 1.
const UNIT_TOLERANCE: f32 = 1e-2;
/// Keys that are looked at, over all samplers; bounds the time a file can take.
const KEY_COUNT_MAX: usize = 1 << 24;

pub(super) fn check(root: &Json<'_>, data: &Data<'_>, findings: &mut Findings) {
    let mut keys_left = KEY_COUNT_MAX;
    let mut seen_inputs = BTreeSet::new();
    for (at, animation) in root.table("animations").iter().enumerate() {
        let place = format!("/animations/{at}");
        for (at, sampler) in animation.table("samplers").iter().enumerate() {
            let place = format!("{place}/samplers/{at}");
            let Some(index) = check_input(root, sampler, &place, findings) else { continue };
            // Zeros without a buffer view stand for data that an extension brings.
            let claims = Claims::of(root, index).filter(|claims| claims.view.is_some());
            let Some(count) = claims.map(|claims| claims.count) else { continue };
            if seen_inputs.insert(index) && count <= keys_left {
                keys_left -= count;
                check_times(data, index, &format!("{place}/input"), findings);
            }
        }
        let mut targets = BTreeMap::new();
        for (at, channel) in animation.table("channels").iter().enumerate() {
            let place = format!("{place}/channels/{at}");
            check_channel(root, channel, &place, &mut targets, findings);
            let Some(sampler) = sampler_of(animation, channel, &place, findings) else { continue };
            check_output(root, data, sampler, channel, (&place, &mut keys_left), findings);
        }
    }
}

fn check_input(root: &Json<'_>, sampler: &Json<'_>, place: &str, findings: &mut Findings) -> Option<usize> {
    for name in ["input", "output"] {
        let claims = sampler.index_at(name).and_then(|index| Claims::of(root, index));
        if claims.is_some_and(|claims| claims.stride(root).is_some()) {
            findings.push(format!("{place}/{name}"), "its buffer view has a stride, which it must not have");
        }
    }
    let index = sampler.index_at("input")?;
    let claims = Claims::of(root, index)?;
    let place = format!("{place}/input");
    if claims.json.get("min").is_none() || claims.json.get("max").is_none() {
        findings.push(place.clone(), "it lacks `min` or `max`; the keys themselves say how long it is");
    }
    let cubic = sampler.get("interpolation").and_then(Json::text) == Some("CUBICSPLINE");
    if cubic && claims.count < 2 {
        findings.push(place.clone(), "a cubic spline needs at least 2 keys");
    }
    if claims.kind != "SCALAR" || claims.component_type != FLOAT {
        findings.push(place, format!("{} is no format of times", claims.format()));
        return None;
    }
    Some(index)
}

fn check_times(data: &Data<'_>, index: usize, place: &str, findings: &mut Findings) {
    let Ok(times) = data.floats::<1>(index, place, &["SCALAR"], [0.0]) else { return };
    if times.iter().any(|time| time[0].is_nan() || time[0] < 0.0) {
        findings.push(place, "times must not be negative");
    }
    let unordered = times
        .windows(2)
        .filter(|pair| pair[1][0].partial_cmp(&pair[0][0]) != Some(Ordering::Greater))
        .count();
    if unordered > 0 {
        findings.push(place, format!("{unordered} times are not after the one before"));
    }
}

fn check_channel(
    root: &Json<'_>,
    channel: &Json<'_>,
    place: &str,
    targets: &mut BTreeMap<(usize, String), String>,
    findings: &mut Findings,
) {
    let Some(target) = channel.get("target") else { return };
    let place = format!("{place}/target");
    let path = target.get("path").and_then(Json::text).unwrap_or_default();
    if let Some(pointer) = target.get("extensions").and_then(|it| it.get("KHR_animation_pointer")) {
        check_pointer(target, pointer, path, &place, findings);
        return;
    }
    let Some(index) = target.index_at("node") else { return };
    if let Some(first) = targets.insert((index, path.to_owned()), place.clone()) {
        findings.push(first, format!("{place} is the same target"));
    }
    let Some(node) = root.table("nodes").get(index) else { return };
    match path {
        "translation" | "rotation" | "scale" if node.get("matrix").is_some() => {
            findings.push(place, format!("node {index} has a matrix, which has no {path}"));
        }
        "weights" => {
            let mesh = node.index_at("mesh").and_then(|mesh| root.table("meshes").get(mesh));
            let primitive = mesh.and_then(|mesh| mesh.table("primitives").first());
            if primitive.is_none_or(|primitive| primitive.table("targets").is_empty()) {
                findings.push(place, format!("node {index} has no morph targets"));
            }
        }
        "translation" | "rotation" | "scale" => {}
        _ => findings.push(format!("{place}/path"), format!("nodes have no `{path}`")),
    }
}

fn check_pointer(target: &Json<'_>, pointer: &Json<'_>, path: &str, place: &str, findings: &mut Findings) {
    let place = format!("{place}/extensions/KHR_animation_pointer");
    if target.get("node").is_some() {
        findings.push(place.clone(), "a pointer and a `node` are two targets");
    }
    if path != "pointer" {
        findings.push(place.clone(), format!("`path` must be `pointer`, not `{path}`"));
    }
    let well_formed = |text: &str| {
        let escaped = text.split('~').skip(1).all(|rest| rest.starts_with(['0', '1']));
        text.starts_with('/') && escaped
    };
    let text = pointer.get("pointer").and_then(Json::text);
    if let Some(text) = text.filter(|text| !well_formed(text)) {
        findings.push(format!("{place}/pointer"), format!("`{text}` is no JSON pointer"));
    }
}

fn sampler_of<'a, 'b>(
    animation: &'a Json<'b>,
    channel: &Json<'b>,
    place: &str,
    findings: &mut Findings,
) -> Option<&'a Json<'b>> {
    let index = channel.index_at("sampler")?;
    let sampler = animation.table("samplers").get(index);
    if sampler.is_none() {
        findings.push(format!("{place}/sampler"), format!("sampler {index} does not exist"));
    }
    sampler
}

fn check_output(
    root: &Json<'_>,
    data: &Data<'_>,
    sampler: &Json<'_>,
    channel: &Json<'_>,
    (place, keys_left): (&str, &mut usize),
    findings: &mut Findings,
) {
    let claims = |name: &str| sampler.index_at(name).and_then(|index| Claims::of(root, index));
    let (Some(input), Some(output)) = (claims("input"), claims("output")) else { return };
    let Some(target) = channel.get("target") else { return };
    let place = format!("{place}/sampler");
    let path = target.get("path").and_then(Json::text).unwrap_or_default();
    let fits = match path {
        "translation" | "scale" => output.kind == "VEC3" && output.component_type == FLOAT,
        "rotation" => output.kind == "VEC4" && (output.component_type == FLOAT || output.normalized),
        "weights" => output.kind == "SCALAR" && (output.component_type == FLOAT || output.normalized),
        _ => return,
    };
    if !fits {
        findings.push(place, format!("{} is no format of `{path}`", output.format()));
        return;
    }
    let cubic = sampler.get("interpolation").and_then(Json::text) == Some("CUBICSPLINE");
    let each = if cubic { 3 } else { 1 };
    let node = target.index_at("node").and_then(|node| root.table("nodes").get(node));
    let mesh = node.and_then(|node| node.index_at("mesh")).and_then(|mesh| root.table("meshes").get(mesh));
    let morphs = mesh.and_then(|mesh| mesh.table("primitives").first()).map(|it| it.table("targets").len());
    let width = if path == "weights" { morphs.unwrap_or(0) } else { 1 };
    let wanted = input.count.saturating_mul(each * width);
    if width > 0 && output.count != wanted {
        let reason = format!("{} values for {} keys, {wanted} are wanted", output.count, input.count);
        findings.push(place, reason);
        return;
    }
    if path == "rotation" && output.view.is_some() && output.count <= *keys_left {
        *keys_left -= output.count;
        let Some(index) = sampler.index_at("output") else { return };
        check_rotations(data, index, cubic, &place, findings);
    }
}

/// The middle one of three values of a cubic spline is a rotation; the others are tangents.
fn check_rotations(data: &Data<'_>, index: usize, cubic: bool, place: &str, findings: &mut Findings) {
    let Ok(values) = data.floats::<4>(index, place, &["VEC4"], [0.0; 4]) else { return };
    let (first, step) = if cubic { (1, 3) } else { (0, 1) };
    let length = |value: &[f32; 4]| value.iter().map(|it| it * it).sum::<f32>().sqrt();
    let is_far = |length: f32| length.is_nan() || (length - 1.0).abs() > UNIT_TOLERANCE;
    let broken = values.iter().skip(first).step_by(step);
    let count = broken.filter(|value| is_far(length(value))).count();
    if count > 0 {
        findings.push(place, format!("{count} rotations do not have length 1"));
    }
}
