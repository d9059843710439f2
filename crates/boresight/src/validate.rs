//! Checks of configured values: a value out of range becomes an error with place, value, expectation and mend.
//!
//! A leaf: every room's configuration uses it. `at` is the place in the configuration (`tracker`), `key` the key as it stands
//! in a file (`gate-probability`), `mend` a value that usually suits.

use crate::{Error, ErrorKind, Result};
use std::fmt::{Debug, Display};

/// The error of a value: `at.key = value: expected what`, with a hint.
pub(crate) fn wrong(at: &str, key: &str, value: impl Display, expected: &str, mend: &str) -> Error {
    Error::new(ErrorKind::Config, format!("expected {expected}")).at(format!("{at}.{key} = {value}")).hint(mend)
}

/// Refuses a value unless `ok`.
pub(crate) fn check(ok: bool, at: &str, key: &str, value: impl Display, expected: &str, mend: &str) -> Result<()> {
    if ok { Ok(()) } else { Err(wrong(at, key, value, expected, mend)) }
}

/// Refuses a value unless `ok`, shown as in code (lists, texts); for values that have no usual mend.
pub(crate) fn check_shown(ok: bool, at: &str, key: &str, value: &dyn Debug, expected: &str) -> Result<()> {
    if ok {
        return Ok(());
    }
    Err(Error::new(ErrorKind::Config, format!("expected {expected}")).at(format!("{at}.{key} = {value:?}")))
}

/// Refuses what is not a finite number above 0.
pub(crate) fn positive(at: &str, key: &str, value: f64, mend: &str) -> Result<()> {
    check(value > 0.0 && value.is_finite(), at, key, value, "a number above 0", mend)
}

/// Refuses what is not a finite number of 0 or more.
pub(crate) fn not_negative(at: &str, key: &str, value: f64, mend: &str) -> Result<()> {
    check(value >= 0.0 && value.is_finite(), at, key, value, "a number of 0 or more", mend)
}

/// Refuses what is not a number strictly between 0 and 1.
pub(crate) fn probability(at: &str, key: &str, value: f64, mend: &str) -> Result<()> {
    check(value > 0.0 && value < 1.0, at, key, value, "a probability in (0, 1)", mend)
}

/// Refuses a count of 0.
pub(crate) fn at_least_one(at: &str, key: &str, value: u32) -> Result<()> {
    check(value >= 1, at, key, value, "a whole number of 1 or more", "leave it out for the default")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_names_place_value_expectation_and_mend() {
        let e = positive("tracker", "coast-s", -1.5, "half a second").unwrap_err().to_string();
        assert_eq!(e, "tracker.coast-s = -1.5: expected a number above 0\nhint: half a second");
        let e = check_shown(false, "scene", "size", &[1, 2], "two equal numbers").unwrap_err().to_string();
        assert_eq!(e, "scene.size = [1, 2]: expected two equal numbers");
    }

    #[test]
    fn ranges_are_closed_and_open_where_they_say_so() {
        let taken = |f: fn(&str, &str, f64, &str) -> Result<()>| {
            [-0.1, 0.0, 0.5, 1.0, 2.0, f64::INFINITY, f64::NAN].map(|v| f("a", "b", v, "c").is_ok())
        };
        assert_eq!(taken(positive), [false, false, true, true, true, false, false]);
        assert_eq!(taken(not_negative), [false, true, true, true, true, false, false]);
        assert_eq!(taken(probability), [false, false, true, false, false, false, false]);
        assert!(at_least_one("a", "b", 0).is_err() && at_least_one("a", "b", 1).is_ok());
    }
}
