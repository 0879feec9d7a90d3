//! Whether a process grows.

use std::fs;

/// Growth that is none, of a part.
const FLAT: f64 = 0.01;
/// Looks without which nothing is said.
const LEAST: usize = 40;

/// What a process took, time after time, kB.
pub(crate) struct Memory {
    id: u32,
    taken: Vec<u64>,
}

impl Memory {
    /// That of a process, not looked at yet.
    pub(crate) fn of(id: u32) -> Self {
        Self { id, taken: Vec::new() }
    }

    /// Look at what it has of its own, files that are mapped left out.
    pub(crate) fn look(&mut self) {
        self.taken.push(status(self.id, "RssAnon:"));
    }

    /// Tells how it went, and panics if it grew from the third quarter of all looks to the last.
    pub(crate) fn judge(&self) {
        let (taken, count) = (&self.taken, self.taken.len());
        let peak = status(self.id, "VmHWM:");
        if count < LEAST {
            println!("memory: {taken:?} kB, peak {peak} kB; too few looks to be judged");
            return;
        }
        let mean = |quarter: &[u64]| quarter.iter().sum::<u64>() as f64 / quarter.len() as f64;
        let [third, last] = [mean(&taken[count / 2..count * 3 / 4]), mean(&taken[count * 3 / 4..])];
        let growth = last / third - 1.0;
        println!(
            "memory: {:.0} kB in the first quarter, {third:.0} in the third, {last:.0} in the last ({:+.2} %), \
             peak {peak}",
            mean(&taken[..count / 4]),
            100.0 * growth
        );
        assert!(growth < FLAT, "it grows: {taken:?} kB");
    }
}

/// What Linux says of a process, kB.
fn status(id: u32, what: &str) -> u64 {
    let status = fs::read_to_string(format!("/proc/{id}/status")).expect("it lives, on Linux");
    let line = status.lines().find_map(|line| line.strip_prefix(what)).expect("Linux says so");
    line.trim().trim_end_matches(" kB").parse().expect("a number")
}
