//! What the spatial filters need to know of a pixel type: u8, u16, f32.
//!
//! A filter sorts by *keys*: integers in the order of the values, so that a network of minima and maxima needs no care
//! for NaN. For u8 and u16 the key is the value; for f32 it is the total order of IEEE 754-2008 (5.10) as an unsigned
//! integer: -NaN < -inf < ... < -0 < +0 < ... < +inf < +NaN.

use fearless_simd::{Simd, SimdInt, SimdIntElement};

/// Integers that the median sorts.
pub trait Key: SimdIntElement + Ord + Default + std::fmt::Debug + Send + Sync + 'static {
    /// As many keys as a register holds.
    type Lanes<S: Simd>: SimdInt<S, Element = Self>;
    /// Number of bits.
    const N_BITS: u32;
    /// The key as a histogram level.
    fn level(self) -> usize;
    /// The key of a histogram level.
    fn from_level(level: usize) -> Self;
}

/// A grey pixel type that the spatial filters work on.
pub trait SpatialPixel: Copy + Default + PartialEq + std::fmt::Debug + Send + Sync + 'static {
    /// The integer that stands for the value when sorting.
    type Key: Key;
    /// Whether sums of these pixels are exact in u32 (integer types).
    const INTEGER: bool;
    /// The key of this value.
    fn key(self) -> Self::Key;
    /// The value of a key.
    fn from_key(key: Self::Key) -> Self;
    /// The value as f64, exactly.
    fn to_f64(self) -> f64;
    /// The value as f32 (exact for all three types).
    fn to_f32(self) -> f32;
    /// The value as u32 for integer types (0 for f32, which never asks).
    fn to_u32(self) -> u32;
    /// The nearest value of this type: integers round half away from zero and saturate (NaN gives 0), f32 rounds to even.
    fn from_f64(v: f64) -> Self;
    /// A mean that is known to be in range (f32 never asks).
    fn from_u16_exact(v: u16) -> Self;
    /// As [`SpatialPixel::from_f64`], from single precision.
    fn from_f32(v: f32) -> Self;
    /// Writes the keys of a row.
    fn keys(row: &[Self], out: &mut [Self::Key]);
    /// The row itself, where values are their own keys.
    fn as_keys(row: &[Self]) -> Option<&[Self::Key]>;
    /// Lets `write` fill `out` with keys, through `work` where values are not their own keys.
    fn fill_keys(out: &mut [Self], work: &mut [Self::Key], write: impl FnOnce(&mut [Self::Key]));
    /// Writes a row of values as single precision.
    fn to_f32_row(row: &[Self], out: &mut [f32]);
}

macro_rules! key {
    ($t:ty, $lanes:ident) => {
        impl Key for $t {
            type Lanes<S: Simd> = S::$lanes;
            const N_BITS: u32 = <$t>::BITS;
            #[inline(always)]
            fn level(self) -> usize {
                self as usize
            }
            #[inline(always)]
            fn from_level(level: usize) -> Self {
                level as $t
            }
        }
    };
}
key!(u8, u8s);
key!(u16, u16s);
key!(u32, u32s);

macro_rules! integer_pixel {
    ($t:ty) => {
        impl SpatialPixel for $t {
            type Key = $t;
            const INTEGER: bool = true;
            #[inline(always)]
            fn key(self) -> $t {
                self
            }
            #[inline(always)]
            fn from_key(key: $t) -> Self {
                key
            }
            #[inline(always)]
            fn to_f64(self) -> f64 {
                f64::from(self)
            }
            #[inline(always)]
            fn to_f32(self) -> f32 {
                f32::from(self)
            }
            #[inline(always)]
            fn to_u32(self) -> u32 {
                u32::from(self)
            }
            #[inline(always)]
            fn from_f64(v: f64) -> Self {
                // Saturating cast; adding 1/2 first rounds half up, and values below 0 saturate anyway.
                (v + 0.5) as $t
            }
            #[inline(always)]
            fn from_u16_exact(v: u16) -> Self {
                v as $t
            }
            #[inline(always)]
            fn from_f32(v: f32) -> Self {
                (v + 0.5) as $t
            }
            fn keys(row: &[Self], out: &mut [$t]) {
                out.copy_from_slice(row);
            }
            fn as_keys(row: &[Self]) -> Option<&[$t]> {
                Some(row)
            }
            fn fill_keys(out: &mut [Self], _: &mut [$t], write: impl FnOnce(&mut [$t])) {
                write(out);
            }
            fn to_f32_row(row: &[Self], out: &mut [f32]) {
                for (o, &v) in out.iter_mut().zip(row) {
                    *o = f32::from(v);
                }
            }
        }
    };
}
integer_pixel!(u8);
integer_pixel!(u16);

#[inline(always)]
fn ordered(v: f32) -> u32 {
    let bits = v.to_bits();
    // Negative: all bits flipped; positive: only the sign.
    bits ^ (((bits as i32) >> 31) as u32 | 0x8000_0000)
}

widest! {
    fn ordered_row(row: &[f32], out: &mut [u32]) {
        for (o, &v) in out.iter_mut().zip(row) {
            *o = ordered(v);
        }
    }
}

impl SpatialPixel for f32 {
    type Key = u32;
    const INTEGER: bool = false;
    #[inline(always)]
    fn key(self) -> u32 {
        ordered(self)
    }
    #[inline(always)]
    fn from_key(key: u32) -> Self {
        f32::from_bits(key ^ ((!((key as i32) >> 31)) as u32 | 0x8000_0000))
    }
    #[inline(always)]
    fn to_f64(self) -> f64 {
        f64::from(self)
    }
    #[inline(always)]
    fn to_f32(self) -> f32 {
        self
    }
    #[inline(always)]
    fn to_u32(self) -> u32 {
        0
    }
    #[inline(always)]
    fn from_f64(v: f64) -> Self {
        v as f32
    }
    #[inline(always)]
    fn from_u16_exact(v: u16) -> Self {
        f32::from(v)
    }
    #[inline(always)]
    fn from_f32(v: f32) -> Self {
        v
    }
    fn keys(row: &[Self], out: &mut [u32]) {
        ordered_row(row, out);
    }
    fn as_keys(_: &[Self]) -> Option<&[u32]> {
        None
    }
    fn fill_keys(out: &mut [Self], work: &mut [u32], write: impl FnOnce(&mut [u32])) {
        write(work);
        for (o, &k) in out.iter_mut().zip(&*work) {
            *o = Self::from_key(k);
        }
    }
    fn to_f32_row(row: &[Self], out: &mut [f32]) {
        out.copy_from_slice(row);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_keep_the_total_order_of_floats_and_give_the_value_back() {
        let nan = f32::from_bits(0x7fc0_0001);
        let values = [-nan, f32::NEG_INFINITY, -1.5, -1e-40, -0.0, 0.0, 1e-40, 2.0, f32::INFINITY, nan];
        for pair in values.windows(2) {
            assert!(pair[0].key() < pair[1].key(), "{pair:?}");
        }
        for v in values {
            assert_eq!(f32::from_key(v.key()).to_bits(), v.to_bits());
        }
    }

    #[test]
    fn integers_round_half_up_and_saturate() {
        assert_eq!(u8::from_f64(2.5), 3);
        assert_eq!(u8::from_f64(-7.0), 0);
        assert_eq!(u8::from_f64(1e9), 255);
        assert_eq!(u16::from_f64(f64::NAN), 0);
        assert_eq!(u16::from_f32(65_534.4), 65_534);
    }
}
