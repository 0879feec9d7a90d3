//! The gate on the cases with known truth in `../shared/eval/cases` beside the project, or wherever
//! `OSSATURE_EVAL` points (a folder with `cases/` and `baselines.json`). They are no part of the project:
//! without them these tests say so and pass.

use host::calibration::StereoCamera;
use host::evaluate::{Evaluation, Options as Ruler, evaluate};
use host::mesh::Mesh;
use host::reconstruct::{Mode, Options, Reconstruction, Refusal, reconstruct};
use host::view::Pinhole;
use shared::fixed::ONE;
use std::path::{Path, PathBuf};

fn folder() -> Option<PathBuf> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/eval");
    let folder = std::env::var_os("OSSATURE_EVAL").map_or_else(beside, PathBuf::from);
    if folder.join("cases").is_dir() {
        return Some(folder);
    }
    eprintln!("\n!!!! SKIPPED: no evaluation cases in {}; set OSSATURE_EVAL !!!!\n", folder.display());
    None
}

fn cases(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder.join("cases")).unwrap();
    let mut cases: Vec<_> =
        entries.map(|e| e.unwrap().path()).filter(|p| p.join("truth.ply").is_file()).collect();
    cases.sort();
    cases
}

fn name(case: &Path) -> String {
    case.file_name().unwrap().to_string_lossy().into_owned()
}

fn run(case: &Path, mode: Mode) -> Result<Reconstruction, Refusal> {
    let open = |name: &str| image::open(case.join(name)).unwrap().to_luma8();
    let camera = StereoCamera::read(case.join("calib.yaml")).unwrap();
    reconstruct(
        open("left.png"),
        open("right.png"),
        &camera,
        &Options { mode, ..Options::default() },
        &mut (),
    )
}

fn measure(case: &Path, model: &Mesh) -> Evaluation {
    let truth = host::mesh::read::read(&case.join("truth.ply")).unwrap();
    let ruler = Ruler { samples: 5000, grid: 2, sections: 1, seed: 0 };
    evaluate::<Pinhole>(model, &truth, &[], &ruler)
}

/// Mean symmetric distance over all cases, % of the diagonal.
const MEAN: f64 = 1.8;

#[test]
fn every_case_gives_one_body_near_the_truth() {
    let Some(folder) = folder() else { return };
    let text = std::fs::read_to_string(folder.join("baselines.json")).unwrap();
    let baselines: serde_json::Value = serde_json::from_str(&text).unwrap();
    let (cases, mut errors, mut right_shifts, mut faults) = (cases(&folder), Vec::new(), 0, Vec::new());
    for case in &cases {
        let name = name(case);
        let model = run(case, Mode::Default).unwrap_or_else(|refusal| panic!("{name}: {refusal}"));
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
        errors.push(error);
    }
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    println!("mean {mean:.3} %, right shift in {right_shifts} of {}", cases.len());
    assert!(faults.is_empty(), "{faults:?}");
    assert!(mean <= MEAN, "mean {mean:.3} %");
    assert!(right_shifts * 11 >= cases.len() * 10, "right shift in {right_shifts} of {}", cases.len());
}

#[test]
fn the_papers_own_way_gives_models() {
    let Some(folder) = folder() else { return };
    let (cases, mut models) = (cases(&folder), 0);
    for case in &cases {
        match run(case, Mode::Paper { omega: 3 }) {
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
