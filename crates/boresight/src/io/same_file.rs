//! Whether an output would take the place of what is read: files are compared, not their names.
//!
//! Two names are one file if they stand for the same inode of the same device (so through links, `..`, and names of any spelling);
//! where the system has no such numbers, if their resolved paths are equal. Why not the crate `same-file`: it opens both files,
//! and opening a pipe waits for its writer.

use super::open::files_of;
use crate::{Error, ErrorKind, Result};
use std::path::Path;

/// Whether two names stand for one file or folder; `false` if either does not exist.
pub fn is_same_file(a: &Path, b: &Path) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        let id = |p: &Path| std::fs::metadata(p).ok().map(|m| (m.dev(), m.ino()));
        id(a).is_some_and(|a| id(b) == Some(a))
    }
    #[cfg(not(unix))]
    {
        a.canonicalize().is_ok_and(|a| b.canonicalize().is_ok_and(|b| a == b))
    }
}

/// Refuses an output that is one of the files that `input` names (a file, a folder and the images in it, a pattern). Devices and
/// pipes hold nothing that could be lost.
/// # Errors
/// [`ErrorKind::Output`] that names both.
pub fn refuse_to_overwrite<'a>(input: impl AsRef<Path>, outputs: impl IntoIterator<Item = &'a Path>) -> Result<()> {
    let outputs: Vec<&Path> = outputs.into_iter().filter(|o| o.is_file() || o.is_dir()).collect();
    if outputs.is_empty() {
        return Ok(());
    }
    for file in files_of(input.as_ref()) {
        if let Some(output) = outputs.iter().find(|o| is_same_file(o, &file)) {
            let what = format!("is the input itself ({}), which the output would replace", file.display());
            return Err(Error::new(ErrorKind::Output, what).at(output.display()).hint("choose another output"));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_one_file_are_told_from_names_of_two() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        std::fs::write(at("a.csv"), "frame,x,y\n").unwrap();
        std::fs::write(at("b.csv"), "frame,x,y\n").unwrap();
        std::fs::create_dir(at("d")).unwrap();
        assert!(is_same_file(&at("a.csv"), &at("d/../a.csv")));
        assert!(!is_same_file(&at("a.csv"), &at("b.csv")) && !is_same_file(&at("none"), &at("none")));
        let input = at("a.csv");
        let (same, other) = (at("d/../a.csv"), at("b.csv"));
        let error = refuse_to_overwrite(&input, [same.as_path()]).unwrap_err();
        assert!(error.kind() == ErrorKind::Output && error.to_string().contains("the input itself"), "{error}");
        refuse_to_overwrite(&input, [other.as_path(), at("new.csv").as_path()]).unwrap();
        // A folder stands for itself and for the images in it; tables beside them are no frames.
        let folder = dir.path();
        std::fs::write(at("f.png"), "").unwrap();
        refuse_to_overwrite(folder, [other.as_path()]).unwrap();
        assert!(refuse_to_overwrite(folder, [at("f.png").as_path()]).is_err());
        assert!(refuse_to_overwrite(folder, [dir.path()]).is_err());
    }

    #[cfg(unix)]
    #[test]
    fn links_are_the_file_and_devices_are_none() {
        let dir = tempfile::tempdir().unwrap();
        let (file, soft, hard) = (dir.path().join("f"), dir.path().join("s"), dir.path().join("h"));
        std::fs::write(&file, "x").unwrap();
        std::os::unix::fs::symlink(&file, &soft).unwrap();
        std::fs::hard_link(&file, &hard).unwrap();
        assert!(is_same_file(&file, &soft) && is_same_file(&soft, &hard));
        refuse_to_overwrite("/dev/null", [Path::new("/dev/null")]).unwrap();
    }
}
