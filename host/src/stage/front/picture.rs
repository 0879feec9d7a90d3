//! A grey image of the object alone: blurred without the background, and looked up between pixels.
//!
//! * **In**: a grey image, and the mask of the object in it.
//! * **Out**: grey levels in a frame. A Gaussian's weights outside the mask are left out and the others scaled up, so
//!   that the rim is not darkened; levels go on beyond the mask as far as the Gaussian reaches.
//! * **Cost**: the frame, times the Gaussian's length.

use super::pool::Lent;
use super::raster::Frame;
use super::system::add;

/// Grey levels in a frame, row by row.
#[derive(Debug)]
pub(super) struct Picture<'p> {
    pub(super) frame: Frame,
    pub(super) levels: Lent<'p, f64>,
}

impl<'p> Picture<'p> {
    /// The picture seen through a Gaussian of `sigma` px, with the weights of `mask`, one a pixel.
    pub(super) fn blurred(&self, mask: &[f64], sigma: f64) -> Self {
        let (frame, shelf) = (self.frame, self.levels.shelf());
        let reach = (3.0 * sigma).ceil() as usize;
        let weights = shelf.of((0..=reach).map(|x| libm::exp(-0.5 * (x as f64 / sigma).powi(2))));
        let blur = |mut values: Lent<'p, f64>| {
            let mut sums = shelf.filled(0.0, values.len());
            along_columns(&values, frame, &weights, &mut sums);
            values.fill(0.0);
            along_rows(&sums, frame, &weights, &mut values);
            values
        };
        let mut levels = blur(shelf.of(self.levels.iter().zip(mask).map(|(level, weight)| level * weight)));
        let total = blur(shelf.of(mask.iter().copied()));
        levels.iter_mut().zip(total.iter()).for_each(|(level, total)| *level /= total.max(1e-3));
        Self { frame, levels }
    }

    /// The level at a place, bilinear; beyond the frame that of its border.
    pub(super) fn at(&self, u: f64, v: f64) -> f64 {
        let Frame { corner, width, height } = self.frame;
        let x = (u - f64::from(corner[0])).clamp(0.0, width as f64 - 1.0);
        let y = (v - f64::from(corner[1])).clamp(0.0, height as f64 - 1.0);
        let (column, row) = (x as usize, y as usize);
        let (s, t) = (x - column as f64, y - row as f64);
        let at = |row: usize| {
            let level = |column: usize| self.levels[row * width + column];
            level(column) * (1.0 - s) + level((column + 1).min(width - 1)) * s
        };
        at(row) * (1.0 - t) + at((row + 1).min(height - 1)) * t
    }
}

/// Adds to `sums` the convolution along rows with a symmetric kernel, of which `weights` has the middle and one side;
/// zero outside.
fn along_rows(values: &[f64], frame: Frame, weights: &[f64], sums: &mut [f64]) {
    for (row, sums) in values.chunks(frame.width).zip(sums.chunks_mut(frame.width)) {
        add(sums, row, weights[0]);
        for (k, &weight) in weights.iter().enumerate().skip(1).take(frame.width.saturating_sub(1)) {
            let within = frame.width - k;
            add(&mut sums[..within], &row[k..], weight);
            add(&mut sums[k..], &row[..within], weight);
        }
    }
}

/// The same along columns.
fn along_columns(values: &[f64], frame: Frame, weights: &[f64], sums: &mut [f64]) {
    add(sums, values, weights[0]);
    for (k, &weight) in weights.iter().enumerate().skip(1).take(frame.height.saturating_sub(1)) {
        let (by, within) = (k * frame.width, (frame.height - k) * frame.width);
        add(&mut sums[..within], &values[by..], weight);
        add(&mut sums[by..], &values[..within], weight);
    }
}
