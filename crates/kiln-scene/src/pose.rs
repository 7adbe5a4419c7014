//! Node hierarchy and skins at the rest pose (glTF 2.0, sections 3.5 and 3.7.3).

use std::collections::BTreeSet;

use glam::{DMat3, DMat4, DQuat, DVec3, DVec4};

use crate::accessor::Data;
use crate::schema::{Node, Root};
use crate::{SceneError, limits};

/// Where every node is, and which ones the scene shows.
#[derive(Debug)]
pub(crate) struct Pose {
    /// Node to world, for every node of the file; joints may lie outside the scene.
    pub worlds: Vec<DMat4>,
    /// Nodes of the scene, depth first; invisible ones (`KHR_node_visibility`) and what hangs on them are absent.
    pub shown: Vec<usize>,
    /// Nodes that are invisible now, but that an animation may show.
    pub hidden: Vec<usize>,
    /// Every node, parents first.
    pub order: Vec<usize>,
    pub parents: Vec<Option<usize>>,
    /// What is worth saying about the choice of the scene.
    pub note: Option<String>,
}

/// Evaluates the hierarchy; an animation sets the visibility of the nodes in `blinking`.
///
/// # Errors
/// Indices out of range, a node with two parents, cycles, transforms that are not finite.
pub(crate) fn pose(root: &Root, blinking: &BTreeSet<usize>) -> Result<Pose, SceneError> {
    let parents = parents(&root.nodes)?;
    let tops: Vec<usize> = (0..root.nodes.len()).filter(|&node| parents[node].is_none()).collect();
    let order = depth_first(&root.nodes, &tops, |_| true);
    if order.len() < root.nodes.len() {
        let reached: BTreeSet<_> = order.iter().collect();
        let lost = (0..root.nodes.len()).find(|node| !reached.contains(node)).unwrap_or(0);
        return Err(SceneError::new(format!("/nodes/{lost}"), "the node is its own ancestor"));
    }
    let mut worlds = vec![DMat4::IDENTITY; root.nodes.len()];
    for &node in &order {
        let local = local_matrix(&root.nodes[node]);
        if !local.is_finite() {
            return Err(SceneError::new(format!("/nodes/{node}"), "the transform is not finite"));
        }
        // No product for a top node: a product with the identity may change the sign of a zero.
        worlds[node] = parents[node].map_or(local, |parent| worlds[parent] * local);
    }
    let (listed, note) = listed_nodes(root, &tops, &parents)?;
    let visible = |node: usize| root.nodes[node].extensions.visibility.is_none_or(|it| it.visible);
    let shown = depth_first(&root.nodes, &listed, visible);
    let may_show = |node: usize| visible(node) || blinking.contains(&node);
    let mut hidden =
        if blinking.is_empty() { Vec::new() } else { depth_first(&root.nodes, &listed, may_show) };
    let seen: BTreeSet<_> = shown.iter().copied().collect();
    hidden.retain(|node| !seen.contains(node));
    Ok(Pose { worlds, shown, hidden, order, parents, note })
}

fn parents(nodes: &[Node]) -> Result<Vec<Option<usize>>, SceneError> {
    let mut parents = vec![None; nodes.len()];
    for (parent, node) in nodes.iter().enumerate() {
        for (at, &child) in node.children.iter().enumerate() {
            let place = || format!("/nodes/{parent}/children/{at}");
            let slot = parents.get_mut(child).ok_or_else(|| missing_node(place(), child, nodes.len()))?;
            if slot.replace(parent).is_some() {
                return Err(SceneError::new(place(), format!("node {child} has two parents")));
            }
        }
    }
    Ok(parents)
}

fn missing_node(place: String, node: usize, count: usize) -> SceneError {
    SceneError::new(place, format!("node {node} does not exist, the file has {count}"))
}

/// Every node has at most one parent, so this visits each once and ends.
fn depth_first(nodes: &[Node], tops: &[usize], enter: impl Fn(usize) -> bool) -> Vec<usize> {
    let mut order = Vec::new();
    let mut stack: Vec<usize> = tops.iter().rev().copied().collect();
    while let Some(node) = stack.pop() {
        if enter(node) {
            order.push(node);
            stack.extend(nodes[node].children.iter().rev());
        }
    }
    order
}

fn listed_nodes(
    root: &Root,
    tops: &[usize],
    parents: &[Option<usize>],
) -> Result<(Vec<usize>, Option<String>), SceneError> {
    let index = root.scene.unwrap_or(0);
    let Some(scene) = root.scenes.get(index) else {
        if root.scene.is_some() {
            let count = root.scenes.len();
            return Err(SceneError::new(
                "/scene",
                format!("scene {index} does not exist, the file has {count}"),
            ));
        }
        let note = (!tops.is_empty()).then(|| "the file has no scene: all its nodes are drawn".to_owned());
        return Ok((tops.to_vec(), note));
    };
    let mut seen = vec![false; root.nodes.len()];
    for (at, &node) in scene.nodes.iter().enumerate() {
        let place = || format!("/scenes/{index}/nodes/{at}");
        let slot = seen.get_mut(node).ok_or_else(|| missing_node(place(), node, root.nodes.len()))?;
        if std::mem::replace(slot, true) {
            return Err(SceneError::new(place(), format!("node {node} is listed twice")));
        }
        if parents[node].is_some() {
            return Err(SceneError::new(place(), format!("node {node} is the child of another node")));
        }
    }
    let others = root.scenes.len() - 1;
    let note = (others > 0).then(|| format!("scene {index} is drawn, {others} more of the file are not"));
    Ok((scene.nodes.clone(), note))
}

/// A node's place relative to its parent.
pub(crate) fn local_matrix(node: &Node) -> DMat4 {
    match &node.matrix {
        Some(columns) => DMat4::from_cols_array(&columns.map(f64::from)),
        None => {
            let translation = DVec3::from_array(node.translation.unwrap_or([0.0; 3]).map(f64::from));
            let scale = DVec3::from_array(node.scale.unwrap_or([1.0; 3]).map(f64::from));
            trs(translation, node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]), scale)
        }
    }
}

/// Rotations are made unit length: exporters round them, and a zero one means none.
pub(crate) fn trs(translation: DVec3, rotation: [f32; 4], scale: DVec3) -> DMat4 {
    let [x, y, z, w] = rotation.map(f64::from);
    let length = (x * x + y * y + z * z + w * w).sqrt();
    let rotation = if length > 0.0 && length.is_finite() {
        DQuat::from_xyzw(x / length, y / length, z / length, w / length)
    } else {
        DQuat::IDENTITY
    };
    DMat4::from_scale_rotation_translation(scale, rotation, translation)
}

/// A skin of the file.
#[derive(Debug)]
pub(crate) struct Binding {
    /// Nodes of the file.
    pub joints: Vec<usize>,
    /// Skin space to joint.
    pub inverse_binds: Vec<DMat4>,
    /// Inverse bind matrices that were no numbers and are the identity now.
    pub odd_count: usize,
}

/// Reads a skin.
///
/// # Errors
/// A skin or joint that does not exist, too many joints, too few inverse bind matrices.
pub(crate) fn binding(data: &Data<'_>, skin: usize, user: &str) -> Result<Binding, SceneError> {
    let (root, node_count) = (data.root, data.root.nodes.len());
    let missing = || {
        let count = root.skins.len();
        SceneError::new(user, format!("skin {skin} does not exist, the file has {count}"))
    };
    let source = root.skins.get(skin).ok_or_else(missing)?;
    let (place, joints, limit) = (format!("/skins/{skin}"), source.joints.clone(), limits::JOINT_COUNT_MAX);
    if joints.len() > limit {
        let reason = format!("{} joints exceed the limit of {limit}", joints.len());
        return Err(SceneError::new(place + "/joints", reason));
    }
    if let Some(at) = joints.iter().position(|&joint| joint >= node_count) {
        return Err(missing_node(format!("{place}/joints/{at}"), joints[at], node_count));
    }
    let mut inverse_binds = match source.inverse_bind_matrices {
        None => vec![DMat4::IDENTITY; joints.len()],
        Some(index) => {
            let count = data.count(index, &place)?;
            if count < joints.len() as u64 || count > limit as u64 {
                let reason = format!("{count} inverse bind matrices for {} joints", joints.len());
                return Err(SceneError::new(place, reason));
            }
            let matrices = data.floats::<16>(index, &place, &["MAT4"], [0.0; 16])?;
            matrices[..joints.len()].iter().map(|columns| affine(&columns.map(f64::from))).collect()
        }
    };
    let odd = inverse_binds.iter_mut().filter(|matrix| !matrix.is_finite());
    let odd_count = odd.map(|matrix| *matrix = DMat4::IDENTITY).count();
    Ok(Binding { joints, inverse_binds, odd_count })
}

impl Binding {
    /// Skin space to world for each joint.
    pub fn matrices(&self, worlds: &[DMat4]) -> Vec<DMat4> {
        let joints = self.joints.iter().zip(&self.inverse_binds);
        joints.map(|(&joint, &inverse_bind)| worlds[joint] * inverse_bind).collect()
    }
}

/// The fourth row is (0, 0, 0, 1) by the specification; exporters leave rounding noise in it.
fn affine(columns: &[f64; 16]) -> DMat4 {
    let mut matrix = DMat4::from_cols_array(columns);
    matrix.x_axis.w = 0.0;
    matrix.y_axis.w = 0.0;
    matrix.z_axis.w = 0.0;
    matrix.w_axis = DVec4::new(matrix.w_axis.x, matrix.w_axis.y, matrix.w_axis.z, 1.0);
    matrix
}

/// Shrunk to a line or a point: there is nothing to draw, but an animation may well let it grow.
pub(crate) fn vanishes(world: DMat4) -> bool {
    let linear = DMat3::from_mat4(world);
    let mut lengths = [linear.x_axis, linear.y_axis, linear.z_axis].map(DVec3::length);
    lengths.sort_by(f64::total_cmp);
    lengths[1] <= 1e-12 * lengths[2]
}

/// Flat as far as single precision can say, whatever the scale.
pub(crate) fn is_singular(world: DMat4) -> bool {
    let linear = DMat3::from_mat4(world);
    let lengths = [linear.x_axis, linear.y_axis, linear.z_axis].map(DVec3::length);
    let (shortest, longest) =
        (lengths.into_iter().fold(f64::INFINITY, f64::min), lengths.into_iter().fold(0.0, f64::max));
    let skew = linear.determinant().abs() / lengths.into_iter().product::<f64>();
    !(shortest > 1e-12 * longest && skew > 1e-6)
}
