//! Thinning: peel the object layer by layer until only its centre lines remain.
//!
//! Paper: section 3.1, thin(A, B) = A - hit-or-miss(A, B); it names no structuring elements. Four rules:
//!
//! | rule | decides | source |
//! |---|---|---|
//! | [`Rule::HitOrMiss`] | the paper's formula with L1, L2 of the Golay alphabet in four turns each | Golay 1969; Serra 1982 |
//! | [`Rule::ZhangSuen`] | two parallel sub-iterations; may erase a component, such as a 2x2 block | Zhang, Suen 1984 |
//! | [`Rule::GuoHall`] | two parallel sub-iterations | Guo, Hall 1989 |
//! | [`Rule::EdtOrdered`] | one pixel after the other, outermost first, between anchors on the ridge of the distance | Pudney 1998, with our anchors |
//!
//! | | |
//! |---|---|
//! | in, out | a [`Bitmap`], changed in place; outside is clear |
//! | scratch | the parallel rules: [`scratch_words`](super::parallel_thinning::scratch_words); EDT-ordered: [`scratch_order`](sequential_thinning::scratch_order) entries and the distances |
//! | cost | that of [`parallel_thinning`](super::parallel_thinning) and [`sequential_thinning`] |
//!
//! All but Zhang-Suen keep the number of components and of holes, so that no component is emptied: an
//! isolated pixel is a legal skeleton. Zhang-Suen and Guo-Hall are as published (OpenCV's `ximgproc` gives
//! the same pixels for an image in a clear frame; without one it never thins the image border).
//!
//! Not promised: lines one pixel wide. [`minimal`](sequential_thinning::minimal) gives those, for any rule.

use crate::arena::Arena;
use crate::bitmap::{Bitmap, Plane};
use crate::limits::CapacityError;
use crate::stage::parallel_thinning::{Parallel, Report, Thin};
use crate::stage::sequential_thinning;

/// Which pixels are deleted, and in which order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Rule {
    /// Hit-or-miss with the Golay L alphabet: the paper's formula.
    HitOrMiss,
    /// Zhang and Suen 1984.
    ZhangSuen,
    /// Guo and Hall 1989.
    GuoHall,
    /// In increasing distance to the background, keeping its ridge.
    #[default]
    EdtOrdered,
}

/// Thin by a rule, a parallel one with `parallel`; `distance` serves [`Rule::EdtOrdered`] alone. The scratch
/// holds [`scratch_order`](sequential_thinning::scratch_order) entries for that rule, [`scratch_words`](super::parallel_thinning::scratch_words) words for the others.
///
/// # Errors
/// A [`CapacityError`] when there is less scratch.
pub fn thin(
    bitmap: &mut Bitmap<'_>,
    (rule, parallel): (Rule, Thin),
    distance: &Plane<'_, u16>,
    scratch: Arena<'_>,
) -> Result<Report, CapacityError> {
    let rule = match rule {
        Rule::HitOrMiss => Parallel::HitOrMiss,
        Rule::ZhangSuen => Parallel::ZhangSuen,
        Rule::GuoHall => Parallel::GuoHall,
        Rule::EdtOrdered => return sequential_thinning::thin(bitmap, distance, scratch),
    };
    parallel(bitmap, rule, scratch)
}
