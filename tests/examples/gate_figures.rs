//! What the gates look at, for every built-in shape and, if the folder is named, for evaluation cases:
//! `cargo run --release -p system-tests --example gate_figures [-- CASES]`. Last, how often e_omega picks
//! shift 0 for hulls that have nothing to do with each other.

use host::calibration::StereoCamera;
use host::reconstruct::{Options, reconstruct};
use host::render::Noise;
use host::shape::Shape;
use image::{GrayImage, imageops};
use oracle::scene::{camera, pair};
use shared::fixed::{ONE, PX};
use shared::pipeline::{Finding, Observer, Product, Side};
use shared::point::PixelPoint;
use shared::stage::correspond::{CutMatch, match_cuts};
use shared::stage::plane::{ImagePlane, Observation};

/// Hulls of the left and the right view.
type Hulls = [Vec<PixelPoint>; 2];

#[derive(Default)]
struct Seen {
    hulls: Hulls,
    cuts: Option<CutMatch>,
    unmatched: Option<f64>,
}

impl Observer for Seen {
    fn saw(&mut self, side: Option<Side>, product: Product<'_>) {
        match product {
            Product::Hull(hull) => self.hulls[usize::from(side == Some(Side::Right))] = hull.to_vec(),
            Product::Cuts(cuts) => self.cuts = Some(*cuts),
            Product::Rows(_, rows) => {
                self.unmatched = Some(f64::from(rows.unmatched) / f64::from(rows.crossings.max(1)));
            }
            _ => {}
        }
    }
}

/// Mean distance of the cut hulls from the best plane of disparity, px.
fn residual(cuts: &CutMatch) -> f64 {
    let seen: Vec<_> = (0..cuts.left.len())
        .map(|k| Observation { at: cuts.left[k], value: cuts.left[k].u - cuts.right[k].u, weight: 1 << 14 })
        .collect();
    let Some(plane) = ImagePlane::fit(seen.iter().copied()) else { return f64::NAN };
    let sum: i32 = seen.iter().map(|o| (o.value - plane.at(o.at)).abs()).sum();
    f64::from(sum) / seen.len() as f64 / f64::from(PX)
}

fn line(name: &str, left: &GrayImage, right: &GrayImage, camera: &StereoCamera) -> Hulls {
    let mut seen = Seen::default();
    let found = reconstruct(left.clone(), right.clone(), camera, &Options::default(), &mut seen);
    let verdict = match &found {
        Ok(model) => format!(
            "model {:?}",
            model.outcome.findings.iter().map(|f: &Finding| format!("{f:?}")).collect::<Vec<_>>()
        ),
        Err(refusal) => format!("REFUSED {}", refusal.to_string().split(';').next().unwrap_or_default()),
    };
    let e = |x: u32| f64::from(x) / f64::from(ONE);
    let (e0, least, shift, residual) = seen.cuts.map_or((f64::NAN, f64::NAN, 99, f64::NAN), |c| {
        (e(c.errors[0]), e(c.errors[c.least]), c.least, residual(&c))
    });
    let unmatched = seen.unmatched.unwrap_or(f64::NAN);
    let (width, height) = seen.cuts.map_or((1.0, 1.0), |c| {
        let span = |f: fn(&PixelPoint) -> i32| {
            let all = || c.left.iter().map(f);
            f64::from(all().max().unwrap_or(0) - all().min().unwrap_or(0)) / f64::from(PX)
        };
        (span(|p| p.u), span(|p| p.v))
    });
    let (by_height, by_both) = (100.0 * residual / height, 200.0 * residual / (width + height));
    println!(
        "{name:28} residual {residual:6.2} px {by_height:5.2} {by_both:5.2} %  e0 {e0:8.2}  least {least:7.2} at {shift:2}  unmatched {unmatched:.3}  {verdict}"
    );
    seen.hulls
}

/// The line of a pair and of its mirrored one; the hulls of the pair.
fn lines(name: &str, [left, right]: &[GrayImage; 2], camera: &StereoCamera) -> Hulls {
    let hulls = line(name, left, right, camera);
    line(&format!("{name} mirrored"), left, &imageops::flip_horizontal(right), camera);
    hulls
}

/// How often e_omega, which knows nothing of rows, picks shift 0 for the left hull of one object and the right hull of another.
fn strangers(objects: &[Hulls]) {
    let strange = objects.iter().enumerate().flat_map(|(i, a)| {
        objects.iter().enumerate().filter(move |(j, _)| *j != i).map(|(_, b)| (&a[0], &b[1]))
    });
    let picked: Vec<_> = strange.filter_map(|(a, b)| match_cuts(a, b)).map(|cuts| cuts.least == 0).collect();
    let right = picked.iter().filter(|zero| **zero).count();
    println!("hulls of two objects: e_omega picks shift 0 for {right} of {}", picked.len());
}

fn main() {
    let mut objects = Vec::new();
    for shape in Shape::ALL {
        for scale in [1, 2] {
            let clean = pair(shape, scale);
            let hulls = lines(&format!("{shape}/{scale}"), &clean, &camera(scale));
            if scale == 1 {
                objects.push(hulls);
            }
            let mut noisy = clean;
            for (image, seed) in noisy.iter_mut().zip(1..) {
                Noise { sigma: 20.0, salt_and_pepper: 0.02, seed }.apply(image);
            }
            lines(&format!("{shape}/{scale} noisy"), &noisy, &camera(scale));
        }
    }
    for folder in std::env::args().skip(1) {
        let mut cases: Vec<_> =
            std::fs::read_dir(folder).into_iter().flatten().flatten().map(|e| e.path()).collect();
        cases.sort();
        for case in cases {
            let open = |name: &str| image::open(case.join(name)).map(|image| image.to_luma8());
            if let (Ok(left), Ok(right), Ok(camera)) =
                (open("left.png"), open("right.png"), StereoCamera::read(case.join("calib.yaml")))
            {
                let name = case.file_name().unwrap_or_default().to_string_lossy();
                lines(&name, &[left, right], &camera);
            }
        }
    }
    strangers(&objects);
}
