//! What a lens and a sensor make of the light, but for [`Noise`](super::Noise).

use image::GrayImage;

/// How a sensor answers. The default gives each grey level as it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensor {
    /// Standard deviation of the lens' blur, px; 0 is sharp.
    pub blur: f64,
    /// What brightness is multiplied by; what goes beyond 255 is clipped there.
    pub gain: f64,
    /// 1 is linear; a usual camera has 2.2, by which dark tones become lighter.
    pub gamma: f64,
}

impl Default for Sensor {
    fn default() -> Self {
        Self { blur: 0.0, gain: 1.0, gamma: 1.0 }
    }
}

impl Sensor {
    /// The image of brightnesses, grey levels row by row; empty if they are not `width` times `height`.
    pub(super) fn develop(&self, [width, height]: [u32; 2], mut light: Vec<f64>) -> GrayImage {
        if self.blur > 0.0 {
            light = blurred(&light, width as usize, self.blur);
        }
        let pixels = light.into_iter().map(|light| self.answer(light)).collect();
        GrayImage::from_raw(width, height, pixels).unwrap_or_default()
    }

    fn answer(&self, light: f64) -> u8 {
        let mut level = light * self.gain;
        if self.gamma != 1.0 {
            level = 255.0 * libm::pow(level / 255.0, self.gamma.recip());
        }
        // The conversion clips.
        level.round() as u8
    }
}

/// A Gaussian along rows, then along columns; edges go on as they end.
fn blurred(light: &[f64], width: usize, sigma: f64) -> Vec<f64> {
    let reach = (4.0 * sigma).ceil() as isize;
    let weights: Vec<f64> = (-reach..=reach).map(|x| libm::exp(-0.5 * (x as f64 / sigma).powi(2))).collect();
    let total: f64 = weights.iter().sum();
    let along = |values: &[f64], length: usize, step: usize, start: usize, out: &mut [f64]| {
        for i in 0..length {
            let tap = |(x, weight): (isize, &f64)| {
                let at = (i as isize + x).clamp(0, length as isize - 1) as usize;
                weight * values[start + at * step]
            };
            out[start + i * step] = (-reach..).zip(&weights).map(tap).sum::<f64>() / total;
        }
    };
    let height = light.len() / width.max(1);
    let (mut rows, mut both) = (vec![0.0; light.len()], vec![0.0; light.len()]);
    (0..height).for_each(|row| along(light, width, 1, row * width, &mut rows));
    (0..width).for_each(|column| along(&rows, height, width, column, &mut both));
    both
}
