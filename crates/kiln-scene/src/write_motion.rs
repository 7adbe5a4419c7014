//! The moving part of a pack: nodes with what they carry, animations, variants. Other readers can play it.

use std::collections::{BTreeMap, BTreeSet};

use crate::schema::{
    self, Accessor, AnimationChannel, AnimationSampler, ChannelTarget, Pointer, TargetExtensions,
    VariantMapping, VariantMappings, Visibility,
};
use crate::write::{FLOAT, Placed, Writer, node};
use crate::write_geometry::whole;
use crate::{Animation, Curve, Interpolation, Item, Scene, Target, Transform};
use glam::Mat4;

const UNSIGNED_BYTE: u32 = 5121;

/// How a curve's values lie in an accessor.
#[derive(Clone, Copy)]
enum Stored {
    Vectors,
    /// One number after the other, as weights are.
    List,
    Flags,
}

fn stored(target: Target) -> Stored {
    match target {
        Target::Visibility { .. } => Stored::Flags,
        Target::Weights { .. } => Stored::List,
        _ => Stored::Vectors,
    }
}

impl Writer {
    /// Writes the nodes that move and, through `make`, what they carry; returns the number of the first one, and puts
    /// those of what is carried into `items`. What a node carries hangs before its other children, which is the order in
    /// which a reader numbers things.
    pub fn hierarchy(
        &mut self,
        scene: &Scene,
        make: &dyn Fn(Item, Mat4) -> schema::Node,
        items: &mut BTreeMap<Item, usize>,
    ) -> usize {
        let channels = scene.animations.iter().flat_map(|animation| &animation.channels);
        let blinking: BTreeSet<usize> = channels
            .filter_map(
                |channel| if let Target::Visibility { node } = channel.target { Some(node) } else { None },
            )
            .collect();
        let first = self.root.nodes.len();
        for (at, source) in scene.nodes.iter().enumerate() {
            let mut written = node(Some(source.name.clone()), Mat4::IDENTITY);
            match source.transform {
                Transform::Matrix(matrix) => written.matrix = Some(matrix.to_cols_array()),
                Transform::Parts { translation, rotation, scale } => {
                    (written.translation, written.rotation) = (Some(translation), Some(rotation));
                    written.scale = Some(scale);
                }
            }
            let visible = source.visible;
            let has_flag = !visible || blinking.contains(&at);
            written.extensions.visibility = has_flag.then_some(Visibility { visible });
            self.root.nodes.push(written);
        }
        for carried in &scene.carried {
            let child = self.root.nodes.len();
            items.insert(carried.item, child);
            self.root.nodes.push(make(carried.item, carried.local));
            self.root.nodes[first + carried.node].children.push(child);
        }
        for (at, source) in scene.nodes.iter().enumerate() {
            if let Some(parent) = source.parent {
                self.root.nodes[first + parent].children.push(first + at);
            }
        }
        first
    }

    /// Writes the animations of a scene whose nodes are there.
    pub fn animations(&mut self, animations: &[Animation], placed: &Placed) {
        // Curves of a bake mostly have the same times.
        let mut times = BTreeMap::new();
        for animation in animations {
            // A curve's channels all store it alike, or reading would have made two of it.
            let stored: BTreeMap<usize, Stored> =
                animation.channels.iter().map(|channel| (channel.curve, stored(channel.target))).collect();
            let samplers = animation.curves.iter().enumerate();
            let samplers = samplers.map(|(at, curve)| self.sampler(curve, stored[&at], &mut times)).collect();
            let channels = animation.channels.iter().map(|channel| AnimationChannel {
                sampler: channel.curve,
                target: channel_target(channel.target, placed),
            });
            let name = (!animation.name.is_empty()).then(|| animation.name.clone());
            let animation = schema::Animation { name, channels: channels.collect(), samplers };
            self.root.animations.push(animation);
        }
    }

    fn sampler(
        &mut self,
        curve: &Curve,
        stored: Stored,
        times: &mut BTreeMap<Vec<u8>, usize>,
    ) -> AnimationSampler {
        let bytes: Vec<u8> = bytemuck::cast_slice(&curve.times_s).to_vec();
        let input = match times.get(&bytes) {
            Some(&known) => known,
            None => {
                let ends =
                    curve.times_s.first().zip(curve.times_s.last()).map(|(&first, &last)| (first, last));
                let index = self.values(&bytes, FLOAT, curve.times_s.len(), 1, ends);
                *times.entry(bytes).or_insert(index)
            }
        };
        let (count, floats) = (curve.values.len(), bytemuck::cast_slice(&curve.values));
        let output = match stored {
            Stored::Flags => {
                let bytes: Vec<u8> = curve.values.iter().map(|&flag| u8::from(flag != 0.0)).collect();
                self.values(&bytes, UNSIGNED_BYTE, count, 1, None)
            }
            Stored::List => self.values(floats, FLOAT, count, 1, None),
            Stored::Vectors => self.values(floats, FLOAT, count / curve.width, curve.width, None),
        };
        let interpolation = match curve.interpolation {
            Interpolation::Linear => None,
            Interpolation::Step => Some("STEP".to_owned()),
            Interpolation::CubicSpline => Some("CUBICSPLINE".to_owned()),
        };
        AnimationSampler { input, output, interpolation }
    }

    fn values(
        &mut self,
        bytes: &[u8],
        component_type: u32,
        count: usize,
        width: usize,
        ends: Option<(f32, f32)>,
    ) -> usize {
        let view = self.view(bytes, None, None);
        let kind = if width == 1 { "SCALAR".to_owned() } else { format!("VEC{width}") };
        let (min, max) = (ends.map(|(min, _)| vec![min]), ends.map(|(_, max)| vec![max]));
        self.accessor(Accessor { min, max, ..whole(view, component_type, count, &kind) })
    }

    /// Writes the variants; the meshes, one a primitive, must be there.
    pub fn variants(&mut self, scene: &Scene) {
        if scene.variants.is_empty() {
            return;
        }
        let variants = scene.variants.iter().map(|name| schema::Variant { name: name.clone() }).collect();
        self.root.extensions.variants = Some(schema::Variants { variants });
        for source in &scene.variant_materials {
            let primitive = &mut self.root.meshes[source.primitive].primitives[0];
            let written = primitive.extensions.variants.get_or_insert_with(VariantMappings::default);
            let (material, variants) = (source.material, source.variants.clone());
            written.mappings.push(VariantMapping { material, variants });
        }
    }
}

fn channel_target(target: Target, placed: &Placed) -> ChannelTarget {
    let first_node = placed.first;
    let of_node = |node: usize, path: &str| ChannelTarget {
        node: Some(node),
        path: path.into(),
        ..ChannelTarget::default()
    };
    let pointer = |pointer: String| ChannelTarget {
        path: "pointer".into(),
        extensions: TargetExtensions { pointer: Some(Pointer { pointer }) },
        ..ChannelTarget::default()
    };
    match target {
        Target::Translation { node } => of_node(first_node + node, "translation"),
        Target::Rotation { node } => of_node(first_node + node, "rotation"),
        Target::Scale { node } => of_node(first_node + node, "scale"),
        Target::Weights { morph } => of_node(placed.morphs[morph], "weights"),
        Target::Visibility { node } => {
            pointer(format!("/nodes/{}/extensions/KHR_node_visibility/visible", first_node + node))
        }
        Target::Material { material, property } => {
            pointer(format!("/materials/{material}/{}", property.path()))
        }
        Target::Camera { camera, property } => pointer(format!("/cameras/{camera}/{}", property.path())),
        Target::Light { light, property } => {
            pointer(format!("/extensions/KHR_lights_punctual/lights/{light}/{}", property.path()))
        }
    }
}
