//! Likelihood-ratio detector: box sums of the log-likelihood ratio of quantised pixel levels.
//!
//! Source: `docs/theory/likelihood-ratio.md`. ℓ(g) = ln P_t(g) - ln P_b(g) with P(g) = Φ((g+½-μ)/σ) - Φ((g-½-μ)/σ), the
//! tails lumped into the first and last level; score(position) = Σ ℓ over the target's window wholly inside the image;
//! posterior = softmax(score). It uses the target's variance as well as its mean, which a band cannot. Limits: a
//! rectangular target on the pixel grid, pixels independent; probabilities below 2e-308 count as that, so that no score
//! is infinite.
//! Symbols: μ, σ mean and standard deviation (counts); g level (counts). Cost: 4 additions a pixel.

use super::pixel::Pixel;
use super::probability::{Level, interval};
use crate::Image;
use nalgebra::Vector2;

/// Log-likelihood ratio of each level 0.. .
#[derive(Clone, Debug, PartialEq)]
pub struct LlrTable(Vec<f64>);

/// ln of the probability of each level.
fn log_probabilities(level: Level, n_levels: usize) -> Vec<f64> {
    (0..n_levels)
        .map(|g| {
            let g64 = g as f64;
            let a = if g == 0 { f64::NEG_INFINITY } else { (g64 - 0.5 - level.mean) / level.sd };
            let b = if g + 1 == n_levels { f64::INFINITY } else { (g64 + 0.5 - level.mean) / level.sd };
            interval(a, b).max(f64::MIN_POSITIVE).ln()
        })
        .collect()
}

impl LlrTable {
    /// Builds the table for `n_levels` levels (256 for 8-bit pixels); both deviations must be above 0.
    ///
    /// ```
    /// use boresight::vision::{LlrTable, probability::Level};
    /// let table = LlrTable::new(Level { mean: 100.0, sd: 10.0 }, Level { mean: 50.0, sd: 50.0 }, 256);
    /// for (g, llr) in [(0, -50.901808326902), (50, -10.880570418522), (90, 1.4294438083709), (100, 2.109021315373),
    ///                  (110, 1.8294304753078), (150, -8.8806370834111)] {
    ///     assert!((table.at(g) - llr).abs() < 1e-10, "{g}: {}", table.at(g));
    /// }
    /// ```
    pub fn new(target: Level, background: Level, n_levels: usize) -> Self {
        let t = log_probabilities(target, n_levels);
        let b = log_probabilities(background, n_levels);
        Self(t.iter().zip(&b).map(|(t, b)| t - b).collect())
    }

    /// The log-likelihood ratio of level `g`; levels past the last count as the last.
    pub fn at(&self, g: usize) -> f64 {
        self.0[g.min(self.0.len() - 1)]
    }
}

/// Box sums of the log-likelihood ratio; position (i, j) is the window whose top-left pixel is column i, row j.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ScoreImage {
    /// The scores: (width - w + 1) x (height - h + 1), empty if the window does not fit.
    pub scores: Image<f64>,
    size: (usize, usize),
    columns: Vec<f64>,
}

impl ScoreImage {
    /// Fills the scores of an image for a target of `size` (width, height), px, each at least 1.
    pub fn fill<T: Pixel>(&mut self, image: &Image<T>, table: &LlrTable, size: (usize, usize)) {
        let (w, h) = (size.0.max(1), size.1.max(1));
        self.size = (w, h);
        if image.width() < w || image.height() < h {
            self.scores.reset(0, 0, 0.0);
            return;
        }
        self.scores.reset(image.width() - w + 1, image.height() - h + 1, 0.0);
        let level = |p: &T| table.at(p.value().round().max(0.0) as usize);
        for j in 0..self.scores.height() {
            // Column sums anew for each row: h additions, but no rounding is carried down the image.
            self.columns.clear();
            self.columns.resize(image.width(), 0.0);
            for y in j..j + h {
                for (sum, p) in self.columns.iter_mut().zip(image.row(y)) {
                    *sum += level(p);
                }
            }
            for (score, window) in self.scores.row_mut(j).iter_mut().zip(self.columns.windows(w)) {
                *score = window.iter().sum();
            }
        }
    }

    /// Centre of the window at position (i, j), px.
    pub fn centre(&self, i: usize, j: usize) -> Vector2<f64> {
        Vector2::new(i as f64 + (self.size.0 as f64 - 1.0) / 2.0, j as f64 + (self.size.1 as f64 - 1.0) / 2.0)
    }

    /// The most likely window centre, px, and its score; the first in raster order of equals.
    pub fn best(&self) -> Option<(Vector2<f64>, f64)> {
        let (mut best, mut at) = (f64::NEG_INFINITY, None);
        for (k, &s) in self.scores.as_slice().iter().enumerate() {
            if s > best {
                (best, at) = (s, Some(k));
            }
        }
        at.map(|k| (self.centre(k % self.scores.width(), k / self.scores.width()), best))
    }

    /// Mean of the window centre over the posterior softmax(score), px.
    pub fn posterior_mean(&self) -> Option<Vector2<f64>> {
        let (_, best) = self.best()?;
        let (mut total, mut mean) = (0.0, Vector2::zeros());
        for (k, &s) in self.scores.as_slice().iter().enumerate() {
            let p = (s - best).exp();
            total += p;
            mean += self.centre(k % self.scores.width(), k / self.scores.width()) * p;
        }
        Some(mean / total)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_window_that_does_not_fit_has_no_scores() {
        let table = LlrTable::new(Level { mean: 100.0, sd: 10.0 }, Level { mean: 50.0, sd: 50.0 }, 256);
        let mut scores = ScoreImage::default();
        scores.fill(&Image::filled(4, 4, 9u8), &table, (5, 1));
        assert!(scores.best().is_none() && scores.posterior_mean().is_none());
        scores.fill(&Image::filled(4, 4, 9u8), &table, (4, 4));
        assert_eq!(scores.best().unwrap().0, Vector2::new(1.5, 1.5));
    }

    #[test]
    fn impossible_levels_give_finite_scores() {
        let table = LlrTable::new(Level { mean: 100.0, sd: 0.1 }, Level { mean: 200.0, sd: 0.1 }, 256);
        assert!((0..256).all(|g| table.at(g).is_finite()));
    }
}
