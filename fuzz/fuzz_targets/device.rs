//! A device in the boards' own loop: any bytes and any commands at any time, a flash that holds anything, eyes, link
//! and flash that break. It goes on, sends nothing but whole messages, and loses count of no pair.
#![no_main]

use arbitrary::Arbitrary;
use embedded_hal::delay::DelayNs;
use firmware::device::{Birth, Desk, Device, RETRY_US};
use firmware::drive::{Ports, step};
use firmware::memory::{Small, Storage};
use firmware::ports::{
    CameraError, CameraFault, CameraPair, Exposure, Flash, FlashError, Identity, Link, LinkError, Side,
    Stamps, Watchdog,
};
use fuzz::figure::{Figure, draw};
use libfuzzer_sys::fuzz_target;
use oracle::camera::Time;
use oracle::wire::{Lists, check, model};
use shared::camera::PairModel;
use shared::stage::warp::knots;
use shared::wire::{
    Decoder, Frame, Health, MAX_FRAME, PairReport, PictureKind, ResetReason, ToDevice, ToHost,
};
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

const SIZE: [usize; 2] = [160, 120];
const KNOTS: usize = knots(<Small as Storage>::CAPACITIES.size);

#[derive(Arbitrary, Debug)]
enum Happening<'a> {
    Bytes(&'a [u8]),
    Frame(u8, u16, &'a [u8]),
    /// A good calibration with some bytes of its payload changed.
    Upload(Option<(u16, [u8; 8])>),
    Start,
    Scene(Figure),
    Capture(Fault),
    Read(Fault),
    Control(bool),
    Jam(Option<bool>),
    Flash(Option<bool>),
    Later(u32),
}

#[derive(Arbitrary, Clone, Copy, Debug)]
enum Fault {
    Bus,
    TimeLimit,
    Length,
}

impl From<Fault> for CameraFault {
    fn from(fault: Fault) -> Self {
        match fault {
            Fault::Bus => Self::PictureBus,
            Fault::TimeLimit => Self::TimeLimit(1),
            Fault::Length => Self::Length(1),
        }
    }
}

/// What is around the device.
#[derive(Default)]
struct World {
    picture: Vec<u8>,
    capture: Option<Fault>,
    read: Option<Fault>,
    dead: bool,
    bytes: VecDeque<u8>,
    sent: Vec<u8>,
    jam: Option<LinkError>,
    page: Vec<u8>,
    flash: Option<FlashError>,
}

#[derive(Clone)]
struct Outside(Rc<RefCell<World>>);

const fn left(fault: CameraFault) -> CameraError {
    CameraError { side: Side::Left, fault }
}

impl Outside {
    fn control(&self) -> Result<(), CameraError> {
        if self.0.borrow().dead { Err(left(CameraFault::ControlBus)) } else { Ok(()) }
    }
}

impl CameraPair for Outside {
    const WIDTH: usize = SIZE[0];
    const HEIGHT: usize = SIZE[1];

    fn start(&mut self, _: Exposure) -> Result<[Identity; 2], CameraError> {
        self.control().map(|()| [Identity { sensor: 0x2642, controller: 0x73, sends_dummy: false }; 2])
    }

    fn expose(&mut self, _: Exposure) -> Result<(), CameraError> {
        self.control()
    }

    fn capture(&mut self) -> Result<Stamps, CameraError> {
        let fault = self.0.borrow_mut().capture.take();
        fault.map_or(Ok(Stamps { done: [5, 7] }), |fault| Err(left(fault.into())))
    }

    fn read(&mut self, side: Side, line: &mut dyn FnMut(usize, &[u8])) -> Result<(), CameraError> {
        let world = self.0.borrow_mut();
        let rows = if world.read.is_some() { SIZE[1] / 2 } else { SIZE[1] };
        // The right eye sees all of it a little further left.
        let shift = 8 * side as usize;
        for (v, row) in world.picture.chunks(SIZE[0]).take(rows).enumerate() {
            let mut row = row.to_vec();
            row.rotate_left(shift);
            line(v, &row);
        }
        drop(world);
        let fault = self.0.borrow_mut().read.take();
        fault.map_or(Ok(()), |fault| Err(CameraError { side, fault: fault.into() }))
    }

    fn self_test(&mut self) -> Result<(), CameraError> {
        self.control()
    }
}

impl Link for Outside {
    fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, LinkError> {
        let bytes = &mut self.0.borrow_mut().bytes;
        let count = buffer.len().min(bytes.len());
        buffer.iter_mut().zip(bytes.drain(..count)).for_each(|(slot, byte)| *slot = byte);
        Ok(count)
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), LinkError> {
        let mut world = self.0.borrow_mut();
        world.jam.map_or(Ok(()), Err)?;
        world.sent.extend(bytes);
        Ok(())
    }
}

impl Flash for Outside {
    fn capacity(&self) -> usize {
        1024
    }

    fn load(&mut self, buffer: &mut [u8]) -> Result<usize, FlashError> {
        let world = self.0.borrow();
        world.flash.map_or(Ok(()), Err)?;
        let place = buffer.get_mut(..world.page.len()).ok_or(FlashError::TooLong(1024))?;
        place.copy_from_slice(&world.page);
        Ok(place.len())
    }

    fn save(&mut self, record: &[u8]) -> Result<(), FlashError> {
        let mut world = self.0.borrow_mut();
        world.flash.map_or(Ok(()), Err)?;
        world.page = record.to_vec();
        Ok(())
    }
}

impl Watchdog for Outside {
    fn feed(&mut self) {}
}

/// A calibration of pictures of this device's size.
fn calibration() -> PairModel {
    let [width, height] = SIZE.map(|side| side as u16);
    PairModel { width, height, columns: [79.5, 80.25], row: 59.5, focal: 187.0, ..model(None) }
}

/// The frame of its upload, and the frame's type and payload.
fn upload() -> (Vec<u8>, (u8, Vec<u8>)) {
    let frame = oracle::wire::command_bytes(&ToDevice::Calibration(calibration()));
    let (kind, _, payload) = oracle::link::frames(&frame).pop().expect("a frame");
    (frame, (kind, payload))
}

struct Bench {
    storage: Box<Small>,
    desk: Box<Desk<KNOTS>>,
    lists: Lists,
    frame: [u8; MAX_FRAME],
}

thread_local! {
    /// Memory as the devices before left it.
    static BENCH: RefCell<Bench> = RefCell::new(Bench {
        storage: Box::new(Small::new()),
        desk: Box::new(Desk::new()),
        lists: Lists::default(),
        frame: [0; MAX_FRAME],
    });
}

fuzz_target!(|input: (Option<&[u8]>, Vec<Happening<'_>>)| {
    let (page, happenings) = input;
    BENCH.with_borrow_mut(|bench| {
        let Bench { storage, desk, lists, frame } = bench;
        let birth = Birth { board: "bench", reset: ResetReason::Power, watchdog_resets: 0 };
        let mut device = Device::new(&mut **storage, &mut **desk, birth);
        let world = Rc::new(RefCell::new(World {
            picture: draw(SIZE[0], SIZE[1], &[]),
            page: page.map_or_else(|| upload().0, |page| page[..page.len().min(1024)].to_vec()),
            ..World::default()
        }));
        let outside = || Outside(world.clone());
        let mut time = Time::default();
        let mut ports = Ports {
            cameras: outside(),
            link: outside(),
            clock: time.clone(),
            flash: outside(),
            watchdog: outside(),
        };
        let mut decoder = Decoder::new(frame);
        let told = RefCell::new(Told::default());
        // Let it do so many things, and hear what it says.
        let mut steps = |count: usize, time: &mut Time| {
            for _ in 0..count {
                let _ = step(&mut device, &mut ports);
                time.delay_us(100);
                for byte in world.borrow_mut().sent.drain(..) {
                    if let Some(frame) = decoder.push(byte) {
                        told.borrow_mut().take(&frame, lists);
                    }
                }
            }
        };
        let order = |commands: &[ToDevice]| {
            world.borrow_mut().bytes.extend(commands.iter().flat_map(oracle::wire::command_bytes));
        };
        steps(4, &mut time);
        // More are but slow.
        for happening in happenings.iter().take(24) {
            happen(happening, &mut world.borrow_mut(), &mut time);
            steps(12, &mut time);
        }
        {
            let mut world = world.borrow_mut();
            *world = World { picture: std::mem::take(&mut world.picture), ..World::default() };
        }
        told.borrow_mut().greeted = false;
        order(&[ToDevice::Hello]);
        let says_hello = (0..200).any(|_| {
            steps(1, &mut time);
            told.borrow().greeted
        });
        assert!(says_hello, "it says who it is, whatever happened");
        // Its eyes are well again, and a pair of pictures is the last that is begun.
        time.delay_us(RETRY_US as u32);
        steps(12, &mut time);
        order(&[ToDevice::Stop, ToDevice::Grab(PictureKind::Grey)]);
        steps(100, &mut time);
        order(&[ToDevice::Health]);
        steps(12, &mut time);
        let told = told.borrow();
        let health = told.health.expect("it says how it fares");
        assert_eq!(Some(health.pairs + health.dropped), told.shown, "{health:?}");
        let counters = decoder.counters();
        assert_eq!((counters.rejected_frames(), counters.rejected_bytes), (0, 0));
    });
});

/// What a device said.
#[derive(Default)]
struct Told {
    greeted: bool,
    health: Option<Health>,
    /// The last pair that was shown.
    shown: Option<u32>,
}

impl Told {
    /// A frame has come, which is a message at least.
    fn take(&mut self, frame: &Frame<'_>, lists: &mut Lists) {
        match ToHost::decode(frame, &mut lists.lend()).expect("a device sends messages") {
            ToHost::Hello(_) => self.greeted = true,
            ToHost::Health(health) => self.health = Some(health),
            ToHost::Picture(part) => self.shown = Some(part.pair),
            ToHost::Pair(PairReport { result: Ok(shape), .. }) => check(shape),
            _ => {}
        }
    }
}

fn happen(happening: &Happening<'_>, world: &mut World, time: &mut Time) {
    match *happening {
        Happening::Bytes(bytes) => world.bytes.extend(bytes),
        Happening::Frame(kind, number, payload) => {
            world.bytes.extend(oracle::link::frame(kind, number, payload));
        }
        Happening::Upload(change) => {
            let (kind, mut payload) = upload().1;
            if let Some((at, bytes)) = change {
                let at = usize::from(at) % payload.len();
                payload.iter_mut().skip(at).zip(bytes).for_each(|(place, byte)| *place = byte);
            }
            world.bytes.extend(oracle::link::frame(kind, 1, &payload));
        }
        Happening::Start => world.bytes.extend(oracle::wire::command_bytes(&ToDevice::Start)),
        Happening::Scene(figure) => figure.draw(SIZE[0], &mut world.picture),
        Happening::Capture(fault) => world.capture = Some(fault),
        Happening::Read(fault) => world.read = Some(fault),
        Happening::Control(dead) => world.dead = dead,
        Happening::Jam(jam) => {
            world.jam = jam.map(|closed| if closed { LinkError::Closed } else { LinkError::TimeLimit(1) });
        }
        Happening::Flash(fault) => {
            world.flash =
                fault.map(|damaged| if damaged { FlashError::Damaged } else { FlashError::Failing });
        }
        Happening::Later(us) => time.delay_us(us),
    }
}
