//! The model from three sides beside the photograph, as in the paper's Figure 8.

use super::canvas::{Anchor, Canvas, Letters};
use super::panel::{FOOT, GAP, HEAD, alone};
use crate::mesh::Mesh;
use crate::render::render_with;
use crate::report::layers::colour::{FAINT, INK, OBJECT, PAPER};
use crate::report::layers::frame::Frame;
use crate::report::layers::{self, Place, Seen};
use crate::report::record::Eye;
use crate::view::Pinhole;
use image::imageops::FilterType;
use image::{DynamicImage, GrayImage, RgbImage};
use nalgebra::{Matrix3, Point3};
use shared::bitmap::PixelBox;

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
    let grey = &eye.rasters.as_ref()?.grey;
    let square = Square::around(&eye.parts.bounds?);
    put(&coloured(square.cut(grey)), "left image", 0, 0);
    if truth.is_some() {
        put(&square.skeleton(eye), "skeleton", 0, 1);
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
    first: [i32; 2],
    side: u32,
}

impl Square {
    /// The square around an object's box.
    fn around(bounds: &PixelBox) -> Self {
        let size = [bounds.max.u - bounds.min.u, bounds.max.v - bounds.min.v].map(|s| u32::from(s) + 1);
        let side = (f64::from(size[0].max(size[1])) / FILL).ceil() as u32;
        let first = |low: u16, size: u32| i32::from(low) - ((side - size) / 2) as i32;
        Self { first: [first(bounds.min.u, size[0]), first(bounds.min.v, size[1])], side }
    }

    /// What an image has there, as large as a view; beyond its border it goes on as there.
    fn cut(&self, image: &GrayImage) -> GrayImage {
        let square = GrayImage::from_fn(self.side, self.side, |x, y| {
            let inside =
                |from: i32, by: u32, limit: u32| (from + by as i32).clamp(0, limit as i32 - 1) as u32;
            let [u, v] = self.first;
            *image.get_pixel(inside(u, x, image.width()), inside(v, y, image.height()))
        });
        image::imageops::resize(&square, SIDE, SIDE, FilterType::CatmullRom)
    }

    /// The object's mask, and in it the branches of its pruned skeleton with their nodes, as large as a view.
    fn skeleton(&self, eye: &Eye) -> RgbImage {
        let seen = Seen { name: "left", parts: &eye.parts, rasters: eye.rasters.as_ref() };
        let (mut canvas, panel) = alone(Frame { first: self.first, size: [self.side; 2] });
        let mask = layers::eye::silhouette(&seen, OBJECT);
        panel.draw(&mut canvas, mask.into_iter().chain([layers::eye::skeleton(&eye.parts)]));
        image::imageops::resize(&canvas.finish(), SIDE, SIDE, FilterType::CatmullRom)
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
