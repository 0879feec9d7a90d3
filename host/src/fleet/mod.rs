//! Live boards over [Zenoh](https://zenoh.io): whoever makes pairs publishes what becomes of them, and anybody who may
//! looks on, keeps it, and gives orders (docs/fleet.md).
//!
//! ```text
//! listen, capture -> Publisher: key, envelope, bytes -> Link ~ network ~ Link -> Subscriber -> Ledger: what is missing
//!        ^                                                                           |
//!        +---- live::control <---- orders: what anybody may ask of a board <---------+
//! ```
//!
//! What is sent is numbered, so who receives knows what was lost, whoever lost it. Zenoh itself is a cargo feature,
//! `fleet`; without it a [`Link`] cannot be opened, and all else is as it is (docs/decisions/0028-live-fleet.md).

pub mod envelope;
pub mod key;
pub mod ledger;
#[cfg_attr(not(feature = "fleet"), path = "absent.rs")]
pub mod link;

use std::fmt;
use std::path::PathBuf;
use std::time::Duration;

use envelope::Envelope;
use key::{Board, Leaf};
pub use link::{Link, Publisher, Subscriber};

/// Where programs of a fleet meet unless somebody says otherwise: on this machine.
pub const MEETING_PLACE: &str = "tcp/127.0.0.1:7447";

/// Where to meet the others.
#[derive(Clone, Debug, Default)]
pub struct Meeting {
    /// Where others listen, as `tcp/HOST:PORT` or `tls/HOST:PORT`; [`MEETING_PLACE`] if nothing is said at all.
    pub connect: Vec<String>,
    /// Where to listen, so that others meet here.
    pub listen: Vec<String>,
    /// Zenoh's own configuration, as JSON5: certificates, access control.
    pub config: Option<PathBuf>,
    /// Whether it is of no use unless it listens.
    pub must_listen: bool,
}

impl fmt::Display for Meeting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let places: Vec<_> = self.connect.iter().chain(&self.listen).map(String::as_str).collect();
        match (&places[..], &self.config) {
            ([], Some(config)) => write!(f, "the places of {}", config.display()),
            ([], None) => f.write_str(MEETING_PLACE),
            (places, _) => f.write_str(&places.join(", ")),
        }
    }
}

/// What becomes of what somebody is too slow for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Pressure {
    /// Nothing is lost: whoever sends waits.
    #[default]
    Wait,
    /// Nobody waits: what has no room is lost, which the numbers tell.
    Newest,
}

/// What has come from a board.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message {
    /// From which.
    pub board: Board,
    /// What it is.
    pub leaf: Leaf,
    /// Its place among others.
    pub envelope: Envelope,
    /// As [`Leaf`] says.
    pub bytes: Vec<u8>,
}

/// What others wrote, for a terminal: what would steer it is a question mark.
#[must_use]
pub fn printable(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { '?' } else { c }).collect()
}

/// What was answered to an order: by whom, and what is set there now, as JSON; or why not, in a sentence.
pub type Obeyed = Result<(Board, Vec<u8>), String>;

/// Boards that one program looks at; what others send is passed over.
pub const BOARDS: usize = 1024;

/// Longest that an answer is waited for.
pub const ANSWER: Duration = Duration::from_secs(3);

/// Why there is no fleet.
#[derive(Debug, thiserror::Error)]
pub enum FleetError {
    /// There is no Zenoh in this program.
    #[error(
        "this program was built without fleets; build it with `cargo build --release -p host --features fleet`, or \
         look at one board of this machine with `host listen --view`"
    )]
    Absent,
    /// The configuration cannot be used.
    #[error("the Zenoh configuration {} cannot be used: {why}", path.display())]
    Config {
        /// The file.
        path: PathBuf,
        /// What Zenoh says.
        why: String,
    },
    /// Another program publishes under the same name.
    #[error(
        "{0} is published by another program: stop that one, or choose another name; one that was cut off is forgotten \
         after 10 s"
    )]
    Named(Board),
    /// Nobody can be met.
    #[error(
        "nobody is met at {places}: {why}; start `host fleet router` there, name another place with --connect, or look \
         at the certificates in --zenoh-config"
    )]
    Nobody {
        /// Where.
        places: String,
        /// What Zenoh says.
        why: String,
    },
    /// Nobody can be let in.
    #[error(
        "cannot listen at {places}: {why}; another program may be there: give a free place with --listen-at"
    )]
    Taken {
        /// Where.
        places: String,
        /// What Zenoh says.
        why: String,
    },
    /// Zenoh does not do what is asked.
    #[error("the link to the fleet failed: {0}")]
    Link(String),
}
