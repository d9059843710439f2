//! `boresight batch`: failures stay alone; a batch that is killed and gone on with, or shared out, gives the bytes of one run; verify finds a
//! changed byte; no child outlives the batch.
#![cfg(target_os = "linux")] // /proc

use super::{boresight, clip, read_csv, stderr};
use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// Options that make an input quick.
const QUICK: [&str; 4] = ["--", "--no-video", "--config", "track.toml"];

/// A folder with `n` clips of 24 frames, two of them of one name, and the configuration that finds their target.
fn clips(n: u32) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    std::fs::create_dir_all(dir.path().join("videos/twin")).unwrap();
    for k in 0..n {
        let seed = k.to_string();
        ok(dir.path(), &["simulate", "ds2", "--frames", "24", "--seed", &seed, "--format", "y4m", "-o", "sim"]);
        let name = if k == 0 { "twin/clip1.y4m".to_string() } else { format!("clip{k}.y4m") };
        std::fs::rename(dir.path().join("sim/frames.y4m"), dir.path().join("videos").join(name)).unwrap();
    }
    std::fs::copy(dir.path().join("sim/track.toml"), dir.path().join("track.toml")).unwrap();
    dir
}

fn at(dir: &Path, args: &[&str]) -> Output {
    boresight().current_dir(dir).args(args).output().unwrap()
}

fn ok(dir: &Path, args: &[&str]) -> Output {
    let out = at(dir, args);
    assert!(out.status.success(), "{args:?}: {}", stderr(&out));
    out
}

fn batch<'a>(output: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [&["batch", "videos/*.y4m", "videos/twin/clip1.y4m", "-o", output], more, &QUICK].concat()
}

/// The bytes of all results, by their names: the manifest tells of times, the page shows them.
fn results(dir: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut all = BTreeMap::new();
    for entry in std::fs::read_dir(dir).unwrap() {
        let (path, name) = entry.map(|e| (e.path(), e.file_name().to_string_lossy().into_owned())).unwrap();
        if path.is_dir() {
            all.extend(results(&path).into_iter().map(|(n, bytes)| (format!("{name}/{n}"), bytes)));
        } else if !name.starts_with("manifest") && name != "index.html" {
            all.insert(name, std::fs::read(&path).unwrap());
        }
    }
    all
}

fn lines(path: &Path) -> usize {
    std::fs::read_to_string(path).unwrap_or_default().lines().count()
}

/// Waits until so many inputs are done and the next one runs; the processes of those that run.
fn running(batch: &Child, manifest: &Path, n_done: usize) -> Vec<u32> {
    let started = Instant::now();
    loop {
        assert!(started.elapsed() < Duration::from_secs(120), "the batch does not get on");
        let id = batch.id();
        let children = std::fs::read_to_string(format!("/proc/{id}/task/{id}/children")).unwrap_or_default();
        // The batch's threads start them, not only the first.
        let tasks = std::fs::read_dir(format!("/proc/{id}/task")).into_iter().flatten().flatten();
        let of_tasks = tasks.filter_map(|t| std::fs::read_to_string(t.path().join("children")).ok());
        let children: Vec<u32> = of_tasks
            .chain([children])
            .flat_map(|t| t.split_whitespace().filter_map(|w| w.parse().ok()).collect::<Vec<u32>>())
            .collect();
        if lines(manifest) >= n_done && !children.is_empty() {
            return children;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Whether a process ends within seconds.
fn ends(id: u32) -> bool {
    let lives = || {
        std::fs::read_to_string(format!("/proc/{id}/stat"))
            .is_ok_and(|s| !s.rsplit(')').next().unwrap_or("").trim_start().starts_with('Z'))
    };
    (0..500).any(|_| {
        std::thread::sleep(Duration::from_millis(10));
        !lives()
    })
}

#[test]
fn a_batch_that_is_killed_or_interrupted_and_gone_on_with_gives_the_bytes_of_one_run() {
    // Enough that none of the signals finds the last one done, however slow the machine is.
    let dir = clips(14);
    ok(dir.path(), &batch("whole", &["-q"]));
    let whole = results(&dir.path().join("whole"));
    assert_eq!(whole.keys().filter(|n| n.ends_with("/tracks.csv")).count(), 14);
    assert!(whole.keys().filter(|n| n.starts_with("clip1-")).count() > 6, "two inputs of one name");
    for (signal, n_done) in [("-KILL", 0), ("-KILL", 2), ("-INT", 3)] {
        let args = batch("again", &["--jobs", "1", "--resume", "-q"]);
        let mut child = boresight().current_dir(dir.path()).args(args).stderr(Stdio::null()).spawn().unwrap();
        let manifest = dir.path().join("again/manifest.jsonl");
        let children = running(&child, &manifest, n_done);
        assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
        let status = child.wait().unwrap();
        assert!(signal == "-KILL" || status.code() == Some(130), "{status}");
        assert!(children.iter().all(|id| ends(*id)), "{signal}: a child goes on");
        // As if the kill had cut the line that was written.
        let mut text = std::fs::read_to_string(&manifest).unwrap();
        text.push_str("{\"input\":\"videos/cl");
        std::fs::write(&manifest, text).unwrap();
    }
    let before = lines(&dir.path().join("again/manifest.jsonl")) - 1;
    ok(dir.path(), &batch("again", &["--resume", "-q"]));
    assert!((3..14).contains(&before), "{before} were done before");
    assert_eq!(lines(&dir.path().join("again/manifest.jsonl")), 14, "none was run twice");
    assert!(results(&dir.path().join("again")) == whole);
    ok(dir.path(), &["batch", "--verify", "-o", "again"]);
}

#[test]
fn shards_together_give_the_bytes_of_one_run() {
    let dir = clips(5);
    ok(dir.path(), &batch("whole", &["-q"]));
    for shard in ["1/2", "2/2"] {
        ok(dir.path(), &batch("shared", &["--shard", shard, "-q"]));
        assert!(!dir.path().join("shared/index.html").exists());
    }
    let counts: Vec<usize> =
        (1..=2).map(|k| lines(&dir.path().join(format!("shared/manifest-{k}-of-2.jsonl")))).collect();
    assert!(counts.iter().sum::<usize>() == 5 && counts.iter().all(|n| *n > 0), "{counts:?}");
    ok(dir.path(), &batch("shared", &["--resume", "-q"]));
    assert_eq!(lines(&dir.path().join("shared/manifest.jsonl")), 0, "nothing was run again");
    assert!(results(&dir.path().join("shared")) == results(&dir.path().join("whole")));
}

#[test]
fn what_breaks_stays_alone_and_is_listed_with_its_reason() {
    let dir = clips(2);
    let videos = dir.path().join("videos");
    let whole = std::fs::read(clip()).unwrap();
    std::fs::write(videos.join("cut.mp4"), &whole[..whole.len() / 2]).unwrap();
    std::fs::write(videos.join("noise.mp4"), [7_u8; 5000]).unwrap();
    let args = ["batch", "videos/*.*", "gone.mp4", "-o", "out", "--", "--no-video", "--rate-hz=10"];
    let out = at(dir.path(), &args);
    assert_eq!(out.status.code(), Some(1), "{}", stderr(&out));
    for said in ["failed: videos/cut.mp4: ", "failed: videos/noise.mp4: ", "failed: gone.mp4: gone.mp4: no such file"] {
        assert!(stderr(&out).contains(said), "{said}: {}", stderr(&out));
    }
    assert!(stderr(&out).contains("4 inputs, 3 failed"), "{}", stderr(&out));
    let page = std::fs::read_to_string(dir.path().join("out/index.html")).unwrap();
    assert!(page.contains("4 inputs, 3 failed") && page.contains("videos/clip1.y4m"));
    assert!(page.find("videos/cut.mp4") < page.find("videos/clip1.y4m"), "failures come first");
    // They are tried again, the others are not.
    let out = at(dir.path(), &[&args[..5], &["--resume"], &args[5..]].concat());
    assert!(out.status.code() == Some(1) && !stderr(&out).contains("clip1.y4m: done"), "{}", stderr(&out));
    assert!(stderr(&out).contains("gone.mp4: failed in"), "{}", stderr(&out));
}

#[test]
fn an_input_that_takes_too_long_or_too_much_is_ended() {
    let dir = tempfile::tempdir().unwrap();
    let video = clip();
    let video = video.to_str().unwrap();
    let out = at(dir.path(), &["batch", video, "-o", "late", "--timeout", "0.05"]);
    assert!(out.status.code() == Some(1) && stderr(&out).contains("took longer than 0.05 s (--timeout)"));
    let out = at(dir.path(), &["batch", video, "-o", "large", "--max-memory", "3"]);
    assert!(stderr(&out).contains("took more memory than 3 MB (--max-memory)"), "{}", stderr(&out));
    let manifest = std::fs::read_to_string(dir.path().join("large/manifest.jsonl")).unwrap();
    assert!(manifest.contains("\"exit_code\":null") && manifest.contains("\"status\":\"failed\""), "{manifest}");
}

#[test]
fn verify_finds_a_changed_byte_a_missing_file_and_another_input() {
    let dir = clips(3);
    ok(dir.path(), &batch("out", &["-q"]));
    ok(dir.path(), &["batch", "--verify", "-o", "out", "videos/*.y4m"]);
    let folder = |name: &str| {
        let mut all = std::fs::read_dir(dir.path().join("out")).unwrap().map(|e| e.unwrap().path());
        all.find(|p| p.file_name().unwrap().to_string_lossy().starts_with(name)).unwrap()
    };
    let tracks = folder("clip2-").join("tracks.csv");
    let mut bytes = std::fs::read(&tracks).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    std::fs::write(&tracks, bytes).unwrap();
    std::fs::remove_file(folder("clip1-").join("report.html")).unwrap();
    std::fs::write(dir.path().join("videos/twin/clip1.y4m"), "other").unwrap();
    std::fs::write(dir.path().join("videos/new.y4m"), "new").unwrap();
    let out = at(dir.path(), &["batch", "--verify", "-o", "out", "videos/*.y4m"]);
    assert_eq!(out.status.code(), Some(1));
    let said = stderr(&out);
    for line in ["tracks.csv: differs", "report.html: is missing", "twin/clip1.y4m: differs", "new.y4m: was not run"] {
        assert!(said.contains(line), "{line}: {said}");
    }
    assert!(said.contains("4 missing or different"), "{said}");
    // Going on mends it.
    std::fs::remove_file(dir.path().join("videos/new.y4m")).unwrap();
    std::fs::copy(dir.path().join("videos/clip2.y4m"), dir.path().join("videos/twin/clip1.y4m")).unwrap();
    ok(dir.path(), &batch("out", &["--resume", "-q"]));
    assert_eq!(lines(&dir.path().join("out/manifest.jsonl")), 6);
    ok(dir.path(), &["batch", "--verify", "-o", "out"]);
}

#[test]
fn other_options_or_another_configuration_are_run_anew() {
    let dir = clips(2);
    ok(dir.path(), &batch("out", &["-q"]));
    let manifest = dir.path().join("out/manifest.jsonl");
    ok(dir.path(), &[&batch("out", &["--resume", "-q"])[..], &["--json"]].concat());
    assert_eq!(lines(&manifest), 4);
    let text = std::fs::read_to_string(dir.path().join("track.toml")).unwrap();
    std::fs::write(dir.path().join("track.toml"), format!("{text}\n")).unwrap();
    ok(dir.path(), &[&batch("out", &["--resume", "-q"])[..], &["--json"]].concat());
    assert_eq!(lines(&manifest), 6);
    let rows = read_csv(&dir.path().join("out/tracks.csv"));
    assert!(
        rows.iter().any(|r| r["input"] == "videos/twin/clip1.y4m")
            && rows.iter().any(|r| r["input"] == "videos/clip1.y4m")
    );
}

#[test]
fn wrong_options_are_refused_before_anything_is_run() {
    let dir = clips(2);
    let code = |args: &[&str]| {
        let out = at(dir.path(), args);
        (out.status.code(), stderr(&out))
    };
    for (more, said) in [
        (vec!["--", "--no-such"], "unexpected argument '--no-such'"),
        (vec!["--", "-o", "x"], "the batch itself says"),
        (vec!["--", "--config", "none.toml"], "none.toml"),
        (vec!["--shard", "3/2"], "expected I/N"),
        (vec!["--timeout", "0"], "above 0"),
    ] {
        let (code, text) = code(&[&["batch", "videos/twin/*", "-o", "out"], &more[..]].concat());
        assert!(code == Some(2) || code == Some(3), "{more:?}: {text}");
        assert!(text.contains(said), "{more:?}: {text}");
        assert!(!dir.path().join("out").exists(), "{more:?}");
    }
    ok(dir.path(), &batch("out", &["-q"])[..]);
    let (again, text) = code(&batch("out", &[]));
    assert!(again == Some(2) && text.contains("--resume"), "{text}");
}
