//! What came of each key, and what did not.
//!
//! * **In**: the numbers of messages as they come, and those that a board says it has sent. **Out**: gaps.
//! * What was sent before the first that came is no loss, nor is a publisher that begins a new run. Runs may
//!   take turns: two programs of one name have numbers of their own. A number that is not beyond those that came is
//!   counted as a repetition.

use std::collections::{BTreeMap, VecDeque};
use std::fmt;

use super::key::{Board, Leaf};

/// Runs of a key whose numbers are known: the last that began.
const RUNS: usize = 4;

/// Messages that never came.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Gap {
    /// Whose.
    pub board: Board,
    /// Which key's.
    pub leaf: Leaf,
    /// The first number.
    pub first: u64,
    /// The last number.
    pub last: u64,
}

impl Gap {
    /// How many.
    #[must_use]
    pub const fn count(&self) -> u64 {
        (self.last - self.first).saturating_add(1)
    }
}

impl fmt::Display for Gap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (key, Self { first, last, .. }) = (self.board.key(self.leaf), self);
        match self.count() {
            1 => write!(f, "{key}: message {first} is lost"),
            count => write!(f, "{key}: {count} messages are lost, {first} to {last}"),
        }
    }
}

/// What came under a key.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Count {
    /// Of each run the number after the last that came, or is given up.
    runs: VecDeque<(String, u64)>,
    /// Messages that came.
    pub came: u64,
    /// Messages that are lost.
    pub lost: u64,
    /// Messages that came again.
    pub repeated: u64,
}

impl Count {
    /// What a run is expected to send next, if this number is the first that is known of it.
    fn next(&mut self, run: &str, number: u64) -> &mut u64 {
        let place = self.runs.iter().position(|(known, _)| known == run).unwrap_or_else(|| {
            // The first run may have begun before this end was there; one after it begins at 0.
            let first = if self.runs.is_empty() { number } else { 0 };
            if self.runs.len() == RUNS {
                self.runs.pop_front();
            }
            self.runs.push_back((run.to_owned(), first));
            self.runs.len() - 1
        });
        &mut self.runs[place].1
    }
}

/// The counts of all keys.
#[derive(Clone, Debug, Default)]
pub struct Ledger(BTreeMap<(Board, Leaf), Count>);

impl Ledger {
    /// A message came; returns what is missing before it.
    pub fn came(&mut self, board: &Board, leaf: Leaf, run: &str, number: u64) -> Option<Gap> {
        let gap = self.reach(board, leaf, run, number);
        let count = self.0.entry((board.clone(), leaf)).or_default();
        let next = count.next(run, number);
        if number < *next {
            count.repeated += 1;
        } else {
            *next = number.saturating_add(1);
            count.came += 1;
        }
        gap
    }

    /// A board says, after all that it sent under a key, how many messages these were; returns what is missing of them.
    pub fn sent(&mut self, board: &Board, leaf: Leaf, run: &str, sent: u64) -> Option<Gap> {
        self.reach(board, leaf, run, sent)
    }

    /// Whatever is before this number of a run came or is lost.
    fn reach(&mut self, board: &Board, leaf: Leaf, run: &str, number: u64) -> Option<Gap> {
        let count = self.0.entry((board.clone(), leaf)).or_default();
        let next = count.next(run, number);
        let first = *next;
        if number <= first {
            return None;
        }
        *next = number;
        let gap = Gap { board: board.clone(), leaf, first, last: number - 1 };
        count.lost = count.lost.saturating_add(gap.count());
        Some(gap)
    }

    /// Everything that came or did not.
    pub fn counts(&self) -> impl Iterator<Item = (&Board, Leaf, &Count)> {
        self.0.iter().map(|((board, leaf), count)| (board, *leaf, count))
    }

    /// Messages that are lost.
    #[must_use]
    pub fn lost(&self) -> u64 {
        self.0.values().fold(0, |sum, count| sum.saturating_add(count.lost))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    fn board(name: &str) -> Board {
        Board::one(&format!("ossature/lab/{name}")).unwrap()
    }

    #[test]
    fn gaps_are_named_and_new_runs_are_none() {
        let (mut ledger, left) = (Ledger::default(), board("left"));
        let mut came =
            |run: &str, number| ledger.came(&left, Leaf::Model, run, number).map(|gap| gap.to_string());
        // Who comes late has lost nothing.
        assert_eq!([came("a", 7), came("a", 8)], [None, None]);
        assert_eq!(came("a", 10).unwrap(), "ossature/lab/left/model: message 9 is lost");
        assert_eq!(came("a", 10), None);
        assert_eq!(came("a", 14).unwrap(), "ossature/lab/left/model: 3 messages are lost, 11 to 13");
        assert_eq!(came("b", 0), None);
        assert_eq!(came("c", 2).unwrap(), "ossature/lab/left/model: 2 messages are lost, 0 to 1");
        // The last ones of a run are missed by what is said to be sent, once.
        let gap = ledger.sent(&left, Leaf::Model, "c", 5).unwrap();
        assert_eq!((gap.first, gap.last), (3, 4));
        assert_eq!(ledger.sent(&left, Leaf::Model, "c", 5), None);
        assert_eq!(ledger.sent(&left, Leaf::Shape, "c", 5), None);
        let (_, _, count) = ledger.counts().find(|(_, leaf, _)| *leaf == Leaf::Model).unwrap();
        assert_eq!((count.came, count.lost, count.repeated), (6, 8, 1));
        assert_eq!(ledger.lost(), 8);
        assert!(ledger.came(&left, Leaf::Model, "c", u64::MAX).is_some());
        assert_eq!(ledger.came(&left, Leaf::Model, "c", u64::MAX), None);
    }

    #[test]
    fn two_of_one_name_are_no_loss_of_each_other() {
        let (mut ledger, left) = (Ledger::default(), board("left"));
        for number in 0..100 {
            for run in ["a", "b"] {
                assert_eq!(ledger.came(&left, Leaf::Model, run, number), None);
            }
        }
        assert_eq!(ledger.came(&left, Leaf::Model, "a", 101).unwrap().count(), 1);
        assert_eq!(ledger.lost(), 1);
    }

    #[test]
    fn what_is_taken_out_is_what_is_missed() {
        let mut random = Random::new(1);
        let (mut ledger, boards) = (Ledger::default(), [board("left"), board("right")]);
        let (mut taken, mut missed) = (0, 0);
        for number in 0..1000 {
            for board in &boards {
                if number > 0 && random.uniform() < 0.3 {
                    taken += 1;
                } else if let Some(gap) = ledger.came(board, Leaf::Shape, "a", number) {
                    missed += gap.count();
                }
            }
        }
        missed += boards
            .iter()
            .filter_map(|board| ledger.sent(board, Leaf::Shape, "a", 1000))
            .map(|gap| gap.count())
            .sum::<u64>();
        assert_eq!((missed, ledger.lost()), (taken, taken));
    }
}
