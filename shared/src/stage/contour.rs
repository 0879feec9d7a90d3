//! Contour: the silhouette's edge as ordered loops of sub-pixel points with normals.
//!
//! Paper section 3.2 keeps the boundary's pixels; depth needs it to a fraction of a pixel,
//! since one pixel of disparity is millimetres of depth.
//!
//! * **In**: the cleaned mask and, for sub-pixel edges, the grey image, both of one size.
//! * **Out**: points every pixel of arc, in loops that keep the object on their right as seen on the
//!   screen (the outer loop runs clockwise, holes the other way), each with its outward normal.
//! * **How**: the loop follows the cracks between set and clear pixels of the mask, so it is closed and
//!   has the mask's topology whatever the grey values are; foreground is 8-connected. Each crack is then
//!   moved along its axis to where the edge really is: a pixel that the edge passes through has a grey
//!   value between the object's and the background's in proportion to the covered area, so the covered
//!   lengths of the few pixels on either side add up to the position. The two grey levels are taken two
//!   pixels inside and outside, so shading does not move the edge. (On a disc of radius 20 px the points
//!   are then 0.014..0.019 px off, rms; linear interpolation at the middle level gives 0.05.)
//! * **Cost**: linear in the number of cracks.
//! * **Not promised**: that the polygon is free of self-intersections where parts are thinner than 2 px.

use crate::arena::{Arena, List};
use crate::bitmap::{Bitmap, Grey, SetBits, WORD_BITS};
use crate::fixed::{PX, hypot};
use crate::limits::{CapacityError, push};
use crate::point::{Direction, PixelPoint};
use bytemuck::{Pod, Zeroable};
use heapless::VecView;

/// A sample of the contour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ContourPoint {
    /// Where the edge is.
    pub at: PixelPoint,
    /// Unit normal, away from the object.
    pub normal: Direction,
    /// The object is cut off by the image's border here: there is no edge.
    pub border: bool,
}

/// A closed run of contour points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ContourLoop {
    /// Index of the first point.
    pub start: usize,
    /// Number of points, at least 8.
    pub len: usize,
}

impl ContourLoop {
    /// Indices of the points, in order.
    pub const fn range(self) -> core::ops::Range<usize> {
        self.start..self.start + self.len
    }

    /// The index `offset` points further along the loop; |offset| <= len.
    pub const fn step(self, index: usize, offset: isize) -> usize {
        let from = (index - self.start) as isize + self.len as isize + offset;
        match (from as usize).checked_rem(self.len) {
            Some(place) => self.start + place,
            None => self.start,
        }
    }

    /// How many points further along the loop `to` is than `from`.
    pub const fn ahead(self, from: usize, to: usize) -> usize {
        match (to + self.len - from).checked_rem(self.len) {
            Some(points) => points,
            None => 0,
        }
    }
}

/// The crack between a set pixel and its clear neighbour, moved on to the edge.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub struct EdgeCrossing {
    at: PixelPoint,
    /// How far the next crossing is, 1/256 px, rounded down: less than four pixels.
    to_next: u16,
    /// Not 0 where the image ends.
    border: u16,
}

/// The four axes, clockwise on the screen, from the inner to the outer pixel of a crack.
const AXES: [(i32, i32); 4] = [(0, -1), (1, 0), (0, 1), (-1, 0)];

/// Grey levels by which object and background must differ for an edge to be placed by them.
const MIN_CONTRAST: i32 = 8;

/// Fewest points of a loop.
pub(crate) const MIN_LOOP: usize = 8;

/// k g(k) of a Gaussian of 1.5 px, in 1/64: the derivative that gives tangents.
const TANGENT: [i32; 5] = [51, 53, 26, 7, 1];

/// Trace all loops of `mask` and sample them at about 1 px of arc. Without a grey image edges lie in the
/// middle between pixels, softened.
///
/// The scratch holds as many words as the mask, and the cracks of the longest loop.
///
/// # Errors
/// A [`CapacityError`] when a list is too short; `points` and `loops` are then incomplete.
pub fn contour(
    grey: Option<Grey<'_>>,
    mask: &Bitmap<'_>,
    mut scratch: Arena<'_>,
    points: &mut VecView<ContourPoint>,
    loops: &mut VecView<ContourLoop>,
) -> Result<(), CapacityError> {
    points.clear();
    loops.clear();
    let mut seen = Bitmap::new(mask.size(), scratch.take(mask.size().words(), "words of scratch")?)?;
    let mut crossings = scratch.list("contour crossings");
    for v in 0..mask.size().height as i32 {
        for (i, word) in mask.row(v).iter().enumerate() {
            // Every loop has a crack with the clear pixel to the north: start at the first not yet seen.
            let north_edges = word & !mask.row(v - 1).get(i).copied().unwrap_or(0);
            for bit in SetBits(north_edges) {
                let u = (i * WORD_BITS + bit) as i32;
                if !seen.get(u, v) {
                    trace(grey, mask, (u, v), &mut seen, &mut crossings)?;
                    if grey.is_none() {
                        soften(&mut crossings);
                    }
                    resample(&mut crossings, points, loops)?;
                }
            }
        }
    }
    Ok(())
}

/// Follow the cracks from the north side of pixel `start` until back there.
fn trace(
    grey: Option<Grey<'_>>,
    mask: &Bitmap<'_>,
    start: (i32, i32),
    seen: &mut Bitmap<'_>,
    crossings: &mut List<'_, EdgeCrossing>,
) -> Result<(), CapacityError> {
    crossings.clear();
    let (mut pixel, mut axis) = (start, 0);
    loop {
        if axis == 0 {
            seen.put(pixel.0 as usize, pixel.1 as usize, true);
        }
        crossings.push(place(grey, mask, pixel, AXES[axis]))?;
        let (outward, ahead) = (AXES[axis], AXES[(axis + 1) % 4]);
        let beside = (pixel.0 + ahead.0, pixel.1 + ahead.1);
        let diagonal = (beside.0 + outward.0, beside.1 + outward.1);
        if mask.get(diagonal.0, diagonal.1) {
            (pixel, axis) = (diagonal, (axis + 3) % 4);
        } else if mask.get(beside.0, beside.1) {
            pixel = beside;
        } else {
            axis = (axis + 1) % 4;
        }
        if (pixel, axis) == (start, 0) {
            return Ok(());
        }
    }
}

/// Take the steps of a few pixels off a staircase: each point moves to the mean of itself and its two
/// neighbours, itself counting twice.
fn soften(crossings: &mut [EdgeCrossing]) {
    let (Some(first), Some(last)) = (crossings.first().map(|c| c.at), crossings.last().map(|c| c.at)) else {
        return;
    };
    let mut before = last;
    for i in 0..crossings.len() {
        let here = crossings[i].at;
        let after = crossings.get(i + 1).map_or(first, |c| c.at);
        // Coordinates within 2^20: the sum is within 2^22 + 2.
        let mean = |a: i32, b: i32, c: i32| (a + 2 * b + c + 2) >> 2;
        crossings[i].at =
            PixelPoint { u: mean(before.u, here.u, after.u), v: mean(before.v, here.v, after.v) };
        before = here;
    }
}

/// Where along `axis` the edge lies near the outer side of `pixel`: by the grey values of two pixels on
/// either side, as far as they are there and on their side of the mask.
fn place(grey: Option<Grey<'_>>, mask: &Bitmap<'_>, pixel: (i32, i32), axis: (i32, i32)) -> EdgeCrossing {
    let at = |k: i32| (pixel.0 + k * axis.0, pixel.1 + k * axis.1);
    let is_set = |k: i32| mask.get(at(k).0, at(k).1);
    let is_there = |k: i32| mask.size().contains(at(k).0, at(k).1);
    let border = !is_there(1);
    let mut shift = 0;
    if let Some(grey) = grey.filter(|_| !border) {
        let level = |k: i32| i32::from(grey.get(at(k).0, at(k).1));
        let (two_inside, two_outside) = (is_set(-1), is_there(2) && !is_set(2));
        let (object, background) = (level(-i32::from(two_inside)), level(1 + i32::from(two_outside)));
        let contrast = object - background;
        if contrast.abs() >= MIN_CONTRAST {
            // Levels differ by less than 2^8: the product is below 2^16.
            let share = |k: i32| ((level(k) - background) * PX).checked_div(contrast).unwrap_or(0);
            let covered = |k: i32| share(k).clamp(0, PX);
            let beyond = if two_outside { covered(1) } else { 0 };
            let missing = if two_inside { PX - covered(0) } else { 0 };
            shift = beyond - missing;
        }
    }
    // From -2^6 to 1.25 px, and half a pixel at the border: no point leaves -2^7..2^20.
    let along = PX / 2 + shift.clamp(-PX * 3 / 4, PX * 3 / 4);
    EdgeCrossing {
        at: PixelPoint { u: pixel.0 * PX + along * axis.0, v: pixel.1 * PX + along * axis.1 },
        to_next: 0,
        border: border.into(),
    }
}

/// Append the loop with points at equal arc lengths of about 1 px and their normals.
fn resample(
    crossings: &mut [EdgeCrossing],
    points: &mut VecView<ContourPoint>,
    loops: &mut VecView<ContourLoop>,
) -> Result<(), CapacityError> {
    let Some(first) = crossings.first().map(|c| c.at) else { return Ok(()) };
    let mut length = 0;
    for i in 0..crossings.len() {
        let (here, next) = (crossings[i].at, crossings.get(i + 1).map_or(first, |c| c.at));
        crossings[i].to_next = hypot(next.u - here.u, next.v - here.v) as u16;
        // At most 2^26 cracks, each less than 2^10 from the next.
        length += i64::from(crossings[i].to_next);
    }
    let len = (length / i64::from(PX)).max(MIN_LOOP as i64);
    let here = ContourLoop { start: points.len(), len: len as usize };
    // Point k lies length * k / len along the loop, rounded down: so much beyond crossing i, and `carried`
    // of len parts.
    let (step, parts) = (length / len, length % len);
    let (mut i, mut beyond, mut carried) = (0, 0, 0);
    for _ in 0..len {
        while let Some([from, _]) = crossings.get(i..i + 2)
            && i64::from(from.to_next) <= beyond
        {
            beyond -= i64::from(from.to_next);
            i += 1;
        }
        let Some(from) = crossings.get(i) else { return Ok(()) };
        let next = crossings.get(i + 1).map_or(first, |c| c.at);
        let at = from.at.lerp(next, beyond as i32, from.to_next.into());
        let point = ContourPoint { at, normal: Direction::default(), border: from.border != 0 };
        push(points, point, "contour points")?;
        (beyond, carried) = (beyond + step, carried + parts);
        if carried >= len {
            (beyond, carried) = (beyond + 1, carried - len);
        }
    }
    for i in here.range() {
        let normal = normal(here, i, |k| points.get(k).map(|p| p.at).unwrap_or_default());
        if let Some(point) = points.get_mut(i) {
            point.normal = normal;
        }
    }
    push(loops, here, "contour loops")
}

/// Outward normal at point `i` of a loop, given where its points are, within +-2^20.
pub(crate) fn normal(l: ContourLoop, i: usize, at: impl Fn(usize) -> PixelPoint) -> Direction {
    let end = l.start + l.len;
    let (mut before, mut after, mut u, mut v) = (i, i, 0, 0);
    for weight in TANGENT {
        before = if before == l.start { end - 1 } else { before - 1 };
        after = if after + 1 == end { l.start } else { after + 1 };
        let (a, b) = (at(before), at(after));
        // Weights of 138 in all, differences below 2^21: below 2^29.
        u += weight * (b.u - a.u);
        v += weight * (b.v - a.v);
    }
    Direction::of(v, -u).unwrap_or_default()
}

/// The contour's highest point and its lowest: `(top, bottom)`.
/// These are the frontier points, where the epipolar plane touches the object: in a rectified pair
/// both eyes see them in the same row.
pub fn frontier(points: &[ContourPoint]) -> Option<(ContourPoint, ContourPoint)> {
    let top = points.iter().min_by_key(|p| p.at.v)?;
    let bottom = points.iter().max_by_key(|p| p.at.v)?;
    Some((*top, *bottom))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bitmap::{Size, Word};
    use crate::samples;
    use heapless::Vec;

    /// A disc with area-sampled edge, bright on dark, radius and centre in 1/16 px.
    fn disc(size: Size, centre: (i32, i32), radius: i32, grey: &mut [u8]) {
        grey.fill(12);
        let across = |middle: i32| (middle - radius) / 16 - 1..=(middle + radius) / 16 + 1;
        for v in across(centre.1) {
            for u in across(centre.0) {
                let inside = (0..256)
                    .filter(|s| {
                        let (du, dv) = (u * 16 + s % 16 - 8 - centre.0, v * 16 + s / 16 - 8 - centre.1);
                        (2 * du + 1).pow(2) + (2 * dv + 1).pow(2) <= (2 * radius).pow(2)
                    })
                    .count() as i32;
                grey[v as usize * size.width + u as usize] = (12 + inside * 180 / 256) as u8;
            }
        }
    }

    #[test]
    fn a_disc_is_found_to_a_fraction_of_a_pixel() {
        let size = Size::new(64, 64).unwrap();
        let (mut grey, mut words, mut block) = ([0; 64 * 64], [0 as Word; 128], [0; 2048]);
        let discs = [((505, 515), 100, 0.045), ((512, 512), 320, 0.02), ((519, 505), 331, 0.02)];
        for (centre, radius, bound) in discs.into_iter().take(samples(3, 1)) {
            disc(size, centre, radius, &mut grey);
            let mut mask = Bitmap::new(size, &mut words).unwrap();
            (0..64 * 64).for_each(|i| mask.put(i % 64, i / 64, grey[i] > 100));
            let (mut points, mut loops) = (Vec::<_, 1024>::new(), Vec::<_, 4>::new());
            let image = Grey::new(size, 64, &grey).unwrap();
            contour(Some(image), &mask, Arena::new(&mut block), &mut points, &mut loops).unwrap();
            assert_eq!(loops.len(), 1);
            let mut square_sum = 0.0;
            for p in &points {
                let (du, dv) = (
                    f64::from(p.at.u) / 256.0 - f64::from(centre.0) / 16.0,
                    f64::from(p.at.v) / 256.0 - f64::from(centre.1) / 16.0,
                );
                let error = du.hypot(dv) - f64::from(radius) / 16.0;
                square_sum += error * error;
                assert!(error.abs() < 0.15, "{error} px off the disc of {radius}/16");
                let cosine =
                    (du * f64::from(p.normal.u) + dv * f64::from(p.normal.v)) / du.hypot(dv) / 16384.0;
                assert!(cosine > 0.995, "normal off by {} degrees", cosine.acos().to_degrees());
            }
            let rms = (square_sum / points.len() as f64).sqrt();
            assert!(rms < bound, "rms {rms} px on the disc of {radius}/16");
        }
    }

    #[test]
    fn loops_keep_the_masks_topology() {
        let mut words = [0; 16];
        let mask = Bitmap::from_art(
            "#######\n\
             #.....#\n\
             #..#..#\n\
             #.....#\n\
             #######\n\
             .......\n\
             ##.....",
            &mut words,
        )
        .unwrap();
        let grey: [u8; 49] =
            core::array::from_fn(|i| if mask.get(i as i32 % 7, i as i32 / 7) { 200 } else { 10 });
        let mut block = [0; 256];
        let (mut points, mut loops) = (Vec::<_, 256>::new(), Vec::<_, 8>::new());
        let image = Grey::new(mask.size(), 7, &grey).unwrap();
        contour(Some(image), &mask, Arena::new(&mut block), &mut points, &mut loops).unwrap();
        assert_eq!(loops.len(), 4, "ring outside, ring inside, dot, bar");
        assert!(points.iter().any(|p| p.border) && points.iter().any(|p| !p.border));
    }
}
