//! Several compact bright things of one kind on an even dark ground: cells, nuclei, droplets under a fluorescence microscope.
//!
//! Source: our own. The frame is smoothed (5 x 5 mean: nuclei are textured, dim ones are hardly above the noise) and cut at k robust deviations
//! above its median, over the whole frame. Cells are there if most of what is cut out lies in pieces of one size that fill their boxes as
//! an ellipse does (π/4 = 0.79); woods, horizons and clouds do not.

use super::digits::round;
use super::evidence::Evidence;
use super::ground::Ground;
use super::looks;
use super::spread::spread;
use super::stretch;
use super::value_step::value_step;
use crate::camera::CameraConfig;
use crate::tempo::Tempo;
use crate::vision::config::DetectorConfig;
use crate::vision::spatial::{SpatialConfig, WindowConfig};
use crate::vision::threshold::{LocalConfig, Polarity, ThresholdConfig};
use crate::{Config, Detection, Frame, Result, SourceInfo};

/// Least cells a frame.
const LEAST: f64 = 6.0;
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

/// The detector, with a least area that lets everything but specks through.
fn detector(info: &SourceInfo, min_area_px: u32, step: f64) -> DetectorConfig {
    // One cell of the background's grid holds the whole frame.
    let cell_px = info.width.max(info.height).clamp(4, 4096) as u32;
    let local = LocalConfig { k: 5.0, polarity: Polarity::Bright, cell_px, min_contrast: round(LEAST_STEPS * step) };
    let mut config = DetectorConfig {
        filter: SpatialConfig::Mean(WindowConfig { size: 5, ..WindowConfig::default() }),
        threshold: ThresholdConfig::Local(local),
        max_detections: Some(5000),
        ..DetectorConfig::default()
    };
    config.cluster.min_area_px = Some(min_area_px);
    config.camera = CameraConfig::Fixed;
    config
}

/// Whether a piece fills its box as an ellipse does and is not much longer than wide.
fn is_compact(d: &Detection) -> bool {
    let (w, h) = (d.extent.width_px, d.extent.height_px);
    let fill = f64::from(d.area_px) / (w * h).max(1.0);
    (0.55..=0.9).contains(&fill) && w.max(h) <= 2.5 * w.min(h)
}

/// Cells, if the frames are of that kind.
/// # Errors
/// Frames of more than one size or pixel type.
pub fn look(frames: &[Frame], info: &SourceInfo, n_threads: usize) -> Result<Option<Cells>> {
    let (seen, fits) = count(frames, info, n_threads)?;
    Ok(fits.then_some(seen))
}

/// The compact pieces in the frames, and whether they are cells.
/// # Errors
/// Frames of more than one size or pixel type.
pub fn count(frames: &[Frame], info: &SourceInfo, n_threads: usize) -> Result<(Cells, bool)> {
    let pixels = (info.width * info.height) as f64;
    // A thing of less than 10 px across is a spot, not a cell.
    let specks = 60;
    let step = value_step(frames);
    let scans = looks::scans(&detector(info, specks, step), spread(frames, LOOKS), info, n_threads)?;
    let (mut areas, mut compact, mut all, mut looks) = (Vec::new(), 0.0, 0.0, 0usize);
    for scan in &scans {
        looks += 1;
        for d in &scan.detections {
            let area = f64::from(d.area_px);
            all += area;
            if is_compact(d) {
                compact += area;
                areas.push(area);
            }
        }
    }
    areas.sort_by(f64::total_cmp);
    let at = |share: f64| areas.get((share * areas.len() as f64) as usize).copied().unwrap_or(0.0);
    let looks = looks.max(1) as f64;
    let (per_frame, share) = (areas.len() as f64 / looks, all / (looks * pixels.max(1.0)));
    let fits = per_frame >= LEAST
        && (CUT_OUT[0]..=CUT_OUT[1]).contains(&share)
        && compact >= COMPACT_SHARE * all
        && at(0.75) <= MOST_SPREAD * at(0.25);
    let area_px = if areas.is_empty() { ASSUMED_AREA_PX } else { at(0.5) };
    Ok((Cells { per_frame, area_px, step }, fits))
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
    let detector = detector(info, least_area(cells), cells.step);
    let scans = looks::scans(&detector, places.iter().map(|&k| &frames[k]), info, n_threads)?;
    Ok(Evidence::of_looks(&scans, places, ground, info))
}

/// Least area of a cell among such, px.
fn least_area(cells: &Cells) -> u32 {
    round((0.1 * cells.area_px).max(60.0)) as u32
}

/// Writes detector and tracker.
pub fn configure(cells: &Cells, info: &SourceInfo, interval_s: f64, config: &mut Config, reasons: &mut Vec<String>) {
    let side = cells.area_px.sqrt();
    let least = least_area(cells);
    reasons.push(format!(
        "Some {:.0} bright compact pieces a frame on an even dark ground, about {side:.0} px across: cells. So what lies 5 robust deviations above the \
         smoothed frame's median is detected, in pieces of {least} px or more.",
        cells.per_frame
    ));
    config.detector = detector(info, least, cells.step);
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
        let cells = look(&discs, &info, 1).unwrap().expect("twelve discs");
        // The 5 x 5 mean spreads a disc of radius 14 by up to 2 px: between pi 14² and pi 16².
        assert!(cells.per_frame == 12.0 && (615.0..=804.0).contains(&cells.area_px), "{cells:?}");
        let (bars, info) = frames(false);
        assert_eq!(look(&bars, &info, 1).unwrap(), None);
    }
}
