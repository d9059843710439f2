//! Whether what the manifest says still holds: every input and every output is hashed again.

use super::hash;
use super::inputs::Input;
use super::manifest::{Entry, Known, Status};
use boresight::{Error, ErrorKind, Result};
use std::path::Path;

/// What was looked at, and what is wrong.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Findings {
    /// Inputs that the manifest names.
    pub n_inputs: usize,
    /// Of these those that failed when they were run.
    pub n_failed: usize,
    /// Files that were hashed.
    pub n_files: usize,
    /// What is missing or differs, a line each.
    pub wrong: Vec<String>,
}

/// The first output that is missing or differs; `None` if all hold.
pub fn first_wrong(dir: &Path, entry: &Entry) -> Option<String> {
    entry.outputs.iter().find_map(|(name, sha256)| check(&dir.join(&entry.folder).join(name), sha256).err())
}

fn check(path: &Path, sha256: &str) -> std::result::Result<(), String> {
    match hash::of_input(path) {
        Ok(found) if found == sha256 => Ok(()),
        Ok(_) => Err(format!("{}: differs from the manifest", path.display())),
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => Err(format!("{}: is missing", path.display())),
        Err(e) => Err(format!("{}: cannot be read: {e}", path.display())),
    }
}

/// Hashes everything that the manifests name, and looks for `inputs` that they do not name.
/// # Errors
/// A folder without a manifest.
pub fn verify(dir: &Path, known: &Known, inputs: &[Input]) -> Result<Findings> {
    if known.entries.is_empty() && known.warnings.is_empty() {
        return Err(Error::new(ErrorKind::NotFound, "holds no manifest of a batch")
            .at(dir.display())
            .hint("give the folder of a batch with --output"));
    }
    let mut entries: Vec<&Entry> = known.entries.values().collect();
    entries.sort_by(|a, b| a.input.cmp(&b.input));
    let mut found = Findings { n_inputs: entries.len(), ..Findings::default() };
    found.wrong.extend(known.warnings.iter().cloned());
    for entry in entries {
        found.n_failed += usize::from(entry.status == Status::Failed);
        let input = entry.input_sha256.iter().map(|sha256| (Path::new(&entry.input).to_path_buf(), sha256));
        let outputs = entry.outputs.iter().map(|(name, sha256)| (dir.join(&entry.folder).join(name), sha256));
        for (path, sha256) in input.chain(outputs) {
            found.n_files += 1;
            found.wrong.extend(check(&path, sha256).err());
        }
    }
    let unknown = inputs.iter().filter(|i| !known.entries.contains_key(&i.name));
    found.wrong.extend(unknown.map(|i| format!("{}: was not run", i.name)));
    Ok(found)
}
