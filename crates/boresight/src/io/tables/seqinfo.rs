//! What the `seqinfo.ini` beside a table of MOTChallenge, or one folder up, says of its sequence.

use std::path::{Path, PathBuf};

/// A file of a sequence's facts is small.
const MAX_BYTES: u64 = 1 << 16;

/// What `seqinfo.ini` says; a value that makes no sense is none.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SequenceInfo {
    /// `frameRate`, frames/s.
    pub rate_hz: Option<f64>,
    /// `seqLength`.
    pub n_frames: Option<usize>,
    /// `imWidth` and `imHeight`, px.
    pub size_px: Option<(f64, f64)>,
    /// The folder `imDir`, if it is there.
    pub pictures: Option<PathBuf>,
}

impl SequenceInfo {
    /// Reads the file that a table belongs to; all is none where there is no such file.
    pub fn beside(table: &Path) -> Self {
        let folders = table.parent().map(|folder| [folder.to_path_buf(), folder.join("..")]);
        let found = folders.into_iter().flatten().find_map(|folder| {
            let path = folder.join("seqinfo.ini");
            let is_small = path.metadata().ok()?.len() < MAX_BYTES;
            is_small.then(|| std::fs::read(&path).ok()).flatten().map(|bytes| (folder, bytes))
        });
        let Some((folder, bytes)) = found else { return Self::default() };
        Self::of(&String::from_utf8_lossy(&bytes), &folder)
    }

    fn of(ini: &str, folder: &Path) -> Self {
        let word = |key: &str| {
            ini.lines().find_map(|line| {
                let (k, v) = line.split_once('=')?;
                k.trim().eq_ignore_ascii_case(key).then(|| v.trim())
            })
        };
        let number = |key: &str| word(key)?.parse::<f64>().ok().filter(|v| *v > 0.0 && v.is_finite());
        Self {
            rate_hz: number("frameRate").filter(|rate| crate::time::check_rate(*rate).is_ok()),
            n_frames: number("seqLength").map(|n| n as usize),
            size_px: number("imWidth").zip(number("imHeight")),
            pictures: word("imDir").filter(|d| !d.is_empty()).map(|d| folder.join(d)).filter(|d| d.is_dir()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_found_whatever_the_spacing_and_senseless_ones_are_none() {
        let of = |ini: &str| SequenceInfo::of(ini, Path::new("."));
        let all = of("[Sequence]\r\nname=A\r\nframeRate = 14\r\nseqLength=71\r\nimWidth=640\nimheight=480\nimDir=none");
        assert_eq!((all.rate_hz, all.n_frames, all.size_px), (Some(14.0), Some(71), Some((640.0, 480.0))));
        assert_eq!(all.pictures, None, "no such folder");
        assert_eq!((of("frameRate=0").rate_hz, of("frameRate=1e300").rate_hz), (None, None));
        assert_eq!(of(""), SequenceInfo::default());
    }

    #[test]
    fn the_file_beside_the_table_or_one_folder_up_is_taken() {
        let dir = tempfile::tempdir().unwrap();
        std::fs::create_dir_all(dir.path().join("det")).unwrap();
        std::fs::create_dir_all(dir.path().join("img1")).unwrap();
        std::fs::write(dir.path().join("seqinfo.ini"), "frameRate=25\nimDir=img1\n").unwrap();
        for table in ["det.txt", "det/det.txt"] {
            let info = SequenceInfo::beside(&dir.path().join(table));
            assert_eq!(info.rate_hz, Some(25.0), "{table}");
            assert!(info.pictures.is_some_and(|p| p.ends_with("img1")), "{table}");
        }
    }
}
