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
//! | cost | linear in the pixels |
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

/// Number of pixels of each grey value.
pub type Histogram = [u32; 256];

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
    let mut columns = above.iter().zip(here).zip(below).map(|((&a, &b), &c)| sorted(a, b, c));
    let Some(first) = columns.next() else { return };
    let (mut west, mut centre) = (first, first);
    let width = above.len().min(here.len()).min(below.len());
    for out in out.iter_mut().take(width) {
        let east = columns.next().unwrap_or(centre);
        *out = median_of_columns([west, centre, east]);
        (west, centre) = (centre, east);
    }
}

/// Median of nine values given as three sorted columns (Smith 1996): it is the median of the largest
/// minimum, the median of the medians, and the smallest maximum.
fn median_of_columns([a, b, c]: [[u8; 3]; 3]) -> u8 {
    let low = a[0].max(b[0]).max(c[0]);
    let middle = sorted(a[1], b[1], c[1])[1];
    let high = a[2].min(b[2]).min(c[2]);
    sorted(low, middle, high)[1]
}

fn sorted(a: u8, b: u8, c: u8) -> [u8; 3] {
    let (low, high) = (a.min(b), a.max(b));
    [low.min(c), low.max(high.min(c)), high.max(c)]
}

/// The 3x3 median of an image, by `median_row`, in `buffer`, of which it takes the first width x height
/// bytes.
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
pub fn histogram(grey: Grey<'_>) -> Histogram {
    let mut histogram = [0; 256];
    for v in 0..grey.size().height {
        count_row(&mut histogram, grey.row(v));
    }
    histogram
}

/// Otsu's level: the first one that maximises the variance between the values up to it and those above
/// it, compared exactly. 0 when there are no two classes.
///
/// With n0 values of sum s0 up to the level, n1 above, and n of sum s in all, the variance is
/// (n s0 - n0 s)^2 / (n0 n1), up to a constant. For n < 2^25 the square is below 2^112 and the divisor
/// below 2^48; fractions are compared by whole part, then crosswise by remainder. A histogram of more
/// pixels, which no raster of the core gives, is first scaled down by a power of two.
pub fn otsu(histogram: &Histogram) -> u8 {
    let pixels: u64 = histogram.iter().map(|&h| u64::from(h)).sum();
    let halvings = pixels.checked_ilog2().unwrap_or(0).saturating_sub(24);
    let bins = || (0..=u8::MAX).zip(histogram).map(|(value, &h)| (value, u64::from(h >> halvings)));
    let (n, s) = bins().fold((0, 0), |(n, s), (value, h)| (n + h, s + u64::from(value) * h));
    let (mut n0, mut s0) = (0, 0);
    let (mut level, mut best) = (0, (0, 0, 1));
    for (value, h) in bins() {
        n0 += h;
        s0 += u64::from(value) * h;
        if n0 == 0 || n0 == n {
            continue;
        }
        let square = u128::from((n * s0).abs_diff(n0 * s)).pow(2);
        let divisor = u128::from(n0 * (n - n0));
        let variance = (square / divisor, square % divisor, divisor);
        if variance.0 > best.0 || variance.0 == best.0 && variance.1 * best.2 > best.1 * variance.2 {
            (level, best) = (value, variance);
        }
    }
    level
}

/// The bits of a row: set where a grey value lies on the object's side of the level. Fills as many
/// words as the row has; `out` beyond them is left alone.
pub fn binarise_row(row: &[u8], level: u8, tone: Tone, out: &mut [Word]) {
    for (word, values) in out.iter_mut().zip(row.chunks(WORD_BITS)) {
        let bright = |bits: Word, (b, &value): (usize, &u8)| bits | Word::from(value > level) << b;
        let bits = values.iter().enumerate().fold(0, bright);
        let valid = Word::MAX >> (WORD_BITS - values.len());
        *word = if tone == Tone::Bright { bits } else { !bits & valid };
    }
}

/// The bitmap of an image, in `words`.
pub fn binarise<'w>(
    grey: Grey<'_>,
    level: u8,
    tone: Tone,
    words: &'w mut [Word],
) -> Result<Bitmap<'w>, CapacityError> {
    let mut bitmap = Bitmap::new(grey.size(), words)?;
    for v in 0..grey.size().height {
        binarise_row(grey.row(v), level, tone, bitmap.row_mut(v as i32));
    }
    Ok(bitmap)
}
