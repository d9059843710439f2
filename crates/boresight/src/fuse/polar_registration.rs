//! Range and azimuth bias of a radar from targets that another sensor (AIS, a second radar) sees as well, with their covariance.
//!
//! Source: Bar-Shalom, Li, *Multitarget-Multisensor Tracking*, 1995, 9.6 (constant biases of range and azimuth); the search for the common targets is our own.
//! Model: at the time of each point of the radar, seen from where it is, Δ = (r_b - r_a, θ_b - θ_a) = (ρ, β) + e, e with the sum of both covariances, turned to the line
//! of sight. Linear least squares, in closed form. Which tracks are common is not known: each pair of tracks that would need biases within [`Limits`] is a guess; the guess with
//! which most points agree wins, its pairs give the estimate, and pairs are chosen anew, a few times.
//! Covariance: the inverse of the information, times the mean squared residual where that is above what was stated; from [`LEAST_CLUSTERS`] pairs on at least what the scatter of
//! the pairs among each other says (J. White's sandwich by clusters), for an antenna a ship's length from where its position is told is wrong by the same in every scan.
//! Symbols: ρ m (or px), β rad from +x towards +y. Limits: ranges well above the errors; a clock that is ahead looks like a bias where all targets go round the same way.

use super::timeline::Timeline;
use crate::{Error, ErrorKind, Result};
use boresight_filters::sensor::wrap_angle;
use nalgebra::{Matrix2, Matrix4, Rotation2, Vector2};

/// Rounds of choosing pairs and estimating.
const ROUNDS: usize = 5;
/// A pair agrees with biases if its mean squared residual is no larger (2 is expected of right covariances).
const AGREES: f64 = 8.0;
/// Fewest points of a pair.
const LEAST_POINTS: usize = 5;
/// Pairs from which on their scatter tells.
const LEAST_CLUSTERS: usize = 5;

/// What is estimated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PolarConfig {
    /// Bias of the range.
    pub range: bool,
    /// Bias of the azimuth.
    pub azimuth: bool,
    /// Biases are looked for within these, m (or px) and rad.
    pub limits: [f64; 2],
    /// The first sensor's points may lie this far apart, s.
    pub max_gap_s: f64,
}

impl Default for PolarConfig {
    fn default() -> Self {
        Self { range: true, azimuth: true, limits: [500.0, 0.2], max_gap_s: 30.0 }
    }
}

/// The biases of a radar.
#[derive(Clone, Debug, PartialEq)]
pub struct PolarRegistration {
    /// Bias of the range ρ: what is measured is longer by it.
    pub range: f64,
    /// Bias of the azimuth β, rad from +x towards +y: what is measured is turned by it.
    pub azimuth_rad: f64,
    /// Covariance of both; 0 for what was not estimated.
    pub cov: Matrix2<f64>,
    /// Mean squared normalised residual of a point without the biases and with them (2 if covariances and model are right).
    pub mean_d2: [f64; 2],
    /// Number of common points.
    pub n_points: usize,
    /// Which tracks are common, by their places in both lists.
    pub pairs: Vec<(usize, usize)>,
}

/// One point of a pair: Δ and its information.
type Residual = (Vector2<f64>, Matrix2<f64>);

/// The residuals of every pair that might be one.
struct Pair {
    a: usize,
    b: usize,
    points: Vec<Residual>,
}

impl Pair {
    fn mean_d2(&self, bias: &Vector2<f64>) -> f64 {
        let sum: f64 = self.points.iter().map(|(d, w)| ((d - bias).transpose() * w * (d - bias))[0]).sum();
        sum / self.points.len() as f64
    }
}

/// Estimates the biases of the radar that made the tracks `b` and was at `own(time_s)`, from the tracks `a` of a sensor without them.
/// # Errors
/// [`ErrorKind::Numeric`] where no tracks are common.
pub fn register_polar(
    a: &[Timeline],
    b: &[Timeline],
    own: impl Fn(f64) -> [f64; 2],
    config: &PolarConfig,
) -> Result<PolarRegistration> {
    let free = [config.range, config.azimuth];
    let refuse = |what: &str| {
        Error::new(ErrorKind::Numeric, what.to_string())
            .at("registration")
            .hint("are both tables in one frame of reference and clock, and does the radar stand where it is said to?")
    };
    let mut pairs = Vec::new();
    for (i, x) in a.iter().enumerate() {
        for (j, y) in b.iter().enumerate() {
            let points = residuals(x, y, &own, config);
            if points.len() >= LEAST_POINTS {
                pairs.push(Pair { a: i, b: j, points });
            }
        }
    }
    let chosen_by = |bias: &Vector2<f64>| chosen(&pairs, bias, b.len());
    // Every pair's own biases are a guess; the one with most points wins, of equals the one with the smaller residuals.
    let mut best: Option<(usize, f64, Vector2<f64>)> = None;
    for pair in &pairs {
        let Some((bias, _)) = solve(pair.points.iter(), free) else { continue };
        if bias[0].abs() > config.limits[0] || bias[1].abs() > config.limits[1] {
            continue;
        }
        let kept = chosen_by(&bias);
        let n: usize = kept.iter().map(|k| pairs[*k].points.len()).sum();
        let cost: f64 = kept.iter().map(|k| pairs[*k].mean_d2(&bias)).sum();
        let better = |(most, least, _): (usize, f64, Vector2<f64>)| n > most || (n == most && cost < least);
        if best.is_none_or(better) && n > 0 {
            best = Some((n, cost, bias));
        }
    }
    let Some((_, _, mut bias)) = best else { return Err(refuse("no track of one sensor fits a track of the other")) };
    let mut kept = chosen_by(&bias);
    for _ in 0..ROUNDS {
        let points = kept.iter().flat_map(|k| &pairs[*k].points);
        let Some((found, _)) = solve(points, free) else { break };
        bias = found;
        let again = chosen_by(&bias);
        if again == kept || again.is_empty() {
            break;
        }
        kept = again;
    }
    let points = || kept.iter().flat_map(|k| &pairs[*k].points);
    let (found, inverse) = solve(points(), free).ok_or_else(|| refuse("the common points say nothing"))?;
    let n_points = points().count();
    let mean = |bias: Vector2<f64>| {
        points().map(|(d, w)| ((d - bias).transpose() * w * (d - bias))[0]).sum::<f64>() / n_points.max(1) as f64
    };
    let mean_d2 = [mean(Vector2::zeros()), mean(found)];
    let mut cov = inverse * (mean_d2[1] / 2.0).max(1.0);
    if kept.len() >= LEAST_CLUSTERS {
        let scores = kept.iter().map(|k| pairs[*k].points.iter().map(|(d, w)| w * (d - found)).sum::<Vector2<f64>>());
        let n = kept.len() as f64;
        let scatter = inverse * scores.map(|s| s * s.transpose()).sum::<Matrix2<f64>>() * inverse * (n / (n - 1.0));
        for i in 0..2 {
            // Widened axis by axis: a covariance stays one.
            if scatter[(i, i)] > cov[(i, i)] && cov[(i, i)] > 0.0 {
                let k = (scatter[(i, i)] / cov[(i, i)]).sqrt();
                cov.row_mut(i).scale_mut(k);
                cov.column_mut(i).scale_mut(k);
            }
        }
    }
    let pairs = kept.iter().map(|k| (pairs[*k].a, pairs[*k].b)).collect();
    Ok(PolarRegistration { range: found[0], azimuth_rad: found[1], cov, mean_d2, n_points, pairs })
}

/// Δ and its information at the points of `b`; none where the pair would need biases beyond the limits.
fn residuals(a: &Timeline, b: &Timeline, own: &impl Fn(f64) -> [f64; 2], config: &PolarConfig) -> Vec<Residual> {
    let mut out = Vec::new();
    for (t, belief) in &b.points {
        let Some((p, _)) = a.between(*t, config.max_gap_s) else { continue };
        let Some(fix) = a.points.partition_point(|(at, _)| at <= t).checked_sub(1).map(|i| &a.points[i].1) else {
            continue;
        };
        let o = Vector2::from(own(*t));
        let (z, p) = (Vector2::new(belief.mean[0], belief.mean[2]) - o, p - o);
        let (range, truth) = (z.norm(), p.norm());
        let turned = wrap_angle(z.y.atan2(z.x) - p.y.atan2(p.x));
        if !(range > 0.0 && truth > 0.0) {
            continue;
        }
        if (range - truth).abs() > 2.0 * config.limits[0] || turned.abs() > 2.0 * config.limits[1] {
            // Far apart at any time: no pair.
            return Vec::new();
        }
        let position = |c: &Matrix4<f64>| Matrix2::new(c[(0, 0)], c[(0, 2)], c[(2, 0)], c[(2, 2)]);
        // Between two fixes the other's own error is meant, not that of a prediction.
        let sum = position(&belief.cov) + position(&fix.cov);
        // To the line of sight: along and across, across in radians.
        let u = z / range;
        let j = Matrix2::new(u.x, u.y, -u.y / range, u.x / range);
        let Some(w) = (j * sum * j.transpose()).try_inverse() else { continue };
        out.push((Vector2::new(range - truth, turned), w));
    }
    out
}

/// The biases that fit best, and the inverse of their information; what is not free stays 0.
fn solve<'p>(points: impl Iterator<Item = &'p Residual>, free: [bool; 2]) -> Option<(Vector2<f64>, Matrix2<f64>)> {
    let (mut information, mut right) = (Matrix2::zeros(), Vector2::zeros());
    for (d, w) in points {
        information += w;
        right += w * d;
    }
    for i in (0..2).filter(|i| !free[*i]) {
        information.row_mut(i).fill(0.0);
        information.column_mut(i).fill(0.0);
        information[(i, i)] = 1.0;
        right[i] = 0.0;
    }
    let mut inverse = information.try_inverse()?;
    let bias = inverse * right;
    for i in (0..2).filter(|i| !free[*i]) {
        inverse[(i, i)] = 0.0;
    }
    bias.iter().all(|v| v.is_finite()).then_some((bias, inverse))
}

/// The pairs that agree with biases: the best ones first, a track of `b` in one pair; one of `a` may have several, for a radar's tracks break.
fn chosen(pairs: &[Pair], bias: &Vector2<f64>, n_b: usize) -> Vec<usize> {
    let mut good: Vec<(f64, usize)> =
        pairs.iter().enumerate().map(|(k, p)| (p.mean_d2(bias), k)).filter(|(d2, _)| *d2 <= AGREES).collect();
    good.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
    let mut taken_b = vec![false; n_b];
    let mut out = Vec::new();
    for (_, k) in good {
        if !std::mem::replace(&mut taken_b[pairs[k].b], true) {
            out.push(k);
        }
    }
    out.sort_unstable();
    out
}

impl PolarRegistration {
    /// Takes the biases off a position seen from `own`.
    pub fn position(&self, at: Vector2<f64>, own: Vector2<f64>) -> Vector2<f64> {
        let d = at - own;
        let range = d.norm();
        if range <= 0.0 {
            return at;
        }
        own + Rotation2::new(-self.azimuth_rad) * d * ((range - self.range).max(0.0) / range)
    }

    /// Takes the biases off a track; velocities and covariances are turned.
    pub fn timeline(&self, track: &Timeline, own: impl Fn(f64) -> [f64; 2]) -> Timeline {
        let turn = *Rotation2::new(-self.azimuth_rad).matrix();
        let mut full = Matrix4::zeros();
        for i in 0..2 {
            for j in 0..2 {
                full[(2 * i, 2 * j)] = turn[(i, j)];
                full[(2 * i + 1, 2 * j + 1)] = turn[(i, j)];
            }
        }
        let mut out = track.clone();
        for (t, b) in &mut out.points {
            let p = self.position(Vector2::new(b.mean[0], b.mean[2]), Vector2::from(own(*t)));
            b.mean = full * b.mean;
            (b.mean[0], b.mean[2]) = (p.x, p.y);
            b.cov = full * b.cov * full.transpose();
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::TrackId;
    use boresight_filters::Gaussian;
    use nalgebra::Vector4;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    const RANGE_STD: f64 = 40.0;
    const AZIMUTH_STD: f64 = 0.015;
    const REPORT_STD: f64 = 10.0;

    fn own(t: f64) -> [f64; 2] {
        [100.0 + 2.0 * t, -50.0]
    }

    fn point(p: Vector2<f64>, v: Vector2<f64>, cov: Matrix2<f64>) -> Gaussian<4> {
        let mut all = Matrix4::identity();
        for i in 0..2 {
            for j in 0..2 {
                all[(2 * i, 2 * j)] = cov[(i, j)];
            }
        }
        Gaussian { mean: Vector4::new(p.x, v.x, p.y, v.y), cov: all }
    }

    /// Ten ships as they report themselves (each with an antenna that lies `antenna` off, in the mean square), and as a radar with biases sees them, among clutter.
    fn scene(seed: u64, bias: [f64; 2], antenna: f64) -> (Vec<Timeline>, Vec<Timeline>) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut n = || -> f64 { StandardNormal.sample(&mut rng) };
        let (mut a, mut b) = (Vec::new(), Vec::new());
        for k in 0..10 {
            let turn = 0.6 * f64::from(k);
            let start = (1500.0 + 400.0 * f64::from(k)) * Vector2::new(turn.cos(), turn.sin());
            let v = Vector2::new(3.0 * n(), 3.0 * n());
            let lies = antenna * Vector2::new(n(), n());
            let at = |t: f64| start + v * t;
            let (mut reports, mut plots) = (Vec::new(), Vec::new());
            for i in 0..20 {
                let t = 10.0 * f64::from(i);
                let p = at(t) + lies + REPORT_STD * Vector2::new(n(), n());
                reports.push((t, point(p, v, Matrix2::identity() * REPORT_STD.powi(2))));
            }
            for i in 0..40 {
                // Seen when the others report, so that nothing is interpolated and their errors are as stated.
                let t = 10.0 * f64::from(i / 2);
                let o = Vector2::from(own(t));
                let d = at(t) - o;
                let (r, c) = (d.norm() + bias[0] + RANGE_STD * n(), d.y.atan2(d.x) + bias[1] + AZIMUTH_STD * n());
                let z = o + r * Vector2::new(c.cos(), c.sin());
                let u = (z - o) / r;
                let w = Vector2::new(-u.y, u.x);
                let cov = u * u.transpose() * RANGE_STD.powi(2) + w * w.transpose() * (r * AZIMUTH_STD).powi(2);
                if i % 2 == 0 {
                    plots.push((t, point(z, v, cov)));
                }
            }
            a.push(Timeline { id: TrackId(k as u64), points: reports, size: [0.0; 2] });
            b.push(Timeline { id: TrackId(k as u64), points: plots, size: [0.0; 2] });
        }
        // Land and buoys: nobody reports them.
        for k in 0..30u64 {
            let p = Vector2::new(4000.0 * n(), 4000.0 * n());
            let cov = Matrix2::identity() * RANGE_STD.powi(2);
            let points = (0..20).map(|i| (10.0 * f64::from(i), point(p, Vector2::zeros(), cov))).collect();
            b.push(Timeline { id: TrackId(100 + k), points, size: [0.0; 2] });
        }
        (a, b)
    }

    /// Mean normalised squared error of both biases over scenes, and the share of scenes with the right pairs.
    fn nees(bias: [f64; 2], antenna: f64) -> (f64, f64) {
        let (mut sum, mut right) = (0.0, 0.0);
        const N: u64 = 100;
        for seed in 0..N {
            let (a, b) = scene(seed, bias, antenna);
            let found = register_polar(&a, &b, own, &PolarConfig::default()).unwrap();
            let e = Vector2::new(found.range - bias[0], found.azimuth_rad - bias[1]);
            sum += e.dot(&(found.cov.try_inverse().unwrap() * e));
            let true_pairs = found.pairs.iter().filter(|(i, j)| i == j).count();
            right += f64::from(u8::from(true_pairs == 10 && found.pairs.len() <= 12));
        }
        (sum / N as f64, right / N as f64)
    }

    #[test]
    fn biases_are_found_among_clutter_as_well_as_their_covariance_says() {
        for bias in [[0.0, 0.0], [60.0, -0.09], [-150.0, 0.12]] {
            let (nees, right) = nees(bias, 0.0);
            // 2 is expected of 200 degrees of freedom, 1.62 to 2.42 in 95 of 100; the scatter of ten pairs only ever widens the covariance.
            assert!((1.2..2.42).contains(&nees), "{bias:?}: {nees}");
            assert!(right > 0.9, "{bias:?}: {right}");
        }
    }

    #[test]
    fn antennas_off_by_a_ships_length_widen_the_covariance() {
        // 30 m in every scan of a ship: with errors taken as white the error would be about 2.5 times what was stated (NEES 6).
        let (nees, _) = nees([60.0, -0.09], 30.0);
        assert!(nees < 3.0, "{nees}");
    }

    #[test]
    fn one_bias_alone_leaves_the_other_and_taking_it_off_brings_the_radar_home() {
        let (a, b) = scene(3, [0.0, 0.1], 0.0);
        let config = PolarConfig { range: false, ..PolarConfig::default() };
        let found = register_polar(&a, &b, own, &config).unwrap();
        assert_eq!((found.range, found.cov[(0, 0)]), (0.0, 0.0));
        assert!(
            (found.azimuth_rad - 0.1).abs() < 4.0 * found.cov[(1, 1)].sqrt()
                && found.mean_d2[0] > 5.0 * found.mean_d2[1]
        );
        let home = found.timeline(&b[4], own);
        let rest = residuals(&a[4], &home, &own, &config);
        let mean = rest.iter().map(|(d, _)| d[1]).sum::<f64>() / rest.len() as f64;
        assert!(mean.abs() < 4.0 * AZIMUTH_STD / (rest.len() as f64).sqrt(), "{mean}");
    }

    #[test]
    fn sensors_that_share_nothing_are_refused() {
        let (a, b) = scene(1, [0.0, 0.0], 0.0);
        let far: Vec<Timeline> = b[10..13].to_vec();
        let e = register_polar(&a[..1], &far, own, &PolarConfig { limits: [1.0, 1e-4], ..PolarConfig::default() });
        assert!(e.unwrap_err().to_string().contains("no track"));
    }
}
