//! Photographs and shaded meshes side by side, each over its name.

use super::canvas::{Anchor, Canvas, Letters};
use super::model::{SIDE, shaded};
use super::panel::{FOOT, GAP, HEAD};
use crate::mesh::Mesh;
use crate::report::layers::Place;
use crate::report::layers::colour::{FAINT, INK, PAPER};
use image::imageops::FilterType;
use image::{DynamicImage, GrayImage, RgbImage};
use nalgebra::{Matrix3, Rotation3, Vector3};

/// From where a mesh is looked at.
#[derive(Clone, Copy)]
pub(crate) enum From {
    /// As the left camera does.
    Front,
    /// From above and 40 degrees to the side.
    Above,
}

impl From {
    fn turn(self) -> Matrix3<f64> {
        let about = |axis, degrees: f64| Rotation3::from_axis_angle(&axis, degrees.to_radians());
        match self {
            Self::Front => Matrix3::identity(),
            Self::Above => (about(Vector3::x_axis(), 22.0) * about(Vector3::y_axis(), 40.0)).into_inner(),
        }
    }
}

/// A view of a mesh, as large as it would be if it filled the box around `frame`.
pub(crate) fn look(mesh: &Mesh, frame: &Mesh, from: From) -> Option<GrayImage> {
    let [low, high] = frame.bounds()?;
    shaded(mesh, (nalgebra::center(&low, &high), (high - low).max() / 2.0), &from.turn())
}

/// A square of an image, five eighths of its height, around a pixel.
pub(crate) fn square(image: &GrayImage, centre: [f64; 2]) -> GrayImage {
    let size = [image.width(), image.height()];
    let side = (image.height() * 5 / 8).min(image.width());
    let [x, y] = [0, 1].map(|k| (centre[k] as u32).saturating_sub(side / 2).min(size[k] - side));
    let cut = image::imageops::crop_imm(image, x, y, side, side).to_image();
    image::imageops::resize(&cut, SIDE, SIDE, FilterType::CatmullRom)
}

/// Rows of pictures with their names under a title.
pub(crate) fn gallery(title: &str, rows: &[Vec<(String, GrayImage)>]) -> RgbImage {
    let (across, down) = (SIDE + GAP, SIDE + FOOT);
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0) as u32;
    let mut canvas = Canvas::new(columns * across + GAP, HEAD + rows.len() as u32 * down, PAPER);
    let place = Place::new(f64::from(GAP), f64::from(HEAD) / 2.0);
    canvas.text(title, place, Anchor::Left, Letters::Large, INK);
    for (row, pictures) in (0..).zip(rows) {
        for (column, (name, picture)) in (0..).zip(pictures) {
            let corner = (GAP + column * across, HEAD + row * down);
            canvas.paste(&DynamicImage::ImageLuma8(picture.clone()).to_rgb8(), corner);
            let [x, y] = [corner.0 + SIDE / 2, corner.1 + SIDE + FOOT / 2].map(f64::from);
            canvas.text(name, Place::new(x, y), Anchor::Centre, Letters::Small, FAINT);
        }
    }
    canvas.finish()
}
