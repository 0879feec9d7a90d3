//! Smoothing of depth over neighbouring balls, across branches (docs/algorithm.md, step 23).
//!
//! A ball's depth comes from two contacts and is as noisy as they are; an object's depth changes slowly
//! along and between its branches. What differs from the disparity plane is regressed locally: linear in
//! u and v over the balls within max(3 px, rho / 2), those of similar radius weighing more, each by how well
//! its own depth is known, with Cauchy weights against balls that sit on something else.
//!
//! * **Cost**: number of balls times neighbours.

use super::balls::{Ball, px};
use nalgebra::{Matrix3, Vector2, Vector3};
use shared::fixed::ONE;
use shared::stage::plane::ImagePlane;
use std::collections::BTreeMap;

/// Kernel width as a part of a ball's radius, and at least this many px.
const WIDTH: (f64, f64) = (0.5, 3.0);
/// Radii this part of the ball's own apart weigh e^-1/2.
const RADIUS_WIDTH: f64 = 0.5;
/// Rounds of robust re-weighting.
const ROUNDS: usize = 4;
/// Least scale of the residuals, px.
const LEAST_SCALE: f64 = 0.15;
/// Pull of level and slopes towards the median and flatness, as a part of the neighbours' weight.
const RIDGE: [f64; 3] = [0.02, 0.5, 0.5];

/// Replace each ball's disparity by the local robust estimate.
pub fn smooth(balls: &mut [Ball], plane: &ImagePlane) {
    let expected = |b: &Ball| {
        let slope = |s: i32| f64::from(s) / f64::from(ONE);
        px(plane.level)
            + slope(plane.slope_u) * (b.at.x - px(plane.origin.u))
            + slope(plane.slope_v) * (b.at.y - px(plane.origin.v))
    };
    let excess: Vec<f64> = balls.iter().map(|b| b.disparity - expected(b)).collect();
    let grid = Grid::new(balls);
    let smoothed: Vec<f64> = (0..balls.len()).map(|i| estimate(balls, &excess, &grid, i)).collect();
    for (ball, excess) in balls.iter_mut().zip(smoothed) {
        ball.disparity = expected(ball) + excess;
    }
}

/// Balls by cells of the image, for neighbour search.
struct Grid {
    cell: f64,
    cells: BTreeMap<(i64, i64), Vec<usize>>,
}

impl Grid {
    fn new(balls: &[Ball]) -> Self {
        let widest = balls.iter().map(|b| b.rho).fold(0.0, f64::max);
        let cell = 2.0 * WIDTH.1.max(WIDTH.0 * widest);
        let mut cells: BTreeMap<_, Vec<_>> = BTreeMap::new();
        for (i, b) in balls.iter().enumerate() {
            cells.entry(Self::key(b.at, cell)).or_default().push(i);
        }
        Self { cell, cells }
    }

    fn key(at: Vector2<f64>, cell: f64) -> (i64, i64) {
        ((at.x / cell).floor() as i64, (at.y / cell).floor() as i64)
    }

    /// The balls in the cell of a point and the eight around it, in a fixed order.
    fn around(&self, at: Vector2<f64>) -> impl Iterator<Item = usize> + '_ {
        let (cu, cv) = Self::key(at, self.cell);
        let keys = (-1..=1).flat_map(move |dv| (-1..=1).map(move |du| (cu + du, cv + dv)));
        keys.filter_map(|key| self.cells.get(&key)).flatten().copied()
    }
}

/// The excess at ball `i` by robust local linear regression.
fn estimate(balls: &[Ball], excess: &[f64], grid: &Grid, i: usize) -> f64 {
    let here = &balls[i];
    let width = WIDTH.1.max(WIDTH.0 * here.rho);
    let radius_width = RADIUS_WIDTH * here.rho.max(4.0);
    let neighbours: Vec<(Vector3<f64>, f64, f64)> = grid
        .around(here.at)
        .filter_map(|j| {
            let offset = (balls[j].at - here.at) / width;
            let q = offset.norm_squared() + ((balls[j].rho - here.rho) / radius_width).powi(2);
            let near = offset.norm_squared() <= 4.0;
            near.then(|| {
                (
                    Vector3::new(1.0, offset.x, offset.y),
                    excess[j],
                    libm::exp(-0.5 * q) * balls[j].weight.max(0.0025),
                )
            })
        })
        .collect();
    let total: f64 = neighbours.iter().map(|n| n.2).sum();
    if total < 1e-9 {
        return excess[i];
    }
    let median = median(neighbours.iter().map(|n| n.1).collect());
    let ridge = Vector3::from(RIDGE) * total.max(0.3);
    let mut robust = vec![1.0; neighbours.len()];
    let mut level = median;
    for _ in 0..ROUNDS {
        let (mut a, mut b) = (Matrix3::from_diagonal(&ridge), Vector3::new(ridge.x * median, 0.0, 0.0));
        for ((x, y, w), r) in neighbours.iter().zip(&robust) {
            a += x * x.transpose() * (w * r);
            b += x * (w * r * y);
        }
        let Some(solution) = a.cholesky().map(|c| c.solve(&b)) else { return median };
        level = solution.x;
        let residuals: Vec<f64> = neighbours.iter().map(|(x, y, _)| (y - x.dot(&solution)).abs()).collect();
        let scale = 2.0 * LEAST_SCALE.max(1.48 * self::median(residuals.clone()));
        robust = residuals.iter().map(|e| 1.0 / (1.0 + (e / scale).powi(2))).collect();
    }
    level
}

/// The middle value; 0 of none.
fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(middle, f64::total_cmp).1 }
}
