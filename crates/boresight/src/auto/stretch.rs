//! What a detector and a tracker assume in seconds of video, in another tempo ([`crate::tempo`]).

use super::digits::round;
use crate::Config;
use crate::tempo::Tempo;
use crate::track::{InitiationConfig, TrackerConfig, TwoPointConfig};
use crate::vision::threshold::ThresholdConfig;

/// A tracker with the usual assumptions.
pub fn tracker(tempo: Tempo) -> TrackerConfig {
    let mut usual = TrackerConfig::default();
    of_tracker(tempo, &mut usual);
    usual
}

/// Stretches what a detector and a tracker assume.
pub fn of_both(tempo: Tempo, config: &mut Config) {
    if tempo != Tempo::VIDEO
        && let ThresholdConfig::Moving(c) = &mut config.detector.threshold
    {
        for time in [&mut c.time_constant_s, &mut c.standing_time_s, &mut c.ghost_time_s, &mut c.start_s] {
            *time = round(tempo.stretched(*time));
        }
    }
    of_tracker(tempo, &mut config.tracker);
}

/// Stretches what a tracker assumes.
pub fn of_tracker(tempo: Tempo, t: &mut TrackerConfig) {
    if tempo == Tempo::VIDEO {
        return;
    }
    let times = [
        &mut t.coast_s,
        &mut t.duplicate_s,
        &mut t.merged_measurements.max_secondary_s,
        &mut t.reidentification.max_gap_s,
    ];
    times.into_iter().for_each(|time| *time = round(tempo.stretched(*time)));
    let densities = [&mut t.acceleration_density_px2_per_s3, &mut t.acceleration_density_per_height2_per_s3];
    densities.into_iter().for_each(|density| *density = round(tempo.density(*density)));
    t.max_speed_px_per_s = round(tempo.speed(t.max_speed_px_per_s));
    match &mut t.initiation {
        InitiationConfig::OnePoint(c) => c.velocity_std_px_per_s = round(tempo.speed(c.velocity_std_px_per_s)),
        InitiationConfig::TwoPoint(TwoPointConfig { velocity_std_px_per_s: Some(std) }) => {
            *std = round(tempo.speed(*std))
        }
        InitiationConfig::TwoPoint(_) | InitiationConfig::VelocityBounds(_) => {}
    }
}

#[cfg(test)]
mod tests {
    use super::super::in_memory::{InMemory, described};
    use super::super::{choose, learn};
    use crate::auto::Request;
    use crate::io::Replay;
    use crate::{Config, Error, Frame, FrameIndex, Image, Pixels, Scan, SourceInfo, Timestamp};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    /// Forty frames, so far apart, of twelve bright spots that wander with some persistence before noise.
    fn wanderers(interval_s: f64) -> (Vec<Frame>, SourceInfo) {
        const SIZE: usize = 128;
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let mut spots: Vec<[f64; 4]> =
            (0..12).map(|i| [20.0 + 28.0 * f64::from(i % 4), 24.0 + 36.0 * f64::from(i / 4), 0.0, 0.0]).collect();
        let frames = (0..40u64)
            .map(|k| {
                for s in &mut spots {
                    for axis in 0..2 {
                        s[2 + axis] = 0.9 * s[2 + axis] + 0.2 * rng.sample::<f64, _>(StandardNormal);
                        s[axis] += s[2 + axis];
                    }
                }
                let values = (0..SIZE * SIZE).map(|i| {
                    let (x, y) = ((i % SIZE) as f64, (i / SIZE) as f64);
                    let light = spots.iter().map(|s| (-((x - s[0]).powi(2) + (y - s[1]).powi(2)) / 4.5).exp());
                    (300.0 + 250.0 * light.sum::<f64>() + 8.0 * rng.sample::<f64, _>(StandardNormal)) as u16
                });
                let image = Image::from_vec(SIZE, SIZE, values.collect()).unwrap();
                let time = Timestamp::from_secs_f64(interval_s * k as f64);
                Frame { index: FrameIndex(k), time, pixels: Pixels::Gray16(image) }
            })
            .collect();
        described(frames)
    }

    /// Id and place of every reported track in every frame, as chosen and learnt.
    fn tracked(interval_s: f64) -> Vec<(u64, u64, [f64; 2])> {
        let (frames, info) = wanderers(interval_s);
        let mut choice = choose(&frames, &info, &Config::default()).unwrap();
        let mut source = Replay::new(Box::new(InMemory(frames.clone().into_iter(), info.clone())), frames.len());
        learn(&mut source, &mut choice, &Request::default(), Ok::<_, Error>).unwrap();
        let mut detector = crate::vision::build(&choice.config.detector, &info).unwrap();
        let mut tracker = crate::track::build(&choice.config.tracker).unwrap();
        let (mut scan, mut out) = (Scan::default(), Vec::new());
        for frame in &frames {
            detector.detect(frame, &mut scan).unwrap();
            let reported = tracker.step(&scan).unwrap().iter().filter(|s| s.status != crate::TrackStatus::Tentative);
            out.extend(reported.map(|s| (frame.index.0, s.id.0, [s.kinematics.mean[0], s.kinematics.mean[2]])));
        }
        out
    }

    #[test]
    fn the_same_frames_give_the_same_tracks_at_any_interval_beyond_those_of_video() {
        for [base, other] in [[0.5, 500.0], [0.5, 50_000.0], [0.004, 0.000_04]] {
            let (a, b) = (tracked(base), tracked(other));
            assert!(a.len() > 300, "twelve in forty frames: {}", a.len());
            assert_eq!(a.len(), b.len(), "{other}");
            for (a, b) in a.iter().zip(&b) {
                let far = (a.2[0] - b.2[0]).hypot(a.2[1] - b.2[1]);
                // Chosen numbers have three digits.
                assert!((a.0, a.1) == (b.0, b.1) && far < 0.02, "{other}: {a:?} {b:?}");
            }
        }
    }
}
