//! Shadows on the ground: pixels darkened by a factor that hardly changes nearby, so that the ground's texture stays.
//!
//! Source: J. C. S. Jacques, C. R. Jung, S. R. Musse, "Background Subtraction and Shadow Detection in Grayscale Video
//! Sequences", SIBGRAPI 2005: a shadow has v / m between a low limit and 1 and a small variance of v / m over a window.
//! Departure: the spread is measured against what the pixels' own deviation explains, so that it needs no level of its own.
//! Symbols: q = v / m' over a 3x3 window. Only moving pixels are looked at.

use super::model::BackgroundPixel;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Which darkened pixels are shadows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct ShadowConfig {
    /// Whether anything is; not where the targets themselves are dark and even, as animals on bright ground are.
    pub enabled: bool,
    /// Smallest ratio to the background, in (0, 1). Lower takes deeper shadows, and more dark targets, for shadow.
    pub darkest: f32,
    /// Largest ratio, in (`darkest`, 1].
    pub lightest: f32,
    /// Largest standard deviation of the ratio in the 3x3 window, above 0, beyond what noise explains. Larger forgives more
    /// texture and takes more targets for shadow.
    pub spread: f32,
}

impl Default for ShadowConfig {
    fn default() -> Self {
        Self { enabled: true, darkest: 0.5, lightest: 0.97, spread: 0.2 }
    }
}

/// Whether the pixel at `x` of the middle row is in shadow; `rows` are three rows of pixels, `means` the model's means.
pub(super) fn is_shadow<T: BackgroundPixel>(
    c: &ShadowConfig,
    rows: [&[T]; 3],
    means: [&[T::Level]; 3],
    x: usize,
    light: (f32, f32),
    deviation: f32,
) -> bool {
    let ratio = |row: &[T], mean: &[T::Level], x: usize| -> Option<f32> {
        let m = T::counts(*mean.get(x)?) * light.0 + light.1;
        (m > 0.0).then(|| row.get(x).map(|v| v.to_f64() as f32 / m))?
    };
    let Some(middle) = ratio(rows[1], means[1], x) else { return false };
    if !(c.darkest..=c.lightest).contains(&middle) {
        return false;
    }
    let (mut n, mut sum, mut sum2) = (0.0f32, 0.0f32, 0.0f32);
    for (row, mean) in rows.iter().zip(means) {
        for x in x.saturating_sub(1)..=x + 1 {
            if let Some(q) = ratio(row, mean, x) {
                n += 1.0;
                sum += q;
                sum2 += q * q;
            }
        }
    }
    let mean = sum / n;
    let m = T::counts(means[1].get(x).copied().unwrap_or_default()).max(1.0);
    // The noise of a pixel is about 1.25 mean absolute deviations.
    let noise = 1.25 * deviation / m;
    (c.darkest..=1.0).contains(&mean) && sum2 / n - mean * mean <= c.spread * c.spread + noise * noise
}
