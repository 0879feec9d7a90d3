//! Sheets: the layers of a stage in both views, side by side.

use super::canvas::{Anchor, Canvas, Letters};
use super::panel::{self, Panel, sheet, staggered};
use crate::report::layers::colour::{Colour, GROUND, OBJECT, RIM, WHITE, mix};
use crate::report::layers::frame::Frame;
use crate::report::layers::pair::Pair;
use crate::report::layers::{Layer, Place, Seen, eye};
use image::RgbImage;
use shared::stage::distance::DISTANCE_PX;
use shared::stage::medial::MedialBall;

/// The object's colour under marks that are close to one another.
fn dim() -> Colour {
    mix(GROUND, OBJECT, 0.6)
}

/// The frames of the views, under their names; none without an object.
fn frames<'a>(views: &[Seen<'a>]) -> Option<Vec<(Frame, &'a str)>> {
    let found = views.iter().all(|view| view.parts.bounds.is_some());
    let frames = || Frame::of(views, 0).into_iter().zip(views.iter().map(|view| view.name)).collect();
    found.then(frames)
}

/// A sheet with a panel a view, in which `layers` lie over one another.
fn each<'a>(
    title: &str,
    views: &[Seen<'a>],
    layers: impl Fn(usize, &Seen<'a>) -> Vec<Option<Layer<'a>>>,
) -> Option<RgbImage> {
    let (mut canvas, panels) = sheet(title, &frames(views)?);
    for (k, (panel, view)) in panels.into_iter().zip(views).enumerate() {
        panel.draw(&mut canvas, layers(k, view).into_iter().flatten());
    }
    Some(canvas.finish())
}

/// What was taken for the object.
pub(crate) fn mask(views: &[Seen<'_>]) -> Option<RgbImage> {
    each("Mask (white) and its boundary pixels (orange)", views, |_, view| vec![eye::mask(view)])
}

/// How far each pixel is from the background.
pub(crate) fn distance(views: &[Seen<'_>]) -> Option<RgbImage> {
    let widest = eye::widest(views);
    let pixels = f64::from(widest) / f64::from(DISTANCE_PX);
    let title = format!("Distance to the background: dark 0 px, yellow {pixels:.1} px");
    each(&title, views, |_, view| vec![eye::distance(view, widest)])
}

/// The skeleton's branches, its nodes, and what pruning took away.
pub(crate) fn skeleton(views: &[Seen<'_>]) -> Option<RgbImage> {
    each("Skeleton: branches, ends (white), junctions (orange), pruned (red)", views, |_, view| {
        vec![eye::silhouette(view, OBJECT), eye::pruned(view), Some(eye::skeleton(view.parts))]
    })
}

/// The skeleton's pixels as thinning left them.
pub(crate) fn thinned(views: &[Seen<'_>]) -> Option<RgbImage> {
    each("Thinned mask", views, |_, view| vec![eye::silhouette(view, OBJECT), eye::thinned(view)])
}

/// Medial balls.
pub(crate) fn medial(views: &[Seen<'_>], balls: &[MedialBall]) -> Option<RgbImage> {
    if balls.is_empty() {
        return None;
    }
    each("Medial balls: small dark, large yellow", views, |_, view| {
        vec![eye::silhouette(view, dim()), Some(eye::medial(balls))]
    })
}

/// The contour over the image.
pub(crate) fn contour(views: &[Seen<'_>]) -> Option<RgbImage> {
    each("Contour, to a fraction of a pixel", views, |_, view| {
        vec![eye::grey(view, 0.75), Some(eye::contour(view.parts))]
    })
}

/// The hull and its own vertices.
pub(crate) fn hull(views: &[Seen<'_>]) -> Option<RgbImage> {
    each("Convex hull and its vertices", views, |_, view| {
        vec![eye::silhouette(view, OBJECT), Some(eye::hull(view.parts))]
    })
}

/// The fitted curves.
pub(crate) fn curves(views: &[Seen<'_>]) -> Option<RgbImage> {
    let views: Vec<_> = views.iter().copied().filter(|view| !view.parts.controls.is_empty()).collect();
    if views.is_empty() {
        return None;
    }
    each("NURBS: curves, control points (white), balls", &views, |_, view| {
        vec![eye::silhouette(view, dim()), Some(eye::curves(view.parts))]
    })
}

/// Both hulls with the matched vertices.
pub(super) fn hulls(pair: &Pair<'_>) -> Option<RgbImage> {
    each("Hulls: a letter marks the same vertex in both views", &pair.views, |k, view| {
        vec![eye::silhouette(view, OBJECT), Some(pair.hull(k))]
    })
}

/// Matched points of both views, and lines between those of every Nth row.
pub(super) fn correspondence(pair: &Pair<'_>) -> Option<RgbImage> {
    let frames = frames(&pair.views)?;
    let matched = pair.matched();
    let drop = panel::picture(&frames.first()?.0)[1] / 5;
    let how = if matched.by_rows { "by rows" } else { "by the affine map" };
    let (mut canvas, panels) = staggered(&format!("Correspondence {how}"), &frames, drop);
    let &[left, right] = panels.as_slice() else { return None };
    for (k, panel) in panels.iter().enumerate() {
        let layers = [eye::silhouette(&pair.views[k], dim()), Some(matched.layer(k))];
        panel.draw(&mut canvas, layers.into_iter().flatten());
    }
    for ([a, b], colour) in matched.links() {
        canvas.line(left.at(a), right.at(b), 1.2, colour);
    }
    for ([a, b], colour) in matched.links() {
        canvas.dot(left.at(a), 3.5, colour, RIM);
        canvas.dot(right.at(b), 3.5, colour, RIM);
    }
    remark(&mut canvas, left, &matched.caption());
    Some(canvas.finish())
}

/// Say something at the upper left corner of a panel.
fn remark(canvas: &mut Canvas, panel: Panel, text: &str) {
    let at = panel.inside(0.0, 0.0) + Place::new(8.0, 12.0);
    canvas.text(text, at, Anchor::Left, Letters::Small, WHITE);
}
