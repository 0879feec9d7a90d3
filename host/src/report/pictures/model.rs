//! The model from three sides beside the photograph, as in the paper's Figure 8.

use super::canvas::{Anchor, Canvas, Letters, Place};
use super::colour::{FAINT, INK, PAPER};
use super::panel::{FOOT, GAP, HEAD};
use crate::mesh::Mesh;
use crate::render::render_with;
use crate::report::record::Eye;
use crate::view::Pinhole;
use image::imageops::FilterType;
use image::{DynamicImage, GrayImage, RgbImage};
use nalgebra::{Matrix3, Point3};

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

/// The photograph and the model from front, side and top; below it the truth, if it is known.
pub(super) fn model(eye: &Eye, mesh: &Mesh, truth: Option<&Mesh>) -> Option<RgbImage> {
    let [low, high] = mesh.bounds()?;
    let cube = (nalgebra::center(&low, &high), (high - low).max() / 2.0);
    let rows = 1 + u32::from(truth.is_some());
    let (across, down) = (SIDE + GAP, SIDE + FOOT);
    let mut canvas = Canvas::new(4 * across + GAP, HEAD + rows * down, PAPER);
    let title = Place::new(f64::from(GAP), f64::from(HEAD) / 2.0);
    canvas.text("The model beside the left image", title, Anchor::Left, Letters::Large, INK);
    let mut put = |picture: &GrayImage, name: &str, column: u32, row: u32| {
        let corner = (GAP + column * across, HEAD + row * down);
        canvas.paste(&DynamicImage::ImageLuma8(picture.clone()).to_rgb8(), corner);
        let below = (corner.0 + SIDE / 2, corner.1 + SIDE + FOOT / 2);
        let below = Place::new(below.0.into(), below.1.into());
        canvas.text(name, below, Anchor::Centre, Letters::Small, FAINT);
    };
    put(&photograph(eye)?, "left image", 0, 0);
    for (row, (what, mesh)) in (0..).zip([("model", Some(mesh)), ("truth", truth)]) {
        for (column, (name, turn)) in (1..).zip(VIEWS) {
            if let Some(picture) = mesh.and_then(|mesh| shaded(mesh, cube, &turn)) {
                put(&picture, &format!("{what}, {name}"), column, row);
            }
        }
    }
    Some(canvas.finish())
}

/// The object in the left image, cut out as a square.
fn photograph(eye: &Eye) -> Option<GrayImage> {
    let (grey, bounds) = (&eye.rasters.as_ref()?.grey, eye.parts.bounds?);
    let size = [bounds.max.u - bounds.min.u, bounds.max.v - bounds.min.v].map(|s| u32::from(s) + 1);
    let side = (f64::from(size[0].max(size[1])) / FILL).ceil() as u32;
    let first = |low: u16, size: u32| i64::from(low) - i64::from((side - size) / 2);
    let (u0, v0) = (first(bounds.min.u, size[0]), first(bounds.min.v, size[1]));
    let square = GrayImage::from_fn(side, side, |x, y| {
        let inside =
            |from: i64, by: u32, limit: u32| (from + i64::from(by)).clamp(0, i64::from(limit) - 1) as u32;
        *grey.get_pixel(inside(u0, x, grey.width()), inside(v0, y, grey.height()))
    });
    Some(image::imageops::resize(&square, SIDE, SIDE, FilterType::CatmullRom))
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
