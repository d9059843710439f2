//! The page over the network: every wrong way in, limits on what is read, and viewers that stand still.

mod common;

use boresight_live::{LiveOutput, Page, PageOptions, RunOptions, run};
use common::{ScenePlug, Viewer, ask, board, config, get, scene};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

fn page(address: &str) -> Page {
    Page::serve(&PageOptions::at(address.parse().unwrap()), &[board()]).unwrap()
}

#[test]
fn on_loopback_the_page_opens_without_a_token_and_strangers_are_refused() {
    let page = page("127.0.0.1:0");
    let to = page.address();
    assert!(page.token().is_none());
    for (path, kind) in [
        ("/", "text/html"),
        ("/page.js", "text/javascript"),
        ("/page.css", "text/css"),
        ("/api/tracks", "application/json"),
        ("/api/config", "application/json"),
        ("/metrics", "text/plain; version=0.0.4"),
    ] {
        let (code, head, body) = get(to, path);
        assert!(code == 200 && head.contains(kind) && !body.is_empty(), "{path}: {code} {head}");
        for header in ["content-security-policy: default-src 'none'", "x-frame-options: DENY", "nosniff"] {
            assert!(head.contains(header), "{path}: {header}");
        }
    }
    let code = |request: &str| ask(to, request).0;
    assert_eq!(code("GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n"), 421, "a name made to lead here");
    assert_eq!(code("GET / HTTP/1.1\r\n\r\n"), 400, "no host");
    assert_eq!(code(&format!("GET /api/tracks HTTP/1.1\r\nHost: {to}\r\nOrigin: http://evil.example\r\n\r\n")), 403);
    for method in ["POST", "PUT", "DELETE", "PATCH", "OPTIONS", "TRACE"] {
        assert_eq!(code(&format!("{method} / HTTP/1.1\r\nHost: {to}\r\nContent-Length: 0\r\n\r\n")), 405, "{method}");
    }
    for path in ["/../../etc/passwd", "/%2e%2e/etc/passwd", "/etc/passwd", "/page.js/", "/api/"] {
        assert_eq!(get(to, path).0, 404, "{path}");
    }
    assert_eq!(Viewer::enter(to, "Origin: http://evil.example\r\n").err(), Some(403));
    assert!(Viewer::enter(to, &format!("Origin: http://{to}\r\n")).is_ok());
}

#[test]
fn what_is_too_large_is_refused_and_the_next_is_served() {
    let page = page("127.0.0.1:0");
    let to = page.address();
    let long = "a".repeat(40_000);
    let code = ask(to, &format!("GET /{long} HTTP/1.1\r\nHost: {to}\r\n\r\n")).0;
    assert!(matches!(code, 0 | 400 | 414 | 431), "{code}");
    let many: String = (0..200).map(|k| format!("X-{k}: 1\r\n")).collect();
    assert_eq!(ask(to, &format!("GET / HTTP/1.1\r\nHost: {to}\r\n{many}\r\n")).0, 431);
    assert!(matches!(ask(to, "\u{0}\u{1}garbage\r\n\r\n").0, 0 | 400));
    // A viewer has one word to say; a long one ends it.
    let mut viewer = Viewer::enter(to, "").ok().unwrap();
    assert!(viewer.next().is_some(), "the first message comes at once");
    viewer.send(&long.as_bytes()[..10_000]);
    assert!(viewer.next().is_none(), "closed");
    assert_eq!(get(to, "/").0, 200);
}

#[test]
fn on_any_other_address_the_token_is_the_only_way_in() {
    let page = page("0.0.0.0:0");
    let port = page.address().port();
    let to = format!("127.0.0.1:{port}").parse().unwrap();
    let token = page.token().unwrap().to_string();
    for path in [
        "/",
        "/page.js",
        "/api/tracks",
        "/api/stream",
        "/metrics",
        "/?token=",
        "/?token=00000000000000000000000000000000",
    ] {
        let (code, _, body) = get(to, path);
        assert_eq!(code, 401, "{path}");
        assert!(!body.contains(&token));
    }
    assert_eq!(Viewer::enter(to, "").err(), Some(401));
    assert_eq!(Viewer::enter(to, &format!("Cookie: boresight-{port}={token}\r\n")).err(), Some(401));
    let (code, head, _) = get(to, &format!("/?token={token}"));
    assert_eq!(code, 303);
    assert!(head.contains("location: /") && !head.contains(&token), "the token stays in no address: {head}");
    let cookie = head.lines().find_map(|l| l.strip_prefix("set-cookie: ")).unwrap();
    assert!(cookie.contains("HttpOnly") && cookie.contains("SameSite=Strict"));
    let pair = cookie.split(';').next().unwrap();
    let with = |extra: &str| ask(to, &format!("GET /api/tracks HTTP/1.1\r\nHost: {to}\r\n{extra}\r\n\r\n")).0;
    assert_eq!(with(&format!("Cookie: other=1; {pair}")), 200);
    assert_eq!(with(&format!("Authorization: Bearer {token}")), 200);
    assert_eq!(with(&format!("Cookie: {pair}x")), 401);
    assert_eq!(with(&format!("Cookie: {pair}\r\nOrigin: http://evil.example")), 403, "a cookie alone is not enough");
    assert!(Viewer::enter(to, &format!("Cookie: {pair}\r\nOrigin: http://{to}\r\n")).is_ok());
}

#[test]
fn places_are_limited_and_given_back() {
    let board = board();
    let options = PageOptions { most_viewers: 2, ..PageOptions::at("127.0.0.1:0".parse().unwrap()) };
    let page = Page::serve(&options, &[Arc::clone(&board)]).unwrap();
    let to = page.address();
    let (first, _second) = (Viewer::enter(to, "").ok().unwrap(), Viewer::enter(to, "").ok().unwrap());
    assert_eq!(Viewer::enter(to, "").err(), Some(503));
    drop(first);
    let until = std::time::Instant::now() + std::time::Duration::from_secs(20);
    while board.counts.viewers.load(Ordering::SeqCst) > 1 {
        assert!(std::time::Instant::now() < until, "the place is given back");
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    assert!(Viewer::enter(to, "").is_ok());
}

#[test]
fn fifty_viewers_one_of_them_stalled_hold_up_nobody() {
    let board = board();
    let page = Page::serve(&PageOptions::at("127.0.0.1:0".parse().unwrap()), &[Arc::clone(&board)]).unwrap();
    let to = page.address();
    // This one never reads, and never says that it has drawn.
    let stalled = Viewer::enter(to, "").ok().unwrap();
    let over = Arc::new(AtomicBool::new(false));
    let seen: Vec<Arc<AtomicU64>> = (0..49).map(|_| Arc::default()).collect();
    let viewers: Vec<_> = seen
        .iter()
        .map(|seen| {
            let (seen, over) = (Arc::clone(seen), Arc::clone(&over));
            let mut viewer = Viewer::enter(to, "").ok().unwrap();
            std::thread::spawn(move || {
                while !over.load(Ordering::SeqCst) {
                    let Some((snapshot, _)) = viewer.next() else { return };
                    viewer.send(b"next");
                    seen.fetch_max(snapshot["frame"].as_u64().unwrap(), Ordering::SeqCst);
                    if snapshot["state"] == "ended" {
                        return;
                    }
                }
            })
        })
        .collect();
    assert_eq!(board.counts.viewers.load(Ordering::SeqCst), 50);
    let mut outputs: Vec<Box<dyn LiveOutput>> = vec![page.output(0).unwrap()];
    let options = RunOptions { config: Some(config()), ..RunOptions::default() };
    // Every frame waits to be taken here: the run ends only if no viewer holds it up.
    run(Box::new(ScenePlug::of(scene(100, 50.0), true)), &options, &board, &mut outputs, &|| false).unwrap();
    assert_eq!(board.counts.tracked.load(Ordering::SeqCst), 100);
    assert_eq!(board.counts.viewers.load(Ordering::SeqCst), 50, "the stalled one is still there");
    for viewer in viewers {
        viewer.join().unwrap();
    }
    over.store(true, Ordering::SeqCst);
    assert!(seen.iter().all(|s| s.load(Ordering::SeqCst) > 10), "the others saw the run go on");
    drop(stalled);
}
