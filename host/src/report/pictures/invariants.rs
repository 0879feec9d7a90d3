//! e_omega of each way in which the hulls might be matched, as bars.

use super::canvas::{Anchor, Canvas, Letters};
use super::panel::{GAP, HEAD};
use crate::report::layers::Place;
use crate::report::layers::colour::{APART, FAINT, INK, PAPER, mix};
use crate::report::layers::pair::Invariants;
use image::RgbImage;

/// A bar a value on a logarithmic scale, the chosen one set off.
pub(super) fn chart(invariants: &Invariants) -> RgbImage {
    let Invariants { values, chosen, ways } = invariants;
    const HEIGHT: f64 = 360.0;
    const FLOOR: f64 = 1e-4;
    let step = (760.0 / values.len().max(1) as f64).floor().clamp(30.0, 64.0);
    let (left, bottom) = (f64::from(GAP) + 4.0, f64::from(HEAD) + HEIGHT + 24.0);
    let width = (left * 2.0 + step * values.len() as f64).max(760.0);
    let mut canvas = Canvas::new(width as u32, bottom as u32 + 44, PAPER);
    let head = Place::new(f64::from(GAP), f64::from(HEAD) / 2.0);
    canvas.text(&format!("e_omega (log) of each {ways}"), head, Anchor::Left, Letters::Large, INK);
    let least = values.iter().copied().fold(f64::INFINITY, f64::min).max(FLOOR).log10().floor();
    let most = values.iter().copied().fold(FLOOR, f64::max).log10().ceil().max(least + 1.0);
    let height = |value: f64| (value.max(FLOOR).log10() - least) / (most - least) * HEIGHT;
    for decade in least as i32..=most as i32 {
        let y = bottom - height(10f64.powi(decade));
        canvas.line(Place::new(left, y), Place::new(width - left, y), 1.0, mix(PAPER, FAINT, 0.35));
    }
    for (k, &value) in values.iter().enumerate() {
        let x = left + step * k as f64;
        let tall = height(value).max(2.0);
        let colour = if k == *chosen { APART[5] } else { APART[0] };
        canvas.fill(Place::new(x + step * 0.12, bottom - tall), Place::new(step * 0.76, tall), colour);
        let middle = x + step / 2.0;
        if step > 44.0 {
            let text = short(value);
            canvas.text(&text, Place::new(middle, bottom - tall - 10.0), Anchor::Centre, Letters::Small, INK);
        }
        let below = Place::new(middle, bottom + 14.0);
        canvas.text(&k.to_string(), below, Anchor::Centre, Letters::Small, INK);
    }
    canvas.line(Place::new(left, bottom), Place::new(width - left, bottom), 1.5, INK);
    canvas.text(ways, Place::new(width / 2.0, bottom + 33.0), Anchor::Centre, Letters::Small, FAINT);
    canvas.finish()
}

/// A number in at most six characters.
fn short(value: f64) -> String {
    match value {
        v if v < 0.1 => format!("{v:.0e}"),
        v if v < 1.0 => format!("{v:.2}"),
        v if v < 100.0 => format!("{v:.1}"),
        v if v < 1e5 => format!("{v:.0}"),
        v => format!("{v:.0e}"),
    }
}
