//! A link's bytes in pieces of any length: what is whole comes through once, nothing else does, and every byte is
//! counted, as the twin says that reads whole streams.
#![no_main]

use arbitrary::Arbitrary;
use host::source::serial::link;
use libfuzzer_sys::fuzz_target;
use shared::wire::{Decoder, MAX_FRAME};

#[derive(Arbitrary, Debug)]
enum Piece<'a> {
    /// Whatever it is.
    Bytes(&'a [u8]),
    Frame(u8, u16, &'a [u8]),
    /// A frame with a byte changed.
    Damaged(u8, u16, &'a [u8], u16, u8),
    /// A frame cut short.
    Cut(u8, u16, &'a [u8], u16),
}

impl Piece<'_> {
    fn bytes(&self) -> Vec<u8> {
        match *self {
            Self::Bytes(bytes) => bytes.to_vec(),
            Self::Frame(kind, number, payload) => oracle::link::frame(kind, number, payload),
            Self::Damaged(kind, number, payload, at, mask) => {
                let mut frame = oracle::link::frame(kind, number, payload);
                let at = usize::from(at) % frame.len();
                frame[at] ^= mask;
                frame
            }
            Self::Cut(kind, number, payload, at) => {
                let mut frame = oracle::link::frame(kind, number, payload);
                frame.truncate(usize::from(at) % frame.len());
                frame
            }
        }
    }
}

/// What frame a stretch between delimiters is, if it is one that fits.
fn frame(stretch: &[u8], room: usize) -> Option<(u8, u16, Vec<u8>)> {
    // Type, number and check sum are seven bytes.
    oracle::link::frames(stretch).pop().filter(|(_, _, payload)| payload.len() + 7 <= room)
}

fuzz_target!(|input: (u16, Vec<Piece<'_>>)| {
    let (room, pieces) = input;
    let pieces: Vec<Vec<u8>> = pieces.iter().map(Piece::bytes).collect();
    let mut buffer = vec![0; usize::from(room) % (MAX_FRAME + 1)];
    let room = buffer.len();
    let (mut decoder, mut received) = (Decoder::new(&mut buffer), Vec::new());
    for piece in &pieces {
        link::frames(&mut decoder, piece, |arrived| {
            let frame = arrived.frame();
            received.push((frame.kind, frame.sequence, frame.payload.to_vec()));
        });
    }

    let stream = pieces.concat();
    let (mut expected, mut repeated, mut rejected) = (Vec::new(), 0, 0);
    // Nobody knows where the first stretch began, and the last one goes on.
    let stretches: Vec<&[u8]> = stream.split(|byte| *byte == 0).collect();
    let ended = stretches.len() - 1;
    let mut last = None;
    for (place, stretch) in stretches[..ended].iter().enumerate() {
        match frame(stretch, room).filter(|_| place > 0) {
            None => rejected += stretch.len(),
            Some((_, number, _)) if number != 0 && last == Some(number) => repeated += 1,
            Some(whole) => {
                last = Some(whole.1);
                expected.push(whole);
            }
        }
    }
    assert_eq!(received, expected);
    let counters = decoder.counters();
    assert_eq!(counters.frames as usize, expected.len() + repeated);
    assert_eq!(counters.repeated as usize, repeated);
    assert_eq!(counters.rejected_bytes as usize, rejected);
});
