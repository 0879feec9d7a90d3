//! The signed distance to the union of the cones near a point of the solid: the least of theirs.
//!
//! The cones are first asked in single precision, four at once and in lengths of a lattice cube from the
//! middle of their region; only those that come within rounding of the least are asked exactly.

use nalgebra::Point3;

use super::{
    distance::Distance,
    lanes::{LANES, Lanes, Vectors, all, dot, plus},
};

/// What single precision may be wrong by, as a share of the lengths that it adds up.
pub(super) const ROUNDING: f32 = 4e-6;

/// So far off, in cubes, is what fills the last group.
const NOWHERE: f32 = 1e15;

/// Points of a leaf, in [`Bundle::nearest_of_sites`], by fours.
pub(super) const SITES: usize = 16;

/// Four cones, in cubes, as seen from the middle of a region: by the point of the axis nearest to it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Group {
    /// From that point to the middle.
    pub(super) middle: Vectors,
    /// Unit vector along the axis; zero for a ball.
    pub(super) axis: Vectors,
    /// The ends of the axis, from that point.
    pub(super) low: Lanes,
    pub(super) high: Lanes,
    /// The radius there, its growth along the axis, and the tangent of the side's angle to it.
    pub(super) radius: Lanes,
    pub(super) slope: Lanes,
    pub(super) lean: Lanes,
}

impl Group {
    /// Up to four cones, around `middle`, in lengths of 1 / `scale` mm.
    fn of(cones: &[u32], all: &[Distance], middle: &Point3<f64>, scale: f64) -> Self {
        let mut numbers = [[0.0; LANES]; 11];
        // What fills the group is a point nowhere near.
        numbers[0] = [NOWHERE; LANES];
        for (lane, &cone) in cones.iter().enumerate() {
            let cone = &all[cone as usize];
            let from_start = middle - cone.start;
            let base = from_start.dot(&cone.axis).clamp(0.0, cone.length);
            let from_base = (from_start - cone.axis * base) * scale;
            for axis in 0..3 {
                numbers[axis][lane] = from_base[axis] as f32;
                numbers[3 + axis][lane] = cone.axis[axis] as f32;
            }
            numbers[6][lane] = (-base * scale) as f32;
            numbers[7][lane] = ((cone.length - base) * scale) as f32;
            numbers[8][lane] = ((cone.radius + cone.slope * base) * scale) as f32;
            numbers[9][lane] = cone.slope as f32;
            numbers[10][lane] = cone.lean as f32;
        }
        let lanes = |i: usize| Lanes::from(numbers[i]);
        Self {
            middle: [lanes(0), lanes(1), lanes(2)],
            axis: [lanes(3), lanes(4), lanes(5)],
            low: lanes(6),
            high: lanes(7),
            radius: lanes(8),
            slope: lanes(9),
            lean: lanes(10),
        }
    }

    /// The squares of how far a point at `offset` from the middle is from the centres of the balls that decide
    /// its distances, and their radii.
    #[inline(always)]
    fn balls(&self, offset: Vectors) -> (Lanes, Lanes) {
        let p = plus(self.middle, offset);
        let along = dot(p, self.axis);
        let away = (dot(p, p) - along * along).fast_max(Lanes::ZERO);
        let (square, s) = nearest_ball(along, away, [self.low, self.high, self.lean]);
        (square, self.radius + self.slope * s)
    }
}

/// The square of how far a point is from the centre of the ball that decides its distance, and where on the
/// axis that is; from where the point is along the axis, and the square of how far away from it.
#[inline(always)]
pub(super) fn nearest_ball(along: Lanes, away: Lanes, [low, high, lean]: Vectors) -> (Lanes, Lanes) {
    let s = (along + lean * away.sqrt()).fast_min(high).fast_max(low);
    let short = along - s;
    (short * short + away, s)
}

/// Appends what [`Bundle`] keeps of `cones`.
pub(super) fn prepare(
    cones: &[u32],
    all: &[Distance],
    middle: &Point3<f64>,
    cube: f64,
    groups: &mut Vec<Group>,
) {
    groups.extend(cones.chunks(LANES).map(|cones| Group::of(cones, all, middle, 1.0 / cube)));
}

/// Cones around the middle of a region.
#[derive(Clone, Copy)]
pub(super) struct Bundle<'a> {
    /// Of the list of all cones, ascending.
    pub(super) cones: &'a [u32],
    /// Of them, see [`prepare`].
    pub(super) groups: &'a [Group],
    /// The middle of the region, mm.
    pub(super) middle: Point3<f64>,
}

impl Bundle<'_> {
    /// Signed distances, cubes, of points that are `offsets` cubes from the middle, and the places in the
    /// bundle of the cones that decide them, to within rounding.
    pub(super) fn nearest_of_sites(
        &self,
        offsets: &[[[f32; LANES]; 3]; SITES / LANES],
    ) -> ([f32; SITES], [usize; SITES]) {
        let mut nearest = [Lanes::splat(f32::INFINITY); SITES / LANES];
        // As numbers, which are exact for all that there is memory for.
        let mut places = [Lanes::ZERO; SITES / LANES];
        for (group, first) in self.groups.iter().zip((0..self.cones.len()).step_by(LANES)) {
            let [x, y, z] = group.middle.map(Lanes::to_array);
            let [ux, uy, uz] = group.axis.map(Lanes::to_array);
            let [low, high, lean] = [group.low, group.high, group.lean].map(Lanes::to_array);
            let (radius, slope) = (group.radius.to_array(), group.slope.to_array());
            for lane in 0..LANES.min(self.cones.len() - first) {
                let (middle, axis) = (all([x[lane], y[lane], z[lane]]), all([ux[lane], uy[lane], uz[lane]]));
                let extent = all([low[lane], high[lane], lean[lane]]);
                let (wide, slope) = (Lanes::splat(radius[lane]), Lanes::splat(slope[lane]));
                let place = Lanes::splat((first + lane) as f32);
                for i in 0..SITES / LANES {
                    let [ox, oy, oz] = offsets[i];
                    let p = plus(middle, [ox.into(), oy.into(), oz.into()]);
                    let square = dot(p, p);
                    let distance = if low[lane] == high[lane] {
                        square.sqrt() - wide
                    } else {
                        let along = dot(p, axis);
                        let away = (square - along * along).fast_max(Lanes::ZERO);
                        let (square, s) = nearest_ball(along, away, extent);
                        square.sqrt() - (wide + slope * s)
                    };
                    places[i] = distance.simd_lt(nearest[i]).bitselect(place, places[i]);
                    nearest[i] = distance.fast_min(nearest[i]);
                }
            }
        }
        let mut sites = ([0.0; SITES], [0; SITES]);
        for i in 0..SITES {
            sites.0[i] = nearest[i / LANES].to_array()[i % LANES];
            sites.1[i] = places[i / LANES].to_array()[i % LANES] as usize;
        }
        sites
    }

    /// Where `p` is from the middle, in cubes of `cube` mm.
    fn offset(&self, p: &Point3<f64>, cube: f64) -> Vectors {
        let scale = 1.0 / cube;
        let along = |axis: usize| Lanes::splat(((p[axis] - self.middle[axis]) * scale) as f32);
        [along(0), along(1), along(2)]
    }

    /// Signed distance of `p` to the union, mm, and the cone that decides it: of equals, the first in the
    /// list of all. `cube` is in mm.
    pub(super) fn nearest(&self, p: &Point3<f64>, cube: f64, all: &[Distance]) -> (f64, u32) {
        let offset = self.offset(p, cube);
        let distance = |group: &Group| {
            let (square, radius) = group.balls(offset);
            (square.sqrt() - radius, square)
        };
        let (mut least, mut far) = (f32::INFINITY, 0.0);
        for group in self.groups {
            let (distance, square) = distance(group);
            for (distance, square) in distance.to_array().into_iter().zip(square.to_array()) {
                if distance < least {
                    (least, far) = (distance, square.sqrt());
                }
            }
        }
        let bound = least + 4.0 * ROUNDING * (far + 4.0);
        let mut best = (f64::INFINITY, u32::MAX);
        for (group, cones) in self.groups.iter().zip(self.cones.chunks(LANES)) {
            for (&cone, distance) in cones.iter().zip(distance(group).0.to_array()) {
                if distance <= bound {
                    let distance = all[cone as usize].at(p);
                    if distance < best.0 {
                        best = (distance, cone);
                    }
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
    ) -> Option<u32> {
        let mut best = (-exact, None);
        let offset = self.offset(p, cube);
        for (group, cones) in self.groups.iter().zip(self.cones.chunks(LANES)) {
            let (square, radius) = group.balls(offset);
            // A little larger for rounding: of the point's distance, and of the radius.
            let radius = radius * Lanes::splat(1.0 + 2.0 * ROUNDING) + Lanes::splat(8.0 * ROUNDING);
            let mut inside = square.simd_lt(radius * radius).to_bitmask();
            while inside != 0 {
                let cone = cones[inside.trailing_zeros() as usize];
                inside &= inside - 1;
                if cone != known {
                    let distance = all[cone as usize].at(p);
                    if distance < best.0 {
                        best = (distance, Some(cone));
                    }
                }
            }
        }
        best.1
    }
}
