//! A fleet within one process: what is lost is counted and named, who may not is not let in, nothing listens that
//! should not. Boards are in `tests/tests/fleet.rs`.
//!
//! Needs a build with fleets, and `openssl`: `./ci.sh fleet`.
#![cfg(unix)]

mod certificates;

use std::fs;
use std::io::{BufRead, BufReader};
use std::net::TcpListener;
use std::os::unix::fs::MetadataExt;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use host::fleet::key::{Board, Leaf};
use host::fleet::ledger::Ledger;
use host::fleet::{FleetError, Link, Meeting, Message, Pressure, Publisher, Subscriber};
use host::live::control::{Control, Limits, Settings};
use serde_json::{Map, Value};
use shared::stage::binarise::Threshold;
use tempfile::TempDir;

/// Longest that anything is waited for.
const PATIENCE: Duration = Duration::from_secs(60);
/// Bytes of a message like a model.
const MODEL: usize = 1 << 20;

fn free_port() -> u16 {
    TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

/// A router, and a client that met it.
fn meet() -> (Link, Link) {
    let place = format!("tcp/127.0.0.1:{}", free_port());
    let router = Link::open(&Meeting { listen: vec![place.clone()], ..Meeting::default() }).unwrap();
    let client = Link::open(&Meeting { connect: vec![place], ..Meeting::default() }).unwrap();
    (router, client)
}

fn board(name: &str) -> Board {
    Board::one(&format!("ossature/lab/{name}")).unwrap()
}

fn control() -> Arc<Control> {
    let no = Err("it has none");
    let limits = Limits {
        threshold: Ok(()),
        polarity: Ok(()),
        region: no,
        exposure: Err("it has none".into()),
        pairs: Ok(()),
    };
    Arc::new(Control::new(Settings::default(), limits))
}

/// The next message.
fn next(subscriber: &Subscriber) -> Message {
    subscriber.next(PATIENCE).unwrap().expect("a message comes").expect("it can be read")
}

/// Sends until a message has come, so that both ends know one another.
fn warm(publisher: &mut Publisher, subscriber: &Subscriber) {
    let end = Instant::now() + PATIENCE;
    loop {
        publisher.put(Leaf::Health, 0, b"{}".to_vec()).unwrap();
        if subscriber.next(Duration::from_millis(50)).unwrap().is_some() {
            break;
        }
        assert!(Instant::now() < end, "nothing comes");
    }
    while subscriber.next(Duration::from_millis(200)).unwrap().is_some() {}
}

/// So many models and a status from another thread, to a subscriber that only then begins to look: the numbers of the
/// models that came, and the gaps, models of them.
fn slowly(pressures: [Pressure; 2], models: u64, pause: Duration) -> (Vec<u64>, Vec<(u64, u64)>) {
    let (router, client) = meet();
    let mut publisher = client.publish(&board("left"), pressures[0], control()).unwrap();
    let subscriber = router.subscribe(&"ossature/*/*".parse().unwrap(), pressures[1]).unwrap();
    warm(&mut publisher, &subscriber);
    let mut ledger = Ledger::default();
    // The subscriber was there before the first model.
    ledger.sent(&board("left"), Leaf::Model, &run_of(&router), 0);
    let sender = thread::spawn(move || {
        for pair in 1..=models {
            publisher.put(Leaf::Model, pair, vec![pair as u8; MODEL]).unwrap();
        }
        // A status may be lost as well, so there are several, once there is somebody who looks.
        thread::sleep(pause);
        for _ in 0..20 {
            thread::sleep(Duration::from_millis(250));
            publisher.status(models, Map::new()).unwrap();
        }
        publisher
    });
    thread::sleep(pause);
    let (mut came, mut gaps) = (Vec::new(), Vec::new());
    loop {
        let Message { board, leaf, envelope, bytes } = next(&subscriber);
        let mut note = |gap: Option<host::fleet::ledger::Gap>| {
            gaps.extend(gap.filter(|gap| gap.leaf == Leaf::Model).map(|gap| (gap.first, gap.last)));
        };
        note(ledger.came(&board, leaf, &envelope.run, envelope.number));
        match leaf {
            Leaf::Model => {
                assert!(bytes == vec![envelope.pair as u8; MODEL], "a model is whole");
                came.push(envelope.number);
            }
            Leaf::Status => {
                let status: Value = serde_json::from_slice(&bytes).unwrap();
                assert_eq!(status["sent"]["model"], models);
                note(ledger.sent(&board, Leaf::Model, &envelope.run, models));
                break;
            }
            _ => {}
        }
    }
    drop(sender.join().unwrap());
    (came, gaps)
}

/// The run of the only board.
fn run_of(link: &Link) -> String {
    link.last(&board("left"), Leaf::Health).unwrap()[0].as_ref().unwrap().envelope.run.clone()
}

fn in_gaps(gaps: &[(u64, u64)]) -> Vec<u64> {
    gaps.iter().flat_map(|&(first, last)| first..=last).collect()
}

#[test]
fn nothing_is_lost_to_a_slow_subscriber_for_whom_others_wait() {
    let (came, gaps) = slowly([Pressure::Wait; 2], 150, Duration::from_secs(7));
    assert_eq!(came, (0..150).collect::<Vec<_>>());
    assert_eq!(gaps, []);
}

#[test]
fn what_a_slow_subscriber_loses_is_counted_and_named() {
    for pressures in [[Pressure::Newest, Pressure::Wait], [Pressure::Wait, Pressure::Newest]] {
        let (came, gaps) = slowly(pressures, 150, Duration::from_secs(5));
        let lost = in_gaps(&gaps);
        assert!(!came.is_empty() && !lost.is_empty(), "{pressures:?}: {} came", came.len());
        eprintln!("{pressures:?}: {} of 150 came, lost: {gaps:?}", came.len());
        if pressures[1] == Pressure::Newest {
            assert_eq!(came.last(), Some(&149), "the newest is there");
        }
        let mut all = [came, lost].concat();
        all.sort_unstable();
        assert_eq!(all, (0..150).collect::<Vec<_>>(), "{pressures:?}");
    }
}

/// What a pair takes on its way: 1.4 KB, 1 MiB and a line, as `host listen` sends them, to one subscriber that keeps up.
#[test]
#[ignore = "takes an idle machine"]
fn how_fast_it_is() {
    const PAIRS: u64 = 300;
    let (router, client) = meet();
    let mut publisher = client.publish(&board("left"), Pressure::Wait, control()).unwrap();
    let subscriber = router.subscribe(&"ossature/*/*".parse().unwrap(), Pressure::Wait).unwrap();
    warm(&mut publisher, &subscriber);
    let begun = (Instant::now(), processor_time());
    let sender = thread::spawn(move || {
        for pair in 1..=PAIRS {
            for (leaf, length) in [(Leaf::Shape, 1400), (Leaf::Model, MODEL), (Leaf::Pair, 300)] {
                publisher.put(leaf, pair, vec![0; length]).unwrap();
            }
        }
        publisher
    });
    loop {
        let Message { leaf, envelope, .. } = next(&subscriber);
        if leaf == Leaf::Pair && envelope.pair == PAIRS {
            break;
        }
    }
    let (wall, busy) = (begun.0.elapsed().as_secs_f64(), processor_time() - begun.1);
    drop(sender.join().unwrap());
    let per_pair = |seconds: f64| 1e3 * seconds / PAIRS as f64;
    eprintln!("a pair: {:.2} ms, {:.2} ms of processors at both ends", per_pair(wall), per_pair(busy));
}

/// Of this process so far, s.
fn processor_time() -> f64 {
    let stat = fs::read_to_string("/proc/self/stat").unwrap();
    let fields: Vec<&str> = stat.rsplit_once(')').unwrap().1.split_whitespace().collect();
    // Ticks of 10 ms, of the program and of the system for it.
    [11, 12].iter().map(|&k| fields[k].parse::<f64>().unwrap()).sum::<f64>() / 100.0
}

#[test]
fn a_publisher_that_begins_anew_has_lost_nothing() {
    let (router, client) = meet();
    let subscriber = router.subscribe(&"ossature/lab/*".parse().unwrap(), Pressure::Wait).unwrap();
    let mut ledger = Ledger::default();
    let mut runs = Vec::new();
    for _ in 0..3 {
        let mut publisher = client.publish(&board("left"), Pressure::Wait, control()).unwrap();
        warm(&mut publisher, &subscriber);
        for pair in 1..=5 {
            publisher.put(Leaf::Pair, pair, b"{}".to_vec()).unwrap();
            let message = next(&subscriber);
            assert_eq!((message.leaf, message.envelope.number), (Leaf::Pair, pair - 1));
            assert_eq!(ledger.came(&message.board, message.leaf, &message.envelope.run, pair - 1), None);
            runs.push(message.envelope.run);
        }
    }
    runs.dedup();
    assert_eq!(runs.len(), 3, "{runs:?}");
    assert_eq!(ledger.lost(), 0);
}

#[test]
fn orders_are_obeyed_or_refused_and_the_last_words_are_kept() {
    let (router, client) = meet();
    let controls = [control(), control()];
    let boards = ["left", "right"].map(board);
    let mut publishers =
        [0, 1].map(|k| client.publish(&boards[k], Pressure::Wait, Arc::clone(&controls[k])).unwrap());
    let all: Board = "ossature/lab/*".parse().unwrap();
    let end = Instant::now() + PATIENCE;
    let order = |boards: &Board, what: &str, value: &str| {
        loop {
            let answers = router.order(boards, what, value).unwrap();
            if !answers.is_empty() || Instant::now() > end {
                return answers;
            }
        }
    };
    let (whose, told) = order(&boards[0], "threshold", "120").remove(0).unwrap();
    let told: Value = serde_json::from_slice(&told).unwrap();
    assert_eq!(whose, boards[0]);
    assert_eq!(told["threshold"]["value"], "120");
    let threshold = |k: usize| controls[k].settings().0.threshold;
    assert_eq!([threshold(0), threshold(1)], [Threshold::Fixed(120), Threshold::Otsu]);
    assert_eq!(order(&all, "threshold", "77").iter().filter(|answer| answer.is_ok()).count(), 2);
    assert_eq!([threshold(0), threshold(1)], [Threshold::Fixed(77); 2]);
    for (what, value, words) in [
        ("threshold", "300", "0 to 255"),
        ("exposure", "9", "it has none"),
        ("gain", "1", "gain"),
        ("pairs", "x", "give all"),
    ] {
        let answer = order(&boards[1], what, value).remove(0).unwrap_err();
        assert!(
            answer.starts_with("ossature/lab/right: ") && answer.contains(words),
            "{what} {value}: {answer}"
        );
    }
    assert!(order(&boards[1], "pairs", "1")[0].is_ok());
    assert_eq!(
        [controls[1].take_pair(), controls[1].take_pair(), controls[0].take_pair()],
        [true, false, true]
    );

    // Who comes late asks for what was said last.
    for (k, publisher) in publishers.iter_mut().enumerate() {
        publisher.put(Leaf::Model, 1, vec![0; 9]).unwrap();
        publisher.status(k as u64, Map::new()).unwrap();
        publisher.status(k as u64, Map::new()).unwrap();
    }
    thread::sleep(Duration::from_millis(300));
    let last: Result<Vec<Message>, String> = router.last(&all, Leaf::Status).unwrap().into_iter().collect();
    let mut last = last.unwrap();
    last.sort_by(|a, b| a.board.cmp(&b.board));
    assert_eq!(last.iter().map(|message| message.board.clone()).collect::<Vec<_>>(), boards);
    for message in &last {
        let status: Value = serde_json::from_slice(&message.bytes).unwrap();
        assert_eq!((message.envelope.number, &status["sent"]["model"]), (1, &1.into()));
        assert!(message.envelope.age_ms >= Some(300), "{message:?}");
    }
    assert_eq!(router.last(&all, Leaf::Model).unwrap(), [], "models are not kept");
    drop(publishers);
    assert_eq!(router.last(&all, Leaf::Status).unwrap(), [], "who is gone does not answer");
}

#[test]
fn a_name_that_is_taken_is_refused_until_it_is_free() {
    let (router, client) = meet();
    let first = client.publish(&board("left"), Pressure::Wait, control()).unwrap();
    let other = client.publish(&board("right"), Pressure::Wait, control()).unwrap();
    for link in [&client, &router] {
        let end = Instant::now() + PATIENCE;
        // A router hears of a name a moment later.
        let error = loop {
            match link.publish(&board("left"), Pressure::Wait, control()) {
                Err(error) => break error,
                Ok(_) => assert!(Instant::now() < end, "two have one name"),
            }
        };
        assert!(matches!(error, FleetError::Named(_)), "{error}");
    }
    drop(first);
    let _again = client.publish(&board("left"), Pressure::Wait, control()).unwrap();
    drop(other);
}

/// A program of ours that was told to stand still, killed at the end.
struct Hung(Child);

impl Drop for Hung {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn a_subscriber_that_hangs_is_given_up_and_the_others_go_on() {
    let place = format!("tcp/127.0.0.1:{}", free_port());
    let router = Link::open(&Meeting { listen: vec![place.clone()], ..Meeting::default() }).unwrap();
    let client = Link::open(&Meeting { connect: vec![place.clone()], ..Meeting::default() }).unwrap();
    let hung = Command::new(env!("CARGO_BIN_EXE_host"))
        .args(["subscribe", "--connect", &place, "--json"])
        .stdout(Stdio::piped())
        .spawn();
    let mut hung = Hung(hung.unwrap());
    let mut lines = BufReader::new(hung.0.stdout.take().unwrap()).lines();
    assert!(lines.next().unwrap().unwrap().contains("subscribed"));
    let mut publisher = client.publish(&board("left"), Pressure::Wait, control()).unwrap();
    // Both ends may need a moment to know one another.
    for _ in 0..20 {
        publisher.put(Leaf::Pair, 1, b"{}".to_vec()).unwrap();
        thread::sleep(Duration::from_millis(100));
    }
    assert!(lines.any(|line| line.unwrap().contains("told")));
    let stopped = Command::new("kill").args(["-STOP", &hung.0.id().to_string()]).status();
    assert!(stopped.unwrap().success());
    let (begun, mut longest) = (Instant::now(), Duration::ZERO);
    for pair in 1..=60 {
        let before = Instant::now();
        publisher.put(Leaf::Model, pair, vec![0; MODEL]).unwrap();
        longest = longest.max(before.elapsed());
    }
    eprintln!("a hung subscriber: the longest wait {longest:.1?}, all {:.1?}", begun.elapsed());
    assert!(longest > Duration::from_secs(3), "it has held nobody up: {longest:?}");
    assert!(longest < Duration::from_secs(25) && begun.elapsed() < Duration::from_secs(40), "{longest:?}");
    // The link of the publisher is as it was.
    let end = Instant::now() + PATIENCE;
    while router.order(&board("left"), "threshold", "9").unwrap().iter().all(Result::is_err) {
        assert!(Instant::now() < end, "it takes no orders any more");
    }
}

#[test]
fn a_router_that_comes_back_is_met_again_and_what_was_lost_is_named() {
    let place = format!("tcp/127.0.0.1:{}", free_port());
    let listen = || Link::open(&Meeting { listen: vec![place.clone()], ..Meeting::default() });
    let router = listen().unwrap();
    let [sending, hearing] = [(); 2]
        .map(|()| Link::open(&Meeting { connect: vec![place.clone()], ..Meeting::default() }).unwrap());
    let subscriber = hearing.subscribe(&"ossature/*/*".parse().unwrap(), Pressure::Wait).unwrap();
    let mut publisher = sending.publish(&board("left"), Pressure::Wait, control()).unwrap();
    warm(&mut publisher, &subscriber);
    let mut ledger = Ledger::default();
    publisher.put(Leaf::Pair, 1, b"{}".to_vec()).unwrap();
    let Message { board, leaf, envelope, .. } = next(&subscriber);
    assert_eq!(ledger.came(&board, leaf, &envelope.run, envelope.number), None);
    drop(router);
    thread::sleep(Duration::from_secs(1));
    for pair in 2..=6 {
        publisher.put(Leaf::Pair, pair, b"{}".to_vec()).unwrap();
    }
    let end = Instant::now() + PATIENCE;
    let _router = loop {
        match listen() {
            Ok(router) => break router,
            Err(error) => assert!(Instant::now() < end, "{error}"),
        }
        thread::sleep(Duration::from_millis(200));
    };
    let status = loop {
        assert!(Instant::now() < end, "nobody meets again");
        publisher.status(6, Map::new()).unwrap();
        if let Some(message) = subscriber.next(Duration::from_millis(250)).unwrap() {
            break message.unwrap();
        }
    };
    let gap = ledger.sent(&status.board, Leaf::Pair, &status.envelope.run, 6).unwrap();
    assert_eq!(gap.to_string(), "ossature/lab/left/pair: 5 messages are lost, 1 to 5");
}

#[test]
fn who_does_not_listen_is_no_router_and_what_is_no_place_is_wrong_usage() {
    let folder = TempDir::new().unwrap();
    let config = folder.path().join("member.json5");
    fs::write(&config, r#"{ connect: { endpoints: ["tcp/127.0.0.1:1"] } }"#).unwrap();
    let host = |arguments: &[&str]| {
        let done = Command::new(env!("CARGO_BIN_EXE_host")).args(arguments).output().unwrap();
        (done.status.code(), String::from_utf8_lossy(&done.stderr).into_owned())
    };
    let config = config.to_str().unwrap();
    for (arguments, code, words) in [
        (&["fleet", "router", "--zenoh-config", config][..], 1, "nowhere to listen"),
        (&["fleet", "--connect", "127.0.0.1:7447"], 2, "give tcp/HOST:PORT"),
        (&["subscribe", "--listen-at", "tcp/127.0.0.1"], 2, "give tcp/HOST:PORT"),
        (&["fleet", "list", "--listen-at", "tcp/127.0.0.1:0"], 2, "host fleet router"),
        (&["listen", "--calib", "x", "--connect", "tcp/127.0.0.1:1"], 2, "need --publish"),
    ] {
        let (ended, told) = host(arguments);
        assert!(ended == Some(code) && told.contains(words), "{arguments:?}: {ended:?} {told}");
    }
}

/// What listens, and what waits for datagrams: addresses as the kernel writes them.
fn listening() -> Vec<String> {
    let sockets: Vec<u64> = fs::read_dir("/proc/self/fd")
        .unwrap()
        .filter_map(|entry| Some(fs::metadata(entry.ok()?.path()).ok()?.ino()))
        .collect();
    let mut found = Vec::new();
    for (table, state) in [("tcp", Some("0A")), ("tcp6", Some("0A")), ("udp", None), ("udp6", None)] {
        let text = fs::read_to_string(format!("/proc/net/{table}")).unwrap_or_default();
        for line in text.lines().skip(1).map(|line| line.split_whitespace().collect::<Vec<_>>()) {
            let ours = line[9].parse().is_ok_and(|inode: u64| sockets.contains(&inode));
            if ours && state.is_none_or(|state| line[3] == state) {
                found.push(format!("{table} {}", line[1]));
            }
        }
    }
    found
}

#[test]
fn nothing_is_reachable_from_elsewhere_unless_it_is_said() {
    let _fleet = meet();
    let found = listening();
    assert!(!found.is_empty(), "the router listens");
    // In the kernel's words 127.0.0.1 is this.
    assert!(found.iter().all(|address| address.starts_with("tcp 0100007F:")), "{found:?}");
    let nobody = Link::open(&Meeting {
        connect: vec![format!("tcp/127.0.0.1:{}", free_port())],
        ..Meeting::default()
    });
    let words = nobody.unwrap_err().to_string();
    assert!(words.contains("nobody is met") && words.contains("host fleet router"), "{words}");
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let place = format!("tcp/127.0.0.1:{}", taken.local_addr().unwrap().port());
    let error = Link::open(&Meeting { listen: vec![place], ..Meeting::default() }).unwrap_err();
    assert!(matches!(error, FleetError::Taken { .. }), "{error}");
}

#[test]
fn who_has_no_certificate_is_not_let_in() {
    if certificates::skipped() {
        return;
    }
    let document = certificates::document("fleet.md");
    let (ours, theirs) = (TempDir::new().unwrap(), TempDir::new().unwrap());
    for folder in [&ours, &theirs] {
        certificates::make(folder.path());
    }
    let port = free_port();
    let configs: Vec<&str> = certificates::blocks(&document, "json5").collect();
    let [router, member] = configs[..] else { panic!("{configs:?}") };
    // The document's own text, in this test's folders and at its port.
    let config = |text: &str, name: &str, change: &dyn Fn(String) -> String| {
        let here = format!("\"{}/", ours.path().display());
        let text =
            [("0.0.0.0:7447", format!("127.0.0.1:{port}")), ("localhost:7447", format!("localhost:{port}"))]
                .iter()
                .fold(text.to_owned(), |text, (from, to)| text.replace(from, to));
        let names = ["authority", "router", "board"];
        let text = names
            .iter()
            .fold(text, |text, name| text.replace(&format!("\"{name}"), &format!("{here}{name}")));
        let path = ours.path().join(format!("{name}.json5"));
        fs::write(&path, change(text)).unwrap();
        Meeting { config: Some(path), ..Meeting::default() }
    };
    let same = |text| text;
    let router = Link::open(&config(router, "router", &same)).unwrap();
    let subscriber = router.subscribe(&"ossature/*/*".parse().unwrap(), Pressure::Wait).unwrap();
    let member_link = Link::open(&config(member, "board", &same)).unwrap();
    let mut publisher = member_link.publish(&board("left"), Pressure::Wait, control()).unwrap();
    warm(&mut publisher, &subscriber);

    let without = |text: String| {
        let kept = text.lines().filter(|line| !line.contains("connect_") && !line.contains("mtls"));
        kept.map(|line| format!("{line}\n")).collect::<String>()
    };
    let own = ours.path().display().to_string();
    let foreign = |text: String| {
        let [from, to] = [&own, &theirs.path().display().to_string()].map(|folder| format!("{folder}/board"));
        text.replace(&from, &to)
    };
    let distrustful = |text: String| {
        let [from, to] =
            [&own, &theirs.path().display().to_string()].map(|folder| format!("{folder}/authority"));
        text.replace(&from, &to)
    };
    let plain = |text: String| text.replace("tls/localhost", "tcp/127.0.0.1");
    let strangers: [(&str, &dyn Fn(String) -> String); 4] =
        [("without", &without), ("foreign", &foreign), ("distrustful", &distrustful), ("plain", &plain)];
    for (name, change) in strangers {
        let error = Link::open(&config(member, name, change)).expect_err(name);
        assert!(matches!(error, FleetError::Nobody { .. }), "{name}: {error}");
        assert!(error.to_string().contains("certificates"), "{name}: {error}");
    }
    let missing = |text: String| text.replace("board-key.pem", "no-such-key.pem");
    assert!(Link::open(&config(member, "missing", &missing)).is_err());
    let broken = Link::open(&config("{ mode: ", "broken", &same)).unwrap_err();
    assert!(matches!(broken, FleetError::Config { .. }), "{broken}");
    // Nobody was disturbed.
    publisher.put(Leaf::Pair, 1, b"{}".to_vec()).unwrap();
    assert_eq!(next(&subscriber).leaf, Leaf::Pair);
}
