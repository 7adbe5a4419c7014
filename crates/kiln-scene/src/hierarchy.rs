//! The nodes that a moving scene keeps. A scene at rest needs none: its draws stand in the world.
//!
//! Kept are the nodes that channels name and what those hang on. Everything between such a node and a draw is
//! one matrix, so that a pack, where the draw is that node's child, comes out as the same pack again.

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
    /// Where every node of the file stands.
    pub places: Vec<Place>,
    /// Whether a channel names the kept node or one that it hangs on.
    moves: Vec<bool>,
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

/// Keeps `named` nodes and what they hang on.
pub(crate) fn hierarchy(root: &Root, pose: &Pose, named: &BTreeSet<usize>) -> Hierarchy {
    let mut wanted = BTreeSet::new();
    for &node in named {
        let mut next = Some(node);
        while let Some(node) = next.filter(|node| wanted.insert(*node)) {
            next = pose.parents[node];
        }
    }
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
    hierarchy.places = places(root, pose, &hierarchy);
    hierarchy
}

/// Where every node of the file stands.
fn places(root: &Root, pose: &Pose, hierarchy: &Hierarchy) -> Vec<Place> {
    let mut places: Vec<Place> = pose.worlds.iter().map(|&world| Place::still(world)).collect();
    // What the nodes between a node and the one that carries it do, in full precision.
    let mut locals = vec![DMat4::IDENTITY; places.len()];
    for &node in &pose.order {
        if let Some(&kept) = hierarchy.kept.get(&node) {
            if hierarchy.moves[kept] {
                places[node] = Place { node: Some(kept), base: pose.worlds[node], local: DMat4::IDENTITY };
            }
            continue;
        }
        let Some(parent) = pose.parents[node] else { continue };
        if places[parent].node.is_some() {
            let local = local_matrix(&root.nodes[node]);
            let is_child = hierarchy.kept.contains_key(&parent);
            locals[node] = if is_child { local } else { locals[parent] * local };
            places[node] = Place { local: rounded(locals[node]), ..places[parent] };
        }
    }
    places
}

impl Place {
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
