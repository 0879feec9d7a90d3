//! A worker: pairs out of a queue, models into a folder.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use indicatif::ProgressBar;
use serde_json::json;

use super::super::connect::progress;
use super::super::model::NoModel;
use super::super::table::{Table, count};
use super::super::{Failure, crew, interruption, note, replay, say, say_json, words_of};
use super::WorkArgs;
use super::recipe::Recipe;
use crate::batch::job::Job;
use crate::batch::queue::{Queue, Taken};
use crate::batch::record::{Outcome, Record};
use crate::batch::server::QueueError;
use crate::export::ExportError;
use crate::reconstruct::Workspace;
use crate::unfinished::sweep;

/// Longest that is waited for a job, or for a server that is away, before anything else is looked at.
const LOOK: Duration = Duration::from_millis(250);
/// Longest that a pair rests before it is tried again.
const REST: Duration = Duration::from_secs(32);

/// Makes models until none is left.
pub(super) fn run(args: &WorkArgs, json: bool) -> Result<(), Failure> {
    let folder = args.batch.folder()?;
    let queue = Queue::open(&args.batch.server(), &args.batch.name()?)?;
    let worker = Worker {
        args,
        folder,
        queue,
        name: format!("{}/{}", host_name(), std::process::id()),
        stop: interruption()?,
        failure: Mutex::default(),
        turn: Mutex::default(),
        away: AtomicBool::new(false),
        done: Default::default(),
        bar: progress(),
        start: Instant::now(),
    };
    let take = || worker.take();
    let job = |bench: &mut Bench, taken: Taken| worker.settle(bench, &taken);
    crew::work(usize::MAX, args.jobs.map(usize::from), &take, &job)?;
    worker.close(json)
}

/// What a thread has of its own: its memory, and how it made the last pair.
#[derive(Default)]
struct Bench {
    workspace: Workspace,
    recipe: Option<(Vec<String>, Recipe)>,
}

struct Worker<'a> {
    args: &'a WorkArgs,
    folder: &'a Path,
    queue: Queue,
    /// Machine and process.
    name: String,
    stop: Arc<AtomicBool>,
    /// Why it ends before the queue does.
    failure: Mutex<Option<Failure>>,
    /// Whose turn it is to wait for a job: a machine asks once, however many threads it has.
    turn: Mutex<()>,
    /// Whether the server was said to be.
    away: AtomicBool,
    /// Pairs of each outcome.
    done: [AtomicUsize; Outcome::ALL.len()],
    bar: ProgressBar,
    start: Instant,
}

/// Why a pair has no model.
enum Trouble {
    /// It gives none.
    Refused(String),
    /// Something was in the way.
    Failed(String),
    /// This worker cannot go on.
    Broken(Failure),
}

impl From<Failure> for Trouble {
    fn from(failure: Failure) -> Self {
        let plain = replay::plain(&failure);
        if plain.is::<NoModel>() {
            Self::Refused(words_of(&*failure))
        } else if plain.is::<ExportError>() {
            Self::Broken(failure)
        } else {
            Self::Failed(words_of(&*failure))
        }
    }
}

impl Worker<'_> {
    fn is_over(&self) -> bool {
        self.stop.load(Ordering::Relaxed) || self.failure.lock().is_ok_and(|failure| failure.is_some())
    }

    /// Has every thread end when it has done what it is at.
    fn end(&self, failure: Failure) {
        *self.failure.lock().unwrap_or_else(PoisonError::into_inner) = Some(failure);
    }

    /// A line to standard error.
    fn remark(&self, line: &str) {
        self.bar.suspend(|| note(line));
    }

    /// Asks the server until it answers, at least once; None when this worker ends first.
    fn ask<T>(&self, question: impl Fn() -> Result<T, QueueError>) -> Option<T> {
        loop {
            let error = match question() {
                Ok(answer) => {
                    if self.away.swap(false, Ordering::Relaxed) {
                        self.remark("the server is back");
                    }
                    return Some(answer);
                }
                Err(error) => error,
            };
            if let Err(gone @ QueueError::NoBatch { .. }) = self.queue.left() {
                self.end(gone.into());
            } else if !self.away.swap(true, Ordering::Relaxed) {
                self.remark(&format!("{}; waiting for it", words_of(&error)));
            }
            if self.is_over() {
                return None;
            }
            thread::sleep(LOOK);
        }
    }

    /// The next job; None when this worker has no more to do.
    fn take(&self) -> Option<Taken> {
        let _turn = self.turn.lock().unwrap_or_else(PoisonError::into_inner);
        while !self.is_over() {
            let (taken, left) = self.ask(|| {
                let taken = self.queue.take(LOOK)?;
                // What others are at may come back.
                let left = taken.is_some() || self.args.stay || self.queue.left()? > 0;
                Ok((taken, left))
            })?;
            if taken.is_some() || !left {
                return taken;
            }
        }
        None
    }

    /// Does a job, and says so.
    fn settle(&self, bench: &mut Bench, taken: &Taken) {
        let start = Instant::now();
        match self.ask(|| self.queue.is_done(taken.id())) {
            None => return,
            Some(true) => {
                self.ask(|| self.queue.pass(taken));
                return;
            }
            Some(false) => {}
        }
        let job = Job::from_bytes(taken.bytes());
        let name = job.as_ref().map_or_else(|_| taken.id().to_owned(), |job| job.name.clone());
        let job = job.map_err(|error| Trouble::Failed(words_of(&error)));
        let (outcome, reason) = match job.and_then(|job| self.attempt(bench, &job, taken)) {
            Ok(()) => (Outcome::Made, None),
            Err(Trouble::Refused(words)) => (Outcome::Refused, Some(words)),
            Err(Trouble::Failed(words)) if taken.tries < self.args.tries => {
                self.remark(&format!("{name}: {words}; it will be tried again"));
                let rest = REST.min(Duration::from_secs(1 << taken.tries.min(6)));
                self.ask(|| self.queue.give_back(taken, rest));
                return;
            }
            Err(Trouble::Failed(words)) => (Outcome::Aside, Some(words)),
            Err(Trouble::Broken(failure)) => {
                self.end(failure);
                self.ask(|| self.queue.give_back(taken, Duration::ZERO));
                return;
            }
        };
        if let Some(words) = &reason {
            self.remark(&format!("{name}: {words}"));
        }
        let (worker, time_s) = (self.name.clone(), start.elapsed().as_secs_f64());
        let record = Record { name, worker, tries: taken.tries, time_s, reason };
        if self.ask(|| self.queue.settle(taken, outcome, &record)).is_some() {
            self.done[outcome as usize].fetch_add(1, Ordering::Relaxed);
            let [made, refused, aside] = self.counts();
            let rate = (made + refused + aside) as f64 / self.start.elapsed().as_secs_f64().max(1e-3);
            self.bar.set_message(format!(
                "{} by this worker, {rate:.2} pairs a second",
                count(made, "model", "models")
            ));
        }
    }

    /// Makes and writes a model.
    fn attempt(&self, bench: &mut Bench, job: &Job, taken: &Taken) -> Result<(), Trouble> {
        let out = &self.args.out;
        if taken.tries > 1 {
            sweep(&out.join(&job.name));
        }
        if taken.tries > self.args.tries {
            let workers = taken.tries - 1;
            return Err(Trouble::Failed(format!(
                "each of {workers} workers that took it ended without an answer; make it by `host replay`, and look \
                 whether that needs more memory than they have"
            )));
        }
        let recipe = recipe(&mut bench.recipe, &job.how, self.folder, out)?;
        let id = job.id(self.folder, &recipe.sum).map_err(Failure::from)?;
        if id != taken.id() {
            return Err(Trouble::Failed(
                "its files, or this worker's version, are not those that were submitted: submit it again"
                    .into(),
            ));
        }
        let pair = job.pair(self.folder, recipe.args.layout);
        let (how, workspace) = ((&recipe.options, &recipe.scene), &mut bench.workspace);
        let made = catch_unwind(AssertUnwindSafe(|| {
            replay::one(&recipe.args, how, (false, &pair), workspace, None).result
        }));
        match made {
            Ok(result) => result.map(drop).map_err(Trouble::from),
            Err(panic) => {
                *workspace = Workspace::default();
                Err(Trouble::Failed(format!("the program failed: {}", said(&*panic))))
            }
        }
    }

    /// Pairs of each outcome.
    fn counts(&self) -> [usize; Outcome::ALL.len()] {
        self.done.each_ref().map(|count| count.load(Ordering::Relaxed))
    }

    /// Says what was done.
    fn close(self, json: bool) -> Result<(), Failure> {
        self.bar.finish_and_clear();
        let ([made, refused, aside], seconds) = (self.counts(), self.start.elapsed().as_secs_f64());
        if json {
            say_json(&json!({
                "worker": self.name,
                "made": made,
                "refused": refused,
                "set_aside": aside,
                "time_s": seconds,
            }))?;
        } else {
            let mut table = Table::new(&self.name);
            for (row, number) in [("made", made), ("refused", refused), ("set aside", aside)] {
                table.row(row, &count(number, "pair", "pairs"));
            }
            table.row("time", &format!("{seconds:.2} s"));
            say(table.text())?;
        }
        self.failure.into_inner().unwrap_or_else(PoisonError::into_inner).map_or(Ok(()), Err)
    }
}

/// What words mean; the last pair's, which are kept, mean most often the same.
fn recipe<'a>(
    kept: &'a mut Option<(Vec<String>, Recipe)>,
    words: &[String],
    folder: &Path,
    out: &Path,
) -> Result<&'a Recipe, Failure> {
    let known = match kept.take().filter(|(known, _)| known == words) {
        Some(known) => known,
        None => (words.to_vec(), Recipe::read(words, folder, out)?),
    };
    Ok(&kept.insert(known).1)
}

/// What a panic said.
fn said(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("it did not say why")
}

/// This machine's name, as far as it is known.
fn host_name() -> String {
    let of_system = std::fs::read_to_string("/proc/sys/kernel/hostname").ok();
    let name =
        of_system.or_else(|| ["COMPUTERNAME", "HOSTNAME"].iter().find_map(|name| std::env::var(name).ok()));
    name.map_or_else(|| "a machine".into(), |name| name.trim().to_owned())
}
