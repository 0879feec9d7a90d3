//! What a block's cubes see: the block's own cubes and those ahead of it, five along each axis.

use nalgebra::{Point3, Vector3};

use super::{
    block::bits,
    lattice::{Corner, EDGES, Edge, LOWERED, Lattice, TETRAHEDRA},
    patch::{Blocks, Cut},
    region::Solid,
};

/// Cubes that a block sees.
const CUBES: usize = 5 * 5 * 5;

/// The way to the cube ahead, a bit an axis as in [`Corner`](super::lattice::Corner).
pub(super) const AHEAD: [usize; 8] = [0, 1, 5, 6, 25, 26, 30, 31];

/// The place of each cube of a block.
pub(super) const PLACES: [usize; 64] = {
    let mut places = [0; 64];
    let mut bit = 0;
    while bit < 64 {
        places[bit] = 25 * (bit >> 4) + 5 * (bit >> 2 & 3) + (bit & 3);
        bit += 1;
    }
    places
};

/// The cubes that are seen of each block ahead: the first ones on the axes on which it is ahead.
const SEEN: [u64; 8] = {
    let mut seen = [u64::MAX; 8];
    let mut ahead = 0;
    while ahead < 8 {
        let axes = [0xffff, 0x000f_000f_000f_000f, 0x1111_1111_1111_1111];
        let mut axis = 0;
        while axis < 3 {
            if ahead >> (2 - axis) & 1 == 1 {
                seen[ahead] &= axes[axis];
            }
            axis += 1;
        }
        ahead += 1;
    }
    seen
};

/// The blocks ahead, a bit each, of which the tetrahedra of a block have edges in each direction.
const NEEDED: [u8; EDGES] = {
    let mut needed = [0; EDGES];
    let mut i = 0;
    while i < TETRAHEDRA.len() * 16 * 8 {
        let (Edge { direction, ahead }, block) = (TETRAHEDRA[i >> 7].edges[i >> 5 & 3][i >> 3 & 3], i & 7);
        if i >> 5 & 3 != i >> 3 & 3 && ahead & block == block {
            needed[direction] |= 1 << block;
        }
        i += 1;
    }
    needed
};

/// The leaf in which each corner of a cube is, and each middle, of three along each axis.
const LEAVES: [u8; 2 * CUBES] = {
    let mut leaves = [0; 2 * CUBES];
    let mut i = 0;
    while i < leaves.len() {
        let place = i % CUBES;
        leaves[i] = (place / 25 / 2 * 9 + place / 5 % 5 / 2 * 3 + place % 5 / 2) as u8;
        i += 1;
    }
    leaves
};

/// A point of the lattice.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    /// Where it stands, from the block's corner, mm.
    pub(super) position: Vector3<f64>,
    /// The cone that decides its distance.
    pub(super) cone: u32,
    /// How far all others of its leaf are at least, cubes; less than nothing if not known.
    pub(super) others: f32,
    /// The leaf in which it is, as in [`block_of`].
    pub(super) leaf: u32,
}

/// The points that a block sees: corners of cubes, then middles.
#[derive(Debug)]
pub(super) struct Points {
    positions: [Vector3<f64>; 2 * CUBES],
    cones: [u32; 2 * CUBES],
    others: [f32; 2 * CUBES],
    /// Those that have been moved, a bit each.
    moved: [u64; (2 * CUBES).div_ceil(64)],
    /// The block's corner, mm.
    pub(super) corner: Point3<f64>,
    /// Edge of a cube, mm.
    cube: f64,
    /// Leaves a millimetre.
    leaves: f64,
}

impl Points {
    /// Room for the points of any block.
    pub(super) fn new(lattice: &Lattice) -> Self {
        let cube = lattice.cube;
        Self {
            positions: std::array::from_fn(|i| position(i, cube)),
            cones: [0; 2 * CUBES],
            others: [-1.0; 2 * CUBES],
            moved: [0; (2 * CUBES).div_ceil(64)],
            corner: Point3::origin(),
            cube,
            leaves: 0.5 / cube,
        }
    }

    /// Fills in the points of a block and those ahead of it; of where there is no block only where they stand.
    pub(super) fn fill(&mut self, solid: &Solid, blocks: &Blocks) {
        for (word, moved) in self.moved.iter_mut().enumerate() {
            for i in bits(std::mem::take(moved)).map(|bit| 64 * word + bit) {
                self.positions[i] = position(i, self.cube);
            }
        }
        self.corner = solid.lattice.position(blocks[0].expect("a block").1.corner);
        let rows = self.cones.as_chunks_mut::<5>().0.iter_mut().zip(self.others.as_chunks_mut::<5>().0);
        for (row, (cones, others)) in rows.enumerate() {
            let (kind, x, y) = (row / 25, row / 5 % 5, row % 5);
            let first = 64 * kind + 16 * (x & 3) + 4 * (y & 3);
            let ahead = x & 4 | y >> 1 & 2;
            if let Some((_, block)) = blocks[ahead] {
                cones[..4].copy_from_slice(&block.cones[first..first + 4]);
                others[..4].copy_from_slice(&block.others[first..first + 4]);
            }
            if let Some((_, block)) = blocks[ahead | 1] {
                (cones[4], others[4]) = (block.cones[first], block.others[first]);
            }
        }
        for (ahead, block) in blocks.iter().enumerate() {
            let Some((grove, block)) = block else { continue };
            for kind in 0..2 {
                for bit in bits(block.moved[kind] & SEEN[ahead]) {
                    let place = CUBES * kind + PLACES[bit] + 4 * AHEAD[ahead];
                    self.positions[place] = grove.moved(block, kind, bit) - self.corner;
                    self.moved[place / 64] |= 1 << (place % 64);
                }
            }
        }
    }

    /// Where the corners of cubes are, from the cubes' own places.
    pub(super) fn offset(Corner { kind, ahead }: Corner) -> usize {
        CUBES * kind + AHEAD[ahead]
    }

    #[inline(always)]
    pub(super) fn at(&self, place: usize) -> Seen {
        Seen {
            position: self.positions[place],
            cone: self.cones[place],
            others: self.others[place],
            leaf: LEAVES[place].into(),
        }
    }

    /// The leaf in which a place is that the block sees, as in [`block_of`].
    #[inline(always)]
    pub(super) fn leaf_of(&self, p: &Vector3<f64>) -> u32 {
        /// The last bits of numbers of this size are whole ones.
        const WHOLE: f64 = (3_u64 << 51) as f64;
        let along = |axis: usize| {
            let leaves = p[axis] * self.leaves + LOWERED / 2.0;
            ((leaves - 0.5 + WHOLE).to_bits() as u32 & 3).min(2)
        };
        9 * along(0) + 3 * along(1) + along(2)
    }
}

/// Where an unmoved point stands, from the block's corner, with cubes of `cube` mm.
fn position(i: usize, cube: f64) -> Vector3<f64> {
    let (kind, place) = (i / CUBES, i % CUBES);
    Vector3::from([place / 25, place / 5 % 5, place % 5]).map(|x| (x as f64 + 0.5 * kind as f64) * cube)
}

/// The block ahead in which such a leaf is.
pub(super) fn block_of(leaf: u32) -> usize {
    let [x, y, z] = [leaf / 9, leaf / 3 % 3, leaf % 3].map(|along| along as usize / 2);
    x << 2 | y << 1 | z
}

/// The numbers of the vertices that a block sees, by the direction of their edge and by cube.
#[derive(Debug)]
pub(super) struct Numbers([u32; EDGES * CUBES]);

impl Default for Numbers {
    fn default() -> Self {
        Self([0; EDGES * CUBES])
    }
}

impl Numbers {
    /// Where in a direction the numbers of a cube's edges are, from the cube's own place.
    pub(super) const fn offset(direction: usize, ahead: usize) -> usize {
        direction * CUBES + AHEAD[ahead]
    }

    /// Fills in the numbers of a block's vertices and of those ahead of it; what is on no edge that is cut stays
    /// what it is.
    pub(super) fn fill(&mut self, cuts: &[Option<&Cut>; 8]) {
        for (ahead, cut) in cuts.iter().enumerate() {
            let Some(cut) = cut else { continue };
            for (direction, numbers) in self.0.chunks_exact_mut(CUBES).enumerate() {
                let (edges, first) = cut.numbered(direction);
                if NEEDED[direction] >> ahead & 1 == 0 {
                    continue;
                }
                if ahead == 0 {
                    for (bit, number) in bits(edges).zip(first..) {
                        numbers[PLACES[bit]] = number;
                    }
                    continue;
                }
                for bit in bits(edges & SEEN[ahead]) {
                    let before = (edges & ((1 << bit) - 1)).count_ones();
                    numbers[PLACES[bit] + 4 * AHEAD[ahead]] = first + before;
                }
            }
        }
    }

    pub(super) fn at(&self, place: usize) -> u32 {
        self.0[place]
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
            assert_eq!(place, PLACES[there] + 4 * AHEAD[block]);
            assert_eq!(SEEN[block] >> there & 1, 1);
            assert_eq!(block_of(LEAVES[place].into()), block);
        }
        let seen: u32 = SEEN.iter().map(|cubes| cubes.count_ones()).sum();
        assert_eq!(seen as usize, CUBES);
    }
}
