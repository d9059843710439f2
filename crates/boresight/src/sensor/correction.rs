//! Frames mended: dark frame taken off, response divided out, columns' offsets taken off, bad pixels filled.
//!
//! value' = (value - dark - column) / response + level, level the mean of the dark frame, so that nothing falls below 0 and the noise model's offset stays. Response: the
//! flat frame less the dark one over its mean; below a twentieth of it a pixel is bad. Bad pixels take the mean of the good ones among their eight
//! neighbours, of the 24 around if there are none; else, as where something is drawn, of the nearest good ones along the row and the column, weighted by one over their distance. Whole numbers are rounded and kept in their range; full pixels stay full.

use super::config::SensorConfig;
use super::defects::Defects;
use crate::{Error, ErrorKind, Image, Pixels, Result};

/// A response below which a pixel is bad.
const LEAST_RESPONSE: f32 = 0.05;

/// What is known of a sensor: means of its dark and of its flat frames.
#[derive(Clone, Debug, Default)]
pub struct Calibration {
    /// Mean of frames without light, counts.
    pub dark: Option<Image<f32>>,
    /// Mean of frames of even light, counts.
    pub flat: Option<Image<f32>>,
}

/// What is done to each frame; keeps its memory.
#[derive(Clone, Debug)]
pub struct Correction {
    width: usize,
    height: usize,
    /// Taken off each pixel, counts; empty like the next where only bad pixels are mended.
    off: Vec<f32>,
    /// Multiplied to each pixel.
    times: Vec<f32>,
    /// Bad pixels and the good ones that fill them: offsets into the frame, and what each weighs.
    bad: Vec<(usize, Vec<(usize, f32)>)>,
    level: f32,
    /// Whether nothing but bad pixels is mended, each of which has good ones around it.
    only_bad: bool,
    scratch: Vec<f32>,
}

impl Correction {
    /// Puts together what is done to frames of this size.
    /// # Errors
    /// A dark or flat frame of another size; a flat frame without light.
    pub fn new(size: (usize, usize), config: &SensorConfig, known: &Calibration, defects: &Defects) -> Result<Self> {
        let (w, h) = size;
        for (key, image) in [("dark", &known.dark), ("flat", &known.flat)] {
            if let Some(image) = image
                && (image.width(), image.height()) != size
            {
                let what =
                    format!("expected {w} x {h} px as the frames have, found {} x {}", image.width(), image.height());
                return Err(Error::new(ErrorKind::Config, what)
                    .at(format!("input.sensor.{key}"))
                    .hint("take them with the same sensor, window and binning"));
            }
        }
        let mean = |v: &[f32]| v.iter().map(|v| f64::from(*v)).sum::<f64>() / v.len().max(1) as f64;
        let mut off = known.dark.as_ref().map_or_else(|| vec![0.0; w * h], |d| d.as_slice().to_vec());
        let level = mean(&off) as f32;
        let mut is_bad = vec![false; w * h];
        let mut times = vec![1.0; w * h];
        if let Some(flat) = &known.flat {
            let light: Vec<f32> = flat.as_slice().iter().zip(&off).map(|(f, d)| f - d).collect();
            let even = mean(&light) as f32;
            if !(even > 0.0 && even.is_finite()) {
                return Err(Error::new(ErrorKind::Config, "the flat frames are no brighter than the dark ones")
                    .at("input.sensor.flat")
                    .hint("frames of even light, half as bright as the sensor takes"));
            }
            for ((t, l), bad) in times.iter_mut().zip(&light).zip(&mut is_bad) {
                let response = l / even;
                *bad = !(response >= LEAST_RESPONSE && response.is_finite());
                *t = if *bad { 1.0 } else { 1.0 / response };
            }
        }
        if config.levels_columns() && known.dark.is_none() && defects.columns.len() == w {
            off.chunks_exact_mut(w.max(1))
                .for_each(|row| row.iter_mut().zip(&defects.columns).for_each(|(o, c)| *o += c));
        }
        if config.fills() {
            for [x, y] in &defects.pixels {
                if (*x as usize) < w && (*y as usize) < h {
                    is_bad[*y as usize * w + *x as usize] = true;
                }
            }
        }
        if config.fills_overlay() {
            for [x, y] in &defects.overlay {
                if (*x as usize) < w && (*y as usize) < h {
                    is_bad[*y as usize * w + *x as usize] = true;
                }
            }
        }
        let bad: Vec<(usize, Vec<(usize, f32)>)> =
            (0..w * h).filter(|&i| is_bad[i]).map(|i| (i, fillers(&is_bad, w, h, i))).collect();
        let only_bad = level == 0.0
            && off.iter().all(|o| *o == 0.0)
            && times.iter().all(|t| *t == 1.0)
            && bad.iter().all(|(_, from)| !from.is_empty());
        if only_bad {
            (off, times) = (Vec::new(), Vec::new());
        }
        Ok(Self { width: w, height: h, off, times, bad, level, only_bad, scratch: Vec::new() })
    }

    /// Number of pixels that are filled.
    pub fn n_bad(&self) -> usize {
        self.bad.len()
    }

    /// Mends a frame; of colour frames only what is filled. Those of another size (those without pixels) stay as they are.
    pub fn apply(&mut self, pixels: &mut Pixels) {
        if (pixels.width(), pixels.height()) != (self.width, self.height) {
            return;
        }
        match pixels {
            Pixels::Gray8(image) => {
                let full = f32::from(u8::MAX);
                self.mend(image, f32::from, |v| v.round().clamp(0.0, full) as u8, full);
            }
            Pixels::Gray16(image) => {
                let full = f32::from(u16::MAX);
                self.mend(image, f32::from, |v| v.round().clamp(0.0, full) as u16, full);
            }
            Pixels::GrayF32(image) => self.mend(image, |v| v, |v| v, f32::INFINITY),
            Pixels::Rgb8(image) if self.only_bad => {
                for (i, from) in &self.bad {
                    let channel = |c: usize| weighted(from, |j| f32::from(image.as_slice()[j][c])).round() as u8;
                    image.as_mut_slice()[*i] = [channel(0), channel(1), channel(2)];
                }
            }
            Pixels::Rgb8(_) => {}
        }
    }

    fn mend<T: Copy>(&mut self, image: &mut Image<T>, get: impl Fn(T) -> f32, put: impl Fn(f32) -> T, full: f32) {
        if self.only_bad {
            // Those that fill are good ones and stay, so nothing else is touched.
            let pixels = image.as_mut_slice();
            for (i, from) in &self.bad {
                pixels[*i] = put(weighted(from, |j| get(pixels[j])));
            }
            return;
        }
        self.scratch.clear();
        let mended = image.as_slice().iter().zip(&self.off).zip(&self.times).map(|((v, o), t)| {
            let v = get(*v);
            if v >= full { full } else { (v - o) * t + self.level }
        });
        self.scratch.extend(mended);
        for (i, from) in &self.bad {
            self.scratch[*i] = if from.is_empty() { self.level } else { weighted(from, |j| self.scratch[j]) };
        }
        for (p, v) in image.as_mut_slice().iter_mut().zip(&self.scratch) {
            *p = put(*v);
        }
    }
}

/// The mean of values by weights.
fn weighted(from: &[(usize, f32)], value: impl Fn(usize) -> f32) -> f32 {
    let [sum, weights] = from.iter().fold([0.0; 2], |[sum, all], (j, weight)| [sum + weight * value(*j), all + weight]);
    sum / weights
}

/// The good pixels that fill a bad one, and their weights.
fn fillers(is_bad: &[bool], w: usize, h: usize, i: usize) -> Vec<(usize, f32)> {
    let (x, y) = (i % w, i / w);
    let near = (1..=2usize)
        .map(|r| {
            (y.saturating_sub(r)..=(y + r).min(h - 1))
                .flat_map(|yy| (x.saturating_sub(r)..=(x + r).min(w - 1)).map(move |xx| yy * w + xx))
                .filter(|&j| !is_bad[j])
                .map(|j| (j, 1.0))
                .collect::<Vec<(usize, f32)>>()
        })
        .find(|f| !f.is_empty());
    near.unwrap_or_else(|| {
        let good = |mut along: Box<dyn Iterator<Item = usize>>| along.find(|j| !is_bad[*j]);
        let nearest = [
            good(Box::new((y * w..i).rev())),
            good(Box::new(i + 1..(y + 1) * w)),
            good(Box::new((0..y).rev().map(|y| y * w + x))),
            good(Box::new((y + 1..h).map(|y| y * w + x))),
        ];
        let distance = |j: usize| (j % w).abs_diff(x) + (j / w).abs_diff(y);
        nearest.into_iter().flatten().map(|j| (j, 1.0 / distance(j) as f32)).collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column(w: usize, h: usize, of: impl Fn(usize, usize) -> f32) -> Image<f32> {
        Image::from_vec(w, h, (0..w * h).map(|i| of(i % w, i / w)).collect()).unwrap()
    }

    #[test]
    fn light_is_given_back_from_dark_and_flat_frames() {
        let (dark, response) =
            (|x: usize, y: usize| 90.0 + 5.0 * (x % 3) as f32 + y as f32, |x: usize| 1.0 - 0.02 * x as f32);
        let known = Calibration {
            dark: Some(column(8, 6, dark)),
            flat: Some(column(8, 6, |x, y| dark(x, y) + 1000.0 * response(x))),
        };
        let mut c = Correction::new((8, 6), &SensorConfig::default(), &known, &Defects::default()).unwrap();
        let light = |x: usize, y: usize| 200.0 + 10.0 * (x + y) as f32;
        let mut frame = Pixels::GrayF32(column(8, 6, |x, y| dark(x, y) + light(x, y) * response(x)));
        c.apply(&mut frame);
        let Pixels::GrayF32(image) = frame else { panic!() };
        // The mean of dark is 97.375 counts (x % 3: 0 1 2 0 1 2 0 1), that of the response 0.93.
        let level = 90.0 + 5.0 * 7.0 / 8.0 + 2.5;
        for y in 0..6 {
            for x in 0..8 {
                assert!((image.row(y)[x] - level - 0.93 * light(x, y)).abs() < 0.01, "{x} {y}");
            }
        }
    }

    #[test]
    fn bad_pixels_are_filled_and_full_ones_stay_full() {
        let defects =
            Defects { pixels: vec![[3, 2], [4, 2], [0, 0], [99, 9]], columns: vec![1.0; 8], overlay: Vec::new() };
        let config = SensorConfig { bad_pixels: Some(true), column_noise: Some(true), ..Default::default() };
        let mut c = Correction::new((8, 6), &config, &Calibration::default(), &defects).unwrap();
        let mut image = Image::filled(8, 6, 41u8);
        image.row_mut(2)[3] = 250;
        image.row_mut(5)[5] = 255;
        let mut frame = Pixels::Gray8(image);
        c.apply(&mut frame);
        let Pixels::Gray8(image) = frame else { panic!() };
        assert_eq!(
            (image.get(3, 2), image.get(0, 0), image.get(5, 5), image.get(1, 1)),
            (Some(40), Some(40), Some(255), Some(40))
        );
        assert_eq!(c.n_bad(), 3);
        let mut other = Pixels::Gray8(Image::filled(2, 2, 9));
        c.apply(&mut other);
        assert_eq!(other, Pixels::Gray8(Image::filled(2, 2, 9)));
    }

    #[test]
    fn what_is_drawn_is_filled_along_its_row_and_column_by_distance() {
        let block = || (2..7).flat_map(|y| (2..9).map(move |x| [x, y]));
        let defects = Defects { overlay: block().collect(), ..Defects::default() };
        let config = SensorConfig { overlay: Some(true), ..Default::default() };
        let mut c = Correction::new((12, 9), &config, &Calibration::default(), &defects).unwrap();
        let mut frame = Pixels::GrayF32(column(12, 9, |x, y| 3.0 * x as f32 + 5.0 * y as f32));
        if let Pixels::GrayF32(image) = &mut frame {
            block().for_each(|[x, y]| image.row_mut(y as usize)[x as usize] = 999.0);
        }
        c.apply(&mut frame);
        let Pixels::GrayF32(image) = frame else { panic!() };
        // In the middle of the block, four to the left and the right and three up and down, the plane itself; beside its rim the mean of the three good ones around.
        assert!((image.row(4)[5] - 35.0).abs() < 1e-4, "{}", image.row(4)[5]);
        let left = [3, 4, 5].map(|y| 3.0 + 5.0 * y as f32).iter().sum::<f32>() / 3.0;
        assert!((image.row(4)[2] - left).abs() < 1e-4);
    }

    #[test]
    fn dark_frames_of_another_size_and_flat_ones_without_light_are_refused() {
        let e = |known: Calibration| {
            Correction::new((8, 6), &SensorConfig::default(), &known, &Defects::default()).unwrap_err().to_string()
        };
        let dark = e(Calibration { dark: Some(Image::filled(4, 4, 1.0)), flat: None });
        assert!(dark.contains("input.sensor.dark") && dark.contains("found 4 x 4"), "{dark}");
        assert!(e(Calibration { dark: None, flat: Some(Image::filled(8, 6, 0.0)) }).contains("no brighter"));
    }

    #[test]
    fn bad_pixels_alone_are_filled_as_they_are_beside_all_else() {
        let defects = Defects { pixels: vec![[3, 2], [4, 2], [0, 0], [7, 5]], ..Defects::default() };
        let config = SensorConfig { bad_pixels: Some(true), ..Default::default() };
        let mut alone = Correction::new((8, 6), &config, &Calibration::default(), &defects).unwrap();
        assert!(alone.only_bad);
        let mut whole = Correction { only_bad: false, off: vec![0.0; 48], times: vec![1.0; 48], ..alone.clone() };
        let value = |x: usize, y: usize| 30 + (7 * x + 13 * y + x * y) % 50;
        let image = column(8, 6, |x, y| value(x, y) as f32);
        let bytes = Image::from_vec(8, 6, image.as_slice().iter().map(|v| *v as u8).collect()).unwrap();
        for frame in [Pixels::GrayF32(image), Pixels::Gray8(bytes)] {
            let (mut a, mut b) = (frame.clone(), frame.clone());
            alone.apply(&mut a);
            whole.apply(&mut b);
            assert_eq!(a, b);
            assert_ne!(a, frame);
        }
    }
}
