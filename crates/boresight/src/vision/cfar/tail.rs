//! The null: how many extremes of a frame without targets are expected to be at least as strong.
//!
//! z -> e(z) = (z² + 0.45) / 1.40, so that extremes of white noise have P(e > x) = exp(-x) (fitted to simulated white noise down to
//! 3e-5; it holds on every level because z is in units of the local noise). Two models of what a frame without targets shows:
//!  homogeneous: n(e) = N_u exp(-(e - u) / μ), u and μ the frame's own 5 % point and mean excess;
//!  structured: n(e) = N_u (1 + ξ (e - 3 s)₊ / s)^(-1/ξ), ξ = 1/2 (extremes of real ground fall like z⁻⁴), s the frame's 0.5 % point over
//!  that of white noise.
//! Both are taken from the polarity whose 0.5 % point is lower: targets of one polarity do not hide themselves, and contrast
//! leaves no rims of the other sign. Where the 20 % points of the finest level differ by more than 30 %, the ground itself is skewed (foliage, sparkle): it
//! counts as structured, its scale larger by that ratio. The weight of the first is w = 1 / (1 + 1/Λ), Λ the ratio of the likelihoods of the
//! extremes beyond u under both, the first held to u and μ that fit each other within 5 %.
//! Source of the parts: generalised Pareto tail, J. Pickands, Ann. Statist. 3, 119 (1975); number of false alarms as score,
//! A. Desolneux, L. Moisan & J.-M. Morel, *From Gestalt Theory to Image Analysis*, 2008; the frame's own extremes as null,
//! B. Efron, J. Am. Stat. Assoc. 99, 96 (2004). Derivation and sensitivities: `docs/theory/detection-cfar.md`.
//! Symbols: N number of extremes of a polarity; N_u how many of them lie beyond u.

/// e(z) = (z² + `OFFSET`) / `SLOPE`.
const OFFSET: f32 = 0.45;
const SLOPE: f32 = 1.40;
/// Part of the extremes that the tail is fitted to.
const FITTED: f64 = 0.05;
/// Part of the extremes beyond which the scale of structured ground is read.
const SCALE_AT: f64 = 0.005;
/// Shape of the tail of structured ground.
const SHAPE: f64 = 0.5;
/// How closely the 5 % point and the mean excess of homogeneous ground agree with each other (standard deviation, no unit).
const AGREE: f64 = 0.05;
/// Part of the extremes at which the two polarities are compared, and the ratio from which on they differ, with its width.
const BULK: f64 = 0.2;
const SKEWED: f64 = 1.3;
const SKEW_WIDTH: f64 = 0.1;
/// Fewest extremes that a point of the tail is read from.
const FEWEST: usize = 10;
/// Most excesses that the likelihoods are taken from.
const MOST: usize = 512;
/// e of extremes too weak to be listed.
const UNLISTED: f64 = 0.9;

/// The strength of an extreme of `z` deviations.
pub(super) fn strength(z: f32) -> f32 {
    (z * z + OFFSET) / SLOPE
}

/// The null of one frame, for one polarity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Null {
    /// Expected number beyond `u`.
    beyond: f64,
    /// The 5 % point, and mean excess of homogeneous ground.
    u: f64,
    mu: f64,
    /// Scale of structured ground, 1 for white noise.
    scale: f64,
    /// Weight of the homogeneous model.
    weight: f64,
}

/// What is read from the extremes of one polarity.
#[derive(Clone, Copy, Debug)]
struct Points {
    count: usize,
    /// The 20 % point.
    bulk: f64,
    u: f64,
    mu: f64,
    scale: f64,
    weight: f64,
}

/// The value of rank `rank` (0 the largest) of a list whose weaker members were left out.
fn ranked(e: &mut [f32], rank: usize) -> f64 {
    if rank >= e.len() {
        return UNLISTED;
    }
    // Numbers that are not negative stand in the order of their bits.
    f64::from(*e.select_nth_unstable_by(rank, |a, b| b.to_bits().cmp(&a.to_bits())).1)
}

/// The strengths of the listed extremes of one polarity.
#[derive(Debug)]
pub(super) struct Strengths<'a> {
    /// Those of all levels, the finest first.
    pub(super) listed: &'a mut [f32],
    /// How many extremes there are in all, listed or not.
    pub(super) count: usize,
    /// How many are listed of the finest level.
    pub(super) finest_listed: usize,
    /// How many the finest level has in all.
    pub(super) finest_count: usize,
}

/// Reads the tail.
fn points(strengths: Strengths<'_>) -> Points {
    let Strengths { listed: e, count, finest_listed, finest_count } = strengths;
    let bulk_rank = ((BULK * finest_count as f64) as usize).max(FEWEST);
    let bulk = ranked(&mut e[..finest_listed], bulk_rank);
    let part = |p: f64, least: usize| ((p * count as f64) as usize).max(least).min(count.saturating_sub(1));
    let (upper, fitted) = (part(SCALE_AT, FEWEST / 2), part(FITTED, FEWEST));
    let white = |rank: usize| (count as f64 / rank.max(1) as f64).ln().max(0.5);
    let scale = (ranked(e, upper) / white(upper)).max(0.1);
    let u = ranked(e, fitted);
    let excess = &e[..fitted.min(e.len())];
    let n = excess.len().min(MOST);
    if n < FEWEST {
        // Too few to know: structured ground of the scale of white noise.
        return Points { count, bulk, u, mu: 1.0, scale: scale.max(1.0), weight: 0.0 };
    }
    // Evenly spread over the list, which stands in no order.
    let step = excess.len() / n;
    let excess = || excess.iter().step_by(step).take(n).map(|x| (f64::from(*x) - u).max(0.0));
    let n = n as f64;
    let mu = (excess().sum::<f64>() / n).max(1e-3);
    let agree = (mu - u / white(fitted)).powi(2) + (mu - 1.0).max(0.0).powi(2);
    let homogeneous = -n * mu.ln() - n - 0.5 * agree / (AGREE * AGREE + 1.0 / n);
    let structured = best_scale(
        |s| {
            let logs: f64 = excess().map(|x| (1.0 + SHAPE * x / s).ln()).sum();
            -n * s.ln() - (1.0 + 1.0 / SHAPE) * logs
        },
        mu,
    );
    let weight = 1.0 / (1.0 + (structured - homogeneous).clamp(-700.0, 700.0).exp());
    Points { count, bulk, u, mu, scale, weight }
}

/// The largest value of a likelihood over the scale, near `guess`, by golden section over the logarithm.
fn best_scale(likelihood: impl Fn(f64) -> f64, guess: f64) -> f64 {
    const GOLDEN: f64 = 0.618_033_988_749_894_8;
    let (mut a, mut b) = (guess.ln() - 2.5, guess.ln() + 0.5);
    let at = |l: f64| likelihood(l.exp());
    let (mut c, mut d) = (b - GOLDEN * (b - a), a + GOLDEN * (b - a));
    let (mut fc, mut fd) = (at(c), at(d));
    for _ in 0..10 {
        if fc > fd {
            (b, d, fd) = (d, c, fc);
            c = b - GOLDEN * (b - a);
            fc = at(c);
        } else {
            (a, c, fc) = (c, d, fd);
            d = a + GOLDEN * (b - a);
            fd = at(d);
        }
    }
    fc.max(fd)
}

/// The nulls for bright and for dark extremes; `sides` is how many polarities are looked for.
pub(super) fn nulls(bright: Strengths<'_>, dark: Strengths<'_>, sides: usize) -> [Null; 2] {
    let (b, d) = (points(bright), points(dark));
    // A polarity with hardly any extremes says nothing.
    let few = |p: &Points| p.count < 2 * FEWEST;
    let p = if few(&b) || !few(&d) && d.scale <= b.scale { d } else { b };
    [b, d].map(|own| {
        let share = (FITTED * own.count as f64).max(FEWEST as f64);
        // Ground whose ordinary extremes of this polarity are stronger is texture of that polarity.
        let skew = if few(&own) || few(&p) { 1.0 } else { (own.bulk / p.bulk.max(1e-3)).max(1.0) };
        let even = (-((skew - SKEWED).max(0.0) / SKEW_WIDTH).powi(2)).exp();
        Null { beyond: share * sides as f64, u: p.u, mu: p.mu, scale: p.scale * skew, weight: p.weight * even }
    })
}

impl Null {
    /// Expected number of extremes a frame at least as strong as `e`.
    pub(super) fn number(&self, e: f64) -> f64 {
        let homogeneous = (-(e - self.u).max(0.0) / self.mu).exp();
        let excess = (e - 3.0 * self.scale).max(0.0) / self.scale;
        let structured = (1.0 + SHAPE * excess).powf(-1.0 / SHAPE);
        self.beyond * (self.weight * homogeneous + (1.0 - self.weight) * structured)
    }

    /// The strength beyond which `number` are expected.
    pub(super) fn strength_of(&self, number: f64) -> f64 {
        let (mut low, mut high) = (0.0, 1e9);
        for _ in 0..80 {
            let mid = 0.5 * (low + high);
            if self.number(mid) > number { low = mid } else { high = mid }
        }
        high
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The quantiles of a law in a mixed order, as a frame of `n` extremes would show them.
    fn law(n: usize, quantile: impl Fn(f64) -> f64) -> Vec<f32> {
        (0..n).map(|i| (i * 7919) % n).map(|i| quantile((i as f64 + 0.5) / n as f64) as f32).collect()
    }

    fn all(listed: &mut [f32]) -> Strengths<'_> {
        let count = listed.len();
        Strengths { listed, count, finest_listed: count, finest_count: count }
    }

    #[test]
    fn exponential_extremes_are_homogeneous_and_heavy_ones_are_not() {
        let mut white = law(4001, |p| -p.ln());
        let p = points(all(&mut white));
        assert!(p.weight > 0.99 && (p.mu - 1.0).abs() < 0.05 && (p.u - 3.0).abs() < 0.05, "{p:?}");
        let mut heavy = law(4001, |p| 2.0 * (p.powf(-0.5) - 1.0));
        assert!(points(all(&mut heavy)).weight < 1e-6);
    }

    #[test]
    fn the_number_falls_with_the_strength_and_its_inverse_gives_it_back() {
        let mut white = law(4001, |p| -p.ln());
        let [null, _] = nulls(all(&mut white.clone()), all(&mut white), 1);
        let mut last = f64::INFINITY;
        for i in 0..200 {
            let n = null.number(f64::from(i));
            assert!(n <= last && n > 0.0);
            last = n;
        }
        for wanted in [0.01, 0.1, 1.0, 10.0] {
            assert!((null.number(null.strength_of(wanted)) / wanted - 1.0).abs() < 1e-6);
        }
        // White noise: the number is that of the exponential law.
        assert!((null.number(7.0) / (4001.0 * (-7.0f64).exp()) - 1.0).abs() < 0.3);
    }

    #[test]
    fn targets_of_one_polarity_do_not_change_the_null() {
        let dark = law(4001, |p| -p.ln());
        let mut bright = dark.clone();
        bright.iter_mut().take(160).for_each(|e| *e = 300.0);
        let [with, _] = nulls(all(&mut bright), all(&mut dark.clone()), 1);
        let [without, _] = nulls(all(&mut dark.clone()), all(&mut dark.clone()), 1);
        assert!((with.number(9.0) / without.number(9.0) - 1.0).abs() < 0.2, "{with:?} {without:?}");
        assert_eq!(with.weight, without.weight);
    }

    #[test]
    fn ground_whose_ordinary_extremes_are_of_one_polarity_is_texture() {
        let mut dark = law(4001, |p| -p.ln());
        let mut bright = law(4001, |p| -2.0 * p.ln());
        let [texture, other] = nulls(all(&mut bright), all(&mut dark), 1);
        assert!(texture.weight < 1e-6 && other.weight > 0.99);
        assert!((texture.scale / other.scale - 2.0).abs() < 0.05);
    }

    #[test]
    fn no_extremes_at_all_give_a_null_without_a_weight() {
        let [null, _] = nulls(all(&mut []), all(&mut []), 1);
        assert!(null.weight == 0.0 && null.number(1e6) < 1e-6 && null.number(0.0) > 1.0);
    }
}
