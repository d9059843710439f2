//! Registration of two sensors from common targets: constant offset, rotation and time offset, with their uncertainty.
//!
//! Model: p_a(t) = Rot(φ) (p_b(t + τ) − c) + c + d, c the mean of b's positions or a given pivot, φ positive from +x towards +y, τ > 0: b's clock is
//! ahead. Weighted least squares by Gauss-Newton (Levenberg damping), weights (P_a + Rot P_b Rotᵀ)⁻¹.
//! Symbols: d px, φ rad, τ s; residual px. Limits: errors of filtered tracks are correlated in time, so the stated standard
//! deviations are too small by about the root of the correlation length in scans; one straight target cannot tell a time offset
//! from an offset along its path: this is refused, not guessed.

use super::timeline::Timeline;
use crate::{Error, ErrorKind, Result};
use nalgebra::{Matrix2, Matrix4, Rotation2, Vector2, Vector4};

/// What is to be estimated.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RegistrationConfig {
    /// Constant offset.
    pub offset: bool,
    /// Rotation.
    pub rotation: bool,
    /// Time offset.
    pub time: bool,
    /// Point (x, y) of the second sensor's frame that is rotated about, px: where a radar stands whose azimuth is biased. None:
    /// the mean of its positions, which keeps rotation and offset apart. Matters when the offset is not estimated.
    pub pivot_px: Option<[f64; 2]>,
}

/// A registration: how the second sensor's positions become the first one's.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Registration {
    /// Offset d (x, y), px.
    pub offset_px: [f64; 2],
    /// Rotation φ, rad.
    pub rotation_rad: f64,
    /// Time offset τ, s: the second clock's lead.
    pub time_s: f64,
    /// Point that is rotated about, px.
    pub centre_px: [f64; 2],
    /// Standard deviations of d_x, d_y (px), φ (rad), τ (s); 0 for what was not estimated.
    pub std: [f64; 4],
    /// Mean squared normalised residual per point before and after (2 if covariances and model are right).
    pub mean_d2: [f64; 2],
    /// Number of common points.
    pub n_points: usize,
}

impl Registration {
    /// No correction.
    pub const IDENTITY: Self = Self {
        offset_px: [0.0; 2],
        rotation_rad: 0.0,
        time_s: 0.0,
        centre_px: [0.0; 2],
        std: [0.0; 4],
        mean_d2: [0.0; 2],
        n_points: 0,
    };

    /// Brings a track of the second sensor into the first one's frame and clock.
    pub fn apply(&self, track: &Timeline) -> Timeline {
        let rot = *Rotation2::new(self.rotation_rad).matrix();
        let (c, d) = (Vector2::from(self.centre_px), Vector2::from(self.offset_px));
        // The rotation acts on positions and velocities alike.
        let mut full = Matrix4::zeros();
        for i in 0..2 {
            for j in 0..2 {
                full[(2 * i, 2 * j)] = rot[(i, j)];
                full[(2 * i + 1, 2 * j + 1)] = rot[(i, j)];
            }
        }
        let shift = c + d - rot * c;
        let mut out = track.clone();
        for (t, b) in &mut out.points {
            *t -= self.time_s;
            b.mean = full * b.mean + Vector4::new(shift.x, 0.0, shift.y, 0.0);
            b.cov = full * b.cov * full.transpose();
        }
        out
    }
}

fn position_cov(p: &Matrix4<f64>) -> Matrix2<f64> {
    Matrix2::new(p[(0, 0)], p[(0, 2)], p[(2, 0)], p[(2, 2)])
}

/// Sums of the normal equations at one set of parameters.
struct Normal {
    information: Matrix4<f64>,
    gradient: Vector4<f64>,
    cost: f64,
    n: usize,
}

fn normal(pairs: &[(&Timeline, &Timeline)], x: &Vector4<f64>, c: Vector2<f64>, max_gap_s: f64) -> Normal {
    let rot = *Rotation2::new(x[2]).matrix();
    let mut out = Normal { information: Matrix4::zeros(), gradient: Vector4::zeros(), cost: 0.0, n: 0 };
    for (a, b) in pairs {
        for (t, belief) in &a.points {
            let at = t + x[3];
            let (Some((p, v)), Some(other)) = (b.between(at, max_gap_s), b.at(at, 0.0, max_gap_s)) else { continue };
            let turned = rot * (p - c);
            let r = Vector2::new(belief.mean[0], belief.mean[2]) - turned - c - Vector2::new(x[0], x[1]);
            let s = position_cov(&belief.cov) + rot * position_cov(&other.cov) * rot.transpose();
            let Some(w) = s.try_inverse() else { continue };
            // Derivatives of the modelled position by d_x, d_y, φ, τ.
            let rv = rot * v;
            let j = nalgebra::Matrix2x4::new(1.0, 0.0, -turned.y, rv.x, 0.0, 1.0, turned.x, rv.y);
            out.information += j.transpose() * w * j;
            out.gradient += j.transpose() * w * r;
            out.cost += r.dot(&(w * r));
            out.n += 1;
        }
    }
    out
}

/// Estimates the registration of `b` to `a` from pairs of tracks of common targets.
/// # Errors
/// [`ErrorKind::Numeric`] if there are fewer than 5 common points, or the geometry cannot tell the asked quantities apart.
pub fn register(pairs: &[(&Timeline, &Timeline)], config: RegistrationConfig, max_gap_s: f64) -> Result<Registration> {
    let n_all = pairs.iter().map(|(_, b)| b.points.len()).sum::<usize>();
    let sum: Vector2<f64> =
        pairs.iter().flat_map(|(_, b)| &b.points).map(|(_, g)| Vector2::new(g.mean[0], g.mean[2])).sum();
    let c = config.pivot_px.map_or(sum / n_all.max(1) as f64, Vector2::from);
    let free = [config.offset, config.offset, config.rotation, config.time];
    let refuse = |what: &str| {
        Error::new(ErrorKind::Numeric, what.to_string())
            .at("registration")
            .hint("give more common targets, or estimate less (offset only)")
    };
    let mut x = Vector4::zeros();
    let mut now = normal(pairs, &x, c, max_gap_s);
    let before = now.cost / now.n.max(1) as f64;
    if now.n < 5 {
        return Err(refuse(&format!("only {} common points of both sensors, 5 are needed", now.n)));
    }
    let held = |m: &Matrix4<f64>, damp: f64| {
        let mut m = *m;
        for i in 0..4 {
            if free[i] {
                m[(i, i)] *= 1.0 + damp;
            } else {
                m.row_mut(i).fill(0.0);
                m.column_mut(i).fill(0.0);
                m[(i, i)] = 1.0;
            }
        }
        m
    };
    let mut damp = 1e-3;
    for _ in 0..100 {
        let mut g = now.gradient;
        (0..4).filter(|i| !free[*i]).for_each(|i| g[i] = 0.0);
        let Some(step) = held(&now.information, damp).cholesky().map(|c| c.solve(&g)) else { break };
        let tried = normal(pairs, &(x + step), c, max_gap_s);
        // Compared per point: a time offset changes how many points are common.
        if tried.n >= 5 && tried.cost / tried.n as f64 <= now.cost / now.n as f64 {
            x += step;
            let small = step.norm() < 1e-10 * (1.0 + x.norm());
            now = tried;
            damp = (damp * 0.1).max(1e-12);
            if small {
                break;
            }
        } else if damp > 1e8 {
            break;
        } else {
            damp *= 10.0;
        }
    }
    let information = held(&now.information, 0.0);
    // Scaled to a unit diagonal, so that units do not matter for what can be told apart.
    let d = Vector4::from_fn(|i, _| information[(i, i)].max(0.0).sqrt());
    if d.min() <= 0.0 {
        return Err(refuse("the common targets say nothing about one of the quantities"));
    }
    let unit = Matrix4::from_fn(|i, j| information[(i, j)] / (d[i] * d[j]));
    if unit.symmetric_eigenvalues().min() < 1e-6 {
        return Err(refuse(
            "the common targets cannot tell the quantities apart (one straight path does not separate time from offset)",
        ));
    }
    let cov = information.try_inverse().ok_or_else(|| refuse("the normal equations have no solution"))?;
    let std = [0, 1, 2, 3].map(|i| if free[i] { cov[(i, i)].max(0.0).sqrt() } else { 0.0 });
    Ok(Registration {
        offset_px: [x[0], x[1]],
        rotation_rad: x[2],
        time_s: x[3],
        centre_px: [c.x, c.y],
        std,
        mean_d2: [before, now.cost / now.n as f64],
        n_points: now.n,
    })
}
