//! The ruler against another program: `metrics.py` beside the evaluation cases measures the same models.
//!
//! `ci.sh` names the Python that can run it in `OSSATURE_RULER`; without that, or without the cases, the
//! test says that it is skipped. Both sample 20,000 points a side by their own generators: means of
//! distances agree within 2 % and 0.01 mm, volumes and silhouettes, which are exact on a grid, within .001.

use host::calibration::StereoCamera;
use host::evaluate::{Options, evaluate};
use host::reconstruct::{self, reconstruct};
use host::view::Calibrated;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;

#[test]
fn another_program_measures_the_same() {
    let cases = std::env::var_os("OSSATURE_EVAL")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/eval"), PathBuf::from);
    let Some(python) = std::env::var_os("OSSATURE_RULER").filter(|_| cases.is_dir()) else {
        eprintln!("SKIPPED: OSSATURE_RULER or the evaluation cases are missing; ./ci.sh test sets both up");
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    for case in ["torus_tilt", "screwdriver"] {
        let case = cases.join("cases").join(case);
        let picture = |name: &str| image::open(case.join(name)).unwrap().to_luma8();
        let calibration = StereoCamera::read(case.join("calib.yaml")).unwrap();
        let options = reconstruct::Options::default();
        let made =
            reconstruct(picture("left.png"), picture("right.png"), &calibration, &options, &mut ()).unwrap();
        let model = folder.path().join("model.ply");
        host::export::ply::write_mesh(&model, &made.mesh, &[]).unwrap();
        let run =
            Command::new(&python).arg(cases.join("metrics.py")).arg(&case).arg(&model).output().unwrap();
        assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
        let theirs: Value = serde_json::from_slice(&run.stdout).unwrap();

        let truth = host::mesh::read::read(&case.join("truth.ply")).unwrap();
        let views = Calibrated::pair(&calibration);
        let ours = serde_json::to_value(evaluate(&made.mesh, &truth, &views, &Options::default())).unwrap();
        let at = |value: &Value, path: &str| value.pointer(path).and_then(Value::as_f64).expect("a number");
        for (ours_at, theirs_at) in [
            ("/distance/symmetric/mean_mm", "/symmetric/mean"),
            ("/distance/symmetric/rms_mm", "/symmetric/rms"),
            ("/distance/symmetric/p95_mm", "/symmetric/p95"),
        ] {
            let (a, b) = (at(&ours, ours_at), at(&theirs, theirs_at));
            assert!((a - b).abs() < 0.01 + 0.02 * b, "{case:?} {theirs_at}: {a} against {b}");
        }
        for (ours_at, theirs_at) in [
            ("/volume_iou", "/volume_iou"),
            ("/silhouette_iou/0", "/silhouette_iou/left"),
            ("/silhouette_iou/1", "/silhouette_iou/right"),
        ] {
            let (a, b) = (at(&ours, ours_at), at(&theirs, theirs_at));
            assert!((a - b).abs() < 0.001, "{case:?} {theirs_at}: {a} against {b}");
        }
        assert_eq!(ours["closed"], theirs["closed"]);
        assert_eq!(ours["bodies"], theirs["bodies"]);
    }
}
