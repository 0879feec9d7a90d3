//! What a device says to its host. Layouts stand in docs/wire-format.md.

use super::WireError;
use super::bytes::Reader;
use super::finding::{read_finding, write_finding};
use super::frame::{Frame, Writer};
use super::hello::{Hello, codes};
use super::picture::PicturePart;
use super::shape::{Shape, ShapeLists};
use crate::limits::CapacityError;
use crate::pipeline::Finding;

/// A message from a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ToHost<'a> {
    /// Who it is; the first message after a reset, and the answer to a hello.
    Hello(Hello<'a>),
    /// What became of a pair of pictures.
    Pair(PairReport<'a>),
    /// Rows of a picture that was asked for.
    Picture(PicturePart<'a>),
    /// How it fares.
    Health(Health),
    /// What became of a command.
    Answer(Answer),
}

codes! {
    /// Why a command was not obeyed; 0 is none.
    ErrorCode, "error code":
    /// It is of a type that this firmware does not know.
    UnknownCommand = 1,
    /// It could not be read.
    Malformed = 2,
    /// It speaks another version of the format.
    Version = 3,
    /// Its values are outside what this device can do.
    OutOfRange = 4,
    /// Not while another one is under way.
    Busy = 5,
    /// The calibration could not be stored or erased.
    Storage = 6,
    /// A camera does not answer.
    Camera = 7,
    /// Pairs cannot be described without a calibration, and the device keeps none.
    Uncalibrated = 8
}

/// How a picture was taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Exposure {
    /// Time, lines of the sensor.
    pub lines: u16,
    /// Gain, 1/256.
    pub gain: u16,
}

/// What became of a pair of pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PairReport<'a> {
    /// Its number since the device started.
    pub number: u32,
    /// When the left and the right picture were complete, us since the device started.
    pub stamps: [u64; 2],
    /// Levels between object and background, 0 in an eye that was not looked at.
    pub levels: [u8; 2],
    /// How both pictures were taken.
    pub exposures: [Exposure; 2],
    /// What the core made of it, or why it refused.
    pub result: Result<Shape<'a>, Finding>,
}

impl PairReport<'_> {
    /// How much later the right picture was complete than the left one, us.
    pub const fn gap(&self) -> i64 {
        self.stamps[1].wrapping_sub(self.stamps[0]).cast_signed()
    }
}

/// How a device fares; counters since it started, but for the last one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Health {
    /// Time since it started, ms.
    pub uptime: u64,
    /// Pairs that came to their end: described, refused, or shown and no more.
    pub pairs: u32,
    /// Those that the core refused.
    pub refused: u32,
    /// Pairs that were begun and did not come to it. With `pairs`, and one under way, they make the newest number.
    pub dropped: u32,
    /// Times that a picture did not come in time; its pair was dropped.
    pub timeouts: u32,
    /// Times that a camera was started anew.
    pub restarts: u32,
    /// Bytes from the host that were no frame.
    pub rejected_bytes: u32,
    /// Frames from the host that could not be used.
    pub rejected_frames: u32,
    /// Times that the watchdog bit since it was switched on.
    pub watchdog_resets: u32,
    /// Times that the calibration's memory failed or was found damaged.
    pub storage_faults: u32,
}

/// What became of a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Answer {
    /// The sequence number of the command's frame.
    pub command: u16,
    /// It was obeyed, or why not.
    pub result: Result<(), ErrorCode>,
}

const HELLO: u8 = 0x01;
const PAIR: u8 = 0x02;
const PICTURE: u8 = 0x03;
const HEALTH: u8 = 0x04;
const ANSWER: u8 = 0x05;

impl<'a> ToHost<'a> {
    /// Write the message as a frame and return its length. A shape that does not fit is not sent in part:
    /// the pair is then reported as refused for [`Finding::Capacity`].
    ///
    /// # Errors
    /// A [`CapacityError`] when `out` is too short even so, and for a board's name that is too long.
    pub fn encode(&self, sequence: u16, out: &mut [u8]) -> Result<usize, CapacityError> {
        match (self.encode_whole(sequence, out), self) {
            (Err(error), Self::Pair(pair)) if pair.result.is_ok() => {
                let refused = PairReport { result: Err(Finding::Capacity(error)), ..*pair };
                Self::Pair(refused).encode_whole(sequence, out)
            }
            (done, _) => done,
        }
    }

    fn encode_whole(&self, sequence: u16, out: &mut [u8]) -> Result<usize, CapacityError> {
        let kind = match self {
            Self::Hello(_) => HELLO,
            Self::Pair(_) => PAIR,
            Self::Picture(_) => PICTURE,
            Self::Health(_) => HEALTH,
            Self::Answer(_) => ANSWER,
        };
        let mut writer = Writer::new(kind, sequence, out);
        match self {
            Self::Hello(hello) => hello.write(&mut writer)?,
            Self::Pair(pair) => pair.write(&mut writer)?,
            Self::Picture(part) => part.write(&mut writer)?,
            Self::Health(health) => health.write(&mut writer),
            Self::Answer(answer) => answer.write(&mut writer),
        }
        writer.finish()
    }

    /// Read a frame. A shape goes into `lists`, and whatever they held is lost then.
    ///
    /// # Errors
    /// A [`WireError`] that says what is wrong with the message.
    pub fn decode(frame: &Frame<'a>, lists: &'a mut ShapeLists<'_>) -> Result<Self, WireError> {
        let mut reader = Reader::new(frame.payload);
        Ok(match frame.kind {
            HELLO => Self::Hello(Hello::read(&mut reader)?),
            PAIR => Self::Pair(PairReport::read(&mut reader, lists)?),
            PICTURE => Self::Picture(PicturePart::read(&mut reader)?),
            HEALTH => Self::Health(Health::read(&mut reader)?),
            ANSWER => Self::Answer(Answer::read(&mut reader)?),
            code => return Err(WireError::Unknown { what: "message type", code }),
        })
    }
}

impl<'a> PairReport<'a> {
    fn write(&self, writer: &mut Writer<'_>) -> Result<(), CapacityError> {
        writer.u32(self.number);
        for x in self.stamps {
            writer.u64(x);
        }
        for x in self.levels {
            writer.u8(x);
        }
        for exposure in &self.exposures {
            exposure.write(writer);
        }
        match &self.result {
            Ok(shape) => {
                writer.flag(true);
                shape.write(writer)
            }
            Err(finding) => {
                writer.flag(false);
                write_finding(finding, writer);
                Ok(())
            }
        }
    }

    fn read(reader: &mut Reader<'_>, lists: &'a mut ShapeLists<'_>) -> Result<Self, WireError> {
        let number = reader.u32()?;
        let stamps = [reader.u64()?, reader.u64()?];
        let levels = [reader.u8()?, reader.u8()?];
        let exposures = [Exposure::read(reader)?, Exposure::read(reader)?];
        let result = if reader.flag("result of a pair")? {
            lists.read(reader)?;
            Ok(lists.shape())
        } else {
            Err(read_finding(reader)?)
        };
        Ok(Self { number, stamps, levels, exposures, result })
    }
}

impl Exposure {
    pub(super) fn write(self, writer: &mut Writer<'_>) {
        writer.u16(self.lines);
        writer.u16(self.gain);
    }

    pub(super) fn read(reader: &mut Reader<'_>) -> Result<Self, WireError> {
        Ok(Self { lines: reader.u16()?, gain: reader.u16()? })
    }
}

impl Health {
    fn write(&self, writer: &mut Writer<'_>) {
        writer.u64(self.uptime);
        for counter in [
            self.pairs,
            self.refused,
            self.dropped,
            self.timeouts,
            self.restarts,
            self.rejected_bytes,
            self.rejected_frames,
            self.watchdog_resets,
            self.storage_faults,
        ] {
            writer.u32(counter);
        }
    }

    fn read(reader: &mut Reader<'_>) -> Result<Self, WireError> {
        Ok(Self {
            uptime: reader.u64()?,
            pairs: reader.u32()?,
            refused: reader.u32()?,
            dropped: reader.u32()?,
            timeouts: reader.u32()?,
            restarts: reader.u32()?,
            rejected_bytes: reader.u32()?,
            rejected_frames: reader.u32()?,
            watchdog_resets: reader.u32()?,
            storage_faults: reader.u32()?,
        })
    }
}

impl Answer {
    fn write(self, writer: &mut Writer<'_>) {
        writer.u16(self.command);
        writer.u8(self.result.map_or_else(|error| error as u8, |()| 0));
    }

    fn read(reader: &mut Reader<'_>) -> Result<Self, WireError> {
        let command = reader.u16()?;
        let result = match reader.u8()? {
            0 => Ok(()),
            code => Err(ErrorCode::of(code)?),
        };
        Ok(Self { command, result })
    }
}
