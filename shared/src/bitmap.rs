//! Rasters over borrowed memory: bitmaps with one bit a pixel, planes with one number a pixel, and
//! grey images as a camera gives them.
//!
//! A bitmap's row starts on a word; pixel `u` is bit `u % WORD_BITS` of word `u / WORD_BITS`, so the
//! picture runs from the least to the most significant bit. Bits beyond the width are always 0, and so
//! is everything outside the image: stages need no special case at the border.
//!
//! The eight neighbours of a whole word of pixels come from shifts that carry one bit over from the
//! next word:
//!
//! ```text
//!   bit      0 1 2 ... 63 | 0 1 ...
//!   pixel    a b c ...  z | A B ...
//!   east     b c ...  z A | B ...        (w >> 1) | (next << 63)
//!   west     . a b c ...  | z A ...      (w << 1) | (previous >> 63)
//! ```

use crate::limits::{CapacityError, MAX_SIDE};
use crate::point::Pixel;
use core::fmt;
use core::num::NonZeroUsize;

/// The unit of pixel-parallel work: what the processor handles in one register.
#[cfg(target_pointer_width = "64")]
pub type Word = u64;
/// The unit of pixel-parallel work: what the processor handles in one register.
#[cfg(not(target_pointer_width = "64"))]
pub type Word = u32;

/// Pixels in a word.
pub const WORD_BITS: usize = Word::BITS as usize;

/// Width and height of a raster, px; both at most [`MAX_SIDE`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

impl Size {
    /// A size, if both sides are at most [`MAX_SIDE`].
    ///
    /// # Errors
    /// A [`CapacityError`] when a side is longer.
    pub const fn new(width: usize, height: usize) -> Result<Self, CapacityError> {
        if width > MAX_SIDE || height > MAX_SIDE {
            return Err(CapacityError { what: "pixels on a side", limit: MAX_SIDE });
        }
        Ok(Self { width, height })
    }

    /// Words in a row of a bitmap.
    pub const fn row_words(self) -> usize {
        self.width.div_ceil(WORD_BITS)
    }

    /// Words in a bitmap.
    pub const fn words(self) -> usize {
        self.row_words() * self.height
    }

    /// Pixels in a plane.
    pub const fn pixels(self) -> usize {
        self.width * self.height
    }

    /// Whether the pixel lies inside.
    pub const fn contains(self, u: i32, v: i32) -> bool {
        // What is negative is then beyond every side.
        (u as usize) < self.width && (v as usize) < self.height
    }
}

/// An upright box of pixels, both corners included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelBox {
    /// Upper left pixel.
    pub min: Pixel,
    /// Lower right pixel.
    pub max: Pixel,
}

/// One bit a pixel.
pub struct Bitmap<'a> {
    size: Size,
    /// Words in a row.
    row_words: usize,
    words: &'a mut [Word],
}

impl<'a> Bitmap<'a> {
    /// An empty bitmap in `words`, of which it takes the first [`Size::words`].
    ///
    /// # Errors
    /// A [`CapacityError`] when there are fewer words.
    pub fn new(size: Size, words: &'a mut [Word]) -> Result<Self, CapacityError> {
        let bitmap = Self::over(size, words)?;
        bitmap.words.fill(0);
        Ok(bitmap)
    }

    /// A bitmap over `words` as they stand, of which it takes the first [`Size::words`]: one that an
    /// earlier stage left there.
    ///
    /// # Errors
    /// A [`CapacityError`] when there are fewer words.
    pub fn over(size: Size, words: &'a mut [Word]) -> Result<Self, CapacityError> {
        let limit = words.len();
        let words =
            words.get_mut(..size.words()).ok_or(CapacityError { what: "words in a bitmap", limit })?;
        Ok(Self { size, row_words: size.row_words(), words })
    }

    /// A bitmap from a drawing: a line a row, `#` set, anything else clear. For tests and examples.
    ///
    /// # Errors
    /// A [`CapacityError`] when there are fewer words than the drawing needs.
    pub fn from_art(art: &str, words: &'a mut [Word]) -> Result<Self, CapacityError> {
        let rows = || art.lines().map(str::trim).filter(|l| !l.is_empty());
        let width = rows().map(|l| l.chars().count()).max().unwrap_or(0);
        let mut bitmap = Self::new(Size::new(width, rows().count())?, words)?;
        for (v, row) in rows().enumerate() {
            for (u, c) in row.chars().enumerate() {
                bitmap.put(u, v, c == '#');
            }
        }
        Ok(bitmap)
    }

    /// Width and height.
    pub const fn size(&self) -> Size {
        self.size
    }

    /// Whether the pixel is set; false outside the image.
    pub fn get(&self, u: i32, v: i32) -> bool {
        self.size.contains(u, v)
            && at(self.words, v as usize * self.row_words + u as usize / WORD_BITS)
                >> (u as usize % WORD_BITS)
                & 1
                == 1
    }

    /// Set or clear a pixel; nothing happens outside the image.
    pub fn put(&mut self, u: usize, v: usize, on: bool) {
        if u < self.size.width
            && v < self.size.height
            && let Some(word) = self.words.get_mut(v * self.row_words + u / WORD_BITS)
        {
            let bit = 1 << (u % WORD_BITS);
            if on { *word |= bit } else { *word &= !bit }
        }
    }

    /// The words of a row; none outside the image.
    pub fn row(&self, v: i32) -> &[Word] {
        let n = self.row_words;
        match usize::try_from(v) {
            Ok(v) if v < self.size.height => self.words.get(v * n..(v + 1) * n).unwrap_or_default(),
            _ => &[],
        }
    }

    /// The words of a row, to be changed; the caller keeps bits beyond the width clear.
    pub fn row_mut(&mut self, v: i32) -> &mut [Word] {
        let n = self.row_words;
        match usize::try_from(v) {
            Ok(v) if v < self.size.height => self.words.get_mut(v * n..(v + 1) * n).unwrap_or_default(),
            _ => &mut [],
        }
    }

    /// Words from a row to the next: what an index is divided by.
    pub(crate) fn pitch(&self) -> NonZeroUsize {
        NonZeroUsize::new(self.row_words).unwrap_or(NonZeroUsize::MIN)
    }

    /// All words, row after row.
    pub fn words(&self) -> &[Word] {
        self.words
    }

    /// All words, to be changed; the caller keeps bits beyond the width clear.
    pub fn words_mut(&mut self) -> &mut [Word] {
        self.words
    }

    /// The bits of word `i` of a row that lie inside the image.
    pub const fn valid(&self, i: usize) -> Word {
        let from = i * WORD_BITS;
        if from + WORD_BITS <= self.size.width {
            Word::MAX
        } else if from >= self.size.width {
            0
        } else {
            (1 << (self.size.width - from)) - 1
        }
    }

    /// Clear every pixel.
    pub fn clear(&mut self) {
        self.words.fill(0);
    }

    /// Set what is clear and clear what is set, inside the image.
    pub fn invert(&mut self) {
        let n = self.pitch().get();
        let valid = self.valid(n - 1);
        for row in self.words.chunks_exact_mut(n) {
            row.iter_mut().for_each(|word| *word = !*word);
            row[n - 1] &= valid;
        }
    }

    /// Take over the pixels of a bitmap of the same size.
    pub fn copy_from(&mut self, other: &Bitmap<'_>) {
        for (to, from) in self.words.iter_mut().zip(&*other.words) {
            *to = *from;
        }
    }

    /// Number of set pixels.
    pub fn count(&self) -> usize {
        self.words.iter().map(|w| w.count_ones() as usize).sum()
    }

    /// The smallest box that holds every set pixel.
    pub fn bounds(&self) -> Option<PixelBox> {
        let mut spans = self.spans();
        let (top, first, last) = spans.next()?;
        let whole = |(u0, u1, _), (v, first, last): (usize, usize, usize)| (first.min(u0), last.max(u1), v);
        let (left, right, bottom) = spans.fold((first, last, top), whole);
        Some(PixelBox {
            min: Pixel { u: left as u16, v: top as u16 },
            max: Pixel { u: right as u16, v: bottom as u16 },
        })
    }

    /// Each row that has a set pixel, with its first and its last one: `(v, first, last)`.
    pub fn spans(&self) -> impl Iterator<Item = (usize, usize, usize)> + '_ {
        let rows = self.words.chunks_exact(self.pitch().get());
        (0..self.size.height).zip(rows).filter_map(|(v, row)| {
            let first = row.iter().position(|w| *w != 0)?;
            let last = row.iter().rposition(|w| *w != 0)?;
            Some((
                v,
                first * WORD_BITS + row[first].trailing_zeros() as usize,
                last * WORD_BITS + WORD_BITS - 1 - row[last].leading_zeros() as usize,
            ))
        })
    }

    /// The set pixels in raster order.
    pub fn pixels(&self) -> impl Iterator<Item = Pixel> + '_ {
        let n = self.pitch();
        self.words.iter().enumerate().flat_map(move |(i, &word)| {
            let (v, u0) = (i / n, i % n * WORD_BITS);
            SetBits(word).map(move |b| Pixel { u: (u0 + b) as u16, v: v as u16 })
        })
    }

    /// The eight neighbours of a pixel as a byte, bit 0 north, then clockwise: N NE E SE S SW W NW.
    #[inline]
    pub fn neighbours(&self, u: i32, v: i32) -> u8 {
        let (bit, place) = (u as usize % WORD_BITS, u as usize / WORD_BITS);
        if bit == 0 || bit == WORD_BITS - 1 || !self.size.contains(u, v) {
            return self.neighbours_apart(u, v);
        }
        self.neighbours_within(v as usize * self.row_words + place, bit)
    }

    /// [`Self::neighbours`] of a bit of a word, but for its first and last one.
    #[inline]
    fn neighbours_within(&self, i: usize, bit: usize) -> u8 {
        let three = |i: usize| at(self.words, i) >> (bit - 1) & 0b111;
        let (above, here, below) = (i.wrapping_sub(self.row_words), i, i + self.row_words);
        AROUND_OF_SQUARE[(three(above) | three(here) << 3 | three(below) << 6) as usize]
    }

    /// The place of a pixel of the image among the bits of all words.
    pub const fn place(&self, u: usize, v: usize) -> usize {
        v * self.row_words * WORD_BITS + u
    }

    /// Clear the pixel at a [`place`](Self::place) if `decide` says so of its neighbours, which outside the image are
    /// clear; what it said.
    #[inline]
    pub fn clear_if(&mut self, place: usize, decide: impl Fn(u8) -> bool) -> bool {
        let (i, bit) = (place / WORD_BITS, place % WORD_BITS);
        let neighbours = if bit == 0 || bit == WORD_BITS - 1 {
            let n = self.pitch();
            self.neighbours_apart((i % n * WORD_BITS + bit) as i32, (i / n) as i32)
        } else {
            self.neighbours_within(i, bit)
        };
        let Some(word) = self.words.get_mut(i).filter(|_| decide(neighbours)) else { return false };
        *word &= !(1 << bit);
        true
    }

    /// [`Self::neighbours`], some of which lie in another word or outside.
    #[cold]
    fn neighbours_apart(&self, u: i32, v: i32) -> u8 {
        const AROUND: [(i32, i32); 8] =
            [(0, -1), (1, -1), (1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1)];
        AROUND.iter().enumerate().fold(0, |n, (k, (du, dv))| n | u8::from(self.get(u + du, v + dv)) << k)
    }

    /// The eight neighbours of all pixels of word `i` of row `v`, in the order of [`Self::neighbours`].
    pub fn neighbour_words(&self, v: i32, i: usize) -> [Word; 8] {
        neighbours_in_rows(self.row(v - 1), self.row(v), self.row(v + 1), i)
    }
}

/// [`Bitmap::neighbours`] of the square of 3x3 pixels whose rows are bits 0 to 2, 3 to 5 and 6 to 8.
const AROUND_OF_SQUARE: [u8; 512] = {
    const PLACES: [usize; 8] = [1, 2, 5, 8, 7, 6, 3, 0];
    let mut around = [0; 512];
    let mut square = 0;
    while square < 512 {
        let mut k = 0;
        while k < 8 {
            around[square] |= ((square >> PLACES[k] & 1) as u8) << k;
            k += 1;
        }
        square += 1;
    }
    around
};

/// [`Bitmap::neighbour_words`] of word `i` of the row `here`, from the rows themselves.
pub fn neighbours_in_rows(above: &[Word], here: &[Word], below: &[Word], i: usize) -> [Word; 8] {
    [
        at(above, i),
        east(above, i),
        east(here, i),
        east(below, i),
        at(below, i),
        west(below, i),
        west(here, i),
        west(above, i),
    ]
}

/// Word `i` of a row, 0 beyond its end.
pub fn at(row: &[Word], i: usize) -> Word {
    row.get(i).copied().unwrap_or(0)
}

/// The eastern neighbours of the pixels of word `i`.
pub fn east(row: &[Word], i: usize) -> Word {
    at(row, i) >> 1 | at(row, i + 1) << (WORD_BITS - 1)
}

/// The western neighbours of the pixels of word `i`.
pub fn west(row: &[Word], i: usize) -> Word {
    at(row, i) << 1 | at(row, i.wrapping_sub(1)) >> (WORD_BITS - 1)
}

/// Positions of the set bits of a word, from the least significant on.
pub struct SetBits(pub Word);

impl Iterator for SetBits {
    type Item = usize;

    fn next(&mut self) -> Option<usize> {
        if self.0 == 0 {
            return None;
        }
        let bit = self.0.trailing_zeros() as usize;
        self.0 &= self.0 - 1;
        Some(bit)
    }
}

/// The same drawing that [`Bitmap::from_art`] reads, so that a failing test shows the picture.
impl fmt::Debug for Bitmap<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for v in 0..self.size.height {
            writeln!(f)?;
            for u in 0..self.size.width {
                f.write_str(if self.get(u as i32, v as i32) { "#" } else { "." })?;
            }
        }
        Ok(())
    }
}

impl PartialEq for Bitmap<'_> {
    fn eq(&self, other: &Self) -> bool {
        self.size == other.size && self.words == other.words
    }
}

/// One number a pixel.
pub struct Plane<'a, T> {
    size: Size,
    data: &'a mut [T],
}

impl<'a, T> Plane<'a, T> {
    /// A plane over `data` as it stands, of which it takes the first [`Size::pixels`].
    ///
    /// # Errors
    /// A [`CapacityError`] when there is less data.
    pub fn over(size: Size, data: &'a mut [T]) -> Result<Self, CapacityError> {
        let limit = data.len();
        let data = data.get_mut(..size.pixels()).ok_or(CapacityError { what: "pixels in a plane", limit })?;
        Ok(Self { size, data })
    }
}

impl<'a, T: Copy + Default> Plane<'a, T> {
    /// A plane of default values in `data`, of which it takes the first [`Size::pixels`].
    ///
    /// # Errors
    /// A [`CapacityError`] when there is less data.
    pub fn new(size: Size, data: &'a mut [T]) -> Result<Self, CapacityError> {
        let plane = Self::over(size, data)?;
        plane.data.fill(T::default());
        Ok(plane)
    }

    /// Width and height.
    pub const fn size(&self) -> Size {
        self.size
    }

    /// The value at a pixel; the default outside the image.
    pub fn get(&self, u: i32, v: i32) -> T {
        if self.size.contains(u, v) {
            self.data.get(v as usize * self.size.width + u as usize).copied().unwrap_or_default()
        } else {
            T::default()
        }
    }

    /// A row; empty outside the image.
    pub fn row(&self, v: usize) -> &[T] {
        if v < self.size.height {
            self.data.get(v * self.size.width..(v + 1) * self.size.width).unwrap_or_default()
        } else {
            &[]
        }
    }

    /// A row, to be changed; empty outside the image.
    pub fn row_mut(&mut self, v: usize) -> &mut [T] {
        if v < self.size.height {
            self.data.get_mut(v * self.size.width..(v + 1) * self.size.width).unwrap_or_default()
        } else {
            &mut []
        }
    }
}

/// An 8-bit grey image as it stands in a camera's buffer.
#[derive(Clone, Copy)]
pub struct Grey<'a> {
    size: Size,
    stride: usize,
    data: &'a [u8],
}

impl<'a> Grey<'a> {
    /// An image whose rows start `stride` bytes apart.
    ///
    /// # Errors
    /// A [`CapacityError`] when the rows overlap or the last one is cut short.
    pub fn new(size: Size, stride: usize, data: &'a [u8]) -> Result<Self, CapacityError> {
        let rows_before_last = stride.saturating_mul(size.height.saturating_sub(1));
        let needed = if size.height == 0 { 0 } else { rows_before_last.saturating_add(size.width) };
        if stride < size.width || data.len() < needed {
            return Err(CapacityError { what: "bytes in a grey image", limit: data.len() });
        }
        Ok(Self { size, stride, data })
    }

    /// Width and height.
    pub const fn size(&self) -> Size {
        self.size
    }

    /// The grey value at a pixel; outside the image that of the nearest pixel, 0 if there is none.
    pub fn get(&self, u: i32, v: i32) -> u8 {
        let (mut u, mut v) = (u, v);
        if !self.size.contains(u, v) {
            u = u.clamp(0, (self.size.width as i32 - 1).max(0));
            v = v.clamp(0, (self.size.height as i32 - 1).max(0));
        }
        self.data.get(v as usize * self.stride + u as usize).copied().unwrap_or(0)
    }

    /// A row; empty outside the image.
    pub fn row(&self, v: usize) -> &'a [u8] {
        if v < self.size.height {
            self.data.get(v * self.stride..v * self.stride + self.size.width).unwrap_or_default()
        } else {
            &[]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples;

    #[test]
    fn a_drawing_comes_back() {
        let mut words = [0; 64];
        let art = "#..#\n.##.\n";
        let bitmap = Bitmap::from_art(art, &mut words).unwrap();
        assert_eq!(bitmap.count(), 4);
        extern crate std;
        assert_eq!(std::format!("{bitmap:?}").trim_start(), "#..#\n.##.");
    }

    #[test]
    fn neighbour_words_equal_single_neighbours_at_every_width() {
        for width in (1..=2 * WORD_BITS + 3).rev().take(samples(usize::MAX, 8)) {
            let mut words = [0; 64];
            let size = Size::new(width, 5).unwrap();
            let mut bitmap = Bitmap::new(size, &mut words).unwrap();
            let mut seed = width as u32;
            for v in 0..5 {
                for u in 0..width {
                    seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    bitmap.put(u, v, seed >> 31 == 1);
                }
            }
            for v in 0..5 {
                for u in 0..width {
                    let words = bitmap.neighbour_words(v, u / WORD_BITS);
                    let code = (0..8).fold(0, |n, k| n | ((words[k] >> (u % WORD_BITS) & 1) as u8) << k);
                    assert_eq!(code, bitmap.neighbours(u as i32, v), "width {width}, pixel {u},{v}");
                }
            }
        }
    }
}
