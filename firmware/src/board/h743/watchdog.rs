//! The independent watchdog: its oscillator runs whatever happens to the rest.

use crate::ports;
use embassy_stm32::Peri;
use embassy_stm32::peripherals::IWDG1;
use embassy_stm32::wdg::IndependentWatchdog;

/// Longer than any picture, any erasure of flash and any run of the core, us.
const PATIENCE: u32 = 10_000_000;

/// Resets the board unless it is fed every ten seconds; starts with the first meal.
pub struct Watchdog {
    inner: IndependentWatchdog<'static, IWDG1>,
    started: bool,
}

impl Watchdog {
    pub(super) fn new(peripheral: Peri<'static, IWDG1>) -> Self {
        Self { inner: IndependentWatchdog::new(peripheral, PATIENCE), started: false }
    }
}

impl ports::Watchdog for Watchdog {
    fn feed(&mut self) {
        if self.started {
            self.inner.pet();
        } else {
            self.inner.unleash();
            self.started = true;
        }
    }
}
