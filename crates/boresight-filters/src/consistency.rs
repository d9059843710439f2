//! Is a filter honest? NIS, NEES and whiteness against their chi-square and normal bounds, said in words.
//!
//! Source: Bar-Shalom, Li, Kirubarajan 2001, 5.4. NIS νᵀS⁻¹ν ~ χ²(m), NEES eᵀP⁻¹e ~ χ²(n); sums over K samples ~ χ²(K n).
//! Whiteness: ρ(l) = Σ ν̃_k·ν̃_{k-l} / sqrt(Σ|ν̃_k|² Σ|ν̃_{k-l}|²) with ν̃ whitened by S; 95 % within ±1.96/sqrt(K m).
//! Chi-square quantiles: incomplete gamma by series and continued fraction (M. Abramowitz, I. Stegun, 6.5.29, 6.5.31),
//! then Newton from Wilson-Hilferty. Limits: samples of one run are correlated in NEES: use many runs, or NIS.
//! Symbols: ν innovation m x 1, S its covariance; e error n x 1, P its covariance; K samples. Cost: a factorisation a
//! sample.

use crate::linalg::Cholesky;
use crate::{FilterError, Real};
use core::fmt;
use nalgebra::{SMatrix, SVector};

/// What the errors say about the covariances.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The errors are as large as the covariances say.
    Consistent,
    /// The errors are larger: the covariances are too small.
    OverConfident,
    /// The errors are smaller: the covariances are too large.
    UnderConfident,
    /// No samples yet.
    NoSamples,
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Consistent => "consistent: the errors are as large as the covariances say",
            Self::OverConfident => {
                "over-confident: the errors are larger than the covariances say; raise the process or measurement noise"
            }
            Self::UnderConfident => {
                "under-confident: the errors are smaller than the covariances say; lower the process or measurement noise"
            }
            Self::NoSamples => "unknown: no samples yet",
        })
    }
}

/// Returns eᵀ P⁻¹ e: NEES of an error, NIS of an innovation (no unit).
/// # Errors
/// [`FilterError`] if the covariance cannot be factored or the error is not finite.
pub fn normalized_error2<const N: usize, T: Real>(
    error: &SVector<T, N>,
    cov: &SMatrix<T, N, N>,
) -> Result<T, FilterError> {
    if !crate::real::all_finite(error) {
        return Err(FilterError::NotFinite("the error"));
    }
    let white = Cholesky::new(cov, "the covariance")?.whiten(error);
    Ok(white.dot(&white))
}

/// Running sum of normalised squared errors (NIS or NEES) of `dof` degrees of freedom each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Consistency {
    dof: usize,
    n: usize,
    sum: f64,
}

impl Consistency {
    /// Starts; `dof` is the size of each error vector: 2 for NIS of positions, 4 for NEES of kinematics.
    pub fn new(dof: usize) -> Self {
        Self { dof, n: 0, sum: 0.0 }
    }

    /// Adds one normalised squared error; what is not finite counts as very large.
    pub fn add(&mut self, error2: f64) {
        self.n += 1;
        // Large, but a sum of many stays finite.
        const LARGE: f64 = 1e150;
        self.sum += if error2.is_nan() { LARGE } else { error2.clamp(0.0, LARGE) };
    }

    /// Returns the mean; about `dof` for a consistent filter.
    pub fn mean(&self) -> f64 {
        if self.n == 0 { 0.0 } else { self.sum / self.n as f64 }
    }

    /// Returns how many errors were added.
    pub fn count(&self) -> usize {
        self.n
    }

    /// Returns the interval in which the mean of a consistent filter lies with the given probability.
    /// # Errors
    /// [`FilterError::OutOfRange`] for a probability outside (0, 1) or no samples.
    pub fn bounds(&self, probability: f64) -> Result<(f64, f64), FilterError> {
        if self.n == 0 || self.dof == 0 {
            return Err(FilterError::OutOfRange("at least one sample"));
        }
        let tail = two_sided(probability)?;
        let dof = (self.n * self.dof) as f64;
        Ok((chi2_quantile(tail, dof)? / self.n as f64, chi2_quantile(1.0 - tail, dof)? / self.n as f64))
    }

    /// Returns whether the mean lies in the bounds, and if not on which side.
    /// # Errors
    /// [`FilterError::OutOfRange`] for a probability outside (0, 1).
    pub fn is_consistent(&self, probability: f64) -> Result<Verdict, FilterError> {
        two_sided(probability)?;
        if self.n == 0 {
            return Ok(Verdict::NoSamples);
        }
        let (low, high) = self.bounds(probability)?;
        let mean = self.mean();
        Ok(if mean < low {
            Verdict::UnderConfident
        } else if mean > high {
            Verdict::OverConfident
        } else {
            Verdict::Consistent
        })
    }
}

fn two_sided(probability: f64) -> Result<f64, FilterError> {
    if probability > 0.0 && probability < 1.0 {
        Ok((1.0 - probability) / 2.0)
    } else {
        Err(FilterError::OutOfRange("a probability in (0, 1)"))
    }
}

/// Running autocorrelation of whitened innovations at lags 1..=L: near 0 for a filter whose model fits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Whiteness<const M: usize, const L: usize> {
    past: [SVector<f64, M>; L],
    n: usize,
    product: [f64; L],
    new2: [f64; L],
    old2: [f64; L],
}

impl<const M: usize, const L: usize> Default for Whiteness<M, L> {
    fn default() -> Self {
        Self { past: [SVector::zeros(); L], n: 0, product: [0.0; L], new2: [0.0; L], old2: [0.0; L] }
    }
}

impl<const M: usize, const L: usize> Whiteness<M, L> {
    /// Adds an innovation with its covariance S.
    /// # Errors
    /// [`FilterError`] if S cannot be factored or the innovation is not finite.
    pub fn add(&mut self, innovation: &SVector<f64, M>, s: &SMatrix<f64, M, M>) -> Result<(), FilterError> {
        if !crate::real::all_finite(innovation) {
            return Err(FilterError::NotFinite("the innovation"));
        }
        let white = Cholesky::new(s, "the innovation covariance")?.whiten(innovation);
        for lag in 0..L.min(self.n) {
            let old = &self.past[lag];
            self.product[lag] += white.dot(old);
            self.new2[lag] += white.norm_squared();
            self.old2[lag] += old.norm_squared();
        }
        if L > 0 {
            self.past.rotate_right(1);
            self.past[0] = white;
        }
        self.n += 1;
        Ok(())
    }

    /// Returns ρ(1) … ρ(L), each in -1..=1; 0 where there are no pairs yet.
    pub fn autocorrelation(&self) -> [f64; L] {
        core::array::from_fn(|l| {
            let scale = libm::sqrt(self.new2[l] * self.old2[l]);
            if scale > 0.0 { self.product[l] / scale } else { 0.0 }
        })
    }

    /// Returns the bound that |ρ(lag)| of a white sequence keeps with 95 % probability; lag counts from 1.
    pub fn bound(&self, lag: usize) -> f64 {
        let pairs = self.n.saturating_sub(lag) * M;
        // 97.5 % quantile of the normal distribution.
        if pairs == 0 { 1.0 } else { 1.959_963_984_540_054 / libm::sqrt(pairs as f64) }
    }
}

/// Returns P(χ² <= x) with `dof` degrees of freedom.
pub fn chi2_cdf(x: f64, dof: f64) -> f64 {
    if !(x > 0.0) {
        return 0.0;
    }
    gamma_p(dof / 2.0, x / 2.0)
}

/// Returns the x with P(χ² <= x) = probability.
/// # Errors
/// [`FilterError::OutOfRange`] for a probability outside (0, 1) or `dof` not above 0.
pub fn chi2_quantile(probability: f64, dof: f64) -> Result<f64, FilterError> {
    if !(probability > 0.0 && probability < 1.0) {
        return Err(FilterError::OutOfRange("a probability in (0, 1)"));
    }
    if !(dof > 0.0 && dof <= 1e12) {
        return Err(FilterError::OutOfRange("degrees of freedom above 0 and at most 1e12"));
    }
    // Bracket by doubling from Wilson-Hilferty, then Newton kept inside the bracket.
    let z = normal_quantile(probability);
    let c = 2.0 / (9.0 * dof);
    let guess = dof * libm::pow(1.0 - c + z * libm::sqrt(c), 3.0);
    let mut x = if guess > 0.0 { guess } else { dof * 1e-3 };
    let (mut low, mut high) = (0.0, f64::MAX);
    for _ in 0..200 {
        let f = chi2_cdf(x, dof) - probability;
        if f > 0.0 {
            high = x;
        } else {
            low = x;
        }
        let k = dof / 2.0;
        let slope = libm::exp((k - 1.0) * libm::log(x / 2.0) - x / 2.0 - libm::lgamma(k)) / 2.0;
        let mut next = x - f / slope;
        if !(next > low && next < high) {
            next = if high < f64::MAX { 0.5 * (low + high) } else { x * 2.0 };
        }
        if (next - x).abs() <= 1e-14 * x {
            return Ok(next);
        }
        x = next;
    }
    Ok(x)
}

/// Normal quantile, good to 5e-4: a start for Newton (Abramowitz, Stegun, 26.2.23).
fn normal_quantile(p: f64) -> f64 {
    let tail = p.min(1.0 - p);
    let t = libm::sqrt(-2.0 * libm::log(tail));
    let z = t - (2.515517 + t * (0.802853 + t * 0.010328)) / (1.0 + t * (1.432788 + t * (0.189269 + t * 0.001308)));
    if p < 0.5 { -z } else { z }
}

/// Regularised lower incomplete gamma function P(a, x).
fn gamma_p(a: f64, x: f64) -> f64 {
    let front = libm::exp(a * libm::log(x) - x - libm::lgamma(a));
    // Terms needed grow like sqrt(a) near x = a.
    let terms = 200 + (12.0 * libm::sqrt(a)) as usize;
    if x < a + 1.0 {
        let mut term = 1.0 / a;
        let mut sum = term;
        for k in 1..terms {
            term *= x / (a + k as f64);
            sum += term;
            if term < sum * 1e-17 {
                break;
            }
        }
        (front * sum).min(1.0)
    } else {
        // Lentz's evaluation of the continued fraction.
        let mut b = x + 1.0 - a;
        let mut c = 1e300;
        let mut d = 1.0 / b;
        let mut h = d;
        for k in 1..terms {
            let an = -(k as f64) * (k as f64 - a);
            b += 2.0;
            d = 1.0 / nonzero(an * d + b);
            c = nonzero(b + an / c);
            let delta = d * c;
            h *= delta;
            if (delta - 1.0).abs() < 1e-16 {
                break;
            }
        }
        (1.0 - front * h).max(0.0)
    }
}

fn nonzero(v: f64) -> f64 {
    if v.abs() < 1e-300 { 1e-300 } else { v }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Vector2};

    #[test]
    fn quantiles_are_those_of_the_tables() {
        // NIST/SEMATECH e-Handbook of Statistical Methods, 1.3.6.7.4, and χ²(2) = -2 ln(1 - p).
        for (p, dof, want) in [(0.95, 1.0, 3.841), (0.99, 4.0, 13.277), (0.975, 10.0, 20.483), (0.025, 100.0, 74.222)] {
            assert!((chi2_quantile(p, dof).unwrap() - want).abs() < 6e-4, "{p} {dof}");
        }
        for p in [1e-6, 0.5, 0.99, 0.999999] {
            assert!((chi2_quantile(p, 2.0).unwrap() + 2.0 * libm::log(1.0 - p)).abs() < 1e-9);
        }
        for dof in [0.5, 3.0, 400.0, 8000.0, 2e6] {
            let x = chi2_quantile(0.995, dof).unwrap();
            assert!((chi2_cdf(x, dof) - 0.995).abs() < 1e-9, "{dof}");
        }
    }

    #[test]
    fn the_start_of_the_quantiles_is_as_good_as_it_says() {
        for (p, z) in [(0.975, 1.959_964), (0.025, -1.959_964), (0.5, 0.0), (0.999, 3.090_232), (0.1, -1.281_552)] {
            assert!((normal_quantile(p) - z).abs() < 5e-4, "{p}: {}", normal_quantile(p));
        }
    }

    #[test]
    fn each_verdict_is_reached_and_said_in_words() {
        for (value, want) in [(2.0, Verdict::Consistent), (3.0, Verdict::OverConfident), (1.0, Verdict::UnderConfident)]
        {
            let mut c = Consistency::new(2);
            for _ in 0..200 {
                c.add(value);
            }
            assert_eq!(c.is_consistent(0.95).unwrap(), want);
        }
        assert_eq!(Consistency::new(2).is_consistent(0.95).unwrap(), Verdict::NoSamples);
        let mut nan = Consistency::new(2);
        nan.add(f64::NAN);
        assert_eq!(nan.is_consistent(0.95).unwrap(), Verdict::OverConfident);
    }

    #[test]
    fn a_repeated_innovation_is_not_white() {
        let mut w = Whiteness::<2, 3>::default();
        for k in 0..50 {
            let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
            w.add(&(Vector2::new(1.0, 2.0) * sign), &Matrix2::identity()).unwrap();
        }
        let r = w.autocorrelation();
        assert!((r[0] + 1.0).abs() < 1e-12 && (r[1] - 1.0).abs() < 1e-12);
        assert!(r[0].abs() > w.bound(1));
    }
}
