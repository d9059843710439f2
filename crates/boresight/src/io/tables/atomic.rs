//! Files that appear whole: written beside under `NAME.part`, renamed at the end.
//!
//! A run that is killed leaves nothing under the final name, and under `NAME.part` all that was written up to the last
//! whole frame (the text writers hand over whole frames, each in one write). The part file is locked while it is
//! written, so that two runs cannot mix their lines in it.

use crate::{Error, ErrorKind, Result};
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Seek, Write};
use std::path::{Path, PathBuf};

/// A file under a temporary name until [`AtomicFile::finish`].
#[derive(Debug)]
pub struct AtomicFile {
    file: File,
    path: PathBuf,
    part: PathBuf,
    keep_part: bool,
    finished: bool,
}

impl AtomicFile {
    /// Creates `path.part`; what another run left there is overwritten.
    /// # Errors
    /// [`ErrorKind::Output`] if it cannot be created or another run is writing it.
    pub fn create(path: impl Into<PathBuf>) -> Result<Self> {
        let path = path.into();
        if path.is_dir() {
            return Err(Error::new(ErrorKind::Output, "a folder of this name is in the way").at(path.display()));
        }
        let mut name = path.file_name().unwrap_or_default().to_os_string();
        name.push(".part");
        let part = path.with_file_name(name);
        let failed =
            |e: std::io::Error| Error::new(ErrorKind::Output, "cannot be written").at(part.display()).because(e);
        let file =
            OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&part).map_err(failed)?;
        match file.try_lock() {
            // Some file systems have no locks: then there is only the name to keep runs apart.
            Ok(()) | Err(TryLockError::Error(_)) => {}
            Err(TryLockError::WouldBlock) => {
                return Err(Error::new(ErrorKind::Output, "another run is writing it")
                    .at(part.display())
                    .hint("wait for that run, or choose another folder"));
            }
        }
        file.set_len(0).map_err(failed)?;
        Ok(Self { file, path, part, keep_part: false, finished: false })
    }

    /// Keeps the part file if the writer is dropped unfinished: for tables, whose whole lines can be read.
    #[must_use]
    pub fn keep_part(mut self) -> Self {
        self.keep_part = true;
        self
    }

    /// The final name.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The name during writing.
    pub fn part_path(&self) -> &Path {
        &self.part
    }

    /// The open file, for writers that need `Seek`.
    pub fn file_mut(&mut self) -> &mut File {
        &mut self.file
    }

    /// Makes the content durable and gives it its final name.
    /// # Errors
    /// [`ErrorKind::Output`] if the disk is full or the name cannot be taken.
    pub fn finish(mut self) -> Result<()> {
        let failed = |e: std::io::Error| Error::new(ErrorKind::Output, "cannot be written").because(e);
        self.file.flush().and_then(|()| self.file.sync_all()).map_err(|e| failed(e).at(self.part.display()))?;
        std::fs::rename(&self.part, &self.path).map_err(|e| failed(e).at(self.path.display()))?;
        self.finished = true;
        Ok(())
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.file.flush()
    }
}

impl Seek for AtomicFile {
    fn seek(&mut self, to: std::io::SeekFrom) -> std::io::Result<u64> {
        self.file.seek(to)
    }
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        if !self.finished && !self.keep_part {
            // Nothing can be done about a failure here, and an old part file harms nobody.
            let _ = std::fs::remove_file(&self.part);
        }
    }
}

/// Where a text writer's lines go.
pub enum Output {
    /// A file that appears whole.
    File(AtomicFile),
    /// Standard output, or anything else that takes bytes.
    Stream(Box<dyn Write + Send>),
}

impl Output {
    /// A file that appears whole; unfinished, its lines stay readable under `path.part`.
    /// # Errors
    /// As [`AtomicFile::create`].
    pub fn file(path: impl Into<PathBuf>) -> Result<Self> {
        Ok(Self::File(AtomicFile::create(path)?.keep_part()))
    }

    /// Standard output.
    pub fn stdout() -> Self {
        Self::Stream(Box::new(std::io::stdout()))
    }

    /// Writes whole lines at once.
    pub(crate) fn put(&mut self, lines: &[u8]) -> Result<()> {
        match self {
            Self::File(file) => file.write_all(lines).map_err(|e| {
                Error::new(ErrorKind::Output, "cannot be written").at(file.part_path().display()).because(e)
            }),
            Self::Stream(stream) => stream
                .write_all(lines)
                .and_then(|()| stream.flush())
                .map_err(|e| Error::new(ErrorKind::Output, "cannot be written").at("standard output").because(e)),
        }
    }

    /// Ends the output.
    pub(crate) fn finish(self) -> Result<()> {
        match self {
            Self::File(file) => file.finish(),
            Self::Stream(_) => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_stands_under_the_name_until_the_end() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("t.csv");
        let mut file = AtomicFile::create(&path).unwrap();
        file.write_all(b"a,b\n").unwrap();
        assert!(!path.exists());
        assert_eq!(std::fs::read(dir.path().join("t.csv.part")).unwrap(), b"a,b\n");
        file.finish().unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"a,b\n");
        assert!(!dir.path().join("t.csv.part").exists());
    }

    #[test]
    fn an_unfinished_file_goes_unless_its_part_is_worth_keeping() {
        let dir = tempfile::tempdir().unwrap();
        drop(AtomicFile::create(dir.path().join("a.png")).unwrap());
        assert!(!dir.path().join("a.png.part").exists());
        drop(AtomicFile::create(dir.path().join("b.csv")).unwrap().keep_part());
        assert!(dir.path().join("b.csv.part").exists());
        assert!(!dir.path().join("b.csv").exists());
    }

    #[test]
    fn a_second_run_on_the_same_file_is_refused_and_an_old_part_is_overwritten() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("t.csv");
        std::fs::write(dir.path().join("t.csv.part"), b"left by a killed run").unwrap();
        let mut first = AtomicFile::create(&path).unwrap();
        assert!(AtomicFile::create(&path).unwrap_err().to_string().contains("another run"));
        first.write_all(b"new").unwrap();
        first.finish().unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
    }
}
