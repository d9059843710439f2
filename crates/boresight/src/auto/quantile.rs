//! The value that a share of some numbers lies below.

/// Share of normal numbers within one deviation: the magnitude below which this share lies is the deviation of those in the middle.
pub const WITHIN_ONE: f64 = 0.683;

/// The value at that share (0 to 1) of them in their order, the upper one between two; 0 of none.
pub fn quantile(values: &mut [f64], share: f64) -> f64 {
    let at = ((values.len() as f64 * share) as usize).min(values.len().saturating_sub(1));
    if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(at, f64::total_cmp).1 }
}
