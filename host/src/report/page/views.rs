//! Both views for the script: a layer a stage, each as SVG in pixels of the image.

use super::escaped;
use super::picture::address;
use crate::report::layers::colour::{Colour, RIM};
use crate::report::layers::frame::Frame;
use crate::report::layers::pair::Pair;
use crate::report::layers::{Layer, Mark, Place, eye};
use image::{Rgba, RgbaImage};
use serde::Serialize;
use shared::stage::distance::DISTANCE_PX;
use std::fmt::Write as _;

/// The layers, from the lowest: name, and what it is called.
const LAYERS: [(&str, &str); 9] = [
    ("grey", "image"),
    ("mask", "mask"),
    ("distance", "distance"),
    ("pruned", "pruned branches"),
    ("contour", "contour"),
    ("skeleton", "skeleton"),
    ("curves", "curves and balls"),
    ("hull", "hull, matched"),
    ("matches", "correspondence"),
];

/// From a vertex to the middle of its letter, and the letter's size: parts of the frame's width.
const LETTER: f64 = 0.035;

/// Both views, and the layers that either has.
#[derive(Serialize)]
pub(super) struct Views {
    layers: Vec<Switch>,
    figures: Vec<Figure>,
}

/// A layer to be switched on and off.
#[derive(Serialize)]
struct Switch {
    name: &'static str,
    title: &'static str,
    /// What its colours mean.
    caption: String,
    /// Whether it is shown at first.
    shown: bool,
}

/// A view.
#[derive(Serialize)]
struct Figure {
    name: &'static str,
    /// Left, top, width and height of what is shown.
    frame: [f64; 4],
    /// Names of its layers and what is in them, the lowest first.
    layers: Vec<(&'static str, String)>,
}

impl Views {
    /// The views of a pair in their frames, of which the layers `shown` are there to be seen at first.
    pub(super) fn of(pair: &Pair<'_>, frames: Vec<Frame>, shown: &[&str]) -> Self {
        let matched = pair.matched();
        let widest = eye::widest(&pair.views);
        let layer = |name: &str, k: usize| {
            let view = &pair.views[k];
            match name {
                "grey" => eye::grey(view, 1.0),
                "mask" => eye::mask(view),
                "distance" => eye::distance(view, widest),
                "pruned" => eye::pruned(view),
                "contour" => Some(eye::contour(view.parts)),
                "skeleton" => Some(eye::skeleton(view.parts)),
                "curves" => Some(eye::curves(view.parts)),
                "hull" => Some(pair.hull(k)),
                _ => Some(matched.layer(k)),
            }
        };
        let caption = |name: &str| match name {
            "mask" => "white: the object; orange: its boundary pixels".into(),
            "distance" => format!("dark: 0 px; yellow: {:.1} px", f64::from(widest) / f64::from(DISTANCE_PX)),
            "pruned" => "red: what pruning took away".into(),
            "contour" => "orange; red where the image's border cuts the object off".into(),
            "skeleton" => "a colour a branch; white: ends; orange: junctions".into(),
            "curves" => "white: control points; circles: balls".into(),
            "hull" => "a letter marks the same vertex in both views".into(),
            "matches" => matched.caption(),
            _ => String::new(),
        };
        let figure = |(k, frame): (usize, Frame)| {
            let content = |(name, _): (&'static str, &str)| {
                let svg = svg(&layer(name, k)?, frame);
                (!svg.is_empty()).then_some((name, svg))
            };
            Figure {
                name: pair.views[k].name,
                frame: [
                    f64::from(frame.first[0]) - 0.5,
                    f64::from(frame.first[1]) - 0.5,
                    frame.size[0].into(),
                    frame.size[1].into(),
                ],
                layers: LAYERS.into_iter().filter_map(content).collect(),
            }
        };
        let figures: Vec<_> = frames.into_iter().enumerate().map(figure).collect();
        let there = |name| figures.iter().any(|f| f.layers.iter().any(|(other, _)| *other == name));
        let switch =
            |(name, title)| Switch { name, title, caption: caption(name), shown: shown.contains(&name) };
        let layers = LAYERS.into_iter().filter(|(name, _)| there(*name)).map(switch).collect();
        Self { layers, figures: figures.into_iter().filter(|figure| !figure.layers.is_empty()).collect() }
    }
}

/// A layer's elements.
fn svg(layer: &Layer<'_>, frame: Frame) -> String {
    match layer {
        Layer::Raster(colour) => picture(frame, colour),
        Layer::Marks(marks) => marks.iter().map(|mark| element(mark, frame)).collect(),
    }
}

/// An image element of the pixels of a frame; what has no colour is transparent.
fn picture(frame: Frame, colour: &dyn Fn(u32, u32) -> Option<Colour>) -> String {
    let [width, height] = frame.size;
    let at = |k: usize, x: u32| u32::try_from(frame.first[k] + x as i32).ok();
    let image = RgbaImage::from_fn(width, height, |x, y| {
        let colour = at(0, x).zip(at(1, y)).and_then(|(u, v)| colour(u, v));
        colour.map_or(Rgba([0; 4]), |[r, g, b]| Rgba([r, g, b, u8::MAX]))
    });
    if image.pixels().all(|pixel| pixel.0[3] == 0) {
        return String::new();
    }
    let [x, y] = frame.first.map(|first| f64::from(first) - 0.5);
    format!(
        "<image x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" \
         href=\"{}\"/>",
        address(&image)
    )
}

/// A mark's element; the widths of its lines are those of the screen, which is the style's doing.
fn element(mark: &Mark, frame: Frame) -> String {
    let width = f64::from(frame.size[0]);
    match mark {
        Mark::Lines { points, closed, width, colour } => {
            let mut d = String::new();
            for (k, p) in points.iter().enumerate() {
                // Writing to a string does not fail.
                let _ = write!(d, "{}{:.2} {:.2}", if k == 0 { 'M' } else { 'L' }, p.x, p.y);
            }
            if points.len() < 2 {
                return String::new();
            }
            path(&d, if *closed { "Z" } else { "" }, *width, *colour)
        }
        Mark::Ring { centre, radius, colour } => format!(
            "<circle cx=\"{:.2}\" cy=\"{:.2}\" r=\"{radius:.2}\" stroke=\"{}\"/>",
            centre.x,
            centre.y,
            css(*colour)
        ),
        Mark::Dots { places, radius, colour, set_off } => {
            // Lines of no length with round ends are discs whose size is the screen's.
            let of = |p: &Place| format!("M{:.2} {:.2}h0", p.x, p.y);
            let d: String = places.iter().map(of).collect();
            let rim = if *set_off { path(&d, "", 2.0 * radius + 3.0, RIM) } else { String::new() };
            rim + &path(&d, "", 2.0 * radius, *colour)
        }
        Mark::Letter { at, away, letter, colour } => {
            let at = at + away * (LETTER * width);
            format!(
                "<text x=\"{:.2}\" y=\"{:.2}\" font-size=\"{:.2}\" fill=\"{}\">{}</text>",
                at.x,
                at.y,
                LETTER * width,
                css(*colour),
                escaped(&letter.to_string())
            )
        }
    }
}

fn path(d: &str, end: &str, width: f64, colour: Colour) -> String {
    format!("<path stroke=\"{}\" stroke-width=\"{width}\" d=\"{d}{end}\"/>", css(colour))
}

fn css([r, g, b]: Colour) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}
