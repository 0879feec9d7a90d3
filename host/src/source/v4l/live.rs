//! The newest pair, for somebody who is slower than the camera.
//!
//! A thread reads the camera without pause and leaves each pair in one slot. A pair that nobody fetched before
//! the next one came is dropped and counted, so a busy consumer always gets a view of now and never builds a
//! queue. Grey values are made only of what is fetched.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

use super::super::Views;
use super::device::Device;
use super::errors::CameraError;
use super::format::{Format, FormatError, decode};
use super::layout::Layout;
use super::pair::{Losses, Pairs, Shot};

/// Frames in a row that cannot be read before a camera is given up.
const MOST_UNREADABLE: u32 = 30;

/// How frames become views.
#[derive(Clone, Debug)]
pub struct Optics {
    /// How the frames of each camera look.
    pub formats: Vec<Format>,
    /// Where the eyes are.
    pub layout: Layout,
    /// Whether left and right are exchanged.
    pub swap: bool,
}

/// A pair that was fetched.
#[derive(Debug)]
pub struct Live {
    /// Its images, and what the user should know about them.
    pub views: Views,
    /// Right less left time, seconds, of two cameras.
    pub gap: Option<f64>,
    /// When its last frame was handed over; see [`super::device::now`].
    pub arrived: Duration,
}

/// What became of all that a camera sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Pairs handed on.
    pub fetched: u64,
    /// Pairs that nobody had time for.
    pub dropped: u64,
    /// Frames that gave no image.
    pub unreadable: u64,
    /// Frames that a strict decoder stumbled over.
    pub damaged: u64,
    /// What did not become a pair.
    pub losses: Losses,
}

impl Optics {
    /// The views of a shot, and what is suspicious about them.
    ///
    /// # Errors
    ///
    /// If a frame gives no image.
    pub fn views(&self, shot: &Shot) -> Result<Views, FormatError> {
        let mut images = Vec::new();
        let mut warnings = Vec::new();
        for (frame, format) in shot.frames.iter().zip(&self.formats) {
            let decoded = decode(&frame.bytes, format, self.layout == Layout::Interleaved)?;
            images.extend(decoded.images);
            warnings.extend(decoded.damage.map(|damage| {
                format!(
                    "a frame is a damaged JPEG ({damage}); the outline may be wrong, so take another --format"
                )
            }));
        }
        let format = self.formats.first().ok_or(FormatError::Short { got: 0, wanted: 1 })?;
        let mut images = self.layout.views(images).ok_or(FormatError::Size(format.width, format.height))?;
        if self.swap {
            images.reverse();
        }
        Ok(Views { images, warnings })
    }
}

/// Reads pairs until `take` has enough, `stop` is set, or a camera fails. `stop` is set in the end. What is
/// counted meanwhile is shown to `take`, and returned, with what is wrong with a camera if that ended it. A pair
/// that waits then is dropped, lest the end be late.
pub fn run<D: Device + Send>(
    pairs: &mut Pairs<D>,
    optics: &Optics,
    stop: &AtomicBool,
    mut take: impl FnMut(Live, &Tally) -> ControlFlow<()>,
) -> (Tally, Result<(), CameraError>) {
    let slot = Slot::default();
    let path = pairs.path().to_path_buf();
    let mut tally = Tally::default();
    let result = thread::scope(|scope| {
        let reader = scope.spawn(|| {
            let result = read(pairs, &slot, stop);
            slot.close();
            result
        });
        let mut unreadable = 0;
        while let Some((shot, state)) = slot.fetch() {
            (tally.dropped, tally.losses) = (state.dropped, state.losses);
            let arrived = shot.frames.iter().map(|frame| frame.arrived).max().unwrap_or_default();
            match optics.views(&shot) {
                Ok(views) => {
                    unreadable = 0;
                    tally.fetched += 1;
                    tally.damaged += views.warnings.len() as u64;
                    if take(Live { views, gap: shot.gap, arrived }, &tally).is_break() {
                        break;
                    }
                }
                Err(source) => {
                    unreadable += 1;
                    tally.unreadable += 1;
                    if unreadable == MOST_UNREADABLE {
                        stop.store(true, Ordering::Relaxed);
                        return Err(CameraError::Unreadable { path, count: unreadable, source });
                    }
                }
            }
        }
        stop.store(true, Ordering::Relaxed);
        // A thread fails to end only by a panic, which is passed on.
        reader.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    });
    (tally.dropped, tally.losses) = (slot.lock().dropped, pairs.losses());
    (tally, result)
}

/// Fills the slot.
fn read<D: Device>(pairs: &mut Pairs<D>, slot: &Slot, stop: &AtomicBool) -> Result<(), CameraError> {
    while let Some(shot) = pairs.next(stop)? {
        slot.put(shot, pairs.losses());
    }
    Ok(())
}

/// Room for one shot.
#[derive(Debug, Default)]
struct Slot {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Clone, Debug, Default)]
struct State {
    shot: Option<Shot>,
    closed: bool,
    dropped: u64,
    losses: Losses,
}

impl Slot {
    /// What it holds is whole at every moment, so a panic elsewhere does not matter.
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn put(&self, shot: Shot, losses: Losses) {
        let mut state = self.lock();
        state.dropped += u64::from(state.shot.replace(shot).is_some());
        state.losses = losses;
        self.changed.notify_one();
    }

    /// Ends the waiting; a shot that nobody fetched yet is dropped.
    fn close(&self) {
        let mut state = self.lock();
        state.dropped += u64::from(state.shot.take().is_some());
        state.closed = true;
        self.changed.notify_one();
    }

    /// Waits for a shot; nothing once the slot is closed.
    fn fetch(&self) -> Option<(Shot, State)> {
        let mut state = self.lock();
        loop {
            if state.closed {
                return None;
            }
            if let Some(shot) = state.shot.take() {
                let counts = State { shot: None, ..state.clone() };
                return Some((shot, counts));
            }
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

#[cfg(test)]
mod tests;
