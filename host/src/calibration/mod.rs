//! The camera pair: what a pixel of either image means, in millimetres.
//!
//! In: a calibration as OpenCV, ROS or Kalibr writes it, recognised by its keys and not by its name.
//! Out: a [`StereoCamera`] whose numbers are finite, whose rotation turns, and whose right camera stands
//! to the right of the left one, between 1 and 1000 mm away; anything else is a sentence that says what
//! to do. Pixel centres have integer coordinates, x is right, y is down, z is forward.
//! Not promised: that a calibration is accurate, or that its cameras made the images; see
//! [`StereoCamera::check_size`] for the one thing about the images that can be checked.

mod error;
mod kalibr;
mod lens;
mod opencv;
mod ros;
mod yaml;

use std::io::{self, Read};
use std::path::{Path, PathBuf};

use nalgebra::{Matrix3, Point2, Rotation3, UnitQuaternion, Vector3};

pub use error::{CalibrationError, Place};
pub use shared::camera::Lens;
use yaml::{Document, Field};

/// A calibration has some kilobytes; a file beyond this is something else, and is not read to its end.
const MAX_BYTES: u64 = 1 << 20;
/// What a rotation may lack of being one: files hold as few as 4 decimals.
const ROTATION_TOLERANCE: f64 = 1e-3;
/// Below this a matrix is left as it is, so that reading what was written changes no bit.
const ROTATION_ROUNDING: f64 = 1e-12;
/// Distances between the eyes that can be millimetres, mm.
const BASELINES_MM: std::ops::RangeInclusive<f64> = 1.0..=1000.0;
/// Beyond these, rectified images would be mostly stretched border.
const MAX_TURN_DEGREES: f64 = 60.0;
const MAX_LEAN_DEGREES: f64 = 45.0;

/// One camera: a pinhole behind a lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Width of its images, px.
    pub width: u32,
    /// Height of its images, px.
    pub height: u32,
    /// Horizontal focal length, px.
    pub fx: f64,
    /// Vertical focal length, px.
    pub fy: f64,
    /// Column of the optical axis, px.
    pub cx: f64,
    /// Row of the optical axis, px.
    pub cy: f64,
    /// Columns that a row further down is moved by, times `fy`: 0 for every ordinary sensor.
    pub skew: f64,
    /// What the lens does.
    pub lens: Lens,
}

impl Camera {
    /// The pixel that sees the ray (x, y, 1).
    #[must_use]
    #[inline]
    pub fn pixel_of(&self, ray: Point2<f64>) -> Point2<f64> {
        let p = self.lens.bend(ray.coords);
        Point2::new(self.fx * p.x + self.skew * p.y + self.cx, self.fy * p.y + self.cy)
    }

    /// The ray (x, y, 1) that a pixel sees; nothing where the lens model folds over, or the ray stands at right angles
    /// to the axis or beyond.
    #[must_use]
    pub fn ray_of(&self, pixel: Point2<f64>) -> Option<Point2<f64>> {
        let y = (pixel.y - self.cy) / self.fy;
        let x = (pixel.x - self.cx - self.skew * y) / self.fx;
        lens::unbend(&self.lens, Point2::new(x, y))
    }

    /// Holds an image of `width` x `height` px against the calibration.
    ///
    /// # Errors
    ///
    /// [`CalibrationError::Size`], which names both sizes.
    pub fn check_size(&self, width: u32, height: u32) -> Result<(), CalibrationError> {
        let (calibrated, images) = ((self.width, self.height), (width, height));
        if calibrated == images { Ok(()) } else { Err(CalibrationError::Size { calibrated, images }) }
    }

    /// The camera of images whose pixels are the means of 2x2 of this one's; a last odd column or row is
    /// left out. Pixel 0 of these lies at 0.5, so c' = (c + 0.5) / 2 - 0.5.
    #[must_use]
    pub fn halved(&self) -> Self {
        let halfway = |c: f64| (c + 0.5) / 2.0 - 0.5;
        Self {
            width: self.width / 2,
            height: self.height / 2,
            fx: self.fx / 2.0,
            fy: self.fy / 2.0,
            cx: halfway(self.cx),
            cy: halfway(self.cy),
            skew: self.skew / 2.0,
            lens: self.lens,
        }
    }

    /// From a camera matrix, which stands at `source`, and a lens.
    fn new(
        (width, height): (u32, u32),
        matrix: &Matrix3<f64>,
        lens: Lens,
        source: Field<'_>,
    ) -> Result<Self, CalibrationError> {
        let (fx, fy) = (matrix.m11, matrix.m22);
        let below = [matrix.m21, matrix.m31, matrix.m32, matrix.m33 - 1.0];
        if !(fx > 0.0 && fy > 0.0) || below != [0.0; 4] {
            return Err(source.singular());
        }
        Ok(Self { width, height, fx, fy, cx: matrix.m13, cy: matrix.m23, skew: matrix.m12, lens })
    }
}

/// Two cameras and how they stand: `X_right = rotation X_left + translation`, in millimetres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StereoCamera {
    /// The left camera; the model comes out in its axes.
    pub left: Camera,
    /// The right camera.
    pub right: Camera,
    /// From left to right axes.
    pub rotation: Matrix3<f64>,
    /// The left camera's centre in right axes, mm; its x is negative.
    pub translation: Vector3<f64>,
}

impl StereoCamera {
    /// An ideal pair: both images `width` x `height` with one focal length `f`, all px, parallel axes
    /// through the image centres, and the right camera `baseline_mm` to the right.
    #[must_use]
    pub fn rectified(width: u32, height: u32, f: f64, baseline_mm: f64) -> Self {
        let centre = |side: u32| (f64::from(side) - 1.0) / 2.0;
        let camera = Camera {
            width,
            height,
            fx: f,
            fy: f,
            cx: centre(width),
            cy: centre(height),
            skew: 0.0,
            lens: Lens::NONE,
        };
        Self {
            left: camera,
            right: camera,
            rotation: Matrix3::identity(),
            translation: Vector3::new(-baseline_mm, 0.0, 0.0),
        }
    }

    /// The pair of images reduced to half, see [`Camera::halved`].
    #[must_use]
    pub fn halved(&self) -> Self {
        Self { left: self.left.halved(), right: self.right.halved(), ..*self }
    }

    /// Reads an OpenCV file or a Kalibr camchain; or a pair of files, written `left.yaml,right.yaml` or
    /// as the folder that holds them: `left` and `right` (ROS) or `intrinsics` and `extrinsics`
    /// (OpenCV's stereo sample), each `.yaml` or `.yml`.
    ///
    /// # Errors
    ///
    /// Whatever [`CalibrationError`] lists, with the file and the line where there is one.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, CalibrationError> {
        let (first, second) = files(path.as_ref())?;
        let document = |file: PathBuf| {
            let name = file.file_name().unwrap_or_default().to_string_lossy();
            Document::parse(&name, &load(&file)?)
        };
        Self::from_documents(&document(first)?, second.map(document).transpose()?.as_ref())
    }

    /// Reads the text of one file, as [`Self::read`] does.
    ///
    /// # Errors
    ///
    /// Whatever [`CalibrationError`] lists, with the line where there is one.
    pub fn parse(text: &str) -> Result<Self, CalibrationError> {
        Self::from_documents(&Document::parse("", text)?, None)
    }

    /// Reads the texts of a pair of files, as [`Self::read`] does.
    ///
    /// # Errors
    ///
    /// Whatever [`CalibrationError`] lists, with the line where there is one.
    pub fn parse_two(first: &str, second: &str) -> Result<Self, CalibrationError> {
        let [first, second] = [Document::parse("", first)?, Document::parse("", second)?];
        Self::from_documents(&first, Some(&second))
    }

    /// The pair as OpenCV's `M1 D1 M2 D2 R T`, of which [`Self::parse`] gives back the same bits.
    ///
    /// # Errors
    ///
    /// When those keys cannot say what the cameras are: fisheye lenses, or images of two sizes.
    pub fn opencv_yaml(&self) -> Result<String, CalibrationError> {
        opencv::format(self)
    }

    /// Writes [`Self::opencv_yaml`], under a temporary name first, so that the file is there whole or not at all.
    ///
    /// # Errors
    ///
    /// Those of the text, and when the file cannot be written.
    pub fn write_opencv_yaml(&self, path: impl AsRef<Path>) -> Result<(), CalibrationError> {
        opencv::write(self, path.as_ref())
    }

    /// Holds the images, both `width` x `height` px, against the calibration.
    ///
    /// # Errors
    ///
    /// [`CalibrationError::Size`], which names both sizes.
    pub fn check_size(&self, width: u32, height: u32) -> Result<(), CalibrationError> {
        self.left.check_size(width, height)?;
        self.right.check_size(width, height)
    }

    /// Whether the cameras stand side by side, in millimetres, and in the right order. What `read` and
    /// `parse` return has passed; a pair put together by hand may not.
    ///
    /// # Errors
    ///
    /// `NoBaseline`, `NotSideBySide`, `TopBottom`, `Swapped` or `Units` of [`CalibrationError`].
    pub fn check(&self) -> Result<(), CalibrationError> {
        let length = self.translation.norm();
        if length.is_nan() || length == 0.0 {
            return Err(CalibrationError::NoBaseline);
        }
        let (half_turn, t) = self.halfway();
        let turn_degrees = 2.0 * half_turn.angle().to_degrees();
        let lean_degrees = (t.z.abs() / length).min(1.0).asin().to_degrees();
        if turn_degrees > MAX_TURN_DEGREES || lean_degrees > MAX_LEAN_DEGREES {
            Err(CalibrationError::NotSideBySide { turn_degrees, lean_degrees })
        } else if t.y.abs() > t.x.abs() {
            Err(CalibrationError::TopBottom { down: -t.y, right: -t.x })
        } else if t.x > 0.0 {
            Err(CalibrationError::Swapped { mm: t.x })
        } else if !BASELINES_MM.contains(&length) {
            Err(CalibrationError::Units { mm: length })
        } else {
            Ok(())
        }
    }

    /// The rotation from left axes to those halfway between the eyes, and the translation in the latter.
    pub(crate) fn halfway(&self) -> (Rotation3<f64>, Vector3<f64>) {
        // By way of a quaternion: the angle of a small rotation is lost in the cosine on its diagonal.
        let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(self.rotation));
        let half_turn = turn.powf(0.5).to_rotation_matrix();
        (half_turn, half_turn.inverse() * self.translation)
    }

    fn from_documents(first: &Document, second: Option<&Document>) -> Result<Self, CalibrationError> {
        let (first, second) = (first.root(), second.map(Document::root));
        let pair = if first.find(&["cam0"]).is_some() {
            kalibr::read(first)
        } else if first.find(&["camera_matrix"]).is_some() {
            let right = second.ok_or_else(|| CalibrationError::OneEye { place: first.place() })?;
            ros::read(first, right)
        } else if opencv::recognises(first) {
            opencv::read(first, second)
        } else {
            Err(CalibrationError::UnknownFormat { place: first.place() })
        }?;
        pair.check()?;
        Ok(pair)
    }
}

/// The rotation next to a matrix from a file, which has been rounded.
fn rotation_near(matrix: &Matrix3<f64>, source: Field<'_>) -> Result<Matrix3<f64>, CalibrationError> {
    let defect = (matrix.transpose() * matrix - Matrix3::identity()).amax();
    if !(defect < ROTATION_TOLERANCE && matrix.determinant() > 0.0) {
        return Err(source.not_a_rotation());
    }
    let svd = matrix.svd(true, true);
    match (svd.u, svd.v_t) {
        _ if defect < ROTATION_ROUNDING => Ok(*matrix),
        (Some(u), Some(v_t)) => Ok(u * v_t),
        _ => Err(source.not_a_rotation()),
    }
}

/// The one or two files that `path` stands for, the left one or the intrinsics first.
fn files(path: &Path) -> Result<(PathBuf, Option<PathBuf>), CalibrationError> {
    if path.is_dir() {
        let named = |stem: &str| {
            let with = |extension| path.join(stem).with_extension(extension);
            ["yaml", "yml"].map(with).into_iter().find(|file| file.is_file())
        };
        [["left", "right"], ["intrinsics", "extrinsics"]]
            .iter()
            .find_map(|[a, b]| Some((named(a)?, Some(named(b)?))))
            .ok_or_else(|| CalibrationError::Unreadable {
                path: path.into(),
                source: io::Error::other(
                    "the folder holds neither left.yaml and right.yaml nor intrinsics.yml and extrinsics.yml",
                ),
            })
    } else {
        let pair = path.to_str().filter(|_| !path.exists()).and_then(|text| text.split_once(','));
        Ok(pair.map_or_else(|| (path.into(), None), |(a, b)| (a.trim().into(), Some(b.trim().into()))))
    }
}

fn load(path: &Path) -> Result<String, CalibrationError> {
    let mut text = String::new();
    std::fs::File::open(path)
        .and_then(|file| file.take(MAX_BYTES + 1).read_to_string(&mut text))
        .and_then(|bytes| match bytes as u64 {
            0..=MAX_BYTES => Ok(text),
            _ => Err(io::Error::new(io::ErrorKind::FileTooLarge, "over 1 MiB, so no calibration")),
        })
        .map_err(|source| CalibrationError::Unreadable { path: path.into(), source })
}

#[cfg(test)]
mod tests;
