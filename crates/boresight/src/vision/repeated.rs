//! A picture that is shown once more is no look at the scene: where a frame shows what the frame before showed, nothing is detected in it, and its scan is blind.
//!
//! Source: our own. The shutter of an infrared camera, a link that stalls and a recorder that makes 30 frames of 25 show a picture again. What is detected in it says that the targets stand, where they go on; and then that they
//! jump. A sensor's noise is never the same twice, nor is what a codec makes of it.
//! How: the largest difference from the last picture that was looked at, up to [`LARGE`], where the search for it ends. It is 0 where a picture is repeated, or some counts where it was coded once more ([`CODED`]); of a new one it is what noise, edges and targets make it:
//! a repeated one has at most [`SMALL`] of that of the new ones before it. Of pictures without noise two may be equal while all is seen to stand: so a picture counts as repeated only once more than
//! [`LIVELY`] of the pixels have changed at some time, and for [`MOST_S`], or one frame. (Of coded infrared video 0.1 to 2 % of the pixels change from one frame to the next, and nearly all where it is coded anew.)
//! On the ground of a camera that moves the picture stands where it stood.
//! Limits: beyond 8 bits only what is equal; a key frame of the codec in a picture that stands; a picture that stands for longer is looked at again, and so is the first one.
//! Where more than [`LIVELY`] have changed once, a scene without noise that stops is taken for a picture that stands, for [`MOST_S`].

use super::Detector;
use crate::{CameraMotion, Frame, Image, MotionBasis, Pixels, Result, Scan, Timestamp};

/// Largest difference that a codec leaves in a picture which is shown again, counts of 8 bits. Clips coded by x264, x265 and MPEG-4, whose picture stands: 0 to 8 and mostly up to 5; between the frames of 44 public clips as they are 6 to 255 in the median, and 40 in half of them.
const CODED: u8 = 6;
/// The same as a share of that between new pictures, what is more than enough of it, and so many of these whose median counts; with fewer a picture must be equal.
const SMALL: f64 = 1.0 / 6.0;
const LARGE: u8 = (CODED as f64 / SMALL) as u8;
const LAST: usize = 15;
const LEAST: usize = 5;
/// Pixels whose changes are remembered.
const SAMPLES: usize = 1024;
/// Share of them that have changed at some time, so that it is the picture that lives, not a thing before a ground without noise: a fourth of each direction.
const LIVELY: f64 = 1.0 / 16.0;
/// How long a picture counts as repeated, s: shutters take up to one, and what coasted for longer is found again as another anyway.
const MOST_S: f64 = 2.0;

/// A detector that does not look at a picture twice.
pub(super) struct Repeated {
    detector: Box<dyn Detector>,
    /// The last picture that was looked at.
    last: Pixels,
    /// When this picture was first shown, whether it was shown once more already, and the camera's motion to it.
    since: Option<Timestamp>,
    again: bool,
    motion: Option<CameraMotion>,
    /// Which of some pixels have changed, until they are enough.
    changed: Vec<bool>,
    lively: bool,
    /// The largest differences between the last new pictures.
    news: Vec<u8>,
}

impl Repeated {
    pub(super) fn new(detector: Box<dyn Detector>) -> Self {
        Self {
            detector,
            last: Pixels::Gray8(Image::default()),
            since: None,
            again: false,
            motion: None,
            changed: Vec::new(),
            lively: false,
            news: Vec::with_capacity(LAST + 1),
        }
    }

    /// Whether the frame shows the last picture again; its scan then. Else it is the last one from now on.
    fn is_again(&mut self, frame: &Frame, scan: &mut Scan) -> bool {
        let differs = differs(&frame.pixels, &self.last);
        let since = *self.since.get_or_insert(frame.time);
        if differs.is_some_and(|differs| differs <= self.most()) {
            let again = self.lively && (!self.again || frame.time.seconds_since(since) <= MOST_S);
            self.again = true;
            if again {
                scan.detections.clear();
                (scan.index, scan.time, scan.blind) = (frame.index, frame.time, true);
                // Nothing is known of a motion that is none.
                scan.camera_motion = self.motion.map(|motion| CameraMotion {
                    centre_px: motion.centre_px,
                    basis: MotionBasis::Measured,
                    ..CameraMotion::exact_shift(nalgebra::Vector2::zeros())
                });
                return true;
            }
        } else {
            (self.since, self.again) = (Some(frame.time), false);
        }
        if let Some(differs) = differs {
            self.news.push(differs);
            if self.news.len() > LAST {
                self.news.remove(0);
            }
            if !self.lively {
                mark(&frame.pixels, &self.last, &mut self.changed);
                let n_changed = self.changed.iter().filter(|c| **c).count();
                self.lively = n_changed as f64 > LIVELY * self.changed.len() as f64;
            }
        }
        self.last.clone_from(&frame.pixels);
        false
    }

    /// What the detector made of a picture, in order; one that it refuses is forgotten, and refused again if it comes again.
    fn looked<T>(&mut self, made: Result<T>, scan: &Scan) -> Result<T> {
        if made.is_err() {
            self.last = Pixels::Gray8(Image::default());
        }
        self.motion = scan.camera_motion.filter(|_| made.is_ok());
        made
    }

    /// The largest difference of a picture that is shown again, counts.
    fn most(&self) -> u8 {
        let n = self.news.len();
        if n < LEAST {
            return 0;
        }
        let mut news = [0; LAST];
        news[..n].copy_from_slice(&self.news);
        let median = *news[..n].select_nth_unstable(n / 2).1;
        CODED.min((SMALL * f64::from(median)) as u8)
    }
}

impl Detector for Repeated {
    fn detect(&mut self, frame: &Frame, scan: &mut Scan) -> Result<()> {
        if self.is_again(frame, scan) {
            return Ok(());
        }
        let made = self.detector.detect(frame, scan);
        self.looked(made, scan)
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
        let made = self.detector.begin(frame, scan);
        self.looked(made, scan)
    }

    fn twin(&self) -> Option<Box<dyn Detector>> {
        self.detector.twin()
    }
}

/// The largest difference of two pictures, or the first one found from [`LARGE`] on; `None` if they are of different sizes or kinds.
fn differs(now: &Pixels, before: &Pixels) -> Option<u8> {
    fn of<T>(now: &Image<T>, before: &Image<T>, most: impl Fn(&[T], &[T]) -> u8) -> Option<u8>
    where
        T: Copy + PartialEq,
    {
        let same_size = (now.width(), now.height()) == (before.width(), before.height()) && now.width() > 0;
        let mut differs = 0;
        for y in 0..if same_size { now.height() } else { 0 } {
            differs = differs.max(most(now.row(y), before.row(y)));
            if differs >= LARGE {
                break;
            }
        }
        same_size.then_some(differs)
    }
    fn is_other<T: PartialEq>(a: &[T], b: &[T]) -> u8 {
        if a == b { 0 } else { u8::MAX }
    }
    match (now, before) {
        (Pixels::Gray8(a), Pixels::Gray8(b)) => of(a, b, most_apart),
        (Pixels::Rgb8(a), Pixels::Rgb8(b)) => of(a, b, |a, b| most_apart(a.as_flattened(), b.as_flattened())),
        (Pixels::Gray16(a), Pixels::Gray16(b)) => of(a, b, is_other),
        (Pixels::GrayF32(a), Pixels::GrayF32(b)) => of(a, b, is_other),
        _ => None,
    }
}

/// Marks which of some pixels differ; at odd distances, since those of one column are not all.
fn mark(now: &Pixels, before: &Pixels, changed: &mut Vec<bool>) {
    fn of<T: Copy + PartialEq>(now: &Image<T>, before: &Image<T>, changed: &mut Vec<bool>) {
        let step = (now.as_slice().len() / SAMPLES) | 1;
        changed.resize(now.as_slice().len().div_ceil(step), false);
        let pairs = now.as_slice().iter().zip(before.as_slice()).step_by(step);
        changed.iter_mut().zip(pairs).for_each(|(changed, (a, b))| *changed |= a != b);
    }
    match (now, before) {
        (Pixels::Gray8(a), Pixels::Gray8(b)) => of(a, b, changed),
        (Pixels::Rgb8(a), Pixels::Rgb8(b)) => of(a, b, changed),
        (Pixels::Gray16(a), Pixels::Gray16(b)) => of(a, b, changed),
        (Pixels::GrayF32(a), Pixels::GrayF32(b)) => of(a, b, changed),
        _ => {}
    }
}

widest! {
    /// The largest difference of two rows.
    fn most_apart(a: &[u8], b: &[u8]) -> u8 {
        a.iter().zip(b).fold(0, |most, (a, b)| most.max(a.abs_diff(*b)))
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
    fn one_pixel_of_a_count_makes_another_picture_beyond_8_bits() {
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
    fn a_codec_may_change_a_picture_that_is_shown_again_by_some_counts_where_new_ones_change_by_many() {
        // By how much the sixteenth frame differs from the fifteenth, behind new ones with a square that moves, or without.
        let is_blind = |with_square: bool, by: u8| {
            let mut detector = detector(PixelKind::Gray8, &DetectorConfig::default());
            let mut scan = Scan::default();
            for k in 0..16 {
                let mut pixels =
                    pixels(PixelKind::Gray8, k.min(14), true, if with_square { 2 * k.min(14) } else { 90 });
                if let (15, Pixels::Gray8(image)) = (k, &mut pixels) {
                    image.as_mut_slice()[10 * SIDE..20 * SIDE].iter_mut().for_each(|v| *v += by);
                }
                detector.detect(&frame(k, pixels), &mut scan).unwrap();
                assert!(k == 15 || !scan.blind);
            }
            scan.blind
        };
        assert!(is_blind(true, 0) && is_blind(true, 6) && !is_blind(true, 7));
        // Where new pictures differ by no more than the noise, 5 counts, nothing is small.
        assert!(is_blind(false, 0) && !is_blind(false, 1));
    }

    #[test]
    fn what_changes_little_by_little_is_looked_at_where_it_has_come_to_be_much() {
        let mut detector = detector(PixelKind::Gray8, &DetectorConfig::default());
        let (mut scan, mut blind) = (Scan::default(), Vec::new());
        for k in 0..30 {
            let mut pixels = pixels(PixelKind::Gray8, k.min(14), true, 2 * k.min(14));
            if let Pixels::Gray8(image) = &mut pixels {
                let by = 2 * k.saturating_sub(14) as u8;
                image.as_mut_slice()[10 * SIDE..20 * SIDE].iter_mut().for_each(|v| *v += by);
            }
            detector.detect(&frame(k, pixels), &mut scan).unwrap();
            blind.push(scan.blind);
        }
        assert_eq!(blind[15..23], [true, true, true, false, true, true, true, false]);
    }

    #[test]
    fn a_frame_that_is_refused_is_refused_again() {
        let mut detector = detector(PixelKind::Gray8, &DetectorConfig::default());
        let mut scan = Scan::default();
        for k in 0..4 {
            detector.detect(&frame(k, pixels(PixelKind::Gray8, k, true, 10)), &mut scan).unwrap();
        }
        for k in 4..6 {
            let other = Pixels::Gray8(Image::filled(SIDE, SIDE / 2, 9));
            assert!(detector.detect(&frame(k, other), &mut scan).is_err());
        }
        detector.detect(&frame(6, pixels(PixelKind::Gray8, 6, true, 10)), &mut scan).unwrap();
        assert!(!scan.blind);
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
