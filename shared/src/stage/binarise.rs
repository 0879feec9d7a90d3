//! Grey image to bitmap: what is object, what is background.
//!
//! Paper: section 3.2 asks for a foreground that is "quite different from the background" and starts
//! from binary images; how they are made is ours.
//!
//! | | |
//! |---|---|
//! | in | rows of 8-bit grey values |
//! | out | a [`Bitmap`], set where the object is |
//! | steps | 3x3 median, histogram, level, comparison; the first and the last work row by row |
//! | memory | the median of a whole image needs a second image; row by row it needs three rows |
//! | cost | linear in the pixels; on a Cortex-M7 17 instructions a pixel for the median, 5 for the histogram, 3 for the comparison |
//!
//! The median repeats the outermost pixels beyond the border, and the level of Otsu (1979) is the first
//! maximum of the variance between the classes, as in OpenCV (`medianBlur`, `THRESH_OTSU`). OpenCV
//! compares variances in floating point, so that where several levels are equally good, as in the gap
//! between two modes, it may pick another than the first; the bitmap is then the same.
//!
//! Not promised: a sensible level for an image without two classes. An image of one grey value gives
//! level 0.

use crate::bitmap::{Bitmap, Grey, WORD_BITS, Word};
use crate::limits::CapacityError;
use core::ops::Range;

/// Number of pixels of each grey value.
pub type Histogram = [u32; 256];

/// Pixels in a word of grey values.
const BYTES: usize = size_of::<Word>();

/// How the level between object and background is chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Threshold {
    /// From the histogram, by [`otsu`].
    #[default]
    Otsu,
    /// Given: values above it are bright.
    Fixed(u8),
}

impl Threshold {
    /// The level: grey values above it are bright.
    pub fn level(self, histogram: &Histogram) -> u8 {
        match self {
            Self::Otsu => otsu(histogram),
            Self::Fixed(level) => level,
        }
    }
}

/// Which side of the level is the object.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Polarity {
    /// A bright object on a dark background.
    #[default]
    BrightObject,
    /// A dark object on a bright background.
    DarkObject,
    /// The background is what most of the image border is made of; bright object when it is a draw.
    Auto,
}

/// The side of the level on which the object lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tone {
    /// Above it.
    Bright,
    /// Not above it.
    Dark,
}

impl Polarity {
    /// The tone of the object in this image.
    pub fn tone(self, grey: Grey<'_>, level: u8) -> Tone {
        match self {
            Self::BrightObject => Tone::Bright,
            Self::DarkObject => Tone::Dark,
            Self::Auto => opposite_of_border(grey, level),
        }
    }
}

fn opposite_of_border(grey: Grey<'_>, level: u8) -> Tone {
    let size = grey.size();
    let (mut bright, mut dark) = (0u32, 0u32);
    for v in 0..size.height {
        let whole = v == 0 || v + 1 == size.height;
        let first_to_last = size.width.saturating_sub(1).max(1);
        for &value in grey.row(v).iter().step_by(if whole { 1 } else { first_to_last }) {
            if value > level { bright += 1 } else { dark += 1 }
        }
    }
    if bright > dark { Tone::Dark } else { Tone::Bright }
}

/// A function like [`median_row`].
pub type MedianRow = fn(&[u8], &[u8], &[u8], &mut [u8]);

/// The 3x3 median of a row from the three input rows around it; beyond its ends the row repeats its
/// outermost pixels. Fills as many pixels as the shortest of the four slices has.
pub fn median_row(above: &[u8], here: &[u8], below: &[u8], out: &mut [u8]) {
    // Neither ends nor bounds to look at: a compiler makes vectors of it.
    let windows = above.windows(3).zip(here.windows(3)).zip(below.windows(3));
    for (((a, b), c), out) in windows.zip(out.iter_mut().skip(1)) {
        let column = |k: usize| sorted(a[k], b[k], c[k], order_of_bytes);
        *out = median_of_columns(column(0), column(1), column(2), order_of_bytes);
    }
    let width = above.len().min(here.len()).min(below.len()).min(out.len());
    for u in [0, width.saturating_sub(1)] {
        median_at([above, here, below], out, u..u + 1);
    }
}

/// [`median_row`] four pixels at a time, for a processor that takes bytes from bytes within a word:
/// `excess` gives for each byte by how much that of the first word exceeds that of the second, or 0.
#[inline(always)]
pub fn median_row_by_fours(
    [above, here, below]: [&[u8]; 3],
    out: &mut [u8],
    excess: impl Fn(u32, u32) -> u32 + Copy,
) {
    // Neither the difference nor the sum carries from byte to byte.
    let order = |a: u32, b: u32| (a - excess(a, b), b + excess(a, b));
    let words = above.as_chunks::<4>().0.iter().zip(here.as_chunks::<4>().0).zip(below.as_chunks::<4>().0);
    let mut columns = words.map(|((a, b), c)| {
        sorted(u32::from_le_bytes(*a), u32::from_le_bytes(*b), u32::from_le_bytes(*c), order)
    });
    // A word of medians lies one pixel east of a word of columns.
    let (medians, _) = out.get_mut(1..).unwrap_or_default().as_chunks_mut::<4>();
    let mut done = 1;
    if let Some(mut west) = columns.next() {
        for (median, next) in medians.iter_mut().zip(columns) {
            let shifted = |by: u32| {
                let place = |west: u32, next: u32| west >> by | next << (32 - by);
                (place(west.0, next.0), place(west.1, next.1), place(west.2, next.2))
            };
            *median = median_of_columns(west, shifted(8), shifted(16), order).to_le_bytes();
            west = next;
            done += 4;
        }
    }
    let width = above.len().min(here.len()).min(below.len()).min(out.len());
    median_at([above, here, below], out, 0..1);
    median_at([above, here, below], out, done..width);
}

/// [`median_row`] of some pixels, one at a time.
fn median_at([above, here, below]: [&[u8]; 3], out: &mut [u8], pixels: Range<usize>) {
    let column = |u: usize| Some(sorted(*above.get(u)?, *here.get(u)?, *below.get(u)?, order_of_bytes));
    for u in pixels {
        let (Some(centre), Some(out)) = (column(u), out.get_mut(u)) else { return };
        let west = column(u.wrapping_sub(1)).unwrap_or(centre);
        let east = column(u + 1).unwrap_or(centre);
        *out = median_of_columns(west, centre, east, order_of_bytes);
    }
}

/// The lesser and the greater of two.
fn order_of_bytes(a: u8, b: u8) -> (u8, u8) {
    (a.min(b), a.max(b))
}

/// Median of nine values given as three sorted columns (Smith 1996): it is the median of the largest
/// minimum, the median of the medians, and the smallest maximum.
#[inline(always)]
fn median_of_columns<T: Copy>(
    a: (T, T, T),
    b: (T, T, T),
    c: (T, T, T),
    order: impl Fn(T, T) -> (T, T) + Copy,
) -> T {
    let low = order(order(a.0, b.0).1, c.0).1;
    let middle = sorted(a.1, b.1, c.1, order).1;
    let high = order(order(a.2, b.2).0, c.2).0;
    sorted(low, middle, high, order).1
}

#[inline(always)]
fn sorted<T: Copy>(a: T, b: T, c: T, order: impl Fn(T, T) -> (T, T)) -> (T, T, T) {
    let (low, high) = order(a, b);
    let (middle, high) = order(high, c);
    let (low, middle) = order(low, middle);
    (low, middle, high)
}

/// The 3x3 median of an image, by `median_row`, in `buffer`, of which it takes the first width x height
/// bytes.
///
/// # Errors
/// A [`CapacityError`] when the buffer is shorter than the image.
pub fn median<'b>(
    grey: Grey<'_>,
    buffer: &'b mut [u8],
    median_row: MedianRow,
) -> Result<Grey<'b>, CapacityError> {
    let size = grey.size();
    let limit = buffer.len();
    let out =
        buffer.get_mut(..size.pixels()).ok_or(CapacityError { what: "bytes in a grey image", limit })?;
    let bottom = size.height.saturating_sub(1);
    for (v, row) in out.chunks_exact_mut(size.width.max(1)).enumerate() {
        median_row(grey.row(v.saturating_sub(1)), grey.row(v), grey.row((v + 1).min(bottom)), row);
    }
    Grey::new(size, size.width, out)
}

/// Add a row to a histogram; counts stay at the largest once they reach it.
pub fn count_row(histogram: &mut Histogram, row: &[u8]) {
    for &value in row {
        let bin = &mut histogram[usize::from(value)];
        *bin = bin.saturating_add(1);
    }
}

/// The histogram of an image.
///
/// Neighbours count in tables of their own: they tend to be equal, and a count that waits for the one before
/// it is slow. No count of a raster comes near its limit.
pub fn histogram(grey: Grey<'_>) -> Histogram {
    let mut tables = [[[0u32; 256]; 4]; BYTES / 4];
    for v in 0..grey.size().height {
        let (words, rest) = grey.row(v).as_chunks::<BYTES>();
        for word in words {
            for ([a, b, c, d], four) in tables.iter_mut().zip(word.as_chunks::<4>().0) {
                let [p, q, r, s] = four.map(usize::from);
                a[p] += 1;
                b[q] += 1;
                c[r] += 1;
                d[s] += 1;
            }
        }
        count_row(&mut tables[0][0], rest);
    }
    let mut sums = [0; 256];
    for table in tables.as_flattened() {
        sums.iter_mut().zip(table).for_each(|(sum, count)| *sum += count);
    }
    sums
}

/// Otsu's level: the first one that maximises the variance between the values up to it and those above
/// it, compared exactly. 0 when there are no two classes.
///
/// With n0 values of sum s0 up to the level, n1 above, and n of sum s in all, the variance is
/// (n s0 - n0 s)^2 / (n0 n1), up to a constant. For n < 2^25 the square is below 2^112 and the divisor
/// below 2^48; fractions are compared crosswise. A histogram of more pixels, which no raster of the core
/// gives, is first scaled down by a power of two.
pub fn otsu(histogram: &Histogram) -> u8 {
    let pixels: u64 = histogram.iter().map(|&h| u64::from(h)).sum();
    let halvings = pixels.checked_ilog2().unwrap_or(0).saturating_sub(24);
    let bins = || (0..=u8::MAX).zip(histogram).map(|(value, &h)| (value, u64::from(h >> halvings)));
    let (n, s) = bins().fold((0, 0), |(n, s), (value, h)| (n + h, s + u64::from(value) * h));
    let (mut n0, mut s0) = (0, 0);
    let (mut level, mut best) = (0, (0, 1));
    // A value that is not there changes nothing.
    for (value, h) in bins().filter(|(_, h)| *h > 0) {
        n0 += h;
        s0 += u64::from(value) * h;
        // Products below 2^58, their difference below 2^56.
        let variance = (u128::from((n * s0).abs_diff(n0 * s)).pow(2), n0 * (n - n0));
        if variance.1 > 0 && times(variance.0, best.1) > times(best.0, variance.1) {
            (level, best) = (value, variance);
        }
    }
    level
}

/// The product of a number below 2^128 and one below 2^63: what is above the lowest 64 bits, and these.
fn times(a: u128, b: u64) -> (u128, u64) {
    let low = u128::from(a as u64) * u128::from(b);
    ((a >> 64) * u128::from(b) + (low >> 64), low as u64)
}

/// The bits of a row: set where a grey value lies on the object's side of the level. Fills as many
/// words as the row has; `out` beyond them is left alone.
pub fn binarise_row(row: &[u8], level: u8, tone: Tone, out: &mut [Word]) {
    let dark = if tone == Tone::Dark { Word::MAX } else { 0 };
    let bright = above(level);
    let bits = |values: &[u8; WORD_BITS]| {
        let groups = values.as_chunks::<BYTES>().0;
        groups.iter().fold(0, |bits, group| bits >> BYTES | bright(*group)) ^ dark
    };
    let (whole, rest) = row.as_chunks::<WORD_BITS>();
    for (word, values) in out.iter_mut().zip(whole) {
        *word = bits(values);
    }
    if let Some(word) = out.get_mut(whole.len()).filter(|_| !rest.is_empty()) {
        let mut values = [0; WORD_BITS];
        values[..rest.len()].copy_from_slice(rest);
        *word = bits(&values) & Word::MAX >> (WORD_BITS - rest.len());
    }
}

/// Tells which of [`BYTES`] values lie above a level, in as many of a word's uppermost bits.
///
/// A value lies above the level if its sum with what the level lacks of 255 does not fit a byte, so by the
/// eighth bit of half that sum. The product then brings the eighth bits together: each of its terms falls on
/// a bit of its own.
fn above(level: u8) -> impl Fn([u8; BYTES]) -> Word + Copy {
    const ONES: Word = Word::MAX / 255;
    const LOWER: Word = ONES * 0x7F;
    const GATHER: Word = (Word::MAX / 127) >> BYTES;
    let lacking = Word::from(u8::MAX - level) * ONES;
    move |values| {
        let values = Word::from_le_bytes(values);
        let half_sum = (values & lacking) + ((values ^ lacking) >> 1 & LOWER);
        (half_sum & !LOWER).wrapping_mul(GATHER) & !(Word::MAX >> BYTES)
    }
}

/// The bitmap of an image, in `words`.
///
/// # Errors
/// A [`CapacityError`] when there are fewer words than the bitmap has.
pub fn binarise<'w>(
    grey: Grey<'_>,
    level: u8,
    tone: Tone,
    words: &'w mut [Word],
) -> Result<Bitmap<'w>, CapacityError> {
    let mut bitmap = Bitmap::over(grey.size(), words)?;
    for v in 0..grey.size().height {
        binarise_row(grey.row(v), level, tone, bitmap.row_mut(v as i32));
    }
    Ok(bitmap)
}
