//! Frames that belong together.
//!
//! One camera whose frames hold both eyes gives a pair a frame. Two cameras run on clocks of their own:
//! a left and a right frame are a pair if they were taken less than half a period apart, by the system's
//! monotonic clock, or by the time of their arrival if a driver does not tell; else the older one has no
//! partner any more, is dropped and counted. The period is that of the slower camera: what it says, or what it
//! takes, which in the dark is longer.

use std::collections::VecDeque;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use super::device::{Device, Frame};
use super::errors::CameraError;
use super::watch::{Wait, Watched};

/// The period until a camera has shown or said its own.
const USUAL_PERIOD: Duration = Duration::from_millis(33);
/// Intervals by which a camera shows its period.
const INTERVALS: usize = 8;
/// Frames without partner in a row after which cameras are told to run apart.
const MOST_ALONE: u64 = 300;

/// Frames of one moment.
#[derive(Clone, Debug, PartialEq)]
pub struct Shot {
    /// One that holds both eyes, or the left and the right one.
    pub frames: Vec<Frame>,
    /// Right less left time, seconds, if there are two.
    pub gap: Option<f64>,
}

/// What did not become a pair.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Losses {
    /// Restarts of stalled cameras.
    pub stalls: u64,
    /// Frames that a driver called broken.
    pub broken: u64,
    /// Frames of one camera without one of the other.
    pub unpaired: u64,
    /// Times that a camera was unplugged and came back.
    pub returns: u64,
}

/// One camera, or two.
#[derive(Debug)]
pub struct Pairs<D> {
    /// The camera of both eyes, or of the left one.
    first: Eye<D>,
    right: Option<Eye<D>>,
    unpaired: u64,
}

/// A camera and its pace.
#[derive(Debug)]
struct Eye<D> {
    camera: Watched<D>,
    /// Time of the last frame.
    last: Option<Duration>,
    /// What it took from frame to frame, the latest last.
    intervals: VecDeque<Duration>,
}

impl<D: Device> Eye<D> {
    fn of(device: D) -> Self {
        Self { camera: Watched::new(device), last: None, intervals: VecDeque::new() }
    }

    fn next(&mut self, stop: &AtomicBool) -> Result<Option<Frame>, CameraError> {
        let frame = self.camera.next(stop)?;
        frame.iter().for_each(|frame| self.saw(frame));
        Ok(frame)
    }

    /// What it says, or if that is longer, the shortest of its last intervals: some are longer by lost frames.
    fn period(&self) -> Option<Duration> {
        let shown = self.intervals.iter().min().filter(|_| self.intervals.len() == INTERVALS);
        shown.copied().max(self.camera.device.period())
    }

    /// Takes note of a frame.
    fn saw(&mut self, frame: &Frame) {
        let now = frame.taken.unwrap_or(frame.arrived);
        let interval = self.last.replace(now).and_then(|last| now.checked_sub(last));
        if self.intervals.len() == INTERVALS {
            self.intervals.pop_front();
        }
        self.intervals.extend(interval);
    }
}

impl<D: Device> Pairs<D> {
    /// Pairs of a camera that sees with both eyes, or of a left and a right one.
    pub fn of(first: D, right: Option<D>) -> Self {
        Self { first: Eye::of(first), right: right.map(Eye::of), unpaired: 0 }
    }

    /// The same, of cameras that are waited for when they are unplugged.
    #[must_use]
    pub fn waiting(mut self, wait: Wait) -> Self {
        for eye in [Some(&mut self.first), self.right.as_mut()].into_iter().flatten() {
            eye.camera.wait = wait;
        }
        self
    }

    /// The camera, or the left one.
    pub fn path(&self) -> &Path {
        self.first.camera.device.path()
    }

    /// What was lost so far.
    pub fn losses(&self) -> Losses {
        let cameras =
            || [Some(&self.first), self.right.as_ref()].into_iter().flatten().map(|eye| &eye.camera);
        Losses {
            stalls: cameras().map(|camera| camera.stalls).sum(),
            broken: cameras().map(|camera| camera.broken).sum(),
            unpaired: self.unpaired,
            returns: cameras().map(|camera| camera.returns).sum(),
        }
    }

    /// The next pair; nothing once `stop` is set.
    ///
    /// # Errors
    ///
    /// What is wrong with a camera, or that two never meet.
    pub fn next(&mut self, stop: &AtomicBool) -> Result<Option<Shot>, CameraError> {
        let Some(mut left) = self.first.next(stop)? else { return Ok(None) };
        let Some(second) = &mut self.right else { return Ok(Some(Shot { frames: vec![left], gap: None })) };
        let Some(mut right) = second.next(stop)? else { return Ok(None) };
        for _ in 0..MOST_ALONE {
            let gap = gap(&left, &right);
            let period = self.first.period().max(second.period()).unwrap_or(USUAL_PERIOD);
            if gap.abs() <= period.as_secs_f64() / 2.0 {
                return Ok(Some(Shot { frames: vec![left, right], gap: Some(gap) }));
            }
            self.unpaired += 1;
            let (eye, older) =
                if gap > 0.0 { (&mut self.first, &mut left) } else { (&mut *second, &mut right) };
            let Some(next) = eye.next(stop)? else { return Ok(None) };
            *older = next;
        }
        let paths = [&self.first, &*second].map(|eye| eye.camera.device.path().to_path_buf());
        Err(CameraError::Apart { paths, frames: MOST_ALONE })
    }
}

/// Right less left time, seconds.
fn gap(left: &Frame, right: &Frame) -> f64 {
    let (left, right) = match (left.taken, right.taken) {
        (Some(left), Some(right)) => (left, right),
        _ => (left.arrived, right.arrived),
    };
    right.as_secs_f64() - left.as_secs_f64()
}

#[cfg(test)]
mod tests {
    use super::super::errors::errno;
    use super::super::simulated::{Event, Simulated};
    use super::*;

    static GO: AtomicBool = AtomicBool::new(false);

    fn eye(path: &str, times: &[u64]) -> Simulated {
        let frames = times.iter().enumerate().map(|(number, ms)| Event::frame(*ms, number as u8));
        Simulated::grey(path, frames.collect())
    }

    /// Numbers of the frames that were paired, gaps in ms, and how many had no partner.
    fn paired(left: &[u64], right: &[u64]) -> (Vec<(u8, u8, i64)>, u64) {
        let mut pairs = Pairs::of(eye("left", left), Some(eye("right", right)));
        let mut all = Vec::new();
        while let Ok(Some(shot)) = pairs.next(&GO) {
            let [left, right] = [0, 1].map(|eye| shot.frames[eye].bytes[0]);
            all.push((left, right, (shot.gap.unwrap() * 1e3).round() as i64));
        }
        (all, pairs.losses().unpaired)
    }

    #[test]
    fn frames_less_than_half_a_period_apart_are_pairs() {
        let (all, alone) = paired(&[0, 40, 80], &[15, 55, 95]);
        assert_eq!((all, alone), (vec![(0, 0, 15), (1, 1, 15), (2, 2, 15)], 0));
        // A camera that was started later, and lags.
        let (all, alone) = paired(&[0, 40, 80, 120], &[75, 115, 155]);
        assert_eq!((all, alone), (vec![(2, 0, -5), (3, 1, -5)], 2));
    }

    #[test]
    fn a_lost_frame_costs_its_partner_alone() {
        let (all, alone) = paired(&[0, 40, 80, 120], &[0, 80, 120]);
        assert_eq!((all, alone), (vec![(0, 0, 0), (2, 1, 0), (3, 2, 0)], 1));
    }

    #[test]
    fn a_slow_camera_gets_the_nearest_frame_of_a_fast_one() {
        let (all, _) = paired(&[0, 100, 200, 300], &[0, 40, 80, 120, 160, 200, 240, 280, 320]);
        assert!(all.len() >= 3 && all.iter().all(|(_, _, gap)| gap.abs() <= 50), "{all:?}");
    }

    #[test]
    fn a_camera_in_the_dark_shows_its_real_period() {
        // It says 40 ms and takes 80, and the other one is 35 behind.
        let left: Vec<u64> = (0..20).map(|n| 80 * n).collect();
        let right: Vec<u64> = left.iter().map(|ms| ms + 35).collect();
        let (all, alone) = paired(&left, &right);
        assert!(all.len() >= 10 && all.iter().all(|(l, r, gap)| l == r && *gap == 35), "{all:?}");
        assert!(alone <= 20, "{alone}");
    }

    #[test]
    fn without_a_clock_the_arrival_counts() {
        let mut left = eye("left", &[0]);
        left.has_clock = false;
        let shot = Pairs::of(left, Some(eye("right", &[7]))).next(&GO).unwrap().unwrap();
        assert_eq!(shot.gap, Some(0.007));
    }

    #[test]
    fn cameras_that_never_meet_say_so() {
        let left: Vec<u64> = (0..200).map(|n| 40 * n).collect();
        let right: Vec<u64> = left.iter().map(|ms| ms + 1_000_000_000).collect();
        let script = |times: &[u64]| times.iter().map(|ms| Event::frame(*ms, 0)).collect::<Vec<_>>();
        let left = [script(&left), script(&left)].concat();
        let mut pairs = Pairs::of(Simulated::grey("a", left), Some(Simulated::grey("b", script(&right))));
        let error = pairs.next(&GO).unwrap_err().to_string();
        assert!(error.contains("a and b") && error.contains("same --fps"), "{error}");
    }

    #[test]
    fn one_frame_of_both_eyes_is_a_pair_and_losses_are_counted() {
        let script = vec![Event::Stall, Event::Broken, Event::frame(0, 9), Event::Error(errno::ENODEV)];
        let mut pairs = Pairs::of(Simulated::grey("a", script), None);
        let shot = pairs.next(&GO).unwrap().unwrap();
        assert_eq!((shot.frames.len(), shot.gap), (1, None));
        assert_eq!(pairs.losses(), Losses { stalls: 1, broken: 1, ..Losses::default() });
        assert!(pairs.next(&GO).unwrap_err().to_string().contains("unplugged"));
    }
}
