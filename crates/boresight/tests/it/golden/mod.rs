//! Golden vectors (`golden/README.md`): numbers of an independent implementation, compared as |a - b| <= abs_tol +
//! rel_tol |b|. The folder is the repository's `golden/`; `BORESIGHT_GOLDEN` names another of the same form. A missing
//! file fails. One submodule a room; each reads its own files with [`load`].

pub mod file;
mod fuse;
mod sim;
mod spatial;
mod track;
mod track_metrics;
mod vision;

use file::repository_folder;
use std::path::Path;

/// All Rust text of a folder of tests.
fn sources(dir: &Path) -> String {
    let mut text = String::new();
    for entry in std::fs::read_dir(dir).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            text += &sources(&path);
        } else {
            text += &std::fs::read_to_string(&path).unwrap();
        }
    }
    text
}

/// A file that nobody reads would look like evidence and be none.
#[test]
fn every_golden_file_is_read_by_a_test_and_described() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let tests = ["crates/boresight/tests/it/golden", "crates/boresight-filters/tests/it/golden"]
        .map(|dir| sources(&root.join(dir)))
        .concat();
    let tests = tests + &sources(&root.join("crates/boresight/src/track/step"));
    let readme = std::fs::read_to_string(repository_folder().join("README.md")).unwrap();
    let mut n_files = 0;
    for entry in std::fs::read_dir(repository_folder()).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        let Some(stem) = name.strip_suffix(".json") else { continue };
        assert!(tests.contains(&format!("(\"{stem}\")")), "no test reads golden/{name}");
        assert!(readme.contains(&format!("`{name}`")), "golden/README.md says nothing of {name}");
        n_files += 1;
    }
    assert!(n_files > 0, "no golden files");
}
