//! The sums of several spots on one ground, each smeared along its path over the exposure.
//!
//! A spot that moves by d px over the exposure is the mean over the exposure of spots at rest: seven points of Gauss and Legendre, exact to 1e-4 of
//! the peak up to |d| = 8 deviations. The other spots' parameters are fitted along, so that what is unknown of them widens the covariance.
//! Symbols as in `single`; 3 + 5 n parameters: b, bx, by, then x, y (middle of the exposure), F, ln of the deviations of each spot.

use super::noise::SensorNoise;
use super::pixel_terms::{is_constant, ln};
use super::profile::Axis;
use super::scoring::Model;
use super::single::place;
use super::solve::{HELD, Sums};
use super::stamp::Stamp;
use nalgebra::Vector2;

/// Most spots fitted together.
pub const MOST_SPOTS: usize = 4;
/// Number of parameters at most.
pub(super) const PARAMETERS: usize = 3 + 5 * MOST_SPOTS;
/// Points over the exposure, its middle 0 and its length 1, and their weights.
const NODES: [(f64, f64); 7] = [
    (-0.474_553_956_171_379_3, 0.064_742_483_084_434_85),
    (-0.370_765_592_799_697_2, 0.139_852_695_744_638_33),
    (-0.202_922_575_688_698_6, 0.190_915_025_252_559_47),
    (0.0, 0.208_979_591_836_734_7),
    (0.202_922_575_688_698_6, 0.190_915_025_252_559_47),
    (0.370_765_592_799_697_2, 0.139_852_695_744_638_33),
    (0.474_553_956_171_379_3, 0.064_742_483_084_434_85),
];
const AT_REST: [(f64, f64); 1] = [(0.0, 1.0)];
/// Motion that is none, px.
const LEAST_MOTION: f64 = 0.05;

/// The pixels of several spots.
pub(super) struct Several<'a> {
    stamp: &'a Stamp,
    n_spots: usize,
    /// Way of each spot over the exposure, px.
    motion: [Vector2<f64>; MOST_SPOTS],
    /// Which parameters are free: sums over the others are left out.
    to: [usize; PARAMETERS],
    reference: f64,
    constant: bool,
}

impl<'a> Several<'a> {
    pub(super) fn new(
        stamp: &'a Stamp,
        n_spots: usize,
        motion: [Vector2<f64>; MOST_SPOTS],
        to: [usize; PARAMETERS],
    ) -> Self {
        let reference = SensorNoise::variance(stamp.gain, stamp.offset, stamp.read[0], stamp.border_mean());
        Self {
            stamp,
            n_spots: n_spots.min(MOST_SPOTS),
            motion,
            to,
            reference,
            constant: is_constant(stamp.gain, reference),
        }
    }
}

/// Points over the exposure of a spot that moves so far, px.
fn nodes(motion: Vector2<f64>) -> &'static [(f64, f64)] {
    if motion.norm() < LEAST_MOTION { &AT_REST } else { &NODES }
}

impl Model<PARAMETERS> for Several<'_> {
    fn sums(&self, p: &[f64; PARAMETERS]) -> Sums<PARAMETERS> {
        let s = self.stamp;
        let (w, h) = (s.width, s.height);
        let empty = Axis::of(0, 0.0, 1.0);
        let mut axes = [[(empty, empty, 0.0); NODES.len()]; MOST_SPOTS];
        let mut n_nodes = [0; MOST_SPOTS];
        for k in 0..self.n_spots {
            let q = &p[3 + 5 * k..8 + 5 * k];
            for (axis, &(t, share)) in axes[k].iter_mut().zip(nodes(self.motion[k])) {
                let d = self.motion[k] * t;
                *axis = (Axis::of(w, q[0] + d.x, q[3].exp()), Axis::of(h, q[1] + d.y, q[4].exp()), share);
                n_nodes[k] += 1;
            }
        }
        let n = 3 + 5 * self.n_spots;
        let mut sums = Sums::new(n);
        let gain = if self.constant { 0.0 } else { s.gain };
        for j in 0..h {
            for i in 0..w {
                let at = j * w + i;
                if s.seen[at] == 0.0 {
                    continue;
                }
                let mut slope = [0.0; PARAMETERS];
                slope[..3].copy_from_slice(&[1.0, place(i, w), place(j, h)]);
                let mut mean = p[0] + p[1] * slope[1] + p[2] * slope[2];
                for k in 0..self.n_spots {
                    let first = 3 + 5 * k;
                    let mut sum = [0.0; 5];
                    for (x, y, share) in &axes[k][..n_nodes[k]] {
                        sum[0] += share * x.by_centre[i] * y.share[j];
                        sum[1] += share * x.share[i] * y.by_centre[j];
                        sum[2] += share * x.share[i] * y.share[j];
                        sum[3] += share * x.by_width[i] * y.share[j];
                        sum[4] += share * x.share[i] * y.by_width[j];
                    }
                    let flux = p[first + 2];
                    mean += flux * sum[2];
                    slope[first..first + 5].copy_from_slice(&[
                        flux * sum[0],
                        flux * sum[1],
                        sum[2],
                        flux * sum[3],
                        flux * sum[4],
                    ]);
                }
                let variance = SensorNoise::variance(gain, s.offset, s.read[at], mean);
                let residual = s.value[at] - mean;
                let weight = 1.0 / variance;
                sums.chi2 += weight * residual * residual;
                if !self.constant {
                    let of_value = s.read[at] + gain * (s.value[at] - s.offset);
                    sums.cost += variance - self.reference - of_value * ln(variance / self.reference);
                }
                for k in (0..n).filter(|&k| self.to[k] != HELD) {
                    let v = weight * slope[k];
                    sums.vector[k] += v * residual;
                    for l in 0..=k {
                        sums.matrix[k][l] += v * slope[l];
                    }
                }
            }
        }
        sums.cost = if self.constant { sums.chi2 } else { sums.cost * 2.0 / (gain * gain) };
        sums
    }
}
