//! Worker for the comparison with peers, workload W4: tracking from detections.
//!
//! The work starts with positions and ends with the confirmed tracks' positions, as for every peer there.

use boresight::associate::AssociatorConfig;
use boresight::track::{
    self, ConfirmationConfig, ExistenceConfig, InitiationConfig, MergedMeasurementsConfig, TrackerConfig,
    TwoPointConfig,
};
use boresight::{Detection, Extent, FrameIndex, Scan, Timestamp, TrackStatus};
use nalgebra::{Matrix2, Vector2};
use peers::{Fault, Job};

struct W4 {
    points: Vec<Vec<Vector2<f64>>>,
    config: TrackerConfig,
    sigma: f64,
    cap_s: f64,
    frames_done: usize,
    out: Vec<f64>,
}

impl Job for W4 {
    fn run(&mut self) {
        self.out.clear();
        self.frames_done = 0;
        let begin = std::time::Instant::now();
        let Ok(mut tracker) = track::build(&self.config) else { return };
        let mut scan = Scan::default();
        for (k, points) in self.points.iter().enumerate() {
            scan.index = FrameIndex(k as u64);
            scan.time = Timestamp::from_secs_f64(k as f64);
            scan.detections.clear();
            scan.detections.extend(points.iter().map(|p| {
                Detection::at(*p, Matrix2::identity() * self.sigma * self.sigma)
                    .with_extent(Extent { left_px: p.x - 10.0, top_px: p.y - 10.0, width_px: 20.0, height_px: 20.0 })
                    .with_area_px(400)
            }));
            let Ok(states) = tracker.step(&scan) else { return };
            for s in states.iter().filter(|s| s.status != TrackStatus::Tentative) {
                self.out.extend([k as f64, s.id.0 as f64, s.kinematics.mean[0], s.kinematics.mean[2]]);
            }
            self.frames_done = k + 1;
            if begin.elapsed().as_secs_f64() > self.cap_s {
                break;
            }
        }
    }

    fn result(&mut self) -> (Vec<f64>, usize) {
        (self.out.clone(), 4)
    }

    fn units(&self) -> f64 {
        self.frames_done as f64
    }
}

fn load(message: &serde_json::Value) -> Result<Box<dyn Job>, Fault> {
    let (rows, _) = peers::read_npy(&std::fs::read(message["inputs"]["det"].as_str().ok_or("no det")?)?)?;
    let parameter = |key: &str| message["params"][key].as_f64();
    let n_frames = parameter("frames").ok_or("no frames")? as usize;
    let mut points = vec![Vec::new(); n_frames];
    for r in rows.as_chunks::<3>().0 {
        points.get_mut(r[0] as usize).ok_or("frame beyond the last")?.push(Vector2::new(r[1], r[2]));
    }
    let mut config = TrackerConfig {
        acceleration_std_px_per_s2: Some(0.1),
        extra_noise_px: 0.0,
        max_speed_px_per_s: 8.0,
        detection_probability: parameter("pd").unwrap_or(0.9),
        clutter_density_per_px2: parameter("clutter_density").unwrap_or(1e-5),
        associator: AssociatorConfig::default(),
        gate_probability: 0.9999,
        initiation: InitiationConfig::TwoPoint(TwoPointConfig { velocity_std_px_per_s: Some(2.0) }),
        confirmation: ConfirmationConfig::Existence(ExistenceConfig {
            new_target_density_per_px2: 1e-6,
            confirm_probability: 0.5,
            demotion_probability: 0.5,
            delete_probability: 0.001,
            mean_target_lifetime_s: 200.0,
        }),
        coast_s: 6.0,
        coast_scans: 1,
        merged_measurements: MergedMeasurementsConfig::off(),
        ..TrackerConfig::default()
    };
    // Another configuration may be tried without building anew.
    if let Ok(text) = std::env::var("BORESIGHT_W4_CONFIG") {
        config = serde_json::from_str(&text)?;
        if message["params"]["override_clutter"].as_bool() == Some(true) {
            config.clutter_density_per_px2 = parameter("clutter_density").unwrap_or(1e-5);
        }
    }
    let sigma = parameter("sigma_r").unwrap_or(1.0);
    let cap_s = parameter("cap_s").unwrap_or(10.0);
    Ok(Box::new(W4 { points, config, sigma, cap_s, frames_done: 0, out: Vec::new() }))
}

fn main() -> Result<(), Fault> {
    peers::serve(load)
}
