//! A frame brought to the light of the frames before it, so that places are told by texture: sums of absolute differences say nothing of a patch all of which is darker. It is asked only where
//! the ground was not found as it is: on a frame that goes by, a shade from light to dark looks like a change of light.
//!
//! Source: our own; gain and offset between frames as in G. D. Hager, P. N. Belhumeur, *IEEE PAMI* 20, 1998, here of the whole frame and by medians, which targets over less than half of it
//! do not move.
//! How: differences of pixels at the same places, of some [`SAMPLES`] of them. Where their median is larger than their deviation from it, the light has changed by more than motion and noise
//! change a pixel: the median is taken off. It is believed where the patches then found are as bright as they were. The ratio of the frames' quartile ranges is the gain, where it leaves less of the differences.
//! Symbols: level = gain · value + offset. Units: counts.
//! Limits: one gain and offset for the whole frame; a gain that changes while the frame moves by more than its texture is wide, or by little from frame to frame, is taken for an offset.

use super::key_frame::{KeyFrame, PATCH};
use crate::{Homography, Image};
use nalgebra::Vector2;

/// Pixels whose differences are looked at: their median is known to 3 % of their deviation.
const SAMPLES: usize = 2000;
/// A gain must leave less than this share of the deviation that an offset alone leaves: by chance it differs by some 3 %.
const GAINED: f32 = 0.8;
/// Gains beyond this, or below its inverse, are no light's: the frame is taken as it is.
const MOST_GAIN: f32 = 64.0;

/// The light of the frames so far.
#[derive(Clone, Debug)]
pub(super) struct Light {
    gain: f32,
    offset: f32,
    /// Scratch memory: the samples of the frame and of the one before, and what is selected from.
    now: Vec<f32>,
    before: Vec<f32>,
    sorted: Vec<f32>,
}

impl Default for Light {
    fn default() -> Self {
        Self { gain: 1.0, offset: 0.0, now: Vec::new(), before: Vec::new(), sorted: Vec::new() }
    }
}

impl Light {
    /// Brings a frame to the light found so far.
    pub fn bring(&self, frame: &mut Image<f32>) {
        let (gain, offset) = (self.gain, self.offset);
        if (gain, offset) != (1.0, 0.0) {
            frame.as_mut_slice().iter_mut().for_each(|v| *v = gain * *v + offset);
        }
    }

    /// Brings `frame` to the light of `before`, the frame before it, both in the light found so far, if the light has changed; then the light that was is returned.
    pub fn change(&mut self, frame: &mut Image<f32>, before: &Image<f32>) -> Option<(f32, f32)> {
        if (frame.width(), frame.height()) != (before.width(), before.height()) {
            return None;
        }
        let step = ((frame.as_slice().len() / SAMPLES) as f64).sqrt().max(1.0) as usize;
        let of = |image: &Image<f32>, out: &mut Vec<f32>| {
            out.clear();
            (0..image.height()).step_by(step).for_each(|y| out.extend(image.row(y).iter().step_by(step)));
        };
        of(frame, &mut self.now);
        of(before, &mut self.before);
        let (mut by, left) = self.offset_to_before(1.0);
        if by.is_nan() || by.abs() <= left {
            return None;
        }
        let [own, others] = [&self.now, &self.before].map(|v| quartile_range(v, &mut self.sorted));
        let mut times = others / own;
        let (by_with, left_with) = self.offset_to_before(times);
        if left_with < GAINED * left {
            by = by_with;
        } else {
            times = 1.0;
        }
        let was = (self.gain, self.offset);
        let (gain, offset) = (times * self.gain, times * self.offset + by);
        if !(offset.is_finite() && (1.0 / MOST_GAIN..=MOST_GAIN).contains(&gain)) {
            return None;
        }
        (self.gain, self.offset) = (gain, offset);
        frame.as_mut_slice().iter_mut().for_each(|v| *v = times * *v + by);
        Some(was)
    }

    /// Whether the patches of a key frame, found in a frame brought to this light, are as bright as they were: more than they would be in the light that `was`.
    pub fn is_that_of(&mut self, key: &KeyFrame, frame: &Image<f32>, motion: &Homography, was: (f32, f32)) -> bool {
        let mean = |image: &Image<f32>, middle: Vector2<f64>| {
            let corner = middle.map(|c| (c - 0.5 * (PATCH - 1) as f64).round());
            let is_inside = corner.x >= 0.0
                && corner.y >= 0.0
                && corner.x as usize + PATCH <= image.width()
                && corner.y as usize + PATCH <= image.height();
            let (x, y) = (corner.x as usize, corner.y as usize);
            is_inside
                .then(|| (y..y + PATCH).flat_map(|r| &image.row(r)[x..x + PATCH]).sum::<f32>() / (PATCH * PATCH) as f32)
        };
        let (gain, offset) = (was.0 / self.gain, was.1 - was.0 / self.gain * self.offset);
        let pairs = || {
            key.patches.iter().filter_map(|p| mean(&key.image, p.middle()).zip(mean(frame, motion.apply(p.middle()))))
        };
        let mut median = |of: &dyn Fn(f32, f32) -> f32| {
            self.sorted.clear();
            self.sorted.extend(pairs().map(|(key, now)| of(key, now).abs()));
            at_share(&mut self.sorted, 0.5)
        };
        median(&|key, now| now - key) < 0.5 * median(&|key, now| gain * now + offset - key)
    }

    /// The light that was is the light again.
    pub fn is_again(&mut self, (gain, offset): (f32, f32)) {
        (self.gain, self.offset) = (gain, offset);
    }

    /// The offset from the frame to the one before at that gain, and the median of what it leaves.
    fn offset_to_before(&mut self, gain: f32) -> (f32, f32) {
        self.sorted.clear();
        self.sorted.extend(self.before.iter().zip(&self.now).map(|(b, n)| b - gain * n));
        let offset = at_share(&mut self.sorted, 0.5);
        self.sorted.iter_mut().for_each(|d| *d = (*d - offset).abs());
        (offset, at_share(&mut self.sorted, 0.5))
    }
}

/// The value that this share of the values lies below; 0 of none.
fn at_share(values: &mut [f32], share: f64) -> f32 {
    let place = (share * values.len() as f64) as usize;
    if place >= values.len() { 0.0 } else { *values.select_nth_unstable_by(place, f32::total_cmp).1 }
}

/// How far the quartiles of the values lie apart.
fn quartile_range(values: &[f32], sorted: &mut Vec<f32>) -> f32 {
    sorted.clear();
    sorted.extend(values);
    at_share(sorted, 0.75) - at_share(sorted, 0.25)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Texture of 10 counts about 110 and noise of one; its first columns are a target of 200 counts over that share of the width; all in a light of that gain and offset.
    fn frame(noise: u64, target: f64, (gain, offset): (f32, f32)) -> Image<f32> {
        let mut rng = ChaCha8Rng::seed_from_u64(noise);
        let mut image = Image::filled(160, 120, 0.0f32);
        for y in 0..120 {
            for (x, v) in image.row_mut(y).iter_mut().enumerate() {
                let texture = 10.0 * ((0.7 * x as f32).sin() + (0.9 * y as f32).sin());
                let is_target = (x as f64) < target * 160.0;
                let level = if is_target { 200.0 } else { 110.0 + texture } + 3.4 * (rng.random::<f32>() - 0.5);
                *v = gain * level + offset;
            }
        }
        image
    }

    /// Largest difference on the ground that is left after each frame was brought to the one before.
    fn left(lights: &[(f32, f32)], target: f64) -> f32 {
        let (first, mut light) = (frame(0, 0.0, lights[0]), Light::default());
        let mut before = first.clone();
        for (k, l) in lights.iter().enumerate().skip(1) {
            let mut now = frame(k as u64, target, *l);
            light.bring(&mut now);
            light.change(&mut now, &before);
            before = now;
        }
        let ground = |i: usize| (i % 160) as f64 >= target * 160.0;
        let all = before.as_slice().iter().zip(first.as_slice()).enumerate().filter(|(i, _)| ground(*i));
        all.map(|(_, (a, b))| (a - b).abs()).fold(0.0, f32::max)
    }

    #[test]
    fn a_light_that_falls_frame_by_frame_leaves_the_noise() {
        // Differences of noise of ±1.7 lie within 3.4, and an offset below their median deviation, 1.0, may be left.
        let falls: Vec<(f32, f32)> = (0..40).map(|k| (1.0, -1.5 * k as f32)).collect();
        assert!(left(&falls, 0.0) < 4.8, "{}", left(&falls, 0.0));
        // Made brighter again, the noise is larger by as much.
        let dimmed = left(&[(1.0, 0.0), (0.6, 5.0)], 0.0);
        assert!(dimmed < 1.7 + 1.7 / 0.6 + 1.0, "{dimmed}");
    }

    #[test]
    fn a_target_over_a_third_of_the_frame_is_no_light() {
        assert!(left(&[(1.0, 0.0), (1.0, 0.0)], 0.33) < 3.5);
        assert!(left(&[(1.0, 0.0), (1.0, 30.0)], 0.33) < 4.5);
    }

    #[test]
    fn the_same_light_changes_no_bit() {
        let (before, mut now) = (frame(1, 0.0, (1.0, 0.0)), frame(2, 0.0, (1.0, 0.4)));
        let as_it_is = now.clone();
        let mut light = Light::default();
        assert!(light.change(&mut now, &before).is_none() && now == as_it_is);
        light.bring(&mut now);
        assert!(now == as_it_is);
    }

    #[test]
    fn what_is_no_number_and_what_has_no_contrast_are_left_as_they_are() {
        for value in [f32::NAN, f32::INFINITY, 0.0] {
            let mut light = Light::default();
            let mut now = Image::filled(160, 120, value);
            for before in [frame(1, 0.0, (1.0, 0.0)), Image::filled(160, 120, 50.0)] {
                light.change(&mut now, &before);
            }
            let mut later = frame(3, 0.0, (1.0, 0.0));
            light.bring(&mut later);
            light.change(&mut later, &frame(1, 0.0, (1.0, 0.0)));
            assert!(later.as_slice().iter().all(|v| v.is_finite()), "{value}");
        }
        assert!(Light::default().change(&mut Image::default(), &Image::default()).is_none());
    }
}
