//! CMSDK APB UART 0: a byte at a time, no interrupts.

use super::register::Register;

const DATA: Register = Register::at(0x4000_4000);
const STATE: Register = Register::at(0x4000_4004);
const CONTROL: Register = Register::at(0x4000_4008);
const DIVIDER: Register = Register::at(0x4000_4010);

const SEND_FULL: u32 = 1;
const RECEIVE_FULL: u32 = 2;

/// The serial line.
#[derive(Debug)]
pub struct Uart(());

impl Uart {
    pub(super) fn start() -> Self {
        // The emulator takes any speed but none below 16.
        DIVIDER.write(16);
        CONTROL.write(SEND_FULL | RECEIVE_FULL);
        Self(())
    }

    /// Take bytes that have come; how many of `buffer`'s first they fill. Does not wait.
    pub fn receive(&mut self, buffer: &mut [u8]) -> usize {
        let mut count = 0;
        for place in buffer {
            if STATE.read() & RECEIVE_FULL == 0 {
                break;
            }
            *place = DATA.read() as u8;
            count += 1;
        }
        count
    }

    /// Send all bytes; waits until the last one is on its way.
    pub fn send(&mut self, bytes: &[u8]) {
        for byte in bytes {
            while STATE.read() & SEND_FULL != 0 {}
            DATA.write(u32::from(*byte));
        }
    }
}
