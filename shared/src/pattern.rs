//! Hit-or-miss patterns of 3x3 pixels, written as the pictures they are.
//!
//! The letters are leptonica's: `x` a pixel that must be set, `o` one that must be clear, a space one
//! that does not matter, `C` the centre, which must be set. Outside the image is clear.

use crate::bitmap::Word;
use crate::lanes::Lanes;

/// A 3x3 hit-or-miss pattern with a set centre; bits in the order of `Bitmap::neighbours`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pattern {
    /// Neighbours that must be set.
    pub hit: u8,
    /// Neighbours that must be clear.
    pub miss: u8,
}

impl Pattern {
    /// A pattern from its three rows; none if the drawing is not three by three letters of the alphabet.
    pub const fn parse(drawing: [&str; 3]) -> Option<Self> {
        /// Column and row of each neighbour, from north clockwise.
        const AROUND: [(usize, usize); 8] = [(1, 0), (2, 0), (2, 1), (2, 2), (1, 2), (0, 2), (0, 1), (0, 0)];
        if drawing[0].len() != 3 || drawing[1].len() != 3 || drawing[2].len() != 3 {
            return None;
        }
        if drawing[1].as_bytes()[1] != b'C' {
            return None;
        }
        let mut pattern = Self { hit: 0, miss: 0 };
        let mut k = 0;
        while k < 8 {
            let (column, row) = AROUND[k];
            match drawing[row].as_bytes()[column] {
                b'x' => pattern.hit |= 1 << k,
                b'o' => pattern.miss |= 1 << k,
                b' ' => {}
                _ => return None,
            }
            k += 1;
        }
        Some(pattern)
    }

    /// The pattern turned by 90 degrees clockwise on the screen.
    pub const fn turned(self) -> Self {
        Self { hit: self.hit.rotate_left(2), miss: self.miss.rotate_left(2) }
    }

    /// Whether the pattern fits around a set pixel with these neighbours.
    pub const fn fits(self, neighbours: u8) -> bool {
        neighbours & self.hit == self.hit && neighbours & self.miss == 0
    }

    /// Bit by bit: whether the pattern fits around pixels with these neighbours.
    #[inline(always)]
    pub fn fits_words<L: Lanes>(self, neighbours: [L; 8]) -> L {
        let mut fit = L::splat(Word::MAX);
        for (k, words) in neighbours.into_iter().enumerate() {
            if self.hit >> k & 1 == 1 {
                fit = fit & words;
            } else if self.miss >> k & 1 == 1 {
                fit = fit & !words;
            }
        }
        fit
    }
}

/// An edge of the object.
#[rustfmt::skip]
const EDGE: Pattern = Pattern::parse([
    "ooo",
    " C ",
    "xxx",
]).expect("a drawing of 3x3 letters");

/// A corner of the object.
#[rustfmt::skip]
const CORNER: Pattern = Pattern::parse([
    " oo",
    "xCo",
    " x ",
]).expect("a drawing of 3x3 letters");

/// Letter L of the Golay alphabet on the square grid: edge and corner in turns, both turned by 90 degrees
/// clockwise after each pair.
pub const GOLAY_L: [Pattern; 8] = {
    let mut patterns = [EDGE, CORNER, EDGE, CORNER, EDGE, CORNER, EDGE, CORNER];
    let mut k = 2;
    while k < 8 {
        patterns[k] = patterns[k - 2].turned();
        k += 1;
    }
    patterns
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drawing_is_read_clockwise_from_north() {
        let pattern = Pattern::parse(["xo ", "oCx", "  x"]).unwrap();
        assert_eq!(pattern, Pattern { hit: 0b1000_1100, miss: 0b0100_0001 });
        assert_eq!(pattern.turned(), Pattern::parse([" ox", " Co", "xx "]).unwrap());
    }

    #[test]
    fn what_is_no_drawing_is_refused() {
        for drawing in
            [["ooo", "oxo", "ooo"], ["ooo", "oCo", "oo"], ["oö", " C ", "   "], ["?oo", "oCo", "ooo"]]
        {
            assert_eq!(Pattern::parse(drawing), None);
        }
    }

    #[test]
    fn words_and_single_pixels_agree_on_all_neighbourhoods() {
        let mut pattern = Pattern::parse([" oo", "xCo", " x "]).unwrap();
        for _ in 0..4 {
            for code in 0..=u8::MAX {
                let words = core::array::from_fn(|k| Word::from(code >> k & 1));
                assert_eq!(pattern.fits_words(words) & 1 == 1, pattern.fits(code));
            }
            pattern = pattern.turned();
        }
    }
}
