//! What a block's cubes see in one array: the block's own cubes and those ahead of it, five along each axis.

use nalgebra::Point3;

use super::{
    block::bits,
    lattice::EDGES,
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

/// The leaf in which each cube is, of three along each axis.
const LEAVES: [u8; CUBES] = {
    let mut leaves = [0; CUBES];
    let mut place = 0;
    while place < CUBES {
        leaves[place] = (place / 25 / 2 * 9 + place / 5 % 5 / 2 * 3 + place % 5 / 2) as u8;
        place += 1;
    }
    leaves
};

/// A point of the lattice.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    /// Where it stands, mm.
    pub(super) position: Point3<f64>,
    /// The cone that decides its distance.
    pub(super) cone: u32,
    /// How far all others of its leaf are at least, cubes; less than nothing if not known.
    pub(super) others: f32,
    /// See [`leaf_at`].
    pub(super) leaf: usize,
}

/// The points that a block sees: corners of cubes, then middles.
#[derive(Debug)]
pub(super) struct Points {
    positions: [[Point3<f64>; CUBES]; 2],
    cones: [[u32; CUBES]; 2],
    others: [[f32; CUBES]; 2],
}

impl Default for Points {
    fn default() -> Self {
        Self { positions: [[Point3::origin(); CUBES]; 2], cones: [[0; CUBES]; 2], others: [[0.0; CUBES]; 2] }
    }
}

impl Points {
    /// Fills in the points of a block and those ahead of it; of where there is no block only where they stand.
    pub(super) fn fill(&mut self, solid: &Solid, blocks: &Blocks) {
        let corner = blocks[0].expect("a block").1.corner;
        for (kind, positions) in self.positions.iter_mut().enumerate() {
            let along: [Point3<f64>; 5] =
                std::array::from_fn(|i| solid.lattice.position(corner.map(|x| x + (2 * i + kind) as i32)));
            let mut positions = positions.iter_mut();
            for x in along {
                for y in along {
                    for (z, position) in along.into_iter().zip(&mut positions) {
                        *position = Point3::new(x.x, y.y, z.z);
                    }
                }
            }
        }
        for (ahead, block) in blocks.iter().enumerate() {
            let Some((grove, block)) = block else { continue };
            for kind in 0..2 {
                let (cones, others) = block.nearest(kind);
                for bit in bits(SEEN[ahead]) {
                    let place = PLACES[bit] + 4 * AHEAD[ahead];
                    self.cones[kind][place] = cones[bit];
                    self.others[kind][place] = others[bit];
                }
                for bit in bits(block.moved(kind) & SEEN[ahead]) {
                    let place = PLACES[bit] + 4 * AHEAD[ahead];
                    self.positions[kind][place] = grove.position(solid, block, kind, bit);
                }
            }
        }
    }

    pub(super) fn at(&self, kind: usize, place: usize) -> Seen {
        Seen {
            position: self.positions[kind][place],
            cone: self.cones[kind][place],
            others: self.others[kind][place],
            leaf: leaf_at(place),
        }
    }
}

/// The leaf of a place, counted like places, three along each axis.
fn leaf_at(place: usize) -> usize {
    usize::from(LEAVES[place])
}

/// The block ahead in which such a leaf is, and which of its leaves that is.
pub(super) fn block_of(leaf: usize) -> (usize, usize) {
    let [x, y, z] = [leaf / 9, leaf / 3 % 3, leaf % 3];
    ((x >> 1) << 2 | (y >> 1) << 1 | z >> 1, (x & 1) << 2 | (y & 1) << 1 | z & 1)
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
            let spread = |bit: usize| [bit >> 4, bit >> 2 & 3, bit & 3].map(|along| along / 2);
            let [x, y, z] = spread(there);
            assert_eq!(block_of(leaf_at(place)), (block, x << 2 | y << 1 | z));
        }
        let seen: u32 = SEEN.iter().map(|cubes| cubes.count_ones()).sum();
        assert_eq!(seen as usize, CUBES);
    }
}
