//! Two ArduCAM Mini 2MP Plus modules as their buses see them, stricter than the chips.
//!
//! What a chip would silently get wrong panics here and so fails the test: a register that does not exist or
//! cannot be written, the wrong bank, a repeated start, a table without a reset before it, a reset not waited
//! for, a burst without its command, data fetched before they are there or after they ended, a capture begun
//! twice. What can break in the field is ordered by the fields of [`ArduChip`] and [`Sensor`].
//!
//! The model shares nothing with the driver but the traits of the clock and of the control bus. It has its own time: bytes on a bus
//! and delays take what they would take.

mod arduchip;
mod ov2640;

pub use arduchip::{ArduChip, Dummy};
pub use ov2640::Sensor;

use embedded_hal::delay::DelayNs;
use embedded_hal::i2c::{self, I2c, NoAcknowledgeSource};
use embedded_hal::spi::{self, Mode, Operation, SpiDevice};
use firmware::camera::control;
use firmware::ports::Clock;
use std::cell::{Cell, RefCell};
use std::rc::Rc;

/// Columns and rows of the pictures that are fed, px.
pub const SIZE: (usize, usize) = (320, 240);

/// Luma in front of an eye, row by row, as it is seen with 300 lines of exposure and a gain of 1.
pub type Scene = Vec<u8>;

/// The time of a bench, ns.
#[derive(Clone, Debug, Default)]
pub struct Time(Rc<Cell<u64>>);

impl Time {
    fn now(&self) -> u64 {
        self.0.get()
    }

    fn pass(&self, ns: u64) {
        self.0.set(self.now() + ns);
    }
}

impl DelayNs for Time {
    fn delay_ns(&mut self, ns: u32) {
        self.pass(ns.into());
    }
}

impl Clock for Time {
    fn micros(&self) -> u64 {
        self.now() / 1000
    }
}

/// How the modules are wired.
#[derive(Clone, Copy, Debug)]
pub struct Wiring {
    /// Clock of the picture bus, Hz.
    pub hz: u32,
    /// Mode of the picture bus.
    pub mode: Mode,
    /// Whether both sensors are on one control bus.
    pub shared_control: bool,
}

impl Default for Wiring {
    fn default() -> Self {
        Self { hz: 4_000_000, mode: spi::MODE_0, shared_control: false }
    }
}

/// Both modules, left and right, and their time.
#[derive(Debug)]
pub struct Bench {
    /// The chips that keep frames.
    pub chips: [Rc<RefCell<ArduChip>>; 2],
    /// The sensors.
    pub sensors: [Rc<RefCell<Sensor>>; 2],
    /// The time.
    pub time: Time,
    wiring: Wiring,
}

impl Bench {
    /// Two modules just powered, before two scenes.
    pub fn new(wiring: Wiring, scenes: [Scene; 2]) -> Self {
        let time = Time::default();
        // The right sensor starts its frames 7.3 ms after the left one.
        let mut phases = [0, 7_300_000].into_iter();
        let sensors = scenes.map(|scene| {
            Rc::new(RefCell::new(Sensor::new(time.clone(), scene, phases.next().unwrap_or_default())))
        });
        let chips = sensors.clone().map(|s| Rc::new(RefCell::new(ArduChip::new(time.clone(), s))));
        Self { chips, sensors, time, wiring }
    }

    /// The picture bus of the left (0) or right (1) module.
    pub fn picture_bus(&self, eye: usize) -> PictureBus {
        PictureBus { chip: self.chips[eye].clone(), time: self.time.clone(), wiring: self.wiring }
    }

    /// The control bus of the left (0) or right (1) module.
    pub fn control_bus(&self, eye: usize) -> ControlBus {
        let own = eye..eye + 1;
        let sensors = if self.wiring.shared_control { &self.sensors[..] } else { &self.sensors[own] };
        ControlBus { sensors: sensors.to_vec(), time: self.time.clone() }
    }
}

/// SPI with one chip on it.
#[derive(Debug)]
pub struct PictureBus {
    chip: Rc<RefCell<ArduChip>>,
    time: Time,
    wiring: Wiring,
}

impl PictureBus {
    fn exchange(&self, sent: u8) -> u8 {
        self.time.pass(8_000_000_000 / u64::from(self.wiring.hz));
        if self.wiring.mode != spi::MODE_0 {
            // Clocked on the wrong edge, nothing that the chip hears is a command.
            return 0xFF;
        }
        let mut chip = self.chip.borrow_mut();
        let answer = chip.exchange(sent);
        let too_fast = if self.wiring.hz > 8_000_000 { 100_000 } else { 0 };
        chip.disturb(answer, too_fast)
    }
}

impl spi::ErrorType for PictureBus {
    type Error = spi::ErrorKind;
}

impl SpiDevice for PictureBus {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Self::Error> {
        if self.chip.borrow_mut().is_broken() {
            return Err(spi::ErrorKind::Other);
        }
        let begins = !matches!(operations.first(), Some(Operation::Read(_)));
        assert!(begins, "a transaction begins with its command, not with reading");
        // Selecting and releasing the chip.
        self.time.pass(1000);
        for operation in operations {
            match operation {
                Operation::Write(bytes) => {
                    for &byte in *bytes {
                        self.exchange(byte);
                    }
                }
                Operation::Read(bytes) => bytes.iter_mut().for_each(|b| *b = self.exchange(0)),
                Operation::TransferInPlace(bytes) => bytes.iter_mut().for_each(|b| *b = self.exchange(*b)),
                Operation::Transfer(read, write) => {
                    for i in 0..read.len().max(write.len()) {
                        let answer = self.exchange(write.get(i).copied().unwrap_or_default());
                        if let Some(byte) = read.get_mut(i) {
                            *byte = answer;
                        }
                    }
                }
                Operation::DelayNs(ns) => self.time.pass(u64::from(*ns)),
            }
        }
        if self.wiring.mode == spi::MODE_0 {
            self.chip.borrow_mut().release();
        }
        Ok(())
    }
}

/// How long a board tries to begin a transfer on wires that are held, ns.
const HELD_NS: u64 = 1_000_000_000;

/// SCCB with one or two sensors on it, at 100 kHz.
#[derive(Debug)]
pub struct ControlBus {
    sensors: Vec<Rc<RefCell<Sensor>>>,
    time: Time,
}

impl i2c::ErrorType for ControlBus {
    type Error = i2c::ErrorKind;
}

impl I2c for ControlBus {
    fn transaction(&mut self, address: u8, operations: &mut [i2c::Operation<'_>]) -> Result<(), Self::Error> {
        let [operation] = operations else { panic!("a repeated start, which SCCB does not know") };
        let bytes = match operation {
            i2c::Operation::Write(bytes) => bytes.len(),
            i2c::Operation::Read(bytes) => bytes.len(),
        };
        if self.sensors.iter().any(|sensor| sensor.borrow().holds > 0) {
            self.time.pass(HELD_NS);
            return Err(i2c::ErrorKind::Bus);
        }
        self.time.pass(90_000 * (1 + bytes as u64));
        let answering = |sensor: &&Rc<RefCell<Sensor>>| address == 0x30 && !sensor.borrow().deaf;
        let sensors: Vec<_> = self.sensors.iter().filter(answering).collect();
        if sensors.is_empty() {
            return Err(i2c::ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address));
        }
        match operation {
            i2c::Operation::Write(bytes) => sensors.iter().for_each(|s| s.borrow_mut().write(bytes)),
            i2c::Operation::Read(bytes) => {
                let [byte] = &mut bytes[..] else { panic!("SCCB reads one byte at a time") };
                *byte = sensors.iter().fold(0xFF, |all, s| all & s.borrow_mut().read());
            }
        }
        Ok(())
    }
}

impl control::ControlBus for ControlBus {
    fn clear(&mut self) {
        // Ten clocks.
        self.time.pass(100_000);
        for sensor in &self.sensors {
            let holds = &mut sensor.borrow_mut().holds;
            *holds = holds.saturating_sub(1);
        }
    }
}
