//! A pair as a live page takes it: what it shows of a report, and how it came about.
//!
//! * **In**: what was made of a pair, or why it was refused, with everything that the core showed. **Out**: JSON,
//!   made when the first page asks for it and kept for the others; what is set goes with each answer, as it is then.

use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use hyper::body::Bytes;
use image::GrayImage;
use serde::Serialize;

use super::control::Control;
use crate::calibration::StereoCamera;
use crate::reconstruct::{Options, Reconstruction, Refusal};
use crate::report::page::Content;
use crate::report::page::picture::address;
use crate::report::record::Record;
use crate::report::{Refused, Run, numbers};

/// A pair, and what became of it.
#[derive(Debug)]
pub struct Shot {
    /// What it is called.
    pub name: String,
    /// Its views as they were taken, if they were seen here.
    pub pictures: Option<[GrayImage; 2]>,
    /// What its pixels mean.
    pub calibration: StereoCamera,
    /// The choices made.
    pub options: Options,
    /// What the core showed.
    pub record: Record,
    /// The model, or why there is none; then the record is complete.
    pub made: Result<Reconstruction, Arc<Refusal>>,
    /// What else the user should know, in sentences.
    pub remarks: Vec<String>,
    /// Pairs that the source had to drop so far.
    pub dropped: u64,
    /// When it came.
    pub arrived: Instant,
}

/// A shot among others.
#[derive(Debug)]
pub(super) struct Frame {
    number: u64,
    /// Pairs made a second, lately.
    rate: Option<f64>,
    /// Of the page.
    title: Arc<str>,
    shot: Shot,
    json: OnceLock<Vec<u8>>,
}

/// What a page gets beside what is set.
#[derive(Serialize)]
struct Told<'a> {
    number: u64,
    name: &'a str,
    rate: Option<f64>,
    dropped: u64,
    remarks: &'a [String],
    /// The views' size, px, and both as pictures.
    pictures: Option<([u32; 2], [String; 2])>,
    /// What the report's script shows.
    content: Content,
}

impl Frame {
    pub(super) fn new((number, rate): (u64, Option<f64>), title: Arc<str>, shot: Shot) -> Self {
        Self { number, rate, title, shot, json: OnceLock::new() }
    }

    /// Pairs are counted from 1.
    pub(super) const fn number(&self) -> u64 {
        self.number
    }

    /// Since it came.
    pub(super) fn age(&self) -> Duration {
        self.shot.arrived.elapsed()
    }

    pub(super) fn into_shot(self) -> Shot {
        self.shot
    }

    /// What a page gets: `settings`, which are those of now, before the fields of [`Told`].
    pub(super) fn json(&self, control: &Control) -> Bytes {
        let told = self.json.get_or_init(|| self.encoded());
        let settings = control.told().to_string();
        let fields = told.strip_prefix(b"{").unwrap_or_default();
        [&b"{\"settings\":"[..], settings.as_bytes(), b",", fields].concat().into()
    }

    fn encoded(&self) -> Vec<u8> {
        let Shot { name, pictures, calibration, options, record, made, remarks, dropped, .. } = &self.shot;
        let content = match made {
            Ok(reconstruction) => {
                let run = Run { calibration, options, reconstruction, record, truth: None };
                Content::of(&run, &numbers::json(&run), &self.title)
            }
            Err(refusal) => Content::refused(&Refused { options, record, refusal }, &self.title),
        };
        let told = Told {
            number: self.number,
            name,
            rate: self.rate,
            dropped: *dropped,
            remarks,
            pictures: pictures
                .as_ref()
                .map(|views| (views[0].dimensions().into(), views.each_ref().map(address))),
            content,
        };
        // Plain data becomes JSON; were it not to, the page would say that it cannot read it.
        serde_json::to_vec(&told).unwrap_or_default()
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::live::control::{Limits, Settings};
    use base64::Engine as _;
    use base64::engine::general_purpose::STANDARD;
    use serde_json::Value;

    /// A pair that was refused before anything was seen of it.
    pub(in crate::live) fn refused(number: u64) -> Frame {
        let shot = Shot {
            name: "a pair".into(),
            pictures: Some([0, 1].map(|_| GrayImage::new(16, 12))),
            calibration: StereoCamera::rectified(16, 12, 20.0, 60.0),
            options: Options::default(),
            record: Record::new(),
            made: Err(Arc::new(Refusal::Behind)),
            remarks: Vec::new(),
            dropped: 3,
            arrived: Instant::now(),
        };
        Frame::new((number, Some(9.5)), "a <camera>".into(), shot)
    }

    #[test]
    fn a_refused_pair_shows_what_the_cameras_saw_and_why() {
        let none = || Err("no");
        let exposure = Err("no".to_owned());
        let limits = Limits { threshold: Ok(()), polarity: none(), region: none(), exposure, pairs: none() };
        let control = Control::new(Settings::default(), limits);
        let frame = refused(7);
        let told: Value = serde_json::from_slice(&frame.json(&control)).unwrap();
        assert_eq!((&told["number"], &told["dropped"]), (&7.into(), &3.into()));
        let gate = told["content"]["gates"][0]["sentence"].as_str().unwrap();
        assert!(gate.contains("in front of both cameras"), "{gate}");
        assert_eq!(
            (&told["content"]["space"], &told["content"]["title"]),
            (&Value::Null, &"a <camera>".into())
        );
        let address = told["pictures"][1][0].as_str().unwrap();
        let png = STANDARD.decode(address.strip_prefix("data:image/png;base64,").unwrap()).unwrap();
        assert_eq!(image::load_from_memory(&png).unwrap().into_luma8(), GrayImage::new(16, 12));
        assert_eq!(told["settings"]["threshold"]["value"], "otsu");
        // Who asks later sees what is set by then; the pair is not made again.
        let kept = frame.json.get().unwrap().as_ptr();
        control.wish(br#"{"threshold": "90"}"#).unwrap();
        let later: Value = serde_json::from_slice(&frame.json(&control)).unwrap();
        assert_eq!((&later["settings"]["threshold"]["value"], &later["number"]), (&"90".into(), &7.into()));
        assert_eq!(frame.json.get().unwrap().as_ptr(), kept);
    }
}
