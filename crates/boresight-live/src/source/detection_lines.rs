//! Detections as JSON lines, an object for each scan: `{"time_s":0.04,"detections":[{"x_px":10.5,"y_px":7}]}`.
//!
//! Of a detection `x_px` and `y_px` must be there; `cov_px2` (`[x,x] [x,y] [y,y]`; 1 px² each if absent), the box (`left_px`, `top_px`,
//! `width_px`, `height_px`), `area_px`, `peak`, `sum`, `score` and `class` may. `blind` says that nothing could be detected,
//! `camera_motion` how the background moved, `parameters` (of a record) what the tracker assumed from that scan on. Other fields are passed over, so a record's lines are read as they are. A line that cannot be read is left out and counted.
//! Limits: 4 MB a line, 100,000 detections a scan.

use super::feed::{Content, Feed};
use crate::motion::MotionLine;
use boresight::boresight_filters::nalgebra::{Matrix2, Vector2};
use boresight::track::TrackerParameters;
use boresight::{ClassId, Detection, Error, ErrorKind, Extent, FrameIndex, Result, Scan, SourceInfo, Timestamp};
use serde::Deserialize;
use std::io::{BufRead, Read};

const MAX_LINE: u64 = 4 << 20;
const MAX_DETECTIONS: usize = 100_000;

#[derive(Deserialize)]
struct Line {
    time_s: Option<f64>,
    detections: Vec<Row>,
    #[serde(default)]
    blind: bool,
    camera_motion: Option<MotionLine>,
    parameters: Option<Box<TrackerParameters>>,
}

#[derive(Deserialize)]
struct Row {
    x_px: f64,
    y_px: f64,
    cov_px2: Option<[f64; 3]>,
    left_px: Option<f64>,
    top_px: Option<f64>,
    width_px: Option<f64>,
    height_px: Option<f64>,
    area_px: Option<u32>,
    peak: Option<f32>,
    sum: Option<f64>,
    score: Option<f32>,
    class: Option<u32>,
}

impl Row {
    fn detection(&self) -> Result<Detection> {
        let [xx, xy, yy] = self.cov_px2.unwrap_or([1.0, 0.0, 1.0]);
        let position = Vector2::new(self.x_px, self.y_px);
        let (w, h) = (self.width_px.unwrap_or(0.0), self.height_px.unwrap_or(0.0));
        let around = Extent::around(position, w, h);
        let extent = Extent {
            left_px: self.left_px.unwrap_or(around.left_px),
            top_px: self.top_px.unwrap_or(around.top_px),
            ..around
        };
        let numbers = [self.x_px, self.y_px, xx, xy, yy, extent.left_px, extent.top_px, w, h];
        if !numbers.iter().all(|v| v.is_finite()) || w < 0.0 || h < 0.0 {
            return Err(Error::new(
                ErrorKind::Damaged,
                "a detection holds a number that is no position, size or covariance",
            ));
        }
        if !(xx > 0.0 && yy > 0.0 && xy * xy < xx * yy) {
            return Err(Error::new(
                ErrorKind::Damaged,
                "cov_px2 is no covariance: [x,x] and [y,y] must be above 0, and the determinant too",
            ));
        }
        let d = Detection::at(position, Matrix2::new(xx, xy, xy, yy))
            .with_extent(extent)
            .with_class(self.class.map(ClassId));
        let d = d.with_area_px(self.area_px.unwrap_or(1)).with_peak(self.peak.unwrap_or(1.0));
        Ok(d.with_sum(self.sum.unwrap_or(1.0)).with_score(self.score.unwrap_or(1.0)))
    }
}

/// Reads one line as a scan with what comes with it, and whether it states its time.
/// # Errors
/// What is wrong with it.
pub fn parse(line: &str, index: u64) -> Result<(Content, bool)> {
    let line: Line = serde_json::from_str(line)
        .map_err(|e| Error::new(ErrorKind::Damaged, "expected a JSON object with \"detections\"").because(e))?;
    if line.detections.len() > MAX_DETECTIONS {
        let what = format!("{} detections in one scan: expected at most {MAX_DETECTIONS}", line.detections.len());
        return Err(Error::new(ErrorKind::Damaged, what));
    }
    let detections = line.detections.iter().map(Row::detection).collect::<Result<Vec<_>>>()?;
    let time = Timestamp::from_secs_f64(line.time_s.unwrap_or(0.0));
    let motion = line.camera_motion.as_ref().and_then(MotionLine::motion);
    let scan =
        Scan::at(FrameIndex(index), time).with_detections(detections).with_blind(line.blind).with_camera_motion(motion);
    let content = match line.parameters {
        Some(parameters) => Content::Adapted(scan, parameters),
        None => Content::Scan(scan),
    };
    Ok((content, line.time_s.is_some()))
}

/// Scans from lines.
pub struct DetectionLines<R> {
    reader: R,
    line: Vec<u8>,
    n_given: u64,
    n_lines: u64,
    n_bad: u64,
    has_stamps: bool,
    late_ns: i64,
    warnings: Vec<String>,
}

impl<R: BufRead + Send> DetectionLines<R> {
    /// Lines of this reader, which may come so late, s, by their times.
    pub fn new(reader: R, late_s: f64) -> Self {
        let late_ns = Timestamp::from_secs_f64(late_s).ns;
        let (line, warnings) = (Vec::new(), Vec::new());
        Self { reader, line, n_given: 0, n_lines: 0, n_bad: 0, has_stamps: true, late_ns, warnings }
    }

    /// Reads a line into `self.line`; of one that is too long only its beginning is kept. `false` at the end.
    fn read_line(&mut self) -> Result<bool> {
        let broken = |e| Error::new(ErrorKind::Damaged, "the lines cannot be read").because(e);
        self.line.clear();
        let n = self.reader.by_ref().take(MAX_LINE).read_until(b'\n', &mut self.line).map_err(broken)?;
        if n as u64 == MAX_LINE && self.line.last() != Some(&b'\n') {
            loop {
                let rest = self.reader.fill_buf().map_err(broken)?;
                let end = rest.iter().position(|b| *b == b'\n').map(|k| k + 1);
                let (used, over) = (end.unwrap_or(rest.len()), end.is_some() || rest.is_empty());
                self.reader.consume(used);
                if over {
                    break;
                }
            }
        }
        self.n_lines += 1;
        Ok(n > 0)
    }
}

impl<R: BufRead + Send> Feed for DetectionLines<R> {
    fn next(&mut self) -> Result<Option<Content>> {
        while self.read_line()? {
            let text = String::from_utf8_lossy(&self.line);
            let text = text.trim();
            if text.is_empty() {
                continue;
            }
            match parse(text, self.n_given) {
                Ok((content, has_time)) => {
                    // One line without a time decides for all: half of a clock is none.
                    self.has_stamps &= has_time;
                    self.n_given += 1;
                    return Ok(Some(content));
                }
                Err(e) => {
                    self.n_bad += 1;
                    if self.n_bad == 1 {
                        self.warnings.push(format!("line {} is left out, and others like it: {e}", self.n_lines));
                    }
                }
            }
        }
        Ok(None)
    }

    fn has_stamps(&self) -> bool {
        self.has_stamps
    }

    fn late_ns(&self) -> Option<i64> {
        Some(self.late_ns)
    }

    fn info(&self) -> Option<&SourceInfo> {
        None
    }

    fn bad_lines(&self) -> u64 {
        self.n_bad
    }

    fn warnings(&self) -> &[String] {
        &self.warnings
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(text: &[u8]) -> (Vec<Scan>, u64) {
        let mut lines = DetectionLines::new(std::io::BufReader::with_capacity(16, text), 1.0);
        let mut scans = Vec::new();
        while let Some(Content::Scan(scan)) = lines.next().unwrap() {
            scans.push(scan);
        }
        (scans, lines.bad_lines())
    }

    #[test]
    fn a_line_is_a_scan_and_what_is_absent_has_its_default() {
        let text = b"{\"time_s\":0.04,\"detections\":[{\"x_px\":10.5,\"y_px\":7,\"cov_px2\":[0.25,0,0.5],\"class\":3}]}\n\n{\"time_s\":0.08,\"detections\":[],\"tracks\":[]}";
        let (scans, bad) = all(text);
        assert_eq!((scans.len(), bad, scans[0].time.ns, scans[1].index.0), (2, 0, 40_000_000, 1));
        let d = &scans[0].detections[0];
        assert_eq!((d.position.x, d.cov[(1, 1)], d.class, d.area_px), (10.5, 0.5, Some(ClassId(3)), 1));
    }

    #[test]
    fn what_is_no_scan_is_left_out_and_counted() {
        let long =
            [b"{\"detections\":[".as_slice(), &vec![b' '; 5 << 20], b"]}\n{\"time_s\":1,\"detections\":[]}\n"].concat();
        let (scans, bad) = all(&long);
        assert_eq!((scans.len(), bad), (1, 1), "a line without end costs itself");
        for line in [
            "[]",
            "{\"detections\":[{\"x_px\":1}]}",
            "{\"detections\":[{\"x_px\":1,\"y_px\":2,\"cov_px2\":[1,2,1]}]}",
            "{\"detections\":[{\"x_px\":1,\"y_px\":2,\"width_px\":-1}]}",
            "{\"detections\":[{\"x_px\":1e999,\"y_px\":2}]}",
            "\u{0}\u{1}",
        ] {
            assert_eq!(all(line.as_bytes()).1, 1, "{line}");
        }
    }
}
