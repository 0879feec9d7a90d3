//! Live boards (`host listen --publish`, `host capture --publish`): which there are, orders to them, and where they meet.
//!
//! list, which is done if nothing else is said, tells of every board its firmware, its rate, when it was heard last, and
//! what it warns of. With --watch it goes on, and boards that do not answer any more are told as gone.
//!
//! order sets threshold, polarity, exposure or region of boards, in the words of `host listen` and `host capture`, for the
//! next pair on; pairs 1 has them take a single pair and then wait, pairs 0 has them wait, and pairs all go on.
//!
//! router is where everybody meets, by default at tcp/127.0.0.1:7447, which is this machine alone; zenohd is another.
//! docs/fleet.md says how to let in other machines, and nobody else. Needs a build with `--features fleet`.
//!
//! Examples:
//!   host fleet router
//!   host fleet
//!   host fleet order ossature/lab/left threshold 120
//!   host fleet order 'ossature/lab/*' pairs 1
//!   host fleet list --watch --zenoh-config lab.json5

mod roster;

use std::sync::atomic::Ordering;
use std::thread;
use std::time::{Duration, Instant};

use clap::builder::PossibleValuesParser;
use serde_json::{Map, Value, json};

use super::options::usage;
use super::publish::MeetingArgs;
use super::table::count;
use super::{Failure, interruption, note, say, say_json, say_json_line};
use crate::fleet::key::{Board, Leaf};
use crate::fleet::{BOARDS, Link, MEETING_PLACE, Meeting, printable};
use roster::Roster;

/// From one look at the boards to the next.
const AGAIN: Duration = Duration::from_secs(1);
/// Longest that is waited without a look at whether to stop.
const LOOK: Duration = Duration::from_millis(50);

/// Arguments of `fleet`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    action: Option<Action>,
    /// Print JSON instead of text
    #[arg(long, global = true)]
    pub(super) json: bool,
    #[command(flatten)]
    meeting: MeetingArgs,
}

/// What to do.
#[derive(Debug, clap::Subcommand)]
enum Action {
    /// Which boards there are, and how they fare
    #[command(after_help = "Examples:\n  host fleet list 'ossature/lab/*' --watch")]
    List {
        /// The boards
        #[arg(value_name = "KEY", default_value = "ossature/*/*")]
        boards: Board,
        /// Look again every second until Ctrl-C
        #[arg(long)]
        watch: bool,
        /// Stop watching after so many seconds
        #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
        seconds: Option<u32>,
    },
    /// Set something of boards
    #[command(after_help = "Examples:\n  host fleet order ossature/lab/left exposure 300")]
    Order {
        /// The boards
        #[arg(value_name = "KEY")]
        boards: Board,
        /// What to set
        #[arg(value_name = "WHAT", value_parser = PossibleValuesParser::new(ORDERS))]
        what: String,
        /// To what
        #[arg(value_name = "VALUE")]
        value: String,
    },
    /// Be where everybody meets, until Ctrl-C
    #[command(after_help = "Examples:\n  host fleet router --listen-at tcp/127.0.0.1:7447")]
    Router,
}

/// What can be set; a board says which of them it cannot.
const ORDERS: [&str; 5] = ["threshold", "polarity", "region", "exposure", "pairs"];

/// Does what is asked.
///
/// # Errors
///
/// If the fleet cannot be met, no board answers, or one refuses.
pub fn run(args: &Args) -> Result<(), Failure> {
    let meeting = args.meeting.meeting();
    if args.meeting.listens() && !matches!(args.action, Some(Action::Router)) {
        return Err(usage("--listen-at is for `host fleet router`; others meet there with --connect"));
    }
    let (boards, watch) = match &args.action {
        None => ("ossature/*/*".parse()?, None),
        Some(Action::List { boards, watch, seconds }) => (boards.clone(), watch.then_some(*seconds)),
        Some(Action::Order { boards, what, value }) => {
            return order(&Link::open(&meeting)?, boards, (what, value), args.json);
        }
        Some(Action::Router) => return router(meeting),
    };
    let link = Link::open(&meeting)?;
    match watch {
        None => list(&link, &boards, args.json),
        Some(seconds) => keep_watching(&link, &boards, seconds, args.json),
    }
}

fn list(link: &Link, boards: &Board, json: bool) -> Result<(), Failure> {
    let mut roster = Roster::default();
    look(link, boards, &mut roster)?;
    if roster.is_empty() {
        return Err(format!(
            "no board answers to {boards}; start `host listen --publish ossature/SITE/BOARD`, or look under which names \
             boards publish"
        )
        .into());
    }
    if json { say_json(&roster.as_json()) } else { say(&roster.as_text()) }
}

/// Asks all boards; what cannot be read is told.
fn look(link: &Link, boards: &Board, roster: &mut Roster) -> Result<(), Failure> {
    let (mut messages, answers) = (Vec::new(), link.last(boards, Leaf::Status)?);
    for answer in answers {
        match answer {
            Ok(message) => messages.push(message),
            Err(why) => note(&format!("warning: {}", printable(&why))),
        }
    }
    if !roster.answered(messages) {
        note(&format!("warning: more than {BOARDS} boards answered; name fewer with KEY"));
    }
    Ok(())
}

fn keep_watching(link: &Link, boards: &Board, seconds: Option<u32>, json: bool) -> Result<(), Failure> {
    let (stop, mut roster) = (interruption()?, Roster::default());
    let end = seconds.map(|seconds| Instant::now() + Duration::from_secs(seconds.into()));
    let is_over = || stop.load(Ordering::Relaxed) || end.is_some_and(|end| Instant::now() >= end);
    while !is_over() {
        let next = Instant::now() + AGAIN;
        look(link, boards, &mut roster)?;
        if json {
            say_json_line(&roster.as_json())?;
        } else {
            say(&format!("{}\n", roster.as_text()))?;
        }
        while Instant::now() < next && !is_over() {
            thread::sleep(LOOK);
        }
    }
    Ok(())
}

fn order(link: &Link, boards: &Board, (what, value): (&str, &str), json: bool) -> Result<(), Failure> {
    let (mut obeyed, mut refused) = (Vec::<Value>::new(), Vec::new());
    for answer in link.order(boards, what, value)? {
        match answer {
            Ok((board, settings)) => {
                let mut settings: Map<_, _> = serde_json::from_slice(&settings).unwrap_or_default();
                settings.insert("board".into(), board.to_string().into());
                obeyed.push(settings.into());
            }
            Err(why) => refused.push(why),
        }
    }
    if json {
        say_json(&json!({ "obeyed": obeyed, "refused": refused }))?;
    } else {
        refused.iter().for_each(|why| note(&format!("refused: {}", printable(why))));
        if !obeyed.is_empty() {
            let number = count(obeyed.len(), "board obeys", "boards obey");
            say(&format!("{number}: {what} {value}\n"))?;
        }
    }
    match (obeyed.len(), refused.len()) {
        (0, 0) => {
            Err(format!("no board answers to {boards}; `host fleet` lists those that are there").into())
        }
        (_, 0) => Ok(()),
        (_, no) => Err(format!("{} of the order", count(no, "refusal", "refusals")).into()),
    }
}

/// Lets others meet here.
fn router(mut meeting: Meeting) -> Result<(), Failure> {
    if meeting.listen.is_empty() && meeting.config.is_none() {
        meeting.listen.push(MEETING_PLACE.into());
    }
    meeting.must_listen = true;
    let (_link, stop) = (Link::open(&meeting)?, interruption()?);
    note(&format!("the fleet meets at {meeting}, until Ctrl-C"));
    while !stop.load(Ordering::Relaxed) {
        thread::sleep(LOOK);
    }
    Ok(())
}
