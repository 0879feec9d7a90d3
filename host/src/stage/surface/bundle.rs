//! The signed distance to the union of the cones near a point of the solid: the least of theirs.
//!
//! The cones are asked in single precision, in lengths of a lattice cube from the middle of their region, so that what
//! is far off is as exact as what is near: eight cones about one point, or one about eight points.

use super::{
    block::{CLEAR, bits},
    cone::{Cone, Group},
    lattice::MAX_SHIFT,
    region::reach,
    vectors::{Vectors, all, choose, load, plus, store, times},
};
use crate::{
    lanes::{Floats, LANES, Work},
    wide::widest,
};

/// What single precision may be wrong by, as a share of the lengths that it adds up.
pub(super) const ROUNDING: f32 = 4e-6;

/// Cones around the middle of a region.
#[derive(Clone, Copy)]
pub(super) struct Bundle<'a> {
    /// Of the list of all cones, ascending.
    pub(super) cones: &'a [u32],
    /// Of them, see [`prepare`](super::cone::prepare).
    pub(super) groups: &'a [Group],
}

/// Offsets of the leaves' middles from that of their block, in cubes: of all that belongs to them, and of their points.
const LEAVES: [[f32; LANES]; 3] = offsets(-1.0, 2.0);
const LEAVES_POINTS: [[f32; LANES]; 3] = offsets(-1.25, 2.0);

/// Offsets of the points of a leaf from its middle, in cubes: corners of cubes, and middles.
const OFFSETS: [[[f32; LANES]; 3]; KINDS] = [offsets(-1.0, 1.0), offsets(-0.5, 1.0)];
const KINDS: usize = 2;

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

/// What the union is at the points of a leaf, a bit each: by kind, then by place.
#[derive(Debug, Default)]
pub(super) struct Sites {
    /// The points that are inside, and those that have been moved off the surface.
    pub(super) inside: u32,
    pub(super) moved: u32,
    /// Where the points are that have been moved, from the middle of the block, cubes.
    pub(super) places: [[[f32; LANES]; 3]; KINDS],
    /// Those that would have to be moved, but then another cone may be the nearest.
    doubtful: u32,
    /// Before any move: the signed distances, cubes, and how they grow.
    distances: [[f32; LANES]; KINDS],
    outward: [[[f32; LANES]; 3]; KINDS],
}

impl Bundle<'_> {
    /// What the cones say about the leaves of a block whose middle is the bundle's. In `touching` is put which leaves
    /// each cone touches. `apart` is room to work in.
    pub(super) fn leaves(&self, apart: &mut Vec<Apart>, touching: &mut Vec<Touching>) -> Leaves {
        widest(AskLeaves { bundle: self, apart, touching })
    }

    /// Puts in `sites` what the cones at `places` say about the points of a leaf. Rounding is that of the cone of the
    /// block whose ball is furthest from the leaf.
    pub(super) fn ask_sites(&self, leaf: usize, leaves: &Leaves, places: &[u32], sites: &mut Sites) {
        let rounding = (leaves.furthest[leaf] + 4.0) * 8.0 * ROUNDING;
        widest(AskSites { bundle: self, leaf, places, rounding, sites });
        for i in bits(sites.doubtful.into()) {
            self.settle(sites, leaf, i);
        }
    }

    /// Moves a point that is doubtful, if it can be moved.
    fn settle(&self, sites: &mut Sites, leaf: usize, i: usize) {
        let (kind, lane) = (i / LANES, i % LANES);
        let distance = sites.distances[kind][lane];
        // Away from the surface; but from a crease outward there is no getting away, only inward.
        for target in [CLEAR.copysign(distance), -CLEAR] {
            let place = [0, 1, 2].map(|axis| {
                let outward = sites.outward[kind][axis][lane];
                LEAVES[axis][leaf] + OFFSETS[kind][axis][lane] + outward * (target - distance)
            });
            let distance = widest(AskPlace { groups: self.groups, offset: place });
            if distance.abs() > 0.99 * CLEAR {
                sites.inside = sites.inside & !(1 << i) | u32::from(distance < 0.0) << i;
                sites.moved |= 1 << i;
                for (along, place) in sites.places[kind].iter_mut().zip(place) {
                    along[lane] = place;
                }
                return;
            }
        }
    }
}

/// See [`Bundle::leaves`].
struct AskLeaves<'a> {
    bundle: &'a Bundle<'a>,
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
            (of_points + L::splat(2.0 * POINTS_REACH)).min(L::splat(POINTS_REACH + CLEAR)) + rounding;
        for [distance, of_points] in &*self.apart {
            let leaves = L::load(distance).is_below(bound).bits() & surface;
            let points = L::load(of_points).is_below(points_bound).bits() & surface;
            self.touching.push(Touching { points: points as u8, leaves: leaves as u8 });
        }
        Leaves { whole: !surface, inside: own.is_below(zero).bits(), furthest: furthest.store() }
    }
}

/// See [`Bundle::ask_sites`].
struct AskSites<'a> {
    bundle: &'a Bundle<'a>,
    leaf: usize,
    places: &'a [u32],
    rounding: f32,
    sites: &'a mut Sites,
}

impl Work for AskSites<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Floats>(self) {
        let middle = all([0, 1, 2].map(|axis| LEAVES[axis][self.leaf]));
        let offsets: [Vectors<L>; KINDS] = [plus(load(&OFFSETS[0]), middle), plus(load(&OFFSETS[1]), middle)];
        let mut nearest = [Nearest::<L>::none(); KINDS];
        for &place in self.places {
            let cone = Cone::<L>::of(self.bundle.groups, place as usize);
            for (nearest, offsets) in nearest.iter_mut().zip(offsets) {
                nearest.see(&cone, offsets);
            }
        }
        let sites = self.sites;
        (sites.inside, sites.moved, sites.doubtful) = (0, 0, 0);
        let (zero, clear) = (L::splat(0.0), L::splat(CLEAR));
        for (i, (nearest, offsets)) in nearest.into_iter().zip(offsets).enumerate() {
            let Nearest { distance, from_centre, far, others } = nearest;
            let inside = distance.is_below(zero);
            let target = inside.choose(zero - clear, clear);
            let shift = target - distance;
            let way = shift.max(zero - shift);
            let near = distance.max(zero - distance).is_below(clear);
            // The cone that decides decides after the move too, by the same ball.
            let alone =
                (target + way + L::splat(self.rounding)).is_below(others).and(zero.is_below(far + shift));
            let outward = times(from_centre, L::splat(1.0) / far.max(L::splat(f32::MIN_POSITIVE)));
            sites.inside |= inside.bits() << (LANES * i);
            sites.moved |= near.and(alone).bits() << (LANES * i);
            sites.doubtful |= near.bits() << (LANES * i);
            sites.places[i] = store(plus(offsets, times(outward, shift)));
            sites.distances[i] = distance.store();
            sites.outward[i] = store(outward);
        }
        sites.doubtful &= !sites.moved;
    }
}

/// What is the nearest of the cones that eight points have been asked about.
#[derive(Clone, Copy)]
struct Nearest<L> {
    /// Signed distance, cubes.
    distance: L,
    /// From the centre of the ball that decides it, cubes.
    from_centre: Vectors<L>,
    far: L,
    /// The signed distance of all other cones at least, cubes.
    others: L,
}

impl<L: Floats> Nearest<L> {
    #[inline(always)]
    fn none() -> Self {
        let (zero, infinite) = (L::splat(0.0), L::splat(f32::INFINITY));
        Self { distance: infinite, from_centre: [zero; 3], far: zero, others: infinite }
    }

    #[inline(always)]
    fn see(&mut self, cone: &Cone<L>, offsets: Vectors<L>) {
        let (from_centre, square, radius) = cone.balls(offsets);
        let far = square.sqrt();
        let distance = far - radius;
        let nearer = distance.is_below(self.distance);
        self.others = distance.max(self.distance).min(self.others);
        self.from_centre = choose(nearer, from_centre, self.from_centre);
        self.far = nearer.choose(far, self.far);
        self.distance = distance.min(self.distance);
    }
}

/// The signed distance of a place to the union, cubes, to within rounding.
struct AskPlace<'a> {
    groups: &'a [Group],
    offset: [f32; 3],
}

impl Work for AskPlace<'_> {
    type Output = f32;

    #[inline(always)]
    fn run<L: Floats>(self) -> f32 {
        let offset = all::<L>(self.offset);
        let mut least = L::splat(f32::INFINITY);
        for group in self.groups {
            let (_, square, radius) = Cone::each(group).balls(offset);
            least = (square.sqrt() - radius).min(least);
        }
        least.store().into_iter().fold(f32::INFINITY, f32::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    use crate::stage::surface::{block::tests::cones, cone::prepare, distance::Distance};

    #[test]
    fn all_lanes_say_the_same_about_leaves_and_points() {
        let distances: Vec<Distance> = cones().iter().map(Distance::to).collect();
        let cones: Vec<u32> = (0..distances.len() as u32).collect();
        let mut seen = [0; 3];
        for cube in [0.5, 0.7, 3.0] {
            let (mut groups, middle) = (Vec::new(), Point3::new(8.0, 7.0, 6.0));
            prepare(&cones, &distances, &middle, cube, &mut groups);
            let bundle = &Bundle { cones: &cones, groups: &groups };
            let ask = |is_widest| {
                let (mut apart, mut touching) = (Vec::new(), Vec::new());
                let asked = AskLeaves { bundle, apart: &mut apart, touching: &mut touching };
                let leaves = if is_widest { widest(asked) } else { asked.run::<wide::f32x8>() };
                let distances = apart.as_flattened().as_flattened().iter().map(|x| x.to_bits());
                let touching: Vec<_> =
                    touching.iter().map(|touching| [touching.points, touching.leaves]).collect();
                let furthest = leaves.furthest.map(f32::to_bits);
                (distances.collect::<Vec<_>>(), touching, leaves.whole, leaves.inside, furthest)
            };
            assert_eq!(ask(true), ask(false), "{cube}");
            let ask = |leaf, is_widest| {
                let mut sites = Sites::default();
                let asked = AskSites { bundle, leaf, places: &cones, rounding: 1e-4, sites: &mut sites };
                if is_widest {
                    widest(asked);
                } else {
                    asked.run::<wide::f32x8>();
                }
                let Sites { inside, moved, doubtful, places, outward, distances } = sites;
                let vectors =
                    [places, outward].map(|all| all.map(|axes| axes.map(|along| along.map(f32::to_bits))));
                (inside, moved, doubtful, vectors, distances.map(|all| all.map(f32::to_bits)))
            };
            for leaf in 0..8 {
                let told = ask(leaf, true);
                assert_eq!(told, ask(leaf, false), "{cube} {leaf}");
                seen = std::array::from_fn(|k| seen[k] | [told.0, told.1, told.2][k]);
            }
        }
        assert!(
            seen.iter().all(|&points| points != 0),
            "some are inside, some moved, some doubtful: {seen:x?}"
        );
    }
}
