//! `--publish`: a fleet is told of each pair beside what a command does.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use serde_json::{Map, Value, json};
use shared::camera::PairModel;
use shared::wire::ToDevice;

use super::options::usage;
use super::{Failure, note, words_of};
use crate::fleet::key::{Board, Leaf};
use crate::fleet::{FleetError, Link, Meeting, Pressure, Publisher};
use crate::live::control::Control;
use crate::live::rate::Rate;
use crate::output::surface;
use crate::reconstruct::Reconstruction;
use crate::source::serial::link::MAX_COMMAND;

/// From one status to the next.
const STATUS: Duration = Duration::from_secs(2);

/// The flags.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct PublishArgs {
    /// Tell a fleet of each pair under this name; files are left only if --out is given
    #[arg(long, value_name = "ossature/SITE/BOARD", value_parser = Board::one, help_heading = "Fleet")]
    publish: Vec<Board>,
    /// Lose what somebody in the fleet is too slow for, instead of waiting
    #[arg(long, help_heading = "Fleet")]
    newest: bool,
    #[command(flatten)]
    meeting: MeetingArgs,
}

/// Where a fleet meets.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Fleet")]
pub(super) struct MeetingArgs {
    /// Meet the fleet where a router listens [default: tcp/127.0.0.1:7447]
    #[arg(long, global = true, value_name = "tcp/HOST:PORT", value_parser = place)]
    connect: Vec<String>,
    /// Be the router at which the fleet meets
    #[arg(long, global = true, value_name = "tcp/HOST:PORT", value_parser = place)]
    listen_at: Vec<String>,
    /// Zenoh's own configuration: certificates, access control
    #[arg(long, global = true, value_name = "FILE")]
    zenoh_config: Option<PathBuf>,
}

/// A place in Zenoh's words.
fn place(text: &str) -> Result<String, String> {
    let address = text.strip_prefix("tcp/").or_else(|| text.strip_prefix("tls/"));
    match address.and_then(|address| address.rsplit_once(':')) {
        Some((host, port)) if !host.is_empty() && port.parse::<u16>().is_ok() => Ok(text.to_owned()),
        _ => Err("give tcp/HOST:PORT or tls/HOST:PORT, as tcp/127.0.0.1:7447".into()),
    }
}

impl MeetingArgs {
    pub(super) fn meeting(&self) -> Meeting {
        let Self { connect, listen_at, zenoh_config } = self.clone();
        Meeting { connect, listen: listen_at, config: zenoh_config, must_listen: false }
    }

    fn is_said(&self) -> bool {
        self.listens() || !self.connect.is_empty() || self.zenoh_config.is_some()
    }

    pub(super) const fn listens(&self) -> bool {
        !self.listen_at.is_empty()
    }
}

impl PublishArgs {
    pub(super) const fn is_wanted(&self) -> bool {
        !self.publish.is_empty()
    }

    /// The names, one a board.
    pub(super) fn boards(&self) -> &[Board] {
        &self.publish
    }

    /// Meets the fleet, if that is wanted.
    pub(super) fn meet(&self) -> Result<Option<Link>, Failure> {
        if !self.is_wanted() && (self.newest || self.meeting.is_said()) {
            return Err(usage("--newest, --connect, --listen-at and --zenoh-config need --publish"));
        }
        Ok(self.is_wanted().then(|| Link::open(&self.meeting.meeting())).transpose()?)
    }

    /// Begins to publish as a board, which others may set.
    pub(super) fn voice(&self, link: &Link, board: &Board, control: &Arc<Control>) -> Result<Voice, Failure> {
        let pressure = if self.newest { Pressure::Newest } else { Pressure::Wait };
        let publisher = link.publish(board, pressure, Arc::clone(control))?;
        let (control, now) = (Arc::clone(control), Instant::now());
        Ok(Voice {
            publisher,
            control,
            rate: Rate::default(),
            about: Value::Null,
            away: None,
            warnings: Vec::new(),
            pairs: 0,
            models: 0,
            heard: now,
            told: None,
            fails: false,
        })
    }
}

/// What a fleet hears of a board.
pub(super) struct Voice {
    publisher: Publisher,
    control: Arc<Control>,
    rate: Rate,
    /// Who the board is.
    about: Value,
    /// Why it is not heard now.
    away: Option<String>,
    /// Of the last pair.
    warnings: Vec<String>,
    pairs: u64,
    models: u64,
    /// When the board was heard last.
    heard: Instant,
    /// When the last status was sent.
    told: Option<Instant>,
    /// Whether it was said that nothing can be sent.
    fails: bool,
}

impl Voice {
    /// A board is there.
    pub(super) fn greeted(&mut self, about: Value) {
        (self.about, self.away, self.told) = (about, None, None);
        self.heard();
    }

    /// A board is gone.
    pub(super) fn gone(&mut self, why: &str, counters: Value) {
        self.away = Some(why.to_owned());
        self.end(counters);
    }

    /// What the pixels of its shapes mean.
    pub(super) fn calibration(&mut self, model: &PairModel) {
        let mut frame = [0; MAX_COMMAND];
        if let Ok(length) = ToDevice::Calibration(*model).encode(0, &mut frame) {
            self.put(Leaf::Calibration, frame[..length].to_vec());
        }
    }

    /// The board is there, whether or not what it sends is wanted.
    pub(super) fn heard(&mut self) {
        self.heard = Instant::now();
    }

    /// A pair has come; all that is said until the next is about it.
    pub(super) fn begin(&mut self) {
        self.pairs += 1;
        self.heard();
        self.rate.step();
    }

    /// As the device describes it.
    pub(super) fn shape(&mut self, frame: Vec<u8>) {
        self.put(Leaf::Shape, frame);
    }

    /// Its model.
    pub(super) fn model(&mut self, made: &Reconstruction) {
        self.models += 1;
        self.put(Leaf::Model, surface(made));
    }

    /// What became of it: warnings, or the one reason why there is no model.
    pub(super) fn pair(&mut self, told: &Value, warnings: &[String]) {
        self.warnings = warnings.to_vec();
        self.put(Leaf::Pair, told.to_string().into_bytes());
    }

    /// How the device fares.
    pub(super) fn health(&mut self, health: &Value) {
        self.heard();
        self.put(Leaf::Health, health.to_string().into_bytes());
    }

    /// That is all, for now at least.
    pub(super) fn end(&mut self, counters: Value) {
        self.told = None;
        self.status(counters);
    }

    /// How its pairs fare, every now and then.
    pub(super) fn status(&mut self, counters: Value) {
        if self.told.is_some_and(|told| told.elapsed() < STATUS) {
            return;
        }
        self.told = Some(Instant::now());
        let mut status = Map::new();
        for (name, value) in [
            ("about", self.about.clone()),
            ("away", json!(self.away)),
            ("heard_ms", json!(self.heard.elapsed().as_millis() as u64)),
            ("rate_hz", json!(self.rate.now())),
            ("pairs", json!(self.pairs)),
            ("models", json!(self.models)),
            ("warnings", json!(self.warnings)),
            ("counters", counters),
            ("settings", self.control.told()),
        ] {
            status.insert(name.into(), value);
        }
        let sent = self.publisher.status(self.pairs, status);
        self.judge(sent.err());
    }

    fn put(&mut self, leaf: Leaf, bytes: Vec<u8>) {
        let put = self.publisher.put(leaf, self.pairs, bytes);
        self.judge(put.err());
    }

    /// A fleet that cannot be told is no reason to end.
    fn judge(&mut self, error: Option<FleetError>) {
        let before = std::mem::replace(&mut self.fails, error.is_some());
        if let Some(error) = error.filter(|_| !before) {
            note(&words_of(&error));
        }
    }
}
