//! A stereo pair to one whose rows are epipolar lines (method step 11).
//!
//! In: the calibration, and the box of the object in each raw image, px. Out: a [`Rectification`], that
//! is the virtual pair of pinholes ([`RectifiedCamera`]) and the resampling of both images into it.
//! A pair that is rectified already passes untouched, to the bit.
//!
//! Rotations after Bouguet (OpenCV's `stereoRectify`): each eye makes half of the turn between them,
//! then both turn the least that lays the baseline along the rows. So neither image is stretched more
//! than the other, and `X_left = to_left X_rectified`.
//!
//! Images are resampled, not points: then everything downstream is the same for every pair, on the
//! device too, and a threshold between pixels still means a place on an edge. Bilinear weights blur an
//! edge alike on both sides and so leave its place; rounding to 8 bits moves one of 100 grey values a
//! pixel by at most 0.005 px. The focal length is the largest of the four, so no direction is
//! decimated, unless the canvas would exceed [`MAX_SIDE`].
//!
//! The canvas is centred on the object, which fills at most half of it in each direction: a verged pair
//! of long lenses can see its object hundreds of pixels from the rectified axes. Both eyes share one
//! principal point if that fits; if not, the right one's column differs, see
//! [`RectifiedCamera::disparity_offset`]. Pixels from outside the source repeat its border: a plain
//! background stays plain, and an object that touches the border of its image reaches that of the canvas.
//!
//! Cost: a rotation, a lens model and four reads for each pixel of each eye, rows in parallel.
//!
//! A device cannot choose its canvas by the object, nor evaluate a lens for each pixel. Its canvas is that
//! of [`Rectification::same_size`], its description [`Rectification::model`], and its pictures, to the bit,
//! are those of [`Rectification::device_images`]; `shared::stage::warp` says how it makes them.

mod canvas;
mod device;
mod resample;

use std::fmt;

use image::GrayImage;
use nalgebra::{Matrix3, Point2, Point3, Rotation3, Vector3};
use shared::camera::CameraError;
use shared::limits::CapacityError;

use crate::calibration::{CalibrationError, Camera, Lens, StereoCamera};
use canvas::Canvas;
pub use device::device_images;

/// Longest side of an image that is made here, px.
pub const MAX_SIDE: u32 = 2047;
/// What a rectified calibration may lack of being one, in radians or relative: 0.002 px in the rows
/// at a focal length of 2000 px.
const RECTIFIED_TOLERANCE: f64 = 1e-6;

/// Which camera of the pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Eye {
    /// The left camera.
    Left,
    /// The right camera.
    Right,
}

impl fmt::Display for Eye {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(match self {
            Self::Left => "left",
            Self::Right => "right",
        })
    }
}

/// A box in an image, edges included, px. Pixel centres are integers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelBox {
    /// Upper left corner.
    pub min: Point2<f64>,
    /// Lower right corner.
    pub max: Point2<f64>,
}

/// Why a pair could not be rectified.
#[derive(Debug, thiserror::Error)]
pub enum RectifyError {
    /// The calibration is not that of a pair side by side, or not of these images.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    /// The lens model has no inverse there.
    #[error(
        "the lens model of the {eye} camera folds over at pixel ({u:.0}, {v:.0}); calibrate with views that \
         reach the corners, or keep the object nearer to the centre"
    )]
    Lens {
        /// The camera.
        eye: Eye,
        /// Column of the pixel.
        u: f64,
        /// Its row.
        v: f64,
    },
    /// A ray of the object stands at right angles to the rectified axis or beyond.
    #[error(
        "the {eye} camera sees the object more than 80 degrees from the rectified axis; turn the cameras \
         less"
    )]
    Aside {
        /// The camera.
        eye: Eye,
    },
    /// No row of the canvas is seen by both eyes.
    #[error("the cameras look past one another, one above the other; turn them until both see the object")]
    Apart,
    /// The model of the pair is beyond what a device takes.
    #[error(transparent)]
    Device(#[from] CameraError),
    /// The pictures are beyond what a device takes.
    #[error(transparent)]
    Capacity(#[from] CapacityError),
}

/// The virtual pair of pinholes: parallel axes, one focal length, one row for every point.
///
/// A point of the left image is (u, v), its disparity d = u_left - u_right, all px. Rectified axes are x
/// right along the baseline, y down, z forward, mm, from the left camera's centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RectifiedCamera {
    /// Width of both images, px.
    pub width: u32,
    /// Height of both images, px.
    pub height: u32,
    /// Focal length of both eyes in both directions, px.
    pub f: f64,
    /// Column of the left axis, px; it may lie outside the image.
    pub cx: f64,
    /// Row of both axes, px; it may lie outside the image.
    pub cy: f64,
    /// Column of the right axis, px.
    pub cx_right: f64,
    /// Distance between the eyes, mm.
    pub baseline_mm: f64,
    /// From rectified axes to those of the left camera.
    pub to_left: Rotation3<f64>,
}

impl RectifiedCamera {
    /// `cx_right - cx`, px: what to add to a disparity before Z = f B / d holds. 0 for most pairs.
    #[must_use]
    pub fn disparity_offset(&self) -> f64 {
        self.cx_right - self.cx
    }

    /// Depth of a disparity, mm; nothing unless the point is in front of the cameras.
    #[must_use]
    pub fn depth(&self, d: f64) -> Option<f64> {
        let shift = d + self.disparity_offset();
        (shift > 0.0).then(|| self.f * self.baseline_mm / shift)
    }

    /// Disparity of a depth in mm, px.
    #[must_use]
    pub fn disparity(&self, z: f64) -> f64 {
        self.f * self.baseline_mm / z - self.disparity_offset()
    }

    /// The ray that pixel (u, v) of the left image sees, in rectified axes, with z = 1.
    #[must_use]
    pub fn ray(&self, u: f64, v: f64) -> Vector3<f64> {
        Vector3::new((u - self.cx) / self.f, (v - self.cy) / self.f, 1.0)
    }

    /// The point at pixel (u, v) of the left image and disparity d, in rectified axes, mm; nothing unless
    /// it is in front of the cameras.
    #[must_use]
    pub fn point(&self, u: f64, v: f64, d: f64) -> Option<Point3<f64>> {
        self.depth(d).map(|z| Point3::from(self.ray(u, v) * z))
    }

    /// The pixels of both images that see a point of the rectified axes, mm; nothing unless it is in
    /// front of the cameras.
    #[must_use]
    pub fn project(&self, point: &Point3<f64>) -> Option<[Point2<f64>; 2]> {
        let scale = (point.z > 0.0).then(|| self.f / point.z)?;
        let v = self.cy + point.y * scale;
        let left = Point2::new(self.cx + point.x * scale, v);
        Some([left, Point2::new(self.cx_right + (point.x - self.baseline_mm) * scale, v)])
    }

    /// A point of the rectified axes in those of the left camera, mm.
    #[must_use]
    pub fn to_left_camera(&self, point: Point3<f64>) -> Point3<f64> {
        self.to_left * point
    }
}

/// One eye's way from its raw image to the rectified one.
#[derive(Clone, Copy, Debug)]
struct Turned {
    eye: Eye,
    camera: Camera,
    /// From raw to rectified axes.
    turn: Rotation3<f64>,
}

impl Turned {
    /// The rectified ray (x, y, 1) that a raw pixel sees.
    fn ray(&self, pixel: Point2<f64>) -> Result<Point2<f64>, RectifyError> {
        let (eye, u, v) = (self.eye, pixel.x, pixel.y);
        let raw = self.camera.ray_of(pixel).ok_or(RectifyError::Lens { eye, u, v })?;
        let ray = self.turn * Vector3::new(raw.x, raw.y, 1.0);
        if ray.z > ray.norm() * 80.0_f64.to_radians().cos() {
            Ok(Point2::new(ray.x / ray.z, ray.y / ray.z))
        } else {
            Err(RectifyError::Aside { eye })
        }
    }
}

/// A rectified pair, and how its images come about.
#[derive(Clone, Debug)]
pub struct Rectification {
    camera: RectifiedCamera,
    source: StereoCamera,
    eyes: Option<[Turned; 2]>,
}

impl Rectification {
    /// A canvas around the object, whose box in the left and right raw image `object` is. The boxes
    /// matter only for a pair that is not rectified yet.
    ///
    /// # Errors
    ///
    /// When the cameras do not stand side by side, or a lens model cannot be inverted at the object.
    pub fn around(pair: &StereoCamera, object: [PixelBox; 2]) -> Result<Self, RectifyError> {
        Self::new(pair, |eyes| canvas::fit(eyes, object, 0.5))
    }

    /// A canvas that holds all of both raw images.
    ///
    /// # Errors
    ///
    /// As [`Self::around`]; strong lenses are often not invertible in the corners.
    pub fn whole(pair: &StereoCamera) -> Result<Self, RectifyError> {
        Self::new(pair, |eyes| canvas::fit(eyes, [whole(&pair.left), whole(&pair.right)], 0.0))
    }

    /// A canvas of the size of the left raw image: what a device has, which does not know the object when
    /// it is told the calibration. It holds the middles of the sides of both raw images, across by columns
    /// of their own, and down as far as both see; a bent lens sees more in its corners, which is lost.
    ///
    /// # Errors
    ///
    /// As [`Self::around`], and [`RectifyError::Apart`].
    pub fn same_size(pair: &StereoCamera) -> Result<Self, RectifyError> {
        Self::new(pair, canvas::same_size)
    }

    /// The rectification of a pair that needs none, if it is one.
    #[must_use]
    pub fn untouched(pair: &StereoCamera) -> Option<Self> {
        let camera = pair.check().ok().and_then(|()| already_rectified(pair))?;
        Some(Self { camera, source: *pair, eyes: None })
    }

    fn new(
        pair: &StereoCamera,
        lay: impl FnOnce(&[Turned; 2]) -> Result<Canvas, RectifyError>,
    ) -> Result<Self, RectifyError> {
        pair.check()?;
        if let Some(untouched) = Self::untouched(pair) {
            return Ok(untouched);
        }
        let [left_turn, right_turn] = bouguet(pair);
        let eyes = [
            Turned { eye: Eye::Left, camera: pair.left, turn: left_turn },
            Turned { eye: Eye::Right, camera: pair.right, turn: right_turn },
        ];
        let canvas = lay(&eyes)?;
        let camera = RectifiedCamera {
            width: canvas.width,
            height: canvas.height,
            f: canvas.f,
            cx: canvas.cx[0],
            cy: canvas.cy,
            cx_right: canvas.cx[1],
            baseline_mm: pair.translation.norm(),
            to_left: left_turn.inverse(),
        };
        Ok(Self { camera, source: *pair, eyes: Some(eyes) })
    }

    /// What the pixels of the rectified images mean.
    #[must_use]
    pub fn camera(&self) -> RectifiedCamera {
        self.camera
    }

    /// Whether the images pass untouched.
    #[must_use]
    pub fn is_identity(&self) -> bool {
        self.eyes.is_none()
    }

    /// The rectified place of a pixel of a raw image.
    ///
    /// # Errors
    ///
    /// When the lens model cannot be inverted there, or the pixel looks far aside.
    pub fn rectified_pixel(&self, eye: Eye, raw: Point2<f64>) -> Result<Point2<f64>, RectifyError> {
        let Some(turned) = self.turned(eye) else { return Ok(raw) };
        let ray = turned.ray(raw)?;
        let RectifiedCamera { f, cy, .. } = self.camera;
        Ok(Point2::new(f * ray.x + self.column_of_axis(eye), f * ray.y + cy))
    }

    /// The images of the virtual pair, left and right.
    ///
    /// # Errors
    ///
    /// [`CalibrationError::Size`] when the images are not those that the calibration is for.
    pub fn images(&self, left: GrayImage, right: GrayImage) -> Result<[GrayImage; 2], RectifyError> {
        let mut made = Default::default();
        self.images_into([&left, &right], &mut made)?;
        Ok(if self.is_identity() { [left, right] } else { made })
    }

    /// The images of the virtual pair, left and right: the raw ones if they pass untouched, or else those that
    /// are made in the memory of `made`.
    ///
    /// # Errors
    ///
    /// As [`Self::images`].
    pub fn images_into<'a>(
        &self,
        raw: [&'a GrayImage; 2],
        made: &'a mut [GrayImage; 2],
    ) -> Result<[&'a GrayImage; 2], RectifyError> {
        self.check_sizes(raw)?;
        let Some(eyes) = &self.eyes else { return Ok(raw) };
        for ((eye, raw), made) in eyes.iter().zip(raw).zip(made.iter_mut()) {
            resample::resample(eye, &self.camera, self.column_of_axis(eye.eye), raw, made);
        }
        Ok(made.each_ref())
    }

    fn check_sizes(&self, [left, right]: [&GrayImage; 2]) -> Result<(), CalibrationError> {
        self.source.left.check_size(left.width(), left.height())?;
        self.source.right.check_size(right.width(), right.height())
    }

    fn turned(&self, eye: Eye) -> Option<&Turned> {
        self.eyes.as_ref()?.iter().find(|turned| turned.eye == eye)
    }

    fn column_of_axis(&self, eye: Eye) -> f64 {
        match eye {
            Eye::Left => self.camera.cx,
            Eye::Right => self.camera.cx_right,
        }
    }
}

/// All of a camera's image.
fn whole(camera: &Camera) -> PixelBox {
    PixelBox {
        min: Point2::origin(),
        max: Point2::new(f64::from(camera.width) - 1.0, f64::from(camera.height) - 1.0),
    }
}

/// The camera of a pair that needs no resampling: parallel axes, rows aligned, square pixels, no lens.
fn already_rectified(pair: &StereoCamera) -> Option<RectifiedCamera> {
    let StereoCamera { left, right, rotation, translation } = pair;
    let near = |a: f64, b: f64| (a - b).abs() <= RECTIFIED_TOLERANCE * left.fx;
    let aligned = (rotation - Matrix3::identity()).amax() <= RECTIFIED_TOLERANCE
        && translation.yz().amax() <= RECTIFIED_TOLERANCE * translation.norm();
    let same = near(left.fx, left.fy)
        && near(left.fx, right.fx)
        && near(left.fx, right.fy)
        && near(left.cy, right.cy)
        && (left.width, left.height) == (right.width, right.height);
    let pinholes = [left, right].iter().all(|eye| near(eye.skew, 0.0) && eye.lens == Lens::NONE);
    (aligned && same && pinholes).then_some(RectifiedCamera {
        width: left.width,
        height: left.height,
        f: left.fx,
        cx: left.cx,
        cy: left.cy,
        cx_right: right.cx,
        baseline_mm: translation.norm(),
        to_left: Rotation3::identity(),
    })
}

/// From the axes of each eye to the rectified ones.
fn bouguet(pair: &StereoCamera) -> [Rotation3<f64>; 2] {
    let (half_turn, translation) = pair.halfway();
    // `check` has seen that the baseline points left, so the least turn is defined.
    let level = Rotation3::rotation_between(&translation, &-Vector3::x()).unwrap_or_default();
    [level * half_turn, level * half_turn.inverse()]
}

#[cfg(test)]
mod tests;
