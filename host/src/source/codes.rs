//! Whether the codes of a JPEG come out even. JPEG has no check sum, but a changed byte mostly shifts the codes behind
//! it, so that at the end blocks are missing or bytes are left over. Baseline files of one scan, as cameras and most
//! programs write them, are looked at; of others nothing is said.

const START_OF_IMAGE: [u8; 2] = [0xff, 0xd8];
const END_OF_IMAGE: u8 = 0xd9;
const FIRST_RESTART: u8 = 0xd0;

/// The tables of frames that bring none of their own, as a segment has them: annex K.3 of the standard (ITU-T T.81).
#[rustfmt::skip]
const USUAL_TABLES: &[u8] = &[
    0x00, // counts, symbols
    0, 1, 5, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0,
    0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11,
    0x01, // counts, symbols
    0, 3, 1, 1, 1, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0,
    0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11,
    0x10, // counts, symbols
    0, 2, 1, 3, 3, 2, 4, 3, 5, 5, 4, 4, 0, 0, 1, 125,
    1, 2, 3, 0, 4, 17, 5, 18, 33, 49, 65, 6, 19, 81, 97, 7, 34, 113, 20, 50,
    129, 145, 161, 8, 35, 66, 177, 193, 21, 82, 209, 240, 36, 51, 98, 114, 130, 9, 10, 22,
    23, 24, 25, 26, 37, 38, 39, 40, 41, 42, 52, 53, 54, 55, 56, 57, 58, 67, 68, 69,
    70, 71, 72, 73, 74, 83, 84, 85, 86, 87, 88, 89, 90, 99, 100, 101, 102, 103, 104, 105,
    106, 115, 116, 117, 118, 119, 120, 121, 122, 131, 132, 133, 134, 135, 136, 137, 138, 146, 147, 148,
    149, 150, 151, 152, 153, 154, 162, 163, 164, 165, 166, 167, 168, 169, 170, 178, 179, 180, 181, 182,
    183, 184, 185, 186, 194, 195, 196, 197, 198, 199, 200, 201, 202, 210, 211, 212, 213, 214, 215, 216,
    217, 218, 225, 226, 227, 228, 229, 230, 231, 232, 233, 234, 241, 242, 243, 244, 245, 246, 247, 248,
    249, 250,
    0x11, // counts, symbols
    0, 2, 1, 2, 4, 4, 3, 4, 7, 5, 4, 4, 0, 1, 2, 119,
    0, 1, 2, 3, 17, 4, 5, 33, 49, 6, 18, 65, 81, 7, 97, 113, 19, 34, 50, 129,
    8, 20, 66, 145, 161, 177, 193, 9, 35, 51, 82, 240, 21, 98, 114, 209, 10, 22, 36, 52,
    225, 37, 241, 23, 24, 25, 26, 38, 39, 40, 41, 42, 53, 54, 55, 56, 57, 58, 67, 68,
    69, 70, 71, 72, 73, 74, 83, 84, 85, 86, 87, 88, 89, 90, 99, 100, 101, 102, 103, 104,
    105, 106, 115, 116, 117, 118, 119, 120, 121, 122, 130, 131, 132, 133, 134, 135, 136, 137, 138, 146,
    147, 148, 149, 150, 151, 152, 153, 154, 162, 163, 164, 165, 166, 167, 168, 169, 170, 178, 179, 180,
    181, 182, 183, 184, 185, 186, 194, 195, 196, 197, 198, 199, 200, 201, 202, 210, 211, 212, 213, 214,
    215, 216, 217, 218, 226, 227, 228, 229, 230, 231, 232, 233, 234, 242, 243, 244, 245, 246, 247, 248,
    249, 250,
];

/// Codes of one to sixteen bits: how many there are of each length, and what they mean.
#[derive(Clone, Copy)]
struct Table<'a> {
    counts: &'a [u8; 16],
    symbols: &'a [u8],
}

/// A component of the scan: its blocks in a unit, and the tables of their first and other coefficients.
struct Component<'a> {
    blocks: usize,
    tables: [Table<'a>; 2],
}

/// What is wrong with codes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(super) enum Fault {
    /// There is something else before all blocks are there.
    #[error("its codes end too early or mean nothing")]
    Short,
    /// Something else stands where codes begin anew.
    #[error("its codes do not begin anew where they should")]
    Restart,
    /// Something else follows the last block, before the end; some cameras fill up their frames there.
    #[error("its codes go on behind the image")]
    LeftOver,
}

/// What is wrong with the codes of a file, if that can be told.
pub(super) fn fault(file: &[u8]) -> Option<Fault> {
    let (mut tables, mut frame, mut interval) = ([None; 8], None, 0);
    define(&mut tables, USUAL_TABLES)?;
    let mut rest = file.strip_prefix(&START_OF_IMAGE)?;
    loop {
        let (&[0xff, marker, high, low], after) = rest.split_first_chunk()? else { return None };
        let length = usize::from(u16::from_be_bytes([high, low])).checked_sub(2)?;
        let (segment, after) = after.split_at_checked(length)?;
        rest = after;
        match marker {
            0xc4 => define(&mut tables, segment)?,
            0xc0 | 0xc1 => frame = Some(segment),
            0xc2..=0xcf => return None,
            0xdd => interval = usize::from(u16::from_be_bytes(*segment.first_chunk()?)),
            0xda => break scan(rest, segment, frame?, &tables, interval)?,
            _ => {}
        }
    }
}

/// Takes the tables of a segment, first those of first coefficients, then those of others, by their number.
fn define<'a>(tables: &mut [Option<Table<'a>>; 8], mut segment: &'a [u8]) -> Option<()> {
    while let Some((&which, rest)) = segment.split_first() {
        let (counts, rest) = rest.split_first_chunk()?;
        let (symbols, rest) = rest.split_at_checked(counts.iter().map(|&count| usize::from(count)).sum())?;
        *tables.get_mut(usize::from(which >> 4) * 4 + usize::from(which & 15))? =
            Some(Table { counts, symbols });
        segment = rest;
    }
    Some(())
}

/// What is wrong with the codes of a scan, if it is one that can be told of.
fn scan(
    codes: &[u8],
    scan: &[u8],
    frame: &[u8],
    tables: &[Option<Table<'_>>; 8],
    interval: usize,
) -> Option<Option<Fault>> {
    let (&[8, h0, h1, w0, w1, count], parts) = frame.split_first_chunk()? else { return None };
    let (&[in_scan], selected) = scan.split_first_chunk()?;
    if in_scan != count {
        return None;
    }
    let mut components = Vec::new();
    let mut most = [1; 2];
    for (part, select) in parts.chunks_exact(3).zip(selected.chunks_exact(2)).take(count.into()) {
        let sides = [part[1] >> 4, part[1] & 15].map(usize::from);
        most = [most[0].max(sides[0]), most[1].max(sides[1])];
        let table = |class: u8, number: u8| *tables.get(usize::from(class * 4 + number))?;
        let tables = [table(0, select[1] >> 4)?, table(1, select[1] & 15)?];
        components.push(Component { blocks: sides[0] * sides[1], tables });
    }
    if let [one] = &mut components[..] {
        (one.blocks, most) = (1, [1, 1]);
    }
    let sides = [[w0, w1], [h0, h1]].map(|side| usize::from(u16::from_be_bytes(side)));
    let units = sides[0].div_ceil(8 * most[0]) * sides[1].div_ceil(8 * most[1]);
    let mut codes = Codes { rest: codes, byte: 0, left: 0 };
    for unit in 0..units {
        if interval > 0 && unit > 0 && unit % interval == 0 {
            let number = (unit / interval - 1) % 8;
            if codes.marker() != Some(FIRST_RESTART + number as u8) {
                return Some(Some(Fault::Restart));
            }
        }
        for component in &components {
            if (0..component.blocks).any(|_| codes.block(&component.tables).is_none()) {
                return Some(Some(Fault::Short));
            }
        }
    }
    if codes.marker() == Some(END_OF_IMAGE) {
        return Some(None);
    }
    let ends = codes.rest.windows(2).any(|pair| pair == [0xff, END_OF_IMAGE]);
    Some(Some(if ends { Fault::LeftOver } else { Fault::Short }))
}

/// The bits of a scan.
struct Codes<'a> {
    rest: &'a [u8],
    byte: u8,
    /// Bits of the byte that are still to come.
    left: u32,
}

impl Codes<'_> {
    fn byte(&mut self) -> Option<()> {
        (self.byte, self.rest) = match self.rest {
            [0xff, 0, rest @ ..] => (0xff, rest),
            [0xff, ..] | [] => return None,
            [byte, rest @ ..] => (*byte, rest),
        };
        self.left = 8;
        Some(())
    }

    fn bit(&mut self) -> Option<usize> {
        if self.left == 0 {
            self.byte()?;
        }
        self.left -= 1;
        Some(usize::from(self.byte >> self.left & 1))
    }

    fn skip(&mut self, bits: u8) -> Option<()> {
        let mut bits = u32::from(bits);
        while bits > self.left {
            bits -= self.left;
            self.byte()?;
        }
        self.left -= bits;
        Some(())
    }

    /// What the next code means.
    fn symbol(&mut self, table: &Table<'_>) -> Option<u8> {
        // Codes of a length follow one another, and those of the next length follow them with a bit more.
        let (mut code, mut first, mut before) = (0, 0, 0);
        for &count in table.counts {
            code = code << 1 | self.bit()?;
            first <<= 1;
            if let Some(place) = code.checked_sub(first)
                && place < usize::from(count)
            {
                return table.symbols.get(before + place).copied();
            }
            first += usize::from(count);
            before += usize::from(count);
        }
        None
    }

    /// Passes over a block.
    fn block(&mut self, [first, others]: &[Table<'_>; 2]) -> Option<()> {
        let size = self.symbol(first).filter(|&size| size <= 11)?;
        self.skip(size)?;
        let mut coefficient = 1;
        while coefficient < 64 {
            let symbol = self.symbol(others)?;
            match (symbol >> 4, symbol & 15) {
                (0, 0) => break,
                (15, 0) => coefficient += 16,
                (_, 0) => return None,
                (zeros, size) => {
                    coefficient += zeros + 1;
                    self.skip(size)?;
                }
            }
        }
        (coefficient <= 64).then_some(())
    }

    /// The marker that follows, but for the bits that fill the last byte.
    fn marker(&mut self) -> Option<u8> {
        self.left = 0;
        while let [0xff, 0xff, ..] = self.rest {
            self.rest = &self.rest[1..];
        }
        let &[0xff, marker, ref rest @ ..] = self.rest else { return None };
        self.rest = rest;
        Some(marker)
    }
}
