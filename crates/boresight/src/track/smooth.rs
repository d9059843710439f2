//! Smooths finished tracks: the belief of each row given all rows, by Rauch-Tung-Striebel, in roots, or with a fixed lag.
//!
//! Source: H. E. Rauch, F. Tung, C. T. Striebel, AIAA Journal 3(8), 1965; the recursions are in
//! `boresight_filters::smooth`. The rows of a tracker are filtered beliefs, which is all a smoother needs: measurements are
//! not looked at again. Rows without velocity (tables from elsewhere) are positions: [`filter_track`] comes first.
//! Symbols: state `[x, vx, y, vy]` (px, px/s). Model: constant velocity with white acceleration, or a velocity that is forgotten, as in the tracker (`motion.rs`).
//! A row that does not follow from the one before (`cut.rs`) begins a part of its own: a track that was lost and found again, or whose camera moved, is smoothed in between only.
//! Limits: tracks of another model (acceleration states, turns, IMM) are smoothed by this one: the position is still
//! better than the filtered one, its covariance is approximate. A missed frame counts as one long step.

mod cut;
pub(in crate::track) mod motion;

use super::correlated_error;
use super::filter::{AccelerationNoise, OrnsteinUhlenbeckConfig};
use crate::validate::{check, not_negative};
use crate::{Error, ErrorKind, Result, Timestamp};
use boresight_filters::smooth::{Filtered, rts, rts_square_root, rts_step};
use boresight_filters::{Gaussian, GaussianFilter, Measurement, Start, Ud};
use motion::RowModel;
use nalgebra::{Matrix2, Vector2};

/// How tracks are smoothed.
#[derive(Clone, Debug, PartialEq)]
pub struct SmoothConfig {
    /// The white acceleration, above 0: that of the tracker which made the tracks.
    pub acceleration: AccelerationNoise,
    /// Density added to a continuous one in proportion to the square of a track's box, 1/s³, 0 or more.
    pub density_per_height2_per_s3: f64,
    /// Velocities that are forgotten, in the place of the acceleration.
    pub forgetting: Option<OrnsteinUhlenbeckConfig>,
    /// What the tracker added to the positions' covariances, standard deviation, px, 0 or more: taken out before, added after.
    pub correlated_error_px: f64,
    /// Which rows tell of which.
    pub method: SmoothMethod,
}

/// Which rows tell of which, and how it is computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SmoothMethod {
    /// All rows of each row, in covariance form.
    #[default]
    Rts,
    /// The same in square roots: for covariances of very different size.
    SquareRoot,
    /// Each row is told of this many later ones only, at least 1: what a live display with that delay would show.
    FixedLag(u32),
}

impl Default for SmoothConfig {
    fn default() -> Self {
        Self {
            acceleration: AccelerationNoise::default(),
            density_per_height2_per_s3: 0.0,
            forgetting: None,
            correlated_error_px: 0.0,
            method: SmoothMethod::Rts,
        }
    }
}

impl SmoothConfig {
    /// Checks all values; `at` names the place.
    /// # Errors
    /// The first value outside its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        self.acceleration.validate(at)?;
        let per_height2 = self.density_per_height2_per_s3;
        not_negative(at, "acceleration-density-per-height2-per-s3", per_height2, "as in the tracker")?;
        self.forgetting.as_ref().map_or(Ok(()), |c| c.validate(&format!("{at}.forgetting")))?;
        not_negative(at, "correlated-error-px", self.correlated_error_px, "as in the tracker")?;
        match self.method {
            SmoothMethod::FixedLag(lag) => check(lag >= 1, at, "lag", lag, "at least 1 row", "5 rows are usual"),
            _ => Ok(()),
        }
    }

    /// The same for a track whose boxes have that height, px.
    pub(in crate::track) fn of_height(&self, height_px: f64) -> Self {
        let acceleration = match self.acceleration {
            AccelerationNoise::Continuous(q) => {
                AccelerationNoise::Continuous(q + self.density_per_height2_per_s3 * height_px * height_px)
            }
            discrete => discrete,
        };
        Self { acceleration, density_per_height2_per_s3: 0.0, ..self.clone() }
    }

    fn model(&self) -> Result<RowModel> {
        RowModel::of(self.acceleration, self.forgetting.as_ref())
    }
}

/// Replaces the beliefs of one track, in the order of their times, by the smoothed ones; each part by itself where a row does not follow from the one before. Returns the number of parts.
/// # Errors
/// Times that do not ascend; a covariance that cannot be factored.
pub fn smooth_track(times: &[Timestamp], beliefs: &mut [Gaussian<4>], config: &SmoothConfig) -> Result<usize> {
    config.validate("smooth")?;
    let held = correlated_error::take_from(beliefs, config.correlated_error_px);
    let mut scans = scans_of(times, beliefs)?;
    let (mut first, mut n_parts) = (0, 0);
    while first < scans.len() {
        let mut end = first + 1;
        while end < scans.len() && cut::follows(&predict(&beliefs[end - 1], scans[end].dt_s, config)?, &beliefs[end]) {
            end += 1;
        }
        smooth_part(&mut scans[first..end], config)?;
        (first, n_parts) = (end, n_parts + 1);
    }
    for (belief, scan) in beliefs.iter_mut().zip(&scans) {
        *belief = scan.belief;
        if held {
            correlated_error::add_to(belief, config.correlated_error_px);
        }
    }
    Ok(n_parts)
}

/// Smooths rows each of which follows from the one before.
fn smooth_part(scans: &mut [Filtered<4>], config: &SmoothConfig) -> Result<()> {
    let model = config.model()?;
    match config.method {
        SmoothMethod::Rts => rts(&model, scans)?,
        SmoothMethod::SquareRoot => rts_square_root(&model, scans)?,
        SmoothMethod::FixedLag(lag) => {
            // Row k is overwritten only after all rows before it have been told of it.
            for k in 0..scans.len() {
                let end = k.saturating_add(lag as usize).min(scans.len() - 1);
                let mut smoothed = scans[end].belief;
                for j in (k..end).rev() {
                    smoothed = rts_step(&model, &scans[j].belief, &smoothed, scans[j + 1].dt_s)?;
                }
                scans[k].belief = smoothed;
            }
        }
    }
    Ok(())
}

/// Pairs each belief with the time since the one before.
fn scans_of(times: &[Timestamp], beliefs: &[Gaussian<4>]) -> Result<Vec<Filtered<4>>> {
    let mut scans = Vec::with_capacity(beliefs.len());
    let mut last = times.first().copied().unwrap_or_default();
    for (time, belief) in times.iter().zip(beliefs.iter()) {
        let dt_s = time.seconds_since(last);
        if dt_s < 0.0 {
            return Err(Error::new(ErrorKind::Damaged, "the rows of a track run back in time")
                .at(format!("{} s after {} s", time.as_secs_f64(), last.as_secs_f64()))
                .hint("sort the table by frame"));
        }
        last = *time;
        scans.push(Filtered { dt_s, belief: *belief });
    }
    Ok(scans)
}

/// Returns the belief predicted `dt_s` seconds ahead: a row for a frame in which the track has none.
/// # Errors
/// A time that is negative or not finite; a covariance that cannot be factored.
pub fn predict(belief: &Gaussian<4>, dt_s: f64, config: &SmoothConfig) -> Result<Gaussian<4>> {
    let mut filter = boresight_filters::Kf::<_, 4>::start(config.model()?, *belief)?;
    filter.predict(dt_s)?;
    Ok(filter.belief())
}

/// Replaces the positions of one track by the beliefs of a filter that is given one after the other; the first velocity
/// is 0 px/s, known to `velocity_std_px_per_s`, above 0.
/// # Errors
/// Times that do not ascend; a value that is not finite; a covariance that cannot be factored.
pub fn filter_track(
    times: &[Timestamp],
    beliefs: &mut [Gaussian<4>],
    velocity_std_px_per_s: f64,
    config: &SmoothConfig,
) -> Result<()> {
    let measured = |b: &Gaussian<4>| Measurement {
        position: Vector2::new(b.mean[0], b.mean[2]),
        cov: Matrix2::new(b.cov[(0, 0)], b.cov[(0, 2)], b.cov[(2, 0)], b.cov[(2, 2)]),
    };
    let scans = scans_of(times, beliefs)?;
    let [first, rest @ ..] = beliefs else { return Ok(()) };
    let mut filter = Ud::<_, 4>::from_point(config.model()?, &measured(first), velocity_std_px_per_s)?;
    *first = filter.belief();
    for (belief, scan) in rest.iter_mut().zip(&scans[1..]) {
        filter.predict(scan.dt_s)?;
        filter.correct(&measured(belief))?;
        *belief = filter.belief();
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix4, Vector4};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    const STD: f64 = 20.0;

    /// Times, positions with noise of 0.5 px as rows, and the truth of a target that accelerates at random.
    fn run(seed: u64) -> (Vec<Timestamp>, Vec<Gaussian<4>>, Vec<Vector4<f64>>) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = || rng.sample::<f64, _>(StandardNormal);
        let (mut truth, dt) = (Vector4::new(100.0, 40.0 * normal(), 50.0, 40.0 * normal()), 0.04);
        let (mut times, mut rows, mut truths) = (Vec::new(), Vec::new(), Vec::new());
        for k in 0..120 {
            for axis in [0, 2] {
                let a = STD * normal();
                truth[axis] += dt * truth[axis + 1] + 0.5 * dt * dt * a;
                truth[axis + 1] += dt * a;
            }
            let mean = Vector4::new(truth[0] + 0.5 * normal(), 0.0, truth[2] + 0.5 * normal(), 0.0);
            times.push(Timestamp::from_secs_f64(f64::from(k) * dt));
            rows.push(Gaussian { mean, cov: Matrix4::from_diagonal(&Vector4::new(0.25, 1.0, 0.25, 1.0)) });
            truths.push(truth);
        }
        (times, rows, truths)
    }

    fn config(method: SmoothMethod) -> SmoothConfig {
        SmoothConfig { acceleration: AccelerationNoise::Discrete(STD), method, ..SmoothConfig::default() }
    }

    #[test]
    fn smoothing_positions_more_than_halves_their_error_and_is_honest() {
        let (mut raw, mut smooth, mut nees, mut n) = (0.0, 0.0, 0.0, 0.0);
        for seed in 0..40 {
            let (times, rows, truth) = run(seed);
            let mut beliefs = rows.clone();
            filter_track(&times, &mut beliefs, 60.0, &config(SmoothMethod::Rts)).unwrap();
            let n_parts = smooth_track(&times, &mut beliefs, &config(SmoothMethod::Rts)).unwrap();
            assert_eq!(n_parts, 1, "seed {seed}");
            for k in [30, 60, 90] {
                raw += (rows[k].mean - truth[k]).component_mul(&Vector4::new(1.0, 0.0, 1.0, 0.0)).norm_squared();
                let e = beliefs[k].mean - truth[k];
                smooth += e[0] * e[0] + e[2] * e[2];
                nees += (e.transpose() * beliefs[k].cov.try_inverse().unwrap() * e)[0] / 4.0;
                n += 1.0;
            }
        }
        assert!(smooth < 0.25 * raw, "{smooth} of {raw}");
        // The mean of 120 samples of χ²(4)/4, 99.9 %.
        assert!((nees / n - 1.0).abs() < 3.3 * (2.0 / (4.0 * n)).sqrt(), "NEES/4 {}", nees / n);
    }

    #[test]
    fn all_methods_agree_where_they_know_the_same() {
        let (times, rows, _) = run(7);
        let by = |method| {
            let mut beliefs = rows.clone();
            filter_track(&times, &mut beliefs, 60.0, &config(method)).unwrap();
            smooth_track(&times, &mut beliefs, &config(method)).unwrap();
            beliefs
        };
        let (all, roots, lag) = (by(SmoothMethod::Rts), by(SmoothMethod::SquareRoot), by(SmoothMethod::FixedLag(500)));
        for k in 0..rows.len() {
            assert!(
                (all[k].mean - roots[k].mean).norm() < 1e-8 && (all[k].mean - lag[k].mean).norm() < 1e-8,
                "row {k}"
            );
        }
        // A lag of 4 rows knows less than all, more than none.
        let (few, none) = (by(SmoothMethod::FixedLag(4)), by(SmoothMethod::FixedLag(1)));
        assert!(all[60].cov.trace() < few[60].cov.trace() && few[60].cov.trace() < none[60].cov.trace());
    }

    #[test]
    fn a_predicted_row_lies_within_its_own_uncertainty() {
        let (times, rows, truth) = run(3);
        let config = config(SmoothMethod::Rts);
        let mut filtered = rows;
        filter_track(&times, &mut filtered, 60.0, &config).unwrap();
        let ahead = predict(&filtered[40], 0.04, &config).unwrap();
        assert!((ahead.mean[0] - truth[41][0]).abs() < 4.0 * ahead.cov[(0, 0)].sqrt());
        assert!(predict(&filtered[40], f64::NAN, &config).is_err());
    }

    #[test]
    fn where_a_track_was_begun_anew_neither_part_tells_of_the_other() {
        // Lost at row 60 and begun anew by the next two detections, 20 px off; and as an image's coordinates move with a camera, by 6 px once.
        for (jump_px, is_restart) in [(20.0, true), (6.0, false)] {
            let (times, mut rows, _) = run(5);
            rows[60..].iter_mut().for_each(|r| r.mean[0] += jump_px);
            let config = config(SmoothMethod::Rts);
            let filter = |part: std::ops::Range<usize>| {
                let mut beliefs = rows[part.clone()].to_vec();
                filter_track(&times[part], &mut beliefs, 60.0, &config).unwrap();
                beliefs
            };
            let [before, behind] = if is_restart {
                [filter(0..60), filter(60..120)]
            } else {
                let (_, still, _) = run(5);
                let mut all = still;
                filter_track(&times, &mut all, 60.0, &config).unwrap();
                all[60..].iter_mut().for_each(|b| b.mean[0] += jump_px);
                [all[..60].to_vec(), all[60..].to_vec()]
            };
            let mut whole = [before.clone(), behind.clone()].concat();
            let n_parts = smooth_track(&times, &mut whole, &config).unwrap();
            let (mut first, mut second) = (before, behind);
            smooth_track(&times[..60], &mut first, &config).unwrap();
            smooth_track(&times[60..], &mut second, &config).unwrap();
            assert_eq!((n_parts, whole), (2, [first, second].concat()), "by {jump_px} px");
        }
    }

    #[test]
    fn rows_that_run_back_in_time_are_refused() {
        let (mut times, mut rows, _) = run(1);
        times.swap(3, 4);
        let e = smooth_track(&times, &mut rows, &config(SmoothMethod::Rts)).unwrap_err().to_string();
        assert!(e.contains("run back in time"), "{e}");
    }
}
