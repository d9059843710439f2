//! The motion of a plane from matches of its points: a translation, similarity, affine or projective one, chosen by evidence; its covariance is that of [`super::plane_cov`].
//!
//! Source: Gauss-Newton on the first-order basis of each group, with Tukey's biweight; the choice by the Bayesian information
//! criterion (G. Schwarz, *Annals of Statistics* 6, 1978) with a robust loss at one scale for all groups, as P. Torr has it for image motions (*IJCV* 50, 2002).
//! How: each group is fitted from what it can take over of the start, so that no sampling is needed: the weights' reach falls from three times
//! the median residual's deviation on. The larger groups contain the smaller ones.
//! Symbols: u = (q - middle) / half width, in (-1, 1), q the place now; d displacement (px) = Σ θ_i b_i(u), b = (1, 0), (0, 1) | (-v, u), u | (u, -v), (v, u) | u u, v u;
//! k parameters; criterion = Σ w ρ(r / s) + k ln(2 Σ w), s the least of the groups' robust deviations of an axis, ρ Tukey's loss (r²/s² for small r), the second sum over the
//! matches within its reach. A median's deviation of each group in the place of ρ would scatter more than the few numbers that it is to decide about.
//! Limits: one plane; what lies off it is a residual (parallax), of which [`Plane::spread_px`] knows as far as it is not common to all.

use super::fit::Match;
use crate::{Homography, motion_jacobian};
use nalgebra::{Const, DimMin, Matrix3, SMatrix, SVector, Vector2};

/// Numbers of the groups: translation, similarity, affine, projective.
pub(super) const GROUPS: [usize; 4] = [2, 4, 6, 8];
/// Share of the weight that must agree with the plane.
const MAJORITY: f64 = 0.4;
/// Equations for each number of a group, at least; a match is two. A group that is not tried counts as impossible, so that few matches would make a small group look sure: a frame with 14 of them
/// was off by 1.1 px at 0.16 px stated.
const EQUATIONS_A_NUMBER: usize = 3;
/// Rounds of reweighting.
const ROUNDS: usize = 6;
/// Matches nearer than this to the fit are all the same to it, px: what a patch of noise and aliasing can tell.
pub(super) const SHARP: f64 = 0.03;
/// Tukey's reach in deviations.
pub(super) const REACH: f64 = 4.7;
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
    /// Share of the weight of all matches that lies within reach of it.
    pub share: f64,
    /// Numbers of the group that was chosen.
    pub n_numbers: usize,
    /// Each group's fit, where it could be fitted, and its criterion.
    pub groups: [Option<Homography>; GROUPS.len()],
    pub criteria: [f64; GROUPS.len()],
}

/// What counts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// Turn, zoom and what is beyond them count only where they move a corner by more than this from where a shift has it, px.
    pub least_px: f64,
    /// Matches farther than this from the fit so far do not count, px.
    pub most_px: f64,
}

impl Limits {
    pub const NONE: Self = Self { least_px: 0.0, most_px: f64::INFINITY };
}

/// What each of the first `K` numbers moves at a point, px; transposed.
pub(super) fn basis<const K: usize>(u: Vector2<f64>) -> SMatrix<f64, K, 2> {
    let j = motion_jacobian(u);
    SMatrix::from_fn(|i, axis| j[(axis, i)])
}

/// The correction as a homography of px about `middle`.
pub(super) fn correction(theta: &SVector<f64, 8>, middle: Vector2<f64>, half: f64) -> Option<Homography> {
    if theta.rows(2, 6).iter().all(|t| *t == 0.0) {
        return Some(Homography::shift(Vector2::new(theta[0], theta[1])));
    }
    let t = theta / half;
    let unit =
        Matrix3::new(1.0 + t[3] + t[4], -t[2] + t[5], t[0], t[2] + t[5], 1.0 + t[3] - t[4], t[1], -t[6], -t[7], 1.0);
    let to_unit = Matrix3::new(1.0 / half, 0.0, -middle.x / half, 0.0, 1.0 / half, -middle.y / half, 0.0, 0.0, 1.0);
    let to_px = Matrix3::new(half, 0.0, middle.x, 0.0, half, middle.y, 0.0, 0.0, 1.0);
    Homography::of_matrix(to_px * unit * to_unit)
}

/// What a group can take over of a motion: all that matters is that it lies in the group.
fn in_group(start: &Homography, middle: Vector2<f64>, k: usize) -> Homography {
    match k {
        2 => Homography::shift(start.shift_at(middle)),
        4 => Homography::of_similarity(&start.similarity_at(middle)),
        6 => {
            let (a, to) = (start.linear_at(middle), start.apply(middle));
            let t = to - a * middle;
            let m = Matrix3::new(a[(0, 0)], a[(0, 1)], t.x, a[(1, 0)], a[(1, 1)], t.y, 0.0, 0.0, 1.0);
            Homography::of_matrix(m).unwrap_or(*start)
        }
        _ => *start,
    }
}

/// Robust deviation of the residuals, px an axis: the median of Rayleigh's distribution is 1.1774 of it.
pub(super) fn spread(matches: &[Match], at: &Homography) -> f64 {
    let mut residuals = [0.0; MOST_MATCHES];
    let residuals = &mut residuals[..matches.len()];
    residuals.iter_mut().zip(matches).for_each(|(r, m)| *r = (m.to - at.apply(m.from)).norm());
    let middle = matches.len() / 2;
    (*residuals.select_nth_unstable_by(middle, f64::total_cmp).1 / 1.1774).max(SHARP)
}

/// The fit of one group.
fn settle<const K: usize>(
    matches: &[Match],
    start: &Homography,
    middle: Vector2<f64>,
    most_px: f64,
) -> Option<Homography>
where
    Const<K>: DimMin<Const<K>, Output = Const<K>>,
{
    let half = middle.x.max(middle.y).max(1.0);
    let mut at = in_group(start, middle, K);
    for round in 0..ROUNDS {
        let spread = spread(matches, &at);
        let reach = (spread * if round == 0 { 2.0 * REACH } else { REACH }).min(most_px);
        let (mut square, mut pull) = (SMatrix::<f64, K, K>::identity() * 1e-9, SVector::<f64, K>::zeros());
        let (mut sum, mut n, mut all) = (0.0, 0usize, 0.0);
        for m in matches {
            all += m.weight;
            let to = at.apply(m.from);
            let r = m.to - to;
            let q = r.norm_squared() / (reach * reach);
            // A distance that is no number lies beyond the reach.
            let inside = q < 1.0;
            if !inside {
                continue;
            }
            let w = m.weight * (1.0 - q).powi(2);
            let b = basis::<K>((to - middle) / half);
            square += w * b * b.transpose();
            pull += w * b * r;
            (sum, n) = (sum + w, n + 1);
        }
        if n < LEAST_MATCHES.max(K) || sum < 0.5 * MAJORITY * all {
            return None;
        }
        let theta = square.cholesky()?.solve(&pull);
        let mut full = SVector::<f64, 8>::zeros();
        full.rows_mut(0, K).copy_from(&theta);
        at = at.then(&correction(&full, middle, half)?);
        if theta.norm() < 1e-4 * spread {
            break;
        }
    }
    Some(at)
}

/// Tukey's loss of all matches from a fit, at that deviation, and the weight of those that lie within its reach.
fn loss(matches: &[Match], at: &Homography, spread_px: f64) -> (f64, f64) {
    let (mut sum, mut inside) = (0.0, 0.0);
    for m in matches {
        let q = ((m.to - at.apply(m.from)).norm() / (REACH * spread_px)).powi(2);
        // A distance that is no number lies beyond the reach.
        let is_inside = q < 1.0;
        let left = if is_inside { (1.0 - q).powi(3) } else { 0.0 };
        sum += m.weight * REACH * REACH / 3.0 * (1.0 - left);
        inside += if is_inside { m.weight } else { 0.0 };
    }
    (sum, inside)
}

/// The motion that most matches agree with, from one close to it; `middle` is the image's, px. Turn, zoom and what is beyond them count only where they move
/// a corner by more than `least_px` from where a shift has it.
pub(super) fn fit(matches: &[Match], start: &Homography, middle: Vector2<f64>, limits: Limits) -> Option<Plane> {
    let Limits { least_px, most_px } = limits;
    let matches = &matches[..matches.len().min(MOST_MATCHES)];
    if matches.len() < LEAST_MATCHES {
        return None;
    }
    let settle = |k: usize| match k {
        2 => settle::<2>(matches, start, middle, most_px),
        4 => settle::<4>(matches, start, middle, most_px),
        6 => settle::<6>(matches, start, middle, most_px),
        _ => settle::<8>(matches, start, middle, most_px),
    };
    let mut groups = [None; GROUPS.len()];
    for (group, k) in groups.iter_mut().zip(GROUPS) {
        if 2 * matches.len() < EQUATIONS_A_NUMBER * k {
            break;
        }
        *group = settle(k);
    }
    let spreads = groups.map(|g| g.map_or(f64::INFINITY, |at| spread(matches, &at)));
    let least = spreads.into_iter().fold(f64::INFINITY, f64::min);
    let all: f64 = matches.iter().map(|m| m.weight).sum();
    let mut chosen: Option<(usize, f64)> = None;
    let mut criteria = [f64::INFINITY; GROUPS.len()];
    for (i, k) in GROUPS.into_iter().enumerate() {
        let Some(at) = groups[i] else { continue };
        let (loss, inside) = loss(matches, &at, least);
        criteria[i] = loss + k as f64 * (2.0 * inside).max(2.0).ln();
        let is_near = |b: usize| groups[b].is_some_and(|b| corners_apart(&b, &at, middle) <= least_px);
        if chosen.is_none_or(|(b, _)| criteria[i] < criteria[b] && !(GROUPS[b] == 2 && is_near(b))) {
            chosen = Some((i, inside / all.max(f64::MIN_POSITIVE)));
        }
    }
    let (i, share) = chosen?;
    Some(Plane { to_from: groups[i]?, spread_px: spreads[i], share, n_numbers: GROUPS[i], groups, criteria })
}

/// The farthest distance between what two motions make of the image's corners, px.
pub(super) fn corners_apart(a: &Homography, b: &Homography, middle: Vector2<f64>) -> f64 {
    if a.is_shift() && b.is_shift() {
        return (a.shift_at(middle) - b.shift_at(middle)).norm();
    }
    let corners =
        [(0.0, 0.0), (2.0, 0.0), (0.0, 2.0), (2.0, 2.0)].map(|(x, y)| Vector2::new(x * middle.x, y * middle.y));
    corners.into_iter().map(|c| (a.apply(c) - b.apply(c)).norm()).fold(0.0, f64::max)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    pub(in super::super) const MIDDLE: Vector2<f64> = Vector2::new(255.5, 134.5);

    /// 96 matches with a noise of 0.05 px, a third of them off by up to a pixel.
    pub(in super::super) fn matches(truth: &Homography, seed: u64) -> Vec<Match> {
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
        let found = fit(&matches(&truth, seed), &Homography::identity(), MIDDLE, Limits::NONE).unwrap();
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
        assert!(fit(&few, &Homography::identity(), MIDDLE, Limits::NONE).is_none());
    }
}
