//! The background of one pixel: a running mean and a running mean absolute deviation, in fixed point for u8, in f32 else.
//!
//! Mean m and deviation d follow the pixel v with the rate a = 1 - exp(-dt / tau) of real time. u8: both are i16 with 7
//! fractional bits (1/128 count), so that a row of them is half the memory of floats and a register holds twice as many;
//! rates are 15-bit fractions. A rate below 1/32 would be lost in rounding: the caller updates a row less often instead,
//! with the time that has really passed.
//! Symbols: m' = gain * m + offset, the mean under the light of this frame; r = v - m'.

use super::super::ranks::Ranked;
use super::super::spatial::SpatialPixel;

/// What the comparison of one frame with the model needs.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(unnameable_types)] // of a trait that is not implemented outside
pub struct Coefficients {
    /// Light of this frame against the model's: factor.
    pub gain: f32,
    /// Light of this frame against the model's: counts.
    pub offset: f32,
    /// Deviations that make a pixel moving.
    pub factor: f32,
    /// Smallest deviation taken, counts.
    pub floor: f32,
}

/// Rates of one update, each in [0, 1].
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(unnameable_types)] // of a trait that is not implemented outside
pub struct Rates {
    /// Of pixels that are background.
    pub still: f32,
    /// Of pixels that move.
    pub moving: f32,
    /// Of pixels that look like the background beside them.
    pub ghost: f32,
    /// Whether a still pixel's distance counts only up to three deviations: at the start, when targets are not told apart.
    pub cautious: bool,
}

/// A pixel type with its model.
pub trait BackgroundPixel: SpatialPixel + Ranked {
    /// Mean and deviation.
    type Level: Copy + Default + Send + std::fmt::Debug + 'static;
    /// Mean absolute deviation that rounding alone gives, counts.
    const NOISE_FLOOR: f32;
    /// Coefficients in the model's own numbers.
    type Terms: Copy;
    /// Rates in the model's own numbers.
    type Steps: Copy;
    /// Converts the coefficients, once a frame.
    fn terms(c: &Coefficients) -> Self::Terms;
    /// Converts the rates, once a row.
    fn steps(r: &Rates) -> Self::Steps;
    /// The level of a value in counts.
    fn level(counts: f32) -> Self::Level;
    /// The value of a level, counts.
    fn counts(level: Self::Level) -> f32;
    /// Whether the pixel is farther from the model than `factor` deviations.
    fn moves(self, mean: Self::Level, deviation: Self::Level, t: &Self::Terms) -> bool;
    /// The model after this pixel; `state` is `STILL`, `MOVING` or `GHOST`.
    fn adapt(
        self,
        mean: Self::Level,
        deviation: Self::Level,
        state: u8,
        t: &Self::Terms,
        s: &Self::Steps,
    ) -> (Self::Level, Self::Level);
}

/// State of a pixel: background.
pub const STILL: u8 = 0;
/// State of a pixel: not background.
pub const MOVING: u8 = 1;
/// State of a pixel: not its own background, but that beside it.
pub const GHOST: u8 = 2;

/// Coefficients of the fixed-point model.
#[derive(Clone, Copy, Debug)]
#[allow(unnameable_types)] // of a trait that is not implemented outside
pub struct FixedTerms {
    /// gain in 2¹⁴ths.
    gain: i16,
    offset: i16,
    /// factor in 2⁸ths.
    factor: i16,
    floor: i16,
}

/// Rates in 2¹⁵ths.
#[derive(Clone, Copy, Debug)]
#[allow(unnameable_types)] // of a trait that is not implemented outside
pub struct FixedSteps {
    still: i16,
    moving: i16,
    ghost: i16,
    cautious: bool,
}

/// Rounded product of a level and a 15-bit fraction.
#[inline(always)]
fn share(level: i16, rate: i16) -> i16 {
    ((i32::from(level) * i32::from(rate) + (1 << 14)) >> 15) as i16
}

#[inline(always)]
fn lit(mean: i16, t: &FixedTerms) -> i16 {
    let m = (i32::from(mean) * i32::from(t.gain)) >> 14;
    // Levels lie in 0..=32640; the light may carry them out.
    (m + i32::from(t.offset)).clamp(0, 32_640) as i16
}

impl BackgroundPixel for u8 {
    type Level = i16;
    const NOISE_FLOOR: f32 = 0.5;
    type Terms = FixedTerms;
    type Steps = FixedSteps;

    fn terms(c: &Coefficients) -> FixedTerms {
        FixedTerms {
            gain: (c.gain * 16_384.0).round() as i16,
            offset: (c.offset * 128.0).round() as i16,
            factor: (c.factor * 256.0).round() as i16,
            floor: (c.floor * 128.0).round() as i16,
        }
    }
    fn steps(r: &Rates) -> FixedSteps {
        let fixed = |rate: f32| (rate * 32_768.0).round() as i16;
        FixedSteps { still: fixed(r.still), moving: fixed(r.moving), ghost: fixed(r.ghost), cautious: r.cautious }
    }
    fn level(counts: f32) -> i16 {
        (counts * 128.0).round() as i16
    }
    fn counts(level: i16) -> f32 {
        f32::from(level) / 128.0
    }
    #[inline(always)]
    fn moves(self, mean: i16, deviation: i16, t: &FixedTerms) -> bool {
        let r = (i16::from(self) << 7) - lit(mean, t);
        let limit = (i32::from(deviation.max(t.floor)) * i32::from(t.factor)) >> 8;
        i32::from(r.abs()) > limit
    }
    #[inline(always)]
    fn adapt(self, mean: i16, deviation: i16, state: u8, t: &FixedTerms, s: &FixedSteps) -> (i16, i16) {
        let v = i16::from(self) << 7;
        let lit = lit(mean, t);
        let r = (v - lit).abs();
        let still = state == STILL;
        // A covered pixel still follows the light.
        let goal = if still { v } else { lit };
        let mean = mean + share(goal - mean, s.still);
        let rate = if state == GHOST { s.ghost } else { s.moving };
        let rate = if still { 0 } else { rate };
        let mean = mean + share(v - mean, rate);
        // What moves is a target, not noise: it may widen the deviation only slowly (flags, leaves, water).
        let r = if still & !s.cautious { r } else { r.min(deviation.max(t.floor).saturating_mul(3)) };
        let rate = if still { s.still } else { s.moving };
        (mean, deviation + share(r - deviation, rate))
    }
}

macro_rules! float_pixel {
    ($t:ty, $floor:expr) => {
        impl BackgroundPixel for $t {
            type Level = f32;
            const NOISE_FLOOR: f32 = $floor;
            type Terms = Coefficients;
            type Steps = Rates;

            fn terms(c: &Coefficients) -> Coefficients {
                *c
            }
            fn steps(r: &Rates) -> Rates {
                *r
            }
            fn level(counts: f32) -> f32 {
                counts
            }
            fn counts(level: f32) -> f32 {
                level
            }
            #[inline(always)]
            fn moves(self, mean: f32, deviation: f32, t: &Coefficients) -> bool {
                let r = self.to_f32() - (mean * t.gain + t.offset);
                // Written so that NaN pixels do not move.
                r.abs() > deviation.max(t.floor) * t.factor
            }
            #[inline(always)]
            fn adapt(self, mean: f32, deviation: f32, state: u8, t: &Coefficients, s: &Rates) -> (f32, f32) {
                let lit = mean * t.gain + t.offset;
                let v = self.to_f32();
                // A NaN or infinite pixel leaves the model as it is.
                let v = if v.is_finite() { v } else { lit };
                let still = state == STILL;
                let goal = if still { v } else { lit };
                let m = mean + (goal - mean) * s.still;
                let rate = if state == GHOST { s.ghost } else { s.moving };
                let rate = if still { 0.0 } else { rate };
                let m = m + (v - m) * rate;
                let r = (v - lit).abs();
                let r = if still & !s.cautious { r } else { r.min(3.0 * deviation.max(t.floor)) };
                let rate = if still { s.still } else { s.moving };
                (m, deviation + (r - deviation) * rate)
            }
        }
    };
}
float_pixel!(u16, 0.5);
float_pixel!(f32, 0.0);

#[cfg(test)]
mod tests {
    use super::*;

    const LIGHT: Coefficients = Coefficients { gain: 1.0, offset: 0.0, factor: 4.0, floor: 1.0 };

    #[test]
    fn a_still_pixel_reaches_its_value_and_its_deviation() {
        fn settle<T: BackgroundPixel>(a: T, b: T) -> (f32, f32) {
            let (t, s) = (T::terms(&LIGHT), T::steps(&Rates { still: 0.05, moving: 0.0, ghost: 0.0, cautious: false }));
            let (mut m, mut d) = (T::level(80.0), T::level(10.0));
            for i in 0..2000 {
                (m, d) = (if i % 2 == 0 { a } else { b }).adapt(m, d, STILL, &t, &s);
            }
            (T::counts(m), T::counts(d))
        }
        for (m, d) in [settle(98u8, 102), settle(98u16, 102), settle(98f32, 102.0)] {
            // The pixel alternates by 2 counts about 100; 1/10 count is the fixed point's dead zone at this rate.
            assert!((m - 100.0).abs() < 0.2 && (d - 2.0).abs() < 0.2, "{m} {d}");
        }
    }

    #[test]
    fn the_light_is_taken_off_before_a_pixel_is_judged() {
        let c = Coefficients { gain: 1.2, offset: -5.0, ..LIGHT };
        assert!(!115u8.moves(u8::level(100.0), u8::level(1.0), &u8::terms(&c)));
        assert!(120u8.moves(u8::level(100.0), u8::level(1.0), &u8::terms(&c)));
        assert!(120u8.moves(u8::level(100.0), u8::level(1.0), &u8::terms(&LIGHT)));
        assert!(!115f32.moves(100.0, 1.0, &c));
        assert!(!f32::NAN.moves(100.0, 1.0, &c));
    }
}
