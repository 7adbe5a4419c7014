//! What sampled estimators read: a cube map with mips, looked up as texture hardware does.

use kiln_bake::skybox;
use kiln_image::{Cancel, Cancelled, Cube, Panorama};
use kiln_sphere::{cube_direction, cube_face_st};

/// Red, green, blue.
pub type Rgb = [f64; 3];

/// A cube map with mips, each face with a frame of its neighbours' texels.
pub struct Source {
    levels: Vec<Framed>,
}

/// One level. Texels have four values, the last unused, so that each begins at a multiple of 16 bytes.
struct Framed {
    size: usize,
    texels: Vec<[f32; 4]>,
}

impl Source {
    /// The panorama on faces of `face_size` and all smaller ones: exact means, halved by solid angle.
    ///
    /// # Errors
    /// [`Cancelled`] within a row.
    pub fn new(panorama: &Panorama, face_size: usize, cancel: Cancel) -> Result<Source, Cancelled> {
        Source::of_levels(&skybox(panorama, face_size, cancel)?, cancel)
    }

    /// Levels as they are, largest first.
    ///
    /// # Errors
    /// [`Cancelled`] within a face.
    ///
    /// # Panics
    /// If there is no level.
    pub fn of_levels(levels: &[Cube], cancel: Cancel) -> Result<Source, Cancelled> {
        assert!(!levels.is_empty(), "a source has a level");
        let levels = levels.iter().map(|level| Framed::new(level, cancel)).collect::<Result<_, _>>()?;
        Ok(Source { levels })
    }

    /// Edge of the largest level.
    pub fn face_size(&self) -> usize {
        self.levels[0].size
    }

    /// Number of levels.
    pub fn level_count(&self) -> usize {
        self.levels.len()
    }

    /// Bilinear between texels, across the edges of faces too, and linear between levels; the level is brought into range.
    #[inline]
    pub fn sample(&self, direction: [f64; 3], level: f64) -> Rgb {
        let level = level.max(0.0).min((self.levels.len() - 1) as f64);
        let (below, share) = (level as usize, level.fract());
        let (face, st) = cube_face_st(direction);
        let near = self.levels[below].bilinear(face, st);
        if share <= 0.0 {
            return near;
        }
        let far = self.levels[below + 1].bilinear(face, st);
        std::array::from_fn(|i| near[i] * (1.0 - share) + far[i] * share)
    }

    /// Texels that [`Source::sample`] reads at a level.
    pub fn texel_reads(&self, level: f64) -> u64 {
        let level = level.max(0.0).min((self.levels.len() - 1) as f64);
        if level.fract() > 0.0 { 8 } else { 4 }
    }
}

impl Framed {
    fn new(cube: &Cube, cancel: Cancel) -> Result<Framed, Cancelled> {
        let size = cube.face_size;
        let mut texels = Vec::with_capacity(6 * (size + 2) * (size + 2));
        let last = size as isize;
        for face in 0..6 {
            cancel.check()?;
            for (y, x) in (-1..=last).flat_map(|y| (-1..=last).map(move |x| (y, x))) {
                let [r, g, b] = beyond(cube, face, x, y);
                texels.push([r, g, b, 0.0]);
            }
        }
        Ok(Framed { size, texels })
    }

    #[inline]
    fn bilinear(&self, face: usize, st: [f64; 2]) -> Rgb {
        let stride = self.size + 2;
        // In the frame a texel's centre is at its index; the frame's own texels are 0 and size + 1.
        let [x, y] = st.map(|s| (0.5 * (s + 1.0) * self.size as f64 + 0.5).max(0.0));
        let (column, row) = ((x as usize).min(self.size), (y as usize).min(self.size));
        let (dx, dy) = (x - column as f64, y - row as f64);
        let at = (face * stride + row) * stride + column;
        let [a, b] = [self.texels[at], self.texels[at + 1]];
        let [c, d] = [self.texels[at + stride], self.texels[at + stride + 1]];
        let weights = [(1.0 - dx) * (1.0 - dy), dx * (1.0 - dy), (1.0 - dx) * dy, dx * dy];
        std::array::from_fn(|i| {
            f64::from(a[i]) * weights[0]
                + f64::from(b[i]) * weights[1]
                + f64::from(c[i]) * weights[2]
                + f64::from(d[i]) * weights[3]
        })
    }
}

/// The texel at column x and row y of a face, each at most one step outside; where three faces meet, the mean of the
/// three that there are (Vulkan 1.3, section "Cube map edge handling").
fn beyond(cube: &Cube, face: usize, x: isize, y: isize) -> [f32; 3] {
    let size = cube.face_size as isize;
    let inside = |a: isize| (0..size).contains(&a);
    let brought = |a: isize| a.clamp(0, size - 1);
    match (inside(x), inside(y)) {
        (true, true) => cube.texel(face, x as usize, y as usize),
        (false, false) => {
            let three = [(brought(x), brought(y)), (x, brought(y)), (brought(x), y)]
                .map(|(x, y)| beyond(cube, face, x, y));
            std::array::from_fn(|i| three.iter().map(|texel| texel[i] / 3.0).sum())
        }
        _ => {
            // A hair beyond the edge the neighbour's face begins.
            let place = |a: isize| {
                let centre = (2 * a + 1) as f64 / size as f64 - 1.0;
                if inside(a) { centre } else { centre.signum() * (1.0 + 1e-9) }
            };
            let (face, [s, t]) = cube_face_st(cube_direction(face, place(x), place(y)));
            let index = |s: f64| brought((0.5 * (s + 1.0) * size as f64) as isize) as usize;
            cube.texel(face, index(s), index(t))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Source;
    use kiln_image::{Cancel, Cube};
    use kiln_sphere::cube_direction;

    /// Each texel of each level has its own value.
    fn numbered(size: usize) -> Cube {
        Cube { face_size: size, rgb: (0..18 * size * size).map(|i| i as f32).collect() }
    }

    #[test]
    fn centres_give_texels_and_edges_the_mean_of_their_neighbours() {
        let levels = [numbered(4), numbered(2)];
        let source = Source::of_levels(&levels, Cancel::NEVER).unwrap();
        let centre = source.sample(cube_direction(1, 0.25, -0.75), 0.0);
        assert_eq!(centre, levels[0].texel(1, 2, 0).map(f64::from));
        // +X's left edge is +Z's right one.
        let edge = source.sample(cube_direction(0, -1.0 + 1e-12, 0.25), 0.0);
        let (a, b) = (levels[0].texel(0, 0, 2), levels[0].texel(4, 3, 2));
        for i in 0..3 {
            assert!((edge[i] - 0.5 * f64::from(a[i] + b[i])).abs() <= 1e-6, "{edge:?}");
            assert!((edge[i] - f64::from(a[i])).abs() > 1.0, "the check sees the seam");
        }
        let between = source.sample(cube_direction(1, 0.25, -0.75), 0.5);
        assert!(between != centre && source.texel_reads(0.5) == 8 && source.texel_reads(9.0) == 4);
    }
}
