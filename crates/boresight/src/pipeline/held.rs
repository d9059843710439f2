//! A scan that is held back, with its tracks and what is asked of it while it waits.

use crate::associate::UniformGrid;
use crate::camera::SteadyGround;
use crate::track::Past;
use crate::{Frame, Scan, TrackState, TrackStatus};
use std::cell::OnceCell;

/// One scan with its tracks.
pub(super) struct Held {
    /// The frame, if it came with one and a sink wants it.
    pub frame: Option<Frame>,
    pub scan: Scan,
    pub tracks: Vec<TrackState>,
    /// Size of its frame, whether or not it is kept.
    pub bytes: usize,
    /// Where the first scan's background lies in this one.
    pub ground: SteadyGround,
    /// Where its detections are, once somebody asks.
    grid: OnceCell<UniformGrid>,
    /// Which of its detections a reported track has, once somebody asks.
    taken: OnceCell<Vec<bool>>,
}

impl Held {
    /// A scan whose tracks stand in the order of their ids.
    pub fn new(frame: Option<Frame>, scan: Scan, tracks: Vec<TrackState>, bytes: usize, ground: SteadyGround) -> Self {
        Self { frame, scan, tracks, bytes, ground, grid: OnceCell::new(), taken: OnceCell::new() }
    }

    /// What a track that is continued backward needs of it.
    pub fn past(&self) -> Past<'_> {
        let places = || {
            let mut grid = UniformGrid::new();
            grid.build(self.scan.detections.iter().map(|d| (d.position.x, d.position.y)));
            grid
        };
        let taken = || {
            let mut taken = vec![false; self.scan.detections.len()];
            for t in self.tracks.iter().filter(|t| t.status != TrackStatus::Tentative) {
                mark(&mut taken, t.detection);
            }
            taken
        };
        let (grid, taken) = (self.grid.get_or_init(places), self.taken.get_or_init(taken));
        Past { scan: &self.scan, ground: self.ground, grid, taken }
    }

    /// A reported track has this detection from now on.
    pub fn take(&mut self, detection: Option<u32>) {
        if let Some(taken) = self.taken.get_mut() {
            mark(taken, detection);
        }
    }
}

fn mark(taken: &mut [bool], detection: Option<u32>) {
    if let Some(taken) = detection.and_then(|j| taken.get_mut(j as usize)) {
        *taken = true;
    }
}

#[cfg(test)]
mod tests {
    use crate::pipeline::{Input, run};
    use crate::track::{ConfirmationConfig, ExistenceConfig, build};
    use crate::{
        CameraMotion, Config, Detection, FrameIndex, MotionBasis, Result, Scan, Sink, Timestamp, TrackStatus, View,
    };
    use nalgebra::{Matrix2, Vector2};
    use std::ops::ControlFlow;
    use std::sync::{Arc, Mutex};

    /// The frames in which a track was reported, and where.
    struct Places(Arc<Mutex<Vec<(u64, f64)>>>);

    impl Sink for Places {
        fn put(&mut self, view: &View<'_>) -> Result<()> {
            let reported = view.tracks.iter().filter(|t| t.status != TrackStatus::Tentative);
            self.0.lock().unwrap().extend(reported.map(|t| (view.scan.index.0, t.position().x)));
            Ok(())
        }
        fn finish(self: Box<Self>) -> Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_target_too_faint_to_start_a_track_is_reported_from_its_first_detection_on() {
        let scan = |k: u64| {
            let mut d = Detection::at(Vector2::new(50.0 + 2.0 * k as f64, 40.0), Matrix2::identity() * 0.1);
            d.score = if k < 30 { 3.0 } else { 9.0 };
            Scan::at(FrameIndex(k), Timestamp::from_ns(k as i64 * 40_000_000)).with_detections(vec![d])
        };
        let cut = |scan: Scan| {
            let mut motion = CameraMotion::exact_shift(Vector2::zeros());
            motion.basis = MotionBasis::Cut;
            scan.with_camera_motion(Some(motion))
        };
        let places_with = |retrospective_s: f64, cut_at: Option<u64>| {
            let mut config = Config::default().tracker;
            config.confirmation = ConfirmationConfig::Existence(ExistenceConfig::default());
            (config.min_initiation_score, config.retrospective_s) = (5.0, retrospective_s);
            let places = Arc::default();
            let sinks: Vec<Box<dyn Sink>> = vec![Box::new(Places(Arc::clone(&places)))];
            let input = Input::Scans((0..50).map(|k| if cut_at == Some(k) { cut(scan(k)) } else { scan(k) }).collect());
            run(input, Some(build(&config).unwrap()), sinks, &mut |_| ControlFlow::Continue(()));
            places.lock().unwrap().clone()
        };
        let places = |retrospective_s: f64| places_with(retrospective_s, None);
        assert!(places(0.0).iter().all(|(k, _)| *k > 30));
        let whole = places(10.0);
        assert_eq!(whole.iter().map(|p| p.0).collect::<Vec<_>>(), (0..50).collect::<Vec<_>>());
        assert!(whole.iter().all(|(k, x)| (x - 50.0 - 2.0 * *k as f64).abs() < 1.0), "{whole:?}");
        let of_view: Vec<u64> = places_with(10.0, Some(20)).iter().map(|p| p.0).collect();
        assert_eq!(of_view, (20..50).collect::<Vec<_>>(), "before a cut was another view");
        // Half a second is not held: what was given out stays.
        assert_eq!(places(0.4).first().map(|p| p.0 > 15), Some(true));
    }
}
