//! Golden vectors, read from the folder named by `BORESIGHT_GOLDEN` (default `../shared/spec/golden` beside the repository).
//! One submodule a room; each reads its own files with [`cases`].

mod fuse;
mod sim;
mod spatial;
mod track;
mod track_metrics;
mod vision;

use serde_json::Value;
use std::path::PathBuf;

/// One file of golden vectors: its tolerances and its cases.
pub struct Golden {
    pub rel_tol: f64,
    pub abs_tol: f64,
    pub cases: Vec<Value>,
}

/// The folder of the golden vectors.
pub fn folder() -> PathBuf {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..");
    std::env::var_os("BORESIGHT_GOLDEN").map_or_else(|| root.join("../shared/spec/golden"), PathBuf::from)
}

/// Reads `NAME.json`; prints that the test is skipped and returns `None` where the file is missing.
pub fn load(name: &str) -> Option<Golden> {
    let path = folder().join(format!("{name}.json"));
    let Ok(text) = std::fs::read_to_string(&path) else {
        println!("skipped: golden vectors {} are not here (set BORESIGHT_GOLDEN)", path.display());
        return None;
    };
    let v: Value = serde_json::from_str(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let cases = v["cases"].as_array().expect("cases").clone();
    assert!(!cases.is_empty(), "{name}: no cases");
    Some(Golden {
        rel_tol: v["rel_tol"].as_f64().expect("rel_tol"),
        abs_tol: v["abs_tol"].as_f64().expect("abs_tol"),
        cases,
    })
}

/// A number of a golden file; non-finite values are the strings "inf", "-inf", "nan".
pub fn number(v: &Value) -> f64 {
    match v {
        Value::String(s) => s.parse().expect("a number"),
        _ => v.as_f64().unwrap_or_else(|| panic!("expected a number, found {v}")),
    }
}

/// A list of numbers.
pub fn numbers(v: &Value) -> Vec<f64> {
    v.as_array().unwrap_or_else(|| panic!("expected a list, found {v}")).iter().map(number).collect()
}

/// A list of rows of numbers.
pub fn rows(v: &Value) -> Vec<Vec<f64>> {
    v.as_array().unwrap_or_else(|| panic!("expected rows, found {v}")).iter().map(numbers).collect()
}

impl Golden {
    /// Asserts |a - b| <= abs_tol + rel_tol |b|.
    #[track_caller]
    pub fn close(&self, ours: f64, golden: f64, what: &str) {
        let same = ours == golden || (ours.is_nan() && golden.is_nan());
        assert!(
            same || (ours - golden).abs() <= self.abs_tol + self.rel_tol * golden.abs(),
            "{what}: {ours} instead of {golden}"
        );
    }

    /// Asserts that two lists agree.
    #[track_caller]
    pub fn all_close(&self, ours: &[f64], golden: &[f64], what: &str) {
        assert_eq!(ours.len(), golden.len(), "{what}: length");
        for (i, (a, b)) in ours.iter().zip(golden).enumerate() {
            self.close(*a, *b, &format!("{what}[{i}]"));
        }
    }
}
