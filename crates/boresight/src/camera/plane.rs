//! The motion of a plane from matches of its points: a translation, similarity, affine or projective correction of a prediction, chosen by evidence.
//!
//! Source: Gauss-Newton on the first-order basis of each group about the prediction, with Tukey's biweight; the choice by the Bayesian information
//! criterion (G. Schwarz, *Annals of Statistics* 6, 1978) with a robust loss at one scale for all groups, as P. Torr has it for image motions (*IJCV* 50, 2002).
//! How: residuals are small beforehand (a patch is looked for within a pixel), so that no sampling is needed: the weights' reach falls from three times
//! the median residual's deviation on. The larger groups contain the smaller ones; each is fitted from the same prediction.
//! Symbols: u = (p - middle) / half width, in (-1, 1); d displacement (px) = Σ θ_i b_i(u), b = (1, 0), (0, 1) | u, (-v, u) | (u, -v), (v, u) | u u, v u;
//! k parameters; criterion = Σ ρ(r / s) + k ln(2 m), s the least of the groups' robust deviations of an axis, ρ Tukey's loss (r²/s² for small r), m the
//! matches within its reach. A median's deviation of each group in the place of ρ would scatter more than the few numbers that it is to decide about.
//! Limits: one plane; what lies off it is a residual (parallax), of which [`Plane::spread_px`] knows.

use super::fit::Match;
use crate::Homography;
use nalgebra::{Matrix3, SMatrix, SVector, Vector2};

/// Numbers of the groups: translation, similarity, affine, projective.
const GROUPS: [usize; 4] = [2, 4, 6, 8];
/// Share of the weight that must agree with the plane.
const MAJORITY: f64 = 0.4;
/// Matches for each number of a group, at least.
const MATCHES_A_NUMBER: usize = 2;
/// Rounds of reweighting.
const ROUNDS: usize = 6;
/// Matches nearer than this to the fit are all the same to it, px: what a patch of noise and aliasing can tell.
const SHARP: f64 = 0.03;
/// Tukey's reach in deviations.
const REACH: f64 = 4.7;
/// Matches that are looked at, at most.
pub(super) const MOST_MATCHES: usize = 128;
/// Matches that must agree.
const LEAST_MATCHES: usize = 8;

/// A plane's motion.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    pub to_from: Homography,
    /// Robust deviation of the matches from it, px an axis.
    pub spread_px: f64,
    /// Numbers of the group that was chosen.
    #[cfg_attr(not(test), expect(dead_code, reason = "what the tests look at"))]
    pub n_numbers: usize,
}

type Basis = SMatrix<f64, 8, 2>;

/// What each number of a correction moves at a point, px; `k` of them.
fn basis(u: Vector2<f64>, k: usize) -> Basis {
    let (x, y) = (u.x, u.y);
    let mut b = Basis::from_row_slice(&[1.0, 0.0, 0.0, 1.0, x, y, -y, x, x, -y, y, x, x * x, x * y, x * y, y * y]);
    b.rows_mut(k, 8 - k).fill(0.0);
    b
}

/// The correction as a homography of px about `middle`.
fn correction(theta: &SVector<f64, 8>, middle: Vector2<f64>, half: f64) -> Option<Homography> {
    let t = theta / half;
    let unit =
        Matrix3::new(1.0 + t[2] + t[4], -t[3] + t[5], t[0], t[3] + t[5], 1.0 + t[2] - t[4], t[1], -t[6], -t[7], 1.0);
    let to_unit = Matrix3::new(1.0 / half, 0.0, -middle.x / half, 0.0, 1.0 / half, -middle.y / half, 0.0, 0.0, 1.0);
    let to_px = Matrix3::new(half, 0.0, middle.x, 0.0, half, middle.y, 0.0, 0.0, 1.0);
    Homography::of_matrix(to_px * unit * to_unit)
}

/// Robust deviation of the residuals, px an axis: the median of Rayleigh's distribution is 1.1774 of it.
fn spread(matches: &[Match], at: &Homography) -> f64 {
    let mut residuals = [0.0; MOST_MATCHES];
    let residuals = &mut residuals[..matches.len()];
    residuals.iter_mut().zip(matches).for_each(|(r, m)| *r = (m.to - at.apply(m.from)).norm());
    let middle = matches.len() / 2;
    (*residuals.select_nth_unstable_by(middle, f64::total_cmp).1 / 1.1774).max(SHARP)
}

/// The fit of one group.
fn settle(matches: &[Match], predicted: &Homography, middle: Vector2<f64>, k: usize) -> Option<Homography> {
    let half = middle.x.max(middle.y).max(1.0);
    let mut at = *predicted;
    for round in 0..ROUNDS {
        let spread = spread(matches, &at);
        let reach = if round == 0 { 2.0 * REACH } else { REACH } * spread;
        let (mut square, mut pull) = (SMatrix::<f64, 8, 8>::identity() * 1e-9, SVector::<f64, 8>::zeros());
        let (mut sum, mut n, mut all) = (0.0, 0usize, 0.0);
        for m in matches {
            all += m.weight;
            let r = (m.to - at.apply(m.from)).norm();
            let q = (r / reach).powi(2);
            if q >= 1.0 {
                continue;
            }
            let w = m.weight * (1.0 - q).powi(2);
            let to = at.apply(m.from);
            let b = basis((to - middle) / half, k);
            square += w * b * b.transpose();
            pull += w * b * (m.to - to);
            (sum, n) = (sum + w, n + 1);
        }
        if n < LEAST_MATCHES.max(MATCHES_A_NUMBER * k / 2) || sum < 0.5 * MAJORITY * all {
            return None;
        }
        let theta = square.cholesky()?.solve(&pull);
        at = at.then(&correction(&theta, middle, half)?);
    }
    Some(at)
}

/// Tukey's loss of all matches from a fit, at that deviation, and how many lie within its reach.
fn loss(matches: &[Match], at: &Homography, spread_px: f64) -> (f64, usize) {
    let (mut sum, mut n) = (0.0, 0);
    for m in matches {
        let q = ((m.to - at.apply(m.from)).norm() / (REACH * spread_px)).powi(2);
        // A distance that is no number lies beyond the reach.
        let inside = q < 1.0;
        let left = if inside { (1.0 - q).powi(3) } else { 0.0 };
        sum += REACH * REACH / 3.0 * (1.0 - left);
        n += usize::from(inside);
    }
    (sum, n)
}

/// The motion that most matches agree with, close to the predicted one; `middle` is the image's, px.
pub(super) fn fit(matches: &[Match], predicted: &Homography, middle: Vector2<f64>) -> Option<Plane> {
    let matches = &matches[..matches.len().min(MOST_MATCHES)];
    if matches.len() < LEAST_MATCHES {
        return None;
    }
    let mut fits = [None; GROUPS.len()];
    for (fit, k) in fits.iter_mut().zip(GROUPS) {
        if matches.len() < MATCHES_A_NUMBER * k {
            break;
        }
        *fit = settle(matches, predicted, middle, k).map(|at| (at, spread(matches, &at)));
    }
    let least = fits.iter().flatten().map(|f| f.1).fold(f64::INFINITY, f64::min);
    let mut best: Option<(f64, Plane)> = None;
    for (fit, k) in fits.into_iter().zip(GROUPS) {
        let Some((to_from, spread_px)) = fit else { continue };
        let (loss, n) = loss(matches, &to_from, least);
        let criterion = loss + k as f64 * (2.0 * n.max(1) as f64).ln();
        if best.as_ref().is_none_or(|(b, _)| criterion < *b) {
            best = Some((criterion, Plane { to_from, spread_px, n_numbers: k }));
        }
    }
    best.map(|(_, plane)| plane)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    const MIDDLE: Vector2<f64> = Vector2::new(255.5, 134.5);

    /// 96 matches with a noise of 0.05 px, a third of them off by up to a pixel.
    fn matches(truth: &Homography, seed: u64) -> Vec<Match> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        (0..96)
            .map(|i| {
                let from = Vector2::new(20.0 + 40.0 * f64::from(i % 12), 20.0 + 32.0 * f64::from(i / 12));
                let noise: [f64; 2] = std::array::from_fn(|_| StandardNormal.sample(&mut rng));
                let astray = if i % 3 == 1 { 0.3 + 0.7 * rng.random::<f64>() } else { 0.0 };
                let to = truth.apply(from) + 0.05 * Vector2::from(noise) + astray * Vector2::new(1.0, -0.5);
                Match { from, to, weight: 1.0 }
            })
            .collect()
    }

    /// The largest error of a fit at the corners, and its numbers.
    fn error(truth: [f64; 8], seed: u64) -> (f64, usize) {
        let truth = correction(&SVector::from(truth), MIDDLE, MIDDLE.x).unwrap();
        let found = fit(&matches(&truth, seed), &Homography::identity(), MIDDLE).unwrap();
        let corners = [(0.0, 0.0), (511.0, 0.0), (0.0, 269.0), (511.0, 269.0)].map(|(x, y)| Vector2::new(x, y));
        let far = corners.into_iter().map(|c| (found.to_from.apply(c) - truth.apply(c)).norm()).fold(0.0, f64::max);
        (far, found.n_numbers)
    }

    #[test]
    fn each_kind_of_motion_is_found_among_strangers_by_its_own_group() {
        let mut right = [0; 4];
        for seed in 0..50 {
            let kinds = [
                [0.4, -0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
                [0.4, -0.3, 0.5, -0.4, 0.0, 0.0, 0.0, 0.0],
                [0.4, -0.3, 0.3, -0.2, 0.4, 0.3, 0.0, 0.0],
                [0.4, -0.3, 0.2, 0.1, -0.2, 0.1, 0.5, 0.4],
            ];
            for (i, truth) in kinds.into_iter().enumerate() {
                let (far, k) = error(truth, seed);
                // The corner of a projective fit of 64 matches of 0.05 px deviates by some 0.03 px.
                assert!(far < 0.12, "{truth:?}, seed {seed}: {far}");
                right[i] += usize::from(k == GROUPS[i]);
            }
        }
        assert!(right.iter().all(|r| *r >= 40), "{right:?}");
    }

    #[test]
    fn too_few_matches_have_no_plane() {
        let few: Vec<Match> = matches(&Homography::identity(), 1).into_iter().take(7).collect();
        assert!(fit(&few, &Homography::identity(), MIDDLE).is_none());
    }
}
