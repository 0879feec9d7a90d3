//! How well each vertex is known.
//!
//! * **In**: the field of displacements with what stereo says of each node, and how far behind the front each vertex
//!   lies. **Out**: a confidence a vertex, 0 to 1: 1 / (1 + s), where s is the standard deviation of its depth that is
//!   to be expected, mm.
//! * **Expected**: where nothing was measured a cross-section that is not round is off by a part of its half
//!   thickness: most on the back, which nothing corrects, and nothing at the outline, where the thickness ends. What
//!   stereo says of a node it says of its surroundings too, since the surface bends little.

use super::field::Field;
use super::pool::Lent;

/// Nodes around one that speak for it, on each side.
const AROUND: usize = 3;
/// What any vertex may be off by, mm.
const LEAST: f64 = 0.1;
/// What an unmeasured front and the back may be off by besides, in half thicknesses.
const FRONT: f64 = 0.3;
const BACK: f64 = 0.4;
/// What a node's surroundings say of it, in what they say of themselves: residuals are smaller than what they are
/// weighed by, and the surface bends less than those nodes are wide.
const SHARED: f64 = 2.0;

/// The confidence of vertices whose images are `images`, and which lie `behind` the front.
pub(super) fn of_vertices<'p>(field: &Field<'p>, images: &[[f64; 3]], behind: &[f64]) -> Lent<'p, f64> {
    let lattice = &field.lattice;
    let known = lattice.sums_around(&field.known, AROUND);
    let shelf = known.shelf();
    let [mut front, mut back] = [(); 2].map(|()| shelf.filled(0.0, known.len()));
    for node in lattice.nodes() {
        let off = |share: f64| (LEAST + share * lattice.half[node]).powi(2);
        let mm = lattice.unit[node] * lattice.depth[node];
        let measured = LEAST * LEAST + mm * mm / (SHARED * known[node]).max(f64::MIN_POSITIVE);
        front[node] = 1.0 / (1.0 / off(FRONT) + 1.0 / measured);
        back[node] = off(BACK);
    }
    // Away from all nodes nothing is known: no better than the worst of them.
    let worst = lattice.nodes().map(|node| front[node].max(back[node])).reduce(f64::max).unwrap_or(f64::MAX);
    let confidence = |(&[u, v, _], &behind): (&[f64; 3], &f64)| {
        let at = |squares: &[f64]| lattice.look_up(squares, [u, v]).unwrap_or(worst);
        let square = at(&front) * (1.0 - behind) + at(&back) * behind;
        1.0 / (1.0 + square.sqrt())
    };
    shelf.of(images.iter().zip(behind).map(confidence))
}
