//! Models from more recorded pairs than one machine should make: a queue of pairs, and any number of workers.
//!
//! On one machine `host replay DIR` does the same without any of this. The queue is a NATS server with JetStream
//! (docs/batch.md says how to start one), and this program a build with `--features batch`.
//!
//! submit queues every pair in DIR, once: a pair that waits or was done before, with the same contents and the same
//! options, is passed over. What stands behind -- are the options of `host replay` that say how a model is made; it
//! takes what stands for it in `ossature.toml`, too. Only paths are queued: workers read the pictures themselves.
//!
//! work makes models, one pair a core at a time, until none is left, and leaves in --out what `host replay` would,
//! byte for byte. Start as many as there are machines; DIR is the same folder as this machine sees it. A worker may
//! be killed at any time: its pairs go to others. A server that is away is waited for. A pair that is refused is done;
//! one that could not be made --tries times, or whose worker ended each time, is set aside with the reason.
//!
//! status tells what waits, is at work, and is done, how fast, how long the rest will take, and what was refused or
//! set aside and why. drop forgets a batch: what waits, and what was done; models stay.
//!
//! Examples:
//!   host batch submit recordings -- --polarity dark --no-pictures
//!   host batch work recordings --out models
//!   host batch status recordings --json
//!   host batch work recordings --out models --server tls://queue.example:4222 --creds worker.creds

#[cfg(feature = "batch")]
mod recipe;
#[cfg(feature = "batch")]
mod status;
#[cfg(feature = "batch")]
mod submit;
#[cfg(feature = "batch")]
mod work;

use std::ffi::OsString;
use std::path::PathBuf;

use super::{Everywhere, Failure};

/// Arguments of `batch`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// What to do.
    #[command(subcommand)]
    pub action: Action,
    /// Print one JSON document instead of text
    #[arg(long, global = true)]
    pub json: bool,
}

/// What to do with a batch.
#[derive(Debug, clap::Subcommand)]
pub enum Action {
    /// Queue every pair of a folder
    #[command(after_help = "Examples:\n  host batch submit recordings -- --polarity dark --no-pictures")]
    Submit(SubmitArgs),
    /// Make models until no pair is left
    #[command(after_help = "Examples:\n  host batch work recordings --out models")]
    Work(WorkArgs),
    /// How far it is
    #[command(after_help = "Examples:\n  host batch status recordings --json")]
    Status(BatchArgs),
    /// Forget it: what waits, and what was done
    #[command(after_help = "Examples:\n  host batch drop recordings")]
    Drop(BatchArgs),
}

/// Which batch, and where its queue is.
#[derive(Clone, Debug, clap::Args)]
pub struct BatchArgs {
    /// Folder with the pairs, as this machine sees it
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
    /// What the batch is called [default: as the folder]
    #[arg(long, value_name = "NAME")]
    pub name: Option<String>,
    /// The NATS server, with user and password where it asks for them: nats://USER:PASSWORD@HOST:PORT
    #[arg(
        long,
        value_name = "URL",
        default_value = "nats://127.0.0.1:4222",
        env = "OSSATURE_NATS",
        hide_env_values = true
    )]
    pub server: String,
    /// Credentials for the server, as `nsc` writes them
    #[arg(long, value_name = "FILE")]
    pub creds: Option<PathBuf>,
    /// Believe a server that has a certificate by this authority, and none without one
    #[arg(long, value_name = "FILE")]
    pub ca: Option<PathBuf>,
    /// This machine's own certificate, for a server that asks for it
    #[arg(long, value_name = "FILE", requires = "key")]
    pub cert: Option<PathBuf>,
    /// The certificate's key
    #[arg(long, value_name = "FILE", requires = "cert")]
    pub key: Option<PathBuf>,
}

/// Arguments of `batch submit`.
#[derive(Debug, clap::Args)]
pub struct SubmitArgs {
    /// Which batch.
    #[command(flatten)]
    pub batch: BatchArgs,
    /// Seconds without a sign of life after which a worker's pairs go to others, 20 or more
    // A sign of life may be a third of this old when a worker dies, and what it left may be swept ten seconds after.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(20..), default_value_t = 30)]
    pub lost_after: u64,
    /// Options of `host replay` that say how a model is made
    #[arg(last = true, value_name = "OPTIONS")]
    pub how: Vec<OsString>,
}

/// Arguments of `batch work`.
#[derive(Debug, clap::Args)]
pub struct WorkArgs {
    /// Which batch.
    #[command(flatten)]
    pub batch: BatchArgs,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "ossature-out")]
    pub out: PathBuf,
    /// Threads, at most four a core [default: one a core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub jobs: Option<u16>,
    /// Tries after which a pair is set aside
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(i64).range(1..), default_value_t = 5)]
    pub tries: i64,
    /// Wait for more when none is left
    #[arg(long)]
    pub stay: bool,
}

/// Does it.
///
/// # Errors
///
/// A [`clap::Error`] for wrong usage; if there is no server, or the command cannot do its part.
#[cfg(feature = "batch")]
pub fn run(args: &Args, everywhere: &Everywhere) -> Result<(), Failure> {
    match &args.action {
        Action::Submit(submit) => submit::run(submit, everywhere, args.json),
        Action::Work(work) => work::run(work, args.json),
        Action::Status(batch) => status::run(batch, args.json),
        Action::Drop(batch) => status::drop(batch, args.json),
    }
}

/// Says what to do.
///
/// # Errors
///
/// Always: this build has no batches.
#[cfg(not(feature = "batch"))]
pub fn run(_: &Args, _: &Everywhere) -> Result<(), Failure> {
    Err("this program was built without batches; build it with `cargo build --release -p host --features batch`, or \
         make all pairs on this machine with `host replay DIR`"
        .into())
}

#[cfg(feature = "batch")]
impl BatchArgs {
    /// The folder, if it is one.
    fn folder(&self) -> Result<&std::path::Path, Failure> {
        if self.folder.is_dir() {
            return Ok(&self.folder);
        }
        Err(format!("there is no folder {}; name the one with the pairs", self.folder.display()).into())
    }

    /// What the batch is called: letters, digits, `-` and `_`.
    fn name(&self) -> Result<String, Failure> {
        let is_plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        if let Some(name) = &self.name {
            let sound = !name.is_empty() && name.chars().all(is_plain);
            return if sound {
                Ok(name.clone())
            } else {
                Err(super::options::usage("--name takes letters, digits, - and _"))
            };
        }
        let folder = self.folder()?.canonicalize()?;
        let name = folder.file_name().unwrap_or_default().to_string_lossy();
        Ok(name.chars().map(|c| if is_plain(c) { c } else { '-' }).collect())
    }

    fn server(&self) -> crate::batch::server::Server {
        let identity = self.cert.clone().zip(self.key.clone()).map(<[PathBuf; 2]>::from);
        crate::batch::server::Server {
            url: self.server.clone(),
            credentials: self.creds.clone(),
            authority: self.ca.clone(),
            identity,
        }
    }
}
