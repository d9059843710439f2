//! Pixels that differ from two earlier frames, steadied, by more than the ground does.
//!
//! Source: our own; the three-frame difference (Y. Kameda, M. Minoh, VSMM 1996) on frames brought to cover each other, as in M. Irani, P. Anandan, "A unified approach
//! to moving object detection in 2D and 3D scenes", *IEEE PAMI* 20, 1998, with a noise of its own for every place ([`super::noise`]).
//! How: z₁ and z₂, the deviations from the frames one and three lags ago; a pixel moves if both have one sign and exceed `threshold-sd`: so a place that a target has
//! left, which differs from one of them only, does not count (unless it moves by less than half its size in a lag).
//! Wider frames than 960 px are compared in means of 2 x 2 pixels (or more): targets of some 6 px across are the smallest there.
//! Limits: what stands still is not seen, nor what moves less than a part of its own size in a lag; of an even target only the rims that cover and uncover; what
//! sticks out of the plane moves by parallax, and is seen where little around it does so too.

use super::config::SteadiedConfig;
use super::cover::{cover, factor, working};
use super::noise::{GroundNoise, gradients};
use super::references::References;
use crate::vision::background::{BitImage, mask_rows, morphology, pack, size_changed};
use crate::vision::pixel::Pixel;
use crate::vision::segmenter::{PixelWeight, Regions, Segmenter};
use crate::vision::target_finder::TypedFrame;
use crate::vision::threshold::BackgroundGrid;
use crate::{Image, Result};
use fearless_simd::{Level, dispatch};

/// Share of the rounding's variance that the mean over [1 2 1]/4 both ways leaves in a difference of two.
const ROUNDING: f32 = 2.0 * 0.140_625 / 12.0;

/// The earlier frames and the pixels that move by themselves.
#[derive(Clone, Debug)]
pub(in crate::vision) struct Steadied<T> {
    config: SteadiedConfig,
    references: References,
    size: (usize, usize),
    now: Image<f32>,
    gradients: [Image<f32>; 2],
    z: [Image<f32>; 2],
    noise: [GroundNoise; 2],
    line: Vec<f32>,
    states: Vec<u8>,
    small: BitImage,
    bits: BitImage,
    work: BitImage,
    blind: bool,
    of_pixels: std::marker::PhantomData<T>,
}

impl<T: Pixel> Steadied<T> {
    /// Builds it; nothing moves until enough frames are known.
    /// # Errors
    /// As [`SteadiedConfig::validate`].
    pub fn new(config: &SteadiedConfig) -> Result<Self> {
        config.validate("steadied")?;
        Ok(Self {
            references: References::new(config.lag_s),
            config: config.clone(),
            size: (0, 0),
            now: Image::default(),
            gradients: Default::default(),
            z: Default::default(),
            noise: Default::default(),
            line: Vec::new(),
            states: Vec::new(),
            small: BitImage::default(),
            bits: BitImage::default(),
            work: BitImage::default(),
            blind: true,
            of_pixels: std::marker::PhantomData,
        })
    }

    /// Takes the next frame.
    fn update(&mut self, frame: &Image<T>, dt_s: f64) -> Result<()> {
        let size = (frame.width(), frame.height());
        if self.references.has_started() && size != self.size {
            return Err(size_changed(self.size.0, self.size.1, size.0, size.1));
        }
        self.size = size;
        let factor = factor(size.0, size.1);
        working(frame, factor, &mut self.line, &mut self.now);
        self.bits.reset(size.0, size.1);
        self.references.step(&self.now, dt_s);
        self.blind = !self.compare();
        if !self.blind {
            self.mark(factor);
        }
        self.references.keep(&mut self.now);
        Ok(())
    }

    /// Fills z with the deviations from the two earlier frames; whether there are two.
    fn compare(&mut self) -> bool {
        let Self { references, now, gradients: of, z, noise, line, config, .. } = self;
        let Some(two) = references.two(now) else { return false };
        let [own, other] = of;
        gradients(now, line, own);
        for (((image, place), z), noise) in two.into_iter().zip(z).zip(noise) {
            z.reset(now.width(), now.height(), 0.0);
            cover(image, &place, z);
            gradients(z, line, other);
            noise.judge(now, [own, other], z, ROUNDING * T::STEP * T::STEP, config.min_difference);
        }
        true
    }

    /// Marks the pixels that both deviations mark, in the size of the frame.
    fn mark(&mut self, factor: usize) {
        let (w, h) = (self.now.width(), self.now.height());
        self.small.reset(w, h);
        self.states.clear();
        self.states.resize(w.next_multiple_of(64), 0);
        for y in 0..h {
            let ([a, b], [p, q]) = (&self.z, [self.noise[0].factors(y), self.noise[1].factors(y)]);
            let tile = p.1.max(1);
            let rows = a.row(y).chunks(tile).zip(b.row(y).chunks(tile)).zip(self.states.chunks_mut(tile));
            for (((a, b), states), (p, q)) in rows.zip(p.0.iter().zip(q.0)) {
                both(a, b, [self.config.threshold_sd * p, self.config.threshold_sd * q], states);
            }
            let (states, bits) = (&self.states, self.small.row_mut(y));
            dispatch!(Level::new(), simd => pack(simd, states, bits));
        }
        morphology::clean(&mut self.small, self.config.clean_up, &mut self.work);
        if factor == 1 {
            std::mem::swap(&mut self.small, &mut self.bits);
            return;
        }
        for y in 0..h * factor {
            for (i, word) in self.small.row(y / factor).iter().enumerate() {
                let mut left = *word;
                while left != 0 {
                    let x = (64 * i + left.trailing_zeros() as usize) * factor;
                    (x..x + factor).for_each(|x| self.bits.set(x, y));
                    left &= left - 1;
                }
            }
        }
    }
}

widest! {
    fn both(a: &[f32], b: &[f32], thresholds: [f32; 2], states: &mut [u8]) {
        let n = a.len().min(b.len()).min(states.len());
        let (a, b) = (&a[..n], &b[..n]);
        let [p, q] = thresholds;
        for (x, state) in states[..n].iter_mut().enumerate() {
            let bright = (a[x] > p) & (b[x] > q);
            let dark = (a[x] < -p) & (b[x] < -q);
            *state = u8::from(bright | dark);
        }
    }
}

impl<T: Pixel> Segmenter<T> for Steadied<T> {
    fn remembers(&self) -> bool {
        true
    }

    fn is_blind(&self) -> bool {
        self.blind
    }

    fn prime_s(&self) -> f64 {
        self.references.prime_s()
    }

    fn prime(&mut self, times_s: &[f64], frames: &[&Image<T>]) -> Result<()> {
        let mut working_frames = Vec::with_capacity(frames.len());
        for (time_s, frame) in times_s.iter().zip(frames) {
            let mut image = Image::default();
            working(frame, factor(frame.width(), frame.height()), &mut self.line, &mut image);
            working_frames.push((*time_s, image));
        }
        self.references.prime(working_frames);
        Ok(())
    }

    fn weight(&self) -> PixelWeight {
        PixelWeight::Alike
    }

    fn segment(&mut self, frame: &TypedFrame<T>, _: &BackgroundGrid, regions: &mut Regions) -> Result<Option<f64>> {
        self.update(frame.image, frame.dt_s)?;
        mask_rows(&self.bits, frame.image, &mut regions.bright);
        Ok(None)
    }
}
