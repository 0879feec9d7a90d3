//! The device: what a camera pair with a core and a link says and does (docs/device.md). No I/O: it is asked
//! for its next [`Action`], which somebody carries out ([`drive`](crate::drive)) and reports as an [`Event`].
//!
//! ```text
//! flash -> calibration -> tables, optics            bytes -> command -> answer
//!                            |                                  |
//! exposure -> capture -> left picture -> mask, contour          v
//!    ^                -> right picture -> mask, contour -> skeleton, pair -> one frame
//!    '--- histograms <--'
//! ```
//!
//! * **One thing at a time**: a frame that waits to be sent goes before all else, then what the host says,
//!   then a step of the pair under way. Between any two actions the link is listened to.
//! * **Bounds**: nothing is allocated and nothing waits; one step of the core is the longest that a call of
//!   [`Device::next`] takes.
//! * **Whatever happens** is counted, told and gone on from: any bytes, any fault of any port, reports that
//!   nobody asked for.

mod action;
mod calibration;
mod command;
pub mod exposure;
mod link;
mod pair;

pub use action::{Action, Event};

use crate::memory::Storage;
use crate::ports::{CameraFault, Exposure, Identity, Side};
use calibration::Calibration;
use exposure::Control;
use link::{Inbox, MAX_COMMAND, Outbox, Waiting};
use pair::{Job, Meter};
use shared::bitmap::Size;
use shared::pipeline::Memory;
use shared::stage::binarise::{Polarity, Threshold};
use shared::stage::warp::{Place, knots};
use shared::wire::{Capacities, Health, Hello, MAX_FRAME, PictureKind, ResetReason, ToHost};

/// From one unasked report of health to the next, us.
pub const HEALTH_US: u64 = 10_000_000;
/// From a failed start of the eyes to the next try, us.
pub const RETRY_US: u64 = 2_000_000;
/// Faults in a row after which the eyes are started again, whatever the faults were.
pub const PATIENCE: u32 = 3;

/// What a board knows when it boots.
#[derive(Clone, Copy, Debug)]
pub struct Birth {
    /// Name of the board, at most [`MAX_BOARD`](shared::wire::MAX_BOARD) bytes.
    pub board: &'static str,
    /// Why it started.
    pub reset: ResetReason,
    /// Times that the watchdog bit since it was switched on.
    pub watchdog_resets: u32,
}

/// What a device needs beside the core's memory; `KNOTS` is [`knots`] of the pictures' size.
#[derive(Debug)]
pub struct Desk<const KNOTS: usize> {
    tables: [[Place; KNOTS]; 2],
    command: [u8; MAX_COMMAND],
    out: [u8; MAX_FRAME],
}

impl<const KNOTS: usize> Desk<KNOTS> {
    /// An empty desk.
    #[expect(clippy::new_without_default, reason = "a default value would be built on the stack")]
    pub const fn new() -> Self {
        Self { tables: [[[0; 2]; KNOTS]; 2], command: [0; MAX_COMMAND], out: [0; MAX_FRAME] }
    }
}

/// How the eyes stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Eyes {
    /// They run, with this exposure, after so many faults in a row.
    Up { exposure: Exposure, faults: u32 },
    /// They are to be started at this time, us.
    Down { due: u64 },
}

/// What lamps can show of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Condition {
    /// It has not said hello yet.
    Starting,
    /// It waits for its host.
    Ready,
    /// It takes or describes pictures.
    Working,
    /// An eye does not answer; it is tried again and again.
    Faulty,
}

/// What the host ordered.
#[derive(Clone, Copy, Debug, Default)]
struct Orders {
    running: bool,
    grab: Option<PictureKind>,
    threshold: Threshold,
    polarity: Polarity,
}

/// Decided, not yet dressed as an action.
#[derive(Clone, Copy)]
enum Decision {
    Load,
    Out,
    Receive,
    Start,
    Expose,
    Capture,
    Read(Side),
    Rest,
}

/// The device.
pub struct Device<'m> {
    birth: Birth,
    size: Size,
    memory: Memory<'m>,
    calibration: Calibration<'m>,
    inbox: Inbox<'m>,
    /// Whether the link is to be listened to before anything else is done.
    listen: bool,
    outbox: Outbox<'m>,
    loaded: bool,
    greeted: bool,
    now: u64,
    eyes: Eyes,
    /// What the eyes said that they are, unless their last start failed.
    identities: Option<[Identity; 2]>,
    starts: u32,
    control: Control,
    orders: Orders,
    meter: Meter,
    job: Option<Job>,
    pairs_begun: u32,
    health: Health,
    health_due: u64,
}

impl<'m> Device<'m> {
    /// A device that has just booted. Its pictures have the size of the storage.
    pub fn new<S: Storage, const KNOTS: usize>(
        storage: &'m mut S,
        desk: &'m mut Desk<KNOTS>,
        birth: Birth,
    ) -> Self {
        const { assert!(KNOTS >= knots(S::CAPACITIES.size), "the desk's tables are of smaller pictures") };
        let size = S::CAPACITIES.size;
        let Desk { tables: [left, right], command, out } = desk;
        Self {
            birth,
            size,
            memory: storage.lend(),
            calibration: Calibration::none(size, [left, right]),
            inbox: Inbox::new(command),
            listen: true,
            outbox: Outbox::new(out),
            loaded: false,
            greeted: false,
            now: 0,
            eyes: Eyes::Down { due: 0 },
            identities: None,
            starts: 0,
            control: Control::default(),
            orders: Orders::default(),
            meter: Meter::new(),
            job: None,
            pairs_begun: 0,
            health: Health { watchdog_resets: birth.watchdog_resets, ..Health::default() },
            health_due: HEALTH_US,
        }
    }

    /// What to do now, at this time, us.
    pub fn next(&mut self, now: u64) -> Action<'_> {
        self.now = now;
        match self.decide() {
            Decision::Load => Action::Load(self.outbox.buffer()),
            Decision::Out => match self.outbox.waiting {
                Waiting::Nothing => Action::Continue,
                Waiting::Frame(len) => Action::Send(self.outbox.first(len)),
                Waiting::Record(len, _) => Action::Save(self.outbox.first(len)),
            },
            Decision::Receive => {
                self.listen = false;
                Action::Receive(self.inbox.buffer())
            }
            Decision::Start => Action::Start(self.control.exposure()),
            Decision::Expose => Action::Expose(self.control.exposure()),
            Decision::Capture => Action::Capture,
            Decision::Read(side) => Action::Read(side),
            Decision::Rest => Action::Rest,
        }
    }

    /// How it stands.
    pub fn condition(&self) -> Condition {
        let wanted = self.orders.running || self.orders.grab.is_some() || self.job.is_some();
        match self.identities {
            _ if !self.greeted => Condition::Starting,
            None => Condition::Faulty,
            Some(_) if wanted => Condition::Working,
            Some(_) => Condition::Ready,
        }
    }

    fn decide(&mut self) -> Decision {
        if !self.loaded {
            return Decision::Load;
        }
        if self.outbox.waiting != Waiting::Nothing {
            return Decision::Out;
        }
        // Nothing is said before hello, and that tells what the eyes are.
        if self.starts == 0 {
            return Decision::Start;
        }
        if !self.greeted {
            self.greeted = true;
            self.say_hello();
            return Decision::Out;
        }
        if let Some((number, command)) = self.inbox.command() {
            self.obey(number, command);
            return Decision::Out;
        }
        if self.listen {
            return Decision::Receive;
        }
        self.listen = true;
        if let Eyes::Down { due } = self.eyes
            && due <= self.now
        {
            return Decision::Start;
        }
        if self.now >= self.health_due {
            self.say_health();
            return Decision::Out;
        }
        self.go_on()
    }

    /// Take in what came of an action, at this time, us.
    pub fn report(&mut self, event: Event, now: u64) {
        self.now = now;
        match event {
            Event::Loaded(result) => self.take_record(result),
            Event::Saved(result) => self.saved(result),
            Event::Received(result) => {
                // Lost bytes show as damaged frames.
                let count = result.unwrap_or(0);
                self.inbox.fill(count);
                self.listen = count > 0;
            }
            Event::Sent(result) => {
                self.outbox.waiting = Waiting::Nothing;
                if result.is_err() {
                    // Whoever misses a part of a picture asks for it again; the rest is of no use.
                    if let Some(Job { grab: grab @ Some(_), .. }) = &mut self.job {
                        *grab = None;
                        self.abandon();
                    }
                }
            }
            Event::Started(Ok(identities)) => {
                self.count_start();
                self.identities = Some(identities);
                self.eyes = Eyes::Up { exposure: self.control.exposure(), faults: 0 };
            }
            Event::Started(Err(_)) => {
                self.count_start();
                self.identities = None;
                self.eyes = Eyes::Down { due: now.saturating_add(RETRY_US) };
            }
            Event::Exposed(Ok(())) => {
                if let Eyes::Up { exposure, .. } = &mut self.eyes {
                    *exposure = self.control.exposure();
                }
            }
            Event::Exposed(Err(_)) => self.stop_eyes(),
            Event::Captured(Ok(stamps)) => self.captured(stamps),
            Event::Read(Ok(())) => self.read(),
            Event::Captured(Err(error)) | Event::Read(Err(error)) => self.fault(error.fault),
        }
    }

    fn count_start(&mut self) {
        self.health.restarts = self.starts;
        self.starts = self.starts.saturating_add(1);
    }

    /// Let go of the pair under way, if there is one: no pair that was begun ends in another way than here or by
    /// its conclusion. Pictures asked for are the next one's.
    fn abandon(&mut self) {
        let Some(job) = self.job.take() else { return };
        self.health.dropped = self.health.dropped.saturating_add(1);
        self.orders.grab = self.orders.grab.or(job.grab);
    }

    /// Let the eyes be started again.
    fn stop_eyes(&mut self) {
        self.abandon();
        self.eyes = Eyes::Down { due: self.now };
    }

    /// A pair is lost.
    fn fault(&mut self, fault: CameraFault) {
        self.abandon();
        let late = matches!(fault, CameraFault::TimeLimit(_));
        self.health.timeouts = self.health.timeouts.saturating_add(late.into());
        let hopeless = late || fault == CameraFault::NotStarted;
        if let Eyes::Up { faults, .. } = &mut self.eyes {
            *faults += 1;
            if hopeless || *faults >= PATIENCE {
                self.stop_eyes();
            }
        }
    }

    fn say_hello(&mut self) {
        const fn number(text: &str) -> u16 {
            match u16::from_str_radix(text, 10) {
                Ok(number) => number,
                Err(_) => 0,
            }
        }
        let count = |capacity: usize| u16::try_from(capacity).unwrap_or(u16::MAX);
        let eye = &self.memory.eyes[0];
        self.outbox.say(&ToHost::Hello(Hello {
            firmware: const {
                [
                    number(env!("CARGO_PKG_VERSION_MAJOR")),
                    number(env!("CARGO_PKG_VERSION_MINOR")),
                    number(env!("CARGO_PKG_VERSION_PATCH")),
                ]
            },
            board: self.birth.board,
            sensors: self.identities.map_or([0; 2], |eyes| eyes.map(|eye| eye.sensor.into())),
            picture: [count(self.size.width), count(self.size.height)],
            capacities: Capacities {
                contour: count(eye.contour.capacity()),
                branches: count(eye.branches.capacity()),
                controls: count(eye.controls.capacity()),
            },
            reset: self.birth.reset,
            calibration: self.calibration.crc(),
        }));
    }

    fn say_health(&mut self) {
        self.health_due = self.now.saturating_add(HEALTH_US);
        let link = self.inbox.counters();
        self.outbox.say(&ToHost::Health(Health {
            uptime: self.now / 1000,
            rejected_bytes: link.rejected_bytes,
            rejected_frames: link.rejected_frames(),
            ..self.health
        }));
    }
}

// On the boards themselves.
#[cfg(target_pointer_width = "32")]
const _: () = {
    const QVGA: usize = knots(<crate::memory::Qvga as Storage>::CAPACITIES.size);
    assert!(
        size_of::<Device<'_>>() + size_of::<Desk<QVGA>>() <= 14 * 1024,
        "the core's memory and the drivers need the rest of 400 KB of variables"
    );
};
