//! Findings: what the user should know of an input, the thresholds by which that is decided, and what
//! refuses (docs/decisions/0005).

use super::{Method, Outcome, Settings, Side};
use crate::fixed::{ONE, PX};
use crate::limits::CapacityError;

/// Something about the input that the user should know; whether it is fatal, [`Finding::refuses`] says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Finding {
    /// The images differ in size: (width, height) of both.
    SizesDiffer {
        /// Of the left image, px.
        left: (usize, usize),
        /// Of the right image, px.
        right: (usize, usize),
    },
    /// No component of 64 px, or no contrast at all; the area of the largest.
    NoObject(Side, u32),
    /// The object covers most of the image, in percent.
    FillsImage(Side, u32),
    /// The second component's area, in percent of the largest.
    SecondObject(Side, u32),
    /// Right area over left area, in 1/65536.
    AreasDiffer(i32),
    /// The object is cut off by the image's border.
    TouchesBorder(Side),
    /// The object's height, px, too little to match anything by.
    TooLow(Side, u32),
    /// The hull is too flat to be cut: row extents are used instead.
    FlatHull,
    /// Another shift of the hull has a smaller e_omega, but not by much: the rows decide. That shift.
    Ambiguous(usize),
    /// The hulls are no affine images of each other, or are so by another shift than that of the rows: their
    /// mean residual, 1/256 px.
    NotAffine(i32),
    /// The least disparity of the object's hull, 1/256 px, is negative or next to nothing: the eyes are
    /// swapped, or one view is mirrored.
    SwappedEyes(i32),
    /// Top and bottom of the object differ between the views by these rows, 1/256 px.
    NotRectified {
        /// Right less left row of the highest point.
        top: i32,
        /// Right less left row of the lowest point.
        bottom: i32,
    },
    /// The object lies this much lower in the right view, 1/256 px, which was corrected for.
    VerticalOffset(i32),
    /// Thinning left no pixel of the object: Zhang-Suen does that to small and even shapes.
    SkeletonErased(Side),
    /// Share of the left contour's row crossings without partner, in 1/65536.
    Unmatched(i32),
    /// No plane could be laid through what the hulls match; of the paper's matching, no affine map.
    NoMap,
    /// A list was too short.
    Capacity(CapacityError),
}

impl From<CapacityError> for Finding {
    fn from(error: CapacityError) -> Self {
        Self::Capacity(error)
    }
}

/// Least difference of the mean grey values on both sides of Otsu's level: below it, there is but one side.
pub(super) const MIN_CONTRAST: u64 = 8;
/// Fewest pixels of an object.
pub(super) const MIN_AREA: u32 = 64;
/// An object that covers more of the image than this is the background, percent.
pub const MAX_COVER: u32 = 60;
/// A second component this large gets a warning, percent of the first.
pub(super) const SECOND_COVER: u32 = 10;
/// Least height of an object, px.
pub(super) const MIN_HEIGHT: u32 = 8;
/// Right over left area, in 1/65536.
pub(super) const AREA_RATIO: core::ops::RangeInclusive<i32> = ONE * 7 / 10..=ONE * 14 / 10;
/// Most that the rows of top and bottom may differ, and most by which both may be off, 1/256 px.
pub(super) const MAX_TILT: i32 = PX;
pub(super) const MAX_OFFSET: i32 = 3 * PX;
/// A vertical offset below this is taken for noise, 1/256 px.
pub(super) const MIN_OFFSET: i32 = PX / 8;
/// A vertical offset from here on is worth a word, 1/256 px.
pub(super) const NOTED_OFFSET: i32 = PX;
/// Unmatched share that warns and that refuses, in 1/65536.
pub(super) const UNMATCHED_WARNS: i32 = ONE * 15 / 100;
pub(super) const UNMATCHED_REFUSES: i32 = ONE / 4;
/// Mean distance of the cut hull's vertices from the disparity plane that refuses: this part of the hull's
/// mean width and height, and a pixel at least.
pub(super) const MAX_RESIDUAL: i32 = ONE / 50;
/// An object nearer to infinity than this is not where it seems: the eyes are swapped or a view is
/// mirrored, 1/256 px.
pub(super) const MIN_DISPARITY: i32 = 2 * PX;

impl Finding {
    /// Whether no trustworthy model can come of it.
    pub fn refuses(&self) -> bool {
        match self {
            Self::SecondObject(..)
            | Self::TouchesBorder(_)
            | Self::FlatHull
            | Self::Ambiguous(_)
            | Self::VerticalOffset(_)
            | Self::SkeletonErased(_) => false,
            Self::Unmatched(share) => *share > UNMATCHED_REFUSES,
            _ => true,
        }
    }

    /// Whether there is nothing to go on with, whatever the method.
    const fn is_fatal(&self) -> bool {
        matches!(self, Self::SizesDiffer { .. } | Self::NoObject(..) | Self::NoMap | Self::Capacity(_))
    }
}

/// Collects findings and stops at those that refuse.
#[derive(Debug)]
pub(super) struct Gates {
    pub(super) outcome: Outcome,
    lenient: bool,
}

impl Gates {
    pub(super) fn new(settings: &Settings) -> Self {
        Self { outcome: Outcome::default(), lenient: matches!(settings.method, Method::Paper(_)) }
    }

    pub(super) fn meet(&mut self, finding: Finding) -> Result<(), Finding> {
        if finding.is_fatal() || (finding.refuses() && !self.lenient) {
            return Err(finding);
        }
        // Each gate is met at most once an eye, so the list cannot fill up.
        let _ = self.outcome.findings.push(finding);
        Ok(())
    }
}
