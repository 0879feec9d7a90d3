//! The camera pair as a device knows it: how each rectified pixel is seen by a raw one.
//!
//! The only floating point of the core. It is evaluated when a calibration arrives, never per pair, and in
//! IEEE double precision without fused operations, so every machine makes the same tables of it.
//! Rectified axes are x right along the baseline, y down, z forward, mm, from the left camera's centre.

/// How a lens moves the image of a ray; normalised points, no unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lens {
    /// OpenCV's k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4.
    Polynomial([f64; 12]),
    /// k1..k4 of theta (1 + k1 theta^2 + k2 theta^4 + ..), theta the angle to the optical axis.
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
