//! Files named by a glob (`'frames/*.png'`) or a numbered pattern (`frame_%04d.png`).

use super::natural::natural_order;
use crate::{Error, ErrorKind, Result};
use std::path::{Path, PathBuf};

/// The files that a glob or a numbered pattern names, in natural order; `None` if the text is neither.
pub(super) fn expand(input: &str) -> Result<Option<Vec<PathBuf>>> {
    let pattern = match numbered(input) {
        Some(pattern) => pattern,
        None if input.contains(['*', '?', '[']) => input.to_string(),
        None => return Ok(None),
    };
    let paths = glob::glob(&pattern).map_err(|e| Error::new(ErrorKind::NotFound, e.to_string()).at(input))?;
    let mut files: Vec<PathBuf> = Vec::new();
    for path in paths {
        let path = path.map_err(|e| Error::new(ErrorKind::NotFound, e.to_string()).at(input))?;
        if path.is_file() && numbered(input).is_none_or(|_| matches_number(input, &path)) {
            files.push(path);
        }
    }
    if files.is_empty() {
        let error = Error::new(ErrorKind::NotFound, "no file has such a name").at(input);
        return Err(if input.contains('[') {
            error.hint(
                "[ ] stand for one of the letters between them; write [[] for a bracket itself, or give the folder",
            )
        } else {
            error
        });
    }
    files.sort_by(|a, b| natural_order(&a.to_string_lossy(), &b.to_string_lossy()));
    Ok(Some(files))
}

/// Splits `head%04dtail` at its number.
fn split_number(input: &str) -> Option<(&str, &str)> {
    let at = input.find('%')?;
    let rest = input[at + 1..].trim_start_matches(|c: char| c.is_ascii_digit());
    Some((&input[..at], rest.strip_prefix('d')?))
}

/// Turns `frame_%04d.png` into a glob.
fn numbered(input: &str) -> Option<String> {
    let (head, tail) = split_number(input)?;
    Some(format!("{}*{}", glob::Pattern::escape(head), glob::Pattern::escape(tail)))
}

fn matches_number(input: &str, path: &Path) -> bool {
    let Some((head, tail)) = split_number(input) else { return false };
    let name = path.to_string_lossy();
    let digits = name.strip_prefix(head.trim_start_matches("./")).or_else(|| name.strip_prefix(head));
    digits.and_then(|d| d.strip_suffix(tail)).is_some_and(|d| !d.is_empty() && d.bytes().all(|b| b.is_ascii_digit()))
}
