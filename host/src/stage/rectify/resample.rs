//! One raw image to its rectified one, by bilinear interpolation.
//!
//! Each rectified pixel asks where its ray meets the raw image. Rays that leave the raw field of view
//! are pulled in to its rim first: there a lens polynomial may turn back and show a ghost of the image.

use image::GrayImage;
use nalgebra::{Point2, Vector3};
use rayon::prelude::*;

use super::canvas::border;
use super::{PixelBox, RectifiedCamera, Turned};

/// Fill `rectified` with the rectified image of one eye, whose axis is at column `cx`.
pub(super) fn resample(
    eye: &Turned,
    to: &RectifiedCamera,
    cx: f64,
    raw: &GrayImage,
    rectified: &mut GrayImage,
) {
    let reach = reach(eye);
    let back = eye.turn.inverse();
    resize(rectified, to.width, to.height);
    rectified.par_chunks_exact_mut(to.width as usize).enumerate().for_each(|(v, row)| {
        let y = (v as f64 - to.cy) / to.f;
        for (u, grey) in (0_u32..).zip(row) {
            let ray = back * Vector3::new((f64::from(u) - cx) / to.f, y, 1.0);
            *grey = bilinear(raw, eye.camera.pixel_of(pulled_in(&ray, reach)));
        }
    });
}

/// Give an image another size, in the memory that it has if that is enough; its pixels are of no use then.
fn resize(image: &mut GrayImage, width: u32, height: u32) {
    let mut bytes = std::mem::take(image).into_raw();
    bytes.resize(width as usize * height as usize, 0);
    // As many bytes as pixels always make an image.
    *image = GrayImage::from_raw(width, height, bytes).unwrap_or_default();
}

/// How far from the optical axis the raw image sees, in the plane at distance 1.
fn reach(eye: &Turned) -> f64 {
    let far = Point2::new(f64::from(eye.camera.width), f64::from(eye.camera.height));
    border(PixelBox { min: Point2::new(-1.0, -1.0), max: far })
        .filter_map(|pixel| eye.camera.ray_of(pixel))
        .map(|ray| ray.coords.norm())
        .fold(0.0, f64::max)
}

/// The ray as (x, y, 1), no further than `reach` from the axis.
fn pulled_in(ray: &Vector3<f64>, reach: f64) -> Point2<f64> {
    let aside = ray.xy().norm();
    if aside <= reach * ray.z {
        Point2::from(ray.xy() / ray.z)
    } else {
        Point2::from(ray.xy() * (reach / aside))
    }
}

/// The grey value between pixels; outside the image that of the nearest one inside.
fn bilinear(image: &GrayImage, at: Point2<f64>) -> u8 {
    let (right, bottom) = (image.width().saturating_sub(1), image.height().saturating_sub(1));
    let (x, y) = (at.x.clamp(0.0, f64::from(right)), at.y.clamp(0.0, f64::from(bottom)));
    let (u, v) = (x as u32, y as u32);
    let (du, dv) = (x - f64::from(u), y - f64::from(v));
    let (next_u, next_v) = ((u + 1).min(right) as usize, (v + 1).min(bottom) as usize);
    let row = |v: usize| image.as_raw().get(v * image.width() as usize..).unwrap_or_default();
    let grey = |row: &[u8], u: usize| row.get(u).map_or(0.0, |grey| f64::from(*grey));
    let (u, upper, lower) = (u as usize, row(v as usize), row(next_v));
    let above = grey(upper, u) * (1.0 - du) + grey(upper, next_u) * du;
    let below = grey(lower, u) * (1.0 - du) + grey(lower, next_u) * du;
    rounded(above * (1.0 - dv) + below * dv)
}

/// The nearest grey value to one of 0 to 255, the upper one of two: `f64::round` without a call.
fn rounded(grey: f64) -> u8 {
    let whole = grey as u8;
    whole + u8::from(grey - f64::from(whole) >= 0.5)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn greys_are_rounded_as_by_the_library() {
        for k in 0..=255 * 64 {
            let grey = f64::from(k) / 64.0;
            for grey in [grey, grey.next_down().max(0.0), grey.next_up().min(255.0)] {
                assert_eq!(rounded(grey), grey.round() as u8, "{grey}");
            }
        }
    }
}
