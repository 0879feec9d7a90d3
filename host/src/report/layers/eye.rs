//! Layers of what was made of each view by itself. A raster that was not kept has none.

use super::colour::{ACCENT, APART, Colour, OBJECT, REMOVED, WHITE, mix, shade};
use super::{Layer, Mark, Place, Seen, dot, place};
use crate::report::record::{Parts, Rasters};
use crate::stage::balls::px;
use image::GrayImage;
use shared::point::Pixel;
use shared::stage::graph::NodeKind;
use shared::stage::medial::MedialBall;

/// The object where it is not all that is shown.
const PALE: Colour = [225, 225, 222];
/// Balls of a chain that are drawn: every so many.
const BALLS: usize = 8;
/// Points of a curve a span.
const POINTS: i32 = 8;

fn raster<'a>(
    view: &Seen<'a>,
    kept: impl Fn(&Rasters) -> bool,
    colour: impl Fn(&Rasters, u32, u32) -> Option<Colour> + 'a,
) -> Option<Layer<'a>> {
    let rasters = view.rasters.filter(|rasters| kept(rasters))?;
    Some(Layer::Raster(Box::new(move |u, v| colour(rasters, u, v))))
}

fn is_set(image: &GrayImage, u: u32, v: u32) -> bool {
    image.get_pixel_checked(u, v).is_some_and(|pixel| pixel.0[0] != 0)
}

/// The image, darkened to `part`.
pub(crate) fn grey<'a>(view: &Seen<'a>, part: f64) -> Option<Layer<'a>> {
    raster(
        view,
        |kept| !kept.grey.is_empty(),
        move |kept, u, v| kept.grey.get_pixel_checked(u, v).map(|pixel| mix([0; 3], [pixel.0[0]; 3], part)),
    )
}

/// What was taken for the object, and its boundary pixels.
pub(crate) fn mask<'a>(view: &Seen<'a>) -> Option<Layer<'a>> {
    raster(
        view,
        |kept| !kept.mask.is_empty(),
        |kept, u, v| {
            let colour = if is_set(&kept.boundary, u, v) { ACCENT } else { PALE };
            is_set(&kept.mask, u, v).then_some(colour)
        },
    )
}

/// The object in one colour, to be drawn on.
pub(crate) fn silhouette<'a>(view: &Seen<'a>, colour: Colour) -> Option<Layer<'a>> {
    raster(view, |kept| !kept.mask.is_empty(), move |kept, u, v| is_set(&kept.mask, u, v).then_some(colour))
}

/// The largest distance to the background in any view, 1/16 px.
pub(crate) fn widest(views: &[Seen<'_>]) -> u16 {
    views.iter().map(|view| view.parts.widest).max().unwrap_or(0).max(1)
}

/// How far each pixel is from the background: yellow where it is `widest`, 1/16 px.
pub(crate) fn distance<'a>(view: &Seen<'a>, widest: u16) -> Option<Layer<'a>> {
    raster(
        view,
        |kept| !kept.distance.is_empty(),
        move |kept, u, v| {
            let d = kept.distance.get_pixel_checked(u, v)?.0[0];
            (d > 0).then(|| shade(f64::from(d) / f64::from(widest)))
        },
    )
}

/// The skeleton's pixels as thinning left them.
pub(crate) fn thinned<'a>(view: &Seen<'a>) -> Option<Layer<'a>> {
    raster(
        view,
        |kept| !kept.skeleton.is_empty(),
        |kept, u, v| is_set(&kept.skeleton, u, v).then_some(ACCENT),
    )
}

/// The skeleton's pixels that pruning took away.
pub(crate) fn pruned<'a>(view: &Seen<'a>) -> Option<Layer<'a>> {
    raster(
        view,
        |kept| !kept.pruned.is_empty(),
        |kept, u, v| (is_set(&kept.skeleton, u, v) && !is_set(&kept.pruned, u, v)).then_some(REMOVED),
    )
}

/// The contour, and in another colour where the image cuts the object off.
pub(crate) fn contour(parts: &Parts) -> Layer<'static> {
    let mut marks = Vec::new();
    for l in &parts.loops {
        let mut run = Vec::new();
        let mut of_border = false;
        let mut end = |points: &mut Vec<Place>, of_border| {
            let colour = if of_border { REMOVED } else { ACCENT };
            marks.push(Mark::Lines { points: std::mem::take(points), closed: false, width: 2.0, colour });
        };
        for i in l.range() {
            let point = parts.contour[i];
            if run.is_empty() {
                of_border = point.border;
            }
            run.push(place(point.at, 0));
            if point.border != of_border {
                end(&mut run, of_border);
                (run, of_border) = (vec![place(point.at, 0)], point.border);
            }
        }
        run.extend(l.range().next().map(|first| place(parts.contour[first].at, 0)));
        end(&mut run, of_border);
    }
    Layer::Marks(marks)
}

/// The skeleton's branches, its ends (white) and junctions (orange).
pub(crate) fn skeleton(parts: &Parts) -> Layer<'static> {
    let of = |p: &Pixel| Place::new(p.u.into(), p.v.into());
    let branches = parts.edges.iter().zip(APART.iter().cycle()).map(|((edge, pixels), colour)| Mark::Lines {
        points: pixels.iter().map(of).collect(),
        closed: edge.closed,
        width: 3.0,
        colour: *colour,
    });
    let nodes = parts.nodes.iter().filter_map(|node| {
        let colour = match node.kind {
            NodeKind::End | NodeKind::Isolated => WHITE,
            NodeKind::Junction => ACCENT,
            NodeKind::Loop => return None,
        };
        Some(dot(place(node.position, 0), 4.0, colour))
    });
    Layer::Marks(branches.chain(nodes).collect())
}

/// The hull and its own vertices.
pub(crate) fn hull(parts: &Parts) -> Layer<'static> {
    let points: Vec<Place> = parts.hull.iter().map(|p| place(*p, 0)).collect();
    let vertices = Mark::Dots { places: points.clone(), radius: 3.0, colour: WHITE, set_off: true };
    Layer::Marks(vec![Mark::Lines { points, closed: true, width: 2.0, colour: ACCENT }, vertices])
}

/// The fitted curves with their control points, and some of the balls that they describe.
pub(crate) fn curves(parts: &Parts) -> Layer<'static> {
    let curves = parts.branches.iter().filter_map(|branch| branch.curve(&parts.controls));
    let (mut rings, mut lines, mut controls) = (Vec::new(), Vec::new(), Vec::new());
    for (curve, colour) in curves.zip(APART.iter().cycle()) {
        let balls: Vec<_> =
            (0..=(curve.end() >> 16) * POINTS).map(|k| curve.evaluate((k << 16) / POINTS)).collect();
        rings.extend(balls.iter().step_by(BALLS).map(|ball| Mark::Ring {
            centre: place(ball.at(), 0),
            radius: px(ball.rho),
            colour: mix(OBJECT, *colour, 0.6),
        }));
        let points = balls.iter().map(|ball| place(ball.at(), 0)).collect();
        lines.push(Mark::Lines { points, closed: false, width: 3.0, colour: *colour });
        controls.extend(curve.controls().iter().map(|control| place(control.ball.at(), 0)));
    }
    if !controls.is_empty() {
        lines.push(Mark::Dots { places: controls, radius: 2.5, colour: WHITE, set_off: true });
    }
    rings.extend(lines);
    Layer::Marks(rings)
}

/// Centres of medial balls, brighter where they are larger, and some of the balls.
pub(crate) fn medial(balls: &[MedialBall]) -> Layer<'static> {
    let largest = balls.iter().map(|ball| ball.rho).max().unwrap_or(1).max(1);
    let ring = |b: &MedialBall| Mark::Ring { centre: place(b.centre, 0), radius: px(b.rho), colour: OBJECT };
    let centre = |b: &MedialBall| Mark::Dots {
        places: vec![place(b.centre, 0)],
        radius: 2.0,
        colour: shade(0.2 + 0.8 * f64::from(b.rho) / f64::from(largest)),
        set_off: false,
    };
    Layer::Marks(balls.iter().step_by(BALLS).map(ring).chain(balls.iter().map(centre)).collect())
}
