//! Accuracy bounds of a constant-velocity coordinate: what no filter, or no linear one without a prior, can beat.
//!
//! Source: `docs/theory/measures.md`. (1) exact posterior of a coordinate seen through rounding: the polygon of (p, v)
//! that fits all scans, its centroid is the optimal estimate; (2) posterior Cramér-Rao bound P. Tichavský et al., IEEE
//! Trans. SP 46(5), 1998: for a linear Gaussian model it is the Kalman covariance; (3) no prior, no process noise:
//! var_k = r(4k-2)/(k(k+1)).
//! Symbols: p px, v px/step, r px², q px²/step⁴; a step is one scan.
//! Limits: the polygon has few corners (digital lines: 4, plus those of the velocity interval); 32 are provided for.
//! Cost: the polygon's corners a scan, the others closed forms.

use crate::{FilterError, Real};

/// Most corners of the feasible polygon.
const CORNERS: usize = 32;

/// The exact posterior of (position, velocity) given rounded positions of a target of constant velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoundedPosterior {
    /// Corners (p at the newest scan, v), in order.
    corners: [(f64, f64); CORNERS],
    n: usize,
    velocity: (f64, f64),
    n_scans: usize,
}

impl RoundedPosterior {
    /// Starts with a velocity uniform in `v_low..=v_high` (px/step) and an unknown position.
    /// # Errors
    /// [`FilterError::OutOfRange`] unless `v_low < v_high` and both are finite.
    pub fn new(v_low: f64, v_high: f64) -> Result<Self, FilterError> {
        if !(v_low < v_high && v_low.abs() <= f64::MAX && v_high.abs() <= f64::MAX) {
            return Err(FilterError::OutOfRange("a lowest velocity below the highest"));
        }
        Ok(Self { corners: [(0.0, 0.0); CORNERS], n: 0, velocity: (v_low, v_high), n_scans: 0 })
    }

    /// Takes the rounded position of the next scan and returns the posterior mean of position and velocity.
    ///
    /// The worked example of `docs/theory/measures.md`:
    /// ```
    /// let mut posterior = boresight_filters::bounds::RoundedPosterior::new(0.5, 1.5).unwrap();
    /// let mut last = (0.0, 0.0);
    /// for n in [11.0, 12.0, 14.0, 15.0, 16.0, 17.0] {
    ///     last = posterior.observe(n).unwrap();
    /// }
    /// assert!((last.0 - 17.166666666667_f64).abs() < 1e-11 && (last.1 - 1.1944444444444_f64).abs() < 1e-12);
    /// ```
    /// # Errors
    /// [`FilterError`] if the number is not finite or no constant velocity explains all scans; the state is unchanged.
    pub fn observe(&mut self, rounded: f64) -> Result<(f64, f64), FilterError> {
        if !(rounded.abs() <= f64::MAX) {
            return Err(FilterError::NotFinite("the rounded position"));
        }
        let mut next = *self;
        let (low, high) = (rounded - 0.5, rounded + 0.5);
        if next.n_scans == 0 {
            let (a, b) = next.velocity;
            for (c, v) in next.corners.iter_mut().zip([(low, a), (high, a), (high, b), (low, b)]) {
                *c = v;
            }
            next.n = 4;
        } else {
            for c in &mut next.corners[..next.n] {
                c.0 += c.1;
            }
            next.clip(|p| p - low)?;
            next.clip(|p| high - p)?;
        }
        next.n_scans += 1;
        let mean = next.centroid().ok_or(FilterError::OutOfRange("positions that one constant velocity explains"))?;
        *self = next;
        Ok(mean)
    }

    /// Keeps the part of the polygon where `inside(p) >= 0`.
    fn clip(&mut self, inside: impl Fn(f64) -> f64) -> Result<(), FilterError> {
        let old = *self;
        self.n = 0;
        for k in 0..old.n {
            let (a, b) = (old.corners[k], old.corners[(k + 1) % old.n]);
            let (fa, fb) = (inside(a.0), inside(b.0));
            if fa >= 0.0 {
                self.push(a)?;
            }
            if (fa > 0.0 && fb < 0.0) || (fa < 0.0 && fb > 0.0) {
                let t = fa / (fa - fb);
                self.push((a.0 + t * (b.0 - a.0), a.1 + t * (b.1 - a.1)))?;
            }
        }
        Ok(())
    }

    fn push(&mut self, corner: (f64, f64)) -> Result<(), FilterError> {
        let place = self.corners.get_mut(self.n).ok_or(FilterError::OutOfRange("a polygon of at most 32 corners"))?;
        *place = corner;
        self.n += 1;
        Ok(())
    }

    fn centroid(&self) -> Option<(f64, f64)> {
        let c = self.corners.get(..self.n)?;
        let origin = *c.first()?;
        let (mut area, mut p, mut v) = (0.0, 0.0, 0.0);
        // Triangles from the first corner, relative to it: no cancellation far from the origin.
        for w in c.windows(2).skip(1) {
            let (a, b) = ((w[0].0 - origin.0, w[0].1 - origin.1), (w[1].0 - origin.0, w[1].1 - origin.1));
            let twice = a.0 * b.1 - a.1 * b.0;
            area += twice;
            p += twice * (a.0 + b.0) / 3.0;
            v += twice * (a.1 + b.1) / 3.0;
        }
        (area > 0.0).then(|| (origin.0 + p / area, origin.1 + v / area))
    }
}

/// Posterior Cramér-Rao bound of position and velocity variance, scan by scan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PosteriorBound<T = f64> {
    p: [T; 3],
    r: T,
    q: T,
}

impl<T: Real> PosteriorBound<T> {
    /// Starts with variances of position (px²) and velocity (px²/step²); r px² per scan, q px²/step⁴ acceleration.
    /// # Errors
    /// [`FilterError::OutOfRange`] for negative values, or r = 0.
    pub fn new(position_var: T, velocity_var: T, r: T, q: T) -> Result<Self, FilterError> {
        let fine = |v: T| v >= T::zero() && v <= T::MAX;
        if !(fine(position_var) && fine(velocity_var) && fine(q) && fine(r) && r > T::zero()) {
            return Err(FilterError::OutOfRange("variances of at least 0, and r above 0"));
        }
        Ok(Self { p: [position_var, T::zero(), velocity_var], r, q })
    }

    /// Moves one scan and one measurement on; returns the bounds of the variance of position and velocity.
    pub fn scan(&mut self) -> (T, T) {
        let [a, b, c] = self.p;
        let quarter = T::of(0.25);
        let (a, b, c) = (a + b + b + c + self.q * quarter, b + c + self.q * T::of(0.5), c + self.q);
        let s = a + self.r;
        self.p = [a * self.r / s, b * self.r / s, c - b * b / s];
        (self.p[0], self.p[2])
    }
}

/// Returns the least variance of position after k scans of variance r without prior or process noise (px²).
pub fn no_prior_variance<T: Real>(k: usize, r: T) -> T {
    let k = T::of(k as f64);
    r * (T::of(4.0) * k - T::of(2.0)) / (k * (k + T::one()))
}

/// Returns the least RMSPE (both axes) over scans 1..=n without prior or process noise (px).
pub fn no_prior_rmspe<T: Real>(n: usize, r: T) -> T {
    let sum = (1..=n).fold(T::zero(), |s, k| s + no_prior_variance(k, r));
    (T::of(2.0) * sum / T::of(n as f64)).sqrt()
}
