//! Numbers that rows are smoothed and compared in: 16 bit whole numbers for pixels of 8 bits, single precision for all others.
//!
//! Both give the same bits for pixels of 8 bits: the binomial sums are whole sixteenths of a count up to 4080, eight times one of them is below
//! 2^15, and single precision holds them exactly as well. The short numbers go twice as many into a vector.
//! Symbols: a lane holds a smoothed pixel in units of [`Lane::COUNTS`]; contrasts are kept twice as large.

use fearless_simd::prelude::*;

/// Smoothed rows that are held: the power of two above twice the reach of the contrast's pairs, 3 px.
pub(super) const HELD: usize = 8;

/// The rows that a level is read through.
#[derive(Clone, Debug, Default)]
#[allow(unnameable_types)] // of a trait that is not implemented outside
pub struct Rows<L: Lane> {
    /// Smoothed rows, row y at y modulo their number.
    pub(super) smooth: [Vec<L>; HELD],
    /// Sums down the columns of three rows, one mirrored pixel at both sides.
    pub(super) columns: Vec<L>,
    /// Strength |v| of three rows, one pixel of 0 before them and zeros up to a whole word of bits after.
    pub(super) strong: [Vec<L>; 3],
    /// Contrast of the last two rows, up to a whole word of bits.
    pub(super) signed: [Vec<L>; 2],
    pub(super) sums: Vec<L::Sum>,
}

/// A number of a row.
#[allow(unnameable_types)] // of a trait that is not implemented outside
pub trait Lane: Copy + Default + PartialOrd + std::fmt::Debug + Send + 'static {
    /// What absolute values are added up in.
    type Sum: Copy + Default + std::fmt::Debug + Send;
    /// Unit of a smoothed pixel, counts.
    const COUNTS: f32;
    /// a + b; whole numbers wrap.
    fn add(self, b: Self) -> Self;
    /// a - b; whole numbers wrap.
    fn sub(self, b: Self) -> Self;
    /// n a, n small; whole numbers wrap.
    fn times(self, n: u8) -> Self;
    /// The absolute value.
    fn magnitude(self) -> Self;
    /// A smoothed pixel of the binomial sum of sixteen.
    fn sixteenth(self) -> Self;
    /// The value of the wrapped binomial sum of 256, counts.
    fn part_of_256(self) -> f32;
    /// The number itself.
    fn number(self) -> f32;
    /// The smallest lane that is at least `v`, not negative.
    fn at_least(v: f32) -> Self;
    /// Adds an absolute value.
    fn add_to(self, sum: &mut Self::Sum);
    /// A sum as a number; exact below 2^24.
    fn sum(sum: Self::Sum) -> f32;
    /// The rows of this kind.
    fn rows(rows: &mut (Rows<i16>, Rows<f32>)) -> &mut Rows<Self>;
    /// The row of this kind.
    fn row(rows: &mut (Vec<i16>, Vec<f32>)) -> &mut Vec<Self>;
    /// The extremes among 64 pixels, which of these are at least `least` strong, and which are bright; rows of strengths have one pixel of margin.
    fn extremes<S: Simd>(simd: S, strong: [&[Self]; 3], signed: &[Self], from: usize, least: Self) -> (u64, u64, u64);
}

macro_rules! extremes {
    ($lanes:ident) => {
        #[inline(always)]
        fn extremes<S: Simd>(
            simd: S,
            [above, here, below]: [&[Self]; 3],
            signed: &[Self],
            from: usize,
            least: Self,
        ) -> (u64, u64, u64) {
            let n = S::$lanes::LEN;
            let (least, zero) = (S::$lanes::splat(simd, least), S::$lanes::splat(simd, Self::default()));
            let (mut all, mut listed, mut bright) = (0, 0, 0);
            for k in (0..64).step_by(n) {
                let load = |row: &[Self], shift: usize| {
                    S::$lanes::from_slice(simd, &row[from + k + shift..from + k + shift + n])
                };
                let c = load(here, 1);
                // Strictly above what comes before it in raster order, not below what comes after.
                let before = load(above, 0).max(load(above, 1)).max(load(above, 2).max(load(here, 0)));
                let after = load(below, 0).max(load(below, 1)).max(load(below, 2).max(load(here, 2)));
                let extreme = c.simd_gt(before) & c.simd_ge(after);
                all |= extreme.to_bitmask() << k;
                listed |= c.simd_ge(least).to_bitmask() << k;
                bright |= S::$lanes::from_slice(simd, &signed[from + k..from + k + n]).simd_gt(zero).to_bitmask() << k;
            }
            (all, listed, bright)
        }
    };
}

impl Lane for i16 {
    type Sum = u32;
    const COUNTS: f32 = 1.0 / 16.0;
    extremes!(i16s);
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        self.wrapping_add(b)
    }
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        self.wrapping_sub(b)
    }
    #[inline(always)]
    fn times(self, n: u8) -> Self {
        self.wrapping_mul(Self::from(n))
    }
    #[inline(always)]
    fn magnitude(self) -> Self {
        self.wrapping_abs()
    }
    #[inline(always)]
    fn sixteenth(self) -> Self {
        self
    }
    #[inline(always)]
    fn part_of_256(self) -> f32 {
        f32::from(self as u16) * (1.0 / 256.0)
    }
    #[inline(always)]
    fn number(self) -> f32 {
        f32::from(self)
    }
    #[inline(always)]
    fn at_least(v: f32) -> Self {
        v.ceil() as Self
    }
    #[inline(always)]
    fn add_to(self, sum: &mut u32) {
        *sum += u32::from(self as u16);
    }
    #[inline(always)]
    fn sum(sum: u32) -> f32 {
        sum as f32
    }
    fn rows(rows: &mut (Rows<i16>, Rows<f32>)) -> &mut Rows<Self> {
        &mut rows.0
    }
    fn row(rows: &mut (Vec<i16>, Vec<f32>)) -> &mut Vec<Self> {
        &mut rows.0
    }
}

impl Lane for f32 {
    type Sum = f32;
    const COUNTS: f32 = 1.0;
    extremes!(f32s);
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        self + b
    }
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        self - b
    }
    #[inline(always)]
    fn times(self, n: u8) -> Self {
        self * Self::from(n)
    }
    #[inline(always)]
    fn magnitude(self) -> Self {
        self.abs()
    }
    #[inline(always)]
    fn sixteenth(self) -> Self {
        self * (1.0 / 16.0)
    }
    #[inline(always)]
    fn part_of_256(self) -> f32 {
        self * (1.0 / 256.0)
    }
    #[inline(always)]
    fn number(self) -> f32 {
        self
    }
    #[inline(always)]
    fn at_least(v: f32) -> Self {
        v
    }
    #[inline(always)]
    fn add_to(self, sum: &mut f32) {
        *sum += self;
    }
    #[inline(always)]
    fn sum(sum: f32) -> f32 {
        sum
    }
    fn rows(rows: &mut (Rows<i16>, Rows<f32>)) -> &mut Rows<Self> {
        &mut rows.1
    }
    fn row(rows: &mut (Vec<i16>, Vec<f32>)) -> &mut Vec<Self> {
        &mut rows.1
    }
}
