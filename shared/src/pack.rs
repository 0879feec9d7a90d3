//! Masks of a byte a pixel, as other programs keep them, to bitmaps and back.
//!
//! **In**: bytes row after row, 0 for clear and anything else for set. **Out**: a [`Bitmap`]; back, bytes of 0
//! and 255. **Cost**: about ten operations for eight pixels.

use crate::bitmap::{Bitmap, Size, WORD_BITS, Word};
use crate::limits::CapacityError;

/// One in each byte.
const ONES: u64 = u64::MAX / 255;
/// All bits of each byte but the highest.
const LOW: u64 = !(ONES << 7);
/// Byte `k` has bit `k`.
const DIAGONAL: u64 = 0x8040_2010_0804_0201;

/// A bitmap in `words` of the bytes that are not 0.
///
/// # Errors
/// A [`CapacityError`] when there are fewer bytes or words than the size says.
pub fn pack<'w>(size: Size, bytes: &[u8], words: &'w mut [Word]) -> Result<Bitmap<'w>, CapacityError> {
    pack_by(packed, size, bytes, words)
}

/// [`pack`] with a machine's own way to pack a word: bit `k` for each byte `k` that is not 0.
///
/// # Errors
/// As [`pack`].
#[inline(always)]
pub fn pack_by<'w>(
    packed: impl Fn(&[u8; WORD_BITS]) -> Word,
    size: Size,
    bytes: &[u8],
    words: &'w mut [Word],
) -> Result<Bitmap<'w>, CapacityError> {
    let limit = bytes.len();
    let bytes = bytes.get(..size.pixels()).ok_or(CapacityError { what: "bytes of a mask", limit })?;
    let mut bitmap = Bitmap::over(size, words)?;
    for (v, row) in bytes.chunks_exact(size.width.max(1)).enumerate() {
        let (wholes, rest) = row.as_chunks();
        let words = bitmap.row_mut(v as i32);
        for (word, pixels) in words.iter_mut().zip(wholes) {
            *word = packed(pixels);
        }
        if let Some(word) = words.get_mut(wholes.len()) {
            let mut pixels = [0; WORD_BITS];
            pixels[..rest.len()].copy_from_slice(rest);
            *word = packed(&pixels);
        }
    }
    Ok(bitmap)
}

/// The bitmap as bytes of 0 and 255.
///
/// # Errors
/// A [`CapacityError`] when there are fewer bytes than pixels.
pub fn unpack(bitmap: &Bitmap<'_>, bytes: &mut [u8]) -> Result<(), CapacityError> {
    let (size, limit) = (bitmap.size(), bytes.len());
    let bytes = bytes.get_mut(..size.pixels()).ok_or(CapacityError { what: "bytes of a mask", limit })?;
    // Words without a pixel, most of a skeleton's, cost nothing but their zeros.
    bytes.fill(0);
    for (v, row) in bytes.chunks_exact_mut(size.width.max(1)).enumerate() {
        let (wholes, rest) = row.as_chunks_mut();
        let words = bitmap.row(v as i32);
        for (word, pixels) in words.iter().zip(&mut *wholes).filter(|(word, _)| **word != 0) {
            *pixels = unpacked(*word);
        }
        if let Some(word) = words.get(wholes.len()) {
            rest.copy_from_slice(&unpacked(*word)[..rest.len()]);
        }
    }
    Ok(())
}

/// Bit `k` for each byte `k` that is not 0.
fn packed(bytes: &[u8; WORD_BITS]) -> Word {
    let (eights, _) = bytes.as_chunks();
    let mut words = [0; WORD_BITS / 8];
    for (word, eight) in words.iter_mut().zip(eights) {
        *word = u64::from_le_bytes(*eight);
    }
    // Most words have pixels of one kind.
    match words.iter().fold((0, u64::MAX), |(any, all), word| (any | word, all & word)) {
        (0, _) => 0,
        (_, u64::MAX) => Word::MAX,
        _ => words.iter().rev().fold(0, |word, eight| word << 8 | Word::from(packed_eight(*eight))),
    }
}

/// Bit `k` for each byte `k` that is not 0.
fn packed_eight(bytes: u64) -> u8 {
    // The high bit of each byte that is not 0, moved to its lowest; the product gathers them in the top byte.
    let set = (((bytes & LOW) + LOW) | bytes) >> 7 & ONES;
    (set.wrapping_mul(0x0102_0408_1020_4080) >> 56) as u8
}

/// 255 for each bit that is set.
fn unpacked(word: Word) -> [u8; WORD_BITS] {
    let mut bytes = [0; WORD_BITS];
    for (eight, bits) in bytes.as_chunks_mut().0.iter_mut().zip(word.to_le_bytes()) {
        *eight = unpacked_eight(bits);
    }
    bytes
}

/// As [`unpacked`], of eight bits.
fn unpacked_eight(bits: u8) -> [u8; 8] {
    let set = (((u64::from(bits) * ONES) & DIAGONAL) + LOW) >> 7 & ONES;
    (set * 255).to_le_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples;

    #[test]
    fn eight_pixels_at_a_time() {
        for bits in 0..=u8::MAX {
            let expected = core::array::from_fn(|k| if bits >> k & 1 == 1 { u8::MAX } else { 0 });
            assert_eq!(unpacked_eight(bits), expected);
            for value in [1, 127, 128, 255] {
                assert_eq!(packed_eight(u64::from_le_bytes(expected.map(|byte| byte & value))), bits);
            }
        }
    }

    #[test]
    fn masks_of_every_width_come_back() {
        for width in 0..samples(200, 70) {
            let size = Size::new(width, 3).unwrap();
            let mut mask = [0; 600];
            let mut seed = width as u32;
            for byte in &mut mask[..size.pixels()] {
                seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                *byte = if seed >> 31 == 1 { (seed >> 16) as u8 } else { 0 };
            }
            let mut words = [Word::MAX; 64];
            let bitmap = pack(size, &mask, &mut words).unwrap();
            let mut back = [7; 600];
            unpack(&bitmap, &mut back).unwrap();
            for (k, (byte, back)) in mask.iter().zip(back).enumerate().take(size.pixels()) {
                assert_eq!(back, if *byte == 0 { 0 } else { 255 }, "{k}");
            }
            assert_eq!(bitmap.count(), mask.iter().filter(|byte| **byte != 0).count());
            if width > 0 {
                assert!(pack(size, &mask[..3 * width - 1], &mut [0; 64]).is_err());
            }
        }
    }
}
