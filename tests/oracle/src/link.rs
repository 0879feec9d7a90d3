//! A serial link with its faults, and what travels on it, read the plain way: whole streams at once, bit by
//! bit check sums.

use crate::raster::Random;

/// CRC-32/ISO-HDLC by its definition: a division of polynomials over bits.
pub fn crc32(bytes: &[u8]) -> u32 {
    let mut rest = u32::MAX;
    for byte in bytes {
        rest ^= u32::from(*byte);
        for _ in 0..8 {
            rest = if rest & 1 == 1 { rest >> 1 ^ 0xEDB8_8320 } else { rest >> 1 };
        }
    }
    !rest
}

/// What COBS made of bytes without zeros, if it is COBS.
pub fn unstuff(mut stuffed: &[u8]) -> Option<Vec<u8>> {
    let mut plain = Vec::new();
    while let Some((code, rest)) = stuffed.split_first() {
        let (block, further) = rest.split_at_checked(usize::from(*code).checked_sub(1)?)?;
        plain.extend(block);
        if *code < 255 && !further.is_empty() {
            plain.push(0);
        }
        stuffed = further;
    }
    Some(plain)
}

/// COBS, block by block.
pub fn stuff(plain: &[u8]) -> Vec<u8> {
    let mut stuffed = Vec::new();
    let mut rest = plain;
    loop {
        let run = rest.iter().take(254).take_while(|b| **b != 0).count();
        stuffed.push(run as u8 + 1);
        stuffed.extend(&rest[..run]);
        let ended = run == rest.len();
        rest = &rest[run..];
        if ended {
            return stuffed;
        }
        rest = if run < 254 { &rest[1..] } else { rest };
    }
}

/// A frame as it travels, both delimiters included.
pub fn frame(kind: u8, sequence: u16, payload: &[u8]) -> Vec<u8> {
    let [low, high] = sequence.to_le_bytes();
    let content = [&[kind, low, high], payload].concat();
    let whole = [content.as_slice(), &crc32(&content).to_le_bytes()].concat();
    [&[0], stuff(&whole).as_slice(), &[0]].concat()
}

/// Type, sequence number and payload of every frame of a stream that is whole.
pub fn frames(stream: &[u8]) -> Vec<(u8, u16, Vec<u8>)> {
    let whole = |stuffed: &[u8]| {
        let plain = unstuff(stuffed)?;
        let (content, sum) = plain.split_last_chunk::<4>()?;
        let ([kind, low, high], payload) = content.split_first_chunk::<3>()?;
        let right = crc32(content).to_le_bytes() == *sum;
        right.then(|| (*kind, u16::from_le_bytes([*low, *high]), payload.to_vec()))
    };
    stream.split(|b| *b == 0).filter_map(whole).collect()
}

/// What a bad link does to a stream of bytes.
#[derive(Clone, Copy, Debug)]
pub enum Fault {
    /// Some bits arrive as their opposite.
    Flips(u64),
    /// Some bytes in a row never arrive.
    Drops(usize),
    /// Some bytes in a row arrive twice.
    Doubles(usize),
    /// Some bytes in a row are noise.
    Noise(usize),
}

impl Fault {
    /// Let it happen somewhere in the stream; returns where, as a range of the stream before.
    pub fn strike(self, stream: &mut Vec<u8>, random: &mut Random) -> std::ops::Range<usize> {
        let mut somewhere = |len: usize| {
            let start = random.below((stream.len() - len.min(stream.len()) + 1) as u64) as usize;
            start..(start + len).min(stream.len())
        };
        match self {
            Self::Flips(count) => {
                let hits: Vec<usize> = (0..count).map(|_| somewhere(1).start.min(stream.len() - 1)).collect();
                for at in &hits {
                    stream[*at] ^= 1 << random.below(8);
                }
                hits.iter().min().copied().unwrap_or(0)..hits.iter().max().map_or(0, |at| at + 1)
            }
            Self::Drops(len) => {
                let hit = somewhere(len);
                stream.drain(hit.clone());
                hit
            }
            Self::Doubles(len) => {
                let hit = somewhere(len);
                let again = stream[hit.clone()].to_vec();
                stream.splice(hit.end..hit.end, again);
                hit
            }
            Self::Noise(len) => {
                let hit = somewhere(len);
                stream[hit.clone()].iter_mut().for_each(|byte| *byte = random.below(256) as u8);
                hit
            }
        }
    }
}
