//! A clip that a test makes of a real one, followed as the default run does and held against the truth.

use crate::needs::data;
use boresight::io::OpenOptions;
use boresight::vision::DetectorConfig;
use boresight::{Config, Image, Pixels, Scan, TrackStatus, auto};
use std::collections::BTreeMap;
use std::io::Write;

/// The first frames of a real clip, grey.
pub fn grey_frames(name: &str, n: usize) -> Vec<Image<u8>> {
    let options = OpenOptions { colour: boresight::io::Colour::Gray, ..OpenOptions::default() };
    let mut source = boresight::io::open(data(name), &options).unwrap();
    let mut frames = Vec::new();
    while let Some(frame) = source.next_frame().unwrap().filter(|_| frames.len() < n) {
        let Pixels::Gray8(image) = frame.pixels else { panic!("grey was asked for") };
        frames.push(image);
    }
    frames
}

/// The truth's rows: frame from 0 on, id, left, top, width, height.
pub fn truth(name: &str) -> Vec<[f64; 6]> {
    let text = std::fs::read_to_string(data(name)).unwrap();
    let numbers = text.lines().filter(|l| l.starts_with(|c: char| c.is_ascii_digit()));
    let row = |line: &str| {
        let mut numbers = line.split(',').map(|v| v.trim().parse().unwrap_or(f64::NAN));
        // Frames and pixels from 1 on.
        let mut row: [f64; 6] = std::array::from_fn(|_| numbers.next().unwrap());
        [0, 2, 3].iter().for_each(|i| row[*i] -= 1.0);
        row
    };
    numbers.map(row).collect()
}

/// What came of a clip.
pub struct Followed {
    /// Share of the truth's rows with a confirmed or coasting track in the box grown by some pixels.
    pub held: f64,
    /// Share of the tracks' rows in such a box.
    pub precise: f64,
    /// Share of its rows in which the first target has the id that it has most often.
    pub one_id: f64,
    pub reasons: Vec<String>,
    pub detector: DetectorConfig,
}

/// Follows frames without options.
pub fn follow(frames: &[Image<u8>], rate_hz: u32, truth: &[[f64; 6]], near_px: f64) -> Followed {
    let folder = tempfile::tempdir().unwrap();
    let clip = folder.path().join("clip.y4m");
    let mut out = std::io::BufWriter::new(std::fs::File::create(&clip).unwrap());
    let (w, h) = (frames[0].width(), frames[0].height());
    writeln!(out, "YUV4MPEG2 W{w} H{h} F{rate_hz}:1 Ip A1:1 Cmono").unwrap();
    for image in frames {
        out.write_all(b"FRAME\n").and_then(|()| out.write_all(image.as_slice())).unwrap();
    }
    drop(out);
    let mut run = auto::open(&clip, &Config::default()).unwrap();
    let (mut scan, mut ids) = (Scan::default(), BTreeMap::<u64, usize>::new());
    let (mut held, mut near, mut n, mut n_true, mut n_first) = (0, 0, 0, 0, 0);
    while let Some(frame) = run.frames.next_frame().unwrap() {
        run.detector.detect(&frame, &mut scan).unwrap();
        let boxes: Vec<&[f64; 6]> = truth.iter().filter(|r| r[0] as u64 == frame.index.0).collect();
        let is_in = |[_, _, left, top, w, h]: &[f64; 6], x: f64, y: f64| {
            (left - near_px..left + w + near_px).contains(&x) && (top - near_px..top + h + near_px).contains(&y)
        };
        let tracks = run.tracker.step(&scan).unwrap().iter().filter(|t| t.status != TrackStatus::Tentative);
        let tracks: Vec<(u64, f64, f64)> = tracks.map(|t| (t.id.0, t.position().x, t.position().y)).collect();
        n_true += boxes.len();
        held += boxes.iter().filter(|b| tracks.iter().any(|(_, x, y)| is_in(b, *x, *y))).count();
        near += tracks.iter().filter(|(_, x, y)| boxes.iter().any(|b| is_in(b, *x, *y))).count();
        n += tracks.len();
        for first in boxes.iter().filter(|b| b[1] == truth[0][1]) {
            n_first += 1;
            if let Some((id, ..)) = tracks.iter().find(|(_, x, y)| is_in(first, *x, *y)) {
                *ids.entry(*id).or_default() += 1;
            }
        }
    }
    let share = |part: usize, of: usize| part as f64 / of.max(1) as f64;
    Followed {
        held: share(held, n_true),
        precise: share(near, n),
        one_id: share(ids.into_values().max().unwrap_or(0), n_first),
        reasons: run.reasons,
        detector: run.config.detector,
    }
}
