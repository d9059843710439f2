//! What moves if the camera stands, where it is not known to stand: a candidate that is held against the choice by what both find in the first pass.
//!
//! Source: our own. A camera that drifts by a pixel a second, or light that changes while a car fills a third of the view, leaves the question open whether the camera stands, and what is chosen
//! without an answer may be the road's texture. The background itself tells: where the ground goes by, most of the frame differs from it, and [`super::moving`] refuses; where little does, both
//! are run, and the candidate is taken if its chains go with none of the choice's and gain more, a scan, than all of these. Where the choice follows the camera in most scans, nothing is open.
//! Limits: those of [`super::chains`]; what both see is the choice's.

use super::evidence::{Evidence, LEAST_EXPLAINED};
use super::moving;
use super::scene::{Camera, Scene};
use crate::tempo::Tempo;
use crate::{Config, Frame, MotionBasis, Result, Scan, SourceInfo};

/// The candidate's configuration and reasons, from those so far, if little but things that move differs from the background; `frames` are those looked at.
/// # Errors
/// Frames of more than one size or pixel type.
pub fn look(
    frames: &[&Frame],
    scene: &Scene,
    tempo: Tempo,
    info: &SourceInfo,
    n_threads: usize,
    (mut config, mut reasons): (Config, Vec<String>),
) -> Result<Option<(Config, Vec<String>)>> {
    if scene.camera == Camera::Fixed {
        return Ok(None);
    }
    let Some(explained) = moving::look(frames, scene, info, n_threads)? else { return Ok(None) };
    moving::configure(scene, explained, tempo, info, &mut config, &mut reasons);
    Ok(Some((config, reasons)))
}

/// Whether the camera is followed in most of the choice's scans: then nothing is open.
pub fn is_followed(own: &[Scan]) -> bool {
    let is_known = |s: &&Scan| s.camera_motion.is_some_and(|m| m.basis != MotionBasis::Cut);
    2 * own.iter().filter(is_known).count() > own.len()
}

/// Why the candidate is taken, if its scans say more than those of the choice do.
pub fn wins(own: &[Scan], candidate: &[Scan], area_px2: f64) -> Option<String> {
    let [choice, fixed] = [own, candidate].map(|scans| Evidence::of_scans(scans, area_px2));
    let a_scan = [fixed.gain_apart_a_scan(Some(&choice)), choice.gain_apart_a_scan(None).max(0.0)];
    let is_more = fixed.is_sure() && a_scan[0] > a_scan[1];
    (is_more && fixed.explained(candidate) >= LEAST_EXPLAINED).then(|| {
        format!(
            "Whether the camera stands is not seen. If it does, {} in {} frames, {:.1} nats a frame, where what else may be chosen gains {:.1} besides what goes one way, as the ground does: \
             so it does.",
            fixed.words(),
            fixed.times_s.len(),
            a_scan[0],
            a_scan[1],
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CameraMotion, Detection, FrameIndex, Timestamp};
    use nalgebra::{Matrix2, Vector2};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Forty scans of so many specks that go one way by `drift` px a scan, with noise, and of so many things that cross the field of 300 x 300 px.
    fn scans(n_specks: usize, drift: f64, n_things: usize) -> Vec<Scan> {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let places: Vec<Vector2<f64>> =
            (0..n_specks).map(|_| 300.0 * Vector2::new(rng.random::<f64>(), rng.random::<f64>())).collect();
        let mut scan = |k: u64| {
            let t = k as f64;
            let mut at = |p: Vector2<f64>| {
                let noise = 0.2 * Vector2::new(rng.random::<f64>() - 0.5, rng.random::<f64>() - 0.5);
                Detection::at(p + noise, Matrix2::identity() * 0.01)
            };
            let specks = places.iter().map(|p| p + Vector2::new(drift * t, 0.5 * drift * t));
            let things = (0..n_things).map(|i| Vector2::new(20.0 + 4.0 * t, 30.0 + 60.0 * i as f64 + t * i as f64));
            let detections = specks.chain(things).map(&mut at).collect();
            Scan::at(FrameIndex(k), Timestamp::from_secs_f64(0.04 * t)).with_detections(detections)
        };
        (0..40).map(&mut scan).collect()
    }

    #[test]
    fn a_car_before_a_road_wins_over_the_road_and_not_over_the_car() {
        let (road, car) = (scans(60, 0.15, 0), scans(0, 0.0, 1));
        assert!(wins(&road, &car, 9e4).is_some_and(|r| r.contains("the ground does")));
        assert_eq!(wins(&scans(0, 0.0, 1), &car, 9e4), None, "both see it");
        assert_eq!(wins(&scans(0, 0.0, 4), &scans(0, 0.0, 0), 9e4), None, "nothing moves");
        assert_eq!(wins(&car, &road, 9e4), None, "the ground goes by");
        let followed = |s: Scan| s.with_camera_motion(Some(CameraMotion::exact_shift(Vector2::zeros())));
        let followed: Vec<Scan> = road.into_iter().map(followed).collect();
        assert!(is_followed(&followed) && !is_followed(&car));
    }
}
