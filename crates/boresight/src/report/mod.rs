//! The self-contained HTML report: one file that opens offline, with figures that answer the pointer.
//!
//! A sink collects what the figures need while the run goes on, in bounded memory whatever its length (`collect`), and
//! writes the page at the end (`page`). The figures follow the thesis: trajectories (4.6, 4.9), states (4.7, 4.10,
//! 4.11), their errors' bounds (4.13) and innovations with bounds (4.14); without truth the bounds are the filter's own.
//! Settings, warnings and times per stage come from the run through [`ReportNotes`], at any moment before the end.

mod collect;
mod consistency;
mod page;
mod picture;
mod text;

use crate::io::AtomicFile;
use crate::{Error, ErrorKind, Result, Sink, View};
use std::io::Write;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

/// What the report says besides what it sees: handed in before the end of the run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Notes {
    /// Title; empty: the input's name.
    pub title: String,
    /// Name of the input.
    pub input: String,
    /// Further lines of the summary: name and value.
    pub facts: Vec<(String, String)>,
    /// The settings chosen, each with its reason, one line each; what follows an empty line is the configuration in full.
    pub settings: Vec<String>,
    /// Warnings, each a whole sentence.
    pub warnings: Vec<String>,
    /// Time spent in each stage, s.
    pub stages: Vec<(String, f64)>,
}

/// A handle on the notes of a report that is being made; clones share them.
#[derive(Clone, Debug, Default)]
pub struct ReportNotes(Arc<Mutex<Notes>>);

impl ReportNotes {
    /// Changes the notes.
    pub fn edit(&self, change: impl FnOnce(&mut Notes)) {
        change(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner));
    }

    fn get(&self) -> Notes {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// Writes `report.html`.
pub struct HtmlReport {
    file: AtomicFile,
    notes: ReportNotes,
    seen: collect::Collected,
    late: Option<LateReport>,
}

opaque_debug!(HtmlReport);

/// A report whose page is written after the run, when the times of all stages are known.
///
/// Its sink only hands over what it saw; dropped unwritten, no file appears.
#[derive(Clone, Default)]
pub struct LateReport(Arc<Mutex<Option<(AtomicFile, ReportNotes, collect::Collected)>>>);

opaque_debug!(LateReport);

impl LateReport {
    /// Adds what is known at last and writes the page; nothing happens if the sink was not finished.
    /// # Errors
    /// [`ErrorKind::Output`] if it cannot be written.
    pub fn write(&self, edit: impl FnOnce(&mut Notes)) -> Result<()> {
        let taken = self.0.lock().unwrap_or_else(PoisonError::into_inner).take();
        let Some((file, notes, seen)) = taken else { return Ok(()) };
        notes.edit(edit);
        write_page(file, &notes.get(), seen)
    }
}

fn write_page(mut file: AtomicFile, notes: &Notes, seen: collect::Collected) -> Result<()> {
    let html = page::page(notes, seen);
    file.write_all(html.as_bytes())
        .map_err(|e| Error::new(ErrorKind::Output, "cannot be written").at(file.part_path().display()).because(e))?;
    file.finish()
}

impl HtmlReport {
    /// Begins a report; the file appears when the run ends.
    /// # Errors
    /// [`ErrorKind::Output`] if it cannot be written.
    pub fn create(path: impl Into<PathBuf>, notes: Notes) -> Result<Self> {
        let notes = ReportNotes(Arc::new(Mutex::new(notes)));
        Ok(Self { file: AtomicFile::create(path)?, notes, seen: collect::Collected::default(), late: None })
    }

    /// Begins a report whose page is written by the handle after the run.
    /// # Errors
    /// [`ErrorKind::Output`] if it cannot be written.
    pub fn late(path: impl Into<PathBuf>, notes: Notes) -> Result<(Self, LateReport)> {
        let late = LateReport::default();
        let report = Self { late: Some(late.clone()), ..Self::create(path, notes)? };
        Ok((report, late))
    }

    /// The handle through which the run hands in what is known late: warnings, times per stage.
    pub fn notes(&self) -> ReportNotes {
        self.notes.clone()
    }
}

impl Sink for HtmlReport {
    fn put(&mut self, view: &View<'_>) -> Result<()> {
        self.seen.put(view);
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<()> {
        let Self { file, notes, seen, late } = *self;
        match late {
            None => write_page(file, &notes.get(), seen),
            Some(late) => {
                *late.0.lock().unwrap_or_else(PoisonError::into_inner) = Some((file, notes, seen));
                Ok(())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Frame, FrameIndex, Image, Pixels, Scan, Timestamp, TrackState, TrackStatus};
    use boresight_filters::Gaussian;
    use nalgebra::{Matrix2, SMatrix, SVector, Vector2};

    /// A report of `n_frames` with `n_tracks` that move; some values are not finite.
    fn report(n_frames: u64, n_tracks: u64, notes: Notes) -> String {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("report.html");
        let (mut sink, late) = HtmlReport::late(&path, notes).unwrap();
        for k in 0..n_frames {
            let pixels = Pixels::Gray8(Image::filled(64, 48, (k % 200) as u8));
            let frame = Frame { index: FrameIndex(k), time: Timestamp::from_ns(k as i64 * 40_000_000), pixels };
            let tracks: Vec<TrackState> = (1..=n_tracks)
                .map(|id| {
                    let x = if k == 3 { f64::NAN } else { (k + id) as f64 % 64.0 };
                    let mean = SVector::<f64, 4>::new(x, 25.0, 24.0, -1e-9);
                    let innovation = crate::record::Innovation {
                        residual: Vector2::new(0.1, -0.2),
                        cov: Matrix2::identity(),
                        nis: if k == 5 { f64::INFINITY } else { 2.0 },
                    };
                    TrackState {
                        id: crate::TrackId(id),
                        status: if k % 7 == 6 { TrackStatus::Coasting } else { TrackStatus::Confirmed },
                        kinematics: Gaussian { mean, cov: SMatrix::identity() },
                        extent: crate::Extent::default(),
                        detection: Some(0),
                        innovation: Some(innovation),
                        score: 1.0,
                    }
                })
                .collect();
            let scan = Scan { index: frame.index, time: frame.time, detections: Vec::new(), ..Scan::default() };
            sink.put(&View { frame: Some(&frame), scan: &scan, tracks: &tracks }).unwrap();
        }
        Box::new(sink).finish().unwrap();
        assert!(!path.exists());
        late.write(|n| n.stages = vec![("detect".into(), 0.5)]).unwrap();
        std::fs::read_to_string(path).unwrap()
    }

    fn data(html: &str) -> serde_json::Value {
        let json = html.split("id=\"data\">").nth(1).unwrap().split("</script>").next().unwrap();
        serde_json::from_str(json).unwrap()
    }

    #[test]
    fn the_page_needs_nothing_from_outside_and_text_stays_text() {
        let evil = "</script><script>alert(1)</script><img src=x onerror=alert(1)>";
        let notes = Notes {
            title: evil.into(),
            input: evil.into(),
            facts: vec![(evil.into(), evil.into())],
            settings: vec![evil.into()],
            warnings: vec![evil.into()],
            stages: Vec::new(),
        };
        let html = report(20, 2, notes);
        assert!(!html.contains("<img") && html.matches("</script>").count() == 2);
        // The only addresses are the name space of SVG and the picture that is inside.
        for word in ["src=", "@import", "url(http", "fetch(", "<link", "//cdn"] {
            assert!(
                !html.contains(word) || html.matches(word).count() == html.matches("&lt;img src=x").count(),
                "{word}"
            );
        }
        assert_eq!(html.matches("http").count(), html.matches("http://www.w3.org/2000/svg").count());
        assert!(html.contains("href=\"data:image/png;base64,"));
    }

    #[test]
    fn the_curves_hold_what_was_seen_and_gaps_where_values_are_not_finite() {
        let data = data(&report(20, 2, Notes::default()));
        let track = &data["tracks"][0];
        assert_eq!(track["t"].as_array().unwrap().len(), 20);
        assert_eq!(
            (track["x"][0].as_f64(), track["x"][3].is_null(), track["nis"][5].is_null()),
            (Some(1.0), true, true)
        );
        assert_eq!(track["s"].as_str().unwrap(), "ccccccoccccccocccccc");
        assert_eq!(data["counts"]["c"][0].as_f64(), Some(2.0));
        assert_eq!(data["counts"]["o"][6].as_f64(), Some(2.0));
    }

    #[test]
    fn a_long_run_with_many_tracks_gives_a_page_of_bounded_size() {
        let html = report(9000, 80, Notes::default());
        assert!(html.len() < 6_000_000, "{}", html.len());
        let data = data(&html);
        let tracks = data["tracks"].as_array().unwrap();
        assert_eq!(tracks.len(), 50);
        assert!(tracks.iter().all(|t| t["t"].as_array().unwrap().len() <= 2000));
        assert!(html.contains("The 50 longest of 80 tracks"));
    }

    #[test]
    fn a_run_without_frames_or_tracks_still_gives_a_page() {
        let html = report(0, 0, Notes::default());
        assert!(html.contains("No track was started") && html.ends_with("</html>\n"));
    }
}
