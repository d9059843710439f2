//! The public clips and tables of the exam with their truth, by kind; each kind is cut in two halves.

use anyhow::{Context, Result};
use boresight::TrackRow;
use std::path::{Path, PathBuf};

/// Where a truth's columns are: frame, id, x or left, y or top, and width and height of boxes.
#[derive(Clone, Copy)]
pub struct Columns {
    at: [usize; 4],
    size: Option<[usize; 2]>,
    first_frame: u32,
    first_pixel: f64,
    head: bool,
}

/// The truth has one target and no column that numbers it.
const ONE: usize = usize::MAX;
const MOT: Columns = Columns { at: [0, 1, 2, 3], size: Some([4, 5]), first_frame: 1, first_pixel: 1.0, head: false };
const BOXES: Columns = Columns { head: true, ..MOT };
const POINTS: Columns = Columns { at: [0, 1, 2, 3], size: None, first_frame: 0, first_pixel: 0.0, head: true };
const MOUSE: Columns = Columns { at: [1, ONE, 2, 3], size: None, first_frame: 1, first_pixel: 0.0, head: true };
const DRONE: Columns = Columns { at: [0, ONE, 1, 2], size: Some([3, 4]), ..BOXES };
const CAR: Columns = Columns { first_pixel: 0.0, ..BOXES };

impl Columns {
    /// Points: frame, id, x, y, from 0, below a header.
    pub const POINTS: Self = POINTS;
    /// Frame, id, left, top, width, height, from 0, below a header.
    pub const CORNERS: Self = Self { first_frame: 0, ..CAR };
}

/// How near a result must be to a target.
#[derive(Clone, Copy, PartialEq)]
pub enum Near {
    /// Distance of the positions, px.
    Px(f64),
    /// Inside the truth's box grown by this, px.
    Box(f64),
}

/// A clip with its truth.
pub struct Clip {
    pub kind: &'static str,
    pub name: String,
    pub input: PathBuf,
    pub truth: PathBuf,
    pub columns: Columns,
    pub near: Near,
    /// Whether the truth holds all targets: without that nothing can be called false.
    pub whole: bool,
    /// Median contrast of the target in standard deviations of its surroundings, where it was measured.
    pub contrast: Option<f64>,
}

const SINGLE: [(&str, &str, &str, Columns, f64, bool); 6] = [
    ("people", "pets09_vtest/vtest.avi", "pets09_vtest/gt.txt", MOT, 30.0, true),
    ("people", "dctracking_pets_tud/TUD-Campus/img1", "dctracking_pets_tud/TUD-Campus/gt.txt", MOT, 30.0, true),
    ("particles", "trackpy_bulk_water/frames", "trackpy_bulk_water/trackpy_link_first60.csv", POINTS, 3.0, true),
    ("cells", "cells_ctc_gowt1/01/frames", "cells_ctc_gowt1/01/gt_points.csv", POINTS, 30.0, true),
    ("animal", "animals_tracktor/mouse_video.mp4", "animals_tracktor/mouse_video_tracked.csv", MOUSE, 15.0, true),
    ("car from the air", "uav_uavdt_S1001/frames", "uav_uavdt_S1001/gt.csv", CAR, 10.0, false),
];

/// Whether one of these is part of the name, or none is asked for.
pub fn is_wanted(only: &[String], name: &str) -> bool {
    only.is_empty() || only.iter().any(|part| name.contains(part.as_str()))
}

/// All clips that are here, by kind and name.
pub fn clips(data: &Path) -> Result<Vec<Clip>> {
    let mut out = Vec::new();
    let mut folder = |kind: &'static str, dir: &str, ending: &str, columns: Columns, near: Near| -> Result<()> {
        let dir = data.join(dir);
        let Ok(entries) = std::fs::read_dir(&dir) else { return Ok(()) };
        let mut videos: Vec<PathBuf> = entries.flatten().map(|e| e.path()).collect();
        videos.retain(|p| p.extension().is_some_and(|e| e == "mp4"));
        videos.sort();
        let contrasts = contrasts(&dir.join("index.csv"))?;
        for input in videos {
            let name = input.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            let contrast = contrasts.iter().find(|c| c.0 == name).map(|c| c.1);
            let truth = dir.join(format!("{name}{ending}"));
            out.push(Clip { kind, name, input, truth, columns, near, whole: true, contrast });
        }
        Ok(())
    };
    folder("infrared", "ir_drone_svanstrom", ".gt.csv", BOXES, Near::Box(3.0))?;
    folder("infrared, a minute", "anti_uav410", ".gt.txt", MOT, Near::Box(3.0))?;
    folder("visible, flying", "vis_drone_svanstrom", ".gt.csv", DRONE, Near::Box(5.0))?;
    for (kind, input, truth, columns, px, whole) in SINGLE {
        let (name, input) = (input.to_string(), data.join(input));
        if input.exists() {
            let truth = data.join(truth);
            out.push(Clip { kind, name, input, truth, columns, near: Near::Px(px), whole, contrast: None });
        }
    }
    Ok(out)
}

/// A user's own clips: every `NAME.csv` of points (frame, id, x, y, from 0, below a header) with `NAME.y4m`, `NAME.mp4`, `NAME.avi` or a folder `NAME`.
pub fn own(dir: &Path, near_px: f64) -> Result<Vec<Clip>> {
    let entries = std::fs::read_dir(dir).with_context(|| format!("{}", dir.display()))?;
    let mut tables: Vec<PathBuf> = entries.flatten().map(|e| e.path()).collect();
    tables.retain(|p| p.extension().is_some_and(|e| e == "csv"));
    tables.sort();
    let clip = |truth: PathBuf| {
        let inputs = ["y4m", "mp4", "avi", ""].map(|e| truth.with_extension(e));
        let input = inputs.into_iter().find(|p| p.exists())?;
        let name = truth.file_stem()?.to_string_lossy().into_owned();
        let near = Near::Px(near_px);
        Some(Clip { kind: "own", name, input, truth, columns: POINTS, near, whole: true, contrast: None })
    };
    Ok(tables.into_iter().filter_map(clip).collect())
}

/// Name and median contrast of each clip in an index, where it has such columns.
fn contrasts(index: &Path) -> Result<Vec<(String, f64)>> {
    let Ok(mut reader) = csv::Reader::from_path(index) else { return Ok(Vec::new()) };
    let head = reader.headers()?.clone();
    let column = |name: &str| head.iter().position(|h| h == name);
    let (Some(name), Some(contrast)) = (column("name"), column("median_scr")) else { return Ok(Vec::new()) };
    let rows = reader.records().map(|r| {
        let r = r?;
        Ok((r[name].to_string(), r[contrast].parse()?))
    });
    rows.collect()
}

/// Reads a truth in boresight's coordinates: centres with width and height (0 for points).
pub fn truth(path: &Path, c: &Columns) -> Result<Vec<TrackRow>> {
    let mut reader = csv::ReaderBuilder::new().has_headers(c.head).flexible(true).from_path(path)?;
    let mut rows = Vec::new();
    for record in reader.records() {
        let record = record?;
        let number = |i: usize| -> Result<f64> {
            let text = record.get(i).with_context(|| format!("{}: a row without column {i}", path.display()))?;
            text.trim().parse().with_context(|| format!("{}: {text}", path.display()))
        };
        let id = if c.at[1] == ONE { 0 } else { number(c.at[1]).unwrap_or(0.0) as i64 };
        let (mut x, mut y) = (number(c.at[2])? - c.first_pixel, number(c.at[3])? - c.first_pixel);
        let (mut w, mut h) = (0.0, 0.0);
        if let Some(at) = c.size {
            (w, h) = (number(at[0])?, number(at[1])?);
            // A box's left is its first pixel's edge, half a pixel before that pixel's centre.
            (x, y) = (x - 0.5 + 0.5 * w, y - 0.5 + 0.5 * h);
        }
        let frame = number(c.at[0])? as u32 - c.first_frame;
        rows.push(TrackRow { frame, id, bbox: [x, y, w, h], score: 1.0, ..TrackRow::default() });
    }
    Ok(rows)
}
