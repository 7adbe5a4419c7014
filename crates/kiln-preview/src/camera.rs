//! The camera: around a point, set by the hand or by the file.

use std::f32::consts::{FRAC_PI_2, PI, TAU};

use glam::camera::rh::proj::directx::{orthographic, perspective};
use glam::{Mat3, Mat4, Vec3};
use kiln_scene::{Bounds, Camera, Scene};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Vertical field of view where no camera of the file says another: a short telephoto, as for products.
const FIELD_OF_VIEW_RAD: f32 = 35.0 * PI / 180.0;
/// Pitch stops short of the poles, where "up" is not defined.
const PITCH_MAX_RAD: f32 = FRAC_PI_2 - 0.01;
/// How much farther than the target's distance the eye of parallel rays is for shaders: to them a scene is 1e-4 rad wide.
const ORTHOGRAPHIC_DISTANCE: f32 = 1e4;
/// How near and how far the hand may bring it.
const DISTANCES: (f32, f32) = (1e-5, 1e7);
/// Room left around the scene, as a factor of the distance at which it just fits.
const FRAME_MARGIN: f32 = 1.06;

/// Looks at a point from a direction and a distance; +Y is up.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct OrbitCamera {
    /// What it looks at.
    #[serde(serialize_with = "write_point", deserialize_with = "read_point")]
    pub target: Vec3,
    /// From the target to the eye, above 0.
    pub distance: f32,
    /// Angle of the eye around +Y; 0 is towards +Z, growing towards +X.
    pub yaw_rad: f32,
    /// Angle of the eye above the horizon.
    pub pitch_rad: f32,
    /// Vertical field of view.
    pub field_of_view_rad: f32,
    /// Turns the picture clockwise about its middle.
    #[serde(default)]
    pub roll_rad: f32,
    /// Whether rays are parallel; it sees as much as the field of view does at the target.
    #[serde(default)]
    pub is_orthographic: bool,
}

impl OrbitCamera {
    /// Where there is no scene: level, from the origin's front.
    pub(crate) const BACKGROUND_ONLY: OrbitCamera = OrbitCamera {
        target: Vec3::ZERO,
        distance: 1.0,
        yaw_rad: 0.0,
        pitch_rad: 0.0,
        field_of_view_rad: FIELD_OF_VIEW_RAD,
        roll_rad: 0.0,
        is_orthographic: false,
    };

    /// The `index`th of the [named](Self::names) cameras, where `cameras` has it now; else one that shows all of `bounds` from slightly above and beside its front. `aspect` = width / height.
    pub fn for_scene(bounds: Option<Bounds>, cameras: &[Camera], index: usize, aspect: f32) -> Self {
        let bounds = bounds.unwrap_or(Bounds { min: Vec3::splat(-1.0), max: Vec3::ONE });
        let of_file = cameras.get(index);
        let of_file = of_file.and_then(|camera| Self::from_file(camera, bounds));
        of_file.unwrap_or_else(|| Self::framing(bounds, aspect))
    }

    /// Names of the file's cameras.
    pub fn names(scene: &Scene) -> Vec<String> {
        scene.cameras.iter().map(|camera| camera.name.clone()).collect()
    }

    fn from_file(camera: &Camera, bounds: Bounds) -> Option<Self> {
        let eye = camera.world.w_axis.truncate();
        let back = camera.world.z_axis.truncate().try_normalize()?;
        let along = (eye - center(bounds)).dot(back);
        // Turning around a point in the middle of the scene feels right; one behind the eye would not.
        let distance = if along > 0.0 { along } else { diagonal(bounds) };
        let right = camera.world.x_axis.truncate().try_normalize()?;
        // Straight up and down, where to is left to the roll's axis.
        let is_level = back.x.hypot(back.z) > 1e-4;
        let facing =
            if is_level { Vec3::new(back.x, 0.0, back.z) } else { Vec3::new(-right.z, 0.0, right.x) };
        let mut found = OrbitCamera {
            target: eye - back * distance,
            distance,
            yaw_rad: facing.x.atan2(facing.z),
            pitch_rad: back.y.clamp(-1.0, 1.0).asin(),
            ..Self::BACKGROUND_ONLY
        };
        let (level_right, level_up, _) = found.axes();
        found.roll_rad = right.dot(level_up).atan2(right.dot(level_right));
        found.field_of_view_rad = match (camera.yfov_rad, camera.ymag) {
            (Some(angle), _) => angle,
            (None, Some(half_height)) => {
                found.is_orthographic = true;
                // How far away the eye is shows in nothing but in how far hands move it.
                found.distance = half_height.abs() / (FIELD_OF_VIEW_RAD / 2.0).tan();
                FIELD_OF_VIEW_RAD
            }
            (None, None) => return None,
        };
        let is_usable = found.target.is_finite() && found.distance.is_finite() && found.distance > 0.0;
        (is_usable && (1e-3..3.1).contains(&found.field_of_view_rad)).then_some(found)
    }

    /// Shows the whole box from slightly above and beside its front.
    pub fn framing(bounds: Bounds, aspect: f32) -> Self {
        let mut camera = OrbitCamera {
            target: center(bounds),
            distance: 1.0,
            yaw_rad: 0.5,
            pitch_rad: 0.25,
            ..Self::BACKGROUND_ONLY
        };
        camera.distance = camera.fitting_distance(bounds, aspect).max(1e-4) * FRAME_MARGIN;
        camera
    }

    /// The same direction and field of view, so far away that all of `bounds` is just inside the picture.
    #[must_use]
    pub fn framed(mut self, bounds: Bounds, aspect: f32) -> Self {
        self.target = center(bounds);
        self.distance =
            (self.fitting_distance(bounds, aspect) * FRAME_MARGIN).clamp(DISTANCES.0, DISTANCES.1);
        self
    }

    /// A world ray through a place of the picture, 0 to 1 from its top left: origin, direction of any length.
    pub(crate) fn ray(&self, place: [f32; 2], aspect: f32) -> (Vec3, Vec3) {
        let half_height = (self.field_of_view_rad / 2.0).tan();
        let (right, up, back) = self.axes();
        let x = (2.0 * place[0] - 1.0) * half_height * aspect;
        let y = (1.0 - 2.0 * place[1]) * half_height;
        if self.is_orthographic {
            return (self.position() + (right * x + up * y) * self.distance, -back);
        }
        (self.position(), right * x + up * y - back)
    }

    /// Whether it can be looked through: what a file says need not be.
    pub(crate) fn is_usable(&self) -> bool {
        let numbers = [self.distance, self.yaw_rad, self.pitch_rad, self.field_of_view_rad, self.roll_rad];
        self.target.is_finite()
            && numbers.iter().all(|number| number.is_finite())
            && (DISTANCES.0..=DISTANCES.1).contains(&self.distance)
            && self.pitch_rad.abs() <= FRAC_PI_2 + 1e-3
            && (1e-3..3.1).contains(&self.field_of_view_rad)
    }

    /// The distance at which every corner of the box is just inside the picture.
    fn fitting_distance(&self, bounds: Bounds, aspect: f32) -> f32 {
        let half_height = (self.field_of_view_rad / 2.0).tan();
        let half_width = half_height * aspect.clamp(1e-3, 1e3);
        let (right, up, back) = self.axes();
        let needed = corners(bounds).map(|corner| {
            let offset = corner - self.target;
            let sideways = (offset.dot(right).abs() / half_width).max(offset.dot(up).abs() / half_height);
            sideways + offset.dot(back)
        });
        needed.into_iter().filter(|distance| distance.is_finite()).fold(0.0, f32::max)
    }

    /// Right, up and backward, unit length.
    fn axes(&self) -> (Vec3, Vec3, Vec3) {
        let (sin_yaw, cos_yaw) = self.yaw_rad.sin_cos();
        let (sin_pitch, cos_pitch) = self.pitch_rad.sin_cos();
        let back = Vec3::new(sin_yaw * cos_pitch, sin_pitch, cos_yaw * cos_pitch);
        let right = Vec3::new(cos_yaw, 0.0, -sin_yaw);
        let up = back.cross(right);
        let (sin_roll, cos_roll) = self.roll_rad.sin_cos();
        (right * cos_roll + up * sin_roll, up * cos_roll - right * sin_roll, back)
    }

    /// Where the eye is; where rays are parallel, so far away that they are to shaders.
    pub fn position(&self) -> Vec3 {
        let factor = if self.is_orthographic { ORTHOGRAPHIC_DISTANCE } else { 1.0 };
        self.target + self.axes().2 * (self.distance * factor)
    }

    /// Where depth is measured from.
    fn eye(&self) -> Vec3 {
        self.target + self.axes().2 * self.distance
    }

    /// World to clip space, depth 0 at the near plane; the planes are as tight around `bounds` as the eye allows.
    pub fn clip_from_world(&self, bounds: Option<Bounds>, aspect: f32) -> Mat4 {
        let (near, far) = self.depth_range(bounds);
        let (right, up, back) = self.axes();
        let rotation = Mat3::from_cols(right, up, back).transpose();
        let view = Mat4::from_mat3(rotation) * Mat4::from_translation(-self.eye());
        if self.is_orthographic {
            let half_height = self.distance * (self.field_of_view_rad / 2.0).tan();
            let half_width = half_height * aspect;
            return orthographic(-half_width, half_width, -half_height, half_height, near, far) * view;
        }
        perspective(self.field_of_view_rad, aspect, near, far) * view
    }

    fn depth_range(&self, bounds: Option<Bounds>) -> (f32, f32) {
        let Some(bounds) = bounds else { return (self.distance * 0.01, self.distance * 100.0) };
        let (eye, back) = (self.eye(), self.axes().2);
        let depths = corners(bounds).map(|corner| (eye - corner).dot(back));
        let nearest = depths.into_iter().fold(f32::INFINITY, f32::min);
        let farthest = depths.into_iter().fold(f32::NEG_INFINITY, f32::max);
        if self.is_orthographic {
            let margin = 0.01 * (farthest - nearest).max(1e-3 * self.distance);
            return (nearest - margin, farthest + margin);
        }
        let farthest = farthest.max(self.distance);
        // A ratio of 10⁴ keeps 32-bit depth far from fighting.
        let near = (nearest * 0.99).max(farthest * 1e-4);
        (near, (farthest * 1.01).max(near * 1.1))
    }

    /// Turns around the target.
    pub fn orbit(&mut self, yaw_rad: f32, pitch_rad: f32) {
        self.yaw_rad = (self.yaw_rad + yaw_rad).rem_euclid(TAU);
        self.pitch_rad = (self.pitch_rad + pitch_rad).clamp(-PITCH_MAX_RAD, PITCH_MAX_RAD);
    }

    /// Moves target and eye sideways by fractions of the picture's height.
    pub fn pan(&mut self, right: f32, up: f32) {
        let height = 2.0 * self.distance * (self.field_of_view_rad / 2.0).tan();
        let (right_axis, up_axis, _) = self.axes();
        self.target += (right_axis * right + up_axis * up) * height;
    }

    /// Multiplies the distance.
    pub fn dolly(&mut self, factor: f32) {
        self.distance = (self.distance * factor).clamp(DISTANCES.0, DISTANCES.1);
    }
}

fn write_point<S: Serializer>(point: &Vec3, to: S) -> Result<S::Ok, S::Error> {
    point.to_array().serialize(to)
}

fn read_point<'de, D: Deserializer<'de>>(from: D) -> Result<Vec3, D::Error> {
    <[f32; 3]>::deserialize(from).map(Vec3::from)
}

fn center(bounds: Bounds) -> Vec3 {
    (bounds.min + bounds.max) / 2.0
}

fn diagonal(bounds: Bounds) -> f32 {
    (bounds.max - bounds.min).length()
}

pub(crate) fn corners(bounds: Bounds) -> [Vec3; 8] {
    std::array::from_fn(|corner| {
        let pick = |bit: usize, min: f32, max: f32| if corner & bit == 0 { min } else { max };
        Vec3::new(
            pick(1, bounds.min.x, bounds.max.x),
            pick(2, bounds.min.y, bounds.max.y),
            pick(4, bounds.min.z, bounds.max.z),
        )
    })
}
