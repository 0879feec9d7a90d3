//! Where edges of the lattice leave the solid.
//!
//! In: edges from a point inside to one outside, the cones that can touch them, all in cubes from the middle of a
//! block. Out: points of the edges, on the surface to within rounding.
//!
//! A cone is convex, so an edge whose end is outside has at most one stretch in each. Where the last of these
//! stretches ends no cone is left: that is the place, the largest share of the edge below 1 at which it leaves a cone,
//! and each cone is asked once, about eight edges at a time, in single precision.

use nalgebra::{Point3, Vector3};

use super::{
    block::fours,
    cone::Cone,
    lattice::{EDGES, ENDS, SIDE},
    near::{PLACES, Points},
    patch::{Blocks, Cut, Edges},
    region::{Region, Solid},
    vectors::{Vectors, dot, less, plus, store, times},
};
use crate::lanes::{Floats, LANES, Work};

/// A vertex stays this share of its edge off the ends even where no point could be moved clear of the
/// surface, as on a ball smaller than the way that they are moved.
const END: f32 = 0.02;

/// Edges that may be cut in a leaf.
const MOST: usize = 8 * EDGES;

/// The edges of a block that are cut, by leaf, and beyond the last leaf what is none.
#[derive(Debug)]
pub(super) struct Sorted {
    counts: [usize; 9],
    /// The places of the ends, that inside first; what is beyond the last edge of a leaf is of others.
    ends: [[[u8; 2]; MOST]; 9],
    /// The numbers of the vertices, from the block's first.
    numbers: [[u16; MOST]; 9],
}

impl Default for Sorted {
    fn default() -> Self {
        Self { counts: [0; 9], ends: [[[0; 2]; MOST]; 9], numbers: [[0; MOST]; 9] }
    }
}

impl Sorted {
    #[inline(always)]
    fn fill(&mut self, edges: &[Edges; EDGES], inside: [u64; 2]) {
        self.counts = [0; 9];
        let mut number = 0;
        for (&[first, second], edges) in ENDS.iter().zip(edges) {
            let [start, end] = [Points::offset(first), Points::offset(second)];
            for four in fours(edges.cubes) {
                for bit in four {
                    let leaf = bit / 8;
                    let count = self.counts[leaf];
                    let [start, end] = [(PLACES[bit] + start) as u8, (PLACES[bit] + end) as u8];
                    let outward = inside[first.kind] >> (bit % 64) & 1 == 1;
                    self.ends[leaf][count] = if outward { [start, end] } else { [end, start] };
                    self.numbers[leaf][count] = number;
                    self.counts[leaf] = count + 1;
                    number += u16::from(leaf < 8);
                }
            }
        }
    }
}

/// Puts a block's vertices into `vertices`, mm; `points` are those that it sees, and `sorted` is room to work in.
pub(super) struct PutVertices<'a> {
    pub(super) cut: &'a Cut,
    pub(super) solid: &'a Solid<'a>,
    pub(super) blocks: &'a Blocks<'a>,
    pub(super) points: &'a Points,
    pub(super) sorted: &'a mut Sorted,
    pub(super) vertices: &'a mut [Point3<f64>],
}

impl Work for PutVertices<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Floats>(self) {
        let (grove, own) = self.blocks[0].expect("a block");
        let middle = self.solid.middle(Region { corner: own.corner, cubes: SIDE });
        self.sorted.fill(&self.cut.edges, own.inside);
        for leaf in 0..8 {
            let (groups, places) = grove.touching(own, leaf);
            let ends = self.sorted.ends[leaf].as_chunks().0;
            let numbers = self.sorted.numbers[leaf][..self.sorted.counts[leaf]].chunks(LANES);
            for (ends, numbers) in ends.iter().zip(numbers) {
                let mut crossings = Crossings::<L>::between(self.points.at(ends, 0), self.points.at(ends, 1));
                for &place in places {
                    crossings.leave(&Cone::of(groups, place as usize));
                }
                let [x, y, z] = crossings.places();
                for (i, &number) in numbers.iter().enumerate() {
                    let place = Vector3::new(f64::from(x[i]), f64::from(y[i]), f64::from(z[i]));
                    self.vertices[usize::from(number)] = middle + place * self.solid.lattice.cube;
                }
            }
        }
    }
}

/// Eight edges.
struct Crossings<L> {
    start: Vectors<L>,
    step: Vectors<L>,
    /// The square of the edge's length.
    square: L,
    /// The share of the edge at which it leaves the cones that have been asked.
    share: L,
}

impl<L: Floats> Crossings<L> {
    /// From points inside to points outside.
    #[inline(always)]
    fn between(start: Vectors<L>, end: Vectors<L>) -> Self {
        let step = less(end, start, L::splat(1.0));
        Self { start, step, square: dot(step, step), share: L::splat(0.0) }
    }

    /// Asks a cone.
    ///
    /// It is the balls along its axis, none of which is left after the cone: so the last ball that is left is enough.
    /// That is the ball of an end, or that by whose side the edge leaves. A point is deepest, by squares, in one ball,
    /// whose place on the axis moves as the point does.
    #[inline(always)]
    fn leave(&mut self, cone: &Cone<L>) {
        let from = plus(cone.middle, self.start);
        // Of the ball at the point of the axis that the cone is seen from; those of others follow.
        let (a, b) = (self.square, dot(from, self.step));
        let c = dot(from, from) - cone.radius * cone.radius;
        if cone.is_ball {
            return self.leave_at(exit(a, b, c));
        }
        // 1 divided by what is left of 1 by the square of the slope.
        let steep = L::splat(1.0) + cone.lean * cone.lean;
        let flat = L::splat(1.0) / steep;
        let ahead = dot(self.step, cone.axis);
        let base = dot(from, cone.axis) + cone.slope * cone.radius;
        let (deepest, moved) = (base * steep, ahead * steep);
        let place = deepest + moved * exit(a - ahead * moved, b - base * moved, c - base * deepest);
        let between = cone.low.is_at_most(place).and(place.is_at_most(cone.high));
        for s in [cone.low, cone.high, between.choose(place, cone.low)] {
            self.leave_at(exit(a, b - ahead * s, c - (base + base - flat * s) * s));
        }
    }

    /// Leaves a ball at a share of the edge, if there is one and the edge does not end in the ball.
    #[inline(always)]
    fn leave_at(&mut self, share: L) {
        self.share = share.and(share.is_below(L::splat(1.0))).max(self.share);
    }

    /// The places, along each axis.
    #[inline(always)]
    fn places(&self) -> [[f32; LANES]; 3] {
        let share = self.share.max(L::splat(END)).min(L::splat(1.0 - END));
        store(plus(self.start, times(self.step, share)))
    }
}

/// The zero of a t^2 + 2 b t + c at which it grows; no number if there is none.
#[inline(always)]
fn exit<L: Floats>(a: L, b: L, c: L) -> L {
    let zero = L::splat(0.0);
    let root = (b * b - a * c).sqrt();
    let grows = zero.is_below(b);
    grows.choose(zero - c, root - b) / grows.choose(b + root, a)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stage::surface::{RoundCone, cone::prepare, distance::Distance, vectors::all};
    use wide::f32x8;

    /// Where an edge leaves a cone from the origin along the first axis, and how far from the cone it is after a share.
    fn left(radii: [f64; 2], start: Vector3<f64>, step: Vector3<f64>) -> (f32, impl Fn(f64) -> f64) {
        let cone = RoundCone { centres: [Point3::origin(), Point3::new(10.0, 0.0, 0.0)], radii };
        let distance = Distance::to(&cone);
        let mut groups = Vec::new();
        prepare(&[0], &[distance], &Point3::new(4.0, 1.0, 2.0), 1.0, &mut groups);
        let seen = |p: Vector3<f64>| all((p - Vector3::new(4.0, 1.0, 2.0)).map(|x| x as f32).into());
        let mut crossings = Crossings::<f32x8>::between(seen(start), seen(start + step));
        crossings.leave(&Cone::of(&groups, 0));
        (crossings.share.store()[5], move |share| distance.at(&Point3::from(start + step * share)))
    }

    #[test]
    fn an_edge_leaves_a_cone_where_the_distance_is_zero() {
        let at = |i: i32, n: i32| f64::from(i * n % 17) - 8.0;
        // Up to sides that are all but upright, and a ball that contains the other.
        let tapered = [0.0, 0.3, 0.5, 0.7, 0.9, 0.99, 1.01].map(|slope| [0.5, 0.5 + 10.0 * slope]);
        let mut count = 0;
        for ([small, large], i) in tapered.iter().flat_map(|radii| (0..180).map(move |i| (*radii, i))) {
            let radii = if i % 2 == 0 { [small, large] } else { [large, small] };
            // A third begins on the axis, and a fifth each runs ahead along it and back.
            let away = if i % 3 == 0 { 0.0 } else { 0.3 };
            let start = Vector3::new(f64::from(i % 11), away * at(i, 5), away * at(i, 7));
            let step = match i % 5 {
                0 => Vector3::x(),
                1 => -Vector3::x(),
                _ => Vector3::new(at(i, 3), at(i, 11), at(i, 13) + 0.5).normalize(),
            } * 30.0;
            let (share, distance) = left(radii, start, step);
            let from_inside = distance(0.0) < 0.0 && distance(1.0) > 0.0;
            assert!(share > 0.0 || !from_inside, "{radii:?} {i}");
            // From outside too, as of an edge that begins in another cone.
            if share > 0.0 {
                let off = distance(share.into());
                assert!(off.abs() < 2e-4, "{radii:?} {i}: {share} {off}");
                assert!(distance(f64::from(share) + 0.01) > 0.0, "{radii:?} {i}: {share}");
                count += 1;
            }
        }
        assert!(count > 900, "{count}");
    }

    #[test]
    fn what_an_edge_misses_or_ends_in_does_not_count() {
        let (missed, _) = left([1.0, 2.0], Vector3::new(0.0, 9.0, 0.0), Vector3::x());
        assert_eq!(missed, 0.0);
        let (ended_in, _) = left([1.0, 2.0], Vector3::new(-4.0, 0.0, 0.0), Vector3::x() * 5.0);
        assert_eq!(ended_in, 0.0);
    }
}
