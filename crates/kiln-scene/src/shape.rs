//! Makes geometry fit to draw: finite, with unit normals and tangents, without what nothing refers to.
//!
//! Every step leaves a result of its own as it is, bit for bit, so that a pack of a pack is the same pack.

use std::collections::HashMap;
use std::hash::Hash;

use glam::DVec3;

use crate::deform::{Influence, MorphDelta, MorphTarget};
use crate::geometry::Needs;
use crate::{Bounds, Primitive, Vertex, tangents};

/// A triangle list.
#[derive(Clone, Debug, Default)]
pub(crate) struct Geometry {
    pub vertices: Vec<Vertex>,
    pub indices: Vec<u32>,
    pub has_normals: bool,
    pub has_tangents: bool,
    /// One a vertex, or none.
    pub influences: Vec<Influence>,
    /// By the file's number of the target.
    pub targets: Vec<(usize, MorphTarget)>,
    /// Vertices whose joint weights are negative or do not sum up to 1.
    pub odd_weight_count: usize,
    /// Vertices that lost weights, because they hang on more than four joints.
    pub dropped_joint_count: usize,
    /// What morph targets add, but is no number.
    pub odd_delta_count: usize,
    /// Which vertex that was read each one is, if it has influences or targets: those wait until all is settled.
    pub sources: Option<Vec<u32>>,
}

/// How far from 1 the squared length of a unit vector may be; four times what rounding to f32 leaves.
const UNIT_TOLERANCE: f64 = 1e-6;

/// Squared lengths this far from 1 are worth a word; rounding to 8 bits leaves a third of it.
const NOTED_SQUARED_LENGTH_ERROR: f64 = 1.35e-2;

/// Repairs `geometry` and adds what is missing; returns sentences about what was wrong, each after its
/// place below the primitive.
pub(crate) fn finish(mut geometry: Geometry, needs: Needs) -> (Geometry, Vec<String>) {
    let mut remarks = Vec::new();
    let mut remark = |count: usize, place: &str, what: &str| {
        if count > 0 {
            remarks.push(format!("{place}: {count} {what}"));
        }
    };
    remark(
        geometry.odd_weight_count,
        "/attributes/WEIGHTS_0",
        "vertices have joint weights that are negative or whose sum is not 1",
    );
    remark(
        geometry.dropped_joint_count,
        "/attributes/JOINTS_0",
        "vertices hang on more than four joints, of which the four heaviest count",
    );
    remark(geometry.odd_delta_count, "/targets", "vertices of morph targets are not finite and count as 0");
    let deforms = !(geometry.influences.is_empty() && geometry.targets.is_empty());
    geometry.sources = deforms.then(|| (0..geometry.vertices.len() as u32).collect());
    remark(
        drop_non_finite_triangles(&mut geometry),
        "/attributes/POSITION",
        "triangles with non-finite positions were dropped",
    );
    let (broken, outside) = repair_attributes(&mut geometry);
    remark(broken, "", "vertices had non-finite texture coordinates or colours");
    remark(outside, "/attributes/COLOR_0", "vertices have colours outside 0 to 1; negative ones count as 0");
    let had_indices = geometry.vertices.len() < geometry.indices.len();
    let mut split = false;
    if needs.normals && !geometry.has_normals {
        unshare(&mut geometry);
        flat_normals(&mut geometry);
        let what =
            "morph targets do not move the normals, which are missing: the unmorphed shape's flat ones stay";
        remark(geometry.targets.len(), "/attributes", what);
        split = true;
    } else if needs.normals {
        let normal = "/attributes/NORMAL";
        let lengths = geometry.vertices.iter().map(|vertex| vertex.normal);
        remark(
            lengths.filter(|&it| is_scaled(it)).count(),
            normal,
            "normals did not have length 1 and were scaled",
        );
        remark(
            repair_normals(&mut geometry),
            normal,
            "vertices without a usable normal got one from their triangles",
        );
    }
    if let Some(placement) = needs.tangents {
        if !geometry.has_tangents {
            unshare(&mut geometry);
            tangents::generate(&mut geometry, placement);
            forget_uvs(&mut geometry, needs.uv);
            split = true;
        } else {
            let tangents = geometry.vertices.iter().map(|vertex| vertex.tangent);
            let wrong = |&[x, y, z, w]: &[f32; 4]| is_scaled([x, y, z]) || w.abs() != 1.0;
            let count = tangents.filter(wrong).count();
            remark(
                count,
                "/attributes/TANGENT",
                "tangents did not have length 1 or a handedness of ±1 and were made so",
            );
        }
        remark(repair_tangents(&mut geometry), "", "vertices without a usable tangent got an arbitrary one");
    }
    if split && had_indices {
        weld(&mut geometry);
    }
    compact(&mut geometry);
    settle(&mut geometry);
    (geometry, remarks)
}

/// Gives each vertex the influence and the morph deltas of the one that it was; targets without any go.
fn settle(geometry: &mut Geometry) {
    let Some(sources) = geometry.sources.take() else { return };
    if !geometry.influences.is_empty() {
        geometry.influences = sources.iter().map(|&at| geometry.influences[at as usize]).collect();
    }
    for (_, target) in &mut geometry.targets {
        target.deltas = sources.iter().map(|&at| target.deltas[at as usize]).collect();
    }
    let is_zero = |delta: &MorphDelta| *delta == MorphDelta::default();
    geometry.targets.retain(|(_, target)| !target.deltas.iter().all(is_zero));
}

/// Shrinks what morph targets add to a vector as much as the vector was.
fn scale_deltas(geometry: &mut Geometry, at: usize, length: f64, part: fn(&mut MorphDelta) -> &mut [f32; 3]) {
    let Some(sources) = &geometry.sources else { return };
    let source = sources[at] as usize;
    for (_, target) in &mut geometry.targets {
        let delta = part(&mut target.deltas[source]);
        *delta = delta.map(|value| (f64::from(value) / length) as f32);
    }
}

/// Drops coordinates that were read for the tangents alone.
fn forget_uvs(geometry: &mut Geometry, needed: [bool; 2]) {
    for vertex in &mut geometry.vertices {
        if !needed[0] {
            vertex.uv0 = [0.0; 2];
        }
        if !needed[1] {
            vertex.uv1 = [0.0; 2];
        }
    }
}

/// The mirror image about x = 0: `world · diag(−1, 1, 1)` with it shows what `world` with `geometry` does.
/// The bitangent is a cross product, which mirrors to its opposite: the handedness makes up for it.
/// Tangents that nothing reads keep their neutral value.
/// Nothing that has joints is mirrored: they place it.
pub(crate) fn mirrored(source: &Primitive, has_tangents: bool) -> Primitive {
    let Primitive { mut vertices, indices, mut targets, .. } = source.clone();
    for delta in targets.iter_mut().flat_map(|target| &mut target.deltas) {
        for part in [&mut delta.position, &mut delta.normal, &mut delta.tangent] {
            part[0] = -part[0];
        }
    }
    for vertex in &mut vertices {
        vertex.position[0] = -vertex.position[0];
        vertex.normal[0] = -vertex.normal[0];
        if has_tangents {
            vertex.tangent[0] = -vertex.tangent[0];
            vertex.tangent[3] = -vertex.tangent[3];
        }
    }
    let (triangles, _) = indices.as_chunks::<3>();
    let indices = triangles.iter().flat_map(|&[a, b, c]| [a, c, b]).collect();
    let bounds = bounds(&vertices);
    Primitive { vertices, indices, bounds, targets, material: source.material, influences: Vec::new() }
}

/// Smallest box around all vertices, of which there is at least one.
pub(crate) fn bounds(vertices: &[Vertex]) -> Bounds {
    let first = vertices.first().map_or(glam::Vec3::ZERO, |vertex| vertex.position.into());
    let mut bounds = Bounds { min: first, max: first };
    for vertex in vertices {
        bounds.min = bounds.min.min(vertex.position.into());
        bounds.max = bounds.max.max(vertex.position.into());
    }
    bounds
}

fn wide(values: [f32; 3]) -> DVec3 {
    DVec3::from_array(values.map(f64::from))
}

fn narrow(vector: DVec3) -> [f32; 3] {
    vector.to_array().map(|value| value as f32)
}

/// The vector at unit length, untouched where it has it; `None` where it has no direction.
fn unit(vector: [f32; 3]) -> Option<[f32; 3]> {
    let length_squared = wide(vector).length_squared();
    if (length_squared - 1.0).abs() <= UNIT_TOLERANCE {
        return Some(vector);
    }
    (length_squared.is_finite() && length_squared > 1e-24)
        .then(|| narrow(wide(vector) / length_squared.sqrt()))
}

/// Whether a vector has a direction, and a length that quantisation does not explain.
fn is_scaled(vector: [f32; 3]) -> bool {
    let length_squared = wide(vector).length_squared();
    length_squared > 1e-24 && (length_squared - 1.0).abs() > NOTED_SQUARED_LENGTH_ERROR
}

fn drop_non_finite_triangles(geometry: &mut Geometry) -> usize {
    let is_finite = |vertex: &Vertex| vertex.position.iter().all(|value| value.is_finite());
    if geometry.vertices.iter().all(is_finite) {
        return 0;
    }
    let (triangles, _) = geometry.indices.as_chunks::<3>();
    let finite = |index: u32| is_finite(&geometry.vertices[index as usize]);
    let kept: Vec<u32> =
        triangles.iter().filter(|t| t.iter().all(|&i| finite(i))).flatten().copied().collect();
    let dropped = triangles.len() - kept.len() / 3;
    geometry.indices = kept;
    dropped
}

/// Number of vertices with values that are no numbers, and with colours out of range.
fn repair_attributes(geometry: &mut Geometry) -> (usize, usize) {
    let (mut repaired, mut outside) = (0, 0);
    for vertex in &mut geometry.vertices {
        let uv = vertex.uv0.iter_mut().chain(&mut vertex.uv1).map(|value| (value, 0.0));
        let values = uv.chain(vertex.color.iter_mut().map(|value| (value, 1.0)));
        let wrong = values.filter(|(value, _)| !value.is_finite());
        let count = wrong.map(|(value, neutral)| *value = neutral).count();
        repaired += usize::from(count > 0);
        outside += usize::from(vertex.color.iter().any(|value| !(0.0..=1.0).contains(value)));
        // Colours multiply radiance: a negative one would take light away.
        vertex.color = vertex.color.map(|value| value.max(0.0));
    }
    (repaired, outside)
}

/// Gives every corner a vertex of its own.
fn unshare(geometry: &mut Geometry) {
    if let Some(sources) = &mut geometry.sources {
        *sources = geometry.indices.iter().map(|&index| sources[index as usize]).collect();
    }
    geometry.vertices = geometry.indices.iter().map(|&index| geometry.vertices[index as usize]).collect();
    geometry.indices = (0..geometry.vertices.len() as u32).collect();
}

/// Twice the triangle's area along its normal.
fn area_vector(vertices: &[Vertex], triangle: &[u32; 3]) -> DVec3 {
    let [a, b, c] = triangle.map(|index| wide(vertices[index as usize].position));
    (b - a).cross(c - a)
}

fn flat_normals(geometry: &mut Geometry) {
    let (triangles, _) = geometry.indices.as_chunks::<3>();
    for triangle in triangles {
        let normal = unit_or_up(area_vector(&geometry.vertices, triangle));
        for &index in triangle {
            geometry.vertices[index as usize].normal = normal;
        }
    }
}

fn unit_or_up(vector: DVec3) -> [f32; 3] {
    vector.try_normalize().map_or([0.0, 0.0, 1.0], narrow)
}

fn repair_normals(geometry: &mut Geometry) -> usize {
    let is_broken = |vertex: &Vertex| unit(vertex.normal).is_none();
    let (mut broken, mut sums) = (0, Vec::new());
    if geometry.vertices.iter().any(is_broken) {
        let used = used_vertices(geometry);
        broken =
            geometry.vertices.iter().zip(&used).filter(|(vertex, used)| **used && is_broken(vertex)).count();
        sums = vec![DVec3::ZERO; geometry.vertices.len()];
        let (triangles, _) = geometry.indices.as_chunks::<3>();
        for triangle in triangles {
            let area = area_vector(&geometry.vertices, triangle);
            triangle.iter().for_each(|&index| sums[index as usize] += area);
        }
    }
    for at in 0..geometry.vertices.len() {
        let normal = geometry.vertices[at].normal;
        let scaled = unit(normal);
        if scaled.is_some_and(|scaled| scaled != normal) {
            scale_deltas(geometry, at, wide(normal).length(), |delta| &mut delta.normal);
        }
        let from_triangles = || unit_or_up(sums.get(at).copied().unwrap_or(DVec3::ZERO));
        geometry.vertices[at].normal = scaled.unwrap_or_else(from_triangles);
    }
    broken
}

/// A tangent must be finite, have a direction that is not the normal's, and a handedness of ±1.
fn repair_tangents(geometry: &mut Geometry) -> usize {
    let mut repaired = 0;
    for at in 0..geometry.vertices.len() {
        let vertex = &geometry.vertices[at];
        let [x, y, z, w] = vertex.tangent;
        let handedness = if w < 0.0 { -1.0 } else { 1.0 };
        let given = [x, y, z];
        let usable = unit(given).filter(|&tangent| wide(tangent).dot(wide(vertex.normal)).abs() < 0.9999);
        let [x, y, z] = usable.unwrap_or_else(|| {
            repaired += 1;
            narrow(wide(vertex.normal).any_orthonormal_vector())
        });
        geometry.vertices[at].tangent = [x, y, z, handedness];
        if usable.is_some_and(|usable| usable != given) {
            scale_deltas(geometry, at, wide(given).length(), |delta| &mut delta.tangent);
        }
    }
    repaired
}

/// Shares vertices that are equal in every bit, in the order of their first use. Those with influences or morph targets
/// must have been one to be one again.
fn weld(geometry: &mut Geometry) {
    type Bits = [u32; size_of::<Vertex>() / 4];
    match geometry.sources.take() {
        None => drop(weld_by(geometry, |vertex, _| bytemuck::cast::<Vertex, Bits>(vertex))),
        Some(sources) => {
            let key = |vertex, at| (bytemuck::cast::<Vertex, Bits>(vertex), sources[at]);
            let firsts = weld_by(geometry, key);
            geometry.sources = Some(firsts.into_iter().map(|at| sources[at as usize]).collect());
        }
    }
}

/// Makes vertices of equal keys one; returns which one each is now.
fn weld_by<K: Eq + Hash>(geometry: &mut Geometry, key: impl Fn(Vertex, usize) -> K) -> Vec<u32> {
    let mut seen: HashMap<K, u32> = HashMap::with_capacity(geometry.vertices.len());
    let (mut vertices, mut firsts) = (Vec::new(), Vec::new());
    for index in &mut geometry.indices {
        let vertex = geometry.vertices[*index as usize];
        *index = *seen.entry(key(vertex, *index as usize)).or_insert_with(|| {
            vertices.push(vertex);
            firsts.push(*index);
            vertices.len() as u32 - 1
        });
    }
    geometry.vertices = vertices;
    firsts
}

fn used_vertices(geometry: &Geometry) -> Vec<bool> {
    let mut used = vec![false; geometry.vertices.len()];
    geometry.indices.iter().for_each(|&index| used[index as usize] = true);
    used
}

/// Removes vertices that no triangle uses and keeps the order of the others.
fn compact(geometry: &mut Geometry) {
    let used = used_vertices(geometry);
    if used.iter().all(|used| *used) {
        return;
    }
    let mut next = 0;
    let renumbered: Vec<u32> = used
        .iter()
        .map(|&used| {
            next += u32::from(used);
            next.saturating_sub(1)
        })
        .collect();
    geometry.indices.iter_mut().for_each(|index| *index = renumbered[*index as usize]);
    let mut flags = used.iter();
    geometry.vertices.retain(|_| flags.next() == Some(&true));
    if let Some(sources) = &mut geometry.sources {
        let mut flags = used.iter();
        sources.retain(|_| flags.next() == Some(&true));
    }
}
