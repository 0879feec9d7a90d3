//! Boundary pixels: beta(A) = A - (A eroded by B).
//!
//! Paper: section 3.2, the formula as it stands. The paper leaves the structuring element B open; the 3x3
//! square is what `cv2.erode` takes when given none, and is the default here.
//!
//! | | |
//! |---|---|
//! | in | a [`Bitmap`] A |
//! | out | a bitmap of the set pixels of A with a clear pixel under B |
//! | border | all outside is clear, so object pixels at the border of the image are boundary (OpenCV's erosion takes the outside as set) |
//! | cost | two passes over the words of rows that are not empty, a few rows at a time |
//!
//! By the square the boundary is 4-connected and two pixels wide at diagonals; by the cross it is
//! 8-connected and thin.
//!
//! The words of a few rows are taken as one long row. What then comes from beyond the end of a row is wrong,
//! but of concern to pixels of the outermost columns alone, which are boundary wherever they are set.

use crate::bitmap::{Bitmap, WORD_BITS, Word};
use crate::limits::{CapacityError, MAX_SIDE};

/// The structuring element B.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Element {
    /// The pixel and its eight neighbours.
    #[default]
    Square,
    /// The pixel and its four edge neighbours.
    Cross,
}

/// Words that are worked on together: at least a row.
const TOGETHER: usize = MAX_SIDE / WORD_BITS;

/// The boundary of a bitmap, in `words`.
///
/// # Errors
/// A [`CapacityError`] when there are fewer words than the bitmap has.
pub fn boundary<'w>(
    bitmap: &Bitmap<'_>,
    element: Element,
    words: &'w mut [Word],
) -> Result<Bitmap<'w>, CapacityError> {
    let size = bitmap.size();
    let mut out = Bitmap::over(size, words)?;
    let n = bitmap.pitch().get();
    let all = bitmap.words();
    let border = n.min(all.len());
    // Every set pixel of the first and the last row is boundary.
    let last = all.len() - border;
    for row in [0..border, last..all.len()] {
        let to = out.words_mut().get_mut(row.clone()).unwrap_or_default();
        to.iter_mut().zip(all.get(row).unwrap_or_default()).for_each(|(to, from)| *to = *from);
    }

    let inner = out.words_mut().get_mut(n..last).unwrap_or_default();
    let at_once = (TOGETHER / n * n).max(n);
    for (k, out) in inner.chunks_mut(at_once).enumerate() {
        let start = n + k * at_once;
        let [above, here, below] =
            [start - n, start, start + n].map(|first| all.get(first..first + out.len()).unwrap_or_default());
        if here.iter().fold(0, |any, word| any | word) == 0 {
            out.fill(0);
            continue;
        }
        within(element, [above, here, below], out);
        let last = 1 << ((size.width - 1) % WORD_BITS);
        for (out, here) in out.chunks_exact_mut(n).zip(here.chunks_exact(n)) {
            if let (Some(out), Some(here)) = (out.first_mut(), here.first()) {
                *out |= here & 1;
            }
            if let (Some(out), Some(here)) = (out.last_mut(), here.last()) {
                *out |= here & last;
            }
        }
    }
    Ok(out)
}

/// The boundary of the words `here`, as of one long row, between those of the rows above and below.
fn within(element: Element, [above, here, below]: [&[Word]; 3], out: &mut [Word]) {
    // What the pixels to the west and to the east must have too, with a clear word at either end.
    debug_assert!(here.len() <= TOGETHER);
    let mut columns = [0; TOGETHER + 2];
    let columns = columns.get_mut(..here.len() + 2).unwrap_or_default();
    let inner = columns.get_mut(1..).unwrap_or_default();
    for (((column, a), b), c) in inner.iter_mut().zip(above).zip(here).zip(below) {
        *column = if element == Element::Square { a & b & c } else { *b };
    }
    for ((out, here), beside) in out.iter_mut().zip(here).zip(columns.windows(3)) {
        let west = beside[1] << 1 | beside[0] >> (WORD_BITS - 1);
        let east = beside[1] >> 1 | beside[2] << (WORD_BITS - 1);
        *out = here & !(beside[1] & west & east);
    }
    if element == Element::Cross {
        for (((out, a), b), c) in out.iter_mut().zip(above).zip(here).zip(below) {
            *out |= b & !(a & c);
        }
    }
}
