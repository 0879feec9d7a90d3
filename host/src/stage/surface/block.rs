//! The lattice, and the blocks of it in which the surface can pass.
//!
//! A signed distance changes by at most the way walked. So when its size in the middle of a cube exceeds
//! the cube's reach there is no surface in it, and a cone that is further from the middle than the
//! nearest one by twice the reach is the nearest nowhere in the cube. From one cube around the solid both
//! rules are applied to its eight children, and so on down: the cost follows the surface, not the volume.

use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

use super::{RoundCone, distance::Distance};

/// Cubes along the side of a block.
pub(super) const SIDE: i32 = 4;

/// A block takes about 6 kB of mesh, so that this many take 0.4 GB, about as much again when joined.
const MAX_BLOCKS: usize = 1 << 16;

/// The blocks along a side of the outermost cube: an edge's name has 21 bits an axis
/// ([`Lattice::name`]), which is 2^18 cubes, less the margin.
const MAX_BLOCKS_ALONG: i32 = 1 << 15;

/// How far off the origin the solid may be, in cubes: there a coordinate still resolves 2e-10 cubes.
const MAX_OFFSET: f64 = (1u32 << 20) as f64;

/// Rounding, in cubes, of distances and of what their slopes add up to over a block: a coordinate's, times
/// the largest lean of a cone, times the reach of a block in cubes.
pub(super) const SLACK: f64 = 1e-5;

/// How far a lattice point may be moved, in cubes. A tetrahedron is half a cube wide at its narrowest, so
/// below a quarter none can turn inside out.
pub(super) const MAX_SHIFT: f64 = 0.24;

/// A body-centred cubic lattice: the points whose three integer coordinates, in half cubes, are all even
/// (corners of the cubes) or all odd (their middles).
pub(super) struct Lattice {
    /// The point (0, 0, 0), mm: at least two cubes below the solid on each axis, at a multiple of the
    /// cube so that a solid that grows keeps its points.
    origin: Point3<f64>,
    /// Edge of a cube, mm.
    pub(super) cube: f64,
    /// Longest side of the solid's bounding box, mm.
    pub(super) size: f64,
}

/// A cube of the lattice in which the surface may pass.
pub(super) struct Block {
    /// Its lowest corner, in half cubes.
    pub(super) corner: [i32; 3],
    /// Its middle, mm.
    pub(super) middle: Point3<f64>,
    /// The cones that are the nearest one somewhere in it, ascending.
    pub(super) cones: Vec<u32>,
}

impl Lattice {
    /// A lattice with cubes of `cube` mm around all `cones`.
    pub(super) fn around(cones: &[RoundCone], cube: f64) -> Self {
        let mut low = Point3::from(Vector3::repeat(f64::INFINITY));
        let mut high = -low;
        for cone in cones {
            for (centre, &radius) in cone.centres.iter().zip(&cone.radii) {
                low = low.inf(&(centre - Vector3::repeat(radius)));
                high = high.sup(&(centre + Vector3::repeat(radius)));
            }
        }
        Self { origin: low.map(|x| ((x / cube).floor() - 2.0) * cube), cube, size: (high - low).max() }
    }

    /// Where a lattice point is before any shift, mm.
    pub(super) fn position(&self, point: [i32; 3]) -> Point3<f64> {
        self.origin + Vector3::from(point).map(f64::from) * (self.cube / 2.0)
    }

    /// One number for the edge between two lattice points: its middle, which no other edge has.
    pub(super) fn name(a: [i32; 3], b: [i32; 3]) -> u64 {
        (0..3).fold(0, |name, axis| (name << 21) | u64::from((a[axis] + b[axis]).cast_unsigned()))
    }

    /// The blocks near the surface in an order that depends on the solid alone, or nothing if there are
    /// too many.
    pub(super) fn blocks_near_surface(&self, distances: &[Distance]) -> Option<Vec<Block>> {
        let mut along = self.blocks_along()?;
        let all = (0..u32::try_from(distances.len()).ok()?).collect();
        let mut blocks = vec![Block { corner: [0; 3], middle: self.middle([0; 3], along), cones: all }];
        while along > 1 {
            along /= 2;
            blocks = blocks
                .par_iter()
                .flat_map_iter(|parent| {
                    (0..8).filter_map(move |octant| {
                        let corner = [0, 1, 2]
                            .map(|axis| parent.corner[axis] + ((octant >> axis) & 1) * along * SIDE * 2);
                        self.block(corner, along, &parent.cones, distances)
                    })
                })
                .collect();
            if blocks.len() > MAX_BLOCKS {
                return None;
            }
        }
        Some(blocks)
    }

    /// How far from a block's middle the points of its tetrahedra can be, mm, when it is `along` blocks
    /// wide: they stick out by half a cube, and may have been moved.
    pub(super) fn reach(&self, along: i32) -> f64 {
        let half_side = f64::from(along * SIDE + 1) / 2.0;
        self.cube * (half_side * 3.0_f64.sqrt() + MAX_SHIFT + SLACK)
    }

    /// Blocks along the side of the cube around the solid, a power of two.
    fn blocks_along(&self) -> Option<i32> {
        let far = self.origin.coords.amax() / self.cube;
        let cubes = self.size / self.cube + 5.0;
        // Comparisons this way round refuse what overflowed to infinity or became no number.
        if !(far < MAX_OFFSET && cubes <= f64::from(MAX_BLOCKS_ALONG * SIDE)) {
            return None;
        }
        let mut along = 1;
        while f64::from(along * SIDE) < cubes {
            along *= 2;
        }
        Some(along)
    }

    fn middle(&self, corner: [i32; 3], along: i32) -> Point3<f64> {
        self.position(corner.map(|x| x + along * SIDE))
    }

    /// The block at `corner`, unless it is all inside or all outside.
    fn block(&self, corner: [i32; 3], along: i32, cones: &[u32], distances: &[Distance]) -> Option<Block> {
        let middle = self.middle(corner, along);
        let reach = self.reach(along);
        let from_middle: Vec<f64> = cones.iter().map(|&cone| distances[cone as usize].at(&middle)).collect();
        let nearest = from_middle.iter().copied().fold(f64::INFINITY, f64::min);
        if nearest.abs() > reach {
            return None;
        }
        let may_be_nearest = cones.iter().zip(&from_middle).filter(|&(_, &far)| far <= nearest + 2.0 * reach);
        Some(Block { corner, middle, cones: may_be_nearest.map(|(&cone, _)| cone).collect() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_follow_the_surface_and_not_the_volume() {
        let ball = RoundCone { centres: [Point3::origin(); 2], radii: [50.0; 2] };
        let count =
            |cube| Lattice::around(&[ball], cube).blocks_near_surface(&[Distance::to(&ball)]).unwrap().len();
        let (coarse, fine) = (count(1.0), count(0.5));
        assert!((3.5..4.5).contains(&(fine as f64 / coarse as f64)), "{coarse} {fine}");
    }

    #[test]
    fn edges_of_a_point_have_names_of_their_own() {
        let point = [8, 10, 6];
        let mut names: Vec<u64> = (-2..=2)
            .flat_map(|x| (-2..=2).flat_map(move |y| (-2..=2).map(move |z| [x, y, z])))
            .filter(|step: &[i32; 3]| {
                matches!(step.map(|x| x.abs()), [2, 0, 0] | [0, 2, 0] | [0, 0, 2] | [1, 1, 1])
            })
            .map(|step| Lattice::name(point, [0, 1, 2].map(|axis| point[axis] + step[axis])))
            .collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), 14);
    }
}
