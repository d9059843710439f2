//! The null: how many tops of pure noise are expected to be at least as high, from the frames' own tops of the other sign.
//!
//! How: tops of −z are what the same search over the negative frames finds: no bright target is in them, noise and what is left of the
//! background are. With q = z² / 2, tops of a smooth Gaussian field in d = 4 dimensions (x, y, v_x, v_y) are beyond z in numbers like
//! N(z) ∝ z³ exp(−q) for high z; here N(z) = m (q / q_m)^{3/2} exp(−κ (q − q_m)), q_m the m-th highest and κ the one thing fitted, by maximum
//! likelihood over the tops of the last [`KEPT`] searches: below 1 where the ground has heavier tails than noise. Where both signs are
//! looked for, the one with the lower q_m is the null of both.
//! Source: R. J. Adler, *The Geometry of Random Fields*, 1981, ch. 6 (the number of high maxima); score −log₁₀ N as in `cfar`.
//! Limits: ground whose bright side differs from its dark one (sparkle) is not in the null. Fewer than [`FEWEST`] tops: κ = 1 and as many
//! independent tests as velocities times pixels.

/// Searches that the tail is fitted over.
const KEPT: usize = 16;
/// Highest tops of a search that the tail is fitted to, and the share of all that it may be at most.
const FITTED: usize = 64;
const SHARE: usize = 4;
/// Fewest tops that say something of the tail.
const FEWEST: usize = 8;
/// Half of the number of dimensions less one: of place and velocity.
const POWER: f64 = 1.5;

/// The tops of one search.
#[derive(Clone, Debug, Default)]
struct Tops {
    /// q of the fitted ones.
    q: Vec<f64>,
    q_m: f64,
}

/// The expected number of tops of noise.
#[derive(Clone, Debug)]
pub(super) struct Null {
    searches: Vec<Tops>,
    next: usize,
    filled: usize,
    kappa: f64,
    /// Tests of a search, should nothing be known.
    tests: f64,
}

impl Null {
    /// A null of searches of so many tests.
    pub(super) fn new(tests: f64) -> Self {
        let empty = || Tops { q: Vec::with_capacity(FITTED), q_m: 0.0 };
        Self { searches: (0..KEPT).map(|_| empty()).collect(), next: 0, filled: 0, kappa: 1.0, tests }
    }

    /// Takes in the tops of a search, the highest first.
    pub(super) fn learn(&mut self, tops: impl Iterator<Item = f64> + Clone) {
        let n = tops.clone().count();
        let m = FITTED.min(n / SHARE);
        if m < FEWEST {
            return;
        }
        let search = &mut self.searches[self.next];
        search.q.clear();
        search.q.extend(tops.map(|z| 0.5 * z * z).take(m));
        search.q_m = search.q.last().copied().unwrap_or(0.0);
        self.next = (self.next + 1) % KEPT;
        self.filled = (self.filled + 1).min(KEPT);
        self.fit();
    }

    /// κ by maximum likelihood: Σ 1 / (κ − 3 / 2q) = Σ (q − q_m).
    fn fit(&mut self) {
        let searches = &self.searches[..self.filled];
        let lowest = searches.iter().map(|s| s.q_m).fold(f64::INFINITY, f64::min).max(1e-3);
        let surplus = |kappa: f64| -> f64 {
            let of = |s: &Tops| s.q.iter().map(|q| 1.0 / (kappa - POWER / q.max(lowest)) - (q - s.q_m)).sum::<f64>();
            searches.iter().map(of).sum()
        };
        let (mut low, mut high) = (POWER / lowest + 1e-6, POWER / lowest + 20.0);
        for _ in 0..60 {
            let mid = 0.5 * (low + high);
            if surplus(mid) > 0.0 { low = mid } else { high = mid }
        }
        self.kappa = low;
    }

    /// Expected number of tops of noise in a search at least as high.
    pub(super) fn number(&self, z: f64) -> f64 {
        let q = 0.5 * z * z;
        if self.filled == 0 {
            return self.tests * 0.5 * libm::erfc(z / std::f64::consts::SQRT_2);
        }
        let of = |s: &Tops| {
            let q_m = s.q_m.max(1e-3);
            s.q.len() as f64 * (q / q_m).powf(POWER) * (-self.kappa * (q - q_m)).exp()
        };
        self.searches[..self.filled].iter().map(of).sum::<f64>() / self.filled as f64
    }

    /// κ of the tail: 1 for white noise.
    #[cfg(test)]
    fn kappa(&self) -> f64 {
        self.kappa
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tops drawn from m (q/q_m)^1.5 exp(-κ (q - q_m)) by inversion, evenly spread, the highest first.
    fn drawn(kappa: f64, q_m: f64, n: usize, shift: f64) -> Vec<f64> {
        let q_of = |p: f64| {
            let beyond = |q: f64| (q / q_m).powf(1.5) * (-kappa * (q - q_m)).exp() - p;
            let (mut a, mut b) = (q_m, q_m + 100.0);
            for _ in 0..80 {
                let mid = 0.5 * (a + b);
                if beyond(mid) > 0.0 { a = mid } else { b = mid }
            }
            a
        };
        (0..n).map(|i| (2.0 * q_of((i as f64 + shift) / n as f64)).sqrt()).collect()
    }

    #[test]
    fn the_tail_that_was_drawn_is_found_and_extrapolated() {
        for kappa in [1.0, 0.7] {
            let mut null = Null::new(1e9);
            for k in 0..16 {
                let mut tops = drawn(kappa, 10.0, 64, 0.2 + 0.05 * f64::from(k));
                // Lower ones that are not fitted.
                tops.extend(vec![2.0; 256]);
                null.learn(tops.into_iter());
            }
            assert!((null.kappa() - kappa).abs() < 0.05, "{}", null.kappa());
            let q: f64 = 22.0;
            let truth = 64.0 * (q / 10.0).powf(1.5) * (-kappa * (q - 10.0)).exp();
            let ratio = null.number((2.0 * q).sqrt()) / truth;
            assert!((0.5..2.0).contains(&ratio), "{ratio}");
        }
    }

    #[test]
    fn without_tops_every_test_counts() {
        let mut null = Null::new(1e6);
        null.learn([9.0, 8.0].into_iter());
        assert!((null.number(5.0) / (1e6 * 2.866_5e-7) - 1.0).abs() < 1e-3, "{}", null.number(5.0));
    }
}
