//! Recordings: what came over a link, byte for byte, with the times at which it came.
//!
//! ```text
//! "ossature-link-1\n", then entries: kind u8 | time us u64 | length u32 | bytes
//! kinds: 0 a connection begins, 1 bytes of the device, 2 the calibration as the frame of an upload
//! ```
//!
//! Numbers are little-endian. Entries are appended, and handed to the system whenever a frame ends, so a
//! recording that was cut off is a shorter recording. What is damaged is left out up to the next entry, and told.

use std::fs::File;
use std::io::{self, BufWriter, Read, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::Instant;

use shared::camera::PairModel;
use shared::wire::{Decoder, ToDevice};

use super::link::MAX_COMMAND;

const MAGIC: &[u8] = b"ossature-link-1\n";
const CONNECTION: u8 = 0;
const BYTES: u8 = 1;
const CALIBRATION: u8 = 2;
/// Kind, time and length.
const HEAD: usize = 13;
/// Most bytes of the device in one entry: so many are read of a port at once.
pub(super) const MAX_BYTES: usize = 4096;

/// Why there is no recording.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// A file of that name is there.
    #[error("{} exists already; name a new file for the recording", path.display())]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// It cannot be written or read.
    #[error("the recording {} cannot be used", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// It does not begin as one, or what its calibration was cannot be read.
    #[error("the recording {} is damaged at byte {at}; copy it again from where it was made", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Where.
        at: usize,
    },
    /// A file without a calibration.
    #[error("the recording {} ends before its calibration; it was cut off, so record again", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
}

/// A recording under way.
#[derive(Debug)]
pub struct Writer {
    path: PathBuf,
    file: BufWriter<File>,
    start: Instant,
}

impl Writer {
    /// Begin a recording in a new file.
    ///
    /// # Errors
    /// When the file exists or cannot be written.
    pub fn begin(path: &Path, calibration: &PairModel) -> Result<Self, RecordingError> {
        let file = File::create_new(path).map_err(|source| match source.kind() {
            io::ErrorKind::AlreadyExists => RecordingError::Exists { path: path.into() },
            _ => RecordingError::Io { path: path.into(), source },
        })?;
        let mut writer = Self { path: path.into(), file: BufWriter::new(file), start: Instant::now() };
        let mut frame = [0; MAX_COMMAND];
        let length = ToDevice::Calibration(*calibration).encode(0, &mut frame);
        let length = length.map_err(|error| writer.failed(io::Error::other(error)))?;
        writer.file.write_all(MAGIC).map_err(|source| writer.failed(source))?;
        writer.append(CALIBRATION, &frame[..length])?;
        Ok(writer)
    }

    /// A connection begins.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn connection(&mut self) -> Result<(), RecordingError> {
        self.append(CONNECTION, &[])
    }

    /// Bytes came.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn bytes(&mut self, bytes: &[u8]) -> Result<(), RecordingError> {
        bytes.chunks(MAX_BYTES).try_for_each(|bytes| self.append(BYTES, bytes))
    }

    /// Wait until all of it is on the disk: some systems say only then that it is full.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn finish(&mut self) -> Result<(), RecordingError> {
        let done = self.file.flush().and_then(|()| self.file.get_ref().sync_all());
        done.map_err(|source| self.failed(source))
    }

    fn append(&mut self, kind: u8, bytes: &[u8]) -> Result<(), RecordingError> {
        let time = self.start.elapsed().as_micros() as u64;
        let mut entry = vec![kind];
        entry.extend(time.to_le_bytes());
        entry.extend((bytes.len() as u32).to_le_bytes());
        entry.extend(bytes);
        let written = self.file.write_all(&entry);
        // A frame ends with a zero.
        let ends = kind != BYTES || bytes.contains(&0);
        let done = written.and_then(|()| if ends { self.file.flush() } else { Ok(()) });
        done.map_err(|source| self.failed(source))
    }

    fn failed(&self, source: io::Error) -> RecordingError {
        RecordingError::Io { path: self.path.clone(), source }
    }
}

/// A recording that was read.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// What the device's pixels mean.
    pub calibration: PairModel,
    /// What came, connection by connection.
    pub connections: Vec<Vec<u8>>,
    /// Time from its beginning to its last entry, us.
    pub length: u64,
    /// Which bytes of the file are damaged, and were left out.
    pub damaged: Vec<Range<usize>>,
    /// Bytes at its end of an entry that is not whole, as a writer that is killed leaves it; left out too.
    pub cut: usize,
}

/// Whether a file is a recording, as far as its first bytes say.
#[must_use]
pub fn is_recording(path: &Path) -> bool {
    let mut head = [0; MAGIC.len()];
    let read = File::open(path).and_then(|mut file| file.read_exact(&mut head));
    path.is_file() && read.is_ok() && head == MAGIC
}

impl Recording {
    /// Read a recording. What is damaged or cut off is left out.
    ///
    /// # Errors
    /// When it cannot be read, is none, or has no calibration.
    pub fn read(path: &Path) -> Result<Self, RecordingError> {
        let file = std::fs::read(path).map_err(|source| RecordingError::Io { path: path.into(), source })?;
        Self::parse(path, &file)
    }

    /// Read the recording in the bytes of a file, which errors call `path`.
    ///
    /// # Errors
    /// When it is none, or has no calibration.
    pub fn parse(path: &Path, file: &[u8]) -> Result<Self, RecordingError> {
        let unreadable = |at| RecordingError::Damaged { path: path.into(), at };
        let mut rest = file.strip_prefix(MAGIC).ok_or_else(|| unreadable(0))?;
        let (mut calibration, mut connections, mut length) = (None, Vec::new(), 0);
        let (mut damaged, mut cut) = (Vec::new(), 0);
        while !rest.is_empty() {
            let at = file.len() - rest.len();
            let Some((Entry { kind, time, bytes }, after)) = entry(rest) else {
                let next = (1..rest.len()).find(|&k| begins_an_entry(&rest[k..]));
                if next.is_none() && is_cut(rest) {
                    cut = rest.len();
                    break;
                }
                let lost = next.unwrap_or(rest.len());
                damaged.push(at..at + lost);
                rest = &rest[lost..];
                continue;
            };
            match kind {
                CALIBRATION => calibration = Some(uploaded(bytes).ok_or_else(|| unreadable(at))?),
                CONNECTION => connections.push(Vec::new()),
                _ => match connections.last_mut() {
                    Some(last) => last.extend_from_slice(bytes),
                    // Where it begins is damaged.
                    None => connections.push(bytes.to_vec()),
                },
            }
            length = time;
            rest = after;
        }
        let none = || match damaged.first() {
            Some(first) => unreadable(first.start),
            None => RecordingError::Empty { path: path.into() },
        };
        let calibration = calibration.ok_or_else(none)?;
        Ok(Self { calibration, connections, length, damaged, cut })
    }
}

/// What was appended at a time.
struct Entry<'a> {
    kind: u8,
    time: u64,
    bytes: &'a [u8],
}

/// The kind, the time and the length in the head of an entry, if a writer can have written it.
fn head([kind, t0, t1, t2, t3, t4, t5, t6, t7, l0, l1, l2, l3]: [u8; HEAD]) -> Option<(u8, u64, usize)> {
    let most = match kind {
        CONNECTION => 0,
        BYTES => MAX_BYTES,
        CALIBRATION => MAX_COMMAND,
        _ => return None,
    };
    let length = u32::from_le_bytes([l0, l1, l2, l3]) as usize;
    (length <= most).then_some((kind, u64::from_le_bytes([t0, t1, t2, t3, t4, t5, t6, t7]), length))
}

/// The entry that begins here, if it is whole, and what follows it.
fn entry(rest: &[u8]) -> Option<(Entry<'_>, &[u8])> {
    let (first, after) = rest.split_first_chunk()?;
    let (kind, time, length) = head(*first)?;
    let (bytes, after) = after.split_at_checked(length)?;
    Some((Entry { kind, time, bytes }, after))
}

/// Whether what is no whole entry may be the beginning of one.
fn is_cut(rest: &[u8]) -> bool {
    rest.split_first_chunk().is_none_or(|(first, _)| head(*first).is_some())
}

/// Whether an entry begins among bytes that may be anything: what looks like one by chance is followed by none.
fn begins_an_entry(rest: &[u8]) -> bool {
    entry(rest).is_some_and(|(_, after)| entry(after).is_some() || is_cut(after))
}

/// The calibration in the frame of an upload.
fn uploaded(frame: &[u8]) -> Option<PairModel> {
    let mut buffer = [0; MAX_COMMAND];
    let mut decoder = Decoder::new(&mut buffer);
    frame.iter().find_map(|byte| match ToDevice::decode(&decoder.push(*byte)?) {
        Ok(ToDevice::Calibration(model)) => Some(model),
        _ => None,
    })
}
