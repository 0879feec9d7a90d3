//! A record on two sectors that hold anything, with losses of power and changed bits: what is loaded was saved.
#![no_main]

use arbitrary::Arbitrary;
use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash};
use firmware::ports::{Flash, FlashError};
use firmware::record::Record;
use libfuzzer_sys::fuzz_target;
use std::cell::RefCell;
use std::rc::Rc;

const SECTOR: usize = 256;

#[derive(Arbitrary, Debug)]
enum Happening {
    Save {
        length: u8,
        seed: u8,
    },
    /// Power goes in the middle of this write or erasure of a save, and what it was about is refused from then on, or
    /// is what it has become.
    Cut {
        length: u8,
        seed: u8,
        at: u8,
        refused: bool,
    },
    Flip {
        at: u16,
        bit: u8,
    },
    Load {
        room: u8,
    },
}

/// Two sectors; writing clears bits and sets none.
#[derive(Debug)]
struct Cells {
    bytes: Vec<u8>,
    /// How many writes and erasures there is power for.
    power: usize,
    /// Whether what power is lost over is refused when it is read.
    refuses: bool,
    refused: Vec<bool>,
}

#[derive(Clone, Debug)]
struct Chip(Rc<RefCell<Cells>>);

impl Chip {
    fn change(
        &mut self,
        from: usize,
        len: usize,
        to: impl Fn(u8, usize) -> u8,
    ) -> Result<(), NorFlashErrorKind> {
        let cells = &mut *self.0.borrow_mut();
        cells.power = cells.power.saturating_sub(1);
        let lost = cells.power == 0;
        let done = if lost { len / 2 } else { len };
        cells.bytes[from..from + done].iter_mut().enumerate().for_each(|(k, byte)| *byte = to(*byte, k));
        cells.refused[from..from + len].fill(lost && cells.refuses);
        if lost { Err(NorFlashErrorKind::Other) } else { Ok(()) }
    }
}

impl ErrorType for Chip {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for Chip {
    const READ_SIZE: usize = 1;
    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Self::Error> {
        let (cells, place) = (self.0.borrow(), offset as usize..offset as usize + bytes.len());
        if cells.refused[place.clone()].contains(&true) {
            return Err(NorFlashErrorKind::Other);
        }
        bytes.copy_from_slice(&cells.bytes[place]);
        Ok(())
    }
    fn capacity(&self) -> usize {
        2 * SECTOR
    }
}

impl NorFlash for Chip {
    const WRITE_SIZE: usize = 32;
    const ERASE_SIZE: usize = SECTOR;
    fn erase(&mut self, from: u32, to: u32) -> Result<(), Self::Error> {
        self.change(from as usize, (to - from) as usize, |_, _| 0xFF)
    }
    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Self::Error> {
        assert!((offset as usize).is_multiple_of(Self::WRITE_SIZE) && bytes.len() == Self::WRITE_SIZE);
        self.change(offset as usize, bytes.len(), |old, k| old & bytes[k])
    }
}

fn content(length: u8, seed: u8) -> Vec<u8> {
    (0..length).map(|k| k.wrapping_mul(31).wrapping_add(seed)).collect()
}

fuzz_target!(|input: (Vec<Happening>, &[u8])| {
    let (happenings, rest) = input;
    let mut bytes = rest.to_vec();
    bytes.resize(2 * SECTOR, 0xFF);
    let refused = vec![false; bytes.len()];
    let cells = Cells { bytes, power: usize::MAX, refuses: false, refused };
    let chip = Chip(Rc::new(RefCell::new(cells)));
    let mut record = Record::new(chip.clone(), 0);
    // What may be loaded, and whether nothing else may.
    let (mut saved, mut last): (Vec<Vec<u8>>, Option<Vec<u8>>) = (vec![Vec::new()], None);
    for happening in happenings {
        match happening {
            Happening::Save { length, seed } => {
                let content = content(length, seed);
                match record.save(&content) {
                    Ok(()) => last = Some(content.clone()),
                    Err(error) => assert_eq!(error, FlashError::TooLong(record.capacity())),
                }
                saved.push(content);
            }
            Happening::Cut { length, seed, at, refused } => {
                let content = content(length, seed);
                (chip.0.borrow_mut().power, chip.0.borrow_mut().refuses) = (usize::from(at) + 1, refused);
                let result = record.save(&content);
                chip.0.borrow_mut().power = usize::MAX;
                match result {
                    Ok(()) => last = Some(content.clone()),
                    Err(FlashError::Failing) => {
                        // The old one or the new one.
                        let now = load(&mut record);
                        assert!(last.is_none() || now == last || now.as_ref() == Some(&content));
                        last = last.and(now);
                    }
                    Err(_) => {}
                }
                saved.push(content);
            }
            Happening::Flip { at, bit } => {
                chip.0.borrow_mut().bytes[usize::from(at) % (2 * SECTOR)] ^= 1 << (bit % 8);
                last = None;
            }
            Happening::Load { room } => {
                let _ = record.load(&mut vec![0; room.into()]);
            }
        }
        let found = load(&mut record);
        assert!(last.is_none() || found == last, "what was saved last is loaded");
        assert!(found.is_none_or(|found| saved.contains(&found)), "nothing is loaded that was not saved");
    }
});

fn load(record: &mut Record<Chip>) -> Option<Vec<u8>> {
    let mut buffer = vec![0; record.capacity()];
    record.load(&mut buffer).ok().map(|length| buffer[..length].to_vec())
}
