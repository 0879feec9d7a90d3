//! One view of a picture: the object's box, enlarged by a whole number, drawn on in image coordinates.

use super::canvas::{Anchor, Canvas, Colour, Letters, Place, text_width};
use super::colour::{FAINT, GROUND, INK, PAPER};
use image::RgbImage;
use shared::bitmap::PixelBox;
use shared::point::{Pixel, PixelPoint};

/// Height that an object is enlarged to about, and width that it does not exceed, px.
const HEIGHT: u32 = 600;
const WIDTH: u32 = 800;
/// Background shown around an object, a part of its size, and at least this many pixels of the image.
const MARGIN: f64 = 0.08;
const LEAST_MARGIN: f64 = 6.0;
/// Paper between panels, above them for the title, and below them for their names, px.
pub(super) const GAP: u32 = 16;
pub(super) const HEAD: u32 = 44;
pub(super) const FOOT: u32 = 28;

/// What part of an image is shown, and how large.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Frame {
    /// First column and row shown.
    first: [i32; 2],
    /// Columns and rows shown.
    size: [u32; 2],
    /// Pixels of the picture a pixel of the image.
    pub(super) scale: u32,
}

impl Frame {
    /// Frames of equal size, scale and rows for the boxes of one object in several views.
    pub(super) fn around(boxes: &[PixelBox]) -> Vec<Self> {
        let top = boxes.iter().map(|b| b.min.v).min().unwrap_or(0);
        let bottom = boxes.iter().map(|b| b.max.v).max().unwrap_or(0);
        let columns = |b: &PixelBox| u32::from(b.max.u - b.min.u) + 1;
        let width = boxes.iter().map(columns).max().unwrap_or(1);
        let height = u32::from(bottom.saturating_sub(top)) + 1;
        let margin = (f64::from(width.max(height)) * MARGIN).max(LEAST_MARGIN).ceil() as u32;
        let scale = (HEIGHT / height).min(WIDTH / width).max(1);
        let frame = |b: &PixelBox| {
            let spare = (width - columns(b)) / 2 + margin;
            Self {
                first: [i32::from(b.min.u) - spare as i32, i32::from(top) - margin as i32],
                size: [width + 2 * margin, height + 2 * margin],
                scale,
            }
        };
        boxes.iter().map(frame).collect()
    }

    /// Width and height of the picture, px.
    pub(super) const fn picture(&self) -> [u32; 2] {
        [self.size[0] * self.scale, self.size[1] * self.scale]
    }

    /// Where a point of the image, px, lies in the picture.
    fn place(&self, u: f64, v: f64) -> Place {
        let scale = f64::from(self.scale);
        let to = |x: f64, first: i32| (x - f64::from(first) + 0.5) * scale - 0.5;
        Place::new(to(u, self.first[0]), to(v, self.first[1]))
    }
}

/// A frame at its place on a canvas.
#[derive(Clone, Copy)]
pub(super) struct Panel {
    frame: Frame,
    corner: (u32, u32),
}

impl Panel {
    /// Where a point of the image, px, lies on the canvas.
    pub(super) fn px(&self, u: f64, v: f64) -> Place {
        self.frame.place(u, v) + Place::new(f64::from(self.corner.0), f64::from(self.corner.1))
    }

    /// Where a fixed-point point lies on the canvas.
    pub(super) fn at(&self, point: PixelPoint) -> Place {
        let at = crate::stage::balls::px2(point);
        self.px(at.x, at.y)
    }

    /// Where a pixel's centre lies on the canvas.
    pub(super) fn pixel(&self, pixel: Pixel) -> Place {
        self.px(pixel.u.into(), pixel.v.into())
    }

    /// Length on the canvas of a length in the image, px.
    pub(super) fn length(&self, px: f64) -> f64 {
        px * f64::from(self.frame.scale)
    }

    /// A point of the panel, its sides running from 0 to 1.
    pub(super) fn inside(&self, x: f64, y: f64) -> Place {
        let [width, height] = self.frame.picture().map(f64::from);
        Place::new(f64::from(self.corner.0) + x * width, f64::from(self.corner.1) + y * height)
    }

    /// Paint every pixel of the image; `colour` gets column and row, and says nothing outside the image.
    pub(super) fn paint(&self, canvas: &mut Canvas, colour: impl Fn(u32, u32) -> Option<Colour>) {
        let [width, height] = self.frame.picture();
        let picture = RgbImage::from_fn(width, height, |x, y| {
            let at = |k: usize, x: u32| u32::try_from(self.frame.first[k] + (x / self.frame.scale) as i32);
            let (Ok(u), Ok(v)) = (at(0, x), at(1, y)) else { return image::Rgb(GROUND) };
            image::Rgb(colour(u, v).unwrap_or(GROUND))
        });
        canvas.paste(&picture, self.corner);
    }
}

/// A canvas with a title above and a panel a frame, side by side, each over its name.
pub(super) fn sheet(title: &str, frames: &[(Frame, &str)]) -> (Canvas, Vec<Panel>) {
    staggered(title, frames, 0)
}

/// The same, with each panel `drop` px below the one before.
pub(super) fn staggered(title: &str, frames: &[(Frame, &str)], drop: u32) -> (Canvas, Vec<Panel>) {
    let mut panels = Vec::new();
    let mut size = [GAP, 0];
    for (k, (frame, _)) in frames.iter().enumerate() {
        let panel = Panel { frame: *frame, corner: (size[0], HEAD + k as u32 * drop) };
        let [width, height] = frame.picture();
        size = [size[0] + width + GAP, size[1].max(panel.corner.1 + height + FOOT)];
        panels.push(panel);
    }
    let mut canvas = Canvas::new(size[0].max(text_width(title) + 2 * GAP), size[1], PAPER);
    let middle = Place::new(f64::from(GAP), f64::from(HEAD) / 2.0);
    canvas.text(title, middle, Anchor::Left, Letters::Large, INK);
    for (panel, (_, name)) in panels.iter().zip(frames) {
        let below = panel.inside(0.5, 1.0) + Place::new(0.0, f64::from(FOOT) / 2.0);
        canvas.text(name, below, Anchor::Centre, Letters::Small, FAINT);
    }
    (canvas, panels)
}
