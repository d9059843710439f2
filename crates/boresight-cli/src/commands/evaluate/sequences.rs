//! Finds the sequences of a truth and a result: single tables, folders, or paths with `{seq}`.

use boresight::io::SequenceInfo;
use boresight::{Error, ErrorKind, Result};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// A truth and a result of one sequence, and what seqinfo.ini says of it.
#[derive(Clone, Debug)]
pub struct Sequence {
    pub name: String,
    pub truth: PathBuf,
    /// `None` where the result has no table for this sequence.
    pub result: Option<PathBuf>,
    pub info: SequenceInfo,
}

fn names_in(folder: &Path) -> Result<Vec<String>> {
    let entries = std::fs::read_dir(folder)
        .map_err(|e| Error::new(ErrorKind::NotFound, "cannot be opened").at(folder.display()).because(e))?;
    let mut names: Vec<String> = entries.flatten().filter_map(|e| e.file_name().into_string().ok()).collect();
    names.sort();
    Ok(names)
}

fn first_file(candidates: impl IntoIterator<Item = PathBuf>) -> Option<PathBuf> {
    candidates.into_iter().find(|p| p.is_file())
}

/// The names for which `pattern` (with `{seq}`) leads to something.
fn names_of_pattern(pattern: &str) -> Result<Vec<String>> {
    let (before, after) = pattern.split_once("{seq}").unwrap_or((pattern, ""));
    let (folder, prefix) = before.rsplit_once('/').unwrap_or((".", before));
    let folder = if folder.is_empty() { "/" } else { folder };
    let suffix = after.split('/').next().unwrap_or("");
    let names = names_in(Path::new(folder))?;
    let middle = |n: String| Some(n.strip_prefix(prefix)?.strip_suffix(suffix)?.to_string());
    Ok(names.into_iter().filter_map(middle).filter(|n| Path::new(&pattern.replace("{seq}", n)).exists()).collect())
}

/// Finds the sequences.
/// # Errors
/// A path that is not there; a folder without sequences; a result that fits none of them.
pub fn find(truth: &OsStr, result: &OsStr) -> Result<Vec<Sequence>> {
    let pattern = |text: &OsStr| text.to_str().filter(|t| t.contains("{seq}")).map(str::to_string);
    let (truth_pattern, result_pattern) = (pattern(truth), pattern(result));
    let (truth_path, result_path) = (Path::new(truth), Path::new(result));
    let single = |p: &Path| p.is_file() || p.is_dir() && boresight::io::tracks::ctc::is_ctc(p);
    let mut out = Vec::new();
    let result_of = |name: &str| {
        if let Some(pattern) = &result_pattern {
            let p = PathBuf::from(pattern.replace("{seq}", name));
            return p.exists().then_some(p);
        }
        let short = name.trim_end_matches(".txt");
        first_file([
            result_path.join(format!("{short}.txt")),
            result_path.join(format!("{short}.csv")),
            result_path.join(short).join("tracks.csv"),
            result_path.join(short).join(format!("{short}.txt")),
            result_path.join("data").join(format!("{short}.txt")),
        ])
    };
    if let Some(pattern) = &truth_pattern {
        for name in names_of_pattern(pattern)? {
            let path = PathBuf::from(pattern.replace("{seq}", &name));
            out.push(Sequence { info: SequenceInfo::beside(&path), truth: path, result: result_of(&name), name });
        }
    } else if truth_path.is_dir() && !single(truth_path) {
        for name in names_in(truth_path)? {
            let p = truth_path.join(&name);
            let inside = [p.join("gt").join("gt.txt"), p.join("gt.txt"), p.join("truth.csv")];
            let table = if p.is_dir() {
                first_file(inside)
            } else {
                Some(p).filter(|p| p.extension().is_some_and(|e| e == "txt"))
            };
            if let Some(table) = table {
                let short = name.trim_end_matches(".txt").to_string();
                out.push(Sequence {
                    info: SequenceInfo::beside(&table),
                    truth: table,
                    result: result_of(&short),
                    name: short,
                });
            }
        }
    } else {
        for p in [truth_path, result_path] {
            if !p.exists() {
                return Err(Error::new(ErrorKind::NotFound, "no such file or folder").at(p.display()));
            }
        }
        let name = truth_path
            .file_stem()
            .map_or_else(|| truth.to_string_lossy().into_owned(), |s| s.to_string_lossy().into_owned());
        out.push(Sequence {
            name,
            info: SequenceInfo::beside(truth_path),
            truth: truth_path.into(),
            result: Some(result_path.into()),
        });
    }
    if out.is_empty() {
        return Err(Error::new(ErrorKind::NotFound, "no sequences here")
            .at(truth.display())
            .hint("expected SEQ/gt/gt.txt, SEQ/gt.txt or SEQ.txt in it, or a path with {seq}"));
    }
    if out.iter().all(|s| s.result.is_none()) {
        let names: Vec<&str> = out.iter().take(3).map(|s| s.name.as_str()).collect();
        return Err(Error::new(
            ErrorKind::NotFound,
            format!("has no table for any of the sequences {} ..", names.join(", ")),
        )
        .at(result.display())
        .hint("expected SEQ.txt in it, or a path with {seq}"));
    }
    Ok(out)
}
