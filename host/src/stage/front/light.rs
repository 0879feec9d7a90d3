//! Highlights: where an object shines, both eyes do not see the same brightness on the same spot, and agree all the
//! same, on a depth that is not there.
//!
//! * **In**: what an eye sees, and the ball model in it. **Out**: the pixels that highlights may spoil.
//! * **Method**: a dull surface is at most as bright as where it faces the light. That limit is fitted (Lambert's law on
//!   the ball model's normals, robustly, full pixels left out); what is brighter shines. The flank of a highlight is no
//!   brighter than dull parts, but as wide as its core: each core is widened by its own half width, and by the normals
//!   around its own, since a highlight is a cone of normals whatever the shape.
//! * **Over-exposed** is something else: where dull light alone would fill the sensor, nothing is said to shine.
//! * **Cost**: the pixels of the object, and for each highlight about the square of its area.

use super::lattice::rim;
use super::pool::{Lent, Pool};
use super::raster::{Frame, NOTHING};
use super::stereo::{FULL, View, spread};
use crate::mesh::Mesh;
use nalgebra::{Matrix4, Vector3, Vector4};

/// Every so many pixels one is looked at.
const EVERY: i32 = 3;
/// Fewest pixels that a law is fitted to: where nearly all are full, nothing is said to shine.
const FEWEST: usize = 50;
/// Rounds of reweighting.
const ROUNDS: usize = 10;
/// Blur against noise, px.
const BLUR: f64 = 1.5;
/// How much brighter than the dullest explanation something must be to shine: grey levels, and standard deviations.
const BRIGHTER: [f64; 2] = [8.0, 4.0];
/// So many of a hundred normals of a core lie within its angle: the others are those of a wrong model.
const MOST: usize = 80;
/// The angle of a highlight with its flanks, in those of its core, and its most, radians.
const LOBE: f64 = 2.4;
const WIDEST_LOBE: f64 = 1.0;
/// Widest core that is looked for, px.
const WIDEST: usize = 64;

/// Whether each pixel of the view may be spoilt.
pub(super) fn highlights<'p>(pool: &'p Pool, view: &View<'p>, mesh: &Mesh) -> Lent<'p, bool> {
    let none = pool.flags.filled(false, view.picture.levels.len());
    let Some((limit, deviation)) = limit(pool, view, mesh) else { return none };
    if limit >= FULL {
        return none;
    }
    let least = (limit + BRIGHTER[0].max(BRIGHTER[1] * deviation)).min(FULL);
    let smooth = view.picture.blurred(&view.core, BLUR);
    let shines = |(level, core): (&f64, &f64)| *level >= least && *core > 0.0;
    let cores = pool.flags.of(smooth.levels.iter().zip(view.core.iter()).map(shines));
    let mut spoilt = widened(pool, &cores, view.picture.frame);
    spread_by_normals(pool, &cores, view, mesh, &mut spoilt);
    spoilt
}

/// Adds the pixels whose normals lie around those of the cores.
fn spread_by_normals(pool: &Pool, cores: &[bool], view: &View<'_>, mesh: &Mesh, spoilt: &mut [bool]) {
    let normal = |place: usize| {
        let face = view.depths.face[place];
        (face != NOTHING).then(|| mesh.area_normal(face as usize).normalize())
    };
    let shining = || (0..cores.len()).filter(|&place| cores[place]).filter_map(normal);
    let middle = shining().sum::<Vector3<f64>>();
    if middle.norm() < 1.0 {
        return;
    }
    let middle = middle.normalize();
    let angle = |normal: Vector3<f64>| libm::acos(normal.dot(&middle).clamp(-1.0, 1.0));
    let mut angles = pool.numbers.of(shining().map(angle));
    let rank = angles.len() * MOST / 100;
    let (_, &mut core, _) = angles.select_nth_unstable_by(rank, f64::total_cmp);
    let least = libm::cos((LOBE * core).min(WIDEST_LOBE));
    for (place, spoilt) in spoilt.iter_mut().enumerate() {
        *spoilt |= normal(place).is_some_and(|normal| normal.dot(&middle) > least);
    }
}

/// The brightest that a dull surface of this object would be, and the standard deviation from that law; none where too
/// few pixels tell it.
fn limit(pool: &Pool, view: &View<'_>, mesh: &Mesh) -> Option<(f64, f64)> {
    let seen = |(place, [u, v]): (usize, [i32; 2])| {
        let (face, level) = (view.depths.face[place], view.picture.levels[place]);
        let plain = u % EVERY == 0 && v % EVERY == 0 && face != NOTHING;
        let normal = || mesh.area_normal(face as usize).normalize();
        (plain && level < FULL && view.rim.levels[place] >= 3.0).then(|| (normal().push(1.0), level))
    };
    let samples = pool.samples.of(view.picture.frame.pixels().enumerate().filter_map(seen));
    if samples.len() < FEWEST {
        return None;
    }
    let mut law = Vector4::zeros();
    let mut deviation = f64::INFINITY;
    for _ in 0..ROUNDS {
        let mut normal = Matrix4::identity() * 1e-3;
        let mut right = Vector4::zeros();
        for (direction, level) in samples.iter() {
            let weight = 1.0 / (1.0 + ((level - law.dot(direction)) / (2.0 * deviation)).powi(2));
            normal += weight * direction * direction.transpose();
            right += weight * *level * direction;
        }
        law = normal.cholesky()?.solve(&right);
        deviation =
            spread(&pool.numbers, samples.iter().map(|(direction, level)| level - law.dot(direction)))
                .max(1.0);
    }
    Some((law.w + law.xyz().norm(), deviation))
}

/// Each core, and around each disc that fits into it one of twice the radius.
fn widened<'p>(pool: &'p Pool, cores: &[bool], frame: Frame) -> Lent<'p, bool> {
    let depth = rim(&pool.numbers, cores, frame.width, WIDEST);
    let mut spoilt = pool.flags.of(cores.iter().copied());
    for (place, [u, v]) in frame.pixels().enumerate().filter(|(place, _)| cores[*place]) {
        let at = |du, dv| frame.place(u + du, v + dv).map_or(0.0, |place| depth[place]);
        if [(-1, 0), (1, 0), (0, -1), (0, 1)].iter().any(|&(du, dv)| at(du, dv) > depth[place]) {
            continue;
        }
        let reach = 2.0 * depth[place];
        for dv in -(reach as i32)..=reach as i32 {
            let half = (reach * reach - f64::from(dv * dv)).sqrt() as i32;
            for du in -half..=half {
                if let Some(place) = frame.place(u + du, v + dv) {
                    spoilt[place] = true;
                }
            }
        }
    }
    spoilt
}
