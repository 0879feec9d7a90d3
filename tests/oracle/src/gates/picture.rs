//! The picture of a gate: both views as they came, and over them what the core took for the object.
//!
//! Orange is the outline, red its parts that tell no depth: cut off by the image's border, along the rows, or without
//! counterpart in the other view.
//! Dotted is the box of the left view's object, in both views: of a good pair the right view's lies between the
//! same rows, and further left.

use super::{Gate, Tripped};
use host::report::record::Parts;
use image::{GrayImage, Rgb, RgbImage, imageops};
use shared::fixed::PX;
use shared::point::PixelPoint;

/// Width of a view in the picture, and paper between the two, px.
const WIDTH: u32 = 320;
const GAP: u32 = 8;
const PAPER: Rgb<u8> = Rgb([250, 250, 248]);
const OUTLINE: Rgb<u8> = Rgb([255, 159, 28]);
const MARKED: Rgb<u8> = Rgb([230, 40, 40]);
const BOX: Rgb<u8> = Rgb([86, 180, 233]);

/// Draw it.
pub fn picture(gate: &Gate, Tripped { record, .. }: &Tripped) -> RgbImage {
    let scale = (gate.pair[0].width() / WIDTH).max(1);
    let mut views = gate.pair.each_ref().map(|image| shown(image, scale));
    let [left, right] = record.eyes.each_ref().map(|eye| &eye.parts);
    let rows = &record.pair.rows;
    let alone = |k: usize| rows.get(k).is_some_and(|found| found.weight == 0);
    for view in &mut views {
        frame(view, left, scale);
    }
    outline(&mut views[0], left, scale, alone);
    outline(&mut views[1], right, scale, |_| false);
    let [left, right] = views;
    let height = left.height().max(right.height());
    let mut sheet = RgbImage::from_pixel(left.width() + GAP + right.width(), height, PAPER);
    imageops::replace(&mut sheet, &left, 0, 0);
    imageops::replace(&mut sheet, &right, (left.width() + GAP).into(), 0);
    sheet
}

fn shown(image: &GrayImage, scale: u32) -> RgbImage {
    let [width, height] = [image.width() / scale, image.height() / scale];
    let small = imageops::resize(image, width, height, imageops::FilterType::Triangle);
    RgbImage::from_fn(width, height, |u, v| Rgb([small.get_pixel(u, v)[0]; 3]))
}

fn put(view: &mut RgbImage, [u, v]: [i64; 2], colour: Rgb<u8>) {
    if let (Ok(u), Ok(v)) = (u32::try_from(u), u32::try_from(v))
        && let Some(pixel) = view.get_pixel_mut_checked(u, v)
    {
        *pixel = colour;
    }
}

/// The contour, marked where it ends at the border or is `alone`.
fn outline(view: &mut RgbImage, parts: &Parts, scale: u32, alone: impl Fn(usize) -> bool) {
    let last = [view.width(), view.height()].map(|side| i64::from(side) - 1);
    for (k, point) in parts.contour.iter().enumerate() {
        let PixelPoint { u, v } = point.at;
        let at = [(u, last[0]), (v, last[1])].map(|(x, last)| {
            ((i64::from(x) + i64::from(PX / 2)) >> 8).div_euclid(scale.into()).clamp(0, last)
        });
        if point.border || alone(k) {
            for beside in [[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]] {
                put(view, [at[0] + beside[0], at[1] + beside[1]], MARKED);
            }
        } else {
            put(view, at, OUTLINE);
        }
    }
}

/// Rows and columns of the box around the object, dotted across the view.
fn frame(view: &mut RgbImage, parts: &Parts, scale: u32) {
    let Some(bounds) = parts.bounds else { return };
    let [left, top, right, bottom] =
        [bounds.min.u, bounds.min.v, bounds.max.u, bounds.max.v].map(|x| i64::from(u32::from(x) / scale));
    for x in (0..i64::from(view.width())).step_by(4) {
        put(view, [x, top], BOX);
        put(view, [x, bottom], BOX);
    }
    for y in (0..i64::from(view.height())).step_by(4) {
        put(view, [left, y], BOX);
        put(view, [right, y], BOX);
    }
}
