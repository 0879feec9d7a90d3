//! What can be wrong with a calibration, each as one sentence that also says what to do.

use std::fmt;
use std::io;
use std::path::PathBuf;

/// Where in which file a value stands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// Name of the file; empty for text that came from no file.
    pub file: String,
    /// Line, counted from 1; 0 when it is not known.
    pub line: u64,
}

impl fmt::Display for Place {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.file.as_str(), self.line) {
            ("", 0) => write!(out, "calibration"),
            ("", line) => write!(out, "calibration line {line}"),
            (file, 0) => write!(out, "{file}"),
            (file, line) => write!(out, "{file} line {line}"),
        }
    }
}

/// Why a calibration was refused. Lengths are millimetres.
#[derive(Debug, thiserror::Error)]
pub enum CalibrationError {
    /// The file or folder could not be read.
    #[error("cannot read the calibration {}", path.display())]
    Unreadable {
        /// What was asked for.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The file could not be written.
    #[error("cannot write the calibration {}", path.display())]
    Unwritable {
        /// What was asked for.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The cameras have something that OpenCV's stereo keys cannot say.
    #[error("an OpenCV stereo file cannot hold this calibration: {reason}")]
    Inexpressible {
        /// What it is.
        reason: &'static str,
    },
    /// The text is not YAML, or is not a mapping of keys to values.
    #[error("{place}: not YAML ({reason}); save the calibration as YAML")]
    NotYaml {
        /// Where the reader gave up.
        place: Place,
        /// What it met.
        reason: String,
    },
    /// The keys belong to none of the formats.
    #[error(
        "{place}: no calibration format has these keys; give OpenCV's M1 D1 M2 D2 R T (as YAML), a pair of \
         ROS camera_info files, or a Kalibr camchain with cam0 and cam1"
    )]
    UnknownFormat {
        /// The file.
        place: Place,
    },
    /// One ROS file came alone.
    #[error(
        "{place}: this is one camera of a ROS pair; give the folder of left.yaml and right.yaml, or \
         `left.yaml,right.yaml`"
    )]
    OneEye {
        /// The file.
        place: Place,
    },
    /// A key is not there.
    #[error("{place}: `{key}` is missing; add it, or export the calibration again")]
    Missing {
        /// The file, and the line of the mapping that lacks it.
        place: Place,
        /// The key, by its usual name.
        key: String,
    },
    /// A value has the wrong type or number of elements.
    #[error("{place}: `{key}` should be {expected}")]
    Shape {
        /// Where.
        place: Place,
        /// The key.
        key: String,
        /// What belongs there.
        expected: String,
    },
    /// A value is NaN or infinite.
    #[error(
        "{place}: `{key}` holds a number that is not finite; the calibration did not converge, so \
         calibrate again"
    )]
    NotFinite {
        /// Line of the number itself.
        place: Place,
        /// The key.
        key: String,
    },
    /// A camera matrix without a focal length, or not of the pinhole form.
    #[error(
        "{place}: `{key}` is singular or no camera matrix; it should read [fx s cx; 0 fy cy; 0 0 1] with \
         positive fx and fy"
    )]
    Singular {
        /// Where.
        place: Place,
        /// The key.
        key: String,
    },
    /// A matrix that should turn, but shears, scales or mirrors.
    #[error(
        "{place}: `{key}` is not a rotation; its rows should be orthogonal unit vectors and its determinant 1"
    )]
    NotRotation {
        /// Where.
        place: Place,
        /// The key.
        key: String,
    },
    /// A lens model that is not supported.
    #[error("{place}: the lens model `{model}` is not supported; calibrate with {known}")]
    Lens {
        /// Where.
        place: Place,
        /// What the file says.
        model: String,
        /// What would do.
        known: &'static str,
    },
    /// Both cameras stand at one point.
    #[error("the baseline is 0: one camera cannot see depth; check the translation")]
    NoBaseline,
    /// The right camera stands left of the left one.
    #[error(
        "the eyes are swapped: the right camera stands {mm:.1} mm to the left of the left one (T[0] should \
         be negative); exchange the images and the cameras"
    )]
    Swapped {
        /// By how much, mm.
        mm: f64,
    },
    /// The cameras stand above one another.
    #[error(
        "this is a top-bottom pair: the second camera is {down:.1} mm below and {right:.1} mm right of the \
         first; turn both images by 90 degrees and calibrate again"
    )]
    TopBottom {
        /// Downward part of the baseline, mm.
        down: f64,
        /// Part to the right, mm.
        right: f64,
    },
    /// The cameras stand behind one another, or look apart.
    #[error(
        "the cameras do not look side by side: they are turned by {turn_degrees:.0} degrees against each \
         other and the baseline leans {lean_degrees:.0} degrees out of the image plane; at most \
         60 and 45 can be rectified"
    )]
    NotSideBySide {
        /// Angle of the rotation between the cameras, degrees.
        turn_degrees: f64,
        /// Angle between the baseline and the mean image plane, degrees.
        lean_degrees: f64,
    },
    /// The baseline cannot be millimetres.
    #[error(
        "the baseline is {mm} mm, outside 1 to 1000 mm; check the units: OpenCV files are read in \
         millimetres, ROS and Kalibr files in metres"
    )]
    Units {
        /// Length of the translation, mm.
        mm: f64,
    },
    /// The images have another size than those of the calibration.
    #[error(
        "the calibration is for {}x{} images, but these are {}x{}; calibrate at this resolution, or \
         record at that one",
        calibrated.0, calibrated.1, images.0, images.1
    )]
    Size {
        /// Width and height in the calibration, px.
        calibrated: (u32, u32),
        /// Width and height of the images, px.
        images: (u32, u32),
    },
}
