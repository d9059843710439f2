//! `boresight live` as a program: lines in and out, a record that outlives SIGKILL, refusals.

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, Command, Output, Stdio};

fn boresight(args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_boresight"));
    command.args(args).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// A target that goes right, a scan each 40 ms.
fn line(k: u32) -> String {
    let (time_s, x) = (0.04 * f64::from(k), 10.0 + 0.5 * f64::from(k));
    format!("{{\"time_s\":{time_s:.2},\"detections\":[{{\"x_px\":{x},\"y_px\":20,\"cov_px2\":[0.04,0,0.04]}}]}}\n")
}

fn fed(mut child: Child, text: &str) -> Output {
    child.stdin.take().unwrap().write_all(text.as_bytes()).unwrap();
    child.wait_with_output().unwrap()
}

#[test]
fn lines_of_detections_become_lines_of_events() {
    let text: String = (0..100).map(line).collect();
    let out = fed(boresight(&["live", "-", "--publish", "-", "--updates-hz", "1000"]).spawn().unwrap(), &text);
    let said = String::from_utf8_lossy(&out.stderr);
    assert!(out.status.success(), "{said}");
    let events: Vec<serde_json::Value> =
        String::from_utf8(out.stdout).unwrap().lines().map(|l| serde_json::from_str(l).unwrap()).collect();
    let of = |event: &str| events.iter().filter(|e| e["event"] == event).count();
    assert_eq!((of("start"), of("end")), (1, 1), "{said}");
    let end = events.iter().find(|e| e["event"] == "end").unwrap();
    assert!((end["x_px"].as_f64().unwrap() - 59.5).abs() < 0.5, "{end}");
    assert_eq!(events.last().unwrap()["state"], "ended");
}

#[test]
fn a_record_is_whole_after_a_kill() {
    let dir = tempfile::tempdir().unwrap();
    let kept = dir.path().join("kept").display().to_string();
    let mut child =
        boresight(&["live", "-", "--publish", "-", "--updates-hz", "1000", "--record", &kept, "--learn-s", "0.2"])
            .spawn()
            .unwrap();
    let mut input = child.stdin.take().unwrap();
    let mut events = BufReader::new(child.stdout.take().unwrap()).lines();
    (0..200).for_each(|k| input.write_all(line(k).as_bytes()).unwrap());
    input.flush().unwrap();
    // What was published was recorded before.
    let seen =
        |text: &str| -> u64 { serde_json::from_str::<serde_json::Value>(text).unwrap()["frame"].as_u64().unwrap_or(0) };
    assert!(events.by_ref().any(|event| seen(&event.unwrap()) >= 150));
    child.kill().unwrap();
    child.wait().unwrap();
    let read = |ending: &str| std::fs::read_to_string(format!("{kept}/000001.{ending}")).unwrap();
    let lines = read("jsonl");
    assert!(lines.ends_with('\n') && lines.lines().count() > 150);
    assert!(lines.lines().all(|l| serde_json::from_str::<serde_json::Value>(l).is_ok()));
    for table in ["tracks.csv", "detections.csv"] {
        let text = read(table);
        let columns = text.lines().next().unwrap().split(',').count();
        assert!(text.ends_with('\n') && text.lines().all(|l| l.split(',').count() == columns), "{table}");
    }
    let manifest: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(format!("{kept}/manifest.json")).unwrap()).unwrap();
    assert_eq!(manifest["segments"][0]["open"], true, "{manifest}");
    // And it replays with the tables' own command.
    let (table, config) = (format!("{kept}/000001.detections.csv"), format!("{kept}/000001.config.toml"));
    let offline = dir.path().join("offline").display().to_string();
    let out =
        boresight(&["track", &table, "--config", &config, "-o", &offline, "--quiet", "--no-report"]).output().unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    // The kill may fall between the files: one of them may hold a frame more.
    let (again, kept_tracks) = (std::fs::read_to_string(format!("{offline}/tracks.csv")).unwrap(), read("tracks.csv"));
    let (short, long) = if again.len() < kept_tracks.len() { (&again, &kept_tracks) } else { (&kept_tracks, &again) };
    assert!(long.starts_with(short.as_str()) && long.lines().count() <= short.lines().count() + 1);
    assert!(short.lines().count() > 140);
    // The next run goes on with the next number.
    let text: String = (0..50).map(line).collect();
    assert!(fed(boresight(&["live", "-", "--record", &kept, "--quiet"]).spawn().unwrap(), &text).status.success());
    assert!(std::path::Path::new(&format!("{kept}/000002.jsonl")).exists());
}

#[test]
#[cfg(target_os = "linux")] // prlimit
fn a_record_on_a_full_disk_keeps_whole_lines_and_the_run_goes_on() {
    let dir = tempfile::tempdir().unwrap();
    let text: String = (0..120).map(line).collect();
    // No file may grow beyond `bytes`: a write across it is cut there, the next one fails.
    let recorded = |bytes: u64| {
        let kept = dir.path().join(bytes.to_string());
        let script = format!(
            "trap '' XFSZ; exec prlimit --fsize={bytes} \"$0\" live - --publish - --updates-hz 1000 --learn-s 0.2 --record \"$1\""
        );
        let mut command = Command::new("bash");
        command.args(["-c", &script, env!("CARGO_BIN_EXE_boresight")]).arg(&kept);
        let out =
            fed(command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap(), &text);
        let mut files = std::collections::BTreeMap::new();
        for entry in std::fs::read_dir(&kept).unwrap() {
            let entry = entry.unwrap();
            files.insert(entry.file_name().into_string().unwrap(), std::fs::read(entry.path()).unwrap());
        }
        (out, files)
    };
    let is_whole = |name: &str, content: &[u8]| -> bool {
        let text = std::str::from_utf8(content).unwrap();
        let lines = text.is_empty() || text.ends_with('\n');
        match name.split_once('.').map_or(name, |n| n.1) {
            "jsonl" => lines && text.lines().all(|l| serde_json::from_str::<serde_json::Value>(l).is_ok()),
            "json" => serde_json::from_str::<serde_json::Value>(text).is_ok(),
            _ => lines,
        }
    };
    let (out, whole) = recorded(1 << 30);
    assert!(out.status.success() && whole.contains_key("000001.jsonl"), "{:?}", whole.keys());
    let published = |out: &Output| String::from_utf8_lossy(&out.stdout).lines().filter(|l| l.contains("x_px")).count();
    let n_published = published(&out);
    // The largest file differs from run to run by the digits of its arrival times, some twenty bytes: the last cut is in the middle of its last line.
    let all = whole.values().max_by_key(|content| content.len()).unwrap();
    let last_line = all.split_inclusive(|byte| *byte == b'\n').next_back().unwrap().len() as u64;
    assert!(last_line > 200, "{last_line}");
    let largest = all.len() as u64;
    let last = largest - last_line / 2;
    for bytes in [0, 1, 70, 140, 511, 1000, 1001, 1002, 1003, 2047, 4096, largest / 3, largest / 2, last] {
        let (out, left) = recorded(bytes);
        let said = String::from_utf8_lossy(&out.stderr);
        assert!(said.contains("cannot be written") && !said.contains("panicked"), "{bytes}: {said}");
        assert!(out.status.success() && published(&out) == n_published, "{bytes}: {:?} {said}", out.status);
        for (name, content) in &left {
            assert!(is_whole(name, content), "{bytes} bytes: {name} ends with {:?}", content.iter().rev().take(40));
            assert!(!name.contains("part"), "{bytes} bytes: {name} is left");
            // The first segment's tables are the beginnings of the whole ones.
            if name.starts_with("000001") && !name.ends_with("jsonl") {
                assert!(whole[name].starts_with(content), "{bytes} bytes: {name}");
            }
        }
    }
}

#[test]
fn several_sources_are_recorded_beside_each_other_each_with_its_configuration() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name).display().to_string();
    let text: String = (0..100).map(line).collect();
    std::fs::write(dir.path().join("a.jsonl"), &text).unwrap();
    std::fs::write(dir.path().join("b.jsonl"), &text).unwrap();
    std::fs::write(dir.path().join("far.toml"), "[tracker]\ncoast-s = 7.5\n").unwrap();
    let (a, b, far, kept) =
        (at("a.jsonl"), format!("far={}", at("b.jsonl")), format!("far={}", at("far.toml")), at("kept"));
    let out = boresight(&["live", &a, &b, "--config", &far, "--publish", "-", "--record", &kept]).output().unwrap();
    let said = String::from_utf8_lossy(&out.stderr);
    assert!(out.status.success() && said.contains("far: running") && said.contains("a: configuration:"), "{said}");
    let events: Vec<serde_json::Value> =
        String::from_utf8(out.stdout).unwrap().lines().map(|l| serde_json::from_str(l).unwrap()).collect();
    for name in ["a", "far"] {
        let of = |event: &str| events.iter().filter(|e| e["source"] == name && e["event"] == event).count();
        assert_eq!((of("start"), of("end")), (1, 1), "{name}: {said}");
        assert!(dir.path().join("kept").join(name).join("000001.jsonl").exists(), "{name}");
    }
    let config = |name: &str| std::fs::read_to_string(format!("{kept}/{name}/000001.config.toml")).unwrap();
    assert!(config("far").contains("coast-s = 7.5") && !config("a").contains("coast-s = 7.5"));
    // One that is not there ends alone; the code says it in the end.
    let gone = at("gone.mp4");
    let out = boresight(&["live", &a, &gone, "--publish", "-", "--quiet"]).output().unwrap();
    let said = String::from_utf8_lossy(&out.stderr);
    assert!(out.status.code() == Some(3) && said.contains("the other sources go on"), "{said}");
    assert!(String::from_utf8_lossy(&out.stdout).contains("\"event\":\"end\",\"source\":\"a\""), "{said}");
}

#[test]
fn packaging_asks_for_options_that_there_are_and_the_compiler_that_is_needed() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let read = |name: &str| std::fs::read_to_string(root.join(name)).unwrap();
    let help = boresight(&["live", "--help"]).output().unwrap();
    let help = String::from_utf8(help.stdout).unwrap();
    let (unit, container) = (read("packaging/boresight-live.service"), read("packaging/Containerfile"));
    let run = container.lines().filter(|l| l.contains("--serve"));
    let mut n = 0;
    let unit = unit.lines().filter(|l| !l.contains("systemctl"));
    for word in unit.chain(run).flat_map(|l| l.split([' ', '='])).filter(|w| w.starts_with("--")) {
        assert!(help.contains(word), "{word}");
        n += 1;
    }
    assert!(n >= 5, "{n}");
    let of = |text: &str, before: &str| {
        let rest = text.split(before).nth(1).unwrap();
        rest.split(|c: char| c != '.' && !c.is_ascii_digit()).next().unwrap().to_string()
    };
    assert_eq!(of(&container, "library/rust:"), of(&read("Cargo.toml"), "rust-version = \""));
}

#[test]
fn what_cannot_be_is_said_with_its_mend_and_code() {
    let out = fed(boresight(&["live", "-"]).spawn().unwrap(), "{\"detections\":7}\n{}\n");
    let said = String::from_utf8_lossy(&out.stderr);
    assert!(
        out.status.code() == Some(3) && said.contains("line 1 is left out") && said.contains("gave nothing"),
        "{said}"
    );
    for (args, code, words) in [
        (&["live", "-", "--publish", "ftp://x/y"][..], 2, "hint: give -"),
        (&["live", "-", "--serve", "nowhere"], 2, "127.0.0.1:8090"),
        (&["live", "-", "--detector", "colour"], 2, "config.toml"),
        (&["live", "gone.mp4"], 3, "no such file"),
        (&["live", "-"], 3, "nothing came"),
        (&["live"], 2, "SOURCE"),
        (&["live", "-", "-"], 2, "one source only"),
        (&["live", "a=x", "a=y"], 2, "same name"),
        (&["live", "-", "--config", "a.toml", "--config", "b.toml"], 2, "NAME=FILE"),
    ] {
        let out = boresight(args).stdin(Stdio::null()).output().unwrap();
        let said = String::from_utf8_lossy(&out.stderr);
        assert_eq!(out.status.code(), Some(code), "{args:?}: {said}");
        assert!(said.contains(words), "{args:?}: {said}");
    }
}
