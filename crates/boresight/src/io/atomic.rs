//! Files that appear whole: written beside under `NAME.part`, renamed at the end.
//!
//! A run that is killed leaves nothing under the final name, and under `NAME.part` all that was written up to the last
//! whole frame (the text writers hand over whole frames, each in one write). A writer that fails is dropped unfinished: its part
//! goes, and what stood under the final name stays. The part file is locked while it is written, so that two runs cannot mix their
//! lines in it.
//! Why not `tempfile`: what it keeps has a random name, and a killed run's table must be found; it neither locks, nor follows a
//! link to the file that is to be replaced, nor refuses to replace a device.

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
    finished: bool,
}

impl AtomicFile {
    /// Creates `path.part`; what another run left there is overwritten.
    /// # Errors
    /// [`ErrorKind::Output`] if it cannot be created or another run is writing it.
    pub fn create(path: impl Into<PathBuf>) -> Result<Self> {
        let mut path = path.into();
        // A link keeps pointing where it points: its target is replaced, not the link.
        if path.is_symlink() {
            path = path.canonicalize().map_err(|e| {
                Error::new(ErrorKind::Output, "is a link that leads nowhere, or in a circle")
                    .at(path.display())
                    .because(e)
                    .hint("remove the link, or make what it points to")
            })?;
        }
        if is_special(&path) {
            return Err(Error::new(ErrorKind::Output, "is a device or a pipe, which a file must not replace")
                .at(path.display())
                .hint("give the name of a file; tables also go to `-`, standard output"));
        }
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
        Ok(Self { file, path, part, finished: false })
    }

    /// The final name.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The name during writing.
    pub fn part_path(&self) -> &Path {
        &self.part
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
        if !self.finished {
            // Nothing can be done about a failure here, and an old part file harms nobody.
            let _ = std::fs::remove_file(&self.part);
        }
    }
}

/// Whether something stands under this name that is neither file nor folder: renaming onto it would destroy it.
fn is_special(path: &Path) -> bool {
    std::fs::metadata(path).is_ok_and(|m| !m.is_file() && !m.is_dir())
}

/// Where a text writer's lines go.
pub enum Output {
    /// A file that appears whole.
    File(AtomicFile),
    /// Standard output, or anything else that takes bytes.
    Stream(Box<dyn Write + Send>),
}

opaque_debug!(Output);

impl Output {
    /// A file that appears whole. A device or a pipe gets the lines as they come.
    /// # Errors
    /// As [`AtomicFile::create`].
    pub fn file(path: impl Into<PathBuf>) -> Result<Self> {
        let path = path.into();
        if is_special(&path) {
            let device = OpenOptions::new().write(true).open(&path);
            let failed = |e| Error::new(ErrorKind::Output, "cannot be written").at(path.display()).because(e);
            return Ok(Self::Stream(Box::new(device.map_err(failed)?)));
        }
        Ok(Self::File(AtomicFile::create(path)?))
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
                .map_err(|e| Error::new(ErrorKind::Output, "the output's stream cannot be written").because(e)),
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

/// Writes a whole file: it appears under its name when it is whole, or not at all. A device or a pipe gets the bytes as they are.
/// # Errors
/// [`ErrorKind::Output`] if it cannot be written.
pub fn write_whole(path: impl Into<PathBuf>, bytes: &[u8]) -> Result<()> {
    let mut output = Output::file(path)?;
    output.put(bytes)?;
    output.finish()
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
    fn an_unfinished_file_goes_and_the_earlier_one_stays() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("b.csv");
        write_whole(&path, b"earlier").unwrap();
        let mut file = AtomicFile::create(&path).unwrap();
        file.write_all(b"half").unwrap();
        drop(file);
        assert_eq!(std::fs::read(&path).unwrap(), b"earlier");
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
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

    #[cfg(unix)]
    #[test]
    fn a_device_is_written_to_and_never_replaced() {
        use std::os::unix::fs::FileTypeExt;
        let is_device = || std::fs::metadata("/dev/null").unwrap().file_type().is_char_device();
        assert!(is_device());
        assert!(AtomicFile::create("/dev/null").unwrap_err().to_string().contains("must not replace"));
        let mut lines = Output::file("/dev/null").unwrap();
        lines.put(b"a\n").unwrap();
        lines.finish().unwrap();
        assert!(is_device());
        if is_special(Path::new("/dev/full")) {
            assert_eq!(Output::file("/dev/full").unwrap().put(b"a\n").unwrap_err().kind(), ErrorKind::Output);
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_link_stays_and_its_target_is_written() {
        let dir = tempfile::tempdir().unwrap();
        let (target, link) = (dir.path().join("t.csv"), dir.path().join("l.csv"));
        std::fs::write(&target, b"old").unwrap();
        std::os::unix::fs::symlink(&target, &link).unwrap();
        let mut file = AtomicFile::create(&link).unwrap();
        file.write_all(b"new").unwrap();
        file.finish().unwrap();
        assert!(link.is_symlink());
        assert_eq!(std::fs::read(&target).unwrap(), b"new");
        let circle = dir.path().join("c.csv");
        std::os::unix::fs::symlink(&circle, &circle).unwrap();
        assert!(AtomicFile::create(&circle).unwrap_err().to_string().contains("in a circle"));
    }
}
