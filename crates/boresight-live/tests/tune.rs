//! Parameters changed while a run goes on: what a change does, and every wrong way to ask for one.

mod common;

use boresight_live::{LiveOutput, Page, PageOptions, Record, RecordOptions, RunOptions, Target, publisher, run};
use common::{ScenePlug, ask, board, collect_udp, config, get, scene};
use serde_json::Value;
use std::net::{SocketAddr, UdpSocket};
use std::sync::Arc;
use std::time::{Duration, Instant};

const GOOD: &str = "{\"key\":\"tracker.coast-s\",\"value\":2}";

fn page(address: &str, tune: bool) -> (Page, SocketAddr) {
    let board = board();
    board.configured(config().to_toml().unwrap(), Vec::new());
    let page = Page::serve(&PageOptions { tune, ..PageOptions::at(address.parse().unwrap()) }, &[board]).unwrap();
    let to = SocketAddr::from(([127, 0, 0, 1], page.address().port()));
    (page, to)
}

fn token(to: SocketAddr, headers: &str) -> String {
    let (_, _, body) = ask(to, &format!("GET /api/config HTTP/1.1\r\nHost: {to}\r\n{headers}\r\n"));
    let answer: Value = serde_json::from_str(&body).unwrap();
    answer["change_token"].as_str().unwrap().to_string()
}

/// Sends a body to an address with these headers besides the necessary ones.
fn send(to: SocketAddr, path: &str, headers: &str, body: &str) -> (u16, String) {
    let n = body.len();
    let head =
        format!("POST {path} HTTP/1.1\r\nHost: {to}\r\nContent-Length: {n}\r\nConnection: close\r\n{headers}\r\n");
    let (code, _, text) = ask(to, &(head + body));
    (code, text)
}

fn usual(to: SocketAddr, token: &str) -> String {
    format!("Origin: http://{to}\r\nContent-Type: application/json\r\nX-Boresight-Change: {token}\r\n")
}

#[test]
fn without_leave_nothing_is_changed_and_no_token_is_given() {
    let (_page, to) = page("127.0.0.1:0", false);
    let answer: Value = serde_json::from_str(&get(to, "/api/config").2).unwrap();
    assert!(answer["change_token"].is_null() && answer["dials"].is_null());
    assert_eq!(send(to, "/api/config", &usual(to, ""), GOOD).0, 405);
    assert_eq!(send(to, "/api/config", &usual(to, "0123456789abcdef0123456789abcdef"), GOOD).0, 405);
}

#[test]
fn every_wrong_way_to_ask_for_a_change_is_refused() {
    let (_page, to) = page("127.0.0.1:0", true);
    let token = token(to, "");
    let json = "Content-Type: application/json\r\n";
    let with = format!("X-Boresight-Change: {token}\r\n");
    let own = format!("Origin: http://{to}\r\n");
    let post = |headers: &str, body: &str| send(to, "/api/config", headers, body).0;
    // Its origin.
    assert_eq!(post(&format!("{json}{with}"), GOOD), 403, "no origin");
    for origin in ["http://evil.example", "null", "http://localhost:1"] {
        assert_eq!(post(&format!("{json}{with}Origin: {origin}\r\n"), GOOD), 403, "{origin}");
    }
    assert_eq!(post(&format!("{json}{with}{own}Sec-Fetch-Site: cross-site\r\n"), GOOD), 403);
    // Its token.
    assert_eq!(post(&format!("{json}{own}"), GOOD), 403, "no token");
    for wrong in ["", "x", &token[1..], &format!("{token}0"), &"0".repeat(32), &"x".repeat(5000)] {
        assert_eq!(post(&usual(to, wrong), GOOD), 403, "{wrong}");
    }
    assert_eq!(send(to, &format!("/api/config?change_token={token}"), &format!("{json}{own}"), GOOD).0, 403);
    // Its method, its place, its host.
    let line = |line: &str, host: &str| {
        let n = GOOD.len();
        ask(to, &format!("{line} HTTP/1.1\r\nHost: {host}\r\nContent-Length: {n}\r\n{}\r\n{GOOD}", usual(to, &token))).0
    };
    let host = to.to_string();
    for other in ["PUT /api/config", "DELETE /api/config", "PATCH /api/config", "POST /api/tracks", "POST /"] {
        assert_eq!(line(other, &host), 405, "{other}");
    }
    assert_eq!(line("POST /api/config", "evil.example"), 421);
    assert_eq!(line("POST /api/config?source=west", &host), 404);
    // Its content.
    assert_eq!(post(&format!("{own}{with}Content-Type: text/plain\r\n"), GOOD), 415);
    assert_eq!(post(&usual(to, &token), &" ".repeat(5000)), 413);
    for body in
        ["", "{}", "[]", "{\"key\":\"tracker.coast-s\"}", "{\"key\":\"tracker.coast-s\",\"value\":NaN}", "\u{0}"]
    {
        assert_eq!(post(&usual(to, &token), body), 400, "{body}");
    }
    for (key, value) in
        [("input.rate-hz", "5"), ("tracker.max-tracks", "9"), ("tracker.coast-s", "1e9"), ("tracker.coast-s", "-1")]
    {
        let body = format!("{{\"key\":\"{key}\",\"value\":{value}}}");
        assert_eq!(post(&usual(to, &token), &body), 422, "{body}");
    }
    // And the right way, which a GET never is.
    let (code, text) = send(to, "/api/config", &usual(to, &token), GOOD);
    let told: Value = serde_json::from_str(&text).unwrap();
    assert_eq!((code, told["toml"].as_str()), (202, Some("[tracker]\ncoast-s = 2.0\n")));
    let answer: Value = serde_json::from_str(&get(to, "/api/config?key=tracker.coast-s&value=9").2).unwrap();
    assert!(!answer["toml"].as_str().unwrap().contains("coast-s = 9"));
    // Nobody runs here who would take them: what waits is bounded.
    let codes: Vec<u16> = (0..80).map(|_| send(to, "/api/config", &usual(to, &token), GOOD).0).collect();
    assert!(codes.contains(&429), "{codes:?}");
}

#[test]
fn elsewhere_a_change_needs_the_visitor_s_token_as_well() {
    let (page, to) = page("0.0.0.0:0", true);
    let visitor = format!("Authorization: Bearer {}\r\n", page.token().unwrap());
    let change = token(to, &visitor);
    assert_ne!(Some(change.as_str()), page.token());
    assert_eq!(send(to, "/api/config", &usual(to, &change), GOOD).0, 401);
    assert_eq!(send(to, "/api/config", &(usual(to, page.token().unwrap()) + &visitor), GOOD).0, 403);
    assert_eq!(send(to, "/api/config", &(usual(to, &change) + &visitor), GOOD).0, 202);
}

#[test]
fn before_there_is_a_configuration_there_is_nothing_to_change() {
    let options = PageOptions { tune: true, ..PageOptions::at("127.0.0.1:0".parse().unwrap()) };
    let page = Page::serve(&options, &[board()]).unwrap();
    let to = page.address();
    assert_eq!(send(to, "/api/config", &usual(to, &token(to, "")), GOOD).0, 409);
}

#[test]
fn a_change_acts_on_the_run_its_record_begins_a_segment_and_no_number_comes_twice() {
    let (board, dir) = (board(), tempfile::tempdir().unwrap());
    let options = PageOptions { tune: true, ..PageOptions::at("127.0.0.1:0".parse().unwrap()) };
    let page = Page::serve(&options, &[Arc::clone(&board)]).unwrap();
    let to = page.address();
    let wire = UdpSocket::bind("127.0.0.1:0").unwrap();
    let target = Target::parse(&format!("udp://{}", wire.local_addr().unwrap())).unwrap();
    let mut outputs: Vec<Box<dyn LiveOutput>> = vec![
        Box::new(Record::create(dir.path(), RecordOptions::default()).unwrap()),
        publisher(&target, &board).unwrap(),
        page.output(0).unwrap(),
    ];
    let events = std::thread::spawn(move || collect_udp(&wire));
    let asker = std::thread::spawn(move || {
        let tracks = || -> Vec<u64> {
            let shot: Value = serde_json::from_str(&get(to, "/api/tracks").2).unwrap();
            shot["tracks"].as_array().unwrap().iter().map(|t| t["track"].as_u64().unwrap()).collect()
        };
        let until = |is_so: &dyn Fn(&[u64]) -> bool| {
            let end = Instant::now() + Duration::from_secs(20);
            while !is_so(&tracks()) {
                assert!(Instant::now() < end, "{:?}", tracks());
                std::thread::sleep(Duration::from_millis(10));
            }
        };
        until(&|t| t == [1, 2]);
        let token = token(to, "");
        let change = |key: &str, value: f64| {
            let body = format!("{{\"key\":\"{key}\",\"value\":{value}}}");
            assert_eq!(send(to, "/api/config", &usual(to, &token), &body).0, 202);
        };
        // The tracker begins anew; its numbers do not.
        change("tracker.coast-s", 0.2);
        until(&|t| t.len() == 2 && t.iter().all(|id| *id > 2));
        // Larger than any target: nothing is found, the tracks end.
        change("detector.cluster.min-area-px", 5000.0);
        until(&|t| t.is_empty());
        change("detector.cluster.min-area-px", 25.0);
        until(&|t| t.len() == 2);
    });
    let options = RunOptions { config: Some(config()), updates_hz: f64::INFINITY, ..RunOptions::default() };
    let asked = || asker.is_finished();
    run(Box::new(ScenePlug::of(scene(1000, 50.0), true)), &options, &board, &mut outputs, &asked).unwrap();
    asker.join().unwrap();
    let events = events.join().unwrap();
    let of = |event: &str| -> Vec<u64> {
        events.iter().filter(|(_, e)| e["event"] == event).map(|(_, e)| e["track"].as_u64().unwrap()).collect()
    };
    let (mut starts, mut ends) = (of("start"), of("end"));
    assert_eq!(starts.len(), 6, "{starts:?}");
    starts.sort_unstable();
    starts.dedup();
    ends.sort_unstable();
    assert_eq!((starts.len(), &starts), (6, &ends), "every track starts and ends once, under a number of its own");
    let kept = |n: u32, key: &str| {
        std::fs::read_to_string(dir.path().join(format!("{n:06}.config.toml"))).unwrap().contains(key)
    };
    assert!(
        kept(1, "coast-s = 0.6")
            && kept(2, "coast-s = 0.2")
            && kept(3, "min-area-px = 5000")
            && kept(4, "min-area-px = 25")
    );
    // Wire and record agree on the numbers.
    let text = std::fs::read_to_string(dir.path().join("000002.jsonl")).unwrap();
    let numbers =
        text.lines().flat_map(|l| serde_json::from_str::<Value>(l).unwrap()["tracks"].as_array().unwrap().clone());
    let confirmed = numbers.filter(|t| t["status"] != "tentative").map(|t| t["track_id"].as_u64().unwrap());
    assert!(confirmed.clone().count() >= 2 && confirmed.into_iter().all(|id| id > 2 && starts.contains(&id)));
    let (toml, reasons) = board.configuration();
    assert!(
        toml.contains("coast-s = 0.2") && reasons.iter().any(|r| r == "Changed on the page: tracker.coast-s = 0.2.")
    );
}
