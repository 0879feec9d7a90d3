//! What a camera has to do for the rest of this folder: start, and hand over frames.

use std::io;
use std::path::Path;
use std::sync::LazyLock;
use std::time::{Duration, Instant};

use super::format::Format;

/// One frame as it came.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frame {
    /// The bytes that the driver filled.
    pub bytes: Vec<u8>,
    /// When it was taken, by the system's monotonic clock, if the driver says so by that clock.
    pub taken: Option<Duration>,
    /// When it was handed over; see [`now`].
    pub arrived: Duration,
    /// The driver's count of frames, with those that it lost.
    pub sequence: u32,
    /// Whether the driver knows the bytes to be broken.
    pub broken: bool,
}

/// A device that gives frames.
pub trait Device {
    /// What the user calls it.
    fn path(&self) -> &Path;

    /// How its frames look.
    fn format(&self) -> Format;

    /// Time from frame to frame, if it says.
    fn period(&self) -> Option<Duration>;

    /// Starts to send, or stops and starts anew: what was waiting is lost.
    ///
    /// # Errors
    ///
    /// The system's, with its number.
    fn start(&mut self) -> io::Result<()>;

    /// The next frame, waited for at most so long.
    ///
    /// # Errors
    ///
    /// [`io::ErrorKind::TimedOut`] if none came in time and [`io::ErrorKind::Interrupted`] if a signal came
    /// first, after both of which the device has to be started anew; else the system's, with its number.
    fn next(&mut self, patience: Duration) -> io::Result<Frame>;

    /// Lets go of a device that was unplugged and looks for it wherever it may have been plugged in again. If it is
    /// there, it is set as it was and has to be started; its path may be another.
    fn find_again(&mut self) -> bool;
}

/// Time since some moment that is the same for all devices.
#[must_use]
pub fn now() -> Duration {
    static START: LazyLock<Instant> = LazyLock::new(Instant::now);
    START.elapsed()
}
