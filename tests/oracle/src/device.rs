//! A device on a PC: the loop of the boards on ports that are made up, and the host at the other end.
//!
//! The eyes keep to their contract and panic where a device does not; link, flash and eyes break to order.

use crate::camera::{SIZE, Scene, Time};
use crate::wire::Lists;
use embedded_hal::delay::DelayNs;
use firmware::device::{Birth, Desk, Device};
use firmware::drive::{Pace, Ports, step};
use firmware::memory::{Qvga, Storage};
use firmware::ports::{
    CameraError, CameraFault, CameraPair, Clock, Exposure, Flash, FlashError, Identity, Link, LinkError,
    Side, Stamps, Watchdog,
};
use shared::pipeline::{Branch, Finding, Outcome};
use shared::point::PixelPoint;
use shared::stage::contour::{ContourLoop, ContourPoint};
use shared::stage::nurbs::Control;
use shared::stage::rows::ContourMatch;
use shared::stage::warp::knots;
use shared::wire::{
    self, Answer, Counters, Decoder, ErrorCode, Health, Hello, MAX_FRAME, PictureKind, ResetReason, Sequence,
    Shape, ToDevice, ToHost,
};
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

/// A thing that a port holds and a test looks at.
pub type Shared<T> = Rc<RefCell<T>>;

fn share<T>(thing: T) -> Shared<T> {
    Rc::new(RefCell::new(thing))
}

/// What is in front of the eyes, and what is wrong with them.
#[derive(Debug)]
pub struct World {
    /// Luma of both eyes at an exposure of 300 lines and a gain of 1 in the light of 1.
    pub scenes: [Scene; 2],
    /// How much light there is.
    pub light: f64,
    /// Faults of the next captures.
    pub faults: VecDeque<CameraFault>,
    /// Rows that the next read gives before it fails.
    pub read_breaks: Option<usize>,
    /// Whether nobody answers.
    pub dead: bool,
    /// Starts so far, whatever came of them.
    pub starts: u32,
    /// Exposures ordered, starts left out.
    pub exposures: Vec<Exposure>,
    /// The pictures that were read, left and right in turn.
    pub read: Vec<Scene>,
}

/// Eyes that take no time to speak of.
#[derive(Debug)]
pub struct Eyes {
    world: Shared<World>,
    time: Time,
    exposure: Option<Exposure>,
    taken: [Option<Scene>; 2],
}

impl Eyes {
    /// Eyes before two scenes, and the world that these are.
    pub fn new(scenes: [Scene; 2], time: Time) -> (Self, Shared<World>) {
        let world = share(World {
            scenes,
            light: 1.0,
            faults: VecDeque::new(),
            read_breaks: None,
            dead: false,
            starts: 0,
            exposures: Vec::new(),
            read: Vec::new(),
        });
        (Self { world: world.clone(), time, exposure: None, taken: [None, None] }, world)
    }
}

const fn left(fault: CameraFault) -> CameraError {
    CameraError { side: Side::Left, fault }
}

impl CameraPair for Eyes {
    const WIDTH: usize = SIZE.0;
    const HEIGHT: usize = SIZE.1;

    fn start(&mut self, exposure: Exposure) -> Result<[Identity; 2], CameraError> {
        self.time.delay_ms(800);
        let mut world = self.world.borrow_mut();
        world.starts += 1;
        self.exposure = (!world.dead).then_some(exposure);
        self.exposure.ok_or(left(CameraFault::ControlBus))?;
        Ok([Identity { sensor: 0x2642, controller: 0x73, sends_dummy: false }; 2])
    }

    fn expose(&mut self, exposure: Exposure) -> Result<(), CameraError> {
        self.time.delay_ms(150);
        assert!(self.exposure.is_some(), "only a start helps now");
        let mut world = self.world.borrow_mut();
        world.exposures.push(exposure);
        self.exposure = (!world.dead).then_some(exposure);
        self.exposure.map(|_| ()).ok_or(left(CameraFault::ControlBus))
    }

    fn capture(&mut self) -> Result<Stamps, CameraError> {
        let exposure = self.exposure.expect("only a start helps now");
        self.taken = [None, None];
        self.time.delay_ms(40);
        let mut world = self.world.borrow_mut();
        if let Some(fault) = world.faults.pop_front() {
            if matches!(fault, CameraFault::TimeLimit(_)) {
                self.exposure = None;
            }
            return Err(left(fault));
        }
        let total = f64::from(exposure.lines()) * f64::from(exposure.gain()) / 4800.0 * world.light;
        let seen = |luma: &u8| (f64::from(*luma) * total).round().min(255.0) as u8;
        self.taken = world.scenes.each_ref().map(|scene| Some(scene.iter().map(seen).collect()));
        let now = self.time.micros();
        Ok(Stamps { done: [now, now - 7300] })
    }

    fn read(&mut self, side: Side, line: &mut dyn FnMut(usize, &[u8])) -> Result<(), CameraError> {
        let wrong = |fault| CameraError { side, fault };
        let picture = self.taken[side as usize].take().ok_or(wrong(CameraFault::NoPicture))?;
        let breaks = self.world.borrow_mut().read_breaks.take();
        for (row, luma) in picture.chunks(SIZE.0).enumerate() {
            if breaks == Some(row) {
                return Err(wrong(CameraFault::PictureBus));
            }
            line(row, luma);
        }
        self.world.borrow_mut().read.push(picture);
        Ok(())
    }

    fn self_test(&mut self) -> Result<(), CameraError> {
        Ok(())
    }
}

/// A cable, and what is wrong with it.
#[derive(Debug, Default)]
pub struct Cable {
    /// Bytes on their way to the device.
    pub to_device: VecDeque<u8>,
    /// Bytes on their way to the host.
    pub to_host: VecDeque<u8>,
    /// Most bytes that come at once; 0 for any number.
    pub chunk: usize,
    /// What becomes of frames that are sent.
    pub jam: Option<LinkError>,
    /// Frames that were sent in vain.
    pub lost: usize,
}

/// The device's end of a cable.
#[derive(Debug)]
pub struct Plug(Shared<Cable>);

impl Link for Plug {
    fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, LinkError> {
        let mut cable = self.0.borrow_mut();
        let most = if cable.chunk == 0 { buffer.len() } else { cable.chunk.min(buffer.len()) };
        let count = most.min(cable.to_device.len());
        buffer.iter_mut().zip(cable.to_device.drain(..count)).for_each(|(slot, byte)| *slot = byte);
        Ok(count)
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), LinkError> {
        let mut cable = self.0.borrow_mut();
        match cable.jam {
            Some(error) => {
                cable.lost += 1;
                Err(error)
            }
            None => {
                cable.to_host.extend(bytes);
                Ok(())
            }
        }
    }
}

/// What a flash holds, and what is wrong with it.
#[derive(Clone, Debug, Default)]
pub struct Page {
    /// The record.
    pub record: Vec<u8>,
    /// What comes of the next loads and saves.
    pub fault: Option<FlashError>,
}

/// A flash with one page.
#[derive(Debug)]
pub struct OnePage(Shared<Page>);

impl Flash for OnePage {
    fn capacity(&self) -> usize {
        1024
    }

    fn load(&mut self, buffer: &mut [u8]) -> Result<usize, FlashError> {
        let page = self.0.borrow();
        page.fault.map_or(Ok(()), Err)?;
        let place = buffer.get_mut(..page.record.len()).ok_or(FlashError::TooLong(page.record.len()))?;
        place.copy_from_slice(&page.record);
        Ok(page.record.len())
    }

    fn save(&mut self, record: &[u8]) -> Result<(), FlashError> {
        assert!(record.len() <= self.capacity(), "a record is shorter than a page");
        let mut page = self.0.borrow_mut();
        page.fault.map_or(Ok(()), Err)?;
        page.record = record.to_vec();
        Ok(())
    }
}

/// A watchdog that notes how long it was not fed.
#[derive(Debug)]
pub struct Dog {
    time: Time,
    fed: u64,
    /// The longest time between two meals, us.
    pub hungriest: u64,
}

impl Watchdog for Dog {
    fn feed(&mut self) {
        let now = self.time.micros();
        self.hungriest = self.hungriest.max(now - self.fed);
        self.fed = now;
    }
}

/// A shape, kept.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Description {
    contour: Vec<ContourPoint>,
    loops: Vec<ContourLoop>,
    matches: Vec<ContourMatch>,
    hulls: [Vec<PixelPoint>; 2],
    branches: Vec<Branch>,
    controls: Vec<Control>,
    /// What the run says beside.
    pub outcome: Outcome,
}

impl From<Shape<'_>> for Description {
    fn from(shape: Shape<'_>) -> Self {
        Self {
            contour: shape.contour.to_vec(),
            loops: shape.loops.to_vec(),
            matches: shape.matches.to_vec(),
            hulls: shape.hulls.map(<[_]>::to_vec),
            branches: shape.branches.to_vec(),
            controls: shape.controls.to_vec(),
            outcome: shape.outcome.clone(),
        }
    }
}

/// What became of a pair, kept.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// Number of the pair.
    pub number: u32,
    /// When the pictures were taken, us.
    pub stamps: [u64; 2],
    /// Levels of both eyes.
    pub levels: [u8; 2],
    /// Exposures of both eyes.
    pub exposures: [wire::Exposure; 2],
    /// The shape or why there is none.
    pub result: Result<Box<Description>, Finding>,
}

/// A message, kept.
#[derive(Clone, Debug, PartialEq)]
pub enum Heard {
    /// Hello.
    Hello(Hello<'static>),
    /// A pair.
    Pair(Report),
    /// Rows of a picture: pair, eye, kind, first row, bytes.
    Rows(u32, Side, PictureKind, usize, Vec<u8>),
    /// Health.
    Health(Health),
    /// An answer.
    Answer(Answer),
}

/// The host's ears.
pub struct Ears {
    decoder: Decoder<'static>,
    lists: Lists,
}

impl Default for Ears {
    fn default() -> Self {
        Self { decoder: Decoder::new(vec![0; MAX_FRAME].leak()), lists: Lists::default() }
    }
}

impl Ears {
    /// Hear bytes; the messages that they end, each of which must be one.
    pub fn hear(&mut self, bytes: impl IntoIterator<Item = u8>) -> Vec<Heard> {
        let Self { decoder, lists } = self;
        let mut heard = Vec::new();
        for byte in bytes {
            let Some(frame) = decoder.push(byte) else { continue };
            let lists = &mut lists.lend();
            heard.push(match ToHost::decode(&frame, lists).expect("a device sends messages") {
                ToHost::Hello(hello) => Heard::Hello(Hello { board: hello.board.to_owned().leak(), ..hello }),
                ToHost::Pair(pair) => Heard::Pair(Report {
                    number: pair.number,
                    stamps: pair.stamps,
                    levels: pair.levels,
                    exposures: pair.exposures,
                    result: pair.result.map(|shape| Box::new(shape.into())),
                }),
                ToHost::Picture(part) => {
                    assert_eq!((usize::from(part.width), usize::from(part.height)), SIZE);
                    let first = part.first_row.into();
                    Heard::Rows(part.pair, part.eye, part.kind, first, part.rows.to_vec())
                }
                ToHost::Health(health) => Heard::Health(health),
                ToHost::Answer(answer) => Heard::Answer(answer),
            });
        }
        heard
    }

    /// What came so far.
    pub const fn counters(&self) -> &Counters {
        self.decoder.counters()
    }
}

/// A device, its ports, and its host.
pub struct Bench<C> {
    device: Device<'static>,
    ports: Ports<C, Plug, Time, OnePage, Dog>,
    sequence: Sequence,
    /// The cable between both.
    pub cable: Shared<Cable>,
    /// The device's flash.
    pub page: Shared<Page>,
    /// The host's ears.
    pub ears: Ears,
    /// What the host heard so far, in order.
    pub heard: Vec<Heard>,
    time: Time,
}

/// Steps after which a thing that did not happen will not.
const PATIENCE: usize = 20_000;

impl<C: CameraPair> Bench<C> {
    /// A device that has just booted.
    pub fn new(cameras: C, time: Time, page: &Shared<Page>) -> Self {
        // As large as a board's static memory, so it is made where there is room for it.
        let storage = std::thread::Builder::new().stack_size(16 << 20).spawn(|| Box::new(Qvga::new()));
        let storage = Box::leak(storage.unwrap().join().unwrap());
        let desk = Box::leak(Box::new(Desk::<{ knots(<Qvga as Storage>::CAPACITIES.size) }>::new()));
        let birth = Birth { board: "bench", reset: ResetReason::Watchdog, watchdog_resets: 3 };
        let cable = Shared::<Cable>::default();
        let dog = Dog { time: time.clone(), fed: time.micros(), hungriest: 0 };
        let (link, flash) = (Plug(cable.clone()), OnePage(page.clone()));
        Self {
            device: Device::new(storage, desk, birth),
            ports: Ports { cameras, link, clock: time.clone(), flash, watchdog: dog },
            sequence: Sequence::default(),
            cable,
            page: page.clone(),
            ears: Ears::default(),
            heard: Vec::new(),
            time,
        }
    }

    /// Let the device do one thing, and the host hear what it says.
    pub fn step(&mut self) -> Pace {
        let pace = step(&mut self.device, &mut self.ports);
        self.time.delay_us(if pace == Pace::Idle { 1000 } else { 20 });
        let bytes: Vec<u8> = self.cable.borrow_mut().to_host.drain(..).collect();
        self.heard.extend(self.ears.hear(bytes));
        pace
    }

    /// Let so many steps pass; what was heard meanwhile.
    pub fn steps(&mut self, count: usize) -> &[Heard] {
        let before = self.heard.len();
        for _ in 0..count {
            let _ = self.step();
        }
        &self.heard[before..]
    }

    /// Go on until a message is heard from which `pick` takes something.
    #[track_caller]
    pub fn until<T>(&mut self, pick: impl Fn(&Heard) -> Option<T>) -> T {
        for _ in 0..PATIENCE {
            let before = self.heard.len();
            let _ = self.step();
            if let Some(picked) = self.heard[before..].iter().find_map(&pick) {
                return picked;
            }
        }
        panic!("it was never heard; last came {:?}", self.heard.last());
    }

    /// Send a command; its number.
    pub fn order(&mut self, command: &ToDevice) -> u16 {
        let mut frame = [0; 1024];
        let number = self.sequence.take();
        let len = command.encode(number, &mut frame).expect("a command fits");
        self.cable.borrow_mut().to_device.extend(&frame[..len]);
        number
    }

    /// Send a command and wait for its answer.
    ///
    /// # Errors
    /// The device's.
    #[track_caller]
    pub fn ask(&mut self, command: &ToDevice) -> Result<(), ErrorCode> {
        let number = self.order(command);
        self.until(|heard| match heard {
            Heard::Answer(answer) if answer.command == number => Some(answer.result),
            _ => None,
        })
    }

    /// Wait for the next pair.
    #[track_caller]
    pub fn report(&mut self) -> Report {
        self.until(|heard| match heard {
            Heard::Pair(report) => Some(report.clone()),
            _ => None,
        })
    }

    /// Ask how it fares.
    #[track_caller]
    pub fn health(&mut self) -> Health {
        self.order(&ToDevice::Health);
        self.until(|heard| match heard {
            Heard::Health(health) => Some(*health),
            _ => None,
        })
    }

    /// Ask who it is.
    #[track_caller]
    pub fn hello(&mut self) -> Hello<'static> {
        self.order(&ToDevice::Hello);
        self.next_hello()
    }

    /// Wait for a hello.
    #[track_caller]
    pub fn next_hello(&mut self) -> Hello<'static> {
        self.until(|heard| match heard {
            Heard::Hello(hello) => Some(*hello),
            _ => None,
        })
    }

    /// The pictures of one pair that come until both are whole: left, right.
    #[track_caller]
    pub fn pictures(&mut self, kind: PictureKind) -> [Vec<u8>; 2] {
        let row = kind.row_bytes(SIZE.0 as u16);
        let mut pictures = [Vec::new(), Vec::new()];
        let mut pair = None;
        while pictures.iter().any(|p: &Vec<u8>| p.len() < row * SIZE.1) {
            let (number, side, first, rows) = self.until(|heard| match heard {
                Heard::Rows(pair, side, k, first, rows) if *k == kind => {
                    Some((*pair, *side, *first, rows.clone()))
                }
                _ => None,
            });
            if pair.replace(number).is_some_and(|pair| pair != number) {
                pictures = [Vec::new(), Vec::new()];
            }
            let picture = &mut pictures[side as usize];
            assert_eq!(first * row, picture.len(), "rows come in order");
            picture.extend(rows);
        }
        pictures
    }

    /// The longest time that the watchdog was not fed, us.
    pub const fn hungriest(&self) -> u64 {
        self.ports.watchdog.hungriest
    }

    /// The device itself: how it stands, and for reports that nobody asked for.
    pub const fn device(&mut self) -> &mut Device<'static> {
        &mut self.device
    }
}
