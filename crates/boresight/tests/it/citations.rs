//! What code and chapters cite is in the repository: chapters of `docs/theory`, links between Markdown files, no private codes.

use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// All files with one of these endings, but for what is built.
fn files(dir: &Path, endings: &[&str], out: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(dir).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() {
            if name != "target" && !name.starts_with('.') && !name.ends_with(".tracks") {
                files(&path, endings, out);
            }
        } else if endings.iter().any(|e| name.ends_with(e)) {
            out.push(path);
        }
    }
}

/// Every Rust and Markdown file with its text; not this one, which names what it forbids.
fn texts() -> Vec<(PathBuf, String)> {
    let mut paths = Vec::new();
    files(&root(), &[".rs", ".md"], &mut paths);
    paths.retain(|p| !p.ends_with("it/citations.rs"));
    paths.sort();
    assert!(paths.len() > 100, "the repository is not around the crate");
    paths.into_iter().map(|p| (p.clone(), std::fs::read_to_string(&p).unwrap())).collect()
}

/// Words of a line: letters, digits, hyphens.
fn words(line: &str) -> impl Iterator<Item = &str> {
    line.split(|c: char| !c.is_alphanumeric() && c != '-').filter(|w| !w.is_empty())
}

/// A code that only those know who have the papers' analysis beside them: a document D0, an erratum E-D5, a reading R-DS3.
fn is_private_code(word: &str) -> bool {
    let all = |s: &str, f: fn(&char) -> bool| !s.is_empty() && s.chars().all(|c| f(&c));
    match word.split_once('-') {
        Some(("E", rest)) => {
            rest.starts_with(|c: char| c.is_ascii_uppercase())
                && rest.len() > 1
                && all(&rest[1..], char::is_ascii_digit)
        }
        Some(("R", rest)) => {
            rest.len() > 1 && all(rest, |c| c.is_ascii_uppercase() || c.is_ascii_digit()) && rest != "CNN"
        }
        _ => word == "SPEC",
    }
}

#[test]
fn nothing_is_cited_by_a_private_code() {
    let mut wrong = Vec::new();
    for (path, text) in texts() {
        for (n, line) in text.lines().enumerate() {
            // D0 to D4 are names of matrices elsewhere; as documents they stand before what is cited of them.
            let of_a_document = (0..5).any(|d| {
                ["Table", "Figure", "eq", "§", "Fig"].iter().any(|what| line.contains(&format!("D{d} {what}")))
            });
            if of_a_document || words(line).any(is_private_code) {
                wrong.push(format!("{}:{}: {}", path.display(), n + 1, line.trim()));
            }
        }
    }
    assert!(wrong.is_empty(), "cite docs/theory or the literature instead:\n{}", wrong.join("\n"));
}

#[test]
fn private_codes_are_told_from_words() {
    for code in ["SPEC", "E-D5", "E-H7", "R-DS3", "R-COORD"] {
        assert!(is_private_code(code), "{code}");
    }
    for word in ["E-mail", "R-CNN", "D0", "SPECIAL", "specification", "E", "MOT17-02", "R-tree"] {
        assert!(!is_private_code(word), "{word}");
    }
}

#[test]
fn every_chapter_that_is_cited_exists() {
    let (mut wrong, mut n_cited) = (Vec::new(), 0);
    for (path, text) in texts() {
        for (at, _) in text.match_indices("docs/") {
            let cited: String =
                text[at..].chars().take_while(|c| c.is_ascii_alphanumeric() || "/-_.".contains(*c)).collect();
            let cited = cited.trim_end_matches('.');
            // Relative links are the next test's.
            if !cited.ends_with(".md") || text[..at].ends_with(['/', '.']) {
                continue;
            }
            n_cited += 1;
            if !root().join(cited).is_file() {
                wrong.push(format!("{} cites {cited}", path.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "chapters that are not there:\n{}", wrong.join("\n"));
    assert!(n_cited > 50, "only {n_cited} citations seen");
}

#[test]
fn every_source_file_that_a_text_names_exists() {
    let texts = texts();
    let (mut wrong, mut n_named) = (Vec::new(), 0);
    for (path, text) in texts.iter().filter(|(p, _)| p.extension().is_some_and(|e| e == "md")) {
        let quoted = text.split('`').skip(1).step_by(2);
        for name in quoted.filter(|q| q.ends_with(".rs") && !q.contains([' ', '*', '{', '\n'])) {
            n_named += 1;
            // This file is not among the texts.
            if !texts.iter().any(|(p, _)| p.ends_with(name)) && !name.ends_with("it/citations.rs") {
                wrong.push(format!("{} names {name}", path.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "files that are not there:\n{}", wrong.join("\n"));
    assert!(n_named > 50, "only {n_named} names seen");
}

#[test]
fn every_script_that_is_named_exists() {
    let (mut paths, mut n_named) = (Vec::new(), 0);
    files(&root(), &[".rs", ".md", ".json", ".py"], &mut paths);
    paths.retain(|p| !p.ends_with("it/citations.rs"));
    let mut wrong = Vec::new();
    for path in paths {
        let text = std::fs::read_to_string(&path).unwrap();
        for (at, _) in text.match_indices("scripts/").filter(|(at, _)| !text[..*at].ends_with(['/', '.'])) {
            let is_of_path = |c: &char| c.is_ascii_alphanumeric() || "/-_.".contains(*c);
            let named: String = text[at..].chars().take_while(is_of_path).collect();
            n_named += 1;
            if !root().join(named.trim_end_matches('.')).exists() {
                wrong.push(format!("{} names {named}", path.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "scripts that are not there:\n{}", wrong.join("\n"));
    assert!(n_named > 10, "only {n_named} names seen");
}

/// The anchor that a heading gets on GitHub.
fn anchor(heading: &str) -> String {
    // A link in a heading counts with its text only.
    let mut text = String::new();
    let mut rest = heading;
    while let Some((before, after)) = rest.split_once("](") {
        text += before;
        rest = after.split_once(')').map_or("", |(_, tail)| tail);
    }
    text += rest;
    let kept = text.trim().to_lowercase();
    kept.chars()
        .filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'))
        .map(|c| if c == ' ' { '-' } else { c })
        .collect()
}

/// Targets of the links of a Markdown text, without what stands in code.
fn links(text: &str) -> Vec<&str> {
    let (mut out, mut code) = (Vec::new(), false);
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            code = !code;
        } else if !code {
            for (at, _) in line.match_indices("](") {
                out.extend(line[at + 2..].split([')', ' ']).next());
            }
        }
    }
    out
}

#[test]
fn every_link_between_files_leads_somewhere() {
    let (mut wrong, mut n_links) = (Vec::new(), 0);
    for (path, text) in texts().into_iter().filter(|(p, _)| p.extension().is_some_and(|e| e == "md")) {
        for link in links(&text).into_iter().filter(|l| !l.contains("://") && !l.starts_with("mailto:")) {
            n_links += 1;
            let (file, heading) = link.split_once('#').unwrap_or((link, ""));
            let target = if file.is_empty() { path.clone() } else { path.parent().unwrap().join(file) };
            let found = target.exists()
                && (heading.is_empty()
                    || target.extension().is_none_or(|e| e != "md")
                    || std::fs::read_to_string(&target)
                        .unwrap()
                        .lines()
                        .filter_map(|l| l.strip_prefix('#'))
                        .any(|l| anchor(l.trim_start_matches('#')) == heading));
            if !found {
                wrong.push(format!("{}: {link}", path.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "dead links:\n{}", wrong.join("\n"));
    assert!(n_links > 100, "only {n_links} links seen");
}

#[test]
fn the_index_of_the_theory_names_every_chapter() {
    let dir = root().join("docs/theory");
    let index = std::fs::read_to_string(dir.join("README.md")).unwrap();
    for entry in std::fs::read_dir(&dir).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        assert!(
            name == "README.md" || index.contains(&format!("]({name})")),
            "docs/theory/README.md leaves out {name}"
        );
    }
}
