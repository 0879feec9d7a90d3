//! What live boards publish (`host listen --publish`, `host capture --publish`): kept in files, or shown on a page.
//!
//! KEY is ossature/SITE/BOARD, each of which may be *: every board unless something else is said. --out keeps what
//! comes in DIR/SITE/BOARD/RUN, a folder a pair in it: model.ply, shape.bin and pair.json. A run is one start of whoever
//! publishes. --view shows shapes of devices on a page in the browser, grown here, the newest that has come.
//!
//! Messages are numbered. What is missing is told by name, board, what and which numbers, and counted at the end;
//! what was sent before this began, or by a run before, is not missing. Whoever publishes waits for this program while
//! its 64 places for messages are full. With --newest nobody waits, and the oldest of 16 are lost; --view without --out
//! does the same.
//!
//! Everybody meets at a router: `host fleet router`, or whoever is given --listen-at. docs/fleet.md tells more. Needs a
//! build with `--features fleet`.
//!
//! Examples:
//!   host subscribe --out models
//!   host subscribe 'ossature/lab/*' --view
//!   host subscribe --listen-at tcp/127.0.0.1:7447 --models 100 --out models --json

mod keep;
mod look;

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use super::options::GrowArgs;
use super::publish::MeetingArgs;
use super::table::{Table, count};
use super::view::ViewArgs;
use super::{Failure, interruption, note, say, say_json_line};
use crate::fleet::key::{Board, Leaf};
use crate::fleet::ledger::{Gap, Ledger};
use crate::fleet::{ANSWER, BOARDS, Link, Message, Pressure, printable};
use look::Looker;

/// Longest that is waited for a message before time is looked at.
const LOOK: Duration = Duration::from_millis(100);
/// Longest that what has arrived is taken after the end.
const REST: Duration = Duration::from_secs(2);

/// Arguments of `subscribe`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The boards
    #[arg(value_name = "KEY", default_value = "ossature/*/*")]
    boards: Board,
    /// Folder for what comes
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    view: ViewArgs,
    #[command(flatten)]
    grow: GrowArgs,
    /// Lose what this program is too slow for, instead of having boards wait
    #[arg(long)]
    newest: bool,
    /// Stop after so many models
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    models: Option<u64>,
    /// Stop after so many seconds
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    seconds: Option<u32>,
    /// Print lines of JSON instead of text
    #[arg(long)]
    pub(super) json: bool,
    #[command(flatten)]
    meeting: MeetingArgs,
}

/// Subscribes until enough has come.
///
/// # Errors
///
/// If the fleet cannot be met, nothing comes, or what comes cannot be written.
pub fn run(args: &Args) -> Result<(), Failure> {
    let link = Link::open(&args.meeting.meeting())?;
    let only_shown = args.view.is_wanted() && args.out.is_none();
    let pressure = if args.newest || only_shown { Pressure::Newest } else { Pressure::Wait };
    let subscriber = link.subscribe(&args.boards, pressure)?;
    let mut desk = Desk {
        args,
        looker: Looker::open(&args.view, &args.boards, args.grow.device_options())?,
        boards: BTreeSet::new(),
        is_full: false,
        ledger: Ledger::default(),
        models: 0,
    };
    // Whoever waits for this program to be there can go on.
    if args.json {
        say_json_line(&json!({ "subscribed": args.boards.to_string() }))?;
    } else {
        note(&format!("hearing {}, until Ctrl-C", args.boards));
    }
    // What boards said before this was there.
    let mut question = Question::new(&link, &args.boards);
    question.ask();
    let end = args.seconds.map(|seconds| Instant::now() + Duration::from_secs(seconds.into()));
    let stop = interruption()?;
    let is_over = |models| {
        args.models.is_some_and(|most| models >= most)
            || stop.load(Ordering::Relaxed)
            || end.is_some_and(|end| Instant::now() >= end)
    };
    while !is_over(desk.models) {
        desk.hear(subscriber.next(LOOK)?, &mut question)?;
        while let Some(message) = question.answer() {
            desk.take(&message)?;
        }
    }
    // What has arrived is not thrown away, unless it would be more than was asked for.
    let end = Instant::now() + REST;
    while args.models.is_none_or(|most| desk.models < most) && Instant::now() < end {
        let Some(message) = subscriber.next(Duration::from_millis(1))? else { break };
        desk.hear(Some(message), &mut question)?;
    }
    desk.close()
}

/// What boards are asked aside, so that messages are taken meanwhile.
struct Question<'a> {
    link: &'a Link,
    boards: &'a Board,
    /// When it was asked last.
    asked: Option<Instant>,
    answers: (Sender<Message>, Receiver<Message>),
}

impl<'a> Question<'a> {
    fn new(link: &'a Link, boards: &'a Board) -> Self {
        Self { link, boards, asked: None, answers: channel() }
    }

    /// What do the pixels of your shapes mean? Not while an answer may still come.
    fn ask(&mut self) {
        if self.asked.is_some_and(|asked| asked.elapsed() < 2 * ANSWER) {
            return;
        }
        self.asked = Some(Instant::now());
        let (link, boards, answers) = (self.link.clone(), self.boards.clone(), self.answers.0.clone());
        // A link that failed is told where messages are taken, and what has no answer is asked again.
        thread::spawn(move || {
            let last = link.last(&boards, Leaf::Calibration).unwrap_or_default();
            // Who asked may be gone.
            last.into_iter().flatten().for_each(|message| drop(answers.send(message)));
        });
    }

    /// An answer that has come.
    fn answer(&self) -> Option<Message> {
        self.answers.1.try_recv().ok()
    }
}

/// Where messages become files, pictures and words.
struct Desk<'a> {
    args: &'a Args,
    looker: Option<Looker>,
    /// Those that something came from.
    boards: BTreeSet<Board>,
    /// Whether something came from more than there is room for.
    is_full: bool,
    ledger: Ledger,
    models: u64,
}

impl Desk<'_> {
    /// What has come, if anything has. A shape whose pixels have no meaning yet makes a question.
    fn hear(
        &mut self,
        came: Option<Result<Message, String>>,
        question: &mut Question<'_>,
    ) -> Result<(), Failure> {
        let message = match came {
            None => return Ok(()),
            Some(Err(why)) => {
                note(&printable(&why));
                return Ok(());
            }
            Some(Ok(message)) => message,
        };
        if self.boards.len() >= BOARDS && !self.boards.contains(&message.board) {
            if !self.is_full {
                note(&format!("warning: more than {BOARDS} boards send; name fewer with KEY"));
            }
            self.is_full = true;
            return Ok(());
        }
        self.boards.insert(message.board.clone());
        if !self.count(&message)? {
            question.ask();
        }
        Ok(())
    }

    /// A message in its place; returns as [`Self::take`].
    fn count(&mut self, message: &Message) -> Result<bool, Failure> {
        let Message { board, leaf, envelope, bytes } = message;
        let gap = self.ledger.came(board, *leaf, &envelope.run, envelope.number);
        gap.map_or(Ok(()), |gap| self.missed(&gap))?;
        if *leaf == Leaf::Status {
            // What is no JSON says nothing of what was sent.
            let status: Value = serde_json::from_slice(bytes).unwrap_or_default();
            for leaf in Leaf::ALL {
                if let Some(sent) = status["sent"][leaf.name()].as_u64()
                    && let Some(gap) = self.ledger.sent(board, leaf, &envelope.run, sent)
                {
                    self.missed(&gap)?;
                }
            }
        }
        self.take(message)
    }

    /// Keeps and shows a message; returns whether all is known that is needed for it.
    fn take(&mut self, message: &Message) -> Result<bool, Failure> {
        if let Some(out) = &self.args.out {
            keep::keep(out, message)?;
        }
        let is_known = match &mut self.looker {
            Some(looker) => looker.see(message, self.ledger.lost())?,
            None => true,
        };
        if message.leaf == Leaf::Pair {
            self.tell(message)?;
        }
        Ok(is_known)
    }

    /// What became of a pair, which is the last that is sent about it.
    fn tell(&mut self, message: &Message) -> Result<(), Failure> {
        let Message { board, envelope, bytes, .. } = message;
        let told: Value = serde_json::from_slice(bytes).unwrap_or_default();
        let error = told["error"].as_str();
        self.models += u64::from(error.is_none());
        if self.args.json {
            return say_json_line(&json!({
                "board": board.to_string(), "run": envelope.run, "pair": envelope.pair, "told": told,
            }));
        }
        let became = error.map_or_else(|| "a model".into(), |why| format!("refused: {}", printable(why)));
        say(&format!("{board}: pair {}: {became}\n", envelope.pair))
    }

    fn missed(&self, gap: &Gap) -> Result<(), Failure> {
        note(&format!("warning: {gap}"));
        if !self.args.json {
            return Ok(());
        }
        let key = gap.board.key(gap.leaf);
        say_json_line(&json!({ "lost": { "key": key, "first": gap.first, "last": gap.last } }))
    }

    /// Tells what came.
    fn close(self) -> Result<(), Failure> {
        let (ledger, json) = (&self.ledger, self.args.json);
        if json {
            let keys = ledger.counts().map(|(board, leaf, count)| {
                (
                    board.key(leaf),
                    json!({ "came": count.came, "lost": count.lost, "repeated": count.repeated }),
                )
            });
            say_json_line(&json!({
                "keys": keys.collect::<serde_json::Map<_, _>>(), "models": self.models, "lost": ledger.lost(),
            }))?;
        } else {
            let mut table = Table::new(&self.args.boards.to_string());
            for (board, _, told) in ledger.counts().filter(|(_, leaf, _)| *leaf == Leaf::Model) {
                let models = count(usize::try_from(told.came).unwrap_or(usize::MAX), "model", "models");
                table.row(&format!("{}/{}", board.site(), board.name()), &models);
            }
            for (board, leaf, told) in ledger.counts().filter(|(_, _, count)| count.lost > 0) {
                let lost = count(usize::try_from(told.lost).unwrap_or(usize::MAX), "message", "messages");
                table.warning(&format!("{}: {lost} lost", board.key(leaf)));
            }
            say(table.text())?;
        }
        if ledger.counts().all(|(_, _, count)| count.came == 0) {
            return Err(format!(
                "nothing came under {}; `host fleet` lists the boards that are there",
                self.args.boards
            )
            .into());
        }
        Ok(())
    }
}
