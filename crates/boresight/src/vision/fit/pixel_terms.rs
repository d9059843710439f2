//! What one pixel adds to the deviance: Poisson light plus Gaussian read noise, or Gaussian noise alone.
//!
//! With the variance V(m) = r + g (m - o) of a pixel of mean m, the sum of read noise of variance r and of light is taken as a Poisson number of mean V(m) / g²
//! shifted by r / g² (F. Huang et al., *Video-rate nanoscopy using sCMOS camera-specific single-molecule localization algorithms*, Nat. Methods 10, 653
//! (2013)): mean and variance are right, and so is the score J (d - m) / V(m). Deviance up to a constant:
//! 2 / g² [V(m) - V₀ - V(d) ln(V(m) / V₀)], which holds for values d darker than dark too; V₀ is a variance near those of the window.
//! Where g² is small against r it is that of Gaussian noise, (d - m)² / r.

/// Shares of the gain below which the noise is the same for all light: the deviance would be lost in rounding.
const LEAST_GAIN: f64 = 1e-6;

/// Whether the growth of the variance with light counts.
pub(super) fn is_constant(gain: f64, variance: f64) -> bool {
    gain * gain <= LEAST_GAIN * LEAST_GAIN * variance
}

/// ln(q) of a positive number, to 2e-13 of 1.
#[inline(always)]
pub(super) fn ln(q: f64) -> f64 {
    const MANTISSA: u64 = (1 << 52) - 1;
    let bits = q.to_bits();
    // 1/√2 <= f < √2, so that the series below is short.
    let shift = (bits & MANTISSA > 0x6_A09E_667F_3BCD) as u64;
    let exponent = (bits >> 52) as i64 - 1023 + shift as i64;
    let f = f64::from_bits((bits & MANTISSA) | ((1023 - shift) << 52));
    let s = (f - 1.0) / (f + 1.0);
    let z = s * s;
    let series = 1.0
        + z * (1.0 / 3.0
            + z * (0.2 + z * (1.0 / 7.0 + z * (1.0 / 9.0 + z * (1.0 / 11.0 + z * (1.0 / 13.0 + z / 15.0))))));
    exponent as f64 * std::f64::consts::LN_2 + 2.0 * s * series
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_logarithm_is_that_of_the_standard_library() {
        let mut q = 1e-12;
        while q < 1e12 {
            assert!((ln(q) - f64::ln(q)).abs() < 4e-13, "{q}: {} {}", ln(q), f64::ln(q));
            q *= 1.000_37;
        }
        for q in [1.0, 1.0 + 1e-9, 1.0 - 1e-9] {
            assert!((ln(q) - f64::ln(q)).abs() < 1e-16, "{q}");
        }
    }
}
