//! CMSDK APB UART 0: a byte at a time, no interrupts.

use super::register::Register;
use super::timer::{Clock, Timer};
use crate::ports::{self, LinkError};
use crate::send::send_within;

const DATA: Register = Register::at(0x4000_4000);
const STATE: Register = Register::at(0x4000_4004);
const CONTROL: Register = Register::at(0x4000_4008);
const DIVIDER: Register = Register::at(0x4000_4010);

const SEND_FULL: u32 = 1;
const RECEIVE_FULL: u32 = 2;

/// A host that takes longer over a frame is gone, us. Unlike a wire, a program may be busy or stopped.
const PATIENCE: u32 = 5_000_000;

/// The serial line.
#[derive(Debug)]
pub struct Uart(Clock);

impl Uart {
    pub(super) fn start(timer: Timer) -> Self {
        // The emulator takes any speed but none below 16.
        DIVIDER.write(16);
        CONTROL.write(SEND_FULL | RECEIVE_FULL);
        Self(Clock::new(timer))
    }
}

impl ports::Link for Uart {
    fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, LinkError> {
        let mut count = 0;
        for place in buffer {
            if STATE.read() & RECEIVE_FULL == 0 {
                break;
            }
            *place = DATA.read() as u8;
            count += 1;
        }
        Ok(count)
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), LinkError> {
        send_within(PATIENCE, &&self.0, bytes, |rest| match rest {
            [byte, ..] if STATE.read() & SEND_FULL == 0 => {
                DATA.write(u32::from(*byte));
                Ok(1)
            }
            _ => Ok(0),
        })
    }
}
