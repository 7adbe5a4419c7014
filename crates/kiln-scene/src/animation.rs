//! Animations as typed data: what moves, along which curve, and what a curve says at a time.
//!
//! Nothing here plays: a scene is its rest pose, and a player (`play`) samples a [`Curve`] and sets what the
//! [`Target`] names. Source: glTF 2.0, section 3.11 and appendix C; `KHR_animation_pointer`.

use glam::DQuat;

use crate::property::{CameraProperty, LightProperty, MaterialProperty};

/// Movements that belong together.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Animation {
    /// Its name, empty where the file has none.
    pub name: String,
    /// Values over time; channels may share one.
    pub curves: Vec<Curve>,
    /// What the curves move; no target occurs twice.
    pub channels: Vec<Channel>,
}

/// One thing that a curve moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Channel {
    /// What is set.
    pub target: Target,
    /// Index into [`Animation::curves`].
    pub curve: usize,
}

/// What a channel sets; indices are into the tables of [`crate::Scene`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Target {
    /// Metres, three components.
    Translation {
        /// Index into [`crate::Scene::nodes`].
        node: usize,
    },
    /// Quaternion x, y, z, w.
    Rotation {
        /// Index into [`crate::Scene::nodes`].
        node: usize,
    },
    /// Three factors.
    Scale {
        /// Index into [`crate::Scene::nodes`].
        node: usize,
    },
    /// One weight for each morph target of a draw.
    Weights {
        /// Index into [`crate::Scene::morphs`].
        morph: usize,
    },
    /// 0 hides the node and what hangs on it, 1 shows it.
    Visibility {
        /// Index into [`crate::Scene::nodes`].
        node: usize,
    },
    /// A factor of a material.
    Material {
        /// Index into [`crate::Scene::materials`].
        material: usize,
        /// Which one.
        property: MaterialProperty,
    },
    /// A value of a camera.
    Camera {
        /// Index into [`crate::Scene::cameras`].
        camera: usize,
        /// Which one.
        property: CameraProperty,
    },
    /// A value of a punctual light.
    Light {
        /// Index into [`crate::Scene::lights`].
        light: usize,
        /// Which one.
        property: LightProperty,
    },
}

/// How values between keys come about.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// Straight; rotations along the shortest arc.
    #[default]
    Linear,
    /// The last key's value.
    Step,
    /// Hermite splines through tangents; they may leave the range of the keys.
    CubicSpline,
}

/// Values over time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Curve {
    /// How values between keys come about.
    pub interpolation: Interpolation,
    /// Whether values are quaternions.
    pub is_rotation: bool,
    /// Times of the keys in seconds: at least one, from 0 on, each later than the one before.
    pub times_s: Vec<f32>,
    /// Components of a value.
    pub width: usize,
    /// `width` numbers a key; with [`Interpolation::CubicSpline`] three times as many: the tangent towards the key
    /// in units a second, its value, the tangent away from it.
    pub values: Vec<f32>,
}

/// One component between two keys: values at both ends and tangents scaled to the unit interval.
#[derive(Clone, Copy, Debug)]
struct Hermite {
    start: f64,
    start_tangent: f64,
    end: f64,
    end_tangent: f64,
}

impl Animation {
    /// Time of the last key in seconds; playing it again starts from 0.
    pub fn duration_s(&self) -> f32 {
        let last = self.curves.iter().filter_map(|curve| curve.times_s.last().copied());
        last.fold(0.0, f32::max)
    }
}

impl Curve {
    /// Whether the value ever differs from `rest`. Rotations are compared as rotations: quaternions of either sign and
    /// of any length, with what rounding leaves.
    pub(crate) fn departs_from(&self, rest: &[f32]) -> bool {
        if !self.is_rotation {
            let is_at_rest = |(range, rest): ([f32; 2], &f32)| range[0] == *rest && range[1] == *rest;
            return !self.range().into_iter().zip(rest).all(is_at_rest);
        }
        let rest = quaternion(rest);
        let is_rest = |key: usize| quaternion(self.key(key)).dot(rest).abs() > 1.0 - 1e-12;
        let tangents = (0..self.values.len() / self.width.max(1))
            .filter(|row| self.interpolation == Interpolation::CubicSpline && row % 3 != 1);
        let bends = tangents.into_iter().any(|row| self.row(row).iter().any(|&value| value != 0.0));
        bends || !(0..self.times_s.len()).all(is_rest)
    }

    /// The curve of some of its components.
    pub(crate) fn components(&self, wanted: &[usize]) -> Curve {
        let rows = self.values.chunks_exact(self.width.max(1));
        let values = rows.flat_map(|row| wanted.iter().map(|&component| row[component])).collect();
        Curve { width: wanted.len(), values, times_s: self.times_s.clone(), ..*self }
    }

    /// Writes the value at `time_s` to `value`, which has [`width`](Self::width) places. Before the first key
    /// and after the last one their values hold. Computed in `f64`.
    pub fn sample(&self, time_s: f64, value: &mut [f32]) {
        let next = self.times_s.partition_point(|&time| f64::from(time) <= time_s);
        let (first, last) = (next.saturating_sub(1), self.times_s.len().saturating_sub(1));
        if next == 0 || first >= last || self.interpolation == Interpolation::Step {
            value.copy_from_slice(self.key(first));
            return self.finish(value);
        }
        let [from, to] = [first, next].map(|key| f64::from(self.times_s[key]));
        let at = (time_s - from) / (to - from);
        if self.interpolation == Interpolation::Linear && self.is_rotation {
            let [from, to] = [first, next].map(|key| quaternion(self.key(key)));
            value.copy_from_slice(&slerp(from, to, at).to_array().map(|it| it as f32));
            return;
        }
        for (component, value) in value.iter_mut().enumerate() {
            *value = match self.interpolation {
                Interpolation::CubicSpline => self.segment(first, component).at(at),
                _ => {
                    let [from, to] = [first, next].map(|key| f64::from(self.key(key)[component]));
                    from + (to - from) * at
                }
            } as f32;
        }
        self.finish(value);
    }

    /// Smallest and largest value of each component over all times. Splines count where they turn, not only
    /// at their keys; for rotations it is the range of the numbers before they are made unit length.
    pub fn range(&self) -> Vec<[f32; 2]> {
        let component_range = |component: usize| {
            let keys = (0..self.times_s.len()).map(|key| f64::from(self.key(key)[component]));
            let segments = match self.interpolation {
                Interpolation::CubicSpline => 1..self.times_s.len(),
                _ => 0..0,
            };
            let turns = segments.flat_map(|next| self.segment(next - 1, component).turning_values());
            let range = keys.chain(turns).fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
                [low.min(value), high.max(value)]
            });
            range.map(|value| value as f32)
        };
        (0..self.width).map(component_range).collect()
    }

    /// The value at a key.
    fn key(&self, key: usize) -> &[f32] {
        match self.interpolation {
            Interpolation::CubicSpline => self.row(3 * key + 1),
            _ => self.row(key),
        }
    }

    fn row(&self, row: usize) -> &[f32] {
        &self.values[row * self.width..(row + 1) * self.width]
    }

    fn segment(&self, first: usize, component: usize) -> Hermite {
        let row = |row: usize| f64::from(self.row(row)[component]);
        let duration_s = f64::from(self.times_s[first + 1]) - f64::from(self.times_s[first]);
        Hermite {
            start: row(3 * first + 1),
            start_tangent: duration_s * row(3 * first + 2),
            end: row(3 * first + 4),
            end_tangent: duration_s * row(3 * first + 3),
        }
    }

    /// Splines of quaternions leave the unit sphere, and keys are rounded.
    fn finish(&self, value: &mut [f32]) {
        if self.is_rotation {
            value.copy_from_slice(&quaternion(value).to_array().map(|it| it as f32));
        }
    }
}

impl Hermite {
    /// Factors of t³, t², t and 1 (glTF 2.0, appendix C.5).
    fn polynomial(self) -> [f64; 4] {
        let Hermite { start, start_tangent, end, end_tangent } = self;
        let rise = end - start;
        [
            start_tangent + end_tangent - 2.0 * rise,
            3.0 * rise - 2.0 * start_tangent - end_tangent,
            start_tangent,
            start,
        ]
    }

    fn at(self, t: f64) -> f64 {
        let [a, b, c, d] = self.polynomial();
        ((a * t + b) * t + c) * t + d
    }

    /// Values inside the interval where the derivative 3at² + 2bt + c is 0. The second root comes from the first,
    /// because the textbook's form loses all digits where a is small, and this one is right for a = 0 too.
    fn turning_values(self) -> impl Iterator<Item = f64> {
        let [a, b, c, _] = self.polynomial();
        let discriminant = b * b - 3.0 * a * c;
        let q = -(b + discriminant.sqrt().copysign(b));
        [q / (3.0 * a), c / q].into_iter().filter(|t| *t > 0.0 && *t < 1.0).map(move |t| self.at(t))
    }
}

/// At unit length; no rotation where there is no direction.
fn quaternion(value: &[f32]) -> DQuat {
    let wide: [f64; 4] = std::array::from_fn(|at| f64::from(value[at]));
    let length = wide.iter().map(|it| it * it).sum::<f64>().sqrt();
    if length > 0.0 { DQuat::from_array(wide.map(|it| it / length)) } else { DQuat::IDENTITY }
}

/// Along the shorter arc (glTF 2.0, appendix C.4). Where the arc is too short for its sine, the chord is as good.
fn slerp(from: DQuat, to: DQuat, at: f64) -> DQuat {
    let cosine = from.dot(to);
    let to = if cosine < 0.0 { -to } else { to };
    let angle = libm::acos(cosine.abs().min(1.0));
    if angle < 1e-6 {
        return (from * (1.0 - at) + to * at).normalize();
    }
    (from * libm::sin((1.0 - at) * angle) + to * libm::sin(at * angle)).normalize()
}
