//! The blocks cut: how many vertices and faces each has, the vertices, and the faces.
//!
//! A tetrahedron has two opposite edges along axes, one between corners and one between middles of cubes,
//! and four shorter ones; all are alike and nearly regular. Where its corners differ it is cut in a triangle
//! or a quadrilateral. Each edge and each tetrahedron belongs to one cube, and so to one block; its vertices
//! are numbered by direction of the edge, and then by cube.

use nalgebra::Point3;

use super::{
    block::{Block, Grove, bits},
    lattice::{EDGES, ENDS, Edge, TETRAHEDRA, cube_ahead, seen_ahead},
    region::Solid,
};

/// A vertex is this close to the surface, in cubes.
const EXACT: f64 = 5e-7;

/// Steps after which the search for a vertex ends; it needs one or two where the surface is smooth.
const MAX_STEPS: usize = 40;

/// A vertex stays this share of its edge off the ends even where no point could be moved clear of the
/// surface, as on a ball smaller than the way that they are moved.
const END: f64 = 0.02;

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

/// The edges of a block that the surface cuts.
#[derive(Debug)]
pub(super) struct Cut {
    /// The cubes of which the edge in each direction is cut.
    edges: [u64; EDGES],
    /// The number of the first vertex in each direction, from the block's first.
    first: [u16; EDGES],
    /// The number of the block's first vertex.
    pub(super) first_vertex: u32,
    pub(super) vertices: u32,
    pub(super) faces: u32,
}

/// A block and the seven ahead of it, where there are any. What is missing is further from the surface than
/// an edge is long, so that an edge that leads there is not cut.
pub(super) type Blocks<'a> = [Option<(&'a Grove, &'a Block)>; 8];

/// The points of a block that are inside, as its cubes see them: by kind, then by cube ahead.
fn inside(blocks: &Blocks) -> [[u64; 8]; 2] {
    let own = blocks[0].expect("a block").1;
    // The middle of the last cube has an edge to each block ahead, which is not cut if that is missing.
    let missing = 0_u64.wrapping_sub(own.inside[1] >> 63);
    [0, 1].map(|kind| seen_ahead(blocks.map(|block| block.map_or(missing, |(_, block)| block.inside[kind]))))
}

impl Cut {
    /// What of a block is cut; its first vertex is yet to be numbered.
    pub(super) fn of(blocks: &Blocks) -> Self {
        let inside = inside(blocks);
        let edges = ENDS.map(|[a, b]| inside[a.kind][a.ahead] ^ inside[b.kind][b.ahead]);
        let (mut first, mut vertices) = ([0; EDGES], 0);
        for (first, edge) in first.iter_mut().zip(edges) {
            *first = vertices as u16;
            vertices += edge.count_ones();
        }
        let faces = TETRAHEDRA.iter().map(|tetrahedron| {
            let [a, b, c, d] = tetrahedron.corners.map(|corner| inside[corner.kind][corner.ahead]);
            let triangles = a ^ b ^ c ^ d;
            let cut = (a | b | c | d) & !(a & b & c & d);
            triangles.count_ones() + 2 * (cut & !triangles).count_ones()
        });
        Self { edges, first, first_vertex: 0, vertices, faces: faces.sum() }
    }

    /// The number of the vertex on an edge that is cut.
    fn vertex(&self, direction: usize, bit: usize) -> u32 {
        let before = self.edges[direction] & ((1 << bit) - 1);
        self.first_vertex + u32::from(self.first[direction]) + before.count_ones()
    }

    /// Puts the block's vertices into `vertices`, mm.
    pub(super) fn put_vertices(&self, solid: &Solid, blocks: &Blocks, vertices: &mut [Point3<f64>]) {
        let mut vertices = vertices.iter_mut();
        for (direction, &edges) in self.edges.iter().enumerate() {
            for bit in bits(edges) {
                let ends = ENDS[direction].map(|corner| {
                    let (ahead, bit) = cube_ahead(bit, corner.ahead);
                    let (grove, block) = blocks[ahead].expect("no edge is cut to where there is no block");
                    (block.inside[corner.kind] >> bit & 1, grove, block, corner.kind, bit)
                });
                let [from, to] = if ends[0].0 == 1 { ends } else { [ends[1], ends[0]] };
                let [start, end] =
                    [from, to].map(|(_, grove, block, kind, bit)| grove.position(solid, block, kind, bit));
                let cone = from.2.cone(from.3, from.4);
                *vertices.next().expect("a place for each vertex") =
                    crossing(solid, blocks, [start, end], cone);
            }
        }
    }

    /// Puts the block's faces into `faces`; `cuts` are those of `blocks`.
    pub(super) fn put_faces(
        blocks: &Blocks,
        cuts: &[Option<&Cut>; 8],
        vertices: &[Point3<f64>],
        faces: &mut [[u32; 3]],
    ) {
        let inside = inside(blocks);
        let mut faces = faces.iter_mut();
        let mut put = |face| *faces.next().expect("a place for each face") = face;
        for tetrahedron in &TETRAHEDRA {
            let corners = tetrahedron.corners.map(|corner| inside[corner.kind][corner.ahead]);
            let [a, b, c, d] = corners;
            for bit in bits((a | b | c | d) & !(a & b & c & d)) {
                let set = (0..4).fold(0, |set, i| set | ((corners[i] >> bit & 1) as usize) << i);
                let order = FEWER_FIRST[set];
                let vertex = |i: usize, j: usize| {
                    let Edge { direction, ahead } = tetrahedron.edges[order[i]][order[j]];
                    let (ahead, bit) = cube_ahead(bit, ahead);
                    cuts[ahead].expect("no edge is cut of where there is no block").vertex(direction, bit)
                };
                match set.count_ones() {
                    1 => put([vertex(0, 1), vertex(0, 2), vertex(0, 3)]),
                    2 => {
                        let ring = [vertex(0, 2), vertex(0, 3), vertex(1, 3), vertex(1, 2)];
                        split(ring, vertices).into_iter().for_each(&mut put);
                    }
                    _ => put([vertex(0, 1), vertex(0, 3), vertex(0, 2)]),
                }
            }
        }
    }
}

/// A quadrilateral split at its shorter diagonal.
fn split([p, q, r, s]: [u32; 4], vertices: &[Point3<f64>]) -> [[u32; 3]; 2] {
    let apart = |i: u32, j: u32| (vertices[i as usize] - vertices[j as usize]).norm_squared();
    if apart(p, r) <= apart(q, s) { [[p, q, r], [p, r, s]] } else { [[p, q, s], [q, r, s]] }
}

/// Where the edge from a point inside to one outside first leaves the solid.
///
/// It leaves the cone that decides at its start; where it does, another may contain it, of which it is
/// followed to its end, until none does.
fn crossing(solid: &Solid, blocks: &Blocks, [from, to]: [Point3<f64>; 2], mut cone: u32) -> Point3<f64> {
    let step = to - from;
    let mut share = 0.0;
    for _ in 0..MAX_STEPS {
        let Some(exit) = solid.distances[cone as usize].exit(&from, &step) else { break };
        share = exit;
        let p = from + step * share;
        let (ahead, leaf) = blocks[0].expect("a block").1.leaf_of(solid.lattice, &p);
        let Some((grove, block)) = blocks.get(ahead).copied().flatten() else { break };
        let exact = EXACT * solid.lattice.cube;
        let Some(deeper) = grove.deepest_but(cone, solid, (block, leaf), (&p, exact)) else { break };
        cone = deeper;
    }
    from + step * share.clamp(END, 1.0 - END)
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
