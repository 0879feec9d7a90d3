//! The signed distance to the union of the cones near a point of the solid: the least of theirs.
//!
//! The cones are asked in single precision, in lengths of a lattice cube from the middle of their region, so that what
//! is far off is as exact as what is near: eight cones about one point, or one about eight points.

use nalgebra::Point3;

use super::{
    cone::{Cone, Group},
    lattice::MAX_SHIFT,
    region::reach,
    vectors::{Vectors, all, load, plus},
};
use crate::{
    lanes::{Floats, LANES, Work},
    wide::widest,
};

/// What single precision may be wrong by, as a share of the lengths that it adds up.
pub(super) const ROUNDING: f32 = 4e-6;

/// Points of a leaf, in [`Bundle::nearest_of_sites`].
pub(super) const SITES: usize = 16;

/// Cones around the middle of a region.
#[derive(Clone, Copy)]
pub(super) struct Bundle<'a> {
    /// Of the list of all cones, ascending.
    pub(super) cones: &'a [u32],
    /// Of them, see [`prepare`](super::cone::prepare).
    pub(super) groups: &'a [Group],
    /// The middle of the region, mm.
    pub(super) middle: Point3<f64>,
}

/// Offsets of the leaves' middles from that of their block, in cubes: of all that belongs to them, and of their points.
const LEAVES: [[f32; LANES]; 3] = offsets(-1.0, 2.0);
const LEAVES_POINTS: [[f32; LANES]; 3] = offsets(-1.25, 2.0);

/// Offsets of the points of a leaf from its middle, in cubes: corners of cubes, and middles.
const OFFSETS: [[[f32; LANES]; 3]; KINDS] = [offsets(-1.0, 1.0), offsets(-0.5, 1.0)];
const KINDS: usize = SITES / LANES;

/// The corners of a cube, from its lowest one to `step` further.
const fn offsets(lowest: f32, step: f32) -> [[f32; LANES]; 3] {
    let mut offsets = [[lowest; LANES]; 3];
    let mut i = 0;
    while i < 3 * LANES {
        offsets[i / LANES][i % LANES] += step * ((i % LANES) >> (2 - i / LANES) & 1) as f32;
        i += 1;
    }
    offsets
}

/// How far all that belongs to a leaf is from its middle, cubes.
const REACH: f32 = reach(2);

/// How far the points of a leaf are from their middle, wherever they are moved to, cubes.
const POINTS_REACH: f32 = 0.75 * 1.732_051 + MAX_SHIFT as f32;

/// What the union is in the leaves of a block.
pub(super) struct Leaves {
    /// Those in which the surface does not pass, and those whose middle is inside.
    pub(super) whole: u32,
    pub(super) inside: u32,
    /// How far, of all cones of the block, the centres of the balls are from the middles of the leaves at most, cubes.
    furthest: [f32; LANES],
}

/// The leaves of a block, a bit each, that a cone touches.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Touching {
    /// Those of which it may decide at a point.
    pub(super) points: u8,
    /// Those in which it may decide anywhere.
    pub(super) leaves: u8,
}

/// How far a cone is from the middles of a block's leaves, and from the middles of their points, cubes.
pub(super) type Apart = [[f32; LANES]; 2];

/// What the union is at the points of a leaf.
pub(super) struct Sites {
    /// The ids of the cones that decide.
    pub(super) cones: [u32; SITES],
    /// How far all other cones are at least, cubes.
    pub(super) others: [f32; SITES],
    /// The points that are inside, and those so near to the surface that rounding or a move may change that.
    pub(super) inside: u32,
    pub(super) near: u32,
}

impl Bundle<'_> {
    /// What the cones say about the leaves of a block whose middle is the bundle's. In `touching` is put which leaves
    /// each cone touches; those that come within `clear` cubes of a point may decide there. `apart` is room to work in.
    pub(super) fn leaves(&self, clear: f32, apart: &mut Vec<Apart>, touching: &mut Vec<Touching>) -> Leaves {
        widest(AskLeaves { bundle: self, clear, apart, touching })
    }

    /// What the cones at `places` say about the points of a leaf. Those within `clear` cubes of the surface, to
    /// within rounding, are near; rounding is that of the cone of the block whose ball is furthest from the leaf.
    pub(super) fn nearest_of_sites(&self, leaf: usize, leaves: &Leaves, places: &[u32], clear: f32) -> Sites {
        let rounding = (leaves.furthest[leaf] + 4.0) * 8.0 * ROUNDING;
        widest(AskSites { bundle: self, leaf, places, clear, rounding })
    }

    /// Where `p` is from the middle, in cubes of `cube` mm.
    pub(super) fn offset(&self, p: &Point3<f64>, cube: f64) -> [f32; 3] {
        let scale = 1.0 / cube;
        [0, 1, 2].map(|axis| ((p[axis] - self.middle[axis]) * scale) as f32)
    }

    /// Signed distance of `p` to the union, in cubes of `cube` mm, to within rounding.
    pub(super) fn nearest(&self, p: &Point3<f64>, cube: f64) -> f32 {
        widest(Nearest { groups: self.groups, offset: self.offset(p, cube) })
    }
}

/// See [`Bundle::leaves`].
struct AskLeaves<'a> {
    bundle: &'a Bundle<'a>,
    clear: f32,
    apart: &'a mut Vec<Apart>,
    touching: &'a mut Vec<Touching>,
}

impl Work for AskLeaves<'_> {
    type Output = Leaves;

    #[inline(always)]
    fn run<L: Floats>(self) -> Leaves {
        let mut nearest = [L::splat(f32::INFINITY); 2];
        let mut furthest = L::splat(0.0);
        self.apart.clear();
        self.touching.clear();
        for place in 0..self.bundle.cones.len() {
            let cone = Cone::<L>::of(self.bundle.groups, place);
            let (distance, far) = cone.at(load(&LEAVES));
            let (of_points, _) = cone.at(load(&LEAVES_POINTS));
            furthest = far.max(furthest);
            nearest = [distance.min(nearest[0]), of_points.min(nearest[1])];
            self.apart.push([distance.store(), of_points.store()]);
        }
        let rounding = furthest * L::splat(ROUNDING);
        let [own, of_points] = nearest;
        let zero = L::splat(0.0);
        let surface = own.max(zero - own).is_below(L::splat(REACH) + rounding).bits();
        // A cone that is nowhere the nearest, or touches nothing, decides nothing.
        let bound = (own + L::splat(2.0 * REACH)).min(L::splat(REACH)) + rounding;
        let points_bound =
            (of_points + L::splat(2.0 * POINTS_REACH)).min(L::splat(POINTS_REACH + self.clear)) + rounding;
        for [distance, of_points] in &*self.apart {
            let leaves = L::load(distance).is_below(bound).bits() & surface;
            let points = L::load(of_points).is_below(points_bound).bits() & surface;
            self.touching.push(Touching { points: points as u8, leaves: leaves as u8 });
        }
        Leaves { whole: !surface, inside: own.is_below(zero).bits(), furthest: furthest.store() }
    }
}

/// See [`Bundle::nearest_of_sites`].
struct AskSites<'a> {
    bundle: &'a Bundle<'a>,
    leaf: usize,
    places: &'a [u32],
    clear: f32,
    rounding: f32,
}

impl Work for AskSites<'_> {
    type Output = Sites;

    #[inline(always)]
    fn run<L: Floats>(self) -> Sites {
        let middle = all([0, 1, 2].map(|axis| LEAVES[axis][self.leaf]));
        let offsets: [Vectors<L>; KINDS] = [plus(load(&OFFSETS[0]), middle), plus(load(&OFFSETS[1]), middle)];
        let mut nearest = [L::splat(f32::INFINITY); KINDS];
        let mut others = nearest;
        // As numbers, which are exact for all that there is memory for.
        let mut deciding = [L::splat(0.0); KINDS];
        for &place in self.places {
            let cone = Cone::<L>::of(self.bundle.groups, place as usize);
            for i in 0..KINDS {
                let (distance, _) = cone.at(offsets[i]);
                others[i] = distance.max(nearest[i]).min(others[i]);
                deciding[i] = distance.is_below(nearest[i]).choose(L::splat(place as f32), deciding[i]);
                nearest[i] = distance.min(nearest[i]);
            }
        }
        let mut sites = Sites { cones: [0; SITES], others: [0.0; SITES], inside: 0, near: 0 };
        let (zero, rounding) = (L::splat(0.0), L::splat(self.rounding));
        for i in 0..KINDS {
            let near = nearest[i].max(zero - nearest[i]).is_below(rounding + L::splat(self.clear));
            sites.inside |= nearest[i].is_below(zero).bits() << (LANES * i);
            sites.near |= near.bits() << (LANES * i);
            sites.others.as_chunks_mut().0[i] = (others[i] - rounding).store();
            for (cone, place) in sites.cones[LANES * i..].iter_mut().zip(deciding[i].store()) {
                *cone = self.bundle.cones[place as usize];
            }
        }
        sites
    }
}

/// See [`Bundle::nearest`].
struct Nearest<'a> {
    groups: &'a [Group],
    offset: [f32; 3],
}

impl Work for Nearest<'_> {
    type Output = f32;

    #[inline(always)]
    fn run<L: Floats>(self) -> f32 {
        let offset = all::<L>(self.offset);
        let mut least = L::splat(f32::INFINITY);
        for group in self.groups {
            let (_, square, radius) = group.balls(offset);
            least = (square.sqrt() - radius).min(least);
        }
        least.store().into_iter().fold(f32::INFINITY, f32::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stage::surface::{block::tests::cones, cone::prepare, distance::Distance};

    #[test]
    fn all_lanes_say_the_same_about_leaves() {
        let distances: Vec<Distance> = cones().iter().map(Distance::to).collect();
        let cones: Vec<u32> = (0..distances.len() as u32).collect();
        for cube in [0.5, 0.7, 3.0] {
            let (mut groups, middle) = (Vec::new(), Point3::new(8.0, 7.0, 6.0));
            prepare(&cones, &distances, &middle, cube, &mut groups);
            let bundle = &Bundle { cones: &cones, groups: &groups, middle };
            let ask = |is_widest| {
                let (mut apart, mut touching) = (Vec::new(), Vec::new());
                let asked = AskLeaves { bundle, clear: 0.12, apart: &mut apart, touching: &mut touching };
                let leaves = if is_widest { widest(asked) } else { asked.run::<wide::f32x8>() };
                let distances = apart.as_flattened().as_flattened().iter().map(|x| x.to_bits());
                let touching: Vec<_> =
                    touching.iter().map(|touching| [touching.points, touching.leaves]).collect();
                let furthest = leaves.furthest.map(f32::to_bits);
                (distances.collect::<Vec<_>>(), touching, leaves.whole, leaves.inside, furthest)
            };
            assert_eq!(ask(true), ask(false), "{cube}");
        }
    }
}
