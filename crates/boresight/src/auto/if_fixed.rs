//! What moves if the camera stands, where that is not known, or where isolated blobs explain it: a candidate that is held against the choice by what both find in the first pass.
//!
//! Source: our own. A camera that drifts by a pixel a second, or light that changes while a car fills a third of the view, leaves the question open whether the camera stands, and what is chosen
//! without an answer may be the road's texture. The background itself tells: where the ground goes by, most of the frame differs from it, and [`super::moving`] refuses; where little does, both
//! are run, and the candidate is taken if its chains go with none of the choice's and gain more, a scan, than all of these. Where the choice follows the camera in most scans, nothing is open.
//!
//! Where the camera is seen to stand and isolated blobs explain most of what moves in the few frames looked at, the choice is what finds blobs: it sees those that stand as well. But blobs that come near
//! to each other are not isolated, and are missed while they do: if the chains of all that moves hold surely more detections in the first pass than those of the blobs, and hold most of what is
//! detected, and no chain of the blobs goes without one of them, the candidate is taken.
//! Limits: those of [`super::chains`]; what both see is the choice's where it is not known whether the camera stands.

use super::chains::Chain;
use super::evidence::{Evidence, LEAST_EXPLAINED};
use super::moving;
use super::scene::{Camera, Scene};
use crate::tempo::Tempo;
use crate::vision::threshold::ThresholdConfig;
use crate::{Config, Frame, MotionBasis, Result, Scan, SourceInfo};

/// Deviations by which numbers of detections are surely different.
const STDS: f64 = 3.0;
/// Share of what the candidate detects that must be of chains that move: more than what is not.
const MOST_OF_IT: f64 = 0.5;

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
    let explained = moving::look(frames, scene, info, n_threads)?.filter(|e| moving::is_evident(scene, *e, info));
    let Some(explained) = explained else { return Ok(None) };
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

/// Whether a detector finds blobs by how they stand out from their surroundings, and misses those near to each other.
pub fn finds_blobs(threshold: &ThresholdConfig) -> bool {
    matches!(threshold, ThresholdConfig::Isolated(_) | ThresholdConfig::Cfar(_))
}

/// Why the candidate is taken before a camera that stands: its chains that surely move hold surely more detections than those of the choice and most of what it detects, and none of those of the
/// choice goes without one of its.
pub fn finds_more(own: &[Scan], candidate: &[Scan], area_px2: f64) -> Option<String> {
    let [blobs, all] = [own, candidate].map(|scans| Evidence::of_scans(scans, area_px2));
    let [n_blobs, n_all] = [&blobs, &all].map(|e| e.sure().map(|c| c.hits.len()).sum::<usize>());
    let are_more = n_all as f64 > n_blobs as f64 + STDS * ((n_all + n_blobs) as f64).sqrt();
    let is_lost = |c: &Chain| !all.moving.iter().any(|m| c.goes_with(m));
    (are_more && all.explained(candidate) > MOST_OF_IT && !blobs.sure().any(is_lost)).then(|| {
        format!(
            "In {} frames what surely moves before the fixed camera is in {n_all} detections of what differs from the background, and in {n_blobs} of isolated blobs: blobs that come near to each other \
             are not isolated. So what moves is detected.",
            all.times_s.len(),
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

    /// The scans without what is farther along than some px in some of them: blobs that are missed while others are near.
    fn missed(scans: &[Scan], is_missed: impl Fn(usize) -> bool) -> Vec<Scan> {
        let mut scans = scans.to_vec();
        for (_, scan) in scans.iter_mut().enumerate().filter(|(k, _)| is_missed(*k)) {
            scan.detections.truncate(2);
        }
        scans
    }

    #[test]
    fn all_that_moves_is_taken_where_surely_more_of_it_is_found_and_nothing_is_lost() {
        let things = scans(0, 0.0, 5);
        let some = missed(&things, |k| (10..30).contains(&k));
        assert!(finds_more(&some, &things, 9e4).is_some_and(|r| r.contains("200 detections") && r.contains("140 of")));
        assert_eq!(finds_more(&things, &things, 9e4), None, "as much");
        assert_eq!(finds_more(&missed(&things, |k| k == 20), &things, 9e4), None, "three more are not surely more");
        let among_clutter: Vec<Scan> = scans(60, 0.0, 5);
        assert_eq!(finds_more(&some, &among_clutter, 9e4), None, "most of what is found stands");
        let mut other = some.clone();
        for (k, scan) in other.iter_mut().enumerate() {
            let at = Vector2::new(280.0, 290.0 - 5.0 * k as f64);
            scan.detections.push(Detection::at(at, Matrix2::identity() * 0.01));
        }
        assert_eq!(finds_more(&other, &things, 9e4), None, "one blob is not found");
    }
}
