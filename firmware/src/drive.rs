//! The carrier: takes the device's actions to the ports and tells it what came of them. A board, an emulator
//! and a test on a PC run this very loop; only the ports differ.

use crate::device::{Action, Device, Event};
use crate::ports::{CameraPair, Clock, Flash, Link, Watchdog};

/// All that a device reaches.
#[derive(Debug)]
pub struct Ports<C, L, K, F, W> {
    /// Its eyes.
    pub cameras: C,
    /// Its host.
    pub link: L,
    /// Its time.
    pub clock: K,
    /// Where its calibration outlives a loss of power.
    pub flash: F,
    /// What resets it when it hangs.
    pub watchdog: W,
}

/// Whether a board may sleep for a moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[must_use]
pub enum Pace {
    /// There is more to do at once.
    Busy,
    /// Nothing to do until bytes or some milliseconds have come.
    Idle,
}

/// Let the device do its next thing.
pub fn step<C: CameraPair, L: Link, K: Clock, F: Flash, W: Watchdog>(
    device: &mut Device<'_>,
    ports: &mut Ports<C, L, K, F, W>,
) -> Pace {
    let Ports { cameras, link, clock, flash, watchdog } = ports;
    watchdog.feed();
    let event = match device.next(clock.micros()) {
        Action::Load(buffer) => Event::Loaded(flash.load(buffer)),
        Action::Save(record) => Event::Saved(flash.save(record)),
        Action::Receive(buffer) => Event::Received(link.receive(buffer)),
        Action::Send(frame) => Event::Sent(link.send(frame)),
        Action::Start(exposure) => Event::Started(cameras.start(exposure)),
        Action::Expose(exposure) => Event::Exposed(cameras.expose(exposure)),
        Action::Capture => Event::Captured(cameras.capture()),
        Action::Read(side) => Event::Read(cameras.read(side, &mut |row, luma| device.line(row, luma))),
        Action::Continue => return Pace::Busy,
        Action::Rest => return Pace::Idle,
    };
    device.report(event, clock.micros());
    Pace::Busy
}
