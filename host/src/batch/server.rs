//! The server that a queue is on: how it is reached, and what it may not do.

use std::error::Error;
use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::time::Duration;

use async_nats::jetstream::{self, Context};
use async_nats::{ConnectErrorKind, ConnectOptions, ServerAddr};
use percent_encoding::percent_decode_str;
use tokio::runtime::{self, Runtime};

/// How long a server may take for an answer.
pub(super) const ANSWER: Duration = Duration::from_secs(5);

/// Where a server is, and how it knows us and we it.
#[derive(Clone, Debug)]
pub struct Server {
    /// Its address, with user and password if it asks for them.
    pub url: String,
    /// A file with credentials.
    pub credentials: Option<PathBuf>,
    /// A certificate of the authority that it is believed by; then nothing is said in the clear.
    pub authority: Option<PathBuf>,
    /// Our certificate and its key.
    pub identity: Option<[PathBuf; 2]>,
}

impl Server {
    /// Whether nothing is said to it before it has shown a certificate.
    fn is_certified(&self) -> bool {
        self.authority.is_some() || self.identity.is_some() || self.url.starts_with("tls://")
    }

    /// The files that certify it and us, each with what it must hold.
    fn pem_files(&self) -> impl Iterator<Item = (&PathBuf, &'static str)> {
        let ours = self.identity.iter().flatten().zip(["CERTIFICATE", "PRIVATE KEY"]);
        self.authority.iter().map(|path| (path, "CERTIFICATE")).chain(ours)
    }
}

/// Why a queue did not do what it was asked.
#[derive(Debug, thiserror::Error)]
pub enum QueueError {
    /// Nothing can be at such an address.
    #[error("--server {url} is no address: give one like nats://HOST:4222, or tls://USER:PASSWORD@HOST:4222")]
    Address {
        /// What was given, without a password.
        url: String,
        /// What the client said.
        source: async_nats::Error,
    },
    /// Nobody answers.
    #[error(
        "there is no NATS server at {url}: start one with `nats-server -js -sd FOLDER` (Debian: apt-get install \
         nats-server), or name another with --server"
    )]
    NoServer {
        /// Where it was looked for, without a password.
        url: String,
        /// What the client said.
        source: async_nats::Error,
    },
    /// It lets us not in, or we do not believe it.
    #[error(
        "the NATS server at {url} and this machine do not trust each other: give user and password in --server, or \
         --creds, the authority of its certificate by --ca, and a certificate that it knows by --cert"
    )]
    Stranger {
        /// Where it is, without a password.
        url: String,
        /// What the client said.
        source: async_nats::Error,
    },
    /// A server of another kind, or set up otherwise.
    #[error("the NATS server keeps no streams: start it with JetStream, `nats-server -js -sd FOLDER`")]
    NoStreams,
    /// There is no such batch.
    #[error(
        "there is no batch {name} on this server: queue its pairs with `host batch submit DIR`, or give its --name"
    )]
    NoBatch {
        /// What it was called.
        name: String,
    },
    /// What a file holds.
    #[error("cannot use {}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// Anything else.
    #[error("the NATS server did not do as it was asked")]
    Server {
        /// What the client said.
        source: async_nats::Error,
    },
}

impl QueueError {
    /// Anything that has no sentence of its own.
    pub(super) fn server(error: impl Into<async_nats::Error>) -> Self {
        Self::Server { source: error.into() }
    }
}

/// A client of the server, and what runs it.
pub(super) fn connect(server: &Server) -> Result<(Runtime, Context), QueueError> {
    let runtime = runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build();
    let runtime = runtime.map_err(QueueError::server)?;
    let context: Result<_, QueueError> = runtime.block_on(async {
        let mut options =
            ConnectOptions::new().name("ossature").connection_timeout(ANSWER).max_reconnects(None);
        if let Some(path) = &server.credentials {
            let read = options.credentials_file(path).await;
            options = read.map_err(|source| QueueError::File { path: path.clone(), source })?;
        }
        for (path, what) in server.pem_files() {
            holds_pem(path, what).map_err(|source| QueueError::File { path: path.clone(), source })?;
        }
        // Nor is anything said to servers that this one names: they may know no certificates.
        options = options.require_tls(server.is_certified()).ignore_discovered_servers();
        if let Some(path) = &server.authority {
            options = options.add_root_certificates(path.clone());
        }
        if let Some([certificate, key]) = &server.identity {
            options = options.add_client_certificate(certificate.clone(), key.clone());
        }
        // The client itself passes over what an address says of the user.
        if let Some([user, password]) = user_of(&server.url) {
            options = options.user_and_password(user, password);
        }
        let url = without_password(&server.url);
        let client = options.connect(&server.url).await.map_err(|error| match error.kind() {
            ConnectErrorKind::Authentication
            | ConnectErrorKind::AuthorizationViolation
            | ConnectErrorKind::Tls => QueueError::Stranger { url, source: error.into() },
            ConnectErrorKind::Io if is_distrust(&error) => QueueError::Stranger { url, source: error.into() },
            ConnectErrorKind::ServerParse => QueueError::Address { url, source: error.into() },
            _ => QueueError::NoServer { url, source: error.into() },
        })?;
        let mut context = jetstream::new(client);
        context.set_timeout(ANSWER);
        Ok(context)
    });
    Ok((runtime, context?))
}

/// Whether a file holds what the client, which only says that it is not trusted, will look for there.
fn holds_pem(path: &Path, what: &str) -> io::Result<()> {
    if String::from_utf8_lossy(&fs::read(path)?).contains(&format!("{what}-----")) {
        return Ok(());
    }
    Err(io::Error::new(ErrorKind::InvalidData, format!("it holds no {} in PEM", what.to_lowercase())))
}

/// An error, and what it came of.
fn causes<'a>(error: &'a (dyn Error + 'static)) -> impl Iterator<Item = &'a (dyn Error + 'static)> {
    std::iter::successors(Some(error), |&error| error.source())
}

/// Whether it ended over certificates, or over what is none: what was read is not valid then.
fn is_distrust(error: &(dyn Error + 'static)) -> bool {
    let invalid = |error: &io::Error| error.kind() == ErrorKind::InvalidData;
    causes(error).filter_map(|cause| cause.downcast_ref()).any(invalid)
}

/// User and password that an address names.
fn user_of(url: &str) -> Option<[String; 2]> {
    let address: ServerAddr = url.parse().ok()?;
    let plain = |word: &str| percent_decode_str(word).decode_utf8_lossy().into_owned();
    Some([address.username()?, address.password()?].map(plain))
}

/// An address as it may be shown.
fn without_password(url: &str) -> String {
    let (scheme, rest) = url.split_once("://").unwrap_or(("nats", url));
    format!("{scheme}://{}", rest.rsplit('@').next().unwrap_or_default())
}

/// Why a stream cannot be had.
pub(super) fn no_streams(error: impl Into<async_nats::Error>) -> QueueError {
    let source = error.into();
    let says = causes(&*source).map(ToString::to_string).collect::<Vec<_>>().join(": ");
    if ["unavailable", "not enabled", "resource does not exist"].iter().any(|word| says.contains(word)) {
        QueueError::NoStreams
    } else {
        QueueError::Server { source }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_says_who_asks() {
        let said = user_of("tls://one%40lab:two%20words@there:4222").unwrap();
        assert_eq!(said, ["one@lab", "two words"]);
        assert_eq!(user_of("nats://there:4222"), None);
    }

    #[test]
    fn what_is_no_address_is_told_as_one() {
        let url = "nats://me:secret@there:port".to_string();
        let said =
            connect(&Server { url, credentials: None, authority: None, identity: None }).err().unwrap();
        assert!(matches!(&said, QueueError::Address { .. }), "{said:?}");
        assert!(said.to_string().starts_with("--server nats://there:port is no address"), "{said}");
    }

    #[test]
    fn a_password_is_never_told() {
        assert_eq!(without_password("nats://me:secret@there:4222"), "nats://there:4222");
        assert_eq!(without_password("there:4222"), "nats://there:4222");
    }
}
