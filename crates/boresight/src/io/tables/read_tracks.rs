//! Tracks from a table: our `tracks.csv` to the last bit, MOTChallenge results, or any table with an identity column.
//!
//! Tables without covariance give tracks at the given standard deviation with unknown velocity (0 px/s, deviation one box side
//! a second); they serve to compare and to draw, not to go on filtering.

use super::columns::Field;
use super::options::TableOptions;
use super::read_detections::identified_of;
use super::row::Row;
use super::table::Table;
use crate::{Extent, FrameIndex, Result, Timestamp, TrackFrame, TrackId, TrackState, TrackStatus};
use boresight_filters::Gaussian;
use nalgebra::{SMatrix, SVector};
use std::path::Path;

/// Tracks read from a table, as states of a filter; boxes alone are a [`crate::TrackTable`].
#[derive(Clone, Debug, PartialEq)]
pub struct StateTable {
    /// The frames that have tracks, in order.
    pub frames: Vec<TrackFrame>,
    /// Rate, frames/s: given, or found from the times.
    pub rate_hz: f64,
    /// Whether the table states velocities and whole covariances, as `tracks.csv` does; else they are made up.
    pub has_states: bool,
    /// Number of rows left out.
    pub n_skipped: u64,
    /// Whole sentences about what was assumed or left out.
    pub warnings: Vec<String>,
}

/// Reads tracks from a table.
/// # Errors
/// As [`super::read_detections`]; also if no column names the track.
pub fn read_tracks(path: impl AsRef<Path>, options: &TableOptions) -> Result<StateTable> {
    options.validate("table")?;
    let path = path.as_ref();
    let mut table = Table::open(path, &options.columns)?;
    if table.form.layout.has_states() {
        return own_tracks(&mut table, options);
    }
    foreign_tracks(&mut table, options, super::seqinfo::SequenceInfo::beside(path).rate_hz)
}

/// A table of states, as our own: nothing is guessed, every number comes back to the bit.
fn own_tracks(table: &mut Table, options: &TableOptions) -> Result<StateTable> {
    let mut out = StateTable { frames: Vec::new(), rate_hz: 0.0, has_states: true, n_skipped: 0, warnings: Vec::new() };
    while let Some(row) = table.next_row()? {
        match own_row(&row) {
            Ok((index, time, state)) => match out.frames.last_mut() {
                Some(last) if last.index == index => last.tracks.push(state),
                Some(last) if last.index > index && !options.skip_bad_rows => {
                    return Err(
                        row.bad(format!("frame {} behind frame {}: expected frames in order", index.0, last.index.0))
                    );
                }
                Some(last) if last.index > index => out.n_skipped += 1,
                _ => out.frames.push(TrackFrame { index, time, tracks: vec![state] }),
            },
            Err(_) if options.skip_bad_rows => out.n_skipped += 1,
            Err(e) if row.line.cut && !out.frames.is_empty() => {
                out.n_skipped += 1;
                out.warnings.push(format!("The table breaks off in its last line, 1 row is lost: {e}."));
            }
            Err(e) => return Err(e.hint("mend the row, or leave such rows out with --skip-bad-rows")),
        }
    }
    let mut periods: Vec<f64> = out
        .frames
        .windows(2)
        .map(|w| w[1].time.seconds_since(w[0].time) / (w[1].index.0 - w[0].index.0) as f64)
        .filter(|p| *p > 0.0)
        .collect();
    periods.sort_by(f64::total_cmp);
    out.rate_hz =
        options.rate_hz.or_else(|| periods.get(periods.len() / 2).map(|p| 1.0 / p)).unwrap_or(options.assumed_rate_hz);
    Ok(out)
}

fn own_row(row: &Row<'_>) -> Result<(FrameIndex, Timestamp, TrackState)> {
    row.check_length()?;
    let wrong = |field: Field, expected: &str| row.wrong(field, &row.word(field).unwrap_or_default(), expected);
    let time = row.time()?.ok_or_else(|| wrong(Field::TimeS, "a time in seconds"))?;
    let status = row.status().ok_or_else(|| wrong(Field::Status, "tentative, confirmed or coasting"))?;
    let [vx, vy] = Field::VELOCITY.map(|f| row.need(f));
    let mean = SVector::<f64, 4>::new(row.need(Field::X)?, vx?, row.need(Field::Y)?, vy?);
    let mut cov = SMatrix::<f64, 4, 4>::zeros();
    let mut upper = Field::COV.into_iter();
    for i in 0..4 {
        for j in i..4 {
            cov[(i, j)] = upper.next().map_or(Ok(0.0), |f| row.need(f))?;
            cov[(j, i)] = cov[(i, j)];
        }
    }
    let (width_px, height_px) = (row.need(Field::Width)?, row.need(Field::Height)?);
    let extent = Extent { left_px: mean[0] - width_px / 2.0, top_px: mean[2] - height_px / 2.0, width_px, height_px };
    let detection = row.detection();
    if detection.is_none() && row.word(Field::Detection).is_some() {
        return Err(wrong(Field::Detection, "a row number or nothing"));
    }
    let id = row.id()?.and_then(|id| u64::try_from(id).ok()).ok_or_else(|| wrong(Field::Id, "a track id from 0"))?;
    let kinematics = Gaussian { mean, cov };
    let state = TrackState { id: TrackId(id), status, kinematics, extent, detection, innovation: None, score: 1.0 };
    Ok((FrameIndex(row.frame(0)?), time, state))
}

/// Any other table: its rows are read as detections and get their identities.
fn foreign_tracks(table: &mut Table, options: &TableOptions, rate_beside: Option<f64>) -> Result<StateTable> {
    if !table.is_empty {
        table.check_track()?;
    }
    let (read, ids) = identified_of(table, options, rate_beside, true)?;
    let mut out = StateTable {
        frames: Vec::new(),
        rate_hz: read.rate_hz,
        has_states: false,
        n_skipped: read.n_skipped,
        warnings: read.warnings,
    };
    let mut ids = ids.into_iter();
    for scan in read.scans {
        if scan.detections.is_empty() {
            continue;
        }
        let mut tracks = Vec::with_capacity(scan.detections.len());
        for (n, d) in scan.detections.into_iter().enumerate() {
            let Some(id) = ids.next().map(TrackId) else { break };
            let mut cov = SMatrix::<f64, 4, 4>::zeros();
            let speed2 = d.extent.width_px.max(d.extent.height_px).max(1.0).powi(2);
            for (i, j, v) in
                [(0, 0, d.cov[(0, 0)]), (0, 2, d.cov[(0, 1)]), (2, 0, d.cov[(0, 1)]), (2, 2, d.cov[(1, 1)])]
            {
                cov[(i, j)] = v;
            }
            cov[(1, 1)] = speed2;
            cov[(3, 3)] = speed2;
            let mean = SVector::<f64, 4>::new(d.position.x, 0.0, d.position.y, 0.0);
            tracks.push(TrackState {
                id,
                status: TrackStatus::Confirmed,
                kinematics: Gaussian { mean, cov },
                extent: d.extent,
                detection: u32::try_from(n).ok(),
                innovation: None,
                score: d.score,
            });
        }
        out.frames.push(TrackFrame { index: scan.index, time: scan.time, tracks });
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::{Columns, MotWriter, Output, TracksCsv};
    use crate::{Scan, Sink, View};

    fn track(id: u64, status: TrackStatus, k: f64) -> TrackState {
        let mean = SVector::<f64, 4>::new(0.1 + k, 1e-7 * k, 200.0 / 3.0, -4.5e300);
        let cov = SMatrix::<f64, 4, 4>::from_fn(|i, j| 1.0 / (1.0 + i as f64 + j as f64 + k));
        let (width_px, height_px) = (3.3, 7.0);
        let extent =
            Extent { left_px: mean[0] - width_px / 2.0, top_px: mean[2] - height_px / 2.0, width_px, height_px };
        let detection = (status == TrackStatus::Confirmed).then_some(id as u32);
        TrackState {
            id: TrackId(id),
            status,
            kinematics: Gaussian { mean, cov },
            extent,
            detection,
            innovation: None,
            score: 1.0,
        }
    }

    fn frames() -> Vec<TrackFrame> {
        [(0, TrackStatus::Tentative), (2, TrackStatus::Confirmed), (3, TrackStatus::Coasting)]
            .into_iter()
            .map(|(f, status)| TrackFrame {
                index: FrameIndex(f),
                time: Timestamp::from_ns(f as i64 * 33_366_667),
                tracks: vec![track(1, status, 0.7), track(9, TrackStatus::Confirmed, f as f64)],
            })
            .collect()
    }

    fn put_all(mut sink: Box<dyn Sink>) {
        for frame in frames() {
            let scan = Scan { index: frame.index, time: frame.time, ..Scan::default() };
            sink.put(&View { frame: None, scan: &scan, tracks: &frame.tracks }).unwrap();
        }
        sink.finish().unwrap();
    }

    #[test]
    fn our_own_tracks_come_back_to_the_last_bit() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("tracks.csv");
        put_all(Box::new(TracksCsv::create(&path).unwrap()));
        let table = read_tracks(&path, &TableOptions::default()).unwrap();
        assert_eq!(table.frames, frames());
        assert!((table.rate_hz - 29.97).abs() < 0.01);
        // A copy that breaks off anywhere inside its last line loses that line and says so.
        let whole = std::fs::read(&path).unwrap();
        std::fs::write(&path, &whole[..whole.len() - 30]).unwrap();
        let cut = read_tracks(&path, &TableOptions::default()).unwrap();
        assert_eq!((cut.n_skipped, cut.frames[2].tracks.len()), (1, 1));
    }

    #[test]
    fn mot_results_have_confirmed_tracks_only_and_come_back_at_the_same_place() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("mot.txt");
        put_all(Box::new(MotWriter::to(Output::file(&path).unwrap())));
        let table = read_tracks(&path, &TableOptions::default()).unwrap();
        let seen: Vec<_> =
            table.frames.iter().flat_map(|f| f.tracks.iter().map(move |t| (f.index.0, t.id.0))).collect();
        assert_eq!(seen, [(0, 9), (2, 1), (2, 9), (3, 9)]);
        let (got, want) =
            (table.frames[1].tracks[0].kinematics.mean, track(1, TrackStatus::Confirmed, 0.7).kinematics.mean);
        assert!((got[0] - want[0]).abs() < 1e-12 && (got[2] - want[2]).abs() < 1e-12);
    }

    #[test]
    fn rows_without_identity_are_no_tracks() {
        let mut table =
            Table::of_text("t", b"FRAME,TRACK_ID,X,Y\n0,,1,1\n0,5,2,2\n1,4,3,3\n", &Columns::default()).unwrap();
        let read = foreign_tracks(&mut table, &TableOptions::default(), None).unwrap();
        assert_eq!(read.frames.iter().map(|f| f.tracks[0].id.0).collect::<Vec<_>>(), [5, 4]);
        assert!(read.warnings.iter().any(|w| w.contains("1 rows belong to no track")));
    }
}
