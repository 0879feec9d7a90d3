//! The part of an image that a mesh can touch.

use std::ops::Range;

use rayon::prelude::*;

use crate::mesh::Mesh;
use crate::view::View;

/// Pixels around the mesh's vertices, for the half pixel that a box filter reaches and for edges that
/// distortion bends.
const MARGIN: f64 = 3.0;

/// A box of pixels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Window {
    columns: Range<u32>,
    rows: Range<u32>,
}

impl Window {
    /// The box that holds the mesh's image; the whole image if part of the mesh is behind the camera.
    pub(super) fn of(mesh: &Mesh, view: &impl View) -> Self {
        let [width, height] = view.size();
        let mut low = [f64::INFINITY; 2];
        let mut high = [f64::NEG_INFINITY; 2];
        for vertex in &mesh.vertices {
            let Some((u, v)) = view.project(vertex) else {
                return Self { columns: 0..width, rows: 0..height };
            };
            low = [low[0].min(u), low[1].min(v)];
            high = [high[0].max(u), high[1].max(v)];
        }
        // Conversion clips to the image: below zero is 0, and an empty mesh gives an empty range.
        let range = |low: f64, high: f64, size: u32| {
            ((low - MARGIN).floor() as u32).min(size)..((high + MARGIN).ceil() as u32).min(size)
        };
        Self { columns: range(low[0], high[0], width), rows: range(low[1], high[1], height) }
    }

    /// Columns of the box.
    pub(super) fn columns(&self) -> Range<u32> {
        self.columns.clone()
    }

    /// The box's part of each row of an image `width` wide, in parallel, with the row's number.
    pub(super) fn par_rows<'a, T: Send>(
        &self,
        pixels: &'a mut [T],
        width: u32,
    ) -> impl ParallelIterator<Item = (u32, &'a mut [T])> {
        let columns = self.columns.start as usize..self.columns.end.max(self.columns.start) as usize;
        let skip = self.rows.start as usize;
        pixels
            .par_chunks_mut(width.max(1) as usize)
            .enumerate()
            .skip(skip)
            .take(self.rows.len())
            .map(move |(row, pixels)| (row as u32, &mut pixels[columns.clone()]))
    }
}
