//! How wide a Gaussian is.

/// Width at half height in units of the deviation, 2 √(2 ln 2).
pub const WIDTH_PER_DEVIATION: f64 = 2.354_82;
