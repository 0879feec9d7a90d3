//! How often something happens, lately.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Time over which the rate is taken.
const OVER: Duration = Duration::from_secs(3);

/// When it happened lately.
#[derive(Debug, Default)]
pub(crate) struct Rate(VecDeque<Instant>);

impl Rate {
    /// It happens now; how often a second it did, if it did before.
    pub(crate) fn step(&mut self) -> Option<f64> {
        let rate = self.now();
        self.0.push_back(Instant::now());
        rate
    }

    /// How often a second it happens, if it does.
    pub(crate) fn now(&mut self) -> Option<f64> {
        let now = Instant::now();
        while self.0.front().is_some_and(|time| now - *time > OVER) {
            self.0.pop_front();
        }
        self.0.front().map(|first| self.0.len() as f64 / (now - *first).as_secs_f64().max(1e-9))
    }
}
