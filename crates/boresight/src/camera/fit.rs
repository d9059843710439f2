//! The background's motion from what its patches say: a consensus, then a robust fit of a shift or of a similarity.
//!
//! Source: consensus over single matches and pairs of matches, all of them in order, as in M. Fischler, R. Bolles (RANSAC, *CACM* 24, 1981) without
//! chance; fit in closed form (S. Umeyama, *IEEE PAMI* 13, 1991, in the plane) with Tukey's biweight; the choice of the model by an F test.
//! How: the hypothesis with the most weight near it is the background's; targets and trees in the wind are outvoted. A shift is taken
//! unless turn and zoom explain the matches significantly better: so a camera that only pans only shifts.
//! Symbols: p, q matches before and now (reduced px); w weight; A = `[a -b; b a]`; s² residual variance per axis. Covariances: q_mean has
//! s² sum w² / (sum w)², a and b have s² sum w² |dp|² / (sum w |dp|²)².
//! Limits: one plane; parallax is noise here, which s² knows of.

use super::key_frame::MIN_PATCHES;
use crate::Similarity;
use nalgebra::{Matrix4, Vector2, Vector4};

/// Matches within this distance of a hypothesis agree with it, reduced px; of patches that stand out, and of an even texture, which may be
/// little above the noise: its patches are found to about half a pixel, and all cells of the image vote.
pub(super) const AGREE: f64 = 0.7;
pub(super) const AGREE_EVEN: f64 = 1.5;
/// So many times as far from a similarity that agrees with its middle a bent image is looked for.
pub(super) const BEND: f64 = 4.0;
/// Share of all weight that the winner needs.
pub(super) const MAJORITY: f64 = 0.4;
/// A shift with this share of the weight needs no hypotheses of turn and zoom beside it: the fit finds them.
const CLEAR: f64 = 0.9;
/// Matches that a similarity needs: its four numbers and as many again.
const MIN_TURNED: usize = 8;
/// Turn (rad) and growth of one frame beyond the predicted ones: 4 degrees, 7 %.
const MOST_TURN: f64 = 0.07;
/// Distance between the two matches of a hypothesis, share of the image's width: nearer ones tell no turn.
const LEAST_BASE: f64 = 0.25;
/// F with 2 and about 20 degrees of freedom at 0.1 per thousand.
const SIGNIFICANT: f64 = 15.0;
/// Matches nearer than this to the fit are all the same to it, reduced px: what the search can tell.
const SHARP: f64 = 0.05;

/// Where one patch lay and lies, reduced px.
#[derive(Clone, Copy, Debug)]
pub(super) struct Match {
    pub from: Vector2<f64>,
    pub to: Vector2<f64>,
    pub weight: f64,
}

/// What is expected of the next motion.
#[derive(Clone, Copy, Debug)]
pub(super) struct Expected {
    /// From the key frame to now, with the turn and zoom of the last frames gone on.
    pub predicted: Similarity,
    /// From the key frame to the frame before.
    pub last: Similarity,
    /// The image's middle, reduced px.
    pub middle: Vector2<f64>,
    /// Least movement of the image's corners by turn and zoom that counts, reduced px; 0 if the camera turns already.
    pub least_turn_px: f64,
    /// Distance within which matches agree: [`AGREE`] or [`AGREE_EVEN`].
    pub agree_px: f64,
}

/// The background's motion from the key frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fit {
    pub now_from_key: Similarity,
    /// Covariance of the shift at the middle (reduced px), the turn (rad) and the logarithm of the growth.
    pub cov: Matrix4<f64>,
    /// Whether turn or zoom changed since the frame before.
    pub turned: bool,
}

/// A weighted fit.
#[derive(Clone, Copy, Debug)]
struct Solution {
    transform: Similarity,
    mean_to: Vector2<f64>,
    /// Sum of w, of w², of w |dp|², of w² |dp|², of w |r|².
    sums: [f64; 5],
    n: usize,
}

/// The motion that most of the weight agrees with; `weights` is scratch memory.
pub(super) fn fit(matches: &[Match], expected: &Expected, weights: &mut Vec<f64>) -> Option<Fit> {
    let all: f64 = matches.iter().map(|m| m.weight).sum();
    let (mut start, mut won) = (expected.predicted, 0.0);
    for m in matches {
        let hypothesis = through(&expected.predicted, m);
        let weight = agreeing(matches, &hypothesis, expected.agree_px).map(|m| m.weight).sum::<f64>();
        if weight > won {
            (start, won) = (hypothesis, weight);
        }
    }
    if won < CLEAR * all
        && let Some((turned, weight)) = best_pair(matches, expected)
        && weight > won
    {
        (start, won) = (turned, weight);
    }
    if agreeing(matches, &start, expected.agree_px).count() < MIN_PATCHES || won <= MAJORITY * all {
        return None;
    }
    // The shift alone keeps the last turn and zoom.
    let shift = settle(matches, weights, (start, expected.agree_px), |w| shifted(matches, w, &expected.last))
        .filter(|s| s.n >= MIN_PATCHES && s.sums[0] > MAJORITY * all);
    let turned = settle(matches, weights, (start, expected.agree_px), |w| similar(matches, w))
        .filter(|s| s.n >= MIN_TURNED && s.sums[0] > MAJORITY * all && is_near(&s.transform, &expected.predicted));
    let solution = match (shift, turned) {
        (Some(s), Some(t)) if !is_better(matches, weights, &t, expected) => (s, false),
        (_, Some(t)) => (t, true),
        (Some(s), None) => (s, false),
        (None, None) => return None,
    };
    Some(Fit {
        now_from_key: solution.0.transform,
        cov: covariance(&solution.0, solution.1, expected.middle),
        turned: solution.1,
    })
}

/// The transform with the linear part of `linear` that takes a match to its place.
fn through(linear: &Similarity, m: &Match) -> Similarity {
    let a = linear.linear();
    Similarity::with_linear(a[(0, 0)], a[(1, 0)], m.from, m.to)
}

fn agreeing<'m>(matches: &'m [Match], hypothesis: &Similarity, agree_px: f64) -> impl Iterator<Item = &'m Match> {
    let hypothesis = *hypothesis;
    matches.iter().filter(move |m| (hypothesis.apply(m.from) - m.to).norm_squared() <= agree_px * agree_px)
}

/// The best hypothesis through two matches, with its weight.
fn best_pair(matches: &[Match], expected: &Expected) -> Option<(Similarity, f64)> {
    let base = LEAST_BASE * 2.0 * expected.middle.x;
    let mut best = None;
    let mut most = 0.0;
    for (i, m) in matches.iter().enumerate() {
        for other in &matches[..i] {
            let (p, q) = (m.from - other.from, m.to - other.to);
            let square = p.norm_squared();
            if square < base * base {
                continue;
            }
            let (cos, sin) = (p.dot(&q) / square, (p.x * q.y - p.y * q.x) / square);
            let hypothesis = Similarity::with_linear(cos, sin, 0.5 * (m.from + other.from), 0.5 * (m.to + other.to));
            if !is_near(&hypothesis, &expected.predicted) {
                continue;
            }
            let weight = agreeing(matches, &hypothesis, expected.agree_px).map(|m| m.weight).sum::<f64>();
            if weight > most {
                (best, most) = (Some((hypothesis, weight)), weight);
            }
        }
    }
    best
}

/// Whether turn and growth are those of one frame beyond the predicted ones.
fn is_near(a: &Similarity, predicted: &Similarity) -> bool {
    let change = predicted.inverse().then(a);
    change.angle_rad().abs() <= MOST_TURN && change.zoom().ln().abs() <= MOST_TURN
}

/// Fits again and again with weights by the distance from the last fit, which count whole near it and nothing beyond `agree_px`.
fn settle(
    matches: &[Match],
    weights: &mut Vec<f64>,
    (start, agree_px): (Similarity, f64),
    solve: impl Fn(&[f64]) -> Option<Solution>,
) -> Option<Solution> {
    let mut at = start;
    let mut reach = agree_px;
    let mut solution = None;
    // The reach settles within three rounds: from all that agree to those within some deviations.
    for _ in 0..4 {
        weights.clear();
        weights.extend(matches.iter().map(|m| {
            let u = (at.apply(m.from) - m.to).norm() / reach;
            if u < 1.0 { m.weight * (1.0 - u * u).powi(2) } else { 0.0 }
        }));
        let s = solve(weights)?;
        let spread = (s.sums[4] / (2.0 * s.sums[0])).sqrt();
        // Tukey's 4.7 deviations.
        reach = (4.7 * spread.max(SHARP)).clamp(0.6 * AGREE, agree_px);
        at = s.transform;
        solution = Some(s);
    }
    solution
}

/// Weighted means of the two sides and the sum of the weights.
fn means(matches: &[Match], weights: &[f64]) -> Option<(Vector2<f64>, Vector2<f64>, f64)> {
    let (mut p, mut q, mut sum) = (Vector2::zeros(), Vector2::zeros(), 0.0);
    for (m, &w) in matches.iter().zip(weights) {
        (p, q, sum) = (p + w * m.from, q + w * m.to, sum + w);
    }
    (sum > 0.0).then(|| (p / sum, q / sum, sum))
}

/// The shift that fits best, after the linear part of `linear`.
fn shifted(matches: &[Match], weights: &[f64], linear: &Similarity) -> Option<Solution> {
    if linear.is_shift() {
        // The mean of the differences, not the difference of the means: exact where all agree.
        let (mut d, mut sum) = (Vector2::zeros(), 0.0);
        for (m, &w) in matches.iter().zip(weights) {
            (d, sum) = (d + w * (m.to - m.from), sum + w);
        }
        return (sum > 0.0).then(|| sums(matches, weights, Similarity::shift(d / sum)));
    }
    let (p, q, _) = means(matches, weights)?;
    let a = linear.linear();
    Some(sums(matches, weights, Similarity::with_linear(a[(0, 0)], a[(1, 0)], p, q)))
}

/// The similarity that fits best.
fn similar(matches: &[Match], weights: &[f64]) -> Option<Solution> {
    let (p, q, _) = means(matches, weights)?;
    let (mut dot, mut cross, mut square) = (0.0, 0.0, 0.0);
    for (m, &w) in matches.iter().zip(weights) {
        let (u, v) = (m.from - p, m.to - q);
        dot += w * u.dot(&v);
        cross += w * (u.x * v.y - u.y * v.x);
        square += w * u.norm_squared();
    }
    (square > 0.0).then(|| sums(matches, weights, Similarity::with_linear(dot / square, cross / square, p, q)))
}

fn sums(matches: &[Match], weights: &[f64], transform: Similarity) -> Solution {
    let (p, mean_to, _) = means(matches, weights).unwrap_or_default();
    let mut sums = [0.0; 5];
    let mut n = 0;
    for (m, &w) in matches.iter().zip(weights).filter(|(_, w)| **w > 0.0) {
        let (base, rest) = ((m.from - p).norm_squared(), (transform.apply(m.from) - m.to).norm_squared());
        let terms = [w, w * w, w * base, w * w * base, w * rest];
        sums.iter_mut().zip(terms).for_each(|(s, t)| *s += t);
        n += 1;
    }
    Solution { transform, mean_to, sums, n }
}

/// Whether turn and zoom explain the matches better than a shift by more than chance and by more than what counts.
fn is_better(matches: &[Match], weights: &mut Vec<f64>, turned: &Solution, expected: &Expected) -> bool {
    weights.clear();
    weights.extend(matches.iter().map(|m| {
        let u = (turned.transform.apply(m.from) - m.to).norm() / expected.agree_px;
        if u < 1.0 { m.weight * (1.0 - u * u).powi(2) } else { 0.0 }
    }));
    let (Some(t), Some(s)) = (similar(matches, weights), shifted(matches, weights, &expected.last)) else {
        return false;
    };
    let freedom = (2 * t.n) as f64 - 4.0;
    let rest = t.sums[4].max(t.sums[0] * SHARP * SHARP / 4.0);
    let f = 0.5 * (s.sums[4] - t.sums[4]) / (rest / freedom);
    // What turn and zoom alone do at the image's corners.
    let change = expected.last.inverse().then(&turned.transform).linear() - nalgebra::Matrix2::identity();
    f > SIGNIFICANT && (change * expected.middle).norm() > expected.least_turn_px
}

fn covariance(s: &Solution, turned: bool, middle: Vector2<f64>) -> Matrix4<f64> {
    let [w, w2, base, base2, rest] = s.sums;
    let n_numbers = if turned { 4.0 } else { 2.0 };
    let n = 2.0 * s.n as f64;
    // Matches are worth no more than the search can tell.
    let variance = (rest / w / 2.0 * n / (n - n_numbers).max(1.0)).max(SHARP * SHARP / 4.0);
    let shift = variance * w2 / (w * w);
    if !turned {
        return Matrix4::from_diagonal(&Vector4::new(shift, shift, 0.0, 0.0));
    }
    let turn = variance * base2 / (base * base) / s.transform.zoom().powi(2);
    let d = middle - s.mean_to;
    #[rustfmt::skip]
    let to_middle = Matrix4::new(
        1.0, 0.0, -d.y, d.x,
        0.0, 1.0, d.x, d.y,
        0.0, 0.0, 1.0, 0.0,
        0.0, 0.0, 0.0, 1.0,
    );
    to_middle * Matrix4::from_diagonal(&Vector4::new(shift, shift, turn, turn)) * to_middle.transpose()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    const MIDDLE: Vector2<f64> = Vector2::new(159.5, 119.5);

    /// 40 matches of a motion with noise, a third of them something else's.
    fn matches(truth: &Similarity, noise_px: f64, seed: u64) -> Vec<Match> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        (0..40)
            .map(|i| {
                let from = Vector2::new(20.0 + 40.0 * f64::from(i % 8), 25.0 + 45.0 * f64::from(i / 8));
                let [zx, zy]: [f64; 2] = std::array::from_fn(|_| StandardNormal.sample(&mut rng));
                let astray = if i % 3 == 1 { 16.0 * (rng.random::<f64>() - 0.5) } else { 0.0 };
                Match {
                    from,
                    to: truth.apply(from) + noise_px * Vector2::new(zx, zy) + Vector2::new(astray, -astray),
                    weight: 1.0,
                }
            })
            .collect()
    }

    fn expected() -> Expected {
        Expected {
            predicted: Similarity::identity(),
            last: Similarity::identity(),
            middle: MIDDLE,
            least_turn_px: 0.2,
            agree_px: AGREE,
        }
    }

    #[test]
    fn a_shift_stays_a_shift_and_a_turn_is_found_among_strangers() {
        for seed in 0..200 {
            let shift = Similarity::shift(Vector2::new(4.3, -2.2));
            let found = fit(&matches(&shift, 0.05, seed), &expected(), &mut Vec::new()).unwrap();
            assert!(found.now_from_key.is_shift() && !found.turned, "{seed}");
            assert!((found.now_from_key.shift_at(MIDDLE) - Vector2::new(4.3, -2.2)).norm() < 0.06, "{found:?}");
            let turn = Similarity::about(MIDDLE, Vector2::new(1.0, 2.0), 1f64.to_radians(), 1.01);
            let found = fit(&matches(&turn, 0.05, seed), &expected(), &mut Vec::new()).unwrap();
            assert!(found.turned && (found.now_from_key.angle_rad().to_degrees() - 1.0).abs() < 0.05);
            assert!((found.now_from_key.zoom() - 1.01).abs() < 5e-4);
        }
    }

    #[test]
    fn the_covariance_is_that_of_the_errors() {
        // NEES over many fits: 4 numbers, so 4 in the mean; the biweight and its reach cost a little.
        let turn = Similarity::about(MIDDLE, Vector2::new(1.0, 2.0), 1f64.to_radians(), 1.01);
        let (mut sum, n) = (0.0, 400);
        for seed in 0..n {
            let found = fit(&matches(&turn, 0.08, 1000 + seed), &expected(), &mut Vec::new()).unwrap();
            let error = turn.inverse().then(&found.now_from_key);
            let shift = found.now_from_key.apply(before_middle(&turn)) - MIDDLE;
            let e = Vector4::new(shift.x, shift.y, error.angle_rad(), error.zoom().ln());
            sum += e.dot(&found.cov.cholesky().unwrap().solve(&e));
        }
        let nees = sum / n as f64;
        assert!((3.2..5.6).contains(&nees), "{nees}");
    }

    /// The place whose image is the middle.
    fn before_middle(truth: &Similarity) -> Vector2<f64> {
        truth.inverse().apply(MIDDLE)
    }

    #[test]
    fn strangers_alone_have_no_consensus() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        for _ in 0..200 {
            let mut strangers = matches(&Similarity::identity(), 0.0, 1);
            for m in &mut strangers {
                m.to = m.from + 20.0 * Vector2::new(rng.random::<f64>() - 0.5, rng.random::<f64>() - 0.5);
            }
            assert!(fit(&strangers, &expected(), &mut Vec::new()).is_none());
        }
        assert!(fit(&[], &expected(), &mut Vec::new()).is_none());
    }
}
