//! Pictures from their parts, which come in any order and some of them never.

use image::{GrayImage, Luma};
use shared::wire::PictureKind;

use super::inbox::Part;

/// The pictures of the newest pair of which there are parts.
#[derive(Debug)]
pub struct Mosaic {
    kind: PictureKind,
    pair: Option<u32>,
    eyes: [Option<Eye>; 2],
}

/// A picture under way.
#[derive(Debug)]
struct Eye {
    picture: GrayImage,
    /// Which rows have come.
    rows: Vec<bool>,
}

impl Mosaic {
    /// Nothing has come yet of what was asked for.
    #[must_use]
    pub const fn new(kind: PictureKind) -> Self {
        Self { kind, pair: None, eyes: [None, None] }
    }

    /// Add a part. Parts of another kind are not taken; one of another pair begins anew.
    pub fn add(&mut self, part: &Part) {
        if part.kind != self.kind {
            return;
        }
        if self.pair != Some(part.pair) {
            (self.pair, self.eyes) = (Some(part.pair), [None, None]);
        }
        let [width, height] = part.size.map(u32::from);
        let eye = self.eyes[part.eye as usize].get_or_insert_with(|| Eye {
            picture: GrayImage::new(width, height),
            rows: vec![false; height as usize],
        });
        if eye.picture.dimensions() != (width, height) {
            return;
        }
        let rows = part.rows.chunks_exact(part.kind.row_bytes(part.size[0]));
        for (v, row) in (part.first_row.into()..height).zip(rows) {
            for u in 0..width {
                let grey = match part.kind {
                    PictureKind::Grey => row[u as usize],
                    PictureKind::Mask => 255 * (row[u as usize / 8] >> (u % 8) & 1),
                };
                eye.picture.put_pixel(u, v, Luma([grey]));
            }
            eye.rows[v as usize] = true;
        }
    }

    /// Both pictures of this pair, when they are whole.
    #[must_use]
    pub fn pictures_of(&self, pair: u32) -> Option<[GrayImage; 2]> {
        (self.pair == Some(pair)).then(|| self.pictures()).flatten()
    }

    /// Both pictures, when they are whole; a mask is 0 and 255.
    #[must_use]
    pub fn pictures(&self) -> Option<[GrayImage; 2]> {
        let whole = |eye: &Option<Eye>| {
            eye.as_ref().filter(|eye| eye.rows.iter().all(|row| *row)).map(|eye| eye.picture.clone())
        };
        Some([whole(&self.eyes[0])?, whole(&self.eyes[1])?])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use shared::pipeline::Side;

    fn part(pair: u32, eye: Side, first_row: u16, rows: &[u8]) -> Part {
        Part { pair, eye, kind: PictureKind::Mask, size: [10, 2], first_row, rows: rows.to_vec() }
    }

    #[test]
    fn rows_come_in_any_order_but_of_one_pair() {
        let mut mosaic = Mosaic::new(PictureKind::Mask);
        mosaic.add(&part(1, Side::Left, 0, &[1, 0, 0, 2]));
        mosaic.add(&part(2, Side::Right, 1, &[0xff, 3]));
        mosaic.add(&part(2, Side::Right, 0, &[0, 1]));
        assert_eq!(mosaic.pictures(), None);
        mosaic.add(&part(2, Side::Left, 0, &[1, 0, 0, 2]));
        let [left, right] = mosaic.pictures().unwrap();
        let lit = |picture: &GrayImage| {
            let pixels = picture.enumerate_pixels().filter(|(.., p)| p[0] == 255);
            pixels.map(|(u, v, _)| (u, v)).collect::<Vec<_>>()
        };
        assert_eq!(lit(&left), [(0, 0), (9, 1)]);
        assert_eq!(lit(&right), [(8, 0)].into_iter().chain((0..10).map(|u| (u, 1))).collect::<Vec<_>>());
    }
}
