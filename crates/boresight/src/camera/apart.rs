//! Whether a motion is a ground's, or what things that move by themselves have in common by chance.
//!
//! Source: our own; the test is that of a regression (R. Fisher's F in closed form, for two and four numbers that are fitted).
//! How: what has texture in the key frame falls into pieces that stand apart. A piece that reaches over half of the image's width is ground. Where there is none, each piece has one word: things
//! that move by themselves leave a motion of k numbers unexplained in the share x of their 2 n displacements' squares, or less, with the probability x^(m/2) for k = 2 and
//! x^(m/2) (1 + m/2 (1 − x)) for k = 4, m = 2 n − k; times the number of ways to choose n of all pieces, since those that agree are chosen for it. Two things can always be explained, by a
//! turn and a zoom.
//! Symbols: n pieces, m degrees of freedom left. Units: reduced px.
//! Limits: things that move alike before a ground without texture are the ground; a thing that is half as wide as the image is.

use super::fit::Match;
use super::key_frame::{PATCH, STEP, add_gradients, texture};
use super::rest::STILL;
use crate::{Homography, Image};
use nalgebra::Vector2;

/// Probability in one look that what moves by itself is taken for a ground. For velocities that are evenly distributed, not normally, three to six times as many pass (5 and 7 things, 23 000 draws), and a
/// film has some ten looks that do not hang together: of 60 simulated ones of three to eight things two passed. At 1e-6 none does, but nor does a camera that shakes by a pixel before four pieces.
const CHANCE: f64 = 1e-4;
/// A ground reaches over this share of the image's width: below a sky from side to side.
pub(super) const WIDE: f64 = 0.5;
/// No piece.
const NONE: u32 = u32::MAX;

/// What the patches of a piece say.
#[derive(Clone, Copy, Debug, Default)]
struct Word {
    /// Whether it has any.
    is_heard: bool,
    /// Those that agree, the sum of their displacements, and of what is left of them.
    n: f64,
    moved: Vector2<f64>,
    left: Vector2<f64>,
}

/// The pieces of a key frame.
#[derive(Clone, Debug, Default)]
pub(super) struct Pieces {
    /// Tiles in a row; one every [`STEP`] px.
    columns: usize,
    /// By tile, the number of its piece.
    labels: Vec<u32>,
    /// First and last column of each piece's tiles.
    ends: Vec<[usize; 2]>,
    words: Vec<Word>,
    stack: Vec<usize>,
    gradients: Vec<[f32; 2]>,
}

impl Pieces {
    /// Finds the pieces of an image: neighbouring tiles with more texture than that.
    fn take(&mut self, image: &Image<f32>, quiet: f32) {
        let count = |side: usize| side.saturating_sub(PATCH + 2).div_ceil(STEP);
        let (columns, rows) = (count(image.width()), count(image.height()));
        self.columns = columns;
        self.ends.clear();
        self.labels.clear();
        self.labels.resize(columns * rows, NONE);
        for (y, labels) in self.labels.chunks_mut(columns.max(1)).enumerate() {
            self.gradients.clear();
            self.gradients.resize(image.width() - 1, [0.0; 2]);
            for r in STEP * y..STEP * y + PATCH {
                add_gradients(image.row(r), image.row(r + 1), &mut self.gradients);
            }
            for (x, label) in labels.iter_mut().enumerate() {
                // Textured, and of no piece yet.
                if texture(&self.gradients[STEP * x..STEP * x + PATCH]) > quiet {
                    *label = NONE - 1;
                }
            }
        }
        for first in 0..self.labels.len() {
            if self.labels[first] != NONE - 1 {
                continue;
            }
            let number = self.ends.len() as u32;
            let mut ends = [first % columns; 2];
            self.labels[first] = number;
            self.stack.push(first);
            while let Some(at) = self.stack.pop() {
                let (x, y) = (at % columns, at / columns);
                ends = [ends[0].min(x), ends[1].max(x)];
                for row in y.saturating_sub(1)..(y + 2).min(rows) {
                    for column in x.saturating_sub(1)..(x + 2).min(columns) {
                        let next = row * columns + column;
                        if self.labels[next] == NONE - 1 {
                            self.labels[next] = number;
                            self.stack.push(next);
                        }
                    }
                }
            }
            self.ends.push(ends);
        }
    }

    /// The piece of a patch with that middle; a patch without any is its own.
    fn of(&self, middle: Vector2<f64>) -> Option<u32> {
        let tile = middle.map(|c| ((c - 0.5 * (PATCH - 1) as f64) / STEP as f64).round().max(0.0) as usize);
        let rows = self.labels.len() / self.columns.max(1);
        let near = |c: usize, n: usize| c.saturating_sub(1)..(c + 2).min(n);
        let around = near(tile.y, rows).flat_map(|y| near(tile.x, self.columns).map(move |x| (x, y)));
        around.map(|(x, y)| self.labels[y * self.columns + x]).find(|l| *l != NONE)
    }

    /// Whether a motion of so many numbers from that key frame, whose texture stands out above `quiet`, with which those matches agree that lie no farther from it than `agree_px`, may be what things that move by themselves have in common.
    pub fn may_be_chance(
        &mut self,
        (key, quiet): (&Image<f32>, f32),
        (motion, n_numbers): (&Homography, usize),
        matches: &[Match],
        agree_px: f64,
    ) -> bool {
        self.take(key, quiet);
        let Self { ends, words, .. } = &mut *self;
        words.clear();
        words.resize(ends.len(), Word::default());
        for m in matches {
            let piece = self.of(m.from).map_or(self.words.len(), |p| p as usize);
            if piece == self.words.len() {
                self.words.push(Word::default());
            }
            let (word, left) = (&mut self.words[piece], m.to - motion.apply(m.from));
            word.is_heard = true;
            if left.norm() <= agree_px {
                (word.n, word.moved, word.left) = (word.n + 1.0, word.moved + (m.to - m.from), word.left + left);
            }
        }
        let n_all = self.words.iter().filter(|w| w.is_heard).count();
        let spoken = || self.words.iter().enumerate().filter(|(_, w)| w.n > 0.0);
        let reach = |piece: usize| self.ends.get(piece).map_or(0, |e| STEP * (e[1] - e[0]) + PATCH);
        if spoken().any(|(piece, _)| reach(piece) as f64 >= WIDE * key.width() as f64) {
            return false;
        }
        // What stands, stands: none of them moves by itself.
        let (n, moved, left) = spoken().fold((0usize, 0.0, 0.0), |(n, moved, left), (_, w)| {
            (n + 1, moved + (w.moved / w.n).norm_squared(), left + (w.left / w.n).norm_squared())
        });
        moved > n as f64 * STILL * STILL && ways(n_all, n) * by_chance(n, n_numbers, left / moved) > CHANCE
    }
}

/// Number of ways to choose `n` of so many.
fn ways(of: usize, n: usize) -> f64 {
    (0..n.min(of - n)).map(|i| (of - i) as f64 / (i + 1) as f64).product()
}

/// Probability that `n` things that move by themselves leave no larger a share of their squared displacements to a motion of `k` numbers, two or more, that is fitted to them.
fn by_chance(n: usize, k: usize, left: f64) -> f64 {
    let Some(m) = (2 * n).checked_sub(k).filter(|m| *m > 0) else { return 1.0 };
    let (half, x) = (0.5 * m as f64, left.clamp(0.0, 1.0));
    x.powf(half) * if k > 2 { 1.0 + half * (1.0 - x) } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    #[test]
    fn independent_displacements_leave_as_little_as_often_as_is_said() {
        // Least squares of a shift, and of a similarity, to normal displacements at random places.
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        for (n, k) in [(3, 2), (3, 4), (6, 2), (6, 4), (12, 4)] {
            const RUNS: usize = 4000;
            let mut ps: Vec<f64> = (0..RUNS)
                .map(|_| {
                    let mut design = DMatrix::zeros(2 * n, k);
                    for i in 0..n {
                        let (x, y) = (rng.random::<f64>() - 0.5, rng.random::<f64>() - 0.5);
                        let rows = [[1.0, 0.0, x, -y], [0.0, 1.0, y, x]];
                        (0..2).for_each(|r| (0..k).for_each(|c| design[(2 * i + r, c)] = rows[r][c]));
                    }
                    let moved = DVector::from_fn(2 * n, |_, _| rng.sample::<f64, _>(StandardNormal));
                    let fitted = design.clone().svd(true, true).solve(&moved, 1e-12).unwrap();
                    by_chance(n, k, (&moved - design * fitted).norm_squared() / moved.norm_squared())
                })
                .collect();
            ps.sort_by(f64::total_cmp);
            // Kolmogorov and Smirnov: farther than 1.95 / √n from the even law once in a thousand.
            let far =
                ps.iter().enumerate().map(|(i, p)| (p - (i as f64 + 0.5) / RUNS as f64).abs()).fold(0.0, f64::max);
            assert!(far < 1.95 / (RUNS as f64).sqrt(), "{n} {k}: {far}");
        }
        assert_eq!([ways(8, 8), ways(8, 4), ways(5, 2)], [1.0, 70.0, 10.0]);
        assert_eq!([by_chance(2, 4, 0.0), by_chance(1, 2, 0.0)], [1.0; 2]);
    }

    /// A picture of 160 x 120 px.
    fn picture(f: impl Fn(usize, usize) -> f32) -> Image<f32> {
        let mut image = Image::filled(160, 120, 0f32);
        for y in 0..120 {
            image.row_mut(y).iter_mut().enumerate().for_each(|(x, v)| *v = f(x, y));
        }
        image
    }

    fn n_pieces(image: &Image<f32>) -> usize {
        let mut pieces = Pieces::default();
        pieces.take(image, 0.5);
        pieces.ends.len()
    }

    #[test]
    fn spots_stand_apart_and_a_ground_below_a_sky_is_one() {
        let spots = [(30.0, 30.0), (90.0, 40.0), (60.0, 90.0), (130.0, 95.0)];
        let of_spots = picture(|x, y| {
            let d2 = |&(a, b): &(f64, f64)| (x as f64 - a).powi(2) + (y as f64 - b).powi(2);
            spots.iter().map(|s| (90.0 * (-d2(s) / 8.0).exp()) as f32).sum()
        });
        let of_ground =
            picture(|x, y| if y > 70 { 50.0 * ((x as f32 * 0.7).sin() + (y as f32 * 0.9).sin()) } else { 0.0 });
        assert_eq!([n_pieces(&of_spots), n_pieces(&of_ground)], [4, 1]);
        let shift = Homography::shift(Vector2::new(2.0, 1.0));
        let matches = |places: &[(f64, f64)], own: f64| -> Vec<Match> {
            let to = |i: usize, at: Vector2<f64>| at + Vector2::new(2.0 + own * (i as f64 - 1.5), 1.0);
            let at = |p: &(f64, f64)| Vector2::new(p.0, p.1);
            places.iter().enumerate().map(|(i, p)| Match { from: at(p), to: to(i, at(p)), weight: 1.0 }).collect()
        };
        let chance =
            |key: &Image<f32>, all: &[Match]| Pieces::default().may_be_chance((key, 0.5), (&shift, 4), all, 0.7);
        assert!(chance(&of_spots, &matches(&spots, 0.2)), "each by itself");
        assert!(!chance(&of_spots, &matches(&spots, 0.002)), "all by the same");
        assert!(chance(&of_spots, &matches(&spots[..2], 0.0)), "two are always explained");
        assert!(!chance(&of_ground, &matches(&[(20.0, 90.0), (130.0, 100.0)], 0.2)), "a ground");
    }
}
