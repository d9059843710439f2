//! The command end to end, as a user runs it: the sample clip in, tables out, every exit code, every help text.

mod batch;
mod config;
mod detect;
mod exit_codes;
mod faults;
mod help;
mod interrupt;
mod loss;
mod names;
mod outputs;
mod pictures;
mod preview;
mod sensor;
mod streams;
mod track;

use std::collections::HashMap;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

/// The repository's root.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The sample clip.
fn clip() -> PathBuf {
    root().join("samples/ir_drone/IR_DRONE_046.mp4")
}

/// The command, ready for arguments.
fn boresight() -> Command {
    Command::new(env!("CARGO_BIN_EXE_boresight"))
}

/// Runs the command to its end.
fn run<S: AsRef<OsStr>>(args: impl IntoIterator<Item = S>) -> Output {
    boresight().args(args).output().unwrap()
}

/// Runs the command, which must succeed.
fn run_ok<S: AsRef<OsStr>>(args: impl IntoIterator<Item = S>) -> Output {
    let out = run(args);
    assert!(out.status.success(), "{}", stderr(&out));
    out
}

fn stdout(out: &Output) -> String {
    String::from_utf8_lossy(&out.stdout).into_owned()
}

fn stderr(out: &Output) -> String {
    String::from_utf8_lossy(&out.stderr).into_owned()
}

/// The results of `boresight track` on the sample clip with no options, made once for all tests.
fn tracked() -> &'static Path {
    static DONE: OnceLock<tempfile::TempDir> = OnceLock::new();
    DONE.get_or_init(|| {
        let dir = tempfile::tempdir().unwrap();
        run_ok([
            OsStr::new("track"),
            clip().as_os_str(),
            OsStr::new("-o"),
            dir.path().as_os_str(),
            OsStr::new("--json"),
        ]);
        dir
    })
    .path()
}

/// A table with a header: a map from column to text for each row; every row must have all columns.
fn read_csv(path: &Path) -> Vec<HashMap<String, String>> {
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().expect("a header").split(',').collect();
    lines
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            assert_eq!(cells.len(), names.len(), "{line}");
            names.iter().zip(cells).map(|(n, c)| ((*n).to_string(), c.to_string())).collect()
        })
        .collect()
}

/// A cell as a number.
fn number(row: &HashMap<String, String>, column: &str) -> f64 {
    row.get(column).and_then(|v| v.parse().ok()).unwrap_or_else(|| panic!("no number in {column}: {row:?}"))
}
