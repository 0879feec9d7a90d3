//! Words for people and for machines: findings as sentences that say what is wrong and what to do, and
//! the names by which choices are given and reported.

use crate::reconstruct::Unmeasured;
use crate::stage::balls::px;
use shared::fixed::ONE;
use shared::pipeline::{Finding, Side};
use shared::stage::binarise::{Polarity, Threshold};
use shared::stage::thinning::Rule;

/// Thinning rules by name.
pub const RULES: [(&str, Rule); 4] = [
    ("edt", Rule::EdtOrdered),
    ("hit-or-miss", Rule::HitOrMiss),
    ("zhang-suen", Rule::ZhangSuen),
    ("guo-hall", Rule::GuoHall),
];

/// Polarities by name.
pub const POLARITIES: [(&str, Polarity); 3] =
    [("bright", Polarity::BrightObject), ("dark", Polarity::DarkObject), ("auto", Polarity::Auto)];

/// The name of a thinning rule.
#[must_use]
pub fn rule_name(rule: Rule) -> &'static str {
    name_in(&RULES, rule)
}

/// The name of a polarity.
#[must_use]
pub fn polarity_name(polarity: Polarity) -> &'static str {
    name_in(&POLARITIES, polarity)
}

/// The thinning rule of a name.
///
/// # Errors
/// A sentence with the names there are.
pub fn parse_rule(name: &str) -> Result<Rule, String> {
    parse(&RULES, name)
}

/// The polarity of a name.
///
/// # Errors
/// A sentence with the names there are.
pub fn parse_polarity(name: &str) -> Result<Polarity, String> {
    parse(&POLARITIES, name)
}

/// `otsu`, or a grey level.
///
/// # Errors
/// A sentence that says so.
pub fn parse_threshold(text: &str) -> Result<Threshold, String> {
    if text == "otsu" {
        return Ok(Threshold::Otsu);
    }
    text.parse().map(Threshold::Fixed).map_err(|_| "give a grey level from 0 to 255, or otsu".into())
}

fn name_in<T: Copy + PartialEq>(names: &[(&'static str, T)], value: T) -> &'static str {
    names.iter().find(|(_, other)| *other == value).map_or("", |(name, _)| name)
}

fn parse<T: Copy>(names: &[(&'static str, T)], text: &str) -> Result<T, String> {
    let known = || names.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ");
    let found = names.iter().find(|(name, _)| *name == text);
    found.map(|(_, value)| *value).ok_or_else(|| format!("one of: {}", known()))
}

/// The name of a finding for programs; it does not change between versions.
#[must_use]
pub const fn name(finding: &Finding) -> &'static str {
    match finding {
        Finding::SizesDiffer { .. } => "sizes-differ",
        Finding::NoObject(..) => "no-object",
        Finding::FillsImage(..) => "fills-image",
        Finding::SecondObject(..) => "second-object",
        Finding::AreasDiffer(_) => "areas-differ",
        Finding::TouchesBorder(_) => "touches-border",
        Finding::TooLow(..) => "too-low",
        Finding::FlatHull => "flat-hull",
        Finding::Ambiguous(_) => "ambiguous",
        Finding::NotAffine(_) => "not-affine",
        Finding::SwappedEyes(_) => "swapped-eyes",
        Finding::NotRectified { .. } => "not-rectified",
        Finding::VerticalOffset(_) => "vertical-offset",
        Finding::SkeletonErased(_) => "skeleton-erased",
        Finding::Unmatched(_) => "unmatched",
        Finding::NoMap => "no-map",
        Finding::Capacity(_) => "capacity",
    }
}

fn percent(x: i32) -> f64 {
    f64::from(x) * 100.0 / f64::from(ONE)
}

/// The name of an eye.
#[must_use]
pub const fn view(side: &Side) -> &'static str {
    match side {
        Side::Left => "left",
        Side::Right => "right",
    }
}

/// One sentence about a visible side that was to be measured and is from balls.
#[must_use]
pub const fn unmeasured(why: Unmeasured) -> &'static str {
    match why {
        Unmeasured::NoPictures => "its pictures did not come with it, so that its visible side is from balls",
        Unmeasured::OtherPictures => {
            "the pictures that came with it show another object than its shape, so that its visible side is from balls"
        }
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
             try the other --polarity, or move the camera back",
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
            "the object's disparity is {:.1} px, which puts it at infinity or behind the cameras: left and right \
             are swapped, or one view is mirrored; try --swap",
            px(*disparity)
        ),
        Finding::NotRectified { top, bottom } => format!(
            "the object's top lies {:+.2} px and its bottom {:+.2} px lower in the right image: the pair is not rectified; \
             give its calibration with --calib, or calibrate again",
            px(*top),
            px(*bottom)
        ),
        Finding::VerticalOffset(rows) => format!(
            "the object lies {:+.2} px lower in the right image, which was corrected; calibrate again, and check that \
             left and right are not swapped",
            px(*rows)
        ),
        Finding::SkeletonErased(side) => format!(
            "thinning left nothing of the object in the {} image, as Zhang-Suen's rule does with some even shapes; \
             take --thinning edt",
            view(side)
        ),
        Finding::Unmatched(share) => format!(
            "{:.0} % of the left outline has no counterpart in the right image: the views are too different, the \
             object is too finely toothed, or the calibration is wrong; bring the cameras closer together, or \
             calibrate again",
            percent(*share)
        ),
        Finding::NoMap => {
            "the outlines cannot be matched: they have too few corners, or the image cuts them off on \
                           both sides; move the camera back"
                .into()
        }
        Finding::Capacity(error) => {
            format!(
                "the outline is too complex for the memory set aside: {error}; smooth the image or reduce its size"
            )
        }
    }
}
