//! Findings as a code and four numbers.
//!
//! Codes stand in the table of docs/wire-format.md; new findings get the next one.

use super::WireError;
use super::bytes::Reader;
use super::frame::Writer;
use crate::limits::CapacityError;
use crate::pipeline::{Finding, Side};

/// What a [`CapacityError`] can be about, by its code; code 0 is anything else. Names are appended.
const LISTS: [&str; 40] = [
    "memory",
    "ball depths",
    "balls",
    "balls on an edge",
    "branch samples",
    "branches",
    "bytes in a frame",
    "bytes in a grey image",
    "contour crossings",
    "contour loops",
    "contour matches",
    "contour points",
    "control points",
    "distances in a row",
    "edges",
    "ends of rows",
    "entries in an envelope",
    "entries of the thinning order",
    "hull vertices",
    "medial balls",
    "node pixels",
    "nodes",
    "pairs",
    "parabolas of scratch",
    "path pixels",
    "pixels in a plane",
    "pixels on a side",
    "row crossings",
    "tips",
    "words in a bitmap",
    "words of scratch",
    "knots",
    "pixels in a picture",
    "control points of a fit",
    "entries of a fit",
    "bytes of a mask",
    "points in a disc",
    "right points",
    "runs of a row",
    "strips",
];

pub(super) const fn side_code(side: Side) -> u32 {
    match side {
        Side::Left => 0,
        Side::Right => 1,
    }
}

pub(super) const fn side(code: u32) -> Result<Side, WireError> {
    match code {
        0 => Ok(Side::Left),
        1 => Ok(Side::Right),
        _ => Err(WireError::Invalid("eye")),
    }
}

/// A finding's code, as in the table of docs/wire-format.md.
pub fn finding_code(finding: &Finding) -> u8 {
    coded(finding).0
}

/// Append a finding: 17 bytes.
pub(super) fn write_finding(finding: &Finding, writer: &mut Writer<'_>) {
    let (code, numbers) = coded(finding);
    writer.u8(code);
    for x in numbers {
        writer.u32(x);
    }
}

/// A finding as its code and its numbers.
fn coded(finding: &Finding) -> (u8, [u32; 4]) {
    let signed = |x: i32| x as u32;
    // No size of a picture or a list that fits its memory is cut here: all are below 2^32.
    let size = |x: usize| x as u32;
    match *finding {
        Finding::SizesDiffer { left, right } => {
            (1, [size(left.0), size(left.1), size(right.0), size(right.1)])
        }
        Finding::NoObject(side, area) => (2, [side_code(side), area, 0, 0]),
        Finding::FillsImage(side, percent) => (3, [side_code(side), percent, 0, 0]),
        Finding::SecondObject(side, percent) => (4, [side_code(side), percent, 0, 0]),
        Finding::AreasDiffer(ratio) => (5, [signed(ratio), 0, 0, 0]),
        Finding::TouchesBorder(side) => (6, [side_code(side), 0, 0, 0]),
        Finding::TooLow(side, height) => (7, [side_code(side), height, 0, 0]),
        Finding::FlatHull => (8, [0; 4]),
        Finding::Ambiguous(shift) => (9, [size(shift), 0, 0, 0]),
        Finding::NotAffine(residual) => (10, [signed(residual), 0, 0, 0]),
        Finding::SwappedEyes(disparity) => (11, [signed(disparity), 0, 0, 0]),
        Finding::NotRectified { top, bottom } => (12, [signed(top), signed(bottom), 0, 0]),
        Finding::VerticalOffset(offset) => (13, [signed(offset), 0, 0, 0]),
        Finding::SkeletonErased(side) => (14, [side_code(side), 0, 0, 0]),
        Finding::Unmatched(share) => (15, [signed(share), 0, 0, 0]),
        Finding::NoMap => (16, [0; 4]),
        Finding::Capacity(CapacityError { what, limit }) => {
            let list = LISTS.iter().position(|name| *name == what).unwrap_or(0);
            (17, [size(list), size(limit), 0, 0])
        }
    }
}

/// Read a finding.
pub(super) fn read_finding(reader: &mut Reader<'_>) -> Result<Finding, WireError> {
    let code = reader.u8()?;
    let [a, b, c, d] = [reader.u32()?, reader.u32()?, reader.u32()?, reader.u32()?];
    let size = |x: u32| x as usize;
    let signed = |x: u32| x as i32;
    Ok(match code {
        1 => Finding::SizesDiffer { left: (size(a), size(b)), right: (size(c), size(d)) },
        2 => Finding::NoObject(side(a)?, b),
        3 => Finding::FillsImage(side(a)?, b),
        4 => Finding::SecondObject(side(a)?, b),
        5 => Finding::AreasDiffer(signed(a)),
        6 => Finding::TouchesBorder(side(a)?),
        7 => Finding::TooLow(side(a)?, b),
        8 => Finding::FlatHull,
        9 => Finding::Ambiguous(size(a)),
        10 => Finding::NotAffine(signed(a)),
        11 => Finding::SwappedEyes(signed(a)),
        12 => Finding::NotRectified { top: signed(a), bottom: signed(b) },
        13 => Finding::VerticalOffset(signed(a)),
        14 => Finding::SkeletonErased(side(a)?),
        15 => Finding::Unmatched(signed(a)),
        16 => Finding::NoMap,
        17 => {
            let what = LISTS.get(size(a)).copied().unwrap_or(LISTS[0]);
            Finding::Capacity(CapacityError { what, limit: size(b) })
        }
        code => return Err(WireError::Unknown { what: "finding", code }),
    })
}
