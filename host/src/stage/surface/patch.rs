//! The blocks cut: how many vertices and faces each has, the vertices, and the faces.
//!
//! A tetrahedron has two opposite edges along axes, one between corners and one between middles of cubes,
//! and four shorter ones; all are alike and nearly regular. Where its corners differ it is cut in a triangle
//! or a quadrilateral. Each edge and each tetrahedron belongs to one cube, and so to one block; its vertices
//! are numbered by direction of the edge, and then by cube.

use nalgebra::{Point3, Vector3};

use super::{
    block::{Block, Grove, bits},
    lattice::{Corner, EDGES, ENDS, Edge, TETRAHEDRA, Tetrahedron, seen_ahead},
    near::{Numbers, PLACES, Points, Seen, block_of},
    region::Solid,
};

/// A vertex is this close to the surface, in cubes: a hundredth of what a contour is wrong by.
const EXACT: f32 = 1e-4;

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
    let mut inside = [[0_u64.wrapping_sub(own.inside[1] >> 63); 8]; 2];
    for (ahead, block) in blocks.iter().enumerate() {
        if let Some((_, block)) = block {
            (inside[0][ahead], inside[1][ahead]) = (block.inside[0], block.inside[1]);
        }
    }
    [seen_ahead(inside[0]), seen_ahead(inside[1])]
}

impl Cut {
    /// What of a block is cut; its first vertex is yet to be numbered.
    pub(super) fn of(blocks: &Blocks, ahead: [Option<Place>; 8]) -> Self {
        let inside = inside(blocks);
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
        Self { edges, first, first_vertex: 0, vertices, faces, ahead }
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
        let own = blocks[0].expect("a block").1;
        let mut vertices = vertices.iter_mut();
        for (&[first, second], &edges) in ENDS.iter().zip(&self.edges) {
            let ends = [first, second].map(Points::offset);
            for bit in bits(edges) {
                let ends = if own.inside[first.kind] >> bit & 1 == 1 { ends } else { [ends[1], ends[0]] };
                let [start, end] = ends.map(|end| points.at(PLACES[bit] + end));
                let crossing = Crossing { solid, blocks, points, start, end };
                *vertices.next().expect("a place for each vertex") = crossing.place();
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
            let [a, b, c, d] = corners(tetrahedron, &inside);
            let ring = |bit: usize| {
                let set = (a >> bit & 1) | (b >> bit & 1) << 1 | (c >> bit & 1) << 2 | (d >> bit & 1) << 3;
                let vertex = |edge: u16| numbers.at(PLACES[bit] + usize::from(edge));
                let [p, q, r, s] = rings[set as usize];
                [vertex(p), vertex(q), vertex(r), vertex(s)]
            };
            let [triangles, quadrilaterals] = cut(tetrahedron, &inside);
            for bit in bits(triangles) {
                let [p, q, r, _] = ring(bit);
                put([p, q, r]);
            }
            for bit in bits(quadrilaterals) {
                split(ring(bit), vertices).into_iter().for_each(&mut put);
            }
        }
    }
}

/// Of each of a tetrahedron's corners, the cubes whose corner it is that are inside.
fn corners(tetrahedron: &Tetrahedron, inside: &[[u64; 8]; 2]) -> [u64; 4] {
    let [a, b, c, d] = &tetrahedron.corners;
    let of = |corner: &Corner| inside[corner.kind][corner.ahead];
    [of(a), of(b), of(c), of(d)]
}

/// The cubes of which a tetrahedron is cut in a triangle, and those of which in a quadrilateral.
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

/// A quadrilateral split at its shorter diagonal.
fn split([p, q, r, s]: [u32; 4], vertices: &[Point3<f64>]) -> [[u32; 3]; 2] {
    let apart = |i: u32, j: u32| (vertices[i as usize] - vertices[j as usize]).norm_squared();
    if apart(p, r) <= apart(q, s) { [[p, q, r], [p, r, s]] } else { [[p, q, s], [q, r, s]] }
}

/// An edge from a point inside to one outside.
struct Crossing<'a> {
    solid: &'a Solid<'a>,
    blocks: &'a Blocks<'a>,
    points: &'a Points,
    start: Seen,
    end: Seen,
}

impl Crossing<'_> {
    /// Where the edge first leaves the solid.
    ///
    /// It leaves the cone that decides at its start; where it does, another may contain it.
    #[inline(always)]
    fn place(&self) -> Point3<f64> {
        let from = self.points.corner + self.start.position;
        let step = self.end.position - self.start.position;
        let share = self.solid.distances[self.start.cone as usize].exit(&from, &step);
        let Some(mut share) = share else { return from + step * END };
        let leaf = self.leaf_of(&step, share);
        if !self.is_alone(self.start.cone, leaf, step.norm_squared(), share) {
            share = self.follow(leaf, share);
        }
        from + step * share.clamp(END, 1.0 - END)
    }

    /// From the share of the edge at which it leaves the cone that decides at its start to that at which it leaves the
    /// solid: of what contains it there it is followed to the end, until nothing does.
    #[inline(never)]
    fn follow(&self, mut leaf: u32, mut share: f64) -> f64 {
        let from = self.points.corner + self.start.position;
        let step = self.end.position - self.start.position;
        for _ in 0..MAX_STEPS {
            let p = from + step * share;
            let Some((grove, block)) = self.blocks[block_of(leaf)] else { break };
            let (distance, cone) = grove.nearest(self.solid, block, &p);
            if distance > -EXACT {
                break;
            }
            let Some(exit) = self.solid.distances[cone as usize].exit(&from, &step) else { break };
            share = exit;
            leaf = self.leaf_of(&step, share);
            if self.is_alone(cone, leaf, step.norm_squared(), share) {
                break;
            }
        }
        share
    }

    /// The leaf of a place at a share of the edge.
    #[inline(always)]
    fn leaf_of(&self, step: &Vector3<f64>, share: f64) -> u32 {
        if self.start.leaf == self.end.leaf {
            return self.start.leaf;
        }
        self.points.leaf_of(&(self.start.position + step * share))
    }

    /// Whether no other cone than `cone` contains the place in `leaf` at a share of the edge, the square of whose length
    /// is `square`: as an end in that leaf knows of which it decides, and from which all others are further.
    #[inline(always)]
    fn is_alone(&self, cone: u32, leaf: u32, square: f64, share: f64) -> bool {
        [(&self.start, share), (&self.end, 1.0 - share)].into_iter().any(|(end, share)| {
            let others = f64::from(end.others) * self.solid.lattice.cube;
            end.leaf == leaf && end.cone == cone && others > 0.0 && share * share * square < others * others
        })
    }
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
