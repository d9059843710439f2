//! One run of a paper's scene: frames drawn, segmented in several readings, all centroids kept, in the papers' world.
//!
//! Source: `docs/theory/papers.md`. A reading says which ambiguity of the papers is taken which way: distance `<` or
//! `<=` d_p, centroid over the cluster's own pixels or over its bounding box. Frames are drawn once for all readings.
//! Coordinates: the papers' world counts pixels from 1 (percentage errors depend on it); the 1 is added here.
//! Units: px, px/scan. Cost: one 64 x 64 frame of data set II about 20 µs a reading.

use boresight::sim::{SceneConfig, SceneSource, Seed};
use boresight::vision::Clusterer;
use boresight::vision::threshold::{band_bits, words};
use boresight::vision::{CentroidMethod, ClusterConfig};
use boresight::vision::{Surroundings, centroid};
use boresight::{Error, ErrorKind, FrameSource, Pixels, Result};
use nalgebra::{Vector2, Vector4};

/// A reading of the papers' segmentation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reading {
    /// Pixels exactly d_p apart are linked too.
    pub inclusive: bool,
    /// Over which pixels the centroid is taken.
    pub method: CentroidMethod,
}

/// Reading A: distance `<` d_p, centroid over the cluster's own pixels.
pub const READING_A: Reading = Reading { inclusive: false, method: CentroidMethod::Mask };
/// Reading B: distance `<=` d_p, centroid over the cluster's own pixels.
pub const READING_B: Reading = Reading { inclusive: true, method: CentroidMethod::Mask };
/// Reading C: distance `<` d_p, grey centroid over the cluster's whole bounding box (4.16 taken literally).
pub const READING_C: Reading = Reading { inclusive: false, method: CentroidMethod::Bbox };

impl Reading {
    /// A sentence that says it.
    pub fn words(self) -> &'static str {
        match (self.inclusive, self.method) {
            (false, CentroidMethod::Mask) => "A: distance < 2, centroid over the cluster's own pixels",
            (true, CentroidMethod::Mask) => "B: distance <= 2, centroid over the cluster's own pixels",
            (false, CentroidMethod::Bbox) => "C: distance < 2, grey centroid over the cluster's whole bounding box",
            _ => "another reading",
        }
    }

    /// Its letter.
    pub fn letter(self) -> &'static str {
        &self.words()[..1]
    }
}

/// The band of all the papers' scenes, counts.
const BAND: (u8, u8) = (90, 110);
/// Their proximity distance, px.
const PROXIMITY_PX: f64 = 2.0;

/// What one run of a scene gave.
#[derive(Clone, Debug, Default)]
pub struct SceneRun {
    /// True state `[x, vx, y, vy]` of the first target at each scan, the papers' world.
    pub truth: Vec<Vector4<f64>>,
    /// Centroids of all clusters: `centroids[reading][scan]`, the papers' world.
    pub centroids: Vec<Vec<Vec<Vector2<f64>>>>,
}

/// Draws one run of a scene and segments it in each reading.
/// # Errors
/// A scene that is not one of 8-bit frames.
pub fn run_scene(scene: &SceneConfig, seed: Seed, readings: &[Reading]) -> Result<SceneRun> {
    run_scene_of(scene.build(seed)?, readings)
}

/// Segments a scene that is already built, in each reading.
/// # Errors
/// As [`run_scene`].
pub fn run_scene_of(mut source: SceneSource, readings: &[Reading]) -> Result<SceneRun> {
    let mut out = SceneRun { truth: Vec::new(), centroids: vec![Vec::new(); readings.len()] };
    // One clusterer for each way of linking.
    let linking = |inclusive| ClusterConfig { distance_px: PROXIMITY_PX, inclusive, ..ClusterConfig::default() };
    let mut clusterers: Vec<(bool, Clusterer)> = [false, true]
        .into_iter()
        .filter(|i| readings.iter().any(|r| r.inclusive == *i))
        .map(|i| (i, Clusterer::new(&linking(i))))
        .collect();
    let around = Surroundings::plain();
    let mut bits = vec![0u64; words(source.config().width_px)];
    while let Some(frame) = source.next_frame()? {
        let Pixels::Gray8(image) = &frame.pixels else {
            return Err(Error::new(ErrorKind::Config, "the papers' scenes have 8-bit frames").at("scene.bits"));
        };
        for (_, c) in &mut clusterers {
            c.begin(image.width());
        }
        for y in 0..image.height() {
            band_bits(image.row(y), BAND.0, BAND.1, &mut bits);
            for (_, c) in &mut clusterers {
                c.row(y, &bits, image.row(y));
            }
        }
        for (reading, scans) in readings.iter().zip(&mut out.centroids) {
            let clusterer = clusterers.iter().find(|(i, _)| *i == reading.inclusive);
            let all = clusterer.into_iter().flat_map(|(_, c)| c.regions());
            scans.push(all.map(|r| centroid(r, image, reading.method, &around).position.add_scalar(1.0)).collect());
        }
        let truth = source.truth().first().map_or(Vector4::zeros(), |t| t.kinematics.mean);
        out.truth.push(truth + Vector4::new(1.0, 0.0, 1.0, 0.0));
        source.recycle(frame);
    }
    Ok(out)
}
