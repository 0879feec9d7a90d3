//! The lattice, and how its points, edges and tetrahedra are numbered.
//!
//! A body-centred cubic lattice has a point at each corner of its cubes (even) and one in each middle (odd).
//! The points of [`SIDE`]^3 cubes are two words: a bit of one is a cube's lowest corner, of the other its middle.
//! So each question about a block is asked of 64 points at once. A byte of a word is a leaf of 2^3 cubes; leaves and
//! cubes stand in the order of [`Corner::ahead`].

use nalgebra::{Point3, Vector3};

use super::RoundCone;

/// Cubes along the side of a block.
pub(super) const SIDE: i32 = 4;

/// How far a lattice point may be moved, in cubes. A tetrahedron is half a cube wide at its narrowest, so
/// below a quarter none can turn inside out.
pub(super) const MAX_SHIFT: f64 = 0.24;

/// The blocks along a side of the outermost cube: far less than a coordinate, in half cubes, can count.
const MAX_BLOCKS_ALONG: i32 = 1 << 15;

/// How far off the origin the solid may be, in cubes: there a coordinate still resolves 2e-10 cubes.
const MAX_OFFSET: f64 = (1u32 << 20) as f64;

/// A body-centred cubic lattice: the points whose three integer coordinates, in half cubes, are all even
/// (corners of the cubes) or all odd (their middles).
#[derive(Debug)]
pub(super) struct Lattice {
    /// The point (0, 0, 0), mm: at least two cubes below the solid on each axis, at a multiple of the
    /// cube so that a solid that grows keeps its points.
    origin: Point3<f64>,
    /// Edge of a cube, mm.
    pub(super) cube: f64,
    /// Longest side of the solid's bounding box, mm.
    pub(super) size: f64,
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

    /// Blocks along the side of the cube around the solid, a power of two; none if they are too many or
    /// too far off.
    pub(super) fn blocks_along(&self) -> Option<i32> {
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
}

/// A lattice point relative to a cube: a corner (`kind` 0) or the middle (1) of the cube that is `ahead` of
/// it on each axis by 0 or 1, a bit an axis (4 for x, 2 for y, 1 for z).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Corner {
    pub(super) kind: usize,
    pub(super) ahead: usize,
}

/// An edge relative to a cube: its direction, below [`EDGES`], and the cube ahead to which it belongs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Edge {
    pub(super) direction: usize,
    pub(super) ahead: usize,
}

/// Edges that belong to a cube: from its corner along the axes, from its middle along the axes, and from its
/// middle to its eight corners.
pub(super) const EDGES: usize = 14;

/// Both ends of the edge of a cube in each direction.
pub(super) const ENDS: [[Corner; 2]; EDGES] = {
    let mut ends = [[Corner { kind: 1, ahead: 0 }, Corner { kind: 0, ahead: 0 }]; EDGES];
    let mut i = 0;
    while i < 8 {
        if i < 3 {
            ends[i] = [Corner { kind: 0, ahead: 0 }, Corner { kind: 0, ahead: 1 << i }];
            ends[3 + i] = [Corner { kind: 1, ahead: 0 }, Corner { kind: 1, ahead: 1 << i }];
        }
        ends[6 + i][1].ahead = i;
        i += 1;
    }
    ends
};

/// The edge between two corners of a tetrahedron.
const fn edge(a: Corner, b: Corner) -> Edge {
    let step = a.ahead ^ b.ahead;
    if a.kind == b.kind {
        return Edge { direction: 3 * a.kind + step.trailing_zeros() as usize, ahead: a.ahead & b.ahead };
    }
    Edge { direction: 6 + step, ahead: if a.kind == 1 { a.ahead } else { b.ahead } }
}

/// A tetrahedron relative to a cube.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tetrahedron {
    /// In an order of positive volume.
    pub(super) corners: [Corner; 4],
    /// Between each two of them; nothing on the diagonal.
    pub(super) edges: [[Edge; 4]; 4],
}

/// The tetrahedra that belong to a cube, of which all corners are of it or ahead of it: around an axis edge
/// between corners (the first six) or between middles, at the side below it or above it.
pub(super) const TETRAHEDRA: [Tetrahedron; 12] = {
    let none = Corner { kind: 0, ahead: 0 };
    let nowhere = Edge { direction: 0, ahead: 0 };
    let mut all = [Tetrahedron { corners: [none; 4], edges: [[nowhere; 4]; 4] }; 12];
    let mut i = 0;
    while i < all.len() {
        let (kind, axis, above) = (i / 6, i / 2 % 3, i % 2);
        // Bits of the axis of the edge, of the next one and of the third.
        let (first, next, third) = (4 >> axis, 4 >> ((axis + 1) % 3), 4 >> ((axis + 2) % 3));
        // The edge's lower end, and whether the cube across it is the one ahead. Of the middle of a cube the
        // corners lie at 0 and 1; of a corner the middles lie at -1 and 0.
        let (start, across) = match (kind, above) {
            (0, 0) => (next | third, 0),
            (0, _) => (next, 0),
            (_, 0) => (0, first),
            _ => (0, first | third),
        };
        let (low, high) =
            (Corner { kind: 1 - kind, ahead: across }, Corner { kind: 1 - kind, ahead: across | next });
        let (third_corner, fourth) = if above == 1 { (high, low) } else { (low, high) };
        let corners =
            [Corner { kind, ahead: start }, Corner { kind, ahead: start | first }, third_corner, fourth];
        all[i].corners = corners;
        let mut pair = 0;
        while pair < 16 {
            let (a, b) = (pair / 4, pair % 4);
            if a != b {
                all[i].edges[a][b] = edge(corners[a], corners[b]);
            }
            pair += 1;
        }
        i += 1;
    }
    all
};

/// The place in its block, on each axis, of the cube with a bit.
pub(super) const fn cube_of(bit: usize) -> [usize; 3] {
    [bit >> 4 & 2 | bit >> 2 & 1, bit >> 3 & 2 | bit >> 1 & 1, bit >> 2 & 2 | bit & 1]
}

/// On each axis, the cubes whose next one is in the same leaf, in the next leaf, and in the next block.
const NEXT: [[u64; 3]; 3] = {
    let mut next = [[0; 3]; 3];
    let mut i = 0;
    while i < 3 * 64 {
        let (axis, bit) = (i / 64, i % 64);
        let along = cube_of(bit)[axis];
        next[axis][if along.is_multiple_of(2) { 0 } else { 1 + along / 2 }] |= 1 << bit;
        i += 1;
    }
    next
};

/// The points of a block and of the seven ahead of it, as the block's own cubes see them: element `ahead`
/// has for each cube the bit of the cube ahead of it.
pub(super) fn seen_ahead(blocks: [u64; 8]) -> [u64; 8] {
    let on = |axis: usize, word: u64, next: u64| {
        let ([same, leaf, block], step) = (NEXT[axis], 4 >> axis);
        word >> step & same | word >> (7 * step) & leaf | next << (9 * step) & block
    };
    let plane = |x: usize| {
        let [a, b, c, d] = [0, 1, 2, 3].map(|i| blocks[4 * x + i]);
        [a, on(2, a, b), on(1, a, c), on(1, on(2, a, b), on(2, c, d))]
    };
    let (here, next) = (plane(0), plane(1));
    std::array::from_fn(|i| if i < 4 { here[i] } else { on(0, here[i - 4], next[i - 4]) })
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// The block ahead, as in [`seen_ahead`], and the bit in it, of the cube that is `ahead` of the cube at `bit`.
    pub(in crate::stage::surface) fn cube_ahead(bit: usize, ahead: usize) -> (usize, usize) {
        let moved = [0, 1, 2].map(|axis| cube_of(bit)[axis] + (ahead >> (2 - axis) & 1));
        let block = moved.iter().fold(0, |block, along| 2 * block + along / 4);
        let there = (0..64).find(|&there| cube_of(there) == moved.map(|along| along % 4));
        (block, there.expect("a cube of the block"))
    }

    /// The lattice point of a cube, in half cubes.
    pub(in crate::stage::surface) fn point_of(block_corner: [i32; 3], bit: usize, kind: usize) -> [i32; 3] {
        let cube = cube_of(bit);
        [0, 1, 2].map(|axis| block_corner[axis] + (2 * cube[axis] + kind) as i32)
    }

    /// A corner's place in half cubes, of the cube at the origin.
    fn place(corner: Corner) -> Point3<f64> {
        let along = |bit: usize| (2 * (corner.ahead >> bit & 1) + corner.kind) as f64;
        Point3::new(along(2), along(1), along(0))
    }

    #[test]
    fn the_tetrahedra_of_a_cube_are_all_right_way_out_and_fill_it() {
        let volumes = TETRAHEDRA.map(|tetrahedron| {
            let [a, b, c, d] = tetrahedron.corners.map(place);
            (b - a).cross(&(c - a)).dot(&(d - a)) / 6.0
        });
        assert!(volumes.iter().all(|&volume| volume > 0.0), "{volumes:?}");
        assert!((volumes.iter().sum::<f64>() - 8.0).abs() < 1e-12);
    }

    #[test]
    fn the_edges_of_tetrahedra_have_their_ends_and_each_one_name() {
        for tetrahedron in TETRAHEDRA {
            for (i, j) in (0..4).flat_map(|j| (0..j).map(move |i| (i, j))) {
                let edge = tetrahedron.edges[i][j];
                assert_eq!(edge, tetrahedron.edges[j][i]);
                let ends = ENDS[edge.direction].map(|end| {
                    assert_eq!(end.ahead & edge.ahead, 0);
                    Corner { ahead: end.ahead | edge.ahead, ..end }
                });
                let corners = [tetrahedron.corners[i], tetrahedron.corners[j]];
                assert!(ends == corners || ends == [corners[1], corners[0]], "{edge:?} {corners:?}");
            }
        }
        let mut steps: Vec<_> = ENDS.iter().map(|[a, b]| (place(*b) - place(*a)).map(|x| x as i32)).collect();
        steps.sort_by_key(|step| (step.x, step.y, step.z));
        steps.dedup();
        // Along an axis there is one edge from a corner and one from a middle.
        assert_eq!(steps.len(), 11);
    }

    #[test]
    fn words_ahead_are_the_bits_ahead() {
        let blocks = [1, 2, 3, 4, 5, 6, 7, 8_u64].map(|i| i.wrapping_mul(0x9e37_79b9_7f4a_7c15));
        let seen = seen_ahead(blocks);
        for (ahead, bit) in (0..8).flat_map(|ahead| (0..64).map(move |bit| (ahead, bit))) {
            let (block, there) = cube_ahead(bit, ahead);
            assert_eq!(seen[ahead] >> bit & 1, blocks[block] >> there & 1, "{ahead} {bit}");
        }
    }
}
