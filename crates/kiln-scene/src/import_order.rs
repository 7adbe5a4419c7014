//! Last steps of an import: what is used keeps its place, what is not goes, and the whole gets its bounds.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DVec3, Mat4};

use super::Morph;
use crate::geometry::Budget;
use crate::hierarchy::Hierarchy;
use crate::{Bounds, Draw, Posed, Primitive, Scene, SceneError};

/// Keeps the primitives that are drawn, in the order in which they are: one that was only ever mirrored goes.
pub(super) fn order_primitives(scene: &mut Scene) {
    let mut renumbered = BTreeMap::new();
    for draw in scene.draws.iter_mut().chain(&mut scene.hidden) {
        let next = renumbered.len();
        draw.primitive = *renumbered.entry(draw.primitive).or_insert(next);
    }
    let mut kept: Vec<(usize, Primitive)> = std::mem::take(&mut scene.primitives)
        .into_iter()
        .enumerate()
        .filter_map(|(old, primitive)| renumbered.get(&old).map(|&new| (new, primitive)))
        .collect();
    kept.sort_by_key(|(new, _)| *new);
    scene.primitives = kept.into_iter().map(|(_, primitive)| primitive).collect();
    scene.variant_materials.retain_mut(|it| match renumbered.get(&it.primitive) {
        Some(&primitive) => {
            it.primitive = primitive;
            true
        }
        None => false,
    });
    scene.variant_materials.sort_by_key(|it| it.primitive);
}

/// Numbers skins in the order in which they are drawn.
pub(super) fn order_skins(scene: &mut Scene) {
    let mut used = Vec::new();
    for skin in scene.draws.iter_mut().chain(&mut scene.hidden).filter_map(|draw| draw.skin.as_mut()) {
        let known = used.iter().position(|it| it == skin);
        let number = known.unwrap_or(used.len());
        if known.is_none() {
            used.push(*skin);
        }
        *skin = number;
    }
    scene.skins = used.into_iter().map(|skin| scene.skins[skin].clone()).collect();
}

/// Numbers what morphs in the order in which it is drawn, and gives the scene the weights.
pub(super) fn order_morphs<'a>(scene: &mut Scene, morphs: &'a [Morph]) -> Vec<&'a Morph> {
    let mut ordered = Vec::new();
    for morph in scene.draws.iter_mut().chain(&mut scene.hidden).filter_map(|draw| draw.morph.as_mut()) {
        ordered.push(&morphs[*morph]);
        *morph = ordered.len() - 1;
    }
    scene.morphs = ordered.iter().map(|morph| morph.weights.clone()).collect();
    ordered
}

/// Leaves out nodes that neither move nor are joints of what is drawn. `named` are those that channels name.
pub(super) fn order_nodes(scene: &mut Scene, hierarchy: &mut Hierarchy, named: &BTreeSet<usize>) {
    let joints = scene.skins.iter().flat_map(|skin| skin.joints.iter().copied());
    let used = named.iter().filter_map(|node| hierarchy.kept.get(node).copied());
    let numbers = hierarchy.retain(used.chain(joints).collect());
    for carried in &mut scene.carried {
        carried.node = numbers[carried.node];
    }
    for joint in scene.skins.iter_mut().flat_map(|skin| &mut skin.joints) {
        *joint = numbers[*joint];
    }
}

/// Bounds of all draws at rest.
///
/// # Errors
/// More skinned and morphed vertices than a file may cost.
pub(super) fn world_bounds(scene: &Scene, budget: &mut Budget) -> Result<Option<Bounds>, SceneError> {
    let posed = scene.pose(None, 0.0);
    let mut whole: Option<Bounds> = None;
    for draw in &scene.draws {
        let local = local_bounds(scene, draw, &posed, budget)?;
        let placed = |place: Mat4| transformed(local, place);
        let copies = draw.instances.iter().map(|it| placed(draw.world * it.matrix()));
        let alone = draw.instances.is_empty().then(|| placed(draw.world));
        whole = copies.chain(alone).chain(whole).reduce(union);
    }
    Ok(whole)
}

fn union(a: Bounds, b: Bounds) -> Bounds {
    Bounds { min: a.min.min(b.min), max: a.max.max(b.max) }
}

fn local_bounds(
    scene: &Scene,
    draw: &Draw,
    posed: &Posed,
    budget: &mut Budget,
) -> Result<Bounds, SceneError> {
    let primitive = &scene.primitives[draw.primitive];
    if draw.skin.is_none() && draw.morph.is_none() {
        return Ok(primitive.bounds);
    }
    let steps = primitive.vertices.len() * (primitive.targets.len() + 4);
    budget.spend(steps as u64, "")?;
    let weights = draw.morph.map_or(&[][..], |morph| &posed.morphs[morph]);
    let joints = draw.skin.map_or(&[][..], |skin| &posed.skins[skin]);
    let positions =
        (0..primitive.vertices.len()).map(|at| primitive.deformed_vertex(at, weights, joints).position);
    let finite = positions.filter(|position| position.is_finite());
    let ends = finite.map(|it| (it, it)).reduce(|a: (DVec3, DVec3), b| (a.0.min(b.0), a.1.max(b.1)));
    Ok(ends.map_or(primitive.bounds, |(min, max)| Bounds { min: min.as_vec3(), max: max.as_vec3() }))
}

/// Box around a transformed box (J. Arvo, "Transforming Axis-Aligned Bounding Boxes", Graphics Gems, 1990).
fn transformed(bounds: Bounds, world: Mat4) -> Bounds {
    let world = world.as_dmat4();
    let origin = world.w_axis.truncate();
    let (mut min, mut max) = (origin, origin);
    for (axis, (low, high)) in [world.x_axis, world.y_axis, world.z_axis]
        .into_iter()
        .zip(bounds.min.to_array().into_iter().zip(bounds.max.to_array()))
    {
        let (a, b) = (axis.truncate() * f64::from(low), axis.truncate() * f64::from(high));
        min += a.min(b);
        max += a.max(b);
    }
    Bounds { min: min.as_vec3(), max: max.as_vec3() }
}
