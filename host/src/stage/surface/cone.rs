//! Cones near the middle of a region: eight about one point, or one about eight points.
//!
//! In: cones and points, in cubes from that middle. Out: distances in single precision, in cubes, and how far the
//! centres of the balls are that decide them, with which their rounding goes.

use nalgebra::Point3;

use super::{
    distance::Distance,
    vectors::{Vectors, dot, less, load, plus},
};
use crate::lanes::{Floats, LANES};

/// So far off, in cubes, is what fills the last group.
const NOWHERE: f32 = 1e15;

/// Eight cones, in cubes, as seen from the middle of a region: by the point of the axis nearest to it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Group {
    /// From that point to the middle.
    pub(super) middle: [[f32; LANES]; 3],
    /// Unit vector along the axis; zero for a ball.
    pub(super) axis: [[f32; LANES]; 3],
    /// The ends of the axis, from that point.
    pub(super) low: [f32; LANES],
    pub(super) high: [f32; LANES],
    /// The radius there, its growth along the axis, and the tangent of the side's angle to it.
    pub(super) radius: [f32; LANES],
    pub(super) slope: [f32; LANES],
    pub(super) lean: [f32; LANES],
    /// Whether all are balls, of which the ends are one point.
    pub(super) are_balls: bool,
}

impl Group {
    /// Up to eight cones, around `middle`, in lengths of 1 / `scale` mm.
    fn of(cones: &[u32], all: &[Distance], middle: &Point3<f64>, scale: f64) -> Self {
        let none = [0.0; LANES];
        // What fills the group is a point nowhere near.
        let mut group = Self {
            middle: [[NOWHERE; LANES], none, none],
            axis: [none; 3],
            low: none,
            high: none,
            radius: none,
            slope: none,
            lean: none,
            are_balls: true,
        };
        for (lane, &cone) in cones.iter().enumerate() {
            let cone = &all[cone as usize];
            let mut from_base = middle - cone.start;
            let mut radius = cone.radius;
            if cone.length > 0.0 {
                let base = from_base.dot(&cone.axis).clamp(0.0, cone.length);
                from_base -= cone.axis * base;
                radius += cone.slope * base;
                for axis in 0..3 {
                    group.axis[axis][lane] = cone.axis[axis] as f32;
                }
                group.low[lane] = (-base * scale) as f32;
                group.high[lane] = ((cone.length - base) * scale) as f32;
                group.slope[lane] = cone.slope as f32;
                group.lean[lane] = cone.lean as f32;
                group.are_balls = false;
            }
            for axis in 0..3 {
                group.middle[axis][lane] = (from_base[axis] * scale) as f32;
            }
            group.radius[lane] = (radius * scale) as f32;
        }
        group
    }

    /// As seen from the centres of the balls that decide the distances of a point at `offset` from the middle: the
    /// point, the squares of how far that is, and the radii.
    #[inline(always)]
    pub(super) fn balls<L: Floats>(&self, offset: Vectors<L>) -> (Vectors<L>, L, L) {
        let p = plus(load(&self.middle), offset);
        let radius = L::load(&self.radius);
        if self.are_balls {
            return (p, dot(p, p), radius);
        }
        let axis = load(&self.axis);
        let along = dot(p, axis);
        let away = (dot(p, p) - along * along).max(L::splat(0.0));
        let extent = [L::load(&self.low), L::load(&self.high), L::load(&self.lean)];
        let (square, s) = nearest_ball(along, away, extent);
        (less(p, axis, s), square, radius + L::load(&self.slope) * s)
    }
}

/// Appends the groups of `cones`, as seen from `middle`, with cubes of `cube` mm.
pub(super) fn prepare(
    cones: &[u32],
    all: &[Distance],
    middle: &Point3<f64>,
    cube: f64,
    groups: &mut Vec<Group>,
) {
    groups.extend(cones.chunks(LANES).map(|cones| Group::of(cones, all, middle, 1.0 / cube)));
}

/// One cone of a group, eight times.
pub(super) struct Cone<L> {
    /// See [`Group`].
    pub(super) middle: Vectors<L>,
    pub(super) axis: Vectors<L>,
    pub(super) low: L,
    pub(super) high: L,
    pub(super) radius: L,
    pub(super) slope: L,
    lean: L,
    /// 1 less the square of the slope, and 1 divided by that.
    pub(super) flat: L,
    pub(super) steep: L,
    pub(super) is_ball: bool,
}

impl<L: Floats> Cone<L> {
    /// The cone at a place in the list.
    #[inline(always)]
    pub(super) fn of(groups: &[Group], place: usize) -> Self {
        let (group, lane) = (&groups[place / LANES], place % LANES);
        let lean = group.lean[lane];
        let steep = 1.0 + lean * lean;
        let of = |lanes: &[f32; LANES]| L::splat(lanes[lane]);
        Self {
            middle: [of(&group.middle[0]), of(&group.middle[1]), of(&group.middle[2])],
            axis: [of(&group.axis[0]), of(&group.axis[1]), of(&group.axis[2])],
            low: of(&group.low),
            high: of(&group.high),
            radius: of(&group.radius),
            slope: of(&group.slope),
            lean: L::splat(lean),
            flat: L::splat(1.0 / steep),
            steep: L::splat(steep),
            is_ball: group.low[lane] == group.high[lane],
        }
    }

    /// Signed distances, and how far the centres of the balls that decide them are.
    #[inline(always)]
    pub(super) fn at(&self, offsets: Vectors<L>) -> (L, L) {
        let p = plus(self.middle, offsets);
        let square = dot(p, p);
        if self.is_ball {
            let far = square.sqrt();
            return (far - self.radius, far);
        }
        let along = dot(p, self.axis);
        let away = (square - along * along).max(L::splat(0.0));
        let (square, s) = nearest_ball(along, away, [self.low, self.high, self.lean]);
        let far = square.sqrt();
        (far - (self.radius + self.slope * s), far)
    }
}

/// The square of how far a point is from the centre of the ball that decides its distance, and where on the
/// axis that is; from where the point is along the axis, and the square of how far away from it.
#[inline(always)]
pub(super) fn nearest_ball<L: Floats>(along: L, away: L, [low, high, lean]: [L; 3]) -> (L, L) {
    let s = (along + lean * away.sqrt()).min(high).max(low);
    let short = along - s;
    (short * short + away, s)
}
