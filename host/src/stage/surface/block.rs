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
    bundle::{Bundle, Group, SITES},
    lanes::LANES,
    lattice::{MAX_SHIFT, SIDE, point_of},
    prune::{Answer, prune},
    region::{Level, Octant, Region, Solid},
};

/// A block takes about 4 kB with its cones, and about 6 kB of mesh, so that this many take 700 MB.
pub(super) const MAX_BLOCKS: usize = 1 << 16;

/// Points are moved to at least this distance off the surface, in cubes. Twice that is the most that one
/// is moved: from just outside to inside.
pub(super) const CLEAR: f64 = MAX_SHIFT / 2.0;

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
    pub(super) moved: [u64; 2],
    /// Where the moved ones stand in [`Grove::moved`]; corners first.
    first_moved: u32,
    /// Its cones in [`Grove::cones`], from the first on, and in [`Grove::groups`].
    first_cone: u32,
    count: u32,
    first_group: u32,
    /// The cone that decides the distance of each point, corners first.
    pub(super) cones: [u32; 128],
    /// How far all others of its leaf are from each point at least, cubes; less than nothing if not known.
    pub(super) others: [f32; 128],
}

/// The blocks under one region, with what belongs to them.
#[derive(Debug, Default)]
pub(super) struct Grove {
    pub(super) blocks: Vec<Block>,
    moved: Vec<Point3<f64>>,
    /// Of the block that is added: where its moved points stand, by kind and cube, and the leaves that each of its cones
    /// touches.
    shifted: Vec<[Point3<f64>; 64]>,
    touching: Vec<u32>,
    cones: Vec<u32>,
    groups: Vec<Group>,
    /// Of the regions on the way down, by level.
    levels: Vec<Level>,
    answers: Vec<Answer>,
}

/// The bit in a block of a cube of one of its leaves.
fn bit_of(leaf: usize, cube: usize) -> usize {
    let spread = |octant: usize| (octant >> 2) << 4 | (octant >> 1 & 1) << 2 | octant & 1;
    spread(leaf) << 1 | spread(cube)
}

/// The bits in a block of those cubes of one of its leaves.
fn bits_of(leaf: usize, cubes: u32) -> u64 {
    let pairs = u64::from(cubes);
    (pairs & 0x3 | (pairs & 0xc) << 2 | (pairs & 0x30) << 12 | (pairs & 0xc0) << 14) << bit_of(leaf, 0)
}

/// Where in a block's lists a point of a leaf is.
fn place_of(leaf: usize, site: usize) -> usize {
    64 * (site >> 3) + bit_of(leaf, site & 7)
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
            let cones = &mut below[0].cones;
            cones.clear();
            prune(&bundle, octant.around, &mut self.answers, cones);
            if !cones.is_empty() {
                self.descend(solid, octant.region, below, found);
            }
        }
    }

    /// Adds the block that is `region`.
    fn plant(&mut self, solid: &Solid, region: Region, bundle: &Bundle) {
        let mut block = Block {
            corner: region.corner,
            inside: [0; 2],
            moved: [0; 2],
            first_moved: self.moved.len() as u32,
            first_cone: self.cones.len() as u32,
            count: bundle.cones.len() as u32,
            first_group: self.groups.len() as u32,
            cones: [0; 128],
            others: [-1.0; 128],
        };
        self.cones.extend(bundle.cones);
        self.groups.extend(bundle.groups);
        self.shifted.resize(2, [Point3::origin(); 64]);
        let leaves = bundle.leaves(CLEAR as f32, &mut self.touching);
        for octant in 0..8 {
            if leaves.whole >> octant & 1 == 1 {
                if leaves.inside >> octant & 1 == 1 {
                    block.inside.iter_mut().for_each(|inside| *inside |= bits_of(octant, 0xff));
                    let nearest = bundle.cones[leaves.nearest[octant]];
                    (0..SITES).for_each(|i| block.cones[place_of(octant, i)] = nearest);
                }
                continue;
            }
            let sites = bundle.nearest_of_sites(octant, &self.touching, CLEAR as f32);
            for i in 0..SITES {
                block.cones[place_of(octant, i)] = sites.cones[i];
                block.others[place_of(octant, i)] = sites.others[i];
            }
            let mut inside = sites.inside;
            for i in bits(sites.near.into()) {
                let (kind, bit, place) = (i >> 3, bit_of(octant, i & 7), place_of(octant, i));
                let unmoved = solid.lattice.position(point_of(region.corner, bit, kind));
                let known = (sites.cones[i], sites.others[i]);
                let Some(site) = bundle.site(unmoved, known, solid) else { continue };
                inside = inside & !(1 << i) | u32::from(site.inside) << i;
                let same = site.cone == sites.cones[i];
                block.others[place] = if same { sites.others[i] - MAX_SHIFT as f32 } else { -1.0 };
                block.cones[place] = site.cone;
                block.moved[kind] |= 1 << bit;
                self.shifted[kind][bit] = site.position;
            }
            block.inside[0] |= bits_of(octant, inside & 0xff);
            block.inside[1] |= bits_of(octant, inside >> 8);
        }
        for (set, places) in block.moved.iter().zip(&self.shifted) {
            self.moved.extend(bits(*set).map(|bit| places[bit]));
        }
        self.blocks.push(block);
    }

    /// Where a point of `block` that has been moved stands, mm.
    pub(super) fn moved(&self, block: &Block, kind: usize, bit: usize) -> Point3<f64> {
        let before = block.moved[kind] & ((1 << bit) - 1);
        let others = if kind == 1 { block.moved[0].count_ones() } else { 0 };
        self.moved[(block.first_moved + others + before.count_ones()) as usize]
    }

    /// As [`Bundle::nearest`], of a place in `block`.
    pub(super) fn nearest(&self, solid: &Solid, block: &Block, p: &Point3<f64>) -> (f32, u32) {
        let cones = &self.cones[block.first_cone as usize..][..block.count as usize];
        let groups = &self.groups[block.first_group as usize..][..cones.len().div_ceil(LANES)];
        let middle = solid.middle(Region { corner: block.corner, cubes: SIDE });
        Bundle { cones, groups, middle }.nearest(p, solid.lattice.cube)
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
    inside: bool,
    cone: u32,
}

impl Bundle<'_> {
    /// Where a point near the surface, of which `cone` decides, is clear of the surface; nothing if it stays where it is.
    /// All other cones are at least `others` cubes off.
    fn site(&self, position: Point3<f64>, (cone, others): (u32, f32), solid: &Solid) -> Option<Site> {
        let (cube, deciding) = (solid.lattice.cube, &solid.distances[cone as usize]);
        let distance = deciding.at(&position) / cube;
        if distance.abs() >= CLEAR {
            return None;
        }
        let outward = deciding.outward(&position, 0.0)?;
        // Away from the surface; but from a crease outward there is no getting away, only inward.
        [CLEAR.copysign(distance), -CLEAR].into_iter().find_map(|target| {
            let position = position + outward * ((target - distance) * cube);
            let own = deciding.at(&position) / cube;
            let (distance, cone) = if own < f64::from(others) - MAX_SHIFT {
                (own, cone)
            } else {
                let (distance, cone) = self.nearest(&position, cube);
                (distance.into(), cone)
            };
            (distance.abs() > 0.99 * CLEAR).then_some(Site { position, inside: distance < 0.0, cone })
        })
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::stage::surface::{RoundCone, distance::Distance, lattice::Lattice};
    use nalgebra::Vector3;

    /// Thirty cones in 20 mm, thick and thin, some along the axes.
    pub(in crate::stage::surface) fn cones() -> Vec<RoundCone> {
        let at = |i: i32| Point3::new(f64::from(i * 7 % 20), f64::from(i * 11 % 19), f64::from(i * 5 % 17));
        let cone = |i: i32| {
            let end = if i % 3 == 0 { at(i) + Vector3::y() * 4.0 } else { at(i + 1) };
            RoundCone { centres: [at(i), end], radii: [0.4 + f64::from(i % 4), 1.5] }
        };
        (0..30).map(cone).collect()
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
        // Each of a block's cones is asked about each of its leaves.
        let asked = |count, cube| {
            let asked = std::cell::Cell::new(0);
            grown(&limb(count), cube, |_, grove| asked.set(grove.cones.len()));
            f64::from(asked.get() as u32)
        };
        let (coarse, fine) = (asked(50, 3.0), asked(50, 1.5));
        assert!(fine / coarse < 4.5, "{coarse} {fine}");
        let sparse_per_leaf = asked(200, 1.5) / fine;
        assert!(sparse_per_leaf < 2.5, "{sparse_per_leaf}");
    }

    /// Places all over the leaf in which a cube is.
    fn places_in_leaf(solid: &Solid, block: &Block, bit: usize) -> impl Iterator<Item = Point3<f64>> {
        let octant = (bit >> 5) << 2 | (bit >> 3 & 1) << 1 | bit >> 1 & 1;
        let middle = solid.middle(Region { corner: block.corner, cubes: SIDE }.octant(octant));
        let step = solid.lattice.cube / 2.0;
        let along = move |i: i32| f64::from(i - 2) * step;
        (0..125).map(move |i| middle + Vector3::new(along(i / 25), along(i / 5 % 5), along(i % 5)))
    }

    #[test]
    fn points_are_as_the_nearest_of_all_cones_says_and_moved_ones_clear() {
        grown(&cones(), 0.7, |solid, grove| {
            let mut moved = 0;
            for block in &grove.blocks {
                for (kind, bit) in (0..2).flat_map(|kind| (0..64).map(move |bit| (kind, bit))) {
                    let unmoved = solid.lattice.position(point_of(block.corner, bit, kind));
                    let is_moved = block.moved[kind] >> bit & 1 == 1;
                    let p = if is_moved { grove.moved(block, kind, bit) } else { unmoved };
                    let far = |cone: &Distance| cone.at(&p);
                    let least = solid.distances.iter().map(far).fold(f64::INFINITY, f64::min);
                    assert_eq!(block.inside[kind] >> bit & 1 == 1, least < 0.0, "{p}");
                    let (nearest, others) = (block.cones[64 * kind + bit], block.others[64 * kind + bit]);
                    let own = far(&solid.distances[nearest as usize]);
                    assert!(least > 0.0 || own < 0.0, "{p} {own} {least}");
                    // What is nearer than others are known to be decides nowhere in the leaf.
                    let least_of = |cones: &[(usize, &Distance)], q: &Point3<f64>| {
                        cones.iter().map(|(_, cone)| cone.at(q)).fold(f64::INFINITY, f64::min)
                    };
                    let is_nearer = |&(i, cone): &(usize, &Distance)| {
                        i != nearest as usize && far(cone) < f64::from(others) * solid.lattice.cube
                    };
                    let (nearer, listed): (Vec<_>, Vec<_>) =
                        solid.distances.iter().enumerate().partition(is_nearer);
                    if others > 0.0 && !nearer.is_empty() {
                        for q in places_in_leaf(solid, block, bit) {
                            let [nearer, listed] = [&nearer, &listed].map(|cones| least_of(cones, &q));
                            assert!(nearer >= listed.min(0.0) - 1e-9, "{p} {q}: {nearer} {listed}");
                        }
                    }
                    let way = (p - unmoved).norm();
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
