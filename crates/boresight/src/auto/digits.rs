//! Chosen values are written with three significant digits: what a person would write.

/// Rounds to three significant digits.
pub fn round(v: f64) -> f64 {
    if v == 0.0 || !v.is_finite() {
        return v;
    }
    // Whole numbers stay whole, as far as one reads them.
    let text = if (1000.0..1e6).contains(&v.abs()) { format!("{v:.0}") } else { format!("{v:.2e}") };
    text.parse().unwrap_or(v)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_digits_are_left_of_any_size() {
        assert_eq!([1234.5, 0.012345, -9.9999, 0.0].map(round), [1234.0, 0.0123, -10.0, 0.0]);
        assert_eq!([1.23456e-13, 9.8765e-300, 1.23456e12].map(round), [1.23e-13, 9.88e-300, 1.23e12]);
        assert!(round(f64::NAN).is_nan() && round(f64::INFINITY).is_infinite());
    }
}
