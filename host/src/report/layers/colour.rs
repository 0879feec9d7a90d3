//! Colours that stay apart for every kind of colour vision.

/// Red, green, blue.
pub(crate) type Colour = [u8; 3];

/// Behind everything.
pub(crate) const PAPER: Colour = [250, 250, 248];
/// Text and lines on paper.
pub(crate) const INK: Colour = [40, 40, 44];
/// Text of less weight, and axes.
pub(crate) const FAINT: Colour = [140, 140, 146];
/// Around dots and letters on a dark picture.
pub(crate) const RIM: Colour = [20, 20, 24];
/// On a dark picture.
pub(crate) const WHITE: Colour = [255, 255, 255];
/// What is to be seen first.
pub(crate) const ACCENT: Colour = [255, 159, 28];
/// What was taken away.
pub(crate) const REMOVED: Colour = [196, 72, 72];
/// Object and background of a drawn mask.
pub(crate) const OBJECT: Colour = [74, 78, 88];
/// The background of a drawn mask.
pub(crate) const GROUND: Colour = [24, 25, 30];

/// The palette of Okabe and Ito (2008) without black, for things side by side.
pub(crate) const APART: [Colour; 7] = [
    [86, 180, 233],
    [230, 159, 0],
    [0, 158, 115],
    [240, 228, 66],
    [204, 121, 167],
    [213, 94, 0],
    [0, 114, 178],
];

/// Nodes of the viridis map (van der Walt, Smith 2015) at equal steps.
const VIRIDIS: [Colour; 9] = [
    [68, 1, 84],
    [71, 44, 122],
    [59, 81, 139],
    [44, 113, 142],
    [33, 144, 141],
    [39, 173, 129],
    [92, 200, 99],
    [170, 220, 50],
    [253, 231, 37],
];

/// A shade for a value from 0 to 1, evenly brighter with it.
pub(crate) fn shade(value: f64) -> Colour {
    let place = value.clamp(0.0, 1.0) * (VIRIDIS.len() - 1) as f64;
    let low = (place as usize).min(VIRIDIS.len() - 2);
    mix(VIRIDIS[low], VIRIDIS[low + 1], place - low as f64)
}

/// The colour a part (0 to 1) of the way from one to another.
pub(crate) fn mix(from: Colour, to: Colour, part: f64) -> Colour {
    std::array::from_fn(|k| {
        (f64::from(from[k]) + (f64::from(to[k]) - f64::from(from[k])) * part).round() as u8
    })
}
