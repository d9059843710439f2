//! Initiate: tracks from the detections that no track took, and from the targets known before the first scan.
//!
//! Source: docs/theory/track-management.md: each unassociated detection of the scan before, in order, with the nearest unassociated one
//! of this scan that a target can have reached. With a known spread of velocities the second point corrects a one-point start instead,
//! and its likelihood under that start says how much likelier a target is than clutter. A detection that comes with its velocity starts a track at once.
//! Symbols: Λ of a second point, P_D l / λ; l its density (1/px²), λ density of clutter (1/px²).
//! Limits: at most `max_tracks` tracks; at most [`MOST_LOOKED_AT`] candidates are looked at for each unassociated detection.

use super::super::appearance::Appearance;
use super::super::clutter::Clutter;
use super::super::config::TrackerConfig;
use super::super::confirm::motion_test::MotionProgress;
use super::super::filter::TrackedFilter;
use super::super::initiation::{InitiationConfig, VelocityPrior, from_one_point, from_two_points, from_velocity};
use super::super::scan_table::{Cov2, MOST_LOOKED_AT, Predicted};
use super::super::score_likelihood::LogScore;
use super::super::single_track::{BATCH, Outcome, Track, motion_of, place_of};
use super::context::Context;
use super::gate::normalised_square;
use super::plot_time::seconds;
use super::report::report;
use crate::{Result, Timestamp, TrackState};
use boresight_filters::{Filter, Measurement, Weighted};
use nalgebra::Vector2;

/// A detection that no track took, kept for the next scan.
#[derive(Clone, Copy, Debug)]
struct Unassociated {
    position: Vector2<f64>,
    noise: Cov2,
    score: Option<LogScore>,
    /// How long before its scan's time it was seen, s.
    age_s: f64,
}

/// What waits for a second point.
#[derive(Clone, Debug, Default)]
pub(in crate::track) struct Pending {
    unassociated: Vec<Unassociated>,
    time: Timestamp,
}

/// Where new tracks and their records go.
pub(in crate::track) struct NewTracks<'a> {
    pub tracks: &'a mut Vec<Track>,
    pub states: &'a mut Vec<TrackState>,
    pub next_id: &'a mut u64,
}

/// Initiates tracks from the detections that are not `used`, and keeps the rest for the next scan.
pub(in crate::track) fn initiate(
    context: &Context<'_>,
    clutter: &Clutter,
    used: &mut [bool],
    pending: &mut Pending,
    out: &mut NewTracks<'_>,
) {
    let Context { scan, table, config, .. } = *context;
    let prior = config.initiation.velocity_prior();
    let max_tracks = config.max_tracks as usize;
    // What comes with its velocity needs no second point.
    for (j, d) in scan.detections.iter().enumerate().filter(|(_, d)| d.velocity.is_some()) {
        if !used[j] && out.tracks.len() < max_tracks && config.may_initiate(d.score) {
            used[j] = true;
            begin(context, clutter, j, None, prior, 0.0, out);
        }
    }
    if let InitiationConfig::OnePoint(_) = config.initiation {
        for (j, d) in scan.detections.iter().enumerate() {
            if !used[j] && out.tracks.len() < max_tracks && config.may_initiate(d.score) {
                begin(context, clutter, j, None, prior, 0.0, out);
            }
        }
        return;
    }
    let dt_s = scan.time.seconds_since(pending.time);
    if dt_s > 0.0 {
        let far = config.max_speed_px_per_s * dt_s;
        for (k, first) in pending.unassociated.iter().enumerate() {
            if out.tracks.len() >= max_tracks {
                break;
            }
            if k % BATCH == 0 {
                let batch = pending.unassociated[k..].iter().take(BATCH).map(|u| u.position);
                let grid = table.grid();
                std::hint::black_box(batch.fold(0, |sum, p| sum ^ grid.touch(p.x, p.y, far, far)));
            }
            if let Some((j, dt_s)) = second_point(context, used, first, dt_s) {
                used[j] = true;
                begin(context, clutter, j, Some(first), prior, dt_s, out);
            }
        }
    }
    pending.unassociated.clear();
    for (j, d) in scan.detections.iter().enumerate() {
        if !used[j] && config.may_initiate(d.score) {
            pending.unassociated.push(Unassociated {
                position: d.position,
                noise: table.noise(j as u32),
                score: table.scores.of(j as u32),
                age_s: seconds(context.age_ns(j as u32)),
            });
        }
    }
    pending.time = scan.time;
}

/// Makes the configured initial tracks confirmed tracks at the time of the first scan.
/// # Errors
/// A state that the filter refuses.
pub(in crate::track) fn from_initial_tracks(
    config: &TrackerConfig,
    now: Timestamp,
    tracks: &mut Vec<Track>,
    next_id: &mut u64,
) -> Result<()> {
    for initial in &config.initial_tracks {
        let mut filter = config.start_filter(&initial.belief(), initial.size_px[1])?;
        filter.predict(initial.age_s)?;
        let k = filter.kinematics();
        let mut history = config.confirmation.begin(2, now.ns, config.clutter_density_per_px2, 1.0);
        history.accept();
        // Reach of the first gate: where it can be, and where its detection can then lie.
        let spread = k.cov[(0, 0)].max(k.cov[(2, 2)]).sqrt() + config.extra_noise_px;
        tracks.push(Track {
            id: *next_id,
            filter,
            history,
            appearance: Appearance { size: initial.size_px, sum: 0.0, class: None },
            duplicate_since_ns: None,
            last_place: [k.mean[0], k.mean[2], spread],
            counted: Vector2::new(k.mean[0], k.mean[2]),
            last_age_ns: 0,
            reported: true,
            identified: true,
            log_score: None,
            motion: MotionProgress::passed(),
        });
        *next_id += 1;
    }
    Ok(())
}

/// Begins one track with a detection, and with the unassociated one before it if there is one.
fn begin(
    context: &Context<'_>,
    clutter: &Clutter,
    detection: usize,
    first: Option<&Unassociated>,
    prior: VelocityPrior,
    dt_s: f64,
    out: &mut NewTracks<'_>,
) {
    let Context { scan, table, config, .. } = *context;
    let d = &scan.detections[detection];
    let noise = table.noise(detection as u32);
    let Some((mut filter, likelihood_ratio)) =
        first_filter(context, clutter, detection as u32, &noise, first, prior, dt_s)
    else {
        return;
    };
    let age_ns = context.age_ns(detection as u32);
    if age_ns > 0 && filter.predict(seconds(age_ns)).is_err() {
        return;
    }
    let mut likelihood_ratio =
        likelihood_ratio * context.new_target_score_ratio(first.and_then(|f| f.score), detection as u32);
    if first.is_some_and(|f| config.says_nothing_new(d, &d.position, &f.position)) {
        likelihood_ratio = likelihood_ratio.min(1.0);
    }
    let n_points = if first.is_some() { 2 } else { 1 };
    let clutter_density = clutter.at(d.position.x, d.position.y);
    let mut track = Track {
        id: *out.next_id,
        filter,
        history: config.confirmation.begin(n_points, scan.time.ns, clutter_density, likelihood_ratio),
        appearance: Appearance::of(d),
        duplicate_since_ns: None,
        last_place: place_of(d, &noise),
        counted: d.position,
        last_age_ns: age_ns,
        reported: false,
        identified: false,
        log_score: table.scores.log_score(detection as u32),
        motion: motion_of(d, &noise, table.camera, config.report),
    };
    let outcome = Outcome { hit: true, detection: Some(detection as u32), ..Outcome::default() };
    out.states.push(report(&mut track, &outcome, config, table.camera));
    out.tracks.push(track);
    *out.next_id += 1;
}

/// The filter of a new track and Λ of its second point (1 if there is none); nothing if the filter refuses it.
fn first_filter(
    context: &Context<'_>,
    clutter: &Clutter,
    detection: u32,
    noise: &Cov2,
    first: Option<&Unassociated>,
    prior: VelocityPrior,
    dt_s: f64,
) -> Option<(TrackedFilter, f64)> {
    let (config, d) = (context.config, &context.scan.detections[detection as usize]);
    let height_px = d.extent.height_px;
    match (first, prior) {
        (Some(first), Some((velocity, variance))) => {
            let start = from_one_point(&first.position, &first.noise.matrix(), velocity, variance);
            let mut filter = config.start_filter(&start, height_px).ok()?;
            filter.predict(dt_s).ok()?;
            let p = filter.predicted();
            let (position, noise) = context.measured(detection, &Predicted::of(&p, f64::INFINITY));
            let s = p.cov + noise.matrix();
            let density = (-0.5 * normalised_square(&(position - p.mean), &s)).exp()
                / (std::f64::consts::TAU * s.determinant().sqrt());
            let measurement = Measurement { position, cov: noise.matrix() };
            filter.update(&[Weighted { measurement, weight: 1.0 }]).ok()?;
            let clutter_density = clutter.at(d.position.x, d.position.y).max(1e-200);
            Some((filter, config.detection_probability * density / clutter_density))
        }
        (Some(first), None) => {
            let start = from_two_points(&first.position, &first.noise.matrix(), &d.position, &noise.matrix(), dt_s);
            let filter = config.start_filter(&start, height_px).ok()?;
            Some((filter, uniform_ratio(config, dt_s, clutter.at(d.position.x, d.position.y))))
        }
        (None, _) if let Some(v) = &d.velocity => {
            let start = from_velocity(&d.position, &noise.matrix(), v, config.detection_covariance_scale);
            Some((config.start_filter(&start, height_px).ok()?, 1.0))
        }
        (None, prior) => {
            let (velocity, variance) = prior.unwrap_or_default();
            let start = from_one_point(&d.position, &noise.matrix(), velocity, variance);
            Some((config.start_filter(&start, height_px).ok()?, 1.0))
        }
    }
}

/// Λ of a second point when nothing is known of the velocity: uniform over what the speed lets it reach.
fn uniform_ratio(config: &TrackerConfig, dt_s: f64, clutter: f64) -> f64 {
    let area_px2 = std::f64::consts::PI * (config.max_speed_px_per_s * dt_s).powi(2);
    config.detection_probability / (area_px2 * clutter).max(1e-200)
}

/// The nearest unassociated detection that a target at `first` can have reached, and the time between the two, s, where the scans lie `dt_s` apart.
fn second_point(context: &Context<'_>, used: &[bool], first: &Unassociated, dt_s: f64) -> Option<(usize, f64)> {
    let config = context.config;
    let longest = config.max_speed_px_per_s * (dt_s + first.age_s);
    let mut best: Option<(f64, u32, f64)> = None;
    let mut looked_at = 0;
    context.table.grid().near(first.position.x, first.position.y, longest, longest, |p| {
        looked_at += 1;
        let between_s = dt_s + first.age_s - seconds(context.age_ns(p.index));
        let far = config.max_speed_px_per_s * between_s;
        let (dx, dy) = (p.x - first.position.x, p.y - first.position.y);
        let distance2 = dx * dx + dy * dy;
        let nearer = best.is_none_or(|(d, i, _)| distance2 < d || (distance2 == d && p.index < i));
        let possible = match &config.initiation {
            InitiationConfig::VelocityBounds(b) => [dx, dy]
                .iter()
                .enumerate()
                .all(|(a, d)| (b.min_px_per_s[a]..=b.max_px_per_s[a]).contains(&(d / between_s))),
            _ => true,
        };
        // What is seen twice in a moment, at the border of two turns, tells no velocity.
        let apart = between_s >= 0.5 * dt_s;
        if apart && distance2 <= far * far && nearer && possible && !used[p.index as usize] {
            best = Some((distance2, p.index, between_s));
        }
        looked_at < MOST_LOOKED_AT
    });
    debug_assert!(best.is_none_or(|(_, i, _)| (i as usize) < context.scan.detections.len()));
    best.map(|(_, i, between_s)| (i as usize, between_s))
}

#[cfg(test)]
mod tests {
    use crate::track::{
        ConfirmationConfig, ExistenceConfig, InitialTrackConfig, InitiationConfig, OnePointConfig, TrackerConfig,
        TwoPointConfig, VelocityBoundsConfig, build,
    };
    use crate::{Detection, Scan, Timestamp, TrackState};
    use nalgebra::{Matrix2, Vector2};

    /// Tracks after two scans `dt_s` apart of detections with variance `r` px² and score 5.
    fn after(config: &TrackerConfig, r: f64, dt_s: f64, scans: [&[(f64, f64)]; 2]) -> Vec<TrackState> {
        let mut tracker = build(config).unwrap();
        let mut states = Vec::new();
        for (k, places) in scans.iter().enumerate() {
            let detection =
                |p: &(f64, f64)| Detection::at(Vector2::new(p.0, p.1), Matrix2::identity() * r).with_score(5.0);
            let scan = Scan {
                time: Timestamp::from_secs_f64(k as f64 * dt_s),
                detections: places.iter().map(detection).collect(),
                ..Scan::default()
            };
            states = tracker.step(&scan).unwrap().to_vec();
        }
        states
    }

    fn existence() -> TrackerConfig {
        let config = ExistenceConfig { new_target_density_per_px2: 1e-4, ..ExistenceConfig::default() };
        TrackerConfig {
            confirmation: ConfirmationConfig::Existence(config),
            clutter_density_per_px2: 1e-3,
            detection_probability: 0.9,
            max_speed_px_per_s: 10.0,
            acceleration_std_px_per_s2: Some(1e-9),
            extra_noise_px: 0.0,
            ..TrackerConfig::default()
        }
    }

    #[test]
    fn two_points_give_position_and_velocity_with_their_covariance() {
        // x = [z₂, Δz/T], P = R [[1, 1/T], [1/T, 2/T²]] for R = 1/4, T = 1/2; the uniform Λ is 0.9 / (π 5² 0.001).
        let states = after(&existence(), 0.25, 0.5, [&[(0.0, 0.0)], &[(2.0, 1.0)]]);
        let k = &states[0].kinematics;
        assert_eq!(k.mean.as_slice(), [2.0, 4.0, 1.0, 2.0]);
        let block =
            [k.cov[(0, 0)], k.cov[(0, 1)], k.cov[(1, 1)], k.cov[(2, 2)], k.cov[(2, 3)], k.cov[(3, 3)], k.cov[(0, 2)]];
        assert_eq!(block, [0.25, 0.5, 2.0, 0.25, 0.5, 2.0, 0.0]);
        // Odds 0.1 · 11.459 = 1.1459: probability 0.53400.
        assert!((states[0].score - 0.534_00).abs() < 1e-5, "{}", states[0].score);
    }

    #[test]
    fn with_a_known_spread_of_velocities_the_second_point_corrects_the_first() {
        // R = 1, velocity 2 px/s, T = 1: P = [[5, 4], [4, 4]], S = 6; a step of 3 px gives x = 3 · 5/6, v = 3 · 4/6.
        // Λ = 0.9 exp(−9/12) / (2π 6) / 0.001 = 11.2769, odds 1.12769: probability 0.53001.
        let two = TwoPointConfig { velocity_std_px_per_s: Some(2.0) };
        let config = TrackerConfig { initiation: InitiationConfig::TwoPoint(two), ..existence() };
        let states = after(&config, 1.0, 1.0, [&[(0.0, 0.0)], &[(3.0, 0.0)]]);
        let k = &states[0].kinematics;
        assert!((k.mean[0] - 2.5).abs() < 1e-9 && (k.mean[1] - 2.0).abs() < 1e-9 && k.mean[3].abs() < 1e-9);
        assert!((k.cov[(0, 0)] - 5.0 / 6.0).abs() < 1e-9 && (k.cov[(1, 1)] - 4.0 / 3.0).abs() < 1e-9);
        assert!((states[0].score - 0.530_01).abs() < 1e-5, "{}", states[0].score);
    }

    #[test]
    fn one_point_starts_at_rest_with_the_given_spread() {
        let one = InitiationConfig::OnePoint(OnePointConfig { velocity_std_px_per_s: 3.0 });
        let states = after(&TrackerConfig { initiation: one, ..existence() }, 0.25, 1.0, [&[], &[(4.0, 7.0)]]);
        let k = &states[0].kinematics;
        assert_eq!(k.mean.as_slice(), [4.0, 0.0, 7.0, 0.0]);
        assert_eq!([k.cov[(0, 0)], k.cov[(1, 1)], k.cov[(0, 1)]], [0.25, 9.0, 0.0]);
        // Odds 1e-4 / 1e-3.
        assert!((states[0].score - 1.0 / 11.0).abs() < 1e-6);
    }

    #[test]
    fn the_nearest_second_point_that_a_target_can_have_reached_is_taken() {
        let x = |scan: &[(f64, f64)]| {
            after(&existence(), 0.1, 1.0, [&[(0.0, 0.0)], scan])
                .iter()
                .map(|s| s.kinematics.mean[0])
                .collect::<Vec<_>>()
        };
        assert_eq!(x(&[(-7.0, 0.0), (4.0, 0.0), (5.0, 0.0)]), [4.0]);
        assert_eq!(x(&[(9.99, 0.0)]), [9.99]);
        assert!(x(&[(10.01, 0.0)]).is_empty(), "faster than the largest speed");
    }

    #[test]
    fn velocity_bounds_refuse_what_moves_otherwise() {
        let bounds = VelocityBoundsConfig { min_px_per_s: [2.0, -1.0], max_px_per_s: [6.0, 1.0] };
        let config = TrackerConfig { initiation: InitiationConfig::VelocityBounds(bounds), ..existence() };
        let n = |x: f64, y: f64| after(&config, 0.1, 0.5, [&[(0.0, 0.0)], &[(x, y)]]).len();
        assert_eq!([n(1.0, 0.0), n(3.0, 0.5), n(0.9, 0.0), n(3.1, 0.0), n(2.0, 0.6), n(-2.0, 0.0)], [1, 1, 0, 0, 0, 0]);
    }

    #[test]
    fn weak_detections_and_a_full_tracker_initiate_nothing() {
        let scans: [&[(f64, f64)]; 2] =
            [&[(0.0, 0.0), (50.0, 0.0), (0.0, 50.0)], &[(1.0, 0.0), (51.0, 0.0), (1.0, 50.0)]];
        let one = InitiationConfig::OnePoint(OnePointConfig::default());
        for initiation in [InitiationConfig::default(), one] {
            let n =
                |c: TrackerConfig| after(&TrackerConfig { initiation: initiation.clone(), ..c }, 0.1, 1.0, scans).len();
            assert_eq!(n(existence()), 3);
            assert_eq!(n(TrackerConfig { max_tracks: 2, ..existence() }), 2);
            assert_eq!(n(TrackerConfig { min_initiation_score: 5.0, ..existence() }), 3);
            assert_eq!(n(TrackerConfig { min_initiation_score: 5.1, ..existence() }), 0);
        }
    }

    #[test]
    fn the_first_reach_of_an_initial_track_is_its_own_spread_and_that_of_a_detection() {
        let initial = InitialTrackConfig { position_px: [8.0, 5.0], position_std_px: 3.0, ..Default::default() };
        let config = TrackerConfig { initial_tracks: vec![initial], extra_noise_px: 0.5, ..TrackerConfig::default() };
        let (mut tracks, mut next_id) = (Vec::new(), 4);
        super::from_initial_tracks(&config, Timestamp::default(), &mut tracks, &mut next_id).unwrap();
        assert_eq!((tracks[0].last_place, tracks[0].id, next_id), ([8.0, 5.0, 3.5], 4, 5));
    }
}
