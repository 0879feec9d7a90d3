//! The cameras and camera devices of this machine: what `host capture --device` and `host listen --port` take.
//!
//! For each camera: its device, name, bus and driver; the formats, sizes and rates that it offers; and what
//! `host capture` would take if nothing else were said. Nodes that take no pictures, such as the metadata node
//! of every USB camera, are left out. For each serial port: what it says on USB, and whether `--port auto` would
//! take it.
//!
//! Examples:
//!   host list-devices
//!   host list-devices --json

use serde_json::{Value, json};

use super::table::Table;
use super::{Failure, say, say_json, shown, words_of};
use crate::source::serial::list::{SerialPort, ports as serial_ports};
use crate::source::v4l::choose::{Camera, Choice, Offer, Request, Sizes, choose, sizes_in_words};
use crate::source::v4l::errors::CameraError;
use crate::source::v4l::kernel;

/// Arguments of `list-devices`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Print one JSON document instead of text
    #[arg(long)]
    pub(super) json: bool,
}

/// A camera, or why it cannot be asked.
type Found = Result<Camera, CameraError>;

/// Lists them.
///
/// # Errors
///
/// If neither cameras nor serial ports can be listed; why one of them cannot is told in its place.
pub fn run(args: &Args) -> Result<(), Failure> {
    let cameras = kernel::list().map_err(|error| words_of(&error));
    let ports = serial_ports().map_err(|error| format!("serial ports cannot be listed: {error}"));
    if let (Err(cameras), Err(ports)) = (&cameras, &ports) {
        return Err(format!("{cameras}; {ports}").into());
    }
    if args.json {
        return say_json(&json!({
            "cameras": list_as_json(&cameras, camera_as_json),
            "serial_ports": list_as_json(&ports, port_as_json),
        }));
    }
    let line = |error: String| error + "\n";
    let cameras = cameras.map_or_else(line, |cameras| cameras_as_text(&cameras));
    say(&(cameras + &ports.map_or_else(line, |ports| ports_as_text(&ports))))
}

/// A list, or why there is none.
fn list_as_json<T>(list: &Result<Vec<T>, String>, one: fn(&T) -> Value) -> Value {
    match list {
        Ok(all) => all.iter().map(one).collect(),
        Err(error) => json!({ "error": error }),
    }
}

fn ports_as_text(ports: &[SerialPort]) -> String {
    if ports.is_empty() {
        return "no serial port: plug a camera device in\n".into();
    }
    ports.iter().map(|port| port.line() + "\n").collect()
}

fn port_as_json(port: &SerialPort) -> Value {
    let usb = port
        .usb
        .as_ref()
        .map(|usb| json!({ "vendor": usb.vendor, "product": usb.product, "names": usb.names }));
    json!({ "port": port.path, "usb": usb, "is_taken_by_auto": port.is_device() })
}

fn cameras_as_text(cameras: &[Found]) -> String {
    if cameras.is_empty() {
        return "no camera: plug one in; in a container or a virtual machine, pass its /dev/video nodes on\n"
            .into();
    }
    cameras.iter().map(camera_as_text).collect()
}

fn camera_as_text(camera: &Found) -> String {
    let camera = match camera {
        Ok(camera) => camera,
        Err(error) => return format!("{}\n", words_of(error)),
    };
    let mut table = Table::new(&camera.path.display().to_string());
    table.row("name", &camera.name);
    table.row("bus", &format!("{}, driver {}", camera.bus, camera.driver));
    let (read, others): (Vec<&Offer>, Vec<_>) = camera.offers.iter().partition(|offer| offer.is_read());
    for offer in read {
        let what = if offer.name.is_empty() { String::new() } else { format!(" ({})", offer.name) };
        table.row("format", &format!("{}{what}", offer.code));
        for sizes in &offer.sizes {
            table.row("", &sizes_in_words(sizes));
        }
    }
    if !others.is_empty() {
        let codes: Vec<String> = others.iter().map(|offer| offer.code.to_string()).collect();
        table.row("not read", &codes.join(", "));
    }
    match choose(camera, &Request::default()) {
        Ok(choice) => table.row("taken", &choice_in_words(&choice)),
        Err(_) => table.row("taken", "as one view: give two cameras, or say --layout"),
    }
    table.text().to_owned()
}

fn choice_in_words(choice: &Choice) -> String {
    let (width, height) = choice.size;
    let rate = choice.rate.map_or_else(String::new, |rate| format!(" at {rate:.0}/s"));
    format!("{} {width}x{height}{rate}, {}, unless you say otherwise", choice.code, choice.layout.name())
}

fn camera_as_json(camera: &Found) -> Value {
    let camera = match camera {
        Ok(camera) => camera,
        Err(error) => return json!({ "error": words_of(error) }),
    };
    let sizes = |sizes: &Sizes| match sizes {
        Sizes::One((width, height), rates) => {
            json!({ "size_px": [width, height], "rates_per_s": rates })
        }
        Sizes::Range { least, most, step } => {
            json!({ "least_px": least, "most_px": most, "step_px": step })
        }
    };
    let offer = |offer: &Offer| {
        json!({
            "code": offer.code.to_string(),
            "name": offer.name,
            "is_read": offer.is_read(),
            "sizes": offer.sizes.iter().map(sizes).collect::<Vec<_>>(),
        })
    };
    let taken = choose(camera, &Request::default()).ok().map(|choice| {
        json!({
            "code": choice.code.to_string(),
            "size_px": choice.size,
            "rate_per_s": choice.rate,
            "layout": choice.layout.name(),
        })
    });
    json!({
        "device": shown(&camera.path),
        "name": camera.name,
        "bus": camera.bus,
        "driver": camera.driver,
        "formats": camera.offers.iter().map(offer).collect::<Vec<_>>(),
        "taken": taken,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::v4l::errors::{Doing, errno};

    #[test]
    fn cameras_are_told_with_what_would_be_taken() {
        let camera = Camera {
            path: "/dev/video0".into(),
            name: "3D USB Camera".into(),
            driver: "uvcvideo".into(),
            bus: "usb-0000:00:14.0-1".into(),
            offers: vec![
                Offer {
                    code: "YUYV".parse().unwrap(),
                    name: "YUYV 4:2:2".into(),
                    sizes: vec![Sizes::One((1280, 480), vec![30.0, 29.97])],
                },
                Offer { code: "H264".parse().unwrap(), name: String::new(), sizes: Vec::new() },
            ],
            current: ("YUYV".parse().unwrap(), (1280, 480)),
        };
        let busy =
            CameraError::System { path: "/dev/video2".into(), doing: Doing::Open, code: errno::EACCES };
        let cameras = [Ok(camera), Err(busy)];
        let text = cameras_as_text(&cameras);
        for words in [
            "/dev/video0",
            "3D USB Camera",
            "YUYV (YUYV 4:2:2)",
            "1280x480 at 30, 29.97/s",
            "not read      H264",
            "YUYV 1280x480 at 30/s, side-by-side",
            "/dev/video2 cannot be opened: you may not use it",
        ] {
            assert!(text.contains(words), "{words} is not in\n{text}");
        }
        let told = camera_as_json(&cameras[0]);
        assert_eq!(told["taken"]["layout"], "side-by-side");
        assert_eq!(told["formats"][1]["is_read"], false);
        assert!(cameras_as_text(&[]).contains("plug one in"));
        let port = SerialPort { path: "/dev/ttyS0".into(), usb: None };
        assert_eq!(ports_as_text(std::slice::from_ref(&port)), "/dev/ttyS0  not on USB\n");
        assert_eq!(port_as_json(&port)["is_taken_by_auto"], false);
        assert_eq!(list_as_json(&Ok(vec![port]), port_as_json)[0]["port"], "/dev/ttyS0");
        assert_eq!(list_as_json(&Err("no bus".into()), port_as_json)["error"], "no bus");
    }
}
