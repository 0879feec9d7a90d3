//! What happens when the processor stops the image: it ends, and says where.
#![expect(unsafe_code, reason = "the runtime wants handlers marked so")]

use cortex_m_rt::{ExceptionFrame, exception};
use semihosting::{eprintln, process::exit};

/// Exit code for a bad address or a bad instruction.
const FAULT: i32 = 70;

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    eprintln!("hard fault at {:#010x}", frame.pc());
    exit(FAULT)
}
