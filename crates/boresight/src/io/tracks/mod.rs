//! Tables of tracks in the formats of the field: MOTChallenge, KITTI, CSV with named columns, Cell Tracking Challenge.
//!
//! [`read`] finds the format by the look of the file; [`write()`] says what the target cannot hold.

pub mod ctc;
#[cfg(feature = "images")]
pub mod ctc_write;
pub mod kitti;
pub(crate) mod lines;
pub mod mot;
pub(crate) mod named;
pub(crate) mod named_write;

pub use lines::{BadRows, ReadOptions};
pub use named::Dialect;

use crate::{Error, ErrorKind, Result, TrackTable};
use std::io::{Read, Write};
use std::path::Path;

/// A format of tracks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// MOTChallenge result: the last columns are -1.
    Mot,
    /// MOTChallenge truth: with class and visibility.
    MotTruth,
    /// KITTI tracking labels.
    Kitti,
    /// CSV with named columns.
    Named(Dialect),
    /// Cell Tracking Challenge folder.
    Ctc,
}

impl Format {
    /// The format's name, as the command takes it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mot => "mot",
            Self::MotTruth => "mot-truth",
            Self::Kitti => "kitti",
            Self::Named(Dialect::Plain) => "csv",
            Self::Named(Dialect::Trackpy) => "trackpy",
            Self::Named(Dialect::TrackMate) => "trackmate",
            Self::Named(Dialect::Btrack) => "btrack",
            Self::Named(Dialect::Ultrack) => "ultrack",
            Self::Ctc => "ctc",
        }
    }

    /// All formats.
    pub const ALL: [Self; 9] = [
        Self::Mot,
        Self::MotTruth,
        Self::Kitti,
        Self::Named(Dialect::Plain),
        Self::Named(Dialect::Trackpy),
        Self::Named(Dialect::TrackMate),
        Self::Named(Dialect::Btrack),
        Self::Named(Dialect::Ultrack),
        Self::Ctc,
    ];
}

/// A table as read.
#[derive(Clone, Debug)]
pub struct TrackFile {
    /// The table.
    pub table: TrackTable,
    /// Its format.
    pub format: Format,
    /// Rows that were left out.
    pub bad: BadRows,
}

/// Finds the format of a file or folder by its look.
/// # Errors
/// A path that is not there; a look that is none of the formats'.
pub fn sniff(path: &Path) -> Result<Format> {
    if path.is_dir() {
        return if ctc::is_ctc(path) {
            Ok(Format::Ctc)
        } else {
            Err(Error::new(ErrorKind::Unsupported, "is a folder without man_track.txt or res_track.txt")
                .at(path.display())
                .hint("name the table itself, or write {seq} where the names of the sequences stand"))
        };
    }
    let mut file = std::fs::File::open(path)
        .map_err(|e| Error::new(ErrorKind::NotFound, "cannot be opened").at(path.display()).because(e))?;
    let mut head = vec![0; 4096];
    let n = file.read(&mut head).unwrap_or(0);
    let head = head[..n].strip_prefix(b"\xEF\xBB\xBF").unwrap_or(&head[..n]);
    if matches!(head, [0xff, 0xfe, ..] | [0xfe, 0xff, ..]) {
        return Err(Error::new(ErrorKind::Unsupported, "expected a table in UTF-8, found UTF-16")
            .at(path.display())
            .hint("save it as \"CSV UTF-8\", or convert it: iconv -f UTF-16 -t UTF-8"));
    }
    let line = head.split(|&b| b == b'\n').find(|l| lines::is_content(l)).unwrap_or(b"").trim_ascii();
    if line.is_empty() {
        // An empty table: a tracker that found nothing.
        return Ok(Format::Mot);
    }
    if named::is_header(line) {
        return Ok(Format::Named(Dialect::Plain));
    }
    let separator = lines::separator(line);
    let first = lines::Fields::new(line, separator).field().unwrap_or(b"");
    if first.first().is_some_and(|b| b.is_ascii_alphabetic() || *b == b'"') && line.contains(&separator.unwrap_or(b' '))
    {
        // Names of columns, but not those that are needed: the reader says which.
        return Ok(Format::Named(Dialect::Plain));
    }
    let mut fields = lines::Fields::new(line, None);
    let third = (fields.field(), fields.field(), fields.field()).2;
    if third.is_some_and(|t| t.first().is_some_and(u8::is_ascii_alphabetic)) {
        return Ok(Format::Kitti);
    }
    if line.iter().any(u8::is_ascii_digit) && !line.iter().any(|b| b.is_ascii_alphabetic() && !b"eEnNaA".contains(b)) {
        return Ok(Format::Mot);
    }
    let shown: String = String::from_utf8_lossy(line).chars().take(60).collect();
    Err(Error::new(ErrorKind::Unsupported, format!("begins with \"{shown}\": no table of tracks known here"))
        .at(path.display())
        .hint("known are MOTChallenge, KITTI, CSV with named columns (frame, track_id, x, y ..) and Cell Tracking Challenge folders"))
}

/// Reads a table in a given format, or in that of its look.
/// # Errors
/// As the format's reader.
pub fn read(path: &Path, format: Option<Format>, options: ReadOptions, tentative: bool) -> Result<TrackFile> {
    let format = match format {
        Some(f) => f,
        None => sniff(path)?,
    };
    let (table, bad) = match format {
        Format::Mot | Format::MotTruth => mot::read(path, options)?,
        Format::Kitti => kitti::read(path, options)?,
        Format::Named(_) => named::read(path, options, tentative)?,
        Format::Ctc => {
            (ctc::CtcFolder::open(path)?.table(path.display().to_string(), options.keep_extra)?, BadRows::default())
        }
    };
    Ok(TrackFile { table, format, bad })
}

/// What a format is said to lose that has no regions.
pub(crate) const REGIONS: &str = "regions that do not count";

/// The columns of a table that say anything and are not among those that a format holds.
pub(crate) fn lost(table: &TrackTable, held: &[&str]) -> Vec<String> {
    use crate::tracks::Column::Constant;
    let all = [
        ("score", table.score != Constant(1.0)),
        ("class", table.class != Constant(1)),
        ("visibility", table.visibility != Constant(1.0)),
        ("truncation", table.truncation != Constant(0.0)),
        ("occlusion", table.occlusion != Constant(0)),
        (REGIONS, !table.ignore.is_empty()),
    ];
    all.into_iter().filter(|(n, says)| *says && !held.contains(n)).map(|(n, _)| n.to_string()).collect()
}

/// Writes a table; the names of what the format cannot hold are returned.
/// # Errors
/// The Cell Tracking Challenge's format, which is a folder ([`ctc_write::write_folder`]); what the writer fails with.
pub fn write(table: &TrackTable, format: Format, out: &mut impl Write) -> Result<Vec<String>> {
    match format {
        Format::Mot | Format::MotTruth => {
            let truth = format == Format::MotTruth;
            let held: &[&str] = if truth { &["score", "class", "visibility"] } else { &["score"] };
            let mut dropped = lost(table, held);
            let names = table.extra.iter().map(|e| e.0.clone());
            dropped.extend(names.filter(|n| truth || !mot::WORLD.contains(&n.as_str())));
            if table.is_points {
                dropped.push("that rows are points (they become boxes without size)".into());
            }
            mot::write(table, truth, out)?;
            Ok(dropped)
        }
        Format::Kitti => {
            let mut dropped = lost(table, &["score", "class", "truncation", "occlusion", REGIONS]);
            if table.is_points {
                dropped.push("that rows are points (they become boxes without size)".into());
            }
            dropped.extend(kitti::write(table, out)?);
            Ok(dropped)
        }
        Format::Named(dialect) => named_write::write(table, dialect, out),
        Format::Ctc => {
            Err(Error::new(ErrorKind::Unsupported, "the Cell Tracking Challenge's format is a folder of label images")
                .at(&table.label)
                .hint("give a folder as the output"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_are_known_by_their_look() {
        let f = tempfile::NamedTempFile::new().unwrap();
        let look = |text: &str| {
            std::fs::write(f.path(), text).unwrap();
            sniff(f.path())
        };
        assert_eq!(look("1,2,3,4,5,6,1,-1,-1,-1\n").unwrap(), Format::Mot);
        assert_eq!(look("0 1 Car 0 0 0 1 2 3 4\n").unwrap(), Format::Kitti);
        assert_eq!(look("frame,particle,x,y\n").unwrap(), Format::Named(Dialect::Plain));
        assert_eq!(look("").unwrap(), Format::Mot);
        assert_eq!(look("\u{feff}# by hand\nframe;particle;x;y\n").unwrap(), Format::Named(Dialect::Plain));
        assert_eq!(look("frame\tx\ty\n").unwrap(), Format::Named(Dialect::Plain), "no KITTI label");
        std::fs::write(f.path(), b"\xff\xfef\0").unwrap();
        assert!(sniff(f.path()).unwrap_err().to_string().contains("UTF-16"));
        assert!(look("<html>hello</html>").unwrap_err().to_string().contains("no table of tracks known here"));
    }
}
