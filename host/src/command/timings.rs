//! `--timings`: where the time of pairs goes, stage by stage.

use std::fmt::Write;
use std::time::{Duration, Instant};

use shared::pipeline::Side;

use super::model::Model;
use super::note;
use super::table::count;
use crate::report::times::{CORE, Part};

/// The times of pairs that were not refused.
#[derive(Debug)]
pub(super) struct Timings {
    start: Instant,
    /// In the order in which they go on.
    stages: Vec<Stage>,
    /// Each pair, from its images to its files.
    pairs: Vec<Duration>,
}

/// A stage, and how long each pair took there.
#[derive(Debug)]
struct Stage {
    name: String,
    times: Vec<Duration>,
}

impl Timings {
    /// Nothing timed yet; the pairs come from now on.
    pub(super) fn begin() -> Self {
        Self { start: Instant::now(), stages: Vec::new(), pairs: Vec::new() }
    }

    /// Adds a pair, whose images took so long to load if they are files.
    pub(super) fn add(&mut self, loading: Option<Duration>, model: &Model) {
        if let Some(loading) = loading {
            self.stage("load", loading);
        }
        let mut told = Duration::ZERO;
        for stage in model.stages.iter().filter(|stage| stage.name != CORE) {
            let part = match stage.part {
                Part::Eye(Side::Left) => "left ",
                Part::Eye(Side::Right) => "right ",
                Part::Pair => "pair ",
                Part::Host => "",
            };
            self.stage(&format!("{part}{}", stage.name), stage.time);
            told += stage.time;
        }
        self.stage("write", model.writing);
        self.stage("rest", model.time.saturating_sub(told + model.writing));
        self.pairs.push(loading.unwrap_or_default() + model.time);
    }

    fn stage(&mut self, name: &str, time: Duration) {
        match self.stages.iter_mut().find(|stage| stage.name == name) {
            Some(stage) => stage.times.push(time),
            None => self.stages.push(Stage { name: name.to_owned(), times: vec![time] }),
        }
    }

    /// Tells it on standard error.
    pub(super) fn tell(&self) {
        if !self.pairs.is_empty() {
            note(self.table(self.start.elapsed()).trim_end());
        }
    }

    /// The table of pairs that were all made in the time `taken`.
    fn table(&self, taken: Duration) -> String {
        let all: Duration = self.pairs.iter().sum();
        let one = self.pairs.len() == 1;
        let heading =
            if one { ["ms", "share"].to_vec() } else { ["median ms", "worst ms", "share"].to_vec() };
        let mut text = format!("{:22}", "stage");
        heading.iter().for_each(|name| text.push_str(&format!("{name:>11}")));
        let row = |name: &str, times: &[Duration]| {
            let mut sorted = times.to_vec();
            sorted.sort_unstable();
            let ms = |time: Option<&Duration>| time.map_or(0.0, |time| 1e3 * time.as_secs_f64());
            let share = times.iter().sum::<Duration>().as_secs_f64() / all.as_secs_f64().max(1e-9);
            let worst = if one { String::new() } else { format!("{:>11.3}", ms(sorted.last())) };
            let middle = ms(sorted.get(sorted.len() / 2));
            format!("\n  {name:20}{middle:>11.3}{worst}{:>9.1} %", 100.0 * share)
        };
        self.stages.iter().for_each(|stage| text.push_str(&row(&stage.name, &stage.times)));
        text.push_str(&row("all", &self.pairs));
        if !one {
            let (pairs, seconds) = (self.pairs.len(), taken.as_secs_f64());
            let rate = pairs as f64 / seconds.max(1e-9);
            // Writing to a string does not fail.
            let _ = write!(text, "\n{} in {seconds:.2} s: {rate:.2} a second", count(pairs, "pair", "pairs"));
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn timings(pairs: &[[u64; 2]]) -> Timings {
        let mut timings = Timings::begin();
        for [thin, write] in pairs.iter().map(|pair| pair.map(Duration::from_micros)) {
            timings.stage("left thinning", thin);
            timings.stage("write", write);
            timings.pairs.push(thin + write);
        }
        timings
    }

    #[test]
    fn one_pair_has_times_and_shares() {
        let expected = "\
stage                          ms      share
  left thinning             1.500     75.0 %
  write                     0.500     25.0 %
  all                       2.000    100.0 %";
        assert_eq!(timings(&[[1500, 500]]).table(Duration::from_secs(1)), expected);
    }

    #[test]
    fn many_pairs_have_the_median_the_worst_and_a_rate() {
        let expected = "\
stage                   median ms   worst ms      share
  left thinning             2.000      3.000     60.0 %
  write                     1.000      2.000     40.0 %
  all                       3.000      5.000    100.0 %
3 pairs in 2.00 s: 1.50 a second";
        assert_eq!(
            timings(&[[1000, 1000], [3000, 2000], [2000, 1000]]).table(Duration::from_secs(2)),
            expected
        );
    }
}
