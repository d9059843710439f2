//! Spot detector: small targets by their local contrast, one detection for each peak of a centre-minus-surround filter.
//!
//! Response D = S - B: S the frame smoothed by a box applied twice (close to a Gaussian of the optics), B the mean of a wider
//! box. A peak is the largest D within size/2; it counts if D stands k robust deviations of D (median and 1.4826 x MAD
//! on a grid; at least the k-th part of the least contrast) above its surroundings. Position: centroid of the positive part of D in a disc that is moved until
//! it is centred, after Crocker & Grier, J. Colloid Interface Sci. 179, 298 (1996), but by parts of a pixel and with a soft
//! edge, so that positions are not drawn to whole pixels; the disc has half of the size, less where another peak is near: no more than half of the way to it (`spot/peaks.rs`), and is symmetric where the frame ends (`spot/border.rs`). Of two
//! positions closer than size/2 the stronger stays.
//! Covariance: D is linear in the pixels, so c = Σ D p / Σ D has the covariance σ² Σ_j (K * p)_j² / (Σ D)², K the kernel of D cut
//! to the disc; the sum over j is computed once, at build. A disc that moves with the centroid by the part q of an error
//! enlarges it to 1/(1-q). Where the outer parts of D are negative they are cut off and add no noise, so the lesser covariance of the disc and of the smallest one counts: by that of the largest alone e² is half of what is stated (test). A spot that is longer than the others may be two, and its position is as uncertain as its light is long (`spot/elongation.rs`). The model ends where negative D is clipped: for peaks of a few deviations the truth is
//! somewhat larger. Pixels without a value (NaN) take their left neighbour's.
//! Symbols: σ noise of one pixel (counts); p position in the disc (px).

use super::boxes::Boxes;
use super::grid::BackgroundGrid;
use super::summits::{Rows, find_summits};
use super::{Side, SpotConfig};
use crate::vision::config::DetectorConfig;
use crate::vision::pixel::Pixel;
use crate::vision::target_finder::{PixelNoise, TargetFinder, TypedFrame};
use crate::{Detection, Extent, Image, Result};
use nalgebra::{Matrix2, Vector2};

mod border;
mod centring;
mod disc;
mod elongation;
mod peaks;
mod unseen;

use centring::{Centroid, MOST_PULL, centroid};
pub use disc::DIAMETER_PER_WIDTH;
use disc::{Disc, Moments, discs, part};
use elongation::{Elongation, Moments2};
use peaks::{Summit, find_nearest};
use unseen::Unseen;

/// A spot.
#[derive(Clone, Debug)]
struct Spot {
    position: Vector2<f64>,
    /// Σ of the positive response in the disc, counts.
    mass: f64,
    /// How far the disc's centroid moves when the disc moves by 1 px: the response cut off at its edge.
    pull: Vector2<f64>,
    score: f32,
    peak: (usize, usize),
    disc: Disc,
    /// Square of the distance to the nearest other peak, px².
    nearest2: usize,
    /// What is added to the covariance, px², since it may be two.
    doubt: Matrix2<f64>,
}

/// A spot of one sign as a detection, before the signs are compared.
#[derive(Clone, Debug)]
struct Found {
    detection: Detection,
    response: f32,
    peak: (usize, usize),
    sign: f32,
}

/// The spot detector with the memory it keeps between frames.
#[derive(Clone, Debug)]
pub struct SpotDetector {
    config: SpotConfig,
    /// Odd sides of the smoothing and of the surrounding box, px.
    smooth: usize,
    surround: usize,
    /// Half of the size, px.
    radius: usize,
    /// Offsets nearer than two pixels beyond that, among which a peak is the largest.
    peak_offsets: Vec<(i32, i32)>,
    /// From the smallest to the largest.
    discs: Vec<Disc>,
    unseen: Unseen,
    elongation: Elongation,
    shapes: Vec<(Option<Moments2>, f64)>,
    /// A float frame without missing values.
    whole: Image<f32>,
    response: Image<f32>,
    boxes: Boxes,
    grid: BackgroundGrid,
    noise: PixelNoise,
    level: Vec<f32>,
    /// Columns of the row where a pixel may be a peak.
    columns: Vec<usize>,
    summits: Vec<Summit>,
    spots: Vec<Spot>,
    keep: Vec<bool>,
    found: Vec<Found>,
}

fn odd(v: f64) -> usize {
    // A cast saturates; sizes were checked by the configuration.
    (v.round().max(1.0) as usize) | 1
}

impl<T: Pixel> TargetFinder<T> for SpotDetector {
    fn remembers(&self) -> bool {
        false
    }

    fn find(&mut self, frame: &TypedFrame<T>, config: &DetectorConfig, out: &mut Vec<Detection>) -> Result<()> {
        let noise = self.noise.of(frame.raw, &config.noise);
        self.detect(frame.image, noise, out);
        Ok(())
    }
}

impl SpotDetector {
    /// Builds the detector for a checked configuration.
    pub fn new(config: &SpotConfig) -> Self {
        let smooth = odd(config.smooth_px.unwrap_or(config.size_px / 4.0).max(1.0));
        let surround = odd(config.size_px * config.surround).max(smooth + 2);
        let radius = ((config.size_px / 2.0).floor() as usize).max(1);
        let r = radius as i32;
        let peak_offsets = (-r - 1..=r + 1)
            .flat_map(|y| (-r - 1..=r + 1).map(move |x| (x, y)))
            .filter(|(x, y)| x * x + y * y < (r + 2) * (r + 2))
            .collect();
        let cell = (4.0 * config.size_px).max(32.0) as usize;
        let discs = discs(config.size_px, smooth, surround);
        let largest = discs[discs.len() - 1].radius;
        let unseen = Unseen::new(config.size_px, (smooth, surround), largest);
        Self {
            config: config.clone(),
            smooth,
            surround,
            radius,
            peak_offsets,
            elongation: Elongation::new(discs[0].radius, config.size_px, radius as f64 + 2.0),
            shapes: Vec::new(),
            discs,
            unseen,
            whole: Image::default(),
            response: Image::default(),
            boxes: Boxes::new(smooth, surround),
            grid: BackgroundGrid::of_smoothed(cell, smooth),
            noise: PixelNoise::default(),
            level: Vec::new(),
            columns: Vec::new(),
            summits: Vec::new(),
            spots: Vec::new(),
            keep: Vec::new(),
            found: Vec::new(),
        }
    }

    /// Appends the spots of a frame in raster order of their peaks; `noise` is the variance of one pixel at intensity 0,
    /// counts², and its growth with intensity, counts.
    pub fn detect<T: Pixel>(&mut self, image: &Image<T>, noise: (f64, f64), out: &mut Vec<Detection>) {
        if image.as_slice().is_empty() {
            return;
        }
        self.fill_response(image);
        for side in [Side::Bright, Side::Dark] {
            if !self.config.polarity.has(side) {
                continue;
            }
            let sign = if side == Side::Bright { 1.0 } else { -1.0 };
            if side == Side::Dark {
                self.response.as_mut_slice().iter_mut().for_each(|v| *v = -*v);
            }
            self.grid.refresh(&self.response);
            self.find_peaks();
            self.drop_doubles();
            self.doubt_long_ones();
            let mut found = std::mem::take(&mut self.found);
            found.extend(self.spots.iter().map(|s| Found {
                detection: self.detection(image, s, noise, sign),
                response: self.response.row(s.peak.1)[s.peak.0],
                peak: s.peak,
                sign,
            }));
            self.found = found;
        }
        self.found.sort_unstable_by_key(|f| (f.peak.1, f.peak.0));
        let kept = (0..self.found.len()).filter(|&i| !self.is_side_lobe(i));
        out.extend(kept.map(|i| self.found[i].detection.clone()));
        self.found.clear();
    }

    /// Whether a spot is but the rim of a stronger one of the other sign: the filter answers with an opposite ring.
    fn is_side_lobe(&self, i: usize) -> bool {
        let this = &self.found[i];
        let reach = self.surround / 2 + self.radius + self.smooth;
        let near = |f: &Found| {
            f.peak.0.abs_diff(this.peak.0) <= reach && f.sign != this.sign && f.response > 2.0 * this.response
        };
        let rows = |f: &&Found| f.peak.1.abs_diff(this.peak.1) <= reach;
        self.found[..i].iter().rev().take_while(rows).any(near) || self.found[i..].iter().take_while(rows).any(near)
    }

    fn fill_response<T: Pixel>(&mut self, image: &Image<T>) {
        if T::STEP > 0.0 {
            return self.boxes.run(image, &mut self.response);
        }
        if (self.whole.width(), self.whole.height()) != (image.width(), image.height()) {
            self.whole.reset(image.width(), image.height(), 0.0);
        }
        let mut last = 0.0;
        for (f, p) in self.whole.as_mut_slice().iter_mut().zip(image.as_slice()) {
            let v = p.value_f32();
            if v.is_finite() {
                last = v;
            }
            *f = last;
        }
        self.boxes.run(&self.whole, &mut self.response);
    }

    fn find_peaks(&mut self) {
        let (mut spots, mut summits) = (std::mem::take(&mut self.spots), std::mem::take(&mut self.summits));
        spots.clear();
        summits.clear();
        let h = self.response.height();
        for y in 0..h {
            self.grid.level_row(y, self.config.k as f32, self.config.min_contrast as f32, 1.0, &mut self.level);
            let row = self.response.row(y);
            let above = if y > 0 { self.response.row(y - 1) } else { &[] };
            let below = if y + 1 < h { self.response.row(y + 1) } else { &[] };
            self.columns.clear();
            find_summits(Rows { above, row, below, level: &self.level }, &mut self.columns);
            for &x in &self.columns {
                if self.is_peak(x, y, row[x]) {
                    let (median, deviation) = self.grid.at(x as f64, y as f64);
                    let deviation = deviation.max(self.least_deviation());
                    summits.push(Summit { x, y, v: row[x], median, deviation, nearest2: usize::MAX });
                }
            }
        }
        find_nearest(&mut summits, (2 * self.largest_disc().radius).max(self.elongation.alone_px()));
        spots.extend(summits.iter().map(|s| self.spot(s)));
        (self.spots, self.summits) = (spots, summits);
    }

    /// Whether no pixel within half of the size around (x, y) is larger; of equals the first in raster order is the peak.
    fn is_peak(&self, x: usize, y: usize, v: f32) -> bool {
        self.peak_offsets.iter().all(|&(dx, dy)| {
            let other = self.at(x as i64 + i64::from(dx), y as i64 + i64::from(dy));
            other.is_none_or(|o| o < v || (o == v && (dy, dx) >= (0, 0)))
        })
    }

    fn at(&self, x: i64, y: i64) -> Option<f32> {
        let (x, y) = (usize::try_from(x).ok()?, usize::try_from(y).ok()?);
        self.response.get(x, y)
    }

    /// The spot of a peak.
    fn spot(&self, summit: &Summit) -> Spot {
        let disc = self.disc_for(summit);
        let Centroid { position, mass, pull } =
            centroid(&self.response, disc.radius, Vector2::new(summit.x as f64, summit.y as f64));
        let score = ((f64::from(summit.v) - summit.median) / summit.deviation).min(1e9) as f32;
        let (peak, nearest2) = ((summit.x, summit.y), summit.nearest2);
        Spot { position, mass, pull, score, peak, disc, nearest2, doubt: Matrix2::zeros() }
    }

    /// Least deviation that a score counts in, counts: that of which the least contrast is k. Of a ground without noise, or of one that a codec has flattened in most places, half of the
    /// responses are 0; there a score is the contrast in units that stay the same from frame to frame. Without a least contrast it is what f32 can say.
    fn least_deviation(&self) -> f64 {
        (self.config.min_contrast / self.config.k).max(1e-6)
    }

    /// Of spots closer than size / 2 the strongest stays.
    fn drop_doubles(&mut self) {
        let reach2 = (self.config.size_px / 2.0).powi(2);
        self.keep.clear();
        self.keep.resize(self.spots.len(), true);
        // Spots come in raster order of their peaks, and no position is further from its peak than the disc moves.
        let window = self.largest_disc().radius + 10;
        for i in 0..self.spots.len() {
            for j in i + 1..self.spots.len() {
                let (a, b) = (&self.spots[i], &self.spots[j]);
                if b.peak.1 > a.peak.1 + 2 * window {
                    break;
                }
                if (a.position - b.position).norm_squared() < reach2 {
                    self.keep[if b.mass > a.mass { i } else { j }] = false;
                }
            }
        }
        let mut keep = self.keep.iter();
        self.spots.retain(|_| keep.next().is_none_or(|k| *k));
    }

    /// Says of those that are longer than usual how uncertain that makes where one of two is.
    fn doubt_long_ones(&mut self) {
        let (elongation, response) = (&mut self.elongation, &self.response);
        elongation.suit(response, self.spots.iter().map(|s| (s.position, s.nearest2)));
        let shape = |s: &Spot| (elongation.measure(response, s.position, s.nearest2), s.mass / s.disc.share);
        self.shapes.clear();
        self.shapes.extend(self.spots.iter().map(shape));
        let (spots, area_px2) = (&mut self.spots, self.response.as_slice().len() as f64);
        self.elongation.judge(&self.shapes, area_px2, |i, doubt| spots[i].doubt = doubt);
    }

    /// The largest disc that reaches no farther than half of the way to the nearest other peak, or the smallest there is.
    fn disc_for(&self, summit: &Summit) -> Disc {
        let fits = |d: &&Disc| 4 * d.radius.pow(2) <= summit.nearest2;
        *self.discs.iter().rev().find(fits).unwrap_or(&self.discs[0])
    }

    /// Variance of a spot's position along the axes for noise of this variance of a pixel, px²: the lesser of its disc and of the smallest. What a larger disc has in addition is mostly cut off at 0,
    /// where noise does nothing.
    fn variance_px2(&self, spot: &Spot, pixel: f64) -> Vector2<f64> {
        let own =
            spot.pull.map(|pull| pixel * spot.disc.noise_gain / (spot.mass * (1.0 - pull.min(MOST_PULL))).powi(2));
        let smallest = &self.discs[0];
        if smallest.radius >= spot.disc.radius {
            return own;
        }
        let Moments { sum, edge, .. } = border::moments(&self.response, smallest.radius, spot.position);
        // Of a flat top it has no hold at all.
        own.zip_map(&edge, |own, edge| own.min(pixel * smallest.noise_gain / (sum - edge).max(0.0).powi(2)))
    }

    fn largest_disc(&self) -> Disc {
        self.discs[self.discs.len() - 1]
    }

    fn detection<T: Pixel>(&self, image: &Image<T>, spot: &Spot, noise: (f64, f64), sign: f32) -> Detection {
        let (cx, cy) = (spot.position.x.round() as i64, spot.position.y.round() as i64);
        let top = self.response.get(spot.peak.0, spot.peak.1).unwrap_or(0.0);
        // The pixels above half the peak, for the size.
        let (mut area, mut low, mut high) = (0, (cx, cy), (cx, cy));
        let mut peak = f32::NEG_INFINITY;
        // Those nearer than two pixels beyond the radius.
        let outer = spot.disc.radius as i64 + 2;
        for dy in 1 - outer..outer {
            let (y, reach) = (cy + dy, (outer * outer - dy * dy - 1).isqrt());
            let (from, row) = part(&self.response, y, cx - reach, cx + reach);
            let (_, pixels) = part(image, y, cx - reach, cx + reach);
            for (x, (v, pixel)) in (from..).zip(row.iter().zip(pixels)) {
                if *v >= 0.5 * top {
                    area += 1;
                    low = (low.0.min(x), low.1.min(y));
                    high = (high.0.max(x), high.1.max(y));
                    peak = peak.max(sign * pixel.value_f32());
                }
            }
        }
        // Rounding and clipping leave a little even without noise. A missing value counts as 0.
        let level = image.get(spot.peak.0, spot.peak.1).map_or(0.0, Pixel::value).max(0.0);
        let variance = (noise.0 + noise.1 * level).max(0.0);
        let unseen = self.unseen.variance_px2(spot.position, spot.pull, (image.width(), image.height()));
        let sd2 = (self.variance_px2(spot, variance) + unseen).add_scalar(1e-4);
        Detection {
            position: spot.position,
            cov: Matrix2::from_diagonal(&sd2) + spot.doubt,
            extent: Extent {
                left_px: low.0 as f64 - 0.5,
                top_px: low.1 as f64 - 0.5,
                width_px: (high.0 - low.0 + 1) as f64,
                height_px: (high.1 - low.1 + 1) as f64,
            },
            area_px: area.max(1),
            peak: if peak.is_finite() { sign * peak } else { top },
            sum: spot.mass / spot.disc.share,
            score: spot.score,
            class: None,
            velocity: None,
            fit: None,
            age_ns: 0,
            plot: None,
        }
    }
}

#[cfg(test)]
mod tests;
