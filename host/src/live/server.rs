//! HTTP on loopback, in one thread: the page, the newest pair, and what is set.
//!
//! | below the token | answer |
//! |---|---|
//! | `GET` nothing | the page |
//! | `GET pair?after=N` | the newest pair whose number is greater, as JSON, once there is one; 204 if none came in time |
//! | `POST settings` | what is set then, as JSON; 400 with a sentence if it cannot be obeyed |
//!
//! Everything else is a status and a sentence. A client may be slow, silent or many: a connection has a time to live,
//! those above a number are turned away, those above another are hung up on, and a request is small. What a client is
//! owed is one pair.

use std::convert::Infallible;
use std::future::Future;
use std::io;
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;

use http_body_util::{BodyExt, Full, Limited};
use hyper::body::{Bytes, Incoming};
use hyper::header::{self, HeaderMap, HeaderValue};
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper::{Method, Request, Response, StatusCode};
use hyper_util::rt::{TokioIo, TokioTimer};
use tokio::net::{TcpListener, TcpStream};
use tokio::runtime;
use tokio::sync::{Semaphore, oneshot};
use tokio::time::{sleep, timeout};

use super::control::Control;
use super::guard::{Guard, Stranger};
use super::slot::Slot;

/// Connections at a time; a page has two or three.
const MOST_CONNECTIONS: usize = 32;
/// Further ones that are told so at a time.
const MOST_FAREWELLS: usize = 32;
/// How long a connection is used again.
const LIFE: Duration = Duration::from_secs(60);
/// And how long its last answer may take.
const GRACE: Duration = Duration::from_secs(20);
/// How long one that is turned away may take to ask and to hear so.
const FAREWELL: Duration = Duration::from_secs(2);
/// How long a page is kept waiting for a pair: less than [`GRACE`].
const HOLD: Duration = Duration::from_secs(10);
/// How long a request may take to be said.
const REQUEST: Duration = Duration::from_secs(5);
/// Bytes of its head, and of what it wants to be set.
const MOST_HEAD: usize = 16 << 10;
const MOST_WISH: usize = 1 << 10;
/// From one attempt to accept to the next, where the system has nothing left.
const AGAIN: Duration = Duration::from_millis(100);

/// Milliseconds since a pair came, as it is sent.
const AGE: &str = "ossature-age-ms";

type Answer = Response<Full<Bytes>>;

/// What is served, and to whom.
#[derive(Debug)]
pub(super) struct Site {
    pub(super) guard: Guard,
    pub(super) page: Bytes,
    pub(super) slot: Arc<Slot>,
    pub(super) control: Arc<Control>,
}

/// What serves a site until it is told to stop; connections end with it.
pub(super) fn prepare(
    listener: std::net::TcpListener,
    site: Site,
) -> io::Result<impl FnOnce(oneshot::Receiver<()>) + Send> {
    listener.set_nonblocking(true)?;
    let runtime = runtime::Builder::new_current_thread().enable_io().enable_time().build()?;
    let listener = {
        let _within = runtime.enter();
        TcpListener::from_std(listener)?
    };
    Ok(move |stopped: oneshot::Receiver<()>| {
        runtime.block_on(async {
            tokio::spawn(accept(listener, Arc::new(site)));
            // That the other end is gone is what is waited for.
            let _ = stopped.await;
        });
    })
}

async fn accept(listener: TcpListener, site: Arc<Site>) {
    let [places, farewells] = [MOST_CONNECTIONS, MOST_FAREWELLS].map(|most| Arc::new(Semaphore::new(most)));
    loop {
        let Ok((stream, _)) = listener.accept().await else {
            sleep(AGAIN).await;
            continue;
        };
        if let Ok(place) = Arc::clone(&places).try_acquire_owned() {
            let site = Arc::clone(&site);
            tokio::spawn(async move {
                let answer = |request| {
                    let site = Arc::clone(&site);
                    async move { site.answer(request).await }
                };
                connection(stream, (LIFE, GRACE), answer).await;
                drop(place);
            });
        } else if let Ok(place) = Arc::clone(&farewells).try_acquire_owned() {
            tokio::spawn(async move {
                connection(stream, (FAREWELL, Duration::ZERO), |_| async { crowded() }).await;
                drop(place);
            });
        }
    }
}

/// Answers requests for so long, and then the one at hand within its grace.
async fn connection<F: Future<Output = Answer>>(
    stream: TcpStream,
    (life, grace): (Duration, Duration),
    answer: impl Fn(Request<Incoming>) -> F,
) {
    let mut builder = http1::Builder::new();
    builder.timer(TokioTimer::new()).header_read_timeout(REQUEST).max_buf_size(MOST_HEAD);
    let service = service_fn(|request| {
        let answer = answer(request);
        async { Ok::<_, Infallible>(answer.await) }
    });
    let mut connection = pin!(builder.serve_connection(TokioIo::new(stream), service));
    // How a connection ends is the client's affair.
    if timeout(life, connection.as_mut()).await.is_err() {
        connection.as_mut().graceful_shutdown();
        let _ = timeout(grace, connection).await;
    }
}

impl Site {
    async fn answer(&self, request: Request<Incoming>) -> Answer {
        let text = |name| request.headers().get(name).map(|value| value.to_str().unwrap_or_default());
        let path = request.uri().path().to_owned();
        let below = match self.guard.admit(&path, text(header::HOST), text(header::ORIGIN)) {
            Ok(below) => below,
            Err(stranger) => return refused(stranger),
        };
        match (request.method(), below) {
            (&Method::GET, "") => answer(StatusCode::OK, "text/html; charset=utf-8", self.page.clone()),
            (&Method::GET, "pair") => self.pair(request.uri().query()).await,
            (&Method::POST, "settings") => self.set(request).await,
            (_, "" | "pair" | "settings") => {
                sentence(StatusCode::METHOD_NOT_ALLOWED, "that is asked for otherwise")
            }
            _ => sentence(
                StatusCode::NOT_FOUND,
                "there is nothing here; open the address that the program printed",
            ),
        }
    }

    async fn pair(&self, query: Option<&str>) -> Answer {
        let after = query.and_then(|query| query.strip_prefix("after=")?.parse().ok());
        let Some(after) = after else {
            return sentence(StatusCode::BAD_REQUEST, "say after which pair, as in pair?after=0");
        };
        let Ok(frame) = timeout(HOLD, self.slot.after(after)).await else {
            return answer(StatusCode::NO_CONTENT, "application/json", Bytes::new());
        };
        let mut told = answer(StatusCode::OK, "application/json", frame.json(&self.control));
        let age = format!("{:.1}", 1e3 * frame.age().as_secs_f64());
        told.headers_mut()
            .extend(HeaderValue::from_str(&age).ok().map(|age| (header::HeaderName::from_static(AGE), age)));
        told
    }

    async fn set(&self, request: Request<Incoming>) -> Answer {
        let body = timeout(REQUEST, Limited::new(request.into_body(), MOST_WISH).collect()).await;
        let Ok(Ok(wish)) = body else {
            return sentence(StatusCode::BAD_REQUEST, "the settings did not come, or are too long");
        };
        match self.control.wish(&wish.to_bytes()) {
            Ok(()) => answer(StatusCode::OK, "application/json", self.control.told().to_string().into()),
            Err(why) => sentence(StatusCode::BAD_REQUEST, &why),
        }
    }
}

fn refused(stranger: Stranger) -> Answer {
    sentence(StatusCode::FORBIDDEN, &stranger.to_string())
}

fn crowded() -> Answer {
    sentence(StatusCode::SERVICE_UNAVAILABLE, "too many pages look at this; close some of them")
}

fn sentence(status: StatusCode, words: &str) -> Answer {
    answer(status, "text/plain; charset=utf-8", format!("{words}\n").into())
}

/// An answer that no cache keeps, and no other page gets at.
fn answer(status: StatusCode, kind: &'static str, body: Bytes) -> Answer {
    let mut answer = Response::new(Full::new(body));
    *answer.status_mut() = status;
    let headers: &mut HeaderMap = answer.headers_mut();
    for (name, value) in [
        (header::CONTENT_TYPE, kind),
        (header::CACHE_CONTROL, "no-store"),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::X_FRAME_OPTIONS, "DENY"),
        (header::HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
    answer
}
