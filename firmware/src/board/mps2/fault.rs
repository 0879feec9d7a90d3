//! What happens when the processor stops the image: it ends, and says where; or waits for the watchdog's reset.
#![expect(unsafe_code, reason = "the runtime wants handlers marked so")]

use super::watchdog::bite;
use cortex_m::asm::wfi;
use cortex_m_rt::{ExceptionFrame, exception};
use semihosting::{eprintln, process::exit};

/// Exit code for a bad address or a bad instruction.
const FAULT: i32 = 70;

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    eprintln!("hard fault at {:#010x}", frame.pc());
    exit(FAULT)
}

/// The watchdog's, half way to the reset.
#[exception]
unsafe fn NonMaskableInt() -> ! {
    bite();
    loop {
        wfi();
    }
}
