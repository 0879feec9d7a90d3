//! Branches: the medial balls along each edge of the skeleton graph, in order, ready to be described.
//!
//! * **In**: the path of an edge in pixels, the medial balls and their depths.
//! * **Out**: samples (u, v, rho, d) about every pixel of the path.
//! * **How**: a sample is the average of the balls whose centres lie within 2 px of the path's pixel,
//!   weighted by (1 - (distance / 2 px)^2)^2. Thinning stops short of the last medial ball, most of all in
//!   corners, so a free end is continued along its own direction from ball to ball.
//! * **Cost**: about 200 instructions a pixel of the path, and as many a ball of a tip; the logarithm of the
//!   number of balls is in it.

use crate::arena::Arena;
use crate::bitmap::Plane;
use crate::fixed::{ONE, PX, UNIT, div_round, isqrt};
use crate::limits::{CapacityError, push};
use crate::point::{Direction, Pixel, PixelPoint};
use crate::stage::depth::BallDepth;
use crate::stage::distance::DISTANCE_PX;
use crate::stage::medial::MedialBall;
use crate::strips::{Disc, Strips};
use bytemuck::{Pod, Zeroable};
use heapless::VecView;

/// A ball of the skeleton in the left image, 1/256 px.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Ball {
    /// Horizontal coordinate of the centre.
    pub u: i32,
    /// Vertical coordinate of the centre.
    pub v: i32,
    /// Radius.
    pub rho: i32,
    /// Disparity of the centre.
    pub d: i32,
}

impl Ball {
    /// Its centre.
    pub const fn at(self) -> PixelPoint {
        PixelPoint { u: self.u, v: self.v }
    }
}

/// A ball of a branch, and how well its disparity is known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sample {
    /// The ball.
    pub ball: Ball,
    /// 0..=65536; a fit takes it as at least 1/64.
    pub weight: i32,
}

impl Sample {
    fn of(ball: &MedialBall, depth: &BallDepth) -> Self {
        let (PixelPoint { u, v }, rho, d) = (ball.centre, ball.rho, depth.disparity);
        Self { ball: Ball { u, v, rho, d }, weight: depth.weight * (ONE / UNIT) } // 2^14 x 2^2
    }
}

/// The medial balls of a view with their depths, in the same order.
pub struct Balls<'a> {
    depths: &'a [BallDepth],
    strips: Strips<'a, MedialBall>,
}

impl<'a> Balls<'a> {
    /// Balls that can be found by their places.
    ///
    /// # Errors
    /// A [`CapacityError`] when the scratch is too short.
    pub fn new<'s: 'a>(
        balls: &'a [MedialBall],
        depths: &'a [BallDepth],
        scratch: &mut Arena<'s>,
    ) -> Result<Self, CapacityError> {
        Ok(Self { depths, strips: Strips::new(balls, scratch)? })
    }
}

/// Pixels of a path that balls are looked for together.
const TOGETHER: usize = 8;
/// Balls farther than this from a path's pixel do not count, 1/256 px.
const REACH: i32 = 2 * PX;
/// The next ball beyond a free end is at least this far and at most that far ahead, 1/256 px.
const TIP_STEP: i32 = PX / 4;
const TIP_REACH: i32 = 12 * PX;
/// Fewer samples than this have no direction to be continued in.
const TIP_MIN: usize = 5;
/// Samples that an end's direction is taken over.
const TIP_SPAN: usize = 8;

/// Append the samples of an edge; `free` says which of its ends are end points.
///
/// Nothing is appended where no ball is near, which is the case of paths inside spurs that noise made.
///
/// # Errors
/// A [`CapacityError`] when `samples` is too short.
pub fn trace_branch(
    path: &[Pixel],
    free: [bool; 2],
    balls: &Balls<'_>,
    samples: &mut VecView<Sample>,
) -> Result<(), CapacityError> {
    let start = samples.len();
    for pixels in path.chunks(TOGETHER) {
        let averages = averages(pixels, balls);
        for sample in averages.iter().take(pixels.len()).filter_map(Average::sample) {
            push(samples, sample, "branch samples")?;
        }
    }
    if free[1] {
        continue_tip(start, balls, samples)?;
    }
    if free[0] {
        let turn = |samples: &mut VecView<Sample>| samples.get_mut(start..).unwrap_or_default().reverse();
        turn(samples);
        continue_tip(start, balls, samples)?;
        turn(samples);
    }
    Ok(())
}

/// Append the pixels of a path as they are, with the distance to the background as radius and no
/// disparity: the paper's description of one view's skeleton.
///
/// # Errors
/// A [`CapacityError`] when `samples` is too short.
pub fn trace_pixels(
    path: &[Pixel],
    distance: &Plane<'_, u16>,
    samples: &mut VecView<Sample>,
) -> Result<(), CapacityError> {
    for pixel in path {
        let PixelPoint { u, v } = pixel.centre();
        // At most 2^16 x 2^8.
        let rho =
            i32::from(distance.get(i32::from(pixel.u), i32::from(pixel.v))) * PX / i32::from(DISTANCE_PX);
        push(samples, Sample { ball: Ball { u, v, rho, d: 0 }, weight: ONE }, "branch samples")?;
    }
    Ok(())
}

/// The weighted sum of the balls around a point: of u, v, rho, d and trust, and of the weights.
#[derive(Clone, Copy, Default)]
struct Average {
    sums: [i64; 5],
    total: i64,
}

impl Average {
    fn add(&mut self, weight: i32, Sample { ball: Ball { u, v, rho, d }, weight: trust }: Sample) {
        // A weight of at most 2^24, values below 2^21: 2^16 balls stay below 2^61.
        let weight = i64::from(weight);
        for (sum, value) in self.sums.iter_mut().zip([u, v, rho, d, trust]) {
            *sum += weight * i64::from(value);
        }
        self.total += weight;
    }

    fn sample(&self) -> Option<Sample> {
        let [u, v, rho, d, weight] = self.sums.map(|s| div_round(s, self.total) as i32);
        (self.total > 0).then_some(Sample { ball: Ball { u, v, rho, d }, weight })
    }
}

/// The average around each of at most [`TOGETHER`] pixels, which lie side by side: what is near to one of them is
/// looked for once.
fn averages(pixels: &[Pixel], balls: &Balls<'_>) -> [Average; TOGETHER] {
    let reach_squared = i64::from(REACH).pow(2);
    let mut averages = [Average::default(); TOGETHER];
    let Some(centre) = pixels.get(pixels.len() / 2).map(|p| p.centre()) else { return averages };
    let far = pixels.iter().map(|p| centre.distance_squared(p.centre())).max().unwrap_or(0);
    let radius = REACH + isqrt(far.cast_unsigned()) as i32 + 1;
    balls.strips.walk(Disc { centre, radius }, |k, ball, _| {
        debug_assert!(k < balls.depths.len());
        let Some(depth) = balls.depths.get(k) else { return };
        for (average, pixel) in averages.iter_mut().zip(pixels) {
            let near = reach_squared - pixel.centre().distance_squared(ball.centre);
            if near > 0 {
                // At most 2^18 each; 24 bits of their product are kept.
                average.add(((near * near) >> 12) as i32, Sample::of(ball, depth));
            }
        }
    });
    averages
}

/// Continue the samples from `start` beyond the last one, from ball to ball ahead that does not grow.
fn continue_tip(start: usize, balls: &Balls<'_>, samples: &mut VecView<Sample>) -> Result<(), CapacityError> {
    if samples.len() - start < TIP_MIN {
        return Ok(());
    }
    // From its last ball an object reaches on for at most a few radii: a right angle for 1.4.
    let Some(mut tip) = samples.last().map(|last| last.ball) else { return Ok(()) };
    let mut left = 2 * tip.rho; // Below 2^22.
    loop {
        let behind = samples.get(start.max(samples.len().saturating_sub(1 + TIP_SPAN))).map(|s| s.ball);
        let direction = behind.and_then(|behind| Direction::of(tip.u - behind.u, tip.v - behind.v));
        let Some(direction) = direction else { return Ok(()) };
        let across = Direction { u: -direction.v, v: direction.u };
        // Of equals the first.
        let (mut step, mut next) = (TIP_REACH.min(left), None);
        balls.strips.walk(ahead(tip.at(), step), |k, ball, disc| {
            let along = direction.along(tip.at(), ball.centre);
            let aside = across.along(tip.at(), ball.centre).abs();
            let lies_ahead = along > TIP_STEP && along < step && aside < PX + along / 10;
            if lies_ahead && ball.rho <= tip.rho + PX / 4 {
                (step, next) = (along, balls.depths.get(k).map(|depth| Sample::of(ball, depth)));
                *disc = ahead(tip.at(), along);
            }
        });
        let Some(sample) = next else { return Ok(()) };
        push(samples, sample, "branch samples")?;
        tip = sample.ball;
        left -= step;
    }
}

/// Whatever lies less than `step` ahead of a tip, and by little more than a tenth of that aside, is in here.
fn ahead(tip: PixelPoint, step: i32) -> Disc {
    Disc { centre: tip, radius: (step + step / 8 + 2 * PX).max(0) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use heapless::Vec;

    #[test]
    fn a_path_takes_over_the_balls_and_grows_to_the_last_one() {
        let ball = |k: i32| MedialBall {
            centre: PixelPoint { u: k * PX / 2, v: 10 * PX + 40 },
            rho: 5 * PX - 4 * k,
            contacts: [0, 0],
        };
        let balls: Vec<_, 64> = (0..54).map(ball).collect();
        let depths: Vec<_, 64> =
            (0..54).map(|k| BallDepth { disparity: 90 * PX + k, weight: 16384 }).collect();
        let path: Vec<_, 64> = (2..20).map(|u| Pixel { u, v: 10 }).collect();
        let mut samples = Vec::<_, 64>::new();
        let mut block = [0; 64];
        let all = Balls::new(&balls, &depths, &mut Arena::new(&mut block)).unwrap();
        trace_branch(&path, [false, true], &all, &mut samples).unwrap();
        assert!(samples.iter().all(|s| s.ball.v == 10 * PX + 40));
        assert!(samples.windows(2).all(|w| w[0].ball.u < w[1].ball.u && w[0].ball.rho > w[1].ball.rho));
        let last = samples.last().unwrap().ball.u;
        assert!(last > 52 * PX / 2, "the last ball but for one step: {last}");
    }
}
