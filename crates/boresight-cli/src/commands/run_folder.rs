//! The folder of a run: `track` writes several files there, and the folder is to hold that run and no other.
//!
//! `config.toml` lists the files of its run. When a run has succeeded, files that an earlier run lists and this one did not make go
//! (an old `annotated.mp4` beside new tables would show another run); all other files stay. A run that fails changes nothing.

use super::export_files::FORMATS;
use super::run_options::Plan;
use boresight::io::{AtomicFile, is_same_file};
use boresight::{Error, ErrorKind};
use std::ffi::OsStr;
use std::io::Write;
use std::path::{Path, PathBuf};

/// What a run can write beside [`FORMATS`]; a name with `/` is a folder.
const NAMES: [&str; 11] = [
    "tracks.csv",
    "detections.csv",
    "mot.txt",
    "tracks.jsonl",
    "camera.csv",
    "annotated.mp4",
    "frames/",
    "report.html",
    "summary.json",
    "thumbnail.png",
    "config.toml",
];

/// What a run may remove if an earlier run says that it wrote it.
fn names() -> impl Iterator<Item = &'static str> {
    NAMES.into_iter().chain(FORMATS.map(|(_, name)| name))
}

/// Starts the line of `config.toml` that lists the files.
const LIST: &str = "# Files of this run:";

/// The folder of one run.
pub struct RunFolder {
    dir: PathBuf,
    made: Vec<&'static str>,
}

impl RunFolder {
    /// A folder that `made` will be written to (names of [`names`]), unless that would replace the input.
    /// # Errors
    /// Standard output instead of a folder; the input in the place of an output.
    pub fn new(dir: PathBuf, made: Vec<&'static str>, input: &OsStr) -> boresight::Result<Self> {
        if dir.as_os_str() == "-" {
            return Err(Error::new(ErrorKind::Config, "expected a folder: the results are several files")
                .at("--output -")
                .hint("give a folder; `boresight detect INPUT -o -` writes a table to standard output"));
        }
        let folder = Self { dir, made };
        folder.spares(input)?;
        Ok(folder)
    }

    /// Refuses an input in the place of an output.
    /// # Errors
    /// [`ErrorKind::Output`] that names both.
    pub fn spares(&self, input: &OsStr) -> boresight::Result<()> {
        let outputs: Vec<PathBuf> = self.made.iter().map(|name| self.path(name)).collect();
        boresight::io::refuse_to_overwrite(input, outputs.iter().map(PathBuf::as_path))
            .map_err(|e| e.hint("give a folder of its own with --output DIR"))
    }

    /// Takes back names: detections from elsewhere have no pictures to draw on.
    pub fn leave_out(&mut self, names: &[&str]) {
        self.made.retain(|n| !names.contains(n));
    }

    /// The folder's name.
    pub fn dir(&self) -> &Path {
        &self.dir
    }

    /// Where a file stands.
    pub fn path(&self, name: &str) -> PathBuf {
        self.dir.join(name.trim_end_matches('/'))
    }

    /// Whether this run makes a file.
    pub fn makes(&self, name: &str) -> bool {
        self.made.contains(&name)
    }

    /// Makes the folder itself.
    /// # Errors
    /// A folder that cannot be made.
    pub fn make(&self) -> boresight::Result<()> {
        std::fs::create_dir_all(&self.dir).map_err(|e| {
            Error::new(ErrorKind::Output, "the folder for the results cannot be made")
                .at(self.dir.display())
                .because(e)
                .hint("choose another with --output DIR")
        })
    }

    /// What an earlier run says it made here and this run does not make, but for the input itself.
    fn left_over(&self, input: &OsStr) -> Vec<PathBuf> {
        let earlier = std::fs::read_to_string(self.path("config.toml")).unwrap_or_default();
        let listed = earlier.lines().find_map(|l| l.strip_prefix(LIST)).unwrap_or_default();
        let gone = names().filter(|n| listed.split_whitespace().any(|l| l == *n) && !self.makes(n));
        gone.map(|n| self.path(n)).filter(|p| !is_same_file(p, Path::new(input))).collect()
    }

    /// Begins `config.toml`, which appears with the results of the run.
    /// # Errors
    /// A file that cannot be written.
    pub fn begin_config(&self, plan: &Plan, input: &OsStr) -> boresight::Result<ConfigFile> {
        let mut text = format!(
            "# The configuration of this run; `--config` with this file gives the identical result.\n{LIST} {}\n",
            self.made.join(" ")
        );
        for reason in &plan.reasons {
            text.push_str(&format!("# {}\n", reason.replace('\n', " ")));
        }
        text.push('\n');
        text.push_str(&plan.config.to_toml()?);
        let left_over = self.left_over(input);
        let mut file = AtomicFile::create(self.path("config.toml"))?;
        put(&mut file, &text)?;
        Ok(ConfigFile { file, left_over })
    }
}

/// The configuration of a run that goes on.
pub struct ConfigFile {
    file: AtomicFile,
    left_over: Vec<PathBuf>,
}

impl ConfigFile {
    /// Ends the file with what must be known of the results.
    /// # Errors
    /// A file that cannot be written.
    pub fn finish(mut self, warnings: &[String]) -> boresight::Result<LeftOver> {
        if !warnings.is_empty() {
            let lines: String = warnings.iter().map(|w| format!("# - {}\n", w.replace('\n', " "))).collect();
            put(&mut self.file, &format!("\n# Warnings of this run:\n{lines}"))?;
        }
        self.file.finish()?;
        Ok(LeftOver(self.left_over))
    }
}

fn put(file: &mut AtomicFile, text: &str) -> boresight::Result<()> {
    file.write_all(text.as_bytes())
        .map_err(|e| Error::new(ErrorKind::Output, "cannot be written").at(file.part_path().display()).because(e))
}

/// Files of an earlier run in the folder.
pub struct LeftOver(Vec<PathBuf>);

impl LeftOver {
    /// Removes them; what cannot be removed stays, as anything else in the folder.
    pub fn remove(self) {
        for path in self.0 {
            if path.join(".zattrs").is_file() {
                // A folder as `--also geff` writes it.
                let _ = std::fs::remove_dir_all(path);
            } else if path.is_dir() {
                boresight::draw::PngFolder::remove(&path);
            } else {
                let _ = std::fs::remove_file(path);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whatever_an_earlier_run_exported_goes_and_what_it_did_not_name_stays() {
        let dir = tempfile::tempdir().unwrap();
        let exports: Vec<&str> = FORMATS.iter().map(|(_, name)| *name).collect();
        std::fs::write(dir.path().join("config.toml"), format!("{LIST} {} notes.txt\n", exports.join(" "))).unwrap();
        let folder =
            RunFolder::new(dir.path().to_owned(), vec!["vmti.ts", "config.toml"], OsStr::new("in.mp4")).unwrap();
        let gone = folder.left_over(OsStr::new("in.mp4"));
        let kept = exports.iter().filter(|name| **name != "vmti.ts").map(|name| folder.path(name));
        assert_eq!(gone, kept.collect::<Vec<_>>());
    }
}
