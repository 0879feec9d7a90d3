//! What came of each key, and what did not.
//!
//! * **In**: the numbers of messages as they come, and those that a board says it has sent. **Out**: gaps.
//! * What was sent before the first that came is no loss, nor is a publisher that begins a new run. A number that is
//!   not beyond those that came is counted as a repetition.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::fmt;

use super::key::{Board, Leaf};

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
    run: String,
    /// The number after the last that came, or is given up.
    next: u64,
    /// Messages that came.
    pub came: u64,
    /// Messages that are lost.
    pub lost: u64,
    /// Messages that came again.
    pub repeated: u64,
}

/// The counts of all keys.
#[derive(Clone, Debug, Default)]
pub struct Ledger(BTreeMap<(Board, Leaf), Count>);

impl Ledger {
    /// A message came; returns what is missing before it.
    pub fn came(&mut self, board: &Board, leaf: Leaf, run: &str, number: u64) -> Option<Gap> {
        let gap = self.reach(board, leaf, run, number);
        let count = self.0.entry((board.clone(), leaf)).or_default();
        if number < count.next {
            count.repeated += 1;
        } else {
            count.came += 1;
            count.next = number.saturating_add(1);
        }
        gap
    }

    /// A board says, after all that it sent under a key, how many messages these were; returns what is missing of them.
    pub fn sent(&mut self, board: &Board, leaf: Leaf, run: &str, sent: u64) -> Option<Gap> {
        self.reach(board, leaf, run, sent)
    }

    /// Whatever is before this number of a run came or is lost.
    fn reach(&mut self, board: &Board, leaf: Leaf, run: &str, number: u64) -> Option<Gap> {
        let count = match self.0.entry((board.clone(), leaf)) {
            Entry::Vacant(place) => {
                place.insert(Count { run: run.to_owned(), next: number, ..Count::default() });
                return None;
            }
            Entry::Occupied(place) => place.into_mut(),
        };
        if count.run != run {
            // A new run begins at 0, and this end was there before it.
            (count.run, count.next) = (run.to_owned(), 0);
        }
        let first = count.next;
        if number <= first {
            return None;
        }
        count.next = number;
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
        let (_, _, count) = ledger.counts().next().unwrap();
        assert_eq!((count.came, count.lost, count.repeated), (6, 8, 1));
        assert_eq!(ledger.lost(), 8);
        assert!(ledger.came(&left, Leaf::Model, "c", u64::MAX).is_some());
        assert_eq!(ledger.came(&left, Leaf::Model, "c", u64::MAX), None);
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
