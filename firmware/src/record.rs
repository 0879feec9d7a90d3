//! One record that outlives a loss of power, on two sectors of any flash.
//!
//! A sector holds a header and behind it the record. A new record goes to the sector that does not hold the
//! newest one: erased first, the record written, then its header, in one piece. So whatever happens
//! meanwhile, the old record or the new one stands whole; which, sequence numbers tell. A sector that lost power
//! meanwhile may be one that flash refuses to read: it is as one that is damaged.

use crate::ports::{Flash, FlashError};
use core::ops::ControlFlow;
use crc::{CRC_32_ISO_HDLC, Crc};
use embedded_storage::nor_flash::NorFlash;

/// Bytes of a header, and what is written at once: the largest unit of the boards' flash.
const UNIT: usize = 32;
/// How a header begins.
const MAGIC: u32 = u32::from_le_bytes(*b"Oss1");

static CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

#[derive(Clone, Copy)]
struct Header {
    sequence: u32,
    length: u32,
    /// Of sequence, length and record.
    sum: u32,
}

impl Header {
    fn digest(sequence: u32, length: u32) -> crc::Digest<'static, u32> {
        let mut digest = CRC.digest();
        digest.update(&sequence.to_le_bytes());
        digest.update(&length.to_le_bytes());
        digest
    }
}

/// A record on two sectors.
#[derive(Debug)]
pub struct Record<F> {
    flash: F,
    first: u32,
}

impl<F: NorFlash> Record<F> {
    /// On the sector that starts at `first`, and the one behind it.
    pub const fn new(flash: F, first: u32) -> Self {
        assert!(
            UNIT.is_multiple_of(F::WRITE_SIZE) && UNIT.is_multiple_of(F::READ_SIZE) && F::ERASE_SIZE > UNIT
        );
        Self { flash, first }
    }

    fn start(&self, sector: u32) -> u32 {
        self.first + sector * F::ERASE_SIZE as u32
    }

    fn read(&mut self, offset: u32) -> Result<[u8; UNIT], FlashError> {
        let mut unit = [0; UNIT];
        self.flash.read(offset, &mut unit).map_err(|_| FlashError::Failing)?;
        Ok(unit)
    }

    /// What a sector's header says, if it is one.
    fn header(&mut self, sector: u32) -> Result<Option<Header>, FlashError> {
        let unit = self.read(self.start(sector))?;
        let (words, _) = unit.as_chunks::<4>();
        let Some(words) = words.first_chunk() else { return Ok(None) };
        let [magic, sequence, length, sum] = words.map(u32::from_le_bytes);
        let fits = length as usize <= self.capacity();
        Ok((magic == MAGIC && fits).then_some(Header { sequence, length, sum }))
    }

    /// Hand the bytes of a sector's record to `take`, piece by piece.
    fn each(
        &mut self,
        sector: u32,
        length: u32,
        mut take: impl FnMut(usize, &[u8]),
    ) -> Result<(), FlashError> {
        let start = self.start(sector) + UNIT as u32;
        for at in (0..length).step_by(UNIT) {
            let unit = self.read(start + at)?;
            take(at as usize, &unit[..UNIT.min((length - at) as usize)]);
        }
        Ok(())
    }

    /// The sector of the newest whole record, and its header.
    fn newest(&mut self) -> Result<Option<(u32, Header)>, FlashError> {
        let mut newest: Option<(u32, Header)> = None;
        let mut damaged = false;
        for sector in [0, 1] {
            match self.whole(sector) {
                Ok(Some(header)) if newest.is_none_or(|(_, other)| header.sequence > other.sequence) => {
                    newest = Some((sector, header));
                }
                Ok(_) => (),
                Err(_) => damaged = true,
            }
        }
        if newest.is_none() && damaged { Err(FlashError::Damaged) } else { Ok(newest) }
    }

    /// The header of a sector's record, if it has one.
    fn whole(&mut self, sector: u32) -> Result<Option<Header>, FlashError> {
        let Some(header) = self.header(sector)? else { return Ok(None) };
        let mut digest = Header::digest(header.sequence, header.length);
        self.each(sector, header.length, |_, bytes| digest.update(bytes))?;
        if digest.finalize() == header.sum { Ok(Some(header)) } else { Err(FlashError::Damaged) }
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        let write = |(at, piece): (usize, &[u8])| {
            let mut unit = [0xFF; UNIT];
            unit[..piece.len()].copy_from_slice(piece);
            match self.flash.write(offset + (at * UNIT) as u32, &unit) {
                Ok(()) => ControlFlow::Continue(()),
                Err(_) => ControlFlow::Break(FlashError::Failing),
            }
        };
        match bytes.chunks(UNIT).enumerate().try_for_each(write) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(error) => Err(error),
        }
    }
}

impl<F: NorFlash> Flash for Record<F> {
    fn capacity(&self) -> usize {
        F::ERASE_SIZE - UNIT
    }

    fn load(&mut self, buffer: &mut [u8]) -> Result<usize, FlashError> {
        let Some((sector, header)) = self.newest()? else { return Ok(0) };
        let (length, room) = (header.length as usize, buffer.len());
        let place = buffer.get_mut(..length).ok_or(FlashError::TooLong(room))?;
        self.each(sector, header.length, |at, bytes| {
            place.iter_mut().skip(at).zip(bytes).for_each(|(place, byte)| *place = *byte);
        })?;
        Ok(length)
    }

    fn save(&mut self, record: &[u8]) -> Result<(), FlashError> {
        if record.len() > self.capacity() {
            return Err(FlashError::TooLong(self.capacity()));
        }
        // A damaged record is no reason not to save a good one.
        let newest = match self.newest() {
            Err(FlashError::Damaged) => None,
            other => other?,
        };
        let (sector, sequence) =
            newest.map_or((0, 1), |(sector, h)| (1 - sector, h.sequence.wrapping_add(1)));
        let start = self.start(sector);
        self.flash.erase(start, start + F::ERASE_SIZE as u32).map_err(|_| FlashError::Failing)?;
        self.write(start + UNIT as u32, record)?;

        let length = record.len() as u32;
        let mut digest = Header::digest(sequence, length);
        digest.update(record);
        let mut header = [0; 16];
        for (place, word) in header.chunks_mut(4).zip([MAGIC, sequence, length, digest.finalize()]) {
            place.copy_from_slice(&word.to_le_bytes());
        }
        self.write(start, &header)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use embedded_storage::nor_flash::{ErrorType, NorFlashErrorKind, ReadNorFlash};
    extern crate std;
    use core::ops::Range;
    use std::vec;
    use std::vec::Vec;

    /// Flash that loses power in the middle of its `fuse`-th write or erasure. Writing clears bits and sets
    /// none, as on a real chip.
    #[derive(Clone, Debug)]
    struct Model {
        bytes: Vec<u8>,
        fuse: usize,
        /// Whether what loses power in the middle is refused from then on, until it is erased.
        strict: bool,
        refused: Range<usize>,
    }

    impl Model {
        fn changes(&mut self, from: u32, all: usize) -> (usize, Result<(), NorFlashErrorKind>) {
            self.fuse = self.fuse.saturating_sub(1);
            if self.fuse > 0 {
                return (all, Ok(()));
            }
            if self.strict {
                self.refused = from as usize..from as usize + all;
            }
            (all / 2, Err(NorFlashErrorKind::Other))
        }
    }

    impl ErrorType for Model {
        type Error = NorFlashErrorKind;
    }

    impl ReadNorFlash for Model {
        const READ_SIZE: usize = 1;
        fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Self::Error> {
            if self.refused.contains(&(offset as usize)) {
                return Err(NorFlashErrorKind::Other);
            }
            let all = self.bytes.get(offset as usize..).and_then(|rest| rest.get(..bytes.len()));
            bytes.copy_from_slice(all.ok_or(NorFlashErrorKind::OutOfBounds)?);
            Ok(())
        }
        fn capacity(&self) -> usize {
            self.bytes.len()
        }
    }

    impl NorFlash for Model {
        const WRITE_SIZE: usize = UNIT;
        const ERASE_SIZE: usize = 256;
        fn erase(&mut self, from: u32, to: u32) -> Result<(), Self::Error> {
            assert!(from.is_multiple_of(256) && to == from + 256 && from >= 256, "{from}..{to}");
            if self.refused.start >= from as usize && self.refused.end <= to as usize {
                self.refused = 0..0;
            }
            let (done, result) = self.changes(from, (to - from) as usize);
            self.bytes[from as usize..][..done].fill(0xFF);
            result
        }
        fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Self::Error> {
            assert!((offset as usize).is_multiple_of(UNIT) && bytes.len() == UNIT);
            let (done, result) = self.changes(offset, bytes.len());
            for (place, byte) in self.bytes[offset as usize..].iter_mut().zip(&bytes[..done]) {
                *place &= byte;
            }
            result
        }
    }

    /// Some program, then two sectors.
    fn new() -> Record<Model> {
        let bytes = vec![0x5A; 3 * 256];
        Record::new(Model { bytes, fuse: usize::MAX, strict: false, refused: 0..0 }, 256)
    }

    fn load(record: &mut Record<Model>) -> Result<Vec<u8>, FlashError> {
        let mut buffer = vec![0; record.capacity()];
        record.load(&mut buffer).map(|length| buffer[..length].to_vec())
    }

    #[test]
    fn what_is_saved_last_is_loaded() {
        let mut record = new();
        assert_eq!(load(&mut record), Ok(vec![]));
        for length in [1, 31, 32, 33, 0, 224, 100] {
            let bytes: Vec<u8> = (0..length).collect();
            record.save(&bytes).unwrap();
            assert_eq!(load(&mut record), Ok(bytes));
        }
        assert_eq!(record.save(&[0; 225]), Err(FlashError::TooLong(224)));
        assert_eq!(record.load(&mut [0; 99]), Err(FlashError::TooLong(99)));
        assert!(record.flash.bytes[..256].iter().all(|b| *b == 0x5A), "the program is untouched");
    }

    #[test]
    fn whenever_power_goes_the_old_or_the_new_record_stands() {
        let mut record = new();
        record.save(&[1; 100]).unwrap();
        record.save(&[2; 100]).unwrap();
        let mut lost = 0;
        for (fuse, strict) in (1..=6).flat_map(|fuse| [(fuse, false), (fuse, true)]) {
            let mut cut = Record::new(Model { fuse, strict, ..record.flash.clone() }, 256);
            assert_eq!(cut.save(&[3; 100]), Err(FlashError::Failing), "{fuse} {strict}");
            cut.flash.fuse = usize::MAX;
            let found = load(&mut cut);
            assert!(found == Ok(vec![2; 100]) || found == Ok(vec![3; 100]), "{fuse} {strict}: {found:?}");
            lost += usize::from(found == Ok(vec![2; 100]));
            cut.save(&[4; 10]).unwrap();
            assert_eq!(load(&mut cut), Ok(vec![4; 10]));
        }
        assert!(lost >= 11, "power went while the new one was not whole yet");
    }

    /// With no other record to go back to, none is there, and the next one is saved.
    #[test]
    fn a_first_record_that_flash_refuses_to_read_is_a_damaged_one() {
        for fuse in 1..=6 {
            let mut cut = new();
            (cut.flash.fuse, cut.flash.strict) = (fuse, true);
            assert_eq!(cut.save(&[3; 100]), Err(FlashError::Failing), "{fuse}");
            cut.flash.fuse = usize::MAX;
            assert!(
                matches!(load(&mut cut), Ok(none) if none.is_empty())
                    || load(&mut cut) == Err(FlashError::Damaged)
            );
            cut.save(&[4; 10]).unwrap();
            assert_eq!(load(&mut cut), Ok(vec![4; 10]), "{fuse}");
        }
    }

    #[test]
    fn a_changed_bit_is_noticed() {
        let mut record = new();
        record.save(&[7; 50]).unwrap();
        for at in 256..256 + UNIT + 50 {
            let mut changed = Record::new(record.flash.clone(), 256);
            changed.flash.bytes[at] ^= 0x10;
            let found = load(&mut changed);
            // A header that is none is as if nothing had ever been saved; its filling means nothing.
            let expected = match at - 256 {
                0..4 => Ok(vec![]),
                16..UNIT => Ok(vec![7; 50]),
                _ => Err(FlashError::Damaged),
            };
            assert!(found == expected || (8..12).contains(&(at - 256)), "{at}: {found:?}");
            assert!(found != Ok(vec![7; 50]) || (16..UNIT).contains(&(at - 256)), "{at}");
        }
    }
}
