//! What the device needs from the board: two cameras, a link, a clock, and flash for the calibration.
//!
//! The board's main owns these; [`drive`](crate::drive) carries frames and bytes between them and the
//! device, which itself does no I/O. Every call ends: what waits, waits for a stated time at most.

use core::ops::RangeInclusive;
pub use shared::pipeline::Side;

/// Exposure and gain, the same for both eyes, fixed until the next order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Exposure {
    /// Exposed lines; a line takes the sensor about 50 us.
    lines: u16,
    /// Gain, 1/16.
    gain: u16,
}

impl Exposure {
    /// Lines that an eye can expose: less than a frame's.
    pub const LINES: RangeInclusive<u16> = 1..=670;
    /// Gains that an eye can apply, 1/16.
    pub const GAIN: RangeInclusive<u16> = 16..=496;

    /// As little as an eye can expose.
    pub const LEAST: Self = Self::new(0, 0);

    /// `lines` at a gain of `gain` / 16, both brought into range.
    pub const fn new(lines: u16, gain: u16) -> Self {
        Self { lines: clamp(lines, Self::LINES), gain: clamp(gain, Self::GAIN) }
    }

    /// Exposed lines.
    pub const fn lines(self) -> u16 {
        self.lines
    }

    /// Gain, 1/16.
    pub const fn gain(self) -> u16 {
        self.gain
    }
}

impl Default for Exposure {
    /// About 15 ms at a gain of 1.
    fn default() -> Self {
        Self::new(300, 16)
    }
}

const fn clamp(value: u16, range: RangeInclusive<u16>) -> u16 {
    if value < *range.start() {
        *range.start()
    } else if value > *range.end() {
        *range.end()
    } else {
        value
    }
}

/// What an eye says that it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Identity {
    /// Product number of the sensor.
    pub sensor: u16,
    /// Version of the chip between sensor and bus.
    pub controller: u8,
    /// Whether that chip sends one byte too many before a frame.
    pub sends_dummy: bool,
}

/// When the pictures of both eyes, left then right, were complete.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stamps {
    /// Time of the clock at which each eye was first seen to be done, us.
    pub done: [u64; 2],
}

impl Stamps {
    /// How far the eyes' shutters are apart, us: an object that moves, moves in between.
    pub const fn skew(&self) -> u64 {
        let [left, right] = self.done;
        left.abs_diff(right)
    }
}

/// What is wrong with which eye.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CameraError {
    /// The eye.
    pub side: Side,
    /// What is wrong with it.
    pub fault: CameraFault,
}

/// What can be wrong with an eye.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CameraFault {
    /// The picture bus does not transfer.
    PictureBus,
    /// The control bus does not transfer, or nobody acknowledges.
    ControlBus,
    /// A test byte came back changed: wiring, noise, bus mode or clock.
    Echo {
        /// The byte that was sent.
        sent: u8,
        /// The byte that came back.
        read: u8,
    },
    /// The sensor is another than the driver's; its product number.
    Identity(u16),
    /// A register of the sensor did not keep its value.
    Register {
        /// The register's address.
        address: u8,
        /// What it reads instead.
        read: u8,
    },
    /// No picture within this time, us. The eyes must be started again.
    TimeLimit(u32),
    /// The picture has this many bytes, which is no picture of this size; it is discarded.
    Length(u32),
    /// The test picture is no test picture, seen from this row on.
    TestPicture(u16),
    /// The eyes have not been started.
    NotStarted,
    /// There is no picture, or it has been read already.
    NoPicture,
}

/// A pair of eyes that take pictures of [`WIDTH`](Self::WIDTH) x [`HEIGHT`](Self::HEIGHT) px of luma, one
/// pair at a time, and give them line by line.
pub trait CameraPair {
    /// Columns of a picture, px.
    const WIDTH: usize;
    /// Rows of a picture, px.
    const HEIGHT: usize;

    /// Start both eyes, or start them again whatever state they are in, test them, and fix the exposure.
    /// Takes a second or two.
    ///
    /// # Errors
    /// What is wrong with the first eye found bad. Only `start` works then.
    fn start(&mut self, exposure: Exposure) -> Result<[Identity; 2], CameraError>;

    /// Fix the exposure of both eyes, and wait until their pictures have it. A pair not yet read is lost.
    ///
    /// # Errors
    /// A bus or a sensor that fails. Only `start` works then.
    fn expose(&mut self, exposure: Exposure) -> Result<(), CameraError>;

    /// Take a picture with both eyes.
    ///
    /// # Errors
    /// After `TimeLimit` only `start` works; after other faults another `capture` may succeed.
    fn capture(&mut self) -> Result<Stamps, CameraError>;

    /// Give the luma of one eye's picture to `line`, row by row from the top, each with its number. A
    /// picture can be read once.
    ///
    /// # Errors
    /// A bus that fails, after some rows perhaps; the picture is lost.
    fn read(&mut self, side: Side, line: &mut dyn FnMut(usize, &[u8])) -> Result<(), CameraError>;

    /// Let both eyes make their test pictures and look at these. A pair not yet read is lost.
    ///
    /// # Errors
    /// What is wrong with the first eye found bad. Only `start` works then.
    fn self_test(&mut self) -> Result<(), CameraError>;
}

/// Time since some start.
pub trait Clock {
    /// Time, us; never goes back.
    fn micros(&self) -> u64;
}

/// Bytes to and from the host.
pub trait Link {
    /// Take bytes that have come; how many of `buffer`'s first they fill, 0 when there are none. Does not wait.
    ///
    /// # Errors
    /// Bytes that came and were lost.
    fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, LinkError>;

    /// Send all of `bytes`, in order.
    ///
    /// # Errors
    /// When the host takes no more; some of the bytes may have gone.
    fn send(&mut self, bytes: &[u8]) -> Result<(), LinkError>;
}

/// What can be wrong with a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinkError {
    /// Bytes came faster than they were taken; some are lost.
    Overrun,
    /// The host has not taken all of it within this time, us.
    TimeLimit(u32),
    /// There is no host.
    Closed,
}

/// One record that outlives a loss of power.
pub trait Flash {
    /// Bytes that a record can have.
    fn capacity(&self) -> usize;

    /// The record: how many of `buffer`'s first bytes it fills, 0 when none was ever saved.
    ///
    /// # Errors
    /// A buffer that is too short, a record that is damaged, a failing memory.
    fn load(&mut self, buffer: &mut [u8]) -> Result<usize, FlashError>;

    /// Replace the record; an empty one is as none. Whatever happens meanwhile, the old one or the new one stands whole.
    ///
    /// # Errors
    /// Too many bytes, or a failing memory.
    fn save(&mut self, record: &[u8]) -> Result<(), FlashError>;
}

/// What can be wrong with flash.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlashError {
    /// More bytes than this fit.
    TooLong(usize),
    /// What is there is not what was saved.
    Damaged,
    /// The memory does not erase, write or read.
    Failing,
}

/// Resets the board unless it is fed in time: later than the longest call of these ports and the longest step
/// of the core take, together some seconds.
pub trait Watchdog {
    /// All is well.
    fn feed(&mut self);
}
