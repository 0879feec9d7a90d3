//! Numbers of which most are small as few bits: the lists of a shape.
//!
//! * **In, out**: any `i32`s, in the same order on both sides.
//! * **How**: a number is folded to 0, -1, 1, -2, .. and split at k bits; the upper part is written in
//!   unary, the lower one as it is (Rice 1979). k follows the mean of the numbers before, much as in
//!   JPEG-LS, so nothing has to be chosen. An upper part of 20 or more is an escape for 32 plain bits.
//! * A [`Channel`] first takes away what the numbers before foretell.
//! * **Order of bits**: the lowest of a byte first; the last byte is filled up with zeros.
//! * **Cost**: a few shifts a number, one step a unary bit. A number takes 52 bits at most.

use super::WireError;
use super::bytes::Reader;
use super::frame::Writer;

/// A unary part of this length is followed by 32 plain bits.
const ESCAPE: u32 = 20;
/// Numbers that the mean is taken over, about.
const MEMORY: u32 = 32;
/// Larger numbers count as this in the mean.
const MOST: u32 = 1 << 20;

/// Writes bits behind the fields of a frame.
pub(super) struct BitWriter<'w, 'a> {
    writer: &'w mut Writer<'a>,
    held: u64,
    count: u32,
}

impl<'w, 'a> BitWriter<'w, 'a> {
    pub(super) const fn new(writer: &'w mut Writer<'a>) -> Self {
        Self { writer, held: 0, count: 0 }
    }

    /// The low `count` <= 32 bits of `bits`.
    pub(super) fn put(&mut self, bits: u32, count: u32) {
        let kept = u64::from(bits) & ((1 << count) - 1);
        self.held |= kept << self.count;
        self.count += count;
        while self.count >= 8 {
            let [low, ..] = self.held.to_le_bytes();
            self.writer.u8(low);
            self.held >>= 8;
            self.count -= 8;
        }
    }

    /// Fill up the last byte.
    pub(super) fn finish(mut self) {
        self.put(0, (8 - self.count) % 8);
    }
}

/// Reads what a [`BitWriter`] wrote; bits left in the last byte are dropped with it.
pub(super) struct BitReader<'r, 'a> {
    reader: &'r mut Reader<'a>,
    held: u64,
    count: u32,
}

impl<'r, 'a> BitReader<'r, 'a> {
    pub(super) const fn new(reader: &'r mut Reader<'a>) -> Self {
        Self { reader, held: 0, count: 0 }
    }

    /// The next `count` <= 32 bits.
    pub(super) fn take(&mut self, count: u32) -> Result<u32, WireError> {
        while self.count < count {
            self.held |= u64::from(self.reader.u8()?) << self.count;
            self.count += 8;
        }
        let taken = self.held & ((1 << count) - 1);
        self.held >>= count;
        self.count -= count;
        Ok(taken as u32)
    }

    pub(super) fn flag(&mut self) -> Result<bool, WireError> {
        Ok(self.take(1)? == 1)
    }
}

/// Numbers of one kind, and how large they have been.
#[derive(Clone, Copy)]
pub(super) struct Rice {
    sum: u32,
    count: u32,
}

impl Rice {
    /// Nothing was seen yet, but numbers of about this size, when folded, are to be expected.
    pub(super) const fn new(size: u32) -> Self {
        Self { sum: size, count: 1 }
    }

    /// k: the least for which 2^k is not below 5/8 of the mean, about its median.
    fn low_bits(self) -> u32 {
        (0..24).find(|k| self.count << (k + 3) >= 5 * self.sum).unwrap_or(24)
    }

    fn learn(&mut self, folded: u32) {
        self.sum += folded.min(MOST);
        self.count += 1;
        if self.count == MEMORY {
            (self.sum, self.count) = (self.sum / 2, MEMORY / 2);
        }
    }

    pub(super) fn write(&mut self, x: i32, bits: &mut BitWriter<'_, '_>) {
        let folded = ((x << 1) ^ (x >> 31)) as u32;
        let k = self.low_bits();
        let high = folded >> k;
        if high < ESCAPE {
            bits.put(1 << high, high + 1);
            bits.put(folded, k);
        } else {
            bits.put(0, ESCAPE);
            bits.put(folded, 32);
        }
        self.learn(folded);
    }

    pub(super) fn read(&mut self, bits: &mut BitReader<'_, '_>) -> Result<i32, WireError> {
        let k = self.low_bits();
        let mut high = 0;
        while high < ESCAPE && bits.take(1)? == 0 {
            high += 1;
        }
        let folded = if high < ESCAPE { high << k | bits.take(k)? } else { bits.take(32)? };
        self.learn(folded);
        Ok((folded >> 1) as i32 ^ -((folded & 1) as i32))
    }
}

/// How a channel foretells its next number.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Expect {
    /// The last one again.
    Same,
    /// As far from the last one as that from the one before.
    Onward,
}

/// One quantity along a curve, or along several, one after the other.
pub(super) struct Channel {
    expect: Expect,
    /// The last number and the one before, and how many of this curve there were.
    past: [i32; 2],
    known: u32,
    /// Of the first numbers of curves, of the second ones, of all others.
    kinds: [Rice; 3],
}

impl Channel {
    pub(super) const fn new(expect: Expect) -> Self {
        Self {
            expect,
            past: [0; 2],
            known: 0,
            kinds: [Rice::new(1 << 12), Rice::new(1 << 8), Rice::new(1 << 4)],
        }
    }

    /// Another curve begins; the first guess is where the last one ended.
    pub(super) const fn restart(&mut self) {
        self.known = 0;
    }

    pub(super) fn write(&mut self, x: i32, bits: &mut BitWriter<'_, '_>) {
        let rest = x.wrapping_sub(self.expected());
        self.rice().write(rest, bits);
        self.note(x);
    }

    pub(super) fn read(&mut self, bits: &mut BitReader<'_, '_>) -> Result<i32, WireError> {
        let rest = self.rice().read(bits)?;
        let x = rest.wrapping_add(self.expected());
        self.note(x);
        Ok(x)
    }

    const fn expected(&self) -> i32 {
        match self.expect {
            Expect::Onward if self.known > 1 => self.past[0].wrapping_mul(2).wrapping_sub(self.past[1]),
            _ => self.past[0],
        }
    }

    const fn rice(&mut self) -> &mut Rice {
        let [first, second, others] = &mut self.kinds;
        match self.known {
            0 => first,
            1 => second,
            _ => others,
        }
    }

    const fn note(&mut self, x: i32) {
        self.past = [x, self.past[0]];
        self.known = self.known.saturating_add(1);
    }
}
