//! Correspondence of the two hulls through their affine invariants (paper section 4.1.3).
//!
//! * **In**: the ordered vertices of both convex hulls.
//! * **Out**: which vertex of the left hull is which of the right one, how sure that is, and the affine
//!   map that follows.
//!
//! Two ways, chosen by the caller:
//!
//! * [`match_cuts`], the default: digitised hull vertices are no repeatable features, so both hulls are
//!   first cut at the same six relative heights, which takes the paper's "all the vertices in both images
//!   are distributed equally" at its word: twelve vertices, in the same order in both views. e_omega
//!   (omega = 3, logarithms of the ratios), averaged around the hull, is then computed for each cyclic
//!   shift. The least picks the shift. The heights are uneven, so that the hull of a symmetric object is
//!   cut to a polygon without symmetry. The rows of a rectified pair say that shift 0 is right, and they
//!   decide where e_omega at 0 is nearly as small; where it is not, the hulls are of two different shapes.
//! * [`match_vertices`], the paper: the hulls' own vertices, their number made equal by deleting those that
//!   matter least, arg-min of e_omega over the pairs of quadruplets, then all sets of three vertices whose
//!   area agrees. Vertices are ordered, so each pair of quadruplets stands for a cyclic shift. Rounded to
//!   pixels, some quadruplet is often matched a little better by a wrong one (in 6 % of nearly regular
//!   polygons at omega 1, 1.5 % at omega 3), so only those shifts take part under which the most sets of
//!   three agree.
//!
//! * **Cost**: 12 feature vectors a hull, whatever its size, and 12^2 distances of these; for the paper's, n^2
//!   omega vectors and n^3 triples.

use crate::fixed::{ONE, div_round};
use crate::limits::HULL_CUTS;
use crate::point::{PixelPoint, orient};
use crate::stage::invariants::{Measure, e_omega, feature_distance, feature_vector};
use crate::stage::plane::AffineMap;
use core::num::NonZeroUsize;
use heapless::VecView;

/// Vertices of a cut hull.
pub const CUT_VERTICES: usize = 2 * HULL_CUTS;

/// Quadruplets of consecutive vertices compared in the default mode.
const OMEGA: usize = 3;

/// (1 - cos(t + sin(t) / 8)) / 2 in 1/65536, t = pi (k + 1/2) / 6: dense where the hull closes, and each
/// a little lower than without the sine, which makes no even polygon of an even outline: without it an
/// ellipse becomes a regular dodecagon, and an outline that half a turn takes into itself ties there.
const CUT_HEIGHTS: [i32; HULL_CUTS] = [1407, 11_733, 28_161, 45_000, 57_893, 64_677];

/// Errors that differ by no more than this tie, in 1/65536 of log2^2: noise of a sphere gives 0.1, a view
/// that was mirrored 1.5 and more, if any (docs/decisions/0005-gates.md).
const TIE: u32 = ONE as u32;

/// Two hulls, cut and compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CutMatch {
    /// Vertices of the left hull, down its right and up its left side.
    pub left: [PixelPoint; CUT_VERTICES],
    /// Vertices of the right hull, in the same order.
    pub right: [PixelPoint; CUT_VERTICES],
    /// e_omega averaged around the hull for each cyclic shift, in 1/65536 of log2^2.
    pub errors: [u32; CUT_VERTICES],
    /// The shift of the least error.
    pub least: usize,
    /// The shift picked: the one of the least error, or 0, by which the rows match, where that is a tie.
    pub shift: usize,
}

impl CutMatch {
    /// The least error of any other shift over that of the chosen one, in 1/65536: the margin by which
    /// the invariants decide.
    pub fn margin(&self) -> u32 {
        let others = self.errors.iter().enumerate().filter(|(s, _)| *s != self.shift).map(|(_, e)| *e);
        let second = u64::from(others.min().unwrap_or(0));
        // Errors have 32 bits: 48 when shifted.
        ((second << 16) / u64::from(self.errors[self.shift].max(1))).min(u64::from(u32::MAX)) as u32
    }
}

/// Cut both hulls at equal relative heights and compare their invariants at every cyclic shift.
///
/// `None` when a hull has no height.
pub fn match_cuts(left: &[PixelPoint], right: &[PixelPoint]) -> Option<CutMatch> {
    let (left, right) = (cut(left)?, cut(right)?);
    let features = |hull| core::array::from_fn(|i| feature_vector(hull, i, Measure::Logarithm));
    let (of_left, of_right): ([_; CUT_VERTICES], [_; CUT_VERTICES]) = (features(&left), features(&right));
    let errors = core::array::from_fn(|s| {
        // e_omega of quadruplet i is the sum of the distances from i on.
        let distances: [u64; CUT_VERTICES] =
            core::array::from_fn(|i| feature_distance(&of_left[i], &of_right[(i + s) % CUT_VERTICES]));
        let e_omega = |i| (0..OMEGA).map(|k| distances[(i + k) % CUT_VERTICES]).sum::<u64>();
        // e_omega is below 2^54, so twelve of them, shifted, are below 2^42.
        let sum: u64 = (0..CUT_VERTICES).map(|i| e_omega(i) >> 16).sum();
        (sum / CUT_VERTICES as u64).min(u64::from(u32::MAX)) as u32
    });
    let least = (0..CUT_VERTICES).min_by_key(|&s| errors[s]).unwrap_or(0);
    let shift = if errors[0] - errors[least] <= TIE { 0 } else { least };
    Some(CutMatch { left, right, errors, least, shift })
}

/// The hull's outline at the six heights: right side downwards, left side upwards.
fn cut(hull: &[PixelPoint]) -> Option<[PixelPoint; CUT_VERTICES]> {
    let top = hull.iter().map(|p| p.v).min()?;
    let bottom = hull.iter().map(|p| p.v).max()?;
    if bottom <= top {
        return None;
    }
    let mut vertices = [PixelPoint::default(); CUT_VERTICES];
    for (k, height) in CUT_HEIGHTS.iter().enumerate() {
        // A height of at most 2^21 by a share below 2^16.
        let down = div_round(i64::from(bottom - top) * i64::from(*height), i64::from(ONE)) as i32;
        // Rounding must not reach the bottom of a hull of a tenth of a pixel: nothing crosses that row.
        let v = top + down.min(bottom - top - 1);
        let (mut low, mut high) = (i32::MAX, i32::MIN);
        for (i, a) in hull.iter().enumerate() {
            let b = hull[(i + 1) % hull.len()];
            if (a.v <= v) != (b.v <= v) {
                let u = a.lerp(b, v - a.v, b.v - a.v).u;
                (low, high) = (low.min(u), high.max(u));
            }
        }
        vertices[k] = PixelPoint { u: high, v };
        vertices[CUT_VERTICES - 1 - k] = PixelPoint { u: low, v };
    }
    Some(vertices)
}

/// The paper's parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PaperMatching {
    /// Consecutive quadruplets compared: 1, 2 or 3 for four, five or six matched vertices.
    pub omega: usize,
    /// A set of three vertices corresponds when the shares of its area in those of the hulls differ by
    /// less than this part, in 1/65536.
    pub threshold: i32,
}

impl Default for PaperMatching {
    fn default() -> Self {
        Self { omega: 3, threshold: ONE / 20 }
    }
}

/// The paper's match of two hulls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VertexMatch {
    /// First vertices of the two quadruplets with the least e_omega.
    pub quadruplets: (usize, usize),
    /// That e_omega, in 1/65536.
    pub error: u64,
    /// Vertices that take part in the map.
    pub vertices: usize,
    /// The affine map from the left to the right view.
    pub map: AffineMap,
}

impl VertexMatch {
    /// The right hull's vertex that corresponds to the left hull's vertex `k`, hulls of `n` vertices.
    pub const fn partner(&self, k: usize, n: usize) -> usize {
        (k + n - self.quadruplets.0 + self.quadruplets.1) % n
    }
}

/// Delete vertices until `n` are left, always the one whose triangle with its neighbours is smallest.
pub fn reduce(hull: &mut VecView<PixelPoint>, n: usize) {
    while hull.len() > n.max(3) {
        let m = hull.len();
        let at = |i: usize| hull.get(i % m).copied().unwrap_or_default();
        let area = |i: usize| orient(at(i + m - 1), at(i), at(i + 1)).unsigned_abs();
        let least = (0..m).min_by_key(|&i| area(i)).unwrap_or(0);
        let mut place = 0..;
        hull.retain(|_| place.next() != Some(least));
    }
}

/// The paper's matching: equalise the vertices, take the quadruplets of least e_omega, then every vertex
/// of a triple whose area agrees, and fit the map to these.
///
/// Both hulls are reduced to the smaller number of vertices, at most `limit`. `None` with fewer than four.
pub fn match_vertices(
    left: &mut VecView<PixelPoint>,
    right: &mut VecView<PixelPoint>,
    limit: usize,
    paper: PaperMatching,
) -> Option<VertexMatch> {
    let n = left.len().min(right.len()).min(limit);
    let around = NonZeroUsize::new(n).filter(|_| n >= 4)?;
    reduce(left, n);
    reduce(right, n);
    let areas = (doubled_area(left), doubled_area(right));
    let at = |shift: usize| {
        let (left, right) = (&*left, &*right);
        let vertex = |hull: &[PixelPoint], k: usize| hull.get(k).copied().unwrap_or_default();
        move |k: usize| (vertex(left, k), vertex(right, (k + shift) % around))
    };
    let agreeing =
        |shift: usize| triples(n).filter(|t| triple_agrees(*t, areas, &at(shift), paper.threshold)).count();
    let most = (0..n).map(agreeing).max()?;
    let error = |(i, j)| e_omega((left, i), (right, j), paper.omega, Measure::Ratio);
    let (i, j) = (0..n)
        .filter(|&shift| agreeing(shift) == most)
        .flat_map(|shift| (0..n).map(move |i| (i, (i + shift) % around)))
        .min_by_key(|&pair| error(pair))?;
    let at = at((j + n - i) % around);
    let seed = (paper.omega + 3).min(n);
    let agrees = |k: usize| {
        (k + n - i) % around < seed
            || triples(n).any(|t| t.contains(&k) && triple_agrees(t, areas, &at, paper.threshold))
    };
    let pairs = (0..n).filter(|&k| agrees(k)).map(at);
    let map = AffineMap::fit(pairs.clone())?;
    Some(VertexMatch { quadruplets: (i, j), error: error((i, j)) >> 16, vertices: pairs.count(), map })
}

/// All sets of three of `n` vertices.
fn triples(n: usize) -> impl Iterator<Item = [usize; 3]> {
    (0..n).flat_map(move |a| (a + 1..n).flat_map(move |b| (b + 1..n).map(move |c| [a, b, c])))
}

/// Twice the area of a convex polygon: its triangles do not overlap, so it is at most 2^43.
fn doubled_area(hull: &[PixelPoint]) -> i64 {
    hull.windows(2).map(|edge| orient(hull[0], edge[0], edge[1]).abs()).sum()
}

/// Twice the area of a triple of matched vertices in both views.
fn doubled_areas(triple: [usize; 3], at: &impl Fn(usize) -> (PixelPoint, PixelPoint)) -> (i64, i64) {
    let [a, b, c] = triple.map(at);
    (orient(a.0, b.0, c.0).abs(), orient(a.1, b.1, c.1).abs())
}

/// Whether a triple's share of the hull's area is the same in both views.
fn triple_agrees(
    triple: [usize; 3],
    areas: (i64, i64),
    at: &impl Fn(usize) -> (PixelPoint, PixelPoint),
    threshold: i32,
) -> bool {
    let (left, right) = doubled_areas(triple, at);
    // left / areas.0 against right / areas.1, cross-multiplied: areas below 2^44, products below 2^88, 2^104 when
    // shifted; by a threshold below 2^31, 2^119.
    let (a, b) = (i128::from(left) * i128::from(areas.1), i128::from(right) * i128::from(areas.0));
    a > 0 && b > 0 && (a - b).abs() << 16 < a.max(b) * i128::from(threshold)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixed::PX;

    fn hull(points: [(i32, i32); 5], unit: i32) -> [PixelPoint; 5] {
        points.map(|(u, v)| PixelPoint { u: u * unit, v: v * unit })
    }

    const HOUSE: [(i32, i32); 5] = [(40, 0), (90, 30), (80, 100), (10, 90), (0, 30)];

    #[test]
    fn equal_hulls_match_at_the_rows_and_symmetric_ones_do_not_tie() {
        // The diamond, a corner doubled, is its own image after half a turn; its cuts are not.
        let diamond = [(50, 0), (100, 50), (50, 100), (0, 50), (0, 50)];
        for shape in [HOUSE, diamond] {
            let shape = hull(shape, PX);
            let found = match_cuts(&shape, &shape).unwrap();
            assert_eq!((found.errors[0], found.least, found.shift), (0, 0, 0));
            assert!(found.errors[1..].iter().all(|e| *e > ONE as u32 / 100), "{:?}", found.errors);
        }
    }

    #[test]
    fn another_shape_picks_another_shift() {
        let house = hull(HOUSE, PX);
        let mirrored = hull([(60, 0), (100, 30), (90, 90), (20, 100), (10, 30)], PX);
        let found = match_cuts(&house, &mirrored).unwrap();
        assert!(found.errors[0] > found.errors[found.least]);
        assert_eq!((found.shift, found.least != 0), (found.least, true), "and that is no tie");
    }

    #[test]
    fn a_hull_of_a_few_units_is_cut_without_overflow() {
        for unit in 0..4 {
            let tiny = hull([(1, 0), (2, 3), (1, 7), (0, 5), (0, 2)], unit);
            assert_eq!(match_cuts(&tiny, &tiny).is_some(), unit > 0);
        }
    }
}
