//! One view of a picture: a frame of the image, enlarged by a whole number, and the layers in it.

use super::canvas::{Anchor, Canvas, Letters, text_width};
use crate::report::layers::colour::{Colour, FAINT, GROUND, INK, PAPER, RIM};
use crate::report::layers::frame::Frame;
use crate::report::layers::{Layer, Mark, Place};
use image::RgbImage;

/// Height and width that a frame is enlarged to at most, px.
const HEIGHT: u32 = 720;
const WIDTH: u32 = 960;
/// From a vertex to the middle of its letter, px.
const LETTER: f64 = 16.0;
/// Paper between panels, above them for the title, and below them for their names, px.
pub(super) const GAP: u32 = 16;
pub(super) const HEAD: u32 = 44;
pub(super) const FOOT: u32 = 28;

/// A frame at its place on a canvas, enlarged.
#[derive(Clone, Copy)]
pub(super) struct Panel {
    frame: Frame,
    /// Pixels of the picture a pixel of the image.
    scale: u32,
    corner: (u32, u32),
}

/// Pixels of the picture a pixel of a frame.
fn scale(frame: &Frame) -> u32 {
    (HEIGHT / frame.size[1].max(1)).min(WIDTH / frame.size[0].max(1)).max(1)
}

/// Width and height of a frame's picture, px.
pub(super) fn picture(frame: &Frame) -> [u32; 2] {
    frame.size.map(|side| side * scale(frame))
}

impl Panel {
    /// Where a point of the image lies on the canvas.
    pub(super) fn at(&self, point: Place) -> Place {
        let to = |x: f64, first: i32| (x - f64::from(first) + 0.5) * f64::from(self.scale) - 0.5;
        let corner = Place::new(f64::from(self.corner.0), f64::from(self.corner.1));
        Place::new(to(point.x, self.frame.first[0]), to(point.y, self.frame.first[1])) + corner
    }

    /// A point of the panel, its sides running from 0 to 1.
    pub(super) fn inside(&self, x: f64, y: f64) -> Place {
        let [width, height] = picture(&self.frame).map(f64::from);
        Place::new(f64::from(self.corner.0) + x * width, f64::from(self.corner.1) + y * height)
    }

    /// Paint the layers, the lowest first, over an empty ground.
    pub(super) fn draw<'a>(&self, canvas: &mut Canvas, layers: impl IntoIterator<Item = Layer<'a>>) {
        let [width, height] = picture(&self.frame);
        let mut ground = RgbImage::from_pixel(width, height, image::Rgb(GROUND));
        let mut marks = Vec::new();
        for layer in layers {
            match layer {
                Layer::Raster(colour) => self.paint(&mut ground, &*colour),
                Layer::Marks(more) => marks.extend(more),
            }
        }
        canvas.paste(&ground, self.corner);
        marks.iter().for_each(|mark| self.mark(canvas, mark));
    }

    fn paint(&self, picture: &mut RgbImage, colour: &dyn Fn(u32, u32) -> Option<Colour>) {
        let [columns, rows] = self.frame.size;
        let outside = |k: usize, at: u32| u32::try_from(self.frame.first[k] + at as i32);
        for (x, y) in (0..rows).flat_map(|y| (0..columns).map(move |x| (x, y))) {
            let (Ok(u), Ok(v)) = (outside(0, x), outside(1, y)) else { continue };
            let Some(colour) = colour(u, v) else { continue };
            let [left, top] = [x, y].map(|at| at * self.scale);
            for (x, y) in (0..self.scale).flat_map(|y| (0..self.scale).map(move |x| (x, y))) {
                picture.put_pixel(left + x, top + y, image::Rgb(colour));
            }
        }
    }

    fn mark(&self, canvas: &mut Canvas, mark: &Mark) {
        match mark {
            Mark::Lines { points, closed, width, colour } => {
                let points: Vec<Place> = points.iter().map(|p| self.at(*p)).collect();
                canvas.lines(&points, *closed, *width, *colour);
            }
            Mark::Ring { centre, radius, colour } => {
                canvas.circle(self.at(*centre), radius * f64::from(self.scale), 1.0, *colour);
            }
            Mark::Dots { places, radius, colour, set_off } => {
                for at in places.iter().map(|place| self.at(*place)) {
                    if *set_off {
                        canvas.dot(at, *radius, *colour, RIM);
                    } else {
                        canvas.disc(at, *radius, *colour);
                    }
                }
            }
            Mark::Letter { at, away, letter, colour } => {
                canvas.label(&letter.to_string(), self.at(*at) + away * LETTER, *colour, RIM);
            }
        }
    }
}

/// A panel by itself, on a canvas of its size.
pub(super) fn alone(frame: Frame) -> (Canvas, Panel) {
    let [width, height] = picture(&frame);
    (Canvas::new(width, height, PAPER), Panel { frame, scale: scale(&frame), corner: (0, 0) })
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
        let panel = Panel { frame: *frame, scale: scale(frame), corner: (size[0], HEAD + k as u32 * drop) };
        let [width, height] = picture(frame);
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
