//! What a Gaussian spot gives each column (or row) of pixels, with its derivatives: the axis of a pixel-integrated spot.
//!
//! E_i = ½ [erf(z_{i+1} / √2) - erf(z_i / √2)], z_i = (i - ½ - c) / s the left edge of pixel i. With φ the standard normal density
//! dE_i/dc = -(φ_{i+1} - φ_i) / s and dE_i/d ln s = -(z_{i+1} φ_{i+1} - z_i φ_i). A round or upright elliptic spot is the product of a column's and
//! a row's, so n + 1 error functions an axis are all that a window of n x n pixels needs.
//! Source: C. S. Smith et al., *Fast, single-molecule localization that achieves theoretically minimum uncertainty*, Nat. Methods 7, 373 (2010). The error
//! function: W. J. Cody, *Rational Chebyshev approximations for the error function*, Math. Comp. 23, 631 (1969), tables II and III; the
//! exponential is shared with φ. Beyond 6 it is ±1 to the last bit.
//! Symbols: c centre (px), s deviation (px). Limits: windows of at most [`SIDE`] pixels.

/// Most pixels of a window's side.
pub(super) const SIDE: usize = 21;

const NEAR_UP: [f64; 5] = [
    1.857_777_061_846_031_5e-1,
    3.161_123_743_870_565_6,
    1.138_641_541_510_501_6e2,
    3.774_852_376_853_02e2,
    3.209_377_589_138_469_5e3,
];
const NEAR_DOWN: [f64; 5] =
    [1.0, 2.360_129_095_234_412e1, 2.440_246_379_344_441_7e2, 1.282_616_526_077_372_3e3, 2.844_236_833_439_171e3];
const FAR_UP: [f64; 9] = [
    2.153_115_354_744_038_5e-8,
    5.641_884_969_886_7e-1,
    8.883_149_794_388_376,
    6.611_919_063_714_163e1,
    2.986_351_381_974_001e2,
    8.819_522_212_417_69e2,
    1.712_047_612_634_070_6e3,
    2.051_078_377_826_071_5e3,
    1.230_339_354_797_997_2e3,
];
const FAR_DOWN: [f64; 9] = [
    1.0,
    1.574_492_611_070_983_5e1,
    1.176_939_508_913_125e2,
    5.371_811_018_620_099e2,
    1.621_389_574_566_690_2e3,
    3.290_799_235_733_459_7e3,
    4.362_619_090_143_247e3,
    3.439_367_674_143_721_6e3,
    1.230_339_354_803_749_4e3,
];

/// A polynomial, the highest power first.
#[inline(always)]
fn polynomial<const N: usize>(c: &[f64; N], x: f64) -> f64 {
    c.iter().fold(0.0, |sum, c| sum * x + c)
}

/// erf(x) and exp(-x²).
#[inline]
fn erf_and_exp(x: f64) -> (f64, f64) {
    let a = x.abs();
    let e = (-x * x).exp();
    if a <= 0.46875 {
        return (x * polynomial(&NEAR_UP, x * x) / polynomial(&NEAR_DOWN, x * x), e);
    }
    if a > 6.0 {
        return (1f64.copysign(x), e);
    }
    ((1.0 - e * polynomial(&FAR_UP, a) / polynomial(&FAR_DOWN, a)).copysign(x), e)
}

/// The shares of the columns (or rows) of a window.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axis {
    /// Share of the spot's flux, no unit.
    pub(super) share: [f64; SIDE],
    /// Its derivative by the centre, 1/px.
    pub(super) by_centre: [f64; SIDE],
    /// Its derivative by the logarithm of the deviation.
    pub(super) by_width: [f64; SIDE],
}

impl Axis {
    /// The axis of `n` pixels, the first at 0, of a spot at `centre` (px) of deviation `sigma` (px).
    pub(super) fn of(n: usize, centre: f64, sigma: f64) -> Self {
        let mut axis = Self { share: [0.0; SIDE], by_centre: [0.0; SIDE], by_width: [0.0; SIDE] };
        let per_sigma = 1.0 / sigma;
        let edge = |i: usize| {
            let z = (i as f64 - 0.5 - centre) * per_sigma;
            let (erf, exp) = erf_and_exp(z * std::f64::consts::FRAC_1_SQRT_2);
            let density = exp * FRAC_1_SQRT_TAU;
            (0.5 * erf, density * per_sigma, z * density)
        };
        let mut left = edge(0);
        for i in 0..n.min(SIDE) {
            let right = edge(i + 1);
            axis.share[i] = right.0 - left.0;
            axis.by_centre[i] = left.1 - right.1;
            axis.by_width[i] = left.2 - right.2;
            left = right;
        }
        axis
    }
}

/// 1 / √(2π).
const FRAC_1_SQRT_TAU: f64 = 0.398_942_280_401_432_7;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_function_is_that_of_the_c_library() {
        for i in -9000..=9000 {
            let x = f64::from(i) * 1e-3;
            let (erf, exp) = erf_and_exp(x);
            assert!((erf - libm::erf(x)).abs() < 4e-16, "{x}: {erf} {}", libm::erf(x));
            assert_eq!(exp, (-x * x).exp());
        }
        assert_eq!(erf_and_exp(f64::INFINITY), (1.0, 0.0));
        assert!(erf_and_exp(f64::NAN).0.is_nan());
    }

    #[test]
    fn shares_are_integrals_of_the_gaussian_over_the_pixels() {
        // Simpson's rule with 2000 steps a pixel.
        let (c, s) = (3.3, 0.9);
        let axis = Axis::of(8, c, s);
        for i in 0..8 {
            let h = 1.0 / 2000.0;
            let density = |x: f64| (-0.5 * ((x - c) / s).powi(2)).exp() / (s * std::f64::consts::TAU.sqrt());
            let at = |k: usize| density(i as f64 - 0.5 + h * k as f64);
            let weight = |k: usize| if k == 0 || k == 2000 { 1.0 } else { 2.0 + 2.0 * (k % 2) as f64 };
            let integral = (0..=2000).map(|k| weight(k) * at(k)).sum::<f64>() * h / 3.0;
            assert!((axis.share[i] - integral).abs() < 1e-13, "{i}");
        }
    }

    #[test]
    fn derivatives_are_those_of_differences() {
        let (c, s, h) = (4.2, 1.3, 1e-5);
        let axis = Axis::of(10, c, s);
        let (a, b) = (Axis::of(10, c + h, s), Axis::of(10, c - h, s));
        let (wide, slim) = (Axis::of(10, c, s * h.exp()), Axis::of(10, c, s * (-h).exp()));
        for i in 0..10 {
            assert!((axis.by_centre[i] - (a.share[i] - b.share[i]) / (2.0 * h)).abs() < 1e-9);
            assert!((axis.by_width[i] - (wide.share[i] - slim.share[i]) / (2.0 * h)).abs() < 1e-9);
        }
    }
}
