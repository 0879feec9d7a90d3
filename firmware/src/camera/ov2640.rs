//! The sensor OV2640 on its control bus.
//!
//! The bus is SCCB: I2C without repeated starts, so that a read is a write of the address and then a read of
//! its own. The sensor's address is fixed: two of them have a bus each, or share one. What is written to a
//! shared bus reaches both, and what is read is the AND of both; so both are written alike, one after the
//! other, and nothing here depends on which of them answers.

use super::control::ControlBus;
use super::registers::{
    BANK, BARS, Bank, COM7, PIXEL_CLOCK, PRODUCT_HIGH, PRODUCT_LOW, RESET, RESOLUTION, TABLE, Write, exposure,
};
use crate::ports::{CameraFault, Exposure};

/// Where every OV2640 answers, 7 bits.
pub const ADDRESS: u8 = 0x30;
/// Product numbers of the OV2640.
pub const PRODUCTS: [u16; 2] = [0x2641, 0x2642];
/// How long a reset takes, ms.
pub const RESET_MS: u32 = 100;
/// Frames that a change takes to be seen, as time: two of the slowest, ms.
pub const SETTLE_MS: u32 = 150;

/// A sensor.
#[derive(Debug)]
pub struct Sensor<I> {
    bus: I,
}

impl<I: ControlBus> Sensor<I> {
    /// The sensor behind a bus.
    pub const fn new(bus: I) -> Self {
        Self { bus }
    }

    /// Free the bus, which a transfer that did not end may hold.
    pub fn free(&mut self) {
        self.bus.clear();
    }

    /// Its product number.
    ///
    /// # Errors
    /// A silent bus; another sensor.
    pub fn identify(&mut self) -> Result<u16, CameraFault> {
        self.choose(Bank::Sensor)?;
        let product = u16::from_be_bytes([self.register(PRODUCT_HIGH)?, self.register(PRODUCT_LOW)?]);
        if PRODUCTS.contains(&product) { Ok(product) } else { Err(CameraFault::Identity(product)) }
    }

    /// Forget everything; deaf for [`RESET_MS`].
    ///
    /// # Errors
    /// A silent bus.
    pub fn reset(&mut self) -> Result<(), CameraFault> {
        self.choose(Bank::Sensor)?;
        self.write((COM7, RESET))
    }

    /// From a reset to pictures of QVGA YUV422; they need an exposure too.
    ///
    /// # Errors
    /// A silent bus; a register that does not keep its value.
    pub fn set_up(&mut self) -> Result<(), CameraFault> {
        for &(bank, writes) in TABLE {
            self.choose(bank)?;
            writes.iter().try_for_each(|&write| self.set(write))?;
        }
        Ok(())
    }

    /// Fix exposure and gain; pictures have them after [`SETTLE_MS`].
    ///
    /// # Errors
    /// A silent bus; a register that does not keep its value.
    pub fn expose(&mut self, order: Exposure) -> Result<(), CameraFault> {
        self.choose(Bank::Sensor)?;
        exposure(order).into_iter().try_for_each(|write| self.set(write))
    }

    /// Show colour bars, or what is seen; pictures do after [`SETTLE_MS`].
    ///
    /// # Errors
    /// A silent bus; a register that does not keep its value.
    pub fn show_bars(&mut self, on: bool) -> Result<(), CameraFault> {
        self.choose(Bank::Sensor)?;
        self.set((COM7, RESOLUTION | if on { BARS } else { 0 }))
    }

    fn choose(&mut self, bank: Bank) -> Result<(), CameraFault> {
        self.write((BANK, bank as u8))
    }

    /// Write a register and see that it keeps its value: a picture does not tell every one that is lost.
    fn set(&mut self, (address, value): Write) -> Result<(), CameraFault> {
        self.write((address, value))?;
        let read = self.register(address)?;
        let kept = read == value || address == PIXEL_CLOCK;
        if kept { Ok(()) } else { Err(CameraFault::Register { address, read }) }
    }

    fn write(&mut self, (address, value): Write) -> Result<(), CameraFault> {
        self.bus.write(ADDRESS, &[address, value]).map_err(|_| CameraFault::ControlBus)
    }

    fn register(&mut self, address: u8) -> Result<u8, CameraFault> {
        let mut value = [0];
        self.bus.write(ADDRESS, &[address]).map_err(|_| CameraFault::ControlBus)?;
        self.bus.read(ADDRESS, &mut value).map_err(|_| CameraFault::ControlBus)?;
        let [value] = value;
        Ok(value)
    }
}
