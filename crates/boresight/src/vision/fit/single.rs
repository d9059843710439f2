//! The sums of one upright spot that does not move: they factor into sums along rows and over rows.
//!
//! Mean of pixel (i, j): m = b + bx X_i + by Y_j + F E_i E_j. Every derivative is a product of one of five functions of the column, u ∈ {E, E_c, E_w, 1, X}, with
//! one of the row, so Σ_i u_k u_l / V along a row serves all pairs of parameters: 15 sums a row from tables made once, then 36 products.
//! Symbols: b, bx, by background at the window's centre and its change to the border (counts); F flux (counts); V variance (counts²).

use super::noise::SensorNoise;
use super::pixel_terms::{is_constant, ln};
use super::profile::{Axis, SIDE};
use super::scoring::Model;
use super::solve::Sums;
use super::stamp::Stamp;

/// Number of parameters: b, bx, by, x, y, F, ln of the deviations along x and y.
pub(super) const PARAMETERS: usize = 8;
/// Functions of the column and their pairs; one more, so that the pairs fill whole registers.
const U: usize = 5;
const PAIRS: usize = 16;
/// Which function of the column, and of the row, a parameter's derivative has.
const COLUMN: [usize; PARAMETERS] = [3, 4, 3, 1, 0, 0, 2, 0];
const ROW: [usize; PARAMETERS] = [3, 3, 4, 0, 1, 0, 0, 2];
/// Entries of the lower triangle of the information.
const ENTRIES: usize = PARAMETERS * (PARAMETERS + 1) / 2;

/// Place of a pair of functions.
const fn pair(a: usize, b: usize) -> usize {
    if a >= b { a * (a + 1) / 2 + b } else { b * (b + 1) / 2 + a }
}

/// The pairs of functions of each entry.
const fn pairs_of(of: [usize; PARAMETERS]) -> [usize; ENTRIES] {
    let mut out = [0; ENTRIES];
    let mut k = 0;
    while k < PARAMETERS {
        let mut l = 0;
        while l <= k {
            out[k * (k + 1) / 2 + l] = pair(of[k], of[l]);
            l += 1;
        }
        k += 1;
    }
    out
}
const COLUMN_PAIRS: [usize; ENTRIES] = pairs_of(COLUMN);
const ROW_PAIRS: [usize; ENTRIES] = pairs_of(ROW);

/// The five functions and their pairs at pixel `i` of an axis of `n`.
#[inline(always)]
fn functions(axis: &Axis, i: usize, n: usize) -> ([f64; U], [f64; PAIRS]) {
    let u = [axis.share[i], axis.by_centre[i], axis.by_width[i], 1.0, place(i, n)];
    let mut pairs = [0.0; PAIRS];
    for a in 0..U {
        for b in 0..=a {
            pairs[pair(a, b)] = u[a] * u[b];
        }
    }
    (u, pairs)
}

/// The pixels of one spot.
pub(super) struct Single<'a> {
    stamp: &'a Stamp,
    /// A variance near those of the window, counts².
    reference: f64,
    constant: bool,
}

impl<'a> Single<'a> {
    pub(super) fn new(stamp: &'a Stamp) -> Self {
        let reference = SensorNoise::variance(stamp.gain, stamp.offset, stamp.read[0], stamp.border_mean());
        Self { stamp, reference, constant: is_constant(stamp.gain, reference) }
    }
}

/// Places of the pixels of a side of n, -1 to 1.
pub(super) fn place(i: usize, n: usize) -> f64 {
    (2 * i) as f64 / (n.max(2) - 1) as f64 - 1.0
}

impl Model<PARAMETERS> for Single<'_> {
    fn sums(&self, p: &[f64; PARAMETERS]) -> Sums<PARAMETERS> {
        let s = self.stamp;
        let (w, h) = (s.width, s.height);
        let columns = Axis::of(w, p[3], p[6].exp());
        let rows = Axis::of(h, p[4], p[7].exp());
        let flux = p[5];
        let mut of_column = [([0.0; U], [0.0; PAIRS]); SIDE];
        let mut x = [0.0; SIDE];
        for (i, (f, x)) in of_column[..w].iter_mut().zip(&mut x).enumerate() {
            *f = functions(&columns, i, w);
            *x = place(i, w);
        }
        let mut sums = Sums::new(PARAMETERS);
        // Constant noise has no gain, and nothing then divides by it.
        let per_reference = 1.0 / self.reference;
        let gain = if self.constant { 0.0 } else { s.gain };
        let mut entries = [0.0; ENTRIES];
        for j in 0..h {
            let (from, to) = (j * w, (j + 1) * w);
            let (values, read, seen) = (&s.value[from..to], &s.read[from..to], &s.seen[from..to]);
            let (v, row_pairs) = functions(&rows, j, h);
            let (ground, peak) = (p[0] + p[2] * v[4], flux * v[0]);
            let (mut weight, mut weighted, mut variances) = ([0.0; SIDE], [0.0; SIDE], [0.0; SIDE]);
            let (weight, weighted, variances) = (&mut weight[..w], &mut weighted[..w], &mut variances[..w]);
            let (share, x) = (&columns.share[..w], &x[..w]);
            for i in 0..w {
                let mean = ground + p[1] * x[i] + peak * share[i];
                variances[i] = SensorNoise::variance(gain, s.offset, read[i], mean);
                weight[i] = seen[i] / variances[i];
                let residual = values[i] - mean;
                weighted[i] = weight[i] * residual;
                sums.chi2 += weighted[i] * residual;
            }
            if !self.constant {
                for i in 0..w {
                    let of_value = read[i] + gain * (values[i] - s.offset);
                    sums.cost +=
                        seen[i] * (variances[i] - self.reference - of_value * ln(variances[i] * per_reference));
                }
            }
            let (mut along, mut score) = ([0.0; PAIRS], [0.0; U]);
            for (i, (u, pairs)) in of_column[..w].iter().enumerate() {
                for (a, p) in along.iter_mut().zip(pairs) {
                    *a += weight[i] * p;
                }
                for (s, u) in score.iter_mut().zip(u) {
                    *s += weighted[i] * u;
                }
            }
            for (e, (r, c)) in entries.iter_mut().zip(ROW_PAIRS.iter().zip(&COLUMN_PAIRS)) {
                *e += row_pairs[*r] * along[*c];
            }
            for k in 0..PARAMETERS {
                sums.vector[k] += v[ROW[k]] * score[COLUMN[k]];
            }
        }
        // Derivatives by place and width hold the flux.
        let unit = [1.0, 1.0, 1.0, flux, flux, 1.0, flux, flux];
        for k in 0..PARAMETERS {
            sums.vector[k] *= unit[k];
            for l in 0..=k {
                sums.matrix[k][l] = entries[k * (k + 1) / 2 + l] * unit[k] * unit[l];
            }
        }
        sums.cost = if self.constant { sums.chi2 } else { sums.cost * 2.0 / (gain * gain) };
        sums
    }
}
