//! Information filter: keeps Y = P⁻¹ and y = Y x; measurements add, so many sensors per scan cost little.
//!
//! Source: P. S. Maybeck, *Stochastic Models, Estimation, and Control* 1, 1979, 5.7. Time update with M = Phi⁻ᵀ Y Phi⁻¹
//! and A = G L: Y~ = M - M A (I + Aᵀ M A)⁻¹ Aᵀ M, so Q may be singular.
//! Symbols: info N x N (px⁻²); y N x 1; A N x W root of the process noise.
//! Limits: the difference in the time update cancels where process noise dwarfs the prior: [`crate::Srif`] keeps twice
//! the digits. The measurement covariance must be positive definite. Cost: about 4 N³ flops per predict, 8 per correct,
//! N³ to read the belief.

use crate::check::{check_belief, check_dt, check_measurement};
use crate::linalg::{Cholesky, invert_pair, mul, symmetrize};
use crate::model::{Model, NoiseVisitor};
use crate::real::all_finite;
use crate::{FilterError, Gaussian, GaussianFilter, Measurement, Real, Start};
use nalgebra::{SMatrix, SVector};

/// Information filter of a model with N states.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Information<M, const N: usize, T: Real = f64> {
    model: M,
    info: SMatrix<T, N, N>,
    y: SVector<T, N>,
}

fn to_information<const N: usize, T: Real>(
    b: &Gaussian<N, T>,
) -> Result<(SMatrix<T, N, N>, SVector<T, N>), FilterError> {
    check_belief(b)?;
    let chol = Cholesky::new(&b.cov, "the state covariance")?;
    let mut info = chol.solve(&SMatrix::identity());
    symmetrize(&mut info);
    Ok((info, chol.solve(&b.mean)))
}

impl<M: Model<N, T>, const N: usize, T: Real> Information<M, N, T> {
    /// Returns the information matrix P⁻¹.
    pub fn information(&self) -> &SMatrix<T, N, N> {
        &self.info
    }

    fn accept(&mut self, info: SMatrix<T, N, N>, y: SVector<T, N>) -> Result<(), FilterError> {
        if !(all_finite(&info) & all_finite(&y)) {
            return Err(FilterError::NotFinite("the result of the step"));
        }
        // What cannot be read back as a belief must not become the state.
        Cholesky::new(&info, "the information matrix")?;
        self.info = info;
        self.y = y;
        Ok(())
    }
}

impl<M: Model<N, T>, const N: usize, T: Real> Start<M, N> for Information<M, N, T> {
    fn start(model: M, belief: Gaussian<N, T>) -> Result<Self, FilterError> {
        let (info, y) = to_information(&belief)?;
        Ok(Self { model, info, y })
    }
    fn model(&self) -> &M {
        &self.model
    }
    fn model_mut(&mut self) -> &mut M {
        &mut self.model
    }
}

struct TimeUpdate<const N: usize, T> {
    m: SMatrix<T, N, N>,
    y: SVector<T, N>,
}

impl<const N: usize, T: Real> NoiseVisitor<N, T> for TimeUpdate<N, T> {
    type Out = Result<(SMatrix<T, N, N>, SVector<T, N>), FilterError>;
    fn visit<const W: usize>(self, g: &SMatrix<T, N, W>, q: &SVector<T, W>) -> Self::Out {
        let mut a = *g;
        for c in 0..W {
            let s = q[c].sqrt();
            for i in 0..N {
                a[(i, c)] *= s;
            }
        }
        let ma = mul(&self.m, &a);
        let mut inner = mul(&a.transpose(), &ma);
        for i in 0..W {
            inner[(i, i)] += T::one();
        }
        symmetrize(&mut inner);
        let chol = Cholesky::new(&inner, "the process noise")?;
        let white = chol.whiten(&ma.transpose());
        let mut info = self.m - mul(&white.transpose(), &white);
        symmetrize(&mut info);
        let y = self.y - mul(&ma, &chol.solve(&mul(&a.transpose(), &self.y)));
        Ok((info, y))
    }
}

impl<M: Model<N, T>, const N: usize, T: Real> GaussianFilter<N> for Information<M, N, T> {
    type Real = T;

    fn predict(&mut self, dt_s: T) -> Result<(), FilterError> {
        check_dt(dt_s)?;
        if dt_s == T::zero() {
            return Ok(());
        }
        let at = if M::LINEAR { self.y } else { self.belief().mean };
        let back = self.model.inverse_transition(dt_s, &at)?;
        let m = mul(&back.transpose(), &mul(&self.info, &back));
        let (info, mut y) =
            self.model.with_noise_factor(dt_s, TimeUpdate { m, y: mul(&back.transpose(), &self.y) })??;
        if !M::LINEAR {
            y = mul(&info, &self.model.moved(dt_s, &at));
        }
        self.accept(info, y)
    }

    fn correct(&mut self, m: &Measurement<T>) -> Result<(), FilterError> {
        check_measurement(m)?;
        let r = invert_pair(&m.cov, "the measurement covariance")?.inverse;
        let (mut info, mut y) = (self.info, self.y);
        for (a, i) in M::POSITION.into_iter().enumerate() {
            for (b, j) in M::POSITION.into_iter().enumerate() {
                info[(i, j)] += r[(a, b)];
                y[i] += r[(a, b)] * m.position[b];
            }
        }
        self.accept(info, y)
    }

    fn belief(&self) -> Gaussian<N, T> {
        match Cholesky::new(&self.info, "the information matrix") {
            Ok(chol) => {
                let mut cov = chol.solve(&SMatrix::identity());
                symmetrize(&mut cov);
                Gaussian { mean: chol.solve(&self.y), cov }
            }
            // accept() keeps this out; an answer that claims nothing is the safe one.
            Err(_) => Gaussian { mean: self.y * T::zero(), cov: SMatrix::identity() * T::MAX.sqrt() },
        }
    }

    fn set_belief(&mut self, belief: &Gaussian<N, T>) -> Result<(), FilterError> {
        (self.info, self.y) = to_information(belief)?;
        Ok(())
    }

    fn position_at(&self) -> [usize; 2] {
        M::POSITION
    }

    fn kinematics(&self) -> Gaussian<4, T> {
        self.model.kinematics(&self.belief())
    }
}
