//! A link: from a port's bytes to frames, on a thread of its own, and commands back.
//!
//! The thread reads, records and takes frames apart as bytes come, so nothing is lost while a model is made.
//! Frames that were sent twice are handed out once.

use std::io::{self, Read, Write};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use shared::limits::CapacityError;
use shared::wire::{Counters, Decoder, Frame, MAX_FRAME, Sequence, ToDevice};

use super::port::Port;
use super::recording::{MAX_BYTES, RecordingError, Writer};

/// Longest frame of a command, bytes: an upload of a calibration with both lenses.
pub const MAX_COMMAND: usize = 1024;
/// Frames that may wait to be looked at; then the device has to.
const WAITING: usize = 256;

/// A frame that has come.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Arrived {
    kind: u8,
    sequence: u16,
    payload: Vec<u8>,
}

impl Arrived {
    /// The frame.
    #[must_use]
    pub fn frame(&self) -> Frame<'_> {
        Frame { kind: self.kind, sequence: self.sequence, repeated: false, payload: &self.payload }
    }

    /// Whether a device that has just started sent it: the first of its numbers.
    #[must_use]
    pub const fn is_first(&self) -> bool {
        self.sequence == 0
    }
}

/// Hand the frames in the bytes of a connection to `take`, each once.
pub fn frames(decoder: &mut Decoder<'_>, bytes: &[u8], mut take: impl FnMut(Arrived)) {
    for byte in bytes {
        if let Some(Frame { kind, sequence, repeated: false, payload }) = decoder.push(*byte) {
            take(Arrived { kind, sequence, payload: payload.to_vec() });
        }
    }
}

/// Why a link ended.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// The device is gone.
    #[error("the connection ended{}", .0.as_ref().map_or_else(String::new, |error| format!(": {error}")))]
    Lost(Option<io::Error>),
    /// What came cannot be kept.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// A command that is too long.
    #[error(transparent)]
    Command(#[from] CapacityError),
}

/// What the thread tells beside frames.
#[derive(Default)]
struct Shared {
    stop: AtomicBool,
    bytes: AtomicU64,
    counters: Mutex<Counters>,
    end: Mutex<Option<LinkError>>,
}

/// Whatever holds the lock leaves a whole value in it.
fn locked<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Where bytes are recorded as they come, across connections.
pub type Tap = Arc<Mutex<Writer>>;

/// A link.
pub struct Link {
    writer: Box<dyn Write + Send>,
    sequence: Sequence,
    frames: Receiver<Arrived>,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl Link {
    /// Listen to a port.
    ///
    /// # Errors
    /// When the recording cannot be written.
    pub fn new(port: Port, tap: Option<Tap>) -> Result<Self, LinkError> {
        if let Some(tap) = &tap {
            locked(tap).connection()?;
        }
        let (sender, frames) = sync_channel(WAITING);
        let shared = Arc::new(Shared::default());
        let (theirs, reader) = (shared.clone(), port.reader);
        let thread = thread::spawn(move || {
            let end = pump(reader, tap.as_ref(), &sender, &theirs);
            *locked(&theirs.end) = Some(end);
        });
        let thread = Some(thread);
        Ok(Self { writer: port.writer, sequence: Sequence::default(), frames, shared, thread })
    }

    /// Send a command; its number.
    ///
    /// # Errors
    /// When the device is gone.
    pub fn send(&mut self, command: &ToDevice) -> Result<u16, LinkError> {
        let (number, mut frame) = (self.sequence.take(), [0; MAX_COMMAND]);
        let length = command.encode(number, &mut frame)?;
        let sent = self.writer.write_all(&frame[..length]).and_then(|()| self.writer.flush());
        sent.map_err(|error| LinkError::Lost(Some(error)))?;
        Ok(number)
    }

    /// The next frame, if one comes within this time.
    ///
    /// # Errors
    /// When there are none to come any more.
    pub fn receive(&mut self, within: Duration) -> Result<Option<Arrived>, LinkError> {
        match self.frames.recv_timeout(within) {
            Ok(frame) => Ok(Some(frame)),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => {
                self.join();
                Err(locked(&self.shared.end).take().unwrap_or(LinkError::Lost(None)))
            }
        }
    }

    /// What came so far.
    #[must_use]
    pub fn counters(&self) -> Counters {
        *locked(&self.shared.counters)
    }

    /// Bytes that came so far, whatever they are.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.shared.bytes.load(Ordering::Relaxed)
    }

    fn join(&mut self) {
        if let Some(thread) = self.thread.take() {
            // The thread does not panic; if it did, there is no end to be told.
            let _ = thread.join();
        }
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        self.shared.stop.store(true, Ordering::Relaxed);
        // A thread that waits for room is let go by an end that nobody holds.
        self.frames = sync_channel(0).1;
        self.join();
    }
}

/// Read until the end.
fn pump(
    mut reader: Box<dyn Read + Send>,
    tap: Option<&Tap>,
    sender: &SyncSender<Arrived>,
    shared: &Shared,
) -> LinkError {
    let (mut frame, mut bytes) = ([0; MAX_FRAME], [0; MAX_BYTES]);
    let mut decoder = Decoder::new(&mut frame);
    while !shared.stop.load(Ordering::Relaxed) {
        let count = match reader.read(&mut bytes) {
            Ok(0) => return LinkError::Lost(None),
            Ok(count) => count,
            Err(error) => match error.kind() {
                io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted => continue,
                _ => return LinkError::Lost(Some(error)),
            },
        };
        shared.bytes.fetch_add(count as u64, Ordering::Relaxed);
        if let Some(tap) = tap
            && let Err(error) = locked(tap).bytes(&bytes[..count])
        {
            return error.into();
        }
        let mut heard = true;
        frames(&mut decoder, &bytes[..count], |frame| heard &= sender.send(frame).is_ok());
        *locked(&shared.counters) = *decoder.counters();
        if !heard {
            break;
        }
    }
    LinkError::Lost(None)
}
