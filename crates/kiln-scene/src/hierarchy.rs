//! The nodes that a moving scene keeps. A scene at rest needs none: its draws stand in the world.
//!
//! Kept are the nodes that channels name, joints of skins that move, and what those hang on. Everything between a
//! node that channels name and a draw is one matrix, so that a pack, where the draw is that node's child, comes out as
//! the same pack again.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DMat4, Mat4};

use crate::pose::{Pose, local_matrix};
use crate::schema::Root;
use crate::{Carried, Item, Node, Transform};

#[derive(Debug, Default)]
pub(crate) struct Hierarchy {
    pub nodes: Vec<Node>,
    /// Kept node by the file's node.
    pub kept: BTreeMap<usize, usize>,
    /// The file's nodes that move.
    held: BTreeMap<usize, Held>,
    /// Whether a channel names the kept node or one that it hangs on.
    moves: Vec<bool>,
}

/// A node of the file that moves.
#[derive(Clone, Copy, Debug)]
struct Held {
    /// Kept node that carries it, and the file's number of that.
    kept: usize,
    carrier: usize,
    /// What the nodes between the two do, in full precision.
    local: DMat4,
}

/// Where something stands, and what carries it there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    /// Kept node, if it moves.
    pub node: Option<usize>,
    /// Place of that node; the identity without one.
    base: DMat4,
    pub local: DMat4,
}

/// Keeps `named` nodes, `joints`, and what they hang on.
pub(crate) fn hierarchy(
    root: &Root,
    pose: &Pose,
    named: &BTreeSet<usize>,
    joints: &BTreeSet<usize>,
) -> Hierarchy {
    let carriers = with_ancestors(pose, named);
    let wanted = with_ancestors(pose, &named.union(joints).copied().collect());
    let mut hierarchy = Hierarchy::default();
    for &node in pose.order.iter().filter(|node| wanted.contains(node)) {
        let source = &root.nodes[node];
        let parent = pose.parents[node].map(|parent| hierarchy.kept[&parent]);
        let moves = named.contains(&node) || parent.is_some_and(|parent| hierarchy.moves[parent]);
        hierarchy.kept.insert(node, hierarchy.nodes.len());
        hierarchy.nodes.push(Node {
            name: source.name.clone().unwrap_or_else(|| format!("node {node}")),
            parent,
            transform: match source.matrix {
                Some(columns) => Transform::Matrix(Mat4::from_cols_array(&columns)),
                None => Transform::Parts {
                    translation: source.translation.unwrap_or([0.0; 3]),
                    rotation: source.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]),
                    scale: source.scale.unwrap_or([1.0; 3]),
                },
            },
            visible: source.extensions.visibility.is_none_or(|it| it.visible),
        });
        hierarchy.moves.push(moves);
    }
    hierarchy.held = held(root, pose, &hierarchy, &carriers);
    hierarchy
}

fn with_ancestors(pose: &Pose, nodes: &BTreeSet<usize>) -> BTreeSet<usize> {
    let mut found = BTreeSet::new();
    for &node in nodes {
        let mut next = Some(node);
        while let Some(node) = next.filter(|node| found.insert(*node)) {
            next = pose.parents[node];
        }
    }
    found
}

/// Nodes that move; large files have few, so the others take no memory. What is kept for its joints alone carries
/// nothing: its skin may turn out not to be drawn.
fn held(
    root: &Root,
    pose: &Pose,
    hierarchy: &Hierarchy,
    carriers: &BTreeSet<usize>,
) -> BTreeMap<usize, Held> {
    let mut found = BTreeMap::new();
    for &node in &pose.order {
        if let Some(&kept) = hierarchy.kept.get(&node).filter(|_| carriers.contains(&node)) {
            if hierarchy.moves[kept] {
                found.insert(node, Held { kept, carrier: node, local: DMat4::IDENTITY });
            }
            continue;
        }
        let parent = pose.parents[node].and_then(|parent| Some((parent, *found.get(&parent)?)));
        if let Some((parent, above)) = parent {
            let local = local_matrix(&root.nodes[node]);
            // No product for a child: a product with the identity may change the sign of a zero.
            let local = if above.carrier == parent { local } else { above.local * local };
            found.insert(node, Held { local, ..above });
        }
    }
    found
}

impl Hierarchy {
    /// Keeps `used` nodes and what they hang on alone; returns the new number of each.
    pub fn retain(&mut self, mut used: BTreeSet<usize>) -> Vec<usize> {
        for node in (0..self.nodes.len()).rev() {
            if used.contains(&node) {
                used.extend(self.nodes[node].parent);
            }
        }
        let mut next = 0..;
        let numbers: Vec<usize> = (0..self.nodes.len())
            .map(|node| if used.contains(&node) { next.next().unwrap_or(0) } else { usize::MAX })
            .collect();
        let mut at = 0..;
        self.nodes.retain(|_| at.next().is_some_and(|node| used.contains(&node)));
        for node in &mut self.nodes {
            node.parent = node.parent.map(|parent| numbers[parent]);
        }
        self.kept.retain(|_, node| {
            *node = numbers[*node];
            *node != usize::MAX
        });
        numbers
    }

    /// Where a node of the file stands.
    pub fn place(&self, pose: &Pose, node: usize) -> Place {
        match self.held.get(&node) {
            None => Place::still(pose.worlds[node]),
            Some(held) => {
                let base = pose.worlds[held.carrier];
                Place { node: Some(held.kept), base, local: rounded(held.local) }
            }
        }
    }
}

impl Place {
    /// In the world, seen when the node is.
    pub fn seen_with(self) -> Place {
        Place { local: DMat4::IDENTITY, ..self }
    }

    /// In the world.
    pub fn still(world: DMat4) -> Place {
        Place { node: None, base: DMat4::IDENTITY, local: world }
    }

    pub fn world(&self) -> DMat4 {
        // No product without a node: a product with the identity may change the sign of a zero.
        if self.node.is_some() { self.base * self.local } else { self.local }
    }

    /// The place of something that stands at `local` there. A pack holds single precision, so that is what counts.
    pub fn then(&self, local: DMat4) -> Place {
        let product = self.local * local;
        Place { local: if self.node.is_some() { rounded(product) } else { product }, ..*self }
    }
}

/// Brings what moves behind what does not, node by node, and remembers what each node carries.
pub(crate) fn carry<T>(
    mut placed: Vec<(Place, T)>,
    item: fn(usize) -> Item,
    carried: &mut Vec<Carried>,
) -> Vec<T> {
    placed.sort_by_key(|(place, _)| place.node);
    for (at, (place, _)) in placed.iter().enumerate() {
        let held = place.node.map(|node| Carried { node, item: item(at), local: place.local.as_mat4() });
        carried.extend(held);
    }
    placed.into_iter().map(|(_, thing)| thing).collect()
}

pub(crate) fn rounded(matrix: DMat4) -> DMat4 {
    matrix.as_mat4().as_dmat4()
}
