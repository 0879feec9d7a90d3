//! The boards that answered, and what they said last.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::command::table::Table;
use crate::fleet::key::Board;
use crate::fleet::{BOARDS, Message, printable};

/// Silence after which a board that publishes is told to be silent.
const SILENT: f64 = 30.0;

/// What a board said last.
struct Entry {
    run: String,
    status: Value,
    /// When it came, and how long before the board itself had been heard.
    came: Instant,
    heard: Duration,
    /// Whether it answered when all were asked last.
    answers: bool,
}

/// All that ever answered.
#[derive(Default)]
pub(super) struct Roster(BTreeMap<Board, Entry>);

impl Roster {
    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// All boards were asked, and these answered; returns whether there was room for all of them.
    pub(super) fn answered(&mut self, messages: Vec<Message>) -> bool {
        let mut fits = true;
        self.0.values_mut().for_each(|entry| entry.answers = false);
        for Message { board, envelope, bytes, .. } in messages {
            if self.0.len() >= BOARDS && !self.0.contains_key(&board) {
                fits = false;
                continue;
            }
            let status: Value = serde_json::from_slice(&bytes).unwrap_or_default();
            let heard = status["heard_ms"].as_u64().unwrap_or(0).saturating_add(envelope.age_ms.unwrap_or(0));
            let (came, heard) = (Instant::now(), Duration::from_millis(heard));
            self.0.insert(board, Entry { run: envelope.run, status, came, heard, answers: true });
        }
        fits
    }

    pub(super) fn as_json(&self) -> Value {
        let boards = self.0.iter().map(|(board, entry)| {
            let Entry { run, status, answers, .. } = entry;
            json!({
                "board": board.to_string(),
                "answers": answers,
                "last_seen_s": entry.last_seen(),
                "firmware": entry.firmware(),
                "run": run,
                "status": status,
            })
        });
        json!({ "boards": boards.collect::<Vec<_>>() })
    }

    pub(super) fn as_text(&self) -> String {
        self.0.iter().map(|(board, entry)| entry.as_text(board)).collect()
    }
}

impl Entry {
    /// How long ago the board itself was heard, s.
    fn last_seen(&self) -> f64 {
        (self.heard + self.came.elapsed()).as_secs_f64()
    }

    fn firmware(&self) -> Option<&str> {
        self.status["about"]["firmware"].as_str()
    }

    fn as_text(&self, board: &Board) -> String {
        let (mut table, status) = (Table::new(&board.to_string()), &self.status);
        let about = &status["about"];
        match (self.firmware(), about["board"].as_str(), about["camera"].as_str()) {
            (Some(firmware), Some(name), _) => {
                table.row("firmware", &printable(&format!("{firmware} of {name}")));
            }
            (_, _, Some(camera)) => table.row("camera", &printable(camera)),
            _ => table.row("firmware", "not known"),
        }
        let rate = status["rate_hz"].as_f64().unwrap_or(0.0);
        table.row("rate", &format!("{rate:.2} pairs a second"));
        let seen = self.last_seen();
        table.row("last seen", &format!("{seen:.1} s ago"));
        let is_paused = status["settings"]["pairs"]["value"] == "0";
        let paused = if is_paused { "; paused: `host fleet order` it pairs all" } else { "" };
        table.row("pairs", &format!("{}, {} with a model{paused}", status["pairs"], status["models"]));
        if !self.answers {
            table.warning("it does not answer any more: look whether its program runs");
        } else if let Some(why) = status["away"].as_str() {
            table.warning(&printable(&format!("the device is gone: {why}")));
        } else if seen > SILENT && !is_paused {
            table.warning("nothing is heard of it; look at its camera and cable");
        }
        for warning in status["warnings"].as_array().into_iter().flatten().filter_map(Value::as_str) {
            table.warning(&printable(warning));
        }
        table.text().to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fleet::envelope::{CONTRACT, Envelope};
    use crate::fleet::key::Leaf;

    #[test]
    fn who_does_not_answer_any_more_is_told() {
        let board = Board::one("ossature/lab/left").unwrap();
        let status = json!({
            "about": { "board": "bench", "firmware": "1.2.3" }, "heard_ms": 1500, "rate_hz": 2.5, "pairs": 7,
            "models": 6, "warnings": ["it is \u{1b}[31mdark"],
        });
        let envelope = Envelope {
            contract: CONTRACT,
            run: "a".into(),
            number: 0,
            pair: 7,
            time_us: 0,
            age_ms: Some(500),
        };
        let bytes = status.to_string().into_bytes();
        let mut roster = Roster::default();
        assert!(roster.answered(vec![Message { board, leaf: Leaf::Status, envelope, bytes }]));
        let text = roster.as_text();
        for words in
            ["1.2.3 of bench", "2.50 pairs a second", "2.0 s ago", "7, 6 with a model", "it is ?[31mdark"]
        {
            assert!(text.contains(words), "{words}: {text}");
        }
        assert!(!text.contains("any more"), "{text}");
        assert!(roster.answered(Vec::new()));
        assert!(roster.as_text().contains("does not answer any more"));
        assert_eq!(roster.as_json()["boards"][0]["answers"], false);
    }
}
