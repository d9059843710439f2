//! Where the background of a key frame was found, and the consensus of coarse matches about where it was expected.
//!
//! Source: [`super::fit`]. Units: reduced px.

use super::fit::{Expected, MAJORITY, Match, fit};
use super::plane::MOST_MATCHES;
use super::scales::of_similarity;
use crate::{Homography, MotionCov, Similarity};
use nalgebra::Vector2;

/// Share of the weight that keeps together where a motion stands alone: all but what targets may hide.
const MOST: f64 = 0.8;

/// Where the key frame's background lies now, reduced px.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
    pub now_from_key: Homography,
    pub cov: MotionCov,
    pub turned: bool,
    /// Whether it is the background's beyond doubt: where nothing was known before, it must explain most of the image.
    pub covers: bool,
    /// Whether it may be the motion of a thing before a ground that stands.
    pub may_be_a_thing: bool,
    /// Whether it may be what things that move by themselves have in common ([`super::apart`]).
    pub by_chance: bool,
    /// Patches of the reduced frame that were found.
    pub n_coarse: usize,
    /// How far from the motion those patches lie that are to keep together if it is a ground's, reduced px.
    pub apart_px: f64,
}

/// The consensus of the matches about a predicted motion. What is left of a prediction that is no similarity is one: it is found among the predicted places.
pub(super) fn coarse(
    matches: &mut [Match],
    predicted: &Homography,
    last: &Homography,
    weights: &mut Vec<f64>,
    expected: &dyn Fn(Similarity, Similarity) -> Expected,
) -> Option<Found> {
    let m = predicted.matrix();
    let is_similar = m[(0, 0)] == m[(1, 1)] && m[(0, 1)] == -m[(1, 0)] && m[(2, 0)] == 0.0 && m[(2, 1)] == 0.0;
    let similarity = |h: &Homography| h.similarity_at(Vector2::zeros());
    if is_similar {
        let fit = fit(matches, &expected(similarity(predicted), similarity(last)), weights)?;
        let now_from_key = Homography::of_similarity(&fit.now_from_key);
        return Some(Found {
            now_from_key,
            cov: of_similarity(&fit.cov),
            turned: fit.turned,
            covers: true,
            may_be_a_thing: false,
            by_chance: false,
            n_coarse: 0,
            apart_px: apart(matches, &now_from_key, MAJORITY),
        });
    }
    let none = Similarity::identity();
    matches.iter_mut().for_each(|m| m.from = predicted.apply(m.from));
    let fit = fit(matches, &expected(none, none), weights);
    let back = predicted.inverse();
    matches.iter_mut().for_each(|m| m.from = back.apply(m.from));
    let fit = fit?;
    let now_from_key = predicted.then(&Homography::of_similarity(&fit.now_from_key));
    Some(Found {
        now_from_key,
        cov: of_similarity(&fit.cov),
        turned: true,
        covers: true,
        may_be_a_thing: false,
        by_chance: false,
        n_coarse: 0,
        apart_px: apart(matches, &now_from_key, MAJORITY),
    })
}

impl Found {
    /// The same where the fine patches do not bear it out, by the matches that it comes from: nothing else speaks for it, so more of them have to keep together.
    pub fn alone(self, matches: &[Match]) -> Self {
        Self { covers: false, apart_px: apart(matches, &self.now_from_key, MOST), ..self }
    }
}

/// The distance from a motion within which that share of the weight lies, reduced px.
fn apart(matches: &[Match], now_from_key: &Homography, share: f64) -> f64 {
    let mut all = [(0.0, 0.0); MOST_MATCHES];
    let all = &mut all[..matches.len().min(MOST_MATCHES)];
    all.iter_mut().zip(matches).for_each(|(a, m)| *a = ((now_from_key.apply(m.from) - m.to).norm(), m.weight));
    all.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let mut left = share * all.iter().map(|a| a.1).sum::<f64>();
    let reached = |a: &&(f64, f64)| {
        left -= a.1;
        left <= 0.0
    };
    all.iter().find(reached).map_or(0.0, |a| a.0)
}
