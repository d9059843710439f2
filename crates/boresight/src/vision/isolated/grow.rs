//! Grows a cluster from its peak, level by level, until it is too large, reaches the border or meets what another peak has grown.
//!
//! Source: the flooding of component trees (P. Salembier, A. Oliveras, L. Garrido, 1998; D. Nistér, H. Stewénius, *Linear time maximally stable extremal regions*, 2008), cut
//! to the few peaks that can matter: pixels next to the cluster wait in a bucket of their level, so that each is visited once whatever the number of levels.
//! A pixel that another peak's cluster held at this level or a higher one ends the growth: the two are one cluster from there on, and the first peak, which is at least as
//! high, has seen it. One that the other took in lower down, past the saddle between the two, is free.
//! Of the pixels that a level adds most are those of the last one, which floods the ground: there a cluster ends as soon as its mean says that it can be no target (`bars`).
//! Symbols: `reached` number of levels that a pixel reaches.
//! Limits: 511 levels; the border itself belongs to no cluster.

use super::blob::Blob;
use super::steps::Steps;
use crate::Image;
use crate::vision::pixel::Pixel;

/// Bits of a mark that say the level at which a cluster took the pixel in; 0 if it has only seen it.
const LEVEL_BITS: u32 = 9;
const LEVEL: u32 = (1 << LEVEL_BITS) - 1;

/// Marks of a cache line.
const LINE: usize = 16;

/// Rows above and below a peak that its growth is sure to read, or nearly.
const AHEAD: u32 = 3;

/// No pixel.
const NONE: u32 = u32::MAX;

/// The cluster of one peak while it grows; keeps its memory between peaks and frames.
#[derive(Debug, Default)]
pub struct Growth {
    /// By pixel: the number of the peak that has seen it last, and the level.
    marks: Vec<u32>,
    width: usize,
    height: usize,
    /// Length of a row of marks: an odd number of cache lines, so that the rows of a column do not fall upon each other in the cache.
    stride: u32,
    /// From a pixel to its neighbours: among the marks, and in the image. Steps back wrap around.
    beside: [(u32, usize); 8],
    /// Marks from here on are of this frame.
    first: u32,
    /// The number of the present peak, in its place in a mark.
    own: u32,
    /// Pixels next to the cluster, each with the one of the same level that came before it.
    waiting: Vec<[u32; 2]>,
    /// The last one of each level.
    heads: Vec<u32>,
    /// Pixels of the present level.
    stack: Vec<u32>,
    reached: u16,
    /// Levels that a pixel must reach to matter.
    floor: usize,
    /// Level at which it is one with another's cluster.
    met: usize,
    /// The peak's level, and the lowest one at which a pixel waits.
    top: usize,
    deepest: usize,
    max_side: u32,
    blob: Option<Blob>,
    sum: f64,
    peak: f64,
}

/// What a level has added.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// The cluster is larger.
    Grown,
    /// Nothing was added.
    Same,
    /// The cluster cannot be a target at this level or any further one.
    End,
}

impl Growth {
    /// Begins a frame of that size with so many levels; clusters may have sides of up to `max_side`, px.
    pub fn frame(&mut self, width: usize, height: usize, levels: usize, max_side: u32) {
        if (self.width, self.height) != (width, height) {
            (self.width, self.height) = (width, height);
            self.stride = (width.div_ceil(LINE) | 1) as u32 * LINE as u32;
            self.marks.clear();
            self.marks.resize(height * self.stride as usize, 0);
            (self.own, self.first) = (0, 0);
            // Of the neighbours of one level the last goes on first: along the row, whose marks lie side by side.
            let around = [(-1, -1), (-1, 0), (-1, 1), (1, -1), (1, 0), (1, 1), (0, -1), (0, 1)];
            let stride = self.stride as isize;
            self.beside = around.map(|(down, along): (isize, isize)| {
                ((down * stride + along) as u32, (down * width as isize + along) as usize)
            });
        }
        self.next();
        self.first = self.own;
        self.max_side = max_side;
        self.heads.clear();
        self.heads.resize(levels + 1, NONE);
    }

    /// Takes the next number. When all are used the marks are forgotten: a later peak may then find again what an earlier one has found.
    fn next(&mut self) {
        self.own = self.own.checked_add(LEVEL + 1).unwrap_or_else(|| {
            self.marks.fill(0);
            self.first = LEVEL + 1;
            LEVEL + 1
        });
    }

    /// Begins with a peak that reaches `reached` levels, and goes down to the level `floor`, at least 1.
    pub fn start(&mut self, x: u32, y: u32, reached: u16, floor: u16) {
        if let Some(heads) = self.heads.get_mut(self.deepest..=self.top) {
            heads.fill(NONE);
        }
        self.next();
        self.reached = reached;
        self.floor = usize::from(floor).max(1);
        self.met = 0;
        self.blob = None;
        self.sum = 0.0;
        self.peak = f64::NEG_INFINITY;
        (self.top, self.deepest) = (usize::from(reached), usize::from(reached));
        self.waiting.clear();
        let at = y * self.stride + x;
        self.fetch(at);
        let mark = self.marks[at as usize];
        if mark >= self.first && (mark & LEVEL) as usize >= usize::from(reached) {
            self.met = usize::from(reached);
        } else {
            self.heads[self.top] = 0;
            self.waiting.push([at, NONE]);
        }
    }

    /// Reads the marks of the rows around a peak at once: its growth would wait for memory row by row, since what it reads next depends on what it has read.
    fn fetch(&self, at: u32) {
        let rows = (0..=2 * AHEAD).map(|k| at.wrapping_add(k * self.stride).wrapping_sub(AHEAD * self.stride));
        let seen = rows.map(|row| self.marks.get(row as usize).copied().unwrap_or(0)).fold(0, |a, b| a | b);
        std::hint::black_box(seen);
    }

    /// Ends this peak's growth.
    fn end(&mut self) -> Step {
        self.reached = 0;
        self.blob = None;
        Step::End
    }

    /// Takes in the pixels of the next level, the highest first, as long as the cluster has no more than `small` pixels or its mean is not below `least_mean`.
    pub fn step<T: Pixel>(&mut self, image: &Image<T>, steps: &Steps, small: u32, least_mean: f64) -> Step {
        let level = usize::from(self.reached);
        if level < self.floor || level <= self.met {
            return self.end();
        }
        self.reached -= 1;
        let mut head = if level < self.deepest { NONE } else { std::mem::replace(&mut self.heads[level], NONE) };
        if head == NONE {
            return Step::Same;
        }
        self.stack.clear();
        while let Some(&[at, before]) = self.waiting.get(head as usize) {
            self.stack.push(at);
            head = before;
        }
        if self.take_in(image, steps, level, (small, least_mean)) { Step::Grown } else { self.end() }
    }

    /// Takes in the pixels on the stack and those that they lead to at this level; false if the cluster cannot be a target from there on.
    fn take_in<T: Pixel>(
        &mut self,
        image: &Image<T>,
        steps: &Steps,
        level: usize,
        (small, least_mean): (u32, f64),
    ) -> bool {
        let (stack, waiting, heads, marks) =
            (&mut self.stack, &mut self.waiting, self.heads.as_mut_slice(), self.marks.as_mut_slice());
        let (pixels, width, stride, beside) = (image.as_slice(), self.width, self.stride.max(1), self.beside);
        let (right, bottom) = (width as u32 - 1, self.height as u32 - 1);
        let (own, floor, first) = (self.own, self.floor, self.first);
        let mut blob = self.blob.unwrap_or(Blob::none());
        let (mut sum, mut peak, mut deepest, mut met) = (self.sum, self.peak, self.deepest, self.met);
        let mut whole = true;
        'grow: while let Some(at) = stack.pop() {
            let (x, y) = (at % stride, at / stride);
            blob.add(x, y);
            let (w, h) = blob.sides();
            if x == 0 || y == 0 || x >= right || y >= bottom || w > self.max_side || h > self.max_side {
                whole = false;
                break;
            }
            let pixel = y as usize * width + x as usize;
            let value = steps.signed(pixels[pixel]);
            sum += value;
            // What is still to come of this level is lower than all that was there before it, so the mean only falls.
            if blob.area > small && sum < least_mean * f64::from(blob.area) {
                whole = false;
                break;
            }
            peak = if value > peak { value } else { peak };
            marks[at as usize] = own | level as u32;
            for &(of_mark, of_pixel) in &beside {
                let next = at.wrapping_add(of_mark);
                let Some(mark) = marks.get_mut(next as usize) else { continue };
                if *mark >= own {
                    continue;
                }
                let Some(&p) = pixels.get(pixel.wrapping_add(of_pixel)) else { continue };
                let reached = usize::from(steps.of(p));
                if reached < floor {
                    continue;
                }
                let joins = reached.min(level);
                if *mark >= first && (*mark & LEVEL) as usize >= joins {
                    // Another's cluster, met at once or when this one has come down to it.
                    if joins == level {
                        whole = false;
                        break 'grow;
                    }
                    met = met.max(joins);
                    continue;
                }
                *mark = own;
                if joins == level {
                    stack.push(next);
                } else {
                    deepest = deepest.min(joins);
                    let head = &mut heads[joins];
                    waiting.push([next, *head]);
                    *head = waiting.len() as u32 - 1;
                }
            }
        }
        (self.blob, self.sum, self.peak) = (Some(blob), sum, peak);
        (self.deepest, self.met) = (deepest, met);
        whole
    }

    /// Number of levels that every pixel of the cluster reaches, after a step that was not the end.
    pub fn reached(&self) -> u16 {
        self.reached + 1
    }

    /// The cluster, with the mean and the highest of its values times the sign of the side; `None` before the first pixel.
    pub fn cluster(&self) -> Option<(Blob, f64, f64)> {
        self.blob.map(|b| (b, self.sum / f64::from(b.area), self.peak))
    }
}

#[cfg(test)]
mod tests {
    use super::super::steps::Steps;
    use super::*;
    use crate::vision::threshold::Side;

    #[test]
    fn when_the_numbers_are_used_up_clusters_are_still_whole() {
        let mut image = Image::filled(40, 30, 10u8);
        for y in 12..15 {
            image.row_mut(y)[20..24].fill(90);
        }
        let mut steps = Steps::default();
        steps.take::<u8>(&[50.0], Side::Bright, 90.0);
        let mut growth = Growth::default();
        growth.frame(40, 30, 1, 20);
        growth.own = u32::MAX - 3 * (LEVEL + 1);
        growth.first = growth.own;
        for n in 0..6 {
            // Every other frame begins anew, so that numbers end within a frame and at its beginning.
            if n % 2 == 1 {
                growth.frame(40, 30, 1, 20);
            }
            growth.start(20, 12, 1, 1);
            let step = growth.step(&image, &steps, 0, f64::NEG_INFINITY);
            if step == Step::Grown {
                let (blob, mean, peak) = growth.cluster().unwrap();
                assert_eq!((blob.bounds(), blob.area, mean, peak), ([20, 12, 23, 14], 12, 90.0, 90.0));
            }
            // The same peak a second time in a frame meets its own first cluster, unless that is forgotten.
            assert!(n == 0 || n % 2 == 0 || step == Step::Grown, "{n}");
        }
    }
}
