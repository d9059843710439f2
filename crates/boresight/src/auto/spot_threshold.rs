//! The threshold of the spot detector where targets stand apart from the noise.
//!
//! Source: our own. The threshold of particles lets some false detections through, for the sake of faint ones ([`super::particles`]), and counts on white noise. A codec makes noise last for
//! many frames, and a tracker that takes detections for independent believes it. Where targets are far brighter, nothing is lost without what scores less.
//! How: of the scores of the first scans a valley is looked for, around which lie next to no detections. Those below it are noise if they score no higher than those of the other polarity do: what a codec
//! makes of noise is as often dark as bright. Rims of bright spots are dark, and do not count. Where too few are left, as between many spots, those below are noise, or what a codec leaves behind a spot
//! that moves, if they are the fewer the higher they score: other targets, fainter ones, are a hill of their own.
//! Where false detections last from frame to frame, as copies that a codec makes, to be followed tells no target from them, and the score alone has to: then the bottom between the noise and a hill of targets is taken, though it is no valley. As many false ones score
//! more as targets score less about where both are equally dense, which is at the bottom or a little below.
//! Elsewhere the threshold rises to where detections of the other polarity are as many as the false ones it was to let through: of noise that is not white, a normal law foretells too few.
//! Symbols: s a threshold, N(s) how many detections score less; b(s) = N(s r) - N(s / r), r = [`WIDE`].
//! Limits: faint targets of which most score less than the first threshold, or that are much fewer than the noise, go with it where there are bright ones.

use super::decoys::Decoys;
use super::digits::round;
use super::particles::FALSE_SHARE;

/// Half width of a valley, a factor: a score of few deviations wanders by a fifth.
const WIDE: f64 = 1.25;
/// Most detections in a valley for each of those on the side where there are fewer.
const MOST_BETWEEN: f64 = 0.05;
/// Fewest detections at each side of it, and of the other polarity so that they can be compared.
const FEWEST: usize = 50;
/// The score that so many of them fall short of is compared with that of the other polarity, which it may exceed by as much as a valley is wide.
const COMPARED: f64 = 0.9;
/// Deviations by which a number may exceed the one before by chance.
const BY_CHANCE: f64 = 2.0;
/// Deviations by which a number is surely less than another.
const SURELY: f64 = 3.0;
/// Thresholds that are tried lie apart by this factor.
const STEP: f64 = 1.05;
/// Beyond this a threshold is none of noise: the largest that a configuration takes.
const MOST_K: f64 = 1e6;

/// The threshold in a valley above the noise, or where noise is a small share of all, with the reason, if there is one.
pub(super) fn raised(decoys: &Decoys, least: f64) -> Option<(f64, String)> {
    let Decoys { own, other, .. } = decoys;
    if let Some((k, share)) = valley(own, other, least) {
        let reason = format!(
            "Spots of less than {k} deviations (not {least}) are left out: {:.0} % of all, which score as noise does; hardly one scores as much.",
            100.0 * share,
        );
        return Some((k, reason));
    }
    if decoys.last()
        && decoys.are_copied()
        && let Some((k, share)) = bottom(own, other, least)
    {
        let reason = format!(
            "Spots of less than {k} deviations (not {least}) are left out, {:.0} % of all: false ones last ({:.0} % of those of the other polarity are there again in the next frame), so that \
             following does not tell them from targets, and the fewest of both score as much.",
            100.0 * share,
            100.0 * decoys.lasting.len() as f64 / decoys.n_first as f64,
        );
        return Some((k, reason));
    }
    let k = where_few(own, other, least).filter(|k| *k > least)?;
    let reason = format!(
        "Spots of less than {k} deviations (not {least}) are left out: there are more false ones than white noise would make, for a hundred of all {:.0} of the other polarity.",
        100.0 * other.len() as f64 / own.len() as f64,
    );
    Some((k, reason))
}

/// The least threshold from `least` on at which detections of the other polarity are [`FALSE_SHARE`] of the own at most.
fn where_few(scores: &[f32], noise: &[f32], least: f64) -> Option<f64> {
    let from = |of: &[f32], s: f64| (of.len() - of.partition_point(|v| f64::from(*v) < s)) as f64;
    let most = f64::from(*scores.last()?);
    let mut steps = (0..).map(|i| round(least * STEP.powi(i))).take_while(|s| *s < most.min(MOST_K));
    steps.find(|s| {
        let few = FALSE_SHARE * from(scores, *s);
        from(noise, *s) <= few + BY_CHANCE * few.sqrt()
    })
}

/// A threshold that is tried.
struct Tried {
    k: f64,
    /// How many score less, and how many within [`WIDE`] of it.
    below: usize,
    between: usize,
}

/// The thresholds between `least`, above 0, and the largest score.
fn tried(scores: &[f32], least: f64) -> impl Iterator<Item = Tried> {
    let most = scores.last().filter(|_| least > 0.0).map_or(0.0, |s| f64::from(*s).min(MOST_K));
    let below = |s: f64| scores.partition_point(|v| f64::from(*v) < s);
    let steps = (0..).map(move |i| least * WIDE * STEP.powi(i)).take_while(move |k| *k < most);
    steps.map(move |k| Tried { k, below: below(k), between: below(k * WIDE) - below(k / WIDE) })
}

/// Whether these score no higher than noise does.
fn score_as(noise: &[f32], scores: &[f32]) -> bool {
    let at = |of: &[f32]| f64::from(of[(COMPARED * of.len() as f64) as usize]);
    at(scores) <= WIDE * at(noise)
}

/// The deepest valley of the scores from `least` on of which those below are noise by that of the other polarity, or by themselves where there is little, and the share of these.
fn valley(scores: &[f32], noise: &[f32], least: f64) -> Option<(f64, f64)> {
    let sides = tried(scores, least).filter_map(|t| {
        let (left, fewer) = (&scores[..t.below], t.below.min(scores.len() - t.below));
        let is_noise = || if noise.len() >= FEWEST { score_as(noise, left) } else { falls(left, least) };
        let is_valley = fewer >= FEWEST && t.between as f64 <= MOST_BETWEEN * fewer as f64;
        (is_valley && is_noise()).then_some((t, fewer))
    });
    let depth = |(t, fewer): &(Tried, usize)| t.between as f64 / *fewer as f64;
    let (deepest, _) = sides.min_by(|a, b| depth(a).total_cmp(&depth(b)))?;
    Some((round(deepest.k), deepest.below as f64 / scores.len() as f64))
}

/// The score between the noise and a hill above it at which detections are fewest beside the lower of both, surely fewer, and the share below.
fn bottom(scores: &[f32], noise: &[f32], least: f64) -> Option<(f64, f64)> {
    if noise.len() < FEWEST {
        return None;
    }
    let all: Vec<Tried> = tried(scores, least).collect();
    let highest = |of: &[Tried]| of.iter().map(|t| t.between).max().unwrap_or(0) as f64;
    let bottoms = all.iter().enumerate().filter_map(|(i, t)| {
        let (between, lower) = (t.between as f64, highest(&all[..i]).min(highest(&all[i..])));
        let is_sure = lower - between > SURELY * (lower + between).sqrt();
        let are_enough = t.below.min(scores.len() - t.below) >= FEWEST;
        (are_enough && is_sure && score_as(noise, &scores[..t.below])).then_some((t, between / lower))
    });
    let (lowest, _) = bottoms.min_by(|a, b| a.1.total_cmp(&b.1))?;
    Some((round(lowest.k), lowest.below as f64 / scores.len() as f64))
}

/// Whether rising scores from `least` on are the fewer the higher they are, in steps of [`WIDE`] squared, but for chance.
fn falls(scores: &[f32], least: f64) -> bool {
    let below = |s: f64| scores.partition_point(|v| f64::from(*v) < s);
    let most = scores.last().map_or(0.0, |s| f64::from(*s));
    let edges = (0..).map(|i| least * (WIDE * WIDE).powi(i)).take_while(|s| *s <= most);
    let edges: Vec<usize> = edges.map(below).chain([scores.len()]).collect();
    let counts: Vec<f64> = edges.windows(2).map(|e| (e[1] - e[0]) as f64).collect();
    counts.windows(2).all(|c| c[1] <= c[0] + BY_CHANCE * c[0].max(1.0).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    fn rising(mut scores: Vec<f32>) -> Vec<f32> {
        scores.sort_unstable_by(f32::total_cmp);
        scores
    }

    /// Scores whose excess over `from` falls off exponentially, with a mean of `mean`.
    fn tail(rng: &mut ChaCha8Rng, n: usize, from: f32, mean: f32) -> Vec<f32> {
        (0..n).map(|_| from - mean * (1.0 - rng.random::<f32>()).ln()).collect()
    }

    fn even(rng: &mut ChaCha8Rng, n: usize, from: f32, to: f32) -> Vec<f32> {
        (0..n).map(|_| from + (to - from) * rng.random::<f32>()).collect()
    }

    #[test]
    fn a_valley_lies_between_noise_and_targets_that_stand_apart() {
        let rng = &mut ChaCha8Rng::seed_from_u64(8);
        let dark = rising(tail(rng, 600, 2.5, 0.6));
        let noise = tail(rng, 3000, 2.5, 0.6);
        let bright = even(rng, 5000, 30.0, 80.0);
        let (k, share) = valley(&rising([&noise[..], &bright].concat()), &dark, 2.5).unwrap();
        assert!(k > 7.0 && k < 30.0, "{k}");
        assert!((share - 0.375).abs() < 0.01, "{share}");
    }

    #[test]
    fn without_a_valley_it_rises_to_where_a_tenth_is_of_the_other_polarity() {
        let rng = &mut ChaCha8Rng::seed_from_u64(10);
        let noise = tail(rng, 2000, 2.5, 2.0);
        let other = rising(tail(rng, 2000, 2.5, 2.0));
        let own = rising([&noise[..], &even(rng, 3000, 2.5, 60.0)].concat());
        let k = where_few(&own, &other, 2.5).unwrap();
        // 2000 e^(-(k - 2.5) / 2) = 0.1 (as many + 3000 (60 - k) / 57.5): k = 6.2, less by chance.
        assert!((k - 6.1).abs() < 0.4, "{k}");
        assert_eq!(where_few(&own, &other[..200], 2.5), Some(2.5), "few enough as it is");
        assert_eq!(where_few(&[], &other, 2.5), None);
        let decoys = Decoys { own, other, ..Decoys::default() };
        assert_eq!(raised(&decoys, 2.5).map(|r| r.0), Some(k));
    }

    #[test]
    fn where_false_ones_last_it_is_where_the_fewest_are_mistaken() {
        let rng = &mut ChaCha8Rng::seed_from_u64(12);
        let noise = tail(rng, 4500, 2.9, 2.3);
        let other = rising(tail(rng, 2000, 2.9, 2.3));
        let targets: Vec<f32> = (0..1200).map(|_| 30.0 + 8.0 * rng.sample::<f32, _>(StandardNormal)).collect();
        let own = rising([&noise[..], &targets].concat());
        let lasting = other[..1000].to_vec();
        let coded =
            Decoys { own: own.clone(), other: other.clone(), n_first: 2000, lasting, n_near: 400, n_copied: 300 };
        let (k, reason) = raised(&coded, 2.9).unwrap();
        let mistaken = |s: f64| {
            let false_ones = noise.iter().filter(|v| f64::from(**v) >= s).count();
            false_ones + targets.iter().filter(|v| f64::from(**v) < s).count()
        };
        let fewest = (0..400).map(|i| mistaken(2.9 + 0.1 * f64::from(i))).min().unwrap();
        assert!(mistaken(k) <= fewest + fewest / 2 && reason.contains("50 %"), "{k} {} {fewest} {reason}", mistaken(k));
        // A track tells them where they come and go; then faint targets are worth more.
        let white = Decoys { lasting: Vec::new(), ..coded.clone() };
        // Nor what is there again, but measured anew: things that are real.
        let real = Decoys { n_copied: 80, ..coded };
        for decoys in [white, real] {
            assert!(raised(&decoys, 2.9).is_none_or(|r| mistaken(r.0) > 2 * fewest));
        }
        // Noise alone has no hill, and one of targets above nothing but targets is none.
        assert_eq!(bottom(&rising(noise), &other, 2.9), None);
        let hills = rising([even(rng, 3000, 12.0, 20.0), even(rng, 3000, 30.0, 60.0)].concat());
        assert_eq!(bottom(&hills, &other, 2.9), None);
    }

    #[test]
    fn there_is_none_where_targets_begin_in_the_noise_and_none_above_faint_targets() {
        let rng = &mut ChaCha8Rng::seed_from_u64(9);
        let dark = rising(tail(rng, 600, 2.5, 0.6));
        let noise = tail(rng, 3000, 2.5, 0.6);
        let faint = even(rng, 5000, 2.5, 40.0);
        assert_eq!(valley(&rising([&noise[..], &faint].concat()), &dark, 2.5), None);
        // Faint targets as many as the noise, and bright ones: what lies below the valley is no noise.
        let (faint, bright) = (even(rng, 3000, 2.5, 9.0), even(rng, 5000, 40.0, 80.0));
        assert_eq!(valley(&rising([&noise[..], &faint, &bright].concat()), &dark, 2.5), None);
        // The noise is told without the other polarity as well; what scores higher than that does is none, though it falls.
        assert!(valley(&rising([&noise[..], &bright].concat()), &[], 2.5).is_some());
        assert_eq!(valley(&rising([&noise[..], &bright].concat()), &rising(even(rng, 100, 2.5, 2.7)), 2.5), None);
        // A hill of faint targets alone.
        assert!(valley(&rising([&bright[..], &even(rng, 1000, 6.0, 9.0)].concat()), &[], 2.5).is_none());
        assert_eq!(valley(&[], &dark, 2.5), None);
        assert_eq!(valley(&rising([&noise[..], &bright].concat()), &dark, 0.0), None);
    }
}
