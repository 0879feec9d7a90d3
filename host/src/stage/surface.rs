//! Round cones to a closed surface: the last step of growing the solid from its curve skeleton.
//!
//! In: round cones, mm. Out: the boundary of their union as a [`Mesh`], mm.
//! Promised for any input that is not refused: every edge has exactly two faces that run through it in
//! opposite directions, the faces around a vertex form one fan, faces look outward, no face has zero
//! area, and no two faces cross.
//!
//! The union is an implicit function, the least of the exact signed distances to the cones
//! (`distance.rs`). It is looked at only where the surface can pass (`region.rs`, `block.rs`), there with
//! the cones that can decide where (`prune.rs`, `bundle.rs`), on a body-centred cubic lattice
//! (`lattice.rs`) whose tetrahedra are cut where the function changes its sign (`patch.rs`, `crossing.rs`). Each
//! point, edge and tetrahedron belongs to one block and is worked out once (`mesher.rs`). Tetrahedra, because a plane
//! cuts one in a triangle or a quadrilateral and nothing else: there is no ambiguous case, so the promise
//! holds by construction instead of by repair (`docs/decisions/0003-isosurface.md`,
//! `docs/decisions/0014-fast-isosurface.md`, `docs/decisions/0029-last-crossings.md`,
//! `docs/decisions/0032-branches-foretold.md`).
//!
//! Cost: proportional to surface / cell². The result has the same bits for any number of threads.
//! Not promised: features thinner than the cell may be missing, and concave creases are rounded by up to
//! a cell.

mod block;
mod bundle;
mod cone;
mod crossing;
mod distance;
mod lattice;
mod mesher;
mod near;
mod patch;
mod prune;
mod region;
mod vectors;

use nalgebra::Point3;
use thiserror::Error;

use crate::mesh::Mesh;
pub use mesher::Mesher;

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
/// long. Vertices lie within 5e-4 cells of the true surface, but for a few in creases or on cones thinner
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
        assert!(worst_vertex < 1e-5, "{worst_vertex}");

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
