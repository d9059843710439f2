//! Likelihood ratios of a target of each strength against noise, so that noise alone has the mean 1.
//!
//! How: a target of the strength a (deviations) makes z ~ N(a, 1) where noise makes N(0, 1): ln l = a z − a²/2, at most [`Levels::most`], so that no frame alone
//! decides; but what a target of the brighter strength is expected to show is not cut. Two strengths, the least looked for and twice that: one between loses at most 9 % of its information. Each ratio is
//! divided by its mean over the negative frames so far (l of −z: no target is in them, noise and what is left of the background are), at least that of white noise (light that rises all over leaves the
//! negative nothing to say): under that null the ratio has the mean 1,
//! whatever the tails, and so have products along any path. That is what bounds the number of false alarms (`density`).
//! Source: ratio and martingale: A. Wald, *Sequential Analysis*, 1947. Limits: ground whose bright side differs from its dark one is not in the null.

/// Strengths, as multiples of the least.
pub(super) const STRENGTHS: [f64; 2] = [1.0, 2.0];
/// Frames in which a target as bright as can be is sure, where that is not less than what [`EXPECTED`] asks for.
const FEWEST_FRAMES: f64 = 4.0;
/// Deviations of ln l of the brighter strength that are no outlier: 95 % of its frames are below. Were they cut, targets that are looked for would be told later and followed worse.
const EXPECTED: f64 = 1.645;
/// Frames that white noise's own mean counts for.
const PRIOR: f64 = 4.0;

/// The ratios' scale.
#[derive(Clone, Debug)]
pub(super) struct Levels {
    snr: [f32; STRENGTHS.len()],
    /// Most of ln l in one frame.
    most: f32,
    /// Mean ratio of white noise, and of the negative frames, and in how many.
    white: [f64; STRENGTHS.len()],
    null: [f64; STRENGTHS.len()],
    weight: f64,
}

/// Mean of min(exp(a z − a²/2), e^m) over z ~ N(0, 1).
fn white_mean(a: f64, m: f64) -> f64 {
    let above = |t: f64| 0.5 * libm::erfc(t / std::f64::consts::SQRT_2);
    let t = m / a + 0.5 * a;
    1.0 - above(t - a) + m.exp() * above(t)
}

impl Levels {
    /// For a least strength, and the odds (natural logarithm) that a target needs.
    pub(super) fn new(least_snr: f64, needed: f64) -> Self {
        // Under a target of the strength a, ln l has the mean a²/2 and the deviation a.
        let brighter = STRENGTHS[1] * least_snr;
        let most = (needed / FEWEST_FRAMES).max(brighter * (0.5 * brighter + EXPECTED));
        let white = STRENGTHS.map(|s| white_mean(s * least_snr, most));
        Self { snr: STRENGTHS.map(|s| (s * least_snr) as f32), most: most as f32, white, null: white, weight: PRIOR }
    }

    /// Learns the null from a frame; `kept` is what is left of the older ones.
    pub(super) fn learn(&mut self, z: &[f32], kept: f64) {
        self.weight = kept * self.weight + 1.0;
        for (a, null) in self.snr.iter().zip(&mut self.null) {
            let (most, half) = (self.most, 0.5 * a * a);
            let sum: f64 = z.iter().map(|z| f64::from((-a * z - half).min(most).exp())).sum();
            *null += (sum / z.len().max(1) as f64 - *null) / self.weight;
        }
    }

    /// Ratios of a row of z, for the strength of a number.
    pub(super) fn ratios(&self, strength: usize, z: &[f32], out: &mut [f32]) {
        let a = self.snr[strength];
        let null = self.null[strength].max(self.white[strength]).ln() as f32;
        let (offset, most) = (0.5 * a * a + null, self.most - null);
        for (o, z) in out.iter_mut().zip(z) {
            *o = (a * z - offset).min(most).exp();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn the_mean_of_white_noise_is_that_of_the_integral_and_no_frame_lowers_it() {
        for (a, m) in [(1.0, 4.0), (2.0, 4.0), (4.0, 1.0)] {
            let density = |z: f64| (-0.5 * z * z).exp() / std::f64::consts::TAU.sqrt();
            let at = |z: f64| (a * z - 0.5 * a * a).min(m).exp() * density(z);
            let sum: f64 = (0..200_000).map(|k| at(-10.0 + (k as f64 + 0.5) * 1e-4) * 1e-4).sum();
            assert!((white_mean(a, m) / sum - 1.0).abs() < 1e-6, "{a} {m}");
        }
        // Light that rises all over: every pixel is bright, the negative shows nothing.
        let (mut levels, fresh) = (Levels::new(1.0, 20.0), Levels::new(1.0, 20.0));
        (0..100).for_each(|_| levels.learn(&[5.0; 64], 1.0));
        let (mut now, mut before) = ([0.0], [0.0]);
        for strength in 0..STRENGTHS.len() {
            levels.ratios(strength, &[0.7], &mut now);
            fresh.ratios(strength, &[0.7], &mut before);
            assert_eq!(now, before);
        }
    }

    #[test]
    fn noise_of_heavy_tails_has_the_mean_ratio_one() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut levels = Levels::new(1.0, 24.0);
        let mut means = [0.0; 2];
        let n = 200;
        for k in 0..2 * n {
            // Laplace noise of twice the deviation.
            let z: Vec<f32> = (0..4096)
                .map(|_| {
                    let u: f32 = rng.random::<f32>() - 0.5;
                    -1.4 * u.signum() * (1.0 - 2.0 * u.abs()).max(1e-7).ln()
                })
                .collect();
            levels.learn(&z, 1.0);
            if k >= n {
                let mut l = vec![0.0; z.len()];
                for (s, mean) in means.iter_mut().enumerate() {
                    levels.ratios(s, &z, &mut l);
                    *mean += l.iter().map(|v| f64::from(*v)).sum::<f64>() / (z.len() * n) as f64;
                }
            }
        }
        assert!(means.iter().all(|m| (0.9..1.1).contains(m)), "{means:?}");
    }
}
