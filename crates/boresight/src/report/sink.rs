//! The report of a run: its sink collects while the run goes on, then the page is written.

use super::collect::Collected;
use super::map::Map;
use super::notes::Notes;
use super::page;
use crate::io::{AtomicFile, LengthUnit, RadarPicture};
use crate::{Error, ErrorKind, Result, Sink, View};
use std::io::Write;
use std::path::PathBuf;

/// A report that is being made. Dropped unwritten, no file appears.
///
/// ```
/// use boresight::report::{HtmlReport, Notes};
/// use boresight::{Scan, Sink, View};
///
/// # fn main() -> boresight::Result<()> {
/// # let dir = tempfile::tempdir().unwrap();
/// # let path = dir.path().join("report.html");
/// let mut report = HtmlReport::create(&path)?;
/// let mut sink = report.sink(); // one of the sinks of a run
/// sink.put(&View { frame: None, scan: &Scan::default(), tracks: &[] })?;
/// report.write(&Notes { warnings: vec!["An empty run.".into()], ..Notes::default() })?;
/// # assert!(path.exists());
/// # Ok(())
/// # }
/// ```
pub struct HtmlReport {
    file: AtomicFile,
    seen: Collected,
    map: Option<Map>,
    unit: LengthUnit,
}

opaque_debug!(HtmlReport);

impl HtmlReport {
    /// Begins a report.
    /// # Errors
    /// [`ErrorKind::Output`] if it cannot be written.
    pub fn create(path: impl Into<PathBuf>) -> Result<Self> {
        Ok(Self { file: AtomicFile::create(path)?, seen: Collected::default(), map: None, unit: LengthUnit::Pixel })
    }

    /// Draws a map, north up, in the place of trajectories over a picture.
    pub fn with_map(mut self, radar: RadarPicture) -> Self {
        self.unit = radar.unit;
        self.map = Some(Map::new(radar));
        self
    }

    /// Says what positions are counted in; pixels if nothing is said.
    pub fn with_unit(mut self, unit: LengthUnit) -> Self {
        self.unit = unit;
        self
    }

    /// The sink through which the report sees a run.
    pub fn sink(&mut self) -> ReportSink<'_> {
        ReportSink { seen: &mut self.seen, map: self.map.as_mut() }
    }

    /// Writes the page; only now the file appears.
    /// # Errors
    /// [`ErrorKind::Output`] if it cannot be written.
    pub fn write(mut self, notes: &Notes) -> Result<()> {
        let html = page::page(notes, &self.seen, self.map.as_ref(), self.unit);
        self.file.write_all(html.as_bytes()).map_err(|e| {
            Error::new(ErrorKind::Output, "cannot be written").at(self.file.part_path().display()).because(e)
        })?;
        self.file.finish()
    }
}

/// Collects what a report needs; it writes nothing itself.
pub struct ReportSink<'a> {
    seen: &'a mut Collected,
    map: Option<&'a mut Map>,
}

impl std::fmt::Debug for ReportSink<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ReportSink").finish_non_exhaustive()
    }
}

impl Sink for ReportSink<'_> {
    fn put(&mut self, view: &View<'_>) -> Result<()> {
        self.seen.put(view);
        if let Some(map) = &mut self.map {
            map.put(view);
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Frame, FrameIndex, Image, Pixels, Scan, Timestamp, TrackState, TrackStatus};
    use boresight_filters::Gaussian;
    use nalgebra::{Matrix2, SMatrix, SVector, Vector2};

    /// A report of `n_frames` with `n_tracks` that move; some values are not finite.
    fn report(n_frames: u64, n_tracks: u64, mut notes: Notes) -> String {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("report.html");
        let mut report = HtmlReport::create(&path).unwrap();
        let mut sink = report.sink();
        for k in 0..n_frames {
            let pixels = Pixels::Gray8(Image::filled(64, 48, (k % 200) as u8));
            let frame = Frame { index: FrameIndex(k), time: Timestamp::from_ns(k as i64 * 40_000_000), pixels };
            let tracks: Vec<TrackState> = (1..=n_tracks)
                .map(|id| {
                    let x = if k == 3 { f64::NAN } else { (k + id) as f64 % 64.0 };
                    let mean = SVector::<f64, 4>::new(x, 25.0, 24.0, -1e-9);
                    let innovation = crate::record::TrackInnovation {
                        innovation: Vector2::new(0.1, -0.2),
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
        notes.stages = vec![("detect".into(), 0.5)];
        report.write(&notes).unwrap();
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
            verdict: Some((evil.into(), true)),
            next: Some(evil.into()),
            look: Some(evil.into()),
            facts: vec![(evil.into(), evil.into())],
            settings: vec![evil.into()],
            configuration: Some(evil.into()),
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
    fn a_track_has_one_colour_in_video_overview_table_and_curves() {
        let html = report(20, 3, Notes::default());
        let [r, g, b] = crate::palette::track_colour(crate::TrackId(3));
        let colour = format!("#{r:02x}{g:02x}{b:02x}");
        assert_eq!(data(&html)["tracks"].as_array().unwrap()[2]["colour"], colour);
        for place in [format!("stroke=\"{colour}\" data-track=\"3\""), format!("background:{colour}")] {
            assert!(html.contains(&place), "{place}");
        }
        // Key frames stand before everything else.
        assert!(html.find("class=\"keys\"").unwrap() < html.find("Summary").unwrap());
    }

    #[test]
    fn only_the_longest_twenty_are_drawn_at_first() {
        let html = report(30, 25, Notes::default());
        let of = |group: &str| html.matches(&format!("class=\"path {group} pick\"")).count();
        assert_eq!((of("few"), of("many"), of("never")), (20, 5, 0));
        assert!(
            html.contains("all 25 tracks, not the 20 longest") && html.contains("class=\"view hide-many hide-never\"")
        );
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
