//! The parameter reference: every table and key of the configuration as Markdown, from the meanings written beside them.
//!
//! `cargo xtask docs` writes it to `docs/parameters.md`; a test fails when that file is out of date.

use super::schema_tree::{children, describe, is_choice, resolve};
use super::whole::schema;
use serde_json::Value;
use std::fmt::Write;

/// Writes the reference of all parameters, as Markdown.
///
/// ```
/// assert!(boresight::config::reference().contains("`gate-probability`"));
/// ```
pub fn reference() -> String {
    let root = schema();
    let mut out = String::from(
        "# Parameters\n\nEvery table and key of the configuration. Made by `cargo xtask docs` from the comments in the code; do not edit.\n\n\
         A key with *choices* takes one of the names below it: `clutter = \"given\"` where the name stands alone, or a table\n\
         `[tracker.filter.form.imm]` where it has parameters of its own. *none* means that the key may be left out, *needed* that it must stand where its table does.\n",
    );
    for (name, child) in children(&root, &root) {
        match is_choice(&root, &child) {
            true => choice(&mut out, &root, &name, &child),
            false => table(&mut out, &root, &name, &child),
        }
    }
    out
}

/// A table, or a choice with parameters: its keys, then the tables inside of it.
fn table(out: &mut String, root: &Value, path: &str, at: &Value) {
    let entries = children(root, at);
    let _ = writeln!(out, "\n## `[{path}]`\n\n{}\n", describe(root, at));
    if entries.is_empty() {
        let _ = writeln!(out, "No parameters.");
        return;
    }
    let (mut inner, mut choices) = (Vec::new(), Vec::new());
    let _ = writeln!(out, "| key | default | meaning |\n| --- | --- | --- |");
    for (name, child) in entries {
        let key = format!("{path}.{name}");
        let named = if is_choice(root, &child) {
            choices.push((key.clone(), child.clone()));
            format!("[`{name}`](#{})", anchor(&key))
        } else if !children(root, &child).is_empty() && !is_list(root, &child) {
            inner.push((key.clone(), child.clone()));
            format!("[`[{name}]`](#{})", anchor(&key))
        } else {
            format!("`{name}`")
        };
        let default = if is_needed(root, at, &name) { "*needed*".to_string() } else { default(&child) };
        let _ = writeln!(out, "| {named} | {default} | {} |", cell(&describe(root, &child)));
    }
    for (key, child) in choices {
        choice(out, root, &key, &child);
    }
    for (key, child) in inner {
        table(out, root, &key, &child);
    }
}

/// A key that takes one of several names.
fn choice(out: &mut String, root: &Value, path: &str, at: &Value) {
    let _ = writeln!(out, "\n## `{path}`\n\n{} *Choices:*\n", describe(root, at));
    let _ = writeln!(out, "| name | meaning |\n| --- | --- |");
    let mut inner = Vec::new();
    for (name, child) in children(root, at) {
        let key = format!("{path}.{name}");
        let named = if children(root, &child).is_empty() {
            format!("`{name}`")
        } else {
            let named = format!("[`{name}`](#{})", anchor(&key));
            inner.push((key, child.clone()));
            named
        };
        let _ = writeln!(out, "| {named} | {} |", cell(&describe(root, &child)));
    }
    for (key, child) in inner {
        table(out, root, &key, &child);
    }
}

fn is_list(root: &Value, at: &Value) -> bool {
    resolve(root, at).get("items").is_some()
}

/// Whether a key must stand where its table does.
fn is_needed(root: &Value, table: &Value, name: &str) -> bool {
    let needed = resolve(root, table).get("required").and_then(Value::as_array);
    needed.is_some_and(|names| names.iter().any(|n| n == name))
}

/// The default as it stands in a file; of a choice only the name.
fn default(at: &Value) -> String {
    match at.get("default") {
        None | Some(Value::Null) => "*none*".to_string(),
        Some(Value::Object(o)) if o.len() == 1 => o.keys().map(|k| format!("`{k}`")).collect(),
        Some(Value::Object(_)) => String::new(),
        Some(v) => format!("`{v}`"),
    }
}

fn cell(text: &str) -> String {
    text.replace('|', "\\|")
}

/// The anchor that a Markdown page gives to a heading: lower case, no dots and brackets.
fn anchor(heading: &str) -> String {
    heading.chars().filter(|c| c.is_alphanumeric() || *c == '-').flat_map(char::to_lowercase).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_link_of_the_reference_leads_to_a_heading() {
        let text = reference();
        let headings: Vec<String> = text.lines().filter_map(|l| l.strip_prefix("## ")).map(anchor).collect();
        let links: Vec<&str> = text.split("](#").skip(1).filter_map(|l| l.split(')').next()).collect();
        assert!(links.len() > 30, "{}", links.len());
        let dead: Vec<_> = links.iter().filter(|l| !headings.iter().any(|h| h == *l)).collect();
        assert!(dead.is_empty(), "{dead:?}");
    }

    #[test]
    fn defaults_have_the_digits_that_stand_in_the_code() {
        let text = reference();
        assert!(text.contains("| `low-score` | `0.1` |"), "{text}");
        let digits = |cell: &str| cell.chars().filter(char::is_ascii_digit).count();
        // Lists are of thirds, in double precision.
        let defaults =
            text.lines().filter_map(|l| l.split(" | ").nth(1)).filter(|c| c.contains('.') && !c.contains('['));
        let long: Vec<&str> = defaults.clone().filter(|c| digits(c) > 12).collect();
        assert!(defaults.count() > 50 && long.is_empty(), "{long:?}");
    }

    #[test]
    fn keys_stand_with_default_and_meaning() {
        let text = reference();
        let row = text.lines().find(|l| l.starts_with("| `gate-probability`")).expect("a row");
        assert!(row.contains("`0.99`") && row.contains("gate"), "{row}");
        assert!(text.contains("## `tracker.filter.form`") && text.contains("## `[tracker.filter.form.imm]`"));
    }
}
