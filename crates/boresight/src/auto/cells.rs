//! Several compact bright things of one kind on an even dark ground: cells, nuclei, droplets under a fluorescence microscope; or spots, if their light falls off as a Gaussian's.
//!
//! Source: our own. The frame is smoothed (5 x 5 mean: nuclei are textured, dim ones are hardly above the noise) and cut at k robust deviations
//! above its median, over the whole frame. Cells are there if most of what is cut out lies in pieces of one size that fill their boxes as
//! an ellipse does (π/4 = 0.79); woods, horizons and clouds do not. Where the pieces' profile ([`super::profile`]) is a Gaussian's they are spots, of whatever size: each has one peak, by which those that touch are told apart and
//! placed better than by the piece.

use super::digits::round;
use super::evidence::Evidence;
use super::ground::Ground;
use super::looks;
use super::noise_shown::shows_noise;
use super::particles::Particles;
use super::profile;
use super::spread::spread;
use super::stretch;
use super::value_step::value_step;
use crate::camera::CameraConfig;
use crate::tempo::Tempo;
use crate::vision::config::DetectorConfig;
use crate::vision::spatial::{SpatialConfig, WindowConfig};
use crate::vision::threshold::{LocalConfig, Polarity, ThresholdConfig};
use crate::{Config, Detection, Frame, Result, SourceInfo};

/// Least pieces a frame, and least spots.
const LEAST: f64 = 6.0;
const LEAST_SPOTS: f64 = 1.0;
/// Frames looked at.
const LOOKS: usize = 4;
/// Least share of the cut-out area that lies in compact pieces.
const COMPACT_SHARE: f64 = 0.75;
/// Least and most of the frame that is cut out.
const CUT_OUT: [f64; 2] = [0.005, 0.4];
/// Largest ratio of the upper to the lower quartile of the areas.
const MOST_SPREAD: f64 = 3.0;
/// Area of a cell where none was seen, px.
const ASSUMED_AREA_PX: f64 = 400.0;
/// Side of the square that the mean is taken over, px.
const WINDOW_PX: usize = 5;
/// Pixels of the smallest piece that counts: the mean makes fewer of a single pixel.
const LEAST_PIECE_PX: u32 = (WINDOW_PX * WINDOW_PX + 1) as u32;
/// Pixels of the smallest cell: a thing of less than 10 px across is a spot.
const LEAST_CELL_PX: f64 = 60.0;
/// Largest exponent of the profile of spots: a Gaussian's is 2; nuclei have 4 and more, discs of 12 px with soft edges, after the mean, some 2.8.
const MOST_EXPONENT: f64 = 2.3;

/// Neck at which cells that touch are cut apart, share of the narrower one's width. Of what is cut out in four public sequences (Fluo-N2DH-GOWT1, Fluo-N2DL-HeLa, Fluo-N3DH-CHO in one plane and as
/// its brightest) 6 of 614 single cells have a narrower one, and 30 of 36 pieces of several.
const NECK: f64 = 0.7;

/// Least height of a cell's pixels above the ground, steps of their values.
const LEAST_STEPS: f64 = 2.5;

/// What was seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cells {
    /// Compact pieces a frame.
    pub per_frame: f64,
    /// Their median area, px.
    pub area_px: f64,
    /// Step of the pixels' values, counts.
    pub step: f64,
}

/// What the frames are full of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pieces {
    /// Things with an edge.
    Cells(Cells),
    /// Things without.
    Spots(Particles),
    /// The same, but so few or small that isolated targets are as well, if they stand clear.
    FewSpots(Particles),
}

/// The least height of a piece.
fn level(polarity: Polarity, info: &SourceInfo, step: f64) -> LocalConfig {
    // One cell of the background's grid holds the whole frame.
    let cell_px = info.width.max(info.height).clamp(4, 4096) as u32;
    LocalConfig { k: 5.0, polarity, cell_px, min_contrast: round(LEAST_STEPS * step) }
}

/// The window of the mean.
fn window() -> WindowConfig {
    WindowConfig { size: WINDOW_PX, ..WindowConfig::default() }
}

/// The detector, with a least area that lets everything but specks through.
fn detector(polarity: Polarity, info: &SourceInfo, min_area_px: u32, step: f64) -> DetectorConfig {
    let mut config = DetectorConfig {
        filter: SpatialConfig::Mean(window()),
        threshold: ThresholdConfig::Local(level(polarity, info, step)),
        max_detections: Some(5000),
        ..DetectorConfig::default()
    };
    config.cluster.min_area_px = Some(min_area_px);
    config.camera = CameraConfig::Fixed;
    config
}

/// The detector that cuts cells apart which touch; pieces of what is no cell are not, or they would come to look like cells.
fn cut_apart(mut detector: DetectorConfig) -> DetectorConfig {
    detector.cluster.neck = Some(NECK);
    detector
}

/// Whether a piece fills its box as an ellipse does and is not much longer than wide.
fn is_compact(d: &Detection) -> bool {
    let (w, h) = (d.extent.width_px, d.extent.height_px);
    let fill = f64::from(d.area_px) / (w * h).max(1.0);
    (0.55..=0.9).contains(&fill) && w.max(h) <= 2.5 * w.min(h)
}

/// Areas of compact pieces, and what is cut out beside them.
#[derive(Clone, Debug, Default)]
struct Areas {
    /// From the smallest to the largest, px.
    sorted: Vec<f64>,
    all_px: f64,
    /// Frames looked at, and the pixels of one.
    looks: f64,
    pixels: f64,
}

impl Areas {
    fn at(&self, share: f64) -> Option<f64> {
        self.sorted.get((share * self.sorted.len() as f64) as usize).copied()
    }

    fn per_frame(&self) -> f64 {
        self.sorted.len() as f64 / self.looks
    }

    /// Those of cells, of which smaller pieces are none.
    fn of_cells(mut self) -> Self {
        self.sorted.retain(|a| *a >= LEAST_CELL_PX);
        self
    }

    /// Whether there are any and most of what is cut out is compact and of one size.
    fn are_of_one_kind(&self) -> bool {
        self.per_frame() >= LEAST_SPOTS
            && self.share() <= CUT_OUT[1]
            && self.sorted.iter().sum::<f64>() >= COMPACT_SHARE * self.all_px
            && self.at(0.75) <= self.at(0.25).map(|a| MOST_SPREAD * a)
    }

    /// Whether they are as many as cells are.
    fn are_many(&self) -> bool {
        self.per_frame() >= LEAST && self.share() >= CUT_OUT[0]
    }

    /// Share of the frames that is cut out.
    fn share(&self) -> f64 {
        self.all_px / (self.looks * self.pixels)
    }
}

/// Cells or spots, if the frames are of that kind: bright, or else dark spots.
/// # Errors
/// Frames of more than one size or pixel type.
pub fn look(frames: &[Frame], info: &SourceInfo, n_threads: usize) -> Result<Option<Pieces>> {
    let (_, bright) = count(frames, info, n_threads)?;
    match bright {
        Some(_) => Ok(bright),
        None => Ok(cut_out(Polarity::Dark, frames, info, n_threads)?.1),
    }
}

/// The bright compact pieces in the frames, as if they were cells, and what they are.
/// # Errors
/// Frames of more than one size or pixel type.
pub fn count(frames: &[Frame], info: &SourceInfo, n_threads: usize) -> Result<(Cells, Option<Pieces>)> {
    let (areas, spots) = cut_out(Polarity::Bright, frames, info, n_threads)?;
    let areas = areas.of_cells();
    let cells = Cells {
        per_frame: areas.per_frame(),
        area_px: areas.at(0.5).unwrap_or(ASSUMED_AREA_PX),
        step: value_step(frames),
    };
    let are_cells = spots.is_none() && areas.are_of_one_kind() && areas.are_many();
    Ok((cells, spots.or(are_cells.then_some(Pieces::Cells(cells)))))
}

/// The compact pieces of this polarity in the frames, and the spots that they are, if their light falls off so.
fn cut_out(
    polarity: Polarity,
    frames: &[Frame],
    info: &SourceInfo,
    n_threads: usize,
) -> Result<(Areas, Option<Pieces>)> {
    let step = value_step(frames);
    let looked: Vec<&Frame> = spread(frames, LOOKS).collect();
    let detector = detector(polarity, info, LEAST_PIECE_PX, step);
    let mut scans = looks::scans(&detector, looked.iter().copied(), info, n_threads)?;
    let looks = scans.len().max(1) as f64;
    let mut areas = Areas { looks, pixels: (info.width * info.height).max(1) as f64, ..Areas::default() };
    for scan in &mut scans {
        areas.all_px += scan.detections.iter().map(|d| f64::from(d.area_px)).sum::<f64>();
        scan.detections.retain(is_compact);
        areas.sorted.extend(scan.detections.iter().map(|d| f64::from(d.area_px)));
    }
    areas.sorted.sort_by(f64::total_cmp);
    // What a codec leaves of noise is as round as spots are.
    if !areas.are_of_one_kind() || !looked.iter().all(|frame| shows_noise(frame)) {
        return Ok((areas, None));
    }
    let seen = profile::of(&looked, &scans, &window(), &level(polarity, info, step))?;
    let spots = seen.filter(|p| p.exponent <= MOST_EXPONENT).map(|p| {
        let spots = Particles { polarity, per_frame: areas.per_frame(), width_px: p.width_px, step };
        if areas.are_many() { Pieces::Spots(spots) } else { Pieces::FewSpots(spots) }
    });
    Ok((areas, spots))
}

/// The chains of the pieces that would be detected, in the frames at these places; `ground` is the first one's in each.
/// # Errors
/// Frames of more than one size or pixel type.
pub fn chains(
    cells: &Cells,
    frames: &[Frame],
    places: &[usize],
    ground: &[Ground],
    info: &SourceInfo,
    n_threads: usize,
) -> Result<Evidence> {
    let detector = cut_apart(detector(Polarity::Bright, info, least_area(cells), cells.step));
    let scans = looks::scans(&detector, places.iter().map(|&k| &frames[k]), info, n_threads)?;
    Ok(Evidence::of_looks(&scans, places, ground, info))
}

/// Least area of a cell among such, px.
fn least_area(cells: &Cells) -> u32 {
    round((0.1 * cells.area_px).max(LEAST_CELL_PX)) as u32
}

/// Writes detector and tracker.
pub fn configure(cells: &Cells, info: &SourceInfo, interval_s: f64, config: &mut Config, reasons: &mut Vec<String>) {
    let side = cells.area_px.sqrt();
    let least = least_area(cells);
    reasons.push(format!(
        "Some {:.0} bright compact pieces a frame on an even dark ground, about {side:.0} px across: cells. So what lies 5 robust deviations above the \
         smoothed frame's median is detected, in pieces of {least} px or more; those that touch are cut apart at a neck of less than {:.0} % of their width.",
        cells.per_frame,
        100.0 * NECK
    ));
    config.detector = cut_apart(detector(Polarity::Bright, info, least, cells.step));
    let tracker = &mut config.tracker;
    *tracker = stretch::tracker(Tempo::of(interval_s));
    tracker.extra_noise_px = round((0.03 * side).max(0.5));
    tracker.acceleration_density_px2_per_s3 = round((0.06 * side).powi(2) / interval_s.powi(3));
    tracker.max_speed_px_per_s = round(0.4 * side / interval_s);
    tracker.coast_s = round(3.0 * interval_s);
    tracker.coast_scans = 3;
    tracker.field_px = Some([info.width as f64, info.height as f64]);
    reasons.push(format!(
        "Every cell is tracked from its third sighting in five, moving or not, up to {:.0} px from frame to frame.",
        0.4 * side
    ));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FrameIndex, Image, PixelKind, Pixels, Timestamp};

    /// Discs of one size, or bars of one thickness, on an even ground with noise.
    fn frames(discs: bool) -> (Vec<Frame>, SourceInfo) {
        let info = SourceInfo {
            label: "test".into(),
            reader: "test".into(),
            width: 300,
            height: 240,
            kind: PixelKind::Gray8,
            n_frames: None,
            rate_hz: None,
            true_times: false,
        };
        let make = |k: usize| {
            let mut image = Image::filled(300, 240, 0u8);
            for y in 0..240usize {
                for x in 0..300usize {
                    let (dx, dy) = ((x % 75) as f64 - 37.0, (y % 80) as f64 - 40.0);
                    let inside = if discs { dx.hypot(dy) < 14.0 } else { (dx + dy).abs() < 4.0 };
                    let noise = ((x * 7919 + y * 104_729 + k * 1_299_709) % 1009 % 5) as u8;
                    image.row_mut(y)[x] = 3 + noise + if inside { 20 } else { 0 };
                }
            }
            Frame { index: FrameIndex(k as u64), time: Timestamp::from_ns(k as i64), pixels: Pixels::Gray8(image) }
        };
        ((0..3).map(make).collect(), info)
    }

    #[test]
    fn discs_of_one_size_are_cells_and_bars_are_not() {
        let (discs, info) = frames(true);
        let Some(Pieces::Cells(cells)) = look(&discs, &info, 1).unwrap() else { panic!("twelve discs") };
        // The 5 x 5 mean spreads a disc of radius 14 by up to 2 px: between pi 14² and pi 16².
        assert!(cells.per_frame == 12.0 && (615.0..=804.0).contains(&cells.area_px), "{cells:?}");
        let (bars, info) = frames(false);
        assert_eq!(look(&bars, &info, 1).unwrap(), None);
    }
}
