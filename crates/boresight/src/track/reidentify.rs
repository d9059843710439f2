//! Reidentification: a target that was lost and is found again keeps its id.
//!
//! Source: our own; the hypothesis test is Bayes' with even odds. When a track is confirmed by its rule, and again when it has shown that it moves, the tracks
//! lost within the last seconds, and those that had no detection in any scan in which the new one had one of its own, are predicted to that time by their
//! own filters. The difference of the two beliefs in
//! position and velocity is either that of one target, N(0, P + P'), or a new target's, anywhere in the field with a velocity
//! N(0, v²/9) per axis; the likelier hypothesis holds, and among several lost tracks the likeliest one.
//! Tracks are also lost where a target turns harder than the model allows (a ball at a wall): with the probability [`TURNED`] the velocity has changed by
//! as much as the speeds before and after, u and u', and only the place speaks: N(0, P + P' + ½ (u² + u'²) T² I), T the time since it was last seen; or where
//! it stops: with the probability [`RESTED`] the new velocity is 0 within its own covariance. A new track that has not moved yet may also be scenery, at rest, as
//! often as such tracks are. One that continues a target which has moved needs not show it again.
//! It decides once and looks back only: a stream's ids, the annotated video's and the table's are the same.
//! How long ago it was lost has no limit of its own: the covariance of the prediction grows with the time, the target has stayed in view with the probability
//! e^(−T/τ) (τ the mean time that targets stay, where the rule of confirmation knows it), and with the probability [`ALIKE`] a new target has the lost one's
//! speed, in any direction: what is only as slow is not surely the same.
//! Symbols: A the field's area (px²), v the largest speed (px/s), n the number of new targets that come while one is hidden, by the rule of confirmation where it
//! knows that, else by how many came since the first scan, at least one and at most as many as are reported: a new one has the density n / A; things at rest that of their number.
//! Limits: a track keeps its own number while it is tentative. At most [`MOST_LOST`] lost tracks are remembered, the newest.

use super::filter::TrackedFilter;
use super::scan_interval::ScanInterval;
use super::single_track::Track;
use crate::validate::not_negative;
use crate::{Result, Timestamp};
use boresight_filters::{Filter, Gaussian};
use nalgebra::{Matrix2, Vector2};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// How long a new track may take to be confirmed, s, and scans where these last longer: a lost one is remembered for so much longer than the gap.
const CONFIRM_S: f64 = 10.0;
const CONFIRM_SCANS: u32 = 30;
/// Share of losses where the target had turned hard; with none, every reversal gives a new id. Chosen: such turns are rarer than hiding.
const TURNED: f64 = 0.1;
/// Share of losses where the target had stopped. Chosen as the one of turns.
const RESTED: f64 = 0.1;
/// Share of new targets that have the speed of the lost one, in any direction: birds of a flock. Chosen as those.
const ALIKE: f64 = 0.1;
/// Lost tracks remembered.
const MOST_LOST: usize = 256;
/// Deviation of the logarithm of a target's height between its loss and its return: a third larger or smaller.
const SIZE_LOG_STD: f64 = 0.3;
/// The largest speed is so many deviations of a target's velocity.
const SPEED_STDS: f64 = 3.0;
/// Area of a field whose size is not known, px²: a megapixel.
const UNKNOWN_AREA_PX2: f64 = 1e6;

/// How long a target may be hidden and keep its id where nothing is said, s: someone behind a lamp post.
const HIDDEN_S: f64 = 2.0;

/// Whether a target that was lost gets its old id when it is found again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct ReidentificationConfig {
    /// Longest time between its last detection and the first of the new track, s, 0 or more; 0 gives every track an id of its own. A long one costs memory only
    /// where the confirmation rule knows how long targets stay: likelihoods decide.
    pub max_gap_s: f64,
}

impl Default for ReidentificationConfig {
    fn default() -> Self {
        Self { max_gap_s: HIDDEN_S }
    }
}

impl ReidentificationConfig {
    /// Checks all values; `at` names the place in the configuration.
    /// # Errors
    /// The first value outside its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        not_negative(at, "max-gap-s", self.max_gap_s, "2 s bridges a lamp post")
    }
}

/// A track that was reported and is gone.
#[derive(Clone)]
struct Lost {
    id: u64,
    filter: TrackedFilter,
    /// Time of the filter's belief.
    at: Timestamp,
    last_seen_ns: i64,
    /// Scans with a detection, the newest in the lowest bit.
    hits: u64,
    height_px: f64,
}

/// What a new track can be the continuation of.
enum Earlier {
    Lost(usize),
    Coasting(usize),
}

/// Whose a new track is.
pub(super) enum Identity {
    /// Nobody's who was known.
    New,
    /// A lost one's.
    Found,
    /// That of the track with this number, which it replaces.
    Replaces(usize),
}

/// Tracks that were lost.
#[derive(Clone, Default)]
pub(super) struct Reidentification {
    /// The oldest first.
    lost: VecDeque<Lost>,
    /// When the first new target came, and how many did since.
    came: Option<(Timestamp, u64)>,
}

impl Reidentification {
    /// Remembers a reported track that ends; its filter stands at `now`.
    pub fn remember(&mut self, config: &ReidentificationConfig, track: &Track, now: Timestamp) {
        if config.max_gap_s <= 0.0 || !track.reported {
            return;
        }
        if self.lost.len() >= MOST_LOST {
            self.lost.pop_front();
        }
        self.lost.push_back(Lost {
            id: track.id,
            filter: track.filter.clone(),
            at: now,
            last_seen_ns: track.history.last_seen_ns,
            hits: track.history.hits(),
            height_px: track.appearance.size[1],
        });
    }

    /// Notes that a target came which nobody knew.
    pub fn note_new(&mut self, now: Timestamp) {
        self.came.get_or_insert((now, 0)).1 += 1;
    }

    /// New targets that came a second since the first did, if that is a while ago.
    pub fn new_per_s(&self, now: Timestamp) -> Option<f64> {
        let (first, n) = self.came?;
        let since_s = now.seconds_since(first);
        (since_s > 0.0).then(|| n as f64 / since_s)
    }

    /// Counts a scan more, before the tracks count it.
    pub fn next_scan(&mut self) {
        self.lost.iter_mut().for_each(|l| l.hits <<= 1);
    }

    /// Forgets what was lost too long ago; `interval` is the usual one between scans.
    pub fn forget(&mut self, config: &ReidentificationConfig, interval: &ScanInterval, now: Timestamp) {
        let longest_s = config.max_gap_s + CONFIRM_S.max(interval.span_s(CONFIRM_SCANS));
        self.lost.retain(|l| now.seconds_since(Timestamp::from_ns(l.last_seen_ns)) <= longest_s);
    }

    /// Gives track `new`, just confirmed by its rule or, if it `has_moved`, reported, the id of the track that it continues, if there is one.
    pub fn identify(
        &mut self,
        config: &ReidentificationConfig,
        tracks: &mut [Track],
        new: usize,
        has_moved: bool,
        now: Timestamp,
        field: &Field,
    ) -> Identity {
        if config.max_gap_s <= 0.0 {
            return Identity::New;
        }
        let field = &Field { n_still: if has_moved { 0.0 } else { field.n_still }, ..*field };
        let (belief, height, initiated) =
            (tracks[new].filter.kinematics(), tracks[new].appearance.size[1], tracks[new].history.initiated_ns);
        let seen = tracks[new].history.alone_since_initiation();
        // Two detections in one scan are two targets; one that both share is one.
        let may_be_one = |last_seen_ns: i64, hits: u64| {
            let gap_s = Timestamp::from_ns(initiated).seconds_since(Timestamp::from_ns(last_seen_ns));
            gap_s <= config.max_gap_s && hits & seen == 0
        };
        let mut best: Option<(f64, Earlier)> = None;
        let mut consider = |log_ratio: Option<f64>, earlier: Earlier| {
            if let Some(l) = log_ratio.filter(|l| *l > 0.0)
                && best.as_ref().is_none_or(|b| l > b.0)
            {
                best = Some((l, earlier));
            }
        };
        for (i, l) in self.lost.iter().enumerate().filter(|(_, l)| may_be_one(l.last_seen_ns, l.hits)) {
            let mut filter = l.filter.clone();
            if filter.predict(now.seconds_since(l.at).max(0.0)).is_ok() {
                let gap_s = now.seconds_since(Timestamp::from_ns(l.last_seen_ns));
                let ratio = log_ratio((&filter.kinematics(), l.height_px), (&belief, height), gap_s, field);
                consider(ratio, Earlier::Lost(i));
            }
        }
        for (i, t) in tracks.iter().enumerate() {
            if i != new && t.reported && may_be_one(t.history.last_seen_ns, t.history.hits()) {
                let gap_s = now.seconds_since(Timestamp::from_ns(t.history.last_seen_ns));
                let before = (&t.filter.kinematics(), t.appearance.size[1]);
                let ratio = log_ratio(before, (&belief, height), gap_s, field);
                consider(ratio, Earlier::Coasting(i));
            }
        }
        match best {
            None => Identity::New,
            Some((_, Earlier::Lost(i))) => {
                tracks[new].id = self.lost.remove(i).map_or(tracks[new].id, |l| l.id);
                Identity::Found
            }
            Some((_, Earlier::Coasting(i))) => {
                tracks[new].id = tracks[i].id;
                Identity::Replaces(i)
            }
        }
    }
}

/// Where targets can be, how fast, and how many there are: a new track is as likely another one's as there are others.
#[derive(Clone, Copy)]
pub(super) struct Field {
    area_px2: f64,
    max_speed_px_per_s: f64,
    n_targets: f64,
    n_still: f64,
    stay: Stay,
}

/// How long targets stay and how often new ones come.
#[derive(Clone, Copy)]
pub(super) struct Stay {
    /// Probability to stay in view for a second.
    pub survival_per_s: f64,
    /// New targets a second in the field, if that is known.
    pub new_per_s: Option<f64>,
}

impl Field {
    /// The field of an image of that size, px, if it is known, with so many targets and things at rest.
    pub fn new(
        size_px: Option<[f64; 2]>,
        max_speed_px_per_s: f64,
        stay: Stay,
        [n_targets, n_still]: [usize; 2],
    ) -> Self {
        Self {
            area_px2: size_px.map_or(UNKNOWN_AREA_PX2, |[w, h]| w * h),
            max_speed_px_per_s,
            n_targets: n_targets.max(1) as f64,
            n_still: n_still as f64,
            stay,
        }
    }
}

/// Logarithm of the likelihood that both beliefs, each with the target's height, are one target's over that of a new one's; the one before was last seen `gap_s` ago.
fn log_ratio(
    (before, height_before): (&Gaussian<4>, f64),
    (now, height): (&Gaussian<4>, f64),
    gap_s: f64,
    field: &Field,
) -> Option<f64> {
    let cov = before.cov + now.cov;
    let c = cov.cholesky()?;
    let difference = now.mean - before.mean;
    let log_det = 2.0 * c.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
    let straight = -0.5 * (difference.dot(&c.solve(&difference)) + log_det) - 2.0 * std::f64::consts::TAU.ln();
    let speed_var = (field.max_speed_px_per_s / SPEED_STDS).powi(2);
    let speed2 = |g: &Gaussian<4>| g.mean[1].powi(2) + g.mean[3].powi(2);
    // Of a velocity that says nothing of the one before.
    let any_velocity = -(std::f64::consts::TAU * speed_var).ln() - 0.5 * speed2(now) / speed_var;
    // Of one of the speed of the one before, in any direction, as sure as both are known.
    let alike_var = (0.5 * speed2(before) + 0.25 * (cov[(1, 1)] + cov[(3, 3)])).min(speed_var);
    let alike = -(std::f64::consts::TAU * alike_var).ln() - 0.5 * speed2(now) / alike_var;
    let new_velocity = log_sum([(1.0 - ALIKE).ln() + any_velocity, ALIKE.ln() + alike]);
    let reach2 = 0.5 * (speed2(before) + speed2(now)) * gap_s * gap_s;
    let apart = Vector2::new(difference[0], difference[2]);
    let s = Matrix2::new(cov[(0, 0)] + reach2, cov[(0, 2)], cov[(0, 2)], cov[(2, 2)] + reach2);
    let place = -0.5 * apart.dot(&s.cholesky()?.solve(&apart)) - (std::f64::consts::TAU * s.determinant().sqrt()).ln();
    let velocity_cov = Matrix2::new(now.cov[(1, 1)], now.cov[(1, 3)], now.cov[(3, 1)], now.cov[(3, 3)]);
    let velocity = Vector2::new(now.mean[1], now.mean[3]);
    let at_rest = -0.5 * velocity.dot(&velocity_cov.cholesky()?.solve(&velocity))
        - (std::f64::consts::TAU * velocity_cov.determinant().sqrt()).ln();
    let straight = (1.0 - TURNED - RESTED).ln() + straight;
    let (turned, rested) = (TURNED.ln() + place + any_velocity, RESTED.ln() + place + at_rest);
    let grown = if height > 0.0 && height_before > 0.0 { (height / height_before).ln() / SIZE_LOG_STD } else { 0.0 };
    let same = log_sum([straight, turned, rested]) - 0.5 * grown * grown + gap_s * field.stay.survival_per_s.ln();
    let n_new = field.stay.new_per_s.map_or(field.n_targets, |n| (n * gap_s).clamp(1.0, field.n_targets));
    let new = log_sum([(n_new / field.area_px2).ln() + new_velocity, (field.n_still / field.area_px2).ln() + at_rest]);
    (same - new).is_finite().then_some(same - new)
}

/// Logarithm of the sum of exponentials.
fn log_sum<const N: usize>(terms: [f64; N]) -> f64 {
    let most = terms.into_iter().fold(f64::NEG_INFINITY, f64::max);
    if most.is_finite() { most + terms.iter().map(|t| (t - most).exp()).sum::<f64>().ln() } else { most }
}

#[cfg(test)]
mod tests;
