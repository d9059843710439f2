//! Targets told by their colour: grey and HSI of a colour, pixels that match a reference, and the choice of a reference.
//!
//! Source: `docs/theory/segmentation.md`. [`ColourMatch`] gives one bit a pixel of an RGB frame, exactly where
//! [`distance`] and the saturation say match, at a few operations a pixel: the comparison of angles is done by their
//! cosines in single precision, and the few pixels that lie too near a limit to be sure are computed in full.

mod hsi;
mod mask;
mod reference;

pub use hsi::{Hsi, distance, grey, grey_image, hsi};
pub(super) use mask::{ColourMask, needs_colour};
pub(crate) use reference::GRID_PX;
pub use reference::{Reference, choose_reference};

use crate::Result;
use crate::vision::background::{CleanUp, pack};
use fearless_simd::{Level, dispatch};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Which colours match.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct ColourMatchConfig {
    /// The colour of the target: red, green, blue, 0 to 255.
    pub reference: [u8; 3],
    /// Largest colour distance, above 0 up to 0.5: 0.15 allows a hue 27 degrees off or a saturation 0.3 off.
    pub max_distance: f64,
    /// Smallest saturation, 0 to 1: greys have no hue worth comparing.
    pub min_saturation: f64,
    /// How the matching pixels are cleaned before they are joined.
    pub clean_up: CleanUp,
}

impl Default for ColourMatchConfig {
    fn default() -> Self {
        Self { reference: [0, 255, 0], max_distance: 0.15, min_saturation: 0.1, clean_up: CleanUp::Majority }
    }
}

impl ColourMatchConfig {
    /// Checks the parameters; `at` is the key of this part, for messages.
    /// # Errors
    /// The first parameter out of its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        let wrong = |key: &str, value: f64, expected: &str, hint: &str| {
            Err(crate::validate::wrong(at, key, value, expected, hint))
        };
        if !(self.max_distance > 0.0 && self.max_distance <= 0.5) {
            let hint = "0.15 allows a hue 27 degrees off";
            return wrong("max-distance", self.max_distance, "a colour distance in (0, 0.5]", hint);
        }
        if !(0.0..=1.0).contains(&self.min_saturation) {
            return wrong("min-saturation", self.min_saturation, "a saturation in [0, 1]", "0.1 leaves greys out");
        }
        Ok(())
    }
}

/// Whether a colour matches: the definition, which [`ColourMatch`] follows exactly.
pub fn matches(config: &ColourMatchConfig, rgb: [u8; 3]) -> bool {
    is_match(config, &hsi(config.reference), rgb)
}

fn is_match(config: &ColourMatchConfig, reference: &Hsi, rgb: [u8; 3]) -> bool {
    let c = hsi(rgb);
    c.saturation >= config.min_saturation && distance(&c, reference) <= config.max_distance
}

/// Finds the pixels of a colour, a row at a time.
#[derive(Clone, Debug)]
pub struct ColourMatch {
    config: ColourMatchConfig,
    reference: Hsi,
    terms: Terms,
    states: Vec<u8>,
    planes: [Vec<u8>; 3],
}

/// What the fast comparison needs of the reference.
#[derive(Clone, Copy, Debug)]
struct Terms {
    /// cos and sin of the reference's hue, the latter times sqrt(3).
    along: f32,
    across: f32,
    saturation: f32,
    min_saturation: f32,
    max_distance2: f32,
}

/// States of the fast comparison.
const NO: u8 = 0;
const YES: u8 = 1;
const UNSURE: u8 = 2;

impl ColourMatch {
    /// Builds it.
    /// # Errors
    /// As [`ColourMatchConfig::validate`].
    pub fn new(config: ColourMatchConfig) -> Result<Self> {
        config.validate("colour")?;
        let reference = hsi(config.reference);
        let (sin, cos) = reference.hue_deg.to_radians().sin_cos();
        let terms = Terms {
            along: cos as f32,
            across: (3f64.sqrt() * sin) as f32,
            saturation: reference.saturation as f32,
            min_saturation: config.min_saturation as f32,
            max_distance2: (config.max_distance * config.max_distance) as f32,
        };
        Ok(Self { config, reference, terms, states: Vec::new(), planes: Default::default() })
    }

    /// The configuration it was built from.
    pub fn config(&self) -> &ColourMatchConfig {
        &self.config
    }

    /// Writes bit `x` of `bits` for every pixel that matches; `bits` has `row.len().div_ceil(64)` words.
    pub fn row(&mut self, row: &[[u8; 3]], bits: &mut [u64]) {
        let n = row.len();
        self.states.clear();
        self.states.resize(n.next_multiple_of(64), NO);
        for plane in &mut self.planes {
            plane.resize(n, 0);
        }
        let [r, g, b] = &mut self.planes;
        split(row, r, g, b);
        compare(r, g, b, &self.terms, &mut self.states[..n]);
        // The unsure are few: those on the very limit.
        for (state, &rgb) in self.states.iter_mut().zip(row) {
            if *state == UNSURE {
                *state = u8::from(is_match(&self.config, &self.reference, rgb));
            }
        }
        let states = &self.states;
        dispatch!(Level::new(), simd => pack(simd, states, bits));
    }
}

widest! {
    fn split(row: &[[u8; 3]], r: &mut [u8], g: &mut [u8], b: &mut [u8]) {
        let n = row.len();
        let (r, g, b) = (&mut r[..n], &mut g[..n], &mut b[..n]);
        for x in 0..n {
            [r[x], g[x], b[x]] = row[x];
        }
    }
}

/// cos(pi sqrt(q)) for 0 <= q <= 1/4, by its series in q; error below 1e-7.
#[inline(always)]
fn cos_of_root(q: f32) -> f32 {
    // (-pi²)^k / (2k)!
    const C: [f32; 7] = [1.0, -4.934_802, 4.058_712, -1.335_262_7, 0.235_330_63, -0.025_806_89, 0.001_929_574_3];
    C[0] + q * (C[1] + q * (C[2] + q * (C[3] + q * (C[4] + q * (C[5] + q * C[6])))))
}

widest! {
    fn compare(r: &[u8], g: &[u8], b: &[u8], t: &Terms, states: &mut [u8]) {
        /// Far above the error of single precision here, far below what a step of a pixel makes, mostly.
        const NEAR: f32 = 2e-5;
        let n = states.len();
        let (r, g, b) = (&r[..n], &g[..n], &b[..n]);
        for x in 0..n {
            let (red, green, blue) = (f32::from(r[x]), f32::from(g[x]), f32::from(b[x]));
            let least = f32::from(r[x].min(g[x]).min(b[x]));
            let sum = red + green + blue;
            let saturation = 1.0 - 3.0 * least / sum.max(1.0);
            // Twice the colour's vector in the plane of hues: (u, sqrt(3) v); its length and its part along the reference.
            let (u, v) = (2.0 * red - green - blue, green - blue);
            let length2 = u * u + 3.0 * v * v;
            let along = u * t.along + v * t.across;
            let off = 0.5 * (saturation - t.saturation);
            let q = t.max_distance2 - off * off;
            let cos = cos_of_root(q.max(0.0));
            // Squares with their sign, so that an angle above 90 degrees is not taken for one below.
            let margin = along * along.abs() - cos * cos * length2;
            let near = NEAR * length2;
            let grey = length2 == 0.0;
            let maybe = (margin >= -near) & (q >= -NEAR) & (saturation >= t.min_saturation - NEAR) | grey;
            let sure = (margin > near) & (q > NEAR) & (saturation > t.min_saturation + NEAR) & !grey;
            // Greys match only where the limit of saturation lets them.
            let maybe = maybe & (!grey | (t.min_saturation <= NEAR));
            states[x] = if sure {
                YES
            } else if maybe {
                UNSURE
            } else {
                NO
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]

        #[test]
        fn the_fast_comparison_is_the_definition_bit_for_bit(
            reference: [u8; 3], max_distance in 0.01f64..0.5, min_saturation in 0.0f64..0.6, seed: u32, near: bool, w in 1usize..200,
        ) {
            let config = ColourMatchConfig { reference, max_distance, min_saturation, ..Default::default() };
            let mut fast = ColourMatch::new(config).unwrap();
            let mut s = u64::from(seed);
            for _ in 0..10 {
                let row: Vec<[u8; 3]> = (0..w)
                    .map(|_| {
                        s = s.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                        let v = (s >> 32).to_le_bytes();
                        let any = [v[0], v[1], v[2]];
                        if near { std::array::from_fn(|i| reference[i].wrapping_add(any[i] % 32)) } else { any }
                    })
                    .collect();
                let mut bits = vec![u64::MAX; w.div_ceil(64)];
                fast.row(&row, &mut bits);
                for x in 0..bits.len() * 64 {
                    let want = row.get(x).is_some_and(|&rgb| matches(&config, rgb));
                    prop_assert_eq!(bits[x / 64] >> (x % 64) & 1 == 1, want, "{:?} at {}", row.get(x), x);
                }
            }
        }
    }

    #[test]
    fn the_default_tolerance_is_exact_on_a_grid_over_all_colours() {
        for reference in [[60, 200, 80], [255, 0, 0], [30, 30, 200], [128, 128, 128]] {
            let config = ColourMatchConfig { reference, ..ColourMatchConfig::default() };
            let mut fast = ColourMatch::new(config).unwrap();
            for r in (0..=255u8).step_by(5) {
                let row: Vec<[u8; 3]> = (0..52 * 52u32).map(|i| [r, (i % 52 * 5) as u8, (i / 52 * 5) as u8]).collect();
                let mut bits = vec![0; row.len().div_ceil(64)];
                fast.row(&row, &mut bits);
                for (x, &rgb) in row.iter().enumerate() {
                    assert_eq!(bits[x / 64] >> (x % 64) & 1 == 1, matches(&config, rgb), "{rgb:?}");
                }
            }
        }
    }

    #[test]
    fn tolerances_outside_their_ranges_are_refused() {
        for (max_distance, min_saturation) in [(0.0, 0.1), (0.6, 0.1), (f64::NAN, 0.1), (0.1, -0.1), (0.1, 1.1)] {
            assert!(
                ColourMatch::new(ColourMatchConfig { max_distance, min_saturation, ..Default::default() }).is_err()
            );
        }
    }
}
