//! Bierman-Thornton U-D filter: keeps P = U D Uᵀ, so P stays symmetric and positive by construction.
//!
//! Source: `docs/theory/filters.md` (Bierman's measurement update, Thornton's time update by weighted Gram-Schmidt); G.
//! J. Bierman, *Factorization Methods for Discrete Sequential Estimation*, 1977, ch. V-VI. Misprints of the paper:
//! `docs/theory/papers.md`.
//! Differs from it: a row of U that is measured itself becomes u r/α, which is u + λ K without its cancellation (P may
//! exceed r by the square of the working precision); a full R is whitened first (R = L Lᵀ); the PDA update is made in factors
//! too: P^ = Σ of weighted factors, joined by Gram-Schmidt, so it cannot lose definiteness.
//! Symbols: x N x 1; u N x N unit upper; d N (variances); a N x 1 row of H; r measurement variance; α innovation variance.
//! Two uncorrelated axes are filtered apart, side by side (`ud_axes`), until a full R or a PDA update couples them.
//! Limits: none of rank: a zero variance is allowed. Cost: about N²(N + W) + 3 N² flops per predict + update.

use crate::axes::halves_apart;
use crate::check::{check_belief, check_dt, check_measurement};
use crate::gaussian::position_of;
use crate::linalg::{UdFactors, mwgs, ud_factorize};
use crate::model::{Model, NoiseVisitor};
use crate::real::all_finite;
use crate::ud_axes;
use crate::{FilterError, Gaussian, GaussianFilter, Measurement, Real, Start};
use nalgebra::{SMatrix, SVector};

/// Innovation variance and gain of a scalar update.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ScalarUpdate<const N: usize, T = f64> {
    /// Innovation variance aᵀ P a + r.
    pub alpha: T,
    /// Gain, N x 1.
    pub gain: SVector<T, N>,
}

/// Bierman's update of x and U, D by a scalar z = aᵀ x + v, var v = r, in place.
///
/// The worked example of `docs/theory/filters.md`:
/// ```
/// use boresight_filters::{linalg::UdFactors, ud::ud_scalar_update};
/// use nalgebra::{Matrix4, Vector4};
/// let u = Matrix4::new(1., 0.5, 0.25, 0.1, 0., 1., -0.3, 0.2, 0., 0., 1., 0.4, 0., 0., 0., 1.);
/// let mut factors = UdFactors { u, d: Vector4::new(2.0, 1.0, 0.5, 0.25) };
/// let mut x = Vector4::new(10.0, 1.0, 20.0, -1.0);
/// let done = ud_scalar_update(&mut x, &mut factors, &Vector4::new(1.0, 0.0, 0.0, 0.0), 10.7, 0.5);
/// assert!((done.alpha - 2.78375_f64).abs() < 1e-12);
/// assert!((x[0] - 10.574270318815).abs() < 1e-11 && (x[3] + 0.99371351594073).abs() < 1e-12);
/// assert!((factors.d[3] - 0.24977548271217).abs() < 1e-13);
/// assert!((factors.u[(1, 3)] - 0.18337078651685).abs() < 1e-13);
/// ```
#[inline]
pub fn ud_scalar_update<const N: usize, T: Real>(
    x: &mut SVector<T, N>,
    factors: &mut UdFactors<N, T>,
    a: &SVector<T, N>,
    z: T,
    r: T,
) -> ScalarUpdate<N, T> {
    let mut predicted = T::zero();
    for i in 0..N {
        predicted += a[i] * x[i];
    }
    let done = factor_update(factors, a, r);
    if done.alpha > T::zero() {
        let innovation = z - predicted;
        for i in 0..N {
            x[i] += done.gain[i] * innovation;
        }
    }
    done
}

/// The state that a measurement row is one times, if it is only one.
#[inline(always)]
fn picked<const N: usize, T: Real>(a: &SVector<T, N>) -> Option<usize> {
    let mut others = (0..N).filter(|i| a[*i] != T::zero());
    let first = others.next()?;
    (others.next().is_none() && a[first] == T::one()).then_some(first)
}

/// The covariance part of Bierman's update: no measurement is needed.
#[inline(always)]
pub(crate) fn factor_update<const N: usize, T: Real>(
    factors: &mut UdFactors<N, T>,
    a: &SVector<T, N>,
    r: T,
) -> ScalarUpdate<N, T> {
    let UdFactors { u, d } = factors;
    let mut f = [T::zero(); N];
    let mut g = [T::zero(); N];
    for j in 0..N {
        let mut sum = a[j];
        for i in 0..j {
            sum += u[(i, j)] * a[i];
        }
        f[j] = sum;
        g[j] = d[j] * sum;
    }
    let mut gain = SVector::<T, N>::zeros();
    let mut alpha = r;
    let picked = picked(a);
    for j in 0..N {
        let before = alpha;
        alpha += g[j] * f[j];
        // Both are 0 only for r = 0 and directions already known exactly.
        let lambda = if before > T::zero() { -f[j] / before } else { T::zero() };
        if alpha > T::zero() {
            d[j] *= before / alpha;
        }
        for i in 0..j {
            let t = u[(i, j)];
            u[(i, j)] = t + lambda * gain[i];
            gain[i] += g[j] * t;
        }
        // t + λ K = t (1 - (α - r)/α) of the row that is measured itself: a product has no cancellation.
        if let Some(i) = picked.filter(|i| *i < j) {
            u[(i, j)] = if before > T::zero() { f[j] * (r / before) } else { f[j] };
        }
        gain[j] = g[j];
    }
    if alpha > T::zero() {
        let inv = T::one() / alpha;
        for i in 0..N {
            gain[i] *= inv;
        }
    }
    ScalarUpdate { alpha, gain }
}

/// U-D filter of a model with N states.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ud<M, const N: usize, T: Real = f64> {
    model: M,
    /// Mean and factors as they are, or with their axes side by side (`ud_axes`) if they are apart.
    mean: SVector<T, N>,
    held: UdFactors<N, T>,
    /// The axes are uncorrelated and the model keeps them so: half the work.
    apart: bool,
}

impl<M: Model<N, T>, const N: usize, T: Real> Ud<M, N, T> {
    /// Returns the factors of the covariance.
    #[inline(always)]
    pub fn factors(&self) -> UdFactors<N, T> {
        if self.apart { ud_axes::unpack(&self.held) } else { self.held }
    }

    #[inline(always)]
    fn whole_mean(&self) -> SVector<T, N> {
        if self.apart { ud_axes::unpack_mean(&self.mean) } else { self.mean }
    }

    #[inline(always)]
    fn hold(&mut self, mean: SVector<T, N>, factors: UdFactors<N, T>, apart: bool) {
        self.apart = apart;
        (self.mean, self.held) =
            if apart { (ud_axes::pack_mean(&mean), ud_axes::pack(&factors)) } else { (mean, factors) };
    }

    /// Takes mean and factors in the layout that is held.
    #[inline(always)]
    fn accept(&mut self, mean: SVector<T, N>, factors: UdFactors<N, T>) -> Result<(), FilterError> {
        check_finite(&mean, &factors)?;
        (self.mean, self.held) = (mean, factors);
        Ok(())
    }

    /// The time update of full factors. Out of line: the apart path stays small.
    #[inline(never)]
    fn predict_coupled(&mut self, dt_s: T) -> Result<(), FilterError> {
        let phi_u = self.model.transition_times(dt_s, &self.mean, &self.held.u);
        let next = self.model.with_noise_factor(dt_s, TimeUpdate { phi: phi_u, held: &self.held, apart: false })?;
        self.accept(self.model.moved(dt_s, &self.mean), next)
    }

    #[inline(never)]
    fn correct_coupled(&mut self, m: &Measurement<T>) -> Result<(), FilterError> {
        let (mut mean, mut factors) = (self.whole_mean(), self.factors());
        for (a, z, r) in whitened_rows::<N, T>(m, M::POSITION)? {
            let done = ud_scalar_update(&mut mean, &mut factors, &a, z, r);
            if !(done.alpha > T::zero()) {
                return Err(FilterError::NotPositiveDefinite("the innovation covariance"));
            }
        }
        check_finite(&mean, &factors)?;
        self.hold(mean, factors, false);
        Ok(())
    }
}

#[inline(always)]
fn check_finite<T: Real, const N: usize>(mean: &SVector<T, N>, f: &UdFactors<N, T>) -> Result<(), FilterError> {
    if all_finite(mean) & all_finite(&f.u) & all_finite(&f.d) {
        Ok(())
    } else {
        Err(FilterError::NotFinite("the result of the step"))
    }
}

impl<M: Model<N, T>, const N: usize, T: Real> Start<M, N> for Ud<M, N, T> {
    fn start(model: M, belief: Gaussian<N, T>) -> Result<Self, FilterError> {
        check_belief(&belief)?;
        let factors = ud_factorize(&belief.cov)?;
        let mut filter = Self { model, mean: belief.mean, held: factors, apart: false };
        filter.hold(belief.mean, factors, M::AXES && halves_apart(&belief.cov));
        Ok(filter)
    }

    fn model(&self) -> &M {
        &self.model
    }

    fn model_mut(&mut self) -> &mut M {
        &mut self.model
    }
}

/// Thornton's time update with the model's noise factor; `phi` is Phi if the axes are apart, else Phi U.
struct TimeUpdate<'a, const N: usize, T> {
    phi: SMatrix<T, N, N>,
    held: &'a UdFactors<N, T>,
    apart: bool,
}

impl<const N: usize, T: Real> NoiseVisitor<N, T> for TimeUpdate<'_, N, T> {
    type Out = UdFactors<N, T>;
    #[inline]
    fn visit<const W: usize>(self, g: &SMatrix<T, N, W>, q: &SVector<T, W>) -> Self::Out {
        if self.apart { ud_axes::propagate(self.held, &self.phi, g, q) } else { mwgs(&self.phi, &self.held.d, g, q) }
    }
}

impl<M: Model<N, T>, const N: usize, T: Real> GaussianFilter<N> for Ud<M, N, T> {
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
        let phi = self.model.transition(dt_s, &self.mean);
        let mut mean = SVector::<T, N>::zeros();
        for i in 0..N / 2 {
            for k in i..N / 2 {
                for axis in 0..2 {
                    mean[2 * i + axis] += phi[(i, k)] * self.mean[2 * k + axis];
                }
            }
        }
        let next = self.model.with_noise_factor(dt_s, TimeUpdate { phi, held: &self.held, apart: true })?;
        self.accept(mean, next)
    }

    #[inline]
    fn correct(&mut self, m: &Measurement<T>) -> Result<(), FilterError> {
        check_measurement(m)?;
        if !(self.apart && m.cov[(1, 0)] == T::zero()) {
            return self.correct_coupled(m);
        }
        let (mut mean, mut factors, at) = (self.mean, self.held, M::POSITION[0]);
        let Some(gain) = ud_axes::correct(&mut factors, at, [m.cov[(0, 0)], m.cov[(1, 1)]]) else {
            return Err(FilterError::NotPositiveDefinite("the innovation covariance"));
        };
        for i in 0..N / 2 {
            for axis in 0..2 {
                mean[2 * i + axis] += gain[i][axis] * (m.position[axis] - self.mean[2 * at + axis]);
            }
        }
        self.accept(mean, factors)
    }

    fn belief(&self) -> Gaussian<N, T> {
        Gaussian { mean: self.whole_mean(), cov: self.factors().product() }
    }

    fn set_belief(&mut self, belief: &Gaussian<N, T>) -> Result<(), FilterError> {
        check_belief(belief)?;
        self.hold(belief.mean, ud_factorize(&belief.cov)?, M::AXES && halves_apart(&belief.cov));
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
        position_of(&self.belief(), M::POSITION)
    }
}

/// Returns the measurement as two independent scalars: row a, value, variance.
#[inline(always)]
pub(crate) fn whitened_rows<const N: usize, T: Real>(
    m: &Measurement<T>,
    at: [usize; 2],
) -> Result<[(SVector<T, N>, T, T); 2], FilterError> {
    let (mut a0, mut a1) = (SVector::<T, N>::zeros(), SVector::<T, N>::zeros());
    a0[at[0]] = T::one();
    a1[at[1]] = T::one();
    let (r00, r10, r11) = (m.cov[(0, 0)], m.cov[(1, 0)], m.cov[(1, 1)]);
    let (z0, mut z1, mut r1) = (m.position[0], m.position[1], r11);
    if r10 != T::zero() {
        // L D Lᵀ instead of Cholesky: no root, and the variances keep their meaning.
        if !(r00 > T::zero()) {
            return Err(FilterError::NotPositiveDefinite("the measurement covariance"));
        }
        let l = r10 / r00;
        a1[at[0]] = -l;
        z1 -= l * z0;
        r1 = (r11 - l * r10).max(T::zero());
    }
    Ok([(a0, z0, r00), (a1, z1, r1)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{ConstantVelocity, Dense};

    #[test]
    fn a_measurement_a_billion_times_sharper_than_the_prediction_leaves_its_own_variance() {
        let wide = |p: f32| Gaussian { mean: SVector::<f32, 4>::zeros(), cov: SMatrix::identity() * p };
        for exponent in 0..16 {
            let q = libm::pow(10.0, f64::from(exponent) - 8.0) as f32;
            let cv = ConstantVelocity::<f32>::continuous(q).unwrap();
            let m = Measurement::isotropic(1.0_f32, 2.0, 1e-6);
            let (mut apart, mut dense) =
                (Ud::start(cv, wide(1e-6)).unwrap(), Ud::start(Dense(cv), wide(1e-6)).unwrap());
            apart.predict(700.0).unwrap();
            dense.predict(700.0).unwrap();
            let prior = f64::from(apart.predicted().cov[(0, 0)]);
            apart.correct(&m).unwrap();
            dense.correct(&m).unwrap();
            let want = prior * 1e-12 / (prior + 1e-12);
            for got in [apart.predicted().cov[(1, 1)], dense.predicted().cov[(0, 0)]] {
                assert!((f64::from(got) / want - 1.0).abs() < 1e-5, "q {q}: {got} instead of {want}");
            }
        }
    }
}
