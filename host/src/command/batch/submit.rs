//! Pairs into a queue.

use std::io::IsTerminal;
use std::path::Path;
use std::time::Duration;

use indicatif::ProgressBar;
use serde_json::json;

use super::super::table::{Table, count};
use super::super::{Everywhere, Failure, note, replay, say, say_json};
use super::SubmitArgs;
use super::recipe::{Recipe, words};
use crate::batch::job::Job;
use crate::batch::queue::Queue;
use crate::batch::record::Submitted;

/// Queues every pair of a folder.
pub(super) fn run(args: &SubmitArgs, everywhere: &Everywhere, json: bool) -> Result<(), Failure> {
    let (folder, name) = (args.batch.folder()?, args.batch.name()?);
    let how = words(&args.how, folder, everywhere)?;
    // Results go where a worker puts them.
    let recipe = Recipe::read(&how, folder, Path::new("out"))?;
    let found = replay::pairs(&recipe.args)?;
    for image in &found.alone {
        note(&format!("warning: {} has no partner", image.display()));
    }
    let patience = Duration::from_secs(args.lost_after);
    let queue = Queue::create(&args.batch.server(), &name, patience)?;
    let bar = if std::io::stderr().is_terminal() {
        ProgressBar::new(found.pairs.len() as u64)
    } else {
        ProgressBar::hidden()
    };
    let mut unread = None;
    let jobs = found.pairs.iter().map_while(|pair| {
        let outside = || format!("{}: its files' names are no text; rename them", pair.name);
        let job = Job::new(pair, folder, &how).ok_or_else(outside);
        let known = job.and_then(|job| {
            let id = job.id(folder, &recipe.sum).map_err(|error| error.to_string())?;
            Ok((id, job))
        });
        known.map_err(|words| unread = Some(words)).ok()
    });
    let [mut queued, mut waited, mut done] = [0usize; 3];
    queue.submit(jobs, |submitted| {
        bar.inc(1);
        *match submitted {
            Submitted::Queued => &mut queued,
            Submitted::Waits => &mut waited,
            Submitted::Done => &mut done,
        } += 1;
    })?;
    bar.finish_and_clear();
    if let Some(words) = unread {
        return Err(format!("{words}; the pairs before it are queued").into());
    }
    if json {
        let alone: Vec<String> = found.alone.iter().map(|path| path.display().to_string()).collect();
        return say_json(&json!({
            "batch": name,
            "queued": queued,
            "waited_already": waited,
            "done_before": done,
            "without_partner": alone,
        }));
    }
    let mut table = Table::new(&name);
    table.row("queued", &count(queued, "pair", "pairs"));
    for (row, number) in [("waited", waited), ("done before", done)] {
        if number > 0 {
            table.row(row, &count(number, "pair", "pairs"));
        }
    }
    say(table.text())
}
