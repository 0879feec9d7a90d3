//! The live page in a real browser, and whoever else asks: it follows the newest pair without growing, what is set
//! there makes the next one, and nobody but its own browser windows on this machine is answered.
//!
//! Says loudly when there is no Chromium, and fails then if `CI=true`. `OSSATURE_SHOTS` names a folder for the
//! screenshots, at desktop and at phone width, by day and by night.
#![cfg(unix)]

use host::shape::Shape;
use image::RgbImage;
use oracle::browser::{Browser, Page, Sight};
use oracle::program::{host, within};
use oracle::scene::{Scale, camera, pair, see, views};
use oracle::socket::{intact, prepare, serve};
use serde_json::{Value, json};
use std::cell::RefCell;
use std::fs;
use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, ChildStderr, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};
use tempfile::TempDir;

const DESKTOP: [u32; 2] = [1280, 2000];
const PHONE: [u32; 2] = [390, 2400];
/// Longest that anything is waited for in a page.
const PATIENCE: Duration = Duration::from_secs(60);
/// The program's arguments, for [`program`].
const ARGUMENTS: &str = "OSSATURE_LIVE_TEST";

/// Not a test but the program, in a process of its own: this one, run again by those below.
#[test]
fn program() {
    let Ok(arguments) = std::env::var(ARGUMENTS) else { return };
    if let Err(words) = host(&arguments.split('\n').collect::<Vec<_>>()) {
        eprintln!("error: {words}");
        std::process::exit(1);
    }
}

/// The program with a live page.
struct Program {
    child: Child,
    said: BufReader<ChildStderr>,
    /// Without `http://`: the machine and its port, and what is below it, which ends with a slash.
    address: (String, String),
}

impl Program {
    fn start(arguments: &[&str]) -> Self {
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "program", "--nocapture"])
            .env(ARGUMENTS, arguments.join("\n"))
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut said = BufReader::new(child.stderr.take().unwrap());
        let mut line = String::new();
        while !line.contains("http://") {
            line.clear();
            assert_ne!(said.read_line(&mut line).unwrap(), 0, "the program ended: {:?}", child.wait());
        }
        let (_, address) = line.trim().split_once("http://").unwrap();
        let (machine, path) = address.split_once('/').unwrap();
        Self { child, said, address: (machine.into(), format!("/{path}")) }
    }

    fn url(&self) -> String {
        let (machine, path) = &self.address;
        format!("http://{machine}{path}")
    }

    /// Bytes of memory that it has.
    fn memory(&self) -> f64 {
        let status = fs::read_to_string(format!("/proc/{}/status", self.child.id())).unwrap();
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap();
        1024.0 * line.trim().trim_end_matches(" kB").parse::<f64>().unwrap()
    }

    /// Ctrl-C; returns whether it succeeded, and what it said last.
    fn stop(mut self) -> (bool, String) {
        let pid = self.child.id().to_string();
        assert!(Command::new("kill").args(["-INT", &pid]).status().unwrap().success());
        let mut said = String::new();
        self.said.read_to_string(&mut said).unwrap();
        (self.child.wait().unwrap().success(), said)
    }

    /// Asks as a browser would of this page: status and body.
    fn ask(&self, method: &str, below: &str, body: &str) -> (u16, String) {
        let (machine, path) = &self.address;
        exchange(machine, method, &format!("{path}{below}"), &[("Host", machine)], body)
    }

    fn pair(&self, after: u64) -> Value {
        let (status, body) = self.ask("GET", &format!("pair?after={after}"), "");
        assert_eq!(status, 200, "{body}");
        serde_json::from_str(&body).unwrap()
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn connect(machine: &str) -> TcpStream {
    let stream = TcpStream::connect(machine).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
    stream
}

fn request(method: &str, path: &str, headers: &[(&str, &str)], body: &str) -> String {
    let headers: String = headers.iter().map(|(name, value)| format!("{name}: {value}\r\n")).collect();
    let length = body.len();
    format!(
        "{method} {path} HTTP/1.1\r\n{headers}Connection: close\r\nContent-Length: {length}\r\n\r\n{body}"
    )
}

/// One request on a connection of its own: status and body.
fn exchange(machine: &str, method: &str, path: &str, headers: &[(&str, &str)], body: &str) -> (u16, String) {
    let mut stream = connect(machine);
    stream.write_all(request(method, path, headers, body).as_bytes()).unwrap();
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).unwrap();
    let answer = String::from_utf8(answer).unwrap();
    let (head, body) = answer.split_once("\r\n\r\n").unwrap();
    (head.split(' ').nth(1).unwrap().parse().unwrap(), body.to_owned())
}

/// A folder with so many pairs of something that moves to and fro, and their calibration.
fn recording(count: usize) -> TempDir {
    recording_at(2, count)
}

/// The same at a scale.
fn recording_at(scale: Scale, count: usize) -> TempDir {
    let folder = TempDir::new().unwrap();
    camera(scale).write_opencv_yaml(folder.path().join("calib.yaml")).unwrap();
    let places = 8;
    for k in 0..count {
        let place = k % (2 * places);
        let place = place.min(2 * places - 1 - place);
        for (name, mut view) in ["left", "right"].into_iter().zip(views(scale)) {
            let file = |k: usize| folder.path().join(format!("{name}_{k:04}.png"));
            if k < places {
                view.principal[0] += (8.0 * place as f64 - 32.0) / f64::from(scale);
                see(Shape::Teapot, view).save(file(k)).unwrap();
            } else {
                fs::hard_link(file(place), file(k)).unwrap();
            }
        }
    }
    folder
}

fn replayed(folder: &Path, more: &[&str]) -> Program {
    let input = folder.display().to_string();
    Program::start(&[&["replay", &input, "--view"], more].concat())
}

fn keep(name: &str, picture: &RgbImage) {
    if let Some(folder) = std::env::var_os("OSSATURE_SHOTS") {
        fs::create_dir_all(&folder).unwrap();
        picture.save(Path::new(&folder).join(format!("{name}.png"))).unwrap();
    }
}

/// A live page in a window of its own.
struct Tab<'a> {
    browser: &'a RefCell<Browser>,
    page: Page,
}

impl<'a> Tab<'a> {
    fn open(browser: &'a RefCell<Browser>, program: &Program, window: [u32; 2]) -> Self {
        let sight = Sight { window, dark: false, phone: false };
        let page = browser.borrow_mut().open(&program.url(), sight);
        Self { browser, page }
    }

    fn see(&self, window: [u32; 2], dark: bool) {
        self.browser.borrow_mut().see(&self.page, Sight { window, dark, phone: false });
        self.browser.borrow_mut().settle(&self.page);
    }

    fn eval(&self, expression: &str) -> Value {
        self.browser.borrow_mut().evaluate(&self.page, expression)
    }

    /// Waits until an expression holds; what is not there yet makes it false.
    fn until(&self, expression: &str) {
        let end = Instant::now() + PATIENCE;
        let tried =
            format!("(() => {{ try {{ return Boolean({expression}); }} catch {{ return false; }} }})()");
        while self.eval(&tried) != true {
            let page = || self.eval("document.body.innerText.slice(0, 600)");
            assert!(Instant::now() < end, "never: {expression}; {}; {:?}", page(), self.faults());
            thread::sleep(Duration::from_millis(50));
        }
    }

    /// A picture of an element.
    fn picture(&self, element: &str) -> RgbImage {
        self.browser.borrow_mut().picture(&self.page, element, 1.0)
    }

    /// How many pixels of an element are not as its first one within.
    fn drawn(&self, element: &str) -> usize {
        let picture = self.picture(element);
        let first = *picture.get_pixel(3, 3);
        let differs = |pixel: &&image::Rgb<u8>| pixel.0.iter().zip(first.0).any(|(a, b)| a.abs_diff(b) > 24);
        picture.pixels().filter(differs).count()
    }

    /// Draws a line with the mouse, window px.
    fn drag(&self, from: [f64; 2], to: [f64; 2]) {
        for (kind, [x, y]) in [("mousePressed", from), ("mouseMoved", to), ("mouseReleased", to)] {
            let event =
                json!({ "type": kind, "x": x, "y": y, "button": "left", "buttons": 1, "clickCount": 1 });
            self.browser.borrow_mut().lead(&self.page, "Input.dispatchMouseEvent", &event);
        }
    }

    /// Bytes that its scripts hold on to.
    fn heap(&self) -> f64 {
        let mut browser = self.browser.borrow_mut();
        browser.lead(&self.page, "HeapProfiler.collectGarbage", &json!({}));
        browser.lead(&self.page, "Runtime.getHeapUsage", &json!({}))["usedSize"].as_f64().unwrap()
    }

    /// Complaints since the last window was opened, but for the browser's remark on what was refused in words.
    fn faults(&self) -> Vec<String> {
        let complaints = self.browser.borrow().complaints();
        complaints.into_iter().filter(|complaint| !complaint.contains("status of 400")).collect()
    }

    /// Addresses that were asked for since then, and are not the program's.
    fn foreign(&self, program: &Program) -> Vec<String> {
        let asked = self.browser.borrow().requests();
        asked.into_iter().filter(|address| !address.starts_with(&program.url())).collect()
    }
}

/// The mask of the left view, as it is drawn.
fn mask(tab: &Tab<'_>) -> String {
    tab.eval("document.querySelector('.layer.mask image').getAttribute('href')").as_str().unwrap().to_owned()
}

#[test]
fn only_who_has_the_address_is_answered() {
    let folder = recording(1);
    let program = replayed(folder.path(), &[]);
    let (machine, path) = &program.address;
    let ours = ("Host", machine.as_str());
    let of = |path: &str, headers: &[(&str, &str)]| exchange(machine, "GET", path, headers, "");
    let (status, page) = of(path, &[ours]);
    assert!(status == 200 && page.contains("connect-src 'self'"), "{status}");
    assert_eq!(program.pair(0)["number"], 1);

    let wrong = format!("/{}/", "0".repeat(path.len() - 2));
    for path in ["/", "/pair?after=0", "/settings", &wrong, &format!("{wrong}pair?after=0")] {
        let (status, words) = of(path, &[ours]);
        assert!(status == 403 && words.contains("token"), "{path}: {status} {words}");
    }
    let port = machine.split_once(':').unwrap().1;
    let rebound = format!("evil.example:{port}");
    for headers in [&[("Host", rebound.as_str())][..], &[("Host", "")], &[("Host", "127.0.0.1")]] {
        let (status, words) = of(path, headers);
        assert!(status == 403 && words.contains("this machine"), "{headers:?}: {status} {words}");
    }
    for origin in ["http://evil.example", "null", "http://127.0.0.1"] {
        let wish = r#"{"threshold": "9"}"#;
        let headers = [ours, ("Origin", origin)];
        let (status, words) = exchange(machine, "POST", &format!("{path}settings"), &headers, wish);
        assert!(status == 403 && words.contains("another page"), "{origin}: {status} {words}");
    }
    assert_eq!(program.ask("GET", "settings", "").0, 405);
    assert_eq!(program.ask("GET", "elsewhere", "").0, 404);
    assert_eq!(program.ask("GET", "pair?after=x", "").0, 400);
    assert_eq!(program.ask("POST", "settings", &"x".repeat(5000)).0, 400);
    let (status, words) = program.ask("POST", "settings", r#"{"region": "0,0,400,20"}"#);
    assert!(status == 400 && words.contains("320x240"), "{status} {words}");

    // The port is this machine's alone, and taken.
    let hex = format!(":{:04X}", port.parse::<u16>().unwrap());
    for (file, loopback) in [("/proc/net/tcp", "0100007F"), ("/proc/net/tcp6", "none")] {
        let table = fs::read_to_string(file).unwrap_or_default();
        let local = table.lines().skip(1).map(|line| line.split_whitespace().collect::<Vec<_>>());
        // In state 0A somebody listens.
        for line in local.filter(|line| line[3] == "0A" && line[1].ends_with(&hex)) {
            assert_eq!(line[1], format!("{loopback}{hex}"));
        }
    }
    let input = folder.path().display().to_string();
    let taken = host(&["replay", &input, "--view", port]).unwrap_err();
    assert!(taken.contains("is taken"), "{taken}");

    let machine = machine.clone();
    let (succeeded, said) = program.stop();
    assert!(succeeded && said.contains("until Ctrl-C"), "{said}");
    assert_eq!(TcpStream::connect(machine).unwrap_err().kind(), ErrorKind::ConnectionRefused);
}

#[test]
fn who_is_slow_or_silent_or_many_holds_up_nobody() {
    let folder = recording(400);
    let program = replayed(folder.path(), &["--rate", "20"]);
    let machine = program.address.0.clone();
    let first = program.pair(0)["number"].as_u64().unwrap();
    // One that does not read, one that says half of what it wants, and one that hangs up.
    let mut slow = connect(&machine);
    let get = request("GET", &format!("{}pair?after=0", program.address.1), &[("Host", &machine)], "");
    slow.write_all(get.as_bytes()).unwrap();
    let mut silent = connect(&machine);
    silent.write_all(b"GET / HT").unwrap();
    connect(&machine).write_all(get.as_bytes()).unwrap();
    let mut last = first;
    for _ in 0..8 {
        let next = program.pair(last)["number"].as_u64().unwrap();
        assert!(next > last, "{next} {last}");
        last = next;
    }
    // The newest wins: after a while, it is no pair of then.
    thread::sleep(Duration::from_millis(1500));
    let newest = program.pair(last)["number"].as_u64().unwrap();
    assert!(newest >= last + 3, "{newest} {last}");

    let crowd: Vec<TcpStream> = (0..40).map(|_| connect(&machine)).collect();
    let (status, words) = program.ask("GET", "", "");
    assert!(status == 503 && words.contains("too many"), "{status} {words}");
    drop((crowd, slow, silent));
    let end = Instant::now() + Duration::from_secs(10);
    while program.ask("GET", "", "").0 != 200 {
        assert!(Instant::now() < end, "those who went away are not forgotten");
        thread::sleep(Duration::from_millis(50));
    }
    assert!(program.pair(newest)["number"].as_u64().unwrap() > newest);
}

#[test]
fn what_is_set_on_the_page_makes_the_next_pair() {
    let Some(browser) = Browser::start().map(RefCell::new) else { return };
    let folder = recording(6);
    let program = replayed(folder.path(), &[]);
    let tab = Tab::open(&browser, &program, DESKTOP);
    tab.until("byId('pair').textContent.includes('0005') && byId('state').className === 'going'");
    let canvas = tab.drawn("#space");
    assert!(canvas > 20_000, "the model is drawn: {canvas} pixels");
    let pictures = tab.drawn("#cameras svg");
    assert!(pictures > 10_000, "what the camera sees is drawn: {pictures} pixels");
    for (size, width) in [(DESKTOP, "desktop"), (PHONE, "phone")] {
        for dark in [false, true] {
            tab.see(size, dark);
            keep(&format!("live-{width}-{}", if dark { "night" } else { "day" }), &tab.picture("html"));
            let wide = tab.eval("document.documentElement.scrollWidth").as_u64().unwrap();
            assert!(wide <= size[0].into(), "{width}: {wide} px wide");
        }
    }
    tab.see(DESKTOP, false);
    assert_eq!((tab.faults(), tab.foreign(&program)), (Vec::new(), Vec::new()));

    // Another window follows, and sees what is set in the first.
    let other = Tab::open(&browser, &program, PHONE);
    other.until("byId('state').className === 'going'");
    let before = mask(&tab);
    tab.eval("(() => { const l = byId('level'); l.value = 150; l.dispatchEvent(new Event('input')); })()");
    for tab in [&tab, &other] {
        tab.until(
            "content.report?.eyes.left.threshold_grey === 150 && !byId('otsu').checked && byId('level').value === '150'",
        );
        assert_ne!(mask(tab), before);
    }
    assert_eq!(mask(&tab), mask(&other));
    tab.until("byId('flags').textContent === '--threshold 150'");

    // What is held stays, though its window was waiting for the next pair already.
    tab.eval("byId('hold').click()");
    assert_eq!(program.ask("POST", "settings", r#"{"threshold": "160"}"#).0, 200);
    other.until("content.report?.eyes.left.threshold_grey === 160");
    thread::sleep(Duration::from_millis(1000));
    assert_eq!(tab.eval("content.report.eyes.left.threshold_grey"), 150);
    tab.eval("byId('hold').click()");
    tab.until("content.report?.eyes.left.threshold_grey === 160");
    assert_eq!(program.ask("POST", "settings", r#"{"threshold": "150"}"#).0, 200);
    tab.until("content.report?.eyes.left.threshold_grey === 150");

    // A region, drawn around the object on the right view with the mouse, in that view's pixels.
    tab.eval("document.querySelectorAll('.camera')[1].scrollIntoView()");
    let script = "(() => { const m = document.querySelectorAll('.camera')[1].getScreenCTM(); \
                  return [m.a, m.e, m.f]; })()";
    let [scale, x, y] = [0, 1, 2].map(|k| tab.eval(script)[k].as_f64().unwrap());
    let at = |u: f64, v: f64| [x + scale * u, y + scale * v];
    tab.drag(at(300.0, 220.0), at(20.0, 10.0));
    tab.until("byId('region').value === '20,10,280,210'");
    tab.until("content.report?.options.region_px?.x === 20");
    other.until("byId('flags').textContent === '--threshold 150 --roi 20,10,280,210'");
    keep("live-region", &tab.picture("html"));
    tab.eval("byId('whole').click()");
    tab.until("byId('region').value === '' && content.report?.options.region_px === null");

    // What cannot be is said, and the last pair stays; so is what is refused.
    tab.eval("(() => { byId('region').value = '0,0,999,20'; byId('region').dispatchEvent(new Event('change')); })()");
    tab.until("byId('complaint').textContent.includes('320x240')");
    tab.eval(
        "(() => { const p = byId('polarity'); p.value = 'dark'; p.dispatchEvent(new Event('change')); })()",
    );
    tab.until("byId('state').className === 'refused' && content.space === null");
    keep("live-refused", &tab.picture("html"));
    tab.until("byId('set-exposure').disabled && byId('set-exposure').textContent.includes('taken before')");

    assert_eq!((tab.faults(), tab.foreign(&program)), (Vec::new(), Vec::new()));
    let (succeeded, said) = program.stop();
    assert!(said.contains("--threshold 150 --polarity dark"), "{succeeded}: {said}");
    tab.until("byId('state').className === 'ended'");
}

#[test]
fn three_hundred_pairs_leave_memory_as_it_was() {
    let Some(browser) = Browser::start().map(RefCell::new) else { return };
    let folder = recording(300);
    let program = replayed(folder.path(), &["--rate", "12"]);
    let tab = Tab::open(&browser, &program, DESKTOP);
    let measure = |pair: u32| {
        tab.until(&format!("last >= {pair}"));
        (program.memory(), tab.heap())
    };
    let warm = measure(100);
    let end = measure(300);
    let drawn = tab.eval("300 - skipped").as_f64().unwrap();
    eprintln!("memory after 100 and 300 pairs, {drawn} of them drawn: {warm:?}, {end:?}");
    assert!(drawn > 30.0, "{drawn} of 300 pairs were drawn");
    assert!(end.0 < 1.1 * warm.0, "the program grew from {} to {} bytes", warm.0, end.0);
    assert!(end.1 < 1.1 * warm.1, "the page grew from {} to {} bytes", warm.1, end.1);
    assert_eq!(tab.faults(), Vec::<String>::new());
    assert!(program.stop().0);
}

#[test]
#[ignore = "a measurement (docs/numbers.md), which wants --release and a machine that does nothing else"]
fn how_fast_it_is_at_full_size() {
    let Some(browser) = Browser::start().map(RefCell::new) else { return };
    let folder = recording_at(1, 300);
    let program = replayed(folder.path(), &["--rate", "10"]);
    let tab = Tab::open(&browser, &program, DESKTOP);
    tab.until("last >= 100");
    let mut latencies = Vec::new();
    while tab.eval("last < 300") == true {
        let latency = tab.eval("parseFloat(byId('latency').textContent)");
        latencies.extend(latency.as_f64());
        thread::sleep(Duration::from_millis(100));
    }
    latencies.sort_by(f64::total_cmp);
    let [made, drawn] =
        ["rate", "drawn"].map(|gauge| tab.eval(&format!("byId('{gauge}').textContent")).to_string());
    let (skipped, middle) = (tab.eval("skipped"), latencies.get(latencies.len() / 2));
    eprintln!("made {made}, drawn {drawn}, skipped {skipped} of 300, camera to screen {middle:?} ms");
}

/// A device behind a socket that has its calibration.
fn device(folder: &Path) -> String {
    camera(2).write_opencv_yaml(folder.join("calib.yaml")).unwrap();
    let socket = serve(folder, &pair(Shape::Teapot, 2), intact, usize::MAX);
    prepare(folder, &socket);
    socket
}

#[test]
fn a_device_obeys_the_page() {
    let folder = TempDir::new().unwrap();
    let socket = device(folder.path());
    let calib = within(folder.path(), "calib.yaml");
    let program = Program::start(&["listen", "--port", &socket, "--calib", &calib, "--view"]);
    let pair = program.pair(0);
    assert_eq!(pair["pictures"], Value::Null);
    assert!(pair["settings"]["region"]["why"].as_str().unwrap().contains("all of its pictures"));
    let (status, told) = program.ask("POST", "settings", r#"{"threshold": "123", "exposure": "150"}"#);
    assert_eq!(status, 200, "{told}");
    let end = Instant::now() + Duration::from_secs(60);
    let mut last = pair["number"].as_u64().unwrap();
    loop {
        let pair = program.pair(last);
        last = pair["number"].as_u64().unwrap();
        // The device says with each pair at which level it parted object and background.
        if pair["content"]["report"]["eyes"]["left"]["threshold_grey"] == 123 {
            break;
        }
        assert!(
            Instant::now() < end,
            "the device does not obey: {}",
            pair["content"]["report"]["eyes"]["left"]
        );
    }
}
