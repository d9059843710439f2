//! Joins fragments of one target: the end of a track and the start of another that fits it after a gap.
//!
//! Method (ours): the earlier track is predicted over the gap with its own covariance and process noise, the later one is
//! taken with the covariance of its first estimate; d² of the difference in position and velocity (4 numbers) must pass
//! the gate. The cost is −ln of the density of that difference, so that sharp fits win over vague ones; all joins of a
//! track table are chosen together (sparse assignment: each end joins at most one start), then chains are followed.
//! Limits: one law of motion for all, over the gap too. Nothing is filled in between: rows stay as they are, only ids change; the
//! smoother fills gaps.

use super::filter::{AccelerationNoise, OrnsteinUhlenbeckConfig};
use super::smooth::motion::RowModel;
use crate::associate::{Assignment, AssociatorConfig, Gates, Pair, Prior, UniformGrid};
use crate::validate::{not_negative, positive, probability};
use crate::{Result, Timestamp, TrackId};
use boresight_filters::Gaussian;
use boresight_filters::model::Model;
use nalgebra::Vector4;

/// How fragments are joined.
#[derive(Clone, Debug, PartialEq)]
pub struct StitchConfig {
    /// Longest gap, s, above 0.
    pub max_gap_s: f64,
    /// Fragments may overlap by this much, s, 0 or more (a track that coasted on while its successor had begun).
    pub max_overlap_s: f64,
    /// The white acceleration during the gap, above 0.
    pub acceleration: AccelerationNoise,
    /// Velocities that are forgotten, in the place of the acceleration.
    pub forgetting: Option<OrnsteinUhlenbeckConfig>,
    /// Largest speed, px/s, above 0.
    pub max_speed_px_per_s: f64,
    /// Probability that true fragments pass the gate, in (0, 1).
    pub gate_probability: f64,
}

impl Default for StitchConfig {
    fn default() -> Self {
        Self {
            max_gap_s: 2.0,
            max_overlap_s: 0.0,
            acceleration: AccelerationNoise::default(),
            forgetting: None,
            max_speed_px_per_s: 300.0,
            gate_probability: 0.99,
        }
    }
}

impl StitchConfig {
    /// Checks all values; `at` names the place in the configuration.
    /// # Errors
    /// The first value outside its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        positive(at, "max-gap-s", self.max_gap_s, "2 s bridges a lamp post")?;
        not_negative(at, "max-overlap-s", self.max_overlap_s, "0 if tracks end when their target does")?;
        self.acceleration.validate(at)?;
        self.forgetting.as_ref().map_or(Ok(()), |c| c.validate(&format!("{at}.forgetting")))?;
        positive(at, "max-speed-px-per-s", self.max_speed_px_per_s, "as in the tracker")?;
        probability(at, "gate-probability", self.gate_probability, "0.99 joins 99 % of true fragments")
    }
}

/// A finished track as the stitcher sees it: its two ends.
#[derive(Clone, Debug, PartialEq)]
pub struct Fragment {
    /// The track.
    pub id: TrackId,
    /// Time of its first detection.
    pub begin: Timestamp,
    /// Estimate there, `[x, vx, y, vy]`.
    pub first: Gaussian<4>,
    /// Time of its last detection.
    pub end: Timestamp,
    /// Estimate there.
    pub last: Gaussian<4>,
}

/// Returns for each fragment the id it gets: the id of the first fragment of its chain.
/// # Errors
/// A configuration value outside its range.
pub fn stitch(fragments: &[Fragment], config: &StitchConfig) -> Result<Vec<TrackId>> {
    config.validate("stitch")?;
    // χ² with 4 degrees of freedom: P(d² ≤ g) = 1 − e^(−g/2) (1 + g/2), solved by bisection.
    let (mut low, mut high) = (0.0f64, 1e3);
    for _ in 0..80 {
        let g = 0.5 * (low + high);
        if 1.0 - (-0.5 * g).exp() * (1.0 + 0.5 * g) < config.gate_probability { low = g } else { high = g }
    }
    let gate = high;
    let mut grid = UniformGrid::new();
    grid.build(fragments.iter().map(|f| (finite(f.first.mean[0]), finite(f.first.mean[2]))));
    let mut gates = Gates::new();
    gates.reset(fragments.len(), 1.0);
    // Joins cost what their density says; the worst join that passes the gate costs least than this.
    let std = |g: &Gaussian<4>| finite(g.cov[(0, 0)].max(g.cov[(2, 2)])).max(0.0).sqrt();
    let vaguest_start = fragments.iter().map(|f| std(&f.first)).fold(0.0, f64::max);
    let longest_s = config.max_gap_s.max(config.max_overlap_s);
    for f in fragments {
        let far = config.max_speed_px_per_s * longest_s + 3.0 * std(&f.last).hypot(vaguest_start);
        let mut row = Vec::new();
        let (x, y) = (finite(f.last.mean[0]), finite(f.last.mean[2]));
        let mut looked_at = 0;
        grid.near(x, y, far, far, |p| {
            looked_at += 1;
            let next = &fragments[p.index as usize];
            let gap_s = next.begin.seconds_since(f.end);
            let in_time = gap_s > -config.max_overlap_s && gap_s <= config.max_gap_s && next.begin > f.begin;
            let reach = config.max_speed_px_per_s * gap_s.abs() + 3.0 * std(&f.last).hypot(std(&next.first));
            if in_time
                && next.id != f.id
                && (p.x - x).hypot(p.y - y) <= reach
                && let Some((d2, log_det)) = misfit(f, next, gap_s, config)
                && d2 <= gate
            {
                row.push((p.index, d2 + log_det));
            }
            looked_at < super::scan_table::MOST_LOOKED_AT
        });
        row.sort_unstable_by_key(|r| r.0);
        for (detection, cost) in row {
            gates.push(Pair { detection, cost, log_likelihood: -0.5 * cost });
        }
        gates.end_row(Prior { p_detection: 1.0, p_gate: 1.0, existence: 1.0, miss_cost: 1e6 });
    }
    let mut answer = Assignment::new();
    AssociatorConfig::default().build().associate(&gates, &mut answer);
    let mut before: Vec<Option<u32>> = vec![None; fragments.len()];
    for i in 0..fragments.len() {
        if let [share] = answer.row(i) {
            before[share.detection as usize] = Some(i as u32);
        }
    }
    Ok((0..fragments.len())
        .map(|mut i| {
            // Each join goes back in time, so this ends.
            while let Some(b) = before[i] {
                i = b as usize;
            }
            fragments[i].id
        })
        .collect())
}

fn finite(v: f64) -> f64 {
    if v.is_finite() { v } else { 0.0 }
}

/// d² and ln det S of the end of `a`, moved over the gap, against the start of `b`.
fn misfit(a: &Fragment, b: &Fragment, gap_s: f64, config: &StitchConfig) -> Option<(f64, f64)> {
    // Backwards in time the noise grows as forwards.
    let model = RowModel::of(config.acceleration, config.forgetting.as_ref()).ok()?;
    let (phi, noise) = (model.transition(gap_s, &a.last.mean), model.process_noise(gap_s.abs()));
    let s = phi * a.last.cov * phi.transpose() + noise + b.first.cov;
    let difference: Vector4<f64> = b.first.mean - phi * a.last.mean;
    let c = s.cholesky()?;
    let d2 = difference.dot(&c.solve(&difference));
    let log_det = 2.0 * c.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
    (d2.is_finite() && log_det.is_finite()).then_some((d2, log_det))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::track::AccelerationNoise;
    use nalgebra::Matrix4;

    fn fragment(id: u64, begin_s: f64, end_s: f64, at: impl Fn(f64) -> [f64; 4]) -> Fragment {
        let belief = |s: f64| Gaussian { mean: Vector4::from(at(s)), cov: Matrix4::identity() * 0.5 };
        Fragment {
            id: TrackId(id),
            begin: Timestamp::from_secs_f64(begin_s),
            first: belief(begin_s),
            end: Timestamp::from_secs_f64(end_s),
            last: belief(end_s),
        }
    }

    #[test]
    fn two_crossing_targets_interrupted_at_the_crossing_keep_their_own_paths() {
        let right = |s: f64| [100.0 + 30.0 * s, 30.0, 50.0, 0.0];
        let left = |s: f64| [200.0 - 30.0 * s, -30.0, 50.0, 0.0];
        let fragments = [
            fragment(1, 0.0, 1.3, right),
            fragment(2, 0.0, 1.3, left),
            fragment(3, 2.0, 3.0, left),
            fragment(4, 2.1, 3.0, right),
            fragment(5, 2.0, 3.0, |_| [500.0, 0.0, 400.0, 0.0]),
        ];
        let ids: Vec<u64> = stitch(&fragments, &StitchConfig::default()).unwrap().iter().map(|i| i.0).collect();
        assert_eq!(ids, [1, 2, 2, 1, 5]);
    }

    #[test]
    fn vague_ends_are_joined_as_far_as_their_uncertainty_reaches() {
        // Slow things, known to 5 px: their ends may lie farther apart than they can go in the gap.
        let vague = |id, begin_s, end_s, x: f64| {
            let mut f = fragment(id, begin_s, end_s, |_| [x, 0.0, 10.0, 0.0]);
            (f.first.cov, f.last.cov) = (f.first.cov * 50.0, f.last.cov * 50.0);
            f
        };
        let mut fragments = vec![vague(1, 0.0, 1.0, 50.0), vague(2, 1.5, 2.0, 58.0)];
        // Others fill the grid, so that only what is near is looked at.
        fragments.extend((0..400).map(|k| vague(100 + k, 5.0, 6.0, 0.5 * k as f64)));
        let config = StitchConfig { max_speed_px_per_s: 1.0, ..StitchConfig::default() };
        let ids = stitch(&fragments, &config).unwrap();
        assert_eq!((ids[0].0, ids[1].0), (1, 1));
    }

    #[test]
    fn chains_take_the_first_id_and_long_gaps_stay_open() {
        let still = |_: f64| [10.0, 0.0, 10.0, 0.0];
        let fragments = [
            fragment(7, 0.0, 1.0, still),
            fragment(8, 1.5, 2.0, still),
            fragment(9, 3.0, 4.0, still),
            fragment(10, 9.0, 10.0, still),
        ];
        let ids: Vec<u64> = stitch(&fragments, &StitchConfig::default()).unwrap().iter().map(|i| i.0).collect();
        assert_eq!(ids, [7, 7, 7, 10]);
    }

    #[test]
    fn ends_are_joined_as_far_as_the_quantile_of_chi_square_with_four_degrees_of_freedom() {
        // At once, S = 0.5 I + 0.5 I: d² is the squared difference of the velocities. 99 % of χ² with 4 degrees of freedom: 13.2767 (tables).
        let joined = |d2: f64| {
            let a = fragment(1, 0.0, 1.0, |_| [50.0, 0.0, 50.0, 0.0]);
            let b = fragment(2, 1.0, 2.0, |_| [50.0, d2.sqrt(), 50.0, 0.0]);
            let config = StitchConfig { gate_probability: 0.99, max_overlap_s: 0.1, ..StitchConfig::default() };
            stitch(&[a, b], &config).unwrap()[1] == TrackId(1)
        };
        assert_eq!([13.27, 13.28].map(joined), [true, false]);
    }

    #[test]
    fn the_misfit_of_two_ends_is_that_of_a_hand_computed_pair() {
        let (mut a, mut b) =
            (fragment(1, 0.0, 1.0, |_| [3.0, 0.5, 7.0, 0.0]), fragment(2, 3.0, 4.0, |_| [6.0, 0.5, 7.0, 0.0]));
        (a.last.cov, b.first.cov) = (Matrix4::identity(), Matrix4::identity());
        let config = StitchConfig { acceleration: AccelerationNoise::Discrete(0.0), ..StitchConfig::default() };
        let (d2, log_det) = misfit(&a, &b, 2.0, &config).unwrap();
        // Each axis: S = [[1 + 2² + 1, 2], [2, 1 + 1]], det 8; 2 px beyond x + 2 vx: d² = 2² · 2/8.
        assert!((d2 - 1.0).abs() < 1e-12 && (log_det - 64f64.ln()).abs() < 1e-12, "{d2} {log_det}");
    }
}
