//! Processes that others watch or kill: this program, started anew to play a part.

use host::calibration::StereoCamera;
use host::source::recording::Recording;
use host::source::serial::recording::Writer;
use oracle::program::host;
use serde_json::{Value, json};
use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, Lines, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

/// A part.
#[derive(clap::Subcommand)]
pub(crate) enum Part {
    /// The host's program with arguments from standard input, a line of JSON a run
    Hosts,
    /// The host's program, once
    Host {
        /// Its arguments
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        arguments: Vec<String>,
    },
    /// A recording of the same pair over and over, as `host capture` makes it
    Record {
        /// A folder with left.png and right.png
        pair: PathBuf,
        /// The recording
        folder: PathBuf,
    },
    /// A recording of the same bytes over and over, as `host listen` makes it
    Tape {
        /// The device's calibration
        calibration: PathBuf,
        /// The bytes
        bytes: PathBuf,
        /// The recording
        file: PathBuf,
    },
}

impl Part {
    /// Plays it.
    pub(crate) fn play(self) {
        match self {
            Self::Hosts => hosts(),
            Self::Host { arguments } => run(&arguments).expect("it can be done"),
            Self::Record { pair, folder } => {
                let views =
                    ["left.png", "right.png"].map(|name| image::open(pair.join(name)).unwrap().into_luma8());
                let (width, height) = views[0].dimensions();
                let camera = StereoCamera::rectified(width, height, width.into(), 60.0);
                let mut recording = Recording::begin(&folder, Some((camera, None))).unwrap();
                let mut number = 1;
                loop {
                    recording.add(number, &views).unwrap();
                    number += 1;
                }
            }
            Self::Tape { calibration, bytes, file } => {
                let (camera, bytes) = (StereoCamera::read(calibration).unwrap(), fs::read(bytes).unwrap());
                let model = host::stage::rectify::Rectification::same_size(&camera).unwrap().model();
                let mut writer = Writer::begin(&file, &model).unwrap();
                writer.connection().unwrap();
                loop {
                    bytes.chunks(700).for_each(|chunk| writer.bytes(chunk).unwrap());
                }
            }
        }
    }
}

fn run(arguments: &[String]) -> Result<(), String> {
    host(&arguments.iter().map(String::as_str).collect::<Vec<_>>())
}

fn hosts() {
    for line in io::stdin().lock().lines() {
        let arguments: Vec<String> = serde_json::from_str(&line.expect("text")).expect("arguments");
        let refused = run(&arguments).err();
        println!("{}", json!({ END: refused }));
        io::stdout().flush().expect("somebody listens");
    }
}

/// What the last line of a run begins with.
const END: &str = "trials: the run has ended";

/// A process that runs the host's program again and again.
pub(crate) struct Worker {
    child: Child,
    orders: ChildStdin,
    said: Lines<BufReader<ChildStdout>>,
    errors: PathBuf,
}

impl Worker {
    /// One whose standard error goes to a file.
    pub(crate) fn start(errors: &Path) -> Self {
        let mut child = part(&["hosts"])
            // One heap for all threads: how they share out several hides whether what is in them grows.
            .env("MALLOC_ARENA_MAX", "1")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(File::create(errors).expect("a file"))
            .spawn()
            .expect("it starts");
        let orders = child.stdin.take().expect("piped");
        let said = BufReader::new(child.stdout.take().expect("piped")).lines();
        Self { child, orders, said, errors: errors.into() }
    }

    /// Its process.
    pub(crate) fn id(&self) -> u32 {
        self.child.id()
    }

    /// Have it run the host's program; `hear` hears each line that it says.
    ///
    /// # Errors
    /// The program's sentence.
    pub(crate) fn run(&mut self, arguments: &[&str], mut hear: impl FnMut(&str)) -> Result<(), String> {
        writeln!(self.orders, "{}", json!(arguments)).expect("it listens");
        loop {
            let Some(line) = self.said.next() else {
                let errors = fs::read_to_string(&self.errors).unwrap_or_default();
                panic!("it died in {arguments:?}: {errors}");
            };
            let line = line.expect("text");
            let ended = line.contains(END).then(|| serde_json::from_str::<Value>(&line).expect("JSON"));
            match ended {
                Some(end) => return end[END].as_str().map_or(Ok(()), |refused| Err(refused.to_owned())),
                None => hear(&line),
            }
        }
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        // It may have ended by itself, which its next run tells.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A process of this program that plays a part.
pub(crate) fn part(arguments: &[&str]) -> Command {
    let mut command = Command::new(std::env::current_exe().expect("a program"));
    command.arg("play").args(arguments);
    command
}
