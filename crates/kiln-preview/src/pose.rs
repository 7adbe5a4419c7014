//! Where everything of a scene is in a frame.

use glam::{Mat3, Mat4, Vec3};
use kiln_scene::{Bounds, Draw, Posed};

use crate::scene_gpu::{GpuScene, all_draws};
use crate::view::AnimationTime;

/// A scene at a time of an animation, or at rest; kept from frame to frame.
#[derive(Debug)]
pub(crate) struct Pose {
    /// Matrices, weights, cameras, lights and materials.
    pub posed: Posed,
    /// Where draws are, then hidden ones.
    pub draws: Vec<Stand>,
    /// Of all that is seen; skinned, morphed and copied draws may reach less far.
    pub bounds: Option<Bounds>,
}

/// Where a draw is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stand {
    /// Object to world.
    pub world: Mat4,
    /// Whether its triangles are seen from inside out.
    pub mirrored: bool,
    pub visible: bool,
    /// Middle in the world, to sort by.
    pub center: Vec3,
    /// Half of its box's edges in the world.
    pub half: Vec3,
}

impl Pose {
    /// The scene as it is without animation.
    pub fn at_rest(scene: &GpuScene) -> Self {
        let mut pose = Pose { posed: Posed::default(), draws: Vec::new(), bounds: None };
        pose.update(scene, None);
        pose
    }

    /// Moves everything to where it is at `time`.
    pub fn update(&mut self, scene: &GpuScene, time: Option<AnimationTime>) {
        let (index, time_s) = time.map_or((None, 0.0), |time| (Some(time.index), time.time_s));
        self.posed.update(&scene.scene, index, time_s);
        self.draws.clear();
        let mut all: Option<Block> = None;
        let placed = self.posed.draws.iter().chain(&self.posed.hidden);
        for (draw, placed) in all_draws(&scene.scene).zip(placed) {
            let block = self.block(scene, draw, placed.world);
            let first = draw.instances.first().map_or(Mat4::IDENTITY, kiln_scene::Instance::matrix);
            let mirrored = (placed.world * first).determinant() < 0.0;
            let (world, visible) = (placed.world, placed.visible);
            self.draws.push(Stand { world, mirrored, visible, center: block.center, half: block.half });
            if visible && block.is_finite() {
                all = Some(all.map_or(block, |all| all.union(block)));
            }
        }
        // At rest the scene knows them without slack.
        self.bounds = if time.is_some() { all.map(Block::bounds) } else { scene.scene.bounds };
    }

    /// What a draw does not leave: a vertex stays between the places that its joints would give it.
    fn block(&self, scene: &GpuScene, draw: &Draw, world: Mat4) -> Block {
        let mut bounds = scene.scene.primitives[draw.primitive].bounds;
        let weights = draw.morph.map_or(&[][..], |morph| &self.posed.morphs[morph]);
        for (&weight, reach) in weights.iter().zip(&scene.meshes[draw.primitive].morph_reach) {
            let (one, other) = (weight * reach.min, weight * reach.max);
            bounds = Bounds { min: bounds.min + one.min(other), max: bounds.max + one.max(other) };
        }
        let object = Block::of(bounds);
        let join = |blocks: &mut dyn Iterator<Item = Block>| blocks.reduce(Block::union);
        let joined = match draw.skin {
            Some(skin) => join(&mut self.posed.skins[skin].iter().map(|&joint| object.moved(joint))),
            None => join(&mut draw.instances.iter().map(|copy| object.moved(world * copy.matrix()))),
        };
        joined.unwrap_or_else(|| object.moved(world))
    }
}

/// An axis-aligned box by its middle, which affine maps keep.
#[derive(Clone, Copy, Debug)]
struct Block {
    center: Vec3,
    half: Vec3,
}

impl Block {
    fn of(bounds: Bounds) -> Self {
        Block { center: (bounds.min + bounds.max) / 2.0, half: (bounds.max - bounds.min) / 2.0 }
    }

    fn moved(self, matrix: Mat4) -> Self {
        let linear = Mat3::from_mat4(matrix).abs();
        Block { center: matrix.transform_point3(self.center), half: linear * self.half }
    }

    fn union(self, other: Self) -> Self {
        let (a, b) = (self.bounds(), other.bounds());
        Block::of(Bounds { min: a.min.min(b.min), max: a.max.max(b.max) })
    }

    fn bounds(self) -> Bounds {
        Bounds { min: self.center - self.half, max: self.center + self.half }
    }

    fn is_finite(self) -> bool {
        self.center.is_finite() && self.half.is_finite()
    }
}
