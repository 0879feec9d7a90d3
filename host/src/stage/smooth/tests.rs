//! Smoothing held, bit by bit, against the rule as it is written down.

use super::*;
use crate::random::Random;
use shared::point::PixelPoint;

/// Balls about a few noisy curves, of many widths.
fn balls(count: usize, noise: f64) -> Vec<Ball> {
    let mut random = Random::new(count as u64);
    let ball = |k: usize| {
        let t = k as f64 / 40.0;
        let at = Vector2::new(160.0 + 90.0 * t.cos() + random.normal(), 120.0 + 70.0 * (1.3 * t).sin());
        Ball {
            at,
            rho: 2.0 + 28.0 * random.uniform(),
            disparity: 90.0 + 0.02 * at.x + noise * random.normal(),
            weight: random.uniform(),
            contacts: [0; 2],
            place: k,
            ray: Vector3::z(),
        }
    };
    (0..count).map(ball).collect()
}

fn plane() -> ImagePlane {
    let origin = PixelPoint { u: 160 * 256, v: 120 * 256 };
    ImagePlane { origin, level: 90 * 256, slope_u: 655, slope_v: -300 }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// The estimate at ball `i`, its neighbours looked for among all and added up cell by cell.
fn estimate(balls: &[Ball], excess: &[f64], i: usize) -> f64 {
    let here = &balls[i];
    let wide = |b: &Ball| (0.5 * b.rho).max(3.0);
    let cell = 2.0 * balls.iter().map(wide).fold(0.0, f64::max);
    let mut order: Vec<usize> = (0..balls.len()).collect();
    order.sort_by_key(|&j| [balls[j].at.y, balls[j].at.x].map(|x| (x / cell).floor() as i64));
    let neighbour = |j: usize| {
        let offset = (balls[j].at - here.at) / wide(here);
        let q = offset.norm_squared() + ((balls[j].rho - here.rho) / (0.5 * here.rho.max(4.0))).powi(2);
        let weight = libm::exp(-0.5 * q) * balls[j].weight.max(0.0025);
        (offset.norm_squared() <= 4.0).then(|| (Vector3::new(1.0, offset.x, offset.y), excess[j], weight))
    };
    let neighbours: Vec<_> = order.into_iter().filter_map(neighbour).collect();
    let total: f64 = neighbours.iter().map(|n| n.2).sum();
    if total < 1e-9 {
        return excess[i];
    }
    let middle = median(neighbours.iter().map(|n| n.1).collect());
    let ridge = Vector3::new(0.02, 0.5, 0.5) * total.max(0.3);
    let (mut robust, mut level) = (vec![1.0; neighbours.len()], middle);
    for _ in 0..4 {
        let (mut a, mut b) = (Matrix3::from_diagonal(&ridge), Vector3::new(ridge.x * middle, 0.0, 0.0));
        for ((x, y, w), r) in neighbours.iter().zip(&robust) {
            a += x * x.transpose() * (w * r);
            b += x * (w * r * y);
        }
        let Some(solution) = a.cholesky().map(|c| c.solve(&b)) else { return middle };
        level = solution.x;
        let residuals: Vec<f64> = neighbours.iter().map(|(x, y, _)| (y - x.dot(&solution)).abs()).collect();
        let scale = 2.0 * (1.48 * median(residuals.clone())).max(0.15);
        robust = residuals.iter().map(|e| 1.0 / (1.0 + (e / scale).powi(2))).collect();
    }
    level
}

#[test]
fn the_bits_are_those_of_the_rule_on_any_number_of_threads() {
    let plane = plane();
    let slope = |s: i32| f64::from(s) / f64::from(ONE);
    let expected = |b: &Ball| {
        px(plane.level)
            + slope(plane.slope_u) * (b.at.x - px(plane.origin.u))
            + slope(plane.slope_v) * (b.at.y - px(plane.origin.v))
    };
    let mut smoother = Smoother::default();
    for (count, noise) in [(0, 0.1), (1, 0.1), (2, 5.0), (300, 0.05), (700, 2.0)] {
        let rough = balls(count, noise);
        let excess: Vec<f64> = rough.iter().map(|b| b.disparity - expected(b)).collect();
        let naive = |i: usize| (expected(&rough[i]) + estimate(&rough, &excess, i)).to_bits();
        let naive: Vec<u64> = (0..count).map(naive).collect();
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let mut smoothed = rough.clone();
            pool.install(|| smoother.smooth(&mut smoothed, &plane));
            let bits: Vec<u64> = smoothed.iter().map(|b| b.disparity.to_bits()).collect();
            assert!(bits == naive, "{count} balls, {threads} threads");
        }
    }
}
