//! OpenCV's `FileStorage` YAML: M1 D1 M2 D2 R T, as the stereo calibration sample names them.
//!
//! Lengths are millimetres. R1 R2 P1 P2 Q are ignored: rectification follows from the rest. D1 and D2
//! hold k1 k2 p1 p2 [k3 [k4 k5 k6 [s1 s2 s3 s4 [tx ty]]]], in a row or a column.

use std::io::Write;
use std::path::Path;

use nalgebra::Vector3;

use super::yaml::Field;
use super::{CalibrationError, Camera, Lens, StereoCamera, rotation_near};
use crate::unfinished;

/// Synonyms of the camera matrices and distortions, left and right.
const MATRICES: [[&str; 3]; 2] = [["M1", "K1", "cameraMatrix1"], ["M2", "K2", "cameraMatrix2"]];
const DISTORTIONS: [[&str; 2]; 2] = [["D1", "distCoeffs1"], ["D2", "distCoeffs2"]];

/// Whether a file looks like one of OpenCV's stereo files: any of the keys will do.
pub(super) fn recognises(root: Field<'_>) -> bool {
    MATRICES.iter().any(|keys| root.find(keys).is_some()) || root.find(&["T"]).is_some()
}

/// The pair from one file, or from the intrinsics in one and the extrinsics in another.
pub(super) fn read(first: Field<'_>, second: Option<Field<'_>>) -> Result<StereoCamera, CalibrationError> {
    let find = |keys: &[&str]| first.find(keys).or_else(|| second?.find(keys));
    let get = |keys: &[&str]| find(keys).map_or_else(|| first.get(keys), Ok);
    let size = match find(&["imageSize", "image_size"]) {
        Some(size) => pair_of_sides(size)?,
        None => (get(&["image_width", "width"])?.side()?, get(&["image_height", "height"])?.side()?),
    };
    let camera = |eye: usize| {
        let matrix = get(&MATRICES[eye])?;
        Camera::new(size, &matrix.matrix3()?, distortion(get(&DISTORTIONS[eye])?)?, matrix)
    };
    let (rotation, translation) = (get(&["R"])?, get(&["T"])?);
    let (data, shape) = translation.matrix()?;
    if !matches!(shape, (1, 3) | (3, 1)) {
        return Err(translation.should_be("a vector of 3 elements"));
    }
    Ok(StereoCamera {
        left: camera(0)?,
        right: camera(1)?,
        rotation: rotation_near(&rotation.matrix3()?, rotation)?,
        translation: Vector3::from_iterator(data),
    })
}

/// Writes the pair; see [`StereoCamera::write_opencv_yaml`].
pub(super) fn write(pair: &StereoCamera, path: &Path) -> Result<(), CalibrationError> {
    let text = format(pair)?;
    unfinished::beside(path)
        .and_then(|mut file| {
            file.write_all(text.as_bytes())?;
            file.as_file().sync_all()?;
            file.persist(path)?;
            Ok(())
        })
        .map_err(|source| CalibrationError::Unwritable { path: path.into(), source })
}

/// The pair as text; see [`StereoCamera::opencv_yaml`].
pub(super) fn format(pair: &StereoCamera) -> Result<String, CalibrationError> {
    let StereoCamera { left, right, rotation, translation } = pair;
    if (left.width, left.height) != (right.width, right.height) {
        return Err(CalibrationError::Inexpressible { reason: "the images of the eyes differ in size" });
    }
    let (Lens::Polynomial(d1), Lens::Polynomial(d2)) = (left.lens, right.lens) else {
        return Err(CalibrationError::Inexpressible { reason: "a lens is equidistant (fisheye)" });
    };
    let matrix = |key, rows, cols, data: &[f64]| {
        format!("{key}: !!opencv-matrix\n   rows: {rows}\n   cols: {cols}\n   dt: d\n   data: {data:?}\n")
    };
    let camera = |c: &Camera| [c.fx, c.skew, c.cx, 0.0, c.fy, c.cy, 0.0, 0.0, 1.0];
    Ok([
        format!("%YAML:1.0\n---\nimage_width: {}\nimage_height: {}\n", left.width, left.height),
        matrix("M1", 3, 3, &camera(left)),
        matrix("D1", 1, 12, &d1),
        matrix("M2", 3, 3, &camera(right)),
        matrix("D2", 1, 12, &d2),
        matrix("R", 3, 3, rotation.transpose().as_slice()),
        matrix("T", 3, 1, translation.as_slice()),
    ]
    .concat())
}

fn pair_of_sides(size: Field<'_>) -> Result<(u32, u32), CalibrationError> {
    match size.items()?.as_slice() {
        [width, height] => Ok((width.side()?, height.side()?)),
        _ => Err(size.should_be("[ width, height ]")),
    }
}

fn distortion(source: Field<'_>) -> Result<Lens, CalibrationError> {
    let (data, (rows, cols)) = source.matrix()?;
    if rows > 1 && cols > 1 {
        return Err(source.should_be("one row or one column of coefficients"));
    }
    polynomial(&data, source)
}

/// The lens of 0, 4, 5, 8 or 12 coefficients in OpenCV's order, or of 14 whose tilt is 0.
pub(super) fn polynomial(data: &[f64], source: Field<'_>) -> Result<Lens, CalibrationError> {
    let (bent, tilt) = data.split_at(data.len().min(12));
    if !matches!(data.len(), 0 | 4 | 5 | 8 | 12 | 14) {
        return Err(source.should_be(&format!("0, 4, 5, 8 or 12 coefficients, not {}", data.len())));
    }
    if tilt.iter().any(|&t| t != 0.0) {
        return Err(CalibrationError::Lens {
            place: source.place(),
            model: "tilted sensor".into(),
            known: "at most 12 coefficients",
        });
    }
    let mut k = [0.0; 12];
    k[..bent.len()].copy_from_slice(bent);
    Ok(Lens::Polynomial(k))
}
