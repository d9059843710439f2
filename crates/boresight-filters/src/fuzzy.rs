//! The fuzzy-logic correlator: a map of innovation and its difference to a corrected innovation.
//!
//! Source: `docs/theory/adaptive.md`; Parimala and Raol give only the inputs, the derivative and the name. Per axis
//! u1 = ν/(k_e σ), u2 = (ν - ν_last)/(k_d σ), σ = sqrt(S_ii), both clipped to -1..1; output r = k_o σ · infer(u1, u2).
//! Zero-order Takagi-Sugeno, product AND. Memberships and rule base are data ([`Correlator`] has public fields).
//! Differs from it: the output is divided by the sum of the weights, which is 1 for the default memberships, so that
//! memberships that do not sum to 1 still give an average of their rules.
//! With ν = ν_last the default is the identity up to |ν| = 2σ and saturates there: a robust innovation.
//! Cost: 14 memberships and 49 rules an axis, about 100 flops.
//! Symbols: ν px; σ px; u1, u2, output no unit. Limits: seven sets an input; zero-order consequents.

use crate::{FilterError, Real};

/// Number of fuzzy sets of each input: LN, MN, SN, ZE, SP, MP, LP.
pub const SETS: usize = 7;

/// A triangular membership: 0 at `left`, 1 at `peak`, 0 at `right`, in -1..1 units of the input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle<T = f64> {
    /// Where the left side starts.
    pub left: T,
    /// Where it is 1.
    pub peak: T,
    /// Where the right side ends.
    pub right: T,
}

impl<T: Real> Triangle<T> {
    /// Returns the degree of membership, 0..=1.
    #[inline]
    pub fn degree(&self, u: T) -> T {
        let side = if u <= self.peak {
            let width = self.peak - self.left;
            if width > T::zero() { (u - self.left) / width } else { T::one() }
        } else {
            let width = self.right - self.peak;
            if width > T::zero() { (self.right - u) / width } else { T::zero() }
        };
        side.max(T::zero()).min(T::one())
    }
}

/// Memberships, rules and scales of the correlator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Correlator<T = f64> {
    /// Sets of the scaled innovation u1, ascending.
    pub innovation_sets: [Triangle<T>; SETS],
    /// Sets of the scaled difference u2, ascending.
    pub difference_sets: [Triangle<T>; SETS],
    /// Output of each rule, -1..=1: rows by the innovation's set, columns by the difference's.
    pub rules: [[T; SETS]; SETS],
    /// k_e: innovation, in standard deviations, that fills u1.
    pub innovation_scale: T,
    /// k_d: difference, in standard deviations, that fills u2. Smaller makes the difference count more.
    pub difference_scale: T,
    /// k_o: standard deviations of a full output.
    pub output_scale: T,
}

/// The rule base of `docs/theory/adaptive.md` in thirds: LN = -3 … LP = 3.
const RULES: [[i8; SETS]; SETS] = [
    [-3, -3, -2, -2, -2, -1, 0],
    [-3, -2, -2, -2, -1, 0, 1],
    [-2, -2, -2, -1, 0, 1, 2],
    [-2, -2, -1, 0, 1, 2, 2],
    [-2, -1, 0, 1, 2, 2, 2],
    [-1, 0, 1, 2, 2, 2, 3],
    [0, 1, 2, 2, 2, 3, 3],
];

impl<T: Real> Default for Correlator<T> {
    fn default() -> Self {
        let third = |k: i32| T::of(f64::from(k) / 3.0);
        let mut sets = [Triangle { left: T::zero(), peak: T::zero(), right: T::zero() }; SETS];
        for (k, s) in (-3..).zip(sets.iter_mut()) {
            *s = Triangle { left: third(k - 1), peak: third(k), right: third(k + 1) };
        }
        Self {
            innovation_sets: sets,
            difference_sets: sets,
            rules: RULES.map(|row| row.map(|c| third(i32::from(c)))),
            innovation_scale: T::of(3.0),
            difference_scale: T::of(12.0),
            output_scale: T::of(3.0),
        }
    }
}

impl<T: Real> Correlator<T> {
    /// Checks that the scales are positive, the rules finite and the sets ascending without gaps over -1..=1.
    /// # Errors
    /// [`FilterError::OutOfRange`] that says what was expected.
    pub fn validate(&self) -> Result<(), FilterError> {
        for s in [self.innovation_scale, self.difference_scale, self.output_scale] {
            if !(s > T::zero() && s <= T::MAX) {
                return Err(FilterError::OutOfRange("correlator scales above 0"));
            }
        }
        if !self.rules.iter().flatten().all(|c| c.abs() <= T::MAX) {
            return Err(FilterError::OutOfRange("finite rule outputs"));
        }
        for sets in [&self.innovation_sets, &self.difference_sets] {
            let ordered = sets.iter().all(|s| s.left <= s.peak && s.peak <= s.right && s.left.abs() <= T::MAX)
                && sets.iter().all(|s| s.right.abs() <= T::MAX);
            let joined = sets.windows(2).all(|w| w[0].peak <= w[1].peak && w[1].left < w[0].right);
            let covers = sets[0].degree(-T::one()) > T::zero() && sets[SETS - 1].degree(T::one()) > T::zero();
            if !(ordered && joined && covers) {
                return Err(FilterError::OutOfRange("fuzzy sets in ascending order that overlap and cover -1..=1"));
            }
        }
        Ok(())
    }

    /// Returns the degrees of membership of an input clipped to -1..=1.
    #[inline]
    pub fn degrees(sets: &[Triangle<T>; SETS], u: T) -> [T; SETS] {
        let u = u.max(-T::one()).min(T::one());
        sets.map(|s| s.degree(u))
    }

    /// Returns the inferred output, -1..=1 for rules in that range.
    ///
    /// The worked example of `docs/theory/adaptive.md`:
    /// ```
    /// use boresight_filters::fuzzy::Correlator;
    /// let c = Correlator::default();
    /// for (u1, u2, out) in [(0.1, 0.0, 0.1), (0.5, 0.2, 0.6), (-0.9, 0.4, -0.5), (1.3, -1.3, 0.0_f64)] {
    ///     assert!((c.infer(u1, u2) - out).abs() < 1e-12);
    /// }
    /// ```
    #[inline]
    pub fn infer(&self, u1: T, u2: T) -> T {
        let m1 = Self::degrees(&self.innovation_sets, u1);
        let m2 = Self::degrees(&self.difference_sets, u2);
        let (mut sum, mut weight) = (T::zero(), T::zero());
        for (a, row) in m1.iter().zip(&self.rules) {
            if *a == T::zero() {
                continue;
            }
            for (b, c) in m2.iter().zip(row) {
                sum += *a * *b * *c;
                weight += *a * *b;
            }
        }
        if weight > T::zero() { sum / weight } else { T::zero() }
    }

    /// Returns the corrected innovation of one axis; `difference` is ν - ν_last, `std` is sqrt(S_ii).
    #[inline]
    pub fn correct(&self, innovation: T, difference: T, std: T) -> T {
        let u1 = innovation / (self.innovation_scale * std);
        let u2 = difference / (self.difference_scale * std);
        self.output_scale * std * self.infer(u1, u2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_a_difference_it_is_the_identity_up_to_two_sigma() {
        let c = Correlator::default();
        for (nu, want) in [(0.3, 0.3), (-1.7, -1.7), (1.99, 1.99), (2.5, 2.0), (-50.0, -3.0)] {
            let got: f64 = c.correct(nu, 0.0, 1.0);
            if nu.abs() <= 2.0 {
                assert!((got - want).abs() < 1e-12, "{nu}: {got}");
            } else {
                assert!((got.abs() - 2.0).abs() < 1e-12, "{nu}: {got}");
            }
        }
    }

    #[test]
    fn sets_with_a_gap_and_scales_of_zero_are_refused() {
        let mut c = Correlator::<f64>::default();
        assert!(c.validate().is_ok());
        c.innovation_sets[3].right = 0.0;
        assert!(c.validate().is_err());
        let d = Correlator { output_scale: 0.0, ..Correlator::<f64>::default() };
        assert!(d.validate().is_err());
    }
}
