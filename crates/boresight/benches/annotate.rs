//! Annotated video: cost of drawing, of the conversion and of the whole with the encoder, 1920 x 1080, 50 tracks.

use boresight::draw::{AnnotatedVideo, Annotator, DrawOptions};
use boresight::io::video::Mp4Options;
use boresight::{
    Detection, Extent, Frame, FrameIndex, Image, Pixels, Scan, Sink, Timestamp, TrackId, TrackState, TrackStatus, View,
};
use boresight_filters::Gaussian;
use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};
use rand::{Rng, SeedableRng};

fn main() {
    divan::main();
}

struct Scene {
    frame: Frame,
    scan: Scan,
    tracks: Vec<TrackState>,
}

/// Smooth ground with noise of about 3 levels, tracks that move.
fn scenes(n: u64, width: usize, height: usize) -> Vec<Scene> {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(7);
    let noise: Vec<u8> = (0..width * height + 4096).map(|_| (rng.next_u32() % 7) as u8).collect();
    (0..n)
        .map(|k| {
            let shift = (k as usize * 997) % 4096;
            let pixel = |i: usize| 60 + ((i % width) / 24) as u8 + noise[i + shift];
            let pixels = Image::from_vec(width, height, (0..width * height).map(pixel).collect()).map(Pixels::Gray8);
            let time = Timestamp::from_ns(k as i64 * 40_000_000);
            let at = |t: u64| {
                let (w, h) = (width as f64, height as f64);
                ((t as f64 * 137.0 + k as f64 * 3.0) % w, (t as f64 * 71.0 + k as f64 * 2.0) % h)
            };
            let detection = |t| {
                Detection::at(Vector2::new(at(t).0, at(t).1), Matrix2::identity())
                    .with_area_px(9)
                    .with_peak(200.0)
                    .with_sum(1000.0)
            };
            let track = |t| TrackState {
                id: TrackId(t + 1),
                status: [TrackStatus::Confirmed, TrackStatus::Coasting][usize::from(t % 5 == 0)],
                kinematics: Gaussian {
                    mean: Vector4::new(at(t).0, 75.0, at(t).1, 50.0),
                    cov: Matrix4::from_diagonal(&Vector4::new(16.0, 4.0, 6.0, 4.0)),
                },
                extent: Extent { left_px: at(t).0 - 10.0, top_px: at(t).1 - 8.0, width_px: 20.0, height_px: 16.0 },
                detection: None,
                innovation: None,
                score: 1.0,
            };
            Scene {
                frame: Frame { index: FrameIndex(k), time, pixels: pixels.unwrap() },
                scan: Scan::at(FrameIndex(k), time).with_detections((0..50).map(detection).collect()),
                tracks: (0..50).map(track).collect(),
            }
        })
        .collect()
}

#[divan::bench(sample_count = 20)]
fn draw_1080p_50_tracks(bencher: divan::Bencher) {
    let scenes = scenes(8, 1920, 1080);
    let mut annotator = Annotator::new(DrawOptions::default()).unwrap();
    let mut out = Image::default();
    let mut k = 0;
    bencher.bench_local(|| {
        let s = &scenes[k % scenes.len()];
        k += 1;
        annotator.draw(&View { frame: Some(&s.frame), scan: &s.scan, tracks: &s.tracks }, &mut out).unwrap();
    });
}

/// Time of 30 frames: divide by 30.
#[divan::bench(sample_count = 3, sample_size = 1)]
fn annotated_mp4_1080p_30_frames(bencher: divan::Bencher) {
    let scenes = scenes(30, 1920, 1080);
    let path = std::env::temp_dir().join(format!("boresight-bench-{}.mp4", std::process::id()));
    bencher.bench_local(|| {
        let mut sink = Box::new(AnnotatedVideo::create(&path, DrawOptions::default(), Mp4Options::default()).unwrap());
        for s in &scenes {
            sink.put(&View { frame: Some(&s.frame), scan: &s.scan, tracks: &s.tracks }).unwrap();
        }
        sink.finish().unwrap();
    });
    // Left behind on purpose if it cannot be removed: a bench has nothing better to do.
    let _ = std::fs::remove_file(path);
}
