//! The model from three sides beside the photograph, as in the paper's Figure 8.

use super::canvas::{Anchor, Canvas, Letters};
use super::panel::{FOOT, GAP, HEAD};
use crate::mesh::Mesh;
use crate::render::render_with;
use crate::report::layers::Place;
use crate::report::layers::colour::{ACCENT, APART, FAINT, GROUND, INK, OBJECT, PAPER, RIM, WHITE, mix};
use crate::report::record::{Eye, Parts, Rasters};
use crate::stage::balls::px2;
use crate::view::Pinhole;
use image::imageops::FilterType;
use image::{DynamicImage, GrayImage, Rgb, RgbImage};
use nalgebra::{Matrix3, Point3};
use shared::bitmap::PixelBox;
use shared::stage::graph::NodeKind;

/// Side of a view, px.
pub(super) const SIDE: u32 = 360;
/// Rays a pixel along each axis.
const RAYS: u32 = 2;
/// Part of a view that the longest side of the model's box fills.
const FILL: f64 = 0.86;

/// What is seen, and how the model is turned for it.
const VIEWS: [(&str, Matrix3<f64>); 3] = [
    ("front", Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)),
    ("side", Matrix3::new(0.0, 0.0, 1.0, 0.0, 1.0, 0.0, -1.0, 0.0, 0.0)),
    ("top", Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0)),
];

/// The photograph and the model from front, side and top; below them the skeleton and the truth, if that is known.
pub(super) fn model(eye: &Eye, mesh: &Mesh, truth: Option<&Mesh>) -> Option<RgbImage> {
    let [low, high] = mesh.bounds()?;
    let cube = (nalgebra::center(&low, &high), (high - low).max() / 2.0);
    let rows = 1 + u32::from(truth.is_some());
    let (across, down) = (SIDE + GAP, SIDE + FOOT);
    let mut canvas = Canvas::new(4 * across + GAP, HEAD + rows * down, PAPER);
    let title = Place::new(f64::from(GAP), f64::from(HEAD) / 2.0);
    canvas.text("The model beside the left image", title, Anchor::Left, Letters::Large, INK);
    let mut put = |picture: &RgbImage, name: &str, column: u32, row: u32| {
        let corner = (GAP + column * across, HEAD + row * down);
        canvas.paste(picture, corner);
        let below = (corner.0 + SIDE / 2, corner.1 + SIDE + FOOT / 2);
        let below = Place::new(below.0.into(), below.1.into());
        canvas.text(name, below, Anchor::Centre, Letters::Small, FAINT);
    };
    let Rasters { grey, mask, .. } = eye.rasters.as_ref()?;
    let square = Square::around(&eye.parts.bounds?);
    put(&coloured(square.cut(grey)), "left image", 0, 0);
    if truth.is_some() {
        put(&square.skeleton(mask, &eye.parts), "skeleton", 0, 1);
    }
    for (row, (what, mesh)) in (0..).zip([("model", Some(mesh)), ("truth", truth)]) {
        for (column, (name, turn)) in (1..).zip(VIEWS) {
            if let Some(picture) = mesh.and_then(|mesh| shaded(mesh, cube, &turn)) {
                put(&coloured(picture), &format!("{what}, {name}"), column, row);
            }
        }
    }
    Some(canvas.finish())
}

fn coloured(picture: GrayImage) -> RgbImage {
    DynamicImage::ImageLuma8(picture).to_rgb8()
}

/// The square of an image that is shown, px.
struct Square {
    first: [i64; 2],
    side: u32,
}

impl Square {
    /// The square around an object's box.
    fn around(bounds: &PixelBox) -> Self {
        let size = [bounds.max.u - bounds.min.u, bounds.max.v - bounds.min.v].map(|s| u32::from(s) + 1);
        let side = (f64::from(size[0].max(size[1])) / FILL).ceil() as u32;
        let first = |low: u16, size: u32| i64::from(low) - i64::from((side - size) / 2);
        Self { first: [first(bounds.min.u, size[0]), first(bounds.min.v, size[1])], side }
    }

    /// What an image has there, as large as a view; beyond its border it goes on as there.
    fn cut(&self, image: &GrayImage) -> GrayImage {
        let square = GrayImage::from_fn(self.side, self.side, |x, y| {
            let inside =
                |from: i64, by: u32, limit: u32| (from + i64::from(by)).clamp(0, i64::from(limit) - 1) as u32;
            let [u, v] = self.first;
            *image.get_pixel(inside(u, x, image.width()), inside(v, y, image.height()))
        });
        image::imageops::resize(&square, SIDE, SIDE, FilterType::CatmullRom)
    }

    /// The object's mask, and in it the branches of its pruned skeleton with their nodes.
    fn skeleton(&self, mask: &GrayImage, parts: &Parts) -> RgbImage {
        let mask = self.cut(mask);
        let part = |x, y| f64::from(mask.get_pixel(x, y)[0]) / 255.0;
        let mut canvas = Canvas::new(SIDE, SIDE, GROUND);
        canvas.paste(&RgbImage::from_fn(SIDE, SIDE, |x, y| Rgb(mix(GROUND, OBJECT, part(x, y)))), (0, 0));
        let scale = f64::from(SIDE) / f64::from(self.side);
        let to = |x: f64, first: i64| (x - first as f64 + 0.5) * scale - 0.5;
        let at = |u: f64, v: f64| Place::new(to(u, self.first[0]), to(v, self.first[1]));
        for (k, (edge, pixels)) in parts.edges.iter().enumerate() {
            let places: Vec<Place> = pixels.iter().map(|p| at(p.u.into(), p.v.into())).collect();
            canvas.lines(&places, edge.closed, 2.0, APART[k % APART.len()]);
        }
        for node in parts.nodes.iter().filter(|node| node.kind != NodeKind::Loop) {
            let colour = if node.kind == NodeKind::Junction { ACCENT } else { WHITE };
            let place = px2(node.position);
            canvas.dot(at(place.x, place.y), 3.0, colour, RIM);
        }
        canvas.finish()
    }
}

/// A shaded view of a mesh, turned about the middle of the `cube` (centre and half a side, mm) around it.
pub(super) fn shaded(mesh: &Mesh, cube: (Point3<f64>, f64), turn: &Matrix3<f64>) -> Option<GrayImage> {
    let (centre, half) = cube;
    let turned = Mesh {
        vertices: mesh.vertices.iter().map(|p| centre + turn * (p - centre)).collect(),
        faces: mesh.faces.clone(),
    };
    let focal = FILL * f64::from(SIDE) / 2.0 * centre.z / half;
    let middle = (f64::from(SIDE) - 1.0) / 2.0;
    let view = Pinhole {
        size: [SIDE; 2],
        focal,
        principal: [middle - focal * centre.x / centre.z, middle - focal * centre.y / centre.z],
        centre: Point3::origin(),
    };
    render_with(&turned, &[view], RAYS).pop()
}
