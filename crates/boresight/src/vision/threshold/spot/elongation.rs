//! Spots that are longer than the others of a frame: two that make one peak, and what that adds to the covariance of the position.
//!
//! Source: our own. Of two alike at the distance d the position found lies between, d/2 from either, and their light has the variance d²/4 more along the line between them than that of one: by as
//! much as a spot's light is spread more than usual its place is uncertain. Spread: second moments of the positive response in a disc of some [`REACH`] deviations of the frame's own spots, which the smallest disc tells; what the
//! disc's edge hides of it is made good as for a Gaussian.
//! Longer than usual: the difference of the eigenvalues of the moments stands [`SURE`] robust deviations above the median of the frame's spots; that holds what noise and the optics do. A fainter spot's is by as much
//! less certain as it is fainter. Not all that are long are two: of n spots in an area A some n² π D² / 2A are pairs nearer than D by chance, D twice the deviation of a spot's response (C. M. Sparrow, *Astrophys. J.* 44,
//! 1916: up to there two Gaussians have one peak), or what the detector makes one peak of; if more are long, each may be two with the probability that remains.
//! Symbols: M second moments, px²; E their elongation, the vector of M_xx - M_yy and 2 M_xy, whose length is the difference of the eigenvalues.
//! Limits: spots lie independently of each other; in swarms more are two. Where another peak is near, its light makes a spot long: those are not asked.

use crate::Image;
use crate::vision::middle::middle;
use crate::vision::threshold::grid::median_and_deviation;
use crate::vision::threshold::lanes::around;
use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, f64x4};
use nalgebra::{Matrix2, Vector2};

/// Fewest spots that tell what is usual.
const LEAST: usize = 16;
/// Deviations by which an elongation is more than usual: of Gaussian ones one in a thousand.
const SURE: f64 = 3.0;
/// Another peak is near within this many radii of the disc.
const NEAR: f64 = 1.5;
/// Radius of the disc in deviations of a spot's response: half of an elongation is seen there. With 1.5, an eighth, noise hides pairs up to 1.4 deviations apart; with 4 it hides more again, and neighbours lie within.
const REACH: f64 = 2.5;
/// Largest radius in units of the size: 2.5 deviations of a spot whose size is its width at half height, whose response the surround makes narrower than itself.
const LARGEST: f64 = 0.9;
/// Radii that are chosen among, evenly from the smallest to the largest.
const RADII: usize = 5;
/// So many spots tell their variance: to 3 % where each differs by a sixth.
const ENOUGH: usize = 64;
/// Largest radius whose table is computed, px; those of larger ones are its, scaled.
const COMPUTED: usize = 16;
/// Steps of the table of Gaussians: variances from a hundredth of the squared radius to twice it.
const STEPS: usize = 24;
const VARIANCES: [f64; 2] = [0.01, 2.0];
/// Variance along the longer axis of the Gaussians that tell what the edge hides, in units of that across it.
const LONGER: f64 = 1.5;

/// Second moments of a spot.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Moments2 {
    /// Half of the sum of the eigenvalues, px².
    mean: f64,
    /// M_xx - M_yy and 2 M_xy, px².
    long: [f64; 2],
}

impl Moments2 {
    fn length(&self) -> f64 {
        self.long[0].hypot(self.long[1])
    }
}

/// A disc that moments are taken in.
#[derive(Clone, Debug)]
struct MomentsDisc {
    /// Radius, px.
    radius: usize,
    /// Of Gaussians that grow: the mean eigenvalue of the moments in the disc, px², the part of an elongation that is seen there, and the variance, px².
    table: [[f64; 3]; STEPS],
}

/// What is usual, and what the disc's edge hides.
#[derive(Clone, Debug)]
pub(super) struct Elongation {
    /// From the smallest to the largest.
    discs: [MomentsDisc; RADII],
    /// Which of them suits the frame.
    chosen: usize,
    /// Of peaks within this distance the detector takes the larger one, px.
    one_px: f64,
    values: Vec<f32>,
}

/// See [`MomentsDisc::table`], for a disc of that radius, px.
fn table(radius: usize) -> [[f64; 3]; STEPS] {
    let r2 = (radius * radius) as f64;
    let ratio = (VARIANCES[1] / VARIANCES[0]).powf(1.0 / (STEPS - 1) as f64);
    let side = 2 * radius + 3;
    let c = Vector2::new(radius as f64 + 1.0, radius as f64 + 1.0);
    std::array::from_fn(|i| {
        let across = VARIANCES[0] * ratio.powi(i as i32) * r2;
        let of = |along: f64| {
            let value = |p: usize| {
                let (x, y) = ((p % side) as f64 - c.x, (p / side) as f64 - c.y);
                (-0.5 * (x * x / along + y * y / across)).exp() as f32
            };
            let image = Image::from_vec(side, side, (0..side * side).map(value).collect());
            image.map_or(Moments2::default(), |image| second_moments(&image, radius, c))
        };
        [of(across).mean, of(LONGER * across).length() / ((LONGER - 1.0) * across), across]
    })
}

impl MomentsDisc {
    fn new(radius: usize) -> Self {
        let computed = radius.min(COMPUTED);
        let larger = (radius as f64 / computed as f64).powi(2);
        Self { radius, table: table(computed).map(|[mean, part, across]| [mean * larger, part, across * larger]) }
    }

    /// Another peak is near up to this distance, px.
    fn alone_px(&self) -> usize {
        (NEAR * self.radius as f64).ceil() as usize
    }

    /// Whether no other peak is near, the square of the distance to the next being that, px².
    fn is_alone(&self, nearest2: usize) -> bool {
        nearest2 > self.alone_px().pow(2)
    }

    /// The moments of a spot at a place, with the square of the distance to its next peak, px²; none where that is near.
    fn measure(&self, response: &Image<f32>, (c, nearest2): (Vector2<f64>, usize)) -> Option<Moments2> {
        self.is_alone(nearest2).then(|| second_moments(response, self.radius, c))
    }

    /// Part of an elongation that the disc shows of a spot with that mean of the moments, and its variance, px².
    fn of_gaussian(&self, mean: f64) -> [f64; 2] {
        let k = self.table.partition_point(|t| t[0] < mean).clamp(1, STEPS - 1);
        let (a, b) = (self.table[k - 1], self.table[k]);
        let part = ((mean - a[0]) / (b[0] - a[0])).clamp(0.0, 1.0);
        [1, 2].map(|i| a[i] + part * (b[i] - a[i]))
    }
}

impl Elongation {
    /// For a detector of that size, px, whose smallest disc has that radius, px.
    pub(super) fn new(smallest: usize, size_px: f64, one_px: f64) -> Self {
        let smallest = smallest + 1;
        let largest = ((LARGEST * size_px).round() as usize).max(smallest);
        let radius = |i: usize| smallest + (i * (largest - smallest) + (RADII - 1) / 2) / (RADII - 1);
        let discs = std::array::from_fn(|i| MomentsDisc::new(radius(i)));
        Self { discs, chosen: 0, one_px, values: Vec::new() }
    }

    /// Another peak is near up to this distance at most, px.
    pub(super) fn alone_px(&self) -> usize {
        self.discs[RADII - 1].alone_px()
    }

    /// Chooses the disc for the spots of a frame: each one's place and the square of the distance to its next peak, px². It is a smaller one where too few stand alone.
    pub(super) fn suit(
        &mut self,
        response: &Image<f32>,
        spots: impl ExactSizeIterator<Item = (Vector2<f64>, usize)> + Clone,
    ) {
        let smallest = &self.discs[0];
        let some = spots.clone().step_by(spots.len().div_ceil(ENOUGH).max(1));
        let means = filled(&mut self.values, some.filter_map(|s| smallest.measure(response, s)).map(|m| m.mean));
        self.chosen = 0;
        if means.is_empty() {
            return;
        }
        let [_, variance] = smallest.of_gaussian(f64::from(middle(means)));
        let reach = REACH * variance.sqrt() + 0.5;
        let suits = |d: &MomentsDisc| {
            d.radius as f64 <= reach && spots.clone().filter(|s| d.is_alone(s.1)).nth(LEAST - 1).is_some()
        };
        self.chosen = self.discs.iter().rposition(suits).unwrap_or(0);
    }

    /// The moments of a spot in the disc that was chosen.
    pub(super) fn measure(&self, response: &Image<f32>, c: Vector2<f64>, nearest2: usize) -> Option<Moments2> {
        self.discs[self.chosen].measure(response, (c, nearest2))
    }

    /// What is to be added to the covariance of each spot's position, px², from the moments of those that are asked and all masses, in a frame of that area, px².
    pub(super) fn judge(
        &mut self,
        spots: &[(Option<Moments2>, f64)],
        area_px2: f64,
        mut put: impl FnMut(usize, Matrix2<f64>),
    ) {
        let asked = || spots.iter().enumerate().filter_map(|(i, (m, mass))| m.map(|m| (i, m, *mass)));
        let n_asked = asked().count();
        if n_asked < LEAST {
            return;
        }
        let values = &mut self.values;
        let mass = f64::from(middle(filled(values, asked().map(|(.., mass)| mass))));
        let mean = f64::from(middle(filled(values, asked().map(|(_, m, _)| m.mean))));
        let usual = median_and_deviation(filled(values, asked().map(|(_, m, _)| m.length())), 0.0);
        let (length, deviation) = (f64::from(usual.0), f64::from(usual.1));
        let [shown, variance] = self.discs[self.chosen].of_gaussian(mean);
        let least_more = |own: f64| SURE * deviation * (mass / own).max(1.0);
        let long = || asked().filter(|(_, m, own)| m.length() - length > least_more(*own));
        let one2 = (4.0 * variance).max(self.one_px * self.one_px);
        // Of all pairs so many stand alone and are asked.
        let n_pairs = 0.5 * (spots.len() * n_asked) as f64 * std::f64::consts::PI * one2 / area_px2;
        let two = (n_pairs / long().count().max(1) as f64).min(1.0);
        for (i, m, _) in long() {
            // Half of one and one along the axis, of the length 1.
            let [c, s] = m.long.map(|e| e / m.length());
            put(i, Matrix2::new(1.0 + c, s, s, 1.0 - c) * (0.5 * two * (m.length() - length) / shown));
        }
    }
}

/// These values in the place of those before.
fn filled(values: &mut Vec<f32>, all: impl Iterator<Item = f64>) -> &mut [f32] {
    values.clear();
    values.extend(all.map(|v| v as f32));
    values
}

/// Second moments of the positive response about `c` in a disc with a soft edge.
fn second_moments(response: &Image<f32>, radius: usize, c: Vector2<f64>) -> Moments2 {
    dispatch!(Level::new(), simd => second_moments_vectors(simd, response, radius, c))
}

#[inline(always)]
fn second_moments_vectors<S: Simd>(simd: S, response: &Image<f32>, radius: usize, c: Vector2<f64>) -> Moments2 {
    let reach = radius as f64 + 0.5;
    let splat = |v| f64x4::splat(simd, v);
    let (zero, one) = (splat(0.0), splat(1.0));
    // From 1 at half a pixel within the radius to 0 at half a pixel beyond, along the square of the distance.
    let (outer2, per_width) = (splat(reach * reach), splat(1.0 / (2.0 * reach - 1.0)));
    let [mut sum, mut xx, mut xy, mut yy] = [zero; 4];
    around(simd, response, reach, c, |d, x, y| {
        let (x2, y2) = (x * x, y * y);
        let d = ((outer2 - x2 - y2) * per_width).max(zero).min(one) * d;
        sum += d;
        xx += d * x2;
        xy += d * x * y;
        yy += d * y2;
    });
    let [sum, xx, xy, yy] = [sum, xx, xy, yy].map(|v| v.reduce_sum());
    if sum <= 0.0 {
        return Moments2::default();
    }
    Moments2 { mean: 0.5 * (xx + yy) / sum, long: [(xx - yy) / sum, 2.0 * xy / sum] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    const C: Vector2<f64> = Vector2::new(12.3, 11.8);

    /// Spots of deviation 1.5 px at these places beside the middle.
    fn response(at: &[[f64; 2]]) -> Image<f32> {
        let value = |i: usize| {
            let d2 = |p: &[f64; 2]| ((i % 25) as f64 - C.x - p[0]).powi(2) + ((i / 25) as f64 - C.y - p[1]).powi(2);
            at.iter().map(|p| (-d2(p) / 4.5).exp()).sum::<f64>() as f32
        };
        Image::from_vec(25, 25, (0..625).map(value).collect()).unwrap()
    }

    #[test]
    fn a_pair_is_as_uncertain_along_its_line_as_half_of_its_distance() {
        let mut elongation = Elongation::new(3, 5.0, 3.0);
        let one = elongation.measure(&response(&[[0.0, 0.0]]), C, usize::MAX).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for d in [2.0, 2.5, 3.0] {
            let along = Vector2::new(0.6, 0.8) * (0.5 * d);
            let pair = response(&[[along.x, along.y], [-along.x, -along.y]]);
            let pair = elongation.measure(&pair, C, usize::MAX).unwrap();
            // The others differ by what noise does.
            let mut spots: Vec<(Option<Moments2>, f64)> = (0..40)
                .map(|_| {
                    let noisy = one.long.map(|e| e + 0.05 * rng.sample::<f64, _>(StandardNormal));
                    (Some(Moments2 { long: noisy, ..one }), 10.0)
                })
                .collect();
            spots[0].0 = Some(pair);
            spots.push((None, 10.0));
            let mut added = Vec::new();
            elongation.judge(&spots, 1e4, |i, m| added.push((i, m)));
            let (i, m) = added[0];
            let way = along.normalize();
            let (of, across) = (way.dot(&(m * way)), Vector2::new(-way.y, way.x));
            assert!(i == 0 && (of / (0.25 * d * d) - 1.0).abs() < 0.3, "{d}: {of}");
            assert!(across.dot(&(m * across)).abs() < 1e-3, "{m}");
            assert!(added.len() <= 2, "{added:?}");
            // In a hundred times the area hardly any two lie so near each other: most that are long are so by themselves.
            added.clear();
            elongation.judge(&spots, 1e6, |i, m| added.push((i, m)));
            assert!(way.dot(&(added[0].1 * way)) < 0.05 * of);
            // So faint that noise may do that.
            spots[0].1 = 0.1;
            added.clear();
            elongation.judge(&spots, 1e4, |i, m| added.push((i, m)));
            assert!(added.iter().all(|(i, _)| *i != 0));
            // Of so few none is unusual.
            elongation.judge(&spots[..LEAST - 1], 1e4, |_, _| unreachable!());
        }
    }

    /// The number and the radius of the disc that is chosen for so many spots of 1.5 px with the next peak at that distance (px).
    fn chosen(size_px: f64, n: usize, nearest_px: usize) -> (usize, usize) {
        let response = response(&[[0.0, 0.0]]);
        let mut elongation = Elongation::new(2, size_px, 3.0);
        elongation.suit(&response, (0..n).map(|_| (C, nearest_px.pow(2))));
        (elongation.chosen, elongation.discs[elongation.chosen].radius)
    }

    #[test]
    fn the_disc_holds_two_and_a_half_deviations_of_the_spots_where_enough_stand_alone() {
        // 2.5 of 1.5 px.
        for size_px in [4.5, 6.0, 8.6] {
            assert!(chosen(size_px, LEAST, 50).0 > 0, "{size_px}: {:?}", chosen(size_px, LEAST, 50));
            assert_eq!(chosen(size_px, LEAST, 50).1, 4, "{size_px}");
        }
        assert_eq!(chosen(6.0, LEAST - 1, 50), (0, 3), "too few");
        assert_eq!(chosen(6.0, 50, 6), (0, 3), "others are near: 1.5 of 4 px");
        assert_eq!(chosen(6.0, 0, 50), (0, 3));
    }

    #[test]
    fn the_table_of_a_large_disc_is_a_small_ones_scaled() {
        let large = MomentsDisc::new(2 * COMPUTED);
        for (a, b) in table(2 * COMPUTED).iter().zip(large.table) {
            assert!((b[0] / a[0] - 1.0).abs() < 0.01 && (b[1] - a[1]).abs() < 0.01, "{a:?} {b:?}");
            assert!((b[2] / a[2] - 1.0).abs() < 1e-9, "{a:?} {b:?}");
        }
    }

    #[test]
    fn moments_are_those_of_the_light_where_the_disc_holds_all_of_it() {
        let m = second_moments(&response(&[[1.0, 0.0], [-1.0, 0.0]]), 9, C);
        assert!((m.mean - 2.75).abs() < 0.03 && (m.long[0] - 1.0).abs() < 0.03 && m.long[1].abs() < 0.01, "{m:?}");
        assert_eq!(second_moments(&Image::filled(9, 9, -1.0), 3, C), Moments2::default());
    }
}
