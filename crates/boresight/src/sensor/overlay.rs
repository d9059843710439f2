//! What is drawn on the picture by a camera, a recorder or a display: a cross, marks, a clock, text; also what of the carrier is in view.
//!
//! Source: our own. Of some frames spread over the first seconds, each pixel has a mean and a deviation. Two things are no scene's:
//!
//! 1. Edges that stand while the scene moves. An edge whose pixel deviates by less than a tenth of its step keeps its place to a tenth of a pixel ([`STILL`]): no target that a camera follows does
//!    that. The scene moves if in one direction of edges at least (a pan leaves those along it where they are) more of the frame's tiles hold edges that move than such that stand. Optics make no edge
//!    as sharp as a drawn one ([`SHARP`]), and lines of the scene that run along a pan have no ends: a mark begins where sharp edges of both directions stand close together. Where there are enough,
//!    every sharp edge that stands is drawn.
//! 2. Digits that change. A pixel that goes to and fro between two levels, keeps to them ([`NEAR_LEVEL`]), and wherever it is at the upper one has a sharp edge and no brighter neighbour, with others like it beside it.
//!
//! Around both, what is contrasted in most frames, by the level that is drawn with, is drawn as well: digits in other states, and letters beside them. Of a scene that stands nothing else is taken but sharp edges of the digits' own level.
//! Symbols: w, h size of the frame, px; s pixels of a stroke, one for each [`STROKE_PX`] of height; edges are the larger step to one of the two neighbours along an axis, counts.
//! Limits: 8 bits; frames of which fewer than twelve may be held; what is half transparent, blurred, or less than [`CONTRAST`] from what is around it is left; so is all of a scene that stands for these seconds and moves later, and what is drawn first in the midst of them; hard-edged things
//! drawn by a simulation at the same place in every frame pass for marks.

mod counts;
mod ink;
mod whole;

use crate::Image;
use counts::Counts;

/// Frames that are compared, and fewer of large frames: so many pixels in all.
const SAMPLES: [usize; 2] = [12, 24];
const SAMPLED_PX: usize = 24_000_000;
/// Step from which there is an edge, counts: what is drawn is drawn to be read.
const CONTRAST: f32 = 40.0;
/// Deviation of an edge's pixel over its step: the wander of an edge's place, px; and from which on an edge moves.
const STILL: f32 = 0.1;
const MOVED: f32 = 0.3;
/// A drawn edge makes so much of the contrast around it in one pixel; a Gaussian spot of 0.85 px or more does not.
const SHARP: f32 = 0.6;
/// Tiles along each axis in which it is counted what moves, edges in each, and the majority of those that move.
const TILES: usize = 8;
const TILE_EDGES: u32 = 6;
/// Edges that move for each that stands, in a tile that moves; and every so many-th of the frames compared tells it as well as all.
const MOVED_OF_TILE: u32 = 2;
const MOVING_EVERY: usize = 3;
/// Tiles that move for each that stands, and at least; and fewer where nearly all that stands is of one level, as what is drawn is and no scenery.
const MAJORITY: [f64; 2] = [1.5, 4.0];
const OF_ONE_LEVEL: [f64; 2] = [0.2, 3.0];
const ONE_LEVEL_SHARE: f64 = 0.85;
const ONE_LEVEL: usize = 20;
/// Edges of each direction that stand within half of a window around a mark's, share of them among all that are as strong in the mean of the frames, and such places from which there is a mark.
const OF_EACH: u32 = 2;
/// What is along an axis within a fifth counts for it: ends of lines count for both.
const ALONG: f32 = 0.8;
const STANDING: f32 = 0.7;
const LEAST_MARKS: usize = 20;
/// Distance from one of two levels, as a share of theirs; share of the frames in which a pixel keeps to them, number of its changes, and of pixels like it in a window.
const NEAR_LEVEL: f32 = 0.12;
const KEEPS: f32 = 0.95;
const CHANGES: u32 = 4;
const LEAST_SWITCHING: u32 = 8;
/// The edge that such a pixel makes at its upper level, as a share of their distance, and in which share of the frames there.
const SWITCHED: f32 = 0.5;
const MOSTLY: f32 = 0.7;
/// Share of the frames in which a place is contrasted, so that it is drawn beside what is, and how far from it, strokes: the height of a letter; and the widest gap in a line of text.
const PERSISTS: f32 = 0.7;
const BESIDE: usize = 12;
const GAP: usize = 4;
/// What is filled around marks and digits, which a codec smears them over, strokes; more around letters that nothing but their level tells, which are found without their soft rims.
const RIM: usize = 1;
const SOFT_RIM: usize = 3;
/// Share of the picture within reach of text, at most: what goes on farther is scenery.
const MOST_TEXT: f64 = 0.25;
/// How far thin strokes are from the level that is drawn with, as a share of its height above the scene; and the least edge they make where the ground is nearly as bright, counts.
const OFF_LEVEL: f32 = 0.3;
const FAINT: f32 = 20.0;
/// Share of the rectangle around drawn pixels that hang together from which they are a line of text, which is filled as a whole.
const DENSE: f64 = 0.4;
/// Largest side of a single letter with what is filled around it, strokes.
const LETTER: usize = 16;
/// Half of the side of windows in which edges are counted, and of those in which contrast is measured, strokes.
const WINDOW: usize = 5;
const NEAR: usize = 2;
/// Height of a frame with strokes of one pixel, px.
const STROKE_PX: usize = 480;

/// The pixels (column, row) of what is drawn, row by row; none of frames of several sizes, of too few or too small ones.
pub(super) fn find_overlay(frames: &[&Image<u8>]) -> Vec<[u32; 2]> {
    let Some(first) = frames.first() else { return Vec::new() };
    let (w, h) = (first.width(), first.height());
    let n = (SAMPLED_PX / (w * h).max(1)).clamp(SAMPLES[0], SAMPLES[1]);
    let is_odd = |f: &&Image<u8>| (f.width(), f.height()) != (w, h);
    if frames.len() < n || w < 4 * TILES || h < 4 * TILES || frames.iter().any(is_odd) {
        return Vec::new();
    }
    let samples: Vec<&[u8]> = (0..n).map(|k| frames[k * (frames.len() - 1) / (n - 1)].as_slice()).collect();
    let look = Look::of(&samples, w, h);
    let switching = look.switching(&samples);
    let mut marks = look.marks(&samples);
    if marks.sure.is_empty() && !switching.is_empty() {
        marks.all = look.of_their_level(&switching);
    }
    look.with_beside(&marks, &switching, &samples)
}

/// What stands while the scene moves.
#[derive(Default)]
struct Marks {
    /// Places at which a mark is sure; none where there are too few.
    sure: Vec<usize>,
    /// All that are drawn with them.
    all: Vec<usize>,
}

/// Frames compared: the mean of each pixel, its deviation and its extremes.
struct Look {
    w: usize,
    h: usize,
    /// Pixels of a stroke.
    s: usize,
    mean: Vec<f32>,
    deviation: Vec<f32>,
    low: Vec<u8>,
    high: Vec<u8>,
}

impl Look {
    fn of(samples: &[&[u8]], w: usize, h: usize) -> Self {
        let (mut sum, mut squares) = (vec![0u32; w * h], vec![0u32; w * h]);
        let (mut low, mut high) = (vec![u8::MAX; w * h], vec![0; w * h]);
        for sample in samples {
            for (((v, sum), squares), (low, high)) in
                sample.iter().zip(&mut sum).zip(&mut squares).zip(low.iter_mut().zip(&mut high))
            {
                *sum += u32::from(*v);
                *squares += u32::from(*v) * u32::from(*v);
                *low = (*low).min(*v);
                *high = (*high).max(*v);
            }
        }
        let n = samples.len() as f32;
        let mean: Vec<f32> = sum.iter().map(|s| *s as f32 / n).collect();
        let deviation = squares.iter().zip(&mean).map(|(q, m)| (*q as f32 / n - m * m).max(0.0).sqrt()).collect();
        let s = ((h + STROKE_PX / 2) / STROKE_PX).max(1);
        Self { w, h, s, mean, deviation, low, high }
    }

    /// The places within `reach` of one, in the frame.
    fn around(&self, i: usize, reach: usize) -> impl Iterator<Item = usize> + use<> {
        let (w, x, y) = (self.w, i % self.w, i / self.w);
        let columns = x.saturating_sub(reach)..=(x + reach).min(w - 1);
        (y.saturating_sub(reach)..=(y + reach).min(self.h - 1))
            .flat_map(move |y| columns.clone().map(move |x| y * w + x))
    }

    /// Largest step between two neighbours near a place, counts.
    fn steepest(&self, image: &[u8], i: usize) -> f32 {
        let near = self.around(i, NEAR * self.s);
        let steps = near.flat_map(|j| [1, self.w].map(|d| image.get(j + d).map_or(0, |v| v.abs_diff(image[j]))));
        steps.max().map_or(0.0, f32::from)
    }

    /// Smallest and largest value near a place, stroke by stroke: large frames are asked for as many pixels as small ones.
    fn extremes<T: Copy + Into<f32>>(&self, image: &[T], i: usize) -> [f32; 2] {
        let steps = |at: usize, n: usize| {
            let first = at - (at / self.s).min(NEAR) * self.s;
            (first..=(at + NEAR * self.s).min(n - 1)).step_by(self.s)
        };
        let (x, y) = (i % self.w, i / self.w);
        let near = steps(y, self.h).flat_map(|y| steps(x, self.w).map(move |x| image[y * self.w + x].into()));
        near.fold([f32::MAX, f32::MIN], |[low, high], v| [low.min(v), high.max(v)])
    }

    /// The larger step to one of the two neighbours along each axis; none at the border.
    fn edge<T: Copy + Into<f32>>(&self, image: &[T], i: usize) -> [f32; 2] {
        [1, self.w].map(|d| {
            let [before, at, behind]: [f32; 3] = [image[i - d].into(), image[i].into(), image[i + d].into()];
            (at - before).abs().max((behind - at).abs())
        })
    }

    /// Places that have four neighbours, of every `every`th row.
    fn inner(&self, every: usize) -> impl Iterator<Item = usize> + use<> {
        let w = self.w;
        (1..self.h - 1).step_by(every).flat_map(move |y| (y * w + 1)..(y * w + w - 1))
    }

    /// What stands while the scene moves.
    fn marks(&self, samples: &[&[u8]]) -> Marks {
        let is_strong = |[x, y]: [f32; 2]| x.max(y) >= CONTRAST;
        let strong: Vec<(usize, [f32; 2])> =
            self.inner(1).map(|i| (i, self.edge(&self.mean, i))).filter(|(_, e)| is_strong(*e)).collect();
        let stands = |(i, [x, y]): &(usize, [f32; 2])| self.deviation[*i] <= STILL * x.max(*y);
        let standing: Vec<(usize, [f32; 2])> = strong.iter().copied().filter(stands).collect();
        if standing.len() < LEAST_MARKS || !self.moves(&standing, samples) {
            return Marks::default();
        }
        let along = |axis: usize| {
            let of = |e: &[f32; 2]| e[axis] >= ALONG * e[1 - axis];
            Counts::of(self.w, self.h, standing.iter().filter(|(_, e)| of(e)).map(|(i, _)| *i))
        };
        let (vertical, horizontal) = (along(0), along(1));
        let all = Counts::of(self.w, self.h, strong.iter().map(|(i, _)| *i));
        let still = Counts::of(self.w, self.h, standing.iter().map(|(i, _)| *i));
        let reach = WINDOW * self.s;
        let sharp: Vec<usize> = standing
            .iter()
            .filter(|(i, [x, y])| {
                let [low, high] = self.extremes(&self.mean, *i);
                x.max(*y) >= SHARP * (high - low)
            })
            .map(|(i, _)| *i)
            .collect();
        let is_sure = |i: &usize| {
            let near = |counts: &Counts| counts.near(*i, reach);
            near(&vertical) >= OF_EACH
                && near(&horizontal) >= OF_EACH
                && near(&still) as f32 >= STANDING * near(&all) as f32
        };
        let sure: Vec<usize> = sharp.iter().copied().filter(is_sure).collect();
        if sure.len() < LEAST_MARKS * self.s {
            return Marks::default();
        }
        let mut left = vec![false; self.w * self.h];
        standing.iter().for_each(|(i, _)| left[*i] = true);
        sharp.iter().for_each(|i| left[*i] = false);
        let mut all = sharp;
        self.join(&mut all, &mut left, 1);
        let ink = self.ink(&sure, &[]);
        let is_faint = |i: &usize| {
            let [x, y] = self.edge(&self.mean, *i);
            ink.is(self.mean[*i]) && self.deviation[*i] <= STILL * CONTRAST && x.max(y) >= FAINT
        };
        all.extend(self.inner(1).filter(is_faint));
        Marks { sure, all }
    }

    /// Adds to the places all of those left that hang together with them, over gaps of less than `reach`, and takes them from these.
    fn join(&self, places: &mut Vec<usize>, left: &mut [bool], reach: usize) {
        let mut next = 0;
        while let Some(i) = places.get(next).copied() {
            next += 1;
            places.extend(self.around(i, reach).filter(|j| std::mem::take(&mut left[*j])));
        }
    }

    /// Whether the scene moves under these edges.
    fn moves(&self, standing: &[(usize, [f32; 2])], samples: &[&[u8]]) -> bool {
        let (columns, rows) = (self.w.div_ceil(TILES), self.h.div_ceil(TILES));
        let tile = |i: usize| i / self.w / rows * TILES + i % self.w / columns;
        let axis = |[x, y]: [f32; 2]| usize::from(y >= x);
        let (mut still, mut moved) = ([[0u32; TILES * TILES]; 2], [[0u32; TILES * TILES]; 2]);
        standing.iter().for_each(|(i, e)| still[axis(*e)][tile(*i)] += 1);
        let some: Vec<&[u8]> = samples.iter().step_by(MOVING_EVERY).copied().collect();
        for sample in &some {
            for i in self.inner(self.s) {
                let e = self.edge(sample, i);
                if e[0].max(e[1]) >= CONTRAST && self.deviation[i] >= MOVED * e[0].max(e[1]) {
                    moved[axis(e)][tile(i)] += 1;
                }
            }
        }
        let frames = some.len() as u32;
        // Tiles that move and that stand, across each axis.
        let tiles = [0, 1].map(|axis| {
            let (mut n_moved, mut n_still) = (0.0, 0.0);
            for (moved, still) in moved[axis].iter().zip(&still[axis]) {
                // All rows of those that stand, some of the others.
                let (moved, still) = (moved * self.s as u32 / frames, *still);
                let least = TILE_EDGES * self.s as u32;
                if moved >= least && moved >= MOVED_OF_TILE * still {
                    n_moved += 1.0;
                } else if still >= least {
                    n_still += 1.0;
                }
            }
            [n_moved, n_still]
        });
        let are_most =
            |[majority, least]: [f64; 2]| tiles.iter().any(|[moved, still]| *moved >= least.max(majority * still));
        are_most(MAJORITY) || are_most(OF_ONE_LEVEL) && self.is_of_one_level(standing)
    }

    /// Whether the bright side of nearly all these edges, or the dark one, is of one level.
    fn is_of_one_level(&self, standing: &[(usize, [f32; 2])]) -> bool {
        let mut counts = [[0usize; 256]; 2];
        for (i, _) in standing {
            let extremes = self.extremes(&self.mean, *i);
            counts.iter_mut().zip(extremes).for_each(|(counts, v)| counts[v as usize] += 1);
        }
        let most =
            |counts: &[usize; 256]| counts.windows(ONE_LEVEL + 1).map(|w| w.iter().sum()).max().unwrap_or(0usize);
        counts.iter().any(|counts| most(counts) as f64 >= ONE_LEVEL_SHARE * standing.len() as f64)
    }

    /// Places that go to and fro between two levels, as digits do.
    fn switching(&self, samples: &[&[u8]]) -> Vec<usize> {
        let n = samples.len();
        let most_odd = ((1.0 - KEEPS) * n as f32) as usize;
        let switches = |i: &usize| {
            let (low, high) = (f32::from(self.low[*i]), f32::from(self.high[*i]));
            let range = high - low;
            if range < CONTRAST {
                return false;
            }
            let (mut odd, mut changes, mut up, mut sharp, mut was_up) = (0, 0, 0usize, 0usize, None);
            for sample in samples {
                let v = f32::from(sample[*i]);
                let is_up = v >= high - NEAR_LEVEL * range;
                if !is_up && v > low + NEAR_LEVEL * range {
                    odd += 1;
                    if odd > most_odd {
                        return false;
                    }
                }
                changes += u32::from(was_up.is_some_and(|was| was != is_up));
                was_up = Some(is_up);
                if is_up {
                    let [x, y] = self.edge(sample, *i);
                    up += 1;
                    // On the flank of a spot, which a lens draws, the pixels towards its middle are brighter.
                    let is_top = || self.around(*i, 1).all(|j| f32::from(sample[j]) <= v + NEAR_LEVEL * range);
                    sharp += usize::from(x.max(y) >= SWITCHED * range && is_top());
                }
            }
            changes >= CHANGES && sharp as f32 >= MOSTLY * up as f32
        };
        let found: Vec<usize> = self.inner(1).filter(switches).collect();
        if found.len() < LEAST_SWITCHING as usize {
            return Vec::new();
        }
        let counts = Counts::of(self.w, self.h, found.iter().copied());
        let reach = WINDOW * self.s;
        found.into_iter().filter(|i| counts.near(*i, reach) >= LEAST_SWITCHING * self.s as u32).collect()
    }

    /// What is drawn: marks and digits with their rims, and what is contrasted beside them in most frames.
    fn with_beside(&self, marks: &Marks, switching: &[usize], samples: &[&[u8]]) -> Vec<[u32; 2]> {
        let mut drawn = vec![false; self.w * self.h];
        let mut asked = drawn.clone();
        let ink = self.ink(&marks.sure, switching);
        let least = (PERSISTS * samples.len() as f32).ceil() as usize;
        let persists = |i: usize| {
            let (mut left, mut drawn) = (samples.len(), 0);
            samples.iter().all(|sample| {
                let [low, high] = self.extremes(sample, i);
                left -= 1;
                let is_ink = high - low >= FAINT && ink.is(if ink.is_bright { high } else { low });
                // What a lens draws as bright, a wood in the sun, has no such edges.
                drawn += usize::from(is_ink && self.steepest(sample, i) >= SHARP * (high - low));
                drawn + left >= least
            })
        };
        // A line of text goes on as long as it has no gap, and fills no picture.
        let marked = if marks.sure.is_empty() { &[][..] } else { &marks.all };
        let mut next: Vec<(usize, usize)> = marked.iter().chain(switching).map(|i| (*i, BESIDE)).collect();
        let mut left = (MOST_TEXT * drawn.len() as f64) as usize;
        while let Some((i, reach)) = next.pop() {
            for j in self.around(i, reach * self.s).filter(|j| !std::mem::replace(&mut asked[*j], true)) {
                drawn[j] = left > 0 && persists(j);
                left = left.saturating_sub(1);
                if drawn[j] {
                    next.push((j, GAP));
                }
            }
        }
        if left == 0 {
            drawn.fill(false);
        }
        let rim = if marks.sure.is_empty() { SOFT_RIM } else { RIM };
        for i in marks.all.iter().chain(switching) {
            self.around(*i, rim * self.s).for_each(|j| drawn[j] = true);
        }
        self.fill_text(&mut drawn);
        if !marks.sure.is_empty() {
            self.fill_quiet(&mut drawn);
        }
        let place = |i: usize| [(i % self.w) as u32, (i / self.w) as u32];
        (0..drawn.len()).filter(|i| drawn[*i]).map(place).collect()
    }
}

#[cfg(test)]
#[path = "overlay/tests.rs"]
mod tests;
