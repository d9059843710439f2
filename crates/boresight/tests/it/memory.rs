//! Memory in the hot path: a warm detector and a warm tracker take none, whatever they are made of.
#![allow(unsafe_code)] // An allocator that counts can only be written so.

use super::track::{detection, trackers};
use super::vision_conformance::{source, thresholds};
use boresight::camera::CameraConfig;
use boresight::track::{self, ClutterConfig, PRESETS, TrackerConfig};
use boresight::vision::DetectorConfig;
use boresight::vision::{self, spatial::SpatialConfig, spatial::WindowConfig};
use boresight::{Frame, FrameIndex, Image, PixelKind, Pixels, Scan, Timestamp};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    static NOW: Cell<isize> = const { Cell::new(0) };
    static PEAK: Cell<isize> = const { Cell::new(0) };
    static TAKEN: Cell<u64> = const { Cell::new(0) };
}

/// The system's allocator, which also counts each thread's bytes in use and how often it took some.
struct Counting;

impl Counting {
    fn count(by: isize) {
        // A thread that ends has no counters any more: nothing is measured then.
        let _ = NOW.try_with(|now| {
            now.set(now.get() + by);
            let _ = PEAK.try_with(|peak| peak.set(peak.get().max(now.get())));
            let _ = TAKEN.try_with(|taken| taken.set(taken.get() + u64::from(by > 0)));
        });
    }
}

// SAFETY: every call goes on to the system's allocator with the same arguments; counting touches plain cells only.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        Self::count(layout.size() as isize);
        // SAFETY: as promised by our caller.
        unsafe { System.alloc(layout) }
    }
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        Self::count(layout.size() as isize);
        // SAFETY: as promised by our caller.
        unsafe { System.alloc_zeroed(layout) }
    }
    unsafe fn dealloc(&self, ptr: *mut u8, layout: Layout) {
        Self::count(-(layout.size() as isize));
        // SAFETY: as promised by our caller.
        unsafe { System.dealloc(ptr, layout) }
    }
    unsafe fn realloc(&self, ptr: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        Self::count(size as isize - layout.size() as isize);
        // SAFETY: as promised by our caller.
        unsafe { System.realloc(ptr, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Runs something and says how many bytes it had in use at most.
pub fn peak_of(run: impl FnOnce()) -> isize {
    let before = NOW.get();
    PEAK.set(before);
    run();
    PEAK.get() - before
}

/// Runs something and says how often it took memory.
fn taken_by(run: impl FnOnce()) -> u64 {
    let before = TAKEN.get();
    run();
    TAKEN.get() - before
}

/// Targets on circles, each of its own radius and speed, some of which meet; with clutter at places that come again.
fn circling(k: u64) -> Scan {
    let round = |turns: f64, radius: f64, x: f64, y: f64| {
        let a = std::f64::consts::TAU * turns * k as f64 / 60.0;
        detection(x + radius * a.cos(), y + radius * a.sin())
    };
    let mut detections: Vec<_> =
        (0..12).map(|i| round(1.0, 30.0 + 2.0 * f64::from(i), 100.0 * f64::from(i), 80.0)).collect();
    detections.push(round(1.0, 40.0, 400.0, 300.0));
    detections.push(round(-1.0, 40.0, 404.0, 300.0));
    detections.extend((0..5).map(|i| detection(f64::from(i) * 211.0, 500.0 + 31.0 * ((k + i as u64) % 3) as f64)));
    Scan::at(FrameIndex(k), Timestamp::from_ns(k as i64 * 40_000_000)).with_detections(detections)
}

#[test]
fn histories_take_the_memory_of_those_that_are_kept() {
    // 800 targets in one pixel: each may grow 12 x 65 histories a scan, of which 12 are kept.
    let config = boresight::Config::default().with("tracker.mht={}").unwrap();
    let mut tracker = boresight::track::build(&config.tracker).unwrap();
    let peak = peak_of(|| {
        for k in 0..3u64 {
            let at = |i: u32| nalgebra::Vector2::new(10.0 + 0.001 * f64::from(i), 10.0 + 0.0007 * f64::from(i % 91));
            let all = (0..800).map(|i| boresight::Detection::at(at(i), nalgebra::Matrix2::identity())).collect();
            let scan = Scan::at(boresight::FrameIndex(k), boresight::Timestamp::from_ns(k as i64 * 40_000_000));
            tracker.step(&scan.with_detections(all)).unwrap();
        }
    });
    // Some 600 bytes each: 800 targets x 12 and the new ones are 6 MB; with room for all that grows 400 MB.
    assert!(peak < 60 << 20, "{peak} bytes");
}

#[test]
fn a_warm_tracker_takes_no_memory_in_a_step() {
    let mut configs: Vec<TrackerConfig> = trackers().into_iter().filter(|c| c.mht.is_none()).collect();
    let base = TrackerConfig { max_speed_px_per_s: 300.0, ..TrackerConfig::default() };
    configs.push(TrackerConfig { clutter: ClutterConfig::Map(Default::default()), ..base.clone() });
    configs.push(TrackerConfig { field_px: Some([1200.0, 700.0]), ..base });
    let mut greedy = Vec::new();
    for config in configs {
        let mut tracker = track::build(&config).unwrap();
        let scans: Vec<Scan> = (0..600).map(circling).collect();
        let (warm_up, rest) = scans.split_at(480);
        let mut most = 0;
        for scan in warm_up {
            most = tracker.step(scan).unwrap().len().max(most);
        }
        assert!(most >= 10, "only {most} tracks: {config:?}");
        let taken = taken_by(|| rest.iter().for_each(|scan| assert!(!tracker.step(scan).unwrap().is_empty())));
        if taken > 0 {
            greedy.push(format!("{taken} times: {config:?}"));
        }
    }
    assert!(greedy.is_empty(), "{greedy:#?}");
}

#[test]
fn a_living_track_takes_no_memory_whatever_its_filter() {
    let mut greedy = Vec::new();
    for preset in PRESETS {
        let config = TrackerConfig { filter: preset.filter(), ..TrackerConfig::default() };
        let mut tracker = track::build(&config).unwrap();
        let scan = |k: u64| {
            let detections = vec![detection(10.0 + 0.2 * k as f64, 20.0 + 0.1 * k as f64)];
            Scan::at(FrameIndex(k), Timestamp::from_ns(k as i64 * 40_000_000)).with_detections(detections)
        };
        let scans: Vec<Scan> = (0..100).map(scan).collect();
        for scan in &scans[..60] {
            tracker.step(scan).unwrap();
        }
        let taken = taken_by(|| scans[60..].iter().for_each(|s| assert_eq!(tracker.step(s).unwrap().len(), 1)));
        if taken > 0 {
            greedy.push(format!("{taken} times: {}", preset.name));
        }
    }
    assert!(greedy.is_empty(), "{greedy:#?}");
}

/// A noisy ground with 40 bright squares that go round, 160 x 120 px.
fn frame(kind: PixelKind, k: u64) -> Frame {
    let (width, height) = (160, 120);
    let mut state = (k % 30) * 0x9e37_79b9 + 1;
    let a = std::f64::consts::TAU * k as f64 / 30.0;
    let mut level = |i: usize| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        // From the middle of the cell of 20 x 24 px, in which one square goes round.
        let (x, y) = ((i % width % 20) as f64 - 10.0, (i / width % 24) as f64 - 12.0);
        let bright = (x - 5.0 * a.cos()).abs() < 2.6 && (y - 5.0 * a.sin()).abs() < 2.6;
        (if bright { 200 } else { 100 }) + (state >> 60) as u8 % 4
    };
    let grey: Vec<u8> = (0..width * height).map(&mut level).collect();
    let pixels = match kind {
        PixelKind::Gray8 => Pixels::Gray8(Image::from_vec(width, height, grey).unwrap()),
        PixelKind::Gray16 => {
            let grey = grey.into_iter().map(|v| u16::from(v) * 16).collect();
            Pixels::Gray16(Image::from_vec(width, height, grey).unwrap())
        }
        PixelKind::GrayF32 => {
            let grey = grey.into_iter().map(f32::from).collect();
            Pixels::GrayF32(Image::from_vec(width, height, grey).unwrap())
        }
        PixelKind::Rgb8 => {
            let rgb = grey.into_iter().map(|v| [v, v / 2, 255 - v]).collect();
            Pixels::Rgb8(Image::from_vec(width, height, rgb).unwrap())
        }
    };
    Frame { index: FrameIndex(k), time: Timestamp::from_ns(k as i64 * 40_000_000), pixels }
}

#[test]
fn a_warm_detector_takes_no_memory_in_a_frame() {
    let window = WindowConfig { size: 5, ..WindowConfig::default() };
    let mut configs: Vec<DetectorConfig> =
        thresholds().into_iter().map(|threshold| DetectorConfig { threshold, ..DetectorConfig::default() }).collect();
    for camera in [CameraConfig::Moving, CameraConfig::Shaking] {
        configs.push(DetectorConfig { camera, ..DetectorConfig::default() });
    }
    configs.push(DetectorConfig { max_detections: Some(2), ..configs[1].clone() });
    for filter in
        [SpatialConfig::Mean(window), SpatialConfig::Median(window), SpatialConfig::Gaussian(Default::default())]
    {
        configs.push(DetectorConfig { filter, ..configs[1].clone() });
    }
    let mut greedy = Vec::new();
    let mut ran = vec![false; configs.len()];
    for kind in [PixelKind::Gray8, PixelKind::Gray16, PixelKind::GrayF32, PixelKind::Rgb8] {
        // They come again after 30, with times that go on.
        let mut frames: Vec<Frame> = (0..30).map(|k| frame(kind, k)).collect();
        for (config, ran) in configs.iter().zip(&mut ran) {
            // Some need colour, some cannot have it.
            let Ok(mut detector) = vision::build(config, &source(160, 120, kind)) else { continue };
            *ran = true;
            let mut scan = Scan::default();
            let mut taken = 0;
            for k in 0..150 {
                let frame = &mut frames[k % 30];
                frame.index = FrameIndex(k as u64);
                frame.time = Timestamp::from_ns(k as i64 * 40_000_000);
                let now = taken_by(|| detector.detect(frame, &mut scan).unwrap());
                // A background is learnt in the first 3 s.
                taken += if k < 120 { 0 } else { now };
            }
            if taken > 0 {
                greedy.push(format!("{taken} times: {kind:?} {config:?}"));
            }
        }
    }
    assert!(greedy.is_empty(), "{greedy:#?}");
    assert!(ran.iter().all(|r| *r), "a configuration runs on no kind of pixels: {ran:?}");
}
