//! Kalman filter in covariance form: Joseph update (default) or short form.
//!
//! Source: SPEC D.1. P^ = (I - K H) P~ (I - K H)ᵀ + K R Kᵀ (Joseph), or P~ - K H P~ (short).
//! Differs from it: H selects two states, so its products are picks; S is inverted in closed form (2 x 2).
//! Symbols: x N x 1; P N x N; z, ν 2 x 1 (px); S, R 2 x 2 (px²); K N x 2.
//! Limits: in f32 with P0/R of 1e12 both forms lose all digits (SPEC E-D7): take [`crate::Ud`] or [`crate::Srif`].
//! With a nonlinear model this is the extended Kalman filter: Phi is the Jacobian at the state.
//! Cost: N = 4, constant velocity: about 60 flops to predict, 130 to correct (Joseph).

use crate::filter::{check_belief, check_dt, check_measurement, position_of};
use crate::linalg::{halves_apart, invert_pair};
use crate::mixture::{joseph, mixture_update};
use crate::model::Model;
use crate::real::all_finite;
use crate::{FilterError, Gaussian, GaussianFilter, Measurement, Real, Start, Weighted};
use nalgebra::{SMatrix, Vector2};

/// Which form of the covariance update is used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
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
    belief: Gaussian<N, T>,
    form: CovarianceForm,
    /// The axes are uncorrelated and the model keeps them so: half the work.
    apart: bool,
}

impl<M: Model<N, T>, const N: usize, T: Real> Kf<M, N, T> {
    /// Returns the filter with another form of the covariance update.
    #[must_use]
    pub fn with_form(mut self, form: CovarianceForm) -> Self {
        self.form = form;
        self
    }
}

impl<M: Model<N, T>, const N: usize, T: Real> Start<M, N> for Kf<M, N, T> {
    fn start(model: M, belief: Gaussian<N, T>) -> Result<Self, FilterError> {
        check_belief(&belief)?;
        crate::linalg::ud_factorize(&belief.cov)?;
        let apart = M::AXES && halves_apart(&belief.cov);
        Ok(Self { model, belief, form: CovarianceForm::Joseph, apart })
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

    #[inline]
    fn predict(&mut self, dt_s: T) -> Result<(), FilterError> {
        check_dt(dt_s)?;
        if dt_s == T::zero() {
            return Ok(());
        }
        let mut next = self.belief;
        if self.apart {
            self.model.propagate_apart(dt_s, &mut next.mean, &mut next.cov);
        } else {
            self.model.propagate(dt_s, &mut next.mean, &mut next.cov);
        }
        // The variances bound the covariances of a positive definite P, so these are enough for what can overflow here.
        let mut fine = true;
        for i in 0..N {
            fine &= (next.mean[i].abs() <= T::MAX) & (next.cov[(i, i)] <= T::MAX);
        }
        if !fine {
            return Err(FilterError::NotFinite("the result of the step"));
        }
        self.belief = next;
        Ok(())
    }

    #[inline]
    fn correct(&mut self, m: &Measurement<T>) -> Result<(), FilterError> {
        check_measurement(m)?;
        if self.apart && m.cov[(1, 0)] == T::zero() && self.form == CovarianceForm::Joseph {
            return self.correct_apart(m);
        }
        let at = M::POSITION;
        let prior = position_of(&self.belief, at);
        let s = invert_pair(&(prior.cov + m.cov), "the innovation covariance")?;
        let p = &self.belief.cov;
        let mut k = SMatrix::<T, N, 2>::zeros();
        for i in 0..N {
            let (p0, p1) = (p[(i, at[0])], p[(i, at[1])]);
            k[(i, 0)] = p0 * s.inverse[(0, 0)] + p1 * s.inverse[(1, 0)];
            k[(i, 1)] = p0 * s.inverse[(1, 0)] + p1 * s.inverse[(1, 1)];
        }
        let innovation: Vector2<T> = m.position - prior.mean;
        let mut next = self.belief;
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
        self.accept(next)?;
        self.apart = self.apart && m.cov[(1, 0)] == T::zero();
        Ok(())
    }

    fn correct_weighted<I>(&mut self, hypotheses: I) -> Result<(), FilterError>
    where
        I: Iterator<Item = Weighted<T>> + Clone,
    {
        let next = mixture_update(&self.belief, M::POSITION, hypotheses)?;
        self.accept(next)?;
        self.apart = M::AXES && halves_apart(&self.belief.cov);
        Ok(())
    }

    #[inline]
    fn belief(&self) -> Gaussian<N, T> {
        self.belief
    }

    fn set_belief(&mut self, belief: &Gaussian<N, T>) -> Result<(), FilterError> {
        check_belief(belief)?;
        self.belief = *belief;
        self.apart = M::AXES && halves_apart(&belief.cov);
        Ok(())
    }

    #[inline]
    fn position_at(&self) -> [usize; 2] {
        M::POSITION
    }

    #[inline]
    fn kinematics(&self) -> Gaussian<4, T> {
        self.model.kinematics(&self.belief)
    }

    #[inline]
    fn predicted(&self) -> Gaussian<2, T> {
        position_of(&self.belief, M::POSITION)
    }
}

impl<M: Model<N, T>, const N: usize, T: Real> Kf<M, N, T> {
    /// The Joseph update of two uncorrelated axes, each measured by one number: N/2 states at a time.
    #[inline(always)]
    fn correct_apart(&mut self, m: &Measurement<T>) -> Result<(), FilterError> {
        let half = N / 2;
        let mut next = self.belief;
        let p = &self.belief.cov;
        let mut fine = true;
        for axis in 0..2 {
            let (from, to, at, r) = (axis * half, axis * half + half, M::POSITION[axis], m.cov[(axis, axis)]);
            let s = p[(at, at)] + r;
            let inv = T::one() / s;
            fine &= s > T::zero() && inv <= T::MAX;
            let nu = m.position[axis] - self.belief.mean[at];
            let mut k = [T::zero(); N];
            for i in from..to {
                k[i] = p[(i, at)] * inv;
                next.mean[i] += k[i] * nu;
                fine &= next.mean[i].abs() <= T::MAX;
            }
            for j in from..to {
                for i in from..=j {
                    // (I - K H) P (I - K H)ᵀ + K R Kᵀ, the upper half only.
                    let a = p[(i, j)] - k[i] * p[(at, j)];
                    let b = (p[(i, at)] - k[i] * p[(at, at)]) - k[i] * r;
                    let v = a - b * k[j];
                    next.cov[(i, j)] = v;
                    next.cov[(j, i)] = v;
                    fine &= v.abs() <= T::MAX;
                }
            }
        }
        if !fine {
            return Err(FilterError::NotPositiveDefinite("the innovation covariance"));
        }
        self.belief = next;
        Ok(())
    }

    /// Takes a new belief unless a sum overflowed.
    #[inline(always)]
    fn accept(&mut self, next: Gaussian<N, T>) -> Result<(), FilterError> {
        if !(all_finite(&next.mean) & all_finite(&next.cov)) {
            return Err(FilterError::NotFinite("the result of the step"));
        }
        self.belief = next;
        Ok(())
    }
}
