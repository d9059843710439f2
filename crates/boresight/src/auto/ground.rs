//! Where the first frame's ground lies in each of the frames that the choice looks at, and how far from it what stands may seem to lie.
//!
//! Source: our own. Frames with texture all over follow their plane ([`PlaneFollower`]), and each is registered with the first one once more, directly, as long as they
//! share enough; the others follow the motion of [`crate::camera::CameraMotionEstimator`]. A view from the air is a plane at best: what sticks out of it moves against it, as
//! does all that stands around it. So of each cell of a grid the median distance of the patches around from the plane, since the first frame, is the ground's own deviation there; where
//! half of them are not found near it, nothing is known of it ([`UNKNOWN_PX`]). Patches of mere noise have no say ([`SOLID_PX`]).
//! Symbols: image_from_first (px of the frame); cells of the first frame.
//! Limits: where the first frame is not in sight any more, the deviations last measured stay.

use crate::camera::{PlaneFollower, PlanePatches};
use crate::vision::steadied::plane_image;
use crate::{Frame, Homography, Image};
use nalgebra::Vector2;

/// Where the first frame's ground lies.
#[derive(Clone, Debug, PartialEq)]
pub struct Ground {
    first_from_image: Homography,
    /// Deviation of an axis of what stands in each cell, px, row by row; none where nothing was measured.
    spread_px: Vec<f64>,
    /// Size of a cell, px.
    cell_px: Vector2<f64>,
}

/// Cells in x and y.
const CELLS: (usize, usize) = (14, 8);
/// Where patches are not found near the plane it is so uncertain, px: more than anything moves in the frames looked at.
const UNKNOWN_PX: f64 = 50.0;
/// Patches around that tell something.
const LEAST_AROUND: usize = 3;
/// A patch says where the ground is if it was found as near the plane as this in each of the first so many frames, px: noise without texture is not.
const SOLID_PX: f64 = 0.25;
const SOLID_FRAMES: usize = 3;
/// Distances below this are the patches' own noise, px.
const NOISE_PX: f64 = 0.1;
/// Frames in none of which a plane was seen, after which it is looked for no more: a sky, or noise, where the search for it costs
/// most. A quarter of the frames that the choice looks at; what comes into view later is followed by the estimator's motion.
const MOST_WITHOUT: usize = 12;
/// The median of Rayleigh's distribution in deviations of an axis.
const MEDIAN_SD: f64 = 1.1774;

impl From<&Homography> for Ground {
    fn from(image_from_first: &Homography) -> Self {
        Self { first_from_image: image_from_first.inverse(), spread_px: Vec::new(), cell_px: Vector2::zeros() }
    }
}

impl Ground {
    /// Where a point of the image lies on the ground.
    pub fn of(&self, p: Vector2<f64>) -> Vector2<f64> {
        self.first_from_image.apply(p)
    }

    /// Variance per axis of where the ground lies, at a point of it, px².
    pub fn variance(&self, on_ground: Vector2<f64>) -> f64 {
        let cell = |v: f64, size: f64, n: usize| ((v / size).max(0.0) as usize).min(n - 1);
        let place = cell(on_ground.y, self.cell_px.y, CELLS.1) * CELLS.0 + cell(on_ground.x, self.cell_px.x, CELLS.0);
        self.spread_px.get(place).map_or(0.0, |s| s * s)
    }
}

/// The deviation in each cell of the first frame, of that size, from the distances of its patches from the plane.
fn spreads(residuals: &[(Vector2<f64>, Option<f64>)], (w, h): (usize, usize), out: &mut Vec<f64>) {
    let (cw, ch) = (w as f64 / CELLS.0 as f64, h as f64 / CELLS.1 as f64);
    out.clear();
    for y in 0..CELLS.1 {
        for x in 0..CELLS.0 {
            let middle = Vector2::new((x as f64 + 0.5) * cw, (y as f64 + 0.5) * ch);
            let near = |p: &Vector2<f64>| (p.x - middle.x).abs() <= 1.5 * cw && (p.y - middle.y).abs() <= 1.5 * ch;
            let mut around: Vec<f64> = residuals.iter().filter(|r| near(&r.0)).filter_map(|r| r.1).collect();
            if around.len() < LEAST_AROUND {
                out.push(0.0);
                continue;
            }
            let place = around.len() / 2;
            let median = *around.select_nth_unstable_by(place, f64::total_cmp).1;
            let spread = (median / MEDIAN_SD).min(UNKNOWN_PX);
            out.push(if spread < NOISE_PX { 0.0 } else { spread });
        }
    }
}

/// The ground in each frame; `steps` are the estimator's motions from frame to frame.
pub fn follow(frames: &[&Frame], steps: &[Homography]) -> Vec<Ground> {
    let (mut plane, mut first_patches, mut first) =
        (PlaneFollower::default(), PlanePatches::default(), Image::default());
    let (mut line, mut now) = (Vec::new(), Image::default());
    let mut out = Vec::with_capacity(frames.len());
    // In working px.
    let (mut image_from_first, mut spread) = (Homography::identity(), Vec::new());
    let (mut residuals, mut solid) = (Vec::new(), Vec::new());
    let (mut factor, mut ever_seen) = (1, false);
    for (k, (frame, step)) in frames.iter().zip(steps).enumerate() {
        let looks = ever_seen || k < MOST_WITHOUT;
        if looks {
            factor = plane_image(&frame.pixels, &mut line, &mut now);
        }
        let grow = Homography::of_blocks(factor);
        let shrink = grow.inverse();
        match looks.then(|| plane.step(&now)).flatten().filter(|step| step.is_clear()) {
            Some(step) => {
                ever_seen = true;
                image_from_first = image_from_first.then(&step.to_from);
                if let Some(direct) = first_patches.register(&first, &now, &image_from_first) {
                    image_from_first = direct.to_from;
                    residuals.clear();
                    first_patches.residuals(&first, &now, &image_from_first, &mut residuals);
                    if k <= SOLID_FRAMES {
                        solid.resize(residuals.len(), true);
                        let found = residuals.iter().map(|r| r.1.is_none_or(|far| far < SOLID_PX));
                        solid.iter_mut().zip(found).for_each(|(s, f)| *s &= f);
                    }
                    let mut solid = solid.iter();
                    residuals.retain(|_| solid.next().copied().unwrap_or(false));
                    spreads(&residuals, (first.width(), first.height()), &mut spread);
                }
            }
            None if k == 0 => {
                first_patches.choose(&now);
                first.clone_from(&now);
            }
            None => image_from_first = image_from_first.then(&grow.then(step).then(&shrink)),
        }
        if looks {
            plane.keep(&mut now);
        }
        let in_px = shrink.then(&image_from_first).then(&grow);
        let (w, h) = (frame.pixels.width() as f64, frame.pixels.height() as f64);
        out.push(Ground {
            first_from_image: in_px.inverse(),
            spread_px: spread.iter().map(|s| factor as f64 * s).collect(),
            cell_px: Vector2::new(w / CELLS.0 as f64, h / CELLS.1 as f64),
        });
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FrameIndex, Pixels, Timestamp};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Frames of 480 x 360 px: noise, and from frame `from` on a view of many waves before which the camera goes 2 px to the left a frame.
    fn frames(n: u64, from: u64) -> Vec<Frame> {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let waves: Vec<[f64; 4]> = (0..40)
            .map(|_| {
                let (angle, length) = (6.3 * rng.random::<f64>(), 0.05 + 0.4 * rng.random::<f64>());
                [6.0 * rng.random::<f64>(), length * angle.cos(), length * angle.sin(), 6.3 * rng.random::<f64>()]
            })
            .collect();
        let view = |x: f64, y: f64| waves.iter().map(|[a, kx, ky, phase]| a * (kx * x + ky * y + phase).sin()).sum();
        (0..n)
            .map(|k| {
                let mut image = Image::filled(480, 360, 0u8);
                for y in 0..360 {
                    for (x, v) in image.row_mut(y).iter_mut().enumerate() {
                        let seen: f64 = if k < from { 0.0 } else { view(x as f64 - 2.0 * k as f64, y as f64) };
                        *v = (120.0 + seen + 4.0 * (rng.random::<f64>() - 0.5)).round() as u8;
                    }
                }
                Frame { index: FrameIndex(k), time: Timestamp::from_ns(k as i64), pixels: Pixels::Gray8(image) }
            })
            .collect()
    }

    /// How far the ground's origin has gone, px.
    fn gone(n: u64, from: u64, step: Homography) -> f64 {
        let frames = frames(n, from);
        let ground = follow(&frames.iter().collect::<Vec<_>>(), &vec![step; frames.len()]);
        -ground[frames.len() - 1].of(Vector2::zeros()).x
    }

    #[test]
    fn a_plane_that_is_seen_within_the_first_frames_is_followed_and_later_ones_are_not_looked_for() {
        let nothing = Homography::identity();
        let late = MOST_WITHOUT as u64;
        assert!((gone(late + 8, late - 4, nothing) - 2.0 * 11.0).abs() < 0.5);
        assert!(gone(late + 8, late + 2, nothing).abs() < 1e-9);
        // The motions of the frames say it then, each on the one before.
        let shift = Homography::shift(Vector2::new(2.0, 0.0));
        let n = late + 8;
        assert!((gone(n, late + 2, shift) - 2.0 * (n - 1) as f64).abs() < 1e-9);
    }
}
