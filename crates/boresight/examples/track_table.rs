//! Tracks a table of detections and writes tracks, MOTChallenge text and a report; frames, if given, only lie behind.
//!
//! `cargo run --release --example track_table -- DETECTIONS OUT_FOLDER [FRAMES]`

use boresight::io::{self, DetectionsCsv, MotWriter, OpenOptions, TableOptions, TracksCsv, read_detections};
use boresight::report::{HtmlReport, Notes};
use boresight::track::{self, TrackerConfig};
use boresight::{Error, ErrorKind, Result, Sink, View};
use std::path::Path;
use std::time::Instant;

fn main() {
    if let Err(error) = run() {
        eprintln!("error: {error}");
        std::process::exit(1);
    }
}

fn run() -> Result<()> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [table, folder, frames @ ..] = words.as_slice() else {
        return Err(Error::new(ErrorKind::Config, "expected DETECTIONS OUT_FOLDER [FRAMES]"));
    };
    let out = Path::new(folder);
    std::fs::create_dir_all(out).map_err(|e| Error::new(ErrorKind::Output, "cannot be made").at(folder).because(e))?;
    let begin = Instant::now();
    let detections = read_detections(table, &TableOptions { std_per_side: 0.05, ..TableOptions::default() })?;
    let reading_s = begin.elapsed().as_secs_f64();
    let mut source = frames.first().map(|f| io::open(f, &OpenOptions::default())).transpose()?;
    let config = TrackerConfig::default();
    let mut tracker = track::build(&config)?;
    let mut report = HtmlReport::create(out.join("report.html"))?;
    let mut sinks: Vec<Box<dyn Sink + '_>> = vec![
        Box::new(TracksCsv::create(out.join("tracks.csv"))?),
        Box::new(DetectionsCsv::create(out.join("detections.csv"))?),
        Box::new(MotWriter::create(out.join("mot.txt"))?),
        Box::new(report.sink()),
    ];
    let (mut tracking_s, mut writing_s) = (0.0, 0.0);
    for scan in &detections.scans {
        let begin = Instant::now();
        let tracks = tracker.step(scan)?;
        tracking_s += begin.elapsed().as_secs_f64();
        let begin = Instant::now();
        let frame = match &mut source {
            Some(source) => source.next_frame()?,
            None => None,
        };
        for sink in &mut sinks {
            sink.put(&View { frame: frame.as_ref(), scan, tracks })?;
        }
        writing_s += begin.elapsed().as_secs_f64();
    }
    sinks.into_iter().try_for_each(Sink::finish)?;
    report.write(&Notes {
        input: table.clone(),
        facts: vec![("Read as".into(), detections.format.clone())],
        settings: vec![format!("tracker: {config:#?}")],
        warnings: detections.warnings.clone(),
        stages: vec![("read".into(), reading_s), ("track".into(), tracking_s), ("write".into(), writing_s)],
        ..Notes::default()
    })
}
