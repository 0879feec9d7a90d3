//! From two pictures and their calibration to a mesh in a file.
//!
//!     cargo run --release -p host --example pair_to_mesh -- left.png right.png calib.yaml model.stl

use host::calibration::StereoCamera;
use host::export;
use host::reconstruct::{Options, reconstruct};
use host::source::picture::load_view;
use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [left, right, calibration, output] = arguments.as_slice() else {
        return Err("give LEFT RIGHT CALIBRATION OUTPUT".into());
    };
    let [left, right] = [load_view(left.as_ref())?.image, load_view(right.as_ref())?.image];
    let camera = StereoCamera::read(calibration)?;
    // Nobody looks on: `()`. A `report::record::Record` in its place keeps what every stage made.
    let model = reconstruct(left, right, &camera, &Options::default(), &mut ())?;
    println!("{} faces, {:.1} cm3", model.mesh.faces.len(), model.mesh.volume() / 1000.0);
    export::write(Path::new(output), &model.mesh.into())?;
    Ok(())
}
