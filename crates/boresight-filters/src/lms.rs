//! Time-varying Kalman filter whose acceleration transition is learnt by LMS, per axis: as printed, or guarded.
//!
//! Source: N. Obolensky, D. Erdogmus, J. Principe 2002, corrected (`docs/theory/adaptive.md`). State s = (p, v, a_1 …
//! a_{N+1}), a_i at time k is a[k + 1 - i]; N = S - 3. A(W): p += T v, v += T a_1, accelerations by W (upper
//! triangular). Measured: p and the second differences a[k-2] … a[k-N] of measured positions. After the Kalman step
//! (Joseph): e_i = a_out,i - W_i · a_in, W_i += η e_i a_in, Q = diag(0, 0, e_1² …); η = α ‖A - K C‖₂ (printed) or the
//! guard: η = μ/(1e-6 + ‖a_in‖²), leak to W_0, rows with Σ|w| > 1 scaled to 1, NIS watchdog that restarts the weights.
//! Differs from it: second differences are taken in real time (uneven steps), and a sample that is not yet there is left
//! out of the measurement. The printed line "R = C P Cᵀ" is not used: R collapses, the output is the input.
//! Divergence (table in that chapter): with α <= 1e-14 (T = 0.04 s) the printed rule is a plain filter; at 1e-12 a
//! quarter of the runs diverge, at 1e-8 all overflow: the regressors are noisy, W shrinks, Q = e² goes to 0 and the
//! filter leaves a turning target without noticing. This file returns an error instead of an overflow. Guarded never
//! diverged.
//! Symbols: W (N+1)²; σ px; T s. Cost: about 12 S³ flops an axis and step.
//! Limits: uncorrelated axes; S = N + 3 >= 5; a window of N = 2 gains nothing over longer ones.

use crate::linalg::{Cholesky, mul, mul_transposed, spectral_norm, symmetrize};
use crate::real::all_finite;
use crate::{FilterError, Real};
use nalgebra::{SMatrix, SVector};

/// How the weights learn.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum LmsRule<T = f64> {
    /// The corrected printed equations with step factor α (1/(px/s²)², about): diverges for α that do anything.
    AsPrinted {
        /// α, at least 0; 0 keeps the weights.
        alpha: T,
    },
    /// Normalised LMS with leak, row limit and watchdog: the default.
    #[default]
    Guarded,
}

/// Normalised step μ of the guard.
const MU: f64 = 1e-3;
/// What of W - W_0 is kept per step by the guard.
const KEEP: f64 = 0.99;
/// Memory of the watchdog's mean NIS, in steps.
const WATCH: f64 = 20.0;

/// One axis of the filter with S = N + 3 states; S >= 5.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct LmsAxis<const S: usize, T: Real = f64> {
    /// State (p, v, a_1 …), px, px/s, px/s².
    pub state: SVector<T, S>,
    /// Covariance.
    pub cov: SMatrix<T, S, S>,
    /// Weights W in the lower right (S-2) x (S-2) corner; the rest is not used.
    pub weights: SMatrix<T, S, S>,
    /// Diagonal of Q for the next step.
    pub noise: SVector<T, S>,
    /// Last learning rate η.
    pub rate: T,
    /// How often the watchdog restarted the weights.
    pub trips: u32,
    rule: LmsRule<T>,
    before: SVector<T, S>,
    transition: SMatrix<T, S, S>,
    mean_nis: T,
    /// Measured positions and the time step to each, newest first.
    past: [(T, T); S],
    n_past: usize,
}

/// Returns e and the updated W, both over S states (accelerations from index 2): the paper's eq. 5.
///
/// The worked step of `docs/theory/adaptive.md`:
/// ```
/// use boresight_filters::lms::lms_step;
/// use nalgebra::{Matrix5, Vector5};
/// let mut w = Matrix5::<f64>::identity();
/// (w[(2, 2)], w[(2, 3)], w[(3, 3)], w[(3, 4)]) = (0.9, 0.1, 0.8, 0.2);
/// let e = lms_step(&mut w, &Vector5::new(0., 0., 1., 0.5, -0.25), &Vector5::new(0., 0., 0.9, 0.8, 0.4), 0.1);
/// assert!((e - Vector5::new(0.0, 0.0, -0.05, 0.45, 0.65)).norm() < 1e-15_f64);
/// assert!((w[(2, 2)] - 0.895).abs() < 1e-15 && (w[(3, 4)] - 0.18875).abs() < 1e-15);
/// ```
pub fn lms_step<const S: usize, T: Real>(
    weights: &mut SMatrix<T, S, S>,
    a_in: &SVector<T, S>,
    a_out: &SVector<T, S>,
    rate: T,
) -> SVector<T, S> {
    let mut e = SVector::zeros();
    for i in 2..S {
        let mut predicted = T::zero();
        for j in i..S {
            predicted += weights[(i, j)] * a_in[j];
        }
        e[i] = a_out[i] - predicted;
        for j in i..S {
            weights[(i, j)] += rate * e[i] * a_in[j];
        }
    }
    e
}

/// Returns A(W) for a step of dt seconds.
pub fn lms_transition<const S: usize, T: Real>(weights: &SMatrix<T, S, S>, dt_s: T) -> SMatrix<T, S, S> {
    let mut a = SMatrix::<T, S, S>::identity();
    a[(0, 1)] = dt_s;
    a[(1, 2)] = dt_s;
    for i in 2..S {
        for j in 2..S {
            a[(i, j)] = if j >= i { weights[(i, j)] } else { T::zero() };
        }
    }
    a
}

/// Returns the states that are measured: p, and a[k-2] … a[k-N].
pub fn lms_measured<const S: usize>() -> [bool; S] {
    core::array::from_fn(|i| i == 0 || i >= 4)
}

impl<const S: usize, T: Real> LmsAxis<S, T> {
    /// Starts with a position and velocity of given variances (px², px²/s²); accelerations start at 0 with variance
    /// `acceleration_var` (px²/s⁴).
    /// # Errors
    /// [`FilterError::OutOfRange`] for S < 5, a negative variance or α.
    pub fn new(p: T, v: T, var: [T; 2], acceleration_var: T, rule: LmsRule<T>) -> Result<Self, FilterError> {
        if S < 5 {
            return Err(FilterError::OutOfRange("a window of at least N = 2, that is S >= 5 states"));
        }
        if let LmsRule::AsPrinted { alpha } = rule
            && !(alpha >= T::zero() && alpha <= T::MAX)
        {
            return Err(FilterError::OutOfRange("a step factor of at least 0"));
        }
        if !(p.abs() <= T::MAX && v.abs() <= T::MAX) {
            return Err(FilterError::NotFinite("the state"));
        }
        if ![var[0], var[1], acceleration_var].iter().all(|v| *v >= T::zero() && *v <= T::MAX) {
            return Err(FilterError::OutOfRange("variances of at least 0"));
        }
        let mut state = SVector::zeros();
        state[0] = p;
        state[1] = v;
        let mut cov = SMatrix::<T, S, S>::identity() * acceleration_var;
        cov[(0, 0)] = var[0];
        cov[(1, 1)] = var[1];
        Ok(Self {
            state,
            cov,
            weights: SMatrix::identity(),
            noise: SVector::zeros(),
            rate: T::zero(),
            trips: 0,
            rule,
            before: state,
            transition: SMatrix::identity(),
            mean_nis: T::of((S - 3) as f64),
            past: [(T::zero(), T::zero()); S],
            n_past: 0,
        })
    }

    /// Starts at the third of three samples `dt_s` apart, as the paper does; `std` is the measurement's (px).
    /// # Errors
    /// As [`LmsAxis::new`].
    pub fn from_samples(z: [T; 3], dt_s: T, std: T, rule: LmsRule<T>) -> Result<Self, FilterError> {
        let (r, t2) = (std * std, dt_s * dt_s);
        let mut axis =
            Self::new(z[2], (z[2] - z[1]) / dt_s, [r, T::of(2.0) * r / t2], T::of(6.0) * r / (t2 * t2), rule)?;
        for p in z {
            axis.remember(p, dt_s);
        }
        Ok(axis)
    }

    /// Notes a measured position and the time since the one before, for the second differences.
    pub fn remember(&mut self, position: T, dt_s: T) {
        self.past.rotate_right(1);
        self.past[0] = (position, dt_s);
        self.n_past = (self.n_past + 1).min(S);
    }

    /// Moves the state `dt_s` seconds ahead by the learnt weights.
    /// # Errors
    /// [`FilterError::NotFinite`] if the filter has diverged; the state is then unchanged.
    pub fn predict(&mut self, dt_s: T) -> Result<(), FilterError> {
        let a = lms_transition(&self.weights, dt_s);
        let mut cov = mul_transposed(&mul(&a, &self.cov), &a) + SMatrix::from_diagonal(&self.noise);
        symmetrize(&mut cov);
        let state = mul(&a, &self.state);
        if !(all_finite(&state) & all_finite(&cov)) {
            return Err(FilterError::NotFinite("the predicted state (the learnt weights have diverged)"));
        }
        self.before = self.state;
        self.transition = a;
        self.state = state;
        self.cov = cov;
        Ok(())
    }

    /// Returns the measured second difference `age` samples back, if its three samples are there, and the factor that
    /// makes its variance of that of a position.
    fn acceleration(&self, age: usize) -> Option<(T, T)> {
        if age + 3 > self.n_past {
            return None;
        }
        let ((p2, h2), (p1, h1), (p0, _)) = (self.past[age], self.past[age + 1], self.past[age + 2]);
        let two = T::of(2.0);
        // Divided difference; for equal steps (p2 - 2 p1 + p0)/T², variance 6 r/T⁴.
        let (c2, c0) = (two / (h2 * (h1 + h2)), two / (h1 * (h1 + h2)));
        let c1 = c2 + c0;
        let value = (p2 - p1) * c2 - (p1 - p0) * c0;
        Some((value, c2 * c2 + c1 * c1 + c0 * c0)).filter(|(v, f)| v.abs() <= T::MAX && *f <= T::MAX)
    }

    /// Corrects by a measured position of variance `r` (px²), `since_s` seconds after the measured one before.
    /// # Errors
    /// [`FilterError`] if S cannot be factored or the filter has diverged; the state is then unchanged.
    pub fn correct(&mut self, z: T, r: T, since_s: T) -> Result<(), FilterError> {
        let mut next = *self;
        next.remember(z, since_s);
        next.kalman_and_learn(z, r)?;
        let fine =
            all_finite(&next.state) & all_finite(&next.cov) & all_finite(&next.weights) & all_finite(&next.noise);
        if !fine {
            return Err(FilterError::NotFinite("the result of the step (the learnt weights have diverged)"));
        }
        *self = next;
        Ok(())
    }

    fn kalman_and_learn(&mut self, z: T, r: T) -> Result<(), FilterError> {
        // C is a diagonal selector: rows that are not measured get a unit of noise and no gain.
        let mut innovation = SVector::<T, S>::zeros();
        let mut noise = SMatrix::<T, S, S>::identity();
        let mut measured = [false; S];
        (innovation[0], noise[(0, 0)], measured[0]) = (z - self.state[0], r, true);
        for i in 4..S {
            if let Some((a, factor)) = self.acceleration(i - 4) {
                (innovation[i], noise[(i, i)], measured[i]) = (a - self.state[i], r * factor, true);
            }
        }
        let pick = |i: usize, j: usize| if measured[i] && measured[j] { self.cov[(i, j)] } else { T::zero() };
        let s = SMatrix::<T, S, S>::from_fn(pick) + noise;
        let chol = Cholesky::new(&s, "the innovation covariance")?;
        let cp = SMatrix::<T, S, S>::from_fn(|i, j| if measured[i] { self.cov[(i, j)] } else { T::zero() });
        let gain = chol.solve(&cp).transpose();
        let white = chol.whiten(&innovation);
        let nis = white.dot(&white);
        let kc = SMatrix::<T, S, S>::from_fn(|i, j| if measured[j] { gain[(i, j)] } else { T::zero() });
        let keep = SMatrix::<T, S, S>::identity() - kc;
        let kr = SMatrix::<T, S, S>::from_fn(|i, j| if measured[j] { gain[(i, j)] * noise[(j, j)] } else { T::zero() });
        self.state += mul(&gain, &innovation);
        self.cov = mul_transposed(&mul(&keep, &self.cov), &keep) + mul_transposed(&kr, &gain);
        symmetrize(&mut self.cov);
        let n_measured = T::of(measured.iter().filter(|m| **m).count() as f64);
        self.learn(&kc, nis, n_measured);
        Ok(())
    }

    fn learn(&mut self, kc: &SMatrix<T, S, S>, nis: T, n_measured: T) {
        let (a_in, a_out) = (self.before, self.state);
        self.rate = match self.rule {
            LmsRule::AsPrinted { alpha } => alpha * spectral_norm(&(self.transition - kc)),
            LmsRule::Guarded => {
                let norm2 = (2..S).fold(T::zero(), |s, i| s + a_in[i] * a_in[i]);
                T::of(MU) / (T::of(1e-6) + norm2)
            }
        };
        let e = lms_step(&mut self.weights, &a_in, &a_out, self.rate);
        self.noise = e.component_mul(&e);
        if self.rule != LmsRule::Guarded {
            return;
        }
        for i in 2..S {
            let mut sum = T::zero();
            for j in i..S {
                let start = if i == j { T::one() } else { T::zero() };
                self.weights[(i, j)] = start + T::of(KEEP) * (self.weights[(i, j)] - start);
                sum += self.weights[(i, j)].abs();
            }
            if sum > T::one() {
                for j in i..S {
                    self.weights[(i, j)] /= sum;
                }
            }
        }
        self.mean_nis += (nis - self.mean_nis) / T::of(WATCH);
        if self.mean_nis > T::of(2.0) * n_measured {
            self.weights = SMatrix::identity();
            self.cov *= T::of(10.0);
            for i in 2..S {
                self.noise[i] = self.noise[i].max(self.cov[(i, i)]);
            }
            self.mean_nis = n_measured;
            self.trips += 1;
        }
    }
}

#[cfg(test)]
mod tests;
