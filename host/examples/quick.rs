//! One pair from the command line, with all that the core says of it.
use host::*;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let l = image::open(&a[1]).unwrap().to_luma8();
    let r = image::open(&a[2]).unwrap().to_luma8();
    let c = calibration::StereoCamera::read(&a[3]).unwrap();
    let mode = if a.len() > 5 && a[5].starts_with("paper") {
        reconstruct::Mode::Paper { omega: 3 }
    } else {
        reconstruct::Mode::Default
    };
    match reconstruct::reconstruct(l, r, &c, &reconstruct::Options { mode, ..Default::default() }, &mut ()) {
        Ok(m) => {
            std::fs::create_dir_all(&a[4]).unwrap();
            export::ply::write_mesh(std::path::Path::new(&format!("{}/model.ply", a[4])), &m.mesh, &[])
                .unwrap();
            eprintln!(
                "{} find {:?} dv {:?} cut {:?} margin {:?} rows {:?} dropped {:?} cell {} cones {} verts {} times {:?}",
                a[1],
                m.outcome.findings,
                m.outcome.frontier_offsets,
                m.outcome.cuts.map(|c| (c.shift, c.errors[0])),
                m.outcome.cuts.map(|c| c.margin() as f64 / 65536.),
                m.outcome.rows,
                m.dropped,
                m.cell,
                m.cones,
                m.mesh.vertices.len(),
                m.times
            );
        }
        Err(e) => {
            eprintln!("{} REFUSED {e}", a[1]);
            std::process::exit(1)
        }
    }
}
