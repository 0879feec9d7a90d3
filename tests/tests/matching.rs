//! The stages that match and grow, against their naive twins in floats, fractions and by brute force.

use heapless::Vec as List;
use oracle::matching as naive;
use oracle::raster::Random;
use shared::arena::Arena;
use shared::fixed::{ONE, PX, UNIT, hypot, log2};
use shared::point::{Direction, PixelPoint};
use shared::stage::contour::{ContourLoop, ContourPoint};
use shared::stage::invariants::{Measure, feature_vector};
use shared::stage::medial::medial_balls;
use shared::stage::nearest::pair_nearest;
use shared::stage::plane::{AffineMap, ImagePlane, Observation};
use shared::stage::rows::{RowCrossing, count_crossings, match_rows, row_crossings};
use shared::strips::{Disc, Strips};

fn at(u: f64, v: f64) -> PixelPoint {
    let fixed = |x: f64| (x * f64::from(PX)).round() as i32;
    PixelPoint { u: fixed(u), v: fixed(v) }
}

fn px(p: PixelPoint) -> [f64; 2] {
    [p.u, p.v].map(|x| f64::from(x) / f64::from(PX))
}

fn uniform(random: &mut Random, low: f64, high: f64) -> f64 {
    low + (high - low) * random.below(1 << 32) as f64 / f64::from(u32::MAX)
}

#[test]
fn logarithms_are_those_of_floats() {
    let mut random = Random(1);
    for k in 0..100_000u64 {
        let x = if k < 4096 { k + 1 } else { random.below(u64::MAX) >> random.below(63) | 1 };
        let error = f64::from(log2(x)) - (x as f64).log2() * f64::from(ONE);
        assert!(error.abs() <= 3.0, "log2 {x} is {error} off");
    }
}

#[test]
fn lengths_are_rounded_down() {
    let mut random = Random(2);
    let mut side = || random.below(1 << 32) as i64 as i32;
    for _ in 0..50_000 {
        let (a, b) = (side() / 2, side() / 2);
        let (exact, found) = (i128::from(a).pow(2) + i128::from(b).pow(2), i128::from(hypot(a, b)));
        assert!(found * found <= exact && (found + 1) * (found + 1) > exact, "{a} {b}: {found}");
    }
}

#[test]
fn ratios_are_those_of_fractions() {
    let mut random = Random(3);
    for case in 0..20_000 {
        let reach = [40, 4000, 1 << 20][case % 3];
        let quadruplet = [(); 4].map(|()| (random.below(reach) as i64, random.below(reach) as i64));
        let polygon = quadruplet.map(|(u, v)| PixelPoint { u: u as i32, v: v as i32 });
        let found = feature_vector(&polygon, 0, Measure::Ratio);
        let logarithms = feature_vector(&polygon, 0, Measure::Logarithm);
        let apart = |k: usize, l: usize| polygon[k].distance(polygon[l]);
        let noise = f64::from(apart(0, 2).max(apart(1, 3)).max(apart(0, 3))) * f64::from(PX) / 2.0;
        for (k, (n, d)) in naive::ratios(quadruplet).into_iter().enumerate() {
            let (n, d) = (n.max(1), d.max(1));
            // The clamped ratio, rounded down: found <= n / d * 2^16 < found + 1.
            let exact = ((n << 16) / d).clamp(1 << 8, 1 << 24);
            assert_eq!(i128::from(found[k]), exact);
            let log = (n as f64 + noise).log2() - (d as f64 + noise).log2();
            let log = log.clamp(-8.0, 8.0) * f64::from(ONE);
            assert!((f64::from(logarithms[k]) - log).abs() <= 6.0, "{n} / {d}");
        }
    }
}

#[test]
fn planes_are_those_of_floats() {
    let mut random = Random(4);
    let mut worst = 0.0f64;
    for case in 0..2000 {
        let n = 12 + random.below(60) as usize;
        let (width, height) = (uniform(&mut random, 5.0, 600.0), uniform(&mut random, 5.0, 400.0));
        let (a, b, c) = (
            uniform(&mut random, -0.3, 0.3),
            uniform(&mut random, -0.3, 0.3),
            uniform(&mut random, -200.0, 200.0),
        );
        let noise = [0.0, 0.3, 1.0][case % 3];
        let seen: Vec<Observation> = (0..n)
            .map(|_| {
                let (u, v) = (uniform(&mut random, 0.0, width), uniform(&mut random, 0.0, height));
                let wild = if random.below(10) == 0 { 20.0 } else { 0.0 };
                let value = a * u + b * v + c + noise * uniform(&mut random, -1.0, 1.0) + wild;
                let weight = UNIT / 4 + random.below(UNIT as u64 * 3 / 4) as i32;
                Observation { at: at(u, v), value: (value * f64::from(PX)).round() as i32, weight }
            })
            .collect();
        let floats: Vec<_> = seen
            .iter()
            .map(|o| (px(o.at), f64::from(o.value) / f64::from(PX), f64::from(o.weight)))
            .collect();
        let (plane, naive) = (ImagePlane::fit(seen.iter().copied()).unwrap(), naive::robust_plane(&floats));
        for o in &seen {
            let off = f64::from(plane.at(o.at)) / f64::from(PX) - naive(px(o.at));
            worst = worst.max(off.abs());
        }
    }
    println!("planes differ by {worst:.4} px at most");
    assert!(worst < 0.1, "{worst} px");
}

#[test]
fn partners_are_the_nearest() {
    let mut random = Random(5);
    let mut points = |n: usize| -> Vec<PixelPoint> {
        (0..n).map(|_| at(random.below(90) as f64, random.below(90) as f64)).collect()
    };
    for n in 0..60 {
        let (left, right) = (points(40), points(n));
        let map = AffineMap::fit((0..4).map(|k| (left[k], left[(k + 1) % 4]))).unwrap();
        let (mut pairs, mut block) = (List::<_, 64>::new(), [7; 256]);
        let right_points = || right.iter().copied();
        pair_nearest(left.iter().copied(), right_points, &map, Arena::new(&mut block), &mut pairs).unwrap();
        assert_eq!(pairs.len(), if n == 0 { 0 } else { 40 });
        for (pair, l) in pairs.iter().zip(&left) {
            let [u, v] = px(map.apply(*l));
            let distance = |r: &PixelPoint| (px(*r)[0] - u).hypot(px(*r)[1] - v);
            let least = right.iter().map(distance).fold(f64::INFINITY, f64::min);
            assert!(pair.left == *l && distance(&pair.right) <= least);
            let first = right.iter().min_by_key(|r| map.apply(*l).distance_squared(**r));
            assert_eq!(first, Some(&pair.right), "of equals the first");
        }
    }
    let full = pair_nearest(
        [at(0.0, 0.0); 3].into_iter(),
        || [at(1.0, 1.0)].into_iter(),
        &AffineMap::default(),
        Arena::new(&mut [7; 64]),
        &mut List::<_, 2>::new(),
    );
    assert!(full.is_err());
}

/// A smooth closed curve about `centre`, clockwise on the screen, a point every pixel, with its normals.
fn curve(random: &mut Random, n: usize) -> Vec<ContourPoint> {
    let waves: Vec<[f64; 3]> =
        (1..5).map(|k| [f64::from(k), uniform(random, 0.0, 0.15), uniform(random, 0.0, 6.3)]).collect();
    let size = n as f64 / 7.0;
    let position = |t: f64| {
        let r = size * (1.0 + waves.iter().map(|[k, a, p]| a / k * (k * t + p).cos()).sum::<f64>());
        (100.0 + r * t.cos(), 100.0 + r * t.sin())
    };
    let point = |k: usize| {
        let t = std::f64::consts::TAU * k as f64 / n as f64;
        let ((u, v), (a, b), (c, d)) = (position(t), position(t - 1e-4), position(t + 1e-4));
        let normal = Direction::of(((d - b) * 1e9) as i32, (-(c - a) * 1e9) as i32).unwrap();
        ContourPoint { at: at(u, v), normal, border: false }
    };
    (0..n).map(point).collect()
}

#[test]
fn balls_are_the_largest_that_the_definition_allows() {
    let mut random = Random(6);
    let (mut balls, mut block) = (List::<_, 1024>::new(), [7; 1024]);
    for case in 0..12 {
        let points = curve(&mut random, 120 + 40 * case);
        medial_balls(&points, Arena::new(&mut block), &mut balls).unwrap();
        assert!(balls.len() > points.len() / 3, "{} of {}", balls.len(), points.len());
        let floats: Vec<_> = points
            .iter()
            .map(|p| {
                (px(p.at), [f64::from(p.normal.u) / f64::from(UNIT), f64::from(p.normal.v) / f64::from(UNIT)])
            })
            .collect();
        for ball in &balls {
            let [grown, touched] = ball.contacts.map(|k| k as usize);
            let (rho, naive) =
                (f64::from(ball.rho) / f64::from(PX), naive::medial_radius(&floats, grown, 1000.0));
            // The height above the tangent is cut to 1/256 px, which the radius feels by rho / height.
            assert!((rho - naive).abs() < 0.02 * naive + 0.05, "radius {rho}, by definition {naive}");
            let from = |k: usize| f64::from(ball.centre.distance(points[k].at)) / f64::from(PX);
            assert!((from(grown) - rho).abs() < 0.03, "{} {rho}", from(grown));
            assert!((from(touched) - rho).abs() < 0.02 * rho + 0.05, "{} {rho}", from(touched));
            let deepest = points.iter().map(|q| ball.centre.distance(q.at)).min().unwrap();
            assert!(deepest >= ball.rho - PX * 2 / 5 - 1);
        }
    }
    let many = curve(&mut random, 200);
    assert!(medial_balls(&many, Arena::new(&mut block), &mut List::<_, 3>::new()).is_err());
    assert!(medial_balls(&many, Arena::new(&mut block[..9]), &mut balls).is_err());
}

/// Rows of points with normals such as no contour has, a kind a number.
fn adversary(random: &mut Random, kind: usize) -> Vec<ContourPoint> {
    let n = [0, 1, 2, 9, 33, 64, 150][random.below(7) as usize];
    let reach = [3, 300, 20_000, 1 << 20][random.below(4) as usize];
    let mut any = |reach: i32| (random.below(2 * reach as u64 + 1)) as i32 - reach;
    let turn = f64::from(any(1 << 12)) / 652.0;
    let direction = |t: f64, length: f64| {
        let part = |x: f64| (x * length * f64::from(UNIT)).round().clamp(-16384.0, 16384.0) as i16;
        Direction { u: part(t.cos()), v: part(t.sin()) }
    };
    let place = |t: f64, r: f64| PixelPoint { u: (r * t.cos()) as i32, v: (r * t.sin()) as i32 };
    let round = |k: usize| std::f64::consts::TAU * k as f64 / n as f64;
    let size = f64::from(reach);
    let point = |k: usize| {
        let (at, normal) = match kind {
            // Anywhere, with any normal.
            0 => (
                PixelPoint { u: any(reach), v: any(reach) },
                Direction { u: any(16384) as i16, v: any(16384) as i16 },
            ),
            // On one line, looking along it and across.
            1 => (place(turn, size * k as f64 / n as f64), direction(turn + round(k % 4 * n / 4), 1.0)),
            // A circle: every disc is the same but for rounding; normals too long, or too short.
            2 => (place(round(k), size), direction(round(k), 1.0)),
            3 => (place(round(k), size), direction(round(k), 1.002)),
            4 => (place(round(k), size), direction(round(k), 0.7)),
            // All in one place, or in two.
            5 => (
                place(turn, size * (k % 2) as f64),
                direction(turn + std::f64::consts::PI * (1 - k % 2) as f64, 1.0),
            ),
            // Two walls across from each other, whose normals are a little too long.
            6 | 7 => {
                let (side, along) = ((2 * (k % 2)) as f64 - 1.0, f64::from(any(reach)));
                let wall = place(turn, side * size / 3.0);
                let slide = place(turn + std::f64::consts::FRAC_PI_2, along);
                let at = PixelPoint { u: wall.u + slide.u, v: wall.v + slide.v };
                (at, direction(turn, side * [1.0, 1.0004][kind - 6]))
            }
            // A noisy blob.
            _ => (place(round(k), size * (1.0 + f64::from(any(100)) / 1000.0)), direction(round(k), 1.0)),
        };
        ContourPoint { at, normal, border: false }
    };
    (0..n).map(point).collect()
}

#[test]
fn balls_are_those_of_every_point_tried_in_turn() {
    let mut random = Random(9);
    let (mut balls, mut block) = (List::<_, 1024>::new(), [7; 1024]);
    let mut found = [0; 10];
    for case in 0..4000 {
        let kind = case % 10;
        let points = match kind {
            9 => curve(&mut random, 8 + case % 200),
            kind => adversary(&mut random, kind),
        };
        medial_balls(&points, Arena::new(&mut block), &mut balls).unwrap();
        let wide = |a: i32, b: i32| [a, b].map(i64::from);
        let rims: Vec<naive::Rim> =
            points.iter().map(|p| (wide(p.at.u, p.at.v), [p.normal.u, p.normal.v].map(i64::from))).collect();
        let expected = (0..rims.len()).filter_map(|i| {
            let (centre, rho, contact) = naive::medial_ball(&rims, i, i64::from(PX) * 2 / 5)?;
            Some((centre, rho, [i as u32, contact as u32]))
        });
        let balls: Vec<_> =
            balls.iter().map(|b| (wide(b.centre.u, b.centre.v), i64::from(b.rho), b.contacts)).collect();
        assert_eq!(balls, expected.collect::<Vec<_>>(), "kind {kind}, case {case}: {points:?}");
        found[kind] += balls.len();
    }
    println!("balls of each kind: {found:?}");
    assert!(found.iter().all(|count| *count > 100), "{found:?}");
}

#[test]
fn strips_show_what_lies_inside() {
    let mut random = Random(10);
    let mut block = [7; 4096];
    for case in 0..2000 {
        let points: Vec<_> = adversary(&mut random, case % 9).iter().map(|p| p.at).collect();
        let strips = Strips::new(&points, &mut Arena::new(&mut block)).unwrap();
        let reach = [40, 5000, 1 << 20, 1 << 29][case % 4];
        let mut any = || random.below(2 * reach) as i32 - reach as i32;
        for _ in 0..20 {
            let (centre, radius) = (PixelPoint { u: any(), v: any() }, any().max(0));
            let squared = i64::from(radius).pow(2);
            let mut shown = Vec::new();
            strips.walk(Disc { centre, radius }, |k, p, _| shown.push((k, *p)));
            let inside = points.iter().copied().enumerate();
            let inside: Vec<_> = inside.filter(|(_, p)| centre.distance_squared(*p) < squared).collect();
            assert_eq!(shown, inside);
        }
    }
}

/// Vertical edges: a closed loop for each bar, with a point every half pixel up and down its sides.
fn bars(bars: &[(f64, f64)], height: usize) -> (Vec<ContourPoint>, Vec<ContourLoop>) {
    let (mut points, mut loops) = (Vec::new(), Vec::new());
    for &(left, right) in bars {
        let start = points.len();
        for k in 0..=2 * height {
            let normal = Direction { u: UNIT as i16, v: 0 };
            points.push(ContourPoint { at: at(right, 0.5 * k as f64 - 0.25), normal, border: false });
        }
        for k in (0..=2 * height).rev() {
            let normal = Direction { u: -UNIT as i16, v: 0 };
            points.push(ContourPoint { at: at(left, 0.5 * k as f64 - 0.25), normal, border: false });
        }
        loops.push(ContourLoop { start, len: points.len() - start });
    }
    (points, loops)
}

#[test]
fn crossings_are_where_the_outline_meets_the_rows() {
    let mut random = Random(7);
    for case in 0..40usize {
        let points = curve(&mut random, 100 + 10 * case);
        let loops = [ContourLoop { start: 0, len: points.len() }];
        let offset = [0, 77, -300][case % 3];
        let mut first = [9; 241];
        let mut crossings = vec![RowCrossing::default(); count_crossings(&points, &loops, offset, 240)];
        let rows = row_crossings(&points, &loops, offset, &mut first, &mut crossings);
        for v in 0..240 {
            let line = f64::from(v * PX + offset) / f64::from(PX);
            let mut expected: Vec<(f64, bool)> = Vec::new();
            for (k, p) in points.iter().enumerate() {
                let ([u0, v0], [u1, v1]) = (px(p.at), px(points[(k + 1) % points.len()].at));
                if (v0 <= line) != (v1 <= line) {
                    expected.push((u0 + (u1 - u0) * (line - v0) / (v1 - v0), v1 > v0));
                }
            }
            expected.sort_by(|a, b| a.0.total_cmp(&b.0));
            let row = rows.row(v as usize);
            assert_eq!(row.len(), expected.len(), "row {v}");
            for (c, (u, downwards)) in row.iter().zip(expected) {
                assert!((f64::from(c.u) / f64::from(PX) - u).abs() < 0.01 && (c.heading > 0) == downwards);
            }
        }
    }
}

/// Every pairing of small rows is looked at: none is cheaper than what the pairs and gaps found cost.
#[test]
fn alignment_is_the_cheapest_of_all() {
    let mut random = Random(8);
    let (mut unmatched_seen, mut matched_seen) = (0, 0);
    for case in 0..300 {
        let mut side = |n: u64| {
            let mut u = uniform(&mut random, 20.0, 60.0);
            let mut bars = Vec::new();
            for _ in 0..n {
                let width = uniform(&mut random, 2.0, 25.0);
                bars.push((u, u + width));
                u += width + uniform(&mut random, 2.0, 25.0);
            }
            bars
        };
        let (left, right) = (side(case % 3 + 1), side(2));
        let right: Vec<_> = right.iter().map(|(a, b)| (a - 10.0, b - 10.0)).collect();
        let height = 9;
        let ((points, loops), (right_points, right_loops)) = (bars(&left, height), bars(&right, height));
        let plane = ImagePlane { level: 10 * PX, ..ImagePlane::default() };
        let (mut first, mut right_first) = ([0; 10], [0; 10]);
        let (mut crossings, mut right_crossings) =
            ([RowCrossing::default(); 256], [RowCrossing::default(); 256]);
        let rows = row_crossings(&points, &loops, 0, &mut first, &mut crossings);
        let right_rows =
            row_crossings(&right_points, &right_loops, 0, &mut right_first, &mut right_crossings);
        let (mut matches, mut block) = (List::<_, 512>::new(), [7; 1024]);
        let statistics = match_rows(
            (&points, &loops),
            &right_points,
            (rows, right_rows),
            &plane,
            &mut matches,
            Arena::new(&mut block),
        )
        .unwrap();

        let edges =
            |row: &[RowCrossing]| -> Vec<naive::Edge> { row.iter().map(|c| (c.u, c.heading > 0)).collect() };
        let (a, b) = (edges(rows.row(4)), edges(right_rows.row(4)));
        let cost = |x: naive::Edge, y: naive::Edge| (x.0 - y.0 - 10 * PX).abs().min(30 * PX);
        // All rows are alike.
        let unmatched = statistics.unmatched as usize / rows.len();
        let paired = a.len() - unmatched;
        unmatched_seen += unmatched;
        matched_seen += paired;
        // The number of pairs is that of a cheapest alignment.
        let (_, pairs) = naive::cheapest(&a, &b, &cost, 6 * PX);
        assert_eq!(paired, pairs.len(), "{a:?} {b:?}");
        // And so are the pairs themselves, as far as the loop's average lets them through: alone in its
        // loop, a pair gives its own disparity.
        for &(i, j) in pairs.iter().filter(|_| loops.len() == 1 && pairs.len() == 1) {
            let found = matches[rows.row(4)[i].index as usize].disparity;
            assert!((found - (a[i].0 - b[j].0)).abs() <= 2, "{a:?} {b:?}");
        }
    }
    assert!(unmatched_seen > 100 && matched_seen > 100);
}
