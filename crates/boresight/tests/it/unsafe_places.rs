//! Unsafe code stands in named files only, and every crate refuses it elsewhere.

use std::path::{Path, PathBuf};

/// The files with unsafe code, and why.
const NAMED: [(&str, &str); 4] = [
    ("crates/boresight-py/src/arrow.rs", "the Arrow C interface is made of raw pointers"),
    ("crates/boresight-cli/src/stdout_at_start.rs", "looks at standard output before the runtime opens it"),
    ("crates/boresight/tests/it/memory.rs", "an allocator that counts"),
    ("crates/boresight-filters/tests/no_std/src/lib.rs", "a firmware's entry points"),
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap()
}

fn files(dir: &Path, out: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(dir).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() {
            if !name.starts_with('.') && name != "target" {
                files(&path, out);
            }
        } else if name == "Cargo.toml" || name.ends_with(".rs") {
            out.push(path);
        }
    }
}

/// The code of a file: no comments to the end of a line, no text between quotes.
fn words(text: &str) -> Vec<String> {
    let code: String = text.lines().map(|l| l.split("//").next().unwrap_or("").to_string() + "\n").collect();
    let code: String = code.split('"').step_by(2).collect::<Vec<_>>().join(" ");
    code.split(|c: char| !c.is_alphanumeric() && c != '_').map(String::from).collect()
}

#[test]
fn unsafe_code_stands_in_named_files_and_nowhere_else() {
    let root = root();
    let mut all = Vec::new();
    for room in ["crates", "peers", "xtask", "fuzz"] {
        files(&root.join(room), &mut all);
    }
    assert!(all.len() > 300, "{} files", all.len());
    for path in &all {
        let name = path.strip_prefix(&root).unwrap().to_string_lossy().replace('\\', "/");
        let text = std::fs::read_to_string(path).unwrap();
        let named = NAMED.iter().any(|(n, _)| *n == name);
        if name.ends_with("Cargo.toml") {
            // Of a workspace of its own or of this one: somewhere unsafe code is refused.
            let own = name.starts_with("fuzz/") || name.contains("no_std");
            assert!(own || text.contains("[lints]\nworkspace = true"), "{name} does not take the workspace's lints");
            continue;
        }
        let unsafe_words = words(&text).iter().any(|w| w == "unsafe");
        // An allowance lets code in that does not say the word.
        let allows = text.lines().any(|l| l.trim_start().starts_with("#") && l.contains("allow(unsafe_code)"));
        if name == "crates/boresight/tests/it/unsafe_places.rs" {
            continue;
        }
        assert_eq!(unsafe_words || allows, named, "{name}: unsafe code, or a name in the list without it");
    }
    let manifest = std::fs::read_to_string(root.join("Cargo.toml")).unwrap();
    assert!(manifest.contains("unsafe_code = \"deny\""), "the workspace refuses unsafe code");
    let fuzz = std::fs::read_to_string(root.join("fuzz/src/lib.rs")).unwrap();
    assert!(fuzz.contains("#![forbid(unsafe_code)]"));
}

#[test]
fn words_are_read_as_code() {
    assert!(words("let x = unsafe { 1 };").contains(&"unsafe".to_string()));
    assert!(!words("// unsafe\nlet x = \"unsafe\"; let unsafe_words = 1;").contains(&"unsafe".to_string()));
}
