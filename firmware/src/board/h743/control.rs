//! A control bus: the chip's I2C, and its two wires moved by hand when a sensor holds them.

use crate::camera::control::{self, ControlBus};
use core::convert::Infallible;
use embassy_stm32::i2c::{Error, I2c, Master};
use embassy_stm32::mode::Blocking;
use embassy_stm32::pac;
use embassy_stm32::pac::gpio::vals::Moder;
use embassy_time::Delay;
use embedded_hal::digital::{self, InputPin, OutputPin};
use embedded_hal::i2c::{self, Operation};

/// A wire: a pin that the bus has made an open drain with a resistor to the supply.
pub(super) struct Wire {
    port: pac::gpio::Gpio,
    pin: u32,
}

impl Wire {
    pub(super) const fn new(port: pac::gpio::Gpio, pin: u32) -> Self {
        Self { port, pin }
    }

    /// Whose the pin is from now on.
    fn give_to(&self, mode: Moder) {
        let at = 2 * self.pin;
        self.port.moder().modify(|modes| modes.0 = modes.0 & !(3 << at) | u32::from(mode.to_bits()) << at);
    }

    fn drive(&self, bit: u32) {
        self.port.bsrr().write(|bits| bits.0 = 1 << bit);
    }
}

impl digital::ErrorType for Wire {
    type Error = Infallible;
}

impl OutputPin for Wire {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.drive(self.pin + 16);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.drive(self.pin);
        Ok(())
    }
}

impl InputPin for Wire {
    fn is_high(&mut self) -> Result<bool, Infallible> {
        Ok(self.port.idr().read().0 >> self.pin & 1 == 1)
    }

    fn is_low(&mut self) -> Result<bool, Infallible> {
        Ok(!self.is_high()?)
    }
}

/// A control bus with one sensor on it.
pub struct Control {
    bus: I2c<'static, Blocking, Master>,
    registers: pac::i2c::I2c,
    scl: Wire,
    sda: Wire,
}

impl Control {
    /// The bus, its registers, and the pins that it was given.
    pub(super) const fn new(
        bus: I2c<'static, Blocking, Master>,
        registers: pac::i2c::I2c,
        scl: Wire,
        sda: Wire,
    ) -> Self {
        Self { bus, registers, scl, sda }
    }
}

impl ControlBus for Control {
    fn clear(&mut self) {
        let Self { registers, scl, sda, .. } = self;
        // Switched off, the bus forgets a transfer that did not end.
        registers.cr1().modify(|bus| bus.set_pe(false));
        let Ok(()) = sda.set_high();
        let Ok(()) = scl.set_high();
        scl.give_to(Moder::OUTPUT);
        sda.give_to(Moder::OUTPUT);
        // Wires that stay held show in the next transfer.
        let Ok(_) = control::clear(scl, sda, &mut Delay);
        scl.give_to(Moder::ALTERNATE);
        sda.give_to(Moder::ALTERNATE);
        registers.cr1().modify(|bus| bus.set_pe(true));
    }
}

impl i2c::ErrorType for Control {
    type Error = Error;
}

/// What the sensors' protocol has of it goes the driver's own, shorter way.
impl i2c::I2c for Control {
    fn read(&mut self, address: u8, read: &mut [u8]) -> Result<(), Error> {
        self.bus.blocking_read(address, read)
    }

    fn write(&mut self, address: u8, write: &[u8]) -> Result<(), Error> {
        self.bus.blocking_write(address, write)
    }

    fn transaction(&mut self, address: u8, operations: &mut [Operation<'_>]) -> Result<(), Error> {
        self.bus.blocking_transaction(address, operations)
    }
}
