//! CMSDK APB timer 0: 32 bits, counts down at 25 MHz of emulated time.

use super::register::Register;
use crate::stages::Counter;

const CONTROL: Register = Register::at(0x4000_0000);
const VALUE: Register = Register::at(0x4000_0004);
const RELOAD: Register = Register::at(0x4000_0008);

/// Instructions a tick when QEMU is told `-icount shift=3`: 8 ns an instruction, 40 ns a tick.
const INSTRUCTIONS: u32 = 5;

/// Counts instructions, in steps of five, when QEMU runs with `-icount shift=3,align=off,sleep=off`.
#[derive(Debug)]
pub struct Timer(());

impl Timer {
    pub(super) fn start() -> Self {
        RELOAD.write(u32::MAX);
        VALUE.write(u32::MAX);
        CONTROL.write(1);
        Self(())
    }
}

impl Counter for &Timer {
    fn count(&self) -> u32 {
        (u32::MAX - VALUE.read()).wrapping_mul(INSTRUCTIONS)
    }
}
