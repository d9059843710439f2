//! What is done for one input of a batch: kept if an earlier run's results hold, else run anew in its folder, and written down.

use super::child::{self, Ended, Limits};
use super::hash;
use super::inputs::Input;
use super::manifest::{Entry, Status};
use super::verify::first_wrong;
use boresight::{Error, ErrorKind, Result};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::{SystemTime, UNIX_EPOCH};

/// What is the same for all inputs.
#[derive(Debug)]
pub struct Job {
    dir: PathBuf,
    options: Vec<String>,
    given_configuration_sha256: Option<String>,
    resume: bool,
    limits: Limits,
    threads: usize,
}

/// What became of an input.
#[derive(Debug)]
pub enum Made {
    /// It was run.
    New(Entry),
    /// What an earlier run made holds.
    Kept(Entry),
    /// The batch was interrupted.
    Stopped,
}

impl Job {
    /// What `options` ask of every input, with the file of a configuration that they name.
    /// # Errors
    /// A configuration that cannot be read.
    pub fn new(
        dir: PathBuf,
        options: Vec<String>,
        configuration: Option<&Path>,
        resume: bool,
        limits: Limits,
        threads: usize,
    ) -> Result<Self> {
        let hashed = |path: &Path| {
            hash::of_file(path)
                .map_err(|e| Error::new(ErrorKind::NotFound, "cannot be read").at(path.display()).because(e))
        };
        let given_configuration_sha256 = configuration.map(hashed).transpose()?;
        Ok(Self { dir, options, given_configuration_sha256, resume, limits, threads })
    }

    /// Runs one input, unless what an earlier run made of it holds.
    /// # Errors
    /// A process that cannot be started, a folder that cannot be cleared: nothing that lies in the input.
    pub fn run(&self, input: &Input, earlier: Option<&Entry>, stop: &AtomicBool) -> Result<Made> {
        let input_sha256 = hash::of_input(Path::new(&input.name)).ok();
        let held = earlier.filter(|e| self.resume && self.asked_for(e, input_sha256.as_deref()));
        if let Some(entry) = held.filter(|e| first_wrong(&self.dir, e).is_none()) {
            return Ok(Made::Kept(entry.clone()));
        }
        let folder = self.dir.join(&input.folder);
        match std::fs::remove_dir_all(&folder) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => {
                return Err(Error::new(ErrorKind::Output, "cannot be removed").at(folder.display()).because(e));
            }
            _ => {}
        }
        let Some(ended) = child::run(&self.arguments(input, &folder), self.limits, stop)? else {
            return Ok(Made::Stopped);
        };
        Ok(Made::New(self.entry(input, input_sha256, ended)))
    }

    /// Whether an entry is what this job would make of the input, if its outputs still hold.
    fn asked_for(&self, entry: &Entry, input_sha256: Option<&str>) -> bool {
        entry.status == Status::Done
            && entry.input_sha256.as_deref() == input_sha256
            && entry.arguments == self.options
            && entry.given_configuration_sha256 == self.given_configuration_sha256
            && entry.version == env!("CARGO_PKG_VERSION")
    }

    fn arguments(&self, input: &Input, folder: &Path) -> Vec<OsString> {
        let mut words: Vec<OsString> = ["track", "--quiet", "--summary", "--end-with-stdin"].map(OsString::from).into();
        let has = |name: &str| self.options.iter().any(|o| o == name || o.starts_with(&format!("{name}=")));
        words.retain(|word| !word.to_str().is_some_and(has));
        if !has("--thumbnail") {
            words.push("--thumbnail".into());
        }
        if !has("--threads") {
            words.push(format!("--threads={}", self.threads).into());
        }
        if let Some(mb) = self.limits.memory_mb.filter(|_| !has("--max-memory")) {
            words.push(format!("--max-memory={mb}").into());
        }
        words.extend(self.options.iter().map(OsString::from));
        words.extend(["--output".into(), folder.into(), "--".into(), OsString::from(&input.name)]);
        words
    }

    fn entry(&self, input: &Input, input_sha256: Option<String>, ended: Ended) -> Entry {
        let folder = self.dir.join(&input.folder);
        let mut reason = ended.reason;
        let mut outputs = hash::of_files_below(&folder).unwrap_or_else(|e| {
            // An input that fails early has no folder.
            reason.get_or_insert_with(|| format!("{}: cannot be read: {e}", folder.display()));
            Default::default()
        });
        // What a process that was ended left half written.
        outputs.retain(|name, _| !name.split('/').any(|n| n.ends_with(".part")));
        let has_configuration = outputs.contains_key("config.toml");
        Entry {
            input: input.name.clone(),
            input_sha256,
            status: if reason.is_none() { Status::Done } else { Status::Failed },
            exit_code: ended.exit_code,
            reason,
            folder: input.folder.clone(),
            arguments: self.options.clone(),
            given_configuration_sha256: self.given_configuration_sha256.clone(),
            configuration: has_configuration.then(|| format!("{}/config.toml", input.folder)),
            configuration_sha256: outputs.get("config.toml").cloned(),
            outputs,
            version: env!("CARGO_PKG_VERSION").to_string(),
            cpu_features: boresight::cpu_features().into_iter().map(str::to_string).collect(),
            seconds: (ended.seconds * 1e3).round() / 1e3,
            peak_memory_mb: ended.peak_memory_mb,
            ended_unix_ms: SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_millis() as u64),
        }
    }
}
