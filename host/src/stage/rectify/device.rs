//! The pair as a device knows it, and the pictures that a device makes of it.
//!
//! In: a [`Rectification`]. Out: its [`PairModel`], and both images through the tables and integers of
//! `shared::stage::warp`, rows in parallel: the same bits as on a microcontroller.

use image::GrayImage;
use nalgebra::{Matrix3, Rotation3, Vector3};
use rayon::prelude::*;
use shared::bitmap::{Grey, Size};
use shared::camera::{EyeModel, Mapping, PairModel};
use shared::stage::warp::{Warp, knots};

use super::{Rectification, RectifiedCamera, RectifyError, Turned};
use crate::calibration::{Camera, StereoCamera};

impl Rectification {
    /// What a device has to know to make the same rectified pair. The images of [`Self::same_size`] are as
    /// large as those that it is made of; of the others, a device takes what its memory holds.
    #[must_use]
    pub fn model(&self) -> PairModel {
        let camera = &self.camera;
        // A side that does not fit is refused by the model's check, as any above 4096.
        let side = |side: u32| u16::try_from(side).unwrap_or(u16::MAX);
        PairModel {
            width: side(camera.width),
            height: side(camera.height),
            focal: camera.f,
            columns: [camera.cx, camera.cx_right],
            row: camera.cy,
            baseline: camera.baseline_mm,
            to_left: rows(camera.to_left.matrix()),
            eyes: self.eyes.as_ref().map(|eyes| eyes.each_ref().map(eye_model)),
        }
    }

    /// The images of the virtual pair, left and right, as a device makes them.
    ///
    /// # Errors
    ///
    /// As [`Self::images`]; [`RectifyError::Device`] or [`RectifyError::Capacity`] when the pair or its
    /// images are beyond what a device takes.
    pub fn device_images(&self, left: GrayImage, right: GrayImage) -> Result<[GrayImage; 2], RectifyError> {
        self.check_sizes([&left, &right])?;
        device_images(&self.model(), [left, right])
    }
}

/// The images of a device's rectified pair, left and right, as it makes them of the raw ones.
///
/// # Errors
///
/// [`RectifyError::Device`] or [`RectifyError::Capacity`] when the pair or its images are beyond what a device takes.
pub fn device_images(
    model: &PairModel,
    [left, right]: [GrayImage; 2],
) -> Result<[GrayImage; 2], RectifyError> {
    match model.mappings()? {
        None => Ok([left, right]),
        Some([to_left, to_right]) => Ok([warped(&to_left, &left)?, warped(&to_right, &right)?]),
    }
}

impl From<&PairModel> for RectifiedCamera {
    /// What the pixels of a device's rectified images mean.
    fn from(model: &PairModel) -> Self {
        Self {
            width: model.width.into(),
            height: model.height.into(),
            f: model.focal,
            cx: model.columns[0],
            cy: model.row,
            cx_right: model.columns[1],
            baseline_mm: model.baseline,
            to_left: Rotation3::from_matrix_unchecked(Matrix3::from(model.to_left).transpose()),
        }
    }
}

impl From<&PairModel> for StereoCamera {
    /// The raw pair of a device's model, whose images are as large as the rectified ones.
    fn from(model: &PairModel) -> Self {
        let (width, height) = (model.width.into(), model.height.into());
        let Some([left, right]) = &model.eyes else {
            let mut pair = Self::rectified(width, height, model.focal, model.baseline);
            for (camera, column) in [(&mut pair.left, model.columns[0]), (&mut pair.right, model.columns[1])]
            {
                (camera.cx, camera.cy) = (column, model.row);
            }
            return pair;
        };
        let camera = |eye: &EyeModel| Camera {
            width,
            height,
            fx: eye.focal[0],
            fy: eye.focal[1],
            cx: eye.centre[0],
            cy: eye.centre[1],
            skew: eye.skew,
            lens: eye.lens,
        };
        let turn = |eye: &EyeModel| Matrix3::from(eye.turn).transpose();
        Self {
            left: camera(left),
            right: camera(right),
            rotation: turn(right) * turn(left).transpose(),
            translation: turn(right) * Vector3::new(-model.baseline, 0.0, 0.0),
        }
    }
}

fn eye_model(eye: &Turned) -> EyeModel {
    let camera = &eye.camera;
    EyeModel {
        focal: [camera.fx, camera.fy],
        skew: camera.skew,
        centre: [camera.cx, camera.cy],
        lens: camera.lens,
        turn: rows(eye.turn.inverse().matrix()),
    }
}

fn rows(matrix: &Matrix3<f64>) -> [[f64; 3]; 3] {
    matrix.transpose().into()
}

fn warped(mapping: &Mapping, raw: &GrayImage) -> Result<GrayImage, RectifyError> {
    let Size { width, height } = mapping.size();
    let mut table = vec![[0; 2]; knots(mapping.size())];
    let warp = Warp::new(mapping, &mut table)?;
    let stride = raw.width() as usize;
    let grey = Grey::new(Size::new(stride, raw.height() as usize)?, stride, raw.as_raw())?;
    let mut image = GrayImage::new(width as u32, height as u32);
    image.par_chunks_exact_mut(width).enumerate().for_each(|(v, row)| warp.row(v, grey, row));
    Ok(image)
}
