//! Many constant-velocity tracks of one kind, lane beside lane: the batch (structure-of-arrays) Kalman filter.
//!
//! Source: `docs/theory/filters.md`, for each axis alone: with uncorrelated axes and diagonal R the 4 x 4 filter falls
//! apart into two 2 x 2 ones, 46 flops a step. Lanes holds L tracks as arrays, so that the compiler turns each line
//! into vector instructions of whatever width the machine has. With the feature `simd` the widest is chosen at run
//! time.
//! Differs from it: P^ = (1 - k) P~ per axis, k = p/(p + r) written as r/(p + r): no difference of nearly equal numbers,
//! so the short form is as good as Joseph's here. p11 is reduced by k1 p01, positive by Cauchy-Schwarz up to rounding.
//! Symbols: per axis x px, v px/s, p00 px², p01 px²/s, p11 px²/s². A variance of infinity is a missed scan.
//! Limits: axes must be uncorrelated ([`Lanes::set`] refuses others): no PDA spread, no full R. Cost per track and step:
//! 2 divisions, about 50 flops, 160 bytes moved.

pub use crate::model::AxisNoise;
use crate::model::ConstantVelocity;
use crate::{FilterError, Gaussian, Real};
use nalgebra::{SMatrix, SVector};

/// L tracks side by side; arrays are by axis, then lane.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
pub struct Lanes<const L: usize, T = f64> {
    x: [[T; L]; 2],
    v: [[T; L]; 2],
    p00: [[T; L]; 2],
    p01: [[T; L]; 2],
    p11: [[T; L]; 2],
}

/// Variances of the positions of one scan (px²).
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Variance<'a, T = f64> {
    /// The same for every track and axis.
    Same(T),
    /// For each track (x, y); infinity is a missed scan.
    Each(&'a [[T; 2]]),
}

impl<const L: usize, T: Real> Default for Lanes<L, T> {
    fn default() -> Self {
        let zero = [[T::zero(); L]; 2];
        // Empty lanes are ordinary tracks at the origin with unit variance: harmless to step.
        let one = [[T::one(); L]; 2];
        Self { x: zero, v: zero, p00: one, p01: zero, p11: one }
    }
}

impl<const L: usize, T: Real> Lanes<L, T> {
    /// Puts a belief in `[x, vx, y, vy]` into a lane.
    /// # Errors
    /// [`FilterError`] if the lane does not exist, the belief is not finite or positive definite, or its axes are
    /// correlated.
    pub fn set(&mut self, lane: usize, belief: &Gaussian<4, T>) -> Result<(), FilterError> {
        crate::check::check_belief(belief)?;
        crate::linalg::ud_factorize(&belief.cov)?;
        let p = &belief.cov;
        if lane >= L || [(0, 2), (0, 3), (1, 2), (1, 3)].iter().any(|&at| p[at] != T::zero()) {
            return Err(FilterError::OutOfRange("a lane that exists, and axes without correlation"));
        }
        for axis in 0..2 {
            let i = 2 * axis;
            self.x[axis][lane] = belief.mean[i];
            self.v[axis][lane] = belief.mean[i + 1];
            self.p00[axis][lane] = p[(i, i)];
            self.p01[axis][lane] = p[(i, i + 1)];
            self.p11[axis][lane] = p[(i + 1, i + 1)];
        }
        Ok(())
    }

    /// Returns the belief of a lane in `[x, vx, y, vy]`; `None` if there is no such lane.
    pub fn get(&self, lane: usize) -> Option<Gaussian<4, T>> {
        if lane >= L {
            return None;
        }
        let mut b = Gaussian { mean: SVector::zeros(), cov: SMatrix::zeros() };
        for axis in 0..2 {
            let i = 2 * axis;
            b.mean[i] = self.x[axis][lane];
            b.mean[i + 1] = self.v[axis][lane];
            b.cov[(i, i)] = self.p00[axis][lane];
            b.cov[(i, i + 1)] = self.p01[axis][lane];
            b.cov[(i + 1, i)] = self.p01[axis][lane];
            b.cov[(i + 1, i + 1)] = self.p11[axis][lane];
        }
        Some(b)
    }

    /// Predicts by `dt` with the noise of one axis (q00, q01, q11), then corrects by z with variances r.
    /// Returns whether all results are finite; if not the lanes are unchanged.
    #[inline(always)]
    fn step(&mut self, dt: T, q: (T, T, T), z: &[[T; L]; 2], r: &[[T; L]; 2]) -> bool {
        let mut next = *self;
        let mut fine = true;
        for axis in 0..2 {
            let (z, r) = (&z[axis], &r[axis]);
            for l in 0..L {
                let (v, b, c) = (self.v[axis][l], self.p01[axis][l], self.p11[axis][l]);
                let x = self.x[axis][l] + dt * v;
                let moved = b + dt * c;
                let p00 = self.p00[axis][l] + dt * (b + moved) + q.0;
                let p01 = moved + q.1;
                let p11 = c + q.2;
                let inv = T::one() / (p00 + r[l]);
                let (k0, k1) = (p00 * inv, p01 * inv);
                let nu = z[l] - x;
                // r/(p00 + r); for r = infinity it is 1, which 1 - k0 gives and r * inv does not.
                let rest = T::one() - k0;
                next.x[axis][l] = x + k0 * nu;
                next.v[axis][l] = v + k1 * nu;
                next.p00[axis][l] = p00 * rest;
                next.p01[axis][l] = p01 * rest;
                next.p11[axis][l] = p11 - k1 * p01;
                // NaN in any input, an overflow or a negative r reaches one of these.
                fine &= next.x[axis][l].abs() <= T::MAX;
                fine &= next.v[axis][l].abs() <= T::MAX;
                fine &= next.p11[axis][l] <= T::MAX;
                fine &= (r[l] >= T::zero()) & (inv <= T::MAX);
            }
        }
        if fine {
            *self = next;
        }
        fine
    }
}

/// Moves all tracks by `dt_s` seconds and corrects each by its position (x, y): track i is lane i % L of pack i / L.
/// Returns how many packs were refused because of a value that is not finite; those tracks are unchanged.
/// # Errors
/// [`FilterError`] if `dt_s` is not usable, `r` is not positive, or there are not as many positions as tracks fit
/// (the last pack may be partly filled).
pub fn step_all<const L: usize, T: Real>(
    model: &ConstantVelocity<T>,
    dt_s: T,
    packs: &mut [Lanes<L, T>],
    positions: &[[T; 2]],
    variance: Variance<'_, T>,
) -> Result<usize, FilterError> {
    crate::check::check_dt(dt_s)?;
    step_all_with(dt_s, model.noise_of_step(dt_s), packs, positions, variance)
}

/// [`step_all`] with the process noise of the step as numbers.
/// # Errors
/// As [`step_all`].
pub fn step_all_with<const L: usize, T: Real>(
    dt_s: T,
    noise: AxisNoise<T>,
    packs: &mut [Lanes<L, T>],
    positions: &[[T; 2]],
    variance: Variance<'_, T>,
) -> Result<usize, FilterError> {
    crate::check::check_dt(dt_s)?;
    if L == 0 || positions.len().div_ceil(L) != packs.len() {
        return Err(FilterError::OutOfRange("as many positions as tracks in the packs"));
    }
    match variance {
        Variance::Same(r) if !(r > T::zero()) => return Err(FilterError::OutOfRange("a variance above 0")),
        Variance::Each(each) if each.len() != positions.len() => {
            return Err(FilterError::OutOfRange("as many variances as positions"));
        }
        _ => {}
    }
    #[cfg(feature = "simd")]
    {
        // Asked once a call; the answer is cached by the crate.
        let level = fearless_simd::Level::new();
        Ok(fearless_simd::dispatch!(level, simd => {
            use fearless_simd::Simd as _;
            simd.vectorize(
                #[inline(always)]
                || run(noise, dt_s, packs, positions, variance),
            )
        }))
    }
    #[cfg(not(feature = "simd"))]
    Ok(run(noise, dt_s, packs, positions, variance))
}

#[inline(always)]
fn run<const L: usize, T: Real>(
    noise: AxisNoise<T>,
    dt: T,
    packs: &mut [Lanes<L, T>],
    positions: &[[T; 2]],
    variance: Variance<'_, T>,
) -> usize {
    let q = (noise.q00, noise.q01, noise.q11);
    let mut refused = 0;
    match variance {
        Variance::Same(r) => {
            let r = [[r; L]; 2];
            for (pack, z) in packs.iter_mut().zip(positions.chunks(L)) {
                refused += usize::from(!pack.step(dt, q, &gathered(z, T::zero()), &r));
            }
        }
        Variance::Each(each) => {
            for ((pack, z), r) in packs.iter_mut().zip(positions.chunks(L)).zip(each.chunks(L)) {
                // A missed scan may carry any position, also NaN.
                let (mut z, r) = (gathered(z, T::zero()), gathered(r, T::one()));
                for axis in 0..2 {
                    for l in 0..L {
                        if r[axis][l] > T::MAX {
                            z[axis][l] = pack.x[axis][l];
                        }
                    }
                }
                refused += usize::from(!pack.step(dt, q, &z, &r));
            }
        }
    }
    refused
}

/// Turns pairs (x, y) into arrays by axis; lanes without a pair get `rest`.
#[inline(always)]
fn gathered<const L: usize, T: Real>(pairs: &[[T; 2]], rest: T) -> [[T; L]; 2] {
    let mut out = [[rest; L]; 2];
    if let Some(full) = pairs.first_chunk::<L>() {
        for (l, [x, y]) in full.iter().enumerate() {
            out[0][l] = *x;
            out[1][l] = *y;
        }
    } else {
        for (l, [x, y]) in pairs.iter().enumerate().take(L) {
            out[0][l] = *x;
            out[1][l] = *y;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{GaussianFilter, Kf, Measurement, Start};
    use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};

    #[test]
    fn every_lane_gives_the_answer_of_its_own_kalman_filter() {
        let model = ConstantVelocity::continuous(0.4).unwrap();
        let n = 11;
        let mut packs = [Lanes::<4>::default(); 3];
        let start: [Gaussian<4>; 11] = core::array::from_fn(|i| Gaussian {
            mean: Vector4::new(i as f64, 1.0, -(i as f64), 0.5),
            cov: Matrix4::from_diagonal(&Vector4::new(1.0, 2.0, 0.5 + i as f64, 1.0)),
        });
        let mut kfs = start.map(|b| Kf::start(model, b).unwrap());
        for i in 0..n {
            packs[i / 4].set(i % 4, &start[i]).unwrap();
        }
        for k in 0..30 {
            let z: [[f64; 2]; 11] =
                core::array::from_fn(|i| [i as f64 + 0.3 * f64::from(k), f64::from((k * 7 + i as i32) % 5)]);
            // Track 3 is not seen at every other scan, whatever stands in its place.
            let mut seen = z;
            let r: [[f64; 2]; 11] =
                core::array::from_fn(|i| if i == 3 && k % 2 == 0 { [f64::INFINITY; 2] } else { [0.3, 0.1 + i as f64] });
            if k % 2 == 0 {
                seen[3] = [f64::NAN; 2];
            }
            assert_eq!(step_all(&model, 0.3, &mut packs, &seen, Variance::Each(&r)).unwrap(), 0);
            for i in 0..n {
                kfs[i].predict(0.3).unwrap();
                if r[i][0] < f64::MAX {
                    let cov = Matrix2::from_diagonal(&Vector2::new(r[i][0], r[i][1]));
                    kfs[i].correct(&Measurement { position: Vector2::new(z[i][0], z[i][1]), cov }).unwrap();
                }
            }
        }
        for i in 0..n {
            let (a, b) = (packs[i / 4].get(i % 4).unwrap(), kfs[i].belief());
            assert!((a.mean - b.mean).norm() < 1e-10 && (a.cov - b.cov).norm() < 1e-10, "track {i}");
        }
    }

    #[test]
    fn a_nan_is_refused_with_its_pack_and_told() {
        let model = ConstantVelocity::discrete(1.0).unwrap();
        let mut packs = [Lanes::<2>::default(); 2];
        let before = packs[0];
        let z = [[1.0, 2.0], [f64::NAN, 0.0], [1.0, 1.0]];
        assert_eq!(step_all(&model, 1.0, &mut packs, &z, Variance::Same(0.5)).unwrap(), 1);
        assert_eq!(packs[0], before);
        assert_ne!(packs[1], before);
        assert!(step_all(&model, 1.0, &mut packs, &z[..2], Variance::Same(0.5)).is_err());
        assert!(step_all(&model, f64::NAN, &mut packs, &z, Variance::Same(0.5)).is_err());
        assert!(step_all(&model, 1.0, &mut packs, &z, Variance::Same(0.0)).is_err());
    }
}
