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

use super::{
    bundle::{Apart, Bundle, Sites, Touching},
    cone::Group,
    lattice::{MAX_SHIFT, SIDE},
    prune::{Answer, prune},
    region::{Level, Octant, Region, Solid},
};
use crate::lanes::LANES;

/// A block takes about 2 kB with its cones, and about 6 kB of mesh, so that this many take 500 MB.
pub(super) const MAX_BLOCKS: usize = 1 << 16;

/// Points are moved to at least this distance off the surface, in cubes. Twice that is the most that one
/// is moved: from just outside to inside.
pub(super) const CLEAR: f32 = MAX_SHIFT as f32 / 2.0;

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
    /// Where its cones stand in [`Grove::groups`].
    first_group: u32,
    /// Where in [`Grove::places`] those of each of its leaves begin, and the last ones end.
    first_place: [u32; 9],
}

/// The blocks under one region, with what belongs to them.
#[derive(Debug, Default)]
pub(super) struct Grove {
    pub(super) blocks: Vec<Block>,
    /// Where moved points stand, from the middle of their block, in cubes.
    moved: Vec<[f32; 3]>,
    /// The cones of each block, and which of them touch each of its leaves.
    groups: Vec<Group>,
    places: Vec<u32>,
    /// Of the regions on the way down, by level.
    levels: Vec<Level>,
    answers: Vec<Answer>,
    /// Of the block that is added: what its cones are asked, and those that may decide at points of a leaf.
    apart: Vec<Apart>,
    touching: Vec<Touching>,
    deciding: Vec<u32>,
    sites: Sites,
    /// Of the block that is added: where its points stand, if moved, by kind and leaf.
    shifted: [[[[f32; LANES]; 3]; 8]; 2],
}

impl Grove {
    /// Finds the blocks of `region`, of which `cones` may be the nearest ones. `found` counts the blocks of
    /// all groves, which stop when there are too many.
    pub(super) fn grow(&mut self, solid: &Solid, region: Region, cones: &[u32], found: &AtomicUsize) {
        self.blocks.clear();
        self.moved.clear();
        self.groups.clear();
        self.places.clear();
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
                self.plant(region, &bundle);
            }
            return;
        }
        for octant in Octant::all(region) {
            let cones = &mut below[0].cones;
            cones.clear();
            if prune(&bundle, octant.around, &mut self.answers, cones) {
                self.descend(solid, octant.region, below, found);
            }
        }
    }

    /// Adds the block that is `region`.
    fn plant(&mut self, region: Region, bundle: &Bundle) {
        let mut block = Block {
            corner: region.corner,
            inside: [0; 2],
            moved: [0; 2],
            first_moved: self.moved.len() as u32,
            first_group: self.groups.len() as u32,
            first_place: [self.places.len() as u32; 9],
        };
        self.groups.extend(bundle.groups);
        let leaves = bundle.leaves(&mut self.apart, &mut self.touching);
        let [mut end, most] = [self.places.len(), self.touching.len()];
        self.places.resize(end + 8 * most, 0);
        self.deciding.resize(most, 0);
        for octant in 0..8 {
            if leaves.whole >> octant & 1 == 1 {
                let inside = u64::from(leaves.inside >> octant & 1) * 0xff;
                block.inside.iter_mut().for_each(|bits| *bits |= inside << (8 * octant));
                block.first_place[octant + 1] = end as u32;
                continue;
            }
            let places = &mut self.places[end..];
            end += list(&self.touching, |touching| touching.leaves >> octant, places);
            block.first_place[octant + 1] = end as u32;
            let count = list(&self.touching, |touching| touching.points >> octant, &mut self.deciding);
            let sites = &mut self.sites;
            bundle.ask_sites(octant, &leaves, &self.deciding[..count], sites);
            for kind in 0..2 {
                let byte = |bits: u32| u64::from(bits >> (LANES * kind) & 0xff) << (8 * octant);
                block.inside[kind] |= byte(sites.inside);
                block.moved[kind] |= byte(sites.moved);
                self.shifted[kind][octant] = sites.places[kind];
            }
        }
        self.places.truncate(end);
        for (set, places) in block.moved.iter().zip(&self.shifted) {
            self.moved.extend(bits(*set).map(|bit| places[bit / LANES].map(|along| along[bit % LANES])));
        }
        self.blocks.push(block);
    }

    /// Where a point of `block` that has been moved stands, from the block's middle, in cubes.
    pub(super) fn moved(&self, block: &Block, kind: usize, bit: usize) -> [f32; 3] {
        let before = block.moved[kind] & ((1 << bit) - 1);
        let others = if kind == 1 { block.moved[0].count_ones() } else { 0 };
        self.moved[(block.first_moved + others + before.count_ones()) as usize]
    }

    /// The cones of `block`, and the places among them of those that touch one of its leaves.
    pub(super) fn touching(&self, block: &Block, leaf: usize) -> (&[Group], &[u32]) {
        let [first, end] = [block.first_place[leaf] as usize, block.first_place[leaf + 1] as usize];
        (&self.groups[block.first_group as usize..], &self.places[first..end])
    }
}

/// Lists the places of the cones of which the last bit is set, and returns how many these are.
fn list(touching: &[Touching], bit: impl Fn(&Touching) -> u8, places: &mut [u32]) -> usize {
    // Without a branch, as nobody could foretell it.
    let mut end = 0;
    for (place, touching) in touching.iter().enumerate() {
        places[end] = place as u32;
        end += usize::from(bit(touching) & 1);
    }
    end
}

/// The places of the ones of a word.
#[inline(always)]
pub(super) fn bits(mut word: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = word.trailing_zeros() as usize;
        (word != 0).then(|| {
            word &= word - 1;
            bit
        })
    })
}

/// As [`bits`], but four at a time: how many there are can hardly be foretold, how many fours mostly. After the last one
/// there are 64s.
#[inline(always)]
pub(super) fn fours(mut word: u64) -> impl Iterator<Item = [usize; 4]> {
    std::iter::from_fn(move || {
        (word != 0).then(|| {
            [(); 4].map(|()| {
                let bit = word.trailing_zeros() as usize;
                word &= word.wrapping_sub(1);
                bit
            })
        })
    })
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::lanes::Floats;
    use crate::stage::surface::{
        RoundCone,
        cone::Cone,
        distance::Distance,
        lattice::{Lattice, tests::point_of},
        region::reach,
        vectors::all,
    };
    use nalgebra::{Point3, Vector3};
    use wide::f32x8;

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
    fn fours_are_the_ones_and_what_is_none() {
        for word in [0, 1, 0b1011, 0b1111 << 60, 0x8000_1001_0010_0001, 0x1_F000, u64::MAX] {
            let fours: Vec<usize> = fours(word).flatten().collect();
            let ones: Vec<usize> = bits(word).collect();
            assert_eq!(fours.len(), ones.len().next_multiple_of(4));
            assert_eq!(fours[..ones.len()], ones);
            assert!(fours[ones.len()..].iter().all(|&bit| bit == 64));
        }
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
            grown(&limb(count), cube, |_, grove| asked.set(grove.places.len()));
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
                    let unmoved = solid.lattice.position(point_of(block.corner, bit, kind));
                    let is_moved = block.moved[kind] >> bit & 1 == 1;
                    let p = if is_moved {
                        let middle = solid.middle(Region { corner: block.corner, cubes: SIDE });
                        middle
                            + Vector3::from(grove.moved(block, kind, bit)).map(f64::from) * solid.lattice.cube
                    } else {
                        unmoved
                    };
                    let far = |cone: &Distance| cone.at(&p);
                    let least = solid.distances.iter().map(far).fold(f64::INFINITY, f64::min);
                    assert_eq!(block.inside[kind] >> bit & 1 == 1, least < 0.0, "{p}");
                    let way = (p - unmoved).norm();
                    assert!(way <= MAX_SHIFT * solid.lattice.cube * (1.0 + 1e-5), "{way}");
                    if way > 0.0 {
                        assert!(least.abs() > 0.99 * f64::from(CLEAR) * solid.lattice.cube);
                        moved += 1;
                    }
                }
            }
            assert!(moved > 100, "{moved}");
        });
    }

    #[test]
    fn each_leaf_lists_the_cones_of_the_surface_in_it() {
        /// So near to the surface are the places that are looked at, cubes.
        const NEAR: f64 = 0.02;
        grown(&cones(), 0.7, |solid, grove| {
            let cube = solid.lattice.cube;
            let mut seen = 0;
            for (block, leaf) in
                grove.blocks.iter().step_by(5).flat_map(|block| (0..8).map(move |leaf| (block, leaf)))
            {
                let middle = solid.middle(Region { corner: block.corner, cubes: SIDE });
                let of_leaf = solid.middle(Region { corner: block.corner, cubes: SIDE }.octant(leaf));
                let (groups, places) = grove.touching(block, leaf);
                let along = |i: i32| f64::from(i - 5) * 0.4;
                for way in (0..11 * 11 * 11)
                    .map(|i| Vector3::new(along(i / 121), along(i / 11 % 11), along(i % 11)))
                    .filter(|way| way.norm() + NEAR < f64::from(reach(2)))
                {
                    let p = of_leaf + way * cube;
                    let nearest =
                        |p| solid.distances.iter().map(|cone| cone.at(p)).fold(f64::INFINITY, f64::min);
                    let least = nearest(&p) / cube;
                    if least.abs() > NEAR {
                        continue;
                    }
                    let offset = ((p - middle) / cube).map(|x| x as f32);
                    let listed = places.iter().map(|&place| {
                        Cone::<f32x8>::of(groups, place as usize).at(all(offset.into())).0.store()[0]
                    });
                    let listed = f64::from(listed.fold(f32::INFINITY, f32::min));
                    assert!((listed - least).abs() < 1e-4, "{p} {listed} {least}");
                    seen += 1;
                }
            }
            assert!(seen > 1000, "{seen}");
        });
    }
}
