//! What recorders, links, lamps and displays do to a clip: variants in which the targets are where they were, so that figures that fall show what the default run takes for something else. (Where the picture stands they are not where it shows them.)

use super::variant::Variant;
use anyhow::{Context, Result};
use boresight::{Image, TrackRow};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, Normal};

/// One frame in so many is shown twice.
const REPEATED_EVERY: usize = 5;
/// Probability that a frame is lost.
const LOST: f64 = 0.1;
/// The picture stands for the first of so many seconds.
const STALL_S: [f64; 2] = [0.5, 4.0];
/// Amplitude of the light's changes, and its periods a frame: 100 Hz seen at some 30 frames/s.
const FLICKER: [f64; 2] = [0.05, 0.37];
/// Height of a bar, as a share of the picture's.
const BAR: f64 = 0.125;
/// Deviation of the camera's shake along an axis, px, and the farthest.
const JITTER_PX: [f64; 2] = [1.5, 4.0];
/// Time without a picture, s.
const BLACK_S: f64 = 0.5;

/// Disturbs frames and moves the truth with what is shown; the frames' rate.
pub fn apply(how: Variant, frames: &mut Vec<Image<u8>>, rows: &mut Vec<TrackRow>, rate_hz: f64) -> Result<f64> {
    let n = frames.len();
    match how {
        Variant::Transposed => {
            *frames = frames.iter().map(transposed).collect::<Result<_>>()?;
            rows.iter_mut().for_each(|r| r.bbox = [r.bbox[1], r.bbox[0], r.bbox[3], r.bbox[2]]);
        }
        Variant::DoubleSize => {
            *frames = frames.iter().map(doubled).collect::<Result<_>>()?;
            rows.iter_mut().for_each(|r| {
                r.bbox = [2.0 * r.bbox[0] + 0.5, 2.0 * r.bbox[1] + 0.5, 2.0 * r.bbox[2], 2.0 * r.bbox[3]];
            });
        }
        Variant::Repeated => {
            let shown: Vec<usize> = (0..n)
                .flat_map(|k| std::iter::repeat_n(k, 1 + usize::from((k + 1).is_multiple_of(REPEATED_EVERY))))
                .collect();
            show(&shown, frames, rows);
            return Ok(rate_hz * (REPEATED_EVERY + 1) as f64 / REPEATED_EVERY as f64);
        }
        Variant::Lost => {
            let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
            let shown: Vec<usize> = (0..n).filter(|_| rng.random::<f64>() >= LOST).collect();
            show(&shown, frames, rows);
        }
        Variant::Stalling => {
            let [stands, every] = STALL_S.map(|s| (s * rate_hz) as usize);
            // The first stall comes after the first seconds.
            let last = |k: usize| if k >= every && k % every < stands { k - k % every } else { k };
            // What it shows of the targets stands; they go on.
            *frames = (0..n).map(|k| frames[last(k)].clone()).collect();
        }
        Variant::Flickering => {
            for (k, frame) in frames.iter_mut().enumerate() {
                let light = 1.0 + FLICKER[0] * (std::f64::consts::TAU * FLICKER[1] * k as f64).sin();
                frame.as_mut_slice().iter_mut().for_each(|p| *p = (light * f64::from(*p)).round().min(255.0) as u8);
            }
        }
        Variant::Overlaid => frames.iter_mut().enumerate().for_each(|(k, frame)| overlay(frame, k)),
        Variant::Barred => {
            let bar = (BAR * frames.first().context("no frame")?.height() as f64) as usize;
            *frames = frames.iter().map(|f| barred(f, bar)).collect::<Result<_>>()?;
            rows.iter_mut().for_each(|r| r.bbox[1] += bar as f64);
        }
        Variant::Jittering => {
            let normal = Normal::new(0.0, JITTER_PX[0])?;
            let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
            let most = JITTER_PX[1];
            let offsets: Vec<[i64; 2]> = (0..n)
                .map(|_| [0; 2].map(|_: i64| normal.sample(&mut rng).round().clamp(-most, most) as i64))
                .collect();
            let (margin, of) = (most as i64, |r: &TrackRow| offsets.get(r.frame as usize).copied().unwrap_or_default());
            *frames = frames.iter().zip(&offsets).map(|(f, o)| part(f, margin, *o)).collect::<Result<_>>()?;
            for r in rows.iter_mut() {
                let [dx, dy] = of(r);
                r.bbox[0] -= (margin + dx) as f64;
                r.bbox[1] -= (margin + dy) as f64;
            }
        }
        Variant::Black => {
            let (first, last) = (n / 2, n / 2 + (BLACK_S * rate_hz) as usize);
            frames[first..last.min(n)].iter_mut().for_each(|f| f.as_mut_slice().fill(0));
            rows.retain(|r| !(first..last).contains(&(r.frame as usize)));
        }
        _ => {}
    }
    Ok(rate_hz)
}

/// The frames of these numbers, each with the truth of what it shows.
fn show(shown: &[usize], frames: &mut Vec<Image<u8>>, rows: &mut Vec<TrackRow>) {
    *frames = shown.iter().map(|k| frames[*k].clone()).collect();
    let of = std::mem::take(rows);
    for (k, from) in shown.iter().enumerate() {
        rows.extend(of.iter().filter(|r| r.frame as usize == *from).map(|r| {
            let mut row = *r;
            row.frame = k as u32;
            row
        }));
    }
}

fn image(width: usize, height: usize, pixel: impl Fn(usize, usize) -> u8) -> Result<Image<u8>> {
    let values = (0..height).flat_map(|y| (0..width).map(move |x| [x, y])).map(|[x, y]| pixel(x, y)).collect();
    Image::from_vec(width, height, values).context("an image of another size")
}

fn transposed(of: &Image<u8>) -> Result<Image<u8>> {
    image(of.height(), of.width(), |x, y| of.row(x)[y])
}

/// Twice the size: between the middles of two pixels by a quarter and three quarters.
fn doubled(of: &Image<u8>) -> Result<Image<u8>> {
    let (w, h) = (of.width(), of.height());
    let two = |k: usize, n: usize| {
        let near = k / 2;
        let other = if k.is_multiple_of(2) { near.saturating_sub(1) } else { (near + 1).min(n - 1) };
        [near, other]
    };
    image(2 * w, 2 * h, |x, y| {
        let ([x0, x1], [y0, y1]) = (two(x, w), two(y, h));
        let p = |x: usize, y: usize| u32::from(of.row(y)[x]);
        ((9 * p(x0, y0) + 3 * (p(x1, y0) + p(x0, y1)) + p(x1, y1) + 8) / 16) as u8
    })
}

fn barred(of: &Image<u8>, bar: usize) -> Result<Image<u8>> {
    let h = of.height();
    image(of.width(), h + 2 * bar, |x, y| if (bar..bar + h).contains(&y) { of.row(y - bar)[x] } else { 0 })
}

/// What a camera that is displaced by `offset` shows, without a margin on each side.
fn part(of: &Image<u8>, margin: i64, offset: [i64; 2]) -> Result<Image<u8>> {
    let [dx, dy] = offset.map(|o| (margin + o) as usize);
    let all = 2 * margin as usize;
    image(of.width().saturating_sub(all), of.height().saturating_sub(all), |x, y| of.row(y + dy)[x + dx])
}

/// Three columns by five rows a digit, the upper row in the highest bits.
const DIGITS: [u16; 10] = [0x7b6f, 0x2c97, 0x73e7, 0x73cf, 0x5bc9, 0x79cf, 0x79ef, 0x7249, 0x7bef, 0x7bcf];

/// Draws white marks: the frame's number in the upper left corner, a cross in the middle, the corners of a frame.
fn overlay(frame: &mut Image<u8>, number: usize) {
    let (w, h) = (frame.width(), frame.height());
    let mut put = |x: usize, y: usize| {
        if x < w && y < h {
            frame.row_mut(y)[x] = 255;
        }
    };
    for (place, digit) in format!("{number:06}").bytes().map(|b| usize::from(b - b'0')).enumerate() {
        for bit in (0..15).filter(|b| DIGITS[digit] >> (14 - b) & 1 == 1) {
            let (x, y) = (8 + place * 8 + bit % 3 * 2, 8 + bit / 3 * 2);
            [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)].iter().for_each(|p| put(p.0, p.1));
        }
    }
    for k in 4..12 {
        [(w / 2 + k, h / 2), (w / 2 - k, h / 2), (w / 2, h / 2 + k), (w / 2, h / 2 - k)]
            .iter()
            .for_each(|p| put(p.0, p.1));
    }
    let (left, right, top, bottom) = (w / 4, 3 * w / 4, h / 4, 3 * h / 4);
    for k in 0..16 {
        for (x, sx) in [(left, 1), (right, -1)] {
            for (y, sy) in [(top, 1), (bottom, -1)] {
                put((x as i64 + sx * k) as usize, y);
                put(x, (y as i64 + sy * k) as usize);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(frame: u32, x: f64, y: f64) -> TrackRow {
        TrackRow { frame, bbox: [x, y, 2.0, 4.0], ..TrackRow::default() }
    }

    /// One bright pixel that moves a pixel a frame, and its truth.
    fn clip() -> (Vec<Image<u8>>, Vec<TrackRow>) {
        let frames = (0..20).map(|k| image(40, 32, |x, y| 250 * u8::from([x, y] == [10 + k, 15])).unwrap()).collect();
        (frames, (0..20).map(|k| row(k, 10.0 + f64::from(k), 15.0)).collect())
    }

    #[test]
    fn the_truth_is_where_the_pixel_is_shown() {
        use Variant::{Barred, Flickering, Jittering, Lost, Overlaid, Repeated, Transposed};
        for how in [Transposed, Repeated, Lost, Flickering, Overlaid, Barred, Jittering] {
            let (mut frames, mut rows) = clip();
            apply(how, &mut frames, &mut rows, 2.0).unwrap();
            assert_eq!(frames.len(), rows.len(), "{how:?}");
            for (frame, row) in frames.iter().zip(&rows) {
                let [x, y] = [row.bbox[0] as usize, row.bbox[1] as usize];
                assert!(frame.row(y)[x] > 230, "{how:?}, frame {}", row.frame);
            }
        }
    }

    #[test]
    fn a_picture_that_stands_shows_where_the_targets_were() {
        let (mut frames, mut rows) = clip();
        apply(Variant::Stalling, &mut frames, &mut rows, 4.0).unwrap();
        assert_eq!((frames[17].clone(), frames[18].row(15)[28]), (frames[16].clone(), 250));
        assert_eq!(rows.iter().map(|r| r.bbox[0] as usize).collect::<Vec<_>>(), (10..30).collect::<Vec<_>>());
    }

    #[test]
    fn twice_the_size_has_the_same_centroid() {
        let (mut frames, mut rows) = clip();
        apply(Variant::DoubleSize, &mut frames, &mut rows, 2.0).unwrap();
        let (mut sum, mut moment) = (0.0, [0.0; 2]);
        for y in 0..frames[3].height() {
            for (x, p) in frames[3].row(y).iter().enumerate() {
                sum += f64::from(*p);
                moment[0] += f64::from(*p) * x as f64;
                moment[1] += f64::from(*p) * y as f64;
            }
        }
        assert!((moment[0] / sum - rows[3].bbox[0]).abs() < 0.02 && (moment[1] / sum - rows[3].bbox[1]).abs() < 0.02);
    }
}
