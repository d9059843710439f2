//! Square-root information filter: keeps [R | y] with R x = y - ν, ν ~ N(0, I), so P = R⁻¹ R⁻ᵀ can never lose its sign.
//!
//! Source: `docs/theory/filters.md` (Parimala and Raol, corrected: whitening, time update); G. J. Bierman,
//! *Factorization Methods for Discrete Sequential Estimation*, 1977, ch. V-VI. Uses I and L_q in place of R_w, so Q may be singular.
//! Symbols: r N x N upper triangular, diagonal >= 0 (1/px); y N x 1; R_m = L Lᵀ measurement covariance (px²).
//! Limits: the measurement covariance must be positive definite (a perfect measurement has infinite information), Phi
//! must have an inverse, and a nonlinear model must not be strongly curved over one step.
//! Two uncorrelated axes are filtered apart, side by side (`srif_axes`), until a full R_m or a PDA update couples them.
//! Cost: about 2 N²(N + W) flops per predict, 4 N² per correct, N³/3 to read the belief.

use crate::axes::halves_apart;
use crate::check::{check_belief, check_dt, check_measurement};
pub use crate::information_pair::InformationPair;
use crate::linalg::{Cholesky, mul};
use crate::model::{Model, NoiseVisitor};
use crate::real::all_finite;
use crate::srif_axes::{measure, move_back, pack, spread, unpack};
use crate::{FilterError, Gaussian, GaussianFilter, Measurement, Real, Start};
use nalgebra::{Matrix2, SMatrix, SVector, Vector2};

/// Square-root information filter of a model with N states.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Srif<M, const N: usize, T: Real = f64> {
    model: M,
    /// As it is, or with its axes side by side (`srif_axes`) if they are apart.
    held: InformationPair<N, T>,
    /// The axes are uncorrelated and the model keeps them so: half the work.
    apart: bool,
}

impl<M: Model<N, T>, const N: usize, T: Real> Srif<M, N, T> {
    /// Returns the information pair.
    #[inline(always)]
    pub fn pair(&self) -> InformationPair<N, T> {
        if self.apart { unpack(&self.held) } else { self.held }
    }

    /// Corrects by two sensors at once: the same as one after the other, with one triangularisation.
    /// # Errors
    /// As [`GaussianFilter::correct`].
    pub fn correct_both(&mut self, first: &Measurement<T>, second: &Measurement<T>) -> Result<(), FilterError> {
        let (h1, z1) = whitened::<N, T>(first, M::POSITION)?;
        let (h2, z2) = whitened::<N, T>(second, M::POSITION)?;
        let mut h = SMatrix::<T, 4, N>::zeros();
        let mut z = SVector::<T, 4>::zeros();
        for k in 0..2 {
            z[k] = z1[k];
            z[k + 2] = z2[k];
            for c in 0..N {
                h[(k, c)] = h1[(k, c)];
                h[(k + 2, c)] = h2[(k, c)];
            }
        }
        let mut pair = self.pair();
        pair.measure(&h, &z);
        check_regular(&pair)?;
        let apart = self.apart && first.cov[(1, 0)] == T::zero() && second.cov[(1, 0)] == T::zero();
        self.hold(pair, apart);
        Ok(())
    }

    /// The measurement update of two uncorrelated axes, each measured by one number.
    #[inline(always)]
    fn correct_apart(&mut self, m: &Measurement<T>) -> Result<(), FilterError> {
        check_measurement(m)?;
        let variance = [m.cov[(0, 0)], m.cov[(1, 1)]];
        let mut next = self.held;
        measure(&mut next, M::POSITION[0], &m.position, variance);
        // A variance of 0 gives an infinite row, which no rotation leaves finite.
        check_regular_axes(&next)?;
        self.held = next;
        Ok(())
    }

    /// The measurement update of a full R. Out of line: the apart path stays small.
    #[inline(never)]
    fn correct_coupled(&mut self, m: &Measurement<T>) -> Result<(), FilterError> {
        let (h, z) = whitened::<N, T>(m, M::POSITION)?;
        let mut pair = self.pair();
        pair.measure(&h, &z);
        check_regular(&pair)?;
        self.hold(pair, false);
        Ok(())
    }

    #[inline(never)]
    fn predict_coupled(&mut self, dt_s: T) -> Result<(), FilterError> {
        let mean = if M::LINEAR { self.held.y } else { self.held.mean() };
        let r = self.model.times_inverse_transition(dt_s, &mean, &self.held.r)?;
        let moved = InformationPair { r, y: self.held.y };
        let mut next = self.model.with_noise_factor(dt_s, TimeUpdate { pair: moved, apart: false })?;
        if !M::LINEAR {
            // The pair moved by the Jacobian; the mean moves by the function itself.
            next.y = mul(&next.r, &self.model.moved(dt_s, &mean));
        }
        for i in 0..N {
            // A step cannot create exact ignorance; only underflow can, and the check refuses it.
            next.r[(i, i)] = next.r[(i, i)].abs();
        }
        check_regular(&next)?;
        self.held = next;
        Ok(())
    }

    /// Takes a pair; `apart` puts its axes side by side.
    #[inline(always)]
    fn hold(&mut self, pair: InformationPair<N, T>, apart: bool) {
        self.apart = apart;
        self.held = if apart { pack(&pair) } else { pair };
    }
}

/// Refuses a pair that is not finite or has lost a direction.
#[inline(always)]
fn check_regular<T: Real, const N: usize>(pair: &InformationPair<N, T>) -> Result<(), FilterError> {
    let mut regular = all_finite(&pair.r) & all_finite(&pair.y);
    for i in 0..N {
        regular &= pair.r[(i, i)] > T::zero();
    }
    if regular { Ok(()) } else { Err(FilterError::NotFinite("the result of the step")) }
}

/// [`check_regular`] of axes side by side.
#[inline(always)]
fn check_regular_axes<T: Real, const N: usize>(pair: &InformationPair<N, T>) -> Result<(), FilterError> {
    let mut rest = T::zero();
    let mut regular = true;
    for i in 0..N {
        rest += pair.y[i] * T::zero();
        for j in i / 2..N / 2 {
            rest += pair.r[(i, j)] * T::zero();
        }
        regular &= pair.r[(i, i / 2)] > T::zero();
    }
    if regular & (rest == T::zero()) { Ok(()) } else { Err(FilterError::NotFinite("the result of the step")) }
}

/// Returns L⁻¹ H and L⁻¹ z for a position measurement, R_m = L Lᵀ.
#[inline(always)]
fn whitened<const N: usize, T: Real>(
    m: &Measurement<T>,
    at: [usize; 2],
) -> Result<(SMatrix<T, 2, N>, Vector2<T>), FilterError> {
    check_measurement(m)?;
    let l = Cholesky::<2, T>::new(&m.cov, "the measurement covariance")?.l;
    let (a, b, c) = (T::one() / l[(0, 0)], l[(1, 0)], T::one() / l[(1, 1)]);
    let mut h = SMatrix::<T, 2, N>::zeros();
    h[(0, at[0])] = a;
    h[(1, at[0])] = -b * a * c;
    h[(1, at[1])] = c;
    let z0 = m.position[0] * a;
    Ok((h, Vector2::new(z0, (m.position[1] - b * z0) * c)))
}

impl<M: Model<N, T>, const N: usize, T: Real> Start<M, N> for Srif<M, N, T> {
    fn start(model: M, belief: Gaussian<N, T>) -> Result<Self, FilterError> {
        check_belief(&belief)?;
        let pair = InformationPair::from_belief(&belief)?;
        let mut filter = Self { model, held: pair, apart: false };
        filter.hold(pair, M::AXES && halves_apart(&belief.cov));
        Ok(filter)
    }
    fn model(&self) -> &M {
        &self.model
    }
    fn model_mut(&mut self) -> &mut M {
        &mut self.model
    }
}

/// Holds the pair with R Phi⁻¹ in place of R; `apart`: its axes side by side.
struct TimeUpdate<const N: usize, T> {
    pair: InformationPair<N, T>,
    apart: bool,
}

impl<const N: usize, T: Real> NoiseVisitor<N, T> for TimeUpdate<N, T> {
    type Out = InformationPair<N, T>;
    #[inline]
    fn visit<const W: usize>(mut self, g: &SMatrix<T, N, W>, q: &SVector<T, W>) -> Self::Out {
        let mut root = *g;
        for c in 0..W {
            let s = q[c].sqrt();
            for i in 0..N {
                root[(i, c)] *= s;
            }
        }
        if self.apart {
            spread(&mut self.pair, &root, W / 2);
        } else {
            self.pair.spread(&root);
        }
        self.pair
    }
}

impl<M: Model<N, T>, const N: usize, T: Real> GaussianFilter<N> for Srif<M, N, T> {
    type Real = T;

    #[inline]
    fn predict(&mut self, dt_s: T) -> Result<(), FilterError> {
        check_dt(dt_s)?;
        if dt_s == T::zero() {
            return Ok(());
        }
        if !self.apart {
            return self.predict_coupled(dt_s);
        }
        let back = self.model.inverse_transition(dt_s, &self.held.y)?;
        let mut moved = self.held;
        move_back(&mut moved.r, &back);
        let next = self.model.with_noise_factor(dt_s, TimeUpdate { pair: moved, apart: true })?;
        check_regular_axes(&next)?;
        self.held = next;
        Ok(())
    }

    #[inline]
    fn correct(&mut self, m: &Measurement<T>) -> Result<(), FilterError> {
        if self.apart && m.cov[(1, 0)] == T::zero() { self.correct_apart(m) } else { self.correct_coupled(m) }
    }

    fn belief(&self) -> Gaussian<N, T> {
        self.pair().belief()
    }

    fn set_belief(&mut self, belief: &Gaussian<N, T>) -> Result<(), FilterError> {
        check_belief(belief)?;
        self.hold(InformationPair::from_belief(belief)?, M::AXES && halves_apart(&belief.cov));
        Ok(())
    }

    #[inline]
    fn position_at(&self) -> [usize; 2] {
        M::POSITION
    }

    fn kinematics(&self) -> Gaussian<4, T> {
        self.model.kinematics(&self.belief())
    }

    fn predicted(&self) -> Gaussian<2, T> {
        // Only the two position rows of R⁻¹ are needed: a R = e_i by forward substitution.
        let at = M::POSITION;
        let pair = self.pair();
        let x = pair.mean();
        let mut rows = [[T::zero(); N]; 2];
        for (row, i) in rows.iter_mut().zip(at) {
            row[i] = T::one() / pair.r[(i, i)];
            for c in i + 1..N {
                let mut v = T::zero();
                for k in i..c {
                    v -= row[k] * pair.r[(k, c)];
                }
                row[c] = v / pair.r[(c, c)];
            }
        }
        let dot = |a: &[T; N], b: &[T; N]| a.iter().zip(b).fold(T::zero(), |s, (u, v)| s + *u * *v);
        let cross = dot(&rows[0], &rows[1]);
        Gaussian {
            mean: Vector2::new(x[at[0]], x[at[1]]),
            cov: Matrix2::new(dot(&rows[0], &rows[0]), cross, cross, dot(&rows[1], &rows[1])),
        }
    }
}
