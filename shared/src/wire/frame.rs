//! Frames: a message type, a sequence number and a payload as bytes that survive a bad link.
//!
//! ```text
//! 0x00 | COBS( type u8 | sequence u16 | payload | CRC-32 of all before u32 ) | 0x00
//! ```
//!
//! * **COBS** (Cheshire and Baker 1999) takes all zeros out, at most one byte more for each 254 begun, so
//!   that a zero always ends a frame. A frame also begins with one: what noise or a reset left before it
//!   cannot spoil it. Empty frames mean nothing.
//! * **CRC-32/ISO-HDLC** with one table of 1 KiB: COBS alone lets three of four flipped frames pass as
//!   something else.
//! * **Sequence numbers** count the frames of one direction: 0 opens a numbering, 65535 is followed by 1.
//! * **Out**: the writer fills lent bytes, the decoder a lent buffer; a frame too long for the buffer is
//!   counted and skipped, so bytes without end cost nothing. After any damage the next delimiter starts
//!   anew: at most the frames that were hit and the one behind a lost delimiter are lost.
//! * **Cost**: one table look-up a byte.

use crate::limits::CapacityError;
use crc::{CRC_32_ISO_HDLC, Crc, Digest};

/// The check sum of frames and of calibrations.
pub(super) static CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// Ends every frame and occurs nowhere in it.
const DELIMITER: u8 = 0;
/// Type and sequence number.
const HEADER: usize = 3;
/// The check sum.
const TRAILER: usize = 4;
/// The code of a COBS block that no zero follows.
const FULL_BLOCK: u8 = 255;

/// Writes one frame; [`Writer::finish`] says whether it fitted.
pub(super) struct Writer<'a> {
    out: &'a mut [u8],
    len: usize,
    /// Where the code of the block under way stands, and what it would be if the block ended here.
    slot: usize,
    code: u8,
    digest: Digest<'static, u32>,
    overflow: bool,
}

impl<'a> Writer<'a> {
    pub(super) fn new(kind: u8, sequence: u16, out: &'a mut [u8]) -> Self {
        let mut writer = Self { out, len: 0, slot: 0, code: 0, digest: CRC.digest(), overflow: false };
        writer.raw(DELIMITER);
        writer.open_block();
        writer.put(&[kind]);
        writer.put(&sequence.to_le_bytes());
        writer
    }

    /// Append bytes of the payload.
    pub(super) fn put(&mut self, bytes: &[u8]) {
        self.digest.update(bytes);
        self.stuff(bytes);
    }

    /// Append the check sum and the delimiter; returns the frame's length.
    pub(super) fn finish(mut self) -> Result<usize, CapacityError> {
        let sum = self.digest.clone().finalize();
        self.stuff(&sum.to_le_bytes());
        self.close_block();
        self.raw(DELIMITER);
        let fits = !self.overflow;
        fits.then_some(self.len).ok_or(CapacityError { what: "bytes in a frame", limit: self.out.len() })
    }

    fn stuff(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            if self.code == FULL_BLOCK {
                self.close_block();
                self.open_block();
            }
            if byte == 0 {
                self.close_block();
                self.open_block();
            } else {
                self.raw(byte);
                self.code = self.code.saturating_add(1);
            }
        }
    }

    fn open_block(&mut self) {
        (self.slot, self.code) = (self.len, 1);
        self.raw(0);
    }

    fn close_block(&mut self) {
        if let Some(slot) = self.out.get_mut(self.slot) {
            *slot = self.code;
        }
    }

    fn raw(&mut self, byte: u8) {
        match self.out.get_mut(self.len) {
            Some(slot) => {
                *slot = byte;
                self.len += 1;
            }
            None => self.overflow = true,
        }
    }
}

/// Numbers the frames of one direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sequence(u16);

impl Sequence {
    /// The number of the next frame: 0, 1, .. 65535, 1, ..
    pub const fn take(&mut self) -> u16 {
        let this = self.0;
        self.0 = after(this);
        this
    }
}

const fn after(sequence: u16) -> u16 {
    if sequence == u16::MAX { 1 } else { sequence + 1 }
}

/// A frame whose check sum was right.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame<'a> {
    /// The type of the message.
    pub kind: u8,
    /// Its number.
    pub sequence: u16,
    /// It has the number of the frame before: sent twice.
    pub repeated: bool,
    /// The message's fields.
    pub payload: &'a [u8],
}

/// What a decoder has met; each counter stops at its largest value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Frames handed out.
    pub frames: u32,
    /// Frames with a wrong check sum.
    pub bad_crc: u32,
    /// Frames longer than the buffer, or bytes without end.
    pub oversize: u32,
    /// Frames that are no COBS, or too short for a header and a check sum.
    pub malformed: u32,
    /// 1 when listening began in the middle of a frame.
    pub partial: u32,
    /// Frames that never came, by their numbers.
    pub missing: u32,
    /// Frames that came twice.
    pub repeated: u32,
    /// Bytes, delimiters left out, of everything that is no frame.
    pub rejected_bytes: u32,
}

impl Counters {
    /// Frames that came but could not be used.
    pub const fn rejected_frames(&self) -> u32 {
        self.bad_crc.saturating_add(self.oversize).saturating_add(self.malformed)
    }
}

/// How a decoder stands to the frame under way.
#[derive(Clone, Copy, PartialEq, Eq)]
enum State {
    /// No delimiter yet: where a frame begins is unknown.
    Listening,
    /// Within a frame.
    Reading,
    /// Within a frame that is counted as lost already.
    Skipping,
}

/// Finds the frames in the bytes of a link, in the order in which they come.
pub struct Decoder<'a> {
    buffer: &'a mut [u8],
    len: usize,
    /// Bytes since the last delimiter.
    raw: u32,
    /// Bytes left in the COBS block, and whether a zero follows it.
    block: u8,
    zero: bool,
    state: State,
    last: Option<u16>,
    counters: Counters,
}

impl<'a> Decoder<'a> {
    /// A decoder of frames whose type, number, payload and check sum fit the buffer.
    pub const fn new(buffer: &'a mut [u8]) -> Self {
        Self {
            buffer,
            len: 0,
            raw: 0,
            block: 0,
            zero: false,
            state: State::Listening,
            last: None,
            counters: Counters {
                frames: 0,
                bad_crc: 0,
                oversize: 0,
                malformed: 0,
                partial: 0,
                missing: 0,
                repeated: 0,
                rejected_bytes: 0,
            },
        }
    }

    /// What came so far.
    pub const fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Take a byte of the link; the frame that it ends, if it ends one.
    pub fn push(&mut self, byte: u8) -> Option<Frame<'_>> {
        if byte == DELIMITER {
            return self.end();
        }
        self.raw = self.raw.saturating_add(1);
        if self.state != State::Reading {
            return None;
        }
        let decoded = if self.block > 0 {
            self.block -= 1;
            Some(byte)
        } else {
            let zero = core::mem::replace(&mut self.zero, byte != FULL_BLOCK);
            self.block = byte - 1;
            (zero && self.raw > 1).then_some(0)
        };
        if let Some(byte) = decoded {
            match self.buffer.get_mut(self.len) {
                Some(slot) => {
                    *slot = byte;
                    self.len += 1;
                }
                None => {
                    count(&mut self.counters.oversize, 1);
                    self.state = State::Skipping;
                }
            }
        }
        None
    }

    /// A delimiter came.
    fn end(&mut self) -> Option<Frame<'_>> {
        let raw = core::mem::take(&mut self.raw);
        let len = core::mem::take(&mut self.len);
        let cut = core::mem::take(&mut self.block) > 0;
        let state = core::mem::replace(&mut self.state, State::Reading);
        if raw == 0 {
            return None;
        }
        let counter = match state {
            State::Listening => Some(&mut self.counters.partial),
            State::Reading if cut || len < HEADER + TRAILER => Some(&mut self.counters.malformed),
            State::Reading if !self.is_whole(len) => Some(&mut self.counters.bad_crc),
            State::Reading => return self.hand_out(len),
            // Counted when it grew too long.
            State::Skipping => None,
        };
        if let Some(counter) = counter {
            count(counter, 1);
        }
        count(&mut self.counters.rejected_bytes, raw);
        None
    }

    /// Whether the check sum of the frame in the buffer is right.
    fn is_whole(&self, len: usize) -> bool {
        let parts = self.buffer.get(..len).and_then(<[u8]>::split_last_chunk::<TRAILER>);
        parts.is_some_and(|(content, sum)| CRC.checksum(content) == u32::from_le_bytes(*sum))
    }

    /// The frame in the buffer.
    fn hand_out(&mut self, len: usize) -> Option<Frame<'_>> {
        let content = self.buffer.get(..len.checked_sub(TRAILER)?)?;
        let (&[kind, low, high], payload) = content.split_first_chunk::<HEADER>()?;
        let sequence = u16::from_le_bytes([low, high]);
        let last = self.last.replace(sequence).filter(|_| sequence != 0);
        let repeated = last == Some(sequence);
        if repeated {
            count(&mut self.counters.repeated, 1);
        } else if let Some(last) = last {
            count(&mut self.counters.missing, missing(last, sequence));
        }
        count(&mut self.counters.frames, 1);
        Some(Frame { kind, sequence, repeated, payload })
    }
}

/// Numbers between two that came one after the other, neither twice the same nor a new numbering. Half
/// of all or more mean that the numbering began anew unseen: one frame at least.
const fn missing(last: u16, now: u16) -> u32 {
    const NUMBERS: u32 = u16::MAX as u32;
    let ahead = (now as u32 + NUMBERS - after(last) as u32) % NUMBERS;
    if ahead < NUMBERS / 2 { ahead } else { 1 }
}

const fn count(counter: &mut u32, by: u32) {
    *counter = counter.saturating_add(by);
}
