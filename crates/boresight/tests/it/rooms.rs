//! The arrows between rooms: a file uses only what this table allows. A new arrow is a new line here and a sentence in
//! ARCHITECTURE.md. No room uses what joins the rooms, and no files import each other in a circle.

mod imports;
mod tokens;

use imports::Crate;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Leaf types, open to all.
const LEAVES: &[&str] = &[
    "image",
    "frame",
    "similarity",
    "homography",
    "geodesy",
    "camera_motion",
    "detection",
    "warp",
    "record",
    "tracks",
    "view",
    "error",
    "time",
    "length_unit",
    "union_find",
    "validate",
    "cpu",
    "palette",
    "memory_budget",
];

/// room -> rooms it may use besides the leaves and itself.
const ARROWS: &[(&str, &[&str])] = &[
    ("camera", &[]),
    ("vision", &["camera"]),
    ("associate", &[]),
    ("track", &["associate", "camera"]),
    ("fuse", &["associate"]),
    ("world", &["fuse"]),
    ("metrics", &["associate"]),
    ("sim", &[]),
    ("sensor", &[]),
    ("io", &[]),
    ("draw", &["io"]),
    ("report", &["draw", "io", "metrics"]),
];

/// What stands above the rooms and joins them.
const ABOVE: [&str; 4] = ["config", "auto", "pipeline", "verdict"];

/// Beginnings of the paths of files that still import each other in a circle. To become empty; an entry without a circle fails.
const KNOWN_CYCLES: &[&str] = &[];

fn rust_files(dir: &Path, out: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(dir).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            rust_files(&path, out);
        } else if path.extension().is_some_and(|e| e == "rs") {
            out.push(path);
        }
    }
}

/// The rooms named in `crate::room` paths and in `use crate::{a, b}` groups.
fn rooms_used(text: &str, rooms: &[&str]) -> Vec<String> {
    // Tests inside a file may use anything.
    let code = text.split("#[cfg(test)]").next().unwrap_or(text);
    let mut used = Vec::new();
    for (at, _) in code.match_indices("crate::") {
        let rest = &code[at + "crate::".len()..];
        let names: String = if let Some(group) = rest.strip_prefix('{') {
            group.split(';').next().unwrap_or("").to_string()
        } else {
            rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect()
        };
        for room in rooms {
            if names.split(|c: char| !c.is_alphanumeric() && c != '_').any(|word| word == *room) {
                used.push((*room).to_string());
            }
        }
    }
    used
}

#[test]
fn every_room_uses_only_the_rooms_it_may() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let rooms: Vec<&str> = ARROWS.iter().map(|(r, _)| *r).collect();
    let mut wrong = Vec::new();
    for &(room, allowed) in ARROWS {
        let mut files = Vec::new();
        rust_files(&src.join(room), &mut files);
        // A file of tests, declared beside its subject, may use anything as well.
        files.retain(|f| f.file_name().is_none_or(|n| n != "tests.rs" && n != "edge_tests.rs"));
        for file in files {
            let text = std::fs::read_to_string(&file).unwrap();
            for used in rooms_used(&text, &rooms) {
                if used != room && !allowed.contains(&used.as_str()) {
                    wrong.push(format!("{} uses {used}", file.display()));
                }
            }
        }
    }
    for leaf in LEAVES {
        let mut files = Vec::new();
        match src.join(format!("{leaf}.rs")) {
            file if file.exists() => files.push(file),
            _ => rust_files(&src.join(leaf), &mut files),
        }
        assert!(!files.is_empty(), "the leaf {leaf} is gone");
        for file in files {
            for used in rooms_used(&std::fs::read_to_string(&file).unwrap(), &rooms) {
                wrong.push(format!("{}, a leaf, uses {used}", file.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "new arrows between rooms:\n{}", wrong.join("\n"));
}

#[test]
fn every_file_starts_by_saying_what_it_is() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut files = Vec::new();
    let dirs =
        ["boresight", "boresight-filters", "boresight-reproduce", "boresight-live", "boresight-cli", "boresight-py"]
            .map(|c| format!("crates/{c}/src"));
    for dir in dirs.iter().map(String::as_str).chain(["peers/src", "xtask/src"]) {
        rust_files(&root.join(dir), &mut files);
    }
    let bare: Vec<_> = files
        .iter()
        .filter(|f| !std::fs::read_to_string(f).unwrap().starts_with("//!"))
        .map(|f| f.display().to_string())
        .collect();
    assert!(bare.is_empty(), "files without a //! header:\n{}", bare.join("\n"));
}

#[test]
fn the_arrow_test_sees_a_forbidden_arrow() {
    let rooms = ["vision", "track"];
    assert_eq!(rooms_used("use crate::track::Tracker;", &rooms), ["track"]);
    assert_eq!(rooms_used("use crate::{Image, track::{A, B}};", &rooms), ["track"]);
    assert!(rooms_used("use crate::Image;\n#[cfg(test)]\nmod tests { use crate::track::X; }", &rooms).is_empty());
}

/// The table of arrows in ARCHITECTURE.md is the one of this file.
#[test]
fn the_architecture_chapter_draws_the_same_arrows() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let text = std::fs::read_to_string(root.join("ARCHITECTURE.md")).unwrap();
    let names = |cell: &str| -> Vec<String> {
        cell.split('`').skip(1).step_by(2).map(ToString::to_string).collect() // what stands between back quotes
    };
    for &(room, allowed) in ARROWS {
        let start = format!("| `{room}` |");
        let row = text.lines().find(|l| l.starts_with(&start)).unwrap_or_else(|| panic!("no row for {room}"));
        let cells: Vec<&str> = row.split('|').collect();
        assert_eq!(names(cells[2]), allowed, "arrows of {room} in ARCHITECTURE.md");
    }
}

/// file -> imported files of the whole workspace, by their paths in it.
fn imports_of_the_workspace() -> BTreeMap<PathBuf, BTreeSet<PathBuf>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let read = |file: &Path| std::fs::read_to_string(root.join(file)).ok();
    let crates =
        std::fs::read_dir(root.join("crates")).unwrap().map(|e| Path::new("crates").join(e.unwrap().file_name()));
    let roots = crates.chain(["xtask".into()]).flat_map(|c| [c.join("src/lib.rs"), c.join("src/main.rs")]);
    let roots: BTreeSet<PathBuf> = roots.filter(|file| root.join(file).exists()).collect();
    assert!(roots.len() >= 4, "{roots:?}");
    roots.iter().flat_map(|file| Crate::read(file, &read).imports()).collect()
}

#[test]
fn no_files_import_each_other_in_a_circle() {
    let found = imports::cycles(&imports_of_the_workspace());
    let all_under = |cycle: &[PathBuf], k: &str| cycle.iter().all(|f| f.to_string_lossy().starts_with(k));
    let new: Vec<String> = found
        .iter()
        .filter(|cycle| !KNOWN_CYCLES.iter().any(|k| all_under(cycle, k)))
        .map(|cycle| cycle.iter().map(|f| format!("\n  {}", f.display())).collect::<String>())
        .collect();
    assert!(new.is_empty(), "files that import each other in a circle:{}", new.join("\nand"));
    for k in KNOWN_CYCLES {
        assert!(found.iter().any(|cycle| all_under(cycle, k)), "{k} holds no cycle any more: off the list");
    }
}

#[test]
fn no_room_uses_what_joins_the_rooms() {
    let src = Path::new("crates/boresight/src");
    let is = |file: &Path, room: &str| file.starts_with(src.join(room)) || file == src.join(format!("{room}.rs"));
    let mut wrong = Vec::new();
    for (from, imported) in imports_of_the_workspace() {
        let inside = ARROWS.iter().map(|(room, _)| *room).chain(LEAVES.iter().copied()).any(|room| is(&from, room));
        for to in imported.iter().filter(|to| inside && ABOVE.iter().any(|above| is(to, above))) {
            wrong.push(format!("{} uses {}", from.display(), to.display()));
        }
    }
    assert!(wrong.is_empty(), "rooms that use what stands above them:\n{}", wrong.join("\n"));
}
