//! Judges the sensor's colour bars, which tell where luma lies in a row of bytes, and how noisy the way is.
//!
//! Within a bar luma repeats from pixel to pixel, while the two chroma bytes alternate; so luma is the parity
//! that rarely changes. A chip that sends one dummy byte before a frame moves luma to odd places, and the
//! luma of every row still lies within its burst: nothing has to be skipped.

use super::arducam::ROW_BYTES;
use super::registers::WIDTH;

/// Which byte of two is luma.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LumaPlace {
    /// Even bytes, as the sensor sends them.
    #[default]
    Even,
    /// Odd bytes: a dummy came first.
    Odd,
}

impl LumaPlace {
    /// A row's luma.
    pub fn luma(self, bytes: &[u8; ROW_BYTES]) -> [u8; WIDTH] {
        let mut luma = [0; WIDTH];
        let (pairs, _) = bytes.as_chunks();
        for (luma, &[even, odd]) in luma.iter_mut().zip(pairs) {
            *luma = match self {
                Self::Even => even,
                Self::Odd => odd,
            };
        }
        luma
    }
}

/// A step between neighbours, or a deviation, larger than what processing leaves within a bar.
const STEP: u8 = 8;
/// Luma of a row of bars changes at their edges, which are a few pixels wide.
const MAX_LUMA_STEPS: usize = WIDTH / 5;
/// Six of the eight bars are coloured.
const MIN_CHROMA_STEPS: usize = WIDTH / 2;
/// From the brightest to the darkest bar.
const MIN_RANGE: u8 = 64;
/// Pixels of a test picture that may deviate: a thousandth, or one flipped bit in about 4000.
const MAX_DEVIATIONS: usize = WIDTH * super::registers::HEIGHT / 1000;

/// What is known of a test picture so far.
#[derive(Debug, Default)]
pub struct TestPicture {
    first: Option<(LumaPlace, [u8; WIDTH])>,
    deviations: usize,
}

impl TestPicture {
    /// Look at the next row: whether all so far are rows of one picture of bars.
    pub fn accepts(&mut self, bytes: &[u8; ROW_BYTES]) -> bool {
        let Some(place) = place(bytes) else { return false };
        let luma = place.luma(bytes);
        let (first_place, first) = self.first.get_or_insert((place, luma));
        let pairs = luma.iter().zip(first.iter());
        self.deviations += pairs.filter(|(a, b)| a.abs_diff(**b) > STEP).count();
        place == *first_place && self.deviations <= MAX_DEVIATIONS
    }

    /// Where luma lies, once a row was looked at.
    pub fn place(&self) -> Option<LumaPlace> {
        self.first.map(|(place, _)| place)
    }
}

/// Where luma lies in a row of bars; nothing if it is no such row.
fn place(bytes: &[u8; ROW_BYTES]) -> Option<LumaPlace> {
    let [even, odd] = [LumaPlace::Even, LumaPlace::Odd].map(|place| steps(&place.luma(bytes)));
    let place = if even < odd { LumaPlace::Even } else { LumaPlace::Odd };
    let luma = place.luma(bytes);
    let range = luma.iter().max()?.abs_diff(*luma.iter().min()?);
    let bars = even.min(odd) <= MAX_LUMA_STEPS && even.max(odd) >= MIN_CHROMA_STEPS && range >= MIN_RANGE;
    bars.then_some(place)
}

fn steps(values: &[u8; WIDTH]) -> usize {
    values.iter().zip(values.iter().skip(1)).filter(|(a, b)| a.abs_diff(**b) > STEP).count()
}
