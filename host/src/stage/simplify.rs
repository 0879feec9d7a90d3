//! Fewer round cones for the same solid: cones that follow one another closely along a line become one.
//!
//! * **In**: round cones in the order of their chains, mm, and a tolerance, mm. **Out**: the same list, shorter.
//! * **Bound**: no point of the old union is farther than the tolerance from the new one, nor the other way round
//!   (Hausdorff distance).
//! * **Why**: a round cone is the union of the balls interpolated between its two ends. When a long cone replaces a
//!   run of cones, each ball between the run's ends has a partner in the long cone, such that the way between the
//!   centres and the difference of the radii add up to no more than the tolerance: either ball lies in the other one
//!   grown by as much. That sum is convex, so it is no more for the balls between two of those, which are partners in
//!   the same shares; and as the partners go from one end of the long cone to the other without a jump, each of its
//!   balls is the partner of one of the run.
//! * **Cost**: about n log n for n cones.

use super::surface::RoundCone;
use nalgebra::Vector4;

/// Replace runs of `cones` by longer ones wherever the solid moves by no more than `tolerance`, mm.
pub fn simplify(cones: &mut Vec<RoundCone>, tolerance: f64) {
    let (mut from, mut kept) = (0, 0);
    while from < cones.len() {
        let length = longest(&cones[from..], tolerance);
        cones[kept] = joined(&cones[from..from + length]);
        from += length;
        kept += 1;
    }
    cones.truncate(kept);
}

/// How many of the first cones one may replace: found in steps that double while that goes well.
fn longest(cones: &[RoundCone], tolerance: f64) -> usize {
    let (mut length, mut step) = (1, 1);
    loop {
        let next = length + step;
        if next <= cones.len() && is_near(&cones[..next], tolerance) {
            length = next;
            step *= 2;
        } else if step > 1 {
            step /= 2;
        } else {
            return length;
        }
    }
}

/// From the start of the first to the end of the last.
fn joined(run: &[RoundCone]) -> RoundCone {
    let (first, last) = (&run[0], &run[run.len() - 1]);
    RoundCone { centres: [first.centres[0], last.centres[1]], radii: [first.radii[0], last.radii[1]] }
}

/// Whether each cone begins where the one before ends, at a ball near one of the cone that joins them all.
fn is_near(run: &[RoundCone], tolerance: f64) -> bool {
    let [start, end] = [0, 1].map(|end| ball(&joined(run), end));
    let way = end - start;
    let square = way.norm_squared();
    run.windows(2).all(|pair| {
        let here = ball(&pair[1], 0);
        let from_start = here - start;
        let share = if square > 0.0 { (from_start.dot(&way) / square).clamp(0.0, 1.0) } else { 0.0 };
        let off = from_start - way * share;
        here == ball(&pair[0], 1) && off.xyz().norm() + off.w.abs() <= tolerance
    })
}

/// Centre and radius of an end.
fn ball(cone: &RoundCone, end: usize) -> Vector4<f64> {
    cone.centres[end].coords.push(cone.radii[end])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use nalgebra::{Point3, Vector3};

    /// Balls of all cones, a tenth of a millimetre from one another.
    fn balls(cones: &[RoundCone]) -> Vec<(Point3<f64>, f64)> {
        let between = |cone: &RoundCone| {
            let [start, end] = [0, 1].map(|end| ball(cone, end));
            let steps = 1.0 + ((end - start).norm() / 0.1).floor();
            (0..=steps as u32).map(move |i| {
                let ball = start + (end - start) * (f64::from(i) / steps);
                (Point3::from(ball.xyz()), ball.w)
            })
        };
        cones.iter().flat_map(between).collect()
    }

    /// How far the furthest of some points on the balls of one solid is from the other.
    fn furthest(from: &[(Point3<f64>, f64)], to: &[(Point3<f64>, f64)], random: &mut Random) -> f64 {
        let off = |p: Point3<f64>| to.iter().map(|(c, r)| (p - c).norm() - r).fold(f64::INFINITY, f64::min);
        let on = |&(centre, radius): &(Point3<f64>, f64)| {
            off(centre + Vector3::from_fn(|_, _| random.normal()).normalize() * radius)
        };
        from.iter().map(on).fold(0.0, f64::max)
    }

    #[test]
    fn the_solid_moves_by_no_more_than_the_tolerance() {
        let mut random = Random::new(11);
        for (noise, tolerance) in [(0.0, 0.0), (0.0, 0.05), (0.02, 0.1), (0.1, 0.5), (0.5, 0.1), (0.1, 30.0)]
        {
            // A bent limb, apart from it a single ball, and a ring.
            let mut at = |i: i32, bend: f64| {
                let s = f64::from(i) * 0.3;
                let noise = Vector4::from_fn(|_, _| noise * random.normal());
                Vector4::new(s, bend * (0.2 * s).sin(), bend * (0.2 * s).cos(), 4.0 + (0.3 * s).sin()) + noise
            };
            let limb: Vec<_> = (0..60).map(|i| at(i, 6.0)).collect();
            let mut ring: Vec<_> = (0..30).map(|i| at(i, 3.0)).collect();
            ring.push(ring[0]);
            let cone = |pair: &[Vector4<f64>]| RoundCone {
                centres: [pair[0].xyz().into(), pair[1].xyz().into()],
                radii: [pair[0].w, pair[1].w],
            };
            let alone = cone(&[at(5, 20.0); 2]);
            let ends = [limb[59]; 2];
            let mut old: Vec<_> = limb.windows(2).chain([&ends[..]]).map(cone).collect();
            old.push(alone);
            old.extend(ring.windows(2).map(cone));
            let mut new = old.clone();
            simplify(&mut new, tolerance);
            assert!(new.len() < if noise < tolerance { 40 } else { old.len() }, "{noise} {tolerance}");
            assert!(new.contains(&alone), "{noise} {tolerance}");
            let (old, new) = (balls(&old), balls(&new));
            let apart = furthest(&old, &new, &mut random).max(furthest(&new, &old, &mut random));
            assert!(apart <= tolerance + 1e-3, "{noise} {tolerance} {apart}");
        }
        simplify(&mut Vec::new(), 1.0);
    }
}
