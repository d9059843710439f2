//! Runs the tests on one mutant, the nearest first, until one fails.

use super::build::Program;
use super::instrument::Mutant;
use std::fmt;
use std::io::{BufRead as _, BufReader};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// What became of a mutant.
pub enum Outcome {
    NotCompiled,
    /// By the first test that failed.
    Caught(String),
    /// The program ended by itself without a failed test (a signal, an abort).
    Died,
    TimedOut,
    Survived,
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Outcome::NotCompiled => write!(f, "not compiled"),
            Outcome::Caught(test) => write!(f, "caught by {test}"),
            Outcome::Died => write!(f, "caught: the tests ended"),
            Outcome::TimedOut => write!(f, "caught: too slow"),
            Outcome::Survived => write!(f, "SURVIVED"),
        }
    }
}

/// Runs a program of tests; with `all` to its end, else to the first failure. Returns the failed tests and whether it ended well or was stopped.
fn failed(
    program: &Program,
    arguments: &[String],
    mutant: Option<usize>,
    limit: Duration,
    all: bool,
) -> anyhow::Result<(Vec<String>, Option<bool>)> {
    let mut command = Command::new(&program.path);
    command.args(arguments).current_dir(&program.folder).stdout(Stdio::piped()).stderr(Stdio::null());
    match mutant {
        Some(k) => command.env("MUTANT", format!("{}:{k}", program.package)),
        None => command.env_remove("MUTANT"),
    };
    let mut child = command.spawn()?;
    let lines = BufReader::new(child.stdout.take().expect("it is piped")).lines();
    let (send, receive) = std::sync::mpsc::channel();
    let reader = std::thread::spawn(move || {
        for line in lines.map_while(Result::ok) {
            let Some(name) = line.strip_prefix("test ").and_then(|l| l.strip_suffix(" ... FAILED")) else { continue };
            if send.send(name.to_string()).is_err() {
                break;
            }
        }
    });
    let end = Instant::now() + limit;
    let mut names = Vec::new();
    let status = loop {
        names.extend(receive.try_iter());
        if !all && !names.is_empty() {
            child.kill()?;
        }
        if let Some(status) = child.try_wait()? {
            break Some(status.success());
        }
        if Instant::now() > end {
            child.kill()?;
            child.wait()?;
            break None;
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    reader.join().expect("it does not panic");
    names.extend(receive.try_iter());
    Ok((names, status))
}

/// Returns the tests that fail with no mutant on: those that read the source, for instance.
pub fn failing_without(programs: &[Program]) -> anyhow::Result<Vec<String>> {
    let mut known = Vec::new();
    for program in programs {
        known.extend(failed(program, &[], None, Duration::from_secs(3600), true)?.0);
    }
    Ok(known)
}

/// Runs the tests of the mutant's file, of its room, of the crate, then the integration tests.
pub fn hunt(
    k: usize,
    mutant: &Mutant,
    programs: &[Program],
    known: &[String],
    timeout_s: u64,
    nearest: bool,
) -> anyhow::Result<Outcome> {
    let modules =
        mutant.file.split("/src/").last().unwrap_or_default().trim_end_matches(".rs").trim_end_matches("/mod");
    let modules = modules.replace('/', "::");
    let room = modules.split("::").next().unwrap_or_default();
    let skips: Vec<String> = known.iter().flat_map(|name| ["--skip".into(), name.clone()]).collect();
    for program in programs {
        let filters: &[&str] = if program.of_library { &[&modules, room, ""] } else { &[room, ""] };
        for filter in filters.iter().filter(|f| !(nearest && f.is_empty())) {
            let mut arguments = skips.clone();
            if !filter.is_empty() {
                arguments.push(format!("{filter}::"));
            }
            let (names, status) = failed(program, &arguments, Some(k), Duration::from_secs(timeout_s), false)?;
            match (names.into_iter().next(), status) {
                (Some(name), _) => return Ok(Outcome::Caught(name)),
                (None, None) => return Ok(Outcome::TimedOut),
                (None, Some(false)) => return Ok(Outcome::Died),
                (None, Some(true)) => {}
            }
        }
    }
    Ok(Outcome::Survived)
}
