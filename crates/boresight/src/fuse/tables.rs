//! Two sensors' tracks become one table: registration, pairing, fusion at every time of either sensor, a check of agreement.
//!
//! At each time of either sensor both tracks of a pair are predicted there ([`super::timeline`]) and fused by the chosen rule;
//! where one is silent (loss, gap) the other goes on alone. Tracks without a partner pass through. Agreement: share of common
//! times with d² > 9.21 (χ², 2 degrees of freedom, 99 %): 1 % is expected, above 5 % is a warning.

use super::covariance_intersection::{covariance_intersection, inverse_covariance_intersection};
use super::pairing::{pair_tracks, position_distance2};
use super::registration::{Registration, RegistrationConfig, register};
use super::timeline::{Timeline, extent_about};
use super::track_to_track::fuse_independent;
use crate::{Result, TrackId, TrackState, TrackStatus};
use boresight_filters::Gaussian;

/// How two beliefs of one target become one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Rule {
    /// Errors are independent (the papers' state-vector fusion).
    Independent,
    /// Correlation unknown: covariance intersection. Cautious, never over-confident.
    #[default]
    CovarianceIntersection,
    /// Correlation by common information: inverse covariance intersection.
    InverseCovarianceIntersection,
}

/// How two tables of tracks are fused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FuseConfig {
    /// The rule.
    pub rule: Rule,
    /// Largest mean d² of a pair (no unit, above 0): 2 is expected, biases add.
    pub gate: f64,
    /// Common times that a pair needs, 1 or more.
    pub min_common: usize,
    /// Acceleration power density for prediction between times, px²/s³, 0 or more.
    pub density: f64,
    /// A sensor's track is predicted at most this long, s.
    pub max_gap_s: f64,
    /// What is registered from the common targets; none leaves both as they are.
    pub registration: Option<RegistrationConfig>,
}

impl Default for FuseConfig {
    fn default() -> Self {
        Self { rule: Rule::default(), gate: 9.21, min_common: 3, density: 1e-3, max_gap_s: 2.0, registration: None }
    }
}

/// What fusion gave.
#[derive(Clone, Debug, PartialEq)]
pub struct Fused {
    /// Time (s) and fused tracks, in order of time; a track's number is that of sensor a, or follows those for tracks of b alone.
    pub frames: Vec<(f64, Vec<TrackState>)>,
    /// Pairs of the sensors' track numbers.
    pub pairs: Vec<(TrackId, TrackId)>,
    /// The registration used.
    pub registration: Registration,
    /// Share of the common times at which the sensors disagree (d² > 9.21), per pair.
    pub disagreement: Vec<f64>,
    /// Whole sentences.
    pub warnings: Vec<String>,
}

/// χ² with 2 degrees of freedom, 99 %.
const CHI2_2_99: f64 = 9.210;

/// Fuses two sensors' tracks.
/// # Errors
/// A registration that cannot be found; covariances that are not positive definite.
pub fn fuse_tables(a: &[Timeline], b: &[Timeline], config: &FuseConfig) -> Result<Fused> {
    let mut warnings = Vec::new();
    let pair = |b: &[Timeline], gate: f64| pair_tracks(a, b, gate, config.min_common, config.density, config.max_gap_s);
    let mut registration = Registration::IDENTITY;
    let mut b = b.to_vec();
    if let Some(what) = config.registration {
        // Biases spoil the distances, so the pairs for registration are found with a gate that only keeps the order.
        let rough = pair(&b, 1e6)?;
        let common: Vec<_> = rough.iter().map(|(i, j)| (&a[*i], &b[*j])).collect();
        registration = register(&common, what, config.max_gap_s)?;
        b = b.iter().map(|t| registration.apply(t)).collect();
    }
    let pairs = pair(&b, config.gate)?;
    let partner = |i: usize| pairs.iter().find(|(x, _)| *x == i).map(|(_, j)| *j);
    let first_free = a.iter().map(|t| t.id.0).max().unwrap_or(0) + 1;
    let mut times: Vec<f64> = a.iter().chain(&b).flat_map(|t| t.points.iter().map(|p| p.0)).collect();
    times.sort_by(f64::total_cmp);
    times.dedup();
    let (mut odd, mut common) = (vec![0usize; pairs.len()], vec![0usize; pairs.len()]);
    let mut frames = Vec::with_capacity(times.len());
    for time in times {
        let mut tracks = Vec::new();
        let here = |t: &Timeline| t.at(time, config.density, config.max_gap_s);
        let fresh = |t: &Timeline| t.points.binary_search_by(|p| p.0.total_cmp(&time)).is_ok();
        for (i, x) in a.iter().enumerate() {
            let other = partner(i).map(|j| &b[j]);
            let belief = match (here(x), other.and_then(here)) {
                (Some(p), Some(q)) => {
                    if let (Some(k), Some(d2)) = (pairs.iter().position(|(n, _)| *n == i), position_distance2(&p, &q)) {
                        common[k] += 1;
                        odd[k] += usize::from(d2 > CHI2_2_99);
                    }
                    Some(fuse(config.rule, &p, &q)?)
                }
                (Some(p), None) | (None, Some(p)) => Some(p),
                (None, None) => None,
            };
            if let Some(belief) = belief {
                tracks.push(state(x.id, belief, x.size, fresh(x) || other.is_some_and(fresh)));
            }
        }
        for (j, y) in b.iter().enumerate().filter(|(j, _)| !pairs.iter().any(|(_, k)| k == j)) {
            if let Some(belief) = here(y) {
                tracks.push(state(TrackId(first_free + j as u64), belief, y.size, fresh(y)));
            }
        }
        frames.push((time, tracks));
    }
    let disagreement: Vec<f64> = odd.iter().zip(&common).map(|(o, n)| *o as f64 / (*n).max(1) as f64).collect();
    for ((i, j), share) in pairs.iter().zip(&disagreement).filter(|(_, s)| **s > 0.05) {
        warnings.push(format!(
            "The sensors disagree about track {} / {}: {:.0} % of the common times lie outside the 99 % ellipse; estimate a registration, or check the covariances.",
            a[*i].id.0,
            b[*j].id.0,
            100.0 * share
        ));
    }
    if pairs.is_empty() && !a.is_empty() && !b.is_empty() {
        warnings.push("No track of one sensor fits a track of the other: check frames of reference and clocks.".into());
    }
    let pairs = pairs.iter().map(|(i, j)| (a[*i].id, b[*j].id)).collect();
    Ok(Fused { frames, pairs, registration, disagreement, warnings })
}

fn fuse(rule: Rule, a: &Gaussian<4>, b: &Gaussian<4>) -> Result<Gaussian<4>> {
    Ok(match rule {
        Rule::Independent => fuse_independent(a, b)?,
        Rule::CovarianceIntersection => covariance_intersection(a, b)?.belief,
        Rule::InverseCovarianceIntersection => inverse_covariance_intersection(a, b)?.belief,
    })
}

fn state(id: TrackId, belief: Gaussian<4>, size: [f64; 2], fresh: bool) -> TrackState {
    TrackState {
        id,
        status: if fresh { TrackStatus::Confirmed } else { TrackStatus::Coasting },
        kinematics: belief,
        extent: extent_about(&belief.mean, size),
        detection: None,
        innovation: None,
        score: 1.0,
    }
}
