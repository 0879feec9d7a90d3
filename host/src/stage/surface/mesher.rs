//! The steps of [`surface`](super::surface) in their order, and the memory that they share.

use std::{
    collections::HashMap,
    hash::{BuildHasherDefault, Hasher},
    ops::Range,
    sync::atomic::AtomicUsize,
};

use nalgebra::Point3;
use rayon::prelude::*;

use super::{
    CUBE, RoundCone, SurfaceError,
    block::{Grove, MAX_BLOCKS},
    crossing::{PutVertices, Sorted},
    distance::Distance,
    lattice::{Lattice, SIDE},
    near::Points,
    patch::{Blocks, Count, Cut, Place, PutFaces, Workshop},
    prune::{Answer, prune},
    region::{Level, Octant, Region, Solid},
};
use crate::{mesh::Mesh, wide::widest};

/// The solid is divided until there are so many regions, which are then worked on side by side.
const GROVES: usize = 32;

/// What [`surface`](super::surface) needs on the way, kept from one solid to the next: once it has grown to
/// their size, nothing more is allocated.
#[derive(Debug, Default)]
pub struct Mesher {
    distances: Vec<Distance>,
    /// The regions of the groves, and room for their children.
    seeds: [Seeds; 2],
    level: Level,
    answers: Vec<Answer>,
    groves: Vec<Grove>,
    /// Of the blocks of each grove.
    cuts: Vec<Vec<Cut>>,
    places: Places,
}

/// The place of each block, by [`name`].
type Places = HashMap<u64, Place, BuildHasherDefault<Mixer>>;

/// Regions with their cones.
#[derive(Debug, Default)]
struct Seeds {
    regions: Vec<(Region, Range<usize>)>,
    cones: Vec<u32>,
}

impl Mesher {
    /// As [`surface`](super::surface), into `mesh`, which is left empty where there is none.
    ///
    /// # Errors
    ///
    /// See [`SurfaceError`].
    pub fn surface(&mut self, cones: &[RoundCone], cell: f64, mesh: &mut Mesh) -> Result<(), SurfaceError> {
        let made = self.fill(cones, cell, mesh);
        if made.is_err() {
            mesh.vertices.clear();
            mesh.faces.clear();
        }
        made
    }

    /// Makes the surface; what `mesh` has held is overwritten.
    fn fill(&mut self, cones: &[RoundCone], cell: f64, mesh: &mut Mesh) -> Result<(), SurfaceError> {
        super::check(cones, cell)?;
        let lattice = Lattice::around(cones, cell * CUBE);
        let too_fine = SurfaceError::TooFine { cell, size: lattice.size };
        let along = lattice.blocks_along().ok_or(too_fine)?;
        self.distances.clear();
        self.distances.extend(cones.iter().map(Distance::to));
        let solid = Solid { lattice: &lattice, distances: &self.distances };

        let [seeds, next] = &mut self.seeds;
        seeds.begin(Region { corner: [0; 3], cubes: along * SIDE }, cones.len());
        while seeds.regions.len() < GROVES && seeds.regions.first().is_some_and(|seed| seed.0.cubes > SIDE) {
            seeds.divide(&solid, next, &mut self.level, &mut self.answers);
            std::mem::swap(seeds, next);
        }

        let count = seeds.regions.len();
        if self.groves.len() < count {
            self.groves.resize_with(count, Grove::default);
            self.cuts.resize_with(count, Vec::new);
        }
        let (groves, cuts) = (&mut self.groves[..count], &mut self.cuts[..count]);
        let found = AtomicUsize::new(0);
        groves.par_iter_mut().zip(&seeds.regions).for_each(|(grove, (region, own))| {
            grove.grow(&solid, *region, &seeds.cones[own.clone()], &found);
        });
        if found.into_inner() > MAX_BLOCKS {
            return Err(too_fine);
        }

        self.places.clear();
        for (number, grove) in groves.iter().enumerate() {
            let places = grove.blocks.iter().enumerate();
            self.places
                .extend(places.map(|(place, block)| (name(block.corner), (number as u32, place as u32))));
        }
        let wood = Wood { groves, places: &self.places };
        cuts.par_iter_mut().enumerate().for_each(|(grove, cuts)| {
            cuts.clear();
            cuts.extend((0..wood.groves[grove].blocks.len()).map(|place| {
                let ahead = wood.ahead(grove, place);
                widest(Count { blocks: &wood.blocks(&ahead), ahead })
            }));
        });
        let faces = number(cuts);
        if faces == 0 {
            return Err(SurfaceError::TooCoarse { cell });
        }
        wood.put(&solid, cuts, mesh);
        Ok(())
    }
}

impl Seeds {
    /// One region with all cones.
    fn begin(&mut self, region: Region, cones: usize) {
        self.regions.clear();
        self.cones.clear();
        self.regions.push((region, 0..cones));
        self.cones.extend(0..cones as u32);
    }

    /// Puts the children of all regions near which the surface can pass into `next`.
    fn divide(&self, solid: &Solid, next: &mut Self, level: &mut Level, answers: &mut Vec<Answer>) {
        next.regions.clear();
        next.cones.clear();
        for (region, own) in &self.regions {
            level.cones.clear();
            level.cones.extend(&self.cones[own.clone()]);
            let bundle = level.bundle(solid, *region);
            for octant in Octant::all(*region) {
                let start = next.cones.len();
                if prune(&bundle, octant.around, answers, &mut next.cones) {
                    next.regions.push((octant.region, start..next.cones.len()));
                }
            }
        }
    }
}

/// Numbers the vertices of all blocks, and returns how many faces there are.
fn number(cuts: &mut [Vec<Cut>]) -> u32 {
    let (mut vertices, mut faces) = (0, 0);
    for cut in cuts.iter_mut().flatten() {
        cut.number_from(vertices);
        vertices += cut.vertices;
        faces += cut.faces;
    }
    faces
}

/// All blocks.
#[derive(Clone, Copy)]
struct Wood<'a> {
    groves: &'a [Grove],
    places: &'a Places,
}

impl<'a> Wood<'a> {
    /// A block and those ahead of it, see [`Blocks`].
    fn ahead(&self, grove: usize, place: usize) -> [Option<Place>; 8] {
        let corner = self.groves[grove].blocks[place].corner;
        std::array::from_fn(|ahead| {
            if ahead == 0 {
                return Some((grove as u32, place as u32));
            }
            let step = |axis: usize| (ahead >> (2 - axis) & 1) as i32 * 2 * SIDE;
            self.places.get(&name([0, 1, 2].map(|axis| corner[axis] + step(axis)))).copied()
        })
    }

    fn blocks(&self, places: &[Option<Place>; 8]) -> Blocks<'a> {
        places.map(|place| {
            let grove = &self.groves[place?.0 as usize];
            Some((grove, &grove.blocks[place?.1 as usize]))
        })
    }

    /// Fills `mesh` with what has been cut.
    fn put(&self, solid: &Solid, cuts: &[Vec<Cut>], mesh: &mut Mesh) {
        let count = |of: fn(&Cut) -> u32| cuts.iter().flatten().map(|cut| of(cut) as usize).sum();
        mesh.vertices.resize(count(|cut| cut.vertices), Point3::origin());
        spread(cuts, &mut mesh.vertices, |cut| cut.vertices, &|cuts, mut vertices| {
            let (mut points, mut sorted) = (Points::default(), Sorted::default());
            for cut in cuts.iter().flatten().filter(|cut| cut.vertices > 0) {
                let (own, others) = vertices.split_at_mut(cut.vertices as usize);
                let blocks = self.blocks(&cut.ahead);
                points.fill(&blocks);
                let (blocks, points, sorted) = (&blocks, &points, &mut sorted);
                widest(PutVertices { cut, solid, blocks, points, sorted, vertices: own });
                vertices = others;
            }
        });
        mesh.faces.resize(count(|cut| cut.faces), [0; 3]);
        let (all, vertices) = (cuts, &mesh.vertices);
        spread(cuts, &mut mesh.faces, |cut| cut.faces, &|cuts, mut faces| {
            let mut room = Workshop::default();
            for cut in cuts.iter().flatten().filter(|cut| cut.faces > 0) {
                let (own, others) = faces.split_at_mut(cut.faces as usize);
                let seen = cut.ahead.map(|place| Some(&all[place?.0 as usize][place?.1 as usize]));
                widest(PutFaces { cuts: &seen, vertices, room: &mut room, faces: own });
                faces = others;
            }
        });
    }
}

/// Hands to `put`, side by side, some groves at a time with their share of `out`: few calls, but some for each thread,
/// as groves are not equally full.
fn spread<T: Send>(
    cuts: &[Vec<Cut>],
    out: &mut [T],
    count: fn(&Cut) -> u32,
    put: &(impl Fn(&[Vec<Cut>], &mut [T]) + Sync),
) {
    if cuts.len() <= (GROVES / (4 * rayon::current_num_threads())).max(1) {
        return put(cuts, out);
    }
    let (left, right) = cuts.split_at(cuts.len() / 2);
    let (here, there) = out.split_at_mut(left.iter().flatten().map(|cut| count(cut) as usize).sum());
    rayon::join(|| spread(left, here, count, put), || spread(right, there, count, put));
}

/// The corner of a block as one number: on each axis it is far below 2^21.
fn name(corner: [i32; 3]) -> u64 {
    corner.into_iter().fold(0, |name, x| name << 21 | u64::from(x.cast_unsigned()))
}

/// Mixes the bits of a block's name: std's hasher is proof against an enemy, which costs.
#[derive(Debug, Default)]
struct Mixer(u64);

impl Hasher for Mixer {
    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|&byte| self.write_u64(byte.into()));
    }

    fn write_u64(&mut self, x: u64) {
        self.0 = (self.0 ^ x).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    }

    fn finish(&self) -> u64 {
        self.0.rotate_left(26)
    }
}
