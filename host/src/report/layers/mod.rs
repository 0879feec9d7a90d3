//! What each stage made of a view, as layers that can be laid over one another. Sheets of pictures
//! ([`super::pictures`]) and the page ([`super::page`]) draw the same ones.
//!
//! * **In**: what a record kept of each eye and of the pair.
//! * **Out**: layers in image coordinates, px, centres of pixels at integers; a size that is not the image's, such as
//!   the width of a line, is in pixels of the picture or the screen.

pub(crate) mod colour;
pub(crate) mod eye;
pub(crate) mod frame;
pub(crate) mod pair;

use super::record::{Eye, Parts, Rasters};
use super::words::view;
use crate::stage::balls::px2;
use colour::Colour;
use nalgebra::Vector2;
use shared::pipeline::Side;
use shared::point::PixelPoint;

/// A point of an image, px.
pub(crate) type Place = Vector2<f64>;

/// A view to be drawn.
#[derive(Clone, Copy)]
pub(crate) struct Seen<'a> {
    /// What it is called.
    pub(crate) name: &'static str,
    /// Its figures and lists.
    pub(crate) parts: &'a Parts,
    /// Its rasters, if they were kept.
    pub(crate) rasters: Option<&'a Rasters>,
}

impl<'a> Seen<'a> {
    /// Both views of a record.
    pub(crate) fn both([left, right]: &'a [Eye; 2]) -> [Self; 2] {
        [(Side::Left, left), (Side::Right, right)].map(|(side, eye)| Self {
            name: view(&side),
            parts: &eye.parts,
            rasters: eye.rasters.as_ref(),
        })
    }
}

/// What a stage made of a view.
pub(crate) enum Layer<'a> {
    /// The colour of the pixel in a column and row, if it has one.
    Raster(Box<dyn Fn(u32, u32) -> Option<Colour> + 'a>),
    /// Marks, the lowest first.
    Marks(Vec<Mark>),
}

/// A thing drawn in an image.
pub(crate) enum Mark {
    /// Lines from point to point, and back to the first if closed; their width is the picture's.
    Lines { points: Vec<Place>, closed: bool, width: f64, colour: Colour },
    /// A thin circle of a radius in the image.
    Ring { centre: Place, radius: f64, colour: Colour },
    /// Dots of one radius in the picture, with a rim that sets them off if they are `set_off`.
    Dots { places: Vec<Place>, radius: f64, colour: Colour, set_off: bool },
    /// A letter beside a place, in the direction `away`.
    Letter { at: Place, away: Place, letter: char, colour: Colour },
}

/// One dot with a rim.
pub(crate) fn dot(at: Place, radius: f64, colour: Colour) -> Mark {
    Mark::Dots { places: vec![at], radius, colour, set_off: true }
}

/// A fixed-point point, moved down by `offset`, 1/256 px.
pub(crate) fn place(point: PixelPoint, offset: i32) -> Place {
    px2(PixelPoint { v: point.v + offset, ..point })
}
