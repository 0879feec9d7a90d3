//! The only place that speaks Zenoh: a session, what publishes and what subscribes through it, and questions.
//!
//! A program that listens is a router, through which those who meet there find each other; one that does not is a
//! client of the first router that answers, and looks for it again when it is lost. Nobody scouts by multicast, and
//! nobody listens who was not asked to, unless the configuration says so.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use serde_json::{Map, Value, json};
use zenoh::bytes::Encoding;
use zenoh::handlers::{FifoChannel, FifoChannelHandler, RingChannel, RingChannelHandler};
use zenoh::liveliness::LivelinessToken;
use zenoh::qos::CongestionControl;
use zenoh::query::{ConsolidationMode, Query, QueryTarget, Queryable};
use zenoh::sample::Sample;
use zenoh::{Config, Session, Wait};

use super::envelope::{CONTRACT, Envelope, new_run, now_us};
use super::key::{Board, Leaf};
use super::{ANSWER, BOARDS, FleetError, MEETING_PLACE, Meeting, Message, Obeyed, Pressure};
use crate::live::control::Control;

/// Messages that may wait here for whoever takes them: then those who send wait.
const ROOM: usize = 64;
/// Those of them that are kept if nobody is to wait: the newest.
const NEWEST: usize = 16;
/// Where the configuration says who listens, who is called, and as what.
const LISTEN: &str = "listen/endpoints";
const CONNECT: &str = "connect/endpoints";
const MODE: &str = "mode";

/// What is otherwise in this program than in Zenoh, unless a configuration says so: nobody scouts, and no message is
/// longer than a model and what goes with it.
const OURS: [(&str, &str); 2] =
    [("scouting/multicast/enabled", "false"), ("transport/link/rx/max_message_size", "16842752")];
/// How long a message waits for room at the next program, us, before the link to it is ended: at a router, and
/// elsewhere. A router gives up who hangs before those who wait for it give up the router.
const WAIT: &str = "transport/link/tx/queue/congestion_control/block/wait_before_close";
const WAITS: [&str; 2] = ["10000000", "30000000"];
/// What Zenoh has in place of an answer that did not come.
const TIMEOUT: &str = "Timeout";

impl From<zenoh::Error> for FleetError {
    fn from(error: zenoh::Error) -> Self {
        Self::Link(words(&error))
    }
}

/// What Zenoh says, without where in its source it says so.
fn words(error: &zenoh::Error) -> String {
    let words = error.to_string();
    words.split(" at /").next().unwrap_or_default().trim_end_matches(['!', ' ']).to_owned()
}

/// A part of the network.
#[derive(Clone, Debug)]
pub struct Link(Session);

impl Link {
    /// Meet the others.
    ///
    /// # Errors
    /// A [`FleetError`] if nobody is there, nobody can be let in, or the configuration is none.
    pub fn open(meeting: &Meeting) -> Result<Self, FleetError> {
        // Silent unless RUST_LOG asks for more.
        zenoh::try_init_log_from_env();
        let (config, listens) = configuration(meeting)?;
        let session = zenoh::open(config).wait().map_err(|error| {
            let (places, why) = (meeting.to_string(), words(&error));
            if listens { FleetError::Taken { places, why } } else { FleetError::Nobody { places, why } }
        })?;
        Ok(Self(session))
    }

    /// Publish as a board, which obeys what others set of `control`.
    ///
    /// # Errors
    /// [`FleetError::Named`] if somebody does under this name, [`FleetError::Link`].
    pub fn publish(
        &self,
        board: &Board,
        pressure: Pressure,
        control: Arc<Control>,
    ) -> Result<Publisher, FleetError> {
        let (name, living) = (board.to_string(), self.0.liveliness());
        let others = living.get(&name).timeout(ANSWER).with(FifoChannel::new(ROOM)).wait()?;
        if others.iter().any(|reply| reply.result().is_ok()) {
            return Err(FleetError::Named(board.clone()));
        }
        let alive = living.declare_token(&name).wait()?;
        let kept = Arc::<Mutex<Kept>>::default();
        let (its, theirs) = (board.clone(), Arc::clone(&kept));
        let asked = self
            .0
            .declare_queryable(format!("{board}/*"))
            .callback(move |query| answer(&query, &its, &theirs));
        let its = board.clone();
        let orders =
            self.0.declare_queryable(its.order("*")).callback(move |query| obey(&query, &its, &control));
        let answering = [asked.wait()?, orders.wait()?];
        let congestion = match pressure {
            Pressure::Wait => CongestionControl::Block,
            Pressure::Newest => CongestionControl::Drop,
        };
        let (session, board, run) = (self.0.clone(), board.clone(), new_run());
        let (sent, rest) = (BTreeMap::new(), (answering, alive));
        Ok(Publisher { session, board, run, congestion, sent, kept, _rest: rest })
    }

    /// Hear what boards publish from now on.
    ///
    /// # Errors
    /// [`FleetError::Link`].
    pub fn subscribe(&self, boards: &Board, pressure: Pressure) -> Result<Subscriber, FleetError> {
        let declared = self.0.declare_subscriber(format!("{boards}/*"));
        Ok(Subscriber(match pressure {
            Pressure::Wait => Queue::All(declared.with(FifoChannel::new(ROOM)).wait()?),
            Pressure::Newest => Queue::Newest(declared.with(RingChannel::new(NEWEST)).wait()?),
        }))
    }

    /// The last message that each of these boards has kept, or why there is none that can be read.
    ///
    /// # Errors
    /// [`FleetError::Link`].
    pub fn last(&self, boards: &Board, leaf: Leaf) -> Result<Vec<Result<Message, String>>, FleetError> {
        let answers = self.ask(&boards.key(leaf), None)?.into_iter();
        Ok(answers.filter_map(|answer| answer.map_or_else(|why| Some(Err(why)), |it| message(&it))).collect())
    }

    /// Order something of boards: an answer from each that took it or refused it.
    ///
    /// # Errors
    /// [`FleetError::Link`].
    pub fn order(&self, boards: &Board, what: &str, value: &str) -> Result<Vec<Obeyed>, FleetError> {
        let answers = self.ask(&boards.order(what), Some(value))?;
        let whose = |sample: &Sample| Board::one(sample.key_expr().as_str().split("/do/").next()?).ok();
        let obeyed = |answer: Result<Sample, String>| match answer {
            Ok(sample) => whose(&sample).map(|board| Ok((board, sample.payload().to_bytes().into_owned()))),
            Err(why) => Some(Err(why)),
        };
        Ok(answers.into_iter().filter_map(obeyed).collect())
    }

    fn ask(&self, key: &str, payload: Option<&str>) -> Result<Vec<Result<Sample, String>>, FleetError> {
        let question =
            self.0.get(key).target(QueryTarget::All).consolidation(ConsolidationMode::None).timeout(ANSWER);
        let question = match payload {
            Some(payload) => question.payload(payload),
            None => question,
        };
        let answers = question.with(FifoChannel::new(ROOM)).wait()?;
        let sentence = |error: zenoh::query::ReplyError| match &*error.payload().to_bytes() {
            bytes if bytes == TIMEOUT.as_bytes() => format!(
                "somebody of {key} did not answer within {} s: a subscriber that is slow may hold it up",
                ANSWER.as_secs()
            ),
            bytes => String::from_utf8_lossy(bytes).into_owned(),
        };
        Ok(answers.iter().take(BOARDS).map(|reply| reply.into_result().map_err(sentence)).collect())
    }
}

/// Zenoh's configuration, and whether it has this program listen.
fn configuration(meeting: &Meeting) -> Result<(Config, bool), FleetError> {
    let none = Path::new("");
    let wrong = |error: zenoh::Error| FleetError::Config {
        path: meeting.config.as_deref().unwrap_or(none).to_owned(),
        why: words(&error),
    };
    let (defaults, mut config) = (
        Config::default(),
        match &meeting.config {
            Some(path) => Config::from_file(path).map_err(wrong)?,
            None => Config::default(),
        },
    );
    let is_said = |config: &Config, key| config.get_json(key).ok() != defaults.get_json(key).ok();
    let listens = !meeting.listen.is_empty() || is_said(&config, LISTEN);
    if meeting.must_listen && !listens {
        return Err(wrong("it says nowhere to listen; add listen.endpoints, or give --listen-at".into()));
    }
    let connects = !meeting.connect.is_empty() || is_said(&config, CONNECT);
    let mut say = |key, value: Value| config.insert_json5(key, &value.to_string()).map_err(wrong);
    if !meeting.listen.is_empty() || !listens {
        say(LISTEN, json!(meeting.listen))?;
    }
    if !meeting.connect.is_empty() {
        say(CONNECT, json!(meeting.connect))?;
    } else if !listens && !connects {
        say(CONNECT, json!([MEETING_PLACE]))?;
    }
    if !is_said(&config, MODE) {
        config.insert_json5(MODE, if listens { "\"router\"" } else { "\"client\"" }).map_err(wrong)?;
    }
    for (key, value) in OURS.into_iter().chain([(WAIT, WAITS[usize::from(!listens)])]) {
        if !is_said(&config, key) {
            config.insert_json5(key, value).map_err(wrong)?;
        }
    }
    Ok((config, listens))
}

/// What can be asked for later, as it was sent, and when.
type Kept = BTreeMap<Leaf, (Envelope, Instant, Vec<u8>)>;

/// What it holds is whole at every moment, so a panic elsewhere does not matter.
fn locked(kept: &Mutex<Kept>) -> MutexGuard<'_, Kept> {
    kept.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Answers with the last messages that are asked for.
fn answer(query: &Query, board: &Board, kept: &Mutex<Kept>) {
    let kept = locked(kept).clone();
    for (leaf, (envelope, sent, bytes)) in kept {
        let Ok(key) = zenoh::key_expr::KeyExpr::try_from(board.key(leaf)) else { continue };
        if query.key_expr().intersects(&key) {
            let age_ms = u64::try_from(sent.elapsed().as_millis()).ok();
            let envelope = Envelope { age_ms, ..envelope };
            // Who asked may be gone.
            let _ = query.reply(key, bytes).encoding(leaf.media()).attachment(envelope.to_bytes()).wait();
        }
    }
}

/// Sets what is ordered, or says why not.
fn obey(query: &Query, board: &Board, control: &Control) {
    let key = query.key_expr().as_str();
    let what = key.rsplit('/').next().unwrap_or_default();
    let value = query.payload().map(|payload| payload.to_bytes()).unwrap_or_default();
    let wish = json!({ what: String::from_utf8_lossy(&value) });
    // Who asked may be gone.
    let _ = match control.wish(wish.to_string().as_bytes()) {
        Ok(()) => {
            let told = control.told().to_string();
            query.reply(board.order(what), told).encoding(Encoding::APPLICATION_JSON).wait()
        }
        Err(why) => query.reply_err(format!("{board}: {why}")).encoding(Encoding::TEXT_PLAIN).wait(),
    };
}

/// A board, as others see it. It answers them until it is dropped.
#[derive(Debug)]
pub struct Publisher {
    session: Session,
    board: Board,
    run: String,
    congestion: CongestionControl,
    /// Messages sent under each key.
    sent: BTreeMap<Leaf, u64>,
    kept: Arc<Mutex<Kept>>,
    /// What answers, and what tells others that the name is taken.
    _rest: ([Queryable<()>; 2], LivelinessToken),
}

impl Publisher {
    /// Send what is about a pair, or about none: 0. Messages that nobody can have are numbered all the same.
    ///
    /// # Errors
    /// [`FleetError::Link`] when this end is closed, or there are more bytes than [`Leaf::most`].
    pub fn put(&mut self, leaf: Leaf, pair: u64, bytes: Vec<u8>) -> Result<(), FleetError> {
        let next = self.sent.entry(leaf).or_default();
        let (run, number) = (self.run.clone(), *next);
        *next += 1;
        if bytes.len() > leaf.most() {
            return Err(FleetError::Link(too_long(leaf, bytes.len())));
        }
        let envelope = Envelope { contract: CONTRACT, run, number, pair, time_us: now_us(), age_ms: None };
        let attachment = envelope.to_bytes();
        if leaf.is_kept() {
            locked(&self.kept).insert(leaf, (envelope, Instant::now(), bytes.clone()));
        }
        let put = self.session.put(self.board.key(leaf), bytes).encoding(leaf.media()).attachment(attachment);
        Ok(put.congestion_control(self.congestion).wait()?)
    }

    /// Send how pairs fare, and how many messages were sent before under each key, so that nothing is missed unseen.
    ///
    /// # Errors
    /// As [`Self::put`].
    pub fn status(&mut self, pair: u64, mut status: Map<String, Value>) -> Result<(), FleetError> {
        let sent: Map<_, _> =
            self.sent.iter().map(|(leaf, sent)| (leaf.name().to_owned(), json!(sent))).collect();
        status.insert("sent".into(), sent.into());
        self.put(Leaf::Status, pair, Value::Object(status).to_string().into_bytes())
    }
}

/// Where messages arrive.
#[derive(Debug)]
pub struct Subscriber(Queue);

#[derive(Debug)]
enum Queue {
    All(zenoh::pubsub::Subscriber<FifoChannelHandler<Sample>>),
    Newest(zenoh::pubsub::Subscriber<RingChannelHandler<Sample>>),
}

impl Subscriber {
    /// The next message, if one comes within this time, or why it cannot be read.
    ///
    /// # Errors
    /// [`FleetError::Link`] when there are none to come any more.
    pub fn next(&self, within: Duration) -> Result<Option<Result<Message, String>>, FleetError> {
        let came = match &self.0 {
            Queue::All(samples) => samples.recv_timeout(within),
            Queue::Newest(samples) => samples.recv_timeout(within),
        };
        Ok(came?.as_ref().and_then(message))
    }
}

fn too_long(leaf: Leaf, length: usize) -> String {
    format!("a {} of {length} bytes is longer than {}", leaf.name(), leaf.most())
}

/// What a sample says, or why it cannot be read; None if it is none of ours.
fn message(sample: &Sample) -> Option<Result<Message, String>> {
    let key = sample.key_expr().as_str();
    let (board, leaf) = Board::of_message(key)?;
    if sample.payload().len() > leaf.most() {
        return Some(Err(format!("a message under {key}: {}", too_long(leaf, sample.payload().len()))));
    }
    let attachment = sample.attachment().map(|attachment| attachment.to_bytes()).unwrap_or_default();
    Some(match Envelope::from_bytes(&attachment) {
        Ok(envelope) => {
            Ok(Message { board, leaf, envelope, bytes: sample.payload().to_bytes().into_owned() })
        }
        Err(why) => Err(format!("a message under {key} cannot be read: {why}")),
    })
}
