//! The nearest of points that follow one another in space: along a contour, or from ball to ball of a chain.
//!
//! * **In**: points of `D` coordinates in the order of their curves.
//! * **Out**: for a place, the runs of consecutive points that a search cannot rule out, nearer boxes first.
//! * **How**: a tree of boxes over runs of `RUN` points. The order of the points is that of the leaves: nothing
//!   is sorted, and building is one pass. Points in another order are found all the same, but slower.
//! * **Cost**: linear to build, about logarithmic a search; the memory is kept for the next points.

use std::ops::Range;

/// Points in a run.
const RUN: usize = 8;

/// A corner each: lowest and highest coordinates.
type Bounds<const D: usize> = [[f64; D]; 2];

/// A box that holds nothing and is infinitely far from everything.
const fn nothing<const D: usize>() -> Bounds<D> {
    [[f64::INFINITY; D], [f64::NEG_INFINITY; D]]
}

/// What is looked for.
pub trait Search {
    /// Whether points under a node, the square of whose box's distance is `square`, can matter still.
    fn enters(&self, node: usize, square: f64) -> bool;

    /// Looks at a run of points.
    fn visit(&mut self, run: Range<usize>);
}

/// A tree of boxes over points.
#[derive(Clone, Debug, Default)]
pub struct Runs<const D: usize> {
    points: usize,
    /// Number of the first leaf; the children of node k are 2 k and 2 k + 1, and node 1 is the root.
    leaves: usize,
    boxes: Vec<Bounds<D>>,
}

impl<const D: usize> Runs<D> {
    /// Takes other points.
    pub fn build(&mut self, points: impl ExactSizeIterator<Item = [f64; D]>) {
        self.points = points.len();
        self.leaves = points.len().div_ceil(RUN).next_power_of_two();
        self.boxes.clear();
        self.boxes.resize(2 * self.leaves, nothing());
        for (k, point) in points.enumerate() {
            let leaf = &mut self.boxes[self.leaves + k / RUN];
            *leaf = joined(leaf, &[point; 2]);
        }
        for node in (1..self.leaves).rev() {
            self.boxes[node] = joined(&self.boxes[2 * node], &self.boxes[2 * node + 1]);
        }
    }

    /// Number of nodes; the root is 1.
    pub fn nodes(&self) -> usize {
        self.boxes.len()
    }

    /// The nodes above a point, the root last.
    pub fn above(&self, point: usize) -> impl Iterator<Item = usize> {
        std::iter::successors(Some(self.leaves + point / RUN), |node| (*node > 1).then_some(node / 2))
    }

    /// Visits the runs that `search` enters.
    pub fn search(&self, at: &[f64; D], search: &mut impl Search) {
        if self.points > 0 {
            self.descend(1, distance_squared(&self.boxes[1], at), at, search);
        }
    }

    fn descend(&self, node: usize, square: f64, at: &[f64; D], search: &mut impl Search) {
        if !search.enters(node, square) {
            return;
        }
        if node >= self.leaves {
            let first = (node - self.leaves) * RUN;
            return search.visit(first..self.points.min(first + RUN));
        }
        let child = |node: usize| (node, distance_squared(&self.boxes[node], at));
        let (left, right) = (child(2 * node), child(2 * node + 1));
        let (near, far) = if left.1 <= right.1 { (left, right) } else { (right, left) };
        self.descend(near.0, near.1, at, search);
        self.descend(far.0, far.1, at, search);
    }

    /// The point of least `measure`, and it; of equals the first. The measure of a point is at least `scale` times
    /// the square of its distance from `at`, and infinite if the point does not count.
    pub fn nearest(&self, at: &[f64; D], scale: f64, measure: impl Fn(usize) -> f64) -> Option<(usize, f64)> {
        let mut nearest = Nearest { scale, measure, best: None };
        self.search(at, &mut nearest);
        nearest.best
    }
}

struct Nearest<M> {
    scale: f64,
    measure: M,
    best: Option<(usize, f64)>,
}

impl<M: Fn(usize) -> f64> Search for Nearest<M> {
    fn enters(&self, _: usize, square: f64) -> bool {
        square < f64::INFINITY && self.best.is_none_or(|(_, best)| self.scale * square <= best * ROUNDED)
    }

    fn visit(&mut self, run: Range<usize>) {
        for k in run {
            let measure = (self.measure)(k);
            let better = |(first, best): (usize, f64)| measure < best || (measure == best && k < first);
            if measure < f64::INFINITY && self.best.is_none_or(better) {
                self.best = Some((k, measure));
            }
        }
    }
}

/// How much farther a box may seem than a point in it, by rounding.
pub const ROUNDED: f64 = 1.0 + 1e-9;

fn joined<const D: usize>(a: &Bounds<D>, b: &Bounds<D>) -> Bounds<D> {
    let low = std::array::from_fn(|axis| a[0][axis].min(b[0][axis]));
    [low, std::array::from_fn(|axis| a[1][axis].max(b[1][axis]))]
}

/// Square of the distance from a box, 0 from inside.
fn distance_squared<const D: usize>([low, high]: &Bounds<D>, at: &[f64; D]) -> f64 {
    (0..D).map(|axis| (low[axis] - at[axis]).max(at[axis] - high[axis]).max(0.0).powi(2)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    fn square(a: &[f64; 2], b: &[f64; 2]) -> f64 {
        (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2)
    }

    #[test]
    fn the_nearest_of_any_points_is_the_first_of_the_least_distance() {
        let mut random = Random::new(7);
        // Whole numbers, so that distances coincide often.
        let mut place = |span: f64| [0; 2].map(|_| (random.uniform() * span).floor());
        let mut runs = Runs::default();
        for count in [0, 1, 7, 8, 9, 64, 500] {
            let points: Vec<_> = (0..count).map(|_| place(20.0)).collect();
            runs.build(points.iter().copied());
            for _ in 0..200 {
                let at = place(30.0);
                let naive =
                    (0..count).map(|k| (k, square(&points[k], &at))).min_by(|a, b| a.1.total_cmp(&b.1));
                assert_eq!(runs.nearest(&at, 1.0, |k| square(&points[k], &at)), naive);
                let odd = |k: usize| if k % 2 == 1 { square(&points[k], &at) } else { f64::INFINITY };
                let naive = naive_odd(count, odd);
                assert_eq!(runs.nearest(&at, 1.0, odd), naive);
            }
        }
    }

    fn naive_odd(count: usize, odd: impl Fn(usize) -> f64) -> Option<(usize, f64)> {
        (1..count).step_by(2).map(|k| (k, odd(k))).min_by(|a, b| a.1.total_cmp(&b.1))
    }

    #[test]
    fn a_long_curve_is_searched_in_few_runs() {
        let curve = |k: usize| [(k as f64 / 1000.0).cos(), (k as f64 / 1000.0).sin()];
        let mut runs = Runs::default();
        runs.build((0..6000).map(curve));
        let looked = std::cell::Cell::new(0);
        for k in 0..100 {
            let at = [0.7 * f64::from(k).cos(), 0.7 * f64::from(k).sin()];
            let measure = |k: usize| {
                looked.set(looked.get() + 1);
                square(&curve(k), &at)
            };
            assert!(runs.nearest(&at, 1.0, measure).is_some());
        }
        assert!(looked.get() < 100 * 150, "{}", looked.get());
    }
}
