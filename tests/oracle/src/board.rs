//! Images for emulated boards: built, and run in QEMU.

use assert_cmd::Command;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command as Tool, ExitStatus, Stdio};
use std::time::Duration;

/// The processor of all boards.
pub const TARGET: &str = "thumbv7em-none-eabihf";

/// QEMU's machines: a Cortex-M4F and a Cortex-M7.
pub const MACHINES: [&str; 2] = ["mps2-an386", "mps2-an500"];

/// Whether `tool` runs with these arguments; what it prints.
fn runs(tool: &str, arguments: &[&str]) -> Option<String> {
    let output = Tool::new(tool).args(arguments).stderr(Stdio::null()).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).into_owned())
}

/// Whether `what` is missing, said loudly.
///
/// # Panics
/// In CI (`CI=true`), where nothing may be skipped.
fn is_missing(what: &str, missing: bool, remedy: &str) -> bool {
    if missing {
        eprintln!("\n!!!! SKIPPED: {what} is missing, so NOTHING runs on a board: {remedy} !!!!\n");
        assert!(std::env::var_os("CI").is_none_or(|ci| ci != "true"), "in CI {what} must be there");
    }
    missing
}

/// Build an image of the firmware with these features and no others; nothing where its target is missing.
///
/// # Panics
/// When it does not build.
pub fn build(image: &str, features: &str) -> Option<PathBuf> {
    let libraries = runs("rustc", &["--print", "target-libdir", "--target", TARGET]);
    let missing = libraries.is_none_or(|folder| !Path::new(folder.trim()).is_dir());
    if is_missing("the target", missing, &format!("rustup target add {TARGET}")) {
        return None;
    }
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/..");
    let built = Tool::new(std::env::var_os("CARGO").unwrap_or("cargo".into()))
        .current_dir(root)
        .args(["build", "-q", "-p", "firmware", "--locked", "--release", "--target", TARGET])
        .args(["--no-default-features", "--features", features, "--bin", image])
        .status();
    assert!(built.is_ok_and(|status| status.success()), "{image} does not build");
    let target = std::env::var_os("CARGO_TARGET_DIR").map_or(Path::new(root).join("target"), PathBuf::from);
    Some(target.join(TARGET).join("release").join(image))
}

/// QEMU as one of [`MACHINES`] with an image and its arguments; nothing where QEMU is missing.
fn emulator(machine: &str, image: &Path, arguments: &[&Path]) -> Option<Tool> {
    let qemu = "qemu-system-arm";
    if is_missing(qemu, runs(qemu, &["--version"]).is_none(), &format!("apt-get install {qemu}")) {
        return None;
    }
    let semihosting = arguments.iter().fold("enable=on,target=native,arg=image".to_owned(), |all, one| {
        all + ",arg=" + one.to_str().expect("paths are text")
    });
    let mut tool = Tool::new(qemu);
    tool.args(["-M", machine, "-nographic", "-semihosting-config", &semihosting, "-kernel"]).arg(image);
    Some(tool)
}

/// Run an image of the `mps2` boards on one of [`MACHINES`], with arguments and for `limit` at most; what
/// it prints. Nothing where QEMU is missing.
///
/// # Panics
/// When it does not end, or does so with another code than 0: 101 is a panic, 70 a hard fault, 134 a fault
/// within a fault, such as a stack that is too small.
pub fn run(machine: &str, image: &Path, arguments: &[&Path], limit: Duration) -> Option<String> {
    let emulator = emulator(machine, image, arguments)?;
    let output = Command::from_std(emulator)
        .args(["-icount", "shift=3,align=off,sleep=off"])
        .timeout(limit)
        .output()
        .expect("it runs");
    let (said, complained) =
        (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{machine}: {}\n{said}\n{complained}", output.status);
    Some(said.into_owned())
}

/// Run an image of the `mps2` boards on one of [`MACHINES`], without arguments and for `limit` at most: how it ended,
/// which tells of faults too. Nothing where QEMU is missing.
///
/// # Panics
/// When QEMU does not start.
pub fn ending(machine: &str, image: &Path, limit: Duration) -> Option<ExitStatus> {
    let emulator = emulator(machine, image, &[])?;
    Some(Command::from_std(emulator).timeout(limit).output().expect("it runs").status)
}

/// A board that runs until it is dropped.
#[derive(Debug)]
pub struct Running(Child);

/// Let an image that does not end run on one of [`MACHINES`], with arguments and with this for QEMU's serial
/// line; nothing where QEMU is missing.
///
/// # Panics
/// When QEMU does not start.
pub fn start(machine: &str, image: &Path, arguments: &[&Path], serial: &[&str]) -> Option<Running> {
    let mut emulator = emulator(machine, image, arguments)?;
    emulator.args(["-monitor", "none"]).args(serial).stdin(Stdio::null()).stdout(Stdio::piped());
    Some(Running(emulator.spawn().expect("it starts")))
}

impl Running {
    /// The pseudo-terminal that is the serial line of a board started with `-serial pty`.
    ///
    /// # Panics
    /// When QEMU does not say which, or has said it before.
    pub fn terminal(&mut self) -> String {
        let mut said = String::new();
        let output = self.0.stdout.take().expect("asked once");
        BufReader::new(output).read_line(&mut said).expect("QEMU speaks");
        let name = said.split_whitespace().find(|word| word.starts_with("/dev/"));
        name.unwrap_or_else(|| panic!("QEMU said {said:?}")).to_owned()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // It may have ended by itself, which a test sees by what it says.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}
