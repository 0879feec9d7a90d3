//! The signed distance to the union of the cones near a point of the solid: the least of theirs.
//!
//! The cones are asked in single precision, in lengths of a lattice cube from the middle of their region, so that what
//! is far off is as exact as what is near: four cones about one point, or one about four points.

use nalgebra::Point3;

use super::{
    distance::Distance,
    lanes::{LANES, Lanes, Vectors, dot, plus},
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
    /// Whether all are balls, of which the ends are one point.
    are_balls: bool,
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
            are_balls: numbers[6] == numbers[7],
        }
    }

    /// The squares of how far a point at `offset` from the middle is from the centres of the balls that decide
    /// its distances, and their radii.
    #[inline(always)]
    fn balls(&self, offset: Vectors) -> (Lanes, Lanes) {
        let p = plus(self.middle, offset);
        if self.are_balls {
            return (dot(p, p), self.radius);
        }
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

/// Registers that the leaves of a block, and the points of a leaf, fill.
const LEAVES: usize = 8 / LANES;
const POINTS: usize = SITES / LANES;

/// Offsets of the leaves of a block from its middle, in cubes.
const LEAF_OFFSETS: [[[f32; LANES]; 3]; LEAVES] = offsets([-1.0, -1.0], 2.0);

/// Offsets of the points of a leaf from its middle, in cubes: corners of cubes first.
const OFFSETS: [[[f32; LANES]; 3]; POINTS] = offsets([-0.75, -0.25], 1.0);

/// Cubes of eight points each, from the lowest point of each to the highest ones `step` further.
const fn offsets<const N: usize>(lowest: [f32; 2], step: f32) -> [[[f32; LANES]; 3]; N] {
    let mut offsets = [[[0.0; LANES]; 3]; N];
    let mut i = 0;
    while i < N * LANES {
        let mut axis = 0;
        while axis < 3 {
            offsets[i / LANES][axis][i % LANES] = lowest[i >> 3] + step * (i >> (2 - axis) & 1) as f32;
            axis += 1;
        }
        i += 1;
    }
    offsets
}

/// How far the corners of a leaf are from its middle, cubes.
const REACH: f32 = 1.732_051;

/// What the union is in the leaves of a block.
pub(super) struct Leaves {
    /// Those in which the surface does not pass, and those whose middle is inside.
    pub(super) whole: u32,
    pub(super) inside: u32,
    /// The places of the cones nearest to their middles.
    pub(super) nearest: [usize; 8],
}

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

/// One of four cones.
struct One {
    middle: Vectors,
    axis: Vectors,
    /// Its ends and its lean.
    extent: Vectors,
    radius: Lanes,
    slope: Lanes,
    is_ball: bool,
}

impl One {
    #[inline(always)]
    fn of(groups: &[Group], place: usize) -> Self {
        let (group, lane) = (&groups[place / LANES], place % LANES);
        let of = |lanes: &Lanes| Lanes::splat(lanes.as_array()[lane]);
        Self {
            middle: group.middle.each_ref().map(of),
            axis: group.axis.each_ref().map(of),
            extent: [&group.low, &group.high, &group.lean].map(of),
            radius: of(&group.radius),
            slope: of(&group.slope),
            is_ball: group.low.as_array()[lane] == group.high.as_array()[lane],
        }
    }

    /// Signed distances, and how far the centres of the balls that decide them are.
    #[inline(always)]
    fn at(&self, offsets: &[[f32; LANES]; 3]) -> (Lanes, Lanes) {
        let p = plus(self.middle, offsets.map(Lanes::from));
        let square = dot(p, p);
        if self.is_ball {
            let far = square.sqrt();
            return (far - self.radius, far);
        }
        let along = dot(p, self.axis);
        let away = (square - along * along).fast_max(Lanes::ZERO);
        let (square, s) = nearest_ball(along, away, self.extent);
        let far = square.sqrt();
        (far - (self.radius + self.slope * s), far)
    }
}

impl Bundle<'_> {
    /// What the cones say about the leaves of a block whose middle is the bundle's. Of each cone goes into `touching`
    /// in which leaves, a bit each, it comes within `clear` cubes and may be the nearest somewhere.
    pub(super) fn leaves(&self, clear: f32, touching: &mut Vec<u32>) -> Leaves {
        let mut nearest = [Lanes::splat(f32::INFINITY); LEAVES];
        let (mut furthest, mut deciding) = ([Lanes::ZERO; LEAVES], [Lanes::ZERO; LEAVES]);
        for place in 0..self.cones.len() {
            let cone = One::of(self.groups, place);
            for i in 0..LEAVES {
                let (distance, far) = cone.at(&LEAF_OFFSETS[i]);
                furthest[i] = far.fast_max(furthest[i]);
                deciding[i] = distance.simd_lt(nearest[i]).bitselect(Lanes::splat(place as f32), deciding[i]);
                nearest[i] = distance.fast_min(nearest[i]);
            }
        }
        let mut leaves = Leaves { whole: 0, inside: 0, nearest: [0; 8] };
        let mut bounds = [Lanes::ZERO; LEAVES];
        for i in 0..LEAVES {
            let rounding = furthest[i] * Lanes::splat(ROUNDING);
            let whole = (Lanes::splat(REACH) + rounding).simd_lt(nearest[i].abs());
            leaves.whole |= whole.to_bitmask() << (LANES * i);
            leaves.inside |= nearest[i].simd_lt(Lanes::ZERO).to_bitmask() << (LANES * i);
            for (nearest, place) in leaves.nearest[LANES * i..].iter_mut().zip(deciding[i].to_array()) {
                *nearest = place as usize;
            }
            let nearest_somewhere = nearest[i] + Lanes::splat(2.0 * REACH);
            bounds[i] = nearest_somewhere.fast_min(Lanes::splat(REACH + clear)) + rounding;
        }
        touching.clear();
        touching.extend((0..self.cones.len()).map(|place| {
            let cone = One::of(self.groups, place);
            let touches =
                |i: usize| cone.at(&LEAF_OFFSETS[i]).0.simd_lt(bounds[i]).to_bitmask() << (LANES * i);
            (0..LEAVES).map(touches).fold(0, |all, some| all | some) & !leaves.whole
        }));
        leaves
    }

    /// What the cones that are `touching` a leaf say about its points. Those within `clear` cubes of the surface, to
    /// within rounding, are near.
    pub(super) fn nearest_of_sites(&self, leaf: usize, touching: &[u32], clear: f32) -> Sites {
        let middle = [0, 1, 2].map(|axis| Lanes::splat(LEAF_OFFSETS[leaf / LANES][axis][leaf % LANES]));
        let mut nearest = [Lanes::splat(f32::INFINITY); POINTS];
        let mut others = nearest;
        // From the centre of the ball that decides, which is what rounding goes with.
        let mut furthest = [Lanes::ZERO; POINTS];
        // As numbers, which are exact for all that there is memory for.
        let mut deciding = [Lanes::ZERO; POINTS];
        for (place, _) in touching.iter().enumerate().filter(|(_, leaves)| **leaves >> leaf & 1 == 1) {
            let mut cone = One::of(self.groups, place);
            cone.middle = plus(cone.middle, middle);
            for i in 0..POINTS {
                let (distance, far) = cone.at(&OFFSETS[i]);
                furthest[i] = far.fast_max(furthest[i]);
                others[i] = distance.fast_max(nearest[i]).fast_min(others[i]);
                deciding[i] = distance.simd_lt(nearest[i]).bitselect(Lanes::splat(place as f32), deciding[i]);
                nearest[i] = distance.fast_min(nearest[i]);
            }
        }
        let mut sites = Sites { cones: [0; SITES], others: [0.0; SITES], inside: 0, near: 0 };
        for i in 0..POINTS {
            let rounding = (furthest[i] + Lanes::splat(4.0)) * Lanes::splat(8.0 * ROUNDING);
            let near = nearest[i].abs().simd_lt(rounding + Lanes::splat(clear));
            sites.inside |= nearest[i].simd_lt(Lanes::ZERO).to_bitmask() << (LANES * i);
            sites.near |= near.to_bitmask() << (LANES * i);
            sites.others.as_chunks_mut().0[i] = (others[i] - rounding).to_array();
            for (cone, place) in sites.cones[LANES * i..].iter_mut().zip(deciding[i].to_array()) {
                *cone = self.cones[place as usize];
            }
        }
        sites
    }

    /// Where `p` is from the middle, in cubes of `cube` mm.
    fn offset(&self, p: &Point3<f64>, cube: f64) -> Vectors {
        let scale = 1.0 / cube;
        let along = |axis: usize| Lanes::splat(((p[axis] - self.middle[axis]) * scale) as f32);
        [along(0), along(1), along(2)]
    }

    /// Signed distance of `p` to the union, in cubes of `cube` mm, and the cone that decides it, both to within rounding.
    pub(super) fn nearest(&self, p: &Point3<f64>, cube: f64) -> (f32, u32) {
        let offset = self.offset(p, cube);
        let mut least = Lanes::splat(f32::INFINITY);
        let mut deciding = Lanes::ZERO;
        for (place, group) in self.groups.iter().enumerate() {
            let (square, radius) = group.balls(offset);
            let distance = square.sqrt() - radius;
            deciding = distance.simd_lt(least).bitselect(Lanes::splat(place as f32), deciding);
            least = distance.fast_min(least);
        }
        let (least, deciding) = (least.to_array(), deciding.to_array());
        let lane = (1..LANES).fold(0, |best, i| if least[i] < least[best] { i } else { best });
        (least[lane], self.cones[deciding[lane] as usize * LANES + lane])
    }
}
