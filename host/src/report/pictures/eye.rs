//! Pictures of what was made of each view by itself.

use super::canvas::{Anchor, Canvas, Colour, Letters, Place};
use super::colour::{ACCENT, APART, GROUND, OBJECT, REMOVED, RIM, WHITE, mix, shade};
use super::panel::{Frame, Panel, sheet};
use crate::report::record::{Parts, Rasters};
use crate::stage::balls::px;
use image::{GrayImage, RgbImage};
use shared::stage::distance::DISTANCE_PX;
use shared::stage::graph::NodeKind;
use shared::stage::medial::MedialBall;

/// A view to be drawn.
#[derive(Clone, Copy)]
pub(crate) struct Seen<'a> {
    /// What it is called.
    pub(crate) name: &'static str,
    /// Its figures and lists.
    pub(crate) parts: &'a Parts,
    /// Its rasters.
    pub(crate) rasters: &'a Rasters,
}

/// The frames of the views, under their names; none without an object.
pub(super) fn frames<'a>(views: &[Seen<'a>]) -> Option<Vec<(Frame, &'a str)>> {
    let boxes: Option<Vec<_>> = views.iter().map(|view| view.parts.bounds).collect();
    let frames = Frame::around(&boxes?);
    Some(frames.into_iter().zip(views.iter().map(|view| view.name)).collect())
}

/// A sheet with a panel a view, drawn by `draw`.
fn each(
    title: &str,
    views: &[Seen<'_>],
    mut draw: impl FnMut(&mut Canvas, Panel, &Seen<'_>),
) -> Option<RgbImage> {
    let (mut canvas, panels) = sheet(title, &frames(views)?);
    for (panel, view) in panels.into_iter().zip(views) {
        draw(&mut canvas, panel, view);
    }
    Some(canvas.finish())
}

fn is_set(image: &GrayImage, u: u32, v: u32) -> bool {
    image.get_pixel_checked(u, v).is_some_and(|pixel| pixel.0[0] != 0)
}

/// Paint the mask, in the colour `object`.
pub(super) fn paint_mask(canvas: &mut Canvas, panel: Panel, mask: &GrayImage, object: Colour) {
    panel.paint(canvas, |u, v| is_set(mask, u, v).then_some(object));
}

/// Paint the grey image, darkened to `part`.
fn paint_grey(canvas: &mut Canvas, panel: Panel, grey: &GrayImage, part: f64) {
    panel.paint(canvas, |u, v| grey.get_pixel_checked(u, v).map(|pixel| mix([0; 3], [pixel.0[0]; 3], part)));
}

/// The image, and over it what was taken for the object.
pub(crate) fn mask(views: &[Seen<'_>]) -> Option<RgbImage> {
    each("Mask (white) and its boundary pixels (orange)", views, |canvas, panel, view| {
        let Rasters { mask, boundary, .. } = view.rasters;
        panel.paint(canvas, |u, v| {
            let colour = if is_set(boundary, u, v) { ACCENT } else { [225, 225, 222] };
            is_set(mask, u, v).then_some(colour)
        });
    })
}

/// How far each pixel is from the background.
pub(crate) fn distance(views: &[Seen<'_>]) -> Option<RgbImage> {
    let widest = views.iter().map(|view| view.parts.widest).max()?.max(1);
    let title = format!(
        "Distance to the background: dark 0 px, yellow {:.1} px",
        f64::from(widest) / f64::from(DISTANCE_PX)
    );
    each(&title, views, |canvas, panel, view| {
        panel.paint(canvas, |u, v| {
            let d = view.rasters.distance.get_pixel_checked(u, v)?.0[0];
            (d > 0).then(|| shade(f64::from(d) / f64::from(widest)))
        });
    })
}

/// The skeleton's branches, its nodes, and what pruning took away.
pub(crate) fn skeleton(views: &[Seen<'_>]) -> Option<RgbImage> {
    let title = "Skeleton: branches, ends (white), junctions (orange), pruned (red)";
    each(title, views, |canvas, panel, view| {
        let Rasters { mask, skeleton, pruned, .. } = view.rasters;
        panel.paint(canvas, |u, v| {
            let gone = is_set(skeleton, u, v) && !is_set(pruned, u, v);
            let colour = if gone { REMOVED } else { OBJECT };
            (gone || is_set(mask, u, v)).then_some(colour)
        });
        let width = panel.length(0.8).clamp(2.0, 5.0);
        for (k, (edge, pixels)) in view.parts.edges.iter().enumerate() {
            let places: Vec<Place> = pixels.iter().map(|p| panel.pixel(*p)).collect();
            canvas.lines(&places, edge.closed, width, APART[k % APART.len()]);
        }
        for node in &view.parts.nodes {
            let colour = match node.kind {
                NodeKind::End | NodeKind::Isolated => WHITE,
                NodeKind::Junction => ACCENT,
                NodeKind::Loop => continue,
            };
            canvas.dot(panel.at(node.position), width + 1.0, colour, RIM);
        }
    })
}

/// The skeleton's pixels as thinning left them.
pub(crate) fn thinned(views: &[Seen<'_>]) -> Option<RgbImage> {
    each("Thinned mask", views, |canvas, panel, view| {
        let Rasters { mask, skeleton, .. } = view.rasters;
        panel.paint(canvas, |u, v| {
            let colour = if is_set(skeleton, u, v) { ACCENT } else { OBJECT };
            is_set(mask, u, v).then_some(colour)
        });
    })
}

/// Centres of the medial balls, brighter where they are larger, and every eighth ball.
pub(crate) fn medial(views: &[Seen<'_>], balls: &[MedialBall]) -> Option<RgbImage> {
    let largest = balls.iter().map(|ball| ball.rho).max()?.max(1);
    each("Medial balls: small dark, large yellow", views, |canvas, panel, view| {
        paint_mask(canvas, panel, &view.rasters.mask, mix(GROUND, OBJECT, 0.6));
        for ball in balls.iter().step_by(8) {
            canvas.circle(panel.at(ball.centre), panel.length(px(ball.rho)), 1.0, OBJECT);
        }
        for ball in balls {
            let colour = shade(0.2 + 0.8 * f64::from(ball.rho) / f64::from(largest));
            canvas.disc(panel.at(ball.centre), 2.0, colour);
        }
    })
}

/// The contour over the image.
pub(crate) fn contour(views: &[Seen<'_>]) -> Option<RgbImage> {
    each("Contour, to a fraction of a pixel", views, |canvas, panel, view| {
        paint_grey(canvas, panel, &view.rasters.grey, 0.75);
        let points = &view.parts.contour;
        for l in &view.parts.loops {
            for i in l.range() {
                let (a, b) = (points[i], points[l.step(i, 1)]);
                let colour = if a.border { REMOVED } else { ACCENT };
                canvas.line(panel.at(a.at), panel.at(b.at), 2.0, colour);
            }
        }
    })
}

/// The hull and its own vertices.
pub(crate) fn hull(views: &[Seen<'_>]) -> Option<RgbImage> {
    each("Convex hull and its vertices", views, |canvas, panel, view| {
        paint_mask(canvas, panel, &view.rasters.mask, OBJECT);
        let places: Vec<Place> = view.parts.hull.iter().map(|p| panel.at(*p)).collect();
        canvas.lines(&places, true, 2.0, ACCENT);
        for place in places {
            canvas.dot(place, 3.0, WHITE, RIM);
        }
    })
}

/// The fitted curves with their control points, and some of the balls that they describe.
pub(crate) fn curves(views: &[Seen<'_>]) -> Option<RgbImage> {
    let views: Vec<_> = views.iter().copied().filter(|view| !view.parts.controls.is_empty()).collect();
    if views.is_empty() {
        return None;
    }
    each("NURBS: curves, control points (white), balls", &views, |canvas, panel, view| {
        paint_mask(canvas, panel, &view.rasters.mask, mix(GROUND, OBJECT, 0.6));
        let curves = view.parts.branches.iter().filter_map(|b| b.curve(&view.parts.controls));
        let mut lines = Vec::new();
        for (k, curve) in curves.enumerate() {
            let colour = APART[k % APART.len()];
            let spans = curve.end() >> 16;
            let balls: Vec<_> = (0..=spans * 8).map(|k| curve.evaluate(k << 13)).collect();
            for ball in balls.iter().step_by(8) {
                let radius = panel.length(px(ball.rho));
                canvas.circle(panel.at(ball.at()), radius, 1.0, mix(OBJECT, colour, 0.6));
            }
            lines.push((curve, balls, colour));
        }
        for (curve, balls, colour) in lines {
            let places: Vec<Place> = balls.iter().map(|ball| panel.at(ball.at())).collect();
            canvas.lines(&places, false, 3.0, colour);
            for control in curve.controls() {
                canvas.dot(panel.at(control.ball.at()), 2.5, WHITE, RIM);
            }
        }
    })
}

/// Say something at the upper left corner of a panel.
pub(super) fn remark(canvas: &mut Canvas, panel: Panel, text: &str) {
    let at = panel.inside(0.0, 0.0) + Place::new(8.0, 12.0);
    canvas.text(text, at, Anchor::Left, Letters::Small, WHITE);
}
