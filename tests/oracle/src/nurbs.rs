//! Spline fitting and evaluation by definition, in `f64`: the recursion of Cox and de Boor over an
//! explicit knot vector, and dense normal equations.

use nalgebra::DMatrix;

/// The basis function `i` of degree `p` at `t` over `knots`; right-continuous, but for the last knot.
pub fn basis(knots: &[f64], i: usize, p: usize, t: f64) -> f64 {
    if p == 0 {
        let last = knots[knots.len() - 1];
        let inside = knots[i] <= t && t < knots[i + 1];
        let at_end = t >= last && knots[i] < knots[i + 1] && knots[i + 1] >= last;
        return f64::from(inside || at_end);
    }
    let ratio = |a: f64, b: f64| if b == 0.0 { 0.0 } else { a / b };
    ratio(t - knots[i], knots[i + p] - knots[i]) * basis(knots, i, p - 1, t)
        + ratio(knots[i + p + 1] - t, knots[i + p + 1] - knots[i + 1]) * basis(knots, i + 1, p - 1, t)
}

/// All basis functions of a cubic with `n` control points at `t` (in spans), wrapped when closed.
pub fn row(n: usize, closed: bool, t: f64) -> Vec<f64> {
    let mut row = vec![0.0; n];
    if closed {
        let knots: Vec<f64> = (0..n + 7).map(|k| k as f64 - 3.0).collect();
        let t = t.rem_euclid(n as f64);
        for i in 0..n + 3 {
            row[i % n] += basis(&knots, i, 3, t);
        }
    } else {
        let spans = n - 3;
        let knots: Vec<f64> = (0..n + 4).map(|k| (k as f64 - 3.0).clamp(0.0, spans as f64)).collect();
        for (i, value) in row.iter_mut().enumerate() {
            *value = basis(&knots, i, 3, t);
        }
    }
    row
}

/// A rational point: four channels from control points and weights.
pub fn evaluate(controls: &[([f64; 4], f64)], closed: bool, t: f64) -> [f64; 4] {
    let row = row(controls.len(), closed, t);
    let share: f64 = row.iter().zip(controls).map(|(n, c)| n * c.1).sum();
    [0, 1, 2, 3].map(|k| row.iter().zip(controls).map(|(n, c)| n * c.1 * c.0[k]).sum::<f64>() / share)
}

/// Balls at equal arc along a polyline: `pieces` pieces, both ends when open.
pub fn resample(balls: &[([f64; 4], f64)], closed: bool, pieces: usize) -> Vec<([f64; 4], f64)> {
    let segments = if closed { balls.len() } else { balls.len() - 1 };
    let ends = |k: usize| (balls[k % balls.len()], balls[(k + 1) % balls.len()]);
    let chord = |k: usize| {
        let (a, b) = ends(k);
        (a.0[0] - b.0[0]).hypot(a.0[1] - b.0[1])
    };
    let length: f64 = (0..segments).map(chord).sum();
    let (mut k, mut start) = (0, 0.0);
    (0..if closed { pieces } else { pieces + 1 })
        .map(|i| {
            let arc = length * i as f64 / pieces as f64;
            while arc > start + chord(k) && k + 1 < segments {
                start += chord(k);
                k += 1;
            }
            let part = if chord(k) == 0.0 { 0.0 } else { ((arc - start) / chord(k)).min(1.0) };
            let (a, b) = ends(k);
            let mix = |a: f64, b: f64| a + (b - a) * part;
            ([0, 1, 2, 3].map(|c| mix(a.0[c], b.0[c])), mix(a.1, b.1))
        })
        .collect()
}

/// The penalised least squares cubic through balls at equal arc, with `n` control points.
pub fn fit(
    balls: &[([f64; 4], f64)],
    closed: bool,
    pieces: usize,
    n: usize,
    smoothing: f64,
    end_weight: f64,
) -> Vec<[f64; 4]> {
    let points = resample(balls, closed, pieces);
    let spans = if closed { n } else { n - 3 };
    let rows: Vec<Vec<f64>> =
        (0..points.len()).map(|i| row(n, closed, spans as f64 * i as f64 / pieces as f64)).collect();
    let design = DMatrix::from_fn(points.len(), n, |i, j| rows[i][j]);
    let weight = |i: usize| points[i].1 * if !closed && (i == 0 || i == pieces) { end_weight } else { 1.0 };
    let weights: Vec<f64> = (0..points.len()).map(weight).collect();
    let differences = DMatrix::from_fn(if closed { n } else { n - 2 }, n, |k, j| {
        let hit = |d: usize| if (k + d) % n == j { 1.0 } else { 0.0 };
        hit(0) - 2.0 * hit(1) + hit(2)
    });
    let weighted = DMatrix::from_fn(points.len(), n, |i, j| weights[i] * rows[i][j]);
    let matrix = design.transpose() * &weighted + differences.transpose() * &differences * smoothing;
    let values = DMatrix::from_fn(points.len(), 4, |i, c| points[i].0[c]);
    let solution = matrix.cholesky().expect("positive definite").solve(&(weighted.transpose() * values));
    (0..n).map(|i| [0, 1, 2, 3].map(|c| solution[(i, c)])).collect()
}
