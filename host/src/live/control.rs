//! What a person may set while pairs are made; it holds for the next pair.
//!
//! * **In**: wishes, as JSON whose names and words are those of the flags. **Out**: [`Settings`], and what is told of
//!   them to pages.
//! * A wish is obeyed as a whole or refused with a sentence. What a source cannot be told says why.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use serde::Deserialize;
use serde_json::{Value, json};
use shared::stage::binarise::{Polarity, Threshold};

use crate::report::words::{parse_polarity, parse_threshold, polarity_name};
use crate::source::exposure::{Exposure, Range};
use crate::source::scene::Region;

/// What pairs are made with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Settings {
    /// Level between object and background.
    pub threshold: Threshold,
    /// Whether the object is bright or dark.
    pub polarity: Polarity,
    /// The part of both views to look at, if not all.
    pub region: Option<Region>,
    /// How pictures are taken, if not as the camera was set before.
    pub exposure: Option<Exposure>,
}

/// What can be set; what cannot says why.
#[derive(Clone, Debug)]
pub struct Limits {
    /// The level.
    pub threshold: Result<(), &'static str>,
    /// The object's side of it.
    pub polarity: Result<(), &'static str>,
    /// The part of both views to look at.
    pub region: Result<(), &'static str>,
    /// How pictures are taken.
    pub exposure: Result<Range, String>,
    /// How many pairs are taken.
    pub pairs: Result<(), &'static str>,
}

/// The settings, between those who set them and those who obey.
#[derive(Debug)]
pub struct Control {
    limits: Limits,
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Clone, Copy, Debug)]
struct State {
    settings: Settings,
    /// Whether threshold and polarity are known: set by somebody here, and not by whoever was there before.
    said: [bool; 2],
    /// How often they were set.
    version: u64,
    /// Of a view, px, once one was seen.
    size: Option<(u32, u32)>,
    /// Pairs that are still to be taken; None for all that come.
    pairs: Option<u32>,
}

/// What somebody wants; what is not named stays.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Wish {
    threshold: Option<String>,
    polarity: Option<String>,
    /// As `--roi`; nothing for all.
    region: Option<String>,
    /// `auto`, or a number of the camera's unit.
    exposure: Option<String>,
    /// `all`, or how many more: 1 is a single shot, 0 a pause.
    pairs: Option<String>,
}

impl Control {
    /// The settings at first, and what can be set.
    #[must_use]
    pub fn new(settings: Settings, limits: Limits) -> Self {
        let state = Mutex::new(State { settings, said: [true; 2], version: 0, size: None, pairs: None });
        Self { limits, state, changed: Condvar::new() }
    }

    /// Threshold and polarity are those of the settings only if so; otherwise they are not known until they are set.
    #[must_use]
    pub fn knowing(self, said: [bool; 2]) -> Self {
        self.lock().said = said;
        self
    }

    /// Whether threshold and polarity are known.
    #[must_use]
    pub fn said(&self) -> [bool; 2] {
        self.lock().said
    }

    /// What it holds is whole at every moment, so a panic elsewhere does not matter.
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What the next pair is to be made with, and how often that was set.
    #[must_use]
    pub fn settings(&self) -> (Settings, u64) {
        let State { settings, version, .. } = *self.lock();
        (settings, version)
    }

    /// Waits at most so long until something was set since `version`; returns whether it was.
    #[must_use]
    pub fn wait(&self, version: u64, patience: Duration) -> bool {
        let unset = |state: &mut State| state.version == version;
        let waited = self.changed.wait_timeout_while(self.lock(), patience, unset);
        let (state, _) = waited.unwrap_or_else(PoisonError::into_inner);
        state.version != version
    }

    /// Whether pairs are to be taken at all.
    #[must_use]
    pub fn wants_pairs(&self) -> bool {
        self.lock().pairs != Some(0)
    }

    /// A pair has come: whether it is wanted. If so many were asked for, it is one of them.
    #[must_use]
    pub fn take_pair(&self) -> bool {
        let State { pairs, .. } = &mut *self.lock();
        let wanted = *pairs != Some(0);
        *pairs = pairs.map(|pairs| pairs.saturating_sub(1));
        wanted
    }

    /// Views of this size are made; a region must lie within.
    pub(crate) fn saw(&self, size: (u32, u32)) {
        self.lock().size = Some(size);
    }

    /// Obeys.
    ///
    /// # Errors
    /// A sentence, and nothing was set.
    pub(crate) fn wish(&self, json: &[u8]) -> Result<(), String> {
        let wish: Wish =
            serde_json::from_slice(json).map_err(|error| format!("no wish that is known: {error}"))?;
        let mut state = self.lock();
        let (mut settings, mut said) = (state.settings, state.said);
        if let Some(text) = wish.threshold {
            self.limits.threshold?;
            (settings.threshold, said[0]) = (parse_threshold(&text)?, true);
        }
        if let Some(text) = wish.polarity {
            self.limits.polarity?;
            (settings.polarity, said[1]) = (parse_polarity(&text)?, true);
        }
        if let Some(text) = wish.region {
            self.limits.region?;
            settings.region = region(&text, state.size)?;
        }
        if let Some(text) = wish.exposure {
            settings.exposure = Some(exposure(&text, self.limits.exposure.as_ref()?)?);
        }
        if let Some(text) = wish.pairs {
            self.limits.pairs?;
            state.pairs = pairs(&text)?;
        }
        state.said = said;
        if settings != state.settings {
            state.settings = settings;
            state.version += 1;
            self.changed.notify_all();
        }
        Ok(())
    }

    /// All of it, for those who set it.
    pub(crate) fn told(&self) -> Value {
        let State { settings, said, version, pairs, .. } = *self.lock();
        let Limits { threshold, polarity, region, exposure, pairs: takes } = &self.limits;
        let range = exposure.as_ref().ok();
        json!({
            "version": version,
            "flags": settings.flags(),
            "threshold": { "value": said[0].then(|| threshold_word(settings.threshold)), "why": threshold.err() },
            "polarity": { "value": said[1].then(|| polarity_name(settings.polarity)), "why": polarity.err() },
            "region": { "value": settings.region.map(|region| region.to_string()), "why": region.err() },
            "exposure": {
                "value": settings.exposure.map(|exposure| match exposure {
                    Exposure::Auto => "auto".to_owned(),
                    Exposure::Fixed(time) => time.to_string(),
                }),
                "why": exposure.as_ref().err(),
                "least": range.map(|range| range.least),
                "most": range.map(|range| range.most),
                "unit": range.map(|range| range.unit),
                "auto": range.map(|range| range.auto),
            },
            "pairs": {
                "value": pairs.map_or_else(|| "all".to_owned(), |pairs| pairs.to_string()),
                "why": takes.err(),
            },
        })
    }
}

impl Settings {
    /// The flags that would have set this; exposures have none.
    #[must_use]
    pub fn flags(&self) -> String {
        let mut flags = Vec::new();
        if self.threshold != Threshold::default() {
            flags.push(format!("--threshold {}", threshold_word(self.threshold)));
        }
        if self.polarity != Polarity::default() {
            flags.push(format!("--polarity {}", polarity_name(self.polarity)));
        }
        flags.extend(self.region.map(|region| format!("--roi {region}")));
        flags.join(" ")
    }
}

fn threshold_word(threshold: Threshold) -> String {
    match threshold {
        Threshold::Otsu => "otsu".into(),
        Threshold::Fixed(level) => level.to_string(),
    }
}

fn region(text: &str, size: Option<(u32, u32)>) -> Result<Option<Region>, String> {
    if text.trim().is_empty() {
        return Ok(None);
    }
    let region: Region = text.parse()?;
    match size {
        None => Err("no pair has come yet: its size is not known; set the region then".into()),
        Some((width, height)) if !region.is_within(width, height) => {
            Err(format!("the views are {width}x{height} px: the region must lie within"))
        }
        Some(_) => Ok(Some(region)),
    }
}

fn exposure(text: &str, range: &Range) -> Result<Exposure, String> {
    let Range { least, most, unit, auto } = *range;
    match text.parse() {
        Ok(time) if (least..=most).contains(&time) => Ok(Exposure::Fixed(time)),
        Err(_) if text == "auto" && auto => Ok(Exposure::Auto),
        _ => {
            let auto = if auto { "auto, or " } else { "" };
            Err(format!("give {auto}{least} to {most} {unit}"))
        }
    }
}

fn pairs(text: &str) -> Result<Option<u32>, String> {
    match text.parse() {
        Ok(pairs) => Ok(Some(pairs)),
        Err(_) if text == "all" => Ok(None),
        Err(_) => Err("give all, or how many more pairs: 1 for a single one, 0 for a pause".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::damaged::damaged;
    use crate::random::Random;

    fn control() -> Control {
        let exposure = Ok(Range { least: 1, most: 500, unit: "x 0.1 ms", auto: true });
        let limits =
            Limits { threshold: Ok(()), polarity: Err("it is so"), region: Ok(()), exposure, pairs: Ok(()) };
        Control::new(Settings::default(), limits)
    }

    #[test]
    fn a_wish_in_the_words_of_the_flags_is_obeyed_and_told() {
        let control = control();
        control.saw((320, 240));
        control.wish(br#"{"threshold": "90", "region": "10,20,100,120", "exposure": "40"}"#).unwrap();
        let (settings, version) = control.settings();
        let region = Some(Region { x: 10, y: 20, width: 100, height: 120 });
        let (threshold, exposure) = (Threshold::Fixed(90), Some(Exposure::Fixed(40)));
        assert_eq!(settings, Settings { threshold, region, exposure, ..Settings::default() });
        assert_eq!((version, settings.flags().as_str()), (1, "--threshold 90 --roi 10,20,100,120"));
        let told = control.told();
        assert_eq!(told["threshold"]["value"], "90");
        assert_eq!(
            told["exposure"],
            json!({ "value": "40", "why": null, "least": 1, "most": 500, "unit": "x 0.1 ms", "auto": true })
        );
        control.wish(br#"{"threshold": "otsu", "region": "", "exposure": "auto"}"#).unwrap();
        let exposure = Some(Exposure::Auto);
        assert_eq!(control.settings(), (Settings { exposure, ..Settings::default() }, 2));
        assert_eq!(control.settings().0.flags(), "");
    }

    #[test]
    fn a_wish_that_cannot_be_obeyed_changes_nothing() {
        let control = control();
        let error = control.wish(br#"{"region": "10,20,100,120"}"#).unwrap_err();
        assert!(error.contains("no pair has come"), "{error}");
        control.wish(br#"{"region": ""}"#).unwrap();
        control.saw((320, 240));
        for (wish, words) in [
            (r#"{"threshold": "90", "polarity": "dark"}"#, "it is so"),
            (r#"{"threshold": "300"}"#, "0 to 255"),
            (r#"{"region": "10,20,400,120"}"#, "320x240"),
            (r#"{"region": "4294967295,0,20,20"}"#, "320x240"),
            (r#"{"region": "1,2,3"}"#, "X,Y,W,H"),
            (r#"{"exposure": "0"}"#, "give auto, or 1 to 500 x 0.1 ms"),
            (r#"{"pairs": "few"}"#, "give all, or how many"),
            (r#"{"gain": "1"}"#, "gain"),
            ("[]", "no wish"),
            ("", "no wish"),
        ] {
            let error = control.wish(wish.as_bytes()).unwrap_err();
            assert!(error.contains(words), "{wish}: {error}");
        }
        assert_eq!(control.settings(), (Settings::default(), 0));
    }

    #[test]
    fn whatever_is_sent_is_obeyed_as_a_whole_or_changes_nothing() {
        let sound = br#"{"threshold": "90", "region": "10,20,100,120", "exposure": "auto", "pairs": "3"}"#;
        let (mut random, mut obeyed) = (Random::new(1), 0);
        for _ in 0..20_000 {
            let control = control();
            control.saw((320, 240));
            let before = control.told();
            match control.wish(&damaged(sound, &mut random)) {
                Ok(()) => {
                    assert!(control.settings().0.region.is_none_or(|region| region.is_within(320, 240)));
                    obeyed += 1;
                }
                Err(error) => assert!(!error.is_empty() && control.told() == before, "{error}"),
            }
        }
        assert!((1..20_000).contains(&obeyed), "{obeyed} of 20000 are still wishes");
    }

    #[test]
    fn so_many_pairs_are_taken_as_were_asked_for() {
        let control = control();
        let taken = || (0..4).filter(|_| control.take_pair()).count();
        assert!(control.wants_pairs() && taken() == 4);
        control.wish(br#"{"pairs": "1"}"#).unwrap();
        assert_eq!(control.told()["pairs"]["value"], "1");
        assert!(control.wants_pairs() && taken() == 1 && !control.wants_pairs());
        control.wish(br#"{"pairs": "3"}"#).unwrap();
        assert_eq!((taken(), taken()), (3, 0));
        control.wish(br#"{"pairs": "all"}"#).unwrap();
        assert_eq!(taken(), 4);
        // It is nothing that a pair is made with.
        assert_eq!(control.settings().1, 0);
    }

    #[test]
    fn what_nobody_said_is_not_known_until_it_is_set() {
        let control = control().knowing([false, true]);
        assert_eq!((control.said(), &control.told()["threshold"]["value"]), ([false, true], &Value::Null));
        assert!(control.wish(br#"{"threshold": "300"}"#).is_err() && !control.said()[0]);
        control.wish(br#"{"threshold": "otsu"}"#).unwrap();
        assert_eq!((control.said(), &control.told()["threshold"]["value"]), ([true; 2], &"otsu".into()));
    }

    #[test]
    fn what_is_set_already_is_no_change() {
        let control = control();
        control.wish(br#"{"threshold": "otsu"}"#).unwrap();
        assert!(!control.wait(0, Duration::ZERO));
        control.wish(br#"{"threshold": "7"}"#).unwrap();
        assert!(control.wait(0, Duration::from_secs(60)));
    }
}
