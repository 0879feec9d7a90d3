//! One block's share of the surface: tetrahedra of the body-centred cubic lattice, cut where the sign
//! changes.
//!
//! A tetrahedron has two opposite edges along axes, one between corners and one between middles of cubes,
//! and four shorter ones; all are alike and nearly regular. Points that are too near the surface are
//! first moved off it, by less than would turn a tetrahedron inside out, so that no cut passes close to a
//! corner and no face degenerates; isosurface stuffing (Labelle and Shewchuk 2007) moves them onto it
//! instead, where a sign is lost. A vertex is then sought along its edge until it is on the surface.
//!
//! What two blocks share they find with the same bits: signs and vertices depend on the nearest cones
//! alone, and neither block lacks one of those.

use nalgebra::Point3;

use super::{
    block::{Block, Lattice, MAX_SHIFT, SIDE, SLACK},
    distance::Distance,
    nearby::Nearby,
};

/// A block's share of the surface.
pub(super) struct Patch {
    /// Name of the lattice edge that each vertex lies on.
    pub(super) names: Vec<u64>,
    /// Vertices, mm.
    pub(super) vertices: Vec<Point3<f64>>,
    /// Triangles over them, outward.
    pub(super) faces: Vec<[u32; 3]>,
}

/// Points are moved to at least this distance off the surface, in cubes. Twice that is the most that one
/// is moved: from just outside to inside.
const CLEAR: f64 = MAX_SHIFT / 2.0;

/// A vertex is this close to the surface, in cubes.
const EXACT: f64 = 5e-7;

/// Steps after which the search for a vertex ends; it needs three or four where the surface is smooth.
const MAX_STEPS: usize = 40;

/// A vertex stays this share of its edge off the ends even where no point could be moved clear of the
/// surface, as on a ball smaller than [`CLEAR`].
const END: f64 = 0.02;

/// Beyond this distance of the surface, in cubes, the next point a cube further is on the same side, and
/// is at no end of an edge that the surface cuts: those are up to a cube and two shifts long.
const FAR: f64 = 2.0 + 2.0 * MAX_SHIFT + SLACK;

/// Lattice coordinates from -1 to `2 * SIDE + 1` belong to a block's tetrahedra.
const ALONG: i32 = 2 * SIDE + 3;

/// Stride of the block's arrays: wide enough that the sum of two slots is still one number per pair of
/// summed coordinates, and so names an edge by its middle.
const STRIDE: i32 = 2 * ALONG - 1;

/// For each set of corners inside (bit i is corner i) the corners in an order that keeps the orientation
/// and begins with the fewer: those inside, or for three the one outside.
const FEWER_FIRST: [[usize; 4]; 16] = [
    [0, 1, 2, 3],
    [0, 1, 2, 3],
    [1, 0, 3, 2],
    [0, 1, 2, 3],
    [2, 3, 0, 1],
    [0, 2, 3, 1],
    [1, 2, 0, 3],
    [3, 2, 1, 0],
    [3, 2, 1, 0],
    [0, 3, 1, 2],
    [1, 3, 2, 0],
    [2, 3, 0, 1],
    [2, 3, 0, 1],
    [1, 0, 3, 2],
    [0, 1, 2, 3],
    [0, 1, 2, 3],
];

/// Cuts the tetrahedra that begin in `block`.
pub(super) fn cut(lattice: &Lattice, block: &Block, distances: &[Distance]) -> Patch {
    Cutter::new(lattice, block, distances).cut()
}

/// A lattice point, moved off the surface.
#[derive(Clone, Copy)]
struct Site {
    position: Point3<f64>,
    /// Signed distance there, mm; of a point further off than [`FAR`] only the sign, and a bound.
    distance: f64,
    /// Place of the cone that decides it in [`Nearby`].
    cone: usize,
}

impl Site {
    fn inside(&self) -> bool {
        self.distance < 0.0
    }
}

struct Cutter<'a> {
    corner: [i32; 3],
    nearby: Nearby,
    lattice: &'a Lattice,
    sites: Vec<Site>,
    /// The vertex on each edge of the block, by the sum of its ends' slots.
    on_edge: Vec<Option<u32>>,
    patch: Patch,
}

impl<'a> Cutter<'a> {
    fn new(lattice: &'a Lattice, block: &Block, distances: &[Distance]) -> Self {
        let nearby = Nearby::new(lattice, block, distances);
        let slots = (ALONG * STRIDE * STRIDE) as usize;
        let mut site = Site { position: Point3::origin(), distance: 0.0, cone: 0 };
        let mut sites = vec![site; slots];
        for (x, y) in (-1..ALONG - 1).flat_map(|x| (-1..ALONG - 1).map(move |y| (x, y))) {
            if (x - y) % 2 != 0 {
                continue;
            }
            let first = -(x.abs() % 2);
            for z in (first..ALONG - 1).step_by(2) {
                let position = lattice.position(offset(block.corner, [x, y, z]));
                site = if z > first && site.distance.abs() > lattice.cube * FAR {
                    let distance = site.distance - lattice.cube.copysign(site.distance);
                    Site { position, distance, ..site }
                } else {
                    nearby.site(position, site.cone, lattice.cube * CLEAR)
                };
                sites[slot([x, y, z])] = site;
            }
        }
        let patch = Patch { names: Vec::new(), vertices: Vec::new(), faces: Vec::new() };
        Self { corner: block.corner, nearby, lattice, sites, on_edge: vec![None; 2 * slots], patch }
    }

    fn cut(mut self) -> Patch {
        for x in 0..2 * SIDE {
            for y in (x % 2..2 * SIDE).step_by(2) {
                for z in (x % 2..2 * SIDE).step_by(2) {
                    for axis in 0..3 {
                        for side in [-1, 1] {
                            self.cut_tetrahedron(tetrahedron([x, y, z], axis, side));
                        }
                    }
                }
            }
        }
        self.patch
    }

    fn cut_tetrahedron(&mut self, corners: [[i32; 3]; 4]) {
        let inside = corners.map(|corner| self.sites[slot(corner)].inside());
        let set = inside.iter().rev().fold(0, |set, &inside| set << 1 | usize::from(inside));
        let [a, b, c, d] = FEWER_FIRST[set].map(|corner| corners[corner]);
        match set.count_ones() {
            1 => {
                let face = [self.vertex(a, b), self.vertex(a, c), self.vertex(a, d)];
                self.patch.faces.push(face);
            }
            2 => {
                let ring = [self.vertex(a, c), self.vertex(a, d), self.vertex(b, d), self.vertex(b, c)];
                self.add_quadrilateral(ring);
            }
            3 => {
                let face = [self.vertex(a, b), self.vertex(a, d), self.vertex(a, c)];
                self.patch.faces.push(face);
            }
            _ => {}
        }
    }

    /// Splits at the shorter diagonal.
    fn add_quadrilateral(&mut self, [p, q, r, s]: [u32; 4]) {
        let apart = |i: u32, j: u32| {
            (self.patch.vertices[i as usize] - self.patch.vertices[j as usize]).norm_squared()
        };
        let halves = if apart(p, r) <= apart(q, s) { [[p, q, r], [p, r, s]] } else { [[p, q, s], [q, r, s]] };
        self.patch.faces.extend(halves);
    }

    fn vertex(&mut self, a: [i32; 3], b: [i32; 3]) -> u32 {
        let edge = slot(a) + slot(b);
        if let Some(known) = self.on_edge[edge] {
            return known;
        }
        let (low, high) = (a.min(b), a.max(b));
        let (from, to) = (&self.sites[slot(low)], &self.sites[slot(high)]);
        let vertex = self.nearby.crossing(from, to, self.lattice.cube * EXACT);
        let index = self.patch.vertices.len() as u32;
        self.patch.vertices.push(vertex);
        self.patch.names.push(Lattice::name(offset(self.corner, low), offset(self.corner, high)));
        self.on_edge[edge] = Some(index);
        index
    }
}

/// The tetrahedron with the edge from `point` along `axis`, and an edge along the next axis at `side`
/// (-1 or 1) of it on the third. Each tetrahedron of the lattice is this for one choice, and the corners
/// come in an order of positive volume.
fn tetrahedron(point: [i32; 3], axis: usize, side: i32) -> [[i32; 3]; 4] {
    let along = |first: i32, next: i32, third: i32| {
        let mut step = [0; 3];
        step[axis] = first;
        step[(axis + 1) % 3] = next;
        step[(axis + 2) % 3] = third;
        offset(point, step)
    };
    [point, along(2, 0, 0), along(1, side, side), along(1, -side, side)]
}

fn offset(point: [i32; 3], step: [i32; 3]) -> [i32; 3] {
    [point[0] + step[0], point[1] + step[1], point[2] + step[2]]
}

/// Where the arrays of a block keep a point that is given relative to the block's corner.
fn slot([x, y, z]: [i32; 3]) -> usize {
    (((x + 1) * STRIDE + y + 1) * STRIDE + z + 1) as usize
}

impl Nearby {
    /// The lattice point at `position`, moved until it is `clear` mm off the surface.
    fn site(&self, position: Point3<f64>, guess: usize, clear: f64) -> Site {
        let (distance, cone) = self.nearest(&position, guess);
        let unmoved = Site { position, distance, cone };
        if distance.abs() >= clear {
            return unmoved;
        }
        let Some(outward) = self.cones[cone].distance.outward(&position, 0.0) else {
            return unmoved;
        };
        // Away from the surface; but from a crease outward there is no getting away, only inward.
        for target in [clear.copysign(distance), -clear] {
            let position = position + outward * (target - distance);
            let (distance, cone) = self.nearest(&position, cone);
            if distance.abs() > 0.99 * clear {
                return Site { position, distance, cone };
            }
        }
        unmoved
    }

    /// A point on the surface between two sites on different sides of it, by the Illinois variant of
    /// false position (Dowell and Jarratt 1971), to within `exact` mm.
    fn crossing(&self, from: &Site, to: &Site, exact: f64) -> Point3<f64> {
        let at = |share: f64| from.position + (to.position - from.position) * share;
        let (mut low, mut high) = ((0.0, from.distance), (1.0, to.distance));
        let (mut share, mut cone) = (0.5, from.cone);
        for _ in 0..MAX_STEPS {
            share = (low.0 * high.1 - high.0 * low.1) / (high.1 - low.1);
            let distance;
            (distance, cone) = self.nearest(&at(share), cone);
            if distance.abs() <= exact {
                break;
            }
            // The end that stays loses half its weight, or it would stay for ever on a bent function.
            if (distance < 0.0) == (high.1 < 0.0) {
                high = (share, distance);
                low.1 /= 2.0;
            } else {
                low = (share, distance);
                high.1 /= 2.0;
            }
        }
        at(share.clamp(END, 1.0 - END))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stage::surface::nearby::tests::cones;

    fn volume([a, b, c, d]: [Point3<f64>; 4]) -> f64 {
        (b - a).cross(&(c - a)).dot(&(d - a)) / 6.0
    }

    fn all_tetrahedra(point: [i32; 3]) -> impl Iterator<Item = [[i32; 3]; 4]> {
        (0..3).flat_map(move |axis| [-1, 1].map(|side| tetrahedron(point, axis, side)))
    }

    #[test]
    fn the_tetrahedra_of_a_cube_are_all_right_way_out_and_fill_it() {
        let volumes: Vec<f64> = all_tetrahedra([4, 6, 8])
            .chain(all_tetrahedra([5, 7, 9]))
            .map(|corners| volume(corners.map(|corner| Point3::from(corner.map(f64::from)))))
            .collect();
        assert!(volumes.iter().all(|&volume| volume > 0.0));
        assert!((volumes.iter().sum::<f64>() - 8.0).abs() < 1e-12);
    }

    #[test]
    fn the_orders_of_corners_are_even_and_begin_with_the_fewer() {
        for (set, order) in FEWER_FIRST.iter().enumerate() {
            let swaps =
                (0..4).flat_map(|j| (0..j).map(move |i| (i, j))).filter(|&(i, j)| order[i] > order[j]);
            assert_eq!(swaps.count() % 2, 0, "{order:?}");
            let inside = order.map(|corner| set >> corner & 1 == 1);
            match set.count_ones() {
                1 => assert_eq!(inside, [true, false, false, false]),
                2 => assert_eq!(inside, [true, true, false, false]),
                3 => assert_eq!(inside, [false, true, true, true]),
                _ => {}
            }
        }
    }

    #[test]
    fn moved_points_turn_no_tetrahedron_inside_out() {
        let cones = cones();
        let distances: Vec<Distance> = cones.iter().map(Distance::to).collect();
        let lattice = Lattice::around(&cones, 1.0);
        let mut moved = 0;
        for block in lattice.blocks_near_surface(&distances).unwrap() {
            let cutter = Cutter::new(&lattice, &block, &distances);
            for x in 0..2 * SIDE {
                for (y, z) in
                    (x % 2..2 * SIDE).step_by(2).flat_map(|y| (x % 2..2 * SIDE).map(move |z| (y, z)))
                {
                    if (x - z) % 2 != 0 {
                        continue;
                    }
                    let unmoved = lattice.position(offset(block.corner, [x, y, z]));
                    moved += usize::from(cutter.sites[slot([x, y, z])].position != unmoved);
                    for corners in all_tetrahedra([x, y, z]) {
                        assert!(volume(corners.map(|corner| cutter.sites[slot(corner)].position)) > 1e-3);
                    }
                }
            }
        }
        assert!(moved > 100, "{moved}");
    }
}
