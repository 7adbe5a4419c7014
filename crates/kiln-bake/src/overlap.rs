//! The solid angles that texels of a panorama and of a cube have in common: what resampling either to the other weighs by.
//!
//! On a side face longitude is constant along lines of constant s. Along such a line the integral is exact, cut where rows
//! and texels end; across them it is Gauss' rule between meridians, texel edges and the places where a parallel leaves the
//! face. So each texel's shares add up to its solid angle, of either map.
//!
//! On a cap, which the pole is the centre of, meridians are straight lines and parallels circles. What a texel and a column
//! share there is a convex polygon, and what of it lies within a circle has a closed form: the sum over its edges of
//! ∫ (1 − cos θ) dφ. The panorama has an even number of columns, so one quadrant shows eight at once.

use kiln_sphere::quadrature::gauss_legendre;
use kiln_sphere::{cube_direction, panorama_uv};
use std::f64::consts::{FRAC_PI_2, PI};

/// The side faces. Longitude falls as s grows: a cube is stored as seen from outside.
pub(crate) const SIDES: [usize; 4] = [0, 1, 4, 5];

/// Lines across a piece of a side face, and how many where the pieces are wide: either leaves less than 10⁻⁸.
const LINES: usize = 2;
const LINES_IF_WIDE: usize = 16;
/// Pieces along a face's edge, from which on they are not wide.
const PIECES_MIN: usize = 64;

/// A part of a side face between neighbouring meridians and texel edges.
pub(crate) struct SidePiece {
    pub face: usize,
    /// Column of texels on the face.
    pub x: usize,
    /// Column of the panorama.
    pub column: usize,
    /// From and to.
    s: [f64; 2],
}

/// What the quadrant's overlap (x, y, column, row) is one of eight mirror images of.
#[derive(Clone, Copy)]
pub(crate) struct CapImage {
    /// Column of texels on both caps.
    pub x: usize,
    /// Row of texels on the top; the bottom's counts from the other end, as do the panorama's rows there.
    pub y: usize,
    /// Column of the panorama.
    pub column: usize,
}

/// Two grids on the sphere, one over the other.
pub(crate) struct Overlaps {
    width: usize,
    height: usize,
    face_size: usize,
    /// Texel edges, −1 … 1.
    edges: Vec<f64>,
    /// (cot θ, cos θ) of the parallels between rows, north to south.
    parallels: Vec<[f64; 2]>,
    lines: Vec<(f64, f64)>,
    /// Where a side face's upper and lower edges meet parallels: what a row has of the face changes its form there.
    exits: Vec<f64>,
    /// Texel edges of a cap's quadrant: from the centre, though that be a texel's, outwards.
    quadrant: Vec<f64>,
    /// tan φ of the meridians in the quadrant, 0 … ∞; the last one may lie within a column.
    meridians: Vec<f64>,
    /// (tan² θ, 1 − cos θ) of the parallels in the northern half.
    rings: Vec<[f64; 2]>,
}

impl Overlaps {
    /// A panorama of `2 · height` columns and a cube.
    pub(crate) fn new(height: usize, face_size: usize) -> Self {
        let width = 2 * height;
        let theta = |row: usize| PI * row as f64 / height as f64;
        let parallel = |row: usize| {
            let (sin, cos) = libm::sincos(theta(row));
            [cos / sin, cos]
        };
        let ring = |row: usize| {
            let (tan, sin_half) = (libm::tan(theta(row)), libm::sin(0.5 * theta(row)));
            [tan * tan, 2.0 * sin_half * sin_half]
        };
        let edges: Vec<f64> = (0..=face_size).map(|i| 2.0 * i as f64 / face_size as f64 - 1.0).collect();
        let squares =
            (1..height.div_ceil(2)).map(|row| ring(row)[0]).filter(|square| (1.0..2.0).contains(square));
        let mut exits: Vec<f64> =
            squares.flat_map(|square| [-(square - 1.0).sqrt(), (square - 1.0).sqrt()]).collect();
        exits.sort_unstable_by(f64::total_cmp);
        let is_wide = face_size.max(width / 4) < PIECES_MIN;
        let columns = width.div_ceil(4);
        let meridians = (0..columns).map(|j| libm::tan(2.0 * PI * j as f64 / width as f64));
        Self {
            width,
            height,
            face_size,
            parallels: (1..height).map(parallel).collect(),
            exits,
            lines: gauss_legendre(if is_wide { LINES_IF_WIDE } else { LINES }),
            quadrant: std::iter::once(0.0).chain(edges[face_size / 2 + 1..].iter().copied()).collect(),
            meridians: meridians.chain([f64::INFINITY]).collect(),
            rings: (1..height).filter(|&row| theta(row) < FRAC_PI_2 - 1e-9).map(ring).collect(),
            edges,
        }
    }

    /// The pieces of a column of texels of a side face, left to right.
    pub(crate) fn pieces_of_texels(&self, face: usize, x: usize) -> Vec<SidePiece> {
        let s = [self.edges[x], self.edges[x + 1]];
        let width = self.width as f64;
        let u_centre = panorama_uv(cube_direction(face, 0.0, 0.0))[0];
        // Meridians lie symmetrically about the centre, so it does not matter that longitude falls.
        let longitude = |s: f64| (u_centre + libm::atan(s) / (2.0 * PI)) * width;
        let (first, last) = (libm::floor(longitude(s[0])) as i64 + 1, longitude(s[1]));
        let meridians = (first..).take_while(|&j| (j as f64) < last);
        let at = |j: i64| libm::tan(2.0 * PI * (j as f64 / width - u_centre));
        let piece = |s: [f64; 2]| {
            let u = panorama_uv(cube_direction(face, 0.5 * (s[0] + s[1]), 0.0))[0];
            SidePiece { face, x, column: ((u * width) as usize).min(self.width - 1), s }
        };
        self.cut(s, meridians.map(at)).map(piece).collect()
    }

    /// The pieces of a column of the panorama, on one side face or two.
    pub(crate) fn pieces_of_column(&self, column: usize) -> Vec<SidePiece> {
        let width = self.width as f64;
        let mut pieces = Vec::new();
        for face in SIDES {
            let from_centre = (column as f64 + 0.5) / width - panorama_uv(cube_direction(face, 0.0, 0.0))[0];
            let from_centre = from_centre - libm::rint(from_centre);
            let s_at =
                |u: f64| if u.abs() < 0.125 { libm::tan(2.0 * PI * u) } else { libm::copysign(1.0, u) };
            let s = [-0.5, 0.5].map(|half| s_at(half / width - from_centre));
            let texel = |s: [f64; 2]| {
                self.edges.partition_point(|&edge| edge <= 0.5 * (s[0] + s[1])).clamp(1, self.face_size) - 1
            };
            let inner = self.edges[self.edges.partition_point(|&edge| edge <= s[0])..].iter().copied();
            let inner = inner.take_while(|&edge| edge < s[1]);
            pieces.extend(self.cut(s, inner).map(|s| SidePiece { face, x: texel(s), column, s }));
        }
        pieces
    }

    /// From one s to another, cut at rising places between, and where a parallel leaves the face.
    fn cut(
        &self,
        [start, end]: [f64; 2],
        inner: impl Iterator<Item = f64>,
    ) -> impl Iterator<Item = [f64; 2]> {
        let mut cuts = vec![start];
        cuts.extend(inner.filter(|s| start < *s && *s < end));
        if start < end {
            cuts.push(end);
        }
        let first = self.exits.partition_point(|&s| s <= start);
        let exits = self.exits[first..].iter().take_while(|s| **s < end);
        let count = cuts.len();
        cuts.extend(exits);
        if cuts.len() > count {
            cuts.sort_unstable_by(f64::total_cmp);
        }
        (1..cuts.len()).map(move |index| [cuts[index - 1], cuts[index]])
    }

    /// `visit(y, row, sr)` for each texel and row in a piece, from the top. `at_edges` is room for `face_size + 1` values.
    #[inline(always)]
    pub(crate) fn side(
        &self,
        piece: &SidePiece,
        at_edges: &mut [f64],
        mut visit: impl FnMut(usize, usize, f64),
    ) {
        let half = 0.5 * (piece.s[1] - piece.s[0]);
        for &(y, weight) in &self.lines {
            self.line(piece.s[0] + half * (1.0 + y), weight * half, at_edges, &mut visit);
        }
    }

    /// weight · ∫ (1 + s² + t²)^(−3/2) dt along a side face's line of constant s.
    ///
    /// The integral up to t is t / (a √(a + t²)), a = 1 + s². A parallel meets the line at t = −cot θ √a, where that is
    /// −cos θ / a.
    #[inline(always)]
    fn line(&self, s: f64, weight: f64, at_edges: &mut [f64], visit: &mut impl FnMut(usize, usize, f64)) {
        let across = 1.0 + s * s;
        let root = across.sqrt();
        for (value, t) in at_edges.iter_mut().zip(&self.edges) {
            *value = t / (across * (across + t * t).sqrt());
        }
        let t_of = |row: usize| self.parallels.get(row).map_or(f64::INFINITY, |[cot, _]| -cot * root);
        let mut row = self.parallels.partition_point(|[cot, _]| -cot * root <= -1.0);
        let mut next_row = t_of(row);
        let mut before = at_edges[0];
        for texel in 0..self.face_size {
            let edge = self.edges[texel + 1];
            while next_row < edge {
                let here = -self.parallels[row][1] / across;
                visit(texel, row, weight * (here - before));
                before = here;
                row += 1;
                next_row = t_of(row);
            }
            visit(texel, row, weight * (at_edges[texel + 1] - before));
            before = at_edges[texel + 1];
        }
    }

    /// Texels along an edge of a cap's quadrant, the one in the middle counted too.
    pub(crate) fn quadrant_size(&self) -> usize {
        self.quadrant.len() - 1
    }

    /// The panorama's columns in a cap's quadrant.
    pub(crate) fn quadrant_columns(&self) -> usize {
        self.meridians.len() - 1
    }

    /// The columns that texel (`x`, `y`) of the quadrant may have a part in.
    pub(crate) fn columns_of_texel(&self, x: usize, y: usize) -> std::ops::Range<usize> {
        let (least, most) =
            (self.quadrant[x] / self.quadrant[y + 1], self.quadrant[x + 1] / self.quadrant[y]);
        let first = self.meridians.partition_point(|&tan| tan <= least).max(1) - 1;
        first..self.meridians.partition_point(|&tan| tan < most).min(self.quadrant_columns())
    }

    /// The texels in row `y` of the quadrant that a column may have a part in.
    pub(crate) fn texels_of_column(&self, column: usize, y: usize) -> std::ops::Range<usize> {
        let least = self.quadrant[y] * self.meridians[column];
        let most = self.quadrant[y + 1] * self.meridians[column + 1];
        let first = self.quadrant.partition_point(|&edge| edge <= least).max(1) - 1;
        first..self.quadrant.partition_point(|&edge| edge < most).min(self.quadrant_size())
    }

    /// `visit(row, sr)` for each row in what texel (`x`, `y`) of the quadrant and a column share, from the pole.
    ///
    /// In the quadrant p = |s| = ρ sin φ, q = |t| = ρ cos φ, ρ = tan θ.
    #[inline(always)]
    pub(crate) fn cap(&self, x: usize, y: usize, column: usize, mut visit: impl FnMut(usize, f64)) {
        let [p0, p1] = [self.quadrant[x], self.quadrant[x + 1]];
        let [q0, q1] = [self.quadrant[y], self.quadrant[y + 1]];
        let [tan0, tan1] = [self.meridians[column], self.meridians[column + 1]];
        // The polygon's edges beyond and, to be taken away, before it; the meridians' own see no φ.
        let along_q = |p: f64| Edge::new(p, q0.max(p / tan1), q1.min(p / tan0));
        let along_p = |q: f64| Edge::new(q, p0.max(q * tan0), p1.min(q * tan1));
        let (beyond, before) = ([along_q(p1), along_p(q1)], [along_q(p0), along_p(q0)]);
        let squares = |edges: &[Edge; 2], pick: fn(f64, f64) -> f64, start: f64| {
            edges
                .iter()
                .filter(|edge| edge.is_some())
                .fold(start, |far, edge| pick(far, edge.far_squared(pick)))
        };
        let farthest = squares(&beyond, f64::max, 0.0);
        let nearest = if x == 0 && y == 0 { 0.0 } else { squares(&before, f64::min, f64::INFINITY) };
        if farthest <= nearest {
            return;
        }
        let mut row = self.rings.partition_point(|[square, _]| *square <= nearest);
        let mut inner = 0.0;
        while let Some(ring) = self.rings.get(row).filter(|[square, _]| *square < farthest) {
            let within = |edges: &[Edge; 2]| edges.iter().map(|edge| edge.within(ring)).sum::<f64>();
            let area = within(&beyond) - within(&before);
            visit(row, (area - inner).max(0.0));
            inner = inner.max(area);
            row += 1;
        }
        let whole = |edges: &[Edge; 2]| edges.iter().map(Edge::whole).sum::<f64>();
        visit(row, (whole(&beyond) - whole(&before) - inner).max(0.0));
    }

    /// Where the quadrant's texel and column are mirrored to.
    pub(crate) fn cap_images(&self, x: usize, y: usize, column: usize) -> [CapImage; 4] {
        let last = self.face_size - 1;
        let (right, down) = (self.face_size / 2 + x, self.face_size / 2 + y);
        let (left, up) = (last - right, last - down);
        let half = self.width / 2;
        // On the top the first column begins at +t and runs towards −s.
        [
            CapImage { x: left, y: down, column },
            CapImage { x: right, y: down, column: self.width - 1 - column },
            CapImage { x: left, y: up, column: half - 1 - column },
            CapImage { x: right, y: up, column: half + column },
        ]
    }

    /// The row of the lower half that mirrors one of the upper half.
    pub(crate) fn mirrored_row(&self, row: usize) -> usize {
        self.height - 1 - row
    }
}

/// A straight piece of a cap's polygon: the distance of its line from the pole, and from where to where it goes from the
/// foot of the perpendicular. Empty where `to` is not greater.
struct Edge {
    distance: f64,
    from: f64,
    to: f64,
}

impl Edge {
    fn new(distance: f64, from: f64, to: f64) -> Self {
        Self { distance, from, to }
    }

    /// Neither empty nor radial.
    fn is_some(&self) -> bool {
        self.distance > 0.0 && self.to > self.from
    }

    fn far_squared(&self, pick: fn(f64, f64) -> f64) -> f64 {
        let end = pick(self.from, self.to);
        self.distance * self.distance + end * end
    }

    /// ∫ (1 − cos θ) dφ along it: the solid angle between it and the pole.
    fn whole(&self) -> f64 {
        if self.is_some() { self.triangle(self.from, self.to) } else { 0.0 }
    }

    /// That of what lies within the circle (tan² θ, 1 − cos θ).
    fn within(&self, &[square, height]: &[f64; 2]) -> f64 {
        if !self.is_some() {
            return 0.0;
        }
        let reach = square - self.distance * self.distance;
        if reach <= self.from * self.from {
            height * self.angle(self.from, self.to)
        } else if reach >= self.to * self.to {
            self.triangle(self.from, self.to)
        } else {
            let middle = reach.sqrt();
            self.triangle(self.from, middle) + height * self.angle(middle, self.to)
        }
    }

    /// φ between two of its points.
    fn angle(&self, from: f64, to: f64) -> f64 {
        libm::atan(self.distance * (to - from) / (self.distance * self.distance + from * to))
    }

    /// From the foot to x it is φ − atan(x / (d r)), r = √(1 + d² + x²), the triangle's excess; its tangent has no
    /// difference of like numbers.
    fn triangle(&self, from: f64, to: f64) -> f64 {
        let d = self.distance;
        let tan = |x: f64| {
            let square = d * d + x * x;
            let r = (1.0 + square).sqrt();
            x * d * square / ((r + 1.0) * (d * d * r + x * x))
        };
        let (a, b) = (tan(from), tan(to));
        libm::atan((b - a) / (1.0 + a * b))
    }
}
