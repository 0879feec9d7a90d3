//! How often each grey value comes, and where object and background were parted.

use super::canvas::{Anchor, Canvas, Letters};
use super::panel::{FOOT, GAP, HEAD};
use crate::report::layers::Place;
use crate::report::layers::Seen;
use crate::report::layers::colour::{ACCENT, FAINT, INK, PAPER};
use image::RgbImage;

/// Width of a grey value and height of the commonest, px.
const BAR: f64 = 2.0;
const HIGH: f64 = 240.0;

/// A histogram a view, beside each other. Bars grow with the logarithm of the count, or an object that is small
/// before its background would not be seen.
pub(super) fn histograms(views: &[Seen<'_>]) -> RgbImage {
    let wide = 256.0 * BAR;
    let width = GAP + views.len() as u32 * (wide as u32 + GAP);
    let mut canvas = Canvas::new(width, HEAD + HIGH as u32 + FOOT, PAPER);
    let title = "Grey values, and the level between object and background (orange)";
    canvas.text(title, Place::new(16.0, 26.0), Anchor::Left, Letters::Large, INK);
    for (view, left) in
        views.iter().zip((0..).map(|k| f64::from(GAP) + f64::from(k) * (wide + f64::from(GAP))))
    {
        let base = f64::from(HEAD) + HIGH;
        let most = view.parts.histogram.iter().copied().max().unwrap_or(0).max(1);
        for (grey, count) in (0u16..).zip(&view.parts.histogram) {
            let height = f64::from(*count).ln_1p() / f64::from(most).ln_1p() * HIGH;
            let corner = Place::new(left + BAR * f64::from(grey), base - height);
            canvas.fill(corner, Place::new(BAR, height), FAINT);
        }
        // The level itself belongs to the dark side.
        let level = left + BAR * (f64::from(view.parts.level) + 1.0);
        canvas.line(Place::new(level, f64::from(HEAD)), Place::new(level, base), BAR, ACCENT);
        let name = format!("{}: {}", view.name, view.parts.level);
        canvas.text(&name, Place::new(left + wide / 2.0, base + 14.0), Anchor::Centre, Letters::Small, INK);
    }
    canvas.finish()
}
