//! Small pictures of the run with its tracks, evenly spread whatever its length, for the head of the report.

use super::picture::Picture;
use crate::{TrackId, TrackStatus, View};

/// Most pictures, and their longest side, px.
const MOST: usize = 8;
const MOST_SIDE: usize = 320;
/// Most tracks marked on one.
const MOST_MARKS: usize = 400;

/// One of them.
#[derive(Clone, Debug)]
pub(super) struct KeyFrame {
    pub time_s: f64,
    pub picture: Picture,
    /// Tracks that are reported, with their boxes: left, top, width, height, px.
    pub tracks: Vec<(TrackId, [f32; 4])>,
}

/// Every so many-th frame of those seen.
#[derive(Debug, Default)]
pub(super) struct KeyFrames {
    pub kept: Vec<KeyFrame>,
    /// Frames between two of them is two to the power of this.
    step_log2: u32,
    n: u64,
}

impl KeyFrames {
    /// Looks at the next view.
    pub fn put(&mut self, view: &View<'_>) {
        let k = self.n;
        self.n += 1;
        if !k.is_multiple_of(1 << self.step_log2) {
            return;
        }
        let Some(frame) = view.frame else { return };
        if self.kept.len() >= MOST {
            let mut i = 0;
            self.kept.retain(|_| {
                i += 1;
                i % 2 == 1
            });
            self.step_log2 += 1;
            if !k.is_multiple_of(1 << self.step_log2) {
                return;
            }
        }
        let reported = view.tracks.iter().filter(|t| t.status != TrackStatus::Tentative).take(MOST_MARKS);
        let tracks = reported.map(|t| {
            let (e, mean) = (&t.extent, &t.kinematics.mean);
            let (x, y) = (mean[0] - e.width_px / 2.0, mean[2] - e.height_px / 2.0);
            (t.id, [x, y, e.width_px, e.height_px].map(|v| v as f32))
        });
        let tracks = tracks.filter(|(_, r)| r.iter().all(|v| v.is_finite())).collect();
        let picture = Picture::of_frame_within(frame, MOST_SIDE);
        self.kept.push(KeyFrame { time_s: view.scan.time.as_secs_f64(), picture, tracks });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Frame, FrameIndex, Image, Pixels, Scan, Timestamp};

    #[test]
    fn pictures_lie_evenly_over_a_run_of_any_length() {
        for n in [1, 8, 9, 100, 777] {
            let mut seen = KeyFrames::default();
            for k in 0..n {
                let (index, time) = (FrameIndex(k), Timestamp::from_secs_f64(k as f64));
                let frame = Frame { index, time, pixels: Pixels::Gray8(Image::filled(8, 8, 9)) };
                seen.put(&View { frame: Some(&frame), scan: &Scan::at(index, time), tracks: &[] });
            }
            let times: Vec<f64> = seen.kept.iter().map(|k| k.time_s).collect();
            assert!(times.len() <= MOST && times.len() as u64 >= n.min(4), "{n}: {times:?}");
            let step = n as f64 - times.last().unwrap();
            assert!(times.windows(2).all(|w| w[1] - w[0] == times[1] - times[0]) && step <= n as f64 / 3.0 + 1.0);
        }
    }
}
