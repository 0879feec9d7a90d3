//! The host, on USB or behind ST-Link's virtual serial port: whichever has last said something is answered.

use super::{Clock, usb};
use crate::ports::{self, LinkError};
use crate::send::send_within;
use core::sync::atomic::Ordering;
use embassy_stm32::interrupt::{self, InterruptExt as _};
use embassy_stm32::usart::BufferedUart;
use embedded_io::{Read as _, Write as _};

/// A host that takes longer over a frame is gone, us.
const PATIENCE: u32 = 1_000_000;

#[derive(Clone, Copy, Debug)]
enum Host {
    Serial,
    Usb,
}

/// Bytes to and from the host.
pub struct Link {
    serial: BufferedUart<'static>,
    host: Host,
}

impl Link {
    pub(super) const fn new(serial: BufferedUart<'static>) -> Self {
        Self { serial, host: Host::Serial }
    }
}

impl ports::Link for Link {
    fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, LinkError> {
        if let Ok(count) = usb::INCOMING.try_read(buffer) {
            self.host = Host::Usb;
            return Ok(count);
        }
        // Of embassy-stm32 0.6.0, which does not wait here but returns 0 when nothing has come; `embedded_io` would let
        // it wait, and a later version may.
        let count = self.serial.read(buffer).map_err(|_| LinkError::Overrun)?;
        if count > 0 {
            self.host = Host::Serial;
        }
        Ok(count)
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), LinkError> {
        match self.host {
            // A wire takes everything, in its own time.
            Host::Serial => {
                let sent = self.serial.write_all(bytes).map_err(|_| LinkError::Closed);
                // The driver wakes its interrupt if it finds nothing under way; what it finds may end while it copies.
                interrupt::USART3.pend();
                sent
            }
            Host::Usb => send_within(PATIENCE, &Clock, bytes, |rest| {
                if !usb::OPEN.load(Ordering::Relaxed) {
                    return Err(LinkError::Closed);
                }
                Ok(usb::OUTGOING.try_write(rest).unwrap_or(0))
            }),
        }
    }
}
