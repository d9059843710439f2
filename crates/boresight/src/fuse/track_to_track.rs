//! Track-to-track fusion: two beliefs of one target become one.
//!
//! Source: `docs/theory/fusion.md` (thesis eqs 4.44-4.46, corrected): S = P_i + P_j − C − Cᵀ, W = (P_i − C) S⁻¹,
//! x = x_i + W (x_j − x_i), P = P_i − W (P_i − C)ᵀ; C = E[e_i e_jᵀ] is zero for independent errors (the papers' form)
//! and not zero where tracks share process noise or prior (Y. Bar-Shalom, L. Campo, *IEEE Trans. AES* 22, 1986).
//! Differs from it: P is summed as V P_i Vᵀ + W P_j Wᵀ + V C Wᵀ + (V C Wᵀ)ᵀ with V = I − W solved for by itself: the same, but no
//! difference, so that a track of variance 10⁻¹² keeps it beside one of 10¹².
//! Symbols: x N x 1, P, C, S, W N x N. Units: those of the state. Limits: with independent errors assumed wrongly the result is
//! over-confident: take [`super::covariance_intersection`] where the correlation is not known.

use crate::{Error, ErrorKind, Result};
use boresight_filters::Gaussian;
use nalgebra::SMatrix;

/// Fuses two beliefs with independent errors.
///
/// ```
/// use boresight::fuse::fuse_independent;
/// use boresight_filters::Gaussian;
/// use nalgebra::{Matrix2, Matrix4, Vector4};
/// // The worked example of docs/theory/fusion.md.
/// let blocks = |b: Matrix2<f64>| {
///     let mut p = Matrix4::zeros();
///     p.fixed_view_mut::<2, 2>(0, 0).copy_from(&b);
///     p.fixed_view_mut::<2, 2>(2, 2).copy_from(&b);
///     p
/// };
/// let i = Gaussian { mean: Vector4::new(30.0, 1.0, 20.0, -1.0), cov: blocks(Matrix2::new(1.0, 0.2, 0.2, 0.1)) };
/// let j = Gaussian { mean: Vector4::new(31.0, 0.8, 19.5, -1.1), cov: blocks(Matrix2::new(0.5, 0.05, 0.05, 0.2)) };
/// let c = fuse_independent(&i, &j).unwrap();
/// let x = [30.61935483871, 1.0387096774194, 19.664516129032, -1.0709677419355];
/// assert!(c.mean.iter().zip(x).all(|(a, b)| (a - b).abs() < 1e-11));
/// assert!((c.cov[(0, 0)] - 0.32903225806452).abs() < 1e-13 && (c.cov[(1, 1)] - 0.056129032258065).abs() < 1e-13);
/// ```
/// # Errors
/// [`ErrorKind::Numeric`] if P_i + P_j is not positive definite or a number is not finite.
pub fn fuse_independent<const N: usize>(i: &Gaussian<N>, j: &Gaussian<N>) -> Result<Gaussian<N>> {
    fuse_correlated(i, j, &SMatrix::zeros())
}

/// Fuses two beliefs with known cross covariance C = E[e_i e_jᵀ] of their errors (Bar-Shalom and Campo).
/// # Errors
/// [`ErrorKind::Numeric`] if the covariance of the difference is not positive definite or a number is not finite.
pub fn fuse_correlated<const N: usize>(
    i: &Gaussian<N>,
    j: &Gaussian<N>,
    cross: &SMatrix<f64, N, N>,
) -> Result<Gaussian<N>> {
    let s = difference_cov(i, j, cross);
    // W = (P_i − C) S⁻¹ is solved for as S Wᵀ = (P_i − C)ᵀ; V = I − W = (P_j − Cᵀ) S⁻¹ likewise.
    let w = solve(&s, &(i.cov - cross).transpose())?.transpose();
    let v = solve(&s, &(j.cov - cross.transpose()).transpose())?.transpose();
    // From the belief that counts more: the step to it from a vague one would carry the vague one's rounding.
    let step = j.mean - i.mean;
    let mean = if w.trace() > v.trace() { j.mean - v * step } else { i.mean + w * step };
    let both = v * cross * w.transpose();
    let cov = v * i.cov * v.transpose() + w * j.cov * w.transpose() + both + both.transpose();
    let fused = Gaussian { mean, cov: (cov + cov.transpose()) * 0.5 };
    if fused.mean.iter().chain(fused.cov.iter()).any(|v| !v.is_finite()) {
        return Err(Error::new(ErrorKind::Numeric, "the fused belief is not finite").at("track fusion"));
    }
    Ok(fused)
}

fn difference_cov<const N: usize>(i: &Gaussian<N>, j: &Gaussian<N>, cross: &SMatrix<f64, N, N>) -> SMatrix<f64, N, N> {
    i.cov + j.cov - cross - cross.transpose()
}

pub(super) fn not_definite(what: &str) -> Error {
    Error::new(ErrorKind::Numeric, format!("{what} is not positive definite"))
        .at("track fusion")
        .hint("check the covariances: every track needs a positive definite one")
}

pub(super) fn solve<const N: usize>(s: &SMatrix<f64, N, N>, b: &SMatrix<f64, N, N>) -> Result<SMatrix<f64, N, N>> {
    Ok(s.cholesky().ok_or_else(|| not_definite("the covariance of the tracks' difference"))?.solve(b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Vector2};

    #[test]
    fn a_vague_track_does_not_spoil_the_digits_of_a_sharp_one() {
        let turn = *nalgebra::Rotation2::new(0.7).matrix();
        let along = |v: [f64; 2]| turn * Matrix2::from_diagonal(&Vector2::from(v)) * turn.transpose();
        let x = Vector2::new(3.0, -2.0);
        for ratio in [1e3, 1e12, 1e24] {
            let vague = Gaussian { mean: x + Vector2::new(1.0, 1.0), cov: along([2.0 * ratio, 3.0 * ratio]) };
            let sharp = Gaussian { mean: x, cov: along([0.5, 0.25]) };
            // Both have the same axes: along each the variance is ab/(a + b).
            let want = along([2.0 * ratio / (4.0 * ratio + 1.0), 3.0 * ratio / (12.0 * ratio + 1.0)]);
            for (i, j) in [(&vague, &sharp), (&sharp, &vague)] {
                let f = fuse_independent(i, j).unwrap();
                assert!((f.cov - want).amax() < 1e-12, "{ratio}: {} instead of {want}", f.cov);
                assert!((f.mean - x).amax() < 1.1 / ratio, "{ratio}: {}", f.mean);
            }
        }
    }
}
