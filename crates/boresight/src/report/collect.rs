//! What the report keeps of a run, in bounded memory: some 30 MB at most, whatever the number of frames and tracks.
//!
//! Curves of a track are thinned to every 2nd, 4th, .. frame when they grow too long; when many tracks live at once, only
//! the longest keep their curves. Statistics (NIS, numbers of frames and updates) count every frame of every kept track.

use super::consistency::Nis;
use super::ground::Ground;
use super::key_frames::KeyFrames;
use super::picture::Picture;
use crate::{TrackId, TrackState, TrackStatus, View};
use std::collections::BTreeMap;

/// Most points of one curve before every second one is dropped.
const MAX_POINTS: usize = 2000;
/// Most points of a path in the overview.
const MAX_PATH: usize = 256;
/// Most detections of the overview.
const MAX_DETECTIONS: usize = 6000;
/// Most samples of all tracks together before short tracks lose their curves.
const MAX_SAMPLES: usize = 240_000;
/// Tracks that keep their curves then.
const N_DETAILED: usize = 60;
/// Most tracks kept; beyond it the shortest that have ended are dropped (and counted).
const MAX_TRACKS: usize = 4000;
/// Most buckets of the counts over time.
const MAX_BUCKETS: usize = 1600;

/// Every `stride`-th of the values put in, at most `MAX` of them.
#[derive(Clone, Debug)]
pub(super) struct Thinned<T, const MAX: usize> {
    pub values: Vec<T>,
    stride: u64,
    n: u64,
}

impl<T, const MAX: usize> Default for Thinned<T, MAX> {
    fn default() -> Self {
        Self { values: Vec::new(), stride: 1, n: 0 }
    }
}

impl<T, const MAX: usize> Thinned<T, MAX> {
    pub fn put(&mut self, value: T) {
        if self.n.is_multiple_of(self.stride) {
            if self.values.len() >= MAX {
                let mut k = 0;
                self.values.retain(|_| {
                    k += 1;
                    k % 2 == 1
                });
                self.stride *= 2;
            }
            if self.n.is_multiple_of(self.stride) {
                self.values.push(value);
            }
        }
        self.n += 1;
    }

    /// One value kept of how many.
    pub fn stride(&self) -> u64 {
        self.stride
    }
}

/// One track at one frame, as drawn; f32 is finer than any screen.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    pub frame: u64,
    pub time_s: f64,
    pub status: TrackStatus,
    /// Where it is on the steady ground.
    pub ground: [f32; 2],
    /// x, vx, y, vy
    pub mean: [f32; 4],
    /// Their standard deviations.
    pub std: [f32; 4],
    /// Innovation in x and y, their standard deviations, NIS; NaN without an update.
    pub innovation: [f32; 5],
}

/// What is kept of one track.
#[derive(Clone, Debug)]
pub(super) struct TrackLog {
    pub id: TrackId,
    pub first: (u64, f64),
    pub last: (u64, f64),
    pub last_status: TrackStatus,
    pub confirmed: bool,
    pub n_frames: u64,
    pub n_coasting: u64,
    pub nis: Nis,
    /// Places in the image and on the steady ground.
    pub path: Thinned<[f32; 4], MAX_PATH>,
    /// The end of the path, which thinning may have dropped.
    pub end: [f32; 4],
    pub detail: Option<Thinned<Sample, MAX_POINTS>>,
}

/// Counts over time, some frames to a bucket.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Bucket {
    pub frame: u64,
    pub time_s: f64,
    pub n: u64,
    pub detections: u64,
    pub most_detections: u64,
    /// Tentative, confirmed, coasting.
    pub tracks: [u64; 3],
}

/// All that the report keeps.
#[derive(Debug)]
pub(super) struct Collected {
    pub n_frames: u64,
    pub n_detections: u64,
    pub first_time_s: f64,
    pub last_time_s: f64,
    pub n_tracks: u64,
    pub n_confirmed: u64,
    pub n_dropped: u64,
    pub buckets: Vec<Bucket>,
    pub per_bucket: u64,
    pub tracks: BTreeMap<TrackId, TrackLog>,
    pub picture: Option<Picture>,
    pub key_frames: KeyFrames,
    pub ground: Ground,
    /// Places of detections, in the image and on the steady ground.
    pub detections: Thinned<[f32; 4], MAX_DETECTIONS>,
    pub nis: Nis,
    n_samples: usize,
    highest_id: Option<TrackId>,
}

impl Default for Collected {
    fn default() -> Self {
        Self {
            n_frames: 0,
            n_detections: 0,
            first_time_s: 0.0,
            last_time_s: 0.0,
            n_tracks: 0,
            n_confirmed: 0,
            n_dropped: 0,
            buckets: Vec::new(),
            per_bucket: 1,
            tracks: BTreeMap::new(),
            picture: None,
            key_frames: KeyFrames::default(),
            ground: Ground::default(),
            detections: Thinned::default(),
            nis: Nis::default(),
            n_samples: 0,
            highest_id: None,
        }
    }
}

impl Collected {
    pub fn put(&mut self, view: &View<'_>) {
        let (frame, time_s) = (view.scan.index.0, view.scan.time.as_secs_f64());
        if self.n_frames == 0 {
            self.first_time_s = time_s;
        }
        self.last_time_s = time_s;
        // The picture is renewed at frames 0, 1, 2, 4, 8, ..: in the end it comes from the run's second half.
        if let Some(f) = view.frame
            && (self.n_frames == 0 || self.n_frames.is_power_of_two())
        {
            self.picture = Some(Picture::of_frame(f));
        }
        self.key_frames.put(view);
        self.ground.put(view);
        for d in &view.scan.detections {
            let [x, y] = [d.position.x as f32, d.position.y as f32];
            let [gx, gy] = self.ground.place(x, y);
            self.detections.put([x, y, gx, gy]);
        }
        self.n_frames += 1;
        self.n_detections += view.scan.detections.len() as u64;
        self.count(frame, time_s, view);
        for track in view.tracks {
            self.put_track(frame, time_s, track);
        }
        if self.n_samples > MAX_SAMPLES {
            self.forget_short_curves();
        }
        if self.tracks.len() > MAX_TRACKS + MAX_TRACKS / 4 {
            self.drop_short_tracks(frame);
        }
    }

    fn count(&mut self, frame: u64, time_s: f64, view: &View<'_>) {
        if self.buckets.last().is_none_or(|b| b.n >= self.per_bucket) {
            if self.buckets.len() >= MAX_BUCKETS {
                self.buckets =
                    self.buckets.chunks(2).map(|pair| pair.iter().skip(1).fold(pair[0], |a, b| a.joined(b))).collect();
                self.per_bucket *= 2;
            }
            self.buckets.push(Bucket { frame, time_s, ..Bucket::default() });
        }
        let Some(bucket) = self.buckets.last_mut() else { return };
        let n = view.scan.detections.len() as u64;
        bucket.n += 1;
        bucket.detections += n;
        bucket.most_detections = bucket.most_detections.max(n);
        for track in view.tracks {
            bucket.tracks[track.status as usize] += 1;
        }
    }

    fn put_track(&mut self, frame: u64, time_s: f64, track: &TrackState) {
        let (mean, cov) = (&track.kinematics.mean, &track.kinematics.cov);
        let [x, y] = [mean[0] as f32, mean[2] as f32];
        let ground = self.ground.place(x, y);
        let place = [x, y, ground[0], ground[1]];
        let log = self.tracks.entry(track.id).or_insert_with(|| {
            // A dropped track that comes again is not a new one: identities only grow.
            if self.highest_id.is_none_or(|h| track.id > h) {
                self.highest_id = Some(track.id);
                self.n_tracks += 1;
            }
            TrackLog {
                id: track.id,
                first: (frame, time_s),
                last: (frame, time_s),
                last_status: track.status,
                confirmed: false,
                n_frames: 0,
                n_coasting: 0,
                nis: Nis::default(),
                path: Thinned::default(),
                end: place,
                detail: Some(Thinned::default()),
            }
        });
        log.last = (frame, time_s);
        log.last_status = track.status;
        log.n_frames += 1;
        if track.status != TrackStatus::Tentative && !log.confirmed {
            log.confirmed = true;
            self.n_confirmed += 1;
        }
        log.n_coasting += u64::from(track.status == TrackStatus::Coasting);
        log.path.put(place);
        log.end = place;
        let mut innovation = [f32::NAN; 5];
        if let Some(i) = &track.innovation {
            log.nis.add(i.nis);
            if log.confirmed {
                self.nis.add(i.nis);
            }
            let values = [i.innovation.x, i.innovation.y, i.cov[(0, 0)].sqrt(), i.cov[(1, 1)].sqrt(), i.nis];
            innovation = values.map(|v| v as f32);
        }
        if let Some(detail) = &mut log.detail {
            let before = detail.values.len();
            detail.put(Sample {
                frame,
                time_s,
                status: track.status,
                ground,
                mean: [0, 1, 2, 3].map(|k| mean[k] as f32),
                std: [0, 1, 2, 3].map(|k| cov[(k, k)].sqrt() as f32),
                innovation,
            });
            self.n_samples = (self.n_samples + detail.values.len()).saturating_sub(before);
        }
    }

    /// Keeps the curves of the longest tracks only.
    fn forget_short_curves(&mut self) {
        let mut order: Vec<(std::cmp::Reverse<(bool, u64)>, TrackId)> = self
            .tracks
            .values()
            .filter(|t| t.detail.is_some())
            .map(|t| (std::cmp::Reverse((t.confirmed, t.n_frames)), t.id))
            .collect();
        order.sort_unstable();
        for (_, id) in order.iter().skip(N_DETAILED) {
            if let Some(log) = self.tracks.get_mut(id) {
                log.detail = None;
            }
        }
        self.n_samples = self.tracks.values().filter_map(|t| t.detail.as_ref()).map(|d| d.values.len()).sum();
    }

    /// Drops tracks that have ended, unconfirmed and short ones first.
    fn drop_short_tracks(&mut self, now: u64) {
        let mut ended: Vec<(bool, u64, TrackId)> =
            self.tracks.values().filter(|t| t.last.0 < now).map(|t| (t.confirmed, t.n_frames, t.id)).collect();
        ended.sort_unstable();
        let n = self.tracks.len().saturating_sub(MAX_TRACKS);
        for (_, _, id) in ended.into_iter().take(n) {
            if let Some(log) = self.tracks.remove(&id) {
                self.n_dropped += 1;
                self.n_samples = self.n_samples.saturating_sub(log.detail.map_or(0, |d| d.values.len()));
            }
        }
    }
}

impl Bucket {
    fn joined(self, other: &Self) -> Self {
        Self {
            frame: self.frame,
            time_s: self.time_s,
            n: self.n + other.n,
            detections: self.detections + other.detections,
            most_detections: self.most_detections.max(other.most_detections),
            tracks: [0, 1, 2].map(|i| self.tracks[i] + other.tracks[i]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Extent, FrameIndex, Scan, Timestamp};
    use boresight_filters::Gaussian;
    use nalgebra::{SMatrix, SVector};

    pub(super) fn state(id: u64, status: TrackStatus) -> TrackState {
        let kinematics = Gaussian { mean: SVector::<f64, 4>::new(1.0, 0.0, 2.0, 0.0), cov: SMatrix::identity() };
        TrackState {
            id: TrackId(id),
            status,
            kinematics,
            extent: Extent::default(),
            detection: None,
            innovation: None,
            score: 1.0,
        }
    }

    fn put(seen: &mut Collected, frame: u64, tracks: &[TrackState]) {
        let scan = Scan {
            index: FrameIndex(frame),
            time: Timestamp::from_ns(frame as i64 * 40_000_000),
            detections: Vec::new(),
            ..Scan::default()
        };
        seen.put(&View { frame: None, scan: &scan, tracks });
    }

    #[test]
    fn a_long_run_keeps_every_kth_frame_evenly() {
        let mut seen = Collected::default();
        for frame in 0..50_000 {
            put(&mut seen, frame, &[state(1, TrackStatus::Confirmed)]);
        }
        let log = &seen.tracks[&TrackId(1)];
        let detail = log.detail.as_ref().unwrap();
        assert!(detail.values.len() <= MAX_POINTS && detail.values.len() >= MAX_POINTS / 2);
        let steps: Vec<u64> = detail.values.windows(2).map(|w| w[1].frame - w[0].frame).collect();
        assert!(steps.iter().all(|s| *s == detail.stride()));
        assert_eq!(log.n_frames, 50_000);
        assert!(seen.buckets.len() <= MAX_BUCKETS);
        assert_eq!(seen.buckets.iter().map(|b| b.n).sum::<u64>(), 50_000);
        assert!(seen.buckets.windows(2).all(|w| w[1].frame - w[0].frame == seen.per_bucket));
    }

    #[test]
    fn memory_stays_bounded_with_many_tracks_and_the_long_ones_are_kept() {
        let mut seen = Collected::default();
        let mut next = 10;
        for frame in 0..400u64 {
            let mut tracks = vec![state(1, TrackStatus::Confirmed), state(2, TrackStatus::Confirmed)];
            for _ in 0..1000 {
                tracks.push(state(next, TrackStatus::Tentative));
                next += 1;
            }
            put(&mut seen, frame, &tracks);
        }
        assert!(seen.n_samples <= MAX_SAMPLES + 1002 && seen.tracks.len() <= MAX_TRACKS + MAX_TRACKS / 4 + 1002);
        assert_eq!(seen.tracks[&TrackId(1)].detail.as_ref().unwrap().values.len(), 400);
        assert_eq!((seen.n_tracks, seen.n_confirmed), (400_002, 2));
        assert_eq!(seen.tracks.len() as u64 + seen.n_dropped, 400_002);
    }
}
