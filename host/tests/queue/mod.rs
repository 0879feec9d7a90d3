//! A queue's server and its workers as processes on this machine, to be killed at will; and pairs to feed them.

use host::random::Random;
use image::{GrayImage, Luma};
use serde_json::Value;
use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::Read;
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Shapes of the pairs.
const SHAPES: [&str; 4] = ["sphere", "capsule", "screwdriver", "torus"];
/// How far objects are moved in the pictures, px: so many places by so many.
const PLACES: [usize; 2] = [8, 8];

/// Pairs of one kind.
#[derive(Clone, Copy)]
pub(crate) struct Kind {
    /// Size of the pictures, px.
    size: &'static str,
    /// The focal length that goes with it, px.
    focal: &'static str,
    /// Options of `host replay`.
    how: &'static [&'static str],
}

/// What a model takes little of: some milliseconds, and some ten kilobytes.
pub(crate) const SMALL: Kind =
    Kind { size: "160x120", focal: "225", how: &["--no-pictures", "--resolution", "8"] };
/// Pairs as a camera gives them.
pub(crate) const FULL: Kind = Kind { size: "640x480", focal: "750", how: &["--no-pictures"] };

/// What a server that asks for a password takes.
pub(crate) const PASSWORD: &str = "one@two";

/// Longest that a server may take to start or to end, and that workers may take beyond what is expected.
const PATIENCE: Duration = Duration::from_secs(60);

/// Makes a folder of pairs, all different, and a calibration for all: shapes that stand in other places of the pictures,
/// the same in both views. One in 50 is empty, and so refused.
pub(crate) fn make_pairs(folder: &Path, count: usize, kind: Kind) {
    let shapes = folder.join(".shapes");
    let views = SHAPES.map(|shape| {
        let out = shapes.join(shape);
        let render = ["render", shape, "--size", kind.size, "--focal", kind.focal, "--out"];
        assert!(program(&render).arg(&out).status().unwrap().success());
        ["left.png", "right.png"].map(|name| image::open(out.join(name)).unwrap().into_luma8())
    });
    fs::copy(shapes.join(SHAPES[0]).join("calib.yaml"), folder.join("calib.yaml")).unwrap();
    for pair in 0..count {
        let [across, down] = [pair / SHAPES.len() % PLACES[0], pair / SHAPES.len() / PLACES[0] % PLACES[1]];
        let grey = (pair / SHAPES.len() / PLACES[0] / PLACES[1]) as u8;
        let to = folder.join(format!("{pair:05}"));
        fs::create_dir(&to).unwrap();
        for (view, name) in views[pair % SHAPES.len()].iter().zip(["left.png", "right.png"]) {
            let empty = pair % 50 == 49;
            let moved = GrayImage::from_fn(view.width(), view.height(), |u, v| {
                let from = [u.wrapping_sub(across as u32), v.wrapping_sub(down as u32)];
                let seen = view.get_pixel_checked(from[0], from[1]).filter(|_| !empty);
                Luma([seen.map_or(0, |pixel| pixel.0[0].saturating_sub(grey))])
            });
            moved.save(to.join(name)).unwrap();
        }
    }
    fs::remove_dir_all(shapes).unwrap();
}

/// The program, as a process.
fn program(args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_host"));
    command.args(args).stdin(Stdio::null()).stdout(Stdio::piped());
    command
}

/// What a command prints as JSON.
fn said(args: &[&str]) -> Value {
    let output = program(args).stderr(Stdio::piped()).output().unwrap();
    let words = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{args:?}: {words}");
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Time that `host replay` takes for a folder with so many threads.
pub(crate) fn replay(folder: &Path, out: &Path, threads: usize, kind: Kind) -> Duration {
    let start = Instant::now();
    let [folder, out] = [folder, out].map(|path| path.display().to_string());
    let mut command = program(&["replay", &folder, "--out", &out, "--jobs", &threads.to_string(), "--json"]);
    // Some are refused.
    let status = command.args(kind.how).stdout(Stdio::null()).stderr(Stdio::null()).status().unwrap();
    assert!(matches!(status.code(), Some(0 | 1)), "{status}");
    start.elapsed()
}

/// A NATS server that keeps its streams in a folder.
pub(crate) struct Server {
    storage: TempDir,
    port: u16,
    /// A folder with `queue.conf`, if it has one.
    settings: Option<PathBuf>,
    process: Child,
}

impl Server {
    /// A server on a free port of this machine alone, which lets everybody in.
    pub(crate) fn start() -> Self {
        Self::start_as(None)
    }

    /// One that is set by the `queue.conf` of a folder, but for where it listens.
    pub(crate) fn start_as(settings: Option<&Path>) -> Self {
        let storage = TempDir::new().unwrap();
        let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let process = serve(storage.path(), port, settings);
        Self { storage, port, settings: settings.map(PathBuf::from), process }
    }

    /// Kills it, and starts it again on what it kept.
    pub(crate) fn restart(&mut self) {
        end(&mut self.process);
        self.process = serve(self.storage.path(), self.port, self.settings.as_deref());
    }

    /// Processor time that it took since it was started, as Linux counts it.
    pub(crate) fn time(&self) -> Duration {
        let told = fs::read_to_string(format!("/proc/{}/stat", self.process.id())).unwrap();
        // Behind the name, which may hold anything, in hundredths of a second: man 5 proc.
        let fields: Vec<&str> = told.rsplit(')').next().unwrap().split_whitespace().collect();
        let ticks: u64 = fields[11..13].iter().map(|field| field.parse::<u64>().unwrap()).sum();
        Duration::from_millis(10 * ticks)
    }

    /// Bytes of the files that it keeps.
    pub(crate) fn kept(&self) -> usize {
        files(self.storage.path()).values().map(Vec::len).sum()
    }

    /// Where it is, as an option of the program.
    pub(crate) fn place(&self) -> [String; 2] {
        self.place_for("nats://")
    }

    /// The same for somebody: a scheme, and a user with a password and an @ behind.
    pub(crate) fn place_for(&self, whom: &str) -> [String; 2] {
        ["--server".into(), format!("{whom}localhost:{}", self.port)]
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        end(&mut self.process);
    }
}

fn serve(storage: &Path, port: u16, settings: Option<&Path>) -> Child {
    let mut command = Command::new("nats-server");
    command.args(["-a", "127.0.0.1", "-p", &port.to_string()]);
    match settings {
        None => command.args(["-js", "-sd"]).arg(storage),
        Some(folder) => {
            command.args(["-c", "queue.conf"]).current_dir(folder).env("WORKER_PASSWORD", PASSWORD)
        }
    };
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    let process = command.spawn().expect("nats-server (Debian: apt-get install nats-server)");
    let end = Instant::now() + PATIENCE;
    while !greets(port) {
        assert!(Instant::now() < end, "nats-server did not start");
        sleep(Duration::from_millis(50));
    }
    process
}

/// Whether a server says hello.
fn greets(port: u16) -> bool {
    let greeted = TcpStream::connect(("127.0.0.1", port)).and_then(|mut stream| stream.read(&mut [0; 4]));
    greeted.is_ok_and(|bytes| bytes > 0)
}

fn end(process: &mut Child) {
    let _ = process.kill();
    process.wait().unwrap();
}

/// A batch: its pairs, its results, its queue.
#[derive(Clone, Copy)]
pub(crate) struct Batch<'a> {
    /// The pairs.
    pub(crate) folder: &'a Path,
    /// The results.
    pub(crate) out: &'a Path,
    /// The queue: options that reach it.
    pub(crate) server: &'a [String],
    /// Its name.
    pub(crate) name: &'a str,
    /// What its pairs are.
    pub(crate) kind: Kind,
    /// Tries after which a pair is set aside.
    pub(crate) tries: &'a str,
}

impl Batch<'_> {
    /// Whether it can be asked how far it is, or else why not.
    pub(crate) fn try_status(&self) -> Result<(), String> {
        let output = program(&words(&self.command("status", &[]))).stderr(Stdio::piped()).output().unwrap();
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        output.status.success().then_some(()).ok_or(told)
    }

    fn command(&self, action: &str, more: &[&str]) -> Vec<String> {
        let folder = self.folder.display().to_string();
        let all = ["batch", action, &folder, "--name", self.name, "--json"];
        let server = self.server.iter().map(String::as_str);
        all.into_iter().chain(server).chain(more.iter().copied()).map(str::to_owned).collect()
    }

    /// Queues the pairs; who dies is noticed as soon as may be.
    pub(crate) fn submit(&self) -> Value {
        let more = [["--lost-after", "20", "--"].as_slice(), self.kind.how].concat();
        said(&words(&self.command("submit", &more)))
    }

    /// How far it is.
    pub(crate) fn status(&self) -> Value {
        said(&words(&self.command("status", &[])))
    }

    /// Forgets it.
    pub(crate) fn forget(&self) {
        said(&words(&self.command("drop", &[])));
    }

    /// A worker with one thread.
    pub(crate) fn worker(&self) -> Child {
        let out = self.out.display().to_string();
        let command = self.command("work", &["--out", &out, "--jobs", "1", "--tries", self.tries]);
        program(&words(&command)).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
    }

    /// Has so many workers make it, and returns the time that they took.
    pub(crate) fn work(&self, workers: usize) -> Duration {
        let start = Instant::now();
        let workers: Vec<Child> = (0..workers).map(|_| self.worker()).collect();
        for mut worker in workers {
            assert!(worker.wait().unwrap().success());
        }
        start.elapsed()
    }

    /// Has three workers make it, of which one is killed and replaced `kills` times, as the results of so many pairs grow;
    /// in the middle of it the server is killed and started again.
    pub(crate) fn work_with_kills(&self, server: &mut Server, kills: usize, pairs: usize, seed: u64) {
        let mut random = Random::new(seed);
        let mut workers = [(); 3].map(|()| self.worker());
        let deadline = Instant::now() + PATIENCE * 5;
        let wait = |status: &dyn Fn() -> bool| {
            while !status() {
                assert!(Instant::now() < deadline, "it does not come to an end: {}", self.status());
                sleep(Duration::from_millis(5));
            }
        };
        for kill in 0..kills {
            let begun = || fs::read_dir(self.out).map_or(0, Iterator::count);
            wait(&|| begun() >= pairs * (kill + 1) / (kills + 2));
            sleep(Duration::from_secs_f64(0.02 * random.uniform()));
            if kill == kills / 2 {
                server.restart();
            }
            let victim = &mut workers[(random.uniform() * 3.0) as usize];
            assert_eq!(victim.try_wait().unwrap(), None, "a worker ended before the queue was empty");
            end(victim);
            *victim = self.worker();
        }
        let mut workers = workers.map(RefCell::new);
        wait(&|| workers.iter().all(|worker| worker.borrow_mut().try_wait().unwrap().is_some()));
        for worker in &mut workers {
            assert!(worker.get_mut().wait().unwrap().success());
        }
    }
}

fn words(command: &[String]) -> Vec<&str> {
    command.iter().map(String::as_str).collect()
}

/// Every file in and below a folder, by its path there.
fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                found.insert(path.strip_prefix(folder).unwrap().to_owned(), fs::read(&path).unwrap());
            }
        }
    }
    found
}

/// What was left in a folder is what was left in another; or the paths of what is not.
pub(crate) fn same(one: &Path, other: &Path) -> Result<usize, String> {
    let (one, other) = (results(one), results(other));
    let paths: BTreeSet<_> = one.keys().chain(other.keys()).collect();
    let count = paths.len();
    let differ: Vec<_> = paths.into_iter().filter(|path| one.get(*path) != other.get(*path)).collect();
    if differ.is_empty() { Ok(count) } else { Err(format!("{differ:?}")) }
}

/// What was left in a folder, by its path there: all files as they are, but of a report nothing from its times on.
fn results(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = files(folder);
    for (_, bytes) in found.iter_mut().filter(|(path, _)| path.ends_with("report.json")) {
        let times = String::from_utf8_lossy(bytes).find("\"times_ms\"");
        bytes.truncate(times.expect("a report tells times"));
    }
    found
}
