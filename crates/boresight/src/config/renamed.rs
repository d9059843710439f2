//! Keys of the configuration that have a new name: an old one is refused with the new one named.
//!
//! Applied to the tree of a file and of `--set`, before the keys are read. A row also covers the keys below it: with
//! `tracker.birth` -> `tracker.initiation` the error of `tracker.birth.two-point` names `tracker.initiation.two-point`.

use crate::{Error, ErrorKind, Result};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Old dotted key, new dotted key. Where one old key begins like another the longer one counts.
pub(super) const RENAMED: &[(&str, &str)] = &[
    ("tracker.life", "tracker.confirmation"),
    ("tracker.life.score", "tracker.confirmation.sprt"),
    ("tracker.life.score.birth-density-per-px2", "tracker.confirmation.sprt.new-target-density-per-px2"),
    ("tracker.life.score.max-drop", "tracker.confirmation.sprt.max-score-drop"),
    ("tracker.life.existence.birth-density-per-px2", "tracker.confirmation.existence.new-target-density-per-px2"),
    ("tracker.life.existence.doubt-probability", "tracker.confirmation.existence.demotion-probability"),
    ("tracker.life.existence.mean-life-s", "tracker.confirmation.existence.mean-target-lifetime-s"),
    ("tracker.proof", "tracker.motion-test"),
    ("tracker.proof.start-score", "tracker.min-initiation-score"),
    ("tracker.proof.sure-score", "tracker.motion-test"),
    ("tracker.proof.sure-travel-px", "tracker.motion-test"),
    ("tracker.proof.camera-share", "tracker.motion-test.parallax-share"),
    ("tracker.proof.hits-in-a-row", "tracker.motion-test"),
    ("tracker.proof.travel-px", "tracker.report"),
    ("tracker.confirmation-gate", "tracker.motion-test"),
    ("tracker.confirmation-gate.min-travel-px", "tracker.report"),
    ("tracker.confirmation-gate.camera-travel-share", "tracker.motion-test.parallax-share"),
    ("tracker.birth", "tracker.initiation"),
    ("tracker.cues", "tracker.initial-tracks"),
    ("tracker.terms", "tracker.association-cost"),
    ("tracker.terms.overlap.least", "tracker.association-cost.overlap.min-overlap"),
    ("tracker.look-gain", "tracker.appearance-gain"),
    ("tracker.extra-noise-of-size", "tracker.extra-noise-per-height"),
    ("tracker.acceleration-of-size-per-s2", "tracker.acceleration-per-height-per-s2"),
    ("tracker.sharing", "tracker.merged-measurements"),
    ("tracker.sharing.longest-s", "tracker.merged-measurements.max-secondary-s"),
    ("tracker.mht.birth-density-per-px2", "tracker.mht.new-target-density-per-px2"),
    ("tracker.mht.max-gap", "tracker.mht.max-score-gap"),
    ("tracker.filter.kf", "tracker.filter.form.kf"),
    ("tracker.filter.kf.model", "tracker.filter.model"),
    ("tracker.filter.kf.innovation", "tracker.filter.innovation"),
    ("tracker.filter.kf.adaptive", "tracker.filter.adaptive"),
    ("tracker.filter.kf-short", "tracker.filter.form.kf-short"),
    ("tracker.filter.kf-short.model", "tracker.filter.model"),
    ("tracker.filter.kf-short.innovation", "tracker.filter.innovation"),
    ("tracker.filter.kf-short.adaptive", "tracker.filter.adaptive"),
    ("tracker.filter.ud", "tracker.filter.form.ud"),
    ("tracker.filter.ud.model", "tracker.filter.model"),
    ("tracker.filter.ud.innovation", "tracker.filter.innovation"),
    ("tracker.filter.ud.adaptive", "tracker.filter.adaptive"),
    ("tracker.filter.srif", "tracker.filter.form.srif"),
    ("tracker.filter.srif.model", "tracker.filter.model"),
    ("tracker.filter.srif.innovation", "tracker.filter.innovation"),
    ("tracker.filter.srif.adaptive", "tracker.filter.adaptive"),
    ("tracker.filter.information", "tracker.filter.form.information"),
    ("tracker.filter.information.model", "tracker.filter.model"),
    ("tracker.filter.information.innovation", "tracker.filter.innovation"),
    ("tracker.filter.information.adaptive", "tracker.filter.adaptive"),
    ("tracker.filter.square-root", "tracker.filter.form.square-root"),
    ("tracker.filter.square-root.model", "tracker.filter.model"),
    ("tracker.filter.square-root.innovation", "tracker.filter.innovation"),
    ("tracker.filter.square-root.adaptive", "tracker.filter.adaptive"),
    ("tracker.filter.ekf", "tracker.filter.model.nearly-constant-turn"),
    ("tracker.filter.ekf.model", "tracker.filter.model"),
    ("tracker.filter.ekf.innovation", "tracker.filter.innovation"),
    ("tracker.filter.ekf.adaptive", "tracker.filter.adaptive"),
    ("tracker.filter.ukf", "tracker.filter.form.ukf"),
    ("tracker.filter.ukf.model", "tracker.filter.model"),
    ("tracker.filter.ukf.innovation", "tracker.filter.innovation"),
    ("tracker.filter.ukf.adaptive", "tracker.filter.adaptive"),
    ("tracker.filter.fuzzy-srif", "tracker.filter.form.srif"),
    ("tracker.filter.fuzzy-srif.model", "tracker.filter.model"),
    ("tracker.filter.fuzzy-srif.correlator", "tracker.filter.innovation.fuzzy"),
    ("tracker.filter.huber", "tracker.filter.innovation.huber"),
    ("tracker.filter.student-t", "tracker.filter.innovation.student-t"),
    ("tracker.filter.constant-acceleration", "tracker.filter.model.constant-acceleration"),
    ("tracker.filter.singer", "tracker.filter.model.singer"),
    ("tracker.filter.imm", "tracker.filter.form.imm"),
    ("tracker.filter.lms", "tracker.filter.form.lms"),
    ("tracker.filter.ar1", "tracker.filter.form.ar1"),
    ("tracker.filter.displacement", "tracker.filter.form.displacement"),
];

/// The new name of a key, if a part of it has one.
pub(super) fn new_name(key: &str) -> Option<String> {
    RENAMED
        .iter()
        .filter_map(|(old, new)| {
            let rest = key.strip_prefix(old).filter(|rest| rest.is_empty() || rest.starts_with('.'))?;
            Some((old.len(), format!("{new}{rest}")))
        })
        .max_by_key(|(length, _)| *length)
        .map(|(_, new)| new)
}

/// Refuses a file that holds an old key; a text that is not TOML passes, its reader says so better.
/// # Errors
/// The first old key of the file, with its line.
pub(super) fn refuse_in_file(text: &str, name: &str) -> Result<()> {
    let Ok(tree) = DeTable::parse(text) else { return Ok(()) };
    match first_old(tree.get_ref(), "") {
        None => Ok(()),
        Some((at, old, new)) => {
            let before = text.get(..at).unwrap_or("");
            let line = before.matches('\n').count() + 1;
            let column = before.chars().rev().take_while(|c| *c != '\n').count() + 1;
            Err(error(&old, &new, &format!("line {line}, column {column}: ")).at(name))
        }
    }
}

/// Refuses an assignment `key = value` whose key, or a key inside of whose value, is an old one.
/// # Errors
/// The old key.
pub(super) fn refuse_in_assignment(key: &str, value: &toml::Value) -> Result<()> {
    if let Some(new) = new_name(key) {
        return Err(error(key, &new, ""));
    }
    match value {
        toml::Value::Table(table) => table.iter().try_for_each(|(k, v)| refuse_in_assignment(&format!("{key}.{k}"), v)),
        toml::Value::Array(list) => list.iter().try_for_each(|v| refuse_in_assignment(key, v)),
        _ => Ok(()),
    }
}

fn error(old: &str, new: &str, place: &str) -> Error {
    Error::new(ErrorKind::Config, format!("{place}`{old}` has a new name: `{new}`"))
        .hint(format!("write `{new}`; `boresight config --explain {new}` says what it does"))
}

/// Byte, old and new name of the first old key of a table.
fn first_old(table: &DeTable<'_>, path: &str) -> Option<(usize, String, String)> {
    table
        .iter()
        .filter_map(|(key, value)| {
            let dotted = format!("{path}{}", key.get_ref());
            if let Some(new) = new_name(&dotted) {
                let inner = first_inner(value, &dotted);
                return inner.or(Some((key.span().start, dotted, new)));
            }
            first_inner(value, &dotted)
        })
        .min_by_key(|(at, _, _)| *at)
}

fn first_inner(value: &Spanned<DeValue<'_>>, dotted: &str) -> Option<(usize, String, String)> {
    match value.get_ref() {
        DeValue::Table(table) => first_old(table, &format!("{dotted}.")),
        DeValue::Array(list) => list.iter().filter_map(|v| first_inner(v, dotted)).min_by_key(|(at, _, _)| *at),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Config;
    use crate::config::explain;

    #[test]
    fn every_old_key_is_refused_and_its_error_names_a_key_that_there_is() {
        for (old, new) in RENAMED {
            explain(new).unwrap_or_else(|e| panic!("{new}: {e}"));
            assert!(explain(old).is_err(), "{old} still exists");
            let (table, key) = old.rsplit_once('.').unwrap();
            let e = Config::from_toml(&format!("[{table}]\n{key} = 1\n"), "my.toml").unwrap_err().to_string();
            assert!(e.starts_with("my.toml: line 2, column 1: ") && e.contains(&format!("`{new}`")), "{e}");
            for value in ["1", "{}"] {
                let e = Config::default().with(&format!("{old}={value}")).unwrap_err().to_string();
                assert!(e.starts_with("--set") && e.contains(&format!("`{old}` has a new name: `{new}`")), "{e}");
            }
        }
    }
}
