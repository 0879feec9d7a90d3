//! Layers of how the two views were matched, in the default and in the paper's way.

use super::colour::{ACCENT, APART, Colour, FAINT, REMOVED, mix, shade};
use super::{Layer, Mark, Place, Seen, dot, place};
use crate::reconstruct::Mode;
use crate::report::record::{Matches, Record};
use crate::stage::balls::px;
use shared::fixed::{ONE, PX};
use shared::pipeline::PAPER_VERTICES;
use shared::point::PixelPoint;
use shared::stage::correspond::reduce;
use shared::stage::invariants::{Measure, e_omega};

/// Rows of the object in which matches are marked: about so many.
const ROWS: i32 = 22;
/// Vertices of a hull that can be reduced again for a picture.
const HULL: usize = 1 << 12;
/// Vertices nearer to one another than this part of the object's height share a letter.
const LETTER: f64 = 0.02;
/// Shades of disparity that are told apart.
const SHADES: usize = 32;

/// Both views and how they were matched.
pub(crate) struct Pair<'a> {
    pub(crate) views: [Seen<'a>; 2],
    matches: &'a Matches,
    mode: Mode,
    /// What was taken from the right rows before they were matched, 1/256 px.
    pub(crate) offset: i32,
}

/// A vertex of the left hull, its partner, and whether it decided the match.
type VertexPair = (PixelPoint, PixelPoint, bool);
/// A matched point in the left and in the right view, and its disparity, px.
type Match = (PixelPoint, PixelPoint, f64);

/// e_omega of each way in which the hulls might be matched.
pub(crate) struct Invariants {
    /// In the order of the ways.
    pub(crate) values: Vec<f64>,
    /// Which one was chosen.
    pub(crate) chosen: usize,
    /// What the ways are.
    pub(crate) ways: &'static str,
}

impl<'a> Pair<'a> {
    /// The pair of a record that was made in `mode`, and whose right rows were moved by `offset`.
    pub(crate) fn of(record: &'a Record, mode: Mode, offset: i32) -> Self {
        // The paper's stages take rows as they are.
        let offset = if mode == Mode::Default { offset } else { 0 };
        Self { views: Seen::both(&record.eyes), matches: &record.pair, mode, offset }
    }

    /// The matched vertices in the coordinates that were matched.
    fn vertices(&self) -> Vec<VertexPair> {
        if let Some(cuts) = &self.matches.cuts {
            return cuts.left.iter().zip(&cuts.right).map(|(a, b)| (*a, *b, true)).collect();
        }
        let Some(found) = &self.matches.vertices else { return Vec::new() };
        let [left, right] = &self.reduced();
        let n = left.len().min(right.len());
        let partner = |k: usize| {
            let (i, j) = ((found.quadruplets.0 + k) % n, (found.quadruplets.1 + k) % n);
            (left[i], right[j], k < 4)
        };
        (0..n).map(partner).collect()
    }

    /// The hulls as the paper's matching compares them.
    fn reduced(&self) -> [Vec<PixelPoint>; 2] {
        let hulls = self.views.map(|view| &view.parts.hull);
        let n = hulls.iter().map(|hull| hull.len()).min().unwrap_or(0).min(PAPER_VERTICES);
        hulls.map(|hull| {
            let mut list = heapless::Vec::<PixelPoint, HULL>::from_slice(hull).unwrap_or_default();
            reduce(&mut list, n);
            list.to_vec()
        })
    }

    /// The hull of a view (0 left, 1 right), and on it the matched vertices: the same letter in both views.
    pub(crate) fn hull(&self, side: usize) -> Layer<'static> {
        let offset = if side == 1 { self.offset } else { 0 };
        let hull: Vec<Place> = self.views[side].parts.hull.iter().map(|p| place(*p, offset)).collect();
        let pairs = self.vertices();
        let own = |pair: &VertexPair| place(if side == 0 { pair.0 } else { pair.1 }, offset);
        let middle = hull.iter().sum::<Place>() / hull.len().max(1) as f64;
        let height = hull.iter().map(|p| (p - middle).y.abs()).fold(1.0, f64::max) * 2.0;
        let mut marks = vec![
            Mark::Lines { points: hull, closed: true, width: 1.5, colour: FAINT },
            Mark::Lines { points: pairs.iter().map(own).collect(), closed: true, width: 2.0, colour: ACCENT },
        ];
        let mut lettered: Vec<Place> = Vec::new();
        for (k, pair) in pairs.iter().enumerate() {
            let (at, colour) = (own(pair), if pair.2 { APART[k % APART.len()] } else { FAINT });
            marks.push(dot(at, 4.5, colour));
            if lettered.iter().all(|other| (at - other).norm() > LETTER * height) {
                let away = (at - middle).try_normalize(0.0).unwrap_or_else(Place::x);
                let letter = char::from(b'A' + (k % 26) as u8);
                marks.push(Mark::Letter { at, away, letter, colour: mix(colour, [255; 3], 0.5) });
                lettered.push(at);
            }
        }
        Layer::Marks(marks)
    }

    /// e_omega of each shift, or of each quadruplet that the matched one could have been.
    pub(crate) fn invariants(&self) -> Option<Invariants> {
        if let Some(cuts) = &self.matches.cuts {
            let values = cuts.errors.map(|e| f64::from(e) / f64::from(ONE)).to_vec();
            return Some(Invariants { values, chosen: cuts.shift, ways: "shift, vertices" });
        }
        let (found, Mode::Paper { omega }) = (self.matches.vertices.as_ref()?, self.mode) else {
            return None;
        };
        let [left, right] = self.reduced();
        let error = |j| e_omega((&left, found.quadruplets.0), (&right, j), omega, Measure::Ratio);
        let values = (0..right.len()).map(|j| error(j) as f64 / f64::from(ONE) / f64::from(ONE)).collect();
        Some(Invariants { values, chosen: found.quadruplets.1, ways: "first vertex of the right quadruplet" })
    }

    /// The matched points.
    pub(crate) fn matched(&self) -> Matched {
        let parts = self.views[0].parts;
        let rows = || parts.contour.iter().map(|p| p.at.v);
        let height = rows().max().unwrap_or(0) - rows().min().unwrap_or(0);
        let step = (height / PX / ROWS).max(1) * PX;
        let band = |p: PixelPoint| p.v.div_euclid(step);
        let by_rows = !self.matches.rows.is_empty();
        let mut found = Matched { by_rows, ..Matched::default() };
        for pair in &self.matches.boundary_pairs {
            let matched = (pair.left, pair.right, px(pair.left.u - pair.right.u));
            found.add(matched, band(pair.left) * step == pair.left.v);
        }
        for l in parts.loops.iter().filter(|_| by_rows) {
            for i in l.range() {
                let (at, partner) = (parts.contour[i].at, self.matches.rows[i]);
                if partner.weight > 0 {
                    let there = PixelPoint { u: at.u - partner.disparity, v: at.v + self.offset };
                    let crosses = band(at) != band(parts.contour[l.step(i, 1)].at);
                    found.add((at, there, px(partner.disparity)), crosses);
                } else {
                    found.lost.push(place(at, 0));
                }
            }
        }
        found
    }
}

/// The points that were matched.
#[derive(Default)]
pub(crate) struct Matched {
    all: Vec<Match>,
    /// Those of every Nth row.
    rows: Vec<Match>,
    /// Points of the left contour without partner.
    lost: Vec<Place>,
    /// Least and greatest disparity, px.
    span: Option<[f64; 2]>,
    /// Whether partners were found row by row, and not by the paper's map.
    pub(crate) by_rows: bool,
}

impl Matched {
    fn add(&mut self, matched: Match, in_row: bool) {
        let [low, high] = self.span.unwrap_or([matched.2; 2]);
        self.span = Some([low.min(matched.2), high.max(matched.2)]);
        self.all.push(matched);
        if in_row {
            self.rows.push(matched);
        }
    }

    /// What the colours of the matched points mean.
    pub(crate) fn caption(&self) -> String {
        let [low, high] = self.span.unwrap_or_default();
        let lost = if self.by_rows { "; red: no partner" } else { "" };
        format!("dark: far, {low:.1} px of disparity; yellow: near, {high:.1} px{lost}")
    }

    /// The points of a view (0 left, 1 right), those of some rows larger; in the left view also those without partner.
    pub(crate) fn layer(&self, side: usize) -> Layer<'static> {
        let mut marks = Vec::new();
        if side == 0 && !self.lost.is_empty() {
            let places = self.lost.clone();
            marks.push(Mark::Dots { places, radius: 1.8, colour: REMOVED, set_off: false });
        }
        for (matches, radius, set_off) in [(&self.all, 1.8, false), (&self.rows, 3.5, true)] {
            let mut shades = vec![Vec::new(); SHADES];
            for matched in matches {
                let at = place(if side == 0 { matched.0 } else { matched.1 }, 0);
                shades[(self.nearness(matched.2) * (SHADES - 1) as f64).round() as usize].push(at);
            }
            for (k, places) in shades.into_iter().enumerate().filter(|(_, places)| !places.is_empty()) {
                let colour = colour(k as f64 / (SHADES - 1) as f64);
                marks.push(Mark::Dots { places, radius, colour, set_off });
            }
        }
        Layer::Marks(marks)
    }

    /// The points of some rows in both views, with their colour.
    pub(crate) fn links(&self) -> impl Iterator<Item = ([Place; 2], Colour)> {
        self.rows.iter().map(|m| ([m.0, m.1].map(|p| place(p, 0)), colour(self.nearness(m.2))))
    }

    /// Where a disparity lies between the least, 0, and the greatest, 1.
    fn nearness(&self, disparity: f64) -> f64 {
        let [low, high] = self.span.unwrap_or_default();
        ((disparity - low) / (high - low).max(1e-6)).clamp(0.0, 1.0)
    }
}

fn colour(nearness: f64) -> Colour {
    shade(0.12 + 0.88 * nearness)
}
