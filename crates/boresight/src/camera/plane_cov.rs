//! Covariance of a plane's motion fitted to matches of its points.
//!
//! Source: that of an M-estimator whose matches are not alike (P. Huber, *Robust Statistics*, 1981, section 7.6), of a first motion with residuals where each match is left out of the fit: HC3 of
//! J. MacKinnon, H. White, *Journal of Econometrics* 29, 1985; where neighbours' residuals point one way, with parts of the view left out as well (H. Künsch, *Annals of Statistics* 17, 1989: the
//! jackknife of moving blocks); over the groups, the covariance of a mixture, each with the probability that its criterion gives it (A. Raftery, *Sociological Methodology* 25, 1995).
//! How: a match far from the others pulls the fit to itself, so that its own residual says little of how wrong it is; left out, it says all. A thing pulls with all the matches that lie on it, and
//! only without its part of the view it is seen what it did.
//! Symbols: those of [`super::plane`]; r residual, w weight, b basis; P = Σ w b bᵀ, L = w bᵀ P⁻¹ b the leverage of a match, (I - L)⁻¹ r what it leaves where the others are fitted; A the mean
//! slope of the weighted residuals, B = Σ w² b (I - L)⁻¹ r rᵀ (I - L)⁻¹ bᵀ; covariance A⁻¹ B A⁻¹.
//! Departure: matches that deviate from a first motion by more than their noise explains are taken to err together.
//! Limits: residuals that all matches have in common, as of a lens, are only known as far as they differ. Of a course that is known residuals stay in the fit, with the factor n / (n - k) for the
//! numbers fitted: its patches are found near where they are expected, and parallax points one way as a thing does.

use super::fit::Match;
use super::key_frame::CELLS;
use super::mixed::is_mixed;
use super::plane::{GROUPS, MOST_MATCHES, Plane, REACH, SHARP, basis, corners_apart, spread};
use crate::{Homography, MotionCov};
use nalgebra::{Const, DimMin, Matrix2, SMatrix, SVector, Vector2};

/// Deviation of an axis that is common to all matches, px: what straight lines between pixels leave where all patches lie at the same fraction of one, as after a shift.
const COMMON_PX: f64 = 0.01;
/// Where a motion takes a corner farther than this from where a shift has it, px, patches lie at all fractions, and what the lines leave is a residual as others are.
const ALL_FRACTIONS_PX: f64 = 1.0;
/// Deviation of the matches from a first motion, px, from which on it is an error that they have in common: three times the 0.05 px by which a patch deviates that just stands out. With a noise of σ
/// neighbouring pixels differ by 1.13 σ in the mean, such a patch's by twice that or more, so that Σ g² over its 144 px is 860 σ² or more without the noise's part, and its place among the noise of two
/// frames deviates by √2 σ / √860 σ. What deviates by more may lie between motions: of 29 first motions of 4 000 pairs of views that did 19 were off by more than 0.5 px, of 2 477 that did not 82.
const MIXED_PX: f64 = 0.15;
/// Probability of a group, of the likeliest one's, below which it is left out.
const LEAST_PROBABILITY: f64 = 1e-6;
/// Cells across and down of a part of the view that is left out: a quarter of it, about what the largest thing before a ground covers.
const PART: (usize, usize) = (CELLS.0 / 2, CELLS.1 / 2);

/// What is left out of a fit to see what it did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum LeftOut {
    Nothing,
    Matches,
    /// Each match, and each part of the view.
    Parts,
}

/// Covariance of where a plane fitted to these matches takes the points around the middle ([`crate::motion_jacobian`]), px; `is_first` where no course was known.
pub(super) fn plane_cov(plane: &Plane, matches: &[Match], middle: Vector2<f64>, is_first: bool) -> Option<MotionCov> {
    let matches = &matches[..matches.len().min(MOST_MATCHES)];
    let left_out = match is_first {
        true if is_mixed(matches, &plane.to_from, plane.spread_px) => LeftOut::Parts,
        true => LeftOut::Matches,
        false => LeftOut::Nothing,
    };
    let least = plane.criteria.into_iter().fold(f64::INFINITY, f64::min);
    let (mut sum, mut all) = (MotionCov::zeros(), 0.0);
    for ((at, criterion), k) in plane.groups.iter().zip(plane.criteria).zip(GROUPS) {
        let Some(at) = at else { continue };
        let weight = (-0.5 * (criterion - least)).exp();
        if weight < LEAST_PROBABILITY {
            continue;
        }
        let cov = match k {
            2 => of_group::<2>(matches, at, middle, left_out),
            4 => of_group::<4>(matches, at, middle, left_out),
            6 => of_group::<6>(matches, at, middle, left_out),
            _ => of_group::<8>(matches, at, middle, left_out),
        };
        let Some(mut cov) = cov else { continue };
        (0..2).for_each(|axis| cov[(axis, axis)] += common_px2(at, middle));
        let off = difference(&plane.to_from, at, middle);
        sum += weight * (cov + off * off.transpose());
        all += weight;
    }
    if all == 0.0 {
        return None;
    }
    sum /= all;
    if is_first && plane.spread_px > MIXED_PX {
        (0..2).for_each(|axis| sum[(axis, axis)] += plane.spread_px * plane.spread_px);
    }
    Some(sum)
}

/// Variance of an axis that is common to all matches, px².
fn common_px2(at: &Homography, middle: Vector2<f64>) -> f64 {
    let is_nearly_shift = corners_apart(at, &Homography::shift(at.shift_at(middle)), middle) < ALL_FRACTIONS_PX;
    if is_nearly_shift { COMMON_PX * COMMON_PX } else { 0.0 }
}

/// A match within the fit's reach: weight by Tukey, residual, square of its share of the reach, basis.
type Inside<const K: usize> = (f64, Vector2<f64>, f64, SMatrix<f64, K, 2>);

/// Covariance of the numbers of a fit: A⁻¹ B A⁻¹.
fn of_group<const K: usize>(
    matches: &[Match],
    at: &Homography,
    middle: Vector2<f64>,
    left_out: LeftOut,
) -> Option<MotionCov>
where
    Const<K>: DimMin<Const<K>, Output = Const<K>>,
{
    let half = middle.x.max(middle.y).max(1.0);
    let reach = REACH * spread(matches, at);
    let inside = || {
        matches.iter().filter_map(move |m| {
            let to = at.apply(m.from);
            let r = m.to - to;
            let q = r.norm_squared() / (reach * reach);
            // A distance that is no number lies beyond the reach.
            (q < 1.0).then(|| (m.from, (m.weight * (1.0 - q).powi(2), r, q, basis::<K>((to - middle) / half))))
        })
    };
    let (mut slope, mut plain) = (SMatrix::<f64, K, K>::zeros(), SMatrix::<f64, K, K>::zeros());
    let mut n = 0.0;
    for (_, (w, _, q, b)) in inside() {
        let square = w * b * b.transpose();
        // The mean over the directions of the derivative of r (1 - q)².
        slope += (1.0 - 3.0 * q) / (1.0 - q) * square;
        plain += square;
        n += 2.0;
    }
    let factor = plain.cholesky()?;
    let mut meat = SMatrix::<f64, K, K>::zeros();
    for (_, (w, r, _, b)) in inside() {
        let r = match left_out {
            LeftOut::Nothing => r,
            // Nothing is known of a fit that hangs on a single match.
            _ => (Matrix2::identity() - w * b.transpose() * factor.solve(&b)).cholesky()?.solve(&r),
        };
        let of_one = r * r.transpose() + Matrix2::identity() * (0.25 * SHARP * SHARP);
        meat += w * w * b * of_one * b.transpose();
    }
    let back = slope.cholesky().unwrap_or(factor).inverse();
    let mut cov = back * meat * back;
    match left_out {
        LeftOut::Nothing => cov *= n / (n - K as f64).max(1.0),
        LeftOut::Matches => {}
        LeftOut::Parts => cov += of_parts(inside(), &plain, middle)?,
    }
    let mut out = MotionCov::zeros();
    // Numbers for u in (-1, 1) become those for px.
    let unit = |i: usize| [1.0, 1.0 / half, 1.0 / half, 1.0 / (half * half)][i / 2];
    for i in 0..K {
        for j in 0..K {
            out[(i, j)] = 0.5 * (cov[(i, j)] + cov[(j, i)]) * unit(i) * unit(j);
        }
    }
    Some(out)
}

/// Covariance by the changes of the numbers where each part of the view is left out: each cell lies in as many parts as a part has cells.
fn of_parts<const K: usize>(
    inside: impl Iterator<Item = (Vector2<f64>, Inside<K>)>,
    plain: &SMatrix<f64, K, K>,
    middle: Vector2<f64>,
) -> Option<SMatrix<f64, K, K>>
where
    Const<K>: DimMin<Const<K>, Output = Const<K>>,
{
    let mut cells = [[(SVector::<f64, K>::zeros(), SMatrix::<f64, K, K>::zeros()); CELLS.0]; CELLS.1];
    let cell = |at: f64, middle: f64, n: usize| ((at / (2.0 * middle + 1.0) * n as f64).max(0.0) as usize).min(n - 1);
    for (from, (w, r, _, b)) in inside {
        let (pull, square) = &mut cells[cell(from.y, middle.y, CELLS.1)][cell(from.x, middle.x, CELLS.0)];
        *pull += w * b * r;
        *square += w * b * b.transpose();
    }
    let mut sum = SMatrix::<f64, K, K>::zeros();
    // Parts that reach beyond the border are cut off there.
    for y in 1..CELLS.1 + PART.1 {
        for x in 1..CELLS.0 + PART.0 {
            let (mut pull, mut rest) = (SVector::<f64, K>::zeros(), *plain);
            for row in &cells[y.saturating_sub(PART.1)..y.min(CELLS.1)] {
                for (p, square) in &row[x.saturating_sub(PART.0)..x.min(CELLS.0)] {
                    (pull, rest) = (pull + p, rest - square);
                }
            }
            // A part in which nothing pulls may hold nothing.
            if pull != SVector::zeros() {
                let change = rest.cholesky()?.solve(&pull);
                sum += change * change.transpose();
            }
        }
    }
    Some(sum / (PART.0 * PART.1) as f64)
}

/// The eight numbers of the small motion from what one motion makes of the points to what another does, about the middle.
fn difference(from: &Homography, to: &Homography, middle: Vector2<f64>) -> SVector<f64, 8> {
    let d = from.inverse().then(to);
    let (at, a) = (d.shift_at(middle), d.linear_at(middle));
    let centred = Homography::shift(middle).then(&d).then(&Homography::shift(-d.apply(middle)));
    let m = centred.matrix();
    SVector::from([
        at.x,
        at.y,
        0.5 * (a[(1, 0)] - a[(0, 1)]),
        0.5 * (a[(0, 0)] + a[(1, 1)]) - 1.0,
        0.5 * (a[(0, 0)] - a[(1, 1)]),
        0.5 * (a[(0, 1)] + a[(1, 0)]),
        -m[(2, 0)],
        -m[(2, 1)],
    ])
}

#[cfg(test)]
mod tests {
    use super::super::plane::tests::{MIDDLE, matches};
    use super::super::plane::{Limits, correction, fit};
    use super::*;
    use crate::motion_jacobian;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    #[test]
    fn the_covariance_is_that_of_the_errors_in_every_group() {
        // NEES of a corner over many fits, 2 in the mean; every third match is off by up to a pixel.
        let kinds = [
            [0.4, -0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            [0.4, -0.3, 0.5, -0.4, 0.0, 0.0, 0.0, 0.0],
            [0.4, -0.3, 0.3, -0.2, 0.4, 0.3, 0.0, 0.0],
            [0.4, -0.3, 0.2, 0.1, -0.2, 0.1, 0.5, 0.4],
        ];
        for (truth, is_first) in kinds.into_iter().flat_map(|k| [(k, false), (k, true)]) {
            let truth = correction(&SVector::from(truth), MIDDLE, MIDDLE.x).unwrap();
            let (mut sum, n) = (0.0, 300);
            for seed in 0..n {
                let matches = matches(&truth, 1000 + seed);
                let found = fit(&matches, &Homography::identity(), MIDDLE, Limits::NONE).unwrap();
                let cov = plane_cov(&found, &matches, MIDDLE, is_first).unwrap();
                for corner in [Vector2::new(0.0, 0.0), Vector2::new(511.0, 200.0)] {
                    let (at, e) = (truth.apply(corner), found.to_from.apply(corner) - truth.apply(corner));
                    let j = motion_jacobian(at - MIDDLE);
                    // These matches have no error in common.
                    let own = j * cov * j.transpose() - Matrix2::identity() * common_px2(&found.to_from, MIDDLE);
                    sum += 0.5 * e.dot(&own.cholesky().unwrap().solve(&e));
                }
            }
            let nees = sum / n as f64;
            assert!((1.6..2.7).contains(&nees), "{truth:?}, first {is_first}: {nees}");
        }
    }

    #[test]
    fn patches_at_all_fractions_of_a_pixel_have_no_error_in_common() {
        // 64 of 96 matches of 0.05 px have a mean of some 0.007 px.
        let stated = |turn_px: f64| {
            let truth = correction(&SVector::from([0.4, -0.3, turn_px, 0.0, 0.0, 0.0, 0.0, 0.0]), MIDDLE, MIDDLE.x);
            let matches = matches(&truth.unwrap(), 7);
            let found = fit(&matches, &truth.unwrap(), MIDDLE, Limits::NONE).unwrap();
            plane_cov(&found, &matches, MIDDLE, true).unwrap()[(0, 0)].sqrt()
        };
        assert!(stated(0.0) > COMMON_PX && stated(5.0) < COMMON_PX, "{} {}", stated(0.0), stated(5.0));
    }

    #[test]
    fn a_first_motion_between_two_is_stated_as_far_off_as_they_are_apart() {
        // Every second match goes another way by so much; halfway between them both are half of it off.
        let stated = |apart_px: f64, is_first: bool| {
            let truth = Homography::shift(Vector2::new(3.2, 1.4));
            let mut matches = matches(&truth, 7);
            matches.iter_mut().step_by(2).for_each(|m| m.to.x += apart_px);
            let found = fit(&matches, &truth, MIDDLE, Limits::NONE).unwrap();
            plane_cov(&found, &matches, MIDDLE, is_first).unwrap()[(0, 0)].sqrt()
        };
        assert!(stated(0.0, true) < 0.03 && stated(0.5, false) < 0.1);
        assert!((0.15..0.35).contains(&stated(0.5, true)), "{}", stated(0.5, true));
    }

    #[test]
    fn few_matches_far_away_are_not_taken_for_proof_of_their_own_places() {
        // 13 matches in a corner and three in the opposite one, which an affine fit follows nearly whole: squares of the errors there beside the variances stated.
        let (mut errors, mut stated, n) = (0.0, 0.0, 400);
        for seed in 0..n {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let place = |i: i32| Vector2::new(30.0 * f64::from(i % 5), 30.0 * f64::from(i / 5));
            let matches: Vec<Match> = (0..16)
                .map(|i| {
                    let from = if i >= 13 { Vector2::new(500.0, 260.0) - place(i - 13) } else { place(i) };
                    let noise: [f64; 2] = std::array::from_fn(|_| StandardNormal.sample(&mut rng));
                    Match { from, to: from + 0.1 * Vector2::from(noise), weight: 1.0 }
                })
                .collect();
            let affine = fit(&matches, &Homography::identity(), MIDDLE, Limits::NONE).unwrap().groups[2].unwrap();
            let cov = of_group::<6>(&matches, &affine, MIDDLE, LeftOut::Matches).unwrap();
            let p = Vector2::new(500.0, 260.0);
            let (e, j) = (affine.apply(p) - p, motion_jacobian(p - MIDDLE));
            (errors, stated) = (errors + e.norm_squared(), stated + (j * cov * j.transpose()).trace());
        }
        // The residuals themselves, not left out, state 0.75 of them.
        let ratio = stated / errors;
        assert!((1.0..3.0).contains(&ratio), "{ratio}");
    }

    #[test]
    fn a_fit_between_two_motions_does_not_claim_to_be_one_of_them() {
        // The right third of the view is off by what the fit's reach still holds.
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let matches: Vec<Match> = (0..96)
            .map(|i| {
                let from = Vector2::new(20.0 + 40.0 * f64::from(i % 12), 20.0 + 32.0 * f64::from(i / 12));
                let noise: [f64; 2] = std::array::from_fn(|_| StandardNormal.sample(&mut rng));
                let off = Vector2::new(if i % 12 >= 8 { 0.2 } else { 0.0 }, 0.0);
                Match { from, to: from + 0.03 * Vector2::from(noise) + off, weight: 1.0 }
            })
            .collect();
        let shift = fit(&matches, &Homography::identity(), MIDDLE, Limits::NONE).unwrap().groups[0].unwrap();
        let e = shift.shift_at(MIDDLE);
        let distance2 = |left_out| {
            let cov = of_group::<2>(&matches, &shift, MIDDLE, left_out).unwrap();
            e.dot(&cov.fixed_view::<2, 2>(0, 0).into_owned().cholesky().unwrap().solve(&e))
        };
        // χ², 2 degrees of freedom, 99 %: 9.21.
        let (matches_out, parts_out) = (distance2(LeftOut::Matches), distance2(LeftOut::Parts));
        assert!(matches_out > 9.21 && parts_out < 9.21, "{e}: {matches_out}, {parts_out}");
    }
}
