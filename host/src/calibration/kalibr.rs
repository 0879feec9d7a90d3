//! A Kalibr camchain: cam0 is the left eye, cam1 the right one, T_cn_cnm1 turns cam0 axes into cam1's.
//!
//! Lengths are metres. Source: Kalibr wiki, "Yaml formats".

use nalgebra::{Matrix3, Vector3};

use super::yaml::Field;
use super::{CalibrationError, Camera, Lens, StereoCamera, opencv, rotation_near};

const MM_PER_METRE: f64 = 1000.0;

/// The pair from the root of the file.
pub(super) fn read(root: Field<'_>) -> Result<StereoCamera, CalibrationError> {
    let right = root.get(&["cam1"])?;
    let pose = right.get(&["T_cn_cnm1"])?;
    let rows: Vec<[f64; 4]> = pose.items()?.iter().map(Field::array).collect::<Result<_, _>>()?;
    let &[[r11, r12, r13, x], [r21, r22, r23, y], [r31, r32, r33, z], [0.0, 0.0, 0.0, 1.0]] = rows.as_slice()
    else {
        return Err(pose.should_be("4 rows of 4 numbers that end in [0, 0, 0, 1]"));
    };
    let rotation = Matrix3::new(r11, r12, r13, r21, r22, r23, r31, r32, r33);
    Ok(StereoCamera {
        left: camera(root.get(&["cam0"])?)?,
        right: camera(right)?,
        rotation: rotation_near(&rotation, pose)?,
        translation: Vector3::new(x, y, z) * MM_PER_METRE,
    })
}

fn camera(root: Field<'_>) -> Result<Camera, CalibrationError> {
    let model = root.get(&["camera_model"])?;
    if model.text()? != "pinhole" {
        return Err(CalibrationError::Lens {
            place: model.place(),
            model: model.text()?.into(),
            known: "camera_model pinhole",
        });
    }
    let size = root.get(&["resolution"])?;
    let [width, height] = size.items()?[..] else { return Err(size.should_be("[width, height]")) };
    let intrinsics = root.get(&["intrinsics"])?;
    let [fx, fy, cx, cy] = intrinsics.array()?;
    let matrix = Matrix3::new(fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0);
    Camera::new((width.side()?, height.side()?), &matrix, distortion(root)?, intrinsics)
}

fn distortion(root: Field<'_>) -> Result<Lens, CalibrationError> {
    let model = root.get(&["distortion_model"])?;
    let name = model.text()?;
    if name == "none" {
        return Ok(Lens::NONE);
    }
    let coefficients = root.get(&["distortion_coeffs"])?;
    match name {
        "radtan" => opencv::polynomial(&coefficients.array::<4>()?, coefficients),
        "equidistant" => Ok(Lens::Equidistant(coefficients.array()?)),
        other => Err(CalibrationError::Lens {
            place: model.place(),
            model: other.into(),
            known: "radtan or equidistant",
        }),
    }
}
