//! The independent watchdog: its oscillator runs whatever happens to the rest.

use crate::ports;
use embassy_stm32::pac::IWDG1;
use embassy_stm32::pac::iwdg::vals::{Key, Pr};

/// Longer than any picture, any erasure of flash and any run of the core, s.
const PATIENCE: u16 = 10;
/// Of its oscillator's 32 kHz, divided by 256, in a second.
const TICKS: u16 = 125;

/// Resets the board unless it is fed every ten seconds; before the first meal it waits for half a minute.
pub struct Watchdog(());

impl Watchdog {
    /// It runs from now on.
    pub(super) fn start() -> Self {
        IWDG1.kr().write(|order| order.set_key(Key::START));
        IWDG1.kr().write(|order| order.set_key(Key::ENABLE));
        IWDG1.pr().write(|divider| divider.set_pr(Pr::DIVIDE_BY256));
        // Counted down from after the next meal; until then, from the most that there is.
        IWDG1.rlr().write(|start| start.set_rl(PATIENCE * TICKS));
        Self(())
    }
}

impl ports::Watchdog for Watchdog {
    fn feed(&mut self) {
        IWDG1.kr().write(|order| order.set_key(Key::RESET));
    }
}
