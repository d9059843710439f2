//! A picture that is shown once more is no look at the scene: where all pixels of a frame are those of the frame before, nothing is detected in it, and its scan is blind.
//!
//! Source: our own. The shutter of an infrared camera, a link that stalls and a recorder that makes 30 frames of 25 show a picture again. What is detected in it says that the targets stand, where they go on; and then that they
//! jump. A sensor's noise is never the same twice, nor is what a codec makes of it.
//! How: frames are equal if their CRC-32 is, and [`SAMPLES`] pixels are. Of pictures without noise two may be equal while all is seen to stand: so a picture counts as repeated only once more than
//! [`LIVELY`] of the pixels have changed at some time, and for [`MOST_S`], or one frame. (Of coded infrared video 0.1 to 2 % of the pixels change from one frame to the next, and nearly all where it is coded anew.)
//! On the ground of a camera that moves the picture stands where it stood.
//! Limits: a copy that was coded anew differs somewhere; a picture that stands for longer is looked at again, and so is the first picture.

use super::Detector;
use crate::{CameraMotion, Frame, Image, MotionBasis, Pixels, Result, Scan, Timestamp};
use crc32fast::Hasher;

/// Pixels of a frame that are compared one by one.
const SAMPLES: usize = 1024;
/// Share of them that have changed at some time, so that it is the picture that lives, not a thing before a ground without noise: a fourth of each direction.
const LIVELY: f64 = 1.0 / 16.0;
/// How long a picture counts as repeated, s: shutters take up to one, and what coasted for longer is found again as another anyway.
const MOST_S: f64 = 2.0;
/// Bytes that are handed on at a time of pixels which are no bytes.
const CHUNK: usize = 4096;

/// A detector that does not look at a picture twice.
pub(super) struct Repeated {
    detector: Box<dyn Detector>,
    picture: Option<Picture>,
    sample: Vec<u32>,
    /// Which of the pixels have changed, until they are enough.
    changed: Vec<bool>,
    lively: bool,
}

/// The picture that is shown.
struct Picture {
    crc: u32,
    sample: Vec<u32>,
    size: (usize, usize),
    since: Timestamp,
    /// Whether it was shown once more already.
    again: bool,
    /// The camera's motion to it.
    motion: Option<CameraMotion>,
}

impl Repeated {
    pub(super) fn new(detector: Box<dyn Detector>) -> Self {
        Self { detector, picture: None, sample: Vec::new(), changed: Vec::new(), lively: false }
    }

    /// Whether the frame shows the last picture again; its scan then.
    fn is_again(&mut self, frame: &Frame, scan: &mut Scan) -> bool {
        let crc = crc(&frame.pixels);
        sample(&frame.pixels, &mut self.sample);
        let size = (frame.pixels.width(), frame.pixels.height());
        let Some(last) = &mut self.picture else {
            let sample = std::mem::take(&mut self.sample);
            self.picture = Some(Picture { crc, sample, size, since: frame.time, again: false, motion: None });
            return false;
        };
        if (&last.sample, last.crc, last.size) != (&self.sample, crc, size) {
            if !self.lively {
                self.changed.resize(self.sample.len(), false);
                let pairs = last.sample.iter().zip(&self.sample);
                self.changed.iter_mut().zip(pairs).for_each(|(changed, (a, b))| *changed |= a != b);
                let n_changed = self.changed.iter().filter(|c| **c).count();
                self.lively = n_changed as f64 > LIVELY * self.sample.len() as f64;
            }
            (last.crc, last.size, last.since, last.again) = (crc, size, frame.time, false);
            std::mem::swap(&mut last.sample, &mut self.sample);
            return false;
        }
        let again = self.lively && (!last.again || frame.time.seconds_since(last.since) <= MOST_S);
        last.again = true;
        if again {
            scan.detections.clear();
            (scan.index, scan.time, scan.blind) = (frame.index, frame.time, true);
            // Nothing is known of a motion that is none.
            scan.camera_motion = last.motion.map(|motion| CameraMotion {
                centre_px: motion.centre_px,
                basis: MotionBasis::Measured,
                ..CameraMotion::exact_shift(nalgebra::Vector2::zeros())
            });
        }
        again
    }

    /// Keeps how the camera moved to a picture that was looked at.
    fn note(&mut self, scan: &Scan) {
        if let Some(picture) = &mut self.picture {
            picture.motion = scan.camera_motion;
        }
    }
}

impl Detector for Repeated {
    fn detect(&mut self, frame: &Frame, scan: &mut Scan) -> Result<()> {
        if !self.is_again(frame, scan) {
            self.detector.detect(frame, scan)?;
            self.note(scan);
        }
        Ok(())
    }

    fn prime_s(&self) -> f64 {
        self.detector.prime_s()
    }

    fn prime(&mut self, frames: &[Frame]) -> Result<()> {
        self.detector.prime(frames)
    }

    fn leave_out_below(&mut self, area_px: u32) -> bool {
        self.detector.leave_out_below(area_px)
    }

    fn begin(&mut self, frame: &Frame, scan: &mut Scan) -> Result<bool> {
        if self.is_again(frame, scan) {
            return Ok(true);
        }
        let done = self.detector.begin(frame, scan)?;
        self.note(scan);
        Ok(done)
    }

    fn twin(&self) -> Option<Box<dyn Detector>> {
        self.detector.twin()
    }
}

/// CRC-32 of all pixels.
fn crc(pixels: &Pixels) -> u32 {
    fn of<T: Copy, const N: usize>(image: &Image<T>, bytes: impl Fn(T) -> [u8; N], hasher: &mut Hasher) {
        let mut chunk = [[0; N]; CHUNK];
        for values in image.as_slice().chunks(CHUNK) {
            chunk.iter_mut().zip(values).for_each(|(c, v)| *c = bytes(*v));
            hasher.update(chunk[..values.len()].as_flattened());
        }
    }
    let mut hasher = Hasher::new();
    match pixels {
        Pixels::Gray8(i) => hasher.update(i.as_slice()),
        Pixels::Rgb8(i) => hasher.update(i.as_slice().as_flattened()),
        Pixels::Gray16(i) => of(i, u16::to_le_bytes, &mut hasher),
        Pixels::GrayF32(i) => of(i, f32::to_le_bytes, &mut hasher),
    }
    hasher.finalize()
}

/// Replaces `out` by pixels at even distances, odd ones: those of one column are not all.
fn sample(pixels: &Pixels, out: &mut Vec<u32>) {
    fn of<T: Copy>(image: &Image<T>, bits: impl Fn(T) -> u32, out: &mut Vec<u32>) {
        let values = image.as_slice();
        out.extend(values.iter().step_by((values.len() / SAMPLES) | 1).map(|v| bits(*v)));
    }
    out.clear();
    match pixels {
        Pixels::Gray8(i) => of(i, u32::from, out),
        Pixels::Rgb8(i) => of(i, |[r, g, b]| u32::from_le_bytes([r, g, b, 0]), out),
        Pixels::Gray16(i) => of(i, u32::from, out),
        Pixels::GrayF32(i) => of(i, f32::to_bits, out),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vision::{DetectorConfig, threshold::ThresholdConfig};
    use crate::{FrameIndex, PixelKind, SourceInfo};

    const SIDE: usize = 64;

    /// A ground, which is another in every picture if it is noise, and a bright square that has come so far.
    fn pixels(kind: PixelKind, picture: usize, noise: bool, far: usize) -> Pixels {
        let value = |i: usize| {
            let seed = if noise { picture * SIDE * SIDE + i } else { i };
            let (x, y) = (i % SIDE, i / SIDE);
            let square = (20..26).contains(&y) && (far..far + 6).contains(&x);
            20 + (seed.wrapping_mul(2_654_435_761) >> 16) as u8 % 8 + 120 * u8::from(square)
        };
        fn image<T: Copy + Default>(of: impl Fn(usize) -> T) -> Image<T> {
            Image::from_vec(SIDE, SIDE, (0..SIDE * SIDE).map(of).collect()).unwrap()
        }
        match kind {
            PixelKind::Gray8 => Pixels::Gray8(image(value)),
            PixelKind::Gray16 => Pixels::Gray16(image(|i| u16::from(value(i)))),
            PixelKind::GrayF32 => Pixels::GrayF32(image(|i| f32::from(value(i)))),
            PixelKind::Rgb8 => Pixels::Rgb8(image(|i| [value(i); 3])),
        }
    }

    fn frame(k: usize, pixels: Pixels) -> Frame {
        Frame { index: FrameIndex(k as u64), time: Timestamp::from_secs_f64(0.1 * k as f64), pixels }
    }

    fn detector(kind: PixelKind, config: &DetectorConfig) -> Box<dyn Detector> {
        let (label, reader) = (String::new(), String::new());
        let (n_frames, rate_hz, true_times) = (None, Some(10.0), true);
        let info = SourceInfo { label, reader, width: SIDE, height: SIDE, kind, n_frames, rate_hz, true_times };
        crate::vision::build(config, &info).unwrap()
    }

    /// The scans of pictures of these numbers, in each of which the square has come 2 px farther; in turns by `detect` and by `begin` and a twin.
    fn scans(kind: PixelKind, noise: bool, shown: &[usize], config: &DetectorConfig) -> Vec<Scan> {
        let mut detector = detector(kind, config);
        let mut twin = detector.twin();
        let look = |(k, picture): (usize, &usize)| {
            let frame = frame(k, pixels(kind, *picture, noise, 2 * picture));
            let mut scan = Scan::default();
            match &mut twin {
                Some(twin) if k % 2 == 1 => {
                    if !detector.begin(&frame, &mut scan).unwrap() {
                        twin.finish(&frame, &mut scan).unwrap();
                    }
                }
                _ => detector.detect(&frame, &mut scan).unwrap(),
            }
            assert_eq!((scan.index, scan.time), (frame.index, frame.time));
            scan
        };
        shown.iter().enumerate().map(look).collect()
    }

    fn blind(scans: &[Scan]) -> Vec<usize> {
        (0..scans.len()).filter(|k| scans[*k].blind).collect()
    }

    #[test]
    fn a_picture_that_is_shown_again_is_no_look_whatever_its_pixels_are() {
        let shown = [0, 1, 2, 2, 3, 4, 4, 4, 5, 6];
        for kind in [PixelKind::Gray8, PixelKind::Gray16, PixelKind::GrayF32, PixelKind::Rgb8] {
            // One that takes frames in any order, and one that remembers those before.
            for threshold in [ThresholdConfig::Otsu(Default::default()), ThresholdConfig::Moving(Default::default())] {
                let config = DetectorConfig { threshold, ..DetectorConfig::default() };
                let found = scans(kind, true, &shown, &config);
                assert_eq!(blind(&found), [3, 6, 7], "{kind:?}");
                let of_otsu = matches!(config.threshold, ThresholdConfig::Otsu(_));
                assert!(found.iter().all(|s| !s.blind || s.detections.is_empty()), "{kind:?}");
                assert!(!of_otsu || found.iter().all(|s| s.blind != (s.detections.len() == 1)), "{kind:?}");
                let all = DetectorConfig { look_at_repeated: true, ..config };
                assert!(blind(&scans(kind, true, &shown, &all)).is_empty());
            }
        }
    }

    #[test]
    fn what_stands_before_a_ground_without_noise_is_looked_at() {
        let config = DetectorConfig::default();
        assert!(blind(&scans(PixelKind::Gray8, false, &[0, 1, 2, 2, 2, 3], &config)).is_empty());
        assert!(blind(&scans(PixelKind::Gray8, true, &[0, 0, 0], &config)).is_empty(), "nothing is known of the first");
    }

    #[test]
    fn a_picture_that_stands_for_seconds_is_looked_at_again() {
        let shown: Vec<usize> = (0..40).map(|k| k.min(5)).collect();
        assert_eq!(
            blind(&scans(PixelKind::Gray8, true, &shown, &DetectorConfig::default())),
            (6..26).collect::<Vec<_>>()
        );
    }

    #[test]
    fn one_pixel_of_a_count_makes_another_picture() {
        for place in [0, 1, 777, SIDE * SIDE - 1] {
            let mut detector = detector(PixelKind::Gray16, &DetectorConfig::default());
            let mut scan = Scan::default();
            for k in 0..4 {
                let mut pixels = pixels(PixelKind::Gray16, k.min(2), true, 10);
                if let (3, Pixels::Gray16(image)) = (k, &mut pixels) {
                    image.as_mut_slice()[place] += 1;
                }
                detector.detect(&frame(k, pixels), &mut scan).unwrap();
                assert!(!scan.blind);
            }
        }
    }

    #[test]
    fn the_picture_of_a_camera_that_moves_stands_where_it_stood() {
        struct Panning;
        impl Detector for Panning {
            fn detect(&mut self, frame: &Frame, scan: &mut Scan) -> Result<()> {
                *scan = Scan::at(frame.index, frame.time);
                scan.camera_motion = (frame.index.0 > 0).then(|| CameraMotion::exact_shift([5.0, 0.0].into()));
                Ok(())
            }
        }
        let mut detector = Repeated::new(Box::new(Panning));
        let mut scan = Scan::default();
        let shifts = [0, 1, 1, 2].iter().enumerate().map(|(k, picture)| {
            detector.detect(&frame(k, pixels(PixelKind::Gray8, *picture, true, 10)), &mut scan).unwrap();
            scan.camera_motion.and_then(|m| m.measured_shift_px()).map(|s| s.x)
        });
        assert_eq!(shifts.collect::<Vec<_>>(), [None, Some(5.0), Some(0.0), Some(5.0)]);
    }
}
