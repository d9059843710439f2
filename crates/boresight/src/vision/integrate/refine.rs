//! Place and velocity of a candidate between the grid's: the score climbed to its top, with the covariance that its curvature gives.
//!
//! Source: maximum likelihood of a moving spot of known width and unknown amplitude in white noise; scoring steps with the expected
//! curvature (Fisher), S. M. Kay, *Fundamentals of Statistical Signal Processing* I, 1993, ch. 7.
//! Model: place p(τ) = x + v τ, τ <= 0 the time before the newest frame. z(x, v) = Σ ψ(p) / √(Σ φ(p) κ(p)), ψ between pixels by bilinear
//! interpolation and κ = Π (1 − 2 f (1 − f)(1 − ρ)) the noise that it leaves at the fractions f, ρ = exp(−1 / 4σ²) the correlation of neighbours: so z is N(0, 1)
//! between pixels too. Expected curvature for each axis: z² / 2σ² · mean [1 τ; τ τ²], whose inverse is the covariance of (x, v): the Cramér-Rao
//! bound at the amplitude found. Symbols as in `memory`.
//! Limits: below a score of 5 or so the top is one of noise and the covariance too small; targets that keep their velocity. Cost: about 10 µs for 64 frames.

use super::memory::{CELL, PER_UNIT, Phi};
use nalgebra::{Matrix2, Vector2};

/// Most steps; the climb is quadratic near the top.
const STEPS: usize = 8;
/// A climb that gains less than this in z is over.
const ENOUGH: f64 = 0.002;
/// Longest step at either end of the path, px: about the spot's own width keeps the curvature valid.
const LONGEST_PX: f64 = 1.0;
/// Least variance of τ, weighted by φ, in squares of the sum's duration: below it one frame holds nearly all the weight and the velocity is not
/// known. All frames have 1/12, half of them 1/48.
const LEAST_SPREAD: f64 = 1e-3;

/// A place and velocity with its score.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Found {
    /// In the newest frame, px.
    pub(super) position: Vector2<f64>,
    /// px/s.
    pub(super) velocity: Vector2<f64>,
    /// Deviations of noise.
    pub(super) z: f64,
    /// Σψ / Σφ, in units of the noise S.
    pub(super) amplitude: f64,
    /// Weighted mean of [1 τ; τ τ²].
    pub(super) moments: Matrix2<f64>,
}

impl Found {
    /// Covariance of place and velocity of one axis: px², px²/s, px²/s².
    pub(super) fn cov(&self, sigma_px: f64) -> Matrix2<f64> {
        let scale = 2.0 * (sigma_px / self.z).powi(2);
        // At least half of the frames are inside, so the determinant is above 0; the fallback is a velocity of which nothing is known.
        self.moments.try_inverse().unwrap_or_else(|| Matrix2::new(1.0, 0.0, 0.0, 1e12)) * scale
    }
}

/// What is needed to look at a path.
#[derive(Clone, Copy, Debug)]
pub(super) struct Paths<'a> {
    /// ψ of each frame, the newest first, in 1/[`PER_UNIT`].
    pub(super) frames: &'a [Vec<i16>],
    pub(super) times_s: &'a [f64],
    pub(super) phi: &'a Phi,
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) sigma_px: f64,
}

/// Score of a path, its slope, and what it lies on.
#[derive(Clone, Copy, Debug, Default)]
struct Looked {
    z: f64,
    psi: f64,
    phi: f64,
    /// Of z: to x, vx, y, vy.
    slope: [f64; 4],
    /// Σφ, Σφτ, Σφτ².
    moments: [f64; 3],
}

impl Paths<'_> {
    /// ψ at a pixel, 0 outside.
    #[inline]
    fn psi(&self, frame: &[i16], x: i64, y: i64) -> f64 {
        let inside = x >= 0 && y >= 0 && x < self.width as i64 && y < self.height as i64;
        let stride = self.phi.cells_x * CELL;
        if inside { f64::from(frame[y as usize * stride + x as usize]) } else { 0.0 }
    }

    /// Looks at one path.
    fn look(&self, position: Vector2<f64>, velocity: Vector2<f64>) -> Looked {
        let neighbours = (-0.25 / (self.sigma_px * self.sigma_px)).exp();
        let left = |f: f64| 1.0 - 2.0 * f * (1.0 - f) * (1.0 - neighbours);
        let mut l = Looked::default();
        let mut noise = 0.0;
        for (age, (frame, &t)) in self.frames.iter().zip(self.times_s).enumerate() {
            let p = position + velocity * t;
            let (x, y) = (p.x.floor(), p.y.floor());
            let (fx, fy) = (p.x - x, p.y - y);
            let (x, y) = (x as i64, y as i64);
            let (cx, cy) = ((p.x + 0.5).floor() as i64, (p.y + 0.5).floor() as i64);
            if cx < 0 || cy < 0 || cx >= self.width as i64 || cy >= self.height as i64 {
                continue;
            }
            let cell = self.phi.cells[cy as usize / CELL * self.phi.cells_x + cx as usize / CELL];
            let phi = f64::from(cell * self.phi.frames[age]);
            let at = |dx: i64, dy: i64| self.psi(frame, x + dx, y + dy);
            let between = |a: f64, b: f64, f: f64| a + f * (b - a);
            // Columns x - 1 ..= x + 2, rows likewise, of which only the cross is read.
            let rows: [f64; 4] = std::array::from_fn(|k| between(at(0, k as i64 - 1), at(1, k as i64 - 1), fx));
            let columns: [f64; 4] = std::array::from_fn(|k| between(at(k as i64 - 1, 0), at(k as i64 - 1, 1), fy));
            let slope = |v: &[f64; 4], f: f64| 0.5 * (between(v[2], v[3], f) - between(v[0], v[1], f));
            let (gx, gy) = (slope(&columns, fx), slope(&rows, fy));
            l.psi += between(rows[1], rows[2], fy);
            l.phi += phi;
            noise += phi * left(fx) * left(fy);
            for (s, g) in l.slope.iter_mut().zip([gx, gx * t, gy, gy * t]) {
                *s += g;
            }
            for (m, v) in l.moments.iter_mut().zip([phi, phi * t, phi * t * t]) {
                *m += v;
            }
        }
        let sd = noise.max(1e-12).sqrt() * f64::from(PER_UNIT);
        l.z = l.psi / sd;
        l.psi /= f64::from(PER_UNIT);
        l.slope.iter_mut().for_each(|s| *s /= sd);
        l
    }

    /// Climbs from a place and velocity to the top of z, or of −z if `sign` is −1 (z is then that of the negative frames).
    pub(super) fn climb(&self, position: Vector2<f64>, velocity: Vector2<f64>, sign: f64) -> Option<Found> {
        let (mut x, mut v) = (position, velocity);
        let mut here = self.look(x, v);
        let duration = self.times_s.last().map_or(0.0, |t| t.abs());
        // Differences over two pixels see a spot's slope smaller by this.
        let seen = (-0.25 / (self.sigma_px * self.sigma_px)).exp();
        for _ in 0..STEPS {
            let z = sign * here.z;
            if z <= 0.0 || here.moments[0] <= 0.0 {
                break;
            }
            let [m0, m1, m2] = here.moments;
            let moments = Matrix2::new(1.0, m1 / m0, m1 / m0, m2 / m0);
            let Some(inverse) = moments.try_inverse() else { break };
            let scale = sign * 2.0 * self.sigma_px * self.sigma_px / (z * seen);
            let dx = inverse * Vector2::new(here.slope[0], here.slope[1]) * scale;
            let dy = inverse * Vector2::new(here.slope[2], here.slope[3]) * scale;
            let (mut dp, mut dv) = (Vector2::new(dx.x, dy.x), Vector2::new(dx.y, dy.y));
            let longest = dp.norm().max((dp - dv * duration).norm());
            if longest.is_nan() {
                break;
            }
            let shorter = (LONGEST_PX / longest.max(1e-12)).min(1.0);
            (dp, dv) = (dp * shorter, dv * shorter);
            let mut gained = None;
            for _ in 0..4 {
                let next = self.look(x + dp, v + dv);
                if sign * next.z > z {
                    gained = Some((next, sign * next.z - z));
                    break;
                }
                (dp, dv) = (dp * 0.5, dv * 0.5);
            }
            let Some((next, gain)) = gained else { break };
            (x, v, here) = (x + dp, v + dv, next);
            if gain < ENOUGH {
                break;
            }
        }
        let [m0, m1, m2] = here.moments;
        let (w, h) = (self.width as f64, self.height as f64);
        let inside = (-0.5..w - 0.5).contains(&x.x) && (-0.5..h - 0.5).contains(&x.y);
        let known = m0 > 0.0 && m2 / m0 - (m1 / m0).powi(2) > LEAST_SPREAD * duration * duration;
        (inside && known && here.z * sign > 0.0).then(|| Found {
            position: x,
            velocity: v,
            z: sign * here.z,
            amplitude: sign * here.psi / here.phi.max(1e-12),
            moments: Matrix2::new(1.0, m1 / m0, m1 / m0, m2 / m0),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clean_path_is_found_between_pixels_and_between_velocities() {
        let (w, h, n, sigma) = (64usize, 48usize, 16usize, 1.3);
        let times_s: Vec<f64> = (0..n).map(|k| -0.04 * k as f64 - if k > 7 { 0.08 } else { 0.0 }).collect();
        let (truth, speed) = (Vector2::new(40.3, 20.7), Vector2::new(21.0, -13.0));
        let frames: Vec<Vec<i16>> = times_s
            .iter()
            .map(|t| {
                let p = truth + speed * *t;
                (0..w * h)
                    .map(|i| {
                        let (dx, dy) = ((i % w) as f64 - p.x, (i / w) as f64 - p.y);
                        (2000.0 * (-(dx * dx + dy * dy) / (4.0 * sigma * sigma)).exp()).round() as i16
                    })
                    .collect()
            })
            .collect();
        let phi = Phi { cells: vec![1.0; 12], cells_x: 4, frames: vec![1.0; n], unit: 1.0 };
        let paths = Paths { frames: &frames, times_s: &times_s, phi: &phi, width: w, height: h, sigma_px: sigma };
        let found = paths.climb(Vector2::new(41.0, 20.0), Vector2::new(23.5, -11.0), 1.0).unwrap();
        // What bilinear interpolation of a spot of σ = 1.84 px leaves is 0.02 px.
        assert!((found.position - truth).norm() < 0.05, "{found:?}");
        assert!((found.velocity - speed).norm() < 0.15, "{found:?}");
        // 2000 / 64 over 16 frames.
        assert!((found.z / (2000.0 / 64.0 * 4.0) - 1.0).abs() < 0.01, "{found:?}");
        // The line's end is known to 4 R / n for many points evenly in time: here 16 points with a gap.
        let ratio = found.cov(sigma)[(0, 0)] / (2.0 * (sigma / found.z).powi(2));
        assert!((3.0..4.5).contains(&ratio), "{ratio}");
        assert!(paths.climb(Vector2::new(41.0, 20.0), Vector2::new(23.5, -11.0), -1.0).is_none());
    }
}
