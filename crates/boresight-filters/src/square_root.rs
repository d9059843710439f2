//! Square-root covariance filter: keeps S with P = S Sᵀ; Potter's update, Householder time update.
//!
//! Source: J. E. Potter's update as in G. J. Bierman, *Factorization Methods for Discrete Sequential Estimation*, 1977,
//! II.7: f = Sᵀ a, α = r + fᵀ f, K = S f/α, S^ = S - γ K fᵀ, γ = 1/(1 + sqrt(r/α)). Time: [Phi S | G L] → [S~ | 0].
//! Symbols: s N x N (px, px/s), lower triangular after a predict, full after a correct; a row of H; r px².
//! Limits: none of rank. Cost: about 2 N²(N + W) flops per predict, 6 N² per correct; two roots more than [`crate::Ud`].

use crate::check::{check_belief, check_dt, check_measurement};
use crate::linalg::{Cholesky, lower_factor, mul};
use crate::model::{Model, NoiseVisitor};
use crate::real::all_finite;
use crate::ud::whitened_rows;
use crate::{FilterError, Gaussian, GaussianFilter, Measurement, Real, Start};
use nalgebra::{Matrix2, SMatrix, SVector, Vector2};

/// Square-root covariance filter of a model with N states.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SquareRoot<M, const N: usize, T: Real = f64> {
    model: M,
    mean: SVector<T, N>,
    s: SMatrix<T, N, N>,
}

impl<M: Model<N, T>, const N: usize, T: Real> SquareRoot<M, N, T> {
    /// Returns S with P = S Sᵀ.
    pub fn root(&self) -> &SMatrix<T, N, N> {
        &self.s
    }

    fn accept(&mut self, mean: SVector<T, N>, s: SMatrix<T, N, N>) -> Result<(), FilterError> {
        if !(all_finite(&mean) & all_finite(&s)) {
            return Err(FilterError::NotFinite("the result of the step"));
        }
        self.mean = mean;
        self.s = s;
        Ok(())
    }
}

impl<M: Model<N, T>, const N: usize, T: Real> Start<M, N> for SquareRoot<M, N, T> {
    fn start(model: M, belief: Gaussian<N, T>) -> Result<Self, FilterError> {
        check_belief(&belief)?;
        let s = Cholesky::semi_definite(&belief.cov, "the state covariance")?.l;
        Ok(Self { model, mean: belief.mean, s })
    }
    fn model(&self) -> &M {
        &self.model
    }
    fn model_mut(&mut self) -> &mut M {
        &mut self.model
    }
}

struct TimeUpdate<const N: usize, T>(SMatrix<T, N, N>);

impl<const N: usize, T: Real> NoiseVisitor<N, T> for TimeUpdate<N, T> {
    type Out = SMatrix<T, N, N>;
    #[inline]
    fn visit<const W: usize>(self, g: &SMatrix<T, N, W>, q: &SVector<T, W>) -> Self::Out {
        let mut root = *g;
        for c in 0..W {
            let s = q[c].sqrt();
            for i in 0..N {
                root[(i, c)] *= s;
            }
        }
        lower_factor(&self.0, &root)
    }
}

impl<M: Model<N, T>, const N: usize, T: Real> GaussianFilter<N> for SquareRoot<M, N, T> {
    type Real = T;

    fn predict(&mut self, dt_s: T) -> Result<(), FilterError> {
        check_dt(dt_s)?;
        if dt_s == T::zero() {
            return Ok(());
        }
        let phi_s = mul(&self.model.transition(dt_s, &self.mean), &self.s);
        let s = self.model.with_noise_factor(dt_s, TimeUpdate(phi_s))?;
        self.accept(self.model.moved(dt_s, &self.mean), s)
    }

    fn correct(&mut self, m: &Measurement<T>) -> Result<(), FilterError> {
        check_measurement(m)?;
        let (mut x, mut s) = (self.mean, self.s);
        for (a, z, r) in whitened_rows::<N, T>(m, M::POSITION)? {
            let f = mul(&s.transpose(), &a);
            let alpha = r + f.dot(&f);
            if !(alpha > T::zero()) {
                return Err(FilterError::NotPositiveDefinite("the innovation covariance"));
            }
            let gain = mul(&s, &f) / alpha;
            x += gain * (z - a.dot(&x));
            let gamma = T::one() / (T::one() + (r / alpha).sqrt());
            for c in 0..N {
                let fc = gamma * f[c];
                for i in 0..N {
                    s[(i, c)] -= gain[i] * fc;
                }
            }
        }
        self.accept(x, s)
    }

    fn belief(&self) -> Gaussian<N, T> {
        let mut cov = SMatrix::<T, N, N>::zeros();
        for c in 0..N {
            for i in 0..=c {
                let mut v = T::zero();
                for k in 0..N {
                    v += self.s[(i, k)] * self.s[(c, k)];
                }
                cov[(i, c)] = v;
                cov[(c, i)] = v;
            }
        }
        Gaussian { mean: self.mean, cov }
    }

    fn set_belief(&mut self, belief: &Gaussian<N, T>) -> Result<(), FilterError> {
        check_belief(belief)?;
        self.s = Cholesky::semi_definite(&belief.cov, "the state covariance")?.l;
        self.mean = belief.mean;
        Ok(())
    }

    fn position_at(&self) -> [usize; 2] {
        M::POSITION
    }

    fn kinematics(&self) -> Gaussian<4, T> {
        self.model.kinematics(&self.belief())
    }

    fn predicted(&self) -> Gaussian<2, T> {
        let [i, j] = M::POSITION;
        let (a, b) = (self.s.row(i), self.s.row(j));
        let cross = a.dot(&b);
        Gaussian {
            mean: Vector2::new(self.mean[i], self.mean[j]),
            cov: Matrix2::new(a.dot(&a), cross, cross, b.dot(&b)),
        }
    }
}
