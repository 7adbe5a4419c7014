//! Reads a file's animations. One that is wrong is left out with a warning: the rest pose needs none of them.
//! Warnings have the places of `conform/animations`, whose word on the same place then is not needed.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};

use crate::accessor::Data;
use crate::schema::{AnimationChannel, AnimationSampler, Root};
use crate::{
    Animation, CameraProperty, Channel, Curve, Interpolation, LightProperty, MaterialProperty, SceneError,
    Target, limits, schema,
};

/// Animations whose targets are indices into the file's tables.
#[derive(Debug, Default)]
pub(crate) struct Motion {
    pub animations: Vec<Animation>,
    pub warnings: Vec<SceneError>,
    pub notes: Vec<String>,
}

/// Smallest and largest value of each component of an animated property.
pub(crate) type Ranges = Vec<(MaterialProperty, Vec<[f32; 2]>)>;

/// The same of a light.
pub(crate) type LightRanges = Vec<(LightProperty, Vec<[f32; 2]>)>;

pub(crate) fn read(data: &Data<'_>) -> Motion {
    let mut reader = Reader {
        data,
        channels_left: limits::CHANNEL_COUNT_MAX,
        values_left: limits::CURVE_VALUE_COUNT_MAX,
        notes: Vec::new(),
    };
    let mut motion = Motion::default();
    for (index, source) in data.root.animations.iter().enumerate() {
        match reader.animation(index, source) {
            Ok(animation) if animation.channels.is_empty() => {}
            Ok(animation) => motion.animations.push(animation),
            Err(error) if motion.warnings.len() < limits::NOTE_COUNT_MAX => {
                motion.warnings.push(error.with_help("the animation is left out, the rest pose is drawn"));
            }
            Err(_) => {}
        }
    }
    motion.notes = reader.notes;
    motion
}

impl Motion {
    pub fn targets(&self) -> impl Iterator<Item = (Target, &Curve)> {
        self.animations.iter().flat_map(|animation| {
            animation.channels.iter().map(|channel| (channel.target, &animation.curves[channel.curve]))
        })
    }

    /// Nodes that any channel moves, shows or hides; weights belong to draws.
    pub fn nodes(&self) -> BTreeSet<usize> {
        self.targets().filter_map(|(target, _)| node_of(target)).collect()
    }

    /// Nodes whose visibility any channel sets.
    pub fn blinking(&self) -> BTreeSet<usize> {
        let node = |target| if let Target::Visibility { node } = target { Some(node) } else { None };
        self.targets().filter_map(|(target, _)| node(target)).collect()
    }

    /// What the animations do to each material.
    pub fn material_ranges(&self) -> BTreeMap<usize, Ranges> {
        let mut ranges: BTreeMap<usize, Ranges> = BTreeMap::new();
        for (target, curve) in self.targets() {
            if let Target::Material { material, property } = target {
                ranges.entry(material).or_default().push((property, curve.range()));
            }
        }
        ranges
    }

    /// What the animations do to each light.
    pub fn light_ranges(&self) -> BTreeMap<usize, LightRanges> {
        let mut ranges: BTreeMap<usize, LightRanges> = BTreeMap::new();
        for (target, curve) in self.targets() {
            if let Target::Light { light, property } = target {
                ranges.entry(light).or_default().push((property, curve.range()));
            }
        }
        ranges
    }
}

fn node_of(target: Target) -> Option<usize> {
    match target {
        Target::Translation { node }
        | Target::Rotation { node }
        | Target::Scale { node }
        | Target::Visibility { node } => Some(node),
        Target::Weights { .. } | Target::Material { .. } | Target::Camera { .. } | Target::Light { .. } => {
            None
        }
    }
}

/// A channel's target in a scene.
pub(crate) struct Resolved<'a> {
    pub target: Target,
    /// The components of the curve that are left; `None` for all.
    pub components: Option<&'a [usize]>,
}

/// Turns targets into those of a scene, of which there may be several or none, and drops what is left without any.
/// Curves are numbered in the order of their first use, as reading does it.
pub(crate) fn retarget<'a>(
    animations: Vec<Animation>,
    resolve: &dyn Fn(Target) -> Vec<Resolved<'a>>,
) -> Vec<Animation> {
    // A file can have a thousand cameras that are one, and a thousand channels for it.
    let (mut left, mut values_left) = (limits::CHANNEL_COUNT_MAX, limits::CURVE_VALUE_COUNT_MAX);
    let retargeted = animations.into_iter().map(|source| {
        let mut animation = Animation { name: source.name, ..Animation::default() };
        let mut numbers = BTreeMap::new();
        for channel in &source.channels {
            for Resolved { target, components } in resolve(channel.target).into_iter().take(left) {
                left -= 1;
                let curve = match numbers.entry((channel.curve, components)) {
                    Entry::Occupied(known) => *known.get(),
                    Entry::Vacant(place) => {
                        let whole = &source.curves[channel.curve];
                        let Some(rest) = values_left.checked_sub(whole.values.len()) else { continue };
                        values_left = rest;
                        let part = components.filter(|them| !them.iter().copied().eq(0..whole.width));
                        let curve = part.map_or_else(|| whole.clone(), |them| whole.components(them));
                        animation.curves.push(curve);
                        *place.insert(animation.curves.len() - 1)
                    }
                };
                animation.channels.push(Channel { target, curve });
            }
        }
        animation
    });
    retargeted.filter(|animation| !animation.channels.is_empty()).collect()
}

/// How the file's tables became the scene's.
pub(crate) struct Renumbering<'a> {
    pub nodes: &'a BTreeMap<usize, usize>,
    /// With the properties that still matter.
    pub materials: &'a BTreeMap<usize, (usize, Vec<MaterialProperty>)>,
    pub cameras: BTreeMap<usize, Vec<usize>>,
    pub lights: BTreeMap<usize, Vec<usize>>,
    /// Morphing draws by the file's node, with the targets that each has.
    pub morphs: BTreeMap<usize, Vec<(usize, &'a [usize])>>,
}

impl<'a> Renumbering<'a> {
    pub fn apply(&self, target: Target) -> Vec<Resolved<'a>> {
        if let Target::Weights { morph: node } = target {
            let draws = self.morphs.get(&node).into_iter().flatten();
            let resolved = |&(morph, targets): &(usize, &'a [usize])| Resolved {
                target: Target::Weights { morph },
                components: Some(targets),
            };
            return draws.map(resolved).collect();
        }
        let whole = |target| Resolved { target, components: None };
        self.whole(target).into_iter().map(whole).collect()
    }

    fn whole(&self, target: Target) -> Vec<Target> {
        let node = |node: usize| self.nodes.get(&node).copied();
        let one = |target: Option<Target>| target.into_iter().collect();
        match target {
            Target::Translation { node: it } => one(node(it).map(|node| Target::Translation { node })),
            Target::Rotation { node: it } => one(node(it).map(|node| Target::Rotation { node })),
            Target::Scale { node: it } => one(node(it).map(|node| Target::Scale { node })),
            Target::Weights { .. } => Vec::new(),
            Target::Visibility { node: it } => one(node(it).map(|node| Target::Visibility { node })),
            Target::Material { material, property } => {
                let found = self.materials.get(&material).filter(|(_, left)| left.contains(&property));
                one(found.map(|&(material, _)| Target::Material { material, property }))
            }
            Target::Camera { camera, property } => {
                let copies = self.cameras.get(&camera).into_iter().flatten();
                copies.map(|&camera| Target::Camera { camera, property }).collect()
            }
            Target::Light { light, property } => {
                let copies = self.lights.get(&light).into_iter().flatten();
                copies.map(|&light| Target::Light { light, property }).collect()
            }
        }
    }
}

struct Reader<'a, 'b> {
    data: &'a Data<'b>,
    channels_left: usize,
    values_left: usize,
    notes: Vec<String>,
}

/// What the values of a target look like.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Shape {
    width: usize,
    /// Numbers of a value are elements of their own, as weights are.
    is_list: bool,
    is_rotation: bool,
    is_flag: bool,
}

impl Reader<'_, '_> {
    fn animation(&mut self, index: usize, source: &schema::Animation) -> Result<Animation, SceneError> {
        let place = format!("/animations/{index}");
        let mut animation =
            Animation { name: source.name.clone().unwrap_or_default(), ..Animation::default() };
        let (mut known, mut seen) = (BTreeMap::new(), BTreeMap::new());
        for (at, channel) in source.channels.iter().enumerate() {
            let user = format!("{place}/channels/{at}");
            self.channels_left = self.channels_left.checked_sub(1).ok_or_else(|| {
                SceneError::new(&user, format!("more than {} channels", limits::CHANNEL_COUNT_MAX))
            })?;
            let sampler = source.samplers.get(channel.sampler).ok_or_else(|| {
                let count = source.samplers.len();
                let reason = format!("sampler {} does not exist, the animation has {count}", channel.sampler);
                SceneError::new(format!("{user}/sampler"), reason)
            })?;
            let Some(target) = self.target(channel, &user)? else { continue };
            if let Some(first) = seen.insert(target, at) {
                let reason = format!("channel {at} moves the same");
                return Err(SceneError::new(format!("{place}/channels/{first}/target"), reason));
            }
            let shape = self.shape(target, &user)?;
            let curve = match known.get(&(channel.sampler, shape)) {
                Some(&curve) => curve,
                None => {
                    animation.curves.push(self.curve(
                        sampler,
                        shape,
                        &format!("{place}/samplers/{}", channel.sampler),
                        &format!("{user}/sampler"),
                    )?);
                    known.insert((channel.sampler, shape), animation.curves.len() - 1);
                    animation.curves.len() - 1
                }
            };
            animation.channels.push(Channel { target, curve });
        }
        Ok(animation)
    }

    /// What a channel moves; `None` for what an extension defines that is not known here.
    fn target(&mut self, channel: &AnimationChannel, user: &str) -> Result<Option<Target>, SceneError> {
        let root = self.data.root;
        let target = &channel.target;
        if let (Some(pointer), "pointer") = (&target.extensions.pointer, target.path.as_str()) {
            let place = format!("{user}/target/extensions/KHR_animation_pointer/pointer");
            let found = pointed(root, &pointer.pointer, &place)?;
            if found.is_none() {
                self.notes
                    .push(format!("{place}: `{}` is not animated", crate::uri::shorten(&pointer.pointer)));
            }
            return Ok(found);
        }
        let Some(node) = target.node else { return Ok(None) };
        let found = match target.path.as_str() {
            "translation" => Target::Translation { node },
            "rotation" => Target::Rotation { node },
            "scale" => Target::Scale { node },
            "weights" => Target::Weights { morph: node },
            other => {
                let reason = format!(
                    "`{}` is none of translation, rotation, scale, weights",
                    crate::uri::shorten(other)
                );
                return Err(SceneError::new(format!("{user}/target/path"), reason));
            }
        };
        if node >= root.nodes.len() {
            let reason = format!("node {node} does not exist, the file has {}", root.nodes.len());
            return Err(SceneError::new(format!("{user}/target/node"), reason));
        }
        check_movable(root, found, node, &format!("{user}/target"))?;
        Ok(Some(found))
    }

    fn shape(&self, target: Target, user: &str) -> Result<Shape, SceneError> {
        let plain = |width| Shape { width, is_list: false, is_rotation: false, is_flag: false };
        Ok(match target {
            Target::Translation { .. } | Target::Scale { .. } => plain(3),
            Target::Rotation { .. } => Shape { is_rotation: true, ..plain(4) },
            Target::Visibility { .. } => Shape { is_flag: true, ..plain(1) },
            Target::Material { property, .. } => plain(property.width()),
            Target::Light { property, .. } => plain(property.width()),
            Target::Camera { .. } => plain(1),
            Target::Weights { morph: node } => {
                Shape { is_list: true, ..plain(self.weight_count(node, user)?) }
            }
        })
    }

    /// Morph targets of a node's mesh.
    fn weight_count(&self, node: usize, user: &str) -> Result<usize, SceneError> {
        let root = self.data.root;
        let mesh = root.nodes[node].mesh.and_then(|mesh| root.meshes.get(mesh));
        let count = mesh.and_then(|mesh| mesh.primitives.first()).map_or(0, |it| it.targets.len());
        if count > 0 {
            Ok(count)
        } else {
            Err(SceneError::new(format!("{user}/target"), format!("node {node} has no morph targets")))
        }
    }

    /// `place` is the sampler's, `user` that of the channel that wants it.
    fn curve(
        &mut self,
        sampler: &AnimationSampler,
        shape: Shape,
        place: &str,
        user: &str,
    ) -> Result<Curve, SceneError> {
        let interpolation = interpolation(sampler, place)?;
        if shape.is_flag && interpolation != Interpolation::Step {
            return Err(SceneError::new(
                format!("{place}/interpolation"),
                "flags have nothing between them: it must be STEP",
            ));
        }
        let (input, output) = (format!("{place}/input"), format!("{place}/output"));
        let key_count = self.data.count(sampler.input, &input)?;
        let rows =
            if interpolation == Interpolation::CubicSpline { key_count.saturating_mul(3) } else { key_count };
        let wanted = if shape.is_list { rows.saturating_mul(shape.width as u64) } else { rows };
        let actual = self.data.count(sampler.output, &output)?;
        if actual != wanted {
            let reason = format!("{actual} values, {wanted} are needed for {key_count} times");
            return Err(SceneError::new(user, reason));
        }
        let cost = key_count.saturating_add(rows.saturating_mul(shape.width as u64));
        let left = usize::try_from(cost).ok().and_then(|cost| self.values_left.checked_sub(cost));
        self.values_left = left.ok_or_else(|| {
            let limit = limits::CURVE_VALUE_COUNT_MAX;
            SceneError::new(place, format!("the times and values of all animations exceed {limit}"))
        })?;
        let times_s = self.times(sampler.input, &input)?;
        if interpolation == Interpolation::CubicSpline && times_s.len() < 2 {
            return Err(SceneError::new(input, "a spline needs two times"));
        }
        let values = self.values(sampler.output, user, shape)?;
        Ok(Curve { interpolation, is_rotation: shape.is_rotation, times_s, width: shape.width, values })
    }

    fn times(&self, index: usize, user: &str) -> Result<Vec<f32>, SceneError> {
        if !self.data.is_float(index) || self.data.root.accessors[index].kind != "SCALAR" {
            return Err(SceneError::new(user, format!("accessor {index}: times must be float scalars")));
        }
        let times = self.data.floats::<1>(index, user, &["SCALAR"], [0.0])?.concat();
        let Some(&first) = times.first() else {
            let count = format!("/accessors/{index}/count");
            return Err(SceneError::new(count, "an animation needs a time"));
        };
        if !(first >= 0.0 && times.iter().all(|time| time.is_finite())) {
            let reason = format!("accessor {index}: times must be finite and not negative");
            return Err(SceneError::new(user, reason));
        }
        match times.windows(2).position(|pair| pair[0] >= pair[1]) {
            None => Ok(times),
            Some(at) => {
                let reason = format!(
                    "accessor {index}: time {} s (number {}) does not come after {} s",
                    times[at + 1],
                    at + 1,
                    times[at]
                );
                Err(SceneError::new(user, reason))
            }
        }
    }

    fn values(&self, index: usize, user: &str, shape: Shape) -> Result<Vec<f32>, SceneError> {
        let kind = match (shape.is_list, shape.width) {
            (true, _) | (_, 1) => "SCALAR",
            (_, 2) => "VEC2",
            (_, 3) => "VEC3",
            _ => "VEC4",
        };
        let is_format = if shape.is_flag {
            self.data.is_byte(index)
        } else {
            self.data.is_float(index) || self.data.is_normalized(index)
        };
        if !is_format || self.data.root.accessors[index].kind != kind {
            let wanted = if shape.is_flag { "unsigned bytes" } else { "floats or normalised integers" };
            let reason = format!("accessor {index}: the values must be {kind} of {wanted}");
            return Err(SceneError::new(user, reason));
        }
        let values = match kind {
            "SCALAR" => self.data.floats::<1>(index, user, &[kind], [0.0])?.concat(),
            "VEC2" => self.data.floats::<2>(index, user, &[kind], [0.0; 2])?.concat(),
            "VEC3" => self.data.floats::<3>(index, user, &[kind], [0.0; 3])?.concat(),
            _ => self.data.floats::<4>(index, user, &[kind], [0.0; 4])?.concat(),
        };
        match values.iter().position(|value| !value.is_finite()) {
            None if shape.is_flag => {
                Ok(values.into_iter().map(|flag| f32::from(u8::from(flag != 0.0))).collect())
            }
            None => Ok(values),
            Some(at) => Err(SceneError::new(user, format!("accessor {index}: number {at} is not finite"))),
        }
    }
}

fn interpolation(sampler: &AnimationSampler, place: &str) -> Result<Interpolation, SceneError> {
    match sampler.interpolation.as_deref() {
        None | Some("LINEAR") => Ok(Interpolation::Linear),
        Some("STEP") => Ok(Interpolation::Step),
        Some("CUBICSPLINE") => Ok(Interpolation::CubicSpline),
        Some(_) => {
            Err(SceneError::new(format!("{place}/interpolation"), "it is none of LINEAR, STEP, CUBICSPLINE"))
        }
    }
}

fn check_movable(root: &Root, target: Target, node: usize, place: &str) -> Result<(), SceneError> {
    let sets_part =
        matches!(target, Target::Translation { .. } | Target::Rotation { .. } | Target::Scale { .. });
    if sets_part && root.nodes[node].matrix.is_some() {
        return Err(SceneError::new(place, format!("node {node} has a matrix, so its parts cannot move")));
    }
    Ok(())
}

/// What a pointer of `KHR_animation_pointer` means; `None` for what no picture depends on.
///
/// # Errors
/// A table entry that does not exist.
fn pointed(root: &Root, pointer: &str, place: &str) -> Result<Option<Target>, SceneError> {
    let lights = root.extensions.lights.as_ref().map_or(&[][..], |lights| &lights.lights);
    let tables = [
        ("/nodes/", root.nodes.len()),
        ("/materials/", root.materials.len()),
        ("/cameras/", root.cameras.len()),
        ("/extensions/KHR_lights_punctual/lights/", lights.len()),
    ];
    let Some((table, count, rest)) =
        tables.into_iter().find_map(|(table, count)| Some((table, count, pointer.strip_prefix(table)?)))
    else {
        return Ok(None);
    };
    let (index, path) = rest.split_once('/').unwrap_or((rest, ""));
    let index = index.parse::<usize>().ok().filter(|index| *index < count).ok_or_else(|| {
        let pointer = crate::uri::shorten(pointer);
        SceneError::new(place, format!("`{pointer}` does not exist, the table has {count}"))
    })?;
    let target = match table {
        "/materials/" => {
            MaterialProperty::from_path(path).map(|property| Target::Material { material: index, property })
        }
        "/cameras/" => CameraProperty::from_path(path)
            .filter(|property| property.is_of(&root.cameras[index]))
            .map(|property| Target::Camera { camera: index, property }),
        "/nodes/" => node_target(path, index),
        _ => LightProperty::from_path(path)
            .filter(|property| property.is_of(&lights[index]))
            .map(|property| Target::Light { light: index, property }),
    };
    if let Some((target, node)) = target.and_then(|target| Some((target, node_of(target)?))) {
        check_movable(root, target, node, place)?;
    }
    Ok(target)
}

fn node_target(path: &str, node: usize) -> Option<Target> {
    Some(match path {
        "translation" => Target::Translation { node },
        "rotation" => Target::Rotation { node },
        "scale" => Target::Scale { node },
        "weights" => Target::Weights { morph: node },
        "extensions/KHR_node_visibility/visible" => Target::Visibility { node },
        _ => return None,
    })
}
