//! For tests: texts in JSON as others could have sent them, who know what would do harm.

use crate::random::Random;

/// What is put in: signs of JSON, paths, numbers beyond their range, bytes that are no text.
const PIECES: [&[u8]; 24] = [
    b"\"",
    b"{",
    b"}",
    b"[",
    b"]",
    b",",
    b":",
    b"\\",
    b"/",
    b"..",
    b"../",
    b"/../",
    b"./",
    b"\\u002e\\u002e\\u002f",
    b"\\u0000",
    b"\\ud800",
    b"null",
    b"-1",
    b"0",
    b"18446744073709551616",
    b"1e999",
    b" ",
    b"\xff",
    b"\xc3\xa4",
];

/// A text with one to four places changed: a piece put in, a stretch taken out or repeated, a bit flipped, or its end
/// cut off.
pub(crate) fn damaged(text: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = text.to_vec();
    for _ in 0..=random.bits() % 4 {
        let from = below(bytes.len() + 1, random);
        let to = from + below((bytes.len() - from).min(8) + 1, random);
        match random.bits() % 7 {
            0..=2 => drop(bytes.splice(from..from, PIECES[below(PIECES.len(), random)].iter().copied())),
            3 => drop(bytes.drain(from..to)),
            4 => {
                let again = bytes[from..to].to_vec();
                bytes.splice(from..from, again);
            }
            5 => bytes.truncate(from),
            _ => bytes[from..to].iter_mut().take(1).for_each(|byte| *byte ^= 1 << (random.bits() % 8)),
        }
    }
    bytes
}

fn below(count: usize, random: &mut Random) -> usize {
    (random.bits() % count as u64) as usize
}
