//! Many pairs in one workspace: its memory grows with the first pair and serves all that follow.
//!
//!     cargo run --release -p host --example many_pairs -- FOLDER
//!
//! FOLDER is what `host replay` takes, with a calibration beside the pictures. A refused pair is told and gone on from.

use host::calibration::StereoCamera;
use host::reconstruct::{Options, Workspace};
use host::report::words::sentence;
use host::source::find::find;
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).ok_or("give a folder of pairs")?;
    let mut workspace = Workspace::default();
    for pair in find(&[folder], None)?.pairs {
        let images = pair.load()?.images;
        let calibration = pair.calibration.ok_or("there is no calib.yaml beside the pictures")?;
        let camera = StereoCamera::read(&calibration)?;
        match workspace.reconstruct(images.each_ref(), &camera, &Options::default(), &mut ()) {
            Ok(model) => {
                println!("{}: {:.1} cm3", pair.name, model.mesh.volume() / 1000.0);
                model.outcome.findings.iter().for_each(|finding| println!("  {}", sentence(finding)));
                // Its lists are filled again by the next pair.
                workspace.recycle(model);
            }
            Err(refusal) => println!("{}: {refusal}", pair.name),
        }
    }
    Ok(())
}
