//! The ArduChip on its picture bus: it waits for the sensor's next frame, keeps it, and gives it byte by byte.
//!
//! A transaction is a command byte, bit 7 set to write, bits 6:0 the address, and its data, all under one
//! chip select.

use super::registers::{HEIGHT, WIDTH};
use crate::ports::CameraFault;
use embedded_hal::spi::{MODE_0, Mode, Operation, SpiDevice};

/// How the chip clocks.
pub const SPI_MODE: Mode = MODE_0;
/// The fastest clock that the chip is made for, Hz.
pub const SPI_MAX_HZ: u32 = 8_000_000;
/// A clock to begin with, on wires of a hand's length, Hz.
pub const SPI_FIRST_HZ: u32 = 4_000_000;

/// Bytes of a row, YUV422.
pub const ROW_BYTES: usize = 2 * WIDTH;
/// Bytes of a frame.
pub const FRAME_BYTES: u32 = (ROW_BYTES * HEIGHT) as u32;
/// Bytes that may follow a frame.
pub const TAIL_BYTES: u32 = 64;
/// How long each half of the chip's reset takes, ms.
pub const RESET_MS: u32 = 100;

const WRITE: u8 = 0x80;
const TEST: u8 = 0x00;
/// Bits 2:0: frames of a capture, less one.
const FRAMES: u8 = 0x01;
/// Polarities of the sensor's signals; 0 is what a reset of the sensor gives.
const TIMING: u8 = 0x03;
const FIFO: u8 = 0x04;
const CPLD_RESET: u8 = 0x07;
const BURST: u8 = 0x3C;
const VERSION: u8 = 0x40;
const STATUS: u8 = 0x41;
const LENGTH: [u8; 3] = [0x42, 0x43, 0x44];

/// FIFO: forget that a capture is done. Bits 5:4 reset pointers and are left alone: captures that follow are
/// cut short.
const CLEAR_DONE: u8 = 0x01;
/// FIFO: capture.
const START: u8 = 0x02;
/// STATUS: a capture is done.
const DONE: u8 = 0x08;

/// An ArduChip.
#[derive(Debug)]
pub struct ArduChip<S> {
    bus: S,
}

impl<S: SpiDevice> ArduChip<S> {
    /// The chip behind a bus.
    pub const fn new(bus: S) -> Self {
        Self { bus }
    }

    /// Begin (`true`) or end the chip's reset; wait [`RESET_MS`] after each.
    ///
    /// # Errors
    /// A failing bus.
    pub fn reset(&mut self, on: bool) -> Result<(), CameraFault> {
        self.write(CPLD_RESET, if on { 0x80 } else { 0x00 })
    }

    /// One frame a capture, signals as the sensor gives them.
    ///
    /// # Errors
    /// A failing bus.
    pub fn set_up(&mut self) -> Result<(), CameraFault> {
        self.write(FRAMES, 0)?;
        self.write(TIMING, 0)
    }

    /// Whether bytes come back as they were sent: every bit both ways, eight times.
    ///
    /// # Errors
    /// A failing bus; a byte that changed.
    pub fn echo(&mut self) -> Result<(), CameraFault> {
        for _ in 0..8 {
            for sent in [0x55, 0xAA] {
                self.write(TEST, sent)?;
                let read = self.register(TEST)?;
                if read != sent {
                    return Err(CameraFault::Echo { sent, read });
                }
            }
        }
        Ok(())
    }

    /// The chip's version.
    ///
    /// # Errors
    /// A failing bus.
    pub fn version(&mut self) -> Result<u8, CameraFault> {
        self.register(VERSION)
    }

    /// Forget the last frame.
    ///
    /// # Errors
    /// A failing bus.
    pub fn clear(&mut self) -> Result<(), CameraFault> {
        self.write(FIFO, CLEAR_DONE)
    }

    /// Keep the sensor's next whole frame.
    ///
    /// # Errors
    /// A failing bus.
    pub fn capture(&mut self) -> Result<(), CameraFault> {
        self.write(FIFO, START)
    }

    /// Whether the frame is kept; told twice, as the length of half a frame would be read after a flipped bit.
    ///
    /// # Errors
    /// A failing bus.
    pub fn is_done(&mut self) -> Result<bool, CameraFault> {
        Ok(self.register(STATUS)? & DONE != 0 && self.register(STATUS)? & DONE != 0)
    }

    /// Whether the frame kept is a whole one.
    ///
    /// # Errors
    /// A failing bus; a frame of another length.
    pub fn check_length(&mut self) -> Result<(), CameraFault> {
        let [low, middle, high] = LENGTH;
        let bytes = [self.register(low)?, self.register(middle)?, self.register(high)? & 0x7F, 0];
        let length = u32::from_le_bytes(bytes);
        let whole = (FRAME_BYTES..=FRAME_BYTES + TAIL_BYTES).contains(&length);
        if whole { Ok(()) } else { Err(CameraFault::Length(length)) }
    }

    /// The next row's bytes. Each row is a burst of its own, so the bus is free for others in between.
    ///
    /// # Errors
    /// A failing bus.
    pub fn row(&mut self, bytes: &mut [u8; ROW_BYTES]) -> Result<(), CameraFault> {
        self.transfer(&mut [Operation::Write(&[BURST]), Operation::Read(bytes)])
    }

    fn write(&mut self, address: u8, value: u8) -> Result<(), CameraFault> {
        self.transfer(&mut [Operation::Write(&[WRITE | address, value])])
    }

    fn register(&mut self, address: u8) -> Result<u8, CameraFault> {
        let mut value = [0];
        self.transfer(&mut [Operation::Write(&[address]), Operation::Read(&mut value)])?;
        let [value] = value;
        Ok(value)
    }

    fn transfer(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), CameraFault> {
        self.bus.transaction(operations).map_err(|_| CameraFault::PictureBus)
    }
}
