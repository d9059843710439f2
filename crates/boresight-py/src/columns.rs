//! What a run leaves in memory: the columns of `tracks.csv`, and what a report needs besides.
//!
//! One row for each track and frame, 196 bytes. The rows can be shown again to any of the library's sinks, so every table and the
//! report are written by the code that the command uses.

use boresight::boresight_filters::Gaussian;
use boresight::{Detection, Extent, Frame, FrameIndex, Scan, Sink, Timestamp, TrackId, TrackInnovation};
use boresight::{
    PixelOrigin, Result, RowState, TrackRow, TrackState, TrackStatus, TrackTable, TrackTableBuilder, View,
};
use nalgebra::{Matrix2, SMatrix, Vector2, Vector4};

/// Number of the columns that are floats of 64 bits: state, covariance, size.
pub const N_FLOATS: usize = 16;

/// A frame of the run: number, time, detections, and where its rows end.
#[derive(Clone, Copy)]
struct Row {
    index: FrameIndex,
    time: Timestamp,
    n_detections: u32,
    end: usize,
}

/// The rows of a run.
#[derive(Default)]
pub struct Columns {
    /// Frame, from 0.
    pub frame: Vec<i64>,
    /// Its time, s.
    pub time_s: Vec<f64>,
    /// Track.
    pub track_id: Vec<i64>,
    /// Index into [`STATUS`].
    pub status: Vec<i8>,
    /// x, y, vx, vy, the upper triangle of the covariance of `[x, vx, y, vy]`, width, height.
    pub floats: [Vec<f64>; N_FLOATS],
    /// Number of the detection taken among those of the frame, -1 for none.
    pub detection: Vec<i64>,
    /// Confidence.
    pub score: Vec<f32>,
    /// x and y of the innovation, xx, xy, yy of its covariance, NIS; NaN without one.
    innovation: Vec<[f64; 6]>,
    frames: Vec<Row>,
    /// A frame for the report's picture, and its place among the frames.
    picture: Option<(usize, Frame)>,
}

/// The words of [`Columns::status`].
pub const STATUS: [&str; 3] = ["tentative", "confirmed", "coasting"];

/// The code of a status.
pub fn status_code(status: TrackStatus) -> i8 {
    match status {
        TrackStatus::Tentative => 0,
        TrackStatus::Confirmed => 1,
        TrackStatus::Coasting => 2,
    }
}

fn status_of(code: i8) -> TrackStatus {
    match code {
        0 => TrackStatus::Tentative,
        1 => TrackStatus::Confirmed,
        _ => TrackStatus::Coasting,
    }
}

impl Columns {
    /// Number of rows.
    pub fn len(&self) -> usize {
        self.frame.len()
    }

    /// Number of frames.
    pub fn n_frames(&self) -> usize {
        self.frames.len()
    }

    /// Adds a frame's tracks.
    pub fn push(&mut self, index: FrameIndex, time: Timestamp, n_detections: usize, tracks: &[TrackState]) {
        for t in tracks {
            self.frame.push(i64::try_from(index.0).unwrap_or(i64::MAX));
            self.time_s.push(time.as_secs_f64());
            self.track_id.push(i64::try_from(t.id.0).unwrap_or(i64::MAX));
            self.status.push(status_code(t.status));
            let (mean, cov) = (&t.kinematics.mean, &t.kinematics.cov);
            let upper = (0..4).flat_map(|i| (i..4).map(move |j| cov[(i, j)]));
            let values = [0, 2, 1, 3].into_iter().map(|k| mean[k]).chain(upper);
            let values = values.chain([t.extent.width_px, t.extent.height_px]);
            self.floats.iter_mut().zip(values).for_each(|(column, v)| column.push(v));
            self.detection.push(t.detection.map_or(-1, i64::from));
            self.score.push(t.score);
            self.innovation.push(t.innovation.as_ref().map_or([f64::NAN; 6], |i| {
                [i.innovation.x, i.innovation.y, i.cov[(0, 0)], i.cov[(0, 1)], i.cov[(1, 1)], i.nis]
            }));
        }
        let n_detections = u32::try_from(n_detections).unwrap_or(u32::MAX);
        self.frames.push(Row { index, time, n_detections, end: self.frame.len() });
    }

    /// The track of a row.
    fn state(&self, row: usize) -> TrackState {
        let f = |k: usize| self.floats[k][row];
        let mut cov = SMatrix::<f64, 4, 4>::zeros();
        let mut at = 4;
        for i in 0..4 {
            for j in i..4 {
                cov[(i, j)] = f(at);
                cov[(j, i)] = f(at);
                at += 1;
            }
        }
        let [ix, iy, xx, xy, yy, nis] = self.innovation[row];
        let innovation = (!nis.is_nan()).then(|| TrackInnovation {
            innovation: Vector2::new(ix, iy),
            cov: Matrix2::new(xx, xy, xy, yy),
            nis,
        });
        TrackState {
            id: TrackId(self.track_id[row].unsigned_abs()),
            status: status_of(self.status[row]),
            kinematics: Gaussian { mean: Vector4::new(f(0), f(2), f(1), f(3)), cov },
            extent: Extent::around(Vector2::new(f(0), f(1)), f(14), f(15)),
            detection: u32::try_from(self.detection[row]).ok(),
            innovation,
            score: self.score[row],
        }
    }

    /// Shows the run to a sink once more.
    pub fn replay(&self, sink: &mut dyn Sink) -> Result<()> {
        let (mut begin, mut tracks) = (0, Vec::new());
        let nothing = Detection::at(Vector2::zeros(), Matrix2::identity());
        for (k, row) in self.frames.iter().enumerate() {
            tracks.clear();
            tracks.extend((begin..row.end).map(|r| self.state(r)));
            begin = row.end;
            let detections = vec![nothing.clone(); row.n_detections as usize];
            let scan = Scan::at(row.index, row.time).with_detections(detections);
            let frame = self.picture.as_ref().filter(|(at, _)| *at == k).map(|(_, f)| f);
            sink.put(&View { frame, scan: &scan, tracks: &tracks })?;
        }
        Ok(())
    }

    /// The rows as the table that evaluation and formats take; tentative rows only if asked for.
    pub fn table(&self, label: &str, tentative: bool) -> Result<TrackTable> {
        let mut builder = TrackTableBuilder::new(label, PixelOrigin::Centre0);
        let sizeless = self.floats[14].iter().chain(&self.floats[15]).all(|s| *s == 0.0);
        if sizeless && self.len() > 0 {
            builder.points();
        }
        let mut begin = 0;
        for row in &self.frames {
            for r in (begin..row.end).filter(|&r| tentative || self.status[r] != 0) {
                let f = |k: usize| self.floats[k][r];
                let table_row = TrackRow {
                    frame: u32::try_from(row.index.0).unwrap_or(u32::MAX),
                    id: self.track_id[r],
                    bbox: [f(0) - 0.5 * f(14), f(1) - 0.5 * f(15), f(14), f(15)],
                    score: f64::from(self.score[r]),
                    ..TrackRow::default()
                };
                let state = RowState {
                    time: Some(row.time),
                    status: Some(status_of(self.status[r])),
                    detection: u32::try_from(self.detection[r]).ok(),
                    velocity: Some([f(2), f(3)]),
                    position_cov: None,
                    cov: Some(std::array::from_fn(|k| f(4 + k))),
                };
                builder.push_with_state(&table_row, &state)?;
            }
            begin = row.end;
        }
        let mut table = builder.finish(self.frames.last().map_or(0, |r| r.index.0 as usize + 1))?;
        table.size_px = self.picture.as_ref().map(|(_, f)| [f.pixels.width() as u32, f.pixels.height() as u32]);
        Ok(table)
    }
}

/// Fills columns while a run goes on.
pub struct Recorder<'a>(pub &'a mut Columns);

impl Sink for Recorder<'_> {
    fn put(&mut self, view: &View<'_>) -> Result<()> {
        let n = self.0.frames.len();
        // As the report takes its picture: in the end it comes from the run's second half.
        if let Some(frame) = view.frame
            && (n == 0 || n.is_power_of_two())
        {
            self.0.picture = Some((n, frame.clone()));
        }
        self.0.push(view.scan.index, view.scan.time, view.scan.detections.len(), view.tracks);
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<()> {
        Ok(())
    }
}
