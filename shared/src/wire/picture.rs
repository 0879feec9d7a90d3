//! Parts of a picture that was asked for once: rows of grey values, or of a mask's bits.
//!
//! ```text
//! pair u32 | eye u8 | kind u8 | width u16 | height u16 | first row u16 | bytes u16 | the bytes
//! ```
//!
//! A row of grey is `width` bytes; a row of a mask is one bit a pixel, the lowest of a byte first, in whole
//! bytes. A mask is an eighth of its picture as it is; runs would save little more of a thing asked for once.
//! Rows come in any number of parts, each whole; whoever gets them all has the picture.

use super::WireError;
use super::bytes::Reader;
use super::finding::{side, side_code};
use super::frame::Writer;
use crate::bitmap::{Bitmap, Word};
use crate::limits::{CapacityError, MAX_SIDE};
use crate::pipeline::Side;

/// What a picture shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PictureKind {
    /// Grey values as the camera gave them.
    Grey,
    /// The object, clean.
    Mask,
}

impl PictureKind {
    pub(super) const fn code(self) -> u8 {
        match self {
            Self::Grey => 0,
            Self::Mask => 1,
        }
    }

    pub(super) const fn of(code: u8) -> Result<Self, WireError> {
        match code {
            0 => Ok(Self::Grey),
            1 => Ok(Self::Mask),
            code => Err(WireError::Unknown { what: "kind of picture", code }),
        }
    }

    /// Bytes of a row of `width` px.
    pub const fn row_bytes(self, width: u16) -> usize {
        match self {
            Self::Grey => width as usize,
            Self::Mask => (width as usize).div_ceil(8),
        }
    }
}

/// Some rows of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PicturePart<'a> {
    /// Number of the pair that it is of.
    pub pair: u32,
    /// Which eye's it is.
    pub eye: Side,
    /// What it shows.
    pub kind: PictureKind,
    /// Width of the picture, px; at least 1.
    pub width: u16,
    /// Height of the picture, px; at least 1.
    pub height: u16,
    /// The first row of this part.
    pub first_row: u16,
    /// Whole rows, [`PictureKind::row_bytes`] each.
    pub rows: &'a [u8],
}

impl<'a> PicturePart<'a> {
    /// Number of rows.
    pub fn row_count(&self) -> usize {
        self.rows.len() / self.kind.row_bytes(self.width).max(1)
    }

    pub(super) fn write(&self, writer: &mut Writer<'_>) -> Result<(), CapacityError> {
        let limit = usize::from(u16::MAX);
        let bytes =
            u16::try_from(self.rows.len()).map_err(|_| CapacityError { what: "bytes in a frame", limit })?;
        writer.u32(self.pair);
        writer.u8(side_code(self.eye) as u8);
        writer.u8(self.kind.code());
        writer.u16(self.width);
        writer.u16(self.height);
        writer.u16(self.first_row);
        writer.u16(bytes);
        writer.put(self.rows);
        Ok(())
    }

    pub(super) fn read(reader: &mut Reader<'a>) -> Result<Self, WireError> {
        let pair = reader.u32()?;
        let eye = side(reader.u8()?.into())?;
        let kind = PictureKind::of(reader.u8()?)?;
        let (width, height) = (reader.u16()?, reader.u16()?);
        let first_row = reader.u16()?;
        let bytes = reader.u16()?;
        let part = Self { pair, eye, kind, width, height, first_row, rows: reader.take(bytes.into())? };
        let sides = 1..=MAX_SIDE as u16;
        if !(sides.contains(&width) && sides.contains(&height)) {
            return Err(WireError::Invalid("size of a picture"));
        }
        let whole = part.rows.len() == part.row_count() * kind.row_bytes(width);
        let within = usize::from(first_row) + part.row_count() <= height.into();
        if part.rows.is_empty() || !whole || !within {
            return Err(WireError::Invalid("number of rows"));
        }
        Ok(part)
    }
}

/// Pack row `v` of a mask as a part has it; returns the bytes written.
///
/// # Errors
/// A [`CapacityError`] when `out` is too short.
pub fn pack_mask<'o>(mask: &Bitmap<'_>, v: u16, out: &'o mut [u8]) -> Result<&'o [u8], CapacityError> {
    let limit = out.len();
    let bytes = mask.size().width.div_ceil(8);
    let out = out.get_mut(..bytes).ok_or(CapacityError { what: "bytes in a frame", limit })?;
    let words = mask.row(v.into()).iter().copied().map(Word::to_le_bytes);
    for (chunk, word) in out.chunks_mut(size_of::<Word>()).zip(words) {
        chunk.iter_mut().zip(word).for_each(|(to, from)| *to = from);
    }
    Ok(out)
}
