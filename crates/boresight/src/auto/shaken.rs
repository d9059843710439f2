//! What moves before a camera that stays in its place but shakes: the frames are brought to the first one's place and looked at as those of a camera at rest.
//!
//! Source: our own. The first frames' motions say whether the camera shakes ([`super::shake`]). All frames that are held for the first pass are then followed, and of those that are found some are looked at, spread evenly;
//! it must also be that most are found, and that the edges which moved before stand in them, if there are enough.
//! Limits: those of [`crate::camera`]: behind a thing that covers most of the view its place is lost; what comes later than the frames that are held.

use super::first_scans::PROBE_FRAMES;
use super::scene::{Camera, GRID_PX, Scene, edges_moved, edges_stand, grid, primed, what_moves};
use super::shake;
use super::spread::spread;
use crate::camera::CameraMotionEstimator;
use crate::io::Replay;
use crate::warp::draw_onto;
use crate::{Frame, FrameSource, Homography, Image, MotionBasis, PixelKind, Result, SourceInfo};
use nalgebra::Vector2;

/// Share of the edge pixels that move where the frames are brought to one place, at most, and as a share of those that moved before: what goes by crosses edges, and what lies between pixels is not as they are.
const STEADIED: [f64; 2] = [0.1, 0.3];

/// What is seen so.
#[derive(Debug)]
pub(super) struct Shaken {
    /// What moves.
    pub scene: Scene,
    /// Which of the frames held were looked at.
    at: Vec<usize>,
}

impl Shaken {
    /// The frames looked at, of those held.
    pub(super) fn frames<'f>(&self, held: &'f [Frame]) -> Vec<&'f Frame> {
        self.at.iter().filter_map(|k| held.get(*k)).collect()
    }
}

/// As [`look`], of all frames that may be held, which are read only where they are needed.
/// # Errors
/// Frames of more than one size or pixel type.
pub(super) fn look_on(scene: &Scene, frames: &mut Replay) -> Result<Option<Shaken>> {
    let info = frames.info().clone();
    if may_shake(scene, &info) { look(scene, frames.read_on(usize::MAX), &info) } else { Ok(None) }
}

/// Whether the first frames, of which `scene` speaks, show a camera that may shake.
fn may_shake(scene: &Scene, info: &SourceInfo) -> bool {
    !edges_stand(scene.edges_moved) && shake::shakes(&scene.steps, (info.width, info.height))
}

/// What moves in the frames held, if the first of them, of which `scene` speaks, show a camera that shakes.
/// # Errors
/// Frames of more than one size or pixel type.
pub(super) fn look(scene: &Scene, held: &[Frame], info: &SourceInfo) -> Result<Option<Shaken>> {
    let Some(first) = held.first().filter(|_| may_shake(scene, info)) else { return Ok(None) };
    let size = Vector2::new(info.width as f64, info.height as f64);
    let (mut motion, mut place, mut found) = (CameraMotionEstimator::default(), Homography::identity(), Vec::new());
    for (k, frame) in held.iter().take_while(|f| f.pixels.are_like(&first.pixels)).enumerate() {
        let step = motion.step(&frame.pixels);
        // Behind what hides the view its place is not known any more.
        if found.len() > 1 && step.is_none_or(|m| matches!(m.basis, MotionBasis::Resumed | MotionBasis::Cut)) {
            break;
        }
        place = step.map_or(place, |step| place.then(&step.now_from_before));
        let is_measured = step.is_some_and(|m| m.basis == MotionBasis::Measured);
        if k == 0 || is_measured && shake::is_near(&place, size) {
            found.push((k, place));
        }
    }
    let looked: Vec<_> = spread(&found, PROBE_FRAMES).copied().collect();
    if looked.len() < shake::LEAST_FRAMES || 2 * found.len() < held.len() {
        return Ok(None);
    }
    let (at, places): (Vec<usize>, Vec<Homography>) = looked.into_iter().unzip();
    if shake::rms_px(&places, size) <= shake::LEAST_PX {
        return Ok(None);
    }
    let step = info.width.div_ceil(GRID_PX).max(1);
    let mut canvas = first.pixels.clone();
    let grids = at.iter().zip(&places).map(|(k, place)| {
        draw_onto(&held[*k].pixels, place, &mut canvas);
        grid(&canvas, step)
    });
    let grids: Vec<Image<f32>> = grids.collect();
    let bytes = matches!(info.kind, PixelKind::Gray8 | PixelKind::Rgb8);
    let background = primed(&grids, bytes)?;
    let most = STEADIED[0].min(scene.edges_moved.map_or(1.0, |moved| STEADIED[1] * moved));
    if edges_moved(&background, &grids, bytes).is_some_and(|left| left > most) {
        return Ok(None);
    }
    let mut seen = what_moves(background, &grids, info, step)?;
    (seen.camera, seen.places) = (Camera::Fixed, places);
    Ok(Some(Shaken { scene: seen, at }))
}
