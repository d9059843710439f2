//! The tree with all mutants: written, checked, and what rustc refuses taken out until it compiles.

use super::instrument::{Held, Mutant, instrument};
use anyhow::{Context as _, bail};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// What the instrumented crate asks; no allocation after the first call.
const SWITCH: &str = r#"
/// Whether the mutant of this number is on.
pub(crate) fn mutant(k: u32) -> bool {
    extern crate std as with_environment;
    use core::sync::atomic::{AtomicU32, Ordering};
    static ON: AtomicU32 = AtomicU32::new(u32::MAX);
    let on = ON.load(Ordering::Relaxed);
    if on != u32::MAX {
        return on == k;
    }
    // Of this crate: another one may still hold mutants of an earlier list.
    let of = concat!(env!("CARGO_PKG_NAME"), ":");
    let named = with_environment::env::var("MUTANT").ok();
    let on = named.and_then(|v| v.strip_prefix(of)?.parse().ok()).unwrap_or(u32::MAX - 1);
    ON.store(on, Ordering::Relaxed);
    on == k
}
"#;

/// A program of tests and where it runs.
pub struct Program {
    pub path: PathBuf,
    pub folder: PathBuf,
    pub package: String,
    /// The crate's own tests, whose names begin with their module.
    pub of_library: bool,
}

/// Writes the tree's files with all mutants that compile; returns the numbers of the others.
pub fn instrumented(
    mutants: &[Mutant],
    tree: &Path,
    package: &str,
    mut unviable: BTreeSet<usize>,
) -> anyhow::Result<BTreeSet<usize>> {
    let mut files = BTreeMap::<&str, Vec<usize>>::new();
    for (k, m) in mutants.iter().enumerate() {
        files.entry(&m.file).or_default().push(k);
    }
    let library = Path::new("crates").join(package).join("src/lib.rs");
    std::fs::write(tree.join(&library), std::fs::read_to_string(&library)? + SWITCH)?;
    loop {
        let mut held = BTreeMap::new();
        for (&file, numbers) in &files {
            let chosen: Vec<_> = numbers.iter().filter(|k| !unviable.contains(*k)).map(|&k| (k, &mutants[k])).collect();
            let (text, at, lost) =
                instrument(&std::fs::read_to_string(file)?, &chosen).with_context(|| file.to_string())?;
            if !lost.is_empty() {
                bail!("{file}: mutants {lost:?} are not where the list says: is it of this commit?");
            }
            let path = tree.join(file);
            // What has not changed is not compiled again.
            if std::fs::read_to_string(&path).ok().as_ref() != Some(&text) {
                std::fs::write(path, text)?;
            }
            held.insert(file, at);
        }
        let refused = refused(tree, package, &held)?;
        if refused.is_empty() {
            return Ok(unviable);
        }
        for (k, why) in refused {
            println!("not compiled: {k}\t{}\t{why}", mutants[k].name);
            unviable.insert(k);
        }
    }
}

fn messages(tree: &Path, arguments: &[&str]) -> anyhow::Result<(bool, Vec<serde_json::Value>)> {
    let mut cargo = Command::new("cargo");
    let run = cargo.args(arguments).arg("--message-format=json").current_dir(tree).stderr(Stdio::inherit()).output()?;
    let lines = String::from_utf8(run.stdout)?;
    let read = lines.lines().filter_map(|l| serde_json::from_str(l).ok()).collect();
    Ok((run.status.success(), read))
}

/// Returns the mutants that stand where rustc found an error, with its words.
fn refused(tree: &Path, package: &str, held: &BTreeMap<&str, Vec<Held>>) -> anyhow::Result<BTreeMap<usize, String>> {
    let (fine, said) = messages(tree, &["check", "--lib", "-p", package])?;
    let mut refused = BTreeMap::new();
    let mut elsewhere = Vec::new();
    for message in said.iter().map(|m| &m["message"]).filter(|m| m["level"] == "error") {
        let words = message["message"].as_str().unwrap_or_default();
        let spans = message["spans"].as_array().cloned().unwrap_or_default();
        let smallest = spans.iter().filter_map(|span| {
            let file = span["file_name"].as_str()?;
            let (start, end) = (span["byte_start"].as_u64()? as usize, span["byte_end"].as_u64()? as usize);
            let around = held.get(file)?.iter().filter(|(r, _)| r.start <= start && end <= r.end);
            around.min_by_key(|(r, _)| r.len()).map(|(_, k)| *k)
        });
        let before = refused.len();
        refused.extend(smallest.map(|k| (k, words.to_string())));
        if refused.len() == before && !spans.is_empty() {
            elsewhere.push(message["rendered"].to_string());
        }
    }
    if !fine && refused.is_empty() {
        bail!("it does not compile, and no mutant stands where:\n{}", elsewhere.join("\n"));
    }
    Ok(refused)
}

/// Builds the programs of tests.
pub fn tests(tree: &Path, package: &str, integration: &[String]) -> anyhow::Result<Vec<Program>> {
    let mut arguments = vec!["test", "--no-run", "-p", package, "--lib"];
    for name in integration {
        arguments.extend(["--test", name]);
    }
    let (fine, said) = messages(tree, &arguments)?;
    if !fine {
        bail!("the tests do not compile");
    }
    let mut programs = Vec::new();
    for m in said.iter().filter(|m| m["profile"]["test"] == true) {
        let (Some(path), Some(manifest)) = (m["executable"].as_str(), m["manifest_path"].as_str()) else { continue };
        let folder = Path::new(manifest).parent().context("a manifest in no folder")?.to_path_buf();
        programs.push(Program {
            path: path.into(),
            folder,
            package: package.into(),
            of_library: m["target"]["kind"][0] == "lib",
        });
    }
    programs.sort_by_key(|p| !p.of_library);
    Ok(programs)
}
