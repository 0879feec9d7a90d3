//! Smoothing of depth over neighbouring balls, across branches (docs/algorithm.md, step 23).
//!
//! A ball's depth comes from two contacts and is as noisy as they are; an object's depth changes slowly
//! along and between its branches. What differs from the disparity plane is regressed locally: linear in
//! u and v over the balls within max(3 px, rho / 2), those of similar radius weighing more, each by how well
//! its own depth is known, with Cauchy weights against balls that sit on something else.
//!
//! * **Order**: neighbours are added up by cells of the image, row by row, and within a cell in their own order;
//!   the bits of the result depend on nothing else.
//! * **Cost**: number of balls times neighbours, on all threads; no allocation for as many balls as before.

use super::balls::{Ball, px};
use nalgebra::{Matrix3, Vector2, Vector3};
use rayon::prelude::*;
use shared::fixed::ONE;
use shared::stage::plane::ImagePlane;

/// Kernel width as a part of a ball's radius, and at least this many px.
const WIDTH: (f64, f64) = (0.5, 3.0);
/// Neighbours lie within so many kernel widths.
const REACH: f64 = 2.0;
/// Radii this part of the ball's own apart weigh e^-1/2.
const RADIUS_WIDTH: f64 = 0.5;
/// Least trust in a neighbour's depth.
const LEAST_WEIGHT: f64 = 0.0025;
/// Rounds of robust re-weighting.
const ROUNDS: usize = 4;
/// Least scale of the residuals, px.
const LEAST_SCALE: f64 = 0.15;
/// A standard deviation of normal residuals in medians of their sizes.
const DEVIATION: f64 = 1.48;
/// Pull of level and slopes towards the median and flatness, as a part of the neighbours' weight.
const RIDGE: [f64; 3] = [0.02, 0.5, 0.5];

/// Smooths, and keeps its memory for the next balls.
#[derive(Debug, Default)]
pub struct Smoother {
    /// The balls by their cells.
    places: Vec<Place>,
    /// The excess of each ball, lowest first, and which place it has.
    ranked: Vec<(f64, u32)>,
    /// One a place.
    smoothed: Vec<f64>,
    /// One a thread.
    desks: Vec<Desk>,
}

/// What a neighbour is known by.
#[derive(Clone, Copy, Debug)]
struct Place {
    /// Row and column of its cell.
    cell: [i64; 2],
    /// Which ball it is.
    ball: usize,
    at: Vector2<f64>,
    rho: f64,
    /// Disparity beyond the plane, px.
    excess: f64,
    weight: f64,
    /// Its excess's place among all.
    rank: u32,
}

impl Smoother {
    /// Replace each ball's disparity by the local robust estimate.
    pub fn smooth(&mut self, balls: &mut [Ball], plane: &ImagePlane) {
        let expected = |b: &Ball| {
            let slope = |s: i32| f64::from(s) / f64::from(ONE);
            px(plane.level)
                + slope(plane.slope_u) * (b.at.x - px(plane.origin.u))
                + slope(plane.slope_v) * (b.at.y - px(plane.origin.v))
        };
        self.sort(balls, expected);
        self.smoothed.clear();
        self.smoothed.resize(self.places.len(), 0.0);
        let threads = rayon::current_num_threads();
        if self.desks.len() < threads {
            self.desks.resize_with(threads, Desk::default);
        }
        let (places, ranked) = (&self.places, &self.ranked);
        let share = places.len().div_ceil(threads).max(1);
        let shares = self.smoothed.par_chunks_mut(share).zip(places.par_chunks(share));
        shares.zip(&mut self.desks).for_each(|((smoothed, share), desk)| {
            desk.smooth(share, places, ranked, smoothed);
        });
        for (place, excess) in places.iter().zip(&self.smoothed) {
            let ball = &mut balls[place.ball];
            ball.disparity = expected(ball) + excess;
        }
    }

    /// Gives each ball its place.
    fn sort(&mut self, balls: &[Ball], expected: impl Fn(&Ball) -> f64) {
        let widest = balls.iter().map(|b| b.rho).fold(0.0, f64::max);
        let side = REACH * width(widest);
        let place = |(ball, b): (usize, &Ball)| Place {
            cell: [b.at.y, b.at.x].map(|x| (x / side).floor() as i64),
            ball,
            at: b.at,
            rho: b.rho,
            excess: b.disparity - expected(b),
            weight: b.weight.max(LEAST_WEIGHT),
            rank: 0,
        };
        self.places.clear();
        self.places.extend(balls.iter().enumerate().map(place));
        self.places.sort_unstable_by_key(|place| (place.cell, place.ball));
        self.ranked.clear();
        self.ranked.extend(self.places.iter().zip(0..).map(|(place, k)| (place.excess, k)));
        self.ranked.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        for (rank, (_, place)) in (0..).zip(&self.ranked) {
            self.places[*place as usize].rank = rank;
        }
    }
}

/// Kernel width of a ball, px.
fn width(rho: f64) -> f64 {
    WIDTH.1.max(WIDTH.0 * rho)
}

/// Where a thread works: the neighbours of one ball.
#[derive(Debug, Default)]
struct Desk {
    neighbours: Vec<Neighbour>,
    residuals: Vec<f64>,
    sorted: Vec<f64>,
    /// A bit for each rank that is a neighbour's.
    ranks: Vec<u64>,
}

/// A ball near another one.
#[derive(Clone, Copy, Debug)]
struct Neighbour {
    /// From the other one, kernel widths.
    offset: Vector2<f64>,
    excess: f64,
    /// By distance, radius and trust.
    weight: f64,
    /// The same, less where the excess differs from what is found.
    robust: f64,
}

impl Desk {
    /// The estimates for some of all places.
    fn smooth(&mut self, some: &[Place], all: &[Place], ranked: &[(f64, u32)], smoothed: &mut [f64]) {
        self.ranks.clear();
        self.ranks.resize(all.len().div_ceil(64), 0);
        let (mut cell, mut around) = (None, [const { &[] as &[Place] }; 3]);
        for (here, smoothed) in some.iter().zip(smoothed) {
            if cell != Some(here.cell) {
                cell = Some(here.cell);
                around = [-1, 0, 1].map(|row| block(all, here.cell[0] + row, here.cell[1]));
            }
            *smoothed = self.estimate(here, around, ranked);
        }
    }

    /// The excess at a ball by robust local linear regression.
    fn estimate(&mut self, here: &Place, around: [&[Place]; 3], ranked: &[(f64, u32)]) -> f64 {
        let total = self.gather(here, around);
        let median = self.median(ranked);
        let ridge = Vector3::from(RIDGE) * total.max(0.3);
        let mut round = 1;
        loop {
            let (a, b) = self.normal_equations(&ridge, median);
            let Some(solution) = a.cholesky().map(|c| c.solve(&b)) else { return median };
            if round == ROUNDS {
                return solution.x;
            }
            self.weigh(&solution);
            round += 1;
        }
    }

    /// Finds the neighbours and returns their weight.
    fn gather(&mut self, here: &Place, around: [&[Place]; 3]) -> f64 {
        let (width, radius_width) = (width(here.rho), RADIUS_WIDTH * here.rho.max(4.0));
        // Rules out most without a division.
        let far = (REACH * width).powi(2) * (1.0 + 1e-9);
        self.neighbours.clear();
        let mut total = 0.0;
        for place in around.into_iter().flatten() {
            let way = place.at - here.at;
            if way.norm_squared() > far {
                continue;
            }
            let offset = way / width;
            let square = offset.norm_squared();
            if square <= REACH * REACH {
                let q = square + ((place.rho - here.rho) / radius_width).powi(2);
                let weight = libm::exp(-0.5 * q) * place.weight;
                total += weight;
                self.neighbours.push(Neighbour { offset, excess: place.excess, weight, robust: weight });
                self.ranks[place.rank as usize / 64] |= 1 << (place.rank % 64);
            }
        }
        total
    }

    /// The middle excess of the neighbours, whose ranks are forgotten.
    fn median(&mut self, ranked: &[(f64, u32)]) -> f64 {
        let (mut left, mut middle) = (self.neighbours.len() / 2, 0);
        let mut found = false;
        for (k, ranks) in self.ranks.iter_mut().enumerate() {
            let mut bits = std::mem::take(ranks);
            let count = bits.count_ones() as usize;
            if !found && left < count {
                (0..left).for_each(|_| bits &= bits - 1);
                middle = 64 * k + bits.trailing_zeros() as usize;
                found = true;
            }
            left = left.saturating_sub(count);
        }
        ranked[middle].0
    }

    /// Matrix and right side for level and slopes.
    fn normal_equations(&self, ridge: &Vector3<f64>, median: f64) -> (Matrix3<f64>, Vector3<f64>) {
        let (mut aa, mut ab, mut ac, mut bb, mut bc, mut cc) = (ridge.x, 0.0, 0.0, ridge.y, 0.0, ridge.z);
        let (mut a, mut b, mut c) = (ridge.x * median, 0.0, 0.0);
        for Neighbour { offset, excess, robust, .. } in &self.neighbours {
            let (x, y, seen) = (offset.x, offset.y, robust * excess);
            aa += robust;
            ab += x * robust;
            ac += y * robust;
            bb += x * x * robust;
            bc += x * y * robust;
            cc += y * y * robust;
            a += seen;
            b += x * seen;
            c += y * seen;
        }
        (Matrix3::new(aa, ab, ac, ab, bb, bc, ac, bc, cc), Vector3::new(a, b, c))
    }

    /// Weighs each neighbour by how little it differs from the plane that was found.
    fn weigh(&mut self, plane: &Vector3<f64>) {
        let off = |n: &Neighbour| (n.excess - Vector3::new(1.0, n.offset.x, n.offset.y).dot(plane)).abs();
        self.residuals.clear();
        self.residuals.extend(self.neighbours.iter().map(off));
        let scale = 2.0 * self.deviation();
        for (neighbour, residual) in self.neighbours.iter_mut().zip(&self.residuals) {
            neighbour.robust = neighbour.weight * (1.0 / (1.0 + (residual / scale).powi(2)));
        }
    }

    /// The robust deviation of the residuals, at least [`LEAST_SCALE`]. Where that many are small, which is nearly
    /// everywhere, their median need not be known.
    fn deviation(&mut self) -> f64 {
        let middle = self.residuals.len() / 2;
        let small = self.residuals.iter().filter(|&residual| DEVIATION * residual <= LEAST_SCALE).count();
        if small > middle {
            return LEAST_SCALE;
        }
        self.sorted.clone_from(&self.residuals);
        LEAST_SCALE.max(DEVIATION * *self.sorted.select_nth_unstable_by(middle, f64::total_cmp).1)
    }
}

/// The places of a cell and of those beside it.
fn block(all: &[Place], row: i64, column: i64) -> &[Place] {
    let from = all.partition_point(|place| place.cell < [row, column - 1]);
    let to = all.partition_point(|place| place.cell <= [row, column + 1]);
    &all[from..to]
}

#[cfg(test)]
mod tests;
