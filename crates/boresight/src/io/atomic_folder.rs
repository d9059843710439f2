//! A folder of files that appears whole: written beside under `NAME.part`, moved at the end.
//!
//! The folder stands for one run: files of an earlier run that this one did not make go when the new ones are in place. Which names
//! are a run's own, the caller says; everything else in the folder stays.

use crate::{Error, ErrorKind, Result};
use std::ffi::OsString;
use std::fs::File;
use std::path::{Path, PathBuf};

/// A folder under a temporary name until [`AtomicFolder::finish`]. Dropped unfinished, it goes, and what stood under the final name
/// stays.
#[derive(Debug)]
pub struct AtomicFolder {
    path: PathBuf,
    part: PathBuf,
    is_ours: fn(&str) -> bool,
}

impl AtomicFolder {
    /// Makes `path.part`; what a killed run left there goes. `is_ours` tells the names of the files that a run makes.
    /// # Errors
    /// [`ErrorKind::Output`] if it cannot be made, or something else than a folder stands under the name.
    pub fn create(path: impl Into<PathBuf>, is_ours: fn(&str) -> bool) -> Result<Self> {
        let path = path.into();
        if path.exists() && !path.is_dir() {
            return Err(Error::new(ErrorKind::Output, "a file of this name is in the way").at(path.display()));
        }
        let mut name = path.file_name().unwrap_or_default().to_os_string();
        name.push(".part");
        let folder = Self { part: path.with_file_name(name), path, is_ours };
        clear(&folder.part, is_ours, &[]);
        std::fs::create_dir_all(&folder.part).map_err(|e| failed(&folder.part, "the folder cannot be made", e))?;
        Ok(folder)
    }

    /// The folder during writing: files are made here.
    pub fn part_path(&self) -> &Path {
        &self.part
    }

    /// Makes the files durable and gives the folder its final name, or moves them into the one that stands there.
    /// # Errors
    /// [`ErrorKind::Output`] if the disk is full or a name cannot be taken.
    pub fn finish(self) -> Result<()> {
        let names = names(&self.part).map_err(|e| failed(&self.part, "cannot be read", e))?;
        for name in &names {
            let file = self.part.join(name);
            File::open(&file).and_then(|f| f.sync_all()).map_err(|e| failed(&file, "cannot be written", e))?;
        }
        if !self.path.exists() {
            return std::fs::rename(&self.part, &self.path).map_err(|e| failed(&self.path, "cannot be written", e));
        }
        for name in &names {
            let to = self.path.join(name);
            std::fs::rename(self.part.join(name), &to).map_err(|e| failed(&to, "cannot be written", e))?;
        }
        clear(&self.path, self.is_ours, &names);
        Ok(())
    }
}

/// Removes the files of a run from its folder, and the folder if nothing else is in it.
pub fn remove_folder(path: &Path, is_ours: fn(&str) -> bool) {
    clear(path, is_ours, &[]);
    // Fails where something of somebody else stands in it, and after a rename; both are as they should be.
    let _ = std::fs::remove_dir(path);
}

impl Drop for AtomicFolder {
    fn drop(&mut self) {
        remove_folder(&self.part, self.is_ours);
    }
}

fn failed(path: &Path, what: &str, e: std::io::Error) -> Error {
    Error::new(ErrorKind::Output, what).at(path.display()).because(e)
}

/// Names of the files in a folder, in order.
fn names(folder: &Path) -> std::io::Result<Vec<OsString>> {
    let mut names: Vec<OsString> =
        std::fs::read_dir(folder)?.map(|e| e.map(|e| e.file_name())).collect::<std::io::Result<_>>()?;
    names.sort();
    Ok(names)
}

/// Removes what is a run's own, but for `kept` (in order). What cannot be removed harms nobody.
fn clear(folder: &Path, is_ours: fn(&str) -> bool, kept: &[OsString]) {
    for name in names(folder).unwrap_or_default() {
        if name.to_str().is_some_and(is_ours) && kept.binary_search(&name).is_err() {
            let _ = std::fs::remove_file(folder.join(&name));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is_frame(name: &str) -> bool {
        name.starts_with("frame_")
    }

    fn listed(folder: &Path) -> Vec<String> {
        names(folder).unwrap().into_iter().map(|n| n.to_string_lossy().into_owned()).collect()
    }

    #[test]
    fn a_folder_appears_whole_and_the_next_run_clears_what_it_did_not_make() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("frames");
        let run = |files: &[&str]| {
            let folder = AtomicFolder::create(&path, is_frame).unwrap();
            files.iter().for_each(|f| std::fs::write(folder.part_path().join(f), f).unwrap());
            folder
        };
        let first = run(&["frame_0", "frame_1"]);
        assert!(!path.exists());
        first.finish().unwrap();
        assert_eq!(listed(&path), ["frame_0", "frame_1"]);
        std::fs::write(path.join("notes.txt"), "mine").unwrap();
        drop(run(&["frame_0", "frame_2"]));
        assert_eq!(listed(&path), ["frame_0", "frame_1", "notes.txt"], "a run that failed changes nothing");
        run(&["frame_0", "frame_2"]).finish().unwrap();
        assert_eq!(listed(&path), ["frame_0", "frame_2", "notes.txt"]);
        assert_eq!(listed(dir.path()), ["frames"]);
    }

    #[test]
    fn a_file_in_the_way_is_said() {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("frames"), "").unwrap();
        let error = AtomicFolder::create(dir.path().join("frames"), is_frame).unwrap_err();
        assert!(error.kind() == ErrorKind::Output && error.to_string().contains("in the way"), "{error}");
    }
}
