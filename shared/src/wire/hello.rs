//! Who speaks: the first message of both ends.

use super::bytes::Reader;
use super::frame::Writer;
use super::{VERSION, WireError};
use crate::limits::CapacityError;

/// Longest name of a board, bytes.
pub const MAX_BOARD: usize = 32;

/// Who a device is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Hello<'a> {
    /// Version of the firmware, as in 1.2.3.
    pub firmware: [u16; 3],
    /// Name of the board, at most [`MAX_BOARD`] bytes.
    pub board: &'a str,
    /// What the left and the right image sensor say that they are; 0 for one that is silent.
    pub sensors: [u32; 2],
    /// Width and height of the pictures, px.
    pub picture: [u16; 2],
    /// How much a shape may have.
    pub capacities: Capacities,
    /// Why it started.
    pub reset: ResetReason,
    /// [`calibration_crc`](super::calibration_crc) of the calibration that it keeps, if there is one.
    pub calibration: Option<u32>,
}

/// How much a shape may have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Capacities {
    /// Contour points.
    pub contour: u16,
    /// Branches.
    pub branches: u16,
    /// Control points of all branches.
    pub controls: u16,
}

/// Declares an enum whose variants are sent as codes.
macro_rules! codes {
    ($(#[$meta:meta])* $name:ident, $what:literal: $($(#[$doc:meta])* $variant:ident = $code:literal),+) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $name {
            $($(#[$doc])* $variant = $code),+
        }

        impl $name {
            const fn of(code: u8) -> Result<Self, WireError> {
                match code {
                    $($code => Ok(Self::$variant),)+
                    code => Err(WireError::Unknown { what: $what, code }),
                }
            }
        }
    };
}

pub(super) use codes;

codes! {
    /// Why a device started.
    ResetReason, "reset reason":
    /// None that it could tell.
    Unknown = 0,
    /// It was switched on.
    Power = 1,
    /// The reset pin.
    Pin = 2,
    /// It hung and the watchdog bit.
    Watchdog = 3,
    /// It was told to.
    Software = 4,
    /// The supply voltage broke down.
    BrownOut = 5
}

impl<'a> Hello<'a> {
    pub(super) fn write(&self, writer: &mut Writer<'_>) -> Result<(), CapacityError> {
        if self.board.len() > MAX_BOARD {
            return Err(CapacityError { what: "bytes in a board's name", limit: MAX_BOARD });
        }
        writer.u16(VERSION);
        for x in self.firmware {
            writer.u16(x);
        }
        writer.u8(self.board.len() as u8);
        writer.put(self.board.as_bytes());
        for x in self.sensors {
            writer.u32(x);
        }
        for x in self.picture {
            writer.u16(x);
        }
        writer.u16(self.capacities.contour);
        writer.u16(self.capacities.branches);
        writer.u16(self.capacities.controls);
        writer.u8(self.reset as u8);
        writer.flag(self.calibration.is_some());
        writer.u32(self.calibration.unwrap_or(0));
        Ok(())
    }

    pub(super) fn read(reader: &mut Reader<'a>) -> Result<Self, WireError> {
        check_version(reader)?;
        let firmware = [reader.u16()?, reader.u16()?, reader.u16()?];
        let length = usize::from(reader.u8()?);
        // It is shown in terminals, which obey control characters.
        let fits = |name: &&str| name.len() <= MAX_BOARD && !name.contains(char::is_control);
        let board = core::str::from_utf8(reader.take(length)?).ok().filter(fits);
        let board = board.ok_or(WireError::Invalid("name of a board"))?;
        let sensors = [reader.u32()?, reader.u32()?];
        let picture = [reader.u16()?, reader.u16()?];
        let capacities =
            Capacities { contour: reader.u16()?, branches: reader.u16()?, controls: reader.u16()? };
        let reset = ResetReason::of(reader.u8()?)?;
        let stored = reader.flag("calibration")?;
        let calibration = Some(reader.u32()?).filter(|_| stored);
        Ok(Self { firmware, board, sensors, picture, capacities, reset, calibration })
    }
}

/// Read the version of a hello.
pub(super) fn check_version(reader: &mut Reader<'_>) -> Result<(), WireError> {
    match reader.u16()? {
        VERSION => Ok(()),
        theirs => Err(WireError::Version { theirs }),
    }
}
