//! Moving pixels of a fixed camera: a running background with shadows, changing light, ghosts and slight shake.
//!
//! [`Background`] keeps mean and deviation of every pixel (`model`) and gives one bit a pixel: moving or not. In a frame:
//! 1. the light of the frame against the model's is estimated on a grid and taken off (`light`);
//! 2. a pixel moves if it is farther than `threshold-sd` deviations from its mean;
//! 3. moving pixels that are shadow (`shadow`) or, with `shake`, fit a neighbour's background, are background after all;
//! 4. the model follows: still pixels with `time-constant-s`, moving ones with `standing-time-s`, so that a standing
//!    target stays one; moving pixels that look like the still background beside them with `ghost-time-s`: the hole that
//!    a departed target leaves fills from its edge (the idea of O. Barnich, M. Van Droogenbroeck, "ViBe", IEEE Trans.
//!    Image Processing 20(6), 2011, here without chance);
//! 5. the bits are cleaned (`morphology`).
//!
//! The frames of the start are brought to one light before their medians are taken (`light`).
//!
//! All times are in seconds of real time. A row is updated as seldom as its rate allows (see `model`), with the time that
//! has passed. Limits: the camera stands still but for a pixel; the first `start-s` seconds learn.

mod config;
pub(crate) mod difference;
mod light;
pub(crate) mod model;
pub(crate) mod morphology;
mod rows;
mod segmenter;
pub(crate) mod shadow;
mod start;

pub use config::BackgroundConfig;
pub use difference::{DifferenceConfig, FrameDifference};
pub(crate) use light::in_one_light;
pub use model::BackgroundPixel;
pub use morphology::{BitImage, CleanUp};
pub(crate) use rows::pack;
pub(crate) use segmenter::mask_rows;
pub use shadow::ShadowConfig;

use crate::{Error, ErrorKind, Image, Result};
use fearless_simd::{Level, dispatch};
use light::{GRID_PX, Grid, Light};
use model::{Coefficients, GHOST, MOVING, Rates, STILL};
use rows::{adapt, judge};

/// Fewest of the row's updates a time constant: a rate below 1/32 would drown in the rounding of the fixed-point model.
const SLOWEST_RATE: f64 = 1.0 / 32.0;
/// A row waits at most this many frames for its update.
const MOST_FRAMES: u64 = 32;
/// Samples that the start-up keeps for the median.
const START_SAMPLES: usize = 11;
/// Pixels on either side over which the noise from so few is averaged: 25 make 30 % of error 6 %.
const NOISE_REACH: usize = 2;

/// The background of a fixed camera and the pixels that move before it.
#[derive(Clone, Debug)]
pub struct Background<T: BackgroundPixel> {
    config: BackgroundConfig,
    mean: Image<T::Level>,
    deviation: Image<T::Level>,
    /// Time at which each row was last updated, s since the start.
    updated_s: Vec<f64>,
    now_s: f64,
    n_frames: u64,
    /// Frames that the start-up has averaged (0: nothing is known yet).
    n_averaged: u64,
    /// Frames of the start-up, evenly spread in time.
    samples: Vec<Image<T>>,
    /// Scratch: the deviations on the grid, counts.
    deviations: Vec<f32>,
    typical: f32,
    light: Light,
    grid: Grid,
    states: Vec<u8>,
    /// Pixels of the last frame that were taken for shadow.
    n_shadow: usize,
    bits: BitImage,
    /// The bits before cleaning, which the update goes by.
    raw: BitImage,
    work: BitImage,
}

impl<T: BackgroundPixel> Background<T> {
    /// Builds a background that has seen nothing.
    /// # Errors
    /// As [`BackgroundConfig::validate`].
    pub fn new(config: BackgroundConfig) -> Result<Self> {
        config.validate("background")?;
        Ok(Self {
            config,
            mean: Image::default(),
            deviation: Image::default(),
            updated_s: Vec::new(),
            now_s: 0.0,
            n_frames: 0,
            n_averaged: 0,
            samples: Vec::new(),
            deviations: Vec::new(),
            typical: 1.0,
            light: light::SAME,
            grid: Grid::default(),
            states: Vec::new(),
            n_shadow: 0,
            bits: BitImage::default(),
            raw: BitImage::default(),
            work: BitImage::default(),
        })
    }

    /// Learns from frames seen beforehand: the median of each pixel and its mean absolute deviation, so that even the
    /// first frame can be judged and a passing target leaves no trace. All frames must have the same size.
    /// # Errors
    /// No frame, or frames of different sizes.
    pub fn prime(&mut self, frames: &[&Image<T>]) -> Result<()> {
        self.learn_from(frames, 0)
    }

    /// As [`Background::prime`], from the few frames of the start: their noise is averaged over pixels nearby.
    pub(super) fn start_from(&mut self, frames: &[&Image<T>]) -> Result<()> {
        let lit = self.in_one_light(frames);
        self.learn_from(lit.as_ref().map(|l| l.iter().collect::<Vec<_>>()).as_deref().unwrap_or(frames), NOISE_REACH)
    }

    /// The frames without what the light does among them, if it does anything: it is no noise of the pixels.
    fn in_one_light(&self, frames: &[&Image<T>]) -> Option<Vec<Image<T>>> {
        let alike = frames.windows(2).all(|f| (f[0].width(), f[0].height()) == (f[1].width(), f[1].height()));
        (self.config.follow_light && alike).then(|| light::in_one_light(frames, GRID_PX, 0.0)).flatten()
    }

    /// Time in which the background is learned at first, s; 0 if it knows one.
    pub(super) fn start_s(&self) -> f64 {
        if self.n_averaged == 0 { self.config.start_s } else { 0.0 }
    }

    fn learn_from(&mut self, frames: &[&Image<T>], reach: usize) -> Result<()> {
        let Some(first) = frames.first() else {
            return Err(Error::new(ErrorKind::Config, "expected at least one frame to learn the background from"));
        };
        let (w, h) = (first.width(), first.height());
        if let Some(other) = frames.iter().find(|f| (f.width(), f.height()) != (w, h)) {
            return Err(size_changed(w, h, other.width(), other.height()));
        }
        self.restart(w, h);
        self.learn_median(frames, reach);
        Ok(())
    }

    /// Sets the model to median and noise of frames that all have the model's size; the noise averaged over pixels within `reach`.
    fn learn_median(&mut self, frames: &[&Image<T>], reach: usize) {
        start::learn(frames, reach, &mut self.mean, &mut self.deviation);
        self.n_averaged = u64::MAX;
        self.typical = start::typical::<T>(&self.deviation, &mut self.deviations);
    }

    /// Takes the next frame, `dt_s` seconds after the last (any number for the first): finds the moving pixels and learns.
    /// # Errors
    /// A frame of another size than before; a time step that is negative or not finite.
    pub fn update(&mut self, frame: &Image<T>, dt_s: f64) -> Result<()> {
        let (w, h) = (frame.width(), frame.height());
        if self.n_averaged == 0 {
            self.restart(w, h);
        } else if (w, h) != (self.mean.width(), self.mean.height()) {
            return Err(size_changed(self.mean.width(), self.mean.height(), w, h));
        }
        if !(dt_s >= 0.0 && dt_s.is_finite()) {
            return Err(Error::new(ErrorKind::Config, "expected a time of 0 s or more since the last frame")
                .at(format!("dt = {dt_s}"))
                .hint("sort the frames by time"));
        }
        if self.n_frames > 0 {
            self.now_s += dt_s;
        }
        self.raw.reset(w, h);
        self.n_shadow = 0;
        if self.is_starting() {
            self.sample(frame);
        }
        let starting = self.is_starting();
        if self.n_averaged == 0 {
            self.learn_first(frame);
        } else {
            let terms = self.look(frame);
            self.follow(frame, &terms, dt_s, starting);
        }
        if starting {
            self.n_averaged += 1;
        }
        self.n_frames += 1;
        self.bits.clone_from(&self.raw);
        morphology::clean(&mut self.bits, self.config.clean_up, &mut self.work);
        Ok(())
    }

    /// The moving pixels of row `y`, 64 a word.
    pub fn row(&self, y: usize) -> &[u64] {
        self.bits.row(y)
    }

    /// The moving pixels of the last frame.
    pub fn moving(&self) -> &BitImage {
        &self.bits
    }

    /// Pixels of the last frame that moved and were taken for shadow, and those that were not, before cleaning.
    pub(crate) fn shadow_and_not(&self) -> [usize; 2] {
        [self.n_shadow, self.raw.count()]
    }

    /// Takes nothing for shadow from now on.
    pub(crate) fn drop_shadows(&mut self) {
        self.config.shadow.enabled = false;
    }

    /// Whether the model still learns everything, so that what moves is not told apart yet.
    pub fn is_starting(&self) -> bool {
        self.n_averaged < u64::MAX
    }

    /// The mean of a pixel's background, counts; `None` outside.
    pub fn mean(&self, x: usize, y: usize) -> Option<f32> {
        self.mean.get(x, y).map(T::counts)
    }

    /// The standard deviation of a pixel's background, counts; `None` outside.
    pub fn deviation(&self, x: usize, y: usize) -> Option<f32> {
        // A normal's standard deviation is 1.2533 mean absolute deviations.
        self.deviation.get(x, y).map(|d| 1.2533 * T::counts(d).max(self.typical))
    }

    fn restart(&mut self, w: usize, h: usize) {
        self.mean.reset(w, h, T::Level::default());
        self.deviation.reset(w, h, T::Level::default());
        self.bits.reset(w, h);
        self.raw.reset(w, h);
        self.updated_s.clear();
        self.updated_s.resize(h, 0.0);
        self.states.clear();
        self.states.resize(w.next_multiple_of(64), STILL);
        self.samples.clear();
        (self.now_s, self.n_frames, self.n_averaged) = (0.0, 0, 0);
        self.light = light::SAME;
    }

    /// Keeps a frame of the start-up, or ends it with the median of those kept.
    fn sample(&mut self, frame: &Image<T>) {
        let start_s = self.config.start_s;
        let due_s = start_s * self.samples.len() as f64 / (START_SAMPLES - 1) as f64;
        if self.now_s >= due_s && self.samples.len() < START_SAMPLES {
            self.samples.push(frame.clone());
        }
        if self.now_s >= start_s && self.n_averaged > 1 {
            let mut samples = std::mem::take(&mut self.samples);
            if let Some(lit) = self.in_one_light(&samples.iter().collect::<Vec<_>>()) {
                samples = lit;
            }
            self.learn_median(&samples.iter().collect::<Vec<_>>(), NOISE_REACH);
        }
    }

    fn learn_first(&mut self, frame: &Image<T>) {
        for y in 0..frame.height() {
            for (m, v) in self.mean.row_mut(y).iter_mut().zip(frame.row(y)) {
                let v = v.to_f64() as f32;
                *m = T::level(if v.is_finite() { v } else { 0.0 });
            }
        }
    }

    /// Finds the moving pixels, into `raw`.
    fn look(&mut self, frame: &Image<T>) -> T::Terms {
        let (w, h) = (frame.width(), frame.height());
        self.light = light::SAME;
        if self.config.follow_light {
            self.grid.clear();
            for y in (GRID_PX / 2..h).step_by(GRID_PX) {
                let (row, means) = (frame.row(y), self.mean.row(y));
                for x in (GRID_PX / 2..w).step_by(GRID_PX) {
                    let m = T::counts(means[x]);
                    self.grid.push(m, row[x].to_f64() as f32 - m);
                }
            }
            self.light = self.grid.light(self.typical);
        }
        // `threshold-sd` counts standard deviations, the model mean absolute ones.
        let factor = 1.2533 * self.config.threshold_sd;
        let least = self.config.min_difference.map_or(0.0, |d| d / factor);
        let floor = if self.config.min_difference.is_some() { least } else { self.typical.max(T::NOISE_FLOOR) };
        let light = self.light;
        let terms = T::terms(&Coefficients { gain: light.gain, offset: light.offset, factor, floor });
        for y in 0..h {
            judge(frame.row(y), self.mean.row(y), self.deviation.row(y), &terms, &mut self.states);
            let states = &self.states;
            let bits = self.raw.row_mut(y);
            dispatch!(Level::new(), simd => pack(simd, states, bits));
            self.doubt(frame, y, &terms);
        }
        terms
    }

    /// Clears the bits of row `y` that are shadow or shake.
    fn doubt(&mut self, frame: &Image<T>, y: usize, terms: &T::Terms) {
        if !self.config.shadow.enabled && !self.config.shake {
            return;
        }
        let h = frame.height();
        let (above, below) = (y.saturating_sub(1), (y + 1).min(h - 1));
        let rows = [frame.row(above), frame.row(y), frame.row(below)];
        let means = [self.mean.row(above), self.mean.row(y), self.mean.row(below)];
        let deviations = [self.deviation.row(above), self.deviation.row(y), self.deviation.row(below)];
        let light = (self.light.gain, self.light.offset);
        let last = frame.width().saturating_sub(1);
        for (i, word) in self.raw.row_mut(y).iter_mut().enumerate() {
            let mut left = *word;
            while left != 0 {
                let x = i * 64 + left.trailing_zeros() as usize;
                left &= left - 1;
                let shaken = self.config.shake
                    && (x.saturating_sub(1)..=(x + 1).min(last))
                        .any(|nx| (0..3).any(|k| !rows[1][x].moves(means[k][nx], deviations[k][nx], terms)));
                let shadow = !shaken && self.config.shadow.enabled && {
                    let d = T::counts(deviations[1][x]).max(self.typical);
                    shadow::is_shadow(&self.config.shadow, rows, means, x, light, d)
                };
                if shaken || shadow {
                    *word &= !(1 << (x % 64));
                }
                self.n_shadow += usize::from(shadow);
            }
        }
    }

    /// Lets the model follow the frame.
    fn follow(&mut self, frame: &Image<T>, terms: &T::Terms, dt_s: f64, starting: bool) {
        let h = frame.height();
        let rate = |time_s: f64, tau_s: f64| -((-time_s / tau_s).exp_m1());
        // As many frames between two updates of a row as keep its rate above the smallest.
        let per_frame = rate(dt_s, self.config.time_constant_s).max(1e-9);
        let period = if starting { 1 } else { ((SLOWEST_RATE / per_frame) as u64).clamp(1, MOST_FRAMES) };
        for y in 0..h {
            if !(self.n_frames + y as u64).is_multiple_of(period) {
                continue;
            }
            let time_s = self.now_s - self.updated_s[y];
            self.updated_s[y] = self.now_s;
            let rates = if starting {
                let rate = 1.0 / (self.n_averaged + 1) as f32;
                Rates { still: rate, moving: rate, ghost: rate, cautious: true }
            } else {
                Rates {
                    still: rate(time_s, self.config.time_constant_s) as f32,
                    moving: rate(time_s, self.config.standing_time_s) as f32,
                    ghost: rate(time_s, self.config.ghost_time_s) as f32,
                    cautious: false,
                }
            };
            self.states.fill(STILL);
            self.spread_states(frame, y, terms);
            let steps = T::steps(&rates);
            adapt(frame.row(y), &self.states, terms, &steps, self.mean.row_mut(y), self.deviation.row_mut(y));
        }
        // The typical deviation moves slowly: once in a while is enough.
        if starting || self.n_frames.is_multiple_of(16) {
            self.typical = start::typical::<T>(&self.deviation, &mut self.deviations);
        }
    }

    /// Writes the states of the moving pixels of row `y`: moving, or a ghost where they fit still background beside them.
    fn spread_states(&mut self, frame: &Image<T>, y: usize, terms: &T::Terms) {
        let row = frame.row(y);
        let (w, h) = (frame.width(), frame.height());
        for i in 0..w.div_ceil(64) {
            let mut left = self.raw.row(y)[i];
            while left != 0 {
                let x = i * 64 + left.trailing_zeros() as usize;
                left &= left - 1;
                let fits = |nx: usize, ny: usize| {
                    !self.raw.get(nx, ny) && !row[x].moves(self.mean.row(ny)[nx], self.deviation.row(ny)[nx], terms)
                };
                let ghost = (x > 0 && fits(x - 1, y))
                    || (x + 1 < w && fits(x + 1, y))
                    || (y > 0 && fits(x, y - 1))
                    || (y + 1 < h && fits(x, y + 1));
                self.states[x] = if ghost { GHOST } else { MOVING };
            }
        }
    }
}

pub(crate) fn size_changed(w: usize, h: usize, found_w: usize, found_h: usize) -> Error {
    Error::new(ErrorKind::Damaged, format!("expected a frame of {w} x {h} px, as before"))
        .at(format!("{found_w} x {found_h} px"))
        .hint("frames of one sequence must have one size")
}
