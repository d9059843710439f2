//! Whether a fit lies between motions: whether what it leaves of neighbouring matches points one way.
//!
//! Source: the cross products of spatial autocorrelation (P. Moran, *Biometrika* 37, 1950, whose I these are up to a scale) with the null distribution of signs drawn at random
//! (M. Dwass, *Annals of Mathematical Statistics* 28, 1957), as for residuals in A. Cliff, J. Ord, *Spatial Processes*, 1981, chapter 8.
//! How: under a good fit what is left of a match is the noise of its own pixels, independent of its neighbours'. A fit between two motions leaves each thing's matches on its own side.
//! With T = Σ ψ_i · ψ_j over the pairs of neighbours and signs at random the pairs are uncorrelated, so that Var T = Σ (ψ_i · ψ_j)², whatever the matches' own deviations are; T / √Var T is
//! nearly normal with that many pairs. The numbers fitted make T a little smaller: the test errs towards believing.
//! Symbols: ψ residual (px) times Tukey's weight: what a thing leaves that lies beyond the fit's reach is no part of it.
//! Limits: parallax, a codec and a lens point one way too, so that it is no word against a motion, only against the independence of its residuals ([`super::plane_cov`]); fewer than
//! [`LEAST_PAIRS`] pairs say nothing.

use super::fit::Match;
use super::plane::{MOST_MATCHES, REACH};
use crate::Homography;
use nalgebra::Vector2;

/// Normal deviate that T exceeds by chance in 1 % of good fits.
const MIXED: f64 = 2.326;
/// Matches nearer than this times the mean distance of neighbours in a square grid of as many over their bounding box are neighbours: √2 is the diagonal of such a grid, and half a step more is
/// what the choice of the best place of a cell adds.
const NEAR: f64 = 2.0;
/// Pairs of neighbours, at least, for the sum to be nearly normal.
const LEAST_PAIRS: usize = 20;

/// Whether what the fit leaves of neighbours points one way by more than chance.
pub(super) fn is_mixed(matches: &[Match], at: &Homography, spread_px: f64) -> bool {
    deviate(matches, at, spread_px).is_some_and(|z| z > MIXED)
}

/// T / √Var T; `None` where too few pairs are neighbours.
fn deviate(matches: &[Match], at: &Homography, spread_px: f64) -> Option<f64> {
    let matches = &matches[..matches.len().min(MOST_MATCHES)];
    let mut left = [Vector2::zeros(); MOST_MATCHES];
    let (mut low, mut high) = (Vector2::repeat(f64::INFINITY), Vector2::repeat(f64::NEG_INFINITY));
    let mut n = 0.0;
    for (l, m) in left.iter_mut().zip(matches) {
        *l = influence(m.to - at.apply(m.from), spread_px);
        (low, high, n) = (low.inf(&m.from), high.sup(&m.from), n + 1.0);
    }
    let extent = high - low;
    let near2 = NEAR * NEAR * extent.x * extent.y / f64::max(n, 1.0);
    let (mut sum, mut square, mut n_pairs) = (0.0, 0.0, 0);
    for (i, m) in matches.iter().enumerate() {
        for (j, other) in matches[..i].iter().enumerate() {
            let product = left[i].dot(&left[j]);
            if product != 0.0 && (m.from - other.from).norm_squared() <= near2 {
                (sum, square, n_pairs) = (sum + product, square + product * product, n_pairs + 1);
            }
        }
    }
    (n_pairs >= LEAST_PAIRS).then(|| sum / f64::sqrt(square))
}

/// A residual (px) times Tukey's weight for it; nothing beyond the reach.
fn influence(residual: Vector2<f64>, spread_px: f64) -> Vector2<f64> {
    let q = residual.norm_squared() / (REACH * spread_px).powi(2);
    // A distance that is no number lies beyond the reach.
    if q < 1.0 { residual * (1.0 - q).powi(2) } else { Vector2::zeros() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    /// 96 matches of a grid that do not move, with a noise whose deviation differs by ten times from match to match, px; those of the right `share` of the grid are off by so much.
    fn matches(share: f64, off_px: f64, seed: u64) -> Vec<Match> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        (0..96)
            .map(|i| {
                let from = Vector2::new(30.0 * f64::from(i % 12), 30.0 * f64::from(i / 12));
                let noise: [f64; 2] = std::array::from_fn(|_| StandardNormal.sample(&mut rng));
                let deviation = 0.01 * f64::from(1 + 7 * i % 10);
                let is_off = from.x > (1.0 - share) * 345.0;
                let off = Vector2::new(if is_off { off_px } else { 0.0 }, 0.0);
                Match { from, to: from + deviation * Vector2::from(noise) + off, weight: 1.0 }
            })
            .collect()
    }

    fn share_mixed(share: f64, off_px: f64, at: Vector2<f64>, spread_px: f64) -> f64 {
        let n = 2_000;
        let is = |seed: &u64| is_mixed(&matches(share, off_px, *seed), &Homography::shift(at), spread_px);
        (0..n).filter(is).count() as f64 / n as f64
    }

    #[test]
    fn one_fit_in_a_hundred_is_mixed_by_chance() {
        let mixed = share_mixed(0.0, 0.0, Vector2::zeros(), 0.05);
        // Of 2 000 fits 1 % has a deviation of 0.22 %; the sum of 96 matches of unlike deviations is no normal one to the last.
        assert!((0.005..0.017).contains(&mixed), "{mixed}");
    }

    #[test]
    fn a_fit_between_two_motions_is_mixed_and_one_that_leaves_a_thing_out_is_not() {
        assert!(share_mixed(0.4, 0.2, Vector2::new(0.08, 0.0), 0.1) > 0.99);
        // Beyond the reach of 0.24 px.
        let left_out = share_mixed(0.3, 1.0, Vector2::zeros(), 0.05);
        assert!(left_out < 0.02, "{left_out}");
    }

    #[test]
    fn few_matches_and_matches_without_residuals_say_nothing() {
        let all = matches(0.4, 0.2, 1);
        assert!(
            !is_mixed(&all[..5], &Homography::shift(Vector2::new(0.08, 0.0)), 0.1)
                && !is_mixed(&[], &Homography::identity(), 0.1)
        );
        let exact: Vec<Match> = all.iter().map(|m| Match { to: m.from, ..*m }).collect();
        assert!(!is_mixed(&exact, &Homography::identity(), 0.1));
        assert!(!is_mixed(&exact, &Homography::shift(Vector2::repeat(f64::NAN)), 0.1));
    }
}
