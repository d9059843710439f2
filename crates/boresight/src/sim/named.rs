//! The scenes of the papers by name.
//!
//! Source: `docs/theory/simulation.md`, table of data sets; the papers' world counts pixels from 1 and scans from 1,
//! and scan k shows the start state after k steps. The conversion is done here and nowhere else: the papers' (11, 11)
//! at scan 1 is (10, 10) in frame 0. `ds3` is our definition: two targets that cross at scan 22.5. `lms-sines` and
//! `lms-singer` are manoeuvres for the LMS filter (25 frames/s; sines of 40 s and 17 s with 100 px amplitude), drawn as
//! spots. `montecarlo` is the Monte Carlo scene of the peers' bench (one target of 9 x 9, 150 counts above N(50, 50²)),
//! with a start that the seed draws.

use super::motion::{ConstantVelocity, MotionConfig, Singer, Sinusoid};
use super::radar_config::{Measures, PositionErrors, RadarConfig};
use super::random::{Purpose, Seed};
use super::scene::{Background, Clock, Rectangle, SceneConfig, Shape, Spot, Target, White};
use crate::{Error, ErrorKind, Result};
use rand::RngExt;

/// Names that [`named`] knows, each with what it shows.
pub const NAMES: [(&str, &str); 10] = [
    ("ds1", "data set I of the thesis: one target N(100, 0) on N(50, 0)"),
    ("ds2", "data set II of the thesis: one target N(100, 10²) on N(50, 50²)"),
    ("ds3", "data set III: two targets as in ds2 that cross at scan 22.5"),
    ("imager-1", "sensor 1 of the SRIF paper: target N(100, 1²) on N(50, 100²)"),
    ("imager-2", "sensor 2 of the SRIF paper: target N(100, 5²) on N(50, 100²)"),
    ("imager-radar", "imaging sensor and ground radar of the thesis (Table 4.3): data set II and a radar of 2.6 px"),
    ("imager-radar-loss", "the same with the imager lost in scans 15-25, the radar in 30-45 (Table 4.4)"),
    ("lms-sines", "the LMS paper's manoeuvres: sines of 40 s and 17 s, amplitude 100 px, 25 frames/s"),
    ("lms-singer", "Singer manoeuvres at 25 frames/s"),
    ("montecarlo", "the Monte Carlo scene of the peers' bench"),
];

/// Names that scenes had before, and those that they have now.
const RENAMED: [(&str, &str); 4] = [
    ("d3-s1", "imager-1"),
    ("d3-s2", "imager-2"),
    ("d1-fusion", "imager-radar"),
    ("d1-fusion-loss", "imager-radar-loss"),
];

/// The papers' frame: 64 x 64 px, 50 scans of 1 s, white background, targets of 9 x 9 px with the given start states
/// `[x, vx, y, vy]` in the papers' world (pixels from 1, before the first scan).
pub fn paper_scene(starts: &[[f64; 4]], target: (f64, f64), background: (f64, f64)) -> SceneConfig {
    let targets = starts
        .iter()
        .map(|s| Target {
            // From the papers' world to ours: one step on (scan 1 is frame 0), one pixel back (counting from 0).
            start_px: [s[0] + s[1] - 1.0, s[2] + s[3] - 1.0],
            velocity_px_per_s: [s[1], s[3]],
            shape: Shape::Rectangle(Rectangle { size_px: [9, 9], mean: target.0, std: target.1 }),
            ..Target::default()
        })
        .collect();
    SceneConfig {
        background: Background::White(White { mean: background.0, std: background.1 }),
        targets,
        ..SceneConfig::default()
    }
}

/// The start state of the papers' one target, `[x, vx, y, vy]` in their world.
pub const PAPER_START: [f64; 4] = [10.0, 1.0, 10.0, 1.0];

/// Returns the scene of that name; the seed matters only for scenes whose start is random.
/// # Errors
/// [`ErrorKind::NotFound`] for an unknown name, with the known ones.
pub fn named(name: &str, seed: Seed) -> Result<SceneConfig> {
    let one = |target, background| paper_scene(&[PAPER_START], target, background);
    Ok(match name {
        "ds1" => one((100.0, 0.0), (50.0, 0.0)),
        "ds2" => one((100.0, 10.0), (50.0, 50.0)),
        "ds3" => paper_scene(&[PAPER_START, [10.0, 1.0, 55.0, -1.0]], (100.0, 10.0), (50.0, 50.0)),
        "imager-1" => one((100.0, 1.0), (50.0, 100.0)),
        "imager-2" => one((100.0, 5.0), (50.0, 100.0)),
        "imager-radar" => SceneConfig { radars: vec![ground_radar(&[])], ..one((100.0, 10.0), (50.0, 50.0)) },
        // Scan k is frame k - 1.
        "imager-radar-loss" => SceneConfig {
            radars: vec![ground_radar(&[[29.0, 44.0]])],
            clock: Clock { silent_s: vec![[14.0, 24.0]], ..Clock::default() },
            ..one((100.0, 10.0), (50.0, 50.0))
        },
        "lms-sines" => manoeuvre(MotionConfig::Sinusoid(Sinusoid {
            amplitude_px: [100.0, 100.0],
            period_s: [40.0, 17.0],
            phase_deg: [0.0, 90.0],
        })),
        "lms-singer" => {
            manoeuvre(MotionConfig::Singer(Singer { acceleration_std_px_per_s2: 3.0, time_constant_s: 10.0 }))
        }
        "montecarlo" => montecarlo(seed),
        _ => {
            let e = Error::new(ErrorKind::NotFound, "there is no scene of this name and no such file")
                .at(format!("scene {name}"));
            return Err(match RENAMED.iter().find(|(old, _)| *old == name) {
                Some((_, new)) => e.hint(format!("it is called {new} now")),
                None => e.hint(format!("names: {}; or give a TOML file", NAMES.map(|(n, _)| n).join(", "))),
            });
        }
    })
}

/// The thesis' ground radar: positions of 2.62 px, one scan a frame (its noise is fitted, none is printed).
fn ground_radar(silent_s: &[[f64; 2]]) -> RadarConfig {
    RadarConfig {
        measures: Measures::Position(PositionErrors { std_px: 2.62, bias_px: [0.0; 2] }),
        silent_s: silent_s.to_vec(),
        ..RadarConfig::default()
    }
}

fn manoeuvre(motion: MotionConfig) -> SceneConfig {
    let shape = Shape::Spot(Spot { sigma_px: 1.5, psf_sigma_px: 1.0, total: 3000.0 });
    let target = Target { start_px: [256.0, 128.0], velocity_px_per_s: [0.0, 0.0], motion, shape, ..Target::default() };
    SceneConfig {
        width_px: 512,
        height_px: 512,
        n_frames: 1500,
        rate_hz: 25.0,
        background: Background::White(White { mean: 50.0, std: 5.0 }),
        targets: vec![target],
        ..SceneConfig::default()
    }
}

fn montecarlo(seed: Seed) -> SceneConfig {
    let mut rng = seed.stream(Purpose::Scenario, 0);
    let target = Target {
        start_px: [rng.random_range(15.0..30.0), rng.random_range(15.0..30.0)],
        velocity_px_per_s: [rng.random_range(0.2..0.5), rng.random_range(0.2..0.5)],
        motion: MotionConfig::ConstantVelocity(ConstantVelocity { acceleration_std_px_per_s2: 0.02 }),
        shape: Shape::Rectangle(Rectangle { size_px: [9, 9], mean: 200.0, std: 50.0 }),
        ..Target::default()
    };
    SceneConfig { targets: vec![target], ..SceneConfig::default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_gives_a_sound_scene() {
        for (name, _) in NAMES {
            named(name, Seed::new(1)).unwrap().validate(name).unwrap();
        }
        assert!(named("ds9", Seed::new(1)).unwrap_err().to_string().contains("ds1, ds2"));
        for (old, new) in RENAMED {
            assert!(named(old, Seed::new(1)).unwrap_err().to_string().contains(new), "{old}");
            named(new, Seed::new(1)).unwrap();
        }
    }

    #[test]
    fn the_papers_scan_one_is_our_frame_zero() {
        let mut source = named("ds1", Seed::new(1)).unwrap().build(Seed::new(1)).unwrap();
        let mut last = None;
        let mut first = None;
        while let Some(frame) = crate::FrameSource::next_frame(&mut source).unwrap() {
            let t = source.truth()[0].kinematics.mean;
            first.get_or_insert(t);
            last = Some((frame, t));
        }
        // The papers' positions run from 11 to 60, counted from 1.
        assert_eq!(first.unwrap().as_slice(), [10.0, 1.0, 10.0, 1.0]);
        let (frame, t) = last.unwrap();
        assert_eq!(t.as_slice(), [59.0, 1.0, 59.0, 1.0]);
        let crate::Pixels::Gray8(image) = frame.pixels else { panic!("8-bit frames") };
        assert_eq!((image.get(54, 59), image.get(55, 59), image.get(63, 63)), (Some(50), Some(100), Some(100)));
    }
}
