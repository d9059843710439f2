//! A disk that is full behind byte n, for many n, under every command: exit code 5, an error with a name, under the final names whole files or the earlier ones, and
//! nothing else left.
//!
//! The limit is the system's (`prlimit --fsize`), to the byte and for each file: a write across it is cut there, the next one fails. `BORESIGHT_FAULTS=100` tries that
//! many bytes a command, spread over the sizes of its outputs; the default is few.
#![cfg(target_os = "linux")] // prlimit

use super::outputs::files;
use super::stderr;
use super::streams::{COMMANDS, PRINTING, inputs};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// Runs the command where no file may grow beyond `bytes`.
fn run_with_room(dir: &Path, line: &str, bytes: u64) -> Output {
    // The signal that the system sends as well must not kill it: a full disk sends none.
    let script = format!("trap '' XFSZ; exec prlimit --fsize={bytes} \"$0\" {line}");
    let mut command = Command::new("bash");
    command.args(["-c", &script, env!("CARGO_BIN_EXE_boresight")]).current_dir(dir).stdout(Stdio::null());
    command.output().unwrap()
}

/// Room for outputs of these sizes to fail in: none, the first byte, the ends of blocks, the middle and the last byte of each; all below `largest`.
fn rooms(sizes: impl Iterator<Item = u64>, largest: u64) -> Vec<u64> {
    let most = std::env::var("BORESIGHT_FAULTS").ok().and_then(|n| n.parse().ok()).unwrap_or(14);
    let blocks = [0, 1, 70, 511, 4095, 4096, 8191, 8192, 65_535, 65_536];
    let mut all: BTreeSet<u64> = blocks.into_iter().chain([largest / 2, largest - 1]).collect();
    all.extend(sizes.filter(|s| *s > 0).flat_map(|s| [s / 2, s - 1]));
    if most > all.len() {
        let step = (most - all.len()) as u64;
        all.extend((0..step).map(|k| (largest - 1) * k / step));
    }
    let all: Vec<u64> = all.into_iter().filter(|b| *b < largest).collect();
    // Thinned evenly, with both ends.
    let n = most.min(all.len()).max(2);
    let mut kept: Vec<u64> = (0..n).map(|k| all[k * (all.len() - 1) / (n - 1)]).collect();
    kept.dedup();
    kept
}

/// Names of folders and files below one.
fn names(dir: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(dir).into_iter().flatten().map(|e| e.unwrap().path());
    entries.flat_map(|p| if p.is_dir() { [vec![p.clone()], names(&p)].concat() } else { vec![p] }).collect()
}

/// What a run of `track` says of itself is another text when an output is missing; it must be whole too.
fn tells_of_itself(path: &Path, content: &[u8]) -> bool {
    path.ends_with("report.html") && content.ends_with(b"</html>\n")
        || path.ends_with("config.toml") && content.starts_with(b"# The configuration of this run")
        || path.ends_with("summary.json") && content.ends_with(b"\n}\n")
}

/// The file's name as an error may say it, also while it is written.
fn is_named(text: &str, path: &Path) -> bool {
    let mut of = path.iter().rev().map(|n| n.to_string_lossy());
    of.next().is_some_and(|n| text.contains(&*n)) || of.next().is_some_and(|n| text.contains(&format!("{n}.part")))
}

#[test]
fn a_disk_that_is_full_behind_any_byte_leaves_whole_files_and_code_5() {
    let dir = inputs();
    let out = dir.path().join("out");
    let fresh = || {
        let _ = std::fs::remove_dir_all(&out);
        std::fs::create_dir(&out).unwrap();
    };
    let mut n_runs = 0;
    for (line, made) in COMMANDS {
        fresh();
        let whole_run = run_with_room(dir.path(), line, 1 << 30);
        assert_eq!(whole_run.status.code(), Some(0), "{line}: {}", stderr(&whole_run));
        let whole = files(&out);
        let known: BTreeSet<PathBuf> = names(&out).into_iter().collect();
        let size = |p: &PathBuf| whole[p].len() as u64;
        let largest = whole.keys().map(size).max().unwrap();
        for bytes in rooms(whole.keys().map(size), largest) {
            fresh();
            // What an earlier run left is good, and stays where the new file does not become whole.
            for file in made.iter().filter(|f| !f.contains('/')) {
                std::fs::write(out.join(file), "earlier").unwrap();
            }
            let done = run_with_room(dir.path(), line, bytes);
            n_runs += 1;
            let (text, what) = (stderr(&done), format!("{line}, {bytes} bytes"));
            assert_eq!(done.status.code(), Some(5), "{what}: {text}");
            assert!(text.contains("error: ") && !text.contains("panicked"), "{what}: {text}");
            let mut short = whole.keys().filter(|p| size(p) > bytes);
            assert!(short.any(|p| is_named(&text, p)), "{what}: no name in {text}");
            for path in names(&out) {
                assert!(known.contains(&path), "{what}: {} is left", path.display());
            }
            check(&files(&out), &whole, made, &out, bytes, &what);
        }
    }
    eprintln!("{n_runs} runs of {} commands on a full disk", COMMANDS.len());
}

/// Whole files or the earlier ones, and the earlier ones where there was no room.
fn check(
    left: &BTreeMap<PathBuf, Vec<u8>>,
    whole: &BTreeMap<PathBuf, Vec<u8>>,
    made: &[&str],
    out: &Path,
    bytes: u64,
    what: &str,
) {
    for (path, content) in left {
        let sound = content == b"earlier" || whole.get(path) == Some(content) || tells_of_itself(path, content);
        assert!(sound, "{what}: {} is half ({} bytes)", path.display(), content.len());
    }
    for file in made.iter().filter(|f| !f.contains('/')) {
        let path = out.join(file);
        assert!(left.contains_key(&path), "{what}: {file} is gone");
        let fits = whole[&path].len() as u64 <= bytes;
        assert!(fits || left[&path] == b"earlier" || path.ends_with("report.html"), "{what}: {file}");
    }
}

#[test]
fn what_is_printed_into_a_full_disk_is_an_error_of_standard_output() {
    let dir = inputs();
    let printed = dir.path().join("printed");
    for line in PRINTING {
        let into = |bytes| run_with_room(dir.path(), &format!("{line} > printed"), bytes);
        assert_eq!(into(1 << 30).status.code(), Some(0), "{line}");
        let whole = std::fs::read(&printed).unwrap();
        assert!(!whole.is_empty(), "{line}");
        let n = whole.len() as u64;
        for bytes in rooms([n].into_iter(), n) {
            let done = into(bytes);
            let text = stderr(&done);
            assert_eq!(done.status.code(), Some(5), "{line}, {bytes} of {n} bytes: {text}");
            let said = text.contains("error: ") && text.contains("standard output") && !text.contains("panicked");
            assert!(said || text.contains("output's stream"), "{line}, {bytes} bytes: {text}");
        }
    }
}

#[test]
fn a_batch_on_a_full_disk_fails_its_inputs_and_goes_on_when_there_is_room() {
    let dir = inputs();
    let line = "batch sim/frames.y4m run/detections.csv -q -o out";
    let args = "-- --no-video --no-report";
    let out = dir.path().join("out");
    // What depends on times beside results.
    let results = || -> BTreeMap<PathBuf, Vec<u8>> {
        let is_result = |p: &PathBuf| p.parent() != Some(out.as_path());
        files(&out).into_iter().filter(|(p, _)| is_result(p)).collect()
    };
    assert_eq!(run_with_room(dir.path(), &format!("{line} {args}"), 1 << 30).status.code(), Some(0));
    let whole = results();
    let largest = whole.values().map(|b| b.len() as u64).max().unwrap();
    for bytes in rooms(whole.values().map(|b| b.len() as u64), largest) {
        let _ = std::fs::remove_dir_all(&out);
        let done = run_with_room(dir.path(), &format!("{line} {args}"), bytes);
        let text = stderr(&done);
        assert!(matches!(done.status.code(), Some(1 | 5)), "{bytes} bytes: {text}");
        assert!(!text.contains("panicked") && (text.contains("error: ") || text.contains("failed")), "{bytes}: {text}");
        for (path, content) in results() {
            let sound = whole.get(&path) == Some(&content) || tells_of_itself(&path, &content);
            assert!(sound, "{bytes} bytes: {}", path.display());
        }
        let again = run_with_room(dir.path(), &format!("{line} --resume {args}"), 1 << 30);
        assert_eq!(again.status.code(), Some(0), "{bytes} bytes, again: {}", stderr(&again));
        assert!(results() == whole, "{bytes} bytes: what the second run made");
    }
}
