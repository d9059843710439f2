//! Whether a motion explains most of the image's area, whatever its patches say: a thing of much texture before a quiet ground has nearly all of the patches.
//!
//! Source: our own; block matching by sums of absolute differences ([`super::find_patch`]) over all of the image, and sums added up over neighbours where one says nothing, as in adaptive
//! windows for stereo (T. Kanade, M. Okutomi, *IEEE PAMI* 16, 1994).
//! How: the key frame is cut into tiles of 12 x 12 px, up to its border. Each is laid where the motion has it, and up to [`REACH`] px beside that; it is explained where the best place is the
//! motion's. A tile whose best place does not stand clear of the others says nothing alone: its sums are added up with those of such tiles around it, so that a ground whose texture lies below the
//! noise of a tile is heard, and is not drowned by the few tiles of much texture.
//! What remains uncertain counts against the motion, for its best place lies anywhere: a ground that nobody can see might go another way. What has neither texture nor noise is left out. What stands
//! near the border is asked as all else is, among the places within the image: a thing in the middle of a view covers more of its inner part than of the view.
//! Symbols: rest, the part of a pixel between the whole place that the search is laid around and the motion's. Units: reduced px.
//! Limits: tiles that leave the image with the motion are not asked, and near its border down to half as many places compete; a motion less than half a pixel off is not told from the true one; a
//! ground without any texture is not seen to stand still.

use super::find_patch::{Block, row_of_differences, template};
use super::key_frame::{PATCH, Patch};
use crate::{Homography, Image};
use nalgebra::Vector2;

/// How far beside the motion's place a tile is laid, px: a place by chance is the motion's in one of 150 cases then, π NEAR² / (2 REACH + 1)².
const REACH: usize = 5;
const SIDE: usize = 2 * REACH + 1;
/// Columns of the search, filled up to whole vectors.
const LANES: usize = SIDE.next_multiple_of(8);
/// Rows and columns of the pixels in which a tile is looked for.
const DOWN: usize = SIDE + PATCH - 1;
const ACROSS: usize = LANES + PATCH - 1;
/// Pixels of the image that must lie around a tile where the motion has it: the nearest whole place, half a pixel off at most, and one beyond it for the parabola.
const ROOM: f64 = 1.5;
/// Pixels of the key frame that must lie around a tile at least: by so much, 6 px (0.07 + 0.07) at most, its turn and zoom of a frame move its corners ([`super::fit`]).
const EDGE: usize = 1;
/// A tile is explained where its best place is nearer than this to the motion's, px: farther off another whole place is nearer.
const NEAR: f64 = 0.5;
/// A best place stands clear where every other is this many times as bad. By chance in fewer than one tile of 1 000: a sum over 144 pixels of noise deviates by 6.3 %, and the least of 121 such
/// sums is 1.15 times below the next in none of 3 000 tiles of white noise that were drawn, 1.10 times in one of 180.
const CLEAR: f32 = 1.15;
/// Places nearer than this to the best one are the same peak, px: texture is that wide.
const PEAK: usize = 2;
/// Share of the tiles that must be explained: more than half of the area, by the deviation of a share of 600 tiles of which each is explained or not, 0.5 / √600. The reduced image has up to so
/// many.
const LEAST_SHARE: f64 = 0.52;

type Sums = [[f32; LANES]; SIDE];
type Window = [[f32; ACROSS]; DOWN];

/// A tile laid around the motion's place.
#[derive(Clone, Copy, Debug, Default)]
struct Tile {
    sums: Sums,
    rest: Vector2<f64>,
    /// Whether it says anything by itself, and with others.
    is_asked: bool,
    is_clear: bool,
    /// Distance of its best place from the motion's, px.
    off_px: f64,
}

/// Scratch memory: three rows of tiles.
#[derive(Clone, Debug, Default)]
pub(super) struct Cover {
    rows: [Vec<Tile>; 3],
}

impl Cover {
    /// Whether the motion from `key` to `now` explains most of the area ([`LEAST_SHARE`]); not where nothing is asked. It is asked no longer than it is open.
    pub fn is_most(&mut self, key: &Image<f32>, now: &Image<f32>, motion: &Homography) -> bool {
        let ([n_across, left], [n_down, top]) = (tiles(key.width()), tiles(key.height()));
        self.rows.iter_mut().for_each(|row| {
            row.clear();
            row.resize(n_across, Tile::default());
        });
        let (mut n, mut n_explained) = (0, 0);
        for last in 0..=n_down {
            // Whether those that are left could still change it, if all were asked and all of them explained, or none.
            let n_left = n_across * (n_down + 1 - last.max(1));
            let needed = LEAST_SHARE * (n + n_left) as f64;
            if n_explained as f64 >= needed || ((n_explained + n_left) as f64) < needed {
                return n > 0 && n_explained as f64 >= needed;
            }
            for (x, tile) in self.rows[last % 3].iter_mut().enumerate() {
                let patch = Patch { x: left + x * PATCH, y: top + last * PATCH, weight: 1.0 };
                // Below the last row there is none.
                let laid = if last < n_down { lay(key, now, patch, motion) } else { None };
                *tile = laid.unwrap_or_default();
            }
            // The rows above and below a row must be laid.
            if last > 0 {
                for x in (0..n_across).filter(|x| self.rows[(last - 1) % 3][*x].is_asked) {
                    (n, n_explained) = (n + 1, n_explained + usize::from(self.off_px(last - 1, x) < NEAR));
                }
            }
        }
        n > 0 && n_explained as f64 >= LEAST_SHARE * n as f64
    }

    /// Distance of a tile's best place from the motion's, by the tiles around it where it does not stand clear alone.
    fn off_px(&self, y: usize, x: usize) -> f64 {
        let own = &self.rows[y % 3][x];
        if own.is_clear {
            return own.off_px;
        }
        let (mut sums, mut rest, mut n) = (Sums::default(), Vector2::zeros(), 0.0);
        for row in &self.rows {
            let around = &row[x.saturating_sub(1)..(x + 2).min(row.len())];
            for tile in around.iter().filter(|t| t.is_asked && !t.is_clear) {
                sums.as_flattened_mut().iter_mut().zip(tile.sums.as_flattened()).for_each(|(s, t)| *s += t);
                (rest, n) = (rest + tile.rest, n + 1.0);
            }
        }
        peak(&sums, rest / n).0
    }
}

/// How many tiles lie along a side of the image, and where the first begins, px.
fn tiles(side: usize) -> [usize; 2] {
    let n = side.saturating_sub(2 * EDGE) / PATCH;
    [n, (side - n * PATCH) / 2]
}

/// The sums of a tile around where the motion has it; `None` where that leaves the image, and where all places are alike.
fn lay(key: &Image<f32>, now: &Image<f32>, patch: Patch, motion: &Homography) -> Option<Tile> {
    let template = template(key, patch, &motion.similarity_at(patch.middle()))?;
    let half = 0.5 * (PATCH - 1) as f64;
    let corner = motion.apply(patch.middle()) - Vector2::repeat(half);
    let first = corner.map(|c| c.round() - REACH as f64);
    let (w, h) = (now.width() as f64, now.height() as f64);
    let (low, high) = (corner - Vector2::repeat(ROOM), corner + Vector2::repeat(PATCH as f64 + ROOM));
    if !(low.x >= 0.0 && low.y >= 0.0 && high.x <= w && high.y <= h) {
        return None;
    }
    let mut tile = Tile { rest: corner - first, ..Tile::default() };
    differences(&template, &window(now, (first.x as i64, first.y as i64)), &mut tile.sums);
    let (off_px, best, second) = peak(&tile.sums, tile.rest);
    // Sums of what is no number have no best one.
    tile.is_asked = second > best;
    (tile.is_clear, tile.off_px) = (second > CLEAR * best, off_px);
    tile.is_asked.then_some(tile)
}

/// The pixels in which a tile is looked for, from a first column and row on; infinite outside the image, so that no place there is the best.
fn window(now: &Image<f32>, (left, top): (i64, i64)) -> Window {
    let mut out = [[f32::INFINITY; ACROSS]; DOWN];
    let width = now.width() as i64;
    let (from, until) = (left.clamp(0, width), (left + ACROSS as i64).clamp(0, width));
    for (line, y) in out.iter_mut().zip(top..) {
        if (0..now.height() as i64).contains(&y) {
            let (first, last) = ((from - left) as usize, (until - left) as usize);
            line[first..last].copy_from_slice(&now.row(y as usize)[from as usize..until as usize]);
        }
    }
    out
}

widest! {
    /// Sums of absolute differences with the template's first pixel in each row and column of the search.
    fn differences(template: &Block, window: &Window, out: &mut Sums) {
        for (i, sums) in out.iter_mut().enumerate() {
            *sums = row_of_differences(template, window[i..].iter().map(|line| &line[..]));
        }
    }
}

/// Distance of the best place from `at`, px, with a parabola between whole places; the least sum, and the least of those that are not of its peak.
fn peak(sums: &Sums, at: Vector2<f64>) -> (f64, f32, f32) {
    let (mut best, mut row, mut column) = (f32::INFINITY, 0, 0);
    for (i, line) in sums.iter().enumerate() {
        for (j, sum) in line[..SIDE].iter().enumerate() {
            if *sum < best {
                (best, row, column) = (*sum, i, j);
            }
        }
    }
    let mut second = f32::INFINITY;
    for (i, line) in sums.iter().enumerate() {
        for (j, sum) in line[..SIDE].iter().enumerate() {
            if i.abs_diff(row).max(j.abs_diff(column)) > PEAK {
                second = second.min(*sum);
            }
        }
    }
    if row == 0 || column == 0 || row + 1 == SIDE || column + 1 == SIDE {
        return (f64::INFINITY, best, second);
    }
    let vertex = |before: f32, after: f32| {
        let bend = before - 2.0 * best + after;
        if bend > 0.0 { f64::from(0.5 * (before - after) / bend).clamp(-0.5, 0.5) } else { 0.0 }
    };
    let part = Vector2::new(
        vertex(sums[row][column - 1], sums[row][column + 1]),
        vertex(sums[row - 1][column], sums[row + 1][column]),
    );
    let place = Vector2::new(column as f64, row as f64) + part;
    ((place - at).norm(), best, second)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    const GROUND: Vector2<f64> = Vector2::new(3.3, -1.6);

    /// Two frames of 300 x 200 px: waves of that height (counts) that go by [`GROUND`], and a thing of 60 counts over a share of the width that goes by `thing`; noise of 1 count.
    fn frames(height: f64, share: f64, thing: Vector2<f64>, seed: u64) -> [Image<f32>; 2] {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let waves: Vec<[f64; 3]> = (0..24)
            .map(|_| {
                let mut any = |most: f64| most * (2.0 * rng.random::<f64>() - 1.0);
                [any(0.8), any(0.8), any(3.0)]
            })
            .collect();
        let texture =
            |p: Vector2<f64>| waves.iter().map(|[x, y, phase]| (x * p.x + y * p.y + phase).sin()).sum::<f64>() / 3.5;
        [0.0, 1.0].map(|time| {
            let mut image = Image::filled(300, 200, 0.0f32);
            for y in 0..200 {
                for (x, v) in image.row_mut(y).iter_mut().enumerate() {
                    let p = Vector2::new(x as f64, y as f64);
                    let own = p - time * thing;
                    let value = if own.x < 300.0 * share {
                        60.0 * texture(1.3 * own)
                    } else {
                        height * texture(p - time * GROUND)
                    };
                    let noise: f64 = StandardNormal.sample(&mut rng);
                    *v = (100.0 + value + noise) as f32;
                }
            }
            image
        })
    }

    /// The same of a thing that covers from 20 to 80 % of the width and from 15 to 85 % of the height, 42 % of the view.
    fn frames_with_thing_in_the_middle(thing: Vector2<f64>) -> [Image<f32>; 2] {
        let (mut textured, still) = (frames(60.0, 1.0, thing, 8), frames(0.0, 0.0, thing, 9));
        for (time, (image, ground)) in textured.iter_mut().zip(&still).enumerate() {
            for y in 0..200 {
                for (x, v) in image.row_mut(y).iter_mut().enumerate() {
                    let p = Vector2::new(x as f64, y as f64) - time as f64 * thing;
                    let is_thing = (60.0..240.0).contains(&p.x) && (30.0..170.0).contains(&p.y);
                    *v = if is_thing { *v } else { ground.row(y)[x] };
                }
            }
        }
        textured
    }

    #[test]
    fn a_thing_in_the_middle_covers_more_of_the_inner_part_than_of_the_view() {
        let thing = Vector2::new(-2.0, 2.0);
        // It has half of the tiles that are not laid beyond the border, with those that its rim cuts.
        assert!(!is_most(&frames_with_thing_in_the_middle(thing), thing));
    }

    fn is_most([key, now]: &[Image<f32>; 2], motion: Vector2<f64>) -> bool {
        Cover::default().is_most(key, now, &Homography::shift(motion))
    }

    #[test]
    fn a_thing_of_much_texture_is_not_most_of_a_quieter_ground() {
        let thing = Vector2::new(-2.0, 2.0);
        for (seed, height) in [(1, 3.0), (2, 5.0), (3, 20.0)] {
            let frames = frames(height, 0.33, thing, seed);
            assert!(!is_most(&frames, thing) && is_most(&frames, GROUND), "height {height}");
        }
    }

    #[test]
    fn a_ground_that_few_tiles_hear_alone_is_heard_by_them_together() {
        // A ground of the noise's own deviation: alone 36 % of the tiles find their places.
        let frames = frames(1.0, 0.0, Vector2::zeros(), 7);
        assert!(is_most(&frames, GROUND) && !is_most(&frames, GROUND + Vector2::new(0.0, 2.0)));
    }

    #[test]
    fn a_motion_a_pixel_off_explains_nothing_and_one_a_fifth_off_does() {
        let frames = frames(20.0, 0.0, Vector2::zeros(), 4);
        assert!(is_most(&frames, GROUND) && is_most(&frames, GROUND + Vector2::new(0.15, -0.15)));
        for off in [Vector2::new(1.0, 0.0), Vector2::new(0.0, -3.0), Vector2::new(40.0, 0.0), Vector2::repeat(f64::NAN)]
        {
            assert!(!is_most(&frames, GROUND + off), "{off}");
        }
    }

    #[test]
    fn what_has_neither_texture_nor_noise_is_left_out() {
        // Two thirds of both frames are saturated.
        let mut frames = frames(20.0, 0.0, Vector2::zeros(), 5);
        frames.iter_mut().for_each(|f| (0..130).for_each(|y| f.row_mut(y).fill(255.0)));
        assert!(is_most(&frames, GROUND));
        let noise = frames_of_noise();
        assert!(!is_most(&noise, Vector2::zeros()), "noise is explained by chance alone");
        assert!(!is_most(&[0, 1].map(|_| Image::filled(8, 8, 0.0)), Vector2::zeros()), "no tile");
    }

    fn frames_of_noise() -> [Image<f32>; 2] {
        frames(0.0, 0.0, Vector2::zeros(), 6)
    }
}
