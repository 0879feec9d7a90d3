//! Both views as SVG, a layer a stage, cut to the object; a pixel is a unit.

use super::escaped;
use crate::reconstruct::Mode;
use crate::report::Run;
use crate::report::pictures::colour::{APART, Colour, shade};
use crate::report::record::{Eye, Parts, Rasters};
use crate::report::words::view;
use crate::stage::balls::px;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{Rgba, RgbaImage};
use shared::pipeline::Side;
use shared::point::PixelPoint;
use shared::stage::graph::NodeKind;
use std::fmt::Write as _;

/// The layers, from the lowest: name, what it is called, and whether it is shown at first.
const LAYERS: [(&str, &str, bool); 9] = [
    ("grey", "image", true),
    ("mask", "mask", false),
    ("distance", "distance", false),
    ("pruned", "pruned branches", false),
    ("contour", "contour", true),
    ("skeleton", "skeleton", true),
    ("curves", "curves and balls", false),
    ("hull", "hull, matched", false),
    ("matches", "correspondence", false),
];

/// Matched points are drawn in about so many rows of the object.
const ROWS: i32 = 40;

/// The part of a view that is shown, px.
#[derive(Clone, Copy)]
struct Frame {
    min: [u32; 2],
    size: [u32; 2],
}

impl Frame {
    /// The object's box and a margin around it, within the picture where its size is known.
    fn around(eye: &Eye) -> Option<Self> {
        let inside =
            eye.parts.bounds.map(|b| [[b.min.u, b.max.u], [b.min.v, b.max.v]].map(|s| s.map(u32::from)));
        let contour = || {
            let span = |of: fn(PixelPoint) -> i32| {
                let places = || eye.parts.contour.iter().map(|p| of(p.at).max(0) as u32 >> 8);
                Some([places().min()?, places().max()?])
            };
            Some([span(|p| p.u)?, span(|p| p.v)?])
        };
        let spans = inside.or_else(contour)?;
        let margin = spans.iter().map(|[low, high]| high - low).max().unwrap_or(0) / 16 + 4;
        let limit = eye.rasters.as_ref().map_or([u32::MAX; 2], |r| [r.grey.width(), r.grey.height()]);
        let min = spans.map(|[low, _]| low.saturating_sub(margin));
        let end = [0, 1].map(|axis| (spans[axis][1] + margin + 1).min(limit[axis]));
        Some(Self { min, size: [0, 1].map(|axis| end[axis] - min[axis]) })
    }
}

/// The switches of the layers that either view has, and both views.
pub(super) fn both(run: &Run<'_>) -> (String, String) {
    let mut present = [false; LAYERS.len()];
    let mut html = String::new();
    for (side, eye) in [Side::Left, Side::Right].into_iter().zip(&run.record.eyes) {
        let Some(frame) = Frame::around(eye) else { continue };
        let ([u, v], [width, height]) = (frame.min, frame.size);
        let name = view(&side);
        let (x, y) = (f64::from(u) - 0.5, f64::from(v) - 0.5);
        // Writing to a string does not fail.
        let _ = write!(
            html,
            "<figure><svg viewBox=\"{x} {y} {width} {height}\" role=\"img\" aria-label=\"the {name} view\">"
        );
        for (k, (layer, _, shown)) in LAYERS.iter().enumerate() {
            let content = content(layer, run, side, eye, frame).filter(|content| !content.is_empty());
            if let Some(content) = content {
                let hidden = if *shown { "" } else { " style=\"display:none\"" };
                let _ = write!(html, "<g class=\"layer {layer}\"{hidden}>{content}</g>");
                present[k] = true;
            }
        }
        let _ = write!(html, "</svg><figcaption>{name}</figcaption></figure>");
    }
    let switch = |(layer, called, shown): &(&str, &str, bool)| {
        let checked = if *shown { " checked" } else { "" };
        format!("<label><input type=\"checkbox\" data-layer=\"{layer}\"{checked}>{}</label>", escaped(called))
    };
    let switches = LAYERS.iter().zip(present).filter(|(_, there)| *there).map(|(layer, _)| switch(layer));
    (switches.collect(), html)
}

fn content(layer: &str, run: &Run<'_>, side: Side, eye: &Eye, frame: Frame) -> Option<String> {
    let parts = &eye.parts;
    match layer {
        "contour" => Some(contour(parts)),
        "skeleton" => Some(skeleton(parts)),
        "curves" => Some(curves(parts)),
        "hull" => Some(hull(run, side, parts)),
        "matches" => Some(matches(run, side)),
        _ => raster(layer, eye.rasters.as_ref()?, parts, frame),
    }
}

/// The rasters, each with what is not in it transparent.
fn raster(layer: &str, rasters: &Rasters, parts: &Parts, frame: Frame) -> Option<String> {
    let opaque = |[r, g, b]: Colour| Rgba([r, g, b, u8::MAX]);
    let set = |image: &image::GrayImage, u, v| image.get_pixel(u, v).0[0] != 0;
    Some(match layer {
        "grey" => picture(frame, |u, v| Some(opaque([rasters.grey.get_pixel(u, v).0[0]; 3]))),
        "mask" => picture(frame, |u, v| {
            let colour = if set(&rasters.boundary, u, v) { [255, 159, 28] } else { [225, 225, 222] };
            set(&rasters.mask, u, v).then_some(opaque(colour))
        }),
        "distance" => picture(frame, |u, v| {
            let distance = f64::from(rasters.distance.get_pixel(u, v).0[0]);
            (distance > 0.0).then(|| opaque(shade(distance / f64::from(parts.widest.max(1)))))
        }),
        "pruned" => picture(frame, |u, v| {
            let gone = set(&rasters.skeleton, u, v) && !set(&rasters.pruned, u, v);
            gone.then_some(opaque([255, 60, 60]))
        }),
        _ => return None,
    })
}

/// An image element of the pixels of a frame.
fn picture(frame: Frame, colour: impl Fn(u32, u32) -> Option<Rgba<u8>>) -> String {
    let ([u0, v0], [width, height]) = (frame.min, frame.size);
    let clear = Rgba([0; 4]);
    let image = RgbaImage::from_fn(width, height, |u, v| colour(u0 + u, v0 + v).unwrap_or(clear));
    let mut bytes = Vec::new();
    let encoder = PngEncoder::new_with_quality(&mut bytes, CompressionType::Default, FilterType::Adaptive);
    // Writing to a vector does not fail; were it to, the layer would be missing.
    if image.write_with_encoder(encoder).is_err() {
        return String::new();
    }
    let (x, y) = (f64::from(u0) - 0.5, f64::from(v0) - 0.5);
    format!(
        "<image x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" \
         href=\"data:image/png;base64,{}\"/>",
        STANDARD.encode(bytes)
    )
}

/// A path through points, px.
fn path(points: impl Iterator<Item = [f64; 2]>, closed: bool, class: &str, colour: Option<Colour>) -> String {
    let mut d = String::new();
    for (k, [x, y]) in points.enumerate() {
        let _ = write!(d, "{}{x:.2} {y:.2}", if k == 0 { 'M' } else { 'L' });
    }
    if d.is_empty() {
        return d;
    }
    let stroke = colour.map_or(String::new(), |colour| format!(" stroke=\"{}\"", css(colour)));
    format!("<path class=\"{class}\"{stroke} d=\"{d}{}\"/>", if closed { "Z" } else { "" })
}

fn circle([x, y]: [f64; 2], radius: f64, class: &str, colour: Colour) -> String {
    format!(
        "<circle class=\"{class}\" cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"{radius:.2}\" stroke=\"{0}\" fill=\"{0}\"/>",
        css(colour)
    )
}

fn css([r, g, b]: Colour) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

fn at(p: PixelPoint) -> [f64; 2] {
    [px(p.u), px(p.v)]
}

fn contour(parts: &Parts) -> String {
    let of = |l: &shared::stage::contour::ContourLoop| {
        path(l.range().map(|i| at(parts.contour[i].at)), true, "line", Some([255, 159, 28]))
    };
    parts.loops.iter().map(of).collect()
}

fn skeleton(parts: &Parts) -> String {
    let branch = |(k, (edge, pixels)): (usize, &(shared::stage::graph::Edge, Vec<shared::point::Pixel>))| {
        let places = pixels.iter().map(|p| [f64::from(p.u), f64::from(p.v)]);
        path(places, edge.closed, "line thick", Some(APART[k % APART.len()]))
    };
    let mut html: String = parts.edges.iter().enumerate().map(branch).collect();
    for node in parts.nodes.iter().filter(|node| node.kind != NodeKind::Loop) {
        let colour = if node.kind == NodeKind::Junction { [255, 159, 28] } else { [255; 3] };
        html += &circle(at(node.position), 1.5, "dot", colour);
    }
    html
}

fn curves(parts: &Parts) -> String {
    let mut html = String::new();
    let curves = parts.branches.iter().filter_map(|branch| branch.curve(&parts.controls));
    for (k, curve) in curves.enumerate() {
        let colour = APART[k % APART.len()];
        let balls: Vec<_> = (0..=(curve.end() >> 16) * 8).map(|k| curve.evaluate(k << 13)).collect();
        for ball in balls.iter().step_by(8) {
            html += &circle(at(ball.at()), px(ball.rho), "ring", colour);
        }
        html += &path(balls.iter().map(|ball| at(ball.at())), false, "line thick", Some(colour));
        for control in curve.controls() {
            html += &circle(at(control.ball.at()), 1.2, "dot", [255; 3]);
        }
    }
    html
}

/// By how much the rows of a view were moved before they were matched, 1/256 px.
fn moved(run: &Run<'_>, side: Side) -> i32 {
    match (run.options.mode, side) {
        (Mode::Default, Side::Right) => run.reconstruction.outcome.vertical_offset,
        _ => 0,
    }
}

fn hull(run: &Run<'_>, side: Side, parts: &Parts) -> String {
    let offset = moved(run, side);
    let back = |p: &PixelPoint| at(PixelPoint { v: p.v + offset, ..*p });
    let mut html = path(parts.hull.iter().map(back), true, "line faint", Some([190, 190, 196]));
    if let Some(cuts) = &run.record.pair.cuts {
        let own = if side == Side::Left { &cuts.left } else { &cuts.right };
        html += &path(own.iter().map(back), true, "line", Some([255, 159, 28]));
        for (k, p) in own.iter().enumerate() {
            let [x, y] = back(p);
            html += &circle([x, y], 2.0, "dot", APART[k % APART.len()]);
            let letter = char::from(b'A' + (k % 26) as u8);
            let _ = write!(html, "<text x=\"{:.2}\" y=\"{:.2}\">{letter}</text>", x + 3.0, y - 3.0);
        }
    }
    html
}

/// The matched points of every few rows, dark far and yellow near.
fn matches(run: &Run<'_>, side: Side) -> String {
    let (left, pair) = (&run.record.eyes[0].parts, &run.record.pair);
    if pair.rows.len() != left.contour.len() {
        return String::new();
    }
    let offset = moved(run, side);
    let matched = || left.contour.iter().zip(&pair.rows).filter(|(_, found)| found.weight > 0);
    let disparities = || matched().map(|(_, found)| found.disparity);
    let (low, high) = (disparities().min().unwrap_or(0), disparities().max().unwrap_or(0));
    let step = left.bounds.map_or(1, |b| (i32::from(b.max.v - b.min.v) / ROWS).max(1));
    let mut html = String::new();
    for (point, found) in matched().filter(|(point, _)| (point.at.v >> 8) % step == 0) {
        let share = f64::from(found.disparity - low) / f64::from((high - low).max(1));
        let shift = if side == Side::Left { 0 } else { found.disparity };
        let place = PixelPoint { u: point.at.u - shift, v: point.at.v + offset };
        html += &circle(at(place), 1.4, "dot", shade(0.15 + 0.85 * share));
    }
    html
}
