//! Three lamps: green, yellow and red beside the blue button.

use crate::device::Condition;
use embassy_stm32::Peri;
use embassy_stm32::gpio::{AnyPin, Level, Output, Speed};

/// The lamps.
pub struct Lamps([Output<'static>; 3]);

impl Lamps {
    /// Green, yellow, red.
    pub(super) fn new(pins: [Peri<'static, AnyPin>; 3]) -> Self {
        let mut lamps = Self(pins.map(|pin| Output::new(pin, Level::Low, Speed::Low)));
        lamps.show(Condition::Starting);
        lamps
    }

    /// Show how the device is: yellow while it starts, green when it is ready, both while it works, red when
    /// something does not.
    pub fn show(&mut self, condition: Condition) {
        let lit = match condition {
            Condition::Starting => [false, true, false],
            Condition::Ready => [true, false, false],
            Condition::Working => [true, true, false],
            Condition::Faulty => [false, false, true],
        };
        for (lamp, lit) in self.0.iter_mut().zip(lit) {
            lamp.set_level(lit.into());
        }
    }
}
