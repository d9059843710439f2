//! From any pixel type to 8 bits to look at, steady over time, and integer enlargement.
//!
//! The 0.5 % and 99.5 % quantiles of a sample of pixels become black and white; they follow the scene slowly (a tenth of the way each
//! frame), so that the picture does not flicker, but jump when the scene leaves them by far (a range more than three times as wide or as narrow).
//! Of 8-bit pictures only dark ones are stretched: fully up to a 99.5 % quantile of [`DARK`], not at all from [`BRIGHT`] on, partly in between.

use super::canvas::Rgb;
use crate::{Image, Pixels};

/// Pixels looked at for the quantiles.
const SAMPLE: usize = 4096;
/// How far the levels follow each frame.
const FOLLOW: f32 = 0.1;

/// Quantiles of 8-bit pictures between which the stretch fades out, counts.
const DARK: f32 = 120.0;
const BRIGHT: f32 = 200.0;
/// A dark picture is made at most so many times as bright: beyond it noise is shown.
const MOST_GAIN: f32 = 8.0;

/// The levels that are shown black and white.
#[derive(Clone, Debug, Default)]
pub struct Tone {
    levels: Option<(f32, f32)>,
    sample: Vec<f32>,
}

impl Tone {
    /// Draws the frame `scale` times enlarged into `out`.
    pub fn render(&mut self, pixels: &Pixels, scale: usize, out: &mut Image<Rgb>) {
        let scale = scale.max(1);
        let (w, h) = (pixels.width(), pixels.height());
        if (out.width(), out.height()) != (w * scale, h * scale) {
            out.reset(w * scale, h * scale, [0; 3]);
        }
        match pixels {
            Pixels::Gray8(i) => {
                let shown = self.bytes(i.as_slice().iter().map(|v| f32::from(*v)));
                enlarge(i, scale, out, |v| [shown[usize::from(v)]; 3]);
            }
            Pixels::Rgb8(i) => {
                let shown = self.bytes(i.as_slice().iter().map(|p| f32::from(p[0].max(p[1]).max(p[2]))));
                enlarge(i, scale, out, |p| p.map(|v| shown[usize::from(v)]));
            }
            Pixels::Gray16(i) => {
                let (low, gain) = self.follow(i.as_slice().iter().map(|v| f32::from(*v)));
                enlarge(i, scale, out, |v| [((f32::from(v) - low) * gain) as u8; 3]);
            }
            Pixels::GrayF32(i) => {
                let (low, gain) = self.follow(i.as_slice().iter().copied());
                enlarge(i, scale, out, |v| [((v - low) * gain) as u8; 3]);
            }
        }
    }

    /// What each of the 256 values of a picture is shown as.
    fn bytes(&mut self, pixels: impl ExactSizeIterator<Item = f32>) -> [u8; 256] {
        self.follow(pixels);
        let (low, high) = self.levels.unwrap_or((0.0, 255.0));
        let share = ((BRIGHT - high) / (BRIGHT - DARK)).clamp(0.0, 1.0);
        // An even picture has nothing to be stretched.
        let share = if high - low < 2.0 { 0.0 } else { share };
        let black = share * low;
        let gain = (255.0 / (share * high + (1.0 - share) * 255.0 - black)).min(MOST_GAIN);
        std::array::from_fn(|v| if share > 0.0 { ((v as f32 - black) * gain).round() as u8 } else { v as u8 })
    }

    /// Updates the levels; returns black and the gain to 0..=255.
    fn follow(&mut self, pixels: impl ExactSizeIterator<Item = f32>) -> (f32, f32) {
        // A stride that is not a divisor of usual widths, so that the sample is spread over columns.
        let stride = (pixels.len() / SAMPLE).max(1) | 1;
        self.sample.clear();
        self.sample.extend(pixels.step_by(stride).filter(|v| v.is_finite()));
        if let Some(last) = self.sample.len().checked_sub(1) {
            let mut at = |share: f64| {
                let k = ((last as f64 * share) as usize).min(last);
                *self.sample.select_nth_unstable_by(k, f32::total_cmp).1
            };
            let (low, high) = (at(0.005), at(0.995));
            self.levels = Some(match self.levels {
                Some((l, h)) if (high - low) < 3.0 * (h - l) && 3.0 * (high - low) > (h - l) => {
                    (l + FOLLOW * (low - l), h + FOLLOW * (high - h))
                }
                _ => (low, high),
            });
        }
        let (low, high) = self.levels.unwrap_or((0.0, 1.0));
        (low, if high > low { 255.0 / (high - low) } else { 0.0 })
    }
}

fn enlarge<T: Copy>(image: &Image<T>, scale: usize, out: &mut Image<Rgb>, map: impl Fn(T) -> Rgb) {
    let wide = out.width();
    if image.width() == 0 || wide == 0 {
        return;
    }
    if scale == 1 {
        for (o, &v) in out.as_mut_slice().iter_mut().zip(image.as_slice()) {
            *o = map(v);
        }
        return;
    }
    for (row, block) in
        image.as_slice().chunks_exact(image.width()).zip(out.as_mut_slice().chunks_exact_mut(wide * scale))
    {
        let (first, rest) = block.split_at_mut(wide);
        for (o, &v) in first.chunks_exact_mut(scale).zip(row) {
            o.fill(map(v));
        }
        rest.chunks_exact_mut(wide).for_each(|line| line.copy_from_slice(first));
    }
}

/// The enlargement at which annotations on a picture of this size are legible: 1 from about 500 px up.
pub fn legible_scale(width: usize, height: usize) -> usize {
    (1000 / width.max(height).max(1)).clamp(1, 8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grey_is_shown_as_it_is_and_enlarged_by_whole_pixels() {
        let image = Image::from_vec(2, 1, vec![7u8, 200]).unwrap();
        let mut out = Image::default();
        Tone::default().render(&Pixels::Gray8(image), 2, &mut out);
        assert_eq!(out.as_slice(), [[7; 3], [7; 3], [200; 3], [200; 3], [7; 3], [7; 3], [200; 3], [200; 3]]);
    }

    #[test]
    fn a_dark_picture_of_bytes_is_stretched_and_a_bright_one_is_not() {
        let ramp = |top: u8| {
            let data: Vec<u8> = (0..10_000usize).map(|i| (i * usize::from(top) / 10_000) as u8).collect();
            Pixels::Gray8(Image::from_vec(100, 100, data).unwrap())
        };
        let shown = |top: u8| {
            let mut out = Image::default();
            Tone::default().render(&ramp(top), 1, &mut out);
            out.as_slice().iter().map(|p| p[0]).max().unwrap()
        };
        assert_eq!(shown(230), 229);
        assert!(shown(60) >= 250 && shown(20) >= 150, "{} {}", shown(60), shown(20));
        // Partly in between: brighter than it is, and no jump.
        assert!(shown(160) > 175 && shown(160) < 250, "{}", shown(160));
        let mut out = Image::default();
        Tone::default().render(&Pixels::Gray8(Image::filled(4, 4, 7)), 1, &mut out);
        assert_eq!(out.get(0, 0), Some([7; 3]), "an even picture");
    }

    #[test]
    fn a_hot_pixel_does_not_darken_the_picture_and_levels_move_slowly() {
        let ramp = |add: u16| {
            let mut data: Vec<u16> = (0..10_000u16).map(|i| 8000 + add + i / 100).collect();
            data[5000] = 65535;
            Pixels::Gray16(Image::from_vec(100, 100, data).unwrap())
        };
        let (mut tone, mut out) = (Tone::default(), Image::default());
        tone.render(&ramp(0), 1, &mut out);
        let before = out.get(50, 20).unwrap()[0];
        assert!((40..70).contains(&before), "{before}");
        tone.render(&ramp(10), 1, &mut out);
        let after = out.get(50, 20).unwrap()[0];
        // The scene rose by a tenth of the range: shown almost in full, since the levels follow by a tenth of it.
        assert!((15..30).contains(&(after - before)), "{before} {after}");
    }

    #[test]
    fn frames_of_nothing_but_nan_are_drawn_dark() {
        let mut out = Image::default();
        Tone::default().render(&Pixels::GrayF32(Image::filled(3, 3, f32::NAN)), 1, &mut out);
        assert_eq!(out.get(1, 1), Some([0; 3]));
    }

    #[test]
    fn infrared_clips_are_enlarged_three_times_and_large_pictures_not() {
        assert_eq!((legible_scale(320, 256), legible_scale(640, 512), legible_scale(1920, 1080)), (3, 1, 1));
    }
}
