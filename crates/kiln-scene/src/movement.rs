//! What animations really move: a curve that holds a value at what it is at rest moves nothing.

use std::collections::{BTreeMap, BTreeSet};

use crate::animate::Motion;
use crate::geometry::has_joints;
use crate::pose::Pose;
use crate::schema::{Node, Root};
use crate::{Curve, Target};

#[derive(Debug, Default)]
pub(crate) struct Movement {
    /// Whether a skin's joints, or what they hang on, move.
    skins: Vec<bool>,
    /// Whether an animation shows or hides the node or what it hangs on; empty if none does anything such.
    blinks: Vec<bool>,
    /// Nodes whose weights change.
    live: BTreeMap<usize, Live>,
}

/// Morph targets of a node's mesh.
#[derive(Debug, Default)]
struct Live {
    /// Those that a weight, at rest or later, calls for.
    targets: Vec<usize>,
    /// Those whose weight changes.
    changing: BTreeSet<usize>,
}

pub(crate) fn movement(root: &Root, pose: &Pose, motion: &Motion) -> Movement {
    let moves = inherited(pose, &moved_nodes(root, motion));
    let blinks = inherited(pose, &motion.blinking());
    let is_moved = |joint: &usize| moves.get(*joint) == Some(&true);
    let skins = root.skins.iter().map(|skin| skin.joints.iter().any(is_moved)).collect();
    Movement { skins, blinks, live: live_targets(root, motion) }
}

impl Movement {
    /// Whether a node's skin is more than a pose. One that stands still is kept below a node that comes and goes,
    /// because only a skin stands still below a node that may move.
    pub fn keeps_skin(&self, node: usize, skin: usize) -> bool {
        self.blinks(node) || self.skins.get(skin) == Some(&true)
    }

    /// Whether an animation shows or hides the node.
    pub fn blinks(&self, node: usize) -> bool {
        self.blinks.get(node) == Some(&true)
    }

    /// Morph targets of a node's mesh that its weights call for; none if no weight changes.
    pub fn live_targets(&self, node: usize) -> &[usize] {
        self.live.get(&node).map_or(&[], |live| &live.targets)
    }

    /// Whether the weight of any of these targets changes.
    pub fn changes_any(&self, node: usize, targets: &[usize]) -> bool {
        self.live.get(&node).is_some_and(|live| targets.iter().any(|it| live.changing.contains(it)))
    }

    /// Joints of the skins that are kept.
    pub fn joints(&self, root: &Root, pose: &Pose) -> BTreeSet<usize> {
        let mut skins = BTreeSet::new();
        for &node in pose.shown.iter().chain(&pose.hidden) {
            let source = &root.nodes[node];
            let jointed = source.mesh.and_then(|mesh| root.meshes.get(mesh));
            let jointed = jointed.is_some_and(|mesh| mesh.primitives.iter().any(has_joints));
            skins.extend(source.skin.filter(|&skin| jointed && self.keeps_skin(node, skin)));
        }
        let joints = skins.into_iter().filter_map(|skin| root.skins.get(skin)).flat_map(|skin| &skin.joints);
        joints.copied().filter(|&joint| joint < root.nodes.len()).collect()
    }
}

/// Rest weights of a node's mesh, whose own they are unless the node has some.
pub(crate) fn rest_weights<'a>(root: &'a Root, node: &'a Node) -> &'a [f32] {
    let of_mesh = || node.mesh.and_then(|mesh| root.meshes.get(mesh)).map(|mesh| &mesh.weights);
    node.weights.as_ref().or_else(of_mesh).map_or(&[], Vec::as_slice)
}

/// Which nodes are in `chosen` or hang on one that is; empty for none.
fn inherited(pose: &Pose, chosen: &BTreeSet<usize>) -> Vec<bool> {
    if chosen.is_empty() {
        return Vec::new();
    }
    let mut found = vec![false; pose.parents.len()];
    for &node in &pose.order {
        found[node] = chosen.contains(&node) || pose.parents[node].is_some_and(|parent| found[parent]);
    }
    found
}

fn moved_nodes(root: &Root, motion: &Motion) -> BTreeSet<usize> {
    let moved = |(target, curve): (Target, &Curve)| {
        let (node, departs) = match target {
            Target::Translation { node } => {
                (node, curve.departs_from(&root.nodes[node].translation.unwrap_or([0.0; 3])))
            }
            Target::Rotation { node } => {
                (node, curve.departs_from(&root.nodes[node].rotation.unwrap_or([0.0, 0.0, 0.0, 1.0])))
            }
            Target::Scale { node } => (node, curve.departs_from(&root.nodes[node].scale.unwrap_or([1.0; 3]))),
            _ => return None,
        };
        departs.then_some(node)
    };
    motion.targets().filter_map(moved).collect()
}

fn live_targets(root: &Root, motion: &Motion) -> BTreeMap<usize, Live> {
    let mut found: BTreeMap<usize, Live> = BTreeMap::new();
    for (target, curve) in motion.targets() {
        // The file's channels name nodes.
        let Target::Weights { morph: node } = target else { continue };
        let live = found.entry(node).or_default();
        let rest = rest_weights(root, &root.nodes[node]);
        let rest = |at: usize| rest.get(at).copied().unwrap_or(0.0);
        let ranges = curve.range();
        let nonzero = |at: usize| rest(at) != 0.0 || ranges.get(at).is_some_and(|it| *it != [0.0; 2]);
        let count = ranges.len().max(rest_weights(root, &root.nodes[node]).len());
        live.targets.extend((0..count).filter(|&at| nonzero(at)));
        live.changing.extend((0..ranges.len()).filter(|&at| ranges[at] != [rest(at); 2]));
    }
    found.retain(|_, live| !live.changing.is_empty());
    for live in found.values_mut() {
        live.targets.sort_unstable();
        live.targets.dedup();
    }
    found
}
