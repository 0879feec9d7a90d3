//! How a rendered object looks, and what the two sensors make of it: what `render` can make harder.

use clap::Args;
use image::GrayImage;

use super::options::{positive, share_of};
use crate::calibration::StereoCamera;
use crate::mesh::Mesh;
use crate::render::{Material, Noise, Pattern, Sensor, Texture, photograph};
use crate::view::Calibrated;

/// Arguments on looks.
#[derive(Debug, Args)]
#[command(next_help_heading = "Looks")]
pub struct Looks {
    /// Marks on the object: plain, checks or clouds
    #[arg(long, value_name = "NAME", default_value = "plain")]
    texture: Pattern,
    /// Size of the marks, mm
    #[arg(long, value_name = "MM", value_parser = within(0.1, 1000.0), default_value_t = 10.0)]
    texture_size: f64,
    /// How much darker the dark marks are; from 0.8 on they are hard to tell from the background
    #[arg(long, value_name = "FRACTION", value_parser = share_of(1.0), default_value_t = 0.4)]
    contrast: f64,
    /// Brightness of highlights: 0 is dull
    #[arg(long, value_name = "FRACTION", value_parser = share_of(1.0), default_value_t = 0.0)]
    gloss: f64,
    /// How narrow highlights are
    #[arg(long, value_name = "EXPONENT", value_parser = within(1.0, 1000.0), default_value_t = 30.0)]
    shininess: f64,
    /// The lenses' blur, standard deviation, px
    #[arg(long, value_name = "PX", value_parser = share_of(20.0), default_value_t = 0.0)]
    blur: f64,
    /// Gamma of the sensors: 2.2 for an ordinary camera
    #[arg(long, value_name = "GAMMA", value_parser = within(0.1, 10.0), default_value_t = 1.0)]
    gamma: f64,
    /// Brightness of the left and the right image; above 1 highlights are clipped
    #[arg(long, value_name = "LEFT,RIGHT", value_parser = gains, default_value = "1,1")]
    gain: [f64; 2],
    /// How much lower the right camera sees everything than its calibration says, px
    #[arg(long, value_name = "PX", value_parser = offset, allow_negative_numbers = true, default_value_t = 0.0)]
    vertical_offset: f64,
    /// Gaussian noise, grey levels
    #[arg(long, value_name = "SIGMA", default_value_t = 0.0, value_parser = share_of(255.0))]
    noise: f64,
    /// Share of the pixels that are stuck at black or white
    #[arg(long, value_name = "FRACTION", default_value_t = 0.0, value_parser = share_of(1.0))]
    salt_and_pepper: f64,
    /// Seed of the noise
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
}

impl Looks {
    /// What the cameras see, but for noise.
    pub(super) fn images(&self, mesh: &Mesh, calibration: &StereoCamera) -> Vec<GrayImage> {
        let texture = Texture { pattern: self.texture, size: self.texture_size, contrast: self.contrast };
        let material = Material { texture, gloss: self.gloss, shininess: self.shininess };
        let mut as_built = *calibration;
        as_built.right.cy += self.vertical_offset;
        let sensors = self.gain.map(|gain| Sensor { blur: self.blur, gain, gamma: self.gamma });
        let cameras: Vec<_> = Calibrated::pair(&as_built).into_iter().zip(sensors).collect();
        photograph(mesh, material, &cameras)
    }

    /// Adds the noise, another one to each image.
    pub(super) fn disturb(&self, images: &mut [GrayImage]) {
        for (eye, image) in (0..).zip(images) {
            let seed = self.seed.wrapping_mul(2).wrapping_add(eye);
            Noise { sigma: self.noise, salt_and_pepper: self.salt_and_pepper, seed }.apply(image);
        }
    }
}

/// A number in a range.
fn within(least: f64, most: f64) -> impl Fn(&str) -> Result<f64, String> + Clone {
    move |text| match text.parse::<f64>() {
        Ok(number) if (least..=most).contains(&number) => Ok(number),
        _ => Err(format!("must be {least} to {most}")),
    }
}

fn gains(text: &str) -> Result<[f64; 2], String> {
    let both =
        text.split_once(',').and_then(|(left, right)| Some([positive(left).ok()?, positive(right).ok()?]));
    both.ok_or_else(|| "must be two positive numbers, as in 1,1.1".to_owned())
}

fn offset(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|offset: &f64| offset.abs() <= 50.0)
        .ok_or_else(|| "must be -50 to 50".to_owned())
}
