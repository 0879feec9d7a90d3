//! The gate on the cases with known truth (`oracle/src/cases.rs` says where): without them these tests say
//! so and pass.

use host::calibration::StereoCamera;
use host::evaluate::{Evaluation, Options as Ruler, evaluate};
use host::mesh::Mesh;
use host::reconstruct::{Mode, Options, Profile, Reconstruction, Refusal, Skeleton, reconstruct};
use host::view::Pinhole;
use oracle::cases::{cases, folder, name};
use shared::fixed::ONE;
use std::path::{Path, PathBuf};

fn run(case: &Path, options: &Options) -> Result<Reconstruction, Refusal> {
    let open = |name: &str| image::open(case.join(name)).unwrap().to_luma8();
    let camera = StereoCamera::read(case.join("calib.yaml")).unwrap();
    reconstruct(open("left.png"), open("right.png"), &camera, options, &mut ())
}

fn measure(case: &Path, model: &Mesh) -> Evaluation {
    let truth = host::mesh::read::read(&case.join("truth.ply")).unwrap();
    let ruler = Ruler { samples: 5000, grid: 2, sections: 1, seed: 0 };
    evaluate::<Pinhole>(model, &truth, &[], &ruler)
}

/// What the method reaches, with room for the ruler's sampling: the most symmetric distance of each case, %
/// of the diagonal, and of the mean of all.
const LIMITS: [(&str, f64); 11] = [
    ("block", 2.7),
    ("capsule", 0.13),
    ("mouse", 3.4),
    ("real_dino1", 2.75),
    ("real_viff1", 1.6),
    ("screwdriver", 0.5),
    ("sphere", 0.08),
    ("teapot", 1.9),
    ("torus", 0.09),
    ("torus_noise", 0.2),
    ("torus_tilt", 0.13),
];
const MEAN: f64 = 1.2;
/// How much worse each may be from the curves alone, and by a small device's profile; and the mean.
const CURVES: (f64, f64) = (0.12, 0.03);
const DEVICE: (f64, f64) = (0.15, 0.15);

/// Hold the errors of all cases to their limits, each and in the mean, plus what is allowed beyond.
fn hold(errors: &[(String, f64)], (each, all): (f64, f64)) {
    let limit = |name: &str| LIMITS.iter().find(|(known, _)| *known == name).map(|(_, limit)| limit + each);
    let above: Vec<_> = errors.iter().filter(|(name, e)| limit(name).is_some_and(|most| *e > most)).collect();
    assert!(above.is_empty(), "above their limits: {above:?}");
    let mean = errors.iter().map(|(_, e)| e).sum::<f64>() / errors.len() as f64;
    println!("mean {mean:.3} %");
    // Other cases than those that the mean is stated for have a mean of their own.
    assert!(mean <= MEAN + all || errors.len() != LIMITS.len(), "mean {mean:.3} %");
}

#[test]
fn every_case_gives_one_body_near_the_truth() {
    let Some(folder) = folder() else { return };
    let text = std::fs::read_to_string(folder.join("baselines.json")).unwrap();
    let baselines: serde_json::Value = serde_json::from_str(&text).unwrap();
    let (cases, mut errors, mut right_shifts, mut faults) = (cases(&folder), Vec::new(), 0, Vec::new());
    for case in &cases {
        let name = name(case);
        let model = run(case, &Options::default()).unwrap_or_else(|refusal| panic!("{name}: {refusal}"));
        let measured = measure(case, &model.mesh);
        assert!(measured.closed && measured.bodies == 1, "{name}: {} bodies", measured.bodies);
        let error = measured.distance.unwrap().symmetric.mean_pct;
        let cuts = model.outcome.cuts.unwrap();
        // What e_omega picks on its own; that the rows agree is what lets a pair through at all.
        right_shifts += usize::from(cuts.least == 0);
        let best = ["inflate", "hull", "sgbm"]
            .iter()
            .filter_map(|rival| baselines[&name][rival].as_f64())
            .fold(f64::INFINITY, f64::min);
        println!(
            "{name:12} {error:5.2} %, best rival {best:5.2} %, e_omega picks shift {}, margin {:.1}, {:?}",
            cuts.least,
            f64::from(cuts.margin()) / f64::from(ONE),
            model.outcome.findings
        );
        let may_equal = ["block", "mouse"].contains(&name.as_str()) || name.starts_with("real_");
        if !(error < best || may_equal && error <= best + 0.005) {
            faults.push(format!("{name}: {error:.2} % against {best:.2} %"));
        }
        errors.push((name, error));
    }
    println!("right shift in {right_shifts} of {}", cases.len());
    assert!(faults.is_empty(), "{faults:?}");
    hold(&errors, (0.0, 0.0));
    assert!(right_shifts * 11 >= cases.len() * 10, "right shift in {right_shifts} of {}", cases.len());
}

#[test]
fn curves_alone_and_a_small_device_come_close() {
    let Some(folder) = folder() else { return };
    let curves = Options { skeleton: Skeleton::Nurbs, ..Options::default() };
    let device = Options { profile: Profile::Device, ..Options::default() };
    for (what, options, beyond) in [("curves", curves, CURVES), ("device", device, DEVICE)] {
        let error = |case: &PathBuf| {
            let model = run(case, &options).unwrap_or_else(|refusal| panic!("{}: {refusal}", name(case)));
            let measured = measure(case, &model.mesh);
            assert!(measured.closed && measured.bodies == 1, "{}", name(case));
            (name(case), measured.distance.unwrap().symmetric.mean_pct)
        };
        let errors: Vec<_> = cases(&folder).iter().map(error).collect();
        println!("{what}: {errors:.2?}");
        hold(&errors, beyond);
    }
}

#[test]
fn the_papers_own_way_gives_models() {
    let Some(folder) = folder() else { return };
    let paper = Options { mode: Mode::Paper { omega: 3 }, ..Options::default() };
    let (cases, mut models) = (cases(&folder), 0);
    for case in &cases {
        match run(case, &paper) {
            Ok(model) => {
                models += 1;
                let error = measure(case, &model.mesh).distance.map(|d| d.symmetric.mean_pct);
                println!("{:12} {error:8.2?} %, {:?}", name(case), model.outcome.findings);
            }
            Err(refusal) => println!("{:12} {refusal}", name(case)),
        }
    }
    assert!(models * 11 >= cases.len() * 9, "{models} models from {} cases", cases.len());
}
