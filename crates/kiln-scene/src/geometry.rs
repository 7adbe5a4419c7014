//! Attributes of one primitive as vertices, morphed and skinned to the rest pose where nothing moves them.

use std::collections::BTreeMap;

use glam::DMat4;

use crate::accessor::Data;
use crate::deform::{Influence, MorphDelta, MorphTarget, move_vertex};
use crate::schema::Primitive;
use crate::shape::Geometry;
use crate::topology::{Topology, triangulate};
use crate::{SceneError, Vertex, limits};

/// Neutral values of absent attributes.
pub(crate) const NEUTRAL: Vertex = Vertex {
    position: [0.0; 3],
    normal: [0.0, 0.0, 1.0],
    tangent: [1.0, 0.0, 0.0, 1.0],
    uv0: [0.0; 2],
    uv1: [0.0; 2],
    color: [1.0; 4],
};

/// Several times what rounding four weights leaves; the sum is scaled to 1 in any case.
const WEIGHT_SUM_TOLERANCE: f64 = 1e-5;

/// Weights whose sum is this close to 1 keep their bits: scaling four weights once more leaves less.
const SCALED_SUM_TOLERANCE: f64 = 1e-6;

/// Share of a vertex's weights that may be dropped without a word.
const DROPPED_SHARE_MAX: f64 = 0.01;

/// What the material reads; the rest is neither read nor stored.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Needs {
    pub normals: bool,
    /// The UV set and placement that tangents follow.
    pub tangents: Option<crate::TextureRef>,
    /// UV sets of textures.
    pub uv: [bool; 2],
}

impl Needs {
    /// What either of two materials reads. Tangents can follow one placement only: the first's.
    pub fn or(self, other: Needs) -> Needs {
        Needs {
            normals: self.normals || other.normals,
            tangents: self.tangents.or(other.tangents),
            uv: [self.uv[0] || other.uv[0], self.uv[1] || other.uv[1]],
        }
    }
}

/// How the primitive is deformed before it is placed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Deformation<'a> {
    /// Weights at rest.
    pub weights: &'a [f32],
    /// Targets to keep for weights that change; with none the vertices are morphed to the rest pose.
    pub live: &'a [usize],
    pub placing: Placing<'a>,
}

/// How a primitive's vertices come to their place.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Placing<'a> {
    /// By the draw's matrix.
    Instance,
    /// By this many joints that move.
    Joints(usize),
    /// By joints at rest (skin space to world for each): the vertices are in world space then.
    Skin(&'a [DMat4]),
    /// By a matrix that no draw can have, because it flattens and normals have no inverse of it.
    Flattened(DMat4),
}

/// What reading may still cost; see [`limits::POSE_STEP_COUNT_MAX`].
#[derive(Debug)]
pub(crate) struct Budget {
    pub steps_left: usize,
    /// See [`limits::MORPH_DELTA_COUNT_MAX`].
    pub deltas_left: usize,
}

impl Budget {
    pub fn new() -> Self {
        Budget { steps_left: limits::POSE_STEP_COUNT_MAX, deltas_left: limits::MORPH_DELTA_COUNT_MAX }
    }

    pub fn spend_deltas(&mut self, count: usize, pointer: &str) -> Result<(), SceneError> {
        let limit = limits::MORPH_DELTA_COUNT_MAX;
        let fault = || SceneError::new(pointer, format!("the vertices of all morph targets exceed {limit}"));
        self.deltas_left = self.deltas_left.checked_sub(count).ok_or_else(fault)?;
        Ok(())
    }

    pub fn spend(&mut self, steps: u64, pointer: &str) -> Result<(), SceneError> {
        let left = usize::try_from(steps).ok().and_then(|steps| self.steps_left.checked_sub(steps));
        let limit = limits::POSE_STEP_COUNT_MAX;
        let fault = || {
            SceneError::new(pointer, format!("the file's vertices, morphs and joints exceed {limit} steps"))
        };
        self.steps_left = left.ok_or_else(fault)?;
        Ok(())
    }
}

/// A primitive's geometry, or why there is nothing to draw.
pub(crate) enum Read {
    Geometry(Geometry),
    Nothing(String),
}

/// Reads a primitive.
///
/// # Errors
/// Accessors, indices or joints out of range, attributes of different lengths.
pub(crate) fn read(
    data: &Data<'_>,
    primitive: &Primitive,
    pointer: &str,
    needs: Needs,
    deformation: Deformation<'_>,
    budget: &mut Budget,
) -> Result<Read, SceneError> {
    let Some(&position) = primitive.attributes.get("POSITION") else {
        return Ok(Read::Nothing("it has no positions".into()));
    };
    if let Some(extension) = draco_only(data, primitive, position) {
        return Err(SceneError::new(
            pointer,
            format!("{extension} is not supported and there is no other copy"),
        )
        .with_help("export the file without mesh compression"));
    }
    let count = data.bounded_count(position, &format!("{pointer}/attributes/POSITION"))?;
    budget.spend(count as u64, pointer)?;
    let mut reader = Reader { data, primitive, pointer, count };
    let indices = match triangulate(primitive.mode.unwrap_or(4), reader.indices()?) {
        Topology::Triangles(indices) if indices.is_empty() => {
            return Ok(Read::Nothing("it has no triangles".into()));
        }
        Topology::Triangles(indices) => indices,
        Topology::NotDrawn(what) => return Ok(Read::Nothing(format!("{what} are not drawn"))),
        Topology::Unknown => return Err(SceneError::new(format!("{pointer}/mode"), "no mode of glTF 2.0")),
    };
    let mut geometry = reader.vertices(needs, indices)?;
    match deformation.live {
        [] => reader.morph(&mut geometry, deformation.weights, budget)?,
        live => reader.targets(&mut geometry, live, budget)?,
    }
    match deformation.placing {
        Placing::Instance => {}
        Placing::Joints(count) => reader.hang(&mut geometry, count, budget)?,
        Placing::Skin(joints) => reader.skin(&mut geometry, joints, budget)?,
        Placing::Flattened(world) => {
            for at in 0..geometry.vertices.len() {
                place(&mut geometry, at, world);
            }
        }
    }
    Ok(Read::Geometry(geometry))
}

/// Whether a primitive has what a skin needs.
pub(crate) fn has_joints(primitive: &Primitive) -> bool {
    ["JOINTS_0", "WEIGHTS_0"].iter().all(|name| primitive.attributes.contains_key(*name))
}

fn place(geometry: &mut Geometry, at: usize, matrix: DMat4) {
    let deltas = geometry.targets.iter_mut().map(|(_, target)| &mut target.deltas[at]);
    move_vertex(&mut geometry.vertices[at], deltas, matrix, geometry.has_normals, geometry.has_tangents);
}

fn draco_only<'a>(data: &Data<'_>, primitive: &'a Primitive, position: usize) -> Option<&'a str> {
    let name = primitive.extensions.others.keys().find(|name| name.contains("draco"))?;
    let accessor = data.root.accessors.get(position)?;
    accessor.buffer_view.is_none().then_some(name.as_str())
}

struct Reader<'a, 'b> {
    data: &'a Data<'b>,
    primitive: &'a Primitive,
    pointer: &'a str,
    count: usize,
}

impl Reader<'_, '_> {
    fn indices(&self) -> Result<Vec<u32>, SceneError> {
        let Some(index) = self.primitive.indices else {
            return Ok((0..self.count as u32).collect());
        };
        let user = format!("{}/indices", self.pointer);
        let indices: Vec<u32> = bytemuck::cast_vec(self.data.unsigned::<1>(index, &user, &["SCALAR"])?);
        match indices.iter().position(|&index| index as usize >= self.count) {
            None => Ok(indices),
            Some(at) => Err(SceneError::new(
                user,
                format!("index {} (number {at}) is outside the {} vertices", indices[at], self.count),
            )),
        }
    }

    fn attribute<const N: usize>(
        &self,
        attributes: &BTreeMap<String, usize>,
        place: &str,
        name: &str,
        kinds: &[&str],
        fill: [f32; N],
    ) -> Result<Option<Vec<[f32; N]>>, SceneError> {
        let Some(&index) = attributes.get(name) else { return Ok(None) };
        let user = format!("{}{place}/{name}", self.pointer);
        let values = self.data.floats(index, &user, kinds, fill)?;
        self.check_count(values.len(), &user)?;
        Ok(Some(values))
    }

    fn check_count(&self, actual: usize, user: &str) -> Result<(), SceneError> {
        if actual == self.count {
            return Ok(());
        }
        Err(SceneError::new(user, format!("{actual} elements for {} vertices", self.count)))
    }

    fn vertices(&mut self, needs: Needs, indices: Vec<u32>) -> Result<Geometry, SceneError> {
        let attributes = &self.primitive.attributes;
        let has = |name| attributes.contains_key(name);
        let has_normals = needs.normals && has("NORMAL");
        // Without normals the specification has given tangents ignored too.
        let has_tangents = has_normals && needs.tangents.is_some() && has("TANGENT");
        // Tangents that are not given are made along a set that no texture may read.
        let placed = needs.tangents.filter(|_| !has_tangents).map(|placed| placed.uv_set as usize);
        let reads = |set: usize| needs.uv[set] || placed == Some(set);
        let mut vertices = vec![NEUTRAL; self.count];
        self.column("POSITION", &["VEC3"], &mut vertices, |it, [x, y, z, _]| it.position = [x, y, z])?;
        if has_normals {
            self.column("NORMAL", &["VEC3"], &mut vertices, |it, [x, y, z, _]| it.normal = [x, y, z])?;
        }
        if has_tangents {
            self.column("TANGENT", &["VEC4"], &mut vertices, |it, value| it.tangent = value)?;
        }
        if reads(0) {
            self.column("TEXCOORD_0", &["VEC2"], &mut vertices, |it, [u, v, ..]| it.uv0 = [u, v])?;
        }
        if reads(1) {
            self.column("TEXCOORD_1", &["VEC2"], &mut vertices, |it, [u, v, ..]| it.uv1 = [u, v])?;
        }
        self.column("COLOR_0", &["VEC3", "VEC4"], &mut vertices, |it, value| it.color = value)?;
        Ok(Geometry { vertices, indices, has_normals, has_tangents, ..Geometry::default() })
    }

    /// Reads an attribute straight into the vertices, which takes no memory besides; an absent one is skipped.
    fn column(
        &self,
        name: &str,
        kinds: &[&str],
        vertices: &mut [Vertex],
        put: impl Fn(&mut Vertex, [f32; 4]),
    ) -> Result<(), SceneError> {
        let Some(&index) = self.primitive.attributes.get(name) else { return Ok(()) };
        let user = format!("{}/attributes/{name}", self.pointer);
        self.check_count(usize::try_from(self.data.count(index, &user)?).unwrap_or(usize::MAX), &user)?;
        self.data.each_float(index, &user, kinds, [1.0; 4], |at, value| put(&mut vertices[at], value))
    }

    /// Adds the default weights' share of each morph target (glTF 2.0, section 3.7.2.2).
    fn morph(&self, geometry: &mut Geometry, weights: &[f32], budget: &mut Budget) -> Result<(), SceneError> {
        let targets = self.primitive.targets.iter().zip(weights).enumerate();
        for (at, (target, &weight)) in targets.filter(|(_, (_, weight))| **weight != 0.0) {
            budget.spend(self.count as u64, self.pointer)?;
            let place = format!("/targets/{at}");
            let get = |name| self.attribute::<3>(target, &place, name, &["VEC3"], [0.0; 3]);
            let (positions, normals, tangents) = (get("POSITION")?, get("NORMAL")?, get("TANGENT")?);
            for (at, vertex) in geometry.vertices.iter_mut().enumerate() {
                add(&mut vertex.position, positions.as_ref().map(|deltas| deltas[at]), weight);
                if geometry.has_normals {
                    add(&mut vertex.normal, normals.as_ref().map(|deltas| deltas[at]), weight);
                }
                if geometry.has_tangents {
                    add(&mut vertex.tangent, tangents.as_ref().map(|deltas| deltas[at]), weight);
                }
            }
        }
        Ok(())
    }

    /// Reads what weights add, of the `live` targets that add anything.
    fn targets(
        &self,
        geometry: &mut Geometry,
        live: &[usize],
        budget: &mut Budget,
    ) -> Result<(), SceneError> {
        let found = live.iter().filter_map(|&at| Some((at, self.primitive.targets.get(at)?)));
        for (at, target) in found {
            budget.spend(self.count as u64, self.pointer)?;
            let place = format!("/targets/{at}");
            let get = |name| self.attribute::<3>(target, &place, name, &["VEC3"], [0.0; 3]);
            let (positions, normals, tangents) = (get("POSITION")?, get("NORMAL")?, get("TANGENT")?);
            let normals = normals.filter(|_| geometry.has_normals);
            let tangents = tangents.filter(|_| geometry.has_tangents);
            let all = [positions, normals, tangents];
            if all.iter().flatten().all(|deltas| deltas.as_flattened().iter().all(|&it| it == 0.0)) {
                continue;
            }
            budget.spend_deltas(self.count, self.pointer)?;
            let mut finite = |deltas: &Option<Vec<[f32; 3]>>, at: usize| {
                let delta = deltas.as_ref().map_or([0.0; 3], |deltas| deltas[at]);
                let is_finite = delta.iter().all(|value| value.is_finite());
                geometry.odd_delta_count += usize::from(!is_finite);
                if is_finite { delta } else { [0.0; 3] }
            };
            let delta = |at| MorphDelta {
                position: finite(&all[0], at),
                normal: finite(&all[1], at),
                tangent: finite(&all[2], at),
            };
            let deltas = (0..self.count).map(delta).collect();
            geometry.targets.push((at, MorphTarget { deltas }));
        }
        Ok(())
    }

    /// Hangs vertices on joints that move.
    fn hang(&self, geometry: &mut Geometry, joints: usize, budget: &mut Budget) -> Result<(), SceneError> {
        for pairs in self.influences(joints, budget)? {
            geometry.odd_weight_count += usize::from(is_odd(&pairs));
            let (influence, dropped_share) = heaviest(&pairs);
            geometry.dropped_joint_count += usize::from(dropped_share > DROPPED_SHARE_MAX);
            geometry.influences.push(influence);
        }
        Ok(())
    }

    /// Moves vertices by the weighted joint matrices (glTF 2.0, section 3.7.3.3).
    fn skin(&self, geometry: &mut Geometry, joints: &[DMat4], budget: &mut Budget) -> Result<(), SceneError> {
        let influences = self.influences(joints.len(), budget)?;
        for (at, influence) in influences.iter().enumerate() {
            let total: f64 = influence.iter().map(|&(_, weight)| weight).sum();
            geometry.odd_weight_count += usize::from(is_odd(influence));
            // A vertex that no joint holds stays where it was modelled.
            if !(total > 0.0 && total.is_finite()) {
                continue;
            }
            let mut blend = DMat4::ZERO;
            for &(joint, weight) in influence {
                blend += joints[joint] * (weight / total);
            }
            place(geometry, at, blend);
        }
        Ok(())
    }

    /// Joint and weight pairs of each vertex, from all `JOINTS_n`/`WEIGHTS_n` sets.
    fn influences(
        &self,
        joint_count: usize,
        budget: &mut Budget,
    ) -> Result<Vec<Vec<(usize, f64)>>, SceneError> {
        let mut influences = vec![Vec::new(); self.count];
        for set in 0.. {
            let (joints_name, weights_name) = (format!("JOINTS_{set}"), format!("WEIGHTS_{set}"));
            let attributes = &self.primitive.attributes;
            let Some(&joints) = attributes.get(&joints_name) else { break };
            let weights =
                self.attribute::<4>(attributes, "/attributes", &weights_name, &["VEC4"], [0.0; 4])?;
            let Some(weights) = weights else { break };
            budget.spend(4 * self.count as u64, self.pointer)?;
            let user = format!("{}/attributes/{joints_name}", self.pointer);
            let joints = self.data.unsigned::<4>(joints, &user, &["VEC4"])?;
            self.check_count(joints.len(), &user)?;
            for (at, influence) in influences.iter_mut().enumerate() {
                for (&joint, &weight) in
                    joints[at].iter().zip(&weights[at]).filter(|(_, weight)| **weight != 0.0)
                {
                    if joint as usize >= joint_count {
                        return Err(SceneError::new(
                            user,
                            format!("joint {joint} is outside the skin's {joint_count}"),
                        ));
                    }
                    influence.push((joint as usize, f64::from(weight)));
                }
            }
        }
        Ok(influences)
    }
}

fn add<const N: usize>(value: &mut [f32; N], delta: Option<[f32; 3]>, weight: f32) {
    for (value, delta) in value.iter_mut().zip(delta.unwrap_or([0.0; 3])) {
        *value += weight * delta;
    }
}

/// Whether weights are negative, no numbers, or do not sum up to 1.
fn is_odd(pairs: &[(usize, f64)]) -> bool {
    let total: f64 = pairs.iter().map(|&(_, weight)| weight).sum();
    total.is_nan() || (total - 1.0).abs() > WEIGHT_SUM_TOLERANCE || pairs.iter().any(|(_, it)| *it < 0.0)
}

/// The four heaviest of a vertex's joints, in the file's order, and the share of those left out. A vertex that no
/// joint holds hangs on the first: a weight that is missing cannot hold it where it was modelled.
fn heaviest(pairs: &[(usize, f64)]) -> (Influence, f64) {
    let usable = |weight: f64| weight > 0.0 && weight.is_finite();
    let all: Vec<(usize, f64)> = pairs.iter().copied().filter(|&(_, weight)| usable(weight)).collect();
    let mut order: Vec<usize> = (0..all.len()).collect();
    order.sort_by(|&a, &b| all[b].1.total_cmp(&all[a].1));
    order.truncate(4);
    order.sort_unstable();
    let sum: f64 = order.iter().map(|&at| all[at].1).sum();
    let total: f64 = all.iter().map(|&(_, weight)| weight).sum();
    let scale = if (sum - 1.0).abs() <= SCALED_SUM_TOLERANCE { 1.0 } else { sum };
    let shares = order.into_iter().map(|at| (all[at].0 as u16, (all[at].1 / scale) as f32));
    let mut influence = Influence::default();
    for (at, (joint, weight)) in shares.filter(|(_, weight)| *weight > 0.0).enumerate() {
        (influence.joints[at], influence.weights[at]) = (joint, weight);
    }
    if influence.weights == [0.0; 4] {
        influence.weights[0] = 1.0;
    }
    (influence, if total > 0.0 { 1.0 - sum / total } else { 0.0 })
}
