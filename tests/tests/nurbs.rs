//! Curves along skeleton edges: the fixed-point fit and evaluation against the definitions in `f64`, and
//! no panic on anything.

use heapless::Vec as List;
use oracle::nurbs as float;
use proptest::prelude::*;
use shared::arena::Arena;
use shared::envelope::Envelope;
use shared::stage::branch::{Ball, Sample};
use shared::stage::nurbs::{Control, FitParams, LEAST_RADIUS, MAX_CONTROLS, Nurbs, fit};

const ONE: i32 = 1 << 16;

type Controls = List<Control, MAX_CONTROLS>;

fn fitted_by(samples: &[Sample], closed: bool, params: &FitParams) -> Controls {
    let mut block = vec![7; (7 + 4) * MAX_CONTROLS];
    let mut controls = Controls::new();
    let count = fit(samples, closed, params, Arena::new(&mut block), &mut controls).unwrap();
    assert_eq!(count, controls.len());
    controls
}

fn fitted(samples: &[Sample], closed: bool) -> Controls {
    fitted_by(samples, closed, &FitParams::default())
}

fn balls(samples: &[Sample]) -> Vec<([f64; 4], f64)> {
    let weight = |s: &Sample| f64::from(s.weight.clamp(ONE / 64, ONE)) / f64::from(ONE);
    samples.iter().map(|s| (channels(s.ball), weight(s))).collect()
}

fn channels(b: Ball) -> [f64; 4] {
    [b.u, b.v, b.rho, b.d].map(f64::from)
}

fn length(samples: &[Sample], closed: bool) -> f64 {
    let n = samples.len();
    let chord = |k: usize| {
        let (a, b) = (channels(samples[k].ball), channels(samples[(k + 1) % n].ball));
        (a[0] - b[0]).hypot(a[1] - b[1])
    };
    (0..if closed { n } else { n - 1 }).map(chord).sum()
}

/// The largest difference of the fit's control points from those of the definition, 1/256 px.
fn error(samples: &[Sample], closed: bool, params: &FitParams) -> f64 {
    let controls = fitted_by(samples, closed, params);
    let pieces = ((length(samples, closed) / 256.0) as usize).clamp(if closed { 8 } else { 7 }, 0xFFFF);
    let expected = float::fit(
        &balls(samples),
        closed,
        pieces,
        controls.len(),
        f64::from(params.smoothing) / f64::from(ONE),
        f64::from(params.end_weight),
    );
    let difference = |(a, b): (&Control, &[f64; 4])| {
        let a = channels(a.ball);
        (0..4).map(|k| (a[k] - b[k]).abs()).fold(0.0, f64::max)
    };
    controls.iter().zip(&expected).map(difference).fold(0.0, f64::max)
}

/// A smooth curve with noise: half a pixel in place, a tenth in disparity.
fn wave(n: usize, closed: bool, scale: f64, seed: u64) -> Vec<Sample> {
    let mut state = seed | 1;
    let mut noise = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f64 / f64::from(1 << 24) - 0.5
    };
    let turn = std::f64::consts::TAU / n as f64;
    (0..n)
        .map(|i| {
            let a = turn * i as f64;
            let (u, v) = if closed {
                (a.cos() * (1.0 + 0.3 * (3.0 * a).cos()), a.sin())
            } else {
                (a, (2.0 * a).sin() * 0.5)
            };
            let at = |x: f64| (x * 256.0).round() as i32;
            let ball = Ball {
                u: at(320.0 + scale * u + noise()),
                v: at(240.0 + scale * v + noise()),
                rho: at(12.0 + 6.0 * (2.0 * a).cos() + noise()),
                d: at(30.0 + 3.0 * a.sin() + 0.2 * noise()),
            };
            Sample { ball, weight: ONE - (noise().abs() * f64::from(ONE)) as i32 }
        })
        .collect()
}

#[test]
fn control_points_equal_the_float_fit() {
    let params = FitParams::default();
    for (n, scale) in [(12, 2.0), (40, 8.0), (150, 25.0), (600, 95.0), (2000, 300.0)] {
        for closed in [false, true] {
            let error = error(&wave(n, closed, scale, n as u64), closed, &params);
            assert!(error <= 1.0, "{n} balls, closed {closed}: {error}");
        }
    }
}

#[test]
fn other_parameters_and_few_control_points_too() {
    let spacings = [2, 4, 8, 30, 60, 100_000];
    for (smoothing, end_weight) in [(0.01, 1), (1.0, 100), (8.0, 10), (0.1, 10)] {
        let smoothing = (smoothing * f64::from(ONE)) as i32;
        for (spacing, closed) in spacings.into_iter().flat_map(|s| [(s, false), (s, true)]) {
            let params = FitParams { spacing: spacing * 256, smoothing, end_weight };
            let error = error(&wave(300, closed, 50.0, 7), closed, &params);
            assert!(error <= 1.0, "{params:?}, closed {closed}: {error}");
        }
    }
}

#[test]
fn evaluation_equals_the_float_definition() {
    for closed in [false, true] {
        for n in [4, 5, 6, 7, 20] {
            let mut controls = Controls::new();
            for (i, s) in wave(n, closed, 200.0, 3).iter().enumerate() {
                let weight = [ONE, ONE / 3, 4 * ONE, ONE / 16][i % 4];
                controls.push(Control { ball: s.ball, weight }).unwrap();
            }
            let curve = Nurbs::new(&controls, closed).unwrap();
            let reference: Vec<_> =
                controls.iter().map(|c| (channels(c.ball), f64::from(c.weight) / f64::from(ONE))).collect();
            for t in (0..=curve.end()).step_by(1237).chain([curve.end()]) {
                let expected = float::evaluate(&reference, closed, f64::from(t) / f64::from(ONE));
                let ball = channels(curve.evaluate(t));
                for k in 0..4 {
                    let floor = if k == 2 { f64::from(LEAST_RADIUS) } else { f64::MIN };
                    let error = (ball[k] - expected[k].max(floor)).abs();
                    assert!(error <= 0.51, "channel {k} at {t} of {n}: {error}");
                }
            }
        }
    }
}

#[test]
fn a_closed_curve_is_smooth_where_it_closes() {
    let controls = fitted(&wave(200, true, 30.0, 5), true);
    let curve = Nurbs::new(&controls, true).unwrap();
    assert_eq!(curve.evaluate(0), curve.evaluate(curve.end()));
    // Second differences over 1/4 span, across the seam: a cubic's change by at most its third
    // derivative x step^3, which is no larger there than within the spans around.
    let at = |k: i32| channels(curve.evaluate(k * ONE / 4));
    for c in 0..4 {
        let bend = |k: i32| at(k - 1)[c] - 2.0 * at(k)[c] + at(k + 1)[c];
        let seam = (bend(1) - bend(0)).abs().max((bend(0) - bend(-1)).abs());
        let around = (-8..8).map(|k| (bend(k + 1) - bend(k)).abs()).fold(0.0, f64::max);
        assert!(seam <= around, "channel {c}: {seam} against {around}");
        let reference: Vec<_> = controls.iter().map(|c| (channels(c.ball), 1.0)).collect();
        let (h, n) = (1e-3, controls.len());
        let float = |t: f64| float::evaluate(&reference, true, t)[c];
        let side = |s: f64| (float(2.0 * s * h) - 2.0 * float(s * h) + float(0.0)) / (h * h);
        // On a cubic this is the second derivative + h x the third, a third difference of controls.
        let control = |k: usize| channels(controls[k % n].ball)[c];
        let third = |k: usize| control(k + 3) - 3.0 * control(k + 2) + 3.0 * control(k + 1) - control(k);
        let largest = (0..n).map(|k| third(k).abs()).fold(0.0, f64::max);
        assert!((side(1.0) - side(-1.0)).abs() <= 2.0 * h * largest + 0.01, "channel {c}");
    }
}

#[test]
fn a_curve_stays_near_its_balls_and_reaches_its_ends() {
    let samples = wave(300, false, 40.0, 9);
    let controls = fitted(&samples, false);
    let curve = Nurbs::new(&controls, false).unwrap();
    let mut row = List::<Ball, 600>::new();
    curve.sample(256, |ball| row.push(ball)).unwrap();
    for ends in [(samples[0].ball, row[0]), (samples[299].ball, row[row.len() - 1])] {
        assert!((ends.0.u - ends.1.u).abs() < 128 && (ends.0.v - ends.1.v).abs() < 128, "{ends:?}");
    }
    let near = |s: &Sample| {
        row.iter()
            .map(|b| f64::from(b.u - s.ball.u).hypot(f64::from(b.v - s.ball.v)))
            .fold(f64::MAX, f64::min)
    };
    let farthest = samples.iter().map(near).fold(0.0, f64::max);
    assert!(farthest < 320.0, "{farthest} / 256 px, with noise of half a pixel each way");
}

#[test]
fn sampling_is_even() {
    for closed in [false, true] {
        let controls = fitted(&wave(300, closed, 40.0, 11), closed);
        let curve = Nurbs::new(&controls, closed).unwrap();
        for step in [256, 1024, 2048] {
            let mut row = List::<Ball, 600>::new();
            curve.sample(step, |ball| row.push(ball)).unwrap();
            let gaps = row.windows(2).map(|p| f64::from(p[0].u - p[1].u).hypot(f64::from(p[0].v - p[1].v)));
            let gaps: Vec<f64> = gaps.collect();
            let (least, most) = gaps.iter().fold((f64::MAX, 0.0_f64), |(a, b), &g| (a.min(g), b.max(g)));
            let step = f64::from(step);
            assert!(least > 0.9 * step && most < 1.1 * step, "{least}..{most} for {step}");
        }
    }
}

#[test]
fn short_edges() {
    let at = |u: i32, rho: i32| Sample { ball: Ball { u: u * 256, v: 5 * 256, rho, d: 700 }, weight: ONE };
    assert_eq!(fitted(&[], false).len(), 0);
    assert_eq!(fitted(&[], true).len(), 0);
    for closed in [false, true] {
        let one = fitted(&[at(9, 300)], closed);
        assert!(one.len() == 4 && one.iter().all(|c| c.ball == at(9, 300).ball && c.weight == ONE));
        let mut row = List::<Ball, 4>::new();
        Nurbs::new(&one, closed).unwrap().sample(256, |ball| row.push(ball)).unwrap();
        assert_eq!(row[..], [at(9, 300).ball]);
    }
    let two = fitted(&[at(3, 300), at(6, 600)], false);
    assert_eq!(two[..].iter().map(|c| c.ball.rho).collect::<Vec<_>>(), [300, 400, 500, 600]);
    assert_eq!(Nurbs::new(&two, false).unwrap().evaluate(ONE / 2).u, 1152);
    assert!(Nurbs::new(&two[..3], false).is_none());
    // Many balls in one place.
    let pile = fitted(&[at(3, 300); 50], true);
    assert!(pile.iter().all(|c| c.ball == at(3, 300).ball));
}

#[test]
fn radii_are_floored_and_lent_memory_is_respected() {
    let controls = [Control { ball: Ball { rho: -9000, ..Ball::default() }, weight: 0 }; 5];
    assert_eq!(Nurbs::new(&controls, true).unwrap().evaluate(77).rho, LEAST_RADIUS);
    let samples = wave(300, false, 40.0, 1);
    let mut few = List::<Control, 5>::new();
    for (words, what, limit) in
        [(500, "control points", 5), (300, "entries of a fit", 120), (8, "control points of a fit", 2)]
    {
        let mut block = vec![7; words];
        let scratch = Arena::new(&mut block);
        few.clear();
        let error = fit(&samples, false, &FitParams::default(), scratch, &mut few).unwrap_err();
        assert_eq!((error.what, error.limit), (what, limit));
    }
}

fn any_ball(range: i32) -> impl Strategy<Value = Ball> {
    let c = || prop_oneof![4 => -range..=range, 1 => Just(0), 1 => Just(range), 1 => any::<i32>()];
    (c(), c(), c(), c()).prop_map(|(u, v, rho, d)| Ball { u, v, rho, d })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(256) })]

    #[test]
    fn nothing_panics_and_curves_stay_within_reason(
        range in prop_oneof![Just(3), Just(5000), Just(1 << 20)],
        raw in proptest::collection::vec((any_ball(1 << 20), any::<i32>(), 0..4usize), 0..40),
        closed: bool, spacing: i32, smoothing: i32, end_weight: i32, t: i32,
    ) {
        let mut samples = Vec::new();
        for (ball, weight, copies) in raw {
            let ball = Ball { u: ball.u % range, v: ball.v % range, ..ball };
            samples.extend(std::iter::repeat_n(Sample { ball, weight }, copies));
        }
        for params in [FitParams::default(), FitParams { spacing, smoothing, end_weight }] {
            let controls = fitted_by(&samples, closed, &params);
            prop_assert_eq!(controls.is_empty(), samples.is_empty());
            // A cubic fit overshoots its balls, but not by more than the range a few times over.
            prop_assert!(controls.iter().all(|c| c.ball.u.abs() < 1 << 23), "{:?}", controls);
            if let Some(curve) = Nurbs::new(&controls, closed) {
                curve.evaluate(t);
                let mut row = List::<Ball, 64>::new();
                let _full_is_fine = curve.sample(t, |ball| row.push(ball));
            }
        }
    }

    #[test]
    fn any_control_points_evaluate(
        raw in proptest::collection::vec((any_ball(1 << 20), any::<i32>()), 4..30), closed: bool, t: i32,
    ) {
        let controls: Vec<Control> = raw.into_iter().map(|(ball, weight)| Control { ball, weight }).collect();
        let ball = Nurbs::new(&controls, closed).unwrap().evaluate(t);
        prop_assert!(channels(ball).iter().all(|c| c.abs() <= f64::from(1 << 20)));
    }

    #[test]
    fn wild_fits_equal_the_float_fit(
        raw in proptest::collection::vec((any_ball(1 << 17), 0..=ONE), 6..40), closed: bool,
    ) {
        let bounded = |b: Ball| Ball { u: b.u % 20_000, v: b.v % 20_000, rho: b.rho % 9000, d: b.d % 9000 };
        let samples: Vec<Sample> =
            raw.into_iter().map(|(ball, weight)| Sample { ball: bounded(ball), weight }).collect();
        prop_assume!(length(&samples, closed) > 4.0 * 256.0);
        let error = error(&samples, closed, &FitParams::default());
        prop_assert!(error <= 1.0, "{}", error);
    }

    #[test]
    fn any_matrix_and_right_side_can_be_solved(
        entries in proptest::collection::vec(any::<i64>(), 0..200), rows in 0usize..20, cyclic: bool,
        bits in 0u32..40,
    ) {
        let mut memory = vec![0; 20 * 20];
        let mut matrix = Envelope::new(rows, cyclic, &mut memory).unwrap();
        for (k, entry) in entries.iter().enumerate() {
            matrix.add(k % 21, k * 7 % 21, *entry);
        }
        matrix.scale_down(bits);
        matrix.factorise();
        let mut sides = vec![[i64::MAX, i64::MIN, 7]; rows];
        matrix.solve(&mut sides);
    }
}
