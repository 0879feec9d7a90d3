//! Why a frame is no message.

use super::VERSION;
use crate::camera::CameraError;
use crate::limits::CapacityError;
use core::fmt;

/// A frame whose check sum is right, but that cannot be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WireError {
    /// The other end speaks another version of the format.
    Version {
        /// The other end's; [`VERSION`] is ours.
        theirs: u16,
    },
    /// A type or code that this version does not know.
    Unknown {
        /// What it is the code of.
        what: &'static str,
        /// The code.
        code: u8,
    },
    /// The message ends before its last field.
    Short,
    /// A field holds what no sender writes.
    Invalid(&'static str),
    /// A calibration that no pair of cameras has.
    Calibration(CameraError),
    /// The shape needs longer lists than were lent.
    Capacity(CapacityError),
}

impl From<CapacityError> for WireError {
    fn from(error: CapacityError) -> Self {
        Self::Capacity(error)
    }
}

impl fmt::Display for WireError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Version { theirs } => write!(
                f,
                "the other end speaks version {theirs} of the wire format, this one version {VERSION}; \
                 bring host and firmware to the same release"
            ),
            Self::Unknown { what, code } => {
                write!(f, "unknown {what} {code:#04x}: the other end may be newer; update this one")
            }
            Self::Short => write!(f, "a message ends before its last field"),
            Self::Invalid(what) => write!(f, "a message with an impossible {what}"),
            Self::Calibration(error) => write!(f, "{error}"),
            Self::Capacity(error) => write!(f, "a shape of {error}"),
        }
    }
}

impl core::error::Error for WireError {}
