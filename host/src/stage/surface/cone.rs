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

/// The cones of a group, or one of them eight times.
pub(super) struct Cone<L> {
    /// See [`Group`].
    pub(super) middle: Vectors<L>,
    pub(super) axis: Vectors<L>,
    pub(super) low: L,
    pub(super) high: L,
    pub(super) radius: L,
    pub(super) slope: L,
    pub(super) lean: L,
    pub(super) is_ball: bool,
}

impl<L: Floats> Cone<L> {
    /// Those of a group.
    #[inline(always)]
    pub(super) fn each(group: &Group) -> Self {
        Self {
            middle: load(&group.middle),
            axis: load(&group.axis),
            low: L::load(&group.low),
            high: L::load(&group.high),
            radius: L::load(&group.radius),
            slope: L::load(&group.slope),
            lean: L::load(&group.lean),
            is_ball: group.are_balls,
        }
    }

    /// The one at a place in the list.
    #[inline(always)]
    pub(super) fn of(groups: &[Group], place: usize) -> Self {
        let (group, lane) = (&groups[place / LANES], place % LANES);
        let of = |lanes: &[f32; LANES]| L::splat(lanes[lane]);
        Self {
            middle: [of(&group.middle[0]), of(&group.middle[1]), of(&group.middle[2])],
            axis: [of(&group.axis[0]), of(&group.axis[1]), of(&group.axis[2])],
            low: of(&group.low),
            high: of(&group.high),
            radius: of(&group.radius),
            slope: of(&group.slope),
            lean: of(&group.lean),
            is_ball: group.low[lane] == group.high[lane],
        }
    }

    /// As seen from the centres of the balls that decide the distances of points: the points, the squares of how far
    /// that is, and the radii.
    #[inline(always)]
    pub(super) fn balls(&self, offsets: Vectors<L>) -> (Vectors<L>, L, L) {
        let p = plus(self.middle, offsets);
        let square = dot(p, p);
        if self.is_ball {
            return (p, square, self.radius);
        }
        let along = dot(p, self.axis);
        let away = (square - along * along).max(L::splat(0.0));
        let s = (along + self.lean * away.sqrt()).min(self.high).max(self.low);
        let short = along - s;
        (less(p, self.axis, s), short * short + away, self.radius + self.slope * s)
    }

    /// Signed distances, and how far the centres of the balls that decide them are.
    #[inline(always)]
    pub(super) fn at(&self, offsets: Vectors<L>) -> (L, L) {
        let (_, square, radius) = self.balls(offsets);
        let far = square.sqrt();
        (far - radius, far)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use wide::f32x8;

    use super::super::{RoundCone, block::tests::cones, vectors::all};
    use super::*;

    /// In cubes of 0.7 mm, at places about a region's middle: near a surface to a ten-thousandth. Near an axis, deep
    /// inside, digits of `away` are lost, of which nothing depends there but the sign.
    #[test]
    fn both_ways_to_ask_give_the_distances_of_double_precision() {
        let (cube, middle) = (0.7, Point3::new(9.3, 8.1, 7.6));
        let swallowed = RoundCone { centres: [middle, middle + Vector3::x()], radii: [3.0, 1.0] };
        let solid: Vec<_> = cones().iter().chain([&swallowed]).map(Distance::to).collect();
        let (list, mut groups) = (Vec::from_iter(0..solid.len() as u32), Vec::new());
        prepare(&list, &solid, &middle, cube, &mut groups);
        assert_eq!(groups.len(), solid.len().div_ceil(LANES));
        for place in 0..9 * 9 * 9 {
            let way = [place / 81, place / 9 % 9, place % 9].map(|i| f64::from(i - 4));
            let p = middle + Vector3::from(way) * cube;
            let offset = all::<f32x8>(way.map(|x| x as f32));
            let each = groups.iter().flat_map(|group| Cone::each(group).at(offset).0.store());
            for ((number, cone), one_of_eight) in solid.iter().enumerate().zip(each) {
                let exact = cone.at(&p) / cube;
                let alone = Cone::of(&groups, number).at(offset).0.store();
                assert_eq!(alone, [one_of_eight; LANES], "cone {number}, {way:?}");
                let allowed = if exact.abs() < 1.0 { 1e-4 } else { 1e-2 };
                assert!(
                    (f64::from(one_of_eight) - exact).abs() < allowed,
                    "{number} {way:?} {one_of_eight} {exact}"
                );
            }
        }
        let filled = Cone::each(groups.last().unwrap()).at(all::<f32x8>([0.0; 3])).0.store();
        assert!(filled[solid.len() % LANES..].iter().all(|far| *far > 1e14), "{filled:?}");
    }
}
