//! Scenes that break things: figures drawn over each other.

use arbitrary::Arbitrary;

/// Something drawn over what is there.
#[derive(Arbitrary, Clone, Copy, Debug)]
pub struct Figure {
    shape: Shape,
    paint: Paint,
}

#[derive(Arbitrary, Clone, Copy, Debug)]
enum Paint {
    Bright,
    Dark,
    Grey(u8),
    Invert,
}

#[derive(Arbitrary, Clone, Copy, Debug)]
enum Shape {
    /// Centre and radius.
    Disc([u8; 2], u8),
    /// Two corners.
    Box([u8; 4]),
    Pixel([u8; 2]),
    /// This many pixels from every side.
    Border(u8),
    /// The side of a field.
    Checkerboard(u8),
    /// First column and number of columns.
    Columns(u8, u8),
    /// First row and number of rows.
    Rows(u8, u8),
    /// Both sides of each edge of words.
    WordEdges,
    /// From corner to corner, so thick.
    Diagonal(u8),
    /// So many of 256 pixels.
    Noise(u8, u32),
    /// Blots of so many pixels a side.
    Blots(u8, u32),
}

/// A number that looks random, of a place and a seed.
fn hash(u: usize, v: usize, seed: u32) -> u8 {
    let mixed = (u as u32).wrapping_mul(0x9e37_79b1) ^ (v as u32).wrapping_mul(0x85eb_ca77) ^ seed;
    let mixed = (mixed ^ mixed >> 15).wrapping_mul(0x2c1b_3c6d);
    (mixed >> 24) as u8
}

impl Shape {
    fn has(self, u: usize, v: usize, width: usize, height: usize) -> bool {
        let from = |start: u8, count: u8, x: usize| {
            (start.into()..usize::from(start) + usize::from(count)).contains(&x)
        };
        match self {
            Self::Disc([a, b], r) => {
                let r = usize::from(r % 64);
                u.abs_diff(usize::from(a)).pow(2) + v.abs_diff(usize::from(b)).pow(2) < r * r
            }
            Self::Box([a, b, c, d]) => (a.into()..c.into()).contains(&u) && (b.into()..d.into()).contains(&v),
            Self::Pixel([a, b]) => (u, v) == (a.into(), b.into()),
            Self::Border(d) => {
                let d = usize::from(d % 9);
                u < d || v < d || u + d >= width || v + d >= height
            }
            Self::Checkerboard(side) => {
                (u / usize::from(side.max(1)) + v / usize::from(side.max(1))) % 2 == 1
            }
            Self::Columns(start, count) => from(start, count, u),
            Self::Rows(start, count) => from(start, count, v),
            Self::WordEdges => matches!(u % 64, 0 | 31 | 32 | 63),
            Self::Diagonal(thick) => {
                (u * height.max(1)).abs_diff(v * width.max(1)) <= usize::from(thick) * 16
            }
            Self::Noise(share, seed) => hash(u, v, seed) < share,
            Self::Blots(side, seed) => {
                hash(u / usize::from(side.max(1)), v / usize::from(side.max(1)), seed) < 128
            }
        }
    }
}

impl Figure {
    /// Draw over a picture of this width.
    pub fn draw(self, width: usize, picture: &mut [u8]) {
        let height = picture.len().checked_div(width).unwrap_or(0);
        for (v, row) in picture.chunks_mut(width.max(1)).enumerate() {
            for (_, pixel) in row.iter_mut().enumerate().filter(|(u, _)| self.shape.has(*u, v, width, height))
            {
                *pixel = match self.paint {
                    Paint::Bright => 210,
                    Paint::Dark => 12,
                    Paint::Grey(level) => level,
                    Paint::Invert => 255 - *pixel,
                };
            }
        }
    }
}

/// Figures on a dark ground.
pub fn draw(width: usize, height: usize, figures: &[Figure]) -> Vec<u8> {
    let mut picture = vec![12; width * height];
    // More are but slow.
    figures.iter().take(12).for_each(|figure| figure.draw(width, &mut picture));
    picture
}
