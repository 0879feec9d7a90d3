//! NURBS curves along the edges of the skeleton (paper 2.2, "NURBS Curves Approximation"): the compact
//! description of a row of balls.
//!
//! **In**: balls along an edge (u, v, rho, d in 1/256 px) with weights. **Out**: a cubic in these four
//! channels: clamped uniform knots on an open edge, periodic uniform knots on a closed one, which is
//! therefore C2 all round. The fit gives unit weights; evaluation is rational and honours others.
//!
//! The fit resamples the balls linearly at 1 px of arc in (u, v) and minimises
//!
//! ```text
//!   sum weight |curve(t) - ball|^2 + smoothing sum |second difference of control points|^2
//! ```
//!
//! with t proportional to arc, one control point per `spacing` of arc + 3, the ends of an open curve
//! weighing more. At least 8 samples: always well posed. An open edge of fewer than 6 balls or 3 px
//! becomes the straight line from its first to its last ball in four control points; a single ball four
//! equal ones; no ball no curve.
//!
//! **Bounds**: coordinates within +-2^20 (others are brought there), 2^20 balls; arcs over 65535 px are
//! resampled at 65536 points; at most [`MAX_CONTROLS`] control points,
//! beyond which they stand farther apart. **Error**: control points within 1/256 px of the exact
//! minimum, evaluation within half of that. **Cost**: about 60 products and 12 divisions per px of arc, then
//! an [`Envelope`] for 4 right sides. **Deviations**: the paper gives no rule for control points, degree,
//! knots or weights; plain least squares explode at the tips, hence the penalty. **Not promised**: the
//! curve passes near its balls, not through them; the radius is floored at [`LEAST_RADIUS`] in
//! evaluation, not in the controls.

use crate::arena::Arena;
use crate::envelope::{ENTRY_BITS, Envelope};
use crate::fixed::{ONE, PX, confined, div_floor, div_round, saturate};
use crate::limits::{CapacityError, push};
use crate::stage::branch::{Ball, Sample};
use core::num::NonZeroUsize;
use heapless::VecView;

/// Largest number of control points of a curve.
pub const MAX_CONTROLS: usize = 512;
/// Smallest radius that evaluation gives: 0.3 px.
pub const LEAST_RADIUS: i32 = 77;

const DEGREE: usize = 3;
/// Largest magnitude of a coordinate, 1/256 px.
const RANGE: i32 = 1 << 20;
/// Largest number of balls, so that the arc length stays below 2^50.
const MAX_BALLS: usize = 1 << 20;
/// Steps in which a span is measured by chords.
const CHORDS: i32 = 16;
/// Bits of a basis function's value.
const BASIS_BITS: u32 = ENTRY_BITS;
/// Bits by which arc lengths are finer than 1/256 px: the rounding of thousands of chords adds up.
const ARC_BITS: u32 = 8;
/// Bits by which resampled channels are finer than 1/256 px.
const FINE_BITS: u32 = 4;
/// Bits by which unknowns are finer than 1/256 px.
const SIDE_BITS: u32 = 12;

impl Ball {
    const fn channels(self) -> [i32; 4] {
        [self.u, self.v, self.rho, self.d]
    }

    fn bounded(self) -> [i64; 4] {
        self.channels().map(|c| c.clamp(-RANGE, RANGE) as i64)
    }

    const fn from_channels([u, v, rho, d]: [i32; 4]) -> Self {
        Self { u, v, rho, d }
    }
}

/// A control point of a curve.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Control {
    /// The point.
    pub ball: Ball,
    /// Its rational weight, 1/65536; above 0 and at most 16, others are brought there.
    pub weight: i32,
}

/// How to fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FitParams {
    /// Arc per control point, 1/256 px; at least 1 px.
    pub spacing: i32,
    /// Weight of the squared second differences, 1/65536; between 1/1024 and 16.
    pub smoothing: i32,
    /// Weight of the first and last ball of an open edge, a whole number from 1 to 100.
    pub end_weight: i32,
}

impl Default for FitParams {
    /// A control point per 8 px, smoothing 0.1, ends weighing 10.
    fn default() -> Self {
        Self { spacing: 8 * PX, smoothing: ONE / 10, end_weight: 10 }
    }
}

/// A cubic rational B-spline.
#[derive(Clone, Copy, Debug)]
pub struct Nurbs<'a> {
    controls: &'a [Control],
    closed: bool,
}

impl<'a> Nurbs<'a> {
    /// The curve with these control points, if there are 4 to [`MAX_CONTROLS`].
    pub fn new(controls: &'a [Control], closed: bool) -> Option<Self> {
        (DEGREE + 1..=MAX_CONTROLS).contains(&controls.len()).then_some(Self { controls, closed })
    }

    /// The control points.
    pub const fn controls(&self) -> &'a [Control] {
        self.controls
    }

    /// Whether it is periodic.
    pub const fn closed(&self) -> bool {
        self.closed
    }

    /// The largest parameter, 1/65536 span; the smallest is 0.
    pub const fn end(&self) -> i32 {
        (span_count(self.controls.len(), self.closed) as i32) << 16
    }

    /// The ball at parameter `t`, 1/65536 span; at the nearest end if it is outside an open curve.
    pub fn evaluate(&self, t: i32) -> Ball {
        debug_assert!(self.controls.len() > DEGREE);
        let end = self.end();
        let t = if self.closed { t.checked_rem_euclid(end).unwrap_or(0) } else { confined(t, 0, end) };
        let (first, basis) = basis(span_count(self.controls.len(), self.closed), self.closed, t);
        let mut share = 0;
        let mut sums = [0; 4];
        for (k, value) in basis.into_iter().enumerate() {
            let (place, count) = (first + k, self.controls.len());
            let place = if place < count { place } else { place - count };
            let control = self.controls.get(place).copied().unwrap_or_default();
            // At most 2^30 x 2^20 / 2^16; times a coordinate 2^54, as are all four, since basis functions add up to 1.
            let weight = (value as i64 * control.weight.clamp(1, 16 * ONE) as i64) >> 16;
            share += weight;
            for (sum, channel) in sums.iter_mut().zip(control.ball.bounded()) {
                *sum += weight * channel;
            }
        }
        let mut ball = Ball::from_channels(sums.map(|sum| div_round(sum, share) as i32));
        ball.rho = ball.rho.max(LEAST_RADIUS);
        ball
    }

    /// Hand balls at equal arc in (u, v) to `take`, as near to `step` apart (1/256 px) as divides the curve
    /// evenly: both ends of an open curve, the start of a closed one once. A curve without extent gives
    /// one ball.
    ///
    /// # Errors
    /// That of `take`.
    pub fn sample<E>(&self, step: i32, mut take: impl FnMut(Ball) -> Result<(), E>) -> Result<(), E> {
        let chord_count = self.end() / (ONE / CHORDS);
        let chord_at =
            |k: i32| chord(self.evaluate(k * (ONE / CHORDS)), self.evaluate((k + 1) * (ONE / CHORDS)));
        // At most 2^13 chords below 2^30; and no curve is longer than its polygon, 2^9 x 2^30.
        let length: i64 = (0..chord_count).map(chord_at).sum();
        let pieces = div_round(length, (step.max(1) as i64) << ARC_BITS).max((length > 0) as i64);
        take(self.evaluate(0))?;
        let (mut k, mut start, mut across) = (0, 0, chord_at(0));
        for piece in 1..pieces {
            let target = part(length, piece, pieces);
            while start + across < target && k + 1 < chord_count {
                start += across;
                k += 1;
                across = chord_at(k);
            }
            // Below 2^30 x 2^12.
            let beyond = div_round((target - start) * (ONE / CHORDS) as i64, across);
            take(self.evaluate(k * (ONE / CHORDS) + beyond as i32))?;
        }
        if !self.closed && pieces > 0 {
            take(self.evaluate(self.end()))?;
        }
        Ok(())
    }
}

/// Append the control points of the curve along `samples` and return how many there are.
///
/// # Errors
/// A [`CapacityError`] when the scratch or `controls` is too short.
pub fn fit(
    samples: &[Sample],
    closed: bool,
    params: &FitParams,
    mut scratch: Arena<'_>,
    controls: &mut VecView<Control>,
) -> Result<usize, CapacityError> {
    if samples.len() > MAX_BALLS {
        return Err(CapacityError { what: "balls on an edge", limit: MAX_BALLS });
    }
    let (Some(first), Some(last)) = (samples.first(), samples.last()) else { return Ok(0) };
    let line = Polyline::new(samples, closed);
    if !closed && (samples.len() < 6 || line.length < 3 << (8 + ARC_BITS)) {
        for k in 0..=DEGREE as i64 {
            let mut channels = first.ball.bounded();
            for (channel, end) in channels.iter_mut().zip(last.ball.bounded()) {
                *channel += div_round((end - *channel) * k, DEGREE as i64);
            }
            let ball = Ball::from_channels(channels.map(|channel| channel as i32));
            push(controls, Control { ball, weight: ONE }, "control points")?;
        }
        return Ok(DEGREE + 1);
    }

    let spacing = (params.spacing.max(PX) as i64) << ARC_BITS;
    let count = ((line.length + spacing - 1) / spacing + DEGREE as i64)
        .clamp(DEGREE as i64 + 1, MAX_CONTROLS as i64) as usize;
    let sides = scratch.take::<[i64; 4]>(count, "control points of a fit")?;
    let entries = scratch.take::<i64>(Envelope::entries(count, closed), "entries of a fit")?;
    let origin = first.ball.bounded();
    accumulate(&line, params, origin, &mut Envelope::new(count, closed, entries)?, sides);
    for side in sides.iter() {
        let mut channels = origin;
        for (channel, unknown) in channels.iter_mut().zip(side) {
            *channel += div_round(*unknown, 1 << SIDE_BITS);
        }
        let ball = Ball::from_channels(channels.map(saturate));
        push(controls, Control { ball, weight: ONE }, "control points")?;
    }
    Ok(count)
}

/// Build the normal equations of the fit, relative to `origin` so that numbers stay small, and solve.
fn accumulate(
    line: &Polyline<'_>,
    params: &FitParams,
    origin: [i64; 4],
    matrix: &mut Envelope<'_>,
    sides: &mut [[i64; 4]],
) {
    let (count, closed) = (sides.len(), line.closed);
    let spans = span_count(count, closed);
    let smoothing = params.smoothing.clamp(ONE / 1024, 16 * ONE) as i64;
    let end_weight = params.end_weight.clamp(1, 100) as i64;
    let pieces = (line.length >> (8 + ARC_BITS)).clamp(7 + closed as i64, 0xFFFF);
    // The diagonal holds at most the samples of a span (basis functions integrate to a span), an end,
    // and 1 + 4 + 1 of the penalty; divided by this power of two it stays below 1.
    let largest = pieces / spans as i64 + 4 + end_weight + 6 * smoothing / ONE as i64 + 6;
    let bits = largest.checked_ilog2().unwrap_or(0) + 1;

    // Bits between a product of basis function and channel, and a right side.
    let drop = BASIS_BITS + FINE_BITS + bits - SIDE_BITS;

    sides.fill([0; 4]);
    let mut cursor = Cursor { segment: 0, start: 0, across: line.chord(0) };
    let samples = if closed { pieces } else { pieces + 1 };
    // Samples of one span go to the same entries, which gather them first.
    let mut gathered = Span::default();
    for i in 0..samples {
        let (channels, weight) = line.at(part(line.length, i, pieces), &mut cursor);
        let is_end = !closed && (i == 0 || i == pieces);
        let weight = if is_end { weight * end_weight } else { weight };
        let t = div_round(((spans as i64) << 16) * i, pieces) as i32; // 2^9 x 2^16 x 2^16
        let (first, basis) = basis(spans, closed, t);
        if first != gathered.first {
            gathered.give(matrix, sides);
            gathered = Span { first, ..Span::default() };
        }
        let mut entries = gathered.entries.iter_mut();
        for a in 0..=DEGREE {
            for (b, entry) in (0..=a).zip(&mut entries) {
                // At most 2^30, times a weight below 2^23; up to 2^16 samples of 2^37.
                let product = (i64::from(basis[a]) * i64::from(basis[b])) >> BASIS_BITS;
                *entry += (product * weight) >> 16;
            }
            // At most 100 x 2^30, times a difference of channels of at most 2^25: below 2^62.
            let weighted = (i64::from(basis[a]) * weight) >> 16;
            for c in 0..4 {
                let term = weighted * (channels[c] - (origin[c] << FINE_BITS));
                gathered.sides[a][c] += (term + (1 << (drop - 1))) >> drop;
            }
        }
    }
    gathered.give(matrix, sides);
    // At most 2^20 x 2^14, and 4 times as much.
    let penalty = smoothing << (BASIS_BITS - 16);
    for k in 0..if closed { count } else { count - 2 } {
        let stencil = [(k, 1), ((k + 1) % count, -2), ((k + 2) % count, 1)];
        for (a, (i, p)) in stencil.into_iter().enumerate() {
            for (j, q) in stencil.into_iter().take(a + 1) {
                matrix.add(i, j, penalty * p * q);
            }
        }
    }
    matrix.scale_down(bits);
    matrix.factorise();
    matrix.solve(sides);
}

/// What the samples of a span add to the normal equations.
#[derive(Default)]
struct Span {
    /// The first of its control points.
    first: usize,
    /// Those of the lower half of its square of the matrix, row after row.
    entries: [i64; (DEGREE + 1) * (DEGREE + 2) / 2],
    sides: [[i64; 4]; DEGREE + 1],
}

impl Span {
    fn give(&self, matrix: &mut Envelope<'_>, sides: &mut [[i64; 4]]) {
        let Some(count) = NonZeroUsize::new(sides.len()) else { return };
        let mut entries = self.entries.iter();
        for (a, sums) in self.sides.iter().enumerate() {
            let row = (self.first + a) % count;
            for (b, entry) in (0..=a).zip(&mut entries) {
                matrix.add(row, (self.first + b) % count, *entry);
            }
            for (side, sum) in sides.get_mut(row).into_iter().flatten().zip(sums) {
                *side += sum;
            }
        }
    }
}

/// Spans of a curve with so many control points.
const fn span_count(controls: usize, closed: bool) -> usize {
    if closed { controls } else { controls - DEGREE }
}

/// The four basis functions that are not 0 at `t` (1/65536 span), in 1/2^30, and the index of the first
/// (Cox and de Boor; The NURBS Book, A2.2). They add up to exactly 1.
fn basis(spans: usize, closed: bool, t: i32) -> (usize, [i32; 4]) {
    let span = confined(t >> 16, 0, spans as i32 - 1);
    let knot = |offset: i32| {
        let knot = span + offset;
        if closed { knot } else { confined(knot, 0, spans as i32) }
    };
    let mut values = [1 << BASIS_BITS, 0, 0, 0];
    for degree in 1..=DEGREE {
        let mut carried = 0;
        for (r, value) in values.iter_mut().enumerate().take(degree) {
            let left = knot(1 + r as i32 - degree as i32);
            let spans = (knot(1 + r as i32) - left) as u32;
            // value (t - left) / (right - left), rounded: the shift leaves 32 bits, since the function is at most
            // 2^30 and t at most 1 to 3 spans from the left.
            let part = *value as u64 * (t - (left << 16)) as u64 + (u64::from(spans) << 15);
            let rising = ((part >> 16) as u32).checked_div(spans).unwrap_or(0).cast_signed();
            *value += carried - rising;
            carried = rising;
        }
        values[degree] = carried;
    }
    (span as usize, values)
}

/// `length * i / pieces`, rounded down, for 0 <= i <= pieces < 2^32, without the large product.
const fn part(length: i64, i: i64, pieces: i64) -> i64 {
    let (length, i, pieces) = (length as u64, i as u64, pieces as u64);
    let whole = div_floor(length, pieces);
    (whole * i + div_floor((length - whole * pieces) * i, pieces)) as i64
}

/// Distance of two centres in (u, v), 1/65536 px; below 2^30.
fn chord(a: Ball, b: Ball) -> i64 {
    let ([au, av, ..], [bu, bv, ..]) = (a.bounded(), b.bounded());
    let square = (au - bu) * (au - bu) + (av - bv) * (av - bv);
    // One bit more, to round: lengths rounded down would add up to a drift.
    // Differences of at most 2^21: a square of at most 2^43, 2^61 when shifted.
    (((square as u64) << (2 * ARC_BITS + 2)).isqrt() as i64 + 1) / 2
}

/// Samples joined by straight segments, the last to the first when closed.
struct Polyline<'a> {
    samples: &'a [Sample],
    closed: bool,
    /// 1/65536 px.
    length: i64,
}

/// A segment of a polyline, the arc where it starts, and its length.
struct Cursor {
    segment: usize,
    start: i64,
    across: i64,
}

impl<'a> Polyline<'a> {
    fn new(samples: &'a [Sample], closed: bool) -> Self {
        let mut line = Self { samples, closed, length: 0 };
        line.length = (0..line.segments()).map(|k| line.chord(k)).sum();
        line
    }

    const fn segments(&self) -> usize {
        if self.closed { self.samples.len() } else { self.samples.len() - 1 }
    }

    fn ends(&self, segment: usize) -> (Sample, Sample) {
        let n = self.samples.len();
        (self.samples[segment % n], self.samples[(segment + 1) % n])
    }

    fn chord(&self, segment: usize) -> i64 {
        let (a, b) = self.ends(segment);
        chord(a.ball, b.ball)
    }

    /// Channels (1/4096 px) and weight at an arc no less than the last one asked for.
    fn at(&self, arc: i64, cursor: &mut Cursor) -> ([i64; 4], i64) {
        while arc > cursor.start + cursor.across && cursor.segment + 1 < self.segments() {
            cursor.start += cursor.across;
            cursor.segment += 1;
            cursor.across = self.chord(cursor.segment);
        }
        let across = cursor.across;
        let beyond = (arc - cursor.start).min(across);
        let (a, b) = self.ends(cursor.segment);
        // Channels differ by at most 2^25, weights by less: times an arc below 2^30.
        let between = |a: i64, b: i64| a + div_round((b - a) * beyond, across);
        let mut channels = a.ball.bounded();
        for (channel, end) in channels.iter_mut().zip(b.ball.bounded()) {
            *channel = between(*channel << FINE_BITS, end << FINE_BITS);
        }
        let weight = |s: Sample| s.weight.clamp(ONE / 64, ONE) as i64;
        (channels, between(weight(a), weight(b)))
    }
}
