//! Covariance intersection and inverse covariance intersection: fusion of two beliefs whose correlation is not known.
//!
//! Source: S. J. Julier, J. K. Uhlmann, *Proc. American Control Conference*, 1997 (CI): P⁻¹ = ω P_i⁻¹ + (1−ω) P_j⁻¹;
//! B. Noack, J. Sijs, M. Reinhardt, U. D. Hanebeck, *Automatica* 79, 2017 (ICI): P⁻¹ = P_i⁻¹ + P_j⁻¹ − (ω P_i + (1−ω) P_j)⁻¹.
//! ω in [0, 1] minimises the trace of P (golden section: trace is quasi-convex along ω for CI; for ICI the best of the section
//! and both ends). CI is consistent for any correlation; ICI is tighter and consistent where the common part of the estimates
//! is common information. Symbols: x N x 1, P N x N. Limits: states of mixed units are weighed as their numbers stand.

use super::track_to_track::not_definite;
use crate::Result;
use boresight_filters::Gaussian;
use nalgebra::SMatrix;

/// A fused belief and the weight that was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intersection<const N: usize> {
    /// The fused belief.
    pub belief: Gaussian<N>,
    /// Weight ω of the first belief, 0..=1.
    pub weight: f64,
}

type Square<const N: usize> = SMatrix<f64, N, N>;

fn inverse<const N: usize>(m: &Square<N>) -> Option<Square<N>> {
    let c = m.cholesky()?.inverse();
    Some((c + c.transpose()) * 0.5)
}

/// Fuses by covariance intersection.
/// # Errors
/// [`crate::ErrorKind::Numeric`] if a covariance is not positive definite.
pub fn covariance_intersection<const N: usize>(i: &Gaussian<N>, j: &Gaussian<N>) -> Result<Intersection<N>> {
    let (yi, yj) = (information(i)?, information(j)?);
    let at = |w: f64| inverse(&(yi * w + yj * (1.0 - w)));
    let weight = least(|w| at(w).map_or(f64::INFINITY, |p| p.trace()));
    let cov = at(weight).ok_or_else(|| not_definite("the intersection's information"))?;
    let mean = cov * (yi * i.mean * weight + yj * j.mean * (1.0 - weight));
    Ok(Intersection { belief: Gaussian { mean, cov }, weight })
}

/// Fuses by inverse covariance intersection.
/// # Errors
/// [`crate::ErrorKind::Numeric`] if a covariance is not positive definite.
pub fn inverse_covariance_intersection<const N: usize>(i: &Gaussian<N>, j: &Gaussian<N>) -> Result<Intersection<N>> {
    let (yi, yj) = (information(i)?, information(j)?);
    let common = |w: f64| inverse(&(i.cov * w + j.cov * (1.0 - w)));
    let at = |w: f64| common(w).and_then(|c| inverse(&(yi + yj - c)));
    let weight = least(|w| at(w).map_or(f64::INFINITY, |p| p.trace()));
    let (Some(c), Some(cov)) = (common(weight), at(weight)) else {
        return Err(not_definite("the intersection's information"));
    };
    let (ki, kj) = (cov * (yi - c * weight), cov * (yj - c * (1.0 - weight)));
    Ok(Intersection { belief: Gaussian { mean: ki * i.mean + kj * j.mean, cov }, weight })
}

fn information<const N: usize>(g: &Gaussian<N>) -> Result<Square<N>> {
    inverse(&g.cov).ok_or_else(|| not_definite("a track's covariance"))
}

/// The place of the least value on [0, 1], to 1e-7.
fn least(f: impl Fn(f64) -> f64) -> f64 {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let (mut a, mut b) = (0.0, 1.0);
    let (mut x, mut y) = (b - GOLDEN * (b - a), a + GOLDEN * (b - a));
    let (mut fx, mut fy) = (f(x), f(y));
    while b - a > 1e-7 {
        if fx <= fy {
            (b, y, fy) = (y, x, fx);
            x = b - GOLDEN * (b - a);
            fx = f(x);
        } else {
            (a, x, fx) = (x, y, fy);
            y = a + GOLDEN * (b - a);
            fy = f(y);
        }
    }
    // The ends themselves are exact answers when one belief is better in everything.
    let middle = 0.5 * (a + b);
    [0.0, 1.0, middle].into_iter().min_by(|p, q| f(*p).total_cmp(&f(*q))).unwrap_or(middle)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fuse::track_to_track::{fuse_correlated, fuse_independent};
    use nalgebra::{Matrix2, Vector2};
    use proptest::prelude::*;

    fn belief(v: [f64; 5]) -> Gaussian<2> {
        let l = Matrix2::new(v[0], 0.0, v[1], v[2]);
        Gaussian { mean: Vector2::new(v[3], v[4]), cov: l * l.transpose() }
    }

    fn root(p: &Matrix2<f64>) -> Matrix2<f64> {
        p.cholesky().unwrap().l()
    }

    fn any_belief() -> impl Strategy<Value = Gaussian<2>> {
        (0.1..3.0, -2.0..2.0, 0.1..3.0, -5.0..5.0, -5.0..5.0).prop_map(|(a, b, c, d, e)| belief([a, b, c, d, e]))
    }

    proptest! {
        #[test]
        fn ci_covers_the_true_error_for_any_correlation(a in any_belief(), b in any_belief(), c in -0.99..0.99f64, turn in 0.0..6.3f64) {
            // Errors e_i = L_i u, e_j = L_j v with E[u vᵀ] = c Rot(turn): any such pair is possible.
            let f = covariance_intersection(&a, &b).unwrap();
            let cross = root(&a.cov) * nalgebra::Rotation2::new(turn).matrix() * c * root(&b.cov).transpose();
            let (yi, yj) = (inverse(&a.cov).unwrap(), inverse(&b.cov).unwrap());
            let (ki, kj) = (f.belief.cov * yi * f.weight, f.belief.cov * yj * (1.0 - f.weight));
            let true_cov = ki * a.cov * ki.transpose() + kj * b.cov * kj.transpose() + ki * cross * kj.transpose() + kj * cross.transpose() * ki.transpose();
            let least = (f.belief.cov - true_cov).symmetric_eigenvalues().min();
            prop_assert!(least > -1e-8 * f.belief.cov.trace(), "{least}");
        }

        #[test]
        fn intersections_lie_between_the_better_track_and_naive_fusion(a in any_belief(), b in any_belief()) {
            let ci = covariance_intersection(&a, &b).unwrap().belief.cov.trace();
            let ici = inverse_covariance_intersection(&a, &b).unwrap().belief.cov.trace();
            let naive = fuse_independent(&a, &b).unwrap().cov.trace();
            let better = a.cov.trace().min(b.cov.trace());
            prop_assert!(naive <= ici * (1.0 + 1e-9) && ici <= ci * (1.0 + 1e-6) && ci <= better * (1.0 + 1e-9), "{naive} {ici} {ci} {better}");
        }

        #[test]
        fn no_weights_give_less_error_than_the_known_cross_covariance(a in any_belief(), b in any_belief(), c in -0.9..0.9f64, w in -0.5..1.5f64) {
            let cross = root(&a.cov) * c * root(&b.cov).transpose();
            let f = fuse_correlated(&a, &b, &cross).unwrap();
            let v = 1.0 - w;
            let other = a.cov * w * w + b.cov * v * v + (cross + cross.transpose()) * w * v;
            prop_assert!(f.cov.trace() <= other.trace() + 1e-9);
        }
    }

    #[test]
    fn two_copies_of_one_track_stay_one_track() {
        let a = belief([1.0, 0.3, 2.0, 1.0, -1.0]);
        for f in [covariance_intersection(&a, &a).unwrap(), inverse_covariance_intersection(&a, &a).unwrap()] {
            assert!((f.belief.cov - a.cov).norm() < 1e-9 && (f.belief.mean - a.mean).norm() < 1e-9);
        }
        assert!((fuse_independent(&a, &a).unwrap().cov - a.cov * 0.5).norm() < 1e-9, "naive fusion halves it wrongly");
    }

    #[test]
    fn a_covariance_without_an_inverse_is_refused() {
        let a = belief([1.0, 0.0, 1.0, 0.0, 0.0]);
        let flat = Gaussian { mean: a.mean, cov: Matrix2::new(1.0, 1.0, 1.0, 1.0) };
        assert!(covariance_intersection(&a, &flat).is_err());
        assert!(
            fuse_independent(
                &Gaussian { mean: a.mean, cov: Matrix2::zeros() },
                &Gaussian { mean: a.mean, cov: Matrix2::zeros() }
            )
            .is_err()
        );
    }
}
