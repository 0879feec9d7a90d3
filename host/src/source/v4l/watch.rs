//! A device that is kept going: a stalled one is started anew, and frames that its driver calls broken are
//! left out. Both are counted.

use std::io::ErrorKind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use super::device::{Device, Frame};
use super::errors::{CameraError, Doing};

/// The least time that a frame is waited for: an exposure in the dark takes some tenths of a second. A camera
/// that is pulled out meanwhile is noticed when it is started anew, so within two seconds.
const PATIENCE: Duration = Duration::from_secs(1);
/// Or so many periods, for slow cameras.
const PERIODS: u32 = 4;
/// Starts in a row without a frame after which a camera is given up.
const MOST_STARTS: u32 = 5;

/// A device and what has happened to it.
#[derive(Debug)]
pub(super) struct Watched<D> {
    pub(super) device: D,
    /// How often it had to be started anew.
    pub(super) stalls: u64,
    /// Frames that its driver called broken.
    pub(super) broken: u64,
    running: bool,
}

impl<D: Device> Watched<D> {
    pub(super) fn new(device: D) -> Self {
        Self { device, stalls: 0, broken: 0, running: false }
    }

    /// The next good frame; nothing once `stop` is set.
    pub(super) fn next(&mut self, stop: &AtomicBool) -> Result<Option<Frame>, CameraError> {
        let patience = PATIENCE.max(PERIODS * self.device.period().unwrap_or_default());
        let mut silent = 0;
        while !stop.load(Ordering::Relaxed) {
            if !self.running {
                self.device.start().map_err(|error| self.refused(Doing::Start, &error))?;
                self.running = true;
            }
            match self.device.next(patience) {
                Ok(frame) if frame.broken => self.broken += 1,
                Ok(frame) => return Ok(Some(frame)),
                Err(error) if error.kind() == ErrorKind::Interrupted => self.running = false,
                Err(error) if error.kind() == ErrorKind::TimedOut && error.raw_os_error().is_none() => {
                    self.running = false;
                    self.stalls += 1;
                    silent += 1;
                    if silent == MOST_STARTS {
                        let path = self.device.path().into();
                        return Err(CameraError::Silent { path, waited: silent * patience, times: silent });
                    }
                }
                Err(error) => return Err(self.refused(Doing::Read, &error)),
            }
        }
        Ok(None)
    }

    fn refused(&self, doing: Doing, error: &std::io::Error) -> CameraError {
        CameraError::system(self.device.path(), doing, error)
    }
}

#[cfg(test)]
mod tests {
    use super::super::errors::errno;
    use super::super::simulated::{Event, Simulated};
    use super::*;

    fn watched(script: Vec<Event>) -> Watched<Simulated> {
        Watched::new(Simulated::grey("/dev/video0", script))
    }

    static GO: AtomicBool = AtomicBool::new(false);

    #[test]
    fn a_stalled_camera_is_started_anew_and_counted() {
        let mut camera = watched(vec![Event::frame(0, 1), Event::Stall, Event::Stall, Event::frame(100, 2)]);
        assert_eq!(camera.next(&GO).unwrap().unwrap().bytes[0], 1);
        assert_eq!(camera.next(&GO).unwrap().unwrap().bytes[0], 2);
        assert_eq!((camera.stalls, camera.device.starts), (2, 3));
    }

    #[test]
    fn a_silent_camera_is_given_up() {
        let mut camera = watched(vec![Event::Stall; 9]);
        let error = camera.next(&GO).unwrap_err().to_string();
        assert!(error.contains("no frame for 5 s") && error.contains("started 5 times"), "{error}");
    }

    #[test]
    fn a_camera_pulled_out_is_an_error_at_once_even_while_it_stalls() {
        for script in
            [vec![Event::Error(errno::ENODEV)], vec![Event::Stall, Event::RefuseStart(errno::ENODEV)]]
        {
            let mut camera = watched(script);
            let error = camera.next(&GO).unwrap_err().to_string();
            assert!(error.contains("unplugged"), "{error}");
            // One patience at most was spent before.
            assert!(camera.device.waited <= PATIENCE);
        }
    }

    #[test]
    fn signals_cost_nothing_and_broken_frames_are_left_out() {
        let mut camera = watched(vec![Event::Signal, Event::Broken, Event::frame(0, 7)]);
        assert_eq!(camera.next(&GO).unwrap().unwrap().bytes[0], 7);
        assert_eq!((camera.stalls, camera.broken), (0, 1));
    }

    #[test]
    fn a_start_without_bandwidth_says_what_to_do() {
        let mut camera = watched(vec![Event::RefuseStart(errno::ENOSPC)]);
        let error = camera.next(&GO).unwrap_err().to_string();
        assert!(error.contains("bandwidth") && error.contains("MJPG"), "{error}");
    }

    #[test]
    fn nothing_comes_after_the_stop() {
        let mut camera = watched(vec![Event::frame(0, 1)]);
        assert_eq!(camera.next(&AtomicBool::new(true)).unwrap(), None);
        assert_eq!(camera.device.starts, 0);
    }
}
