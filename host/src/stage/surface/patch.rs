//! The blocks cut: how many vertices and faces each has, the vertices, and the faces.
//!
//! A tetrahedron has two opposite edges along axes, one between corners and one between middles of cubes,
//! and four shorter ones; all are alike and nearly regular. Where its corners differ it is cut in a triangle
//! or a quadrilateral. Each edge and each tetrahedron belongs to one cube, and so to one block; its vertices
//! are numbered by direction of the edge, and then by cube.

use nalgebra::Point3;

use super::{
    block::{Block, Grove, bits},
    lattice::{Corner, EDGES, ENDS, Edge, TETRAHEDRA, Tetrahedron, seen_ahead},
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

/// The edges of a block that the surface cuts.
#[derive(Debug)]
pub(super) struct Cut {
    /// The cubes of which the edge in each direction is cut.
    pub(super) edges: [u64; EDGES],
    /// The number of the first vertex in each direction, from the block's first.
    first: [u16; EDGES],
    /// The number of the block's first vertex.
    pub(super) first_vertex: u32,
    pub(super) vertices: u32,
    pub(super) faces: u32,
    /// The block and those ahead of it, see [`Blocks`].
    pub(super) ahead: [Option<Place>; 8],
}

/// A block and the seven ahead of it, where there are any. What is missing is further from the surface than
/// an edge is long, so that an edge that leads there is not cut.
pub(super) type Blocks<'a> = [Option<(&'a Grove, &'a Block)>; 8];

/// The points of a block that are inside, as its cubes see them: by kind, then by cube ahead.
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

/// What of a block is cut; its first vertex is yet to be numbered.
pub(super) struct Count<'a> {
    pub(super) blocks: &'a Blocks<'a>,
    pub(super) ahead: [Option<Place>; 8],
}

impl Work for Count<'_> {
    type Output = Cut;

    #[inline(always)]
    fn run<L: Floats>(self) -> Cut {
        let inside = inside(self.blocks);
        let (mut edges, mut first, mut vertices) = ([0; EDGES], [0; EDGES], 0);
        for (direction, [a, b]) in ENDS.iter().enumerate() {
            edges[direction] = inside[a.kind][a.ahead] ^ inside[b.kind][b.ahead];
            first[direction] = vertices as u16;
            vertices += edges[direction].count_ones();
        }
        let mut faces = 0;
        if vertices > 0 {
            for tetrahedron in &TETRAHEDRA {
                let [triangles, quadrilaterals] = cut(tetrahedron, &inside);
                faces += triangles.count_ones() + 2 * quadrilaterals.count_ones();
            }
        }
        Cut { edges, first, first_vertex: 0, vertices, faces, ahead: self.ahead }
    }
}

impl Cut {
    /// The edges in a direction that are cut, and the number of the first one's vertex.
    pub(super) fn numbered(&self, direction: usize) -> (u64, u32) {
        (self.edges[direction], self.first_vertex + u32::from(self.first[direction]))
    }
}

/// Puts a block's faces into `faces`; `numbers` are those of the vertices that it sees.
pub(super) struct PutFaces<'a> {
    pub(super) blocks: &'a Blocks<'a>,
    pub(super) numbers: &'a Numbers,
    pub(super) vertices: &'a [Point3<f64>],
    pub(super) faces: &'a mut [[u32; 3]],
}

impl Work for PutFaces<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Floats>(self) {
        let inside = inside(self.blocks);
        let mut faces = self.faces.iter_mut();
        let mut put = |face| *faces.next().expect("a place for each face") = face;
        for (tetrahedron, rings) in TETRAHEDRA.iter().zip(&RINGS) {
            let [a, b, c, d] = corners(tetrahedron, &inside);
            let ring = |bit: usize| {
                let set = (a >> bit & 1) | (b >> bit & 1) << 1 | (c >> bit & 1) << 2 | (d >> bit & 1) << 3;
                let vertex = |edge: u16| self.numbers.at(PLACES[bit] + usize::from(edge));
                let [p, q, r, s] = rings[set as usize];
                [vertex(p), vertex(q), vertex(r), vertex(s)]
            };
            let [triangles, quadrilaterals] = cut(tetrahedron, &inside);
            for bit in bits(triangles) {
                let [p, q, r, _] = ring(bit);
                put([p, q, r]);
            }
            for bit in bits(quadrilaterals) {
                let [p, q, r, s] = from_shorter_diagonal(ring(bit), self.vertices);
                put([p, q, r]);
                put([p, r, s]);
            }
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

/// The cubes of which a tetrahedron is cut in a triangle, and those of which in a quadrilateral.
#[inline(always)]
fn cut(tetrahedron: &Tetrahedron, inside: &[[u64; 8]; 2]) -> [u64; 2] {
    let [a, b, c, d] = corners(tetrahedron, inside);
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
            let Edge { direction, ahead } = tetrahedron.edges[FEWER_FIRST[set][from]][FEWER_FIRST[set][to]];
            rings[i / 16][set][corner] = Numbers::offset(direction, ahead) as u16;
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
    if apart(p, r) <= apart(q, s) { [p, q, r, s] } else { [q, r, s, p] }
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
