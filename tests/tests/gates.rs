//! Each bad input and what it must give: a refusal whose sentence says what is wrong
//! and what to do, a warning beside a model, or a mended model. Thresholds: docs/decisions/0005-gates.md.

use host::evaluate::{Options as Ruler, evaluate};
use host::reconstruct::{Options, Reconstruction, Refusal};
use host::render::Noise;
use host::shape::Shape;
use host::view::Pinhole;
use image::{GrayImage, imageops};
use oracle::gates::turned_coin;
use oracle::scene::{Pair, drawn_pair, model, pair, right_moved_down, views};
use shared::fixed::{ONE, PX};
use shared::pipeline::{Finding, Side};
use shared::stage::binarise::{Polarity, Threshold};

fn outcome(pair: &Pair) -> Result<Reconstruction, Refusal> {
    model(pair, &Options::default())
}

/// The finding that refuses the pair; its sentence must hold all the words.
fn refusal(pair: &Pair, words: &[&str]) -> Finding {
    match outcome(pair) {
        Err(Refusal::Gate(finding)) => {
            let sentence = Refusal::Gate(finding).to_string();
            assert!(words.iter().all(|word| sentence.contains(word)), "{sentence}");
            finding
        }
        Err(other) => panic!("another refusal: {other}"),
        Ok(model) => panic!("a model, with {:?}", model.outcome.findings),
    }
}

/// The findings beside a model, which must have faces.
fn warnings(pair: &Pair) -> Vec<Finding> {
    let model = outcome(pair).unwrap_or_else(|refusal| panic!("{refusal}"));
    assert!(model.mesh.faces.len() > 100);
    model.outcome.findings.to_vec()
}

fn disc(u0: f64, v0: f64, r: f64) -> impl Fn(f64, f64) -> bool {
    move |u, v| (u - u0).hypot(v - v0) < r
}

#[test]
fn nothing_or_next_to_nothing_is_no_object() {
    for pair in [drawn_pair(40.0, 0.0, |_, _| false), drawn_pair(40.0, 0.0, disc(160.0, 120.0, 4.0))] {
        let found = refusal(&pair, &["no object", "left image", "light the object", "--threshold"]);
        assert!(matches!(found, Finding::NoObject(Side::Left, 0..64)), "{found:?}");
    }
    let [left, _] = drawn_pair(40.0, 0.0, disc(160.0, 120.0, 40.0));
    let right = GrayImage::from_pixel(320, 240, image::Luma([12]));
    let found = refusal(&[left, right], &["no object", "right image"]);
    assert!(matches!(found, Finding::NoObject(Side::Right, _)));
}

#[test]
fn an_object_over_most_of_the_image_is_the_background() {
    let dark = drawn_pair(40.0, 0.0, |u, v| !disc(160.0, 120.0, 40.0)(u, v));
    let found = refusal(&dark, &["covers", "% of the left image", "--polarity"]);
    assert!(matches!(found, Finding::FillsImage(Side::Left, 61..=100)), "{found:?}");
    let dark_object = Options { polarity: Polarity::DarkObject, ..Options::default() };
    assert!(model(&dark, &dark_object).is_ok(), "what the sentence proposes helps");
    let full = [0, 1].map(|_| GrayImage::from_pixel(320, 240, image::Luma([200])));
    let below = Options { threshold: Threshold::Fixed(100), ..Options::default() };
    let found = model(&full, &below).unwrap_err().to_string();
    assert!(found.contains("covers 100 %"), "{found}");
    refusal(&full, &["no object"]);
}

#[test]
fn a_second_object_is_a_warning_below_which_none_is_given() {
    let two = |r: f64| move |u: f64, v: f64| disc(140.0, 120.0, 40.0)(u, v) || disc(250.0, 60.0, r)(u, v);
    let found = warnings(&drawn_pair(40.0, 0.0, two(15.0)));
    assert!(found.iter().any(|f| matches!(f, Finding::SecondObject(Side::Left, 13..=15))), "{found:?}");
    assert!(found.iter().any(|f| matches!(f, Finding::SecondObject(Side::Right, 13..=15))), "{found:?}");
    let found = warnings(&drawn_pair(40.0, 0.0, two(10.0)));
    assert!(!found.iter().any(|f| matches!(f, Finding::SecondObject(..))), "{found:?}");
}

#[test]
fn objects_of_two_sizes_are_not_one() {
    for (r, left_larger) in [(30.0, true), (52.0, false)] {
        let [left, _] = drawn_pair(40.0, 0.0, disc(170.0, 120.0, 40.0));
        let [_, right] = drawn_pair(40.0, 0.0, disc(170.0, 120.0, r));
        let found = refusal(&[left, right], &["% as large", "not show the same object", "threshold"]);
        assert!(matches!(found, Finding::AreasDiffer(ratio) if (ratio < ONE) == left_larger));
    }
}

#[test]
fn touching_the_border_is_flagged_and_modelled() {
    // A rod that runs out of the top of the image.
    let rod = |u: f64, v: f64| (u - 170.0).abs() < 20.0 && v < 160.0;
    let found = warnings(&drawn_pair(40.0, 0.0, rod));
    for side in [Side::Left, Side::Right] {
        assert!(found.contains(&Finding::TouchesBorder(side)), "{found:?}");
    }
    // At the bottom, and one row lower on the right: the top alone gives the offset.
    let foot = |u: f64, v: f64| (u - 170.0).abs() < 20.0 + 0.1 * v && v > 80.0;
    let [left, _] = drawn_pair(40.0, 0.0, foot);
    let [_, right] = drawn_pair(40.0, 0.0, move |u, v| foot(u, v - 1.0));
    let model = outcome(&[left, right]).unwrap();
    assert_eq!(model.outcome.frontier_offsets[0], model.outcome.frontier_offsets[1]);
    assert!((model.outcome.vertical_offset - PX).abs() < PX / 8, "{:?}", model.outcome.vertical_offset);
    // At the right side of the left image only.
    let found = warnings(&drawn_pair(40.0, 0.0, disc(300.0, 120.0, 40.0)));
    assert!(found.contains(&Finding::TouchesBorder(Side::Left)), "{found:?}");
    assert!(!found.contains(&Finding::TouchesBorder(Side::Right)), "{found:?}");
}

#[test]
fn a_flat_object_is_refused_and_a_thin_one_is_not() {
    let flat = |u: f64, v: f64| (u - 170.0).abs() < 60.0 && (v - 120.0).abs() < 3.0;
    let found = refusal(&drawn_pair(40.0, 0.0, flat), &["only", "px high", "closer or turn"]);
    assert!(matches!(found, Finding::TooLow(Side::Left, 5 | 6)), "{found:?}");
    let thin = |u: f64, v: f64| (u - 170.0 - 0.3 * (v - 120.0)).abs() < 3.0 && (v - 120.0).abs() < 60.0;
    warnings(&drawn_pair(40.0, 0.0, thin));
}

#[test]
fn a_circle_is_nothing_unusual() {
    for pair in [pair(Shape::Sphere, 2), drawn_pair(40.0, 0.0, disc(170.0, 120.0, 50.0))] {
        let found = warnings(&pair);
        assert!(found.iter().all(|f| matches!(f, Finding::Ambiguous(_))), "{found:?}");
    }
}

/// Invariants alone would turn the hull; by the rows the coin is as far away as it is.
#[test]
fn a_symmetric_outline_is_told_and_the_rows_decide() {
    let model = outcome(&turned_coin()).unwrap();
    let told = |f: &Finding| matches!(f, Finding::Ambiguous(1..));
    assert!(model.outcome.findings.iter().any(told), "{:?}", model.outcome.findings);
    let plain = outcome(&drawn_pair(40.0, 0.0, disc(180.0, 120.0, 60.0))).unwrap();
    let [depth, expected] = [&model, &plain].map(|model| {
        let deep = model.mesh.vertices.iter().map(|v| v.z);
        deep.sum::<f64>() / model.mesh.vertices.len() as f64
    });
    assert!((depth / expected - 1.0).abs() < 0.01, "{depth} mm, and {expected} mm of a plain disc");
}

/// Where the image cuts it off, an outline is another in each view, which says nothing of symmetry.
#[test]
fn an_object_cut_off_is_not_told_to_be_symmetric() {
    let mut turned = 0;
    for k in 0..12 {
        let phase = f64::from(k) / 2.0;
        let bean = |u: f64, v: f64| {
            let (x, y) = (u - 290.0, v - 120.0);
            let angle = y.atan2(x) + phase;
            x.hypot(y) < 50.0 + 14.0 * angle.cos() + 9.0 * (2.0 * angle).sin()
        };
        let Ok(model) = outcome(&drawn_pair(25.0, 0.0, bean)) else { continue };
        let by_shape = model.outcome.cuts.as_ref().is_some_and(|cuts| cuts.shift != 0);
        turned += u32::from(by_shape);
        let told = |f: &Finding| matches!(f, Finding::Ambiguous(_));
        assert!(!(by_shape && model.outcome.findings.iter().any(told)), "{k}: {:?}", model.outcome.findings);
    }
    assert!(turned > 0, "none of them is cut off so that it fits better when turned");
}

#[test]
fn swapped_eyes_are_named_and_never_swapped_back() {
    for shape in [Shape::Torus, Shape::Teapot, Shape::Screwdriver] {
        let [left, right] = pair(shape, 2);
        let found = refusal(&[right, left], &["left and right", "are swapped", "--swap", "-"]);
        assert!(matches!(found, Finding::SwappedEyes(..0)), "{shape}: {found:?}");
    }
}

/// Mean distance to the truth, % of the diagonal.
fn error(shape: Shape, model: &Reconstruction) -> f64 {
    let ruler = Ruler { samples: 3000, grid: 2, sections: 1, seed: 0 };
    evaluate::<Pinhole>(&model.mesh, &shape.mesh(1.5 * shape.cell()), &[], &ruler)
        .distance
        .unwrap()
        .symmetric
        .mean_pct
}

#[test]
fn a_vertical_offset_is_mended_up_to_three_pixels() {
    let [left, _] = pair(Shape::Torus, 2);
    for by in [0.0, 0.25, 0.5, -0.5, 1.0, 2.0, -2.0] {
        let model = outcome(&[left.clone(), right_moved_down(Shape::Torus, 2, by)]).unwrap();
        let found = f64::from(model.outcome.vertical_offset) / f64::from(PX);
        assert!((found - by).abs() < 0.13, "{by} px: {found}");
        let error = error(Shape::Torus, &model);
        println!("torus moved by {by} px: error {error:.3} %");
        assert!(error < 0.3, "{by} px: error {error} %");
    }
    for by in [3.5, -4.0, 20.0] {
        let found = refusal(
            &[left.clone(), right_moved_down(Shape::Torus, 2, by)],
            &["not rectified", "--calib", "top lies"],
        );
        assert!(matches!(found, Finding::NotRectified { .. }), "{found:?}");
    }
}

#[test]
fn a_turned_or_stretched_view_is_not_rectified() {
    let blob = |u: f64, v: f64| ((u - 170.0) / 50.0).hypot((v - 120.0) / 80.0) < 1.0;
    let [left, _] = drawn_pair(40.0, 0.0, blob);
    // 2 % higher: 160 px become 163.2, so that top and bottom differ by 3.2 px.
    let [_, right] = drawn_pair(40.0, 0.0, move |u, v| blob(u, 120.0 + (v - 120.0) / 1.02));
    let found = refusal(&[left, right], &["not rectified", "calibrate again"]);
    assert!(matches!(found, Finding::NotRectified { top, bottom } if (bottom - top).abs() > PX));
}

/// Two views of a shape from eyes that are 23 degrees of turn apart about the object, as if a turntable
/// had been used, given with the calibration of a rectified pair.
#[test]
fn views_23_degrees_apart_are_refused() {
    use host::render::render;
    use nalgebra::{Point3, Rotation3, Vector3};
    for shape in [Shape::Teapot, Shape::Mouse, Shape::Screwdriver, Shape::Block] {
        let place = Point3::new(30.0, 0.0, 450.0);
        let mut mesh = shape.mesh(1.5 * shape.cell());
        let [view, _] = views(2);
        let left = render(&mesh, &[view]).remove(0);
        // Turntables are seldom upright in the image.
        let turn = Rotation3::from_axis_angle(
            &nalgebra::Unit::new_normalize(Vector3::new(0.2, 1.0, 0.3)),
            23f64.to_radians(),
        );
        for p in &mut mesh.vertices {
            *p = place + turn * (*p - place) - Vector3::new(60.0, 0.0, 0.0);
        }
        let right = render(&mesh, &[view]).remove(0);
        let found = refusal(&[left, right], &[]);
        println!("{shape} turned by 23 degrees: {found:?}");
    }
}

#[test]
fn an_outline_without_counterpart_is_refused() {
    let comb = |teeth: f64| {
        move |u: f64, v: f64| {
            let inside = (u - 170.0).abs() < 60.0 && (v - 120.0).abs() < 60.0;
            inside && (!(75.0..=165.0).contains(&v) || ((u - 110.0) / teeth).rem_euclid(2.0) < 1.0)
        }
    };
    let [left, _] = drawn_pair(40.0, 0.0, comb(7.5));
    let [_, right] = drawn_pair(40.0, 0.0, comb(20.0));
    let found = refusal(&[left, right], &["% of the left outline", "no counterpart", "too different"]);
    assert!(matches!(found, Finding::Unmatched(share) if share > ONE / 4));
}

/// A shape of its own mirror image shows only in where it seems to be: at infinity.
#[test]
fn a_mirrored_right_view_is_refused() {
    for shape in Shape::ALL {
        for noise in [false, true] {
            let [left, right] = if noise { noisy(shape) } else { pair(shape, 2) };
            let symmetric = [Shape::Sphere, Shape::Torus, Shape::TorusTilt].contains(&shape);
            let found = refusal(&[left, imageops::flip_horizontal(&right)], &["; "]);
            println!("{shape} mirrored: {found:?}");
            match found {
                Finding::SwappedEyes(disparity) => assert!(symmetric && disparity < 2 * PX, "{shape}"),
                Finding::NotAffine(_) => assert!(!symmetric, "{shape}"),
                other => panic!("{shape}: {other:?}"),
            }
        }
    }
}

fn noisy(shape: Shape) -> Pair {
    let mut pair = pair(shape, 2);
    for (image, seed) in pair.iter_mut().zip(1..) {
        Noise { sigma: 20.0, salt_and_pepper: 0.02, seed }.apply(image);
    }
    pair
}

/// The least e_omega is at the shift of the rows, for outlines that half a turn takes into themselves as
/// well, and clearly: the next least is twice as large at least.
#[test]
fn the_right_shift_for_every_shape() {
    for shape in Shape::ALL {
        for pair in [pair(shape, 2), noisy(shape)] {
            let outcome = outcome(&pair).unwrap().outcome;
            let cuts = outcome.cuts.unwrap();
            let margin = f64::from(cuts.margin()) / f64::from(ONE);
            println!("{shape}: least e_omega at shift {}, margin {margin:.1}", cuts.least);
            assert_eq!((cuts.least, cuts.shift), (0, 0), "{shape}");
            assert!(margin > 2.0, "{shape}: margin {margin:.1}");
            assert!(!outcome.findings.iter().any(|f| matches!(f, Finding::Ambiguous(_))));
        }
    }
}

/// A picture of noise alone, or of a stained wall, is no object.
#[test]
fn noise_alone_gives_no_model() {
    for sigma in [1.0, 5.0, 20.0, 60.0] {
        let pair = [1, 2].map(|seed| {
            let mut image = GrayImage::from_pixel(320, 240, image::Luma([90]));
            Noise { sigma, salt_and_pepper: 0.01, seed }.apply(&mut image);
            image
        });
        match outcome(&pair) {
            Err(refusal) => println!("noise of {sigma}: {refusal}"),
            Ok(model) => panic!("a model of noise of {sigma}: {:?}", model.outcome.findings),
        }
    }
}
