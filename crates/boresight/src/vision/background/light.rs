//! How the light of a frame differs from the background's: a gain and an offset, robust against moving targets.
//!
//! On a grid of pixels the differences from the model's mean are split into two groups, for the darker and the brighter
//! half of the grid; the medians of both, taken again near the first line, give the line difference = offset + (gain - 1) * mean. Up to half of each
//! group may be covered by targets. Limits: gain 0.5 to 1.9; where dark and bright differ by less than 16 deviations the
//! gain stays 1 (the offset alone is well known). Our own method; cost: one pixel in 64.

/// Light of a frame against the model: v = gain * m + offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Light {
    pub(super) gain: f32,
    pub(super) offset: f32,
}

/// No change of light.
pub(super) const SAME: Light = Light { gain: 1.0, offset: 0.0 };

/// Pairs (mean, difference) of the grid, with memory kept.
#[derive(Clone, Debug, Default)]
pub(super) struct Grid {
    pairs: Vec<(f32, f32)>,
    work: Vec<f32>,
}

impl Grid {
    pub(super) fn clear(&mut self) {
        self.pairs.clear();
    }

    pub(super) fn push(&mut self, mean: f32, difference: f32) {
        if mean.is_finite() && difference.is_finite() {
            self.pairs.push((mean, difference));
        }
    }

    /// The light; `deviation` is the typical deviation of a pixel, counts.
    pub(super) fn light(&mut self, deviation: f32) -> Light {
        // Too few pixels to tell light from targets.
        if self.pairs.len() < 64 {
            return SAME;
        }
        let mut light = self.fit(f32::INFINITY, SAME, deviation);
        // Covered pixels on one side shift a median: fit again without those far from the line.
        for _ in 0..2 {
            let residual = |p: &(f32, f32)| (p.1 - line(light, p.0)).abs();
            let Some(mad) = median(&mut self.work, self.pairs.iter().map(residual)) else { return light };
            light = self.fit(2.0 * 1.4826 * mad.max(deviation), light, deviation);
        }
        light
    }

    /// The line through the medians of the dark and the bright pairs within `reach` of the line before.
    fn fit(&mut self, reach: f32, before: Light, deviation: f32) -> Light {
        let Self { pairs, work } = self;
        let near = || pairs.iter().filter(|p| (p.1 - line(before, p.0)).abs() <= reach);
        let Some(split) = median(work, near().map(|p| p.0)) else { return before };
        let mut side = |bright: bool| {
            let group = || near().filter(|p| (p.0 > split) == bright);
            Some((median(work, group().map(|p| p.0))?, median(work, group().map(|p| p.1))?))
        };
        let (dark, bright) = (side(false), side(true));
        let Some((m0, d0)) = dark else { return before };
        let Some((m1, d1)) = bright else { return Light { gain: 1.0, offset: d0 } };
        if m1 - m0 < 16.0 * deviation.max(f32::MIN_POSITIVE) {
            return Light { gain: 1.0, offset: 0.5 * (d0 + d1) };
        }
        let slope = ((d1 - d0) / (m1 - m0)).clamp(-0.5, 0.9);
        Light { gain: 1.0 + slope, offset: d0 - slope * m0 }
    }
}

/// The difference that the light gives at a mean.
fn line(light: Light, mean: f32) -> f32 {
    (light.gain - 1.0) * mean + light.offset
}

fn median(work: &mut Vec<f32>, values: impl Iterator<Item = f32>) -> Option<f32> {
    work.clear();
    work.extend(values);
    if work.is_empty() {
        return None;
    }
    let middle = work.len() / 2;
    Some(*work.select_nth_unstable_by(middle, f32::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gain_and_offset_are_found_though_four_in_ten_pixels_are_covered() {
        let mut grid = Grid::default();
        for i in 0..4000u32 {
            let mean = (i * 37 % 200) as f32 + 20.0;
            let lit = 1.1 * mean - 4.0;
            // Covered pixels have any value; the rest have noise of +-1.
            let v = if i * 7919 % 10 < 4 { (i * 131 % 256) as f32 } else { lit + (i % 3) as f32 - 1.0 };
            grid.push(mean, v - mean);
        }
        let light = grid.light(1.0);
        for m in [30.0, 120.0, 210.0] {
            assert!((light.gain * m + light.offset - (1.1 * m - 4.0)).abs() < 2.0, "{light:?} at {m}");
        }
    }

    #[test]
    fn a_few_pixels_or_a_flat_scene_give_no_gain() {
        let mut grid = Grid::default();
        grid.push(10.0, 5.0);
        assert_eq!(grid.light(1.0), SAME);
        (0..100).for_each(|_| grid.push(10.0, 5.0));
        assert_eq!(grid.light(1.0), Light { gain: 1.0, offset: 5.0 });
    }
}
