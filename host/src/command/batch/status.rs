//! How far a batch is, and its end.

use serde_json::json;

use super::super::table::{Table, count};
use super::super::{Failure, say, say_json};
use super::BatchArgs;
use crate::batch::queue::Queue;
use crate::batch::record::Progress;

/// Tells how far a batch is.
pub(super) fn run(args: &BatchArgs, json: bool) -> Result<(), Failure> {
    let name = args.name()?;
    let progress = Queue::open(&args.server(), &name)?.progress()?;
    if json { say_json(&as_json(&name, &progress)) } else { say(&as_text(&name, &progress)) }
}

/// Forgets a batch.
pub(super) fn drop(args: &BatchArgs, json: bool) -> Result<(), Failure> {
    let name = args.name()?;
    Queue::open(&args.server(), &name)?.remove()?;
    if json { say_json(&json!({ "dropped": name })) } else { say(&format!("{name} is forgotten\n")) }
}

/// Seconds that the rest will take.
fn left(progress: &Progress) -> Option<f64> {
    progress.rate.map(|rate| (progress.waiting + progress.at_work) as f64 / rate)
}

fn as_json(name: &str, progress: &Progress) -> serde_json::Value {
    let [made, refused, aside] = progress.done;
    let [_, refusals, set_aside] = &progress.told;
    json!({
        "batch": name,
        "waiting": progress.waiting,
        "at_work": progress.at_work,
        "made": made,
        "refused": refused,
        "set_aside": aside,
        "rate_per_s": progress.rate,
        "left_s": left(progress),
        "idle_s": progress.idle.map(|idle| idle.as_secs_f64()),
        "refusals": refusals,
        "aside": set_aside,
    })
}

fn as_text(name: &str, progress: &Progress) -> String {
    let mut table = Table::new(name);
    let [made, refused, aside] = progress.done;
    let states = [("waiting", progress.waiting), ("at work", progress.at_work), ("made", made)];
    for (state, number) in states.into_iter().chain([("refused", refused), ("set aside", aside)]) {
        table.row(state, &count(usize::try_from(number).unwrap_or(usize::MAX), "pair", "pairs"));
    }
    if let (Some(rate), Some(idle)) = (progress.rate, progress.idle) {
        table.row(
            "rate",
            &format!("{rate:.2} pairs a second; the last was done {:.0} s ago", idle.as_secs_f64()),
        );
    }
    if let Some(seconds) = left(progress).filter(|_| progress.waiting + progress.at_work > 0) {
        table.row("time left", &in_words(seconds));
    }
    for record in progress.told.iter().flatten() {
        let reason = record.reason.as_deref().unwrap_or_default();
        table.warning(&format!("{}: {reason}", record.name));
    }
    table.text().to_owned()
}

/// A length of time.
fn in_words(seconds: f64) -> String {
    match seconds.ceil() as u64 {
        seconds @ 0..120 => format!("{seconds} s"),
        seconds @ 120..7200 => format!("{} min", seconds.div_ceil(60)),
        seconds => format!("{:.1} h", seconds as f64 / 3600.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_told_in_units_that_fit() {
        let told = [1.2, 119.0, 120.5, 7199.0, 7201.0, 1e6].map(in_words);
        assert_eq!(told, ["2 s", "119 s", "3 min", "120 min", "2.0 h", "277.8 h"]);
    }
}
