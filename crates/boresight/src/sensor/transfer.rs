//! Photon transfer: the variance of a pixel against its mean, from the differences of frames that follow one another.
//!
//! Source: J. R. Janesick, *Photon Transfer*, 2007: variance = read² + gain (mean - offset). Fixed patterns cancel in differences. Departures for scenes that move:
//! of each level only the half of the pixels with the smaller gradient around them counts (what moves changes a pixel by its gradient times the way), a pair's
//! median difference is taken off each level (light that flickers), and differences beyond four deviations are left out.
//! The line through the levels leaves out levels that lie far off it. Offset and read noise cannot be told apart without dark frames: only
//! read² - gain offset is known, which is all that the variance of a pixel needs.
//! Symbols: d difference of two frames (counts), m their mean (counts). Limits: noise alike in neighbouring frames (a codec that copies) is not seen; noise that grows
//! with the square of the light (unequal response times shake) bends the line.

use super::grey::{range, values};
use super::line::{Line, fit};
use crate::Pixels;

/// Samples of one pair of frames, and pairs, at most.
const SAMPLES: usize = 20_000;
const PAIRS: usize = 100;
/// Levels between the darkest and the brightest, and samples a level needs.
const LEVELS: usize = 32;
const LEAST_SAMPLES: usize = 200;
/// Differences from a pair of which the median of a level is known well enough to be taken off.
const LEAST_OF_PAIR: usize = 20;
/// Share by which a level may lie off the line for reasons of its own.
const MODEL_ERROR: f64 = 0.02;
/// Differences beyond this many deviations are no noise; and the mean square of a normal variable cut there.
const CUT: f64 = 4.0;
const CUT_SQUARE: f64 = 0.998_93;
/// A share of the full range above which a pixel may be cut off.
const NEARLY_FULL: f32 = 0.98;

#[derive(Clone, Copy, Debug)]
struct Sample {
    mean: f32,
    gradient: f32,
    difference: f32,
    pair: u16,
}

/// One level of light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Level {
    /// Mean, counts.
    pub mean: f64,
    /// Variance of a pixel, counts², with the rounding to whole counts.
    pub variance: f64,
    /// Standard deviation of this variance, counts².
    pub variance_sd: f64,
    /// Differences it comes from.
    pub n: usize,
}

/// Variance against mean.
#[derive(Clone, Debug, PartialEq)]
pub struct TransferCurve {
    /// The levels, from dark to bright.
    pub levels: Vec<Level>,
    /// The line through them; its slope is the gain. `None` from fewer than two levels.
    pub line: Option<Line>,
    /// Variance of a pixel over all levels, counts²: the noise where there is no gain to be seen.
    pub variance: f64,
    /// Rounding noise in the variances, counts².
    pub rounding: f64,
}

impl TransferCurve {
    /// Whether variance surely grows with light: the slope stands 4 deviations above 0.
    pub fn has_gain(&self) -> bool {
        self.line.is_some_and(|l| l.slope > 4.0 * l.slope_sd)
    }

    /// Read noise (a deviation, counts, without the rounding), gain (counts) and offset (counts) that describe the variances.
    ///
    /// Without a gain to be seen it is the mean noise. Without `dark` the offset is 0, or, if the line passes below 0 there, where it reaches 0.
    pub fn noise(&self, dark: Option<Level>) -> [f64; 3] {
        let sd = |variance: f64| (variance - self.rounding).max(0.0).sqrt();
        match (self.line.filter(|_| self.has_gain()), dark) {
            (None, Some(dark)) => [sd(self.variance), 0.0, dark.mean],
            (None, None) => [sd(self.variance), 0.0, 0.0],
            (Some(_), Some(dark)) => {
                // The line starts at the dark level; the slope is that of the others from there.
                let (mut up, mut down) = (0.0, 0.0);
                for l in self.levels.iter().filter(|l| l.mean > dark.mean) {
                    let weight = 1.0 / (l.variance_sd.powi(2) + (MODEL_ERROR * l.variance).powi(2));
                    up += weight * (l.variance - dark.variance) * (l.mean - dark.mean);
                    down += weight * (l.mean - dark.mean).powi(2);
                }
                [sd(dark.variance), (up / f64::max(down, f64::MIN_POSITIVE)).max(0.0), dark.mean]
            }
            (Some(line), None) => {
                let without_rounding = line.intercept - self.rounding;
                let offset = if without_rounding < 0.0 { -without_rounding / line.slope } else { 0.0 };
                [without_rounding.max(0.0).sqrt(), line.slope, offset]
            }
        }
    }
}

/// Gathers differences of frames.
#[derive(Clone, Debug, Default)]
pub struct PhotonTransfer {
    size: (usize, usize),
    before: Vec<f32>,
    now: Vec<f32>,
    samples: Vec<Sample>,
    n_pairs: usize,
    rounding: f64,
}

impl PhotonTransfer {
    /// Takes the next frame; whether more are of use. Colour frames and frames of another size are left out.
    pub fn push(&mut self, pixels: &Pixels) -> bool {
        let size = (pixels.width(), pixels.height());
        std::mem::swap(&mut self.before, &mut self.now);
        if !values(pixels, &mut self.now) {
            self.now.clear();
            return self.n_pairs < PAIRS;
        }
        let (full, step) = range(pixels);
        self.rounding = f64::from(step * step) / 12.0;
        if self.size == size && self.before.len() == self.now.len() && self.n_pairs < PAIRS {
            self.sample(full);
            self.n_pairs += 1;
        }
        self.size = size;
        self.n_pairs < PAIRS
    }

    /// Number of pairs of frames.
    pub fn n_pairs(&self) -> usize {
        self.n_pairs
    }

    fn sample(&mut self, full: f32) {
        let (w, h) = self.size;
        if w < 7 || h < 7 {
            return;
        }
        let stride = (((w - 6) * (h - 6)) / SAMPLES).max(1) | 1;
        // Pairs that share a frame look at other pixels.
        let first = if stride > 1 { self.n_pairs % stride } else { 0 };
        let mean = |i: usize| 0.5 * (self.before[i] + self.now[i]);
        // Means of five pixels beside each, so that the gradient is hardly the noise's.
        let side = |i: usize, along: usize| {
            mean(i) + mean(i + along) + mean(i - along) + mean(i + 2 * along) + mean(i - 2 * along)
        };
        let reach = 2 * w + 2;
        for i in (first..w * h).step_by(stride) {
            let (x, y) = (i % w, i / w);
            if x < 3 || y < 3 || x + 3 >= w || y + 3 >= h || i < reach {
                continue;
            }
            let (a, b) = (self.before[i], self.now[i]);
            if !(a.is_finite() && b.is_finite())
                || a.max(b) >= NEARLY_FULL * full
                || (full.is_finite() && a.min(b) <= 0.0)
            {
                continue;
            }
            let gradient = (side(i + 1, w) - side(i - 1, w)).abs() + (side(i + w, 1) - side(i - w, 1)).abs();
            if gradient.is_finite() {
                self.samples.push(Sample {
                    mean: 0.5 * (a + b),
                    gradient,
                    difference: b - a,
                    pair: self.n_pairs as u16,
                });
            }
        }
    }

    /// Variance against mean of what was gathered; `None` if that is too little.
    pub fn curve(&self) -> Option<TransferCurve> {
        let mut means: Vec<f32> = self.samples.iter().map(|s| s.mean).collect();
        if means.len() < LEAST_SAMPLES {
            return None;
        }
        means.sort_unstable_by(f32::total_cmp);
        let at = |q: f64| means[((means.len() - 1) as f64 * q) as usize];
        let (low, high) = (at(0.002), at(0.998));
        let width = ((high - low) / LEVELS as f32).max(f32::MIN_POSITIVE);
        let mut bins: Vec<Vec<Sample>> = vec![Vec::new(); LEVELS];
        for s in self.samples.iter().filter(|s| s.mean >= low && s.mean <= high) {
            bins[(((s.mean - low) / width) as usize).min(LEVELS - 1)].push(*s);
        }
        let levels: Vec<Level> = bins.iter_mut().filter_map(|bin| level(bin, self.rounding > 0.0)).collect();
        let n: f64 = levels.iter().map(|l| l.n as f64).sum();
        let variance = levels.iter().map(|l| l.n as f64 * l.variance).sum::<f64>() / n.max(1.0);
        let point = |l: &Level| [l.mean, l.variance, l.variance_sd.hypot(MODEL_ERROR * l.variance).max(1e-12)];
        let line = fit(&levels.iter().map(point).collect::<Vec<_>>());
        (n > 0.0).then_some(TransferCurve { levels, line, variance, rounding: self.rounding })
    }

    /// All that was gathered as one level: that of dark frames.
    pub fn single_level(&self) -> Option<Level> {
        level(&mut self.samples.clone(), self.rounding > 0.0)
    }
}

/// The variance of the samples of one level.
fn level(samples: &mut Vec<Sample>, is_whole: bool) -> Option<Level> {
    if samples.len() < LEAST_SAMPLES {
        return None;
    }
    let mut gradients: Vec<f32> = samples.iter().map(|s| s.gradient).collect();
    let middle = gradients.len() / 2;
    let (_, smooth, _) = gradients.select_nth_unstable_by(middle, f32::total_cmp);
    let smooth = *smooth;
    samples.retain(|s| s.gradient <= smooth);
    samples.sort_unstable_by_key(|s| s.pair);
    let mut differences: Vec<f64> = Vec::with_capacity(samples.len());
    let mut sum = 0.0;
    for of_pair in samples.chunk_by(|a, b| a.pair == b.pair).filter(|p| p.len() >= LEAST_OF_PAIR) {
        let mut d: Vec<f64> = of_pair.iter().map(|s| f64::from(s.difference)).collect();
        d.sort_unstable_by(f64::total_cmp);
        // Of whole numbers the median is whole; light that flickers by less than half a count is no matter.
        let median = 0.5 * (d[(d.len() - 1) / 2] + d[d.len() / 2]);
        differences.extend(d.iter().map(|v| v - median));
        sum += of_pair.iter().map(|s| f64::from(s.mean)).sum::<f64>();
    }
    let n = differences.len();
    if n < LEAST_SAMPLES / 2 {
        return None;
    }
    differences.iter_mut().for_each(|d| *d *= *d);
    differences.sort_unstable_by(f64::total_cmp);
    // A tenth may be anything.
    let nine_tenths = differences[n * 9 / 10].sqrt() / 1.645;
    let mut variance = nine_tenths.max(if is_whole { 0.5 } else { 0.0 }).powi(2);
    let mut kept = n;
    for _ in 0..6 {
        kept = differences.partition_point(|d| *d <= CUT * CUT * variance).max(1);
        variance = differences[..kept].iter().sum::<f64>() / kept as f64 / CUT_SQUARE;
        if is_whole {
            // The rounding of both frames at least.
            variance = variance.max(1.0 / 6.0);
        }
    }
    let variance = 0.5 * variance;
    Some(Level { mean: sum / n as f64, variance, variance_sd: variance * (2.0 / kept as f64).sqrt(), n: kept })
}

#[cfg(test)]
mod tests;
