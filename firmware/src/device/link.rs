//! Both ends of the device's link: bytes to commands, messages to bytes.

use shared::wire::{Answer, Counters, Decoder, ErrorCode, Sequence, ToDevice, ToHost, WireError};

/// Bytes of the longest command: a calibration with lenses, its type, number and check sum, and as a frame.
pub(super) const MAX_COMMAND: usize = 576;

/// Bytes that have come, and the frame that they make.
pub(super) struct Inbox<'m> {
    decoder: Decoder<'m>,
    bytes: [u8; 64],
    /// The bytes not looked at yet.
    next: usize,
    end: usize,
}

impl<'m> Inbox<'m> {
    /// An empty one, for frames that fit the buffer.
    pub(super) const fn new(frame: &'m mut [u8]) -> Self {
        Self { decoder: Decoder::new(frame), bytes: [0; 64], next: 0, end: 0 }
    }

    /// Where bytes go.
    pub(super) const fn buffer(&mut self) -> &mut [u8] {
        &mut self.bytes
    }

    /// So many bytes lie in the buffer.
    pub(super) fn fill(&mut self, count: usize) {
        (self.next, self.end) = (0, count.min(self.bytes.len()));
    }

    /// The next command that is whole, or what is wrong with it, and its number.
    pub(super) fn command(&mut self) -> Option<(u16, Result<ToDevice, WireError>)> {
        while self.next < self.end {
            let byte = *self.bytes.get(self.next)?;
            self.next += 1;
            if let Some(frame) = self.decoder.push(byte) {
                return Some((frame.sequence, ToDevice::decode(&frame)));
            }
        }
        None
    }

    /// What came so far.
    pub(super) const fn counters(&self) -> &Counters {
        self.decoder.counters()
    }
}

/// What waits in the buffer that leaves the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Waiting {
    /// Nothing.
    Nothing,
    /// A frame of this length for the host.
    Frame(usize),
    /// A record of this length for flash, by the command of this number.
    Record(usize, u16),
}

/// The buffer that leaves the device.
#[derive(Debug)]
pub(super) struct Outbox<'m> {
    bytes: &'m mut [u8],
    sequence: Sequence,
    pub(super) waiting: Waiting,
}

impl<'m> Outbox<'m> {
    /// An empty one.
    pub(super) fn new(bytes: &'m mut [u8]) -> Self {
        Self { bytes, sequence: Sequence::default(), waiting: Waiting::Nothing }
    }

    /// All of the buffer.
    pub(super) const fn buffer(&mut self) -> &mut [u8] {
        self.bytes
    }

    /// The first bytes of the buffer.
    pub(super) fn first(&self, len: usize) -> &[u8] {
        self.bytes.get(..len).unwrap_or_default()
    }

    /// Let a message wait to be sent.
    pub(super) fn say(&mut self, message: &ToHost<'_>) {
        // What does not fit even alone is a board's name that breaks its promise.
        let len = message.encode(self.sequence.take(), self.bytes).ok();
        self.waiting = len.map_or(Waiting::Nothing, Waiting::Frame);
    }

    /// Answer a command by its number.
    pub(super) fn answer(&mut self, command: u16, result: Result<(), ErrorCode>) {
        self.say(&ToHost::Answer(Answer { command, result }));
    }
}
