//! Whether what a fit leaves is the noise that was stated.
//!
//! X² = Σ (d - m)² / V has the mean ν (pixels less parameters) and the variance 2ν + Σ g³ (m - o) / V², the last from the kurtosis of light. The chance
//! of as much or more is that of a gamma distribution of these two moments, by E. B. Wilson and M. M. Hilferty's cube root (Proc. Natl. Acad.
//! Sci. 17, 684 (1931)), which is within 5 % down to 1e-3 from 20 degrees of freedom on.

/// How well a model explains the pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Goodness {
    /// X², the squared residuals in units of their variances.
    pub chi2: f64,
    /// Degrees of freedom ν.
    pub dof: f64,
    /// The chance that the stated noise leaves as much or more, 0..=1: small for a poor fit.
    pub p: f64,
}

impl Goodness {
    /// From X², the degrees of freedom, and what light's kurtosis adds to the variance of X².
    pub(super) fn of(chi2: f64, dof: f64, kurtosis: f64) -> Self {
        let spread = (1.0 + 0.5 * kurtosis / dof).max(1.0);
        let (x, k) = (chi2 / spread, dof / spread);
        let c = 2.0 / (9.0 * k);
        let z = ((x / k).cbrt() - (1.0 - c)) / c.sqrt();
        let p = 0.5 * libm::erfc(z * std::f64::consts::FRAC_1_SQRT_2);
        Self { chi2, dof, p: if p.is_finite() { p.clamp(0.0, 1.0) } else { 0.0 } }
    }

    /// X² / ν: 1 where the noise is the one stated.
    pub fn per_dof(&self) -> f64 {
        self.chi2 / self.dof
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_chance_is_that_of_the_chi_square_distribution() {
        // Abramowitz & Stegun, table 26.8: upper points of chi-square.
        for (dof, chi2, p) in [
            (20.0, 31.410, 0.05),
            (20.0, 45.315, 0.001),
            (60.0, 60.0 - 0.665, 0.5),
            (60.0, 79.082, 0.05),
            (60.0, 99.607, 0.001),
            (100.0, 149.449, 0.001),
        ] {
            let found = Goodness::of(chi2, dof, 0.0).p;
            assert!((found / p - 1.0).abs() < 0.05, "{dof} {chi2}: {found} {p}");
        }
        assert_eq!(Goodness::of(1e9, 70.0, 0.0).p, 0.0);
        assert_eq!(Goodness::of(f64::NAN, 70.0, 0.0).p, 0.0);
    }
}
