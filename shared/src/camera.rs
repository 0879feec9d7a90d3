//! The camera pair as a device knows it: how each rectified pixel is seen by a raw one.
//!
//! The only floating point of the core. It is evaluated when a calibration arrives, never per pair, and in
//! IEEE double precision without fused operations, so every machine makes the same tables of it. Rectified
//! axes are x right along the baseline, y down, z forward, mm, from the left camera's centre.
//!
//! * **In**: a [`PairModel`], as it was uploaded; [`PairModel::mappings`] refuses what is none.
//! * **Out**: a [`Mapping`] for each eye: rectified pixel -> ray -> turned -> bent by the lens -> raw pixel.
//! * **Beyond the lens**: a polynomial that fits the picture may turn back outside it and show the picture
//!   again. Rays farther from the optical axis than where it does are pulled in to there.
//! * **Source** of the lens models: OpenCV 4, "Camera calibration and 3D reconstruction"; Kannala and
//!   Brandt, "A generic camera model" (2006).

use core::fmt;

use nalgebra::{Matrix3, Vector2, Vector3};

use crate::bitmap::Size;
use crate::fixed::PX;
use crate::limits::MAX_SIDE;

/// How a lens moves the image of a ray, in normalised points: where the ray (x, y, 1) meets the plane at distance
/// 1, no unit. A tilted sensor (OpenCV's 14 coefficients) is not described.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lens {
    /// OpenCV's k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4: plumb-bob is the first five, rational the first eight, thin
    /// prism all twelve. Kalibr's `radtan` is the first four.
    Polynomial([f64; 12]),
    /// k1..k4 of theta (1 + k1 theta^2 + k2 theta^4 + ..), theta the angle to the optical axis: OpenCV's `fisheye`
    /// and Kalibr's `equidistant`.
    Equidistant([f64; 4]),
}

/// One raw eye, seen from the rectified axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EyeModel {
    /// Focal lengths along columns and rows, px.
    pub focal: [f64; 2],
    /// Skew of the columns, px.
    pub skew: f64,
    /// Principal point, px; pixel centres are integers.
    pub centre: [f64; 2],
    /// The lens.
    pub lens: Lens,
    /// From rectified to raw axes, by rows.
    pub turn: [[f64; 3]; 3],
}

/// A rectified pair of pinholes and the raw eyes that it is resampled from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairModel {
    /// Width of the rectified pictures, px.
    pub width: u16,
    /// Height of the rectified pictures, px.
    pub height: u16,
    /// Focal length of both rectified eyes, px.
    pub focal: f64,
    /// Column of the left and of the right axis, px.
    pub columns: [f64; 2],
    /// Row of both axes, px.
    pub row: f64,
    /// Distance between the eyes, mm.
    pub baseline: f64,
    /// From rectified axes to those of the left camera, by rows.
    pub to_left: [[f64; 3]; 3],
    /// The raw eyes; nothing where they are rectified already.
    pub eyes: Option<[EyeModel; 2]>,
}

/// What is wrong with a [`PairModel`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CameraError {
    /// A side is 0 or longer than [`MAX_SIDE`].
    Size,
    /// A focal length is not between 1 and 32767 px.
    Focal,
    /// An axis is not a number or lies farther than 32767 px away, or those of the rectified eyes lie more
    /// than [`MAX_SIDE`] columns apart.
    Axis,
    /// The distance between the eyes is not above 0 and at most 1000 mm.
    Baseline,
    /// A matrix does not turn.
    Rotation,
    /// A coefficient of a lens, or the skew, is not a number.
    Lens,
}

impl fmt::Display for CameraError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let what = match self {
            Self::Size => "the rectified pictures have no pixels or more than 4096 on a side",
            Self::Focal => "a focal length is not between 1 and 32767 px",
            Self::Axis => "an optical axis lies nowhere near its picture",
            Self::Baseline => "the cameras are not between 0 and 1000 mm apart",
            Self::Rotation => "a rotation matrix does not turn",
            Self::Lens => "a lens coefficient is not a number",
        };
        write!(out, "{what}; upload the calibration again")
    }
}

impl core::error::Error for CameraError {}

/// Longest focal length, and farthest axis, px: below 2^23 in 1/256 px.
const MAX_PX: f64 = 32767.0;
/// Longest distance between the eyes, mm.
const MAX_BASELINE: f64 = 1000.0;
/// What the entries of R^T R may differ from those of the identity.
const ROTATION_TOLERANCE: f64 = 1e-6;
/// Where the search for the end of a lens stops, in the plane at distance 1: 80 degrees from the axis.
const MAX_REACH: f64 = 6.0;
/// Its steps in that plane.
const REACH_STEPS: u32 = 192;

impl PairModel {
    /// Holds the numbers against what they can be.
    ///
    /// # Errors
    /// The first [`CameraError`] found.
    pub fn check(&self) -> Result<(), CameraError> {
        let side = |side: u16| (1..=MAX_SIDE).contains(&usize::from(side));
        let long = |focal: f64| (1.0..=MAX_PX).contains(&focal);
        let near = |axis: f64| axis.abs() <= MAX_PX;
        let each = |holds: &dyn Fn(&EyeModel) -> bool| self.eyes.iter().flatten().all(holds);
        let apart = (self.columns[1] - self.columns[0]).abs();
        let axes = self.columns.into_iter().all(near) && near(self.row) && apart <= MAX_SIDE as f64;
        let holds = [
            (side(self.width) && side(self.height), CameraError::Size),
            (long(self.focal) && each(&|eye| eye.focal.into_iter().all(long)), CameraError::Focal),
            (axes && each(&|eye| eye.centre.into_iter().all(near)), CameraError::Axis),
            (self.baseline > 0.0 && self.baseline <= MAX_BASELINE, CameraError::Baseline),
            (turns(&self.to_left) && each(&|eye| turns(&eye.turn)), CameraError::Rotation),
            (each(&|eye| eye.skew.is_finite() && eye.lens.is_finite()), CameraError::Lens),
        ];
        holds.iter().find(|(holds, _)| !holds).map_or(Ok(()), |&(_, error)| Err(error))
    }

    /// How the left and the right rectified picture are seen by the raw ones; nothing where they are these.
    ///
    /// # Errors
    /// As [`Self::check`].
    pub fn mappings(&self) -> Result<Option<[Mapping; 2]>, CameraError> {
        self.check()?;
        Ok(self.eyes.map(|[left, right]| {
            let mapping = |eye: EyeModel, column| Mapping {
                size: self.size(),
                focal: self.focal,
                axis: Vector2::new(column, self.row),
                turn: matrix(&eye.turn),
                reach: eye.lens.reach(),
                eye,
            };
            [mapping(left, self.columns[0]), mapping(right, self.columns[1])]
        }))
    }

    /// Size of the rectified pictures.
    pub fn size(&self) -> Size {
        Size { width: usize::from(self.width), height: usize::from(self.height) }
    }

    /// Focal length of both rectified eyes, 1/256 px.
    pub(crate) fn fixed_focal(&self) -> i32 {
        fixed(self.focal)
    }

    /// What is added to a disparity before Z = f B / d holds, 1/256 px: the right axis' column less the left
    /// one's.
    pub(crate) fn fixed_disparity_offset(&self) -> i32 {
        fixed(self.columns[1] - self.columns[0])
    }
}

/// From the pixels of one rectified picture to those of its raw one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mapping {
    size: Size,
    focal: f64,
    axis: Vector2<f64>,
    turn: Matrix3<f64>,
    reach: f64,
    eye: EyeModel,
}

impl Mapping {
    /// Size of the rectified picture.
    pub const fn size(&self) -> Size {
        self.size
    }

    /// The raw place of a rectified one, px; both may lie outside their pictures.
    pub fn raw(&self, rectified: Vector2<f64>) -> Vector2<f64> {
        let plane = (rectified - self.axis) / self.focal;
        let ray = self.turn * Vector3::new(plane.x, plane.y, 1.0);
        let bent = self.eye.lens.bend(pulled_in(ray, self.reach));
        let ([fx, fy], [cx, cy]) = (self.eye.focal, self.eye.centre);
        Vector2::new(fx * bent.x + self.eye.skew * bent.y + cx, fy * bent.y + cy)
    }

    /// The raw place of a rectified pixel, 1/256 px, rounded; 0 in the place of what is not a number.
    pub fn fixed_raw(&self, u: i32, v: i32) -> [i32; 2] {
        let raw = self.raw(Vector2::new(f64::from(u), f64::from(v)));
        [fixed(raw.x), fixed(raw.y)]
    }
}

impl Lens {
    /// That of a pinhole.
    pub const NONE: Self = Self::Polynomial([0.0; 12]);

    /// Where the image of the ray (x, y, 1) comes to lie.
    pub fn bend(&self, ray: Vector2<f64>) -> Vector2<f64> {
        let (x, y) = (ray.x, ray.y);
        let r2 = x * x + y * y;
        let radial = ray * self.stretch(r2);
        match *self {
            Self::Polynomial([_, _, p1, p2, _, _, _, _, s1, s2, s3, s4]) => {
                let (xx, xy, yy) = (2.0 * x * x, 2.0 * x * y, 2.0 * y * y);
                let decentred = Vector2::new(p1 * xy + p2 * (r2 + xx), p1 * (r2 + yy) + p2 * xy);
                let prism = Vector2::new(r2 * (s1 + r2 * s2), r2 * (s3 + r2 * s4));
                radial + decentred + prism
            }
            Self::Equidistant(_) => radial,
        }
    }

    /// By how much an image moves from the axis or to it, of a ray whose squared distance from it is `r2`.
    fn stretch(&self, r2: f64) -> f64 {
        match *self {
            Self::Polynomial([k1, k2, _, _, k3, k4, k5, k6, ..]) => {
                let above = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
                let below = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6));
                above / below
            }
            Self::Equidistant(_) if r2 == 0.0 => 1.0,
            Self::Equidistant([k1, k2, k3, k4]) => {
                let radius = libm::sqrt(r2);
                let theta = libm::atan(radius);
                let t2 = theta * theta;
                theta * (1.0 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4)))) / radius
            }
        }
    }

    /// How far from the axis, in the plane at distance 1, images move outwards as their rays do. A few
    /// thousandths of tangential and prism terms do not change that.
    fn reach(&self) -> f64 {
        let radius = |step: u32| MAX_REACH * f64::from(step) / f64::from(REACH_STEPS);
        let image = |step: u32| radius(step) * self.stretch(radius(step) * radius(step));
        let last = (0..REACH_STEPS).find(|&step| image(step + 1) <= image(step) || image(step + 1).is_nan());
        radius(last.unwrap_or(REACH_STEPS))
    }

    fn is_finite(&self) -> bool {
        match self {
            Self::Polynomial(k) => k.iter().all(|k| k.is_finite()),
            Self::Equidistant(k) => k.iter().all(|k| k.is_finite()),
        }
    }
}

/// The ray as (x, y, 1), no farther than `reach` from the axis.
fn pulled_in(ray: Vector3<f64>, reach: f64) -> Vector2<f64> {
    let aside = libm::sqrt(ray.x * ray.x + ray.y * ray.y);
    let shrunk = if aside <= reach * ray.z { 1.0 / ray.z } else { reach / aside };
    Vector2::new(ray.x * shrunk, ray.y * shrunk)
}

fn matrix(rows: &[[f64; 3]; 3]) -> Matrix3<f64> {
    Matrix3::from(*rows).transpose()
}

/// Whether the rows are those of a rotation.
fn turns(rows: &[[f64; 3]; 3]) -> bool {
    let turn = matrix(rows);
    let defect = turn * turn.transpose() - Matrix3::identity();
    // No greatest entry: it would pass over what is not a number.
    defect.iter().all(|entry| entry.abs() <= ROTATION_TOLERANCE) && turn.determinant() > 0.0
}

/// A length in px as one in 1/256 px; the nearest end of `i32` if it has none, 0 if it is not a number.
fn fixed(px: f64) -> i32 {
    libm::round(px * f64::from(PX)) as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    const UPRIGHT: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

    fn eye(lens: Lens) -> EyeModel {
        EyeModel { focal: [300.0, 302.0], skew: 0.5, centre: [160.0, 118.0], lens, turn: UPRIGHT }
    }

    fn pair(lens: Lens) -> PairModel {
        PairModel {
            width: 320,
            height: 240,
            focal: 290.0,
            columns: [150.0, 155.5],
            row: 120.0,
            baseline: 60.0,
            to_left: UPRIGHT,
            eyes: Some([eye(lens); 2]),
        }
    }

    #[test]
    fn numbers_that_cannot_be_are_refused() {
        let good = pair(Lens::NONE);
        assert_eq!(good.check(), Ok(()));
        let with = |change: &dyn Fn(&mut PairModel, &mut EyeModel)| {
            let (mut pair, mut right) = (good, eye(Lens::NONE));
            change(&mut pair, &mut right);
            pair.eyes = Some([eye(Lens::NONE), right]);
            pair.check().expect_err("a bad number")
        };
        for bad in [f64::NAN, f64::INFINITY, -1.0, 0.0] {
            assert_eq!(with(&|pair, _| pair.focal = bad), CameraError::Focal);
            assert_eq!(with(&|_, eye| eye.focal[1] = bad), CameraError::Focal);
            assert_eq!(with(&|pair, _| pair.baseline = bad), CameraError::Baseline);
            assert_eq!(with(&|_, eye| eye.turn[1][1] = bad), CameraError::Rotation);
        }
        for bad in [f64::NAN, f64::NEG_INFINITY, 1e5] {
            assert_eq!(with(&|pair, _| pair.row = bad), CameraError::Axis);
            assert_eq!(with(&|pair, _| pair.columns[0] = bad), CameraError::Axis);
            assert_eq!(with(&|_, eye| eye.centre[0] = bad), CameraError::Axis);
        }
        assert_eq!(with(&|pair, _| pair.columns = [-3000.0, 3000.0]), CameraError::Axis);
        assert_eq!(with(&|pair, _| pair.width = 0), CameraError::Size);
        assert_eq!(with(&|pair, _| pair.height = 4097), CameraError::Size);
        assert_eq!(with(&|_, eye| eye.skew = f64::NAN), CameraError::Lens);
        assert_eq!(with(&|_, eye| eye.lens = Lens::Equidistant([f64::NAN; 4])), CameraError::Lens);
        let mirrored = [[-1.0, 0.0, 0.0], UPRIGHT[1], UPRIGHT[2]];
        assert_eq!(with(&|pair, _| pair.to_left = mirrored), CameraError::Rotation);
    }

    #[test]
    fn a_plain_eye_is_a_change_of_scale() {
        let [left, right] = pair(Lens::NONE).mappings().unwrap().unwrap();
        let (x, y) = (50.0 / 290.0, -20.0 / 290.0);
        let expected = Vector2::new(300.0 * x + 0.5 * y + 160.0, 302.0 * y + 118.0);
        assert!((left.raw(Vector2::new(200.0, 100.0)) - expected).norm() < 1e-12);
        assert!((right.raw(Vector2::new(205.5, 100.0)) - expected).norm() < 1e-12);
        assert_eq!(
            (pair(Lens::NONE).fixed_focal(), pair(Lens::NONE).fixed_disparity_offset()),
            (290 * 256, 1408)
        );
        assert_eq!(PairModel { eyes: None, ..pair(Lens::NONE) }.mappings(), Ok(None));
    }

    #[test]
    fn a_lens_that_turns_back_is_held_where_it_does() {
        // r (1 - r^2 / 3) is largest at r = 1.
        let lens = Lens::Polynomial([-1.0 / 3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!((lens.reach(), Lens::NONE.reach(), Lens::Equidistant([0.0; 4]).reach()), (1.0, 6.0, 6.0));
        let [left, _] = pair(lens).mappings().unwrap().unwrap();
        for far in [440.0, 1000.0, 30000.0] {
            let held = left.raw(Vector2::new(far, 120.0));
            assert!((held - Vector2::new(160.0 + 200.0, 118.0)).norm() < 1e-9, "{held}");
        }
    }

    #[test]
    fn whatever_passes_the_check_has_a_raw_place() {
        let turn = [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]];
        for lens in [
            Lens::Polynomial([1e300; 12]),
            Lens::Polynomial([0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
            Lens::Equidistant([-1e300; 4]),
        ] {
            let behind = PairModel { eyes: Some([EyeModel { turn, ..eye(lens) }; 2]), ..pair(lens) };
            for map in
                pair(lens).mappings().unwrap().unwrap().iter().chain(&behind.mappings().unwrap().unwrap())
            {
                for (u, v) in [(-16, -16), (150, 120), (155, 120), (4112, 4112)] {
                    let _ = map.fixed_raw(u, v);
                }
            }
        }
    }
}
