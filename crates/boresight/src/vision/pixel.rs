//! The pixel types that a detector takes: u8, u16 and f32, in the type the file holds.

use super::background::BackgroundPixel;
use super::cfar::lane::Lane;
use super::threshold::band;

/// Sums over the pixels of a run.
#[derive(Clone, Copy, Debug)]
#[allow(unnameable_types)] // of a trait that is not implemented outside
pub struct RunSums {
    /// Σ I.
    pub sum: f64,
    /// Σ I i, i counted from the first pixel of the run.
    pub sum_i: f64,
    /// Smallest value.
    pub min: f32,
    /// Largest value.
    pub max: f32,
}

/// A grey pixel.
pub trait Pixel: BackgroundPixel + PartialOrd {
    /// Distance between neighbouring values, counts; 0 for a float.
    const STEP: f32;
    /// What small binomial sums of these pixels are held in.
    type Lane: Lane;
    /// The pixel in such a sum.
    fn lane(self) -> Self::Lane;
    /// The pixels with their left neighbour's value where they have none (NaN, infinite), in `copy` where they can.
    fn mended<'a>(pixels: &'a [Self], copy: &'a mut Vec<f32>) -> &'a [Self];
    /// The value, counts.
    fn value(self) -> f64;
    /// The value as a place in a table of all values; 0 for a float.
    fn index(self) -> usize;
    /// The value as f32; exact for every type here.
    fn value_f32(self) -> f32;
    /// Writes 1 into `states` for every `row[x] >= level[x]` (`above`) or `row[x] <= level[x]`, else 0; NaN gives 0.
    fn level_states(row: &[Self], level: &[f32], above: bool, states: &mut [u8]);
    /// Sums over the pixels of a run.
    fn run_sums(run: &[Self]) -> RunSums;
    /// The smallest and largest pixel inside the real band [`low`, `high`], or `None` if no pixel value lies in it.
    fn band(low: f64, high: f64) -> Option<(Self, Self)>;
    /// Writes bit `x` of `bits` for every `low <= row[x] <= high`, and 0 past the end; NaN is never set.
    fn band_bits(row: &[Self], low: Self, high: Self, bits: &mut [u64]);
}

macro_rules! integer_pixel {
    ($t:ty, $lane:ty, $band_bits:ident, $level_states:ident) => {
        impl Pixel for $t {
            type Lane = $lane;
            #[inline(always)]
            fn lane(self) -> $lane {
                self.into()
            }
            fn mended<'a>(pixels: &'a [Self], _: &'a mut Vec<f32>) -> &'a [Self] {
                pixels
            }
            fn band_bits(row: &[Self], low: Self, high: Self, bits: &mut [u64]) {
                band::$band_bits(row, low, high, bits);
            }
            const STEP: f32 = 1.0;
            fn level_states(row: &[Self], level: &[f32], above: bool, states: &mut [u8]) {
                band::$level_states(row, level, above, states);
            }
            #[inline(always)]
            fn run_sums(run: &[Self]) -> RunSums {
                if let [only] = run {
                    let v = f32::from(*only);
                    return RunSums { sum: f64::from(*only), sum_i: 0.0, min: v, max: v };
                }
                let (mut sum, mut sum_i, mut min, mut max) = (0u64, 0u64, Self::MAX, 0);
                for (i, &v) in run.iter().enumerate() {
                    sum += u64::from(v);
                    sum_i += u64::from(v) * i as u64;
                    min = min.min(v);
                    max = max.max(v);
                }
                RunSums { sum: sum as f64, sum_i: sum_i as f64, min: f32::from(min), max: f32::from(max) }
            }
            #[inline]
            fn value(self) -> f64 {
                f64::from(self)
            }
            #[inline]
            fn index(self) -> usize {
                usize::from(self)
            }
            #[inline]
            fn value_f32(self) -> f32 {
                f32::from(self)
            }
            fn band(low: f64, high: f64) -> Option<(Self, Self)> {
                let (l, h) = (low.ceil().max(0.0), high.floor().min(f64::from(Self::MAX)));
                // Both are whole and inside the type's range here, so the casts are exact; NaN fails the comparison.
                (low <= high && l <= h).then_some((l as Self, h as Self))
            }
        }
    };
}
integer_pixel!(u8, i16, band_bits_u8, level_states_u8);
integer_pixel!(u16, f32, band_bits_u16, level_states_u16);

impl Pixel for f32 {
    type Lane = f32;
    #[inline(always)]
    fn lane(self) -> f32 {
        self
    }
    fn mended<'a>(pixels: &'a [Self], copy: &'a mut Vec<f32>) -> &'a [Self] {
        copy.clear();
        let mut last = 0.0;
        copy.extend(pixels.iter().map(|v| {
            if v.is_finite() {
                last = *v;
            }
            last
        }));
        copy
    }
    fn band_bits(row: &[Self], low: Self, high: Self, bits: &mut [u64]) {
        band::band_bits_f32(row, low, high, bits);
    }
    const STEP: f32 = 0.0;
    fn level_states(row: &[Self], level: &[f32], above: bool, states: &mut [u8]) {
        band::level_states_f32(row, level, above, states);
    }
    #[inline(always)]
    fn run_sums(run: &[Self]) -> RunSums {
        let mut sums = RunSums { sum: 0.0, sum_i: 0.0, min: Self::INFINITY, max: Self::NEG_INFINITY };
        for (i, &v) in run.iter().enumerate() {
            sums.sum += f64::from(v);
            sums.sum_i += f64::from(v) * i as f64;
            sums.min = sums.min.min(v);
            sums.max = sums.max.max(v);
        }
        sums
    }
    #[inline]
    fn value(self) -> f64 {
        f64::from(self)
    }
    #[inline]
    fn index(self) -> usize {
        0
    }
    #[inline]
    fn value_f32(self) -> f32 {
        self
    }
    fn band(low: f64, high: f64) -> Option<(Self, Self)> {
        let (mut l, mut h) = (low as Self, high as Self);
        if f64::from(l) < low {
            l = l.next_up();
        }
        if f64::from(h) > high {
            h = h.next_down();
        }
        (l <= h).then_some((l, h))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_without_a_value_take_their_neighbours() {
        let copy = &mut Vec::new();
        assert_eq!(f32::mended(&[f32::NAN, 3.0, f32::INFINITY, f32::NAN, 4.0], copy), [0.0, 3.0, 3.0, 3.0, 4.0]);
        assert_eq!(u8::mended(&[7, 255], copy), [7, 255]);
    }

    #[test]
    fn a_real_band_becomes_the_pixels_inside_it() {
        assert_eq!(u8::band(89.5, 110.2), Some((90, 110)));
        assert_eq!(u8::band(-5.0, 1e9), Some((0, 255)));
        assert_eq!(u8::band(90.2, 90.8), None);
        assert_eq!(u8::band(256.0, 300.0), None);
        assert_eq!(u16::band(0.0, f64::INFINITY), Some((0, 65535)));
        assert_eq!(u8::band(f64::NAN, 3.0), None);
        let (l, h) = f32::band(0.1, 0.3).unwrap();
        assert!(f64::from(l) >= 0.1 && f64::from(l.next_down()) < 0.1);
        assert!(f64::from(h) <= 0.3 && f64::from(h.next_up()) > 0.3);
    }
}
