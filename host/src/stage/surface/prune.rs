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
    bundle::{Bundle, ROUNDING},
    cone::{Cone, Group},
    region::Around,
    vectors::{Vectors, all, dot, less, load, plus, store, times},
};
use crate::{
    lanes::{Floats, LANES, Work},
    wide::widest,
};

/// Nearer than this to the centre of the ball that decides, rounding blurs the gradient; cubes.
const BLUR: f32 = 0.5;

/// Longer cones are not compared by their ends, cubes.
const SHORT: f32 = 8.0;

/// What eight cones answer about the middle of a region.
#[derive(Clone, Copy, Debug)]
pub(super) struct Answer {
    /// Signed distance, cubes.
    distance: [f32; LANES],
    /// From the centre of the ball that decides, cubes.
    from_centre: [f32; LANES],
    /// How the distance grows: a unit vector.
    gradient: [[f32; LANES]; 3],
    /// Positive where a rival has been found.
    beaten: [f32; LANES],
}

/// The ball of a cone that decides the distance of the middle of the region.
#[derive(Clone, Copy)]
struct Rival {
    distance: f32,
    from_centre: f32,
    gradient: [f32; 3],
    radius: f32,
}

/// Whether the surface passes within [`EDGE`] of a region. If so, appends to `kept` the cones of `bundle` that come
/// within its margin and may be the nearest somewhere in it. `answers` is room to work in.
pub(super) fn prune(bundle: &Bundle, around: Around, answers: &mut Vec<Answer>, kept: &mut Vec<u32>) -> bool {
    widest(Prune { bundle, around, answers, kept })
}

/// See [`prune`].
struct Prune<'a> {
    bundle: &'a Bundle<'a>,
    around: Around,
    answers: &'a mut Vec<Answer>,
    kept: &'a mut Vec<u32>,
}

impl Work for Prune<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<L: Floats>(self) -> bool {
        let Self { bundle, around: Around { offset, reach, margin }, answers, kept } = self;
        if bundle.cones.is_empty() {
            return false;
        }
        let offset = all::<L>(offset);
        answers.clear();
        for group in bundle.groups {
            answers.push(ask(group, offset));
        }
        let mut least = Least::<L>::none();
        for (i, answer) in answers.iter().enumerate() {
            least.see(i, L::load(&answer.distance));
        }
        let first = least.place();
        let rival = Rival::of(answers, first);
        if rival.distance.abs() > reach + EDGE + ROUNDING * (rival.from_centre + reach) {
            return false;
        }
        for answer in &mut **answers {
            let rounding = L::load(&answer.from_centre) * L::splat(ROUNDING);
            let apart = L::load(&answer.distance) - L::splat(reach + margin) - rounding;
            answer.beaten = by_distance::<L>(answer, rival, reach).max(apart).store();
        }
        if bundle.cones.len() > LANES {
            let axis = bundle.groups[first / LANES].axis.map(|axis| axis[first % LANES] * reach);
            if axis == [0.0; 3] {
                compare(bundle, answers, rival, offset, reach);
            } else {
                // The balls that follow one another are most alike ahead of the middle and behind it.
                for ahead in [axis, axis.map(|x| -x)] {
                    let way = all(ahead);
                    let mut least = Least::<L>::none();
                    for (i, answer) in answers.iter().enumerate() {
                        least.see(i, answer.ahead(way, reach));
                    }
                    let rival = Rival::of(answers, least.place());
                    compare(bundle, answers, rival, offset, reach);
                }
            }
        }
        // Without a branch, as nobody could foretell it.
        let mut end = kept.len();
        kept.resize(end + bundle.cones.len(), 0);
        for (cones, answer) in bundle.cones.chunks(LANES).zip(&**answers) {
            let beaten = L::splat(0.0).is_below(L::load(&answer.beaten)).bits();
            for (i, &cone) in cones.iter().enumerate() {
                kept[end] = cone;
                end += (!beaten >> i & 1) as usize;
            }
        }
        kept.truncate(end);
        true
    }
}

/// What the cones of a group answer about a point.
#[inline(always)]
fn ask<L: Floats>(group: &Group, offset: Vectors<L>) -> Answer {
    let (from_centre, square, radius) = Cone::each(group).balls(offset);
    let far = square.sqrt();
    let scale = L::splat(1.0) / far.max(L::splat(f32::MIN_POSITIVE));
    Answer {
        distance: (far - radius).store(),
        from_centre: far.store(),
        gradient: store(times(from_centre, scale)),
        beaten: [0.0; LANES],
    }
}

/// The cone of which a value is the least.
struct Least<L> {
    least: L,
    /// As numbers, which are exact for all that there is memory for.
    groups: L,
}

impl<L: Floats> Least<L> {
    #[inline(always)]
    fn none() -> Self {
        Self { least: L::splat(f32::INFINITY), groups: L::splat(0.0) }
    }

    /// The values of a group's cones.
    #[inline(always)]
    fn see(&mut self, group: usize, value: L) {
        self.groups = value.is_below(self.least).choose(L::splat(group as f32), self.groups);
        self.least = value.min(self.least);
    }

    /// Its place.
    #[inline(always)]
    fn place(&self) -> usize {
        let least = self.least.store();
        let lane = (1..LANES).fold(0, |best, i| if least[i] < least[best] { i } else { best });
        self.groups.store()[lane] as usize * LANES + lane
    }
}

impl Rival {
    fn of(answers: &[Answer], place: usize) -> Self {
        let (answer, lane) = (&answers[place / LANES], place % LANES);
        let (distance, from_centre) = (answer.distance[lane], answer.from_centre[lane]);
        let gradient = answer.gradient.map(|axis| axis[lane]);
        Self { distance, from_centre, gradient, radius: from_centre - distance }
    }
}

impl Answer {
    /// About the distances of a point that is `way` from the middle, `reach` in length.
    #[inline(always)]
    fn ahead<L: Floats>(&self, way: Vectors<L>, reach: f32) -> L {
        let uphill = dot(load(&self.gradient), way);
        let across = L::splat(reach * reach) - uphill * uphill;
        let from_centre = L::load(&self.from_centre);
        L::load(&self.distance) + uphill + across / (from_centre + from_centre + L::splat(reach))
    }
}

/// Compares by the way, and by tangents: positive where the rival is nearer everywhere.
#[inline(always)]
fn by_distance<L: Floats>(answer: &Answer, rival: Rival, reach: f32) -> L {
    let from_centre = L::load(&answer.from_centre);
    let turned = less(load(&answer.gradient), all(rival.gradient), L::splat(1.0));
    let tangent =
        dot(turned, turned).sqrt() * L::splat(reach) + L::splat(reach * reach / (2.0 * rival.from_centre));
    let rounding = (from_centre + L::splat(rival.from_centre + reach)) * L::splat(ROUNDING);
    let further = L::load(&answer.distance) - L::splat(rival.distance) - rounding;
    // Blurred gradients count as opposite ones.
    let opposite = L::splat(2.0 * reach);
    further - from_centre.is_below(L::splat(BLUR)).choose(opposite, tangent.min(opposite))
}

/// Compares all cones with a rival by the squares of distances to centres.
#[inline(always)]
fn compare<L: Floats>(bundle: &Bundle, answers: &mut [Answer], rival: Rival, offset: Vectors<L>, reach: f32) {
    for (answer, group) in answers.iter_mut().zip(bundle.groups) {
        answer.beaten = L::load(&answer.beaten).max(by_ball(group, rival, offset, reach)).store();
    }
}

/// Compares the balls of one end of each cone by the squares of distances to centres.
#[inline(always)]
fn end_by_ball<L: Floats>(group: &Group, end: L, rival: Rival, offset: Vectors<L>, reach: f32) -> L {
    let far = L::splat(rival.from_centre);
    let square = far * far;
    // Never infinite, as nothing times that is no number; and still more than any way across the region.
    let bend = L::splat(reach * reach / rival.from_centre.max(1e-6));
    let p = less(plus(load(&group.middle), offset), load(&group.axis), end);
    let own = dot(p, p);
    let larger = L::load(&group.radius) + L::load(&group.slope) * end - L::splat(rival.radius);
    let turned = less(p, all(rival.gradient), far + larger);
    let rounding = (own + square + larger * larger + L::splat(reach * reach)) * L::splat(ROUNDING);
    own - square
        - larger * (far + far + larger)
        - dot(turned, turned).sqrt() * L::splat(2.0 * reach)
        - larger.max(L::splat(0.0)) * bend
        - rounding
}

/// Compares by the squares of distances to centres: positive where the rival is nearer everywhere.
#[inline(always)]
fn by_ball<L: Floats>(group: &Group, rival: Rival, offset: Vectors<L>, reach: f32) -> L {
    let low = end_by_ball(group, L::load(&group.low), rival, offset, reach);
    if group.are_balls {
        return low;
    }
    let length = L::load(&group.high) - L::load(&group.low);
    let high = end_by_ball(group, L::load(&group.high), rival, offset, reach);
    let ends = low.min(high) - length * length * L::splat(0.25);
    // A long cone is not its ends.
    length.is_below(L::splat(SHORT)).choose(ends, L::splat(-1.0))
}
