//! MQTT with a real broker, mosquitto, which is killed and started again in the middle; ignored where it is not installed.

mod common;

use boresight_live::{Event, LiveOutput, Mqtt, Target};
use common::board;
use common::daemon::{Daemon, PATIENCE, port};
use libtest_mimic::{Arguments, Trial};
use rumqttc::{Client, MqttOptions, Packet, QoS};
use std::collections::BTreeSet;
use std::process::{Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Instant;

fn program() -> Option<String> {
    let candidates = ["mosquitto", "/usr/sbin/mosquitto"];
    let runs = |p: &&&str| Command::new(p).arg("-h").stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok();
    candidates.iter().find(runs).map(ToString::to_string)
}

fn start(port: u16) -> Daemon {
    // As it comes it drops what a subscriber has not taken beyond 1000 messages: here every one is looked for, however slow the machine.
    let config = format!("listener {port} 127.0.0.1\nallow_anonymous true\nmax_queued_messages 0\n");
    Daemon::start(program().unwrap().as_ref(), &config, port)
}

/// Everything that comes on these topics: topic, payload, retained.
fn subscribe(port: u16, id: &str) -> Receiver<(String, String, bool)> {
    let (send, receive) = channel();
    let (client, mut connection) = Client::new(MqttOptions::new(id, "127.0.0.1", port), 10);
    client.subscribe("site/#", QoS::AtLeastOnce).unwrap();
    let (ready, is_ready) = channel();
    std::thread::spawn(move || {
        for event in connection.iter() {
            match event {
                Ok(rumqttc::Event::Incoming(Packet::SubAck(_))) => drop(ready.send(())),
                Ok(rumqttc::Event::Incoming(Packet::Publish(p))) => {
                    if send.send((p.topic, String::from_utf8(p.payload.to_vec()).unwrap(), p.retain)).is_err() {
                        return;
                    }
                }
                Ok(_) => {}
                Err(_) => return,
            }
        }
    });
    is_ready.recv_timeout(PATIENCE).expect("subscribed");
    // It lives as long as the thread: dropped, it would end the connection.
    std::mem::forget(client);
    receive
}

fn event(k: u64) -> Event {
    Event::line(false, format!("{{\"k\":{k}}}"))
}

fn status(state: &str) -> Event {
    Event::line(true, format!("{{\"state\":\"{state}\"}}"))
}

fn target(port: u16) -> boresight_live::Broker {
    match Target::parse(&format!("mqtt://127.0.0.1:{port}/site/tracks")).unwrap() {
        Target::Mqtt(broker) => broker,
        other => panic!("{other:?}"),
    }
}

/// Takes what comes until all of these numbers did.
fn until_all(from: &Receiver<(String, String, bool)>, mut missing: BTreeSet<u64>) {
    let until = Instant::now() + PATIENCE;
    while !missing.is_empty() {
        let left = until.saturating_duration_since(Instant::now());
        let Ok((topic, text, _)) = from.recv_timeout(left) else { panic!("never came: {missing:?}") };
        if topic == "site/tracks" {
            let value: serde_json::Value = serde_json::from_str(&text).unwrap();
            missing.remove(&value["k"].as_u64().unwrap());
        }
    }
}

fn a_broker_that_is_killed_and_comes_back_gets_what_waited() {
    let port = port();
    let mut broker = start(port);
    let first = subscribe(port, "first");
    let mut mqtt = Mqtt::start(&target(port), board()).unwrap();
    mqtt.event(&status("running"));
    (0..50).for_each(|k| mqtt.event(&event(k)));
    until_all(&first, (0..50).collect());
    drop(broker);
    // While it is away nobody waits, and nothing is lost that fits.
    (50..500).for_each(|k| mqtt.event(&event(k)));
    broker = start(port);
    let second = subscribe(port, "second");
    // What came in before this subscription was there went to nobody; of the rest everything comes.
    (500..600).for_each(|k| mqtt.event(&event(k)));
    until_all(&second, (500..600).collect());
    assert_eq!(mqtt.dropped(), 0);
    // The broker has forgotten everything, and is told the state again: who comes later finds it.
    let third = subscribe(port, "third");
    let (topic, text, retained) = third.recv_timeout(PATIENCE).unwrap();
    assert_eq!((topic.as_str(), text.as_str(), retained), ("site/tracks/status", "{\"state\":\"running\"}", true));
    mqtt.event(&status("ended"));
    mqtt.finish();
    let fourth = subscribe(port, "fourth");
    assert_eq!(fourth.recv_timeout(PATIENCE).unwrap().1, "{\"state\":\"ended\"}");
    drop(broker);
}

fn what_waits_for_a_broker_is_bounded_and_comes_when_it_does() {
    let port = port();
    let mut mqtt = Mqtt::start(&target(port), board()).unwrap();
    (0..5000).for_each(|k| mqtt.event(&event(k)));
    assert_eq!(mqtt.dropped(), 5000 - 4096, "bounded: the oldest go, and are counted");
    let _broker = start(port);
    let listener = subscribe(port, "listener");
    (5000..5010).for_each(|k| mqtt.event(&event(k)));
    until_all(&listener, (5000..5010).collect());
    mqtt.finish();
}

fn the_last_will_is_said_when_the_program_dies() {
    let port = port();
    let _broker = start(port);
    let listener = subscribe(port, "listener");
    let mut mqtt = Mqtt::start(&target(port), board()).unwrap();
    mqtt.event(&status("running"));
    let until = Instant::now() + PATIENCE;
    loop {
        let (topic, text, _) = listener.recv_timeout(until.saturating_duration_since(Instant::now())).unwrap();
        if topic == "site/tracks/status" && text.contains("running") {
            break;
        }
    }
    // Without a word, as when the program is killed.
    drop(mqtt);
    let (topic, text, _) = listener.recv_timeout(PATIENCE).expect("the will");
    assert!(topic == "site/tracks/status" && text.contains("\"gone\""), "{topic} {text}");
}

fn main() -> std::process::ExitCode {
    let tests: [(&str, fn()); 3] = [
        (
            "a_broker_that_is_killed_and_comes_back_gets_what_waited",
            a_broker_that_is_killed_and_comes_back_gets_what_waited,
        ),
        (
            "what_waits_for_a_broker_is_bounded_and_comes_when_it_does",
            what_waits_for_a_broker_is_bounded_and_comes_when_it_does,
        ),
        ("the_last_will_is_said_when_the_program_dies", the_last_will_is_said_when_the_program_dies),
    ];
    let missing = program().is_none();
    let trials = tests.map(|(name, run)| {
        let trial = Trial::test(name, move || {
            run();
            Ok(())
        });
        if missing { trial.with_kind("needs mosquitto").with_ignored_flag(true) } else { trial }
    });
    libtest_mimic::run(&Arguments::from_args(), trials.into()).exit_code()
}
