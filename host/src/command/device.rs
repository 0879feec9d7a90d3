//! A camera device: who it is and how it fares, its calibration, its settings, its pictures.
//!
//! info tells who it is and how it fares. calibrate uploads a calibration, which the device keeps when it is
//! switched off; `host listen` needs the same file. expose fixes how pictures are taken, in lines of the
//! sensor and gain as a factor, or leaves it to the device. threshold and polarity say how the object is told
//! from the background, until the device starts anew. grab fetches one pair of pictures, as the cameras see
//! them (grey) or the object that was found (mask), as left.png and right.png: `host replay` takes these, and
//! they are what to calibrate with.
//!
//! Examples:
//!   host device info
//!   host device calibrate calib.yaml --port /dev/ttyACM0
//!   host device expose 400,2.5
//!   host device grab grey --out pair

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use image::GrayImage;
use serde_json::{Value, json};
use shared::stage::binarise::{Polarity, Threshold};
use shared::wire::{Exposure, ExposureSetting, Health, PictureKind, ToDevice, calibration_crc};

use super::connect::{PortArgs, check_calibration, health_as_json, hello_as_json, model_of, reset, version};
use super::table::Table;
use super::{Failure, of_system, say, say_json, shown};
use crate::output::{grey_png, write_together};
use crate::reconstruct::Refusal;
use crate::report::words::{parse_polarity, parse_threshold};
use crate::source::serial::inbox::{Hello, Message};
use crate::source::serial::mosaic::Mosaic;
use crate::source::serial::session::Session;

/// How long a pair of pictures may take, or pictures of another pair are asked for.
const PICTURES: Duration = Duration::from_secs(30);
/// How often they are asked for.
const TRIES: usize = 3;

/// Arguments of `device`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    action: Action,
    #[command(flatten)]
    port: PortArgs,
    /// Print one JSON document instead of text
    #[arg(long, global = true)]
    pub(super) json: bool,
}

/// What to do with it.
#[derive(Debug, clap::Subcommand)]
enum Action {
    /// Who it is and how it fares
    #[command(after_help = "Examples:\n  host device info --json")]
    Info,
    /// Have it keep a calibration
    #[command(after_help = "Examples:\n  host device calibrate calib.yaml --port /dev/ttyACM0")]
    Calibrate {
        /// The calibration of its pictures: OpenCV (M1 D1 M2 D2 R T), ROS or Kalibr
        file: PathBuf,
    },
    /// How it takes pictures
    #[command(after_help = "Examples:\n  host device expose auto\n  host device expose 400,2.5")]
    Expose {
        /// auto, or exposed lines and gain, as in 400,2.5
        #[arg(value_name = "auto|LINES,GAIN", value_parser = parse_exposure)]
        setting: ExposureSetting,
    },
    /// Where it parts object and background
    #[command(after_help = "Examples:\n  host device threshold 90")]
    Threshold {
        /// otsu, or a grey level
        #[arg(value_name = "otsu|N", value_parser = parse_threshold)]
        threshold: Threshold,
    },
    /// Whether it looks for a bright or a dark object
    #[command(after_help = "Examples:\n  host device polarity dark")]
    Polarity {
        /// bright, dark or auto
        #[arg(value_name = "bright|dark|auto", value_parser = parse_polarity)]
        polarity: Polarity,
    },
    /// Fetch a pair of pictures
    #[command(after_help = "Examples:\n  host device grab grey --out pair")]
    Grab {
        /// As the cameras see it, or the object that was found
        kind: Kind,
        /// Folder for left.png and right.png
        #[arg(long, value_name = "DIR", default_value = "ossature-out")]
        out: PathBuf,
    },
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Kind {
    Grey,
    Mask,
}

/// Does what is asked.
///
/// # Errors
///
/// If there is no device, or it does not do it.
pub fn run(args: &Args) -> Result<(), Failure> {
    // A calibration that is none is told before the device is looked for.
    let model = match &args.action {
        Action::Calibrate { file } => Some(model_of(file)?),
        _ => None,
    };
    let (mut session, hello) = args.port.begin(args.port.only()?, None)?;
    let (json, text) = match (&args.action, model) {
        (Action::Calibrate { .. }, Some(model)) => {
            session.order(&ToDevice::Calibration(model))?;
            check_calibration(&model, &session.hello()?)?;
            let crc = format!("{:08x}", calibration_crc(&model));
            (json!({ "calibration_crc": crc }), format!("the device keeps the calibration {crc}\n"))
        }
        (Action::Expose { setting }, _) => ordered(&mut session, &ToDevice::Exposure(*setting))?,
        (Action::Threshold { threshold }, _) => ordered(&mut session, &ToDevice::Threshold(*threshold))?,
        (Action::Polarity { polarity }, _) => ordered(&mut session, &ToDevice::Polarity(*polarity))?,
        (Action::Grab { kind, out }, _) => {
            let kind = match kind {
                Kind::Grey => PictureKind::Grey,
                Kind::Mask => PictureKind::Mask,
            };
            let files = write(out, &grab(&mut session, kind)?)?;
            let text = files.iter().map(|file| format!("{}\n", file.display())).collect();
            (json!({ "files": files.each_ref().map(|file| shown(file)) }), text)
        }
        (Action::Info | Action::Calibrate { .. }, _) => {
            let health = session.health()?;
            (info_as_json(&hello, &health), info_as_text(&hello, &health))
        }
    };
    if args.json { say_json(&json) } else { say(&text) }
}

fn ordered(session: &mut Session, command: &ToDevice) -> Result<(Value, String), Failure> {
    session.order(command)?;
    Ok((json!({ "done": true }), "done\n".into()))
}

fn info_as_text(hello: &Hello, health: &Health) -> String {
    let mut table = Table::new(&hello.board);
    table.row("firmware", &version(hello));
    table.row("sensors", &hello.sensors.map(|id| format!("{id:#06x}")).join(", "));
    table.row("pictures", &format!("{}x{} px", hello.picture[0], hello.picture[1]));
    let calibration = hello.calibration.map_or_else(|| "none".into(), |crc| format!("{crc:08x}"));
    table.row("calibration", &calibration);
    let up = Duration::from_millis(health.uptime).as_secs_f64();
    table.row("running", &format!("{up:.1} s since {}", reset(hello)));
    table.row("pairs", &format!("{}, {} of them refused", health.pairs, health.refused));
    if health.dropped > 0 {
        table.row("dropped", &format!("{} pairs more that were begun", health.dropped));
    }
    for (name, number) in faults(health) {
        if number > 0 {
            table.row("fault", &format!("{number} {name}"));
        }
    }
    table.text().to_owned()
}

/// What went wrong on the device, and how often.
fn faults(health: &Health) -> [(&'static str, u32); 6] {
    [
        ("pictures late", health.timeouts),
        ("camera restarts", health.restarts),
        ("bytes that were no frame", health.rejected_bytes),
        ("frames not used", health.rejected_frames),
        ("watchdog resets", health.watchdog_resets),
        ("storage faults", health.storage_faults),
    ]
}

fn info_as_json(hello: &Hello, health: &Health) -> Value {
    json!({ "device": hello_as_json(hello), "health": health_as_json(health) })
}

/// `auto`, or lines and gain for both eyes.
fn parse_exposure(text: &str) -> Result<ExposureSetting, String> {
    if text == "auto" {
        return Ok(ExposureSetting::Auto);
    }
    let parsed = text.split_once(',').and_then(|(lines, gain)| {
        let gain = 256.0 * gain.trim().parse::<f64>().ok()?;
        let possible = (1.0..=f64::from(u16::MAX)).contains(&gain);
        possible.then_some(Exposure { lines: lines.trim().parse().ok()?, gain: gain.round() as u16 })
    });
    let exposure = parsed.ok_or("give auto, or exposed lines and a gain from 0.004 to 255, as in 400,2.5")?;
    Ok(ExposureSetting::Fixed([exposure; 2]))
}

/// Both pictures of one pair.
fn grab(session: &mut Session, kind: PictureKind) -> Result<[GrayImage; 2], Failure> {
    let mut refused = None;
    for _ in 0..TRIES {
        // Nothing is left of what was asked for before.
        session.order(&ToDevice::Stop)?;
        session.order_cameras(&ToDevice::Grab(kind))?;
        let (end, mut mosaic) = (Instant::now() + PICTURES, Mosaic::new(kind));
        while Instant::now() < end {
            match session.receive(Duration::from_millis(250))? {
                Some((Message::Picture(part), _)) => mosaic.add(&part),
                // Behind its pictures, if there were any: no more will come.
                Some((Message::Pair(pair), _)) if pair.result.is_err() => {
                    refused = pair.result.err();
                    break;
                }
                _ => {}
            }
            if let Some(pictures) = mosaic.pictures() {
                return Ok(pictures);
            }
        }
    }
    Err(match refused {
        Some(finding) => Refusal::from(finding).into(),
        None => "the pictures did not come whole; look at the cables".into(),
    })
}

fn write(folder: &Path, pictures: &[GrayImage; 2]) -> Result<[PathBuf; 2], Failure> {
    let told = |error| format!("cannot make {}: {}", shown(folder), of_system(&error));
    std::fs::create_dir_all(folder).map_err(told)?;
    let files = ["left.png", "right.png"].map(|name| folder.join(name));
    let [left, right] = &files;
    write_together(&[(left, grey_png(&pictures[0])?), (right, grey_png(&pictures[1])?)])?;
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exposures_are_lines_and_a_factor() {
        let both = |lines, gain| Ok(ExposureSetting::Fixed([Exposure { lines, gain }; 2]));
        assert_eq!(parse_exposure("auto"), Ok(ExposureSetting::Auto));
        assert_eq!(parse_exposure("400,2.5"), both(400, 640));
        for bad in ["400", "x,1", "400,0", "400,-1", "400,nan", "70000,1", "400,300"] {
            assert!(parse_exposure(bad).is_err(), "{bad}");
        }
    }
}
