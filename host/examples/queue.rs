//! The queue of `host batch`, simulated: `cargo run --release -p host --example queue [-- --pairs 1000000]`.
//!
//! Workers take a pair each, make it, and settle it; for both they wait in one line for the server. Machines fail, and
//! what they were at is taken again when the server's patience is over. For docs/scale.md, which says where the
//! figures come from. Assumed: pairs take a lognormal time; failures come at random (exponential), hit one pair at
//! work, and the machine is replaced at once; the server has one line and takes the same time for every pair; the network
//! takes none. The same seed gives the same table.

use clap::Parser;
use host::random::Random;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

#[derive(Parser)]
struct Args {
    /// Pairs in the queue.
    #[arg(long, default_value_t = 1_000_000)]
    pairs: u64,
    /// Threads that make pairs.
    #[arg(long, value_delimiter = ',', default_value = "2,8,16,32,80,800")]
    threads: Vec<u64>,
    /// Mean time of a pair on one thread, ms.
    #[arg(long, default_value_t = 20.0)]
    pair_ms: f64,
    /// Its deviation, as a share of the mean.
    #[arg(long, default_value_t = 0.5)]
    spread: f64,
    /// The server's time for a pair, us.
    #[arg(long, default_value_t = 1020.0)]
    server_us: f64,
    /// Hours between failures of one thread.
    #[arg(long, default_value_t = 100.0)]
    failure_h: f64,
    /// Seconds after which what a failed one was at is taken again.
    #[arg(long, default_value_t = 30.0)]
    patience_s: f64,
    /// What is drawn from.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// What happens to a thread, or to a pair that was lost with one.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Event {
    /// A thread has nothing to do.
    Idle,
    /// It has made a pair.
    Made,
    /// It failed; the pair comes back later.
    Failed,
    /// A lost pair is there again.
    Back,
}

/// What came of it.
#[derive(Debug, PartialEq)]
struct Run {
    hours: f64,
    /// Share of the threads' time that went into pairs that count.
    busy: f64,
    /// Share of the time that the server had something to do.
    server: f64,
    /// Pairs that were begun again.
    again: u64,
}

fn main() {
    let args = Args::parse();
    println!(
        "{:>8} {:>10} {:>10} {:>9} {:>9} {:>8}",
        "threads", "hours", "pairs/s", "at work", "server", "again"
    );
    for &threads in &args.threads {
        let run = simulate(&args, threads);
        let rate = args.pairs as f64 / run.hours / 3600.0;
        let [busy, server] = [run.busy, run.server].map(|share| 100.0 * share);
        println!(
            "{threads:>8} {:>10.3} {rate:>10.1} {busy:>7.1} % {server:>7.1} % {:>8}",
            run.hours, run.again
        );
    }
}

/// Microseconds as an integer: events at one time come in a fixed order.
fn simulate(args: &Args, threads: u64) -> Run {
    let mut random = Random::new(args.seed);
    let server_us = args.server_us / 2.0;
    // A lognormal with this mean and deviation.
    let sigma = (1.0 + args.spread * args.spread).ln().sqrt();
    let mu = (args.pair_ms * 1e3).ln() - sigma * sigma / 2.0;
    let mut draw_pair = {
        let mut random = Random::new(args.seed ^ 0x5eed);
        move || (mu + sigma * random.normal()).exp()
    };
    let mut events = BinaryHeap::new();
    (0..threads).for_each(|thread| events.push(Reverse((0u64, Event::Idle, thread))));
    let (mut waiting, mut settled, mut lost, mut again) = (args.pairs, 0, 0u64, 0);
    let (mut server_free, mut server_busy, mut useful, mut end) = (0.0f64, 0.0, 0.0, 0.0f64);
    let mut idle = Vec::new();
    let mut took = vec![0.0; threads as usize];
    while let Some(Reverse((now, event, thread))) = events.pop() {
        let mut ask = |now: u64| {
            server_free = server_free.max(now as f64) + server_us;
            server_busy += server_us;
            server_free
        };
        match event {
            Event::Idle if waiting == 0 => idle.push(thread),
            Event::Idle => {
                waiting -= 1;
                let begin = ask(now);
                let time = draw_pair();
                took[thread as usize] = time;
                let life = -(1.0 - random.uniform()).ln() * args.failure_h * 3600e6;
                let (end, event) = if life < time { (life, Event::Failed) } else { (time, Event::Made) };
                events.push(Reverse(((begin + end) as u64, event, thread)));
            }
            Event::Made => {
                let at = ask(now);
                settled += 1;
                useful += took[thread as usize];
                end = end.max(at);
                events.push(Reverse((at as u64, Event::Idle, thread)));
            }
            Event::Failed => {
                lost += 1;
                again += 1;
                events.push(Reverse((now + (args.patience_s * 1e6) as u64, Event::Back, thread)));
                events.push(Reverse((now, Event::Idle, thread)));
            }
            Event::Back => {
                lost -= 1;
                waiting += 1;
                if let Some(thread) = idle.pop() {
                    events.push(Reverse((now, Event::Idle, thread)));
                }
            }
        }
    }
    assert_eq!((settled, waiting, lost), (args.pairs, 0, 0), "no pair is lost, none made twice");
    let busy = useful / (end * threads as f64);
    Run { hours: end / 3600e6, busy, server: server_busy / end, again }
}
