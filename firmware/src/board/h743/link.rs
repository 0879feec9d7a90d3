//! The host, on USB or behind ST-Link's virtual serial port: whichever has last said something is answered.

use super::usb;
use crate::ports::{self, LinkError};
use core::sync::atomic::Ordering;
use embassy_stm32::usart::BufferedUart;
use embassy_time::{Duration, Instant};
use embedded_io::{Read as _, Write as _};

/// A host that takes nothing for so long is gone.
const PATIENCE: Duration = Duration::from_secs(1);

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
        let count = self.serial.read(buffer).map_err(|_| LinkError::Overrun)?;
        if count > 0 {
            self.host = Host::Serial;
        }
        Ok(count)
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), LinkError> {
        match self.host {
            // A wire takes everything, in its own time.
            Host::Serial => self.serial.write_all(bytes).map_err(|_| LinkError::Closed),
            Host::Usb => send_usb(bytes),
        }
    }
}

fn send_usb(mut bytes: &[u8]) -> Result<(), LinkError> {
    let mut moved = Instant::now();
    while !bytes.is_empty() {
        if !usb::OPEN.load(Ordering::Relaxed) {
            return Err(LinkError::Closed);
        }
        if let Ok(count) = usb::OUTGOING.try_write(bytes) {
            (bytes, moved) = (bytes.get(count..).unwrap_or_default(), Instant::now());
        } else if moved.elapsed() > PATIENCE {
            return Err(LinkError::TimeLimit(PATIENCE.as_micros() as u32));
        }
    }
    Ok(())
}
