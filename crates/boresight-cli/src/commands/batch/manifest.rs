//! The manifest of a batch: a JSON line for every input that was run, appended when its results are on the disk.
//!
//! A kill at any moment leaves whole lines and at most one cut one, which counts as none. The parts of a batch that is shared out
//! (`--shard`) write a manifest each, so that no two machines append to one file. Of several lines on one input the latest counts.

use boresight::{Error, ErrorKind, Result};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, HashMap};
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// How an input ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// Its results are whole.
    Done,
    /// They are not, for a reason that is said.
    Failed,
}

/// One line of the manifest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// The input as it was given.
    pub input: String,
    /// SHA-256 of the input; of a folder that of the list of its files' hashes.
    pub input_sha256: Option<String>,
    /// How it ended.
    pub status: Status,
    /// Its exit code; `None` if it was ended, or never began.
    pub exit_code: Option<i32>,
    /// Why it failed.
    pub reason: Option<String>,
    /// The folder of its results, in that of the batch.
    pub folder: String,
    /// The options of `track` that were given.
    pub arguments: Vec<String>,
    /// SHA-256 of the configuration that was given.
    pub given_configuration_sha256: Option<String>,
    /// The complete configuration, from the batch's folder.
    pub configuration: Option<String>,
    /// SHA-256 of the complete configuration.
    pub configuration_sha256: Option<String>,
    /// SHA-256 of every file in the folder.
    pub outputs: BTreeMap<String, String>,
    /// The version that made them.
    pub version: String,
    /// The processor that made them.
    pub cpu_features: Vec<String>,
    /// How long it took, s.
    pub seconds: f64,
    /// Most memory that the process took, MB, where the system tells.
    pub peak_memory_mb: Option<u64>,
    /// When it ended, ms since 1970.
    pub ended_unix_ms: u64,
}

/// What the manifests in a folder say.
#[derive(Debug, Default)]
pub struct Known {
    /// The latest entry of each input.
    pub entries: HashMap<String, Entry>,
    /// Lines that cannot be read.
    pub warnings: Vec<String>,
}

/// Whether a file has the name of a manifest.
fn is_manifest(name: &str) -> bool {
    name == "manifest.jsonl" || name.starts_with("manifest-") && name.ends_with(".jsonl")
}

/// Reads all manifests in a folder; one that is not there says nothing.
/// # Errors
/// A file that cannot be read.
pub fn read_all(dir: &Path) -> Result<Known> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(dir).into_iter().flatten().flatten().map(|e| e.path()).collect();
    files.retain(|p| p.file_name().and_then(|n| n.to_str()).is_some_and(is_manifest));
    files.sort();
    let mut known = Known::default();
    for file in files {
        let bytes = std::fs::read(&file)
            .map_err(|e| Error::new(ErrorKind::NotFound, "cannot be read").at(file.display()).because(e))?;
        let mut lines: Vec<&[u8]> = bytes.split(|b| *b == b'\n').collect();
        // Behind the last end of line stands nothing, or what a kill cut.
        lines.pop();
        for (k, line) in lines.into_iter().enumerate() {
            match serde_json::from_slice::<Entry>(line) {
                Ok(entry) => {
                    let later = known.entries.get(&entry.input).is_none_or(|e| e.ended_unix_ms <= entry.ended_unix_ms);
                    if later {
                        known.entries.insert(entry.input.clone(), entry);
                    }
                }
                Err(e) => known.warnings.push(format!("{} line {}: does not count: {e}", file.display(), k + 1)),
            }
        }
    }
    Ok(known)
}

/// A manifest that is appended to.
#[derive(Debug)]
pub struct Manifest {
    file: File,
    path: PathBuf,
}

impl Manifest {
    /// Opens a manifest for appending; a cut last line goes.
    /// # Errors
    /// [`ErrorKind::Config`] if there is one already and `resume` is not asked for; [`ErrorKind::Output`] if it cannot be written, or
    /// another run is writing it.
    pub fn open(path: PathBuf, resume: bool) -> Result<Self> {
        let failed =
            |e: std::io::Error| Error::new(ErrorKind::Output, "cannot be written").at(path.display()).because(e);
        let mut file =
            OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&path).map_err(failed)?;
        match file.try_lock() {
            // Some file systems have no locks.
            Ok(()) | Err(TryLockError::Error(_)) => {}
            Err(TryLockError::WouldBlock) => {
                return Err(Error::new(ErrorKind::Output, "another batch is writing it")
                    .at(path.display())
                    .hint("wait for that one, choose another folder, or share the work with --shard"));
            }
        }
        let mut text = Vec::new();
        file.read_to_end(&mut text).map_err(failed)?;
        if !text.is_empty() && !resume {
            return Err(Error::new(ErrorKind::Config, "there is a batch in this folder already")
                .at(path.display())
                .hint("go on with it: --resume; or choose another folder with --output"));
        }
        let whole = text.iter().rposition(|b| *b == b'\n').map_or(0, |at| at + 1);
        file.set_len(whole as u64).and_then(|()| file.seek(SeekFrom::End(0))).map_err(failed)?;
        Ok(Self { file, path })
    }

    /// Appends a line and hands it to the disk.
    /// # Errors
    /// [`ErrorKind::Output`] if it cannot be written.
    pub fn append(&mut self, entry: &Entry) -> Result<()> {
        let failed =
            |e: std::io::Error| Error::new(ErrorKind::Output, "cannot be written").at(self.path.display()).because(e);
        let mut line = serde_json::to_string(entry).map_err(|e| failed(e.into()))?;
        line.push('\n');
        self.file.write_all(line.as_bytes()).and_then(|()| self.file.sync_data()).map_err(failed)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub fn entry(input: &str, ended_unix_ms: u64) -> Entry {
        Entry {
            input: input.into(),
            input_sha256: None,
            status: Status::Done,
            exit_code: Some(0),
            reason: None,
            folder: format!("{input}-0"),
            arguments: Vec::new(),
            given_configuration_sha256: None,
            configuration: None,
            configuration_sha256: None,
            outputs: BTreeMap::new(),
            version: "0".into(),
            cpu_features: Vec::new(),
            seconds: 1.5,
            peak_memory_mb: None,
            ended_unix_ms,
        }
    }

    #[test]
    fn a_line_that_is_cut_at_any_byte_counts_as_none_and_goes() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("manifest.jsonl");
        let mut manifest = Manifest::open(path.clone(), false).unwrap();
        manifest.append(&entry("a", 1)).unwrap();
        let first = std::fs::metadata(&path).unwrap().len() as usize;
        manifest.append(&entry("b", 2)).unwrap();
        drop(manifest);
        let whole = std::fs::read(&path).unwrap();
        for cut in first..whole.len() {
            std::fs::write(&path, &whole[..cut]).unwrap();
            let known = read_all(dir.path()).unwrap();
            assert!(known.entries.len() == 1 && known.warnings.is_empty(), "{cut}");
            let mut again = Manifest::open(path.clone(), true).unwrap();
            again.append(&entry("b", 2)).unwrap();
            assert_eq!(std::fs::read(&path).unwrap(), whole, "{cut}");
        }
    }

    #[test]
    fn the_latest_of_all_manifests_counts_and_a_damaged_line_is_named() {
        let dir = tempfile::tempdir().unwrap();
        let line = |e: &Entry| serde_json::to_string(e).unwrap();
        let text = format!("{}\n{{\"input\":\n{}\n", line(&entry("a", 9)), line(&entry("b", 1)));
        std::fs::write(dir.path().join("manifest-1-of-2.jsonl"), text).unwrap();
        std::fs::write(dir.path().join("manifest-2-of-2.jsonl"), line(&entry("a", 3)) + "\n").unwrap();
        let known = read_all(dir.path()).unwrap();
        assert_eq!((known.entries["a"].ended_unix_ms, known.entries.len()), (9, 2));
        assert!(known.warnings.len() == 1 && known.warnings[0].contains("of-2.jsonl line 2"), "{:?}", known.warnings);
    }

    #[test]
    fn an_earlier_batch_is_not_gone_on_with_unasked() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("manifest.jsonl");
        let mut first = Manifest::open(path.clone(), false).unwrap();
        assert!(Manifest::open(path.clone(), true).unwrap_err().to_string().contains("another batch"));
        first.append(&entry("a", 1)).unwrap();
        drop(first);
        assert!(Manifest::open(path.clone(), false).unwrap_err().to_string().contains("--resume"));
        Manifest::open(path, true).unwrap();
    }
}
