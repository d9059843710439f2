//! Reader of the golden vectors (`golden/README.md`) and the comparison they prescribe: |a - b| <= abs_tol + rel_tol
//! |b|.
//!
//! The folder is the repository's `golden/`; `BORESIGHT_GOLDEN` names another of the same form. A missing file fails.

mod adaptive;
mod bounds;
mod fuzzy;
mod linear;
mod pda;
mod srif;

use nalgebra::{SMatrix, SVector};
use serde_json::Value;
use std::path::PathBuf;

/// Calls a function generic over two sizes with the sizes of a case.
macro_rules! by_size {
    ($a:expr, $b:expr, $f:ident $args:tt) => {
        $crate::golden::by_size!(@rows $a, $b, $f, $args, [2 3 4 5 6])
    };
    (@rows $a:expr, $b:expr, $f:ident, $args:tt, [$($n:literal)*]) => {
        match $a {
            $($n => match $b {
                1 => $f::<$n, 1> $args,
                2 => $f::<$n, 2> $args,
                3 => $f::<$n, 3> $args,
                4 => $f::<$n, 4> $args,
                5 => $f::<$n, 5> $args,
                6 => $f::<$n, 6> $args,
                other => panic!("add size {other} to by_size"),
            },)*
            other => panic!("add size {other} to by_size"),
        }
    };
}
pub(crate) use by_size;

/// Number of rows of a matrix or entries of a list.
pub fn rows(v: &Value) -> usize {
    v.as_array().unwrap().len()
}

/// Number of columns of a matrix.
pub fn columns(v: &Value) -> usize {
    rows(&v[0])
}

/// One file of golden vectors.
pub struct Golden {
    name: &'static str,
    rel_tol: f64,
    abs_tol: f64,
    pub cases: Vec<(Value, Value)>,
}

/// Reads `NAME.json`.
pub fn golden(name: &'static str) -> Golden {
    let folder = std::env::var_os("BORESIGHT_GOLDEN")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../golden"), PathBuf::from);
    let path = folder.join(format!("{name}.json"));
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("golden vectors {}: {e}", path.display()));
    let v: Value = serde_json::from_str(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let cases: Vec<_> =
        v["cases"].as_array().unwrap().iter().map(|c| (c["inputs"].clone(), c["outputs"].clone())).collect();
    assert!(!cases.is_empty(), "{name} has no cases");
    Golden { name, rel_tol: num(&v["rel_tol"]), abs_tol: num(&v["abs_tol"]), cases }
}

/// Reads a number; the strings "inf", "-inf" and "nan" stand for what JSON cannot write.
pub fn num(v: &Value) -> f64 {
    match v {
        Value::String(s) => s.parse().unwrap(),
        _ => v.as_f64().unwrap_or_else(|| panic!("not a number: {v}")),
    }
}

/// Reads a list of numbers.
pub fn list(v: &Value) -> Vec<f64> {
    v.as_array().unwrap().iter().map(num).collect()
}

/// Reads a vector.
pub fn vector<const N: usize>(v: &Value) -> SVector<f64, N> {
    SVector::from_column_slice(&list(v))
}

/// Reads a matrix written by rows.
pub fn matrix<const R: usize, const C: usize>(v: &Value) -> SMatrix<f64, R, C> {
    let rows: Vec<f64> = v.as_array().unwrap().iter().flat_map(list).collect();
    SMatrix::from_row_slice(&rows)
}

impl Golden {
    /// Compares one number.
    #[track_caller]
    pub fn close(&self, case: usize, what: &str, got: f64, want: f64) {
        let same = got == want || (got.is_nan() && want.is_nan());
        assert!(
            same || (got - want).abs() <= self.abs_tol + self.rel_tol * want.abs(),
            "{} case {case}: {what} is {got:e}, expected {want:e}",
            self.name
        );
    }

    /// Compares a matrix or vector with the expected value.
    #[track_caller]
    pub fn same<const R: usize, const C: usize>(
        &self,
        case: usize,
        what: &str,
        got: &SMatrix<f64, R, C>,
        want: &Value,
    ) {
        let want: SMatrix<f64, R, C> =
            if want[0].is_array() { matrix(want) } else { SMatrix::from_column_slice(&list(want)) };
        for r in 0..R {
            for c in 0..C {
                self.close(case, &format!("{what}[{r}][{c}]"), got[(r, c)], want[(r, c)]);
            }
        }
    }
}
