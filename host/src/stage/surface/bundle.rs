//! The signed distance to the union of the cones near a point of the solid: the least of theirs.
//!
//! The cones are first asked in single precision, all at once and in lengths of a lattice cube from the
//! middle of their region; only those that come within rounding of the least are asked exactly.

use nalgebra::{Point3, Vector3};

use super::distance::Distance;

/// Numbers a cone.
const FIELDS: usize = 13;

/// Cones are kept in groups of so many.
const GROUP: usize = 8;

/// What single precision may be wrong by, as a share of the lengths that it adds up; the worst are cones
/// that taper steeply, near their axis.
pub(super) const ROUNDING: f32 = 3e-5;

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

/// Answers of [`Bundle::ask`], a number a cone in each list.
#[derive(Debug, Default)]
pub(super) struct Answers {
    /// Signed distances, cubes.
    pub(super) distance: Vec<f32>,
    /// From the centre of the ball that decides, cubes.
    pub(super) from_centre: Vec<f32>,
    /// How the distance grows, per cube: a unit vector.
    pub(super) growth: [Vec<f32>; 3],
}

impl Answers {
    fn resize(&mut self, count: usize) {
        for list in [&mut self.distance, &mut self.from_centre].into_iter().chain(&mut self.growth) {
            list.resize(count, 0.0);
        }
    }
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

fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

fn most(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

impl<'a> Bundle<'a> {
    /// What [`prepare`] has kept of `cones` around `middle`: the first of `fields`.
    pub(super) fn new(cones: &'a [u32], fields: &'a [f32], middle: Point3<f64>) -> Self {
        let count = cones.len().next_multiple_of(GROUP) * FIELDS;
        Self { cones, fields: &fields[..count], middle }
    }

    fn fields(&self) -> [&'a [f32]; FIELDS] {
        let stride = self.cones.len().next_multiple_of(GROUP);
        std::array::from_fn(|field| &self.fields[field * stride..][..stride])
    }

    /// Signed distances of the point that is `offset` cubes from the middle, and how they grow.
    pub(super) fn ask(&self, offset: [f32; 3], answers: &mut Answers) {
        let [vx, vy, vz, _, _, ux, uy, uz, low, high, radius, slope, lean] = self.fields();
        let count = vx.len();
        answers.resize(count);
        let [gx, gy, gz] = &mut answers.growth;
        let (gx, gy, gz) = (&mut gx[..count], &mut gy[..count], &mut gz[..count]);
        let (distance, from_centre) = (&mut answers.distance[..count], &mut answers.from_centre[..count]);
        for i in 0..count {
            let (x, y, z) = (vx[i] + offset[0], vy[i] + offset[1], vz[i] + offset[2]);
            let along = x * ux[i] + y * uy[i] + z * uz[i];
            let away = most(x * x + y * y + z * z - along * along, 0.0).sqrt();
            let s = most(least(along + lean[i] * away, high[i]), low[i]);
            let (x, y, z) = (x - s * ux[i], y - s * uy[i], z - s * uz[i]);
            let far = (x * x + y * y + z * z).sqrt();
            distance[i] = far - (radius[i] + slope[i] * s);
            from_centre[i] = far;
            let scale = 1.0 / most(far, f32::MIN_POSITIVE);
            (gx[i], gy[i], gz[i]) = (x * scale, y * scale, z * scale);
        }
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

    /// Signed distance of `p` to the union, mm, and the cone that decides it: of equals, the first in the
    /// list of all. `cube` is in mm.
    pub(super) fn nearest(
        &self,
        p: &Point3<f64>,
        cube: f64,
        all: &[Distance],
        answers: &mut Vec<f32>,
    ) -> (f64, u32) {
        let [vx, vy, vz, _, _, ux, uy, uz, low, high, radius, slope, lean] = self.fields();
        let offset: Vector3<f32> = ((p - self.middle) / cube).map(|x| x as f32);
        let count = vx.len();
        answers.resize(count, 0.0);
        let answers = &mut answers[..count];
        for i in 0..count {
            let (x, y, z) = (vx[i] + offset.x, vy[i] + offset.y, vz[i] + offset.z);
            let along = x * ux[i] + y * uy[i] + z * uz[i];
            let away = most(x * x + y * y + z * z - along * along, 0.0);
            let s = most(least(along + lean[i] * away.sqrt(), high[i]), low[i]);
            answers[i] = ((along - s) * (along - s) + away).sqrt() - (radius[i] + slope[i] * s);
        }
        let mut closest = 0;
        for i in 0..count {
            if answers[i] < answers[closest] {
                closest = i;
            }
        }
        let bound = answers[closest] + ROUNDING * 2.0 * (answers[closest].abs() + radius[closest].abs() + 4.0);
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
}
