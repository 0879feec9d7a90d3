//! `host batch`: each pair is made once, whoever is killed over it, and as `host replay` makes it.
//!
//! Needs a build with batches, and `nats-server`: `./ci.sh fleet`. Thousands of pairs with twenty kills, and how fast a
//! batch is, take minutes:
//!
//!     cargo test --release -p host --features batch --test batch -- --ignored --nocapture --test-threads 1
#![cfg(unix)]

mod certificates;
mod queue;

use queue::{Batch, FULL, PASSWORD, SMALL, Server, make_pairs, replay, same};
use std::fs;
use std::path::Path;
use std::time::Duration;
use tempfile::TempDir;

#[test]
fn workers_that_are_killed_and_a_server_that_restarts_lose_nothing_and_make_nothing_twice() {
    const PAIRS: usize = 600;
    let folder = TempDir::new().unwrap();
    let [pairs, made, expected] = ["pairs", "made", "expected"].map(|name| folder.path().join(name));
    fs::create_dir(&pairs).unwrap();
    make_pairs(&pairs, PAIRS, SMALL);
    let _ = replay(&pairs, &expected, 2, SMALL);
    let mut server = Server::start();
    let place = server.place();
    let batch = Batch { folder: &pairs, out: &made, server: &place, name: "kills", kind: SMALL, tries: "5" };
    assert_eq!(batch.submit()["queued"], PAIRS);
    // A second time there is nothing to queue.
    let again = batch.submit();
    assert_eq!((&again["queued"], &again["waited_already"]), (&0.into(), &PAIRS.into()));
    batch.work_with_kills(&mut server, 6, PAIRS, 1);
    let status = batch.status();
    let count = |name: &str| status[name].as_u64().unwrap();
    assert_eq!(["waiting", "at_work", "set_aside"].map(count), [0; 3], "{status}");
    assert_eq!([count("made"), count("refused")], [PAIRS as u64 - 12, 12], "{status}");
    same(&made, &expected).expect("workers leave what replay leaves");
    // What is done is not queued again, unless it is another pair now.
    assert_eq!(batch.submit()["done_before"], PAIRS);
    fs::copy(pairs.join("00001/left.png"), pairs.join("00000/left.png")).unwrap();
    assert_eq!(batch.submit()["queued"], 1);
}

#[test]
fn what_cannot_be_read_is_set_aside_with_the_reason_and_may_be_submitted_again() {
    let folder = TempDir::new().unwrap();
    let [pairs, made] = ["pairs", "made"].map(|name| folder.path().join(name));
    fs::create_dir(&pairs).unwrap();
    make_pairs(&pairs, 3, SMALL);
    let sound = fs::read(pairs.join("00001/left.png")).unwrap();
    fs::write(pairs.join("00001/left.png"), "no picture").unwrap();
    let server = Server::start();
    let place = server.place();
    let batch = Batch { folder: &pairs, out: &made, server: &place, name: "poison", kind: SMALL, tries: "2" };
    batch.submit();
    let _ = batch.work(1);
    let status = batch.status();
    assert_eq!((&status["made"], &status["set_aside"]), (&2.into(), &1.into()), "{status}");
    let aside = &status["aside"][0];
    assert_eq!((&aside["name"], &aside["tries"]), (&"00001".into(), &2.into()));
    assert!(aside["reason"].as_str().unwrap().contains("left.png"), "{aside}");
    assert!(!made.join("00001").exists());
    // What changes between queue and worker is no longer what was submitted.
    batch.submit();
    fs::write(pairs.join("00001/left.png"), &sound).unwrap();
    let _ = batch.work(1);
    let reason = batch.status()["aside"][0]["reason"].to_string();
    assert!(reason.contains("submit it again"), "{reason}");
    assert_eq!(batch.submit()["queued"], 1);
    let _ = batch.work(1);
    assert_eq!(batch.status()["made"], 3);
    assert!(made.join("00001/model.ply").is_file());
    batch.forget();
    assert_eq!(batch.submit()["queued"], 3);
}

#[test]
fn a_queue_across_machines_lets_in_who_is_known_and_nobody_else() {
    if certificates::skipped() {
        return;
    }
    let folder = TempDir::new().unwrap();
    let [pairs, made, ours, theirs] =
        ["pairs", "made", "ours", "theirs"].map(|name| folder.path().join(name));
    for folder in [&pairs, &ours, &theirs] {
        fs::create_dir(folder).unwrap();
    }
    make_pairs(&pairs, 2, SMALL);
    certificates::make(&ours);
    certificates::make(&theirs);
    let document = certificates::document("batch.md");
    fs::write(ours.join("queue.conf"), certificates::blocks(&document, "hocon").next().unwrap()).unwrap();
    let server = Server::start_as(Some(&ours));
    let file = |folder: &Path, name: &str| folder.join(name).display().to_string();
    let authority = |folder: &Path| ["--ca".into(), file(folder, "authority.pem")];
    let own = |folder: &Path| {
        ["--cert".into(), file(folder, "board.pem"), "--key".into(), file(folder, "board-key.pem")]
    };
    let known = server.place_for(&format!("tls://worker:{}@", PASSWORD.replace('@', "%40")));
    let reach = |place: &[String], more: &[&[String]]| [&[place], more].concat().concat();
    let as_known = reach(&known, &[&authority(&ours), &own(&ours)]);
    let batch = Batch { folder: &pairs, out: &made, server: &as_known, name: "far", kind: SMALL, tries: "2" };
    batch.submit();
    let _ = batch.work(1);
    assert_eq!(batch.status()["made"], 2);
    let strangers = [
        ("without a certificate", reach(&known, &[&authority(&ours)])),
        ("with another authority's", reach(&known, &[&authority(&ours), &own(&theirs)])),
        ("who does not believe it", reach(&known, &[&authority(&theirs), &own(&ours)])),
        ("who knows no authority", server.place().to_vec()),
        ("without a password", reach(&server.place_for("tls://"), &[&authority(&ours), &own(&ours)])),
        ("with a wrong one", reach(&server.place_for("tls://worker:no@"), &[&authority(&ours), &own(&ours)])),
    ];
    for (who, server) in strangers {
        let told = Batch { server: &server, ..batch }.try_status().expect_err(who);
        assert!(told.contains("do not trust each other"), "{who}: {told}");
        assert!(!told.contains(PASSWORD) && !told.contains("one%40two"), "{who}: {told}");
    }
    for (name, why) in [("none.pem", "none.pem"), ("board-key.pem", "no certificate in PEM")] {
        let server = reach(&known, &[&["--ca".into(), file(&ours, name)]]);
        let told = Batch { server: &server, ..batch }.try_status().unwrap_err();
        assert!(told.contains("cannot use") && told.contains(why), "{told}");
    }
    assert_eq!(batch.status()["made"], 2, "nobody was disturbed");
    // Whoever knows an authority says nothing in the clear, whatever the server asks for.
    let open = Server::start();
    let server = reach(&open.place_for("nats://worker:one%40two@"), &[&authority(&ours)]);
    let told = Batch { server: &server, ..batch }.try_status().expect_err("in the clear");
    assert!(told.contains("do not trust each other") || told.contains("no NATS server"), "{told}");
}

/// The time of `host replay` over that of a batch, and what a pair takes of the server.
#[test]
#[ignore = "takes minutes, and an idle machine"]
fn how_fast_it_is() {
    const TIMED: usize = 1000;
    const ROUNDS: usize = 3;
    let folder = TempDir::new().unwrap();
    let [pairs, made, expected] = ["pairs", "made", "expected"].map(|name| folder.path().join(name));
    fs::create_dir(&pairs).unwrap();
    make_pairs(&pairs, TIMED, FULL);
    let server = Server::start();
    let place = server.place();
    let batch = Batch { folder: &pairs, out: &made, server: &place, name: "speed", kind: FULL, tries: "5" };
    println!("{TIMED} pairs, best of {ROUNDS}: replay, batch, ratio");
    let [mut waiting, mut done] = [0; 2];
    let begun = server.time();
    for threads in [1, 2] {
        let [mut alone, mut queued] = [Duration::MAX; 2];
        for _ in 0..ROUNDS {
            alone = alone.min(replay(&pairs, &expected, threads, FULL));
            batch.submit();
            waiting = server.kept();
            queued = queued.min(batch.work(threads));
            done = server.kept();
            batch.forget();
        }
        let [replay, batch] = [alone, queued].map(|time| time.as_secs_f64());
        println!("{threads} at a time: {replay:.2} s, {batch:.2} s, {:.3}", replay / batch);
    }
    let all = (2 * ROUNDS * TIMED) as f64;
    let took = (server.time() - begun).as_secs_f64() / all;
    let [waiting, done] = [waiting, done].map(|bytes| bytes / TIMED);
    println!(
        "the server: {:.0} us a pair; {waiting} bytes for one that waits, {done} when it is done",
        took * 1e6
    );
}

#[test]
#[ignore = "takes minutes"]
fn thousands_of_pairs_with_twenty_kills() {
    const PAIRS: usize = 4000;
    const KILLS: usize = 20;
    let folder = TempDir::new().unwrap();
    let [pairs, made, expected] = ["pairs", "made", "expected"].map(|name| folder.path().join(name));
    fs::create_dir(&pairs).unwrap();
    make_pairs(&pairs, PAIRS, SMALL);
    let _ = replay(&pairs, &expected, 2, SMALL);
    let mut server = Server::start();
    let place = server.place();
    let batch = Batch { folder: &pairs, out: &made, server: &place, name: "kills", kind: SMALL, tries: "5" };
    assert_eq!(batch.submit()["queued"], PAIRS);
    batch.work_with_kills(&mut server, KILLS, PAIRS, 1);
    let status = batch.status();
    let count = |name: &str| status[name].as_u64().unwrap() as usize;
    println!("{KILLS} workers killed, and the server once");
    println!(
        "{PAIRS} pairs: {} made, {} refused, {} set aside",
        count("made"),
        count("refused"),
        count("set_aside")
    );
    assert_eq!(["waiting", "at_work", "set_aside"].map(count), [0; 3], "{status}");
    assert_eq!(count("made") + count("refused"), PAIRS);
    let files = same(&made, &expected).expect("workers leave what replay leaves");
    println!("{files} files, all as `host replay` leaves them");
}
