//! Node hierarchy and skins at the rest pose (glTF 2.0, sections 3.5 and 3.7.3).

use std::collections::BTreeSet;

use glam::{DMat4, DQuat, DVec3, DVec4};

use crate::SceneError;
use crate::accessor::Data;
use crate::schema::{Node, Root};

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

/// Skin space to world for each joint of a skin.
///
/// # Errors
/// A skin or joint that does not exist, too few inverse bind matrices.
pub(crate) fn joint_matrices(
    data: &Data<'_>,
    worlds: &[DMat4],
    skin: usize,
    user: &str,
) -> Result<Vec<DMat4>, SceneError> {
    let count = data.root.skins.len();
    let found = data.root.skins.get(skin);
    let skin_data = found
        .ok_or_else(|| SceneError::new(user, format!("skin {skin} does not exist, the file has {count}")))?;
    let place = format!("/skins/{skin}");
    let inverse_binds = match skin_data.inverse_bind_matrices {
        Some(index) => {
            let matrices = data.floats::<16>(index, &place, &["MAT4"], [0.0; 16])?;
            matrices.iter().map(|columns| affine(&columns.map(f64::from))).collect()
        }
        None => vec![DMat4::IDENTITY; skin_data.joints.len()],
    };
    if inverse_binds.len() < skin_data.joints.len() {
        let (have, want) = (inverse_binds.len(), skin_data.joints.len());
        return Err(SceneError::new(place, format!("{have} inverse bind matrices for {want} joints")));
    }
    let joints = skin_data.joints.iter().zip(inverse_binds).enumerate();
    joints
        .map(|(at, (&joint, inverse_bind))| {
            let world = worlds.get(joint);
            let place = || format!("{place}/joints/{at}");
            Ok(*world.ok_or_else(|| missing_node(place(), joint, worlds.len()))? * inverse_bind)
        })
        .collect()
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
