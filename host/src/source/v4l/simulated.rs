//! A camera that does what a script says, and is stricter than a real one: whoever reads from it before it
//! is started, or again after a stall without starting it anew, gets EINVAL, as the kernel has it.

use std::collections::VecDeque;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::time::Duration;

use super::device::{Device, Frame};
use super::errors::errno;
use super::format::{Format, FourCc};

/// What happens next.
#[derive(Clone, Debug)]
pub(crate) enum Event {
    /// A frame taken at so many milliseconds.
    Frame(u64, Vec<u8>),
    /// A frame that the driver calls broken.
    Broken,
    /// Nothing, for as long as anybody waits.
    Stall,
    /// A signal arrives while waiting.
    Signal,
    /// The system's error of this number.
    Error(i32),
    /// The next start fails by this number.
    RefuseStart(i32),
    /// It is unplugged, looked for in vain so often, and then found under this path.
    Unplugged(u32, &'static str),
}

impl Event {
    /// A frame of four by two equal pixels.
    pub(crate) fn frame(ms: u64, grey: u8) -> Self {
        Self::Frame(ms, vec![grey; 8])
    }
}

/// The camera. At the end of its script it is pulled out.
#[derive(Debug)]
pub(crate) struct Simulated {
    path: PathBuf,
    format: Format,
    script: VecDeque<Event>,
    running: bool,
    sequence: u32,
    /// Whether its driver tells the time.
    pub(crate) has_clock: bool,
    /// How often it was started.
    pub(crate) starts: u32,
    /// How often it was looked for.
    pub(crate) looks: u32,
    /// How long it was waited for in vain.
    pub(crate) waited: Duration,
    /// What it says of the time from frame to frame.
    pub(crate) period: Duration,
    /// Real time that each frame takes, and that passes until it is pulled out.
    pub(crate) pace: Duration,
}

impl Simulated {
    pub(crate) fn new(path: &str, format: Format, script: Vec<Event>) -> Self {
        Self {
            path: path.into(),
            format,
            script: script.into(),
            running: false,
            sequence: 0,
            has_clock: true,
            starts: 0,
            looks: 0,
            waited: Duration::ZERO,
            period: Duration::from_millis(40),
            pace: Duration::ZERO,
        }
    }

    /// A camera of four by two grey pixels.
    pub(crate) fn grey(path: &str, script: Vec<Event>) -> Self {
        Self::new(path, Format { code: FourCc(*b"GREY"), width: 4, height: 2, stride: 4 }, script)
    }

    fn is_unplugged(&self) -> bool {
        matches!(self.script.front(), Some(Event::Unplugged(..)))
    }

    fn frame(&mut self, ms: u64, bytes: Vec<u8>, broken: bool) -> Frame {
        std::thread::sleep(self.pace);
        self.sequence += 1;
        let arrived = Duration::from_millis(ms);
        Frame { bytes, taken: self.has_clock.then_some(arrived), arrived, sequence: self.sequence, broken }
    }
}

impl Device for Simulated {
    fn path(&self) -> &Path {
        &self.path
    }

    fn format(&self) -> Format {
        self.format
    }

    fn period(&self) -> Option<Duration> {
        Some(self.period)
    }

    fn start(&mut self) -> io::Result<()> {
        self.starts += 1;
        if self.is_unplugged() {
            return Err(io::Error::from_raw_os_error(errno::ENODEV));
        }
        if let Some(Event::RefuseStart(code)) = self.script.front() {
            let code = *code;
            self.script.pop_front();
            return Err(io::Error::from_raw_os_error(code));
        }
        self.running = true;
        Ok(())
    }

    fn next(&mut self, patience: Duration) -> io::Result<Frame> {
        if !self.running {
            return Err(io::Error::from_raw_os_error(errno::EINVAL));
        }
        if self.is_unplugged() {
            return Err(io::Error::from_raw_os_error(errno::ENODEV));
        }
        match self.script.pop_front() {
            Some(Event::Frame(ms, bytes)) => Ok(self.frame(ms, bytes, false)),
            Some(Event::Broken) => Ok(self.frame(0, Vec::new(), true)),
            Some(Event::Stall) => {
                self.running = false;
                self.waited += patience;
                Err(ErrorKind::TimedOut.into())
            }
            Some(Event::Signal) => {
                self.running = false;
                Err(ErrorKind::Interrupted.into())
            }
            Some(Event::Error(code) | Event::RefuseStart(code)) => Err(io::Error::from_raw_os_error(code)),
            Some(Event::Unplugged(..)) | None => {
                std::thread::sleep(self.pace);
                Err(io::Error::from_raw_os_error(errno::ENODEV))
            }
        }
    }

    fn find_again(&mut self) -> bool {
        self.running = false;
        self.looks += 1;
        match self.script.front_mut() {
            Some(Event::Unplugged(0, path)) => {
                self.path = (*path).into();
                self.script.pop_front();
                true
            }
            Some(Event::Unplugged(looks, _)) => {
                *looks -= 1;
                false
            }
            _ => false,
        }
    }
}
