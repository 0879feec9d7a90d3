//! What becomes of pairs, one by one and of a batch.

use std::time::Duration;

use serde::{Deserialize, Serialize};

/// What became of a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Its model is written.
    Made,
    /// It gives no trustworthy model.
    Refused,
    /// It could not be made.
    Aside,
}

impl Outcome {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Made, Self::Refused, Self::Aside];

    /// Its word in a subject.
    pub(super) const fn token(self) -> &'static str {
        match self {
            Self::Made => "made",
            Self::Refused => "refused",
            Self::Aside => "aside",
        }
    }
}

/// What is kept of a pair that is done or set aside.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Record {
    /// The pair's name.
    pub name: String,
    /// Who did it: machine and process.
    pub worker: String,
    /// Which try it was.
    pub tries: i64,
    /// Time for it, s.
    pub time_s: f64,
    /// Why there is no model.
    pub reason: Option<String>,
}

/// What came of submitting a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Submitted {
    /// It waits now.
    Queued,
    /// It did so before.
    Waits,
    /// It is done.
    Done,
}

/// How far a batch is.
#[derive(Clone, Debug)]
pub struct Progress {
    /// Pairs that wait.
    pub waiting: u64,
    /// Pairs at work.
    pub at_work: u64,
    /// Pairs of each outcome, as in [`Outcome::ALL`].
    pub done: [u64; 3],
    /// Records of pairs without a model, up to a hundred of each outcome.
    pub told: [Vec<Record>; 3],
    /// Pairs a second, over the latest records.
    pub rate: Option<f64>,
    /// Since the last record.
    pub idle: Option<Duration>,
}
