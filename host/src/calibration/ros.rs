//! A pair of ROS `camera_info` files, as `camera_calibration` writes them.
//!
//! Lengths are metres. Each eye says how it is turned into the rectified axes (rectification_matrix
//! R_i) and what those see: the projection_matrix P has Tx = -fx B in its corner (sensor_msgs,
//! CameraInfo). So X_right = R_right^T (R_left X_left + t) with t = (Tx/fx, Ty/fy, 0), right minus left.

use nalgebra::{Matrix3, Vector3};

use super::yaml::Field;
use super::{CalibrationError, Camera, Lens, StereoCamera, opencv, rotation_near};

const MM_PER_METRE: f64 = 1000.0;

/// The pair from the roots of the two files.
pub(super) fn read(left: Field<'_>, right: Field<'_>) -> Result<StereoCamera, CalibrationError> {
    let (left_camera, left_turn, left_at) = eye(left)?;
    let (right_camera, right_turn, right_at) = eye(right)?;
    Ok(StereoCamera {
        left: left_camera,
        right: right_camera,
        rotation: right_turn.transpose() * left_turn,
        translation: right_turn.transpose() * (right_at - left_at) * MM_PER_METRE,
    })
}

/// A camera, its rectifying rotation, and its translation in rectified axes, metres.
fn eye(root: Field<'_>) -> Result<(Camera, Matrix3<f64>, Vector3<f64>), CalibrationError> {
    let size = (root.get(&["image_width"])?.side()?, root.get(&["image_height"])?.side()?);
    let matrix = root.get(&["camera_matrix"])?;
    let camera = Camera::new(size, &matrix.matrix3()?, distortion(root)?, matrix)?;
    let turn = root.get(&["rectification_matrix"])?;
    let projection = root.get(&["projection_matrix"])?;
    let (data, shape) = projection.matrix()?;
    let ((3, 4), &[fx, _, _, tx, _, fy, _, ty, ..]) = (shape, data.as_slice()) else {
        return Err(projection.should_be("a 3x4 matrix"));
    };
    if !(fx > 0.0 && fy > 0.0) {
        return Err(projection.singular());
    }
    Ok((camera, rotation_near(&turn.matrix3()?, turn)?, Vector3::new(tx / fx, ty / fy, 0.0)))
}

fn distortion(root: Field<'_>) -> Result<Lens, CalibrationError> {
    let model = root.get(&["distortion_model"])?;
    let coefficients = root.get(&["distortion_coefficients"])?;
    let (data, _) = coefficients.matrix()?;
    match model.text()? {
        "plumb_bob" | "rational_polynomial" | "thin_prism" => opencv::polynomial(&data, coefficients),
        "equidistant" | "fisheye" => data
            .try_into()
            .map(Lens::Equidistant)
            .map_err(|_| coefficients.should_be("4 coefficients for this model")),
        other => Err(CalibrationError::Lens {
            place: model.place(),
            model: other.into(),
            known: "plumb_bob, rational_polynomial or equidistant",
        }),
    }
}
