//! Emulated boards: QEMU's mps2-an386 (Cortex-M4F) and mps2-an500 (Cortex-M7), which share a memory map, so
//! that one image runs on both. Files, arguments and exit codes go through semihosting: the `semihosting`
//! crate, whose panic handler says why and exits with 101.

mod eyes;
mod fault;
mod files;
mod flash;
mod register;
mod timer;
mod uart;
mod watchdog;

pub use eyes::Eyes;
pub use files::{argument, refuse};
pub use flash::Flash;
pub use timer::{Clock, Timer};
pub use uart::Uart;
pub use watchdog::Watchdog;

use crate::device::Birth;
use crate::record::Record;
use cortex_m::Peripherals;

/// What a board has.
#[derive(Debug)]
pub struct Board {
    /// The serial line.
    pub uart: Uart,
    /// Time.
    pub clock: Clock,
    /// Counts instructions.
    pub timer: Timer,
    /// Keeps a calibration.
    pub flash: Record<Flash>,
    /// Resets the board when it hangs.
    pub watchdog: Watchdog,
    /// Its name, why it has started, and how often it hung.
    pub birth: Birth,
}

impl Board {
    /// The board, the first time it is asked for.
    pub fn take() -> Option<Self> {
        Peripherals::take()?;
        let time = Timer::start(0x4000_1000);
        Some(Self {
            uart: Uart::start(time.clone()),
            clock: Clock::new(time),
            timer: Timer::start(0x4000_0000),
            flash: Record::new(Flash::new(), 0),
            watchdog: Watchdog::new(),
            birth: watchdog::recall("emulated MPS2"),
        })
    }
}
