//! The animal: a body on four legs with neck, head, two ears and a tail, in the middle of a stride.
//!
//! Our own design, a smooth blend of round cones. Measures are mm; heights count upwards from the
//! ground, x towards the head, z away from the cameras before the animal is turned a little.

use nalgebra::{Point3, Vector3};
use serde::Serialize;

use super::field::{Tube, smooth_line, union};
use super::{PLACE, Solid, turn};

/// What anybody would recognise, as in the paper's Table 5.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Part {
    /// Both ears.
    Ears,
    /// Head and muzzle.
    Mouth,
    /// Body, neck and tail.
    Middle,
    /// All four legs.
    Legs,
}

impl Part {
    /// Every part, in the order of the paper's table.
    pub const ALL: [Self; 4] = [Self::Ears, Self::Mouth, Self::Middle, Self::Legs];

    /// Its name in a table.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ears => "ears",
            Self::Mouth => "mouth",
            Self::Middle => "mid area",
            Self::Legs => "legs",
        }
    }

    /// In how many sections the paper divides it.
    #[must_use]
    pub const fn sections(self) -> usize {
        match self {
            Self::Ears | Self::Mouth => 2,
            Self::Middle => 4,
            Self::Legs => 6,
        }
    }

    /// Unit vector across which its sections lie, left camera's axes: from the ground up for what stands,
    /// from tail to head for what lies.
    #[must_use]
    pub fn axis(self) -> Vector3<f64> {
        let own = match self {
            Self::Ears | Self::Legs => -Vector3::y(),
            Self::Mouth | Self::Middle => Vector3::x(),
        };
        pose() * own
    }
}

/// A limb: its part, its line of `[x, height, z, radius]`, and over how many mm it flows into the rest.
type Limb = (Part, &'static [[f64; 4]], f64);

/// From the middle outwards.
const LIMBS: [Limb; 10] = [
    (
        Part::Middle,
        &[
            [-48.0, 66.0, 0.0, 20.0],
            [-18.0, 63.0, 0.0, 21.0],
            [10.0, 64.0, 0.0, 21.0],
            [30.0, 68.0, 0.0, 19.0],
        ],
        1.0,
    ),
    (Part::Middle, &[[32.0, 72.0, 0.0, 16.0], [46.0, 86.0, 0.0, 13.0], [54.0, 97.0, 0.0, 11.5]], 10.0),
    (Part::Mouth, &[[56.0, 102.0, 0.0, 13.0], [70.0, 97.0, 0.0, 10.5], [84.0, 91.0, 0.0, 8.0]], 6.0),
    (Part::Ears, &[[50.0, 111.0, -6.0, 5.2], [41.0, 124.0, -9.0, 5.4], [35.0, 137.0, -11.0, 3.6]], 4.0),
    (Part::Ears, &[[58.0, 112.0, 6.0, 5.2], [61.0, 126.0, 9.0, 5.4], [63.0, 140.0, 11.0, 3.6]], 4.0),
    (Part::Legs, &[[22.0, 58.0, -9.0, 11.0], [17.0, 34.0, -12.0, 8.0], [9.0, 8.0, -13.0, 6.6]], 7.0),
    (Part::Legs, &[[31.0, 58.0, 9.0, 11.0], [42.0, 35.0, 12.0, 8.0], [47.0, 8.0, 13.0, 6.6]], 7.0),
    (Part::Legs, &[[-52.0, 58.0, -9.0, 12.5], [-62.0, 35.0, -12.0, 8.6], [-66.0, 8.0, -13.0, 6.8]], 7.0),
    (Part::Legs, &[[-42.0, 56.0, 9.0, 12.0], [-33.0, 33.0, 12.0, 8.6], [-31.0, 8.0, 13.0, 6.8]], 7.0),
    (Part::Middle, &[[-62.0, 76.0, 0.0, 7.0], [-78.0, 90.0, 0.0, 5.2], [-93.0, 95.0, 0.0, 4.4]], 6.0),
];
/// Height that stands on the optical axis.
const MIDDLE: f64 = 70.0;

pub(super) fn solid() -> Solid {
    let limbs = LIMBS.map(|(_, line, blend)| (Tube::new(&smooth_line(line, 4)), blend));
    Solid {
        field: Box::new(move |p| {
            let q = upright(p);
            let mut animal = f64::INFINITY;
            for (limb, blend) in &limbs {
                // Where a limb is too far away to blend, its distance does not matter.
                if limb.at_least(&q) < animal + blend {
                    let limb = limb.at(&q);
                    animal = if animal.is_finite() { union(animal, limb, *blend) } else { limb };
                }
            }
            animal
        }),
        low: Point3::new(-98.0, MIDDLE - 145.0, -23.0),
        high: Point3::new(93.0, MIDDLE, 23.0),
        turn: pose(),
    }
}

/// Which part of the animal is nearest to a point in the left camera's axes, mm.
pub fn nearest_part() -> impl Fn(&Point3<f64>) -> Part + Sync {
    let limbs = LIMBS.map(|(part, line, _)| (part, Tube::new(&smooth_line(line, 4))));
    let turn = pose();
    move |p| {
        let q = upright(&Point3::from(turn.tr_mul(&(p - PLACE))));
        let nearest =
            limbs.iter().map(|(part, limb)| (limb.at(&q), *part)).min_by(|a, b| a.0.total_cmp(&b.0));
        nearest.map_or(Part::Middle, |(_, part)| part)
    }
}

/// The same point with its height above the ground.
fn upright(p: &Point3<f64>) -> Point3<f64> {
    Point3::new(p.x, MIDDLE - p.y, p.z)
}

/// Turned away by 18 degrees, so that near and far legs part.
fn pose() -> nalgebra::Matrix3<f64> {
    turn([0.0, 1.0, 0.0], 18.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::Shape;

    #[test]
    fn every_part_has_its_share_of_the_surface_and_its_place() {
        let part_of = nearest_part();
        let mesh = Shape::Animal.mesh(4.0);
        for (part, least) in Part::ALL.into_iter().zip([0.03, 0.05, 0.3, 0.2]) {
            let own = mesh.vertices.iter().filter(|v| part_of(v) == part).count();
            let share = own as f64 / mesh.vertices.len() as f64;
            assert!(share > least, "{}: {share}", part.name());
        }
        // Lowest and highest point: y points down.
        let by_height = |a: &&Point3<f64>, b: &&Point3<f64>| a.y.total_cmp(&b.y);
        assert_eq!(mesh.vertices.iter().max_by(by_height).map(&part_of), Some(Part::Legs));
        assert_eq!(mesh.vertices.iter().min_by(by_height).map(&part_of), Some(Part::Ears));
    }
}
