//! Commands: what the device does about them, each answered by its number.

use super::Device;
use super::calibration::{read_record, write_record};
use super::link::{MAX_COMMAND, Waiting};
use crate::ports::{Exposure, FlashError};
use shared::arena::Arena;
use shared::wire::{self, ErrorCode, ExposureSetting, ToDevice, WireError};

/// A unit of gain on the wire, 1/256, in those of an eye, 1/16.
const GAIN: u16 = 16;

/// What to answer to a frame that is no command.
fn blame(error: &WireError) -> ErrorCode {
    match error {
        WireError::Unknown { what: "command", .. } => ErrorCode::UnknownCommand,
        WireError::Version { .. } => ErrorCode::Version,
        WireError::Unknown { .. } | WireError::Calibration(_) => ErrorCode::OutOfRange,
        WireError::Short | WireError::Invalid(_) | WireError::Capacity(_) => ErrorCode::Malformed,
    }
}

/// The exposure that a host ordered, if both eyes can have it.
fn ordered([left, right]: [wire::Exposure; 2]) -> Result<Exposure, ErrorCode> {
    let gain = (left.gain.saturating_add(GAIN / 2)) / GAIN;
    let possible = Exposure::LINES.contains(&left.lines) && Exposure::GAIN.contains(&gain);
    // One order for both: eyes that see differently are not the same object's.
    if left == right && possible { Ok(Exposure::new(left.lines, gain)) } else { Err(ErrorCode::OutOfRange) }
}

/// How a picture was taken, as it is told.
pub(super) const fn told(exposure: Exposure) -> wire::Exposure {
    wire::Exposure { lines: exposure.lines(), gain: exposure.gain() * GAIN }
}

impl Device<'_> {
    /// Obey a command, and answer it or put off the answer until flash has done its part.
    pub(super) fn obey(&mut self, number: u16, command: Result<ToDevice, WireError>) {
        let result = match command {
            Ok(ToDevice::Hello) => return self.say_hello(),
            Ok(ToDevice::Health) => return self.say_health(),
            Ok(ToDevice::Calibration(model)) => {
                let written = self.calibration.check(&model).and_then(|()| {
                    write_record(&model, self.outbox.buffer()).map_err(|_| ErrorCode::Storage)
                });
                match written {
                    Ok(len) => return self.outbox.waiting = Waiting::Record(len, number),
                    Err(error) => Err(error),
                }
            }
            Ok(ToDevice::ForgetCalibration) => return self.outbox.waiting = Waiting::Record(0, number),
            Ok(ToDevice::Start) => self.start(),
            Ok(ToDevice::Stop) => {
                self.abandon();
                (self.orders.running, self.orders.grab) = (false, None);
                Ok(())
            }
            Ok(ToDevice::Grab(kind)) => self.grab(kind),
            Ok(ToDevice::Threshold(threshold)) => {
                self.orders.threshold = threshold;
                Ok(())
            }
            Ok(ToDevice::Polarity(polarity)) => {
                self.orders.polarity = polarity;
                Ok(())
            }
            Ok(ToDevice::Exposure(ExposureSetting::Auto)) => {
                self.control.fix(None);
                Ok(())
            }
            Ok(ToDevice::Exposure(ExposureSetting::Fixed(exposures))) => {
                ordered(exposures).map(|exposure| self.control.fix(Some(exposure)))
            }
            Err(error) => Err(blame(&error)),
        };
        self.outbox.answer(number, result);
    }

    fn start(&mut self) -> Result<(), ErrorCode> {
        self.calibration.optics().ok_or(ErrorCode::Uncalibrated)?;
        self.need_eyes()?;
        self.orders.running = true;
        Ok(())
    }

    fn grab(&mut self, kind: wire::PictureKind) -> Result<(), ErrorCode> {
        self.need_eyes()?;
        if self.orders.grab.is_some() {
            return Err(ErrorCode::Busy);
        }
        self.orders.grab = Some(kind);
        Ok(())
    }

    /// Eyes that are about to be started again after a fault will do.
    fn need_eyes(&self) -> Result<(), ErrorCode> {
        self.identities.map(|_| ()).ok_or(ErrorCode::Camera)
    }

    /// Flash has been read: use what lies there.
    pub(super) fn take_record(&mut self, result: Result<usize, FlashError>) {
        self.loaded = true;
        if result.is_err() || self.use_record(result.unwrap_or(0)).is_err() {
            self.count_storage_fault();
        }
    }

    /// Flash has been written: only now is the new calibration, or none, in use.
    pub(super) fn saved(&mut self, result: Result<(), FlashError>) {
        let Waiting::Record(len, number) = self.outbox.waiting else { return };
        let result = match result {
            Ok(()) => {
                // A pair is of one calibration.
                self.abandon();
                self.use_record(len)
            }
            Err(_) => {
                self.count_storage_fault();
                Err(ErrorCode::Storage)
            }
        };
        self.outbox.answer(number, result);
    }

    /// Use the record that lies in the buffer, of this length; without one, none.
    fn use_record(&mut self, len: usize) -> Result<(), ErrorCode> {
        let used = if len == 0 {
            self.calibration.forget();
            Ok(())
        } else {
            let record = self.outbox.buffer().get(..len).unwrap_or_default();
            let memory = Arena::new(self.memory.scratch).take(MAX_COMMAND, "bytes in a frame");
            let model = memory.ok().and_then(|memory| read_record(record, memory));
            model.ok_or(ErrorCode::Storage).and_then(|model| self.calibration.install(&model))
        };
        self.orders.running &= self.calibration.optics().is_some();
        used
    }

    fn count_storage_fault(&mut self) {
        self.health.storage_faults = self.health.storage_faults.saturating_add(1);
    }
}
