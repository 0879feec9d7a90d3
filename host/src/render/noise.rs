//! What a poor sensor does to an image.

use image::GrayImage;

use crate::random::Random;

/// Gaussian noise and, on top, pixels stuck at black or white.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Standard deviation of the Gaussian noise, grey levels.
    pub sigma: f64,
    /// Part of the pixels that are stuck, half of them black and half white; 0..=1.
    pub salt_and_pepper: f64,
    /// Seed: another one for each image of a pair.
    pub seed: u64,
}

impl Noise {
    /// Adds the noise; sums are rounded and clipped to 0..=255.
    pub fn apply(&self, image: &mut GrayImage) {
        let mut random = Random::new(self.seed);
        for pixel in image.iter_mut() {
            // The conversion clips.
            let noisy = (f64::from(*pixel) + self.sigma * random.normal()).round() as u8;
            let chance = random.uniform();
            *pixel = if chance >= self.salt_and_pepper {
                noisy
            } else if chance < 0.5 * self.salt_and_pepper {
                0
            } else {
                255
            };
        }
    }
}
