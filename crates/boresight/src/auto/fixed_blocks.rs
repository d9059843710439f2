//! Whether the ground stands, told by blocks: even texture and slow shades have no feature to follow, but they fit themselves best where they are.
//!
//! Source: our own. The mean of the first frames and that of the last ones, in the same light, are compared block by block at shift 0 and at the eight shifts of [`SHIFT_PX`] around
//! it; by chance, or on ground that has gone, 0 has the least squared difference in one block of nine, on ground that stands in more. A turn or a zoom leaves the middle where it is, so each quarter of
//! the frame is asked for itself, and no other shift may win as often there.
//! Limits: what moves by less than half of [`SHIFT_PX`] of the grid between the frames compared stands; a sensor's own pattern stands as well.

use crate::Image;

/// Side of a block, px of the grid.
const BLOCK: usize = 16;
/// The shift that is compared with none, px of the grid.
const SHIFT_PX: usize = 1;
/// Share of the frames that each mean is of.
const SHARE: usize = 4;
/// By chance a camera is called fixed more rarely than this, in each quarter of the frame.
const MOST_CHANCE: f64 = 0.01;

/// Whether the ground of the grids stands.
pub fn stands(grids: &[Image<f32>]) -> bool {
    let n = grids.len() / SHARE;
    let Some(first) = grids.first().filter(|_| n > 0) else { return false };
    let (w, h) = (first.width(), first.height());
    let mut quarters = [[0usize; 9]; 4];
    let [a, mut b] = [&grids[..n], &grids[grids.len() - n..]].map(mean);
    // What most of the frame became brighter by is light.
    let mut brighter: Vec<f32> = b.as_slice().iter().zip(a.as_slice()).map(|(b, a)| b - a).collect();
    let middle = brighter.len() / 2;
    if middle > 0 {
        let light = *brighter.select_nth_unstable_by(middle, f32::total_cmp).1;
        b.as_mut_slice().iter_mut().for_each(|v| *v -= light);
    }
    for y in (SHIFT_PX..(h + 1).saturating_sub(BLOCK + SHIFT_PX)).step_by(BLOCK) {
        for x in (SHIFT_PX..(w + 1).saturating_sub(BLOCK + SHIFT_PX)).step_by(BLOCK) {
            let quarter = usize::from(2 * (x + BLOCK / 2) > w) + 2 * usize::from(2 * (y + BLOCK / 2) > h);
            quarters[quarter][best(&a, &b, x, y)] += 1;
        }
    }
    quarters.iter().all(|wins| {
        let n: usize = wins.iter().sum();
        let most_other = wins.iter().enumerate().filter(|(s, _)| *s != 4).map(|(_, n)| *n).max().unwrap_or(0);
        wins[4] > most_other && by_chance(wins[4], n) < MOST_CHANCE
    })
}

/// The mean of frames of one size.
fn mean(grids: &[Image<f32>]) -> Image<f32> {
    let mut sum = Image::filled(grids[0].width(), grids[0].height(), 0.0f32);
    for g in grids {
        for y in 0..sum.height() {
            sum.row_mut(y).iter_mut().zip(g.row(y)).for_each(|(s, v)| *s += v / grids.len() as f32);
        }
    }
    sum
}

/// The place of the least difference among the nine shifts in rows; 4 is none.
fn best(a: &Image<f32>, b: &Image<f32>, x: usize, y: usize) -> usize {
    let mut least = (f64::INFINITY, 0);
    for s in 0..9 {
        let (dx, dy) = (s % 3 * SHIFT_PX, s / 3 * SHIFT_PX);
        let mut sum = 0.0f64;
        for row in 0..BLOCK {
            let ours = &a.row(y + row)[x..x + BLOCK];
            let theirs = &b.row(y + row + dy - SHIFT_PX)[x + dx - SHIFT_PX..][..BLOCK];
            sum += ours.iter().zip(theirs).map(|(p, q)| f64::from((p - q) * (p - q))).sum::<f64>();
        }
        if sum < least.0 {
            least = (sum, s);
        }
    }
    least.1
}

/// Probability of so many wins or more among `n` with one in nine each.
fn by_chance(wins: usize, n: usize) -> f64 {
    let p = 1.0f64 / 9.0;
    let mut term = (1.0 - p).powi(n as i32);
    let mut below = 0.0;
    for k in 0..wins {
        below += term;
        term *= (n - k) as f64 / (k + 1) as f64 * p / (1.0 - p);
    }
    1.0 - below
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Twelve frames of an even pattern, of slow shades or of neither, with noise; the ground moves by so much a frame, px.
    fn frames(pattern: f64, shade: f64, px_a_frame: f64) -> Vec<Image<f32>> {
        in_light(pattern, shade, px_a_frame, 0.0)
    }

    /// The same in a light that changes by so many counts a frame.
    fn in_light(pattern: f64, shade: f64, px_a_frame: f64, light: f64) -> Vec<Image<f32>> {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let ground: Vec<f64> = (0..400 * 160).map(|_| pattern * (rng.random::<f64>() - 0.5)).collect();
        (0..12)
            .map(|k| {
                let moved = (px_a_frame * f64::from(k)).round() as usize;
                let pixels = (0..160 * 160)
                    .map(|i| {
                        let (x, y) = (i % 160 + moved, i / 160);
                        let shades = shade * (0.05 * x as f64).sin() * (0.04 * y as f64).cos();
                        (light * f64::from(k) + ground[y * 400 + x] + shades + 6.0 * (rng.random::<f64>() - 0.5)) as f32
                    })
                    .collect();
                Image::from_vec(160, 160, pixels).unwrap()
            })
            .collect()
    }

    #[test]
    fn even_ground_and_shades_that_stand_are_told_from_those_that_go_and_from_noise() {
        assert!(stands(&frames(6.0, 0.0, 0.0)), "a pattern as strong as the noise");
        assert!(stands(&frames(0.0, 30.0, 0.0)), "shades");
        assert!(!stands(&frames(6.0, 0.0, 1.0)));
        assert!(!stands(&frames(0.0, 30.0, 1.0)));
        assert!(!stands(&frames(0.0, 0.0, 0.0)), "noise alone");
        assert!(!stands(&[]));
        assert!(stands(&in_light(6.0, 0.0, 0.0, -3.0)) && !stands(&in_light(6.0, 0.0, 1.0, -3.0)), "the light falls");
    }

    #[test]
    fn chance_is_binomial() {
        assert!((by_chance(1, 1) - 1.0 / 9.0).abs() < 1e-12);
        assert!((by_chance(2, 3) - (3.0 * 8.0 + 1.0) / 729.0).abs() < 1e-12);
        assert_eq!(by_chance(0, 5), 1.0);
    }
}
