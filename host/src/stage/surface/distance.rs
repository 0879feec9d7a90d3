//! Round cones made ready in double precision for the exact signed distance to them (`cone.rs`).
//!
//! A round cone is the union of the balls between its ends, so its signed distance is the least over
//! s in [0, length] of |p - c(s)| - r(s), both outside and, since the hull is convex and smooth, inside.
//! The least is at the ball whose radius through p meets the cone's side at a right angle. See I. Quilez,
//! "Round cone", iquilezles.org/articles/distfunctions, for the same function by cases.

use nalgebra::{Point3, Vector3};

use super::RoundCone;

/// Where the radius grows by more than this share of the length, the larger ball is taken alone: the hull
/// loses less than 1e-8 of the length, and the lean below stays under 10^4, which bounds its rounding.
const CONTAINED: f64 = 1.0 - 1e-8;

/// A round cone made ready for many questions.
#[derive(Clone, Copy, Debug)]
pub(super) struct Distance {
    pub(super) start: Point3<f64>,
    /// Unit vector towards the other end; zero for one ball.
    pub(super) axis: Vector3<f64>,
    /// Between the centres, mm; zero for one ball.
    pub(super) length: f64,
    /// At the start, mm.
    pub(super) radius: f64,
    /// Growth of the radius along the axis, within (-1, 1).
    pub(super) slope: f64,
    /// Tangent of the side's angle to the axis.
    pub(super) lean: f64,
}

impl Distance {
    /// Prepares the distance to `cone`.
    pub(super) fn to(cone: &RoundCone) -> Self {
        let [start, end] = cone.centres;
        let [radius, end_radius] = cone.radii;
        let length = (end - start).norm();
        let growth = end_radius - radius;
        if growth.abs() >= length * CONTAINED {
            let (start, radius) = if growth > 0.0 { (end, end_radius) } else { (start, radius) };
            return Self { start, axis: Vector3::zeros(), length: 0.0, radius, slope: 0.0, lean: 0.0 };
        }
        let slope = growth / length;
        let lean = slope / (1.0 - slope * slope).sqrt();
        Self { start, axis: (end - start) / length, length, radius, slope, lean }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    impl Distance {
        /// Signed distance from `p` to the surface, mm: negative inside.
        pub(in crate::stage::surface) fn at(&self, p: &Point3<f64>) -> f64 {
            let from_start = p - self.start;
            let along = from_start.dot(&self.axis);
            let away = (from_start - self.axis * along).norm();
            let s = (along + self.lean * away).clamp(0.0, self.length);
            (from_start - self.axis * s).norm() - (self.radius + self.slope * s)
        }
    }

    fn cone(x: f64, radii: [f64; 2]) -> Distance {
        Distance::to(&RoundCone { centres: [Point3::origin(), Point3::new(x, 0.0, 0.0)], radii })
    }

    #[test]
    fn equals_the_least_over_many_balls() {
        let tapered = cone(10.0, [1.0, 4.0]);
        for (x, y) in [(-3.0, 0.0), (-1.0, 2.0), (2.0, 1.0), (4.0, 7.0), (5.0, 0.0), (9.0, 3.0), (16.0, 1.0)]
        {
            let least = (0..=100_000)
                .map(|i| {
                    let share = f64::from(i) / 100_000.0;
                    f64::hypot(x - 10.0 * share, y) - (1.0 + 3.0 * share)
                })
                .fold(f64::INFINITY, f64::min);
            let got = tapered.at(&Point3::new(x, 0.0, y));
            assert!((got - least).abs() < 1e-8, "({x}, {y}): {got} {least}");
        }
    }

    #[test]
    fn a_contained_ball_does_not_count() {
        for (swallowed, centre) in
            [(cone(1.0, [5.0, 2.0]), 0.0), (cone(1.0, [2.0, 5.0]), 1.0), (cone(3.0, [5.0, 2.0]), 0.0)]
        {
            assert_eq!(swallowed.at(&Point3::new(centre, 0.0, 7.0)), 2.0);
        }
    }
}
