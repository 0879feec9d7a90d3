//! Many jobs on a few threads, each job undisturbed by the others.
//!
//! A thread that waits inside a shared pool takes up another job meanwhile, and the time of that one would
//! count for both. So every worker here has a pool of its own, with an equal share of the threads.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use rayon::{ThreadPoolBuildError, ThreadPoolBuilder};

/// Threads a core that are of any use.
const MOST_A_CORE: usize = 4;

/// Does the jobs 0 to `count`. Results in the order of the jobs.
pub(super) fn run<B: Default + Send, T: Send>(
    count: usize,
    threads: Option<usize>,
    job: &(impl Fn(&mut B, usize) -> T + Sync),
) -> Result<Vec<T>, ThreadPoolBuildError> {
    let next = AtomicUsize::new(0);
    let take = || Some(next.fetch_add(1, Ordering::Relaxed)).filter(|&index| index < count);
    let results = Mutex::new(Vec::with_capacity(count));
    let done = |bench: &mut B, index| {
        let result = job(bench, index);
        // A lock is poisoned only by a panic, which the scope passes on.
        if let Ok(mut results) = results.lock() {
            results.push((index, result));
        }
    };
    work(count, threads, &take, &done)?;
    let mut results = results.into_inner().unwrap_or_default();
    results.sort_by_key(|&(index, _)| index);
    Ok(results.into_iter().map(|(_, result)| result).collect())
}

/// Does each job that `take` gives, at most `side_by_side` at a time, on `threads` threads, by default one a core, at
/// most [`MOST_A_CORE`] a core. Each worker has a bench of its own, which a job finds as the worker's last one left
/// it. A worker waits for its next job outside its pool.
pub(super) fn work<B: Default + Send, J: Send>(
    side_by_side: usize,
    threads: Option<usize>,
    take: &(impl Fn() -> Option<J> + Sync),
    job: &(impl Fn(&mut B, J) + Sync),
) -> Result<(), ThreadPoolBuildError> {
    let cores = thread::available_parallelism().map_or(1, usize::from);
    let threads = threads.unwrap_or_else(rayon::current_num_threads).clamp(1, MOST_A_CORE * cores);
    let workers = threads.min(side_by_side).max(1);
    let pools = (0..workers).map(|worker| {
        let share = threads / workers + usize::from(worker < threads % workers);
        ThreadPoolBuilder::new().num_threads(share).build()
    });
    let pools = pools.collect::<Result<Vec<_>, _>>()?;
    thread::scope(|scope| {
        for pool in &pools {
            scope.spawn(|| {
                let mut bench = B::default();
                while let Some(next) = take() {
                    pool.install(|| job(&mut bench, next));
                }
            });
        }
    });
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_come_in_order_whatever_the_threads() {
        for threads in [None, Some(1), Some(3), Some(8), Some(65_535)] {
            let squares = run(5, threads, &|(): &mut (), index| index * index).unwrap();
            assert_eq!(squares, [0, 1, 4, 9, 16]);
            assert_eq!(run(0, threads, &|(): &mut (), index| index).unwrap(), [0usize; 0]);
            // A bench is one worker's, and each of its jobs finds it as the last one left it.
            let count = |done: &mut usize, _| std::mem::replace(done, *done + 1);
            let firsts = run(20, threads, &count).unwrap().into_iter().filter(|done| *done == 0).count();
            assert!((1..=threads.unwrap_or(20)).contains(&firsts), "{firsts}");
        }
    }
}
