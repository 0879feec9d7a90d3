//! What a calibration says of a pair of cameras, and the same in OpenCV's format, whatever it came in.
//!
//!     cargo run --release -p host --example calibration -- calib.yaml [opencv.yaml]

use host::calibration::StereoCamera;
use std::error::Error;

/// Distances that errors are told for, mm.
const DISTANCES: [f64; 3] = [250.0, 500.0, 1000.0];

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let camera = StereoCamera::read(arguments.next().ok_or("give a calibration")?)?;
    let (focal, baseline) = (camera.left.fx, camera.translation.norm());
    println!("{}x{} px, focal length {focal:.1} px", camera.left.width, camera.left.height);
    println!("{baseline:.2} mm between the eyes");
    for distance in DISTANCES {
        let disparity = focal * baseline / distance;
        // An outline is known to about a tenth of a pixel.
        let error = 0.1 * distance / disparity;
        println!("at {distance:.0} mm: disparity {disparity:.0} px, depth to {error:.2} mm");
    }
    if let Some(output) = arguments.next() {
        camera.write_opencv_yaml(output)?;
    }
    Ok(())
}
