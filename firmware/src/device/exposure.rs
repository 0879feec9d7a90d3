//! Exposure control: from the histograms of a pair to the exposure of the next one.
//!
//! | | |
//! |---|---|
//! | in | the histogram of each eye's raw picture |
//! | out | a rung of a ladder, the same for both eyes: lines times gain in quarter octaves |
//! | aim | Otsu's bright side has a mean of [`MEAN`], and an upper quartile of [`QUARTILE`] at most |
//! | step | the distance to the aim in octaves, to the nearest rung; none within 3/4 rung |
//! | clipped | where the upper quartile is at the end of the scale, the distance is unknown: an octave down |
//! | two eyes | the one that asks for less decides |
//! | cost | one look at 256 bins an eye |
//!
//! **Why it rests**: if twice the light at most doubles the grey values, which holds for every gamma up to 1
//! and every offset, a step never passes the aim by more than the half rung of rounding, and half a rung is
//! within the 3/4 in which nothing moves. An octave down from clipping leaves the quartile above half of
//! [`CLIPPED`], from where the aim of [`QUARTILE`] does not lead back to clipping.
//!
//! Lines come before gain: noise grows with gain, and what is looked at stands still.

use crate::ports::Exposure;
use shared::fixed::log2;
use shared::stage::binarise::{Histogram, otsu};

/// Mean of the bright side that is aimed at, grey values.
pub const MEAN: u64 = 150;
/// Most that the upper quartile of the bright side is led to, grey values.
pub const QUARTILE: u64 = 224;
/// Grey values from here on may stand for anything brighter.
pub const CLIPPED: u64 = 250;
/// Rungs of an octave.
const OCTAVE: i32 = 4;
/// Most rungs up at once: two octaves.
const MOST: i32 = 2 * OCTAVE;

/// A rung of the ladder of exposures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rung(i32);

impl Rung {
    /// 4 x 2^(49/4) lines at a gain of 1 are less than 670 at a gain of 31.
    const LAST: i32 = 49;

    /// The rung so many higher or lower, where the ladder ends at the latest.
    #[must_use]
    pub fn moved(self, by: i32) -> Self {
        Self((self.0 + by.clamp(-Self::LAST, Self::LAST)).clamp(0, Self::LAST))
    }

    /// Its exposure.
    pub const fn exposure(self) -> Exposure {
        // Quarters of an octave from 4 lines on, 1/16.
        const QUARTERS: [u32; OCTAVE as usize] = [64, 76, 91, 108];
        let quarter = QUARTERS[self.0 as usize % QUARTERS.len()] << (self.0 / OCTAVE);
        let longest = *Exposure::LINES.end() as u32;
        let lines = (quarter + 8) / 16;
        if lines <= longest {
            Exposure::new(lines as u16, 16)
        } else {
            Exposure::new(longest as u16, ((quarter + longest / 2) / longest) as u16)
        }
    }
}

impl Default for Rung {
    /// 304 lines at a gain of 1.
    fn default() -> Self {
        Self(25)
    }
}

/// By how many rungs a picture of this histogram was taken too dark, or, negative, too bright.
pub fn steps(histogram: &Histogram) -> i32 {
    let level = otsu(histogram);
    let bright = || (0..=u8::MAX).zip(histogram).skip(usize::from(level) + 1);
    let (count, sum) =
        bright().fold((0, 0), |(n, s), (v, &h)| (n + u64::from(h), s + u64::from(v) * u64::from(h)));
    if count == 0 {
        return MOST;
    }
    let mut above = count;
    let quartile = bright().find(|(_, h)| {
        above -= u64::from(**h);
        4 * above <= count
    });
    let quartile = quartile.map_or(CLIPPED, |(value, _)| u64::from(value));
    if quartile >= CLIPPED {
        return -OCTAVE;
    }
    let mean = log2(MEAN << 8) - log2((sum << 8) / count);
    let distance = OCTAVE * mean.min(log2(QUARTILE) - log2(quartile));
    // 1/65536 rung.
    if distance.abs() <= 3 << 14 { 0 } else { ((distance + (1 << 15)) >> 16).min(MOST) }
}

/// What exposes the eyes: the ladder, or an order.
#[derive(Clone, Copy, Debug, Default)]
pub struct Control {
    rung: Rung,
    fixed: Option<Exposure>,
}

impl Control {
    /// The exposure of the next pair.
    pub fn exposure(&self) -> Exposure {
        self.fixed.unwrap_or_else(|| self.rung.exposure())
    }

    /// Hold this exposure, or go on where control stopped.
    pub const fn fix(&mut self, exposure: Option<Exposure>) {
        self.fixed = exposure;
    }

    /// Take in that both eyes, by [`steps`], ask for this.
    pub fn follow(&mut self, [left, right]: [i32; 2]) {
        if self.fixed.is_none() {
            self.rung = self.rung.moved(left.min(right));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    extern crate std;

    /// An object of grey values around `light` x exposure, on a ground of a twelfth, through a sensor.
    fn picture(light: f64, exposure: Exposure, sensor: impl Fn(f64) -> f64) -> Histogram {
        let total = f64::from(exposure.lines()) * f64::from(exposure.gain()) / 16.0;
        let mut histogram = [0; 256];
        for pixel in 0..10_000 {
            let shade = if pixel % 5 == 0 { 0.6 + 0.8 * f64::from(pixel) / 10_000.0 } else { 1.0 / 12.0 };
            histogram[sensor(light * total * shade).round().clamp(0.0, 255.0) as usize] += 1;
        }
        histogram
    }

    #[test]
    fn the_ladder_rises_by_quarter_octaves_within_what_eyes_can_do() {
        let total = |k| {
            let exposure = Rung(k).exposure();
            f64::from(exposure.lines()) * f64::from(exposure.gain()) / 16.0
        };
        for k in 0..=Rung::LAST {
            let exact = 4.0 * 2.0_f64.powf(f64::from(k) / 4.0);
            assert!((total(k) / exact - 1.0).abs() < 0.07, "rung {k}: {} for {exact}", total(k));
            assert!(k < 8 || (total(k) / exact - 1.0).abs() < 0.035, "rung {k}: {} for {exact}", total(k));
        }
        assert_eq!(Rung(Rung::LAST).moved(i32::MAX), Rung(Rung::LAST));
        assert_eq!(Rung(3).moved(i32::MIN), Rung(0));
    }

    /// From any light and any start, through any sensor, control arrives and then rests.
    #[test]
    fn control_comes_to_rest_at_its_aim() {
        let sensors: [fn(f64) -> f64; 3] =
            [|x| x, |x| 255.0 * (x / 255.0).powf(0.45), |x| 16.0 + x * 219.0 / 255.0];
        for sensor in sensors {
            for light in (0..40).map(|k| 0.02 * 1.2_f64.powi(k)) {
                for start in [0, 25, 49] {
                    let mut control = Control { rung: Rung(start), fixed: None };
                    let mut moves = std::vec::Vec::new();
                    for _ in 0..24 {
                        let by = steps(&picture(light, control.exposure(), sensor));
                        moves.push(by);
                        control.follow([by, by]);
                    }
                    let ended = [Rung(0), Rung(Rung::LAST)].contains(&control.rung);
                    assert!(moves[20..] == [0; 4] || ended, "light {light} from {start}: {moves:?}");
                    let turns = moves.windows(2).filter(|w| w[0].signum() * w[1].signum() < 0).count();
                    assert!(turns <= 1, "light {light} from {start}: {moves:?}");
                }
            }
        }
    }

    #[test]
    fn darkness_asks_for_more_and_white_for_less() {
        let flat = |value: usize| core::array::from_fn(|v| if v == value { 76_800 } else { 0 });
        assert_eq!([flat(0), flat(1), flat(150), flat(255)].map(|h| steps(&h)), [MOST, MOST, 0, -OCTAVE]);
        assert_eq!(steps(&[0; 256]), MOST);
    }

    #[test]
    fn an_order_holds_and_control_goes_on_behind_it() {
        let mut control = Control::default();
        control.fix(Some(Exposure::new(100, 32)));
        control.follow([8, 8]);
        assert_eq!(control.exposure(), Exposure::new(100, 32));
        control.fix(None);
        control.follow([4, 3]);
        assert_eq!(control.exposure(), Rung::default().moved(3).exposure());
    }
}
