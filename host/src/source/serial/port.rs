//! Ports: both directions of a stream of bytes.
//!
//! A serial port of this machine, or a Unix-domain socket, as emulators offer one.

use std::convert::Infallible;
use std::fmt;
use std::io::{self, Read, Write};
use std::str::FromStr;
use std::time::Duration;

use super::list::{self, SerialPort};

/// Longest that a read waits.
pub const TICK: Duration = Duration::from_millis(50);
/// Longest that a write waits.
const WRITE_LIMIT: Duration = Duration::from_secs(2);

/// Both directions of a stream of bytes.
pub struct Port {
    /// What comes. A read ends within about [`TICK`]: with bytes, with `TimedOut` or `WouldBlock` where none
    /// came, with 0 bytes or another error at the end.
    pub reader: Box<dyn Read + Send>,
    /// What goes.
    pub writer: Box<dyn Write + Send>,
}

/// Where a device is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Address {
    /// At the only port that looks like one.
    Auto,
    /// At this serial port, or this socket.
    Path(String),
    /// At this socket.
    Socket(String),
}

impl FromStr for Address {
    type Err = Infallible;

    /// `auto`, `unix:PATH`, or a path.
    fn from_str(text: &str) -> Result<Self, Infallible> {
        Ok(match (text, text.strip_prefix("unix:")) {
            ("auto", _) => Self::Auto,
            (_, Some(path)) => Self::Socket(path.into()),
            _ => Self::Path(text.into()),
        })
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Auto => "the only port of a device",
            Self::Path(path) | Self::Socket(path) => path,
        })
    }
}

/// Why there is no port.
#[derive(Debug, thiserror::Error)]
pub enum PortError {
    /// The ports cannot be listed.
    #[error("the serial ports cannot be listed; name one with --port")]
    Unlisted(#[source] io::Error),
    /// No port looks like a device.
    #[error(
        "no camera device is plugged in, or it is none that is known by its USB identity; plug it in, or name its \
         port with --port"
    )]
    None,
    /// Several do.
    #[error("several devices are plugged in: {}; say which with --port", .0.join(", "))]
    Several(Vec<String>),
    /// It is not there.
    #[error("there is no port {path}; plug the device in, or give --port auto")]
    Missing {
        /// What was named.
        path: String,
    },
    /// It may not be used.
    #[error("you may not use {path}: join the group that owns it (often dialout or uucp) and log in again")]
    Forbidden {
        /// What was named.
        path: String,
    },
    /// It cannot be opened.
    #[error("{path} cannot be opened; it may be in use by another program")]
    Unopened {
        /// What was named.
        path: String,
        /// What the system said.
        source: io::Error,
    },
}

impl Address {
    /// Open the port. What waits there from before is thrown away; `baud` matters only where there are wires.
    ///
    /// # Errors
    /// A [`PortError`] that says what to do.
    pub fn open(&self, baud: u32) -> Result<Port, PortError> {
        match self {
            Self::Auto => {
                let found = list::ports().map_err(PortError::Unlisted)?;
                let mut devices: Vec<String> =
                    found.into_iter().filter(SerialPort::is_device).map(|port| port.path).collect();
                match (devices.pop(), devices.is_empty()) {
                    (None, _) => Err(PortError::None),
                    (Some(path), true) => serial(&path, baud),
                    (Some(last), false) => Err(PortError::Several([devices, vec![last]].concat())),
                }
            }
            Self::Socket(path) => socket(path),
            Self::Path(path) if is_socket(path) => socket(path),
            Self::Path(path) => serial(path, baud),
        }
    }
}

fn failed(path: &str, source: io::Error) -> PortError {
    let path = path.to_owned();
    match source.kind() {
        io::ErrorKind::NotFound => PortError::Missing { path },
        io::ErrorKind::PermissionDenied => PortError::Forbidden { path },
        _ => PortError::Unopened { path, source },
    }
}

fn serial(path: &str, baud: u32) -> Result<Port, PortError> {
    let open = || {
        let mut port = serialport::new(path, baud).timeout(TICK).open()?;
        // The lines say that somebody listens, to devices that care; a pseudo-terminal has none.
        let _ = port.write_data_terminal_ready(true);
        let _ = port.write_request_to_send(true);
        let _ = port.clear(serialport::ClearBuffer::Input);
        let mut writer = port.try_clone()?;
        writer.set_timeout(WRITE_LIMIT)?;
        Ok::<_, serialport::Error>(Port { reader: Box::new(port), writer: Box::new(writer) })
    };
    // Not every system tells a missing port from a busy one.
    let missing = cfg!(unix) && !std::path::Path::new(path).exists();
    open().map_err(|error| {
        if missing { PortError::Missing { path: path.into() } } else { failed(path, error.into()) }
    })
}

#[cfg(unix)]
fn is_socket(path: &str) -> bool {
    use std::os::unix::fs::FileTypeExt;
    std::fs::metadata(path).is_ok_and(|file| file.file_type().is_socket())
}

#[cfg(not(unix))]
fn is_socket(_: &str) -> bool {
    false
}

#[cfg(unix)]
fn socket(path: &str) -> Result<Port, PortError> {
    use std::os::unix::net::UnixStream;
    let open = || {
        let stream = UnixStream::connect(path)?;
        stream.set_read_timeout(Some(TICK))?;
        stream.set_write_timeout(Some(WRITE_LIMIT))?;
        Ok(Port { reader: Box::new(stream.try_clone()?), writer: Box::new(stream) })
    };
    open().map_err(|error| failed(path, error))
}

#[cfg(not(unix))]
fn socket(path: &str) -> Result<Port, PortError> {
    Err(failed(path, io::ErrorKind::Unsupported.into()))
}
