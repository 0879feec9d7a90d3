//! A picture to draw on: anti-aliased lines and discs, and text.
//!
//! Coordinates are pixels of the picture, centres at integers. What lies outside is not drawn.

use crate::report::layers::Place;
use crate::report::layers::colour::Colour;
use embedded_graphics::Pixel;
use embedded_graphics::mono_font::ascii::{FONT_9X15_BOLD, FONT_10X20};
use embedded_graphics::mono_font::{MonoFont, MonoTextStyle};
use embedded_graphics::pixelcolor::{Rgb888, RgbColor};
use embedded_graphics::prelude::{DrawTarget, Drawable, OriginDimensions, Point, Size};
use embedded_graphics::text::{Alignment, Baseline, Text, TextStyleBuilder};
use image::{Rgb, RgbImage};
use std::convert::Infallible;

/// Width of a line of large letters, px.
pub(super) fn text_width(text: &str) -> u32 {
    Letters::Large.font().character_size.width * text.len() as u32
}

/// A picture in the making.
pub(super) struct Canvas {
    pixels: RgbImage,
}

/// Where a text stands about its place.
#[derive(Clone, Copy)]
pub(super) enum Anchor {
    /// To the right of it.
    Left,
    /// Around it.
    Centre,
}

/// Two sizes of letters.
#[derive(Clone, Copy)]
pub(super) enum Letters {
    /// 15 px high.
    Small,
    /// 20 px high.
    Large,
}

impl Letters {
    const fn font(self) -> &'static MonoFont<'static> {
        match self {
            Self::Small => &FONT_9X15_BOLD,
            Self::Large => &FONT_10X20,
        }
    }
}

impl Canvas {
    /// A picture of one colour.
    pub(super) fn new(width: u32, height: u32, colour: Colour) -> Self {
        Self { pixels: RgbImage::from_pixel(width, height, Rgb(colour)) }
    }

    /// The picture.
    pub(super) fn finish(self) -> RgbImage {
        self.pixels
    }

    /// Lay `colour` over a pixel, `cover` of it (0 to 1).
    fn blend(&mut self, x: i64, y: i64, colour: Colour, cover: f64) {
        let (Ok(x), Ok(y)) = (u32::try_from(x), u32::try_from(y)) else { return };
        if let Some(Rgb(pixel)) = self.pixels.get_pixel_mut_checked(x, y) {
            for (old, new) in pixel.iter_mut().zip(colour) {
                *old = (f64::from(*old) + (f64::from(new) - f64::from(*old)) * cover).round() as u8;
            }
        }
    }

    /// Fill the box from `corner`, `size` wide and high, both rounded to pixels.
    pub(super) fn fill(&mut self, corner: Place, size: Place, colour: Colour) {
        let (low, high) = (corner.map(f64::round), (corner + size).map(f64::round));
        for y in low.y as i64..high.y as i64 {
            for x in low.x as i64..high.x as i64 {
                self.blend(x, y, colour, 1.0);
            }
        }
    }

    /// Lay `colour` over every pixel whose distance from the shape leaves it covered.
    fn shade(&mut self, [low, high]: [Place; 2], colour: Colour, outside: impl Fn(Place) -> f64) {
        let (limit_x, limit_y) = (i64::from(self.pixels.width()), i64::from(self.pixels.height()));
        for y in (low.y.floor() as i64).max(0)..=(high.y.ceil() as i64).min(limit_y - 1) {
            for x in (low.x.floor() as i64).max(0)..=(high.x.ceil() as i64).min(limit_x - 1) {
                let cover = (0.5 - outside(Place::new(x as f64, y as f64))).clamp(0.0, 1.0);
                if cover > 0.0 {
                    self.blend(x, y, colour, cover);
                }
            }
        }
    }

    /// A straight line, `width` px wide.
    pub(super) fn line(&mut self, a: Place, b: Place, width: f64, colour: Colour) {
        // In pieces, so that only pixels near the line are looked at.
        let pieces = ((b - a).abs().min() / 16.0).ceil().max(1.0);
        let reach = Place::repeat(width / 2.0 + 1.0);
        let along = b - a;
        let squared = along.norm_squared().max(f64::MIN_POSITIVE);
        for piece in 0..pieces as u32 {
            let (from, to) = (f64::from(piece) / pieces, f64::from(piece + 1) / pieces);
            let (p, q) = (a + along * from, a + along * to);
            // A piece owns the pixels that project on it, so that no pixel is shaded twice.
            let owns = |t: f64| (piece == 0 || t >= from) && (to >= 1.0 || t < to);
            self.shade([p.inf(&q) - reach, p.sup(&q) + reach], colour, |x| {
                let t = (x - a).dot(&along) / squared;
                if owns(t) { (x - a - along * t.clamp(0.0, 1.0)).norm() - width / 2.0 } else { f64::INFINITY }
            });
        }
    }

    /// Lines from point to point, and back to the first if `closed`.
    pub(super) fn lines(&mut self, points: &[Place], closed: bool, width: f64, colour: Colour) {
        for pair in points.windows(2) {
            self.line(pair[0], pair[1], width, colour);
        }
        if let (true, Some(first), Some(last)) = (closed, points.first(), points.last()) {
            self.line(*last, *first, width, colour);
        }
    }

    /// A filled disc.
    pub(super) fn disc(&mut self, centre: Place, radius: f64, colour: Colour) {
        let reach = Place::repeat(radius + 1.0);
        self.shade([centre - reach, centre + reach], colour, |x| (x - centre).norm() - radius);
    }

    /// A circle, `width` px wide.
    pub(super) fn circle(&mut self, centre: Place, radius: f64, width: f64, colour: Colour) {
        let reach = Place::repeat(radius + width + 1.0);
        self.shade([centre - reach, centre + reach], colour, |x| {
            ((x - centre).norm() - radius).abs() - width / 2.0
        });
    }

    /// A disc with a rim that sets it off from any background.
    pub(super) fn dot(&mut self, centre: Place, radius: f64, colour: Colour, rim: Colour) {
        self.disc(centre, radius + 1.5, rim);
        self.disc(centre, radius, colour);
    }

    /// A line of ASCII text, vertically centred on its place.
    pub(super) fn text(&mut self, text: &str, at: Place, anchor: Anchor, letters: Letters, colour: Colour) {
        let style = MonoTextStyle::new(letters.font(), Rgb888::new(colour[0], colour[1], colour[2]));
        let alignment = match anchor {
            Anchor::Left => Alignment::Left,
            Anchor::Centre => Alignment::Center,
        };
        let place = TextStyleBuilder::new().alignment(alignment).baseline(Baseline::Middle).build();
        let at = Point::new(at.x.round() as i32, at.y.round() as i32);
        // Drawing on pixels in memory cannot fail.
        let _ = Text::with_text_style(text, at, style, place).draw(self);
    }

    /// Text with a rim that sets it off from any background.
    pub(super) fn label(&mut self, text: &str, at: Place, colour: Colour, rim: Colour) {
        for (x, y) in [(-1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, 1.0)] {
            self.text(text, at + Place::new(x, y), Anchor::Centre, Letters::Small, rim);
        }
        self.text(text, at, Anchor::Centre, Letters::Small, colour);
    }

    /// Copy a picture to where its upper left corner is `corner`.
    pub(super) fn paste(&mut self, picture: &RgbImage, corner: (u32, u32)) {
        image::imageops::replace(&mut self.pixels, picture, corner.0.into(), corner.1.into());
    }
}

impl OriginDimensions for Canvas {
    fn size(&self) -> Size {
        Size::new(self.pixels.width(), self.pixels.height())
    }
}

impl DrawTarget for Canvas {
    type Color = Rgb888;
    type Error = Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<Rgb888>>>(&mut self, pixels: I) -> Result<(), Infallible> {
        for Pixel(at, colour) in pixels {
            self.blend(at.x.into(), at.y.into(), [colour.r(), colour.g(), colour.b()], 1.0);
        }
        Ok(())
    }
}
