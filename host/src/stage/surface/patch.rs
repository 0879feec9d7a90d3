//! The blocks cut: how many vertices and faces each has, the vertices, and the faces.
//!
//! A tetrahedron has two opposite edges along axes, one between corners and one between middles of cubes,
//! and four shorter ones; all are alike and nearly regular. Where its corners differ it is cut in a triangle
//! or a quadrilateral. Each edge and each tetrahedron belongs to one cube, and so to one block; its vertices
//! are numbered by direction of the edge, and then by cube.

use nalgebra::Point3;

use super::{
    block::{Block, Grove, bits},
    lattice::{Corner, EDGES, ENDS, TETRAHEDRA, Tetrahedron, seen_ahead},
    near::{Numbers, PLACES},
};
use crate::lanes::{Floats, Work};

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

/// Where a block is: its grove, and its place there.
pub(super) type Place = (u32, u32);

/// The edges of a block in one direction that the surface cuts.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Edges {
    /// The cubes of which it is cut.
    pub(super) cubes: u64,
    /// The number of the first one's vertex.
    first: u32,
}

impl Edges {
    /// The number of the vertex of a cube's edge, which is cut; any number of what is no cube.
    #[inline(always)]
    pub(super) fn number(&self, bit: usize) -> u32 {
        self.first + (self.cubes & ((1 << (bit % 64)) - 1)).count_ones()
    }
}

/// What of a block the surface cuts.
#[derive(Debug)]
pub(super) struct Cut {
    /// By direction.
    pub(super) edges: [Edges; EDGES],
    pub(super) vertices: u32,
    pub(super) faces: u32,
    /// The points that are inside, as the block's cubes see them: by kind, then by cube ahead.
    inside: [[u64; 8]; 2],
    /// The block and those ahead of it, see [`Blocks`].
    pub(super) ahead: [Option<Place>; 8],
}

impl Cut {
    /// Numbers the vertices, of which the first is now 0.
    pub(super) fn number_from(&mut self, first: u32) {
        self.edges.iter_mut().for_each(|edges| edges.first += first);
    }
}

/// A block and the seven ahead of it, where there are any. What is missing is further from the surface than
/// an edge is long, so that an edge that leads there is not cut.
pub(super) type Blocks<'a> = [Option<(&'a Grove, &'a Block)>; 8];

/// See [`Cut::inside`].
#[inline(always)]
fn inside(blocks: &Blocks) -> [[u64; 8]; 2] {
    let own = blocks[0].expect("a block").1;
    // The middle of the last cube has an edge to each block ahead, which is not cut if that is missing.
    let mut inside = [[0_u64.wrapping_sub(own.inside[1] >> 63); 8]; 2];
    for (ahead, block) in blocks.iter().enumerate() {
        if let Some((_, block)) = block {
            (inside[0][ahead], inside[1][ahead]) = (block.inside[0], block.inside[1]);
        }
    }
    [seen_ahead(inside[0]), seen_ahead(inside[1])]
}

/// What of a block is cut; its first vertex is number 0.
pub(super) struct Count<'a> {
    pub(super) blocks: &'a Blocks<'a>,
    pub(super) ahead: [Option<Place>; 8],
}

impl Work for Count<'_> {
    type Output = Cut;

    #[inline(always)]
    fn run<L: Floats>(self) -> Cut {
        let inside = inside(self.blocks);
        let (mut edges, mut vertices) = ([Edges::default(); EDGES], 0);
        for (edges, [a, b]) in edges.iter_mut().zip(&ENDS) {
            *edges = Edges { cubes: inside[a.kind][a.ahead] ^ inside[b.kind][b.ahead], first: vertices };
            vertices += edges.cubes.count_ones();
        }
        let mut faces = 0;
        if vertices > 0 {
            for tetrahedron in &TETRAHEDRA {
                let [triangles, quadrilaterals] = cut(corners(tetrahedron, &inside));
                faces += triangles.count_ones() + 2 * quadrilaterals.count_ones();
            }
        }
        Cut { edges, vertices, faces, inside, ahead: self.ahead }
    }
}

/// Room to make faces in.
#[derive(Debug)]
pub(super) struct Workshop {
    numbers: Numbers,
    /// The corners of quadrilaterals.
    quadrilaterals: [[u32; 4]; 64 * TETRAHEDRA.len()],
}

impl Default for Workshop {
    fn default() -> Self {
        Self { numbers: Numbers::default(), quadrilaterals: [[0; 4]; 64 * TETRAHEDRA.len()] }
    }
}

/// Puts a block's faces into `faces`: triangles, then halves of quadrilaterals.
pub(super) struct PutFaces<'a> {
    /// The block and those ahead of it.
    pub(super) cuts: &'a [Option<&'a Cut>; 8],
    pub(super) vertices: &'a [Point3<f64>],
    pub(super) room: &'a mut Workshop,
    pub(super) faces: &'a mut [[u32; 3]],
}

impl Work for PutFaces<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Floats>(self) {
        let Workshop { numbers, quadrilaterals } = self.room;
        numbers.fill(self.cuts);
        let inside = &self.cuts[0].expect("a block").inside;
        let (mut triangle, mut quadrilateral) = (0, 0);
        for (tetrahedron, rings) in TETRAHEDRA.iter().zip(&RINGS) {
            let corners = corners(tetrahedron, inside);
            let [triangles, quads] = cut(corners);
            for bit in bits(triangles | quads) {
                let [a, b, c, d] = corners.map(|corner| corner >> bit & 1);
                let ring = rings[(a | b << 1 | c << 2 | d << 3) as usize]
                    .map(|edge| numbers.at(PLACES[bit] + usize::from(edge)));
                // Without a branch, as nobody could foretell it: what does not count is written over.
                let [p, q, r, _] = ring;
                self.faces[triangle] = [p, q, r];
                quadrilaterals[quadrilateral] = ring;
                let is_triangle = (triangles >> bit & 1) as usize;
                triangle += is_triangle;
                quadrilateral += 1 - is_triangle;
            }
        }
        let halves = self.faces[triangle..].as_chunks_mut().0;
        for (halves, ring) in halves.iter_mut().zip(&quadrilaterals[..quadrilateral]) {
            let [p, q, r, s] = from_shorter_diagonal(*ring, self.vertices);
            *halves = [[p, q, r], [p, r, s]];
        }
    }
}

/// Of each of a tetrahedron's corners, the cubes whose corner it is that are inside.
#[inline(always)]
fn corners(tetrahedron: &Tetrahedron, inside: &[[u64; 8]; 2]) -> [u64; 4] {
    let [a, b, c, d] = &tetrahedron.corners;
    let of = |corner: &Corner| inside[corner.kind][corner.ahead];
    [of(a), of(b), of(c), of(d)]
}

/// The cubes of which a tetrahedron with these [`corners`] is cut in a triangle, and those of which in a quadrilateral.
#[inline(always)]
fn cut([a, b, c, d]: [u64; 4]) -> [u64; 2] {
    let triangles = a ^ b ^ c ^ d;
    [triangles, (a | b | c | d) & !(a & b & c & d) & !triangles]
}

/// The edges of a tetrahedron that the surface cuts, in the order of the face's corners: of a triangle the first
/// three. See [`Numbers::offset`].
type Ring = [u16; 4];

/// For each tetrahedron and each set of its corners inside.
const RINGS: [[Ring; 16]; TETRAHEDRA.len()] = {
    let mut rings = [[[0; 4]; 16]; TETRAHEDRA.len()];
    let mut i = 0;
    while i < TETRAHEDRA.len() * 16 {
        let (tetrahedron, set) = (&TETRAHEDRA[i / 16], i % 16);
        let pairs = match set.count_ones() {
            1 => [[0, 1], [0, 2], [0, 3], [0, 3]],
            2 => [[0, 2], [0, 3], [1, 3], [1, 2]],
            _ => [[0, 1], [0, 3], [0, 2], [0, 2]],
        };
        let mut corner = 0;
        while corner < 4 {
            let [from, to] = pairs[corner];
            let edge = tetrahedron.edges[FEWER_FIRST[set][from]][FEWER_FIRST[set][to]];
            rings[i / 16][set][corner] = Numbers::offset(edge) as u16;
            corner += 1;
        }
        i += 1;
    }
    rings
};

/// The corners of a quadrilateral, from one at which its shorter diagonal ends.
#[inline(always)]
fn from_shorter_diagonal([p, q, r, s]: [u32; 4], vertices: &[Point3<f64>]) -> [u32; 4] {
    let apart = |i: u32, j: u32| (vertices[i as usize] - vertices[j as usize]).norm_squared();
    let turn = usize::from(apart(p, r) > apart(q, s));
    let twice = [p, q, r, s, p];
    std::array::from_fn(|i| twice[turn + i])
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
