//! A mesh in front of cameras, and the files of it: what `render` makes and `demo` starts from.

use std::io::Write;
use std::path::Path;

use image::GrayImage;

use super::looks::Looks;
use super::{Failure, of_system, shown};
use crate::calibration::StereoCamera;
use crate::export::{ply, write_whole};
use crate::mesh::Mesh;
use crate::render::render;
use crate::view::Calibrated;

/// What the cameras see, and what is there.
pub(super) struct Scene {
    /// Left and right.
    pub(super) images: Vec<GrayImage>,
    pub(super) calibration: StereoCamera,
    /// The mesh, mm, axes of the left camera.
    pub(super) truth: Mesh,
}

impl Scene {
    /// Renders a mesh, dull and without texture.
    pub(super) fn new(truth: Mesh, calibration: StereoCamera) -> Self {
        Self { images: render(&truth, &Calibrated::pair(&calibration)), calibration, truth }
    }

    /// Renders a mesh with looks of its own.
    pub(super) fn with_looks(truth: Mesh, calibration: StereoCamera, looks: &Looks) -> Self {
        Self { images: looks.images(&truth, &calibration), calibration, truth }
    }
}

/// Writes left.png, right.png, calib.yaml and truth.ply into a folder, which is made if need be.
pub(super) fn write(folder: &Path, scene: &Scene) -> Result<(), Failure> {
    let made = |error| format!("cannot make the folder {}: {}", shown(folder), of_system(&error));
    std::fs::create_dir_all(folder).map_err(made)?;
    for (image, name) in scene.images.iter().zip(["left.png", "right.png"]) {
        let mut bytes = std::io::Cursor::new(Vec::new());
        image.write_to(&mut bytes, image::ImageFormat::Png)?;
        write_whole(&folder.join(name), |file| file.write_all(bytes.get_ref()))?;
    }
    scene.calibration.write_opencv_yaml(folder.join("calib.yaml"))?;
    ply::write_mesh(&folder.join("truth.ply"), &scene.truth, &["unit mm", "axes of the left camera"])?;
    Ok(())
}
