//! A page that follows pairs as they are made, for a browser on this machine.
//!
//! ```text
//! source -> settings (control) -> reconstruct -> Shot -> slot: the newest alone -> frame: as JSON, once, when asked for
//!               ^                                                                      |
//!               +---- what a person sets <---- guard <---- server: HTTP on 127.0.0.1 <-+
//! ```
//!
//! Whoever makes pairs puts each into the slot and goes on: it never waits for a browser, and nothing is encoded that
//! nobody asks for. A page asks for the pair after the one it has drawn, so a slow one skips pairs, and neither the
//! source nor other pages notice (`docs/decisions/0019-live-page.md`).

pub mod control;
mod frame;
mod guard;
pub(crate) mod rate;
mod server;
mod slot;

use std::io::{self, ErrorKind};
use std::net::{Ipv4Addr, TcpListener};
use std::sync::Arc;
use std::thread::{self, JoinHandle};

use tokio::sync::oneshot;

use crate::report::page;
use control::{Control, Limits, Settings};
use frame::Frame;
pub use frame::Shot;
use guard::Guard;
use rate::Rate;
use slot::Slot;

/// What a live page may ask for beyond what a report may.
const POLICY: &str = "; connect-src 'self'";

/// Why there is no live page.
#[derive(Debug, thiserror::Error)]
pub enum LiveError {
    /// Another program has the port.
    #[error(
        "port {0} of this machine is taken; give another one with --view PORT, or --view alone for any free one"
    )]
    Taken(u16),
    /// The system does not let us have it.
    #[error("cannot listen on port {0} of this machine: {1}; --view alone takes any free one")]
    Refused(u16, io::Error),
    /// There are no random numbers to make a secret of.
    #[error("the system gives no random numbers for the address of the live page: {0}")]
    NoSecret(getrandom::Error),
    /// There is no thread for it.
    #[error("the live page cannot be served: {0}")]
    Server(io::Error),
}

/// A live page that is being served; it ends when this is dropped.
#[derive(Debug)]
pub struct View {
    address: String,
    title: Arc<str>,
    slot: Arc<Slot>,
    control: Arc<Control>,
    shown: u64,
    rate: Rate,
    /// Dropped first, which ends the thread.
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl View {
    /// Serve a page called `title` on a port of this machine alone; 0 is any free one.
    ///
    /// # Errors
    /// A [`LiveError`] that says what to do.
    pub fn open(port: u16, title: &str, settings: Settings, limits: Limits) -> Result<Self, LiveError> {
        let listener =
            TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(|error| match error.kind() {
                ErrorKind::AddrInUse => LiveError::Taken(port),
                _ => LiveError::Refused(port, error),
            })?;
        let port = listener.local_addr().map_err(LiveError::Server)?.port();
        let guard = Guard::new(port).map_err(LiveError::NoSecret)?;
        let (address, slot) = (guard.address(), Arc::new(Slot::default()));
        let control = Arc::new(Control::new(settings, limits));
        let live = page::Live {
            policy: POLICY,
            style: include_str!("page/live.css"),
            controls: include_str!("page/live.html"),
            script: include_str!("page/live.js"),
        };
        let page = page::live(title, &live).into();
        let site = server::Site { guard, page, slot: Arc::clone(&slot), control: Arc::clone(&control) };
        let (stop, stopped) = oneshot::channel();
        let serve = server::prepare(listener, site).map_err(LiveError::Server)?;
        let thread = thread::Builder::new().name("live page".into()).spawn(move || serve(stopped));
        let (stop, thread) = (Some(stop), Some(thread.map_err(LiveError::Server)?));
        Ok(Self {
            address,
            title: title.into(),
            slot,
            control,
            shown: 0,
            rate: Rate::default(),
            stop,
            thread,
        })
    }

    /// Where to look, with the secret that lets one look.
    #[must_use]
    pub fn address(&self) -> &str {
        &self.address
    }

    /// What a person may set.
    #[must_use]
    pub const fn control(&self) -> &Arc<Control> {
        &self.control
    }

    /// Show a pair in place of the one before, which is returned if nobody is looking at it any more.
    pub fn show(&mut self, shot: Shot) -> Option<Shot> {
        let rate = self.rate.step();
        self.shown += 1;
        if let Some(pictures) = &shot.pictures {
            self.control.saw(pictures[0].dimensions());
        }
        let before = self.slot.put(Frame::new((self.shown, rate), Arc::clone(&self.title), shot));
        before.and_then(Arc::into_inner).map(Frame::into_shot)
    }
}

impl Drop for View {
    fn drop(&mut self) {
        self.stop.take();
        if let Some(thread) = self.thread.take() {
            // Were it to have panicked, the pairs would be no worse.
            let _ = thread.join();
        }
    }
}
