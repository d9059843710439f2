//! Chosen values are written with three significant digits: what a person would write.

/// Rounds to three significant digits.
pub fn round(v: f64) -> f64 {
    if v == 0.0 || !v.is_finite() {
        return v;
    }
    let digits = (2.0 - v.abs().log10().floor()).clamp(0.0, 12.0) as usize;
    format!("{v:.digits$}").parse().unwrap_or(v)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_digits_are_left_of_any_size() {
        assert_eq!([1234.5, 0.012345, -9.9999, 0.0].map(round), [1234.0, 0.0123, -10.0, 0.0]);
        assert!(round(f64::NAN).is_nan() && round(f64::INFINITY).is_infinite());
    }
}
