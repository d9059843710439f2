//! A track continued backward in time, through what was detected before it began: a target is mostly fainter or farther away before it is strong enough to start one.
//!
//! Source: our own; the filter is run in reversed time as in two-filter smoothing (D. C. Fraser, J. E. Potter, IEEE Trans. AC 14, 1969), the decision is that of
//! track-before-detect by cumulated evidence (A. Wald, *Sequential Analysis*, 1947).
//! Method: a constant-velocity filter goes backward through the track's own detections, so that it knows where the target came from, and on through the scans before. In each it
//! takes the likeliest detection of its gate that no reported track has, or where there is none, one that a sudden manoeuvre explains better than a miss. The log-likelihood
//! ratio of "the target was there" against "nobody was" is added up: ln(P_D l / λ) of a detection, ln(1 − P_D P_G) of a miss, with the probabilities that the tracker has, and
//! a clutter density that is no lower than what is seen around the place.
//! The track begins where that sum is largest, if it is as sure there as what confirms a track; a walk ends when it has become as unlikely as what deletes one.
//! Where tracks are confirmed by counting hits no such probability is known; but one that was initiated from two detections has had the first of them in the scan before, and is
//! continued by that one.
//! Symbols: l likelihood of a detection (1/px²); λ false detections per px² and scan; times run backward, so velocities have the other sign inside.
//! Limits: one hypothesis; constant velocity whatever the track's own model; more than one scan only with the probabilities of [`ExistenceConfig`]; where more than [`MOST_AROUND`] detections lie around
//! a place nothing is taken there.

use super::config::TrackerConfig;
use super::confirm::existence::ExistenceConfig;
use super::confirm::rule::ConfirmationConfig;
use super::correlated_error;
use super::initiation::InitiationConfig;
use super::score_likelihood::{LogScore, ScoreLikelihoodConfig};
use crate::associate::UniformGrid;
use crate::camera::SteadyGround;
use crate::record::TrackInnovation;
use crate::{Detection, Extent, Scan, TrackId, TrackState, TrackStatus};
use boresight_filters::model::ConstantVelocity;
use boresight_filters::{Gaussian, GaussianFilter, Kf, Measurement, Start};
use nalgebra::Vector2;

/// Own detections that the filter goes through at most: enough for a velocity.
const MOST_OWN: usize = 20;
/// Probability that the velocity changes at once within a scan interval, by anything up to the largest speed: of a bird that turns, or of a camera whose motion is not known. One
/// in a hundred intervals; half or twice as many change the evidence of such a step by 0.7, a detection's is some 5.
const MANOEUVRE: f64 = 0.01;
/// Half the side of the square in which false detections are counted, px, at least: a cell of a clutter map and its neighbours. Where the gate is larger, as of a radar's
/// plots in metres, it is the gate's.
const AROUND_PX: f64 = 48.0;
/// Detections around a place, at most: beyond one in 36 px² none of them tells a target, and the search must end.
const MOST_AROUND: f64 = 256.0;

/// One scan behind a track, with what is known of it.
pub(crate) struct Past<'a> {
    /// The scan.
    pub scan: &'a Scan,
    /// Where the ground lies in it.
    pub ground: SteadyGround,
    /// Its detections' places, px.
    pub grid: &'a UniformGrid,
    /// Which of its detections a reported track has.
    pub taken: &'a [bool],
}

/// A scan in which a track took a detection.
pub(crate) struct Own<'a> {
    /// The scan.
    pub scan: &'a Scan,
    /// Where the ground lies in it.
    pub ground: SteadyGround,
    /// The detection.
    pub detection: u32,
}

/// Continues tracks backward.
#[derive(Clone, Debug)]
pub struct Backward {
    config: TrackerConfig,
    /// Without it only the first of two detections is added.
    existence: Option<ExistenceConfig>,
}

/// A target on its way back.
struct Walk<'c> {
    back: &'c Backward,
    model: ConstantVelocity,
    filter: Kf<ConstantVelocity, 4>,
    time: crate::Timestamp,
    side_px: [f64; 2],
    log_score: Option<f64>,
    /// Where a detection last counted as evidence, px on the ground.
    counted: Vector2<f64>,
    misses: u32,
    /// Others' detections around the place, and the area in which they were counted, px².
    around: [f64; 2],
    /// Largest trace of the noise of a detection that it took, px².
    noise_px2: f64,
}

impl Backward {
    /// What continues the tracks of such a tracker; `None` if it holds nothing back, or knows no probability that a target is there and initiates from one detection.
    pub(crate) fn of(config: &TrackerConfig) -> Option<Self> {
        let existence = match &config.confirmation {
            ConfirmationConfig::Existence(existence) => Some(existence.clone()),
            _ => None,
        };
        let knows = existence.is_some() || matches!(config.initiation, InitiationConfig::TwoPoint(_));
        (config.retrospective_s > 0.0 && knows).then(|| Self { config: config.clone(), existence })
    }

    /// Whether it may go back by more than one scan.
    pub(crate) fn goes_far(&self) -> bool {
        self.existence.is_some()
    }

    /// The states of a track before its first one, the newest first, in image coordinates; `own` are the scans in which it took a detection, from the oldest on, and
    /// `before` those before its first one, from the newest on.
    pub(crate) fn continue_back<'a>(
        &self,
        id: TrackId,
        own: impl Iterator<Item = Own<'a>>,
        mut before: impl Iterator<Item = Past<'a>>,
    ) -> Vec<TrackState> {
        let mut states = Vec::new();
        let Some(mut walk) = self.begin(own) else { return states };
        let Some(existence) = &self.existence else {
            let first = before.next().and_then(|past| walk.step(id, &past));
            states.extend(first.map(|(_, state)| state).filter(|s| s.detection.is_some()));
            return states;
        };
        let (confirm, delete) =
            [existence.confirm_probability, existence.delete_probability].map(|p| (p / (1.0 - p)).ln()).into();
        let (mut sum, mut best, mut n_best) = (0.0, 0.0f64, 0);
        for past in before {
            let Some((evidence, state)) = walk.step(id, &past) else { break };
            sum += evidence;
            states.push(state);
            if sum >= best {
                (best, n_best) = (sum, states.len());
            }
            if sum < best + delete {
                break;
            }
        }
        states.truncate(if best >= confirm { n_best } else { 0 });
        states
    }

    /// Goes through the track's own detections.
    fn begin<'a>(&self, own: impl Iterator<Item = Own<'a>>) -> Option<Walk<'_>> {
        let own: Vec<_> = own
            .take(MOST_OWN)
            .map(|o| Some((o.ground, o.scan, o.scan.detections.get(o.detection as usize)?)))
            .collect::<Option<_>>()?;
        let mut own = own.into_iter().rev();
        let (ground, scan, d) = own.next()?;
        let model = self.config.acceleration_noise(d.extent.height_px).constant_velocity(1.0).ok()?;
        let measurement = self.measurement(ground, d);
        let filter = Kf::from_point(model, &measurement, self.config.max_speed_px_per_s / 3f64.sqrt()).ok()?;
        let mut walk = Walk {
            back: self,
            model,
            filter,
            time: seen(scan, d),
            side_px: [d.extent.width_px, d.extent.height_px],
            log_score: self.log_score(d).map(|s| s.ln),
            counted: measurement.position,
            misses: 0,
            around: [0.0, (2.0 * AROUND_PX).powi(2)],
            noise_px2: self.noise_trace(d),
        };
        for (ground, scan, d) in own {
            walk.predict(seen(scan, d))?;
            walk.counted = self.measurement(ground, d).position;
            walk.filter.correct(&self.measurement(ground, d)).ok()?;
            walk.follow(d);
        }
        Some(walk)
    }

    /// Variance added to a detection's own, px².
    fn extra(&self, d: &Detection) -> f64 {
        self.config.extra_noise_px.powi(2) + (self.config.extra_noise_per_height * d.extent.height_px).powi(2)
    }

    /// Trace of a detection's noise in the image, px².
    fn noise_trace(&self, d: &Detection) -> f64 {
        self.config.detection_covariance_scale * d.cov.trace() + 2.0 * self.extra(d)
    }

    /// A detection on the ground, with the noise that the tracker gives it.
    fn measurement(&self, ground: SteadyGround, d: &Detection) -> Measurement {
        let d = ground.detection_on_ground(d);
        let extra = self.extra(&d);
        let mut cov = d.cov * self.config.detection_covariance_scale;
        cov[(0, 0)] += extra;
        cov[(1, 1)] += extra;
        Measurement { position: d.position, cov }
    }

    fn log_score(&self, d: &Detection) -> Option<LogScore> {
        let config = self.config.score_likelihood.as_ref()?;
        let ln = f64::from(d.score.max(f32::MIN_POSITIVE)).ln();
        Some(LogScore { ln, clutter: config.clutter_density(ln) })
    }
}

/// A detection that can be the target's.
struct Likely {
    detection: u32,
    measurement: Measurement,
    innovation: TrackInnovation,
    /// ln of its likelihood over that of a false detection of density 1.
    log_ratio: f64,
}

impl Walk<'_> {
    fn predict(&mut self, to: crate::Timestamp) -> Option<()> {
        let dt_s = self.time.seconds_since(to).max(0.0);
        self.time = to;
        self.filter.predict(dt_s).ok()
    }

    fn follow(&mut self, d: &Detection) {
        let gain = self.back.config.appearance_gain;
        self.noise_px2 = self.noise_px2.max(self.back.noise_trace(d));
        for (mean, side) in self.side_px.iter_mut().zip([d.extent.width_px, d.extent.height_px]) {
            *mean += gain * (side - *mean);
        }
        if let Some(now) = self.back.log_score(d) {
            self.log_score = Some(self.log_score.map_or(now.ln, |mean| mean + gain * (now.ln - mean)));
        }
    }

    /// One scan further back: the log-likelihood ratio and the state there; `None` where the walk cannot go on.
    fn step(&mut self, id: TrackId, past: &Past<'_>) -> Option<(f64, TrackState)> {
        let (before, dt_s) = (self.filter.belief(), self.time.seconds_since(past.scan.time));
        self.predict(past.scan.time)?;
        let config = &self.back.config;
        let belief = self.filter.belief();
        let place = past.ground.in_image(Vector2::new(belief.mean[0], belief.mean[2]));
        if let Some([width, height]) = config.field_px
            && !(place.x >= -0.5 && place.y >= -0.5 && place.x <= width - 0.5 && place.y <= height - 0.5)
        {
            return None;
        }
        let (mut likely, mut around) = self.look(past, place, &belief);
        let (p_detection, mut p_motion) = (config.p_detection(self.misses), 1.0);
        let missed = (1.0 - p_detection * config.gate_probability).max(f64::MIN_POSITIVE).ln();
        let clutter = |[n, area_px2]: [f64; 2]| {
            config.clutter_density_per_px2.max((self.around[0] + n) / (self.around[1] + area_px2))
        };
        if likely.is_none()
            && let Some(turned) = self.turned(before, dt_s)
        {
            let (other, wider) = self.look(past, place, &turned.belief());
            let gain = |l: &Likely| (MANOEUVRE * p_detection / clutter(wider)).ln() + l.log_ratio;
            if other.as_ref().is_some_and(|l| gain(l) > missed) {
                (likely, around, p_motion) = (other, wider, MANOEUVRE);
                self.filter = turned;
            }
        }
        let clutter = clutter(around);
        self.around = [self.around[0] + around[0], self.around[1] + around[1]];
        let (evidence, detection, innovation) = match likely {
            Some(l) if self.filter.correct(&l.measurement).is_ok() => {
                self.misses = 0;
                let d = &past.scan.detections[l.detection as usize];
                self.follow(d);
                let evidence = (p_motion * p_detection / clutter).ln() + l.log_ratio;
                let told = config.evidence(d, &l.measurement.position, &mut self.counted, evidence);
                (told, Some(l.detection), Some(l.innovation))
            }
            _ => {
                self.misses += 1;
                (missed, None, None)
            }
        };
        Some((evidence, self.state(id, past, detection, innovation)))
    }

    /// The filter as it would be here with any velocity from the scan before on.
    fn turned(&self, mut before: Gaussian<4>, dt_s: f64) -> Option<Kf<ConstantVelocity, 4>> {
        let variance = self.back.config.max_speed_px_per_s.powi(2) / 3.0;
        for v in [1, 3] {
            before.cov.row_mut(v).fill(0.0);
            before.cov.column_mut(v).fill(0.0);
            before.cov[(v, v)] = variance;
        }
        let mut filter = Kf::start(self.model, before).ok()?;
        filter.predict(dt_s).ok()?;
        Some(filter)
    }

    /// The likeliest detection of the gate that nobody has; how many others nobody has around it, and in which area, px².
    fn look(&self, past: &Past<'_>, place: Vector2<f64>, belief: &Gaussian<4>) -> (Option<Likely>, [f64; 2]) {
        let config = &self.back.config;
        let (mut best, mut n_around) = (None::<Likely>, 0.0);
        let variance = belief.cov[(0, 0)].max(belief.cov[(2, 2)]) + self.noise_px2;
        let half = AROUND_PX
            .max((variance * config.gate()).sqrt() * past.ground.zoom_at(Vector2::new(belief.mean[0], belief.mean[2])));
        let is_around = |off: Vector2<f64>| off.x.abs() <= half && off.y.abs() <= half;
        // What was seen before the scan's time lies where the target was then.
        let oldest_s = past.scan.detections.iter().map(|d| d.age_ns).max().unwrap_or(0) as f64 * 1e-9;
        let far = half + oldest_s * config.max_speed_px_per_s;
        past.grid.near(place.x, place.y, far, far, |point| {
            let Some(d) = past.scan.detections.get(point.index as usize) else { return true };
            if past.taken.get(point.index as usize) == Some(&true) {
                return true;
            }
            let off = d.position - place;
            n_around += f64::from(u8::from(is_around(off)));
            if n_around > MOST_AROUND {
                best = None;
                return false;
            }
            // No variance in any direction exceeds the trace.
            let trace = belief.cov[(0, 0)] + belief.cov[(2, 2)] + self.back.noise_trace(d);
            if !past.ground.has_moved() && d.age_ns == 0 && off.norm_squared() > config.gate() * trace {
                return true;
            }
            let measurement = carried(self.back.measurement(past.ground, d), d.age_ns, belief);
            let nu = measurement.position - Vector2::new(belief.mean[0], belief.mean[2]);
            let mut cov = measurement.cov;
            for (i, a) in [0, 2].into_iter().enumerate() {
                for (j, b) in [0, 2].into_iter().enumerate() {
                    cov[(i, j)] += belief.cov[(a, b)];
                }
            }
            let Some(nis) = cov.cholesky().map(|c| nu.dot(&c.solve(&nu))) else { return true };
            if nis > config.gate() {
                return true;
            }
            let score = match (&config.score_likelihood, self.back.log_score(d)) {
                (Some(c), Some(s)) => score_ratio(c, self.log_score, self.misses > 0, s),
                _ => 1.0,
            };
            let log_ratio = -0.5 * nis - (std::f64::consts::TAU * cov.determinant().sqrt()).ln() + score.ln();
            // The first of equals in the order of the scan, whatever the order of the cells.
            let better =
                |b: &Likely| log_ratio > b.log_ratio || (log_ratio == b.log_ratio && point.index < b.detection);
            if best.as_ref().is_none_or(better) {
                let innovation = TrackInnovation { innovation: nu, cov, nis };
                best = Some(Likely { detection: point.index, measurement, innovation, log_ratio });
            }
            true
        });
        if let Some(b) = &best {
            n_around -= f64::from(u8::from(is_around(past.scan.detections[b.detection as usize].position - place)));
        }
        (best, [n_around, (2.0 * half).powi(2)])
    }

    fn state(
        &self,
        id: TrackId,
        past: &Past<'_>,
        detection: Option<u32>,
        innovation: Option<TrackInnovation>,
    ) -> TrackState {
        let mut kinematics = self.filter.belief();
        // Time runs forward again.
        for v in [1, 3] {
            kinematics.mean[v] = -kinematics.mean[v];
            for i in 0..4 {
                kinematics.cov[(v, i)] = -kinematics.cov[(v, i)];
                kinematics.cov[(i, v)] = -kinematics.cov[(i, v)];
            }
        }
        correlated_error::add_to(&mut kinematics, self.back.config.correlated_error_px);
        let [width_px, height_px] = self.side_px;
        let (left_px, top_px) = (kinematics.mean[0] - 0.5 * width_px, kinematics.mean[2] - 0.5 * height_px);
        let extent = Extent { left_px, top_px, width_px, height_px };
        let status = if detection.is_some() { TrackStatus::Confirmed } else { TrackStatus::Coasting };
        // One that is confirmed by its hits is a target: nothing less is known of it.
        let score = self.back.existence.as_ref().map_or(1.0, |e| e.confirm_probability) as f32;
        let mut state = [TrackState { id, status, kinematics, extent, detection, innovation, score }];
        past.ground.tracks_in_image(&mut state);
        let [state] = state;
        state
    }
}

/// When a detection was seen.
fn seen(scan: &Scan, d: &Detection) -> crate::Timestamp {
    crate::Timestamp::from_ns(scan.time.ns.saturating_sub_unsigned(d.age_ns))
}

/// What was seen `age_ns` before the scan's time, carried there by a belief in reversed time.
fn carried(mut m: Measurement, age_ns: u64, belief: &Gaussian<4>) -> Measurement {
    if age_ns > 0 {
        let age_s = age_ns as f64 * 1e-9;
        m.position -= age_s * Vector2::new(belief.mean[1], belief.mean[3]);
        for (i, a) in [1, 3].into_iter().enumerate() {
            for (j, b) in [1, 3].into_iter().enumerate() {
                m.cov[(i, j)] += age_s * age_s * belief.cov[(a, b)];
            }
        }
    }
    m
}

/// Likelihood ratio of a score.
fn score_ratio(c: &ScoreLikelihoodConfig, level: Option<f64>, missed: bool, score: LogScore) -> f64 {
    (c.target_density(level, missed, score) / score.clutter).max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests;
