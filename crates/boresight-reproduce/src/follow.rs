//! Follows one target through scans of centroids: gate, nearest neighbour, any filter.
//!
//! Source: `docs/theory/association.md` (NN: the gated measurement with the least d², first on ties; none: prediction
//! kept), P_G = 0.99. World, px and px/scan; T = 1 scan. Cost: all centroids are tested (about 261 a scan in data set
//! II).

use boresight::Result;
use boresight_filters::{Gaussian, GaussianFilter, Measurement};
use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};

/// γ = −2 ln(1 − 0.99), χ² with 2 degrees of freedom.
pub const GATE_99: f64 = 9.210_340_371_976_182;

/// How a filter is started.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StartAt {
    /// From a state before the first scan, with variances of position and velocity per axis.
    State {
        /// `[x, vx, y, vy]`, one step before the first scan.
        state: [f64; 4],
        /// Variances of position (px²) and velocity (px²/scan²).
        variances: (f64, f64),
    },
    /// From the measurements nearest the truth in the first two scans (`docs/theory/track-management.md`).
    TwoPoints,
}

impl StartAt {
    /// The papers' known start with P0 = diag(0.5, 0.03, 0.5, 0.03).
    pub const KNOWN: Self = Self::State { state: [10.0, 1.0, 10.0, 1.0], variances: (0.5, 0.03) };
}

/// R of each axis (px²), q = variance of acceleration (px²/scan⁴), start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tuning {
    /// Measurement variance per axis, px².
    pub r: f64,
    /// Acceleration variance per axis, px²/scan⁴.
    pub q: f64,
    /// How the filter is started.
    pub start: StartAt,
}

impl Tuning {
    /// The belief before the first scan that is filtered, and how many scans it used up.
    pub fn belief(&self, scans: &[Vec<Vector2<f64>>], truth: &[Vector4<f64>]) -> (Gaussian<4>, Vec<Vector4<f64>>) {
        match self.start {
            StartAt::State { state, variances: (p, v) } => (
                Gaussian { mean: Vector4::from(state), cov: Matrix4::from_diagonal(&Vector4::new(p, v, p, v)) },
                Vec::new(),
            ),
            StartAt::TwoPoints => {
                let nearest = |k: usize| {
                    let at = truth.get(k).map_or(Vector2::zeros(), |t| Vector2::new(t[0], t[2]));
                    let all = scans.get(k).map_or(&[][..], |s| s);
                    all.iter()
                        .copied()
                        .min_by(|a, b| (a - at).norm_squared().total_cmp(&(b - at).norm_squared()))
                        .unwrap_or(at)
                };
                let (a, b) = (nearest(0), nearest(1));
                let (d, r) = (b - a, self.r);
                let mut cov = Matrix4::zeros();
                for i in [0, 2] {
                    cov[(i, i)] = r;
                    cov[(i, i + 1)] = r;
                    cov[(i + 1, i)] = r;
                    cov[(i + 1, i + 1)] = 2.0 * r;
                }
                let mean = Vector4::new(b.x, d.x, b.y, d.y);
                (Gaussian { mean, cov }, vec![Vector4::new(a.x, d.x, a.y, d.y), mean])
            }
        }
    }
}

/// Index of the nearest gated measurement.
pub fn nearest_gated(predicted: &Gaussian<2>, r: &Matrix2<f64>, scan: &[Vector2<f64>]) -> Option<usize> {
    let s = (predicted.cov + r).try_inverse()?;
    let (a, b, c) = (s[(0, 0)], s[(0, 1)] + s[(1, 0)], s[(1, 1)]);
    let mut best: Option<(usize, f64)> = None;
    for (i, z) in scan.iter().enumerate() {
        let (x, y) = (z.x - predicted.mean.x, z.y - predicted.mean.y);
        let d2 = a * x * x + b * x * y + c * y * y;
        if d2 <= GATE_99 && best.is_none_or(|(_, least)| d2 < least) {
            best = Some((i, d2));
        }
    }
    best.map(|(i, _)| i)
}

/// Follows the target with a filter made from the start belief; returns the estimate after each scan.
/// # Errors
/// A filter that refuses a step.
pub fn follow<F: GaussianFilter<4, Real = f64>>(
    make: impl Fn(Gaussian<4>) -> Result<F>,
    tuning: &Tuning,
    scans: &[Vec<Vector2<f64>>],
    truth: &[Vector4<f64>],
    blind: impl Fn(usize) -> bool,
) -> Result<Vec<Vector4<f64>>> {
    let (belief, mut estimates) = tuning.belief(scans, truth);
    let mut filter = make(belief)?;
    let r = Matrix2::identity() * tuning.r;
    for (k, scan) in scans.iter().enumerate().skip(estimates.len()) {
        filter.predict(1.0)?;
        if !blind(k)
            && let Some(i) = nearest_gated(&filter.predicted(), &r, scan)
        {
            filter.correct(&Measurement { position: scan[i], cov: r })?;
        }
        estimates.push(filter.kinematics().mean);
    }
    Ok(estimates)
}
