//! What is known of a sensor's noise: the variance of a pixel of a given mean.

/// Noise of a pixel: variance = `read_variance` + `gain` (mean - `offset`), counts².
///
/// With a gain of 0 it is the same for all, and a fit by maximum likelihood is one by least squares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorNoise {
    /// Variance without light, counts².
    pub read_variance: f64,
    /// Counts for each electron (or photon), counts.
    pub gain: f64,
    /// Value without light, counts.
    pub offset: f64,
}

impl SensorNoise {
    /// The same noise for all pixels, whatever their light.
    pub fn constant(variance: f64) -> Self {
        Self { read_variance: variance, gain: 0.0, offset: 0.0 }
    }

    /// Variance of a pixel of this mean whose own variance without light is `read_variance`, counts²; above 0.
    #[inline(always)]
    pub(super) fn variance(gain: f64, offset: f64, read_variance: f64, mean: f64) -> f64 {
        // A hundredth of an electron: what is darker than dark has no less noise than none.
        (read_variance + gain * (mean - offset)).max(read_variance.max(0.01 * gain * gain)).max(f64::MIN_POSITIVE)
    }

    /// Whether the numbers can be those of a sensor.
    pub fn is_possible(&self) -> bool {
        let SensorNoise { read_variance, gain, offset } = *self;
        read_variance >= 0.0 && gain >= 0.0 && read_variance + gain > 0.0 && (read_variance + gain + offset).is_finite()
    }
}
