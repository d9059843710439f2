//! Constant-velocity Kalman filter of one track with the structure of the model used: no heap, 15 numbers.
//!
//! Source: `docs/theory/filters.md` (prediction with G Q Gᵀ, Joseph update), `docs/theory/association.md` for weighted
//! detections.
//! Method: the covariance is kept as two axis blocks and their coupling; while every measurement covariance is diagonal
//! the axes stay independent and a step is two 2x2 filters. Several hypotheses: each is corrected by itself and the
//! mixture is matched in mean and covariance, which is PDA's update when all share one R.
//! Symbols: state `[x, vx, y, vy]` (px, px/s); q process covariance of a step; r measurement variance, px².
//! The prediction is [`boresight_filters::model::ConstantVelocity`]'s, written out for the numbers kept; its order of operations is
//! that of all published tables, so it stands here once more.
//! Limits: linear, constant velocity with white acceleration.

use super::acceleration_noise::AccelerationNoise;
use boresight_filters::mixture::mixture_update;
use boresight_filters::{Filter, FilterError, Gaussian, Measurement, Weighted};
use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};

/// Mean and covariance of one axis: position and velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Axis {
    pub x: f64,
    pub v: f64,
    pub xx: f64,
    pub xv: f64,
    pub vv: f64,
}

impl Axis {
    #[inline]
    pub fn predict(&mut self, dt_s: f64, q: &[f64; 3]) {
        let t = dt_s;
        self.x += t * self.v;
        self.xx += t * (2.0 * self.xv + t * self.vv) + q[0];
        self.xv += t * self.vv + q[1];
        self.vv += q[2];
    }

    #[inline]
    pub fn correct(&mut self, z: f64, r: f64) {
        let s = self.xx + r;
        let (kx, kv) = (self.xx / s, self.xv / s);
        let nu = z - self.x;
        self.x += kx * nu;
        self.v += kv * nu;
        // Joseph form written out for one axis.
        let left = 1.0 - kx;
        self.vv += kv * (kv * s - 2.0 * self.xv);
        self.xv = left * (self.xv - kv * self.xx) + kx * kv * r;
        self.xx = left * left * self.xx + kx * kx * r;
    }
}

/// Process covariance q00, q01, q11 of one axis over a step (px², px²/s, px²/s²).
#[inline]
pub(crate) fn step_noise(noise: AccelerationNoise, t: f64) -> [f64; 3] {
    let t2 = t * t;
    match noise {
        AccelerationNoise::Continuous(q) => [q * (t2 * t) / 3.0, 0.5 * q * t2, q * t],
        AccelerationNoise::Discrete(std) => {
            let q = std * std;
            [0.25 * q * t2 * t2, 0.5 * q * t2 * t, q * t2]
        }
    }
}

/// The belief of a constant-velocity track.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConstantVelocityKf {
    axes: [Axis; 2],
    /// cov([x, vx], [y, vy]), row by row.
    coupling: [f64; 4],
    noise: AccelerationNoise,
    coupled: bool,
}

impl ConstantVelocityKf {
    /// Builds a filter from a first belief and the white acceleration that drives it.
    pub fn new(start: &Gaussian<4>, noise: AccelerationNoise) -> Self {
        let mut filter = Self {
            axes: [Axis { x: 0.0, v: 0.0, xx: 0.0, xv: 0.0, vv: 0.0 }; 2],
            coupling: [0.0; 4],
            noise,
            coupled: false,
        };
        filter.set(&start.mean, &start.cov);
        filter
    }

    fn set(&mut self, m: &Vector4<f64>, p: &Matrix4<f64>) {
        for (a, axis) in self.axes.iter_mut().enumerate() {
            let i = 2 * a;
            *axis = Axis {
                x: m[i],
                v: m[i + 1],
                xx: p[(i, i)],
                xv: 0.5 * (p[(i, i + 1)] + p[(i + 1, i)]),
                vv: p[(i + 1, i + 1)],
            };
        }
        let mid = |r: usize, c: usize| 0.5 * (p[(r, c)] + p[(c, r)]);
        self.coupling = [mid(0, 2), mid(0, 3), mid(1, 2), mid(1, 3)];
        self.coupled = self.coupling.iter().any(|c| *c != 0.0);
    }

    /// Multiplies the density of the white acceleration.
    pub(super) fn scale_density(&mut self, factor: f64) {
        self.noise = match self.noise {
            AccelerationNoise::Continuous(density) => AccelerationNoise::Continuous(density * factor),
            AccelerationNoise::Discrete(std) => AccelerationNoise::Discrete(std * factor.sqrt()),
        };
    }

    /// Position, px.
    #[inline]
    pub fn position(&self) -> [f64; 2] {
        [self.axes[0].x, self.axes[1].x]
    }

    fn correct_one(&mut self, z: &Measurement) -> Result<(), FilterError> {
        let r = &z.cov;
        if !self.coupled && r[(0, 1)] == 0.0 && r[(1, 0)] == 0.0 {
            let mut axes = self.axes;
            for a in 0..2 {
                axes[a].correct(z.position[a], r[(a, a)]);
            }
            // 0 is a variance too: a measurement without noise leaves nothing unknown.
            let fine = axes.iter().all(|a| (a.x + a.v).is_finite() && a.xx >= 0.0 && a.vv >= 0.0);
            if !fine {
                return Err(FilterError::NotPositiveDefinite("innovation covariance"));
            }
            self.axes = axes;
            return Ok(());
        }
        let (mean, cov) = corrected(&self.kinematics(), z)?;
        self.set(&mean, &cov);
        Ok(())
    }
}

/// The Joseph update of a full belief by one position.
fn corrected(belief: &Gaussian<4>, z: &Measurement) -> Result<(Vector4<f64>, Matrix4<f64>), FilterError> {
    let p = &belief.cov;
    let s = Matrix2::new(p[(0, 0)], p[(0, 2)], p[(2, 0)], p[(2, 2)]) + z.cov;
    let det = s.determinant();
    if !(det > 0.0 && s[(0, 0)] > 0.0 && det.is_finite()) {
        return Err(FilterError::NotPositiveDefinite("innovation covariance"));
    }
    let s_inv = Matrix2::new(s[(1, 1)], -s[(0, 1)], -s[(1, 0)], s[(0, 0)]) / det;
    let pht = nalgebra::Matrix4x2::from_fn(|r, c| p[(r, 2 * c)]);
    let k = pht * s_inv;
    let nu = z.position - Vector2::new(belief.mean[0], belief.mean[2]);
    let mut left = Matrix4::identity();
    for r in 0..4 {
        for c in 0..2 {
            left[(r, 2 * c)] -= k[(r, c)];
        }
    }
    let cov = left * p * left.transpose() + k * z.cov * k.transpose();
    Ok((belief.mean + k * nu, cov))
}

impl Filter for ConstantVelocityKf {
    #[inline]
    fn predict(&mut self, dt_s: f64) -> Result<(), FilterError> {
        if !(dt_s >= 0.0 && dt_s.is_finite()) {
            return Err(FilterError::OutOfRange("a time step of 0 s or more"));
        }
        let q = step_noise(self.noise, dt_s);
        for axis in &mut self.axes {
            axis.predict(dt_s, &q);
        }
        if self.coupled {
            let [xy, xw, vy, vw] = self.coupling;
            self.coupling = [xy + dt_s * (xw + vy + dt_s * vw), xw + dt_s * vw, vy + dt_s * vw, vw];
        }
        Ok(())
    }

    #[inline]
    fn predicted(&self) -> Gaussian<2> {
        let [a, b] = &self.axes;
        let c = self.coupling[0];
        Gaussian { mean: Vector2::new(a.x, b.x), cov: Matrix2::new(a.xx, c, c, b.xx) }
    }

    fn update(&mut self, hypotheses: &[Weighted]) -> Result<(), FilterError> {
        for h in hypotheses {
            let z = &h.measurement;
            if !(z.position.iter().all(|v| v.is_finite()) && z.cov.iter().all(|v| v.is_finite())) {
                return Err(FilterError::NotFinite("measurement"));
            }
            if !(h.weight >= 0.0 && h.weight <= 1.0 + 1e-9) {
                return Err(FilterError::OutOfRange("a weight in 0..=1"));
            }
        }
        match hypotheses {
            [] => Ok(()),
            [one] if one.weight >= 1.0 => self.correct_one(&one.measurement),
            _ => {
                let sum: f64 = hypotheses.iter().map(|h| h.weight).sum();
                if sum > 1.0 + 1e-9 {
                    return Err(FilterError::OutOfRange("weights that sum to at most 1"));
                }
                // More than 1 by rounding is 1.
                let scale = 1.0 / sum.max(1.0);
                let capped = hypotheses.iter().map(|h| Weighted { weight: h.weight * scale, ..*h });
                // The spread of the components is summed about their own mean: it cannot cancel.
                let next = mixture_update(&self.kinematics(), [0, 2], capped)?;
                let (mean, cov) = (next.mean, next.cov);
                if !mean.iter().chain(cov.iter()).all(|v| v.is_finite()) {
                    return Err(FilterError::NotPositiveDefinite("updated covariance"));
                }
                self.set(&mean, &cov);
                Ok(())
            }
        }
    }

    fn kinematics(&self) -> Gaussian<4> {
        let [a, b] = &self.axes;
        let [xy, xw, vy, vw] = self.coupling;
        #[rustfmt::skip]
        let cov = Matrix4::new(
            a.xx, a.xv, xy,   xw,
            a.xv, a.vv, vy,   vw,
            xy,   vy,   b.xx, b.xv,
            xw,   vw,   b.xv, b.vv,
        );
        Gaussian { mean: Vector4::new(a.x, a.v, b.x, b.v), cov }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn filter() -> ConstantVelocityKf {
        let cov = Matrix4::from_diagonal(&Vector4::new(1.0, 4.0, 2.0, 4.0));
        let mut f = ConstantVelocityKf::new(
            &Gaussian { mean: Vector4::new(5.0, 1.0, 6.0, -1.0), cov },
            AccelerationNoise::Discrete(2.0),
        );
        f.predict(0.5).unwrap();
        f
    }

    fn sure(x: f64, y: f64, cov: Matrix2<f64>) -> Weighted {
        Weighted { measurement: Measurement { position: Vector2::new(x, y), cov }, weight: 1.0 }
    }

    #[test]
    fn a_measurement_without_noise_is_taken_as_it_is() {
        let mut f = filter();
        f.update(&[sure(7.0, 5.0, Matrix2::zeros())]).unwrap();
        let k = f.kinematics();
        assert_eq!((k.mean[0], k.mean[2]), (7.0, 5.0));
        assert!(k.cov[(0, 0)] == 0.0 && k.cov[(1, 1)] > 0.0);
        // The next one, too, after any time; at once it has nothing to tell.
        assert!(f.update(&[sure(7.0, 5.0, Matrix2::zeros())]).is_err());
        f.predict(0.5).unwrap();
        f.update(&[sure(7.5, 4.5, Matrix2::zeros())]).unwrap();
        assert_eq!(f.position(), [7.5, 4.5]);
    }

    #[test]
    fn two_halves_of_one_far_measurement_are_that_measurement() {
        let r = Matrix2::new(0.5, 0.1, 0.1, 0.3);
        let (mut whole, mut halves) = (filter(), filter());
        let z = sure(1e9, -2e9, r);
        whole.update(&[z]).unwrap();
        halves.update(&[Weighted { weight: 0.5, ..z }, Weighted { weight: 0.5, ..z }]).unwrap();
        let (a, b) = (whole.kinematics(), halves.kinematics());
        assert!((a.cov - b.cov).amax() < 1e-9, "{} instead of {}", b.cov, a.cov);
    }
}
