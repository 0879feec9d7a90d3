//! The blocks cut: how many vertices and faces each has, the vertices, and the faces.
//!
//! A tetrahedron has two opposite edges along axes, one between corners and one between middles of cubes,
//! and four shorter ones; all are alike and nearly regular. Where its corners differ it is cut in a triangle
//! or a quadrilateral. Each edge and each tetrahedron belongs to one cube, and so to one block; its vertices
//! are numbered by direction of the edge, and then by cube.

use nalgebra::Point3;

use super::{
    block::{Block, Grove, bits},
    lattice::{Corner, EDGES, ENDS, Edge, TETRAHEDRA, seen_ahead},
    near::{AHEAD, Numbers, PLACES, Points, Seen, block_of},
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

/// Where a block is: its grove, and its place there.
pub(super) type Place = (u32, u32);

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
    /// The block and those ahead of it, see [`Blocks`].
    pub(super) ahead: [Option<Place>; 8],
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
    pub(super) fn of(blocks: &Blocks, ahead: [Option<Place>; 8]) -> Self {
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
        Self { edges, first, first_vertex: 0, vertices, faces: faces.sum(), ahead }
    }

    /// The edges in a direction that are cut, and the number of the first one's vertex.
    pub(super) fn numbered(&self, direction: usize) -> (u64, u32) {
        (self.edges[direction], self.first_vertex + u32::from(self.first[direction]))
    }

    /// Puts the block's vertices into `vertices`, mm; `points` are those that it sees.
    pub(super) fn put_vertices(
        &self,
        solid: &Solid,
        blocks: &Blocks,
        points: &Points,
        vertices: &mut [Point3<f64>],
    ) {
        let inside = inside(blocks);
        let mut vertices = vertices.iter_mut();
        for (ends, &edges) in ENDS.iter().zip(&self.edges) {
            let first_inside = inside[ends[0].kind][ends[0].ahead];
            for bit in bits(edges) {
                let [first, second] =
                    ends.map(|Corner { kind, ahead }| points.at(kind, PLACES[bit] + AHEAD[ahead]));
                let [from, to] =
                    if first_inside >> bit & 1 == 1 { [&first, &second] } else { [&second, &first] };
                *vertices.next().expect("a place for each vertex") = crossing(solid, blocks, from, to);
            }
        }
    }

    /// Puts the block's faces into `faces`; `numbers` are those of the vertices that it sees.
    pub(super) fn put_faces(
        blocks: &Blocks,
        numbers: &Numbers,
        vertices: &[Point3<f64>],
        faces: &mut [[u32; 3]],
    ) {
        let inside = inside(blocks);
        let mut faces = faces.iter_mut();
        let mut put = |face| *faces.next().expect("a place for each face") = face;
        for (tetrahedron, rings) in TETRAHEDRA.iter().zip(&RINGS) {
            let [a, b, c, d] = tetrahedron.corners.map(|corner| inside[corner.kind][corner.ahead]);
            for bit in bits((a | b | c | d) & !(a & b & c & d)) {
                let set = (a >> bit & 1) | (b >> bit & 1) << 1 | (c >> bit & 1) << 2 | (d >> bit & 1) << 3;
                let ring = &rings[set as usize];
                let vertex = |i: usize| numbers.at(PLACES[bit] + usize::from(ring.edges[i]));
                let [p, q, r] = [vertex(0), vertex(1), vertex(2)];
                if ring.four {
                    split([p, q, r, vertex(3)], vertices).into_iter().for_each(&mut put);
                } else {
                    put([p, q, r]);
                }
            }
        }
    }
}

/// The edges of a tetrahedron that the surface cuts, in the order of the face's corners.
#[derive(Clone, Copy)]
struct Ring {
    /// See [`Numbers::offset`].
    edges: [u16; 4],
    /// Whether they are four, or three.
    four: bool,
}

/// For each tetrahedron and each set of its corners inside.
const RINGS: [[Ring; 16]; TETRAHEDRA.len()] = {
    let mut rings = [[Ring { edges: [0; 4], four: false }; 16]; TETRAHEDRA.len()];
    let mut i = 0;
    while i < TETRAHEDRA.len() * 16 {
        let (tetrahedron, set) = (&TETRAHEDRA[i / 16], i % 16);
        let pairs = match set.count_ones() {
            1 => [[0, 1], [0, 2], [0, 3], [0, 3]],
            2 => [[0, 2], [0, 3], [1, 3], [1, 2]],
            _ => [[0, 1], [0, 3], [0, 2], [0, 2]],
        };
        let ring = &mut rings[i / 16][set];
        ring.four = set.count_ones() == 2;
        let mut corner = 0;
        while corner < 4 {
            let [from, to] = pairs[corner];
            let Edge { direction, ahead } = tetrahedron.edges[FEWER_FIRST[set][from]][FEWER_FIRST[set][to]];
            ring.edges[corner] = Numbers::offset(direction, ahead) as u16;
            corner += 1;
        }
        i += 1;
    }
    rings
};

/// A quadrilateral split at its shorter diagonal.
fn split([p, q, r, s]: [u32; 4], vertices: &[Point3<f64>]) -> [[u32; 3]; 2] {
    let apart = |i: u32, j: u32| (vertices[i as usize] - vertices[j as usize]).norm_squared();
    if apart(p, r) <= apart(q, s) { [[p, q, r], [p, r, s]] } else { [[p, q, s], [q, r, s]] }
}

impl Seen {
    /// Whether `cone` decides the distance of this point, and no other cone of its leaf contains any place whose
    /// distance from the point has this square, in cubes.
    fn is_alone(&self, cone: u32, square: f64) -> bool {
        let others = f64::from(self.others);
        self.cone == cone && others > 0.0 && square < others * others
    }
}

/// Where the edge from a point inside to one outside first leaves the solid.
///
/// It leaves the cone that decides at its start; where it does, another may contain it, of which it is
/// followed to its end, until none does. None can where an end of the edge knows that all others are further.
fn crossing(solid: &Solid, blocks: &Blocks, start: &Seen, end: &Seen) -> Point3<f64> {
    let [from, to] = [start.position, end.position];
    let mut cone = start.cone;
    let step = to - from;
    let square = step.norm_squared() / (solid.lattice.cube * solid.lattice.cube);
    let mut share = 0.0;
    for _ in 0..MAX_STEPS {
        let Some(exit) = solid.distances[cone as usize].exit(&from, &step) else { break };
        share = exit;
        let p = from + step * share;
        let leaf = blocks[0].expect("a block").1.leaf_of(solid.lattice, &p);
        let is_alone =
            |end: &Seen, share: f64| end.leaf == leaf && end.is_alone(cone, share * share * square);
        if is_alone(start, share) || is_alone(end, 1.0 - share) {
            break;
        }
        let (ahead, octant) = block_of(leaf);
        let Some((grove, block)) = blocks[ahead] else { break };
        let exact = EXACT * solid.lattice.cube;
        let Some(deeper) = grove.deepest_but(cone, solid, (block, octant), (&p, exact)) else { break };
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
