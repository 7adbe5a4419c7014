//! Poses of real files beside what the `gltf` crate reads of them and a slow evaluation of its own.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use glam::{DMat4, DQuat, DVec3};
use gltf::animation::util::ReadOutputs;
use gltf::animation::{Interpolation, Property};

use super::corpus::{corpus, files_below, report};
use super::playing::placed;
use crate::{load, pack};

/// Triangles by the node that shows them: sums of corners, as mirroring turns their order.
type Triangles = BTreeMap<String, Vec<DVec3>>;

struct Other {
    file: gltf::Gltf,
    buffers: Vec<Vec<u8>>,
}

/// What a channel sets, by node.
#[derive(Clone, Default)]
struct Local {
    translation: DVec3,
    rotation: DQuat,
    scale: DVec3,
    weights: Vec<f64>,
    matrix: Option<DMat4>,
}

impl Other {
    fn open(path: &Path) -> Option<Other> {
        let file = gltf::Gltf::from_slice(&std::fs::read(path).ok()?).ok()?;
        let read = |buffer: gltf::Buffer<'_>| match buffer.source() {
            gltf::buffer::Source::Bin => file.blob.clone(),
            gltf::buffer::Source::Uri(uri) => crate::uri::data_payload(uri)
                .or_else(|| std::fs::read(path.parent()?.join(uri.replace("%20", " "))).ok()),
        };
        let buffers = file.buffers().map(read).collect::<Option<Vec<_>>>()?;
        Some(Other { file, buffers })
    }

    fn locals(&self) -> Vec<Local> {
        let local = |node: gltf::Node<'_>| {
            let matrix = matches!(node.transform(), gltf::scene::Transform::Matrix { .. });
            let (translation, rotation, scale) = node.transform().clone().decomposed();
            let wide = |values: [f32; 3]| DVec3::from_array(values.map(f64::from));
            let of_mesh = || node.mesh().and_then(|mesh| mesh.weights().map(<[f32]>::to_vec));
            let weights = node.weights().map(<[f32]>::to_vec).or_else(of_mesh).unwrap_or_default();
            let columns = node.transform().matrix();
            Local {
                translation: wide(translation),
                rotation: DQuat::from_array(rotation.map(f64::from)).normalize(),
                scale: wide(scale),
                weights: weights.into_iter().map(f64::from).collect(),
                matrix: matrix.then(|| DMat4::from_cols_array_2d(&columns.map(|it| it.map(f64::from)))),
            }
        };
        self.file.nodes().map(local).collect()
    }

    fn play(&self, locals: &mut [Local], animation: usize, time_s: f64) {
        let Some(animation) = self.file.animations().nth(animation) else { return };
        for channel in animation.channels() {
            let reader = channel.reader(|buffer| Some(&self.buffers[buffer.index()]));
            let times: Vec<f64> = reader.read_inputs().unwrap().map(f64::from).collect();
            let values: Vec<f64> = match reader.read_outputs().unwrap() {
                ReadOutputs::Translations(it) => it.flatten().map(f64::from).collect(),
                ReadOutputs::Rotations(it) => it.into_f32().flatten().map(f64::from).collect(),
                ReadOutputs::Scales(it) => it.flatten().map(f64::from).collect(),
                ReadOutputs::MorphTargetWeights(it) => it.into_f32().map(f64::from).collect(),
            };
            let property = channel.target().property();
            let is_rotation = property == Property::Rotation;
            let value = sample(channel.sampler().interpolation(), &times, &values, time_s, is_rotation);
            let local = &mut locals[channel.target().node().index()];
            match property {
                Property::Translation => local.translation = DVec3::from_slice(&value),
                Property::Rotation => local.rotation = DQuat::from_slice(&value).normalize(),
                Property::Scale => local.scale = DVec3::from_slice(&value),
                Property::MorphTargetWeights => local.weights = value,
            }
        }
    }

    fn worlds(&self, locals: &[Local]) -> Vec<DMat4> {
        let mut worlds = vec![DMat4::IDENTITY; locals.len()];
        let parents: BTreeMap<usize, usize> = self
            .file
            .nodes()
            .flat_map(|node| node.children().map(move |child| (child.index(), node.index())))
            .collect();
        for (node, world) in worlds.iter_mut().enumerate() {
            let chain = std::iter::successors(Some(node), |at| parents.get(at).copied());
            *world = chain.fold(DMat4::IDENTITY, |below, at| {
                let Local { translation, rotation, scale, matrix, .. } = locals[at].clone();
                let trs = || {
                    DMat4::from_translation(translation)
                        * DMat4::from_quat(rotation)
                        * DMat4::from_scale(scale)
                };
                matrix.unwrap_or_else(trs) * below
            });
        }
        worlds
    }

    fn triangles(&self, animation: Option<usize>, time_s: f64) -> Triangles {
        let mut locals = self.locals();
        if let Some(animation) = animation {
            self.play(&mut locals, animation, time_s);
        }
        let worlds = self.worlds(&locals);
        let mut found = Triangles::new();
        let scene = self.file.default_scene().or_else(|| self.file.scenes().next());
        let mut stack: Vec<gltf::Node<'_>> = scene.map(|it| it.nodes().collect()).unwrap_or_default();
        while let Some(node) = stack.pop() {
            stack.extend(node.children());
            let Some(mesh) = node.mesh() else { continue };
            let name = node.name().map_or_else(|| format!("node {}", node.index()), str::to_owned);
            for primitive in mesh.primitives().filter(|it| it.mode() == gltf::mesh::Mode::Triangles) {
                let sums = self.primitive(&node, &primitive, &locals[node.index()].weights, &worlds);
                found.entry(name.clone()).or_default().extend(sums);
            }
        }
        found
    }

    fn primitive(
        &self,
        node: &gltf::Node<'_>,
        primitive: &gltf::Primitive<'_>,
        weights: &[f64],
        worlds: &[DMat4],
    ) -> Vec<DVec3> {
        let reader = primitive.reader(|buffer| Some(&self.buffers[buffer.index()]));
        let wide = |it: [f32; 3]| DVec3::from_array(it.map(f64::from));
        let mut positions: Vec<DVec3> = reader.read_positions().into_iter().flatten().map(wide).collect();
        for ((deltas, ..), &weight) in reader.read_morph_targets().zip(weights) {
            for (position, delta) in positions.iter_mut().zip(deltas.into_iter().flatten()) {
                *position += weight * wide(delta);
            }
        }
        match (node.skin(), reader.read_joints(0), reader.read_weights(0)) {
            (Some(skin), Some(joints), Some(weights)) => {
                let binds =
                    skin.reader(|buffer| Some(&self.buffers[buffer.index()])).read_inverse_bind_matrices();
                let binds: Option<Vec<DMat4>> = binds.map(|them| {
                    them.map(|it| DMat4::from_cols_array_2d(&it.map(|column| column.map(f64::from))))
                        .collect()
                });
                let joint = |(at, node): (usize, gltf::Node<'_>)| {
                    worlds[node.index()] * binds.as_ref().map_or(DMat4::IDENTITY, |binds| binds[at])
                };
                let matrices: Vec<DMat4> = skin.joints().enumerate().map(joint).collect();
                let pairs = joints.into_u16().zip(weights.into_f32());
                for (position, (joints, weights)) in positions.iter_mut().zip(pairs) {
                    let total: f32 = weights.iter().sum();
                    let parts = joints.iter().zip(weights);
                    let moved = parts.map(|(&joint, weight)| {
                        f64::from(weight / total) * matrices[usize::from(joint)].transform_point3(*position)
                    });
                    *position = moved.sum();
                }
            }
            _ => positions.iter_mut().for_each(|it| *it = worlds[node.index()].transform_point3(*it)),
        }
        let indices: Vec<usize> = match reader.read_indices() {
            Some(indices) => indices.into_u32().map(|index| index as usize).collect(),
            None => (0..positions.len()).collect(),
        };
        indices.chunks_exact(3).map(|corners| corners.iter().map(|&at| positions[at]).sum()).collect()
    }
}

fn sample(mode: Interpolation, times: &[f64], values: &[f64], at_s: f64, is_rotation: bool) -> Vec<f64> {
    let cubic = mode == Interpolation::CubicSpline;
    let width = values.len() / times.len() / if cubic { 3 } else { 1 };
    let row = |row: usize| &values[row * width..(row + 1) * width];
    let key = |key: usize| row(if cubic { 3 * key + 1 } else { key });
    let Some(next) = times.iter().position(|&time| time > at_s).filter(|&next| next > 0) else {
        return key(if at_s < times[0] { 0 } else { times.len() - 1 }).to_vec();
    };
    let span = times[next] - times[next - 1];
    let t = (at_s - times[next - 1]) / span;
    let (a, b) = (key(next - 1), key(next));
    match mode {
        Interpolation::Step => a.to_vec(),
        Interpolation::Linear if is_rotation => {
            DQuat::from_slice(a).normalize().slerp(DQuat::from_slice(b).normalize(), t).to_array().to_vec()
        }
        Interpolation::Linear => a.iter().zip(b).map(|(a, b)| (1.0 - t) * a + t * b).collect(),
        Interpolation::CubicSpline => {
            let (out, into) = (row(3 * (next - 1) + 2), row(3 * next));
            let value = |at: usize| {
                (2.0 * t.powi(3) - 3.0 * t * t + 1.0) * a[at]
                    + span * (t.powi(3) - 2.0 * t * t + t) * out[at]
                    + (3.0 * t * t - 2.0 * t.powi(3)) * b[at]
                    + span * (t.powi(3) - t * t) * into[at]
            };
            (0..width).map(value).collect()
        }
    }
}

/// Sums of corners of our own pose.
fn ours(scene: &crate::Scene, animation: Option<usize>, time_s: f64) -> Triangles {
    let posed = scene.pose(animation, time_s);
    let mut found = Triangles::new();
    for (at, draw) in scene.draws.iter().enumerate() {
        let corners = placed(scene, &posed, at);
        let wide = |index: &u32| DVec3::from_array(corners[*index as usize].map(f64::from));
        let triangles = scene.primitives[draw.primitive].indices.chunks_exact(3);
        let sums = triangles.map(|triangle| triangle.iter().map(wide).sum::<DVec3>());
        found.entry(draw.name.clone()).or_default().extend(sums);
    }
    found
}

/// Largest distance between equal triangles, in units of the scene's size; `None` where there are not as many.
fn difference(a: &Triangles, b: &Triangles) -> Option<f64> {
    let counts =
        |them: &Triangles| them.iter().map(|(name, it)| (name.clone(), it.len())).collect::<Vec<_>>();
    if counts(a) != counts(b) {
        return None;
    }
    let size = b.values().flatten().map(|it| it.length()).fold(1e-9, f64::max);
    let far = a.values().flatten().zip(b.values().flatten()).map(|(a, b)| (*a - *b).length() / size);
    Some(far.fold(0.0, f64::max))
}

#[test]
fn poses_of_real_files_are_those_of_a_second_reader() {
    let Some(corpus) = corpus() else { return };
    let mut files = Vec::new();
    files_below(&corpus.join("gltf"), &corpus, &mut files);
    let (mut compared, mut effects, mut skipped) = (0, BTreeMap::<&str, usize>::new(), Vec::new());
    for file in files {
        let Some(other) = Other::open(&corpus.join(&file)).filter(|it| it.file.animations().len() > 0) else {
            continue;
        };
        let bytes = std::fs::read(corpus.join(&file)).unwrap();
        let packed = pack(&file, &bytes, &mut |path| std::fs::read(corpus.join(path)).ok().map(Arc::from));
        let Some(scene) = packed.glb.as_ref().map(|glb| load(glb).unwrap()) else { continue };
        let name = |at: usize| other.file.animations().nth(at).unwrap().name().unwrap_or_default().to_owned();
        let same = (0..scene.animations.len()).all(|at| scene.animations[at].name == name(at));
        if !same || scene.animations.len() != other.file.animations().len() || !scene.hidden.is_empty() {
            skipped.push(file);
            continue;
        }
        for animation in std::iter::once(None).chain((0..scene.animations.len().min(3)).map(Some)) {
            let duration_s = animation.map_or(0.0, |at| f64::from(scene.animations[at].duration_s()));
            for part in [0.0, 0.13, 0.5, 0.77, 1.0] {
                let time_s = part * duration_s;
                match difference(&ours(&scene, animation, time_s), &other.triangles(animation, time_s)) {
                    Some(far) => assert!(far <= 1e-5, "{file} {animation:?} at {time_s} s: {far}"),
                    None => skipped.push(format!("{file}: other triangles")),
                }
            }
        }
        compared += 1;
        for effect in packed.all_effects().into_iter().filter(|effect| effect.is_of_geometry()) {
            *effects.entry(effect.name()).or_default() += 1;
        }
    }
    skipped.dedup();
    report(&format!("second reader: {compared} files compared, {effects:?}, not compared: {skipped:#?}"));
    assert!(compared >= 20 && effects["skin"] >= 4 && effects["morph"] >= 4, "{compared} {effects:?}");
}

#[test]
fn second_reader_notices_another_time() {
    let Some(corpus) = corpus() else { return };
    let file = "gltf/khronos-sample-assets/Fox/glTF/Fox.gltf";
    let other = Other::open(&corpus.join(file)).unwrap();
    let bytes = std::fs::read(corpus.join(file)).unwrap();
    let packed = pack(file, &bytes, &mut |path| std::fs::read(corpus.join(path)).ok().map(Arc::from));
    let scene = load(&packed.glb.unwrap()).unwrap();
    assert!(difference(&ours(&scene, Some(1), 0.3), &other.triangles(Some(1), 0.31)).unwrap() > 1e-4);
}
