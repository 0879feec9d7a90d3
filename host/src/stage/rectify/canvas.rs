//! Where the rectified images lie in their common plane, and at what scale.
//!
//! In: both turned eyes, and the box of the object in each raw image or nothing. Out: one size, one focal
//! length, one row for both axes, and a column for each.

use nalgebra::Point2;

use super::{MAX_SIDE, PixelBox, RectifyError, Turned, whole};

/// Samples along a side of a raw box: a bent side strays from its samples by less than the margin.
const SIDE_SAMPLES: u32 = 32;

/// The canvas, px.
pub(super) struct Canvas {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) f: f64,
    pub(super) cx: [f64; 2],
    pub(super) cy: f64,
}

/// A stretch along one axis of the plane at distance 1.
#[derive(Clone, Copy)]
struct Span {
    min: f64,
    max: f64,
}

impl Span {
    const EMPTY: Self = Self { min: f64::INFINITY, max: f64::NEG_INFINITY };

    fn with(self, x: f64) -> Self {
        Self { min: self.min.min(x), max: self.max.max(x) }
    }

    fn and(self, other: Self) -> Self {
        self.with(other.min).with(other.max)
    }

    fn length(self) -> f64 {
        self.max - self.min
    }

    fn centre(self) -> f64 {
        f64::midpoint(self.min, self.max)
    }
}

/// Fits the canvas to the object with `margin` times its box on every side.
///
/// The eyes share their principal point if the object's places in both, one disparity apart, fit
/// `MAX_SIDE` together at full scale; if not, each eye is centred on its own.
pub(super) fn fit(eyes: &[Turned; 2], boxes: [PixelBox; 2], margin: f64) -> Result<Canvas, RectifyError> {
    let [left, right] = [spans(&eyes[0], border(boxes[0]))?, spans(&eyes[1], border(boxes[1]))?];
    let rows = left.1.and(right.1);
    let both = left.0.and(right.0);
    let own = left.0.length().max(right.0.length());
    let finest = eyes.iter().flat_map(|eye| [eye.camera.fx, eye.camera.fy]).fold(0.0, f64::max);

    let sides = |columns: f64| (columns + 2.0 * margin * own, rows.length() * (1.0 + 2.0 * margin));
    let longest = f64::from(MAX_SIDE);
    let shared = finest * sides(both.length()).0 < longest;
    let (width, height) = sides(if shared { both.length() } else { own });
    // One pixel more than the distance between the first and the last centre.
    let f = finest.min((longest - 1.0) / width.max(height));
    let pixels = |length: f64| ((f * length).ceil() as u32).clamp(1, MAX_SIDE - 1) + 1;
    let (width, height) = (pixels(width), pixels(height));

    let centres = if shared { [both.centre(); 2] } else { [left.0.centre(), right.0.centre()] };
    Ok(Canvas {
        width,
        height,
        f,
        cx: centres.map(|centre| middle(width) - f * centre),
        cy: middle(height) - f * rows.centre(),
    })
}

/// Fits the view of both eyes to a canvas of the left raw image's size, each eye's columns centred on its
/// own view and the rows on those that both see.
///
/// The view ends at the middles of the raw sides: a bent lens sees much farther in the corners, and a
/// canvas that held these would decimate everything else.
pub(super) fn same_size(eyes: &[Turned; 2]) -> Result<Canvas, RectifyError> {
    let view = |eye: &Turned| {
        let all = whole(&eye.camera);
        let middle = nalgebra::center(&all.min, &all.max);
        let ends =
            [(all.min.x, middle.y), (all.max.x, middle.y), (middle.x, all.min.y), (middle.x, all.max.y)];
        spans(eye, ends.into_iter().map(|(u, v)| Point2::new(u, v)))
    };
    let [left, right] = [view(&eyes[0])?, view(&eyes[1])?];
    let rows = Span { min: left.1.min.max(right.1.min), max: left.1.max.min(right.1.max) };
    let columns = left.0.length().max(right.0.length());
    if !(rows.length() > 0.0 && columns > 0.0) {
        return Err(RectifyError::Apart);
    }
    let (width, height) = (eyes[0].camera.width, eyes[0].camera.height);
    let f = (2.0 * middle(width) / columns).min(2.0 * middle(height) / rows.length());
    Ok(Canvas {
        width,
        height,
        f,
        cx: [left, right].map(|view| middle(width) - f * view.0.centre()),
        cy: middle(height) - f * rows.centre(),
    })
}

/// The place halfway between the first and the last pixel of a side.
fn middle(side: u32) -> f64 {
    f64::from(side.saturating_sub(1)) / 2.0
}

/// What columns and rows of the plane at distance 1 some raw pixels cover.
fn spans(eye: &Turned, pixels: impl Iterator<Item = Point2<f64>>) -> Result<(Span, Span), RectifyError> {
    let mut spans = (Span::EMPTY, Span::EMPTY);
    for pixel in pixels {
        let ray = eye.ray(pixel)?;
        spans = (spans.0.with(ray.x), spans.1.with(ray.y));
    }
    Ok(spans)
}

/// Points along the border of a box.
pub(super) fn border(PixelBox { min, max }: PixelBox) -> impl Iterator<Item = Point2<f64>> {
    (0..=SIDE_SAMPLES).flat_map(move |step| {
        let share = f64::from(step) / f64::from(SIDE_SAMPLES);
        let (u, v) = (min.x + share * (max.x - min.x), min.y + share * (max.y - min.y));
        [Point2::new(u, min.y), Point2::new(u, max.y), Point2::new(min.x, v), Point2::new(max.x, v)]
    })
}
