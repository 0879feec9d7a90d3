//! CMSDK APB timers 0 and 1: 32 bits, count down at 25 MHz of emulated time.

use super::register::Register;
use crate::ports;
use crate::stages::Counter;
use core::cell::Cell;

/// Ticks a microsecond.
pub(super) const TICKS: u64 = 25;
/// Instructions a tick when QEMU is told `-icount shift=3`: 8 ns an instruction, 40 ns a tick.
const INSTRUCTIONS: u32 = 5;

/// Counts instructions, in steps of five, when QEMU runs with `-icount shift=3,align=off,sleep=off`.
#[derive(Clone, Debug)]
pub struct Timer {
    value: Register,
}

impl Timer {
    /// The timer at an address of the board's documentation.
    pub(super) fn start(address: usize) -> Self {
        let [control, value, reload] = [0, 4, 8].map(|offset| Register::at(address + offset));
        reload.write(u32::MAX);
        value.write(u32::MAX);
        control.write(1);
        Self { value }
    }

    /// Ticks since the start; wraps around.
    pub(super) fn ticks(&self) -> u32 {
        u32::MAX - self.value.read()
    }
}

impl Counter for &Timer {
    fn count(&self) -> u32 {
        self.ticks().wrapping_mul(INSTRUCTIONS)
    }
}

/// Time since the start. Must be looked at once in 170 s, in which the timer wraps around.
#[derive(Debug)]
pub struct Clock {
    timer: Timer,
    ticks: Cell<u64>,
}

impl Clock {
    pub(super) const fn new(timer: Timer) -> Self {
        Self { timer, ticks: Cell::new(0) }
    }
}

impl ports::Clock for &Clock {
    fn micros(&self) -> u64 {
        let before = self.ticks.get();
        let passed = self.timer.ticks().wrapping_sub(before as u32);
        self.ticks.set(before + u64::from(passed));
        self.ticks.get() / TICKS
    }
}
