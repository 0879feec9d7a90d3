//! The exact signed distance to a round cone.
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

/// A round cone made ready for many distance queries.
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

    /// Signed distance from `p` to the surface, mm: negative inside.
    pub(super) fn at(&self, p: &Point3<f64>) -> f64 {
        let (along, away, s) = self.nearest_ball(p);
        ((along - s) * (along - s) + away * away).sqrt() - (self.radius + self.slope * s)
    }

    /// The unit vector along which the distance grows fastest at `p`; none within `blur` mm of the middle
    /// of the ball that decides, where rounding blurs the direction.
    pub(super) fn outward(&self, p: &Point3<f64>, blur: f64) -> Option<Vector3<f64>> {
        let (_, _, s) = self.nearest_ball(p);
        (p - (self.start + self.axis * s)).try_normalize(blur)
    }

    /// Where the ray from `from` by `step` leaves the cone, as a share of the step; none if it does not meet
    /// it.
    ///
    /// Of the balls between the ends the one that the ray leaves last decides: where the side's quadric is
    /// left at a ball between the ends, that is the place, and otherwise it is at one of the ends.
    pub(super) fn exit(&self, from: &Point3<f64>, step: &Vector3<f64>) -> Option<f64> {
        let from_start = from - self.start;
        // Of the ball at the start; those of others follow.
        let [a, b, c] = [
            step.norm_squared(),
            from_start.dot(step),
            from_start.norm_squared() - self.radius * self.radius,
        ];
        if self.length == 0.0 {
            return exit_of(a, b, c);
        }
        let (along, ahead) = (from_start.dot(&self.axis), step.dot(&self.axis));
        let base = along + self.slope * self.radius;
        let flat = 1.0 - self.slope * self.slope;
        // A point is deepest, by squares, in the ball at `deepest`, which moves by `moved` a step.
        let (deepest, moved) = (base / flat, ahead / flat);
        let side = exit_of(a - ahead * moved, b - base * moved, c - base * deepest);
        if let Some(share) = side.filter(|share| (0.0..=self.length).contains(&(deepest + moved * share))) {
            return Some(share);
        }
        let of_ball = |s: f64| exit_of(a, b - ahead * s, c - (base + base - flat * s) * s);
        [of_ball(0.0), of_ball(self.length)].into_iter().flatten().reduce(f64::max)
    }

    /// Where `p` is along the axis and away from it, and the ball that decides its distance, all in mm.
    fn nearest_ball(&self, p: &Point3<f64>) -> (f64, f64, f64) {
        let from_start = p - self.start;
        let along = from_start.dot(&self.axis);
        let away = (from_start - self.axis * along).norm();
        (along, away, (along + self.lean * away).clamp(0.0, self.length))
    }
}

/// The zero of a t^2 + 2 b t + c at which it grows.
fn exit_of(a: f64, b: f64, c: f64) -> Option<f64> {
    let root = (b * b - a * c).sqrt();
    let zero = if b > 0.0 { -c / (b + root) } else { (root - b) / a };
    zero.is_finite().then_some(zero)
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn a_ray_leaves_where_the_distance_is_zero_and_grows() {
        let at = |i: i32, n: i32| f64::from(i * n % 17) - 8.0;
        let mut left = 0;
        for (radii, i) in [[2.0, 5.0], [5.0, 2.0], [3.0, 3.0], [9.0, 1.0], [0.5, 10.4]]
            .iter()
            .flat_map(|r| (0..40).map(move |i| (*r, i)))
        {
            let cone = cone(10.0, radii);
            let from = Point3::new(f64::from(i % 11), 0.3 * at(i, 5), 0.3 * at(i, 7));
            let step = Vector3::new(at(i, 3), at(i, 11), at(i, 13) + 0.5);
            if cone.at(&from) >= 0.0 {
                continue;
            }
            let share = cone.exit(&from, &step).unwrap();
            let beyond = from + step * (share + 1e-3);
            assert!(cone.at(&(from + step * share)).abs() < 1e-7, "{radii:?} {i}");
            assert!(share > 0.0 && cone.at(&beyond) > 0.0, "{radii:?} {i}");
            left += 1;
        }
        assert!(left > 100, "{left}");
        assert_eq!(cone(10.0, [1.0, 2.0]).exit(&Point3::new(0.0, 9.0, 0.0), &Vector3::x()), None);
    }

    #[test]
    fn a_contained_ball_does_not_count() {
        for (swallowed, centre) in
            [(cone(1.0, [5.0, 2.0]), 0.0), (cone(1.0, [2.0, 5.0]), 1.0), (cone(3.0, [5.0, 2.0]), 0.0)]
        {
            assert_eq!(swallowed.at(&Point3::new(centre, 0.0, 7.0)), 2.0);
            assert_eq!(swallowed.outward(&Point3::new(centre, 0.0, 7.0), 0.0), Some(Vector3::z()));
            assert_eq!(swallowed.outward(&Point3::new(centre, 0.0, 0.0), 0.0), None);
        }
    }
}
