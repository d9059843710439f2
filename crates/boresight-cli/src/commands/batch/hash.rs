//! SHA-256 of files and folders, as `sha256sum` prints it.

use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Bytes read at once.
const CHUNK: usize = 1 << 20;

fn hex(digest: impl AsRef<[u8]>) -> String {
    digest.as_ref().iter().map(|b| format!("{b:02x}")).collect()
}

/// The hash of a text, 64 hexadecimal digits.
pub fn of_text(text: &str) -> String {
    hex(Sha256::digest(text.as_bytes()))
}

/// The hash of a file's bytes, 64 hexadecimal digits.
/// # Errors
/// A file that cannot be read to its end.
pub fn of_file(path: &Path) -> std::io::Result<String> {
    let mut file = File::open(path)?;
    let mut hasher = Sha256::new();
    let mut chunk = vec![0; CHUNK];
    loop {
        match file.read(&mut chunk) {
            Ok(0) => return Ok(hex(hasher.finalize())),
            Ok(n) => hasher.update(&chunk[..n]),
            Err(e) if e.kind() == std::io::ErrorKind::Interrupted => {}
            Err(e) => return Err(e),
        }
    }
}

/// The hashes of all files below a folder, by their names from there with `/` between.
/// # Errors
/// A file that cannot be read.
pub fn of_files_below(folder: &Path) -> std::io::Result<BTreeMap<String, String>> {
    let mut all = BTreeMap::new();
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if entry.path().is_dir() {
            all.extend(of_files_below(&entry.path())?.into_iter().map(|(n, h)| (format!("{name}/{n}"), h)));
        } else {
            all.insert(name, of_file(&entry.path())?);
        }
    }
    Ok(all)
}

/// The hash of an input: a file's, or of a folder that of the list `HASH  NAME` of its files, by name, a line each.
/// # Errors
/// A file that cannot be read.
pub fn of_input(path: &Path) -> std::io::Result<String> {
    if !path.is_dir() {
        return of_file(path);
    }
    let lines: String = of_files_below(path)?.iter().map(|(name, hash)| format!("{hash}  {name}\n")).collect();
    Ok(of_text(&lines))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hashes_are_those_of_the_standard() {
        // FIPS 180-4, the example "abc".
        let abc = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(of_text("abc"), abc);
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("a"), "abc").unwrap();
        assert_eq!(of_file(&dir.path().join("a")).unwrap(), abc);
        std::fs::create_dir(dir.path().join("d")).unwrap();
        std::fs::write(dir.path().join("d/b"), "abc").unwrap();
        assert_eq!(of_input(dir.path()).unwrap(), of_text(&format!("{abc}  a\n{abc}  d/b\n")));
    }
}
