//! The inputs of a batch: patterns become files and folders, each with a folder for its results that no other input has.

use super::hash;
use boresight::io::natural_order;
use boresight::{Error, ErrorKind, Result};
use std::collections::BTreeSet;
use std::path::Path;

/// Digits of the name's hash in the name of a folder: 48 bits; of a million inputs two share them once in 500 batches, and are refused.
const DIGITS: usize = 12;
/// Letters of the input's own name in the name of its folder.
const LETTERS: usize = 60;

/// One input of a batch.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Input {
    /// Its name as given, or as the pattern found it.
    pub name: String,
    /// The folder of its results, in that of the batch.
    pub folder: String,
    /// Its size, bytes; for the time left.
    pub bytes: u64,
    hash: u64,
}

impl Input {
    fn new(name: String) -> Self {
        let hash = hash::of_text(&name);
        let stem = Path::new(&name).file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
        let plain = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' };
        let stem: String = stem.chars().take(LETTERS).map(plain).collect();
        Self {
            folder: format!("{stem}-{}", &hash[..DIGITS]),
            bytes: size(Path::new(&name)),
            hash: u64::from_str_radix(&hash[..16], 16).unwrap_or(0),
            name,
        }
    }

    /// Whether it belongs to this part of so many, from 1: by its name alone, whatever the other inputs are.
    pub fn is_in(&self, shard: Shard) -> bool {
        self.hash % shard.of == shard.number - 1
    }
}

fn size(path: &Path) -> u64 {
    if path.is_dir() {
        let inside = std::fs::read_dir(path).into_iter().flatten().flatten();
        return inside.map(|e| e.metadata().map_or(0, |m| m.len())).sum();
    }
    std::fs::metadata(path).map_or(0, |m| m.len())
}

/// One part of a batch that is shared out: `2/8`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Which, from 1.
    pub number: u64,
    /// Of how many.
    pub of: u64,
}

impl std::str::FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let parts = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        match parts {
            Some((number, of)) if (1..=of).contains(&number) => Ok(Self { number, of }),
            _ => Err("expected I/N with I from 1 to N, as 2/8".to_string()),
        }
    }
}

/// All inputs that are named, in the order given; what a pattern finds in natural order. A name that comes twice counts once; one
/// that is not there is an input too, which will fail.
/// # Errors
/// A pattern that finds nothing or cannot be read; a stream.
pub fn find(given: &[String]) -> Result<Vec<Input>> {
    let (mut all, mut names, mut folders) = (Vec::new(), BTreeSet::new(), BTreeSet::new());
    for text in given {
        for name in expand(text)? {
            if !names.insert(name.clone()) {
                continue;
            }
            let input = Input::new(name);
            if !folders.insert(input.folder.clone()) {
                return Err(Error::new(ErrorKind::Unsupported, "its name has the hash of another's")
                    .at(&input.name)
                    .hint("rename it, or give it to another batch"));
            }
            all.push(input);
        }
    }
    Ok(all)
}

fn expand(text: &str) -> Result<Vec<String>> {
    let is_stream = text == "-" || text.contains("://") || text.starts_with("/dev/");
    if is_stream {
        return Err(Error::new(ErrorKind::Config, "expected files or folders: a stream cannot be read again")
            .at(text)
            .hint("`boresight track` takes it"));
    }
    if Path::new(text).exists() || !text.contains(['*', '?', '[']) {
        return Ok(vec![text.to_string()]);
    }
    let failed = |e: &dyn std::fmt::Display| Error::new(ErrorKind::NotFound, e.to_string()).at(text);
    let mut found = Vec::new();
    for path in glob::glob(text).map_err(|e| failed(&e))? {
        let path = path.map_err(|e| failed(&e))?;
        let name = path.to_str().ok_or_else(|| {
            Error::new(ErrorKind::Unsupported, "a name that is not UTF-8").at(path.display()).hint("rename it")
        })?;
        found.push(name.to_string());
    }
    if found.is_empty() {
        return Err(failed(&"no file has such a name"));
    }
    found.sort_by(|a, b| natural_order(a, b));
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inputs_of_one_name_have_folders_of_their_own() {
        let all = find(&["a/x.mp4".into(), "b/x.mp4".into(), "a/x.mp4".into()]).unwrap();
        assert_eq!(all.len(), 2);
        assert!(all[0].folder != all[1].folder && all[0].folder.starts_with("x-"));
        let odd = Input::new("d/a b/../Ü:x\u{0}.mp4".into());
        assert!(odd.folder.starts_with("Ü_x_-"), "{}", odd.folder);
        assert!(Input::new("..".into()).folder.len() > DIGITS);
    }

    #[test]
    fn each_input_is_in_one_shard_whatever_the_others_are() {
        let all = find(&(0..100).map(|k| format!("v{k}.mp4")).collect::<Vec<_>>()).unwrap();
        let of = |number| Shard { number, of: 3 };
        for input in &all {
            assert_eq!((1..=3).filter(|k| input.is_in(of(*k))).count(), 1);
        }
        assert!((1..=3).all(|k| all.iter().filter(|i| i.is_in(of(k))).count() > 15));
        assert!("2/2".parse::<Shard>().is_ok());
        for wrong in ["0/2", "3/2", "2", "a/b", "1/0", "-1/2"] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn patterns_are_sorted_as_people_count_and_streams_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        for name in ["v10.mp4", "v9.mp4"] {
            std::fs::write(dir.path().join(name), "x").unwrap();
        }
        let all = find(&[format!("{}/*.mp4", dir.path().display())]).unwrap();
        assert!(all[0].name.ends_with("v9.mp4") && all[1].name.ends_with("v10.mp4"));
        assert!(find(&[format!("{}/*.avi", dir.path().display())]).is_err());
        assert_eq!(find(&["rtsp://camera".into()]).unwrap_err().kind(), ErrorKind::Config);
    }
}
