//! What a block's cubes see: the block's own cubes and those ahead of it, five along each axis.

use super::{
    block::{bits, fours},
    lattice::{Corner, EDGES, Edge, SIDE, TETRAHEDRA, cube_of},
    patch::{Blocks, Cut},
    vectors::{Vectors, load},
};
use crate::lanes::{Floats, LANES};

/// Cubes that a block sees.
const CUBES: usize = 5 * 5 * 5;

/// The way to the cube ahead, a bit an axis as in [`Corner`](super::lattice::Corner).
pub(super) const AHEAD: [usize; 8] = [0, 1, 5, 6, 25, 26, 30, 31];

/// The place of each cube of a block, and one for what is none.
pub(super) const PLACES: [usize; 65] = {
    let mut places = [0; 65];
    let mut bit = 0;
    while bit < 64 {
        let [x, y, z] = cube_of(bit);
        places[bit] = 25 * x + 5 * y + z;
        bit += 1;
    }
    places
};

/// The cubes that are seen of each block ahead: the first ones on the axes on which it is ahead.
const SEEN: [u64; 8] = {
    let mut seen = [0; 8];
    let mut i = 0;
    while i < 8 * 64 {
        let (ahead, [x, y, z]) = (i / 64, cube_of(i % 64));
        if !(ahead & 4 != 0 && x > 0 || ahead & 2 != 0 && y > 0 || ahead & 1 != 0 && z > 0) {
            seen[ahead] |= 1 << (i % 64);
        }
        i += 1;
    }
    seen
};

/// The place of each cube that is seen of each block ahead, and one beyond all for what is none.
const SEEN_PLACES: [[u8; 65]; 8] = {
    let mut places = [[CUBES as u8; 65]; 8];
    let mut i = 0;
    while i < 8 * 64 {
        let (ahead, bit) = (i / 64, i % 64);
        if SEEN[ahead] >> bit & 1 == 1 {
            places[ahead][bit] = (PLACES[bit] + 4 * AHEAD[ahead]) as u8;
        }
        i += 1;
    }
    places
};

/// Of each block ahead, a bit each, the directions in which the tetrahedra of a block have edges there.
const NEEDED: [u64; 8] = {
    let mut needed = [0; 8];
    let mut i = 0;
    while i < TETRAHEDRA.len() * 16 * 8 {
        let (Edge { direction, ahead }, block) = (TETRAHEDRA[i >> 7].edges[i >> 5 & 3][i >> 3 & 3], i & 7);
        if i >> 5 & 3 != i >> 3 & 3 && ahead & block == block {
            needed[block] |= 1 << direction;
        }
        i += 1;
    }
    needed
};

/// The points that a block sees: corners of cubes, then middles.
#[derive(Debug)]
pub(super) struct Points {
    /// Where they stand on each axis, from the block's middle, in cubes; as many as a byte can count.
    along: [[f32; 256]; 3],
    /// Those that have been moved, a bit each.
    moved: [u64; 4],
}

impl Default for Points {
    fn default() -> Self {
        Self { along: UNMOVED, moved: [0; 4] }
    }
}

impl Points {
    /// Fills in the points of a block and those ahead of it; of where there is no block as if it had none moved.
    pub(super) fn fill(&mut self, blocks: &Blocks) {
        for word in 0..self.moved.len() {
            for i in bits(std::mem::take(&mut self.moved[word])).map(|bit| 64 * word + bit) {
                self.put(i, UNMOVED.each_ref().map(|along| along[i]));
            }
        }
        for (ahead, block) in blocks.iter().enumerate() {
            let Some((grove, block)) = block else { continue };
            for kind in 0..2 {
                for bit in bits(block.moved[kind] & SEEN[ahead]) {
                    let place = CUBES * kind + PLACES[bit] + 4 * AHEAD[ahead];
                    let moved = grove.moved(block, kind, bit);
                    let step = |axis: usize| if ahead >> (2 - axis) & 1 == 1 { SIDE as f32 } else { 0.0 };
                    self.put(place, [0, 1, 2].map(|axis| moved[axis] + step(axis)));
                    self.moved[place / 64] |= 1 << (place % 64);
                }
            }
        }
    }

    fn put(&mut self, place: usize, position: [f32; 3]) {
        for (along, x) in self.along.iter_mut().zip(position) {
            along[place] = x;
        }
    }

    /// Where the corners of cubes are, from the cubes' own places.
    pub(super) const fn offset(Corner { kind, ahead }: Corner) -> usize {
        CUBES * kind + AHEAD[ahead]
    }

    /// Where one of the ends of edges stand, from the block's middle, in cubes.
    #[inline(always)]
    pub(super) fn at<L: Floats>(&self, ends: &[[u8; 2]; LANES], end: usize) -> Vectors<L> {
        let mut positions = [[0.0; LANES]; 3];
        for (axis, along) in self.along.iter().enumerate() {
            for (lane, ends) in ends.iter().enumerate() {
                positions[axis][lane] = along[usize::from(ends[end])];
            }
        }
        load(&positions)
    }
}

/// Where points stand before any is moved.
const UNMOVED: [[f32; 256]; 3] = {
    let mut unmoved = [[0.0; 256]; 3];
    let mut i = 0;
    while i < 2 * CUBES {
        let (kind, place) = (i / CUBES, i % CUBES);
        let cube = [place / 25, place / 5 % 5, place % 5];
        let mut axis = 0;
        while axis < 3 {
            unmoved[axis][i] = cube[axis] as f32 + 0.5 * kind as f32 - 0.5 * SIDE as f32;
            axis += 1;
        }
        i += 1;
    }
    unmoved
};

/// The numbers of the vertices that a block sees, by the direction of their edge and by cube.
#[derive(Debug)]
pub(super) struct Numbers([[u32; CUBES + 1]; EDGES]);

impl Default for Numbers {
    fn default() -> Self {
        Self([[0; CUBES + 1]; EDGES])
    }
}

impl Numbers {
    /// Where in a direction the numbers of a cube's edges are, from the cube's own place.
    pub(super) const fn offset(Edge { direction, ahead }: Edge) -> usize {
        direction * (CUBES + 1) + AHEAD[ahead]
    }

    pub(super) fn at(&self, place: usize) -> u32 {
        self.0.as_flattened()[place]
    }

    /// Fills in the numbers of a block's vertices and of those ahead of it; what is on no edge that is cut stays what
    /// it is.
    #[inline(always)]
    pub(super) fn fill(&mut self, cuts: &[Option<&Cut>; 8]) {
        for (ahead, cut) in cuts.iter().enumerate() {
            let Some(cut) = cut else { continue };
            for direction in bits(NEEDED[ahead]) {
                let (edges, numbers) = (&cut.edges[direction], &mut self.0[direction]);
                for four in fours(edges.cubes & SEEN[ahead]) {
                    for bit in four {
                        numbers[usize::from(SEEN_PLACES[ahead][bit])] = edges.number(bit);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stage::surface::lattice::tests::cube_ahead;

    #[test]
    fn a_cube_ahead_has_one_place_and_is_seen() {
        for (ahead, bit) in (0..8).flat_map(|ahead| (0..64).map(move |bit| (ahead, bit))) {
            let (block, there) = cube_ahead(bit, ahead);
            let place = PLACES[bit] + AHEAD[ahead];
            assert_eq!(place, usize::from(SEEN_PLACES[block][there]));
            assert_eq!(usize::from(SEEN_PLACES[block][64]), CUBES, "what is none has its own");
            assert_eq!(SEEN[block] >> there & 1, 1);
        }
        let seen: u32 = SEEN.iter().map(|cubes| cubes.count_ones()).sum();
        assert_eq!(seen as usize, CUBES);
    }
}
