//! A device that is kept going: a stalled one is started anew, frames that its driver calls broken are left out, and
//! one that was unplugged is waited for. All are counted.

use std::io::ErrorKind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use super::device::{Device, Frame};
use super::errors::{CameraError, Doing, is_gone};

/// How long a frame is waited for beyond a period: an exposure in the dark takes some tenths of a second. A camera
/// that is pulled out meanwhile is noticed when it is started anew, so within two seconds, or if it sends less than a
/// frame a second, within a period and a second.
const PATIENCE: Duration = Duration::from_secs(1);
/// Starts in a row without a frame after which a camera is given up.
const MOST_STARTS: u32 = 5;
/// From one look for a camera that was unplugged to the next.
const LOOK_AGAIN: Duration = Duration::from_millis(250);

/// Whether a camera that was unplugged is waited for.
#[derive(Clone, Copy, Debug)]
pub struct Wait {
    /// How long at most.
    pub most: Duration,
    /// Who hears that it is gone, and that it is back.
    pub tell: fn(&str),
}

impl Wait {
    /// It is not.
    pub const NOT: Self = Self { most: Duration::ZERO, tell: |_| () };
}

/// A device and what has happened to it.
#[derive(Debug)]
pub(super) struct Watched<D> {
    pub(super) device: D,
    /// How often it had to be started anew.
    pub(super) stalls: u64,
    /// Frames that its driver called broken.
    pub(super) broken: u64,
    /// How often it was unplugged and found again.
    pub(super) returns: u64,
    pub(super) wait: Wait,
    running: bool,
}

impl<D: Device> Watched<D> {
    pub(super) fn new(device: D) -> Self {
        Self { device, stalls: 0, broken: 0, returns: 0, wait: Wait::NOT, running: false }
    }

    /// The next good frame; nothing once `stop` is set.
    pub(super) fn next(&mut self, stop: &AtomicBool) -> Result<Option<Frame>, CameraError> {
        let patience = PATIENCE + self.device.period().unwrap_or_default();
        let mut silent = 0;
        while !stop.load(Ordering::Relaxed) {
            if !self.running {
                if let Err(error) = self.device.start() {
                    self.survive(Doing::Start, &error, stop)?;
                    continue;
                }
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
                Err(error) => self.survive(Doing::Read, &error, stop)?,
            }
        }
        Ok(None)
    }

    /// Waits for a camera that was unplugged until it is back or `stop` is set. What else is wrong with it, or that it
    /// stays away, is an error.
    fn survive(
        &mut self,
        doing: Doing,
        error: &std::io::Error,
        stop: &AtomicBool,
    ) -> Result<(), CameraError> {
        let refused = CameraError::system(self.device.path(), doing, error);
        if self.wait.most.is_zero() || !error.raw_os_error().is_some_and(is_gone) {
            return Err(refused);
        }
        self.running = false;
        let (path, gone) = (self.device.path().display().to_string(), Instant::now());
        let mut told = false;
        while !stop.load(Ordering::Relaxed) {
            thread::sleep(LOOK_AGAIN);
            if self.device.find_again() {
                self.returns += 1;
                (self.wait.tell)(&format!("{path} is back as {}", self.device.path().display()));
                return Ok(());
            }
            if !told {
                let most = self.wait.most.as_secs();
                (self.wait.tell)(&format!("{path} has been unplugged; waiting for it, {most} s at most"));
                told = true;
            }
            if gone.elapsed() >= self.wait.most {
                return Err(refused);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::errors::errno;
    use super::super::simulated::{Event, Simulated};
    use super::*;
    use std::path::Path;

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
    fn a_camera_pulled_out_is_an_error_within_two_seconds_or_a_period_and_one_even_while_it_stalls() {
        for period in [33, 200, 1000, 5000].map(Duration::from_millis) {
            let silent = vec![Event::Stall, Event::RefuseStart(errno::ENODEV)];
            for (script, most) in
                [(vec![Event::Error(errno::ENODEV)], Duration::ZERO), (silent, PATIENCE + period)]
            {
                let mut camera = watched(script);
                camera.device.period = period;
                let error = camera.next(&GO).unwrap_err().to_string();
                assert!(error.contains("unplugged"), "{error}");
                assert!(camera.device.waited <= most, "{period:?}: {:?}", camera.device.waited);
            }
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
    fn a_camera_that_comes_back_under_another_node_goes_on() {
        let away = Event::Unplugged(2, "/dev/video4");
        let mut camera =
            watched(vec![Event::frame(0, 1), away.clone(), Event::frame(40, 2), away, Event::frame(80, 3)]);
        camera.wait.most = Duration::from_secs(60);
        for grey in 1..=3 {
            assert_eq!(camera.next(&GO).unwrap().unwrap().bytes[0], grey);
        }
        assert_eq!((camera.returns, camera.device.starts), (2, 3));
        assert_eq!(camera.device.path(), Path::new("/dev/video4"));
    }

    #[test]
    fn a_camera_that_stays_away_is_given_up_and_one_that_fails_is_not_looked_for() {
        for (code, looks) in [(errno::ENODEV, 1..100), (errno::EIO, 0..1)] {
            let mut camera = watched(vec![Event::Error(code)]);
            camera.wait.most = Duration::from_millis(300);
            let begun = Instant::now();
            let error = camera.next(&GO).unwrap_err().to_string();
            assert!(error.starts_with("/dev/video0 does not hand over a frame"), "{error}");
            assert!(looks.contains(&camera.device.looks), "{} looks", camera.device.looks);
            // A busy machine is slow.
            assert!(begun.elapsed() < Duration::from_secs(60) && camera.returns == 0);
        }
    }

    #[test]
    fn a_stop_ends_the_waiting() {
        static STOP: AtomicBool = AtomicBool::new(false);
        let mut camera = watched(Vec::new());
        // Whoever hears that it is gone stops.
        camera.wait = Wait { most: Duration::from_secs(60), tell: |_| STOP.store(true, Ordering::Relaxed) };
        assert_eq!(camera.next(&STOP).unwrap(), None);
    }

    #[test]
    fn nothing_comes_after_the_stop() {
        let mut camera = watched(vec![Event::frame(0, 1)]);
        assert_eq!(camera.next(&AtomicBool::new(true)).unwrap(), None);
        assert_eq!(camera.device.starts, 0);
    }
}
