//! CMSDK APB watchdog: counts down at 25 MHz of emulated time, interrupts at zero, and resets the board at zero
//! again. The boards do not say why they were reset, so the interrupt writes it down where a reset changes nothing.

use super::register::Register;
use super::timer::TICKS;
use crate::device::Birth;
use crate::ports;
use shared::wire::ResetReason;

const LOAD: Register = Register::at(0x4000_8000);
const CONTROL: Register = Register::at(0x4000_8008);
const CLEAR: Register = Register::at(0x4000_800C);

/// Two words at the end of memory, which the map leaves out (`megabytes.x`): [`BITTEN`] or anything else, and how
/// often so far.
const CAUSE: Register = Register::at(0x203F_FFF0);
const BITES: Register = Register::at(0x203F_FFF4);
/// The watchdog's mark, which memory is not found with when it is switched on.
const BITTEN: u32 = 0xB17E_0D06;

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

/// Write down that the watchdog is about to reset the board.
pub(super) fn bite() {
    CAUSE.write(BITTEN);
    BITES.write(BITES.read().saturating_add(1));
}

/// What is remembered of the time before the start; the reason is forgotten with this.
pub(super) fn recall(board: &'static str) -> Birth {
    let bitten = CAUSE.read() == BITTEN;
    CAUSE.write(0);
    if !bitten {
        BITES.write(0);
    }
    let reset = if bitten { ResetReason::Watchdog } else { ResetReason::Unknown };
    Birth { board, reset, watchdog_resets: BITES.read() }
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
