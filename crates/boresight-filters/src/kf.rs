//! Kalman filter in covariance form: Joseph update (default) or short form.
//!
//! Source: `docs/theory/filters.md`. P^ = (I - K H) P~ (I - K H)ᵀ + K R Kᵀ (Joseph), or P~ - K H P~ (short).
//! Differs from it: H selects two states, so its products are picks; S is inverted in closed form (2 x 2).
//! Symbols: x N x 1; P N x N; z, ν 2 x 1 (px); S, R 2 x 2 (px²); K N x 2.
//! Limits: in f32 with P0/R of 1e12 both forms lose all digits: take [`crate::Ud`] or [`crate::Srif`].
//! Two uncorrelated axes are filtered apart, side by side in vector registers (`pack_axes`), until a full R or a PDA update
//! couples them. With a nonlinear model this is the extended Kalman filter: Phi is the Jacobian at the state.
//! Cost: N = 4, constant velocity: about 60 flops to predict, 130 to correct (Joseph).

use crate::axes::{halves_apart, pack_axes, unpack_axes};
use crate::check::{check_belief, check_dt, check_measurement};
use crate::gaussian::position_of;
use crate::linalg::invert_pair;
use crate::mixture::{joseph, mixture_update};
use crate::model::Model;
use crate::real::all_finite;
use crate::{FilterError, Gaussian, GaussianFilter, Measurement, Real, Start, Weighted};
use nalgebra::{Matrix2, SMatrix, Vector2};

/// Which form of the covariance update is used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum CovarianceForm {
    /// (I - K H) P (I - K H)ᵀ + K R Kᵀ: positive semi-definite for any gain.
    #[default]
    Joseph,
    /// P - K H P: fewer operations, loses symmetry and definiteness to rounding sooner.
    Short,
}

/// Kalman filter of a model with N states.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kf<M, const N: usize, T: Real = f64> {
    model: M,
    /// As it is, or with its axes side by side if they are apart.
    held: Gaussian<N, T>,
    form: CovarianceForm,
    /// The axes are uncorrelated and the model keeps them so: half the work.
    apart: bool,
}

impl<M: Model<N, T>, const N: usize, T: Real> Kf<M, N, T> {
    /// Returns the filter with another form of the covariance update.
    #[must_use]
    pub fn with_form(mut self, form: CovarianceForm) -> Self {
        let belief = self.belief();
        self.form = form;
        self.hold(belief);
        self
    }
}

impl<M: Model<N, T>, const N: usize, T: Real> Start<M, N> for Kf<M, N, T> {
    fn start(model: M, belief: Gaussian<N, T>) -> Result<Self, FilterError> {
        check_belief(&belief)?;
        crate::linalg::ud_factorize(&belief.cov)?;
        let mut filter = Self { model, held: belief, form: CovarianceForm::Joseph, apart: false };
        filter.hold(belief);
        Ok(filter)
    }

    fn model(&self) -> &M {
        &self.model
    }

    fn model_mut(&mut self) -> &mut M {
        &mut self.model
    }
}

impl<M: Model<N, T>, const N: usize, T: Real> GaussianFilter<N> for Kf<M, N, T> {
    type Real = T;

    #[inline(always)]
    fn predict(&mut self, dt_s: T) -> Result<(), FilterError> {
        check_dt(dt_s)?;
        if dt_s == T::zero() {
            return Ok(());
        }
        if !self.apart {
            return self.predict_coupled(dt_s);
        }
        let mut next = self.held;
        self.model.propagate_axes(dt_s, &mut next.mean, &mut next.cov);
        // What an overflow leaves of 0; the variances bound the covariances of a positive definite P.
        let mut rest = T::zero();
        for i in 0..N {
            rest += next.mean[i] * T::zero() + next.cov[(i, i / 2)] * T::zero();
        }
        if rest != T::zero() {
            return Err(FilterError::NotFinite("the result of the step"));
        }
        self.held = next;
        Ok(())
    }

    #[inline(always)]
    fn correct(&mut self, m: &Measurement<T>) -> Result<(), FilterError> {
        check_measurement(m)?;
        if self.apart && m.cov[(1, 0)] == T::zero() {
            return self.correct_apart(m);
        }
        self.correct_coupled(m)
    }

    fn correct_weighted<I>(&mut self, hypotheses: I) -> Result<(), FilterError>
    where
        I: Iterator<Item = Weighted<T>> + Clone,
    {
        let next = mixture_update(&self.belief(), M::POSITION, hypotheses)?;
        check_finite(&next)?;
        self.hold(next);
        Ok(())
    }

    #[inline]
    fn belief(&self) -> Gaussian<N, T> {
        if self.apart { unpack_axes(&self.held) } else { self.held }
    }

    fn set_belief(&mut self, belief: &Gaussian<N, T>) -> Result<(), FilterError> {
        check_belief(belief)?;
        self.hold(*belief);
        Ok(())
    }

    #[inline]
    fn position_at(&self) -> [usize; 2] {
        M::POSITION
    }

    #[inline]
    fn kinematics(&self) -> Gaussian<4, T> {
        self.model.kinematics(&self.belief())
    }

    #[inline]
    fn predicted(&self) -> Gaussian<2, T> {
        if !self.apart {
            return position_of(&self.held, M::POSITION);
        }
        let at = M::POSITION[0];
        let (m, p, zero) = (&self.held.mean, &self.held.cov, T::zero());
        Gaussian {
            mean: Vector2::new(m[2 * at], m[2 * at + 1]),
            cov: Matrix2::new(p[(2 * at, at)], zero, zero, p[(2 * at + 1, at)]),
        }
    }
}

impl<M: Model<N, T>, const N: usize, T: Real> Kf<M, N, T> {
    /// The Joseph update of two uncorrelated axes, each measured by one number: N/2 states at a time, both axes in step.
    #[inline(always)]
    fn correct_apart(&mut self, m: &Measurement<T>) -> Result<(), FilterError> {
        let (half, at) = (N / 2, M::POSITION[0]);
        let (x, p, r) = (&self.held.mean, &self.held.cov, [m.cov[(0, 0)], m.cov[(1, 1)]]);
        let entry = |i: usize, j: usize, axis: usize| p[(2 * i.min(j) + axis, i.max(j))];
        let mut next = self.held;
        let mut k = [[T::zero(); 2]; N];
        let mut nu = [T::zero(); 2];
        let mut rest = [T::zero(); 2];
        for axis in 0..2 {
            let inv = T::one() / (entry(at, at, axis) + r[axis]);
            nu[axis] = m.position[axis] - x[2 * at + axis];
            for i in 0..half {
                k[i][axis] = entry(i, at, axis) * inv;
            }
        }
        for i in 0..half {
            for axis in 0..2 {
                let v = x[2 * i + axis] + k[i][axis] * nu[axis];
                next.mean[2 * i + axis] = v;
                rest[axis] += v * T::zero();
            }
        }
        for j in 0..half {
            for i in 0..=j {
                for axis in 0..2 {
                    // (I - K H) P (I - K H)ᵀ + K R Kᵀ, the upper half only.
                    let (ki, kj) = (k[i][axis], k[j][axis]);
                    let a = entry(i, j, axis) - ki * entry(at, j, axis);
                    let b = (entry(i, at, axis) - ki * entry(at, at, axis)) - ki * r[axis];
                    let v = a - b * kj;
                    next.cov[(2 * i + axis, j)] = v;
                    rest[axis] += v * T::zero();
                }
            }
        }
        // S = 0 makes a gain, an overflow a sum that is not finite: times 0 it is NaN.
        if rest[0] + rest[1] != T::zero() {
            return Err(FilterError::NotPositiveDefinite("the innovation covariance"));
        }
        self.held = next;
        Ok(())
    }

    #[inline(never)]
    fn predict_coupled(&mut self, dt_s: T) -> Result<(), FilterError> {
        let mut next = self.held;
        self.model.propagate(dt_s, &mut next.mean, &mut next.cov);
        let mut rest = T::zero();
        for i in 0..N {
            rest += next.mean[i] * T::zero() + next.cov[(i, i)] * T::zero();
        }
        if rest != T::zero() {
            return Err(FilterError::NotFinite("the result of the step"));
        }
        self.held = next;
        Ok(())
    }

    /// The update of a full covariance. Out of line: the apart path stays small enough to be inlined into a loop.
    #[inline(never)]
    fn correct_coupled(&mut self, m: &Measurement<T>) -> Result<(), FilterError> {
        let at = M::POSITION;
        let belief = self.belief();
        let prior = position_of(&belief, at);
        let s = invert_pair(&(prior.cov + m.cov), "the innovation covariance")?;
        let p = &belief.cov;
        let mut k = SMatrix::<T, N, 2>::zeros();
        for i in 0..N {
            let (p0, p1) = (p[(i, at[0])], p[(i, at[1])]);
            k[(i, 0)] = p0 * s.inverse[(0, 0)] + p1 * s.inverse[(1, 0)];
            k[(i, 1)] = p0 * s.inverse[(1, 0)] + p1 * s.inverse[(1, 1)];
        }
        let innovation: Vector2<T> = m.position - prior.mean;
        let mut next = belief;
        for i in 0..N {
            next.mean[i] += k[(i, 0)] * innovation[0] + k[(i, 1)] * innovation[1];
        }
        match self.form {
            CovarianceForm::Joseph => {
                next.cov = joseph(p, at, &k, &m.cov);
            }
            CovarianceForm::Short => {
                for c in 0..N {
                    let (h0, h1) = (p[(at[0], c)], p[(at[1], c)]);
                    for i in 0..N {
                        next.cov[(i, c)] -= k[(i, 0)] * h0 + k[(i, 1)] * h1;
                    }
                }
            }
        }
        check_finite(&next)?;
        (self.held, self.apart) = (next, false);
        Ok(())
    }

    /// Takes a belief, its axes side by side if they may stay apart.
    #[inline(always)]
    fn hold(&mut self, belief: Gaussian<N, T>) {
        self.apart = M::AXES && self.form == CovarianceForm::Joseph && halves_apart(&belief.cov);
        self.held = if self.apart { pack_axes(&belief) } else { belief };
    }
}

/// Refuses a belief whose sums overflowed.
#[inline(always)]
fn check_finite<T: Real, const N: usize>(next: &Gaussian<N, T>) -> Result<(), FilterError> {
    if all_finite(&next.mean) & all_finite(&next.cov) {
        Ok(())
    } else {
        Err(FilterError::NotFinite("the result of the step"))
    }
}
