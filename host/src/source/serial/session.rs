//! A session with a device: greeted, told what to do, listened to, and waited for when it is gone.

use std::collections::VecDeque;
use std::thread;
use std::time::{Duration, Instant};

use shared::limits::CapacityError;
use shared::wire::{Counters, ErrorCode, Health, ToDevice, VERSION, WireError};

use super::inbox::{Hello, Inbox, Message};
use super::link::{Arrived, Link, LinkError, Tap};
use super::port::{Port, PortError};

/// How long a device may take to say hello.
pub const GREETING: Duration = Duration::from_secs(5);
/// From one hello to the next.
const HELLO_AGAIN: Duration = Duration::from_millis(500);
/// How long it may take to answer a command, which it may have to hear again: a pair may be under way.
const ANSWER: Duration = Duration::from_secs(12);
/// From one command to its repetition.
const COMMAND_AGAIN: Duration = Duration::from_secs(3);
/// How long its cameras may take to start.
pub const CAMERAS: Duration = Duration::from_secs(15);
/// From one look for a device that is gone to the next.
const LOOK_AGAIN: Duration = Duration::from_millis(500);
/// Silence after which a device is taken for gone: it tells its health every 10 s.
const SILENCE: Duration = Duration::from_secs(60);

/// Why a session cannot go on.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// There is no port.
    #[error(transparent)]
    Port(#[from] PortError),
    /// The connection ended.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// Nobody says hello.
    #[error("{}", silent(*.0))]
    Silent(
        /// Bytes that came instead.
        u64,
    ),
    /// It says hello in another version of the format.
    #[error(transparent)]
    Version(WireError),
    /// It does not know our version.
    #[error(
        "the device does not speak version {VERSION} of the wire format, which is this program's; bring host and \
         firmware to the same release"
    )]
    Foreign,
    /// It did not obey.
    #[error("the device refuses: {}", words(.0))]
    Refused(ErrorCode),
    /// It did not answer.
    #[error("the device does not answer; reset it, and look at the cable")]
    Unanswered,
    /// It has not been heard of.
    #[error("nothing came for {} s", SILENCE.as_secs())]
    Quiet,
    /// There is no memory for shapes.
    #[error(transparent)]
    Memory(#[from] CapacityError),
}

fn silent(bytes: u64) -> String {
    match bytes {
        0 => "nothing answers; check that the firmware runs, and that the port is the device's".into(),
        bytes => format!(
            "nothing answers, but {bytes} bytes came that are no hello; check --baud, and that the port is the \
             device's"
        ),
    }
}

const fn words(code: &ErrorCode) -> &'static str {
    match code {
        ErrorCode::UnknownCommand => "its firmware does not know this command; update it",
        ErrorCode::Malformed => "the command was not understood; bring host and firmware to the same release",
        ErrorCode::Version => {
            "it speaks another version of the wire format; bring host and firmware to the same release"
        }
        ErrorCode::OutOfRange => {
            "it cannot do that; the values are outside its range, or of pictures of another size"
        }
        ErrorCode::Busy => "it is busy with a command before; try again",
        ErrorCode::Storage => {
            "its memory for the calibration failed; try again, and replace the board if that does not help"
        }
        ErrorCode::Camera => "one of its cameras does not answer; look at their cables",
        ErrorCode::Uncalibrated => "it keeps no calibration; upload one with `host device calibrate FILE`",
    }
}

impl SessionError {
    /// Whether the device may come back.
    #[must_use]
    pub const fn is_loss(&self) -> bool {
        matches!(self, Self::Link(LinkError::Lost(_)) | Self::Quiet | Self::Unanswered | Self::Silent(_))
    }
}

/// How a port is opened, again and again.
pub type Opener = Box<dyn FnMut() -> Result<Port, PortError>>;

/// What came over all connections of a session.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Of frames.
    pub frames: Counters,
    /// Frames that are no message.
    pub unreadable: u32,
    /// Times that the device was gone and came back.
    pub reconnections: u32,
}

impl Tally {
    /// Add what came over a connection that ended.
    pub fn add(&mut self, more: &Counters) {
        let Counters { frames, bad_crc, oversize, malformed, partial, missing, repeated, rejected_bytes } =
            &mut self.frames;
        for (sum, more) in [
            (frames, more.frames),
            (bad_crc, more.bad_crc),
            (oversize, more.oversize),
            (malformed, more.malformed),
            (partial, more.partial),
            (missing, more.missing),
            (repeated, more.repeated),
            (rejected_bytes, more.rejected_bytes),
        ] {
            *sum = sum.saturating_add(more);
        }
    }
}

/// A session.
pub struct Session {
    open: Opener,
    tap: Option<Tap>,
    /// None while the device is gone: a port is let go before it is opened again.
    link: Option<Link>,
    /// Frames that came while something else was waited for.
    waiting: VecDeque<Arrived>,
    inbox: Inbox,
    tally: Tally,
    heard: Instant,
}

impl Session {
    /// Open the port and exchange hellos.
    ///
    /// # Errors
    /// A [`SessionError`] that says what to do.
    pub fn begin(mut open: Opener, tap: Option<Tap>) -> Result<(Self, Hello), SessionError> {
        let link = Some(Link::new(open()?, tap.clone())?);
        let (inbox, heard) = (Inbox::new()?, Instant::now());
        let (waiting, tally) = (VecDeque::new(), Tally::default());
        let mut session = Self { open, tap, link, waiting, inbox, tally, heard };
        let hello = session.greet()?;
        Ok((session, hello))
    }

    /// Wait for a device that is gone, until `over`, and exchange hellos again; nothing if it stays away. `tell`
    /// hears why the port cannot be opened, once each time that the reason changes.
    ///
    /// # Errors
    /// A [`SessionError`] other than that it is gone.
    pub fn resume(
        &mut self,
        over: impl Fn() -> bool,
        mut tell: impl FnMut(&PortError),
    ) -> Result<Option<Hello>, SessionError> {
        let mut told = String::new();
        loop {
            if let Some(link) = self.link.take() {
                self.tally.add(&link.counters());
            }
            if over() {
                return Ok(None);
            }
            thread::sleep(LOOK_AGAIN);
            let port = match (self.open)() {
                Ok(port) => port,
                Err(error) => {
                    let words = error.to_string();
                    if words != told {
                        tell(&error);
                        told = words;
                    }
                    continue;
                }
            };
            self.link = Some(Link::new(port, self.tap.clone())?);
            match self.greet() {
                Ok(hello) => {
                    self.tally.reconnections = self.tally.reconnections.saturating_add(1);
                    return Ok(Some(hello));
                }
                Err(error) if error.is_loss() => {}
                Err(error) => return Err(error),
            }
        }
    }

    fn link(&mut self) -> Result<&mut Link, LinkError> {
        self.link.as_mut().ok_or(LinkError::Lost(None))
    }

    /// Say hello until the device does.
    fn greet(&mut self) -> Result<Hello, SessionError> {
        let end = Instant::now() + GREETING;
        self.waiting.clear();
        while Instant::now() < end {
            let number = self.link()?.send(&ToDevice::Hello)?;
            let next = Instant::now() + HELLO_AGAIN;
            while let Some(frame) = self.link()?.receive(next.saturating_duration_since(Instant::now()))? {
                match self.inbox.read(&frame.frame()) {
                    Ok(Message::Hello(hello)) => {
                        self.heard = Instant::now();
                        return Ok(hello);
                    }
                    Ok(Message::Answer(answer))
                        if answer.command == number && answer.result == Err(ErrorCode::Version) =>
                    {
                        return Err(SessionError::Foreign);
                    }
                    Err(error @ WireError::Version { .. }) => return Err(SessionError::Version(error)),
                    _ => {}
                }
            }
        }
        Err(SessionError::Silent(self.link()?.bytes()))
    }

    /// Give an order, again if need be, until it is answered.
    ///
    /// # Errors
    /// When it is refused, not answered, or the device is gone.
    pub fn order(&mut self, command: &ToDevice) -> Result<(), SessionError> {
        let mut numbers = Vec::new();
        let answer = self.ask(command, |message, number| {
            numbers.push(number);
            match message {
                Message::Answer(answer) if numbers.contains(&answer.command) => Some(answer.result),
                _ => None,
            }
        })?;
        answer.map_err(SessionError::Refused)
    }

    /// Give an order for which the device needs its cameras, which may still be starting.
    ///
    /// # Errors
    /// As [`Self::order`].
    pub fn order_cameras(&mut self, command: &ToDevice) -> Result<(), SessionError> {
        let end = Instant::now() + CAMERAS;
        loop {
            match self.order(command) {
                Err(SessionError::Refused(ErrorCode::Camera)) if Instant::now() < end => {
                    thread::sleep(HELLO_AGAIN);
                }
                result => return result,
            }
        }
    }

    /// Ask the device once more who it is.
    ///
    /// # Errors
    /// When it does not answer or is gone.
    pub fn hello(&mut self) -> Result<Hello, SessionError> {
        self.ask(&ToDevice::Hello, |message, _| match message {
            Message::Hello(hello) => Some(hello.clone()),
            _ => None,
        })
    }

    /// Ask how the device fares.
    ///
    /// # Errors
    /// When it does not answer or is gone.
    pub fn health(&mut self) -> Result<Health, SessionError> {
        self.ask(&ToDevice::Health, |message, _| match message {
            Message::Health(health) => Some(*health),
            _ => None,
        })
    }

    /// Send a command until a message answers it; the other messages are kept. `answers` sees each message and
    /// the number of the command sent last.
    fn ask<T>(
        &mut self,
        command: &ToDevice,
        mut answers: impl FnMut(&Message, u16) -> Option<T>,
    ) -> Result<T, SessionError> {
        let end = Instant::now() + ANSWER;
        while Instant::now() < end {
            let number = self.link()?.send(command)?;
            let next = Instant::now() + COMMAND_AGAIN;
            while let Some(frame) = self.link()?.receive(next.saturating_duration_since(Instant::now()))? {
                self.heard = Instant::now();
                match self.inbox.read(&frame.frame()).ok().and_then(|message| answers(&message, number)) {
                    Some(answer) => return Ok(answer),
                    None => self.waiting.push_back(frame),
                }
            }
        }
        Err(SessionError::Unanswered)
    }

    /// The next message, if one comes within this time, and whether a device that has just started sent it as
    /// its first. What cannot be read is counted and passed over.
    ///
    /// # Errors
    /// When the device is gone.
    pub fn receive(&mut self, within: Duration) -> Result<Option<(Message, bool)>, SessionError> {
        let frame = match self.waiting.pop_front() {
            Some(frame) => Some(frame),
            None => self.link()?.receive(within)?,
        };
        let Some(frame) = frame else {
            return if self.heard.elapsed() < SILENCE { Ok(None) } else { Err(SessionError::Quiet) };
        };
        self.heard = Instant::now();
        match self.inbox.read(&frame.frame()) {
            Ok(message) => Ok(Some((message, frame.is_first()))),
            Err(_) => {
                self.tally.unreadable = self.tally.unreadable.saturating_add(1);
                Ok(None)
            }
        }
    }

    /// Where the shape of the last message stands.
    pub fn inbox(&mut self) -> &mut Inbox {
        &mut self.inbox
    }

    /// What came so far.
    #[must_use]
    pub fn tally(&self) -> Tally {
        let mut tally = self.tally;
        if let Some(link) = &self.link {
            tally.add(&link.counters());
        }
        tally
    }
}
