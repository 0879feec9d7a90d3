//! What a run of `capture` says: while it goes on, and at its end.

use std::time::Duration;

use serde_json::{Value, json};

use super::super::model::Model;
use super::super::table::{Table, count};
use super::super::{Failure, note, say, shown, words_of};
use super::session::{Done, Session};
use crate::source::v4l::live::Tally;

impl Session<'_> {
    /// Tells of the newest pair.
    pub(super) fn show(&self, tally: &Tally) {
        let Some(done) = self.done.last() else { return };
        let good = self.done.iter().filter(|done| done.result.is_ok()).count();
        let bad = self.done.len() - good;
        let (ms, dropped) = (done.latency.as_millis(), tally.dropped);
        let made = self.made();
        self.bar.set_message(format!("{good} {made}, {bad} refused, {dropped} pairs dropped, last {ms} ms"));
        self.bar.tick();
        if !self.args.json && !self.args.only_record {
            let line = match &done.result {
                Ok(success) => {
                    let warnings = match success.warnings.as_slice() {
                        [] => String::new(),
                        all => format!(", warning: {}", all.join("; ")),
                    };
                    format!("{}  {}, {ms} ms{warnings}\n", done.name, success.size)
                }
                Err(refusal) => format!("{}  refused: {refusal}\n", done.name),
            };
            // That nobody reads on is no reason to end.
            let _ = self.bar.suspend(|| say(&line));
        }
    }

    /// What becomes of a pair that is not refused.
    fn made(&self) -> &'static str {
        match (self.args.only_record, self.args.best) {
            (true, _) => "recorded",
            (false, true) => "good",
            (false, false) => "models",
        }
    }

    pub(super) fn tell(&self, line: &str) {
        self.bar.suspend(|| note(line));
    }

    pub(super) fn as_text(&self, tally: &Tally, best: Option<&(String, Model)>) -> String {
        let mut table = Table::new("capture");
        let good = self.done.iter().filter(|done| done.result.is_ok()).count();
        table.row("pairs", &format!("{}: {good} {}", self.done.len(), self.made()));
        let mut latencies: Vec<Duration> = self.done.iter().map(|done| done.latency).collect();
        latencies.sort();
        if let (Some(middle), Some(most)) = (latencies.get(latencies.len() / 2), latencies.last()) {
            table.row("latency", &format!("{} ms, at most {}", middle.as_millis(), most.as_millis()));
        }
        let losses = tally.losses;
        for (what, number) in [
            ("dropped", count(tally.dropped as usize, "pair", "pairs")),
            ("unpaired", count(losses.unpaired as usize, "frame", "frames")),
            ("unreadable", count(tally.unreadable as usize, "frame", "frames")),
            ("damaged", count(tally.damaged as usize, "frame", "frames")),
            ("broken", count(losses.broken as usize, "frame", "frames")),
            ("stalled", count(losses.stalls as usize, "time", "times")),
            ("came back", count(losses.returns as usize, "time", "times")),
        ] {
            if !number.starts_with("0 ") {
                table.row(what, &number);
            }
        }
        let gaps = self.done.iter().filter_map(|done| done.gap).map(f64::abs);
        if let Some(most) = gaps.reduce(f64::max) {
            table.row("apart", &format!("left and right at most {:.1} ms", 1e3 * most));
        }
        if let Some(recording) = &self.args.record {
            table.row("recording", &recording.display().to_string());
        }
        if let Some((name, model)) = best {
            table.row("best", name);
            model.tell(&mut table);
            model.warnings.iter().for_each(|warning| table.warning(warning));
        }
        if let Some(out) = self.args.out.as_ref().filter(|_| good > 0 && !self.args.only_record) {
            table.row("files", &shown(out));
        }
        table.text().to_owned()
    }

    pub(super) fn as_json(
        &self,
        tally: &Tally,
        best: Option<&(String, Model)>,
        failure: Option<&Failure>,
    ) -> Value {
        let ms = |time: Duration| (time.as_secs_f64() * 1e6).round() / 1e3;
        let pair = |done: &Done| {
            let (warnings, error) = match &done.result {
                Ok(success) => (Some(&success.warnings), None),
                Err(refusal) => (None, Some(refusal)),
            };
            json!({
                "name": done.name,
                "warnings": warnings,
                "error": error,
                "latency_ms": ms(done.latency),
                "gap_ms": done.gap.map(|gap| (gap * 1e6).round() / 1e3),
            })
        };
        let losses = tally.losses;
        json!({
            "pairs": self.done.iter().map(pair).collect::<Vec<_>>(),
            "folder": self.args.out.as_deref().map(shown),
            "recording": self.args.record.as_deref().map(shown),
            "best": best.map(|(name, model)| json!({ "name": name, "report": model.report })),
            "dropped_pairs": tally.dropped,
            "unpaired_frames": losses.unpaired,
            "unreadable_frames": tally.unreadable,
            "damaged_frames": tally.damaged,
            "broken_frames": losses.broken,
            "stalls": losses.stalls,
            "returns": losses.returns,
            "error": failure.map(|failure| words_of(&**failure)),
        })
    }
}
