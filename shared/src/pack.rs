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
    let limit = bytes.len();
    let bytes = bytes.get(..size.pixels()).ok_or(CapacityError { what: "bytes of a mask", limit })?;
    let mut bitmap = Bitmap::over(size, words)?;
    for (v, row) in bytes.chunks_exact(size.width.max(1)).enumerate() {
        for (word, pixels) in bitmap.row_mut(v as i32).iter_mut().zip(row.chunks(WORD_BITS)) {
            let (eights, rest) = pixels.as_chunks();
            let mut last = [0; 8];
            last[..rest.len()].copy_from_slice(rest);
            let all = eights.iter().chain([&last]).take(WORD_BITS / 8).enumerate();
            *word = all.fold(0, |word, (k, eight)| word | Word::from(packed(*eight)) << (8 * k));
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
        for (word, pixels) in bitmap.row(v as i32).iter().zip(row.chunks_mut(WORD_BITS)) {
            if *word == 0 {
                continue;
            }
            let (eights, rest) = pixels.as_chunks_mut();
            for (eight, byte) in eights.iter_mut().zip(word.to_le_bytes()) {
                *eight = unpacked(byte);
            }
            if let Some(byte) = word.to_le_bytes().get(eights.len()) {
                rest.copy_from_slice(&unpacked(*byte)[..rest.len()]);
            }
        }
    }
    Ok(())
}

/// Bit `k` for each byte `k` that is not 0.
fn packed(bytes: [u8; 8]) -> u8 {
    let bytes = u64::from_le_bytes(bytes);
    // The high bit of each byte that is not 0, moved to its lowest; the product gathers them in the top byte.
    let set = (((bytes & LOW) + LOW) | bytes) >> 7 & ONES;
    (set.wrapping_mul(0x0102_0408_1020_4080) >> 56) as u8
}

/// 255 for each bit that is set.
fn unpacked(bits: u8) -> [u8; 8] {
    let set = (((u64::from(bits) * ONES) & DIAGONAL) + LOW) >> 7 & ONES;
    (set * 255).to_le_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eight_pixels_at_a_time() {
        for bits in 0..=u8::MAX {
            let expected = core::array::from_fn(|k| if bits >> k & 1 == 1 { u8::MAX } else { 0 });
            assert_eq!(unpacked(bits), expected);
            for value in [1, 127, 128, 255] {
                assert_eq!(packed(expected.map(|byte| byte & value)), bits);
            }
        }
    }

    #[test]
    fn masks_of_every_width_come_back() {
        for width in 0..200 {
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
