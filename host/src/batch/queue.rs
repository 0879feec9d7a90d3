//! The queue: two streams of a NATS server, kept in its files.
//!
//! | stream | subject | holds |
//! |---|---|---|
//! | `ossature_NAME_jobs` | `ossature.NAME.job.ID` | a [`Job`] that waits or is at work; gone when it is acknowledged |
//! | `ossature_NAME_records` | `ossature.NAME.record.OUTCOME.ID` | a [`Record`] of one that is not |
//!
//! A job is written only where its subject is empty, so it waits once. A worker takes a job, tells every third of the
//! consumer's patience that it is still at it, and when the results are in their folder writes the record, then
//! acknowledges: whatever is cut off in between leaves a job that is taken again, and a record that says that
//! nothing is left to do. Every call waits for the server's answer.

use std::fmt;
use std::sync::Arc;
use std::time::{Duration, SystemTime};

use async_nats::header::{HeaderMap, NATS_EXPECTED_LAST_SUBJECT_SEQUENCE};
use async_nats::jetstream::consumer::pull::Config as Pull;
use async_nats::jetstream::consumer::{AckPolicy, PullConsumer};
use async_nats::jetstream::context::{ConsumerInfoErrorKind, GetStreamErrorKind, PublishErrorKind};
use async_nats::jetstream::message::{AckKind, Message};
use async_nats::jetstream::stream::{Config, LastRawMessageErrorKind, RetentionPolicy, StorageType, Stream};
use async_nats::jetstream::{Context, ErrorCode};
use futures_util::future::try_join_all;
use futures_util::{StreamExt, TryStreamExt, stream};
use tokio::runtime::Runtime;
use tokio::task::JoinHandle;
use tokio::time::{sleep, timeout};

use super::job::Job;
use super::record::{Outcome, Progress, Record, Submitted};
use super::server::{ANSWER, QueueError, Server, connect, no_streams};

/// The consumer of the jobs, which all workers share.
const WORKERS: &str = "workers";
/// Jobs that are on their way to the server at a time.
const UNDER_WAY: usize = 64;
/// The rate is that of so many records at the end, and of fewer it is none.
const LATEST: u64 = 200;
const FEWEST: u64 = 10;
/// Records of one outcome that are read to be told.
const TOLD: usize = 100;

/// Wherever a client's error is passed on as it is.
macro_rules! server {
    ($call:expr) => {
        $call.await.map_err(QueueError::server)
    };
}

/// A batch on a server.
pub struct Queue {
    runtime: Runtime,
    context: Context,
    name: String,
    jobs: Stream,
    records: Stream,
    consumer: PullConsumer,
    patience: Duration,
}

impl fmt::Debug for Queue {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.debug_struct("Queue").field("name", &self.name).finish_non_exhaustive()
    }
}

impl Queue {
    /// A batch, which is made if there is none. A worker of which nothing was heard for `patience` is lost.
    ///
    /// # Errors
    ///
    /// If the server is not there, or keeps no streams.
    pub fn create(server: &Server, name: &str, patience: Duration) -> Result<Self, QueueError> {
        let (runtime, context) = connect(server)?;
        runtime.block_on(async {
            let [jobs, records] = streams(name);
            let jobs = context.get_or_create_stream(jobs).await.map_err(no_streams)?;
            let _ = server!(context.get_or_create_stream(records))?;
            let pull = Pull {
                durable_name: Some(WORKERS.into()),
                ack_policy: AckPolicy::Explicit,
                ack_wait: patience,
                max_deliver: -1,
                max_ack_pending: -1,
                ..Pull::default()
            };
            server!(jobs.create_consumer(pull))
        })?;
        Self::of(runtime, context, name)
    }

    /// A batch that is there.
    ///
    /// # Errors
    ///
    /// If it is not, or the server is not.
    pub fn open(server: &Server, name: &str) -> Result<Self, QueueError> {
        let (runtime, context) = connect(server)?;
        Self::of(runtime, context, name)
    }

    fn of(runtime: Runtime, context: Context, name: &str) -> Result<Self, QueueError> {
        let found: Result<_, QueueError> = runtime.block_on(async {
            let [jobs, records] = streams(name).map(|config| config.name);
            let jobs = stream_of(&context, &jobs, name).await?;
            let records = stream_of(&context, &records, name).await?;
            let consumer: PullConsumer = server!(jobs.get_consumer(WORKERS))?;
            Ok((jobs, records, consumer))
        });
        let (jobs, records, consumer) = found?;
        let patience = consumer.cached_info().config.ack_wait;
        Ok(Self { runtime, context, name: name.into(), jobs, records, consumer, patience })
    }

    /// Forgets the batch.
    ///
    /// # Errors
    ///
    /// If the server does not.
    pub fn remove(self) -> Result<(), QueueError> {
        self.runtime.block_on(async {
            for stream in streams(&self.name) {
                let _ = server!(self.context.delete_stream(stream.name))?;
            }
            Ok(())
        })
    }

    /// Queues pairs, each under what it is known by; `told` hears of each.
    ///
    /// # Errors
    ///
    /// If the server does not take one; those before it are queued.
    pub fn submit(
        &self,
        jobs: impl Iterator<Item = (String, Job)>,
        mut told: impl FnMut(Submitted),
    ) -> Result<(), QueueError> {
        let submits = stream::iter(jobs).map(|(id, job)| async move { self.submit_one(&id, &job).await });
        self.runtime.block_on(async {
            let mut submits = std::pin::pin!(submits.buffer_unordered(UNDER_WAY));
            while let Some(submitted) = submits.try_next().await? {
                told(submitted);
            }
            Ok(())
        })
    }

    async fn submit_one(&self, id: &str, job: &Job) -> Result<Submitted, QueueError> {
        match self.outcome(id).await? {
            Some(Outcome::Made | Outcome::Refused) => return Ok(Submitted::Done),
            // It may go better now.
            Some(Outcome::Aside) => {
                let _ = server!(self.records.purge().filter(self.record(Outcome::Aside, id)))?;
                let _ = server!(self.jobs.purge().filter(self.job(id)))?;
            }
            None => {}
        }
        let bytes = job.to_bytes().map_err(QueueError::server)?;
        let mut headers = HeaderMap::new();
        headers.insert(NATS_EXPECTED_LAST_SUBJECT_SEQUENCE, "0");
        let sent = server!(self.context.publish_with_headers(self.job(id), headers, bytes.into()))?;
        match sent.await {
            Ok(_) => Ok(Submitted::Queued),
            Err(error) if error.kind() == PublishErrorKind::WrongLastSequence => Ok(Submitted::Waits),
            Err(error) => Err(QueueError::server(error)),
        }
    }

    /// Takes a job, for which it waits so long.
    ///
    /// # Errors
    ///
    /// If the server does not answer.
    pub fn take(&self, wait: Duration) -> Result<Option<Taken>, QueueError> {
        self.runtime.block_on(async {
            let fetched = self.consumer.batch().max_messages(1).expires(wait).messages();
            let mut messages = server!(fetched)?;
            // Of a server that went away nothing comes, not even that nothing comes.
            let next = timeout(wait + ANSWER, messages.next()).await.map_err(QueueError::server)?;
            let Some(message) = next.transpose().map_err(QueueError::server)? else { return Ok(None) };
            Taken::new(message, self.patience).map(Some)
        })
    }

    /// Pairs that wait or are at work.
    ///
    /// # Errors
    ///
    /// If the server does not answer, or the batch is gone.
    pub fn left(&self) -> Result<u64, QueueError> {
        self.runtime.block_on(async {
            // Not the length of the stream: after a crash a server may keep jobs that were acknowledged, and never
            // deliver them again.
            let consumer = self.consumer.get_info().await.map_err(|error| match error.kind() {
                ConsumerInfoErrorKind::NotFound | ConsumerInfoErrorKind::StreamNotFound => {
                    QueueError::NoBatch { name: self.name.clone() }
                }
                _ => QueueError::server(error),
            })?;
            Ok(consumer.num_pending + consumer.num_ack_pending as u64)
        })
    }

    /// Whether a pair is done.
    ///
    /// # Errors
    ///
    /// If the server does not answer.
    pub fn is_done(&self, id: &str) -> Result<bool, QueueError> {
        let outcome = self.runtime.block_on(self.outcome(id))?;
        Ok(matches!(outcome, Some(Outcome::Made | Outcome::Refused)))
    }

    /// What became of a pair, as far as it is known.
    async fn outcome(&self, id: &str) -> Result<Option<Outcome>, QueueError> {
        let recorded = Outcome::ALL.map(|outcome| async move {
            match self.records.get_last_raw_message_by_subject(&self.record(outcome, id)).await {
                Ok(_) => Ok(Some(outcome)),
                Err(error) if error.kind() == LastRawMessageErrorKind::NoMessageFound => Ok(None),
                Err(error) => Err(QueueError::server(error)),
            }
        });
        Ok(try_join_all(recorded).await?.into_iter().flatten().next())
    }

    /// Keeps what became of a job, and takes it from the queue.
    ///
    /// # Errors
    ///
    /// If the server does not answer; it may be tried again.
    pub fn settle(&self, taken: &Taken, outcome: Outcome, record: &Record) -> Result<(), QueueError> {
        self.runtime.block_on(async {
            let bytes = serde_json::to_vec(record).map_err(QueueError::server)?;
            let sent = server!(self.context.publish(self.record(outcome, taken.id()), bytes.into()))?;
            let _ = server!(sent)?;
            server!(taken.message.double_ack())
        })
    }

    /// Takes a job from the queue that is done already.
    ///
    /// # Errors
    ///
    /// As [`Queue::settle`].
    pub fn pass(&self, taken: &Taken) -> Result<(), QueueError> {
        self.runtime.block_on(async { server!(taken.message.double_ack()) })
    }

    /// Gives a job back, for anyone to try again after a time.
    ///
    /// # Errors
    ///
    /// As [`Queue::settle`]; then it comes back when patience is over.
    pub fn give_back(&self, taken: &Taken, after: Duration) -> Result<(), QueueError> {
        self.runtime.block_on(async {
            server!(taken.message.ack_with(AckKind::Nak(Some(after))))?;
            server!(self.context.client().flush())
        })
    }

    /// How far the batch is.
    ///
    /// # Errors
    ///
    /// If the server does not answer.
    pub fn progress(&self) -> Result<Progress, QueueError> {
        self.runtime.block_on(async {
            let consumer = server!(self.consumer.get_info())?;
            let (waiting, at_work) = (consumer.num_pending, consumer.num_ack_pending as u64);
            let state = server!(self.records.get_info())?.state;
            let mut done = [state.messages, 0, 0];
            let mut told = [Vec::new(), Vec::new(), Vec::new()];
            for k in 1..3 {
                let mut subjects =
                    server!(self.records.info_with_subjects(self.record(Outcome::ALL[k], "*")))?;
                while let Some((subject, _)) = server!(subjects.try_next())? {
                    (done[0], done[k]) = (done[0] - 1, done[k] + 1);
                    if told[k].len() < TOLD {
                        let message = server!(self.records.get_last_raw_message_by_subject(&subject))?;
                        told[k].extend(serde_json::from_slice::<Record>(&message.payload));
                    }
                }
            }
            let mut progress = Progress { waiting, at_work, done, told, rate: None, idle: None };
            if state.messages > 0 {
                let last = SystemTime::from(state.last_timestamp);
                progress.idle = Some(last.elapsed().unwrap_or_default());
                progress.rate = self.rate(state.first_sequence, state.last_sequence, last).await;
            }
            Ok(progress)
        })
    }

    /// Pairs a second over the latest records.
    async fn rate(&self, first: u64, last: u64, end: SystemTime) -> Option<f64> {
        let from = last.saturating_sub(LATEST).max(first);
        for sequence in from..last {
            // A record may have been taken away.
            if let Ok(record) = self.records.get_raw_message(sequence).await {
                let time = end.duration_since(SystemTime::from(record.time)).ok()?.as_secs_f64();
                let records = last - sequence;
                return (records >= FEWEST && time > 0.0).then(|| records as f64 / time);
            }
        }
        None
    }

    fn job(&self, id: &str) -> String {
        format!("ossature.{}.job.{id}", self.name)
    }

    fn record(&self, outcome: Outcome, id: &str) -> String {
        format!("ossature.{}.record.{}.{id}", self.name, outcome.token())
    }
}

/// A job at work: while this is held, the server hears that it is.
pub struct Taken {
    message: Arc<Message>,
    /// Which try this is, counted from 1.
    pub tries: i64,
    alive: JoinHandle<()>,
}

impl Taken {
    fn new(message: Message, patience: Duration) -> Result<Self, QueueError> {
        let tries = message.info().map_err(QueueError::server)?.delivered;
        let message = Arc::new(message);
        let told = Arc::clone(&message);
        let alive = tokio::spawn(async move {
            loop {
                sleep(patience / 3).await;
                // A server that is away is told the next time.
                let _ = told.ack_with(AckKind::Progress).await;
            }
        });
        Ok(Self { message, tries, alive })
    }

    /// What it is known by.
    #[must_use]
    pub fn id(&self) -> &str {
        self.message.subject.rsplit('.').next().unwrap_or_default()
    }

    /// What it is.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.message.payload
    }
}

impl Drop for Taken {
    fn drop(&mut self) {
        self.alive.abort();
    }
}

/// Both streams of a batch.
fn streams(name: &str) -> [Config; 2] {
    let of = |what: &str, subject: String, retention| Config {
        name: format!("ossature_{name}_{what}"),
        subjects: vec![subject],
        retention,
        storage: StorageType::File,
        max_messages_per_subject: 1,
        ..Config::default()
    };
    [
        of("jobs", format!("ossature.{name}.job.*"), RetentionPolicy::WorkQueue),
        of("records", format!("ossature.{name}.record.*.*"), RetentionPolicy::Limits),
    ]
}

/// A stream of a batch as it is now.
async fn stream_of(context: &Context, stream: &str, batch: &str) -> Result<Stream, QueueError> {
    context.get_stream(stream).await.map_err(|error| match error.kind() {
        GetStreamErrorKind::JetStream(error) if error.error_code() == ErrorCode::STREAM_NOT_FOUND => {
            QueueError::NoBatch { name: batch.into() }
        }
        _ => no_streams(error),
    })
}
