//! Round cones to a closed surface: the last step of growing the solid from its curve skeleton.
//!
//! In: round cones, mm. Out: the boundary of their union as a [`Mesh`], mm.
//! Promised for any input that is not refused: every edge has exactly two faces that run through it in
//! opposite directions, the faces around a vertex form one fan, faces look outward, no face has zero
//! area, and no two faces cross.
//!
//! The union is an implicit function, the least of the exact signed distances to the cones
//! (`distance.rs`, `nearby.rs`). It is looked at only where the surface can pass (`block.rs`), on a
//! body-centred cubic lattice whose tetrahedra are cut where the function changes its sign
//! (`tetrahedra.rs`), and the pieces are joined (`stitch.rs`). Tetrahedra, because a plane cuts one in a
//! triangle or a quadrilateral and nothing else: there is no ambiguous case, so the promise holds by
//! construction instead of by repair (`docs/decisions/0003-isosurface.md`).
//!
//! Cost: proportional to surface / cell². The result has the same bits for any number of threads.
//! Not promised: features thinner than the cell may be missing, and concave creases are rounded by up to
//! a cell.

mod block;
mod bundle;
mod distance;
mod lanes;
mod lattice;
mod patch;
mod prune;

use std::{
    collections::HashMap,
    hash::{BuildHasherDefault, Hasher},
    ops::Range,
    sync::atomic::AtomicUsize,
};

use nalgebra::Point3;
use rayon::prelude::*;
use thiserror::Error;

use crate::mesh::Mesh;
use block::{Grove, Level, MAX_BLOCKS, Region, Solid};
use distance::Distance;
use lattice::{Lattice, SIDE};
use patch::{Blocks, Cut};

/// The convex hull of two balls: the piece of the solid between neighbouring samples of the curve
/// skeleton. With equal ends it is one ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoundCone {
    /// Centres of the two balls, mm.
    pub centres: [Point3<f64>; 2],
    /// Their radii, mm.
    pub radii: [f64; 2],
}

/// Why no surface was made.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum SurfaceError {
    /// There is no cone.
    #[error("there is no solid to mesh: the list of round cones is empty")]
    Empty,
    /// A centre is not finite, or a radius is not finite and positive.
    #[error("round cone {index} has a centre that is not finite or a radius that is not positive")]
    Cone {
        /// Place of the first such cone in the list.
        index: usize,
    },
    /// The cell is not a finite, positive length.
    #[error("the cell of the surface must be a positive number of millimetres, not {cell}")]
    Cell {
        /// The cell asked for, mm.
        cell: f64,
    },
    /// The grid would not fit in memory, or its points could not be told apart in 64 bits.
    #[error("a cell of {cell} mm cuts a solid of {size:.1} mm too finely; choose a larger cell")]
    TooFine {
        /// The cell asked for, mm.
        cell: f64,
        /// The longest side of the solid's bounding box, mm.
        size: f64,
    },
    /// Every cone slipped between the grid points.
    #[error("the solid is thinner than the cell of {cell} mm everywhere; choose a smaller cell")]
    TooCoarse {
        /// The cell asked for, mm.
        cell: f64,
    },
}

/// Edge of the lattice's cubes, in cells. At 1.5 the largest ball that fits between the points has a
/// radius of 0.84 cells, as in a cubic grid with a point every cell (0.87), with 0.6 times the points.
const CUBE: f64 = 1.5;

/// Meshes the boundary of the union of `cones`.
///
/// `cell`, mm, is the size of the smallest features that are kept; edges of faces are about 0.6 cells
/// long. Vertices lie within 1e-6 cells of the true surface, but for a few in creases or on cones thinner
/// than the cell.
///
/// # Errors
///
/// See [`SurfaceError`].
pub fn surface(cones: &[RoundCone], cell: f64) -> Result<Mesh, SurfaceError> {
    let mut mesh = Mesh::default();
    Mesher::default().surface(cones, cell, &mut mesh)?;
    Ok(mesh)
}

/// What [`surface`] needs on the way, kept from one solid to the next: once it has grown to their size,
/// nothing more is allocated.
#[derive(Debug, Default)]
pub struct Mesher {
    distances: Vec<Distance>,
    seeds: [Seeds; 2],
    level: Level,
    groves: Vec<Grove>,
    cuts: Vec<Vec<Cut>>,
    /// The grove of a block and its place there, by its corner.
    places: HashMap<[i32; 3], (u32, u32), Mixed>,
}

/// Regions with their cones.
#[derive(Debug, Default)]
struct Seeds {
    regions: Vec<(Region, Range<usize>)>,
    cones: Vec<u32>,
}

/// The solid is divided until there are so many regions, which are then worked on side by side.
const GROVES: usize = 64;

impl Mesher {
    /// As [`surface`], into `mesh`, which is emptied first.
    ///
    /// # Errors
    ///
    /// See [`SurfaceError`].
    pub fn surface(&mut self, cones: &[RoundCone], cell: f64, mesh: &mut Mesh) -> Result<(), SurfaceError> {
        mesh.vertices.clear();
        mesh.faces.clear();
        check(cones, cell)?;
        self.distances.clear();
        self.distances.extend(cones.iter().map(Distance::to));
        let lattice = Lattice::around(cones, cell * CUBE);
        let solid = Solid { lattice: &lattice, distances: &self.distances };
        let too_fine = SurfaceError::TooFine { cell, size: lattice.size };
        let along = lattice.blocks_along().ok_or(too_fine)?;

        let [seeds, next] = &mut self.seeds;
        seeds.cones.clear();
        seeds.cones.extend(0..u32::try_from(cones.len()).map_err(|_| too_fine)?);
        seeds.regions.clear();
        seeds.regions.push((Region { corner: [0; 3], cubes: along * SIDE }, 0..cones.len()));
        while seeds.regions.len() < GROVES && seeds.regions.first().is_some_and(|(region, _)| region.cubes > SIDE) {
            next.cones.clear();
            next.regions.clear();
            for (region, own) in &seeds.regions {
                self.level.cones.clear();
                self.level.cones.extend(&seeds.cones[own.clone()]);
                self.level.divide(&solid, *region, &mut next.cones, |region, own| {
                    next.regions.push((region, own));
                });
            }
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

        let groves = &*groves;
        self.places.clear();
        for (number, grove) in groves.iter().enumerate() {
            let places = grove.blocks.iter().enumerate();
            self.places.extend(places.map(|(place, block)| (block.corner, (number as u32, place as u32))));
        }
        let places = &self.places;
        let ahead_of = |grove: usize, place: usize| -> [Option<(u32, u32)>; 8] {
            let corner = groves[grove].blocks[place].corner;
            std::array::from_fn(|ahead| {
                if ahead == 0 {
                    return Some((grove as u32, place as u32));
                }
                let bit = |axis: usize| (ahead >> (2 - axis) & 1) as i32 * 2 * SIDE;
                places.get(&[0, 1, 2].map(|axis| corner[axis] + bit(axis))).copied()
            })
        };
        let blocks_of = |places: &[Option<(u32, u32)>; 8]| -> Blocks<'_> {
            places.map(|place| {
                place.map(|(grove, place)| {
                    let grove = &groves[grove as usize];
                    (grove, &grove.blocks[place as usize])
                })
            })
        };
        cuts.par_iter_mut().enumerate().for_each(|(grove, cuts)| {
            cuts.clear();
            cuts.extend((0..groves[grove].blocks.len()).map(|place| Cut::of(&blocks_of(&ahead_of(grove, place)))));
        });
        let (mut vertices, mut faces) = (0, 0);
        for cut in cuts.iter_mut().flatten() {
            cut.first_vertex = vertices;
            vertices += cut.vertices;
            faces += cut.faces;
        }
        if faces == 0 {
            return Err(SurfaceError::TooCoarse { cell });
        }
        let cuts = &*cuts;
        mesh.vertices.resize(vertices as usize, Point3::origin());
        spread(0, cuts, &mut mesh.vertices, &|cut| cut.vertices as usize, &|grove, vertices| {
            let mut vertices = vertices;
            for (place, cut) in cuts[grove].iter().enumerate() {
                let (own, others) = vertices.split_at_mut(cut.vertices as usize);
                cut.put_vertices(&solid, &blocks_of(&ahead_of(grove, place)), own);
                vertices = others;
            }
        });
        mesh.faces.resize(faces as usize, [0; 3]);
        let vertices = &mesh.vertices;
        spread(0, cuts, &mut mesh.faces, &|cut| cut.faces as usize, &|grove, faces| {
            let mut faces = faces;
            for (place, cut) in cuts[grove].iter().enumerate() {
                let (own, others) = faces.split_at_mut(cut.faces as usize);
                let places = ahead_of(grove, place);
                let cuts = places.map(|place| place.map(|(grove, place)| &cuts[grove as usize][place as usize]));
                Cut::put_faces(&blocks_of(&places), &cuts, vertices, own);
                faces = others;
            }
        });
        Ok(())
    }
}

/// Hands to `put`, side by side, the number of each grove and its share of `out`.
fn spread<T: Send>(
    first: usize,
    cuts: &[Vec<Cut>],
    out: &mut [T],
    count: &(impl Fn(&Cut) -> usize + Sync),
    put: &(impl Fn(usize, &mut [T]) + Sync),
) {
    if let [_] = cuts {
        return put(first, out);
    }
    let (left, right) = cuts.split_at(cuts.len() / 2);
    let (here, there) = out.split_at_mut(left.iter().flatten().map(count).sum());
    rayon::join(
        || spread(first, left, here, count, put),
        || spread(first + left.len(), right, there, count, put),
    );
}

/// Mixes the bits of a block's corner.
#[derive(Debug, Default)]
struct Mixer(u64);

type Mixed = BuildHasherDefault<Mixer>;

impl Hasher for Mixer {
    fn write(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.write_i32(i32::from(byte));
        }
    }

    fn write_i32(&mut self, x: i32) {
        self.0 = (self.0.rotate_left(26) ^ u64::from(x.cast_unsigned())).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    }

    fn finish(&self) -> u64 {
        self.0.rotate_left(26)
    }
}

fn check(cones: &[RoundCone], cell: f64) -> Result<(), SurfaceError> {
    if cones.is_empty() {
        return Err(SurfaceError::Empty);
    }
    let sound = |cone: &RoundCone| {
        cone.centres.iter().all(|centre| centre.iter().all(|x| x.is_finite()))
            && cone.radii.iter().all(|&radius| radius.is_finite() && radius > 0.0)
    };
    if let Some(index) = cones.iter().position(|cone| !sound(cone)) {
        return Err(SurfaceError::Cone { index });
    }
    if !(cell.is_finite() && cell > 0.0) {
        return Err(SurfaceError::Cell { cell });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ball(x: f64, radius: f64) -> RoundCone {
        RoundCone { centres: [Point3::new(x, 0.0, 0.0); 2], radii: [radius; 2] }
    }

    #[test]
    fn refuses_what_cannot_be_meshed() {
        let refused = |cones: &[RoundCone], cell| surface(cones, cell).unwrap_err();
        assert_eq!(refused(&[], 1.0), SurfaceError::Empty);
        assert_eq!(refused(&[ball(0.0, 1.0), ball(f64::NAN, 1.0)], 1.0), SurfaceError::Cone { index: 1 });
        assert_eq!(refused(&[ball(0.0, 0.0)], 1.0), SurfaceError::Cone { index: 0 });
        assert_eq!(refused(&[ball(0.0, f64::INFINITY)], 1.0), SurfaceError::Cone { index: 0 });
        assert_eq!(refused(&[ball(0.0, 1.0)], 0.0), SurfaceError::Cell { cell: 0.0 });
        assert!(matches!(refused(&[ball(0.0, 1.0)], f64::NAN), SurfaceError::Cell { .. }));
        assert!(matches!(refused(&[ball(0.0, 1.0)], 1e-4), SurfaceError::TooFine { .. }));
        assert!(matches!(refused(&[ball(0.0, 1.0)], f64::MIN_POSITIVE), SurfaceError::TooFine { .. }));
        assert!(matches!(refused(&[ball(1e300, 1.0)], 1.0), SurfaceError::TooFine { .. }));
        assert!(matches!(refused(&[ball(-1e308, 1.0), ball(1e308, 1.0)], 1.0), SurfaceError::TooFine { .. }));
        assert!(matches!(refused(&[ball(0.7, 1e-3)], 1.0), SurfaceError::TooCoarse { .. }));
    }

    #[test]
    fn any_number_of_threads_gives_the_same_bits() {
        let at = |i: i32| Point3::new(f64::from(i * 7 % 31), f64::from(i * 11 % 29), f64::from(i * 5 % 23));
        let cones: Vec<_> =
            (0..40).map(|i| RoundCone { centres: [at(i), at(i + 1)], radii: [1.5, 2.5] }).collect();
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| surface(&cones, 0.5).unwrap())
        };
        let bits = |mesh: &Mesh| -> Vec<u64> {
            mesh.vertices.iter().flat_map(|p| p.iter().map(|x| x.to_bits()).collect::<Vec<_>>()).collect()
        };
        let (one, many) = (on(1), on(7));
        assert_eq!(one.faces, many.faces);
        assert_eq!(bits(&one), bits(&many));
    }

    #[test]
    fn a_ball_of_60_mm_is_met_within_20_micrometres() {
        let mesh = surface(&[ball(0.0, 60.0)], 2.0).unwrap();
        let off = |p: Point3<f64>| (p.coords.norm() - 60.0).abs();
        let worst_vertex = mesh.vertices.iter().map(|&p| off(p)).fold(0.0, f64::max);
        assert!(worst_vertex < 2e-6, "{worst_vertex}");

        // The middle of a face is where its sag is near the greatest; weighing by area gives the mean.
        let (mut sum, mut area) = (0.0, 0.0);
        for face in &mesh.faces {
            let [a, b, c] = face.map(|corner| mesh.vertices[corner as usize]);
            let weight = (b - a).cross(&(c - a)).norm() / 2.0;
            sum += weight * off(Point3::from((a.coords + b.coords + c.coords) / 3.0));
            area += weight;
        }
        assert!(sum / area < 0.01, "{}", sum / area);
        let volume = 4.0 / 3.0 * std::f64::consts::PI * 60.0_f64.powi(3);
        assert!((mesh.volume() / volume - 1.0).abs() < 5e-4, "{}", mesh.volume() / volume);
    }
}
