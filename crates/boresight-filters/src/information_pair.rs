//! The information pair [R | y] of a Gaussian: R x = y - ν, ν ~ N(0, I), so that P = R⁻¹ R⁻ᵀ and the mean is R⁻¹ y.
//!
//! Source: G. J. Bierman, *Factorization Methods for Discrete Sequential Estimation*, 1977, ch. V-VI.
//! Symbols: r N x N upper triangular, diagonal >= 0 (1/px); y N x 1 (no unit).

use crate::linalg::{eliminate, fold_rows, mul, triangularize, ud_factorize};
use crate::{FilterError, Gaussian, Real};
use nalgebra::{SMatrix, SVector};

/// The information pair [R | y]: R x = y - ν with ν ~ N(0, I).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InformationPair<const N: usize, T = f64> {
    /// Upper triangular root of the information matrix, diagonal at least 0.
    pub r: SMatrix<T, N, N>,
    /// R times the mean.
    pub y: SVector<T, N>,
}

impl<const N: usize, T: Real> InformationPair<N, T> {
    /// Returns the pair of a belief.
    /// # Errors
    /// [`FilterError::NotPositiveDefinite`] if its covariance cannot be inverted.
    pub fn from_belief(b: &Gaussian<N, T>) -> Result<Self, FilterError> {
        // P = U D Uᵀ gives R = D^-1/2 U⁻¹ without forming P⁻¹.
        let f = ud_factorize(&b.cov)?;
        let mut r = SMatrix::<T, N, N>::identity();
        for c in 0..N {
            for i in (0..c).rev() {
                let mut v = T::zero();
                for k in i + 1..=c {
                    v -= f.u[(i, k)] * r[(k, c)];
                }
                r[(i, c)] = v;
            }
        }
        for i in 0..N {
            if !(f.d[i] > T::zero()) {
                return Err(FilterError::NotPositiveDefinite("the state covariance"));
            }
            let scale = T::one() / f.d[i].sqrt();
            for c in i..N {
                r[(i, c)] *= scale;
            }
        }
        Ok(Self { r, y: mul(&r, &b.mean) })
    }

    /// Returns the mean R⁻¹ y.
    #[inline]
    pub fn mean(&self) -> SVector<T, N> {
        let mut x = self.y;
        for i in (0..N).rev() {
            for k in i + 1..N {
                let less = self.r[(i, k)] * x[k];
                x[i] -= less;
            }
            x[i] /= self.r[(i, i)];
        }
        x
    }

    /// Returns R⁻¹, upper triangular.
    #[inline]
    pub fn root_cov(&self) -> SMatrix<T, N, N> {
        let mut s = SMatrix::<T, N, N>::zeros();
        for c in 0..N {
            s[(c, c)] = T::one() / self.r[(c, c)];
            for i in (0..c).rev() {
                let mut v = T::zero();
                for k in i + 1..=c {
                    v -= self.r[(i, k)] * s[(k, c)];
                }
                s[(i, c)] = v / self.r[(i, i)];
            }
        }
        s
    }

    /// Returns mean and covariance.
    pub fn belief(&self) -> Gaussian<N, T> {
        let s = self.root_cov();
        let mut cov = SMatrix::<T, N, N>::zeros();
        for c in 0..N {
            for i in 0..=c {
                let mut v = T::zero();
                for k in c..N {
                    v += s[(i, k)] * s[(c, k)];
                }
                cov[(i, c)] = v;
                cov[(c, i)] = v;
            }
        }
        Gaussian { mean: self.mean(), cov }
    }

    /// Adds M whitened measurement rows (unit noise) and returns the whitened residual e; |e|² = νᵀ S⁻¹ ν.
    ///
    /// The worked example of `docs/theory/filters.md`:
    /// ```
    /// use boresight_filters::{Gaussian, srif::InformationPair};
    /// use nalgebra::{Matrix2x4, Matrix4, Vector2, Vector4};
    /// let mut cov = Matrix4::from_diagonal(&Vector4::new(0.5, 0.03, 0.5, 0.03));
    /// (cov[(0, 1)], cov[(1, 0)]) = (0.05, 0.05);
    /// let mut pair = InformationPair::from_belief(&Gaussian { mean: Vector4::new(11.0, 1.0, 11.0, 1.0), cov }).unwrap();
    /// assert!((pair.r[(0, 1)] + 2.5819888974716_f64).abs() < 1e-12);
    /// let white = 1.0 / 0.5_f64.sqrt();
    /// let h = Matrix2x4::new(white, 0.0, 0.0, 0.0, 0.0, 0.0, white, 0.0);
    /// let e = pair.measure(&h, &(Vector2::new(11.4, 10.8) * white));
    /// assert!((e.norm_squared() - 0.2).abs() < 1e-12);
    /// assert!((pair.mean() - Vector4::new(11.2, 1.02, 10.9, 1.0)).norm() < 1e-12);
    /// // One second of constant velocity with Q = 1e-5 I.
    /// let back = Matrix4::new(1., -1., 0., 0., 0., 1., 0., 0., 0., 0., 1., -1., 0., 0., 0., 1.);
    /// let q = 1e-5_f64.sqrt();
    /// let g = nalgebra::Matrix4x2::new(0.5 * q, 0., q, 0., 0., 0.5 * q, 0., q);
    /// pair.propagate(&back, &g);
    /// assert!((pair.r[(0, 1)] + 4.0032936493944).abs() < 1e-12);
    /// assert!((pair.y[0] - 21.548409516051).abs() < 1e-11);
    /// assert!((pair.mean() - Vector4::new(12.22, 1.02, 11.9, 1.0)).norm() < 1e-12);
    /// ```
    #[inline]
    pub fn measure<const M: usize>(&mut self, h_white: &SMatrix<T, M, N>, z_white: &SVector<T, M>) -> SVector<T, M> {
        let (mut h, mut e) = (*h_white, *z_white);
        fold_rows(&mut self.r, &mut self.y, &mut h, &mut e);
        e
    }

    /// Moves the pair by x' = Phi x + G L w, w ~ N(0, I), given Phi⁻¹ and G L (any rank, zero allowed).
    #[inline]
    pub fn propagate<const W: usize>(&mut self, phi_inverse: &SMatrix<T, N, N>, noise_root: &SMatrix<T, N, W>) {
        self.r = mul(&self.r, phi_inverse);
        self.spread(noise_root);
    }

    /// The second half of [`InformationPair::propagate`]: R is R Phi⁻¹ already.
    #[inline(always)]
    pub(crate) fn spread<const W: usize>(&mut self, noise_root: &SMatrix<T, N, W>) {
        let Self { r, y } = self;
        let mut a = mul(r, noise_root) * -T::one();
        eliminate(&mut a, r, y);
        triangularize(r, y);
    }
}
