//! Whether another view has begun: a cut of a film, or a camera that was turned away from one frame to the next.
//!
//! Source: shot-boundary detection by the change of a small picture, measured by what it usually is (A. Hanjalic, "Shot-boundary detection: unraveled and resolved?",
//! *IEEE Trans. Circuits and Systems for Video Technology* 12(2), 2002). It is asked only where no patch of the frames before was found again.
//! How: a thumbnail of some 20 x 16 means; D = 1 - r², r the correlation of two frames' thumbnails: the share of its variance that the frame before does not explain, at any gain and
//! offset. Blur, noise and grain leave thumbnails as they are. Another view may have begun where D exceeds [`LEAST_CHANGE`] and [`JUMP`] times its mean; a jerk does that too, so
//! that D of means over [`BLOCK`] x [`BLOCK`] must exceed [`LEAST_CHANGE`] at every shift of up to [`REACH`] of them.
//! Limits: views of the same place from the same direction are one; a fade is none; what has no contrast has no correlation.

use super::reduce::blocks;
use crate::Image;

/// Least D of another view, at the best shift: of 630 pairs of frames of different infrared and visible clips of flying things 98.3 % differ by more, and the rest are views of one
/// place. The two cuts in those clips have 0.36 and 0.23, the six largest other changes 0.006 to 0.024.
const LEAST_CHANGE: f64 = 0.1;
/// How many times its mean D must be: where a camera pans fast every frame is another one. Those cuts have 53 and 1e5 times the mean.
const JUMP: f64 = 20.0;
/// What one frame leaves of the frames before in the mean of D: a memory of 10 frames.
const MEMORY: f64 = 0.9;
/// Frames whose D makes a mean.
const LEAST_FRAMES: u32 = 5;
/// Cells along a thumbnail's longer side.
const CELLS: usize = 20;

/// Side of the blocks that a jerk is looked for by, reduced px, and how far, blocks: 24 of 320 px.
const BLOCK: usize = 4;
const REACH: i32 = 6;

/// Thumbnails of this frame and the one before.
#[derive(Clone, Debug, Default)]
pub(super) struct OtherView {
    now: Image<f32>,
    before: Image<f32>,
    mean: f64,
    n: u32,
    change: f64,
    small: [Image<f32>; 2],
    sums: Vec<f32>,
}

impl OtherView {
    /// Takes the next reduced frame.
    pub fn take(&mut self, frame: &Image<f32>) {
        // What was another view is none of the usual changes.
        if self.n > 0 && !self.may_be_other() {
            let weight = (1.0 - MEMORY).max(1.0 / f64::from(self.n));
            self.mean += weight * (self.change - self.mean);
        }
        std::mem::swap(&mut self.now, &mut self.before);
        blocks(frame, frame.width().max(frame.height()).div_ceil(CELLS).max(1), &mut self.now, &mut self.sums, |p| p);
        if is_alike(&self.before, &self.now) {
            self.change = change(&self.before, &self.now, (0, 0));
            self.n = self.n.saturating_add(1);
        } else {
            (self.change, self.mean, self.n) = (0.0, 0.0, 0);
        }
    }

    /// Whether the frame taken last, `now`, shows another view than the one before it, `last`.
    pub fn is_other(&mut self, last: &Image<f32>, now: &Image<f32>) -> bool {
        if !self.may_be_other() || !is_alike(last, now) {
            return false;
        }
        for (image, small) in [last, now].into_iter().zip(&mut self.small) {
            blocks(image, BLOCK, small, &mut self.sums, |p| p);
        }
        let [a, b] = &self.small;
        let mut shifts = (-REACH..=REACH).flat_map(|dy| (-REACH..=REACH).map(move |dx| (dx, dy)));
        shifts.all(|shift| change(a, b, shift) > LEAST_CHANGE)
    }

    fn may_be_other(&self) -> bool {
        self.n > LEAST_FRAMES && self.change > LEAST_CHANGE && self.change > JUMP * self.mean
    }
}

fn is_alike(a: &Image<f32>, b: &Image<f32>) -> bool {
    (a.width(), a.height()) == (b.width(), b.height())
}

/// 1 - r² of two pictures in pairs of their pixels; 0 where one has no contrast, and where there is none.
fn of_pairs(pairs: impl Iterator<Item = (f32, f32)> + Clone) -> f64 {
    let (mut n, mut sums) = (0.0, [0.0; 2]);
    for (x, y) in pairs.clone() {
        (n, sums) = (n + 1.0, [sums[0] + f64::from(x), sums[1] + f64::from(y)]);
    }
    let (mut aa, mut ab, mut bb) = (0.0, 0.0, 0.0);
    for (x, y) in pairs {
        let (x, y) = (f64::from(x) - sums[0] / n, f64::from(y) - sums[1] / n);
        (aa, ab, bb) = (aa + x * x, ab + x * y, bb + y * y);
    }
    if aa * bb > 0.0 { 1.0 - ab * ab / (aa * bb) } else { 0.0 }
}

/// The same of two images of one size, the second one moved by so much.
fn change(a: &Image<f32>, b: &Image<f32>, (dx, dy): (i32, i32)) -> f64 {
    let part = |of: &Image<f32>, x: i32, y: i32| {
        let (cut_x, cut_y) = (dx.unsigned_abs() as usize, dy.unsigned_abs() as usize);
        let (w, h) = (of.width().saturating_sub(cut_x), of.height().saturating_sub(cut_y));
        ((x.max(0) as usize, y.max(0) as usize), (w, h))
    };
    let ((ax, ay), (w, h)) = part(a, -dx, -dy);
    let ((bx, by), _) = part(b, dx, dy);
    of_pairs(
        (0..h).flat_map(move |y| {
            a.row(ay + y)[ax..ax + w].iter().copied().zip(b.row(by + y)[bx..bx + w].iter().copied())
        }),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture of smooth hills; `seed` says which, `gain` and `offset` how bright, `shift_px` how far to the left.
    fn hills(seed: f32, gain: f32, offset: f32, shift_px: f32) -> Image<f32> {
        let mut image = Image::filled(160, 128, 0.0f32);
        for y in 0..128 {
            image.row_mut(y).iter_mut().enumerate().for_each(|(x, p)| {
                let (x, y) = ((x as f32 + shift_px) / 20.0, y as f32 / 20.0);
                *p = offset + gain * ((x * (1.0 + seed)).sin() * (y + 3.0 * seed).cos() + 0.3 * (x + seed * y).sin());
            });
        }
        image
    }

    /// Takes frames one after the other; whether the last one is of another view than the one before.
    fn is_other_after(view: &mut OtherView, frames: &[Image<f32>]) -> bool {
        frames.iter().for_each(|f| view.take(f));
        let [.., last, now] = frames else { return false };
        view.is_other(last, now)
    }

    #[test]
    fn another_view_is_seen_and_another_exposure_or_a_jerk_is_not() {
        // Grain: every frame differs a little.
        let still: Vec<Image<f32>> = (0..20usize)
            .map(|k| {
                let mut frame = hills(0.0, 50.0, 100.0, 0.0);
                let grain = |i: usize| ((i * 7919 + k * 104_729) % 11) as f32;
                frame.as_mut_slice().iter_mut().enumerate().for_each(|(i, p)| *p += grain(i));
                frame
            })
            .collect();
        let then = |now: Image<f32>| {
            let mut view = OtherView::default();
            is_other_after(&mut view, &[&still[..], &[now]].concat())
        };
        assert!(!then(still[3].clone()));
        assert!(!then(hills(0.0, 25.0, 10.0, 0.0)), "half as bright");
        assert!(!then(hills(0.0, 50.0, 100.0, 12.0)), "a jerk");
        assert!(then(hills(0.7, 50.0, 100.0, 0.0)));
        let other = || hills(0.7, 50.0, 100.0, 0.0);
        let mut view = OtherView::default();
        assert!(!is_other_after(&mut view, &[&still[..], &[other(), other()]].concat()), "it has begun");
        assert!(is_other_after(&mut view, &[other(), still[0].clone()]), "and back");
    }

    #[test]
    fn nothing_is_said_of_what_has_no_contrast_or_no_past() {
        let flat: Vec<Image<f32>> = (0..20u8).map(|k| Image::filled(64, 48, f32::from(k))).collect();
        assert!(!is_other_after(&mut OtherView::default(), &flat));
        let two = [hills(0.0, 50.0, 0.0, 0.0), hills(0.7, 50.0, 0.0, 0.0)];
        assert!(!is_other_after(&mut OtherView::default(), &two), "two frames have no usual change");
    }

    #[test]
    fn the_change_is_one_less_the_squared_correlation() {
        // Of (1, 2, 3, 4) and (1, 3, 2, 4): means 2.5, sums of squares 5 and 5, of products 4: r = 0.8.
        let row = |v: [f32; 4]| Image::from_vec(4, 1, v.to_vec()).unwrap();
        let of = |a, b| change(&row(a), &row(b), (0, 0));
        assert!((of([1.0, 2.0, 3.0, 4.0], [1.0, 3.0, 2.0, 4.0]) - 0.36).abs() < 1e-12);
        assert!(of([1.0, 2.0, 3.0, 4.0], [7.0, 9.0, 11.0, 13.0]).abs() < 1e-12);
        // Two pixels to the left and one down.
        let (mut a, mut b) = (hills(0.0, 1.0, 0.0, 0.0), Image::filled(160, 128, 0.0f32));
        (0..127).for_each(|y| b.row_mut(y + 1)[..158].copy_from_slice(&a.row(y)[2..]));
        assert!(change(&a, &b, (-2, 1)).abs() < 1e-9 && change(&a, &b, (2, -1)) > 1e-3);
        a.reset(2, 2, 0.0);
        assert_eq!(change(&a, &a.clone(), (6, -6)), 0.0, "nothing is left of it");
    }
}
