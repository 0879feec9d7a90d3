//! The signed distance to the union of the cones near a block: the least of theirs, found without asking
//! most of them.
//!
//! A cone is passed over when a lower bound of its distance is more than the least so far: its distance
//! in the block's middle less the way from there, and, better, the tangent of its distance in the middle.

use nalgebra::{Point3, Vector3};

use super::{
    block::{Block, Lattice, SLACK},
    distance::Distance,
};

/// The union of the cones near a block.
pub(super) struct Nearby {
    middle: Point3<f64>,
    /// By distance from the middle.
    pub(super) cones: Vec<Near>,
}

/// One cone of [`Nearby`].
pub(super) struct Near {
    /// Signed distance of the block's middle, mm, less an allowance for rounding.
    from_middle: f64,
    /// How that grows from the middle, per mm. A round cone is convex, and so is the distance to it:
    /// going on straight from the middle gives a distance that is nowhere too large.
    growth: Vector3<f64>,
    /// Place in the list of all cones.
    index: u32,
    pub(super) distance: Distance,
}

impl Nearby {
    /// The union in `block`, of all cones' `distances`.
    pub(super) fn new(lattice: &Lattice, block: &Block, distances: &[Distance]) -> Self {
        let near = |&index: &u32| {
            let distance = distances[index as usize];
            let from_middle = distance.at(&block.middle) - lattice.cube * SLACK;
            match distance.outward(&block.middle, lattice.cube) {
                Some(growth) => Near { from_middle, growth, index, distance },
                // Of a cone whose axis passes the middle only the way walked is known.
                None => Near {
                    from_middle: from_middle - lattice.reach(1),
                    growth: Vector3::zeros(),
                    index,
                    distance,
                },
            }
        };
        let mut cones: Vec<Near> = block.cones.iter().map(near).collect();
        cones.sort_by(|a, b| a.from_middle.total_cmp(&b.from_middle));
        Self { middle: block.middle, cones }
    }

    /// Signed distance of `p` and the place here of the cone that decides it: of equals, the first in the
    /// list of all. A good `guess` at that place saves time and changes nothing else.
    pub(super) fn nearest(&self, p: &Point3<f64>, guess: usize) -> (f64, usize) {
        let walk = p - self.middle;
        let walked = walk.norm();
        let mut place = guess;
        let mut least = self.cones[guess].distance.at(p);
        for (other, near) in self.cones.iter().enumerate() {
            if near.from_middle - walked > least {
                break;
            }
            if near.from_middle + near.growth.dot(&walk) > least {
                continue;
            }
            let distance = near.distance.at(p);
            if (distance, near.index) < (least, self.cones[place].index) {
                (least, place) = (distance, other);
            }
        }
        (least, place)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::stage::surface::RoundCone;

    /// Thirty cones in 20 mm, thick and thin, some along the axes.
    pub(in crate::stage::surface) fn cones() -> Vec<RoundCone> {
        let at = |i: i32| Point3::new(f64::from(i * 7 % 20), f64::from(i * 11 % 19), f64::from(i * 5 % 17));
        let cone = |i: i32| {
            let end = if i % 3 == 0 { at(i) + Vector3::y() * 4.0 } else { at(i + 1) };
            RoundCone { centres: [at(i), end], radii: [0.4 + f64::from(i % 4), 1.5] }
        };
        (0..30).map(cone).collect()
    }

    #[test]
    fn the_nearest_of_few_is_the_nearest_of_all() {
        let cones = cones();
        let distances: Vec<Distance> = cones.iter().map(Distance::to).collect();
        let lattice = Lattice::around(&cones, 0.7);
        for block in lattice.blocks_near_surface(&distances).unwrap() {
            let nearby = Nearby::new(&lattice, &block, &distances);
            for (x, y, z) in [(-1, -1, -1), (0, 4, 2), (3, 7, 1), (9, 9, 9), (5, -1, 9)] {
                let p = lattice.position([block.corner[0] + x, block.corner[1] + y, block.corner[2] + z]);
                let least = distances.iter().map(|distance| distance.at(&p)).fold(f64::INFINITY, f64::min);
                let first = distances.iter().position(|distance| distance.at(&p) == least).unwrap();
                let (got, place) = nearby.nearest(&p, nearby.cones.len() - 1);
                assert_eq!((got, nearby.cones[place].index), (least, first as u32));
            }
        }
    }
}
