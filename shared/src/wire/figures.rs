//! A shape's figures: what an outcome holds beside lists.

use super::WireError;
use super::bytes::Reader;
use super::finding::{read_finding, write_finding};
use super::frame::Writer;
use super::shape::RANGE;
use crate::limits::push;
use crate::pipeline::Outcome;
use crate::point::PixelPoint;
use crate::stage::correspond::CUT_VERTICES;
use crate::stage::plane::ImagePlane;
use crate::stage::rows::RowStatistics;

/// Largest magnitude of a slope, 1/65536.
const MAX_SLOPE: i32 = 1 << 24;

/// How the hulls matched; their cut vertices come later.
pub(super) struct Cut {
    pub(super) shift: usize,
    pub(super) least: usize,
    pub(super) errors: [u32; CUT_VERTICES],
}

/// A plane that can be evaluated everywhere, as every fit is.
pub(super) fn bounded_plane(plane: &ImagePlane) -> ImagePlane {
    let bounded = |x: i32| x.clamp(-2 * RANGE, 2 * RANGE);
    let slope = |x: i32| x.clamp(-MAX_SLOPE, MAX_SLOPE);
    ImagePlane {
        origin: PixelPoint { u: bounded(plane.origin.u), v: bounded(plane.origin.v) },
        level: bounded(plane.level),
        slope_u: slope(plane.slope_u),
        slope_v: slope(plane.slope_v),
    }
}

/// Append the figures.
pub(super) fn write_figures(outcome: &Outcome, writer: &mut Writer<'_>) {
    for area in outcome.areas {
        writer.u32(area);
    }
    writer.i32(outcome.vertical_offset);
    for offset in outcome.frontier_offsets {
        writer.i32(offset);
    }
    let plane = bounded_plane(&outcome.plane);
    for x in [plane.origin.u, plane.origin.v, plane.level, plane.slope_u, plane.slope_v] {
        writer.i32(x);
    }
    writer.u32(outcome.rows.crossings);
    writer.u32(outcome.rows.unmatched);
    writer.u8(outcome.findings.len() as u8);
    for finding in &outcome.findings {
        write_finding(finding, writer);
    }
    writer.flag(outcome.cuts.is_some());
    if let Some(cuts) = &outcome.cuts {
        writer.u8(cuts.shift as u8);
        writer.u8(cuts.least as u8);
        for error in cuts.errors {
            writer.u32(error);
        }
    }
}

/// Read the figures.
pub(super) fn read_figures(outcome: &mut Outcome, reader: &mut Reader<'_>) -> Result<Option<Cut>, WireError> {
    outcome.areas = [reader.u32()?, reader.u32()?];
    outcome.vertical_offset = reader.i32()?;
    outcome.frontier_offsets = [reader.i32()?, reader.i32()?];
    outcome.plane = ImagePlane {
        origin: PixelPoint { u: reader.i32()?, v: reader.i32()? },
        level: reader.i32()?,
        slope_u: reader.i32()?,
        slope_v: reader.i32()?,
    };
    if outcome.plane != bounded_plane(&outcome.plane) {
        return Err(WireError::Invalid("disparity plane"));
    }
    outcome.rows = RowStatistics { crossings: reader.u32()?, unmatched: reader.u32()? };
    if outcome.rows.unmatched > outcome.rows.crossings {
        return Err(WireError::Invalid("number of unmatched crossings"));
    }
    for _ in 0..reader.u8()? {
        push(outcome.findings.as_mut_view(), read_finding(reader)?, "findings")?;
    }
    if !reader.flag("match of the hulls")? {
        return Ok(None);
    }
    let (shift, least) = (usize::from(reader.u8()?), usize::from(reader.u8()?));
    if shift.max(least) >= CUT_VERTICES {
        return Err(WireError::Invalid("shift of the hulls"));
    }
    let mut errors = [0; CUT_VERTICES];
    for error in &mut errors {
        *error = reader.u32()?;
    }
    Ok(Some(Cut { shift, least, errors }))
}
