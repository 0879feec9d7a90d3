//! CMSDK APB watchdog: counts down at 25 MHz of emulated time, interrupts at zero, and resets the board at zero
//! again.

use super::register::Register;
use super::timer::TICKS;
use crate::ports;

const LOAD: Register = Register::at(0x4000_8000);
const CONTROL: Register = Register::at(0x4000_8008);
const CLEAR: Register = Register::at(0x4000_800C);

const COUNT: u32 = 1;
const RESET: u32 = 2;

/// Half of the time that a board may hang, us: the PC may be busy with other things than to emulate.
const HALF: u32 = 30_000_000;

/// Resets the board unless it is fed every minute, the second half of which the processor stands in the
/// interrupt; starts with the first meal.
#[derive(Debug)]
pub struct Watchdog {
    started: bool,
}

impl Watchdog {
    pub(super) const fn new() -> Self {
        Self { started: false }
    }
}

impl ports::Watchdog for Watchdog {
    fn feed(&mut self) {
        if self.started {
            CLEAR.write(1);
        } else {
            LOAD.write(HALF * TICKS as u32);
            CONTROL.write(COUNT | RESET);
            self.started = true;
        }
    }
}
