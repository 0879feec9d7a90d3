//! The signed distance to the union of the cones near a point of the solid: the least of theirs.
//!
//! The cones are first asked in single precision, all at once and in lengths of a lattice cube from the
//! middle of their region; only those that come within rounding of the least are asked exactly.

use nalgebra::{Point3, Vector3};

use super::distance::Distance;

/// Numbers a cone.
const FIELDS: usize = 13;

/// Cones are kept in groups of so many.
pub(super) const GROUP: usize = 4;

/// What single precision may be wrong by, as a share of the lengths that it adds up.
pub(super) const ROUNDING: f32 = 4e-6;

/// Points of a leaf, see [`Bundle::nearest_of_sites`].
pub(super) const SITES: usize = 16;

/// Cones, and what the questions need of each: arrays over the cones, in cubes from the middle of the
/// region: the point of the axis that is nearest to the middle, seen from there; its square, and its part
/// along the axis; the axis; how far it goes on either way; and the radius, its slope and its lean.
#[derive(Clone, Copy)]
pub(super) struct Bundle<'a> {
    /// Of the list of all cones, ascending.
    pub(super) cones: &'a [u32],
    fields: &'a [f32],
    /// The middle of the region, mm.
    middle: Point3<f64>,
}

/// Appends what [`Bundle`] keeps of `cones` to `fields`.
pub(super) fn prepare(cones: &[u32], all: &[Distance], middle: &Point3<f64>, cube: f64, fields: &mut Vec<f32>) {
    let stride = cones.len().next_multiple_of(GROUP);
    let start = fields.len();
    fields.resize(start + stride * FIELDS, 0.0);
    let fields = &mut fields[start..];
    let scale = 1.0 / cube;
    for (place, &cone) in cones.iter().enumerate() {
        let cone = &all[cone as usize];
        let from_start = middle - cone.start;
        let base = from_start.dot(&cone.axis).clamp(0.0, cone.length);
        let from_base = (from_start - cone.axis * base) * scale;
        let [v, u] = [from_base, cone.axis].map(|vector| vector.map(|x| x as f32));
        let radius = (cone.radius + cone.slope * base) * scale;
        let values = [
            v.x,
            v.y,
            v.z,
            v.norm_squared(),
            v.dot(&u),
            u.x,
            u.y,
            u.z,
            (-base * scale) as f32,
            ((cone.length - base) * scale) as f32,
            radius as f32,
            cone.slope as f32,
            cone.lean as f32,
        ];
        for (field, value) in values.into_iter().enumerate() {
            fields[field * stride + place] = value;
        }
    }
    // What fills the last group is nowhere the nearest.
    fields[10 * stride + cones.len()..11 * stride].fill(f32::NEG_INFINITY);
}

pub(super) fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

pub(super) fn most(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

impl<'a> Bundle<'a> {
    /// What [`prepare`] has kept of `cones` around `middle`: the first of `fields`.
    pub(super) fn new(cones: &'a [u32], fields: &'a [f32], middle: Point3<f64>) -> Self {
        let count = cones.len().next_multiple_of(GROUP) * FIELDS;
        Self { cones, fields: &fields[..count], middle }
    }

    #[inline]
    pub(super) fn fields(&self) -> [&'a [f32]; FIELDS] {
        let stride = self.cones.len().next_multiple_of(GROUP);
        let mut rest = self.fields;
        [(); FIELDS].map(|()| {
            let (field, others) = rest.split_at(stride);
            rest = others;
            field
        })
    }

    /// Signed distances, cubes, of points that are `offsets` cubes (x, y, z, and their square) from the
    /// middle, and the places in the bundle of the cones that decide them, to within rounding.
    pub(super) fn nearest_of_sites(&self, offsets: &[[f32; SITES]; 4]) -> ([f32; SITES], [u32; SITES]) {
        let [vx, vy, vz, square, along, ux, uy, uz, low, high, radius, slope, lean] = self.fields();
        let [ox, oy, oz, offset_square] = offsets;
        let (mut nearest, mut place) = ([f32::INFINITY; SITES], [0; SITES]);
        for k in 0..self.cones.len() {
            let mut distance = [0.0; SITES];
            if high[k] == low[k] {
                for i in 0..SITES {
                    let far = 2.0 * (ox[i] * vx[k] + oy[i] * vy[k] + oz[i] * vz[k]) + (offset_square[i] + square[k]);
                    distance[i] = most(far, 0.0).sqrt() - radius[k];
                }
            } else {
                for i in 0..SITES {
                    let far = 2.0 * (ox[i] * vx[k] + oy[i] * vy[k] + oz[i] * vz[k]) + (offset_square[i] + square[k]);
                    let along = ox[i] * ux[k] + oy[i] * uy[k] + oz[i] * uz[k] + along[k];
                    let away = most(far - along * along, 0.0);
                    let s = most(least(along + lean[k] * away.sqrt(), high[k]), low[k]);
                    distance[i] = ((along - s) * (along - s) + away).sqrt() - (radius[k] + slope[k] * s);
                }
            }
            for i in 0..SITES {
                let nearer = distance[i] < nearest[i];
                nearest[i] = if nearer { distance[i] } else { nearest[i] };
                place[i] = if nearer { k as u32 } else { place[i] };
            }
        }
        (nearest, place)
    }

    /// Fills `answers` with the signed distances of `p`, in cubes of `cube` mm, and returns the least.
    fn ask(&self, p: &Point3<f64>, cube: f64, answers: &mut Vec<f32>) -> f32 {
        let [vx, vy, vz, _, _, ux, uy, uz, low, high, radius, slope, lean] = self.fields();
        let scale = 1.0 / cube;
        let [ox, oy, oz] = [0, 1, 2].map(|axis| ((p[axis] - self.middle[axis]) * scale) as f32);
        let count = vx.len();
        answers.resize(count, 0.0);
        let mut nearest = [f32::INFINITY; GROUP];
        for first in (0..count).step_by(GROUP) {
            let group = first..first + GROUP;
            let [vx, vy, vz] = [vx, vy, vz].map(|field| &field[group.clone()]);
            let [ux, uy, uz] = [ux, uy, uz].map(|field| &field[group.clone()]);
            let [low, high] = [low, high].map(|field| &field[group.clone()]);
            let [radius, slope, lean] = [radius, slope, lean].map(|field| &field[group.clone()]);
            let answers = &mut answers[group];
            for i in 0..GROUP {
                let (x, y, z) = (vx[i] + ox, vy[i] + oy, vz[i] + oz);
                let along = x * ux[i] + y * uy[i] + z * uz[i];
                let away = most(x * x + y * y + z * z - along * along, 0.0);
                let s = most(least(along + lean[i] * away.sqrt(), high[i]), low[i]);
                answers[i] = ((along - s) * (along - s) + away).sqrt() - (radius[i] + slope[i] * s);
                nearest[i] = least(answers[i], nearest[i]);
            }
        }
        nearest.into_iter().fold(f32::INFINITY, least)
    }

    /// How far a distance in the bundle may be off, cubes.
    fn blur(&self) -> f32 {
        let [.., radius, _, _] = self.fields();
        2.0 * ROUNDING * (radius[0].abs() + 4.0)
    }

    /// Signed distance of `p` to the union, mm, and the cone that decides it: of equals, the first in the
    /// list of all. `cube` is in mm.
    pub(super) fn nearest(
        &self,
        p: &Point3<f64>,
        cube: f64,
        all: &[Distance],
        answers: &mut Vec<f32>,
    ) -> (f64, u32) {
        let bound = self.ask(p, cube, answers) + 2.0 * self.blur();
        let mut best = (f64::INFINITY, u32::MAX);
        for (&cone, &answer) in self.cones.iter().zip(&*answers) {
            if answer <= bound {
                let distance = all[cone as usize].at(p);
                if distance < best.0 {
                    best = (distance, cone);
                }
            }
        }
        best
    }

    /// Of the cones but one that contain `p` by more than `exact` mm, the one that it is deepest in.
    pub(super) fn deepest_but(
        &self,
        known: u32,
        p: &Point3<f64>,
        (cube, exact): (f64, f64),
        all: &[Distance],
        answers: &mut Vec<f32>,
    ) -> Option<u32> {
        let blur = self.blur();
        let bound = least(self.ask(p, cube, answers) + 2.0 * blur, blur);
        let mut best = (-exact, None);
        for (&cone, &answer) in self.cones.iter().zip(&*answers) {
            if answer <= bound && cone != known {
                let distance = all[cone as usize].at(p);
                if distance < best.0 {
                    best = (distance, Some(cone));
                }
            }
        }
        best.1
    }
}
