//! Pictures of how the two views were matched.

use super::canvas::{Anchor, Canvas, Letters, Place};
use super::colour::{ACCENT, APART, FAINT, GROUND, INK, OBJECT, PAPER, REMOVED, RIM, mix, shade};
use super::eye::{Seen, frames, paint_mask, remark};
use super::panel::{GAP, HEAD, Panel, sheet, staggered};
use crate::report::record::Matches;
use crate::stage::balls::px;
use image::RgbImage;
use shared::fixed::ONE;
use shared::pipeline::PAPER_VERTICES;
use shared::point::PixelPoint;
use shared::stage::correspond::{VertexMatch, reduce};
use shared::stage::invariants::{Measure, e_omega};

/// Rows of the object between which matches are drawn: about so many rows in all.
const ROWS: i32 = 22;
/// Vertices of a hull that can be reduced again for a picture.
const HULL: usize = 1 << 12;

/// Letters nearer to one another than this, px, would not be readable; only the first is drawn.
const LETTER: f64 = 12.0;

/// A vertex of the left hull, its partner, and whether it decided the match.
type VertexPair = (PixelPoint, PixelPoint, bool);

/// The matched vertices in the coordinates that were matched.
fn vertex_pairs(views: &[Seen<'_>; 2], pair: &Matches) -> Vec<VertexPair> {
    if let Some(cuts) = &pair.cuts {
        return cuts.left.iter().zip(&cuts.right).map(|(a, b)| (*a, *b, true)).collect();
    }
    let Some(found) = &pair.vertices else { return Vec::new() };
    let hulls = reduced(views);
    let [left, right] = &hulls;
    let n = left.len().min(right.len());
    let partner = |k: usize| {
        let (i, j) = ((found.quadruplets.0 + k) % n, (found.quadruplets.1 + k) % n);
        (left[i], right[j], k < 4)
    };
    (0..n).map(partner).collect()
}

/// The hulls as the paper's matching compares them.
fn reduced(views: &[Seen<'_>; 2]) -> [Vec<PixelPoint>; 2] {
    let hulls = views.map(|view| &view.parts.hull);
    let n = hulls.iter().map(|hull| hull.len()).min().unwrap_or(0).min(PAPER_VERTICES);
    hulls.map(|hull| {
        let mut list = heapless::Vec::<PixelPoint, HULL>::from_slice(hull).unwrap_or_default();
        reduce(&mut list, n);
        list.to_vec()
    })
}

/// Both hulls with the matched vertices, the same letter for a vertex in both views. `offset` is added to
/// the right view's rows, 1/256 px.
pub(super) fn hulls(views: &[Seen<'_>; 2], pair: &Matches, offset: i32) -> Option<RgbImage> {
    let (mut canvas, panels) = sheet("Hulls: a letter marks the same vertex in both views", &frames(views)?);
    let pairs = vertex_pairs(views, pair);
    for (side, (panel, view)) in panels.iter().zip(views).enumerate() {
        paint_mask(&mut canvas, *panel, &view.rasters.mask, OBJECT);
        let moved = |p: PixelPoint| PixelPoint { v: p.v + if side == 1 { offset } else { 0 }, ..p };
        let outline: Vec<Place> = view.parts.hull.iter().map(|p| panel.at(moved(*p))).collect();
        canvas.lines(&outline, true, 1.5, FAINT);
        let own = |k: usize| panel.at(moved(if side == 0 { pairs[k].0 } else { pairs[k].1 }));
        let middle = panel.inside(0.5, 0.5);
        for k in 0..pairs.len() {
            canvas.line(own(k), own((k + 1) % pairs.len()), 2.0, ACCENT);
        }
        let mut labelled: Vec<Place> = Vec::new();
        for (k, pair) in pairs.iter().enumerate() {
            let (place, colour) = (own(k), if pair.2 { APART[k % APART.len()] } else { FAINT });
            canvas.dot(place, 4.5, colour, RIM);
            let away = (place - middle).try_normalize(0.0).unwrap_or_else(Place::x);
            let letter = char::from(b'A' + (k % 26) as u8).to_string();
            let at = place + away * 16.0;
            if labelled.iter().all(|other| (at - other).norm() > LETTER) {
                canvas.label(&letter, at, mix(colour, [255; 3], 0.5), RIM);
                labelled.push(at);
            }
        }
    }
    Some(canvas.finish())
}

/// e_omega of each shift, or of each quadruplet that the matched one could have been.
pub(super) fn invariants(views: &[Seen<'_>; 2], pair: &Matches, omega: usize) -> Option<RgbImage> {
    let (bars, chosen) = match (&pair.cuts, &pair.vertices) {
        (Some(cuts), _) => (cuts.errors.map(|e| f64::from(e) / f64::from(ONE)).to_vec(), cuts.shift),
        (None, Some(found)) => (of_quadruplets(views, found, omega), found.quadruplets.1),
        (None, None) => return None,
    };
    let title = if pair.cuts.is_some() {
        "e_omega (log) of each shift of the right hull: 0 is what the rows say"
    } else {
        "e_omega (log) of the left quadruplet against each right one"
    };
    Some(chart(title, &bars, chosen))
}

fn of_quadruplets(views: &[Seen<'_>; 2], found: &VertexMatch, omega: usize) -> Vec<f64> {
    let [left, right] = reduced(views);
    let error = |j| e_omega((&left, found.quadruplets.0), (&right, j), omega, Measure::Ratio);
    (0..right.len()).map(|j| error(j) as f64 / f64::from(ONE) / f64::from(ONE)).collect()
}

/// A bar a value on a logarithmic scale, the chosen one set off.
fn chart(title: &str, values: &[f64], chosen: usize) -> RgbImage {
    const HEIGHT: f64 = 360.0;
    const FLOOR: f64 = 1e-4;
    let step = (760.0 / values.len().max(1) as f64).floor().clamp(30.0, 64.0);
    let (left, bottom) = (f64::from(GAP) + 4.0, f64::from(HEAD) + HEIGHT + 24.0);
    let width = (left * 2.0 + step * values.len() as f64).max(760.0);
    let mut canvas = Canvas::new(width as u32, bottom as u32 + 44, PAPER);
    let head = Place::new(f64::from(GAP), f64::from(HEAD) / 2.0);
    canvas.text(title, head, Anchor::Left, Letters::Large, INK);
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
        let colour = if k == chosen { APART[5] } else { APART[0] };
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
    let axis = if values.len() == 12 { "shift, vertices" } else { "first vertex of the right quadruplet" };
    canvas.text(axis, Place::new(width / 2.0, bottom + 33.0), Anchor::Centre, Letters::Small, FAINT);
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

/// A matched point: left, right, disparity, px.
type Match = (PixelPoint, PixelPoint, f64);

/// Matched points of every Nth row with lines between them, coloured by disparity. `offset` is added to the
/// right view's rows, 1/256 px.
pub(super) fn correspondence(views: &[Seen<'_>; 2], pair: &Matches, offset: i32) -> Option<RgbImage> {
    let frames = frames(views)?;
    let shown = frames.first()?.0.picture()[1];
    let title = if pair.rows.is_empty() {
        "Correspondence by the affine map: dark far, yellow near"
    } else {
        "Correspondence by rows: dark far, yellow near, red no partner"
    };
    let (mut canvas, panels) = staggered(title, &frames, shown / 5);
    let &[left, right] = panels.as_slice() else { return None };
    for (panel, view) in panels.iter().zip(views) {
        paint_mask(&mut canvas, *panel, &view.rasters.mask, mix(GROUND, OBJECT, 0.6));
    }
    let (contour, rows) = matches(views, pair, offset);
    let low = contour.iter().map(|m| m.2).fold(f64::INFINITY, f64::min);
    let high = contour.iter().map(|m| m.2).fold(f64::NEG_INFINITY, f64::max);
    let colour = |d: f64| shade(0.12 + 0.88 * (d - low) / (high - low).max(1e-6));
    unmatched(&mut canvas, left, &views[0], pair);
    for (a, b, d) in &contour {
        canvas.disc(left.at(*a), 1.8, colour(*d));
        canvas.disc(right.at(*b), 1.8, colour(*d));
    }
    for (a, b, d) in &rows {
        canvas.line(left.at(*a), right.at(*b), 1.2, colour(*d));
    }
    for (a, b, d) in &rows {
        canvas.dot(left.at(*a), 3.5, colour(*d), RIM);
        canvas.dot(right.at(*b), 3.5, colour(*d), RIM);
    }
    remark(&mut canvas, left, &format!("disparity {low:.1} .. {high:.1} px"));
    Some(canvas.finish())
}

/// All matched points, and those of every Nth row.
fn matches(views: &[Seen<'_>; 2], pair: &Matches, offset: i32) -> (Vec<Match>, Vec<Match>) {
    let step = views[0].parts.bounds.map_or(1, |b| (i32::from(b.max.v - b.min.v) / ROWS).max(1));
    let band = |p: PixelPoint| p.v.div_euclid(step * shared::fixed::PX);
    if pair.rows.is_empty() {
        let of = |p: &shared::stage::nearest::Pair| (p.left, p.right, px(p.left.u - p.right.u));
        let all: Vec<Match> = pair.boundary_pairs.iter().map(of).collect();
        let rows =
            pair.boundary_pairs.iter().map(of).filter(|m| m.0.v == band(m.0) * step * shared::fixed::PX);
        return (all, rows.collect());
    }
    let parts = views[0].parts;
    let (mut all, mut rows) = (Vec::new(), Vec::new());
    for l in &parts.loops {
        for i in l.range() {
            let (at, found) = (parts.contour[i].at, pair.rows[i]);
            if found.weight > 0 {
                let partner = PixelPoint { u: at.u - found.disparity, v: at.v + offset };
                let matched = (at, partner, px(found.disparity));
                all.push(matched);
                if band(at) != band(parts.contour[l.step(i, 1)].at) {
                    rows.push(matched);
                }
            }
        }
    }
    (all, rows)
}

/// Mark the stretches of the left contour about which the right view says nothing.
fn unmatched(canvas: &mut Canvas, panel: Panel, view: &Seen<'_>, pair: &Matches) {
    for (point, _) in view.parts.contour.iter().zip(&pair.rows).filter(|(_, found)| found.weight == 0) {
        canvas.disc(panel.at(point.at), 1.8, REMOVED);
    }
}
