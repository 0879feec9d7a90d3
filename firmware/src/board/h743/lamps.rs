//! Three lamps: green, yellow and red beside the blue button.

use embassy_stm32::Peri;
use embassy_stm32::gpio::{AnyPin, Level, Output, Speed};

/// What the board is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// Starting or testing itself: yellow.
    Starting,
    /// Waiting for the host: green.
    Ready,
    /// Taking or describing pictures: green and yellow.
    Working,
    /// Something does not work; the host and the log are told what: red.
    Faulty,
}

/// The lamps.
pub struct Lamps([Output<'static>; 3]);

impl Lamps {
    /// Green, yellow, red.
    pub(super) fn new(pins: [Peri<'static, AnyPin>; 3]) -> Self {
        let mut lamps = Self(pins.map(|pin| Output::new(pin, Level::Low, Speed::Low)));
        lamps.show(State::Starting);
        lamps
    }

    /// Show what the board is doing.
    pub fn show(&mut self, state: State) {
        let lit = match state {
            State::Starting => [false, true, false],
            State::Ready => [true, false, false],
            State::Working => [true, true, false],
            State::Faulty => [false, false, true],
        };
        for (lamp, lit) in self.0.iter_mut().zip(lit) {
            lamp.set_level(lit.into());
        }
    }
}
