//! One file of golden vectors; read by the integration tests, and by the tests of parts that are not public.

use serde_json::Value;
use std::path::PathBuf;

/// One file of golden vectors: its tolerances and its cases.
pub struct Golden {
    pub rel_tol: f64,
    pub abs_tol: f64,
    pub cases: Vec<Value>,
}

/// The repository's folder of golden vectors.
pub fn repository_folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../golden")
}

/// Reads `NAME.json`.
pub fn load(name: &str) -> Golden {
    let folder = std::env::var_os("BORESIGHT_GOLDEN").map_or_else(repository_folder, PathBuf::from);
    let path = folder.join(format!("{name}.json"));
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("golden vectors {}: {e}", path.display()));
    let v: Value = serde_json::from_str(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let cases = v["cases"].as_array().expect("cases").clone();
    assert!(!cases.is_empty(), "{name}: no cases");
    Golden { rel_tol: v["rel_tol"].as_f64().expect("rel_tol"), abs_tol: v["abs_tol"].as_f64().expect("abs_tol"), cases }
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
