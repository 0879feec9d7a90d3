//! Findings of the core in words: what is wrong and what to do.

use crate::stage::balls::px;
use shared::fixed::ONE;
use shared::pipeline::{Finding, Side};

fn percent(x: i32) -> f64 {
    f64::from(x) * 100.0 / f64::from(ONE)
}

fn view(side: &Side) -> &'static str {
    match side {
        Side::Left => "left",
        Side::Right => "right",
    }
}

/// One sentence about a finding.
pub fn sentence(finding: &Finding) -> String {
    match finding {
        Finding::SizesDiffer { left, right } => format!(
            "the left image is {}x{} px, the right one {}x{}; both must come from one calibrated pair of the same size",
            left.0, left.1, right.0, right.1
        ),
        Finding::NoObject(side, area) => format!(
            "no object in the {} image: nothing of 64 px or more stands out from the background (largest part: {area} px); \
             light the object, or set --threshold and --polarity",
            view(side)
        ),
        Finding::FillsImage(side, percent) => format!(
            "the object covers {percent} % of the {} image, which is more likely the background; \
             try --polarity dark for a dark object, or move the camera back",
            view(side)
        ),
        Finding::SecondObject(side, percent) => format!(
            "a second object in the {} image has {percent} % of the largest one's area; only the largest is modelled",
            view(side)
        ),
        Finding::AreasDiffer(ratio) => format!(
            "the object is {:.0} % as large in the right image as in the left: the views do not show the same object; \
             check the threshold, and that nothing else stands out",
            percent(*ratio)
        ),
        Finding::TouchesBorder(side) => {
            format!("the object is cut off by the border of the {} image; the model ends there", view(side))
        }
        Finding::TooLow(side, height) => {
            format!("the object is only {height} px high in the {} image; move closer or turn it", view(side))
        }
        Finding::FlatHull => {
            "the outline is too flat for hull invariants; the rows' extents are used instead".into()
        }
        Finding::Ambiguous(shift) => format!(
            "the outline is symmetric: its invariants fit as well when turned by {shift} vertices; the rows decide"
        ),
        Finding::NotAffine(residual) => format!(
            "the two outlines are no views of one object from nearby: their hulls miss each other by {:.1} px; \
             check that neither image is mirrored and that both show the same scene",
            px(*residual)
        ),
        Finding::SwappedEyes(disparity) => format!(
            "the object's disparity is {:.1} px, which puts it behind the cameras: left and right are swapped; \
             give the images in the other order",
            px(*disparity)
        ),
        Finding::NotRectified { top, bottom } => format!(
            "the object's top lies {:+.2} px and its bottom {:+.2} px lower in the right image: the pair is not rectified; \
             give its calibration with --calib, or calibrate again",
            px(*top),
            px(*bottom)
        ),
        Finding::Unmatched(share) => format!(
            "{:.0} % of the left outline has no counterpart in the right image: the views are too different, or the \
             calibration is wrong",
            percent(*share)
        ),
        Finding::NoMap => "the outlines have too few corners to be matched".into(),
        Finding::Capacity(error) => {
            format!(
                "the outline is too complex for the memory set aside: {error}; smooth the image or reduce its size"
            )
        }
    }
}
