//! Which cones may decide somewhere in a region where the surface is.
//!
//! One that does not touch the region cannot. Nor can one that is nowhere the nearest, since another, the rival,
//! is nearer in the whole region, and that follows from what is known in the middle of the region in three ways.
//! With d the distances there, g their gradients, h the reach of the region, w the way from the middle, and R how
//! far the middle is from the centre of the rival's ball that decides there:
//!
//! * distances change by at most the way: d - d' > 2 h;
//! * a cone is convex, and so is the distance to it: it is nowhere below its tangent, and the rival's is at
//!   most its own and |w|^2 / 2R: d - d' > |g - g'| h + h^2 / 2R;
//! * the squares of the distances to two centres differ by a linear function. A short cone is all but its
//!   two end balls, and each of them (V the way from its centre to the middle, r its radius) must be further
//!   than the rival's ball everywhere: |V + w| >= |V' + w| + r - r'. This is sharp where balls follow one
//!   another closely.

use super::{
    block::EDGE,
    bundle::{Bundle, Group, ROUNDING, nearest_ball},
    lanes::{LANES, Lanes, Vectors, all, dot, less, plus},
};

/// Nearer than this to the centre of the ball that decides, rounding blurs the gradient; cubes.
const BLUR: f32 = 0.5;

/// Longer cones are not compared by their ends, cubes.
const SHORT: f32 = 8.0;

/// What four cones answer about the middle of a region.
#[derive(Clone, Copy, Debug)]
pub(super) struct Answer {
    /// Signed distance, cubes.
    distance: Lanes,
    /// From the centre of the ball that decides, cubes.
    from_centre: Lanes,
    /// How the distance grows: a unit vector.
    gradient: Vectors,
    /// Positive where a rival has been found.
    beaten: Lanes,
}

/// The ball of a cone that decides the distance of the middle of the region.
#[derive(Clone, Copy)]
struct Rival {
    distance: f32,
    from_centre: f32,
    gradient: [f32; 3],
    radius: f32,
}

/// A region, as seen from the middle of a bundle.
#[derive(Clone, Copy)]
pub(super) struct Around {
    /// Of its middle, cubes.
    pub(super) offset: [f32; 3],
    /// How far its corners are from its middle, cubes.
    pub(super) reach: f32,
}

/// Appends to `kept` the cones of `bundle` that come within [`EDGE`] of a region and may be the nearest somewhere in
/// it; nothing if the surface passes nowhere so near. `answers` is room to work in.
pub(super) fn prune(bundle: &Bundle, around: Around, answers: &mut Vec<Answer>, kept: &mut Vec<u32>) {
    let offset = all(around.offset);
    answers.clear();
    answers.extend(bundle.groups.iter().map(|group| ask(group, offset)));
    let first = place_of_least(answers, |answer| answer.distance);
    let rival = rival(answers, first);
    if rival.distance.abs() > around.reach + EDGE + ROUNDING * (rival.from_centre + around.reach) {
        return;
    }
    let touching = Lanes::splat(around.reach + EDGE);
    for answer in &mut *answers {
        let apart = answer.distance - touching - answer.from_centre * Lanes::splat(ROUNDING);
        answer.beaten = by_distance(answer, rival, around.reach).fast_max(apart);
    }
    if bundle.cones.len() > LANES {
        let compare = |answers: &mut [Answer], rival: Rival| {
            for (answer, group) in answers.iter_mut().zip(bundle.groups) {
                answer.beaten = answer.beaten.fast_max(by_ball(group, rival, offset, around.reach));
            }
        };
        let axis =
            bundle.groups[first / LANES].axis.map(|axis| axis.to_array()[first % LANES] * around.reach);
        if axis == [0.0; 3] {
            compare(answers, rival);
        } else {
            // The balls that follow one another are most alike ahead of the middle and behind it.
            for ahead in [axis, axis.map(|x| -x)] {
                let way = all(ahead);
                let place = place_of_least(answers, |answer| answer.ahead(way, around.reach));
                let rival = self::rival(answers, place);
                compare(answers, rival);
            }
        }
    }
    for (cones, answer) in bundle.cones.chunks(LANES).zip(&*answers) {
        let beaten = Lanes::ZERO.simd_lt(answer.beaten).to_bitmask();
        kept.extend(cones.iter().enumerate().filter(|&(i, _)| beaten >> i & 1 == 0).map(|(_, &cone)| cone));
    }
}

/// What the cones of a group answer about a point.
#[inline(always)]
fn ask(group: &Group, offset: Vectors) -> Answer {
    let p = plus(group.middle, offset);
    let along = dot(p, group.axis);
    let away = (dot(p, p) - along * along).fast_max(Lanes::ZERO);
    let (_, s) = nearest_ball(along, away, [group.low, group.high, group.lean]);
    let from_centre = less(p, group.axis, s);
    let far = dot(from_centre, from_centre).sqrt();
    let scale = Lanes::ONE / far.fast_max(Lanes::splat(f32::MIN_POSITIVE));
    Answer {
        distance: far - (group.radius + group.slope * s),
        from_centre: far,
        gradient: [from_centre[0] * scale, from_centre[1] * scale, from_centre[2] * scale],
        beaten: Lanes::ZERO,
    }
}

/// The place of the cone of which `value` is the least.
fn place_of_least(answers: &[Answer], value: impl Fn(&Answer) -> Lanes) -> usize {
    let mut least = Lanes::splat(f32::INFINITY);
    // As numbers, which are exact for all that there is memory for.
    let mut groups = Lanes::ZERO;
    for (group, answer) in answers.iter().enumerate() {
        let value = value(answer);
        groups = value.simd_lt(least).bitselect(Lanes::splat(group as f32), groups);
        least = value.fast_min(least);
    }
    let least = least.to_array();
    let lane = (1..LANES).fold(0, |best, i| if least[i] < least[best] { i } else { best });
    groups.to_array()[lane] as usize * LANES + lane
}

fn rival(answers: &[Answer], place: usize) -> Rival {
    let (answer, lane) = (&answers[place / LANES], place % LANES);
    let (distance, from_centre) = (answer.distance.to_array()[lane], answer.from_centre.to_array()[lane]);
    let gradient = answer.gradient.map(|axis| axis.to_array()[lane]);
    Rival { distance, from_centre, gradient, radius: from_centre - distance }
}

impl Answer {
    /// About the distances of a point that is `way` from the middle, `reach` in length.
    #[inline(always)]
    fn ahead(&self, way: Vectors, reach: f32) -> Lanes {
        let uphill = dot(self.gradient, way);
        let across = Lanes::splat(reach * reach) - uphill * uphill;
        self.distance + uphill + across / (self.from_centre + self.from_centre + Lanes::splat(reach))
    }
}

/// Compares by the way, and by tangents: positive where the rival is nearer everywhere.
#[inline(always)]
fn by_distance(answer: &Answer, rival: Rival, reach: f32) -> Lanes {
    let gradient = all(rival.gradient);
    let turned = less(answer.gradient, gradient, Lanes::splat(1.0));
    let tangent = dot(turned, turned).sqrt() * Lanes::splat(reach)
        + Lanes::splat(reach * reach / (2.0 * rival.from_centre));
    let rounding = (answer.from_centre + Lanes::splat(rival.from_centre + reach)) * Lanes::splat(ROUNDING);
    let further = answer.distance - Lanes::splat(rival.distance) - rounding;
    // Blurred gradients count as opposite ones.
    let blurred =
        answer.from_centre.simd_lt(Lanes::splat(BLUR)).bitselect(Lanes::splat(f32::INFINITY), Lanes::ZERO);
    further - (tangent + blurred).fast_min(Lanes::splat(2.0 * reach))
}

/// Compares the balls of one end of each cone by the squares of distances to centres.
#[inline(always)]
fn end_by_ball(group: &Group, end: Lanes, rival: Rival, offset: Vectors, reach: f32) -> Lanes {
    let gradient = all(rival.gradient);
    let far = Lanes::splat(rival.from_centre);
    let square = far * far;
    // Never infinite, as nothing times that is no number; and still more than any way across the region.
    let bend = Lanes::splat(reach * reach / rival.from_centre.max(1e-6));
    let p = less(plus(group.middle, offset), group.axis, end);
    let own = dot(p, p);
    let larger = group.radius + group.slope * end - Lanes::splat(rival.radius);
    let turned = less(p, gradient, far + larger);
    let rounding = (own + square + larger * larger + Lanes::splat(reach * reach)) * Lanes::splat(ROUNDING);
    own - square
        - larger * (far + far + larger)
        - dot(turned, turned).sqrt() * Lanes::splat(2.0 * reach)
        - larger.fast_max(Lanes::ZERO) * bend
        - rounding
}

/// Compares by the squares of distances to centres: positive where the rival is nearer everywhere.
#[inline(always)]
fn by_ball(group: &Group, rival: Rival, offset: Vectors, reach: f32) -> Lanes {
    let low = end_by_ball(group, group.low, rival, offset, reach);
    let length = group.high - group.low;
    if !Lanes::ZERO.simd_lt(length).any() {
        return low;
    }
    let high = end_by_ball(group, group.high, rival, offset, reach);
    let ends = low.fast_min(high) - length * length * Lanes::splat(0.25);
    // A long cone is not its ends.
    length.simd_lt(Lanes::splat(SHORT)).bitselect(ends, Lanes::splat(-1.0))
}
