//! Whether a track's innovations are as large as its filter says, in words.
//!
//! The sum of n normalised squares νᵀ S⁻¹ ν of a consistent filter is χ² with 2n degrees of freedom, so their mean lies
//! in [χ²₀.₀₂₅(2n), χ²₀.₉₇₅(2n)]/n in 95 of 100 tracks (Bar-Shalom, Li, Kirubarajan 2001, section 5.4: time-average NIS).
//! Innovations of nearest-neighbour tracks in clutter are a little too small, for the gate cuts their tail.

use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Fewer updates say nothing.
const MIN_UPDATES: u64 = 10;

/// Sum and number of a track's normalised innovation squares.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Nis {
    pub sum: f64,
    pub n: u64,
}

impl Nis {
    pub fn add(&mut self, nis: f64) {
        if nis.is_finite() {
            self.sum += nis;
            self.n += 1;
        }
    }

    pub fn mean(&self) -> Option<f64> {
        (self.n > 0).then(|| self.sum / self.n as f64)
    }

    /// The bounds of the mean that hold in 95 of 100 consistent tracks.
    pub fn bounds(&self) -> Option<(f64, f64)> {
        if self.n < MIN_UPDATES {
            return None;
        }
        let n = self.n as f64;
        if self.n > 5000 {
            // The normal limit: mean 2, variance 4/n; better than 0.1 % here, and quick.
            let half = 1.959_963_984_540_054 * 2.0 / n.sqrt();
            return Some((2.0 - half, 2.0 + half));
        }
        let chi2 = ChiSquared::new(2.0 * n).ok()?;
        Some((chi2.inverse_cdf(0.025) / n, chi2.inverse_cdf(0.975) / n))
    }

    /// The verdict in words.
    pub fn words(&self) -> String {
        let (Some(mean), Some((low, high))) = (self.mean(), self.bounds()) else {
            return match self.n {
                0 => "no update".to_string(),
                1 => "1 update is too little to tell".to_string(),
                n => format!("{n} updates are too few to tell"),
            };
        };
        if mean > high {
            format!("optimistic: the innovations are {:.1} times as large as the filter expects", (mean / 2.0).sqrt())
        } else if mean < low {
            format!("cautious: the innovations are {:.2} times as large as the filter expects", (mean / 2.0).sqrt())
        } else {
            "consistent".to_string()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_are_those_of_the_chi_square_table() {
        let bounds = |n| Nis { sum: 0.0, n }.bounds().unwrap();
        // χ², 20 dof: 9.591 and 34.170; 100 dof: 74.222 and 129.561 (tables in any textbook)
        assert!((bounds(10).0 - 0.9591).abs() < 1e-4 && (bounds(10).1 - 3.4170).abs() < 1e-4);
        assert!((bounds(50).0 - 1.48444).abs() < 1e-4 && (bounds(50).1 - 2.59122).abs() < 1e-4);
        let (exact, limit) = (bounds(5000), bounds(5001));
        assert!((exact.0 - limit.0).abs() < 1e-3 && (exact.1 - limit.1).abs() < 1e-3);
    }

    #[test]
    fn the_verdict_follows_the_mean() {
        let words = |mean: f64, n| Nis { sum: mean * n as f64, n }.words();
        assert_eq!(words(2.0, 100), "consistent");
        assert!(words(8.0, 100).starts_with("optimistic: the innovations are 2.0 times"));
        assert!(words(0.5, 100).starts_with("cautious: the innovations are 0.50 times"));
        assert!(words(2.0, 9).contains("too few"));
    }
}
