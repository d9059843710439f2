//! The evidence that something moves: what detections gain by being told as chains, beside what the same scans gain in another order; what a choice is made by.
//!
//! Source: our own; the surrogate is that of J. Theiler et al., Physica D 58, 1992: the same scans in another order keep all that stands and all that
//! comes and goes, and lose what moves. A gain in nats is the logarithm of a likelihood ratio: by chance one larger than g comes once in e^g choices.
//! Limits: those of [`super::chains`].

use super::chains::{Chain, Field};
use super::first_scans::first;
use super::ground::Ground;
use super::quantile::quantile;
use super::sightings::{Sighting, Sightings};
use crate::camera::SteadyGround;
use crate::{Scan, SourceInfo};
use nalgebra::Vector2;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

/// Orders of the scans in which chains are counted for comparison.
const SURROGATES: usize = 4;
/// Scans of a pass that are looked at, and their detections at most: a guard of time.
pub const MOST_SCANS: usize = 250;
const MOST_DETECTIONS: usize = 20_000;
/// By chance a gain is larger once in a thousand choices: e to the minus gain.
pub const SURE_GAIN: f64 = 6.9;
/// Share of the regions detected that chains must explain: the tracker counts hits, and would make tracks of what is mostly clutter.
pub const LEAST_EXPLAINED: f64 = 0.2;
/// Deviations by which a number of steps, or a gain, is surely more than another.
const STDS: f64 = 3.0;
/// Fewer chains that go one way are things side by side: a ground has as many features as [`crate::camera`] asks for.
const LEAST_OF_GROUND: usize = 6;
/// Share of the steps that may be faster than the speed called fastest.
const FASTER_SHARE: f64 = 0.01;
/// Share of a chain's speed below which chance's chains are of another kind; chosen, and less than 1 so that the fastest of all chains is not without any to be judged by.
const SLOWER: f64 = 0.5;
/// Steps of which the middle one is a chain's speed: two that a wrong detection made are fewer than half.
const LEAST_STEPS: usize = 5;

/// The chains of scans beside those of the same scans in other orders.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Evidence {
    /// The chains in the order of time that move.
    pub moving: Vec<Chain>,
    /// Times of the scans, s.
    pub times_s: Vec<f64>,
    /// Mean number and gain (nats) of a surrogate's moving chains.
    pub by_chance: [f64; 2],
    /// Middle speed (px/s) and gain (nats) of each of them.
    chains_by_chance: Vec<[f64; 2]>,
    /// Speeds of the steps of all surrogates' moving chains, px/s.
    speeds_by_chance: Vec<f64>,
}

impl Evidence {
    /// Looks for chains in the first scans of a pass, on steady ground, in a field of that area, px².
    pub fn of_scans(scans: &[Scan], area_px2: f64) -> Self {
        let (mut ground, mut on_ground) = (SteadyGround::default(), Scan::default());
        let (mut sightings, mut n_seen) = (Vec::new(), 0);
        for scan in first(scans).iter().take(MOST_SCANS) {
            ground = ground.after(scan);
            if scan.blind {
                continue;
            }
            ground.scan_on_ground(scan, &mut on_ground);
            sightings.push(Sightings::of(&on_ground, None));
            n_seen += on_ground.detections.len();
            if n_seen > MOST_DETECTIONS {
                break;
            }
        }
        Self::of(&sightings, area_px2)
    }

    /// Looks for chains in the scans of the frames at these places; `ground` is the first frame's in each frame, none where it stands.
    pub fn of_looks(scans: &[Scan], places: &[usize], ground: &[Ground], info: &SourceInfo) -> Self {
        Self::of(&Sightings::of_looks(scans, places, ground), (info.width * info.height) as f64)
    }

    /// Looks for chains in a field of that area, px².
    pub fn of(scans: &[Sightings], area_px2: f64) -> Self {
        let times_s = scans.iter().map(|s| s.time_s).collect();
        let field = Field::new(scans, area_px2);
        let mut order: Vec<usize> = (0..scans.len()).collect();
        let mut out = Self { moving: field.chains(&order), times_s, ..Self::default() };
        out.moving.retain(|c| c.moves);
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        for _ in 0..SURROGATES {
            order.sort_unstable();
            order.shuffle(&mut rng);
            for chain in field.chains(&order).into_iter().filter(|c| c.moves) {
                out.chains_by_chance.push([middle_px_per_s(&chain), chain.gain]);
                out.by_chance[0] += 1.0 / SURROGATES as f64;
                out.by_chance[1] += chain.gain / SURROGATES as f64;
                out.speeds_by_chance.extend(chain.speeds_px_per_s);
            }
        }
        out
    }

    /// The chains of which each gains surely more than one by chance.
    ///
    /// By chance one gains more than g with e^(-g/κ): κ is 1 where false detections lie as the density says, and more where they come in swarms. The largest of n surrogates is about
    /// κ ln n. Chance is asked for those that are not much slower: what hardly moves is a chain in any order of the scans, and says nothing of what is fast.
    pub fn sure(&self) -> impl Iterator<Item = &Chain> {
        self.moving.iter().filter(|c| {
            // Scans of one time make any step infinitely fast: all of chance's chains are asked then.
            let slowest = Some(SLOWER * middle_px_per_s(c)).filter(|s| s.is_finite()).unwrap_or(0.0);
            let as_fast = self.chains_by_chance.iter().filter(|b| b[0] >= slowest);
            let most = as_fast.map(|b| b[1]).fold(0.0, f64::max);
            let scale = (most / (SURROGATES as f64).ln()).max(1.0);
            c.gain > most + scale * SURE_GAIN
        })
    }

    /// Detections in chains that move.
    pub fn n_hits(&self) -> usize {
        self.moving.iter().map(|c| c.hits.len()).sum()
    }

    /// Share of the scans' detections that the chains hold.
    pub fn explained(&self, scans: &[Scan]) -> f64 {
        // Those that the chains were looked for in: scans in which nothing could be seen were not.
        let looked = scans.iter().filter(|s| !s.blind).take(self.times_s.len());
        let n_detections: usize = looked.map(|s| s.detections.len()).sum();
        self.n_hits() as f64 / n_detections.max(1) as f64
    }

    /// Gain of what moves beyond that of the surrogates, nats.
    pub fn gain(&self) -> f64 {
        self.moving.iter().map(|c| c.gain).sum::<f64>() - self.by_chance[1]
    }

    /// Gain of the chains that go with none that gains more, nats, beyond that of the surrogates: of the rims of one target, and of its parts, one counts.
    pub fn gain_alone(&self) -> f64 {
        let alone = |a: &&Chain| !self.moving.iter().any(|b| b.gain > a.gain && a.goes_with(b));
        self.moving.iter().filter(alone).map(|c| c.gain).sum::<f64>() - self.by_chance[1]
    }

    /// The chains that do not go the way of most of them: many things that go one way are the ground before a camera that moves.
    fn apart(&self) -> Vec<&Chain> {
        let median = |axis: usize| {
            let mut all: Vec<f64> = self.moving.iter().map(|c| self.velocity(c)[axis]).collect();
            all.sort_by(f64::total_cmp);
            all.get(all.len() / 2).copied().unwrap_or(0.0)
        };
        let common = Vector2::new(median(0), median(1));
        let (with, apart): (Vec<_>, Vec<_>) = self.moving.iter().partition(|c| c.may_go_by(self.span_s(c) * common));
        if with.len() < LEAST_OF_GROUND || with.len() <= apart.len() { self.moving.iter().collect() } else { apart }
    }

    /// Gain a scan of the chains that do not go the way of most of them and with none of `other`, nats, beyond that of the surrogates.
    pub fn gain_apart_a_scan(&self, other: Option<&Self>) -> f64 {
        let is_seen = |c: &Chain| other.is_some_and(|o| o.moving.iter().any(|b| c.goes_with(b)));
        let gain: f64 = self.apart().into_iter().filter(|c| !is_seen(c)).map(|c| c.gain).sum();
        (gain - self.by_chance[1]) / self.times_s.len().max(1) as f64
    }

    /// Time from a chain's first detection to its last one, s.
    fn span_s(&self, chain: &Chain) -> f64 {
        let at = |hit: Option<&(usize, Sighting)>| hit.and_then(|h| self.times_s.get(h.0)).copied().unwrap_or(0.0);
        at(chain.hits.last()) - at(chain.hits.first())
    }

    /// Mean velocity of a chain, px/s.
    fn velocity(&self, chain: &Chain) -> Vector2<f64> {
        chain.way_px() / self.span_s(chain).max(f64::MIN_POSITIVE)
    }

    /// Gain of those chains that go with none of `other`, nats, beyond that of the surrogates.
    pub fn gain_beside(&self, other: &Self) -> f64 {
        let own = self.moving.iter().filter(|c| !other.moving.iter().any(|o| c.goes_with(o)));
        own.map(|c| c.gain).sum::<f64>() - self.by_chance[1]
    }

    /// Whether the order of the scans means something, surely.
    pub fn is_sure(&self) -> bool {
        self.gain() > SURE_GAIN
    }

    /// Whether these chains surely gain more than the other ones of the same targets.
    ///
    /// The gain of a detection has the variance of χ²/2, 1: that of n of them deviates by √n.
    pub fn is_surely_more_than(&self, other: &Self) -> bool {
        let hits = |e: &Self| e.n_hits() as f64;
        let luck = if other.is_sure() { STDS * (hits(self) + hits(other)).sqrt() } else { 0.0 };
        self.gain() > other.gain().max(0.0) + SURE_GAIN + luck
    }

    /// The speed that one in a hundred of the steps exceeds which chance does not explain, px/s; none where nothing moves surely.
    pub fn fastest_px_per_s(&self) -> Option<f64> {
        let mut ordered: Vec<f64> = self.moving.iter().flat_map(|c| c.speeds_px_per_s.iter().copied()).collect();
        ordered.sort_by(|a, b| b.total_cmp(a));
        let mut chance = self.speeds_by_chance.clone();
        chance.sort_by(|a, b| b.total_cmp(a));
        // From the fastest down: as soon as so many more steps than by chance are as fast.
        let excess = |n: usize| {
            let by_chance = chance.partition_point(|c| *c >= ordered[n]) as f64 / SURROGATES as f64;
            let more = (n + 1) as f64 - by_chance;
            (more > STDS * (by_chance + 1.0).sqrt()).then_some(more)
        };
        let all = ordered.len() as f64 - chance.len() as f64 / SURROGATES as f64;
        let fast = |n: &usize| excess(*n).is_some_and(|more| more >= FASTER_SHARE * all);
        (0..ordered.len()).find(fast).filter(|_| self.is_sure()).map(|n| ordered[n])
    }

    /// The speed that half of the steps of one chain exceed which chance does not explain, px/s, the largest of all such chains: one fast target among a hundred others is no hundredth of the steps.
    pub fn fastest_chain_px_per_s(&self) -> Option<f64> {
        let long = self.sure().filter(|c| c.speeds_px_per_s.len() >= LEAST_STEPS);
        // Of one whose scans have one time the speed is infinite and says nothing.
        long.map(middle_px_per_s).filter(|s| s.is_finite()).max_by(f64::total_cmp)
    }

    /// In words, for the reasons of a choice.
    pub fn words(&self) -> String {
        let n = self.moving.len();
        format!(
            "{n} chain{} in motion that gain{} {:.0} nats, {:.1} that gain {:.0} in another order",
            if n == 1 { "" } else { "s" },
            if n == 1 { "s" } else { "" },
            self.gain() + self.by_chance[1],
            self.by_chance[0],
            self.by_chance[1]
        )
    }
}

/// The speed that half of a chain's steps exceed, px/s.
fn middle_px_per_s(chain: &Chain) -> f64 {
    quantile(&mut chain.speeds_px_per_s.clone(), 0.5)
}

#[cfg(test)]
mod tests {
    use super::super::sightings::Sighting;
    use super::*;
    use nalgebra::Vector2;
    use rand::RngExt;
    use rand_distr::StandardNormal;

    const SIDE_PX: f64 = 300.0;

    /// Twelve scans of 25 a second of `n` targets of a speed (px a scan), each detected with 0.8, and of `n_false` false detections and `n_still` things.
    fn scans(seed: u64, n: usize, speed: f64, n_false: usize, n_still: usize) -> Vec<Sightings> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let place = |rng: &mut ChaCha8Rng| Vector2::from_fn(|_, _| SIDE_PX * rng.random::<f64>());
        let targets: Vec<(Vector2<f64>, f64)> =
            (0..n).map(|_| (place(&mut rng), std::f64::consts::TAU * rng.random::<f64>())).collect();
        let still: Vec<Vector2<f64>> = (0..n_still).map(|_| place(&mut rng)).collect();
        (0..12)
            .map(|k| {
                let mut all: Vec<Vector2<f64>> = Vec::new();
                for (at, angle) in &targets {
                    let at = at + speed * k as f64 * Vector2::new(angle.cos(), angle.sin());
                    all.extend((rng.random::<f64>() < 0.8).then_some(at));
                }
                all.extend(&still);
                let noisy = |at: Vector2<f64>, rng: &mut ChaCha8Rng| {
                    at + Vector2::from_fn(|_, _| 0.3 * rng.sample::<f64, _>(StandardNormal))
                };
                let mut all: Vec<Vector2<f64>> = all.into_iter().map(|at| noisy(at, &mut rng)).collect();
                all.extend((0..n_false).map(|_| place(&mut rng)));
                let sighting = |at| Sighting { at, variance: 0.09, side_px: 2.0, thickness_px: 2.0, score: 0.0 };
                Sightings { time_s: 0.04 * f64::from(k), all: all.into_iter().map(sighting).collect() }
            })
            .collect()
    }

    #[test]
    fn what_moves_is_told_from_what_stands_and_from_what_comes_and_goes() {
        for speed in [1.0, 4.0, 12.0] {
            let e = Evidence::of(&scans(1, 4, speed, 10, 20), SIDE_PX * SIDE_PX);
            assert!((3..=5).contains(&e.moving.len()) && e.gain() > 30.0, "{speed}: {e:?}");
            let mut speeds: Vec<f64> = e.moving.iter().flat_map(|c| c.speeds_px_per_s.clone()).collect();
            speeds.sort_by(f64::total_cmp);
            let median = speeds[speeds.len() / 2];
            assert!((median / (25.0 * speed) - 1.0).abs() < 0.3, "{speed}: {median}");
            // The error of a step between two places of 0.3 px is 0.42 px: three of them.
            let fastest = e.fastest_px_per_s().unwrap() / 25.0;
            assert!(fastest >= speed && fastest < speed + 1.3, "{speed}: {fastest}");
        }
    }

    #[test]
    fn chance_gains_no_more_than_it_is_allowed_to() {
        for n_false in [2, 25, 100] {
            let gains = (0..60).map(|seed| Evidence::of(&scans(seed, 0, 0.0, n_false, 10), SIDE_PX * SIDE_PX).gain());
            // By chance e^-7 of the choices: none of 60.
            let most = gains.fold(f64::NEG_INFINITY, f64::max);
            assert!(most < 7.0, "{n_false}: {most}");
        }
    }

    #[test]
    fn glitter_in_one_corner_gains_nothing() {
        for seed in 0..20 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let scans: Vec<Sightings> = (0..40)
                .map(|k| {
                    let mut glint = || Vector2::from_fn(|_, _| 60.0 * rng.random::<f64>());
                    let all = (0..40)
                        .map(|_| Sighting { at: glint(), variance: 0.09, side_px: 2.0, thickness_px: 2.0, score: 0.0 })
                        .collect();
                    Sightings { time_s: 0.04 * f64::from(k), all }
                })
                .collect();
            let e = Evidence::of(&scans, SIDE_PX * SIDE_PX);
            assert!(!e.is_sure() && e.fastest_px_per_s().is_none(), "{seed}: {}", e.words());
            assert_eq!(e.sure().count(), 0, "{seed}");
        }
    }

    #[test]
    fn what_hardly_moves_is_a_chain_in_any_order_and_hides_nothing_that_is_fast() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let stars: Vec<Vector2<f64>> =
            (0..120).map(|_| Vector2::from_fn(|_, _| 300.0 * (2.0 * rng.random::<f64>() - 1.0))).collect();
        let scans: Vec<Sightings> = (0..90)
            .map(|k| {
                // They turn by 0.03 degrees a scan, at most 0.2 px; the one that goes does so at 5 px a scan.
                let turn = nalgebra::Rotation2::new(5.2e-4 * f64::from(k));
                let mut all: Vec<Vector2<f64>> = stars.iter().map(|s| turn * s).collect();
                all.push(Vector2::new(-250.0 + 5.0 * f64::from(k), 40.0));
                let sighting = |at| Sighting { at, variance: 0.05, side_px: 3.0, thickness_px: 3.0, score: 0.0 };
                Sightings { time_s: 0.04 * f64::from(k), all: all.into_iter().map(sighting).collect() }
            })
            .collect();
        let e = Evidence::of(&scans, 600.0 * 600.0);
        let largest = e.chains_by_chance.iter().map(|c| c[1]).fold(0.0, f64::max);
        assert!(largest > 100.0, "slow ones are chains in another order: {largest}");
        let fastest = e.fastest_chain_px_per_s().unwrap();
        assert!((fastest - 125.0).abs() < 1.0, "{fastest}");
    }

    #[test]
    fn a_shadow_goes_with_its_thing_and_another_thing_does_not() {
        let line = |from: [f64; 2], step: f64, side_px: f64| -> Vec<Sightings> {
            (0..12)
                .map(|k| {
                    let at = Vector2::new(from[0] + step * f64::from(k), from[1]);
                    Sightings { time_s: 0.04 * f64::from(k), all: vec![Sighting::of_box(at, 0.1, side_px)] }
                })
                .collect()
        };
        let [thing, shadow, other] =
            [line([20.0, 50.0], 4.0, 6.0), line([26.0, 54.0], 4.0, 6.0), line([90.0, 200.0], -3.0, 6.0)]
                .map(|scans| Evidence::of(&scans, SIDE_PX * SIDE_PX));
        assert!(shadow.gain() > 30.0 && shadow.gain_beside(&thing) <= 0.0);
        assert!(other.gain_beside(&thing) > 30.0);
    }

    #[test]
    fn the_two_rims_of_one_thing_count_once() {
        let scans = |apart: Vector2<f64>| -> Vec<Sightings> {
            let both = |k: u32| {
                let at = Vector2::new(20.0 + 4.0 * f64::from(k), 50.0);
                vec![Sighting::of_box(at, 0.1, 10.0), Sighting::of_box(at + apart, 0.2, 10.0)]
            };
            (0..12).map(|k| Sightings { time_s: 0.04 * f64::from(k), all: both(k) }).collect()
        };
        let rims = Evidence::of(&scans(Vector2::new(16.0, 0.0)), SIDE_PX * SIDE_PX);
        let things = Evidence::of(&scans(Vector2::new(0.0, 150.0)), SIDE_PX * SIDE_PX);
        assert_eq!([rims.moving.len(), things.moving.len()], [2, 2]);
        assert!((rims.gain_alone() - rims.moving[0].gain.max(rims.moving[1].gain) + rims.by_chance[1]).abs() < 1e-9);
        assert!((things.gain_alone() - things.gain()).abs() < 1e-9 && things.gain() > 60.0, "{}", things.words());
    }

    #[test]
    fn nothing_comes_of_nothing() {
        let none = Evidence::of(&[], 100.0);
        assert_eq!((none.moving.len(), none.gain()), (0, 0.0));
        assert_eq!(Evidence::of(&vec![Sightings::default(); 5], 100.0).gain(), 0.0);
    }
}
