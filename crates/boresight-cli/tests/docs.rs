//! Every command that the README and the chapters show is run, as it stands there.
//!
//! Blocks fenced as `sh` hold commands, a line each; blocks fenced as `console` hold commands after `$ ` and what they print
//! (`...` stands for anything). A chapter's blocks run in order in one folder, in which `samples/` and `configs/` lie.
//! A block of any kind with `file=NAME` is written to that file first (a scene, a configuration).
//! After `sh` or `console` may stand: `needs=data` (or any other need: not run here, shown as ignored; `needs=live` is run in a build with
//! that feature), `exit=2` (the code expected).
//! Lines whose command is not `boresight` (cargo, .ci/run) are left to `.ci/run`.

use libtest_mimic::{Arguments, Trial};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A fenced block of commands.
struct Block {
    line: usize,
    console: bool,
    needs: Option<String>,
    /// Not commands, but the content of this file.
    file: Option<String>,
    exit: i32,
    lines: Vec<String>,
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap()
}

fn blocks(text: &str) -> Vec<Block> {
    let mut out = Vec::new();
    let mut open: Option<Block> = None;
    let mut other = false;
    for (k, line) in text.lines().enumerate() {
        let Some(fence) = line.trim_start().strip_prefix("```") else {
            if let Some(block) = &mut open {
                block.lines.push(line.to_string());
            }
            continue;
        };
        if let Some(block) = open.take() {
            out.push(block);
        } else if other {
            other = false;
        } else {
            let mut words = fence.split([' ', ',']);
            let kind = words.next().unwrap_or("");
            let attributes: Vec<(&str, &str)> = words.filter_map(|w| w.split_once('=')).collect();
            let get = |name: &str| attributes.iter().find(|(n, _)| *n == name).map(|(_, v)| (*v).to_string());
            let file = get("file");
            if file.is_none() && !matches!(kind, "sh" | "bash" | "shell" | "console") {
                other = true;
                continue;
            }
            open = Some(Block {
                line: k + 1,
                console: kind == "console",
                needs: get("needs").filter(|needs| needs != "live" || !cfg!(feature = "live")),
                file,
                exit: get("exit").map_or(0, |e| e.parse().expect("exit=NUMBER")),
                lines: Vec::new(),
            });
        }
    }
    assert!(open.is_none() && !other, "a fence is not closed");
    out
}

/// The commands of a block, each with the lines it is said to print; a backslash at the end continues a command.
fn commands(block: &Block) -> Vec<(String, Vec<String>)> {
    let mut out: Vec<(String, Vec<String>)> = Vec::new();
    let mut joined = String::new();
    for line in &block.lines {
        if block.console && joined.is_empty() {
            match (line.strip_prefix("$ "), out.last_mut()) {
                (Some(command), _) => joined.push_str(command),
                (None, Some((_, shown))) => {
                    shown.push(line.clone());
                    continue;
                }
                (None, None) => panic!("line {}: a console block starts with `$ `", block.line),
            }
        } else {
            joined.push_str(line.trim());
        }
        if let Some(part) = joined.strip_suffix('\\') {
            joined = part.to_string();
            continue;
        }
        let command = std::mem::take(&mut joined);
        if !(command.is_empty() || command.starts_with('#')) {
            out.push((command, Vec::new()));
        }
    }
    out
}

/// Programs of a shell's everyday life that may stand beside ours.
const COMPANIONS: [&str; 8] = ["cmp", "head", "tail", "cat", "mkdir", "printf", "grep", "ls"];

/// Whether a line is ours to run.
fn is_ours(command: &str) -> bool {
    let first = command.split_whitespace().next().unwrap_or("");
    first == "boresight" || COMPANIONS.contains(&first)
}

fn run(command: &str, dir: &Path) -> Output {
    let bin = Path::new(env!("CARGO_BIN_EXE_boresight")).parent().unwrap();
    let path = std::env::var("PATH").unwrap_or_default();
    Command::new("sh")
        .args(["-c", command])
        .current_dir(dir)
        .env("PATH", format!("{}:{path}", bin.display()))
        .env("COLUMNS", "100")
        .output()
        .unwrap()
}

/// Whether the lines shown appear in this order in what was printed; `...` leaves out any number of lines, and the rest of one.
fn shows(printed: &str, shown: &[String]) -> Result<(), String> {
    let mut rest = printed.lines();
    for line in shown.iter().filter(|l| l.trim() != "...") {
        let fits = |p: &str| match line.strip_suffix("...") {
            Some(start) => p.starts_with(start),
            None => p.trim_end() == line.trim_end(),
        };
        if !rest.any(fits) {
            return Err(line.clone());
        }
    }
    Ok(())
}

fn check(chapter: &Path) {
    let name = chapter.strip_prefix(root()).unwrap().display().to_string();
    let dir = tempfile::tempdir().unwrap();
    for shared in ["samples", "configs"] {
        #[cfg(unix)]
        std::os::unix::fs::symlink(root().join(shared), dir.path().join(shared)).unwrap();
    }
    for block in blocks(&std::fs::read_to_string(chapter).unwrap()) {
        if block.needs.is_some() {
            continue;
        }
        if let Some(file) = &block.file {
            std::fs::write(dir.path().join(file), block.lines.join("\n") + "\n").unwrap();
            continue;
        }
        for (command, shown) in commands(&block) {
            if !is_ours(&command) {
                println!("{name}:{}: left to .ci/run: {command}", block.line);
                continue;
            }
            let out = run(&command, dir.path());
            let printed = format!("{}{}", String::from_utf8_lossy(&out.stdout), String::from_utf8_lossy(&out.stderr));
            assert_eq!(out.status.code(), Some(block.exit), "{name}:{}: {command}\n{printed}", block.line);
            if let Err(line) = shows(&printed, &shown) {
                panic!("{name}:{}: {command}\ndoes not print: {line}\nbut:\n{printed}", block.line);
            }
        }
    }
}

fn every_link_between_chapters_leads_to_a_file() {
    let mut pages = vec![root().join("README.md"), root().join("ARCHITECTURE.md"), root().join("CONTRIBUTING.md")];
    pages.extend(std::fs::read_dir(root().join("docs")).unwrap().map(|e| e.unwrap().path()));
    pages.retain(|p| p.extension().is_some_and(|e| e == "md"));
    let mut dead = Vec::new();
    for page in pages {
        let text = std::fs::read_to_string(&page).unwrap();
        for link in text.split("](").skip(1).filter_map(|l| l.split(')').next()) {
            let file = link.split('#').next().unwrap_or("");
            let local = !file.is_empty() && !link.contains("://") && !link.contains(' ');
            if local && !page.parent().unwrap().join(file).exists() {
                dead.push(format!("{}: {link}", page.display()));
            }
        }
    }
    assert!(dead.is_empty(), "{dead:#?}");
}

fn every_chapter_stands_in_the_index() {
    let index = std::fs::read_to_string(root().join("docs/README.md")).unwrap();
    for entry in std::fs::read_dir(root().join("docs")).unwrap() {
        let name = entry.unwrap().file_name().to_string_lossy().into_owned();
        if name.ends_with(".md") && name != "README.md" {
            assert!(index.contains(&format!("({name})")), "docs/README.md does not list {name}");
        }
    }
}

fn a_block_that_lies_is_caught() {
    let shown = |lines: &[&str]| lines.iter().map(ToString::to_string).collect::<Vec<_>>();
    assert!(shows("a\nb\nc\n", &shown(&["a", "...", "c"])).is_ok());
    assert!(shows("a\nb\nc\n", &shown(&["c", "a"])).is_err());
    assert!(shows("302 frames (10 s)\n", &shown(&["302 frames ..."])).is_ok());
    let text = "```sh\nboresight a \\\n  b\n# no\n```\n```rust\nx\n```\n```console exit=2\n$ boresight c\nd\n```\n```sh needs=data\ny\n```\n";
    let found = blocks(text);
    assert_eq!(found.len(), 3);
    assert_eq!(commands(&found[0]), [("boresight a b".to_string(), vec![])]);
    assert_eq!(commands(&found[1]), [("boresight c".to_string(), vec!["d".to_string()])]);
    assert!(found[1].exit == 2 && found[2].needs.as_deref() == Some("data"));
}

/// The README and the chapters, in order.
fn chapters() -> Vec<PathBuf> {
    let mut chapters: Vec<PathBuf> =
        std::fs::read_dir(root().join("docs")).unwrap().map(|e| e.unwrap().path()).collect();
    chapters.push(root().join("README.md"));
    chapters.retain(|p| p.extension().is_some_and(|e| e == "md"));
    chapters.sort();
    assert!(chapters.len() > 5, "{chapters:?}");
    chapters
}

/// A test for each chapter, an ignored one for each block that is not run, and those of the pages as a whole.
fn main() -> std::process::ExitCode {
    let test = |name: &str, run: fn()| {
        Trial::test(name, move || {
            run();
            Ok(())
        })
    };
    let mut trials = vec![
        test("every_link_between_chapters_leads_to_a_file", every_link_between_chapters_leads_to_a_file),
        test("every_chapter_stands_in_the_index", every_chapter_stands_in_the_index),
        test("a_block_that_lies_is_caught", a_block_that_lies_is_caught),
    ];
    // The commands stand there for a shell.
    for chapter in chapters().into_iter().filter(|_| cfg!(unix)) {
        let name = chapter.strip_prefix(root()).unwrap().display().to_string();
        for block in blocks(&std::fs::read_to_string(&chapter).unwrap()) {
            if let Some(needs) = block.needs {
                let trial = Trial::test(format!("{name}:{}", block.line), || Ok(()));
                trials.push(trial.with_kind(format!("needs {needs}")).with_ignored_flag(true));
            }
        }
        trials.push(Trial::test(format!("the commands of {name} run"), move || {
            check(&chapter);
            Ok(())
        }));
    }
    libtest_mimic::run(&Arguments::from_args(), trials).exit_code()
}
