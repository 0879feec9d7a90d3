//! What can go wrong with a camera, each as one sentence that says what to do.

use std::path::{Path, PathBuf};
use std::time::Duration;

use super::format::{Format, FormatError};

/// What a device was asked to do when the system refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Doing {
    /// Open it.
    Open,
    /// Say what it can.
    Query,
    /// Take a format or a rate.
    Set,
    /// Start to send.
    Start,
    /// Hand over a frame.
    Read,
}

impl Doing {
    /// How a sentence about it begins.
    const fn words(self) -> &'static str {
        match self {
            Self::Open => "cannot be opened",
            Self::Query => "does not say what it can do",
            Self::Set => "does not take the format",
            Self::Start => "does not start to send",
            Self::Read => "does not hand over a frame",
        }
    }
}

/// Numbers of the system's errors that a camera gives, as Linux has them on all machines with cameras: x86, ARM,
/// RISC-V.
pub mod errno {
    /// Not permitted.
    pub const EPERM: i32 = 1;
    /// No such file.
    pub const ENOENT: i32 = 2;
    /// Interrupted by a signal.
    pub const EINTR: i32 = 4;
    /// Input or output failed.
    pub const EIO: i32 = 5;
    /// No such device or address.
    pub const ENXIO: i32 = 6;
    /// Try again.
    pub const EAGAIN: i32 = 11;
    /// No memory.
    pub const ENOMEM: i32 = 12;
    /// Permission denied.
    pub const EACCES: i32 = 13;
    /// Busy.
    pub const EBUSY: i32 = 16;
    /// No such device.
    pub const ENODEV: i32 = 19;
    /// Invalid argument.
    pub const EINVAL: i32 = 22;
    /// Too many open files.
    pub const EMFILE: i32 = 24;
    /// Not for this kind of file.
    pub const ENOTTY: i32 = 25;
    /// No space left: bandwidth.
    pub const ENOSPC: i32 = 28;
    /// Broken pipe.
    pub const EPIPE: i32 = 32;
    /// No link.
    pub const ENOLINK: i32 = 67;
    /// Protocol error.
    pub const EPROTO: i32 = 71;
    /// Bad exchange of messages.
    pub const EILSEQ: i32 = 84;
    /// Shut down.
    pub const ESHUTDOWN: i32 = 108;
    /// Timed out.
    pub const ETIMEDOUT: i32 = 110;
}

/// Whether an error means that the device has gone.
#[must_use]
pub fn is_gone(code: i32) -> bool {
    matches!(code, errno::ENODEV | errno::ENXIO | errno::ENOENT | errno::ESHUTDOWN)
}

/// What an error means and what to do, for each that cameras are known to give; nothing for others.
#[must_use]
pub fn advice(doing: Doing, code: i32) -> Option<&'static str> {
    let words = match (doing, code) {
        (Doing::Open, errno::ENOENT) => "there is no such device; `host list-devices` shows those there are",
        (Doing::Open, errno::EACCES | errno::EPERM) => {
            "you may not use it; add yourself to the group `video` (sudo usermod -aG video $USER) and log in again"
        }
        (Doing::Open, errno::EMFILE) => {
            "this program has too many files open; raise the limit with `ulimit -n`"
        }
        (Doing::Query, errno::ENOTTY | errno::EINVAL) => {
            "it is no Video4Linux device; `host list-devices` shows those there are"
        }
        (Doing::Set, errno::EINVAL) => "it knows no such format; `host list-devices` shows what it offers",
        (Doing::Start, errno::ENOSPC) => {
            "the USB bus has no bandwidth left for it; take --format MJPG, a lower --fps or a smaller --size, or \
             plug the cameras into ports of different USB controllers, without a hub"
        }
        (Doing::Start, errno::EINVAL) => {
            "it refuses the format it was set to; try another --format or --size from `host list-devices`"
        }
        (Doing::Start, errno::EPIPE | errno::ENOLINK) => {
            "its parts are not linked to each other; set up its media pipeline with media-ctl, as its maker says"
        }
        (_, errno::EBUSY) => "another program uses it; end that one (`fuser -v /dev/video*` names it)",
        (_, errno::ENODEV | errno::ENXIO | errno::ENOENT | errno::ESHUTDOWN) => {
            "it has been unplugged or has reset itself; check cable, hub and power, and start again"
        }
        (_, errno::EIO | errno::EPROTO | errno::EILSEQ | errno::EPIPE | errno::ETIMEDOUT) => {
            "the connection to it failed; check cable and hub, plug it in again, or try another port"
        }
        (_, errno::ENOMEM) => "there is no memory for its frames; take a smaller --size",
        (_, errno::EAGAIN) => "it has no frame ready; start again",
        _ => return None,
    };
    Some(words)
}

/// What went wrong with a camera.
#[derive(Debug, thiserror::Error)]
pub enum CameraError {
    /// The system refused.
    #[error("{} {}: {}", path.display(), doing.words(), explained(*doing, *code))]
    System {
        /// The device.
        path: PathBuf,
        /// What it was asked.
        doing: Doing,
        /// The system's number of the error.
        code: i32,
    },
    /// It sends nothing.
    #[error(
        "{} sent no frame for {:.0} s, though it was started {times} times; check that its lens cap, privacy switch \
         and cable let it, plug it in again, or take a lower --fps", path.display(), waited.as_secs_f64()
    )]
    Silent {
        /// The device.
        path: PathBuf,
        /// How long nothing came.
        waited: Duration,
        /// How often it was started.
        times: u32,
    },
    /// Not a camera.
    #[error(
        "{} takes no pictures ({what}); a camera often has a second node for metadata, so try its neighbour: \
         `host list-devices` shows the cameras", path.display()
    )]
    NotACamera {
        /// The device.
        path: PathBuf,
        /// What it is.
        what: &'static str,
    },
    /// The device does not offer what was asked for.
    #[error("{} {what}; it offers {offers}", path.display())]
    NotOffered {
        /// The device.
        path: PathBuf,
        /// What is wrong.
        what: String,
        /// What can be asked for.
        offers: String,
    },
    /// The driver took another format than it was given.
    #[error(
        "{} was asked for {}, but gives {}; ask for that, or for another --size or --format; it offers {offers}",
        path.display(), shown(wanted), shown(got)
    )]
    Adjusted {
        /// The device.
        path: PathBuf,
        /// What it was asked for.
        wanted: Format,
        /// What it took.
        got: Format,
        /// What can be asked for.
        offers: String,
    },
    /// Frame after frame cannot be read.
    #[error("{} sent {count} frames in a row that cannot be read: {source}; try another --format", path.display())]
    Unreadable {
        /// The device.
        path: PathBuf,
        /// How many.
        count: u32,
        /// What is wrong with the last.
        source: FormatError,
    },
    /// The frames of two cameras never come together.
    #[error(
        "{frames} frames of {} and {} came without one pair less than half a period apart; set both to the same \
         --fps, and give them the same light or a fixed exposure", paths[0].display(), paths[1].display()
    )]
    Apart {
        /// The devices.
        paths: [PathBuf; 2],
        /// Frames without partner.
        frames: u64,
    },
    /// Two cameras of different sizes.
    #[error(
        "the left camera gives {}x{} px and the right one {}x{}; ask both for one --size", left.0, left.1, right.0, right.1
    )]
    Sizes {
        /// The left camera's size, px.
        left: (u32, u32),
        /// The right camera's, px.
        right: (u32, u32),
    },
    /// No such thing on this system.
    #[error(
        "cameras are read through Video4Linux, which only Linux has; record pairs by other means, then `host replay` \
         the files"
    )]
    NotLinux,
}

impl CameraError {
    /// What the system said when `path` was asked something.
    #[must_use]
    pub fn system(path: &Path, doing: Doing, error: &std::io::Error) -> Self {
        Self::System { path: path.into(), doing, code: error.raw_os_error().unwrap_or(0) }
    }
}

fn explained(doing: Doing, code: i32) -> String {
    let system = std::io::Error::from_raw_os_error(code);
    advice(doing, code).map_or_else(|| format!("{system}; plug it in again"), Into::into)
}

fn shown(format: &Format) -> String {
    format!("{} {}x{}", format.code, format.width, format.height)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(doing: Doing, code: i32) -> String {
        CameraError::System { path: "/dev/video0".into(), doing, code }.to_string()
    }

    #[test]
    fn every_known_error_says_what_to_do() {
        for (doing, code, words) in [
            (Doing::Open, errno::ENOENT, "host list-devices"),
            (Doing::Open, errno::EACCES, "group `video`"),
            (Doing::Open, errno::EPERM, "group `video`"),
            (Doing::Open, errno::EBUSY, "another program"),
            (Doing::Open, errno::EMFILE, "ulimit"),
            (Doing::Query, errno::ENOTTY, "no Video4Linux device"),
            (Doing::Set, errno::EBUSY, "another program"),
            (Doing::Set, errno::EINVAL, "what it offers"),
            (Doing::Start, errno::ENOSPC, "--format MJPG"),
            (Doing::Start, errno::EPIPE, "media-ctl"),
            (Doing::Start, errno::ENOLINK, "media-ctl"),
            (Doing::Start, errno::EINVAL, "another --format"),
            (Doing::Start, errno::EBUSY, "another program"),
            (Doing::Start, errno::ENOMEM, "smaller --size"),
            (Doing::Start, errno::EIO, "another port"),
            (Doing::Read, errno::ENODEV, "unplugged"),
            (Doing::Read, errno::ENXIO, "unplugged"),
            (Doing::Read, errno::ESHUTDOWN, "unplugged"),
            (Doing::Read, errno::EIO, "another port"),
            (Doing::Read, errno::EPROTO, "another port"),
            (Doing::Read, errno::EILSEQ, "another port"),
            (Doing::Read, errno::ETIMEDOUT, "another port"),
            (Doing::Read, errno::EPIPE, "another port"),
            (Doing::Read, errno::EAGAIN, "start again"),
        ] {
            let told = told(doing, code);
            assert!(told.starts_with("/dev/video0 ") && told.contains(words), "{doing:?} {code}: {told}");
            assert_eq!(told.lines().count(), 1);
        }
    }

    #[test]
    fn an_unknown_error_is_told_as_the_system_tells_it() {
        let told = told(Doing::Read, 122);
        assert!(told.contains("os error 122"), "{told}");
    }

    #[test]
    fn only_what_has_gone_is_gone() {
        assert!(is_gone(errno::ENODEV) && is_gone(errno::ENOENT));
        assert!(!is_gone(errno::EIO) && !is_gone(errno::EINTR));
    }
}
