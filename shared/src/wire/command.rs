//! What a host says to its device. Layouts stand in docs/wire-format.md.

use super::bytes::Reader;
use super::calibration::{read_calibration, write_calibration};
use super::frame::{Frame, Writer};
use super::hello::check_version;
use super::message::Exposure;
use super::picture::PictureKind;
use super::{VERSION, WireError};
use crate::camera::PairModel;
use crate::limits::CapacityError;
use crate::stage::binarise::{Polarity, Threshold};

/// A command to a device. The device answers each: to a hello with its own, to a question with the answer,
/// to all others with an [`Answer`](super::Answer).
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "nothing is allocated, and there is one command at a time")]
pub enum ToDevice {
    /// Who are you?
    Hello,
    /// Take pairs, one after the other.
    Start,
    /// Take no more.
    Stop,
    /// Where to part object and background.
    Threshold(Threshold),
    /// Whether the object is bright or dark.
    Polarity(Polarity),
    /// How to take pictures.
    Exposure(ExposureSetting),
    /// Keep this calibration.
    Calibration(PairModel),
    /// Keep none.
    ForgetCalibration,
    /// Send the pictures of the next pair, once.
    Grab(PictureKind),
    /// How do you fare?
    Health,
}

/// How to take pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExposureSetting {
    /// As the sensors find best.
    Auto,
    /// As it is said, the left eye and the right one.
    Fixed([Exposure; 2]),
}

const HELLO: u8 = 0x81;
const START: u8 = 0x82;
const STOP: u8 = 0x83;
const THRESHOLD: u8 = 0x84;
const POLARITY: u8 = 0x85;
const EXPOSURE: u8 = 0x86;
const CALIBRATION: u8 = 0x87;
const FORGET_CALIBRATION: u8 = 0x88;
const GRAB: u8 = 0x89;
const HEALTH: u8 = 0x8A;

impl ToDevice {
    const fn kind(&self) -> u8 {
        match self {
            Self::Hello => HELLO,
            Self::Start => START,
            Self::Stop => STOP,
            Self::Threshold(_) => THRESHOLD,
            Self::Polarity(_) => POLARITY,
            Self::Exposure(_) => EXPOSURE,
            Self::Calibration(_) => CALIBRATION,
            Self::ForgetCalibration => FORGET_CALIBRATION,
            Self::Grab(_) => GRAB,
            Self::Health => HEALTH,
        }
    }

    /// Write the command as a frame and return its length.
    ///
    /// # Errors
    /// A [`CapacityError`] when `out` is too short.
    pub fn encode(&self, sequence: u16, out: &mut [u8]) -> Result<usize, CapacityError> {
        let mut writer = Writer::new(self.kind(), sequence, out);
        match self {
            Self::Hello => writer.u16(VERSION),
            Self::Start | Self::Stop | Self::ForgetCalibration | Self::Health => (),
            Self::Threshold(Threshold::Otsu) => writer.put(&[0, 0]),
            Self::Threshold(Threshold::Fixed(level)) => writer.put(&[1, *level]),
            Self::Polarity(polarity) => writer.u8(match polarity {
                Polarity::BrightObject => 0,
                Polarity::DarkObject => 1,
                Polarity::Auto => 2,
            }),
            Self::Exposure(setting) => {
                let (fixed, exposures) = match setting {
                    ExposureSetting::Auto => (false, [Exposure::default(); 2]),
                    ExposureSetting::Fixed(exposures) => (true, *exposures),
                };
                writer.flag(fixed);
                for exposure in exposures {
                    exposure.write(&mut writer);
                }
            }
            Self::Calibration(model) => write_calibration(model, &mut writer),
            Self::Grab(kind) => writer.u8(kind.code()),
        }
        writer.finish()
    }

    /// Read a frame.
    ///
    /// # Errors
    /// A [`WireError`] that says what is wrong with the command.
    pub fn decode(frame: &Frame<'_>) -> Result<Self, WireError> {
        let mut reader = Reader::new(frame.payload);
        Ok(match frame.kind {
            HELLO => {
                check_version(&mut reader)?;
                Self::Hello
            }
            START => Self::Start,
            STOP => Self::Stop,
            THRESHOLD => Self::Threshold(match reader.array()? {
                [0, _] => Threshold::Otsu,
                [1, level] => Threshold::Fixed(level),
                [code, _] => return Err(WireError::Unknown { what: "threshold", code }),
            }),
            POLARITY => Self::Polarity(match reader.u8()? {
                0 => Polarity::BrightObject,
                1 => Polarity::DarkObject,
                2 => Polarity::Auto,
                code => return Err(WireError::Unknown { what: "polarity", code }),
            }),
            EXPOSURE => {
                let fixed = reader.flag("exposure")?;
                let exposures = [Exposure::read(&mut reader)?, Exposure::read(&mut reader)?];
                Self::Exposure(if fixed { ExposureSetting::Fixed(exposures) } else { ExposureSetting::Auto })
            }
            CALIBRATION => Self::Calibration(read_calibration(&mut reader)?),
            FORGET_CALIBRATION => Self::ForgetCalibration,
            GRAB => Self::Grab(PictureKind::of(reader.u8()?)?),
            HEALTH => Self::Health,
            code => return Err(WireError::Unknown { what: "command", code }),
        })
    }
}
