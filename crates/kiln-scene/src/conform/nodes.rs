//! Nodes and what hangs on them: transforms, skins, cameras, lights.

use std::collections::BTreeSet;

use glam::{DMat3, DMat4};

use super::Findings;
use super::storage::Claims;
use crate::accessor::Data;
use crate::json::Json;

/// How far the axes of a matrix may be from a right angle, as a cosine, and a quaternion from length 1.
const TRS_TOLERANCE: f64 = 5e-3;

pub(super) fn check(root: &Json<'_>, data: &Data<'_>, findings: &mut Findings) {
    let parents = parents(root);
    for (at, node) in root.table("nodes").iter().enumerate() {
        check_transform(node, at, findings);
        check_mesh(root, node, at, findings);
    }
    let tops = tops(&parents);
    check_skinned_nodes(root, &tops, findings);
    for (at, scene) in root.table("scenes").iter().enumerate() {
        for (entry, node) in scene.table("nodes").iter().enumerate() {
            if node.index().is_some_and(|node| parents.get(node).copied().flatten().is_some()) {
                findings.push(format!("/scenes/{at}/nodes/{entry}"), "the node is the child of another");
            }
        }
    }
    for (at, skin) in root.table("skins").iter().enumerate() {
        check_skin(root, data, skin, at, &tops, findings);
    }
    for (at, camera) in root.table("cameras").iter().enumerate() {
        check_camera(camera, at, findings);
    }
    let lights = root.get("extensions").and_then(|it| it.get("KHR_lights_punctual"));
    for (at, light) in lights.map_or(&[][..], |it| it.table("lights")).iter().enumerate() {
        check_light(light, at, findings);
    }
}

fn parents(root: &Json<'_>) -> Vec<Option<usize>> {
    let nodes = root.table("nodes");
    let mut parents = vec![None; nodes.len()];
    for (parent, node) in nodes.iter().enumerate() {
        for child in node.table("children").iter().filter_map(Json::index).filter(|&it| it < nodes.len()) {
            parents[child] = Some(parent);
        }
    }
    parents
}

/// Each node's oldest ancestor. The hierarchy was found to be a forest before.
fn tops(parents: &[Option<usize>]) -> Vec<usize> {
    let mut tops: Vec<Option<usize>> =
        parents.iter().enumerate().map(|(at, it)| it.is_none().then_some(at)).collect();
    for node in 0..parents.len() {
        let climb =
            || std::iter::successors(Some(node), |&at| if tops[at].is_some() { None } else { parents[at] });
        let path: Vec<usize> = climb().collect();
        let top = path.last().and_then(|&last| tops[last]);
        path.into_iter().for_each(|at| tops[at] = top);
    }
    tops.into_iter().enumerate().map(|(at, top)| top.unwrap_or(at)).collect()
}

fn numbers<const N: usize>(value: Option<&Json<'_>>) -> Option<[f64; N]> {
    let list: Vec<f64> = value?.list().iter().filter_map(Json::number).collect();
    list.try_into().ok()
}

fn check_transform(node: &Json<'_>, at: usize, findings: &mut Findings) {
    if let Some(rotation) = numbers::<4>(node.get("rotation")) {
        let length = rotation.iter().map(|value| value * value).sum::<f64>().sqrt();
        if (length - 1.0).abs() > TRS_TOLERANCE {
            let reason = format!("a rotation must have length 1, not {length}; it was scaled");
            findings.push(format!("/nodes/{at}/rotation"), reason);
        }
    }
    if let Some(matrix) = numbers::<16>(node.get("matrix"))
        && !is_trs(&DMat4::from_cols_array(&matrix))
    {
        let reason = "the matrix is no translation, rotation and scale; it was applied as it is";
        findings.push(format!("/nodes/{at}/matrix"), reason);
    }
}

fn is_trs(matrix: &DMat4) -> bool {
    let linear = DMat3::from_mat4(*matrix);
    let [x, y, z] = [linear.x_axis, linear.y_axis, linear.z_axis].map(|axis| axis.normalize_or_zero());
    let square = [x.dot(y), y.dot(z), z.dot(x)].iter().all(|cosine| cosine.abs() <= TRS_TOLERANCE);
    let last_row = [matrix.x_axis.w, matrix.y_axis.w, matrix.z_axis.w, matrix.w_axis.w];
    square && linear.determinant() != 0.0 && last_row == [0.0, 0.0, 0.0, 1.0]
}

fn check_mesh(root: &Json<'_>, node: &Json<'_>, at: usize, findings: &mut Findings) {
    let mesh = node.index_at("mesh").and_then(|mesh| root.table("meshes").get(mesh));
    let Some(first) = mesh.and_then(|mesh| mesh.table("primitives").first()) else { return };
    let targets = first.table("targets").len();
    let weights = node.get("weights").map(|weights| weights.list().len());
    if let Some(count) = weights.filter(|&count| count != targets) {
        let reason = format!("{count} weights for {targets} morph targets; the rest counts as 0");
        findings.push(format!("/nodes/{at}/weights"), reason);
    }
    let jointed = first.get("attributes").is_some_and(|it| it.get("JOINTS_0").is_some());
    if node.get("skin").is_some() && !jointed {
        findings.push(format!("/nodes/{at}/skin"), "its mesh has no joints; it stays as modelled");
    }
}

/// The scene that is drawn must hold the joints of the skins that it shows.
fn check_skinned_nodes(root: &Json<'_>, tops: &[usize], findings: &mut Findings) {
    let Some(scene) = root.table("scenes").get(root.index_at("scene").unwrap_or(0)) else { return };
    let shown: BTreeSet<usize> = scene.table("nodes").iter().filter_map(Json::index).collect();
    let is_shown = |node: usize| tops.get(node).is_some_and(|top| shown.contains(top));
    let whole = |skin: &Json<'_>| skin.table("joints").iter().filter_map(Json::index).all(is_shown);
    let whole: Vec<bool> = root.table("skins").iter().map(whole).collect();
    for (at, node) in root.table("nodes").iter().enumerate().filter(|(at, _)| is_shown(*at)) {
        if node.index_at("skin").and_then(|skin| whole.get(skin)) == Some(&false) {
            let reason = "its skin's joints are not in the same scene; they count where they stand";
            findings.push(format!("/nodes/{at}/skin"), reason);
        }
    }
}

fn check_skin(
    root: &Json<'_>,
    data: &Data<'_>,
    skin: &Json<'_>,
    at: usize,
    tops: &[usize],
    findings: &mut Findings,
) {
    let place = format!("/skins/{at}");
    let joints: Vec<usize> = skin.table("joints").iter().filter_map(Json::index).collect();
    let roots: BTreeSet<&usize> = joints.iter().filter_map(|&joint| tops.get(joint)).collect();
    if roots.len() > 1 {
        findings
            .push(format!("{place}/joints"), "the joints have no common root; each counts where it stands");
    }
    let Some(index) = skin.index_at("inverseBindMatrices") else { return };
    let Some(claims) = Claims::of(root, index) else { return };
    let place = format!("{place}/inverseBindMatrices");
    if claims.kind != "MAT4" || claims.component_type != 5126 || claims.normalized {
        findings.push(place, format!("{} is no format of matrices", claims.format()));
        return;
    }
    if claims.stride(root).is_some() {
        findings.push(place.clone(), "its buffer view has a stride, which it must not have; it was followed");
    }
    if claims.count < joints.len() {
        findings.push(place.clone(), format!("{} matrices for {} joints", claims.count, joints.len()));
    }
    if claims.view.is_none() {
        return;
    }
    let Ok(matrices) = data.floats::<16>(index, &place, &["MAT4"], [0.0; 16]) else { return };
    let skewed = |m: &&[f32; 16]| [m[3], m[7], m[11], m[15]] != [0.0, 0.0, 0.0, 1.0];
    let count = matrices.iter().filter(skewed).count();
    if count > 0 {
        findings.push(place, format!("the last row of {count} matrices is not 0 0 0 1; it was made so"));
    }
}

fn check_camera(camera: &Json<'_>, at: usize, findings: &mut Findings) {
    for kind in ["perspective", "orthographic"] {
        let Some(lens) = camera.get(kind) else { continue };
        let place = format!("/cameras/{at}/{kind}");
        let number = |name: &str| lens.get(name).and_then(Json::number);
        if let (Some(near), Some(far)) = (number("znear"), number("zfar"))
            && far <= near
        {
            findings.push(place.clone(), format!("`zfar` {far} must be more than `znear` {near}"));
        }
        for name in ["xmag", "ymag"].into_iter().filter(|name| number(name) == Some(0.0)) {
            findings.push(format!("{place}/{name}"), "it must not be 0");
        }
    }
    let kind = camera.get("type").and_then(Json::text);
    if let Some(kind) = kind.filter(|kind| camera.get(kind).is_none()) {
        findings.push(format!("/cameras/{at}"), format!("`{kind}` is missing"));
    }
}

fn check_light(light: &Json<'_>, at: usize, findings: &mut Findings) {
    let place = format!("/extensions/KHR_lights_punctual/lights/{at}");
    let Some(spot) = light.get("spot") else {
        if light.get("type").and_then(Json::text) == Some("spot") {
            findings.push(place, "`spot` is missing; the default cone is taken");
        }
        return;
    };
    let angle = |name: &str, default| spot.get(name).and_then(Json::number).unwrap_or(default);
    let (inner, outer) = (angle("innerConeAngle", 0.0), angle("outerConeAngle", std::f64::consts::FRAC_PI_4));
    if outer <= inner {
        let reason = format!("the outer cone {outer} must be wider than the inner {inner}");
        findings.push(format!("{place}/spot/outerConeAngle"), reason);
    }
}
