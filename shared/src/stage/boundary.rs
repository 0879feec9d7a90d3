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
//! | cost | one pass over the words |
//!
//! By the square the boundary is 4-connected and two pixels wide at diagonals; by the cross it is
//! 8-connected and thin.

use crate::bitmap::{Bitmap, Word};
use crate::limits::CapacityError;

/// The structuring element B.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Element {
    /// The pixel and its eight neighbours.
    #[default]
    Square,
    /// The pixel and its four edge neighbours.
    Cross,
}

/// The boundary of a bitmap, in `words`.
pub fn boundary<'w>(
    bitmap: &Bitmap<'_>,
    element: Element,
    words: &'w mut [Word],
) -> Result<Bitmap<'w>, CapacityError> {
    let mut out = Bitmap::new(bitmap.size(), words)?;
    for v in 0..bitmap.size().height as i32 {
        for (i, (out, &here)) in out.row_mut(v).iter_mut().zip(bitmap.row(v)).enumerate() {
            if here != 0 {
                let [n, ne, e, se, s, sw, w, nw] = bitmap.neighbour_words(v, i);
                let cross = n & e & s & w;
                let eroded = if element == Element::Cross { cross } else { cross & ne & se & sw & nw };
                *out = here & !eroded;
            }
        }
    }
    Ok(out)
}
