//! The level that is drawn with.

use super::{CONTRAST, LEAST_SWITCHING, Look, OFF_LEVEL, ONE_LEVEL, SHARP, STILL};

/// What is drawn with: bright or dark, and how much so.
#[derive(Clone, Copy)]
pub(super) struct Ink {
    pub(super) is_bright: bool,
    /// The middle of its level, counts.
    level: f32,
    /// The level of its thinnest strokes.
    from: f32,
}

impl Ink {
    /// Whether a value is the ink's, or beyond it.
    pub(super) fn is(self, v: f32) -> bool {
        if self.is_bright { v >= self.from } else { v <= self.from }
    }
}

impl Look {
    /// What is drawn with, of places that are sure and of such that switch.
    pub(super) fn ink(&self, sure: &[usize], switching: &[usize]) -> Ink {
        let mut sides = [Vec::new(), Vec::new()];
        for i in sure {
            let [low, high] = self.extremes(&self.mean, *i);
            sides[usize::from(self.mean[*i] >= 0.5 * (low + high))].push(self.mean[*i]);
        }
        sides[1].extend(switching.iter().map(|i| f32::from(self.high[*i])));
        let middle = |of: &mut Vec<f32>| {
            let middle = of.len() / 2;
            (of.len() >= LEAST_SWITCHING as usize).then(|| *of.select_nth_unstable_by(middle, f32::total_cmp).1)
        };
        let typical = middle(&mut self.mean.clone()).unwrap_or_default();
        // Of a letter and its outline that which is farther from the scene.
        let levels = sides.each_mut().map(middle);
        let off = |side: usize| levels[side].map_or(-1.0, |level| (level - typical).abs());
        let is_bright = off(1) >= off(0);
        let level = levels[usize::from(is_bright)].unwrap_or(f32::MAX);
        Ink { is_bright, level, from: level + OFF_LEVEL * (typical - level) }
    }

    /// Sharp edges that stand, on the side of the level that digits are drawn with: who draws digits draws all else with it.
    pub(super) fn of_their_level(&self, switching: &[usize]) -> Vec<usize> {
        let level = self.ink(&[], switching).level;
        let is_drawn = |i: &usize| {
            let near = (self.mean[*i] - level).abs() <= 0.5 * ONE_LEVEL as f32;
            let stands = || self.deviation[*i] <= STILL * CONTRAST;
            let is_sharp = || {
                let [x, y] = self.edge(&self.mean, *i);
                let [low, high] = self.extremes(&self.mean, *i);
                x.max(y) >= CONTRAST && x.max(y) >= SHARP * (high - low)
            };
            near && stands() && is_sharp()
        };
        self.inner(1).filter(is_drawn).collect()
    }
}
