//! What part of each image is shown: the object's box and some background around it.

use super::Seen;
use crate::stage::balls::px;
use shared::bitmap::PixelBox;
use shared::point::{Pixel, PixelPoint};

/// Background shown around an object, a part of its size, and at least this many pixels.
const MARGIN: f64 = 0.08;
const LEAST_MARGIN: f64 = 6.0;

/// Part of an image, which may reach beyond its border.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Frame {
    /// First column and row shown.
    pub(crate) first: [i32; 2],
    /// Columns and rows shown.
    pub(crate) size: [u32; 2],
}

impl Frame {
    /// Frames of equal size and rows for one object in several views, so that epipolar lines run through both; whole
    /// images where the object was not found in all. `offset` is that of the right rows, 1/256 px.
    pub(crate) fn of(views: &[Seen<'_>], offset: i32) -> Vec<Self> {
        let boxes: Option<Vec<_>> =
            views.iter().zip([0, offset]).map(|(view, offset)| object(view, offset)).collect();
        boxes.map_or_else(|| views.iter().map(Self::whole).collect(), |boxes| Self::around(&boxes))
    }

    /// All of an image; nothing where it was not kept.
    pub(crate) fn whole(view: &Seen<'_>) -> Self {
        let size = view.rasters.map_or([0; 2], |rasters| rasters.grey.dimensions().into());
        Self { first: [0; 2], size }
    }

    fn around(boxes: &[PixelBox]) -> Vec<Self> {
        let top = boxes.iter().map(|b| b.min.v).min().unwrap_or(0);
        let bottom = boxes.iter().map(|b| b.max.v).max().unwrap_or(0);
        let columns = |b: &PixelBox| u32::from(b.max.u - b.min.u) + 1;
        let width = boxes.iter().map(columns).max().unwrap_or(1);
        let height = u32::from(bottom.saturating_sub(top)) + 1;
        let margin = (f64::from(width.max(height)) * MARGIN).max(LEAST_MARGIN).ceil() as u32;
        let frame = |b: &PixelBox| {
            let spare = (width - columns(b)) / 2 + margin;
            Self {
                first: [i32::from(b.min.u) - spare as i32, i32::from(top) - margin as i32],
                size: [width + 2 * margin, height + 2 * margin],
            }
        };
        boxes.iter().map(frame).collect()
    }
}

/// The object's box in a view, by the first thing that tells it.
fn object(view: &Seen<'_>, offset: i32) -> Option<PixelBox> {
    let parts = view.parts;
    let hull = || around(parts.hull.iter().map(|p| PixelPoint { v: p.v + offset, ..*p }));
    parts.bounds.or_else(|| around(parts.contour.iter().map(|p| p.at))).or_else(hull)
}

fn around(points: impl Iterator<Item = PixelPoint>) -> Option<PixelBox> {
    let pixel = |p: PixelPoint| {
        let [u, v] = [p.u, p.v].map(|x| px(x).round().clamp(0.0, f64::from(u16::MAX)) as u16);
        Pixel { u, v }
    };
    points.map(pixel).fold(None, |found, p| {
        let PixelBox { min, max } = found.unwrap_or(PixelBox { min: p, max: p });
        Some(PixelBox {
            min: Pixel { u: min.u.min(p.u), v: min.v.min(p.v) },
            max: Pixel { u: max.u.max(p.u), v: max.v.max(p.v) },
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_of_two_views_have_the_same_rows_and_size() {
        let corner = |u, v| Pixel { u, v };
        let boxes = [
            PixelBox { min: corner(10, 20), max: corner(29, 59) },
            PixelBox { min: corner(0, 21), max: corner(9, 60) },
        ];
        let frames = Frame::around(&boxes);
        assert_eq!(frames[0], Frame { first: [4, 14], size: [32, 53] });
        assert_eq!(frames[1], Frame { first: [-11, 14], size: [32, 53] });
    }
}
