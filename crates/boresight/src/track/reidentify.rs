//! Reidentification: a target that was lost and is found again keeps its id.
//!
//! Source: our own; the hypothesis test is Bayes' with even odds. When a track is confirmed, the tracks lost within the last seconds, and those that
//! coast without a detection since the new one began, are predicted to that time by their own filters. The difference of the two beliefs in
//! position and velocity is either that of one target, N(0, P + P'), or a new target's, anywhere in the field with a velocity
//! N(0, v²/9) per axis; the likelier hypothesis holds, and among several lost tracks the likeliest one.
//! Tracks are also lost where a target turns harder than the model allows (a ball at a wall): with the probability [`TURNED`] the velocity has changed by
//! as much as the speeds before and after, u and u', and only the place speaks: N(0, P + P' + ½ (u² + u'²) T² I), T the time since it was last seen.
//! It decides once and looks back only: a stream's ids, the annotated video's and the table's are the same.
//! Symbols: A the field's area (px²), v the largest speed (px/s), n the number of reported targets: a new one has the density n / A; s the logarithm of the ratio of the heights.
//! Limits: a track keeps its own number while it is tentative. At most [`MOST_LOST`] lost tracks are remembered, the newest.

use super::filter::TrackedFilter;
use super::single_track::Track;
use crate::validate::not_negative;
use crate::{Result, Timestamp};
use boresight_filters::{Filter, Gaussian};
use nalgebra::{Matrix2, Vector2};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How long a new track may take to be confirmed, s: a lost one is remembered for so much longer than the gap.
const CONFIRM_S: f64 = 10.0;
/// Share of losses where the target had turned hard; with none, every reversal gives a new id. Chosen: such turns are rarer than hiding.
const TURNED: f64 = 0.1;
/// Lost tracks remembered.
const MOST_LOST: usize = 256;
/// Deviation of the logarithm of a target's height between its loss and its return: a third larger or smaller.
const SIZE_LOG_STD: f64 = 0.3;
/// The largest speed is so many deviations of a target's velocity.
const SPEED_STDS: f64 = 3.0;
/// Area of a field whose size is not known, px²: a megapixel.
const UNKNOWN_AREA_PX2: f64 = 1e6;

/// Whether a target that was lost gets its old id when it is found again.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct ReidentificationConfig {
    /// Longest time between its last detection and the first of the new track, s, 0 or more; 0 gives every track an id of its own.
    pub max_gap_s: f64,
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
    height_px: f64,
}

/// What a new track can be the continuation of.
enum Earlier {
    Lost(usize),
    Coasting(usize),
}

/// Tracks that were lost.
#[derive(Default)]
pub(super) struct Reidentification {
    lost: Vec<Lost>,
}

impl Reidentification {
    /// Remembers a reported track that ends; its filter stands at `now`.
    pub fn remember(&mut self, config: &ReidentificationConfig, track: &Track, now: Timestamp) {
        if config.max_gap_s <= 0.0 || !track.reported {
            return;
        }
        if self.lost.len() >= MOST_LOST {
            self.lost.remove(0);
        }
        self.lost.push(Lost {
            id: track.id,
            filter: track.filter.clone(),
            at: now,
            last_seen_ns: track.history.last_seen_ns,
            height_px: track.appearance.size[1],
        });
    }

    /// Forgets what was lost too long ago.
    pub fn forget(&mut self, config: &ReidentificationConfig, now: Timestamp) {
        self.lost.retain(|l| now.seconds_since(Timestamp::from_ns(l.last_seen_ns)) <= config.max_gap_s + CONFIRM_S);
    }

    /// Gives track `new`, just confirmed, the id of the track that it continues, if there is one. Returns the number of a track that coasted
    /// and is replaced by it.
    pub fn identify(
        &mut self,
        config: &ReidentificationConfig,
        tracks: &mut [Track],
        new: usize,
        now: Timestamp,
        field: &Field,
    ) -> Option<usize> {
        if config.max_gap_s <= 0.0 {
            return None;
        }
        let (belief, height, initiated) =
            (tracks[new].filter.kinematics(), tracks[new].appearance.size[1], tracks[new].history.initiated_ns);
        let in_time = |last_seen_ns: i64| {
            let gap_s = Timestamp::from_ns(initiated).seconds_since(Timestamp::from_ns(last_seen_ns));
            gap_s >= 0.0 && gap_s <= config.max_gap_s
        };
        let mut best: Option<(f64, Earlier)> = None;
        let mut consider = |log_ratio: Option<f64>, earlier: Earlier| {
            if let Some(l) = log_ratio.filter(|l| *l > 0.0)
                && best.as_ref().is_none_or(|b| l > b.0)
            {
                best = Some((l, earlier));
            }
        };
        for (i, l) in self.lost.iter().enumerate().filter(|(_, l)| in_time(l.last_seen_ns)) {
            let mut filter = l.filter.clone();
            if filter.predict(now.seconds_since(l.at).max(0.0)).is_ok() {
                let gap_s = now.seconds_since(Timestamp::from_ns(l.last_seen_ns));
                let ratio = log_ratio(&filter.kinematics(), l.height_px, &belief, height, gap_s, field);
                consider(ratio, Earlier::Lost(i));
            }
        }
        for (i, t) in tracks.iter().enumerate() {
            if i != new && t.reported && t.history.misses > 0 && in_time(t.history.last_seen_ns) {
                let gap_s = now.seconds_since(Timestamp::from_ns(t.history.last_seen_ns));
                let ratio = log_ratio(&t.filter.kinematics(), t.appearance.size[1], &belief, height, gap_s, field);
                consider(ratio, Earlier::Coasting(i));
            }
        }
        match best?.1 {
            Earlier::Lost(i) => {
                tracks[new].id = self.lost.remove(i).id;
                None
            }
            Earlier::Coasting(i) => {
                tracks[new].id = tracks[i].id;
                Some(i)
            }
        }
    }
}

/// Where targets can be, how fast, and how many there are: a new track is as likely another one's as there are others.
pub(super) struct Field {
    area_px2: f64,
    max_speed_px_per_s: f64,
    n_targets: f64,
}

impl Field {
    /// The field of an image of that size, px, if it is known.
    pub fn new(size_px: Option<[f64; 2]>, max_speed_px_per_s: f64, n_targets: usize) -> Self {
        let area_px2 = size_px.map_or(UNKNOWN_AREA_PX2, |[w, h]| w * h);
        Self { area_px2, max_speed_px_per_s, n_targets: n_targets.max(1) as f64 }
    }
}

/// Logarithm of the likelihood that both beliefs are one target's over that of a new one's; the one before was last seen `gap_s` ago.
fn log_ratio(
    before: &Gaussian<4>,
    height_before: f64,
    now: &Gaussian<4>,
    height: f64,
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
    let reach2 = 0.5 * (speed2(before) + speed2(now)) * gap_s * gap_s;
    let apart = Vector2::new(difference[0], difference[2]);
    let s = Matrix2::new(cov[(0, 0)] + reach2, cov[(0, 2)], cov[(0, 2)], cov[(2, 2)] + reach2);
    let turned = TURNED.ln()
        - 0.5 * apart.dot(&s.cholesky()?.solve(&apart))
        - (std::f64::consts::TAU * s.determinant().sqrt()).ln()
        + any_velocity;
    let grown = if height > 0.0 && height_before > 0.0 { (height / height_before).ln() / SIZE_LOG_STD } else { 0.0 };
    let likelier = straight.max(turned);
    let same = likelier + (-(straight - turned).abs()).exp().ln_1p() - 0.5 * grown * grown;
    let new = (field.n_targets / field.area_px2).ln() + any_velocity;
    (same - new).is_finite().then_some(same - new)
}

#[cfg(test)]
mod tests {
    use crate::track::{ReidentificationConfig, Tracker, TrackerConfig, Tracking};
    use crate::{Detection, Extent, FrameIndex, Scan, Timestamp, TrackStatus};
    use nalgebra::{Matrix2, Vector2};

    /// The ids of confirmed tracks in the last scan: a target that flies at 30 px/s, hidden between two times, and comes back displaced.
    fn ids(hidden_s: [f64; 2], displaced_px: f64, max_gap_s: f64) -> Vec<u64> {
        let config = TrackerConfig {
            reidentification: ReidentificationConfig { max_gap_s },
            field_px: Some([640.0, 512.0]),
            ..TrackerConfig::default()
        };
        let mut tracker = Tracker::new(&config).unwrap();
        let mut seen = Vec::new();
        for k in 0..150u64 {
            let t = k as f64 * 0.04;
            let hidden = t > hidden_s[0] && t < hidden_s[1];
            let x = 100.0 + 30.0 * t + if t >= hidden_s[1] { displaced_px } else { 0.0 };
            let at = Vector2::new(x, 200.0);
            let d = Detection::at(at, Matrix2::identity() * 0.1).with_extent(Extent::around(at, 5.0, 5.0));
            let scan = Scan::at(FrameIndex(k), Timestamp::from_secs_f64(t)).with_detections(if hidden {
                vec![]
            } else {
                vec![d]
            });
            seen = tracker.step(&scan).unwrap().to_vec();
        }
        seen.iter().filter(|s| s.status == TrackStatus::Confirmed).map(|s| s.id.0).collect()
    }

    #[test]
    fn a_target_that_turns_back_out_of_sight_keeps_its_id_and_another_place_does_not() {
        // Seen to x = 160 px at 2 s at 30 px/s, then from 0.6 s later on flying back at 30 px/s from where it would have been after 0.3 s.
        let back = |from_px: f64| {
            let config = TrackerConfig {
                reidentification: ReidentificationConfig { max_gap_s: 2.0 },
                field_px: Some([640.0, 512.0]),
                ..TrackerConfig::default()
            };
            let mut tracker = Tracker::new(&config).unwrap();
            let mut seen = Vec::new();
            for k in 0..120u64 {
                let t = k as f64 * 0.04;
                let x = if t <= 2.0 { 100.0 + 30.0 * t } else { from_px - 30.0 * (t - 2.6) };
                let at = Vector2::new(x, 200.0);
                let d = Detection::at(at, Matrix2::identity() * 0.1).with_extent(Extent::around(at, 5.0, 5.0));
                let d = if t > 2.0 && t < 2.6 { vec![] } else { vec![d] };
                let scan = Scan::at(FrameIndex(k), Timestamp::from_secs_f64(t)).with_detections(d);
                seen = tracker.step(&scan).unwrap().to_vec();
            }
            seen.iter().filter(|s| s.status == TrackStatus::Confirmed).map(|s| s.id.0).collect::<Vec<_>>()
        };
        assert_eq!(back(160.0), [1], "it turned at 169 px");
        assert_eq!(back(350.0), [2], "nothing of 30 px/s gets there");
    }

    #[test]
    fn a_target_hidden_for_a_second_keeps_its_id() {
        assert_eq!(ids([2.0, 3.2], 0.0, 2.0), [1]);
        assert_eq!(ids([2.0, 3.2], 0.0, 0.0), [2], "switched off");
        assert_eq!(ids([2.0, 4.5], 0.0, 2.0), [2], "too long");
    }

    #[test]
    fn a_track_that_jumps_is_one_target_as_far_as_its_covariance_reaches_and_replaces_the_one_that_coasts() {
        // The jump is out of the gate: a new track begins while the old one coasts.
        assert_eq!(ids([2.0, 2.04], 2.5, 2.0), [1]);
        assert_eq!(ids([2.0, 2.04], 2.5, 0.0), [2], "switched off: it was out of the gate");
        assert_eq!(ids([2.0, 2.04], 250.0, 2.0), [2]);
    }
}
