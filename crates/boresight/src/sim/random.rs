//! Seeded randomness: independent streams by name, and white pixel noise at the speed of memory.
//!
//! Streams: ChaCha8 keyed by (seed, run), one stream per (purpose, index), so that frame 40 of target 2 draws the same
//! numbers whatever was drawn before it. Pixel noise of 8-bit frames: the quantised, clamped normal is a
//! distribution over 256 levels, sampled without rounding error by the alias method (A. J. Walker, *Electronics Letters*
//! 10, 1974; table built as in M. D. Vose, *IEEE Trans. Softw. Eng.* 17, 1991) from the 32-bit words of 16 interleaved
//! xoshiro128++ generators (D. Blackman, S. Vigna, *ACM Trans. Math. Softw.* 47, 2021), each seeded by ChaCha8.
//! Departure: level probabilities are rounded to 2⁻³² (24-bit alias thresholds in 256 cells).
//! Units: levels are counts 0..=255. Limits: not for secrets; a stream repeats after 2¹²⁸ words.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use statrs::function::erf::erfc;

/// Number of interleaved generators: four AVX2 or one AVX-512 register of words.
const LANES: usize = 16;

/// What a stream of random numbers is for; two purposes never share numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u16)]
pub enum Purpose {
    /// White noise of the pixels of a frame.
    Pixels = 1,
    /// Accelerations of a target.
    Motion = 2,
    /// A target's texture.
    Texture = 3,
    /// Correlated clutter of the background.
    Clutter = 4,
    /// Noise of the sensor's electronics in a frame.
    Sensor = 5,
    /// What stays the same in all frames of a sensor: dead pixels, fixed pattern.
    FixedPattern = 6,
    /// Dropped frames, times, camera jitter.
    Timing = 7,
    /// Plots of a radar.
    Radar = 8,
    /// Anything of a scenario's own (start states, biases).
    Scenario = 9,
    /// White noise of the pixels of rectangular targets in a frame.
    TargetPixels = 10,
}

/// The seed of a scene: a number given by the user and the number of the Monte Carlo run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Seed {
    /// The user's seed.
    pub seed: u64,
    /// Run of a Monte Carlo study, from 0.
    pub run: u64,
}

impl Seed {
    /// The seed of a single scene (run 0).
    pub const fn new(seed: u64) -> Self {
        Self { seed, run: 0 }
    }

    /// The same seed for Monte Carlo run `run`.
    pub const fn of_run(self, run: u64) -> Self {
        Self { seed: self.seed, run }
    }

    /// Returns the stream of random numbers for one purpose and index (of a frame, of a target).
    pub fn stream(self, purpose: Purpose, index: u64) -> ChaCha8Rng {
        let mut key = [0u8; 32];
        key[..8].copy_from_slice(&self.seed.to_le_bytes());
        key[8..16].copy_from_slice(&self.run.to_le_bytes());
        key[16..18].copy_from_slice(&(purpose as u16).to_le_bytes());
        key[18..].copy_from_slice(b"boresight sim.");
        let mut rng = ChaCha8Rng::from_seed(key);
        rng.set_stream(index);
        rng
    }
}

/// Probability of each 8-bit level under `q(mean + std z)`, q = round half up and clamp to 0..=255
/// (`docs/theory/image.md`). `std = 0` puts all on one level.
pub fn level_probabilities(mean: f64, std: f64) -> [f64; 256] {
    let mut p = [0.0; 256];
    if std <= 0.0 {
        p[usize::from(crate::sim::quantise(mean))] = 1.0;
        return p;
    }
    let z = |level: f64| (level - mean) / (std * std::f64::consts::SQRT_2);
    for (g, p) in p.iter_mut().enumerate() {
        let g = g as f64;
        let (lo, hi) = (
            if g == 0.0 { f64::NEG_INFINITY } else { z(g - 0.5) },
            if g == 255.0 { f64::INFINITY } else { z(g + 0.5) },
        );
        // Above the mean the survival function keeps the digits that 1 - cdf would lose.
        *p = if lo > 0.0 { 0.5 * (erfc(lo) - erfc(hi)) } else { 0.5 * (erfc(-hi) - erfc(-lo)) };
    }
    let sum: f64 = p.iter().sum();
    p.map(|v| v / sum)
}

/// Alias table of a distribution over the 256 levels of an 8-bit pixel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LevelTable {
    /// Cell i: bits 8..32 = threshold below which the cell's own level i is taken, bits 0..8 = the level taken else.
    cells: [u32; 256],
}

impl LevelTable {
    /// Builds the table of `q(mean + std z)` (counts).
    pub fn normal(mean: f64, std: f64) -> Self {
        Self::from_probabilities(&level_probabilities(mean, std))
    }

    /// Builds the table of any distribution over the levels (probabilities that sum to 1).
    pub fn from_probabilities(p: &[f64; 256]) -> Self {
        let mut scaled = p.map(|v| v * 256.0);
        let (mut small, mut large): (Vec<usize>, Vec<usize>) = (0..256).partition(|&i| scaled[i] < 1.0);
        let mut own = [1.0; 256];
        let mut alias: [usize; 256] = std::array::from_fn(|i| i);
        while let (Some(&s), Some(&l)) = (small.last(), large.last()) {
            small.pop();
            own[s] = scaled[s];
            alias[s] = l;
            scaled[l] -= 1.0 - scaled[s];
            if scaled[l] < 1.0 {
                large.pop();
                small.push(l);
            }
        }
        let full = f64::from(1u32 << 24);
        let cells = std::array::from_fn(|i| {
            if alias[i] == i {
                return ((1 << 24) - 1) << 8 | i as u32;
            }
            let threshold = (own[i] * full).round().clamp(0.0, full - 1.0) as u32;
            threshold << 8 | alias[i] as u32
        });
        Self { cells }
    }
}

/// White noise of one frame's pixels, drawn from level tables.
#[derive(Clone, Debug)]
pub struct LevelNoise {
    state: [[u32; LANES]; 4],
}

impl LevelNoise {
    /// The noise of frame `frame` of a scene, for one purpose.
    pub fn new(seed: Seed, purpose: Purpose, frame: u64) -> Self {
        let mut rng = seed.stream(purpose, frame);
        let mut state = [[0; LANES]; 4];
        for row in &mut state {
            for s in row {
                *s = rng.next_u32();
            }
        }
        // An all-zero generator would stay zero (chance 2⁻¹²⁸ a lane).
        for lane in 0..LANES {
            if state.iter().all(|row| row[lane] == 0) {
                state[0][lane] = 1;
            }
        }
        Self { state }
    }

    /// Fills `out` with independent draws from `table`.
    pub fn fill(&mut self, table: &LevelTable, out: &mut [u8]) {
        fill_levels(&mut self.state, &table.cells, out);
    }
}

widest! {
    fn fill_levels(state: &mut [[u32; LANES]; 4], cells: &[u32; 256], out: &mut [u8]) {
        let [mut s0, mut s1, mut s2, mut s3] = *state;
        let mut chunks = out.chunks_exact_mut(LANES);
        let mut words = [0u32; LANES];
        let mut next = |words: &mut [u32; LANES]| {
            for i in 0..LANES {
                words[i] = s0[i].wrapping_add(s3[i]).rotate_left(7).wrapping_add(s0[i]);
                let t = s1[i] << 9;
                s2[i] ^= s0[i];
                s3[i] ^= s1[i];
                s1[i] ^= s2[i];
                s0[i] ^= s3[i];
                s2[i] ^= t;
                s3[i] = s3[i].rotate_left(11);
            }
        };
        for chunk in &mut chunks {
            next(&mut words);
            for i in 0..LANES {
                chunk[i] = pick(cells, words[i]);
            }
        }
        let rest = chunks.into_remainder();
        if !rest.is_empty() {
            next(&mut words);
            for (p, w) in rest.iter_mut().zip(words) {
                *p = pick(cells, w);
            }
        }
        *state = [s0, s1, s2, s3];
    }
}

/// The level that a random word stands for: the upper 8 bits name the cell, the lower 24 choose in it.
#[inline(always)]
fn pick(cells: &[u32; 256], word: u32) -> u8 {
    let cell = word >> 24;
    let entry = cells[cell as usize];
    if word & 0x00ff_ffff < entry >> 8 { cell as u8 } else { entry as u8 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use statrs::distribution::{ChiSquared, ContinuousCDF};

    /// χ² of drawn levels against the exact probabilities (cells with expectation below 5 pooled).
    fn chi_square_probability(counts: &[u64; 256], p: &[f64; 256]) -> f64 {
        let n: u64 = counts.iter().sum();
        let (mut stat, mut cells, mut rest, mut rest_p) = (0.0, 0.0, 0.0, 0.0);
        for (c, p) in counts.iter().zip(p) {
            let expected = n as f64 * p;
            if expected < 5.0 {
                rest += *c as f64;
                rest_p += expected;
            } else {
                stat += (*c as f64 - expected).powi(2) / expected;
                cells += 1.0;
            }
        }
        if rest_p > 5.0 {
            stat += (rest - rest_p).powi(2) / rest_p;
            cells += 1.0;
        }
        1.0 - ChiSquared::new(cells - 1.0).unwrap().cdf(stat)
    }

    #[test]
    fn drawn_levels_follow_the_quantised_normal_exactly() {
        for (mean, std) in [(50.0, 50.0), (100.0, 10.0), (100.0, 1.0), (200.0, 50.0), (50.0, 100.0)] {
            let table = LevelTable::normal(mean, std);
            let mut counts = [0u64; 256];
            let mut buffer = vec![0u8; 64 * 64];
            for frame in 0..500 {
                LevelNoise::new(Seed::new(7), Purpose::Pixels, frame).fill(&table, &mut buffer);
                for &g in &buffer {
                    counts[usize::from(g)] += 1;
                }
            }
            let p = chi_square_probability(&counts, &level_probabilities(mean, std));
            assert!(p > 1e-4, "N({mean}, {std}²): chi-square probability {p}");
        }
    }

    #[test]
    fn neighbouring_pixels_rows_and_frames_are_uncorrelated() {
        let table = LevelTable::normal(128.0, 20.0);
        let n = 1 << 16;
        let draw = |frame| {
            let mut b = vec![0u8; n];
            LevelNoise::new(Seed::new(3), Purpose::Pixels, frame).fill(&table, &mut b);
            b.iter().map(|g| (f64::from(*g) - 128.0) / 20.0).collect::<Vec<_>>()
        };
        let (a, b) = (draw(0), draw(1));
        let limit = 4.5 / (n as f64).sqrt();
        for lag in [1, 2, 15, 16, 17, 32, 63, 64, 65, 4096] {
            let r: f64 = a.iter().zip(&a[lag..]).map(|(x, y)| x * y).sum::<f64>() / (n - lag) as f64;
            assert!(r.abs() < limit, "lag {lag}: {r}");
        }
        let r: f64 = a.iter().zip(&b).map(|(x, y)| x * y).sum::<f64>() / n as f64;
        assert!(r.abs() < limit, "next frame: {r}");
        // Squares too: a generator with short memory shows there first.
        let r: f64 = a.iter().zip(&a[16..]).map(|(x, y)| (x * x - 1.0) * (y * y - 1.0)).sum::<f64>() / n as f64;
        assert!(r.abs() < 2.0 * limit, "squares: {r}");
    }

    #[test]
    fn a_stream_does_not_depend_on_what_was_drawn_before() {
        let seed = Seed::new(1).of_run(5);
        let first = seed.stream(Purpose::Motion, 2).next_u64();
        let _ = seed.stream(Purpose::Motion, 1).next_u64();
        assert_eq!(first, seed.stream(Purpose::Motion, 2).next_u64());
        assert_ne!(first, seed.stream(Purpose::Radar, 2).next_u64());
        assert_ne!(first, seed.of_run(6).stream(Purpose::Motion, 2).next_u64());
    }

    #[test]
    fn no_spread_gives_one_level() {
        let mut b = [0u8; 33];
        LevelNoise::new(Seed::new(1), Purpose::Pixels, 0).fill(&LevelTable::normal(50.0, 0.0), &mut b);
        assert_eq!(b, [50; 33]);
    }
}
