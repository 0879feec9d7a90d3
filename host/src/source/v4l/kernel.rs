//! The kernel's side: the one file that talks to a real camera, by the crate `v4l`.
//!
//! What that crate (0.14) leaves to its users, and is done here:
//!
//! * A wait that times out or is interrupted leaves its stream unusable, as the next call hands the kernel a
//!   buffer that it still has. So the wait comes first, and only a frame that is there is asked for; after a
//!   time-out the stream is dropped, and a new one made.
//! * Without a time-out it waits for ever, so one is always set.
//! * It gives the whole buffer: only the bytes that the driver filled are taken.
//! * What the driver made of a format is compared with what was asked for.
//! * Dropping a stream panics if the kernel refuses to stop it. So it is stopped first; one that cannot be
//!   stopped is left alone until the program ends.
//!
//! Nodes that take no pictures, such as the metadata node of every USB camera, are told by what the node, not
//! the device, can do.

use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use v4l::buffer::{Flags, Metadata, Type};
use v4l::capability::{Capabilities, Flags as Capability};
use v4l::control::{Control, Value};
use v4l::format::FourCC;
use v4l::fraction::Fraction;
use v4l::frameinterval::FrameIntervalEnum;
use v4l::framesize::FrameSizeEnum;
use v4l::io::mmap::Stream;
use v4l::io::traits::{CaptureStream, Stream as _};
use v4l::video::Capture;
use v4l::video::capture::Parameters;

use super::choose::{Camera, Choice, Offer, Sizes, offers};
use super::device::{Device, Frame, now};
use super::dial::{Controls, Dial};
use super::errors::{CameraError, Doing, errno};
use super::format::{Format, FourCc};
use super::identity::{Identity, SYSTEM};

/// Frames that the kernel may fill while one is held.
const BUFFERS: u32 = 4;
/// `poll`'s name for bytes to be read.
const READABLE: i16 = 1;

/// A camera of the kernel.
pub struct Kernel {
    camera: Camera,
    identity: Identity,
    /// None while it is unplugged: a node that somebody holds is not given back.
    device: Option<v4l::Device>,
    /// What it was set to.
    choice: Option<Choice>,
    stream: Option<Stream<'static>>,
    format: Format,
    period: Option<Duration>,
}

impl Kernel {
    /// Opens a camera and asks what it offers.
    ///
    /// # Errors
    ///
    /// If it cannot be opened, or takes no pictures.
    pub fn open(path: &Path) -> Result<Self, CameraError> {
        let system = |doing| move |error: io::Error| CameraError::system(path, doing, &error);
        let device = v4l::Device::with_path(path).map_err(system(Doing::Open))?;
        let can = device.query_caps().map_err(system(Doing::Query))?;
        if let Some(what) = lacks(&can) {
            return Err(CameraError::NotACamera { path: path.into(), what });
        }
        let current = device.format().map_err(system(Doing::Query))?;
        let format = ours(&current);
        let identity = identity(path, &can);
        let camera = Camera {
            path: path.into(),
            name: can.card,
            driver: can.driver,
            bus: can.bus,
            offers: offered(&device),
            current: (format.code, (format.width, format.height)),
        };
        Ok(Self { camera, identity, device: Some(device), choice: None, stream: None, format, period: None })
    }

    /// What it says of itself.
    #[must_use]
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Sets it.
    ///
    /// # Errors
    ///
    /// If the driver refuses, or takes another format.
    pub fn set(&mut self, choice: &Choice) -> Result<(), CameraError> {
        let path = &self.camera.path;
        let (width, height) = choice.size;
        let asked = v4l::Format::new(width, height, FourCC::new(&choice.code.0));
        let refused = |error| CameraError::system(path, Doing::Set, &error);
        let device = plugged(self.device.as_ref()).map_err(refused)?;
        self.format = ours(&device.set_format(&asked).map_err(refused)?);
        let wanted = Format { code: choice.code, width, height, stride: self.format.stride };
        if self.format != wanted {
            let (path, offers) = (path.clone(), offers(&self.camera));
            return Err(CameraError::Adjusted { path, wanted, got: self.format, offers });
        }
        if let Some(rate) = choice.rate {
            // Drivers take the nearest that they have, and those without rates refuse: neither is a failure.
            let _ = device.set_params(&Parameters::new(Fraction::new(1000, (1e3 * rate).round() as u32)));
        }
        self.period = device.params().ok().and_then(|params| seconds(params.interval));
        self.choice = Some(*choice);
        Ok(())
    }

    /// Looks for cameras that have the same serial number, so that none is taken for this one when it is unplugged.
    pub fn tell_apart(&mut self) {
        let (there, _) = cameras();
        self.identity = self.identity.clone().among(&there);
    }

    /// Its exposure, if it has controls for it. The node is opened once more, so that it can be set while pictures are
    /// taken.
    #[must_use]
    pub fn dial(&self) -> Option<Dial> {
        Dial::find(Knobs(v4l::Device::with_path(&self.camera.path).ok()?))
    }
}

/// A camera's controls. What the crate says of them all at once is not asked for: it panics on a kind of control that
/// it does not know.
struct Knobs(v4l::Device);

impl Controls for Knobs {
    fn get(&self, id: u32) -> io::Result<i64> {
        match self.0.control(id)?.value {
            Value::Integer(value) => Ok(value),
            _ => Err(ErrorKind::InvalidData.into()),
        }
    }

    fn set(&mut self, id: u32, value: i64) -> io::Result<()> {
        self.0.set_control(Control { id, value: Value::Integer(value) })
    }
}

impl Device for Kernel {
    fn path(&self) -> &Path {
        &self.camera.path
    }

    fn format(&self) -> Format {
        self.format
    }

    fn period(&self) -> Option<Duration> {
        self.period
    }

    fn start(&mut self) -> io::Result<()> {
        end(self.stream.take());
        let device = plugged(self.device.as_ref())?;
        let mut stream = Stream::with_buffers(device, Type::VideoCapture, BUFFERS)?;
        let started = queue(&mut stream).and_then(|()| stream.start());
        if started.is_ok() {
            self.stream = Some(stream);
        } else {
            end(Some(stream));
        }
        started
    }

    fn next(&mut self, patience: Duration) -> io::Result<Frame> {
        let Some(stream) = &mut self.stream else { return Err(io::Error::from_raw_os_error(errno::EINVAL)) };
        wait(stream, patience)?;
        stream.set_timeout(patience);
        let (bytes, about) = CaptureStream::next(stream)?;
        Ok(frame(bytes, about))
    }

    fn find_again(&mut self) -> bool {
        end(self.stream.take());
        self.device = None;
        let (there, paths) = cameras();
        let Some(place) = self.identity.find(&there) else { return false };
        // One that has just come may not be ready yet, and is looked for again.
        let opened = Self::open(&paths[place])
            .and_then(|mut found| self.choice.map_or(Ok(()), |choice| found.set(&choice)).map(|()| found));
        let Ok(mut found) = opened else { return false };
        // What tells it apart was judged when all were there.
        found.identity = self.identity.clone();
        *self = found;
        true
    }
}

impl Drop for Kernel {
    fn drop(&mut self) {
        end(self.stream.take());
    }
}

/// The device, unless it is unplugged.
fn plugged(device: Option<&v4l::Device>) -> io::Result<&v4l::Device> {
    device.ok_or_else(|| io::Error::from_raw_os_error(errno::ENODEV))
}

/// Why a node is no camera that can be read; nothing if it is one.
fn lacks(can: &Capabilities) -> Option<&'static str> {
    if can.capabilities.contains(Capability::VIDEO_CAPTURE_MPLANE) {
        Some("its pictures come in several planes, which are not read")
    } else if !can.capabilities.contains(Capability::VIDEO_CAPTURE) {
        Some("it has no video capture capability")
    } else if !can.capabilities.contains(Capability::STREAMING) {
        Some("it cannot stream")
    } else {
        None
    }
}

fn identity(path: &Path, can: &Capabilities) -> Identity {
    Identity::of(path, (can.card.clone(), can.bus.clone()), Path::new(SYSTEM))
}

/// The cameras that are there, and their nodes.
fn cameras() -> (Vec<Identity>, Vec<PathBuf>) {
    let look = |path: PathBuf| {
        let can = v4l::Device::with_path(&path).ok()?.query_caps().ok()?;
        lacks(&can).is_none().then(|| (identity(&path, &can), path))
    };
    nodes().into_iter().filter_map(look).unzip()
}

/// Hands the kernel all buffers but the first, which follows when the first frame is taken. A driver may have
/// made fewer than it was asked for.
fn queue(stream: &mut Stream<'_>) -> io::Result<()> {
    for index in 1..BUFFERS as usize {
        match CaptureStream::queue(stream, index) {
            Err(error) if index > 1 && error.raw_os_error() == Some(errno::EINVAL) => break,
            result => result?,
        }
    }
    Ok(())
}

/// Waits until a frame is there.
fn wait(stream: &Stream<'_>, patience: Duration) -> io::Result<()> {
    let end = Instant::now() + patience;
    loop {
        let left = end.saturating_duration_since(Instant::now());
        match stream.handle().poll(READABLE, left.as_millis().try_into().unwrap_or(i32::MAX)) {
            Ok(0) => return Err(ErrorKind::TimedOut.into()),
            Ok(_) => return Ok(()),
            Err(error) if error.raw_os_error() == Some(errno::EINTR) => {}
            Err(error) => return Err(error),
        }
    }
}

/// Stops a stream and gives its memory back.
fn end(stream: Option<Stream<'static>>) {
    let Some(mut stream) = stream else { return };
    match stream.stop() {
        Err(error) if error.raw_os_error() != Some(errno::ENODEV) => std::mem::forget(stream),
        _ => drop(stream),
    }
}

/// A copy of what the driver filled, so that the kernel gets its buffer back.
fn frame(buffer: &[u8], about: &Metadata) -> Frame {
    let used = (about.bytesused as usize).min(buffer.len());
    let is_monotonic = about.flags & Flags::TIMESTAMP_MASK == Flags::TIMESTAMP_MONOTONIC;
    Frame {
        bytes: buffer[..used].to_vec(),
        taken: is_monotonic.then(|| about.timestamp.into()),
        arrived: now(),
        sequence: about.sequence,
        broken: used == 0 || about.flags.contains(Flags::ERROR),
    }
}

fn ours(format: &v4l::Format) -> Format {
    Format {
        code: FourCc(format.fourcc.repr),
        width: format.width,
        height: format.height,
        stride: format.stride,
    }
}

/// Every format, size and rate that a driver lists. What it does not list stays empty.
fn offered(device: &v4l::Device) -> Vec<Offer> {
    let rates = |code: FourCC, width: u32, height: u32| -> Vec<f64> {
        let intervals = device.enum_frameintervals(code, width, height).unwrap_or_default();
        let rates = intervals.into_iter().flat_map(|interval| match interval.interval {
            FrameIntervalEnum::Discrete(one) => vec![one],
            FrameIntervalEnum::Stepwise(steps) => vec![steps.min, steps.max],
        });
        rates.filter_map(|interval| seconds(interval).map(|period| 1.0 / period.as_secs_f64())).collect()
    };
    let sizes = |code: FourCC| {
        let sizes = device.enum_framesizes(code).unwrap_or_default();
        let sizes = sizes.into_iter().map(|size| match size.size {
            FrameSizeEnum::Discrete(one) => {
                Sizes::One((one.width, one.height), rates(code, one.width, one.height))
            }
            FrameSizeEnum::Stepwise(steps) => Sizes::Range {
                least: (steps.min_width, steps.min_height),
                most: (steps.max_width, steps.max_height),
                step: (steps.step_width, steps.step_height),
            },
        });
        sizes.collect()
    };
    let formats = device.enum_formats().unwrap_or_default().into_iter();
    let offer = |format: v4l::format::Description| Offer {
        code: FourCc(format.fourcc.repr),
        sizes: sizes(format.fourcc),
        name: format.description,
    };
    formats.map(offer).collect()
}

/// A fraction of a second as a time.
fn seconds(fraction: Fraction) -> Option<Duration> {
    let Fraction { numerator, denominator } = fraction;
    let is_time = numerator > 0 && denominator > 0;
    is_time.then(|| Duration::from_secs_f64(f64::from(numerator) / f64::from(denominator)))
}

/// The nodes of video devices, in the order of their numbers.
fn nodes() -> Vec<PathBuf> {
    let entries = fs::read_dir("/dev").into_iter().flatten().filter_map(|entry| Some(entry.ok()?.path()));
    let numbered = |path: PathBuf| {
        let number: u32 = path.file_name()?.to_str()?.strip_prefix("video")?.parse().ok()?;
        Some((number, path))
    };
    let mut nodes: Vec<(u32, PathBuf)> = entries.filter_map(numbered).collect();
    nodes.sort();
    nodes.into_iter().map(|(_, path)| path).collect()
}

/// Every camera of this machine, in the order of its numbers, or why it cannot be asked. Nodes that are no
/// cameras are left out.
///
/// # Errors
///
/// None here; where there is no Video4Linux, that.
pub fn list() -> Result<Vec<Result<Camera, CameraError>>, CameraError> {
    let ask = |path: PathBuf| match Kernel::open(&path) {
        Ok(kernel) => Some(Ok(kernel.camera().clone())),
        Err(CameraError::NotACamera { .. }) => None,
        Err(error) => Some(Err(error)),
    };
    Ok(nodes().into_iter().filter_map(ask).collect())
}
