//! The two real types of the crate, f64 and f32, behind one name.
//!
//! Every filter is one source, generic over [`Real`]; conversions happen only at the border ([`crate::Tracked`]).

use nalgebra::RealField;

/// A real number type that a filter can compute in: `f64` or `f32`.
pub trait Real: RealField + Copy + Default {
    /// Relative rounding error (distance from 1 to the next number).
    const EPSILON: Self;
    /// Largest finite number.
    const MAX: Self;
    /// 0.
    const ZERO: Self;
    /// 1.
    const ONE: Self;
    /// Returns the nearest number of this type.
    fn of(value: f64) -> Self;
    /// Returns the value as f64.
    fn as_f64(self) -> f64;
}

impl Real for f64 {
    const EPSILON: Self = f64::EPSILON;
    const MAX: Self = f64::MAX;
    const ZERO: Self = 0.0;
    const ONE: Self = 1.0;
    #[inline(always)]
    fn of(value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn as_f64(self) -> f64 {
        self
    }
}

impl Real for f32 {
    const EPSILON: Self = f32::EPSILON;
    const MAX: Self = f32::MAX;
    const ZERO: Self = 0.0;
    const ONE: Self = 1.0;
    #[inline(always)]
    fn of(value: f64) -> Self {
        value as f32
    }
    #[inline(always)]
    fn as_f64(self) -> f64 {
        f64::from(self)
    }
}

/// Whether every entry is an ordinary number: no NaN, no infinity.
#[inline]
pub(crate) fn all_finite<T: Real, const R: usize, const C: usize>(m: &nalgebra::SMatrix<T, R, C>) -> bool {
    // Without a short cut, so that it vectorises: the answer is nearly always yes.
    let mut ok = true;
    for column in &m.data.0 {
        for v in column {
            ok &= v.abs() <= T::MAX;
        }
    }
    ok
}
