//! What programs are told of the page's interface holds: the description of every address, and CBOR where it is asked for.

mod common;

use boresight_live::{LiveOutput, Page, PageOptions, RunOptions, Target, publisher, run};
use common::{POSE, ScenePlug, ask, board, config, get, scene};
use serde_json::Value;
use std::io::{Read, Write};
use std::net::{TcpStream, UdpSocket};
use std::sync::Arc;
use std::time::Duration;

/// A number of 16 bits, as appendix D of RFC 8949 decodes it.
fn half(bits: u64) -> f64 {
    let (exponent, mantissa) = (bits >> 10 & 31, (bits & 1023) as f64);
    let magnitude = match exponent {
        0 => mantissa * 2f64.powi(-24),
        31 => panic!("JSON has no such number"),
        e => (mantissa + 1024.0) * 2f64.powi(e as i32 - 25),
    };
    if bits >> 15 == 1 { -magnitude } else { magnitude }
}

/// Reads CBOR as RFC 8949 says it, written for this test alone.
fn read_cbor(bytes: &mut &[u8]) -> Value {
    let mut take = |n: usize| {
        let (head, rest) = bytes.split_at(n);
        *bytes = rest;
        head.iter().fold(0u64, |v, b| v << 8 | u64::from(*b))
    };
    let head = take(1) as u8;
    let (major, low) = (head >> 5, head & 31);
    if major == 7 {
        return match low {
            20 => false.into(),
            21 => true.into(),
            22 => Value::Null,
            25 => half(take(2)).into(),
            26 => f64::from(f32::from_bits(take(4) as u32)).into(),
            27 => f64::from_bits(take(8)).into(),
            other => panic!("simple value {other}"),
        };
    }
    let n = match low {
        0..24 => u64::from(low),
        24..=27 => take(1 << (low - 24)),
        other => panic!("length {other}"),
    };
    let mut text = |n: u64| {
        let (text, rest) = bytes.split_at(n as usize);
        *bytes = rest;
        String::from_utf8(text.to_vec()).unwrap()
    };
    match major {
        0 => n.into(),
        1 => (-1 - n as i64).into(),
        3 => text(n).into(),
        4 => (0..n).map(|_| read_cbor(bytes)).collect::<Vec<_>>().into(),
        5 => {
            let pairs = (0..n).map(|_| {
                let key = read_cbor(bytes).as_str().unwrap().to_string();
                (key, read_cbor(bytes))
            });
            pairs.collect::<serde_json::Map<_, _>>().into()
        }
        other => panic!("major type {other}"),
    }
}

/// The same but for how a whole number is held.
fn is_same(a: &Value, b: &Value) -> bool {
    match (a, b) {
        (Value::Number(a), Value::Number(b)) => a.as_f64() == b.as_f64(),
        (Value::Array(a), Value::Array(b)) => a.len() == b.len() && a.iter().zip(b).all(|(a, b)| is_same(a, b)),
        (Value::Object(a), Value::Object(b)) => {
            a.len() == b.len() && a.iter().all(|(k, v)| b.get(k).is_some_and(|w| is_same(v, w)))
        }
        _ => a == b,
    }
}

/// The body of an answer to a request that accepts this kind, and its kind.
fn accepted(to: std::net::SocketAddr, path: &str, kind: &str) -> (String, Vec<u8>) {
    let mut stream = TcpStream::connect(to).unwrap();
    write!(stream, "GET {path} HTTP/1.1\r\nHost: {to}\r\nAccept: {kind}\r\nConnection: close\r\n\r\n").unwrap();
    let mut all = Vec::new();
    stream.read_to_end(&mut all).unwrap();
    let end = all.windows(4).position(|w| w == b"\r\n\r\n").unwrap();
    let head = String::from_utf8_lossy(&all[..end]).into_owned();
    let kind = head.lines().find_map(|l| l.strip_prefix("content-type: ")).unwrap().to_string();
    (kind, all[end + 4..].to_vec())
}

/// A page that has seen a run, and a datagram of each form of its last event.
fn after_a_run() -> (Page, [Vec<u8>; 2]) {
    let board = board();
    let options = PageOptions { tune: true, ..PageOptions::at("127.0.0.1:0".parse().unwrap()) };
    let page = Page::serve(&options, &[Arc::clone(&board)]).unwrap();
    let sockets = ["", "?cbor"].map(|form| (UdpSocket::bind("127.0.0.1:0").unwrap(), form));
    let mut outputs: Vec<Box<dyn LiveOutput>> = vec![page.output(0).unwrap()];
    for (socket, form) in &sockets {
        let target = Target::parse(&format!("udp://{}{form}", socket.local_addr().unwrap())).unwrap();
        outputs.push(publisher(&target, &board).unwrap());
    }
    let options = RunOptions { config: Some(config().with(POSE).unwrap()), updates_hz: 5.0, ..RunOptions::default() };
    run(Box::new(ScenePlug::of(scene(30, 25.0), false)), &options, &board, &mut outputs, &|| false).unwrap();
    let last = sockets.map(|(socket, _)| {
        socket.set_read_timeout(Some(Duration::from_millis(300))).unwrap();
        let mut buffer = vec![0; 65_536];
        let mut tracks = Vec::new();
        while let Ok(n) = socket.recv(&mut buffer) {
            if buffer[..n].windows(15).any(|w| w == b"boresight.track") {
                tracks = buffer[..n].to_vec();
            }
        }
        tracks
    });
    (page, last)
}

#[test]
fn cbor_says_what_json_says_on_page_and_wire() {
    let (page, [json, cbor]) = after_a_run();
    let wire: Value = serde_json::from_slice(&json).unwrap();
    assert!(is_same(&read_cbor(&mut &*cbor), &wire) && wire["cov"].as_array().unwrap().len() == 10, "{wire}");
    assert!(cbor.len() < json.len());
    for path in ["/api/tracks", "/api/sources", "/api/config"] {
        let (kind, bytes) = accepted(page.address(), path, "text/html, application/cbor;q=0.9");
        let (plain, text) = accepted(page.address(), path, "*/*");
        assert_eq!((kind.as_str(), plain.as_str()), ("application/cbor", "application/json"));
        let (mut rest, json): (&[u8], Value) = (&bytes, serde_json::from_slice(&text).unwrap());
        assert!(is_same(&read_cbor(&mut rest), &json) && rest.is_empty(), "{path}: {json}");
    }
}

/// Whether a value fits a schema: type, const, enum, properties (all of them named), items, lengths.
fn fits(value: &Value, schema: &Value, document: &Value) -> Result<(), String> {
    if let Some(name) = schema["$ref"].as_str() {
        return fits(value, document.pointer(name.trim_start_matches('#')).unwrap(), document);
    }
    let wrong = |what: &str| Err(format!("{value} is not {what}: {schema}"));
    let is = |kind: &str| match kind {
        "object" => value.is_object(),
        "array" => value.is_array(),
        "string" => value.is_string(),
        "boolean" => value.is_boolean(),
        "integer" => value.is_u64(),
        "number" => value.is_number(),
        "null" => value.is_null(),
        other => panic!("{other}"),
    };
    let is_kind = match &schema["type"] {
        Value::String(kind) => is(kind),
        Value::Array(kinds) => kinds.iter().any(|k| is(k.as_str().unwrap())),
        _ => true,
    };
    if !is_kind || schema.get("const").is_some_and(|c| c != value) {
        return wrong("of its type");
    }
    if schema["enum"].as_array().is_some_and(|all| !all.contains(value)) {
        return wrong("one of those");
    }
    if let Some(items) = value.as_array() {
        let n = items.len() as u64;
        if n < schema["minItems"].as_u64().unwrap_or(0) || n > schema["maxItems"].as_u64().unwrap_or(u64::MAX) {
            return wrong("so long");
        }
        return items.iter().try_for_each(|item| fits(item, &schema["items"], document));
    }
    if let Some(object) = value.as_object() {
        if schema["required"]
            .as_array()
            .is_some_and(|all| all.iter().any(|k| !object.contains_key(k.as_str().unwrap())))
        {
            return wrong("complete");
        }
        return object.iter().try_for_each(|(key, value)| match schema["properties"].get(key) {
            Some(schema) => fits(value, schema, document),
            None => Err(format!("{key} is not described")),
        });
    }
    Ok(())
}

#[test]
fn every_address_answers_as_it_is_described() {
    let (page, [json, _]) = after_a_run();
    let to = page.address();
    let (_, head, body) = get(to, "/api/openapi.json");
    assert!(head.contains("application/json"));
    let document: Value = serde_json::from_str(&body).unwrap();
    let mut n_fit = 0;
    for (path, methods) in document["paths"].as_object().unwrap() {
        // The stream has no end, and pictures want another protocol: that they are there is enough here.
        let head = ask(to, &format!("GET {path} HTTP/1.1\r\nHost: {to}\r\n\r\n"));
        assert_eq!(head.0, if path == "/api/view" { 400 } else { 200 }, "{path}");
        let posted = ask(to, &format!("POST {path} HTTP/1.1\r\nHost: {to}\r\nContent-Length: 0\r\n\r\n")).0;
        assert_eq!(posted == 405, methods.get("post").is_none(), "{path}: {posted}");
        let content = &methods["get"]["responses"]["200"]["content"];
        for kind in content.as_object().into_iter().flat_map(|c| c.keys()) {
            if kind != "text/event-stream" {
                assert!(accepted(to, path, kind).0.starts_with(kind.as_str()), "{path} {kind}");
            }
        }
        if let Some(schema) = content["application/json"].get("schema").filter(|_| path != "/api/openapi.json") {
            let answer: Value = serde_json::from_str(&get(to, path).2).unwrap();
            fits(&answer, schema, &document).unwrap_or_else(|why| panic!("{path}: {why}"));
            n_fit += 1;
        }
    }
    assert_eq!(n_fit, 3);
    let event: Value = serde_json::from_slice(&json).unwrap();
    assert!(event["lat_deg"].is_number() && event["bearing_deg"].is_number(), "the pose gives every field: {event}");
    fits(&event, &document["components"]["schemas"]["Event"], &document).unwrap();
    // And the other way: no address of the interface is left out.
    let routes = include_str!("../src/serve/routes.rs");
    let served = routes.split(".route(\"").skip(1).filter_map(|r| r.split('"').next());
    for path in served.filter(|p| p.starts_with("/api") || *p == "/metrics").chain(["/api/config"]) {
        assert!(document["paths"].get(path).is_some(), "{path} is not described");
    }
}
