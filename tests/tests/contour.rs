//! The contour against analytic shapes at many angles and phases, and its loops against the mask.

use heapless::Vec as List;
use oracle::core::{Picture, picture, size};
use oracle::raster::{self as naive, Image, Random};
use shared::arena::Arena;
use shared::bitmap::Grey;
use shared::fixed::PX;
use shared::stage::contour::{ContourLoop, ContourPoint, contour, frontier};

/// The outline of what is above 100.
fn outline(picture: &Picture) -> (Vec<ContourPoint>, Vec<ContourLoop>, Image) {
    let image: Image = picture.iter().map(|row| row.iter().map(|&g| g > 100).collect()).collect();
    let (mut words, bytes) = (naive::words(&image), picture.concat());
    let (size, mask) = (size(picture), naive::bitmap(&image, &mut words));
    let mut block = vec![7; 1 << 16];
    let mut points = Box::new(List::<_, 16384>::new());
    let mut loops = Box::new(List::<_, 4096>::new());
    let grey = Grey::new(size, size.width, &bytes).unwrap();
    contour(Some(grey), &mask, Arena::new(&mut block), &mut *points, &mut *loops).unwrap();
    (points.to_vec(), loops.to_vec(), image)
}

/// What a camera with square pixels sees of a shape, from 256 points a pixel near its edge; `distance` is
/// signed, negative inside, at least roughly.
fn seen(side: usize, distance: &dyn Fn(f64, f64) -> f64) -> Picture {
    picture(side, side, |u, v| {
        let (u, v) = (u as f64, v as f64);
        let middle = distance(u, v);
        let covered = if middle.abs() > 1.5 {
            if middle < 0.0 { 256 } else { 0 }
        } else {
            let at = |k: usize| (k as f64 + 0.5) / 16.0 - 0.5;
            (0..256).filter(|k| distance(u + at(k % 16), v + at(k / 16)) < 0.0).count()
        };
        (12 + covered * 180 / 256) as u8
    })
}

fn px(x: i32) -> f64 {
    f64::from(x) / f64::from(PX)
}

/// Root mean square and largest error, px, of the points that `keep` lets through.
fn errors(
    points: &[ContourPoint],
    distance: &dyn Fn(f64, f64) -> f64,
    keep: impl Fn(f64, f64) -> bool,
) -> (f64, f64) {
    let kept = points.iter().map(|p| (px(p.at.u), px(p.at.v))).filter(|p| keep(p.0, p.1));
    let all: Vec<f64> = kept.map(|(u, v)| distance(u, v).abs()).collect();
    assert!(all.len() > 20);
    let rms = (all.iter().map(|e| e * e).sum::<f64>() / all.len() as f64).sqrt();
    (rms, all.into_iter().fold(0.0, f64::max))
}

#[test]
fn straight_edges_at_every_angle_and_phase() {
    let mut worst = (0.0f64, 0.0f64);
    for step in 0..45 {
        let (sin, cos) = (f64::from(step) * 2.0).to_radians().sin_cos();
        for phase in [0.0, 0.13, 0.25, 0.5, 0.77] {
            // A square of side 36 about the middle, turned and moved.
            let along = move |u: f64, v: f64| {
                let (u, v) = (u - 31.5 - phase, v - 31.5 - phase / 3.0);
                ((u * cos + v * sin).abs(), (v * cos - u * sin).abs())
            };
            let distance = move |u: f64, v: f64| {
                let (a, b) = along(u, v);
                a.max(b) - 18.0
            };
            let (points, loops, _) = outline(&seen(64, &distance));
            assert_eq!(loops.len(), 1);
            // Three pixels off the corners, which no outline of pixels has.
            let (rms, most) = errors(&points, &distance, |u, v| {
                let (a, b) = along(u, v);
                a.min(b) < 15.0
            });
            worst = (worst.0.max(rms), worst.1.max(most));
        }
    }
    println!("straight edges: rms {:.3} px, at most {:.3} px", worst.0, worst.1);
    assert!(worst.0 < 0.05 && worst.1 < 0.2, "{worst:?}");
}

#[test]
fn ellipses_at_every_angle_and_phase() {
    let mut worst = (0.0f64, 0.0f64, 0.0f64);
    for step in 0..18 {
        let (sin, cos) = (f64::from(step) * 10.0).to_radians().sin_cos();
        for (a, b) in [(24.0, 24.0), (26.0, 14.0), (20.0, 9.0)] {
            for phase in [0.0, 0.3, 0.5, 0.8] {
                let turned = move |u: f64, v: f64| {
                    let (u, v) = (u - 31.5 - phase, v - 32.0 - phase / 2.0);
                    (u * cos + v * sin, v * cos - u * sin)
                };
                // Distance to first order: value over slope.
                let distance = move |u: f64, v: f64| {
                    let (x, y) = turned(u, v);
                    let value = (x / a).powi(2) + (y / b).powi(2) - 1.0;
                    value / (2.0 * (x / (a * a)).hypot(y / (b * b))).max(1e-3)
                };
                let (points, loops, _) = outline(&seen(64, &distance));
                assert_eq!(loops.len(), 1);
                let (rms, most) = errors(&points, &distance, |_, _| true);
                worst = (worst.0.max(rms), worst.1.max(most), worst.2);
                for p in &points {
                    let (x, y) = turned(px(p.at.u), px(p.at.v));
                    let (nx, ny) = (x / (a * a), y / (b * b));
                    let (nu, nv) = (nx * cos - ny * sin, nx * sin + ny * cos);
                    let (u, v) = (f64::from(p.normal.u), f64::from(p.normal.v));
                    let turn = (nu * v - nv * u).atan2(nu * u + nv * v).abs().to_degrees();
                    worst.2 = worst.2.max(turn);
                }
                // Frontier points: the true extents of the ellipse.
                let half = (a * sin).hypot(b * cos);
                let (top, bottom) = frontier(&points).unwrap();
                for (found, truth) in [(top, -half), (bottom, half)] {
                    assert!((px(found.at.v) - 32.0 - phase / 2.0 - truth).abs() < 0.12, "{a} {b} {step}");
                }
            }
        }
    }
    println!(
        "ellipses: rms {:.3} px, at most {:.3} px, normals within {:.1} degrees",
        worst.0, worst.1, worst.2
    );
    assert!(worst.0 < 0.05 && worst.1 < 0.2 && worst.2 < 12.0, "{worst:?}");
}

/// How often the loops wind around a point.
fn winding(points: &[ContourPoint], loops: &[ContourLoop], (u, v): (f64, f64)) -> i32 {
    let mut turns = 0;
    for l in loops {
        for i in l.range() {
            let (a, b) = (points[i].at, points[l.step(i, 1)].at);
            let (below, ahead) = (px(a.v) <= v, px(b.v) <= v);
            if below != ahead && px(a.u) + (v - px(a.v)) / px(b.v - a.v) * px(b.u - a.u) > u {
                turns += if below { 1 } else { -1 };
            }
        }
    }
    turns
}

#[test]
fn loops_are_closed_and_have_the_topology_of_the_mask() {
    let mut random = Random(9);
    for case in 0..400usize {
        let (width, height) = (1 + case % 97, 1 + case % 31);
        let image = match case % 4 {
            0 => naive::noise(width, height, 10 + random.below(80), case as u64),
            _ => naive::blobs(width, height, case as u64),
        };
        // Grey values as wild as can be: the topology is the mask's all the same.
        let wild = case % 8 < 4;
        let mut grey = |on: bool| match (on, wild) {
            (true, true) => 101 + random.below(155) as u8,
            (false, true) => random.below(101) as u8,
            (on, false) => 10 + 190 * u8::from(on),
        };
        let picture: Picture = image.iter().map(|row| row.iter().map(|&on| grey(on)).collect()).collect();
        let (points, loops, mask) = outline(&picture);
        assert_eq!(mask, image);
        let (components, holes) = naive::topology(&image);
        assert_eq!(loops.len(), components + holes);
        for l in &loops {
            assert!(l.len >= 8);
            for i in l.range() {
                // A crack is moved by at most 3/4 px, so that neighbours are at most 2.9 px apart.
                let step = points[i].at.distance(points[l.step(i, 1)].at);
                assert!(step <= 3 * PX, "case {case}: a step of {} px", px(step));
            }
        }
        if !wild && case % 4 != 0 {
            for (u, v) in naive::all(&image) {
                let turns = winding(&points, &loops, (f64::from(u) + 1e-3, f64::from(v) + 1e-3));
                let inside = naive::get(&image, (u, v));
                assert_eq!(turns.abs(), i32::from(inside), "case {case}: pixel {u} {v}");
            }
        }
        for p in points.iter().filter(|p| p.border) {
            let out = |x: i32, side: usize| x <= 0 || x >= (side as i32 - 1) * PX;
            assert!(out(p.at.u, width) || out(p.at.v, height), "case {case}: no border at {:?}", p.at);
        }
    }
}
