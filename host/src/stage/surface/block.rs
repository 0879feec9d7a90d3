//! The blocks of the lattice near the surface: which of their points are inside, and where these stand.
//!
//! A signed distance changes by at most the way walked. So when its size in the middle of a region exceeds
//! the region's reach there is no surface in it. From one cube around the solid this rule is applied to its
//! eight children, and so on down to leaves of two cubes a side, each with the cones that can be the
//! nearest in it (`prune.rs`): the cost follows the surface, not the volume.
//!
//! Points that are too near the surface are moved off it, by less than would turn a tetrahedron inside out,
//! so that no cut passes close to a corner and no face degenerates; isosurface stuffing (Labelle and
//! Shewchuk 2007) moves them onto it instead, where a sign is lost.

use std::sync::atomic::{AtomicUsize, Ordering};

use nalgebra::Point3;

use super::{
    bundle::{Bundle, Group, ROUNDING, SITES, prepare},
    lanes::LANES,
    lattice::{LOWERED, Lattice, MAX_SHIFT, SIDE, point_of},
    prune::{Answer, prune},
    region::{Level, Octant, Region, Solid},
};

/// A block takes about 8 kB with its cones, and about 6 kB of mesh, so that this many take 1 GB.
pub(super) const MAX_BLOCKS: usize = 1 << 16;

/// Points are moved to at least this distance off the surface, in cubes. Twice that is the most that one
/// is moved: from just outside to inside.
const CLEAR: f64 = MAX_SHIFT / 2.0;

/// Cubes along the side of a leaf.
const LEAF: i32 = 2;

/// An edge that the surface cuts is up to a cube and two shifts long: so far off the surface its ends are.
pub(super) const EDGE: f32 = 1.5;

/// A block: [`SIDE`]^3 cubes of the lattice near the surface.
#[derive(Debug)]
pub(super) struct Block {
    /// Its lowest corner, in half cubes.
    pub(super) corner: [i32; 3],
    /// Corners of cubes, and middles, that are inside.
    pub(super) inside: [u64; 2],
    /// Those that have been moved.
    moved: [u64; 2],
    /// Where the moved ones stand in [`Grove::moved`]; corners first.
    first_moved: u32,
    leaves: [Leaf; 8],
    /// The cone that decides the distance of each point, corners first.
    cones: [u32; 128],
    /// How far all others of its leaf are from each point at least, cubes; less than nothing if not known.
    others: [f32; 128],
}

/// An eighth of a block.
#[derive(Clone, Copy, Debug)]
struct Leaf {
    /// Its cones in [`Grove::cones`]; none where the surface does not pass.
    first_cone: u32,
    cones: u32,
    /// In [`Grove::groups`].
    first_group: u32,
    /// The cone nearest to its middle.
    nearest: u32,
}

/// The blocks under one region, with what belongs to them.
#[derive(Debug, Default)]
pub(super) struct Grove {
    pub(super) blocks: Vec<Block>,
    moved: Vec<Point3<f64>>,
    /// Where the moved points of the block that is added stand, by kind and cube.
    shifted: Vec<[Point3<f64>; 64]>,
    cones: Vec<u32>,
    groups: Vec<Group>,
    /// Of the regions on the way down, by level.
    levels: Vec<Level>,
    answers: Vec<Answer>,
}

/// Offsets of the points of a leaf from its middle, in cubes: corners of cubes first.
const OFFSETS: [[[f32; LANES]; 3]; SITES / LANES] = {
    let mut offsets = [[[0.0; LANES]; 3]; SITES / LANES];
    let mut i = 0;
    while i < SITES {
        let lowest = if i < 8 { -0.75 } else { -0.25 };
        let mut axis = 0;
        while axis < 3 {
            offsets[i / LANES][axis][i % LANES] = lowest + (i >> (2 - axis) & 1) as f32;
            axis += 1;
        }
        i += 1;
    }
    offsets
};

/// The bit in a block of a cube of one of its leaves.
fn bit_of(leaf: usize, cube: usize) -> usize {
    let spread = |octant: usize| (octant >> 2) << 4 | (octant >> 1 & 1) << 2 | octant & 1;
    spread(leaf) << 1 | spread(cube)
}

impl Grove {
    /// Finds the blocks of `region`, of which `cones` may be the nearest ones. `found` counts the blocks of
    /// all groves, which stop when there are too many.
    pub(super) fn grow(&mut self, solid: &Solid, region: Region, cones: &[u32], found: &AtomicUsize) {
        self.blocks.clear();
        self.moved.clear();
        self.cones.clear();
        self.groups.clear();
        let mut levels = std::mem::take(&mut self.levels);
        let depth = (region.cubes / SIDE).trailing_zeros() as usize + 1;
        if levels.len() < depth {
            levels.resize_with(depth, Level::default);
        }
        levels[0].cones.clear();
        levels[0].cones.extend(cones);
        self.descend(solid, region, &mut levels, found);
        self.levels = levels;
    }

    fn descend(&mut self, solid: &Solid, region: Region, levels: &mut [Level], found: &AtomicUsize) {
        if found.load(Ordering::Relaxed) > MAX_BLOCKS {
            return;
        }
        let (level, below) = levels.split_first_mut().expect("a level for each division");
        let bundle = level.bundle(solid, region);
        if region.cubes == SIDE {
            if found.fetch_add(1, Ordering::Relaxed) < MAX_BLOCKS {
                self.plant(solid, region, &bundle);
            }
            return;
        }
        for octant in Octant::all(region) {
            below[0].cones.clear();
            prune(&bundle, octant.around, EDGE, &mut self.answers, &mut below[0].cones);
            if !below[0].cones.is_empty() {
                self.descend(solid, octant.region, below, found);
            }
        }
    }

    /// Adds the block that is `region`.
    fn plant(&mut self, solid: &Solid, region: Region, bundle: &Bundle) {
        let leaf = Leaf { first_cone: 0, cones: 0, first_group: 0, nearest: 0 };
        let mut block = Block {
            corner: region.corner,
            inside: [0; 2],
            moved: [0; 2],
            first_moved: self.moved.len() as u32,
            leaves: [leaf; 8],
            cones: [0; 128],
            others: [-1.0; 128],
        };
        self.shifted.resize(2, [Point3::origin(); 64]);
        for (octant, Octant { region, around }) in Octant::all(region).enumerate() {
            let first_cone = self.cones.len();
            let middle = prune(bundle, around, 0.0, &mut self.answers, &mut self.cones);
            let leaf = Leaf {
                first_cone: first_cone as u32,
                cones: (self.cones.len() - first_cone) as u32,
                first_group: self.groups.len() as u32,
                nearest: middle.nearest,
            };
            block.leaves[octant] = leaf;
            if leaf.cones == 0 {
                for i in 0..SITES {
                    let (kind, bit) = (i >> 3, bit_of(octant, i & 7));
                    block.inside[kind] |= u64::from(middle.distance < 0.0) << bit;
                    block.cones[64 * kind + bit] = middle.nearest;
                }
                continue;
            }
            let centre = solid.middle(region);
            let cones = &self.cones[first_cone..];
            prepare(cones, solid.distances, &centre, solid.lattice.cube, &mut self.groups);
            let bundle = Bundle { cones, groups: &self.groups[leaf.first_group as usize..], middle: centre };
            let (distances, places, others) = bundle.nearest_of_sites(&OFFSETS);
            for i in 0..SITES {
                let (kind, bit) = (i >> 3, bit_of(octant, i & 7));
                let cone = cones[places[i]];
                let blur = 4.0
                    * ROUNDING
                    * (distances[i].abs()
                        + 4.0
                        + (solid.distances[cone as usize].radius / solid.lattice.cube) as f32);
                if distances[i].abs() > CLEAR as f32 + blur {
                    block.inside[kind] |= u64::from(distances[i] < 0.0) << bit;
                    block.cones[64 * kind + bit] = cone;
                    block.others[64 * kind + bit] = others[i];
                    continue;
                }
                let unmoved = solid.lattice.position(point_of(region.corner, bit_of(0, i & 7), kind));
                let site = bundle.site(unmoved, solid);
                block.inside[kind] |= u64::from(site.distance < 0.0) << bit;
                block.cones[64 * kind + bit] = site.cone;
                if site.cone == cone {
                    block.others[64 * kind + bit] = others[i] - MAX_SHIFT as f32;
                }
                if site.position != unmoved {
                    block.moved[kind] |= 1 << bit;
                    self.shifted[kind][bit] = site.position;
                }
            }
        }
        for (set, places) in block.moved.iter().zip(&self.shifted) {
            self.moved.extend(bits(*set).map(|bit| places[bit]));
        }
        self.blocks.push(block);
    }

    /// Where a point of `block` stands, mm.
    pub(super) fn position(&self, solid: &Solid, block: &Block, kind: usize, bit: usize) -> Point3<f64> {
        if block.moved[kind] >> bit & 1 == 0 {
            return solid.lattice.position(point_of(block.corner, bit, kind));
        }
        let before = block.moved[kind] & ((1 << bit) - 1);
        let others = if kind == 1 { block.moved[0].count_ones() } else { 0 };
        self.moved[(block.first_moved + others + before.count_ones()) as usize]
    }

    /// Of the cones but one that contain `p`, which is in the given leaf of `block`, by more than `exact` mm,
    /// the one that it is deepest in.
    pub(super) fn deepest_but(
        &self,
        known: u32,
        solid: &Solid,
        (block, octant): (&Block, usize),
        (p, exact): (&Point3<f64>, f64),
    ) -> Option<u32> {
        let leaf = &block.leaves[octant];
        if leaf.cones == 0 {
            let inside = known != leaf.nearest && solid.distances[leaf.nearest as usize].at(p) < -exact;
            return inside.then_some(leaf.nearest);
        }
        let cones = &self.cones[leaf.first_cone as usize..][..leaf.cones as usize];
        let region = Region { corner: block.corner, cubes: SIDE }.octant(octant);
        let groups = &self.groups[leaf.first_group as usize..][..cones.len().div_ceil(LANES)];
        let bundle = Bundle { cones, groups, middle: solid.middle(region) };
        bundle.deepest_but(known, p, (solid.lattice.cube, exact), solid.distances)
    }
}

impl Block {
    /// The cones that decide the distances of the points of a kind, and how far all others of their leaves are at
    /// least, cubes; less than nothing where that is not known.
    pub(super) fn nearest(&self, kind: usize) -> (&[u32], &[f32]) {
        let points = 64 * kind..64 * kind + 64;
        (&self.cones[points.clone()], &self.others[points])
    }

    /// The points of a kind that have been moved.
    pub(super) fn moved(&self, kind: usize) -> u64 {
        self.moved[kind]
    }

    /// The leaf in which `p` is, of this block or of one ahead, as in [`leaf_at`](super::near::leaf_at).
    pub(super) fn leaf_of(&self, lattice: &Lattice, p: &Point3<f64>) -> usize {
        let from_corner = (p - lattice.position(self.corner)) * (1.0 / lattice.cube);
        let leaf = |axis: usize| ((from_corner[axis] + LOWERED).max(0.0) / f64::from(LEAF)) as usize;
        leaf(0).min(2) * 9 + leaf(1).min(2) * 3 + leaf(2).min(2)
    }
}

/// The places of the ones of a word.
pub(super) fn bits(mut word: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = word.trailing_zeros() as usize;
        (word != 0).then(|| {
            word &= word - 1;
            bit
        })
    })
}

/// A lattice point near the surface, moved off it.
struct Site {
    position: Point3<f64>,
    /// Signed distance there, mm.
    distance: f64,
    cone: u32,
}

impl Bundle<'_> {
    /// The lattice point at `position`, moved until it is [`CLEAR`] of the surface.
    fn site(&self, position: Point3<f64>, solid: &Solid) -> Site {
        let cube = solid.lattice.cube;
        let clear = CLEAR * cube;
        let (distance, cone) = self.nearest(&position, cube, solid.distances);
        let unmoved = Site { position, distance, cone };
        if distance.abs() >= clear {
            return unmoved;
        }
        let Some(outward) = solid.distances[cone as usize].outward(&position, 0.0) else {
            return unmoved;
        };
        // Away from the surface; but from a crease outward there is no getting away, only inward.
        for target in [clear.copysign(distance), -clear] {
            let position = position + outward * (target - distance);
            let (distance, cone) = self.nearest(&position, cube, solid.distances);
            if distance.abs() > 0.99 * clear {
                return Site { position, distance, cone };
            }
        }
        unmoved
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::stage::surface::{RoundCone, distance::Distance};

    /// Thirty cones in 20 mm, thick and thin, some along the axes.
    pub(in crate::stage::surface) fn cones() -> Vec<RoundCone> {
        let at = |i: i32| Point3::new(f64::from(i * 7 % 20), f64::from(i * 11 % 19), f64::from(i * 5 % 17));
        let cone = |i: i32| {
            let end = if i % 3 == 0 { at(i) + nalgebra::Vector3::y() * 4.0 } else { at(i + 1) };
            RoundCone { centres: [at(i), end], radii: [0.4 + f64::from(i % 4), 1.5] }
        };
        (0..30).map(cone).collect()
    }

    /// The leaf of a cube of a block.
    fn leaf_at(bit: usize) -> usize {
        (bit >> 5) << 2 | (bit >> 3 & 1) << 1 | bit >> 1 & 1
    }

    fn grown(cones: &[RoundCone], cube: f64, check: impl Fn(&Solid, &Grove)) {
        let distances: Vec<Distance> = cones.iter().map(Distance::to).collect();
        let lattice = Lattice::around(cones, cube);
        let solid = Solid { lattice: &lattice, distances: &distances };
        let all: Vec<u32> = (0..cones.len() as u32).collect();
        let region = Region { corner: [0; 3], cubes: lattice.blocks_along().unwrap() * SIDE };
        let mut grove = Grove::default();
        grove.grow(&solid, region, &all, &AtomicUsize::new(0));
        check(&solid, &grove);
    }

    #[test]
    fn questions_follow_the_surface_and_not_the_volume_nor_the_cones() {
        // A bent limb of 50 mm across as ever more cones.
        let limb = |count: i32| -> Vec<RoundCone> {
            let at = |i: i32| {
                let s = f64::from(i) / f64::from(count);
                Point3::new(200.0 * s, 30.0 * (4.0 * s).sin(), 0.0)
            };
            (0..count).map(|i| RoundCone { centres: [at(i), at(i + 1)], radii: [25.0; 2] }).collect()
        };
        // Each of a leaf's cones is asked about each of its points.
        let asked = |count, cube| {
            let asked = std::cell::Cell::new(0);
            grown(&limb(count), cube, |_, grove| asked.set(grove.cones.len() * SITES));
            f64::from(asked.get() as u32)
        };
        let (coarse, fine) = (asked(50, 3.0), asked(50, 1.5));
        assert!(fine / coarse < 4.5, "{coarse} {fine}");
        let sparse_per_leaf = asked(200, 1.5) / fine;
        assert!(sparse_per_leaf < 2.5, "{sparse_per_leaf}");
    }

    #[test]
    fn points_are_as_the_nearest_of_all_cones_says_and_moved_ones_clear() {
        grown(&cones(), 0.7, |solid, grove| {
            let mut moved = 0;
            for block in &grove.blocks {
                for (kind, bit) in (0..2).flat_map(|kind| (0..64).map(move |bit| (kind, bit))) {
                    let p = grove.position(solid, block, kind, bit);
                    let far = |cone: &Distance| cone.at(&p);
                    let least = solid.distances.iter().map(far).fold(f64::INFINITY, f64::min);
                    assert_eq!(block.inside[kind] >> bit & 1 == 1, least < 0.0, "{p}");
                    let own = far(&solid.distances[block.nearest(kind).0[bit] as usize]);
                    assert!(least > 0.0 || own < 0.0, "{p} {own} {least}");
                    let leaf = &block.leaves[leaf_at(bit)];
                    for &cone in &grove.cones[leaf.first_cone as usize..][..leaf.cones as usize] {
                        let other = far(&solid.distances[cone as usize]) / solid.lattice.cube;
                        let known = f64::from(block.others[64 * kind + bit]);
                        assert!(cone == block.nearest(kind).0[bit] || known <= other, "{p} {known} {other}");
                    }
                    let way = (p - solid.lattice.position(point_of(block.corner, bit, kind))).norm();
                    assert!(way <= MAX_SHIFT * solid.lattice.cube * (1.0 + 1e-9), "{way}");
                    if way > 0.0 {
                        assert!(least.abs() > 0.99 * CLEAR * solid.lattice.cube);
                        moved += 1;
                    }
                }
            }
            assert!(moved > 100, "{moved}");
        });
    }
}
