//! What the first frames show as a whole: whether the camera stands still, what moves before it, and whether isolated blobs explain it.
//!
//! Source: our own. How:
//! 1. the camera: the background's shift from frame to frame ([`CameraMotionEstimator`]); where too little texture says nothing, the edges of
//!    the median frame must stay where they are;
//! 2. what moves: the median of all frames is the background ([`Background::prime`], on a grid of at most 400 px), and what differs from it
//!    in a frame, without shadows and changes of light, is joined to regions;
//! 3. where it is asked for, which of these regions hold an isolated blob of fitting size, as the detector of small targets would find it.
//!
//! Where the light changes, 1 and 2 are asked once more of the frames brought to one light.
//!
//! Limits: a target that stands in the same place in half of the frames is background.

use super::fixed_blocks;
use super::ground::{self, Ground};
use super::looks;
use super::spread::spread;
use crate::camera::CameraMotionEstimator;
use crate::vision::background::{Background, BackgroundConfig, BitImage, in_one_light};
use crate::vision::cluster::Clusterer;
use crate::vision::colour::grey;
use crate::vision::config::{ClusterConfig, DetectorConfig};
use crate::vision::isolated::IsolatedConfig;
use crate::vision::pixel::Pixel;
use crate::vision::threshold::{Polarity, ThresholdConfig};
use crate::{Frame, Homography, Image, MotionBasis, PixelKind, Pixels, Result, SourceInfo};
use nalgebra::Vector2;

/// Width of the grid, px.
pub(super) const GRID_PX: usize = 400;
/// The light is compared at one pixel in so many both ways, px of the grid.
const LIGHT_STEP: usize = 4;
/// Smallest region that counts, px of the grid.
const MIN_AREA: u32 = 6;
/// Frames in which isolated blobs are looked for.
const LOOKS: usize = 12;
/// Score from which an isolated blob explains what moves there: that from which it would start a track.
const BLOB_SCORE: f64 = 6.0;
/// A camera that came no farther than this share of the frame's width stands still, or nods about its place: half of the least side of what moves
/// ([`super::moving`]), so that its own motion makes no such thing.
const STILL_SHARE: f64 = 0.01;
/// Most of what moves that may be shadow. A shadow has a thing that casts it: with the sun 18° above the ground it is three times as long as the thing is high. Where more of what moves is darker than
/// the ground by a factor, that is what things do which are themselves dark: animals on bright ground.
const MOST_SHADOW: f64 = 0.75;
/// Least difference from the background that counts as moving in 8-bit frames, counts: above what codecs leave.
const MIN_COUNTS: f32 = 12.0;

/// Whether the camera stands still.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Camera {
    /// It does.
    Fixed,
    /// It does not.
    Moving,
    /// Too little is seen to say so.
    #[default]
    Unknown,
}

/// What was seen.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scene {
    /// Whether the camera stands still.
    pub camera: Camera,
    /// Frames looked at, and those in which something moves.
    pub n_frames: usize,
    /// Frames in which something moves.
    pub n_moving: usize,
    /// Mean number of moving regions in those.
    pub regions: f64,
    /// Width and height, px of the frame: half of what moves is in regions at least as wide and as high. Many small pieces and flickers hide no size so.
    pub size_px: [f64; 2],
    /// Median area of the regions, px of the frame.
    pub area_px: f64,
    /// Share of the frame that moves, mean of the moving frames.
    pub share: f64,
    /// Ground that moves in any frame, as a share of what moves in all frames together: 1 for things that go on, little for leaves
    /// and water, which stay in their places.
    pub novelty: f64,
    /// Share of what moves that is darker than the background by a factor that hardly changes nearby, as a shadow is.
    pub shadow: f64,
    /// The regions of each frame.
    moved: Vec<Vec<Moved>>,
    /// Where the first frame's ground lies in each frame, px; none before a fixed camera.
    pub ground: Vec<Ground>,
    /// The same of the frames brought to one light, where that changes before a fixed camera.
    pub in_one_light: Option<Box<Scene>>,
    /// Where the first frame's view lies in each frame, of a camera that shakes ([`super::shaken`]).
    pub places: Vec<Homography>,
    /// The motion from each frame to the next, the identity where nothing is known of it.
    pub steps: Vec<Homography>,
    /// Share of the background's edge pixels that move, if there are enough.
    pub edges_moved: Option<f64>,
}

/// A moving region, px of the frame.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Moved {
    left: f64,
    top: f64,
    right: f64,
    bottom: f64,
    area: f64,
}

/// Looks at frames of one size in the order of time.
/// # Errors
/// Frames of more than one size or pixel type.
pub fn look<'f>(frames: impl IntoIterator<Item = &'f Frame>, info: &SourceInfo) -> Result<Scene> {
    let frames: Vec<&Frame> = frames.into_iter().collect();
    let step = info.width.div_ceil(GRID_PX).max(1);
    let grids: Vec<Image<f32>> = frames.iter().map(|f| grid(&f.pixels, step)).collect();
    let same = |g: &Image<f32>| grids.first().is_some_and(|f| (f.width(), f.height()) == (g.width(), g.height()));
    if grids.len() < 4 || !grids.iter().all(same) || grids.iter().any(|g| g.as_slice().is_empty()) {
        return Ok(Scene { n_frames: frames.len(), ..Scene::default() });
    }
    let bytes = matches!(info.kind, PixelKind::Gray8 | PixelKind::Rgb8);
    let background = primed(&grids, bytes)?;
    let moved = edges_moved(&background, &grids, bytes);
    let mut scene = what_moves(background, &grids, info, step)?;
    let (steps, still) = follow(&frames);
    (scene.camera, scene.ground) = camera(&frames, &grids, moved, &steps, still);
    (scene.edges_moved, scene.steps) = (moved, steps);
    // A change that would not count as moving is left.
    let least = if bytes { MIN_COUNTS } else { 0.0 };
    let Some(lit) = in_one_light(&grids.iter().collect::<Vec<_>>(), LIGHT_STEP, least) else { return Ok(scene) };
    // What differs by the light alone neither moves nor shows that the camera does. Before a camera that moves it is other ground that is brighter.
    let background = primed(&lit, bytes)?;
    let stood = scene.camera == Camera::Fixed;
    if !stood && !edges_stand(edges_moved(&background, &lit, bytes)) {
        return Ok(scene);
    }
    let lit = Scene { camera: Camera::Fixed, ..what_moves(background, &lit, info, step)? };
    Ok(if stood { Scene { in_one_light: Some(Box::new(lit)), ..scene } } else { lit })
}

/// The background of grids.
pub(super) fn primed(grids: &[Image<f32>], bytes: bool) -> Result<Background<f32>> {
    let config =
        BackgroundConfig { start_s: 0.0, min_difference: bytes.then_some(MIN_COUNTS), ..BackgroundConfig::default() };
    let mut background = Background::<f32>::new(config)?;
    background.prime(&grids.iter().collect::<Vec<_>>())?;
    Ok(background)
}

/// Share of the background's edge pixels that move, if there are enough.
pub(super) fn edges_moved(background: &Background<f32>, grids: &[Image<f32>], bytes: bool) -> Option<f64> {
    let edges = edges(background, grids[0].width(), grids[0].height(), bytes);
    let n_moved: usize = grids.iter().map(|g| edges.iter().filter(|e| e.has_moved(g)).count()).sum();
    let enough = edges.len() * 1000 > grids[0].as_slice().len();
    enough.then(|| n_moved as f64 / (edges.len() * grids.len()).max(1) as f64)
}

/// What moves in grids before their background.
pub(super) fn what_moves(
    mut background: Background<f32>,
    grids: &[Image<f32>],
    info: &SourceInfo,
    step: usize,
) -> Result<Scene> {
    let mut scene = Scene { n_frames: grids.len(), ..Scene::default() };
    let mut moved = moved_in(&mut background, grids, step)?;
    scene.shadow = moved.shadow;
    if scene.has_dark_things() {
        background.drop_shadows();
        moved = moved_in(&mut background, grids, step)?;
    }
    scene.novelty = moved.novelty;
    measure(&mut scene, &moved.regions, info);
    scene.moved = moved.regions;
    Ok(scene)
}

/// The regions that move in each grid, px of the frame, and two numbers of a [`Scene`].
struct MovedIn {
    regions: Vec<Vec<Moved>>,
    novelty: f64,
    shadow: f64,
}

/// What moves in grids of every `step`-th pixel before their background, without what is shadow.
fn moved_in(background: &mut Background<f32>, grids: &[Image<f32>], step: usize) -> Result<MovedIn> {
    let mut regions = Vec::with_capacity(grids.len());
    let (mut ever, mut all) = (BitImage::new(grids[0].width(), grids[0].height()), 0);
    let mut shadow_and_not = [0usize; 2];
    // Parts of one thing lie near each other.
    let join = ClusterConfig { distance_px: 4.0, min_area_px: Some(MIN_AREA), ..ClusterConfig::default() };
    let mut clusters = Clusterer::new(&join);
    for g in grids {
        // No time passes: the background stays what it is.
        background.update(g, 0.0)?;
        clusters.begin(g.width());
        all += background.moving().count();
        shadow_and_not.iter_mut().zip(background.shadow_and_not()).for_each(|(sum, n)| *sum += n);
        for y in 0..g.height() {
            ever.row_mut(y).iter_mut().zip(background.row(y)).for_each(|(e, b)| *e |= b);
            clusters.row(y, background.row(y), g.row(y));
        }
        let scale = step as f64;
        let found = clusters.regions().filter(|r| r.area >= MIN_AREA).map(|r| Moved {
            left: f64::from(r.left) * scale,
            top: f64::from(r.top) * scale,
            right: f64::from(r.right + 1) * scale,
            bottom: f64::from(r.bottom + 1) * scale,
            area: f64::from(r.area) * scale * scale,
        });
        regions.push(found.collect::<Vec<_>>());
    }
    let [shadow, not] = shadow_and_not.map(|n| n as f64);
    let novelty = ever.count() as f64 / all.max(1) as f64;
    Ok(MovedIn { regions, novelty, shadow: shadow / (shadow + not).max(1.0) })
}

/// Whether edges are seen and stand: strong ones would show the smallest shift.
pub(super) fn edges_stand(edges_moved: Option<f64>) -> bool {
    edges_moved.is_some_and(|share| share <= 0.03)
}

/// The pixels as grey.
pub(super) fn grey_of(pixels: &Pixels) -> Image<f32> {
    grid(pixels, 1)
}

/// Every `step`-th pixel both ways, as grey.
pub(super) fn grid(pixels: &Pixels, step: usize) -> Image<f32> {
    fn take<P: Copy>(image: &Image<P>, step: usize, value: impl Fn(P) -> f32) -> Image<f32> {
        let (w, h) = (image.width().div_ceil(step), image.height().div_ceil(step));
        let mut out = Image::filled(w, h, 0.0f32);
        for y in 0..h {
            let to = out.row_mut(y).iter_mut();
            match step {
                1 => to.zip(image.row(y)).for_each(|(o, &p)| *o = value(p)),
                _ => to.zip(image.row(y * step).iter().step_by(step)).for_each(|(o, &p)| *o = value(p)),
            }
        }
        out
    }
    match pixels {
        Pixels::Gray8(i) => take(i, step, |p| p.value_f32()),
        Pixels::Gray16(i) => take(i, step, |p| p.value_f32()),
        Pixels::GrayF32(i) => take(i, step, |p| p.value_f32()),
        Pixels::Rgb8(i) => take(i, step, |p| f32::from(grey(p))),
    }
}

/// A pixel of the background that differs so far from its neighbour to the right or below that a shift of one pixel shows.
struct Edge {
    x: usize,
    y: usize,
    mean: f32,
    /// How far it differs.
    step: f32,
}

impl Edge {
    /// Whether a frame has something else there. The pixel's own deviation does not count: an edge that moves makes it as large as the edge.
    fn has_moved(&self, grid: &Image<f32>) -> bool {
        (grid.row(self.y)[self.x] - self.mean).abs() > 0.5 * self.step
    }
}

/// The edges of the background.
fn edges(background: &Background<f32>, w: usize, h: usize, bytes: bool) -> Vec<Edge> {
    let at = |x: usize, y: usize| background.mean(x, y).unwrap_or(0.0);
    let mut noise: Vec<f32> = (0..w * h).step_by(7).filter_map(|i| background.deviation(i % w, i / w)).collect();
    let middle = noise.len() / 2;
    let typical = if noise.is_empty() { 1.0 } else { *noise.select_nth_unstable_by(middle, f32::total_cmp).1 };
    let least = (16.0 * typical).max(if bytes { 2.0 * MIN_COUNTS } else { f32::MIN_POSITIVE });
    let inside = (0..h.saturating_sub(1)).flat_map(|y| (0..w.saturating_sub(1)).map(move |x| (x, y)));
    inside
        .map(|(x, y)| {
            let mean = at(x, y);
            Edge { x, y, mean, step: (at(x + 1, y) - mean).abs().max((at(x, y + 1) - mean).abs()) }
        })
        .filter(|e| e.step > least)
        .collect()
}

/// The motion from each frame to the next, the identity where nothing is known of it; in how many frames it is known, and the view lies where it lay first.
fn follow(frames: &[&Frame]) -> (Vec<Homography>, [u32; 2]) {
    let mut motion = CameraMotionEstimator::default();
    let (mut said, mut still) = (0u32, 0u32);
    let (mut moved, mut steps) = (Homography::identity(), Vec::with_capacity(frames.len()));
    for frame in frames {
        let step = motion.step(&frame.pixels);
        steps.push(step.map_or(Homography::identity(), |s| s.now_from_before));
        if let Some(step) = step {
            moved = moved.then(&step.now_from_before);
            if matches!(step.basis, MotionBasis::Measured | MotionBasis::Resumed) {
                said += 1;
                // A turn and a zoom about the middle show at the corners.
                let (w, h) = (frame.pixels.width() as f64, frame.pixels.height() as f64);
                let corners =
                    [(0.0, 0.0), (w, 0.0), (0.0, h), (w, h)].map(|(x, y)| moved.shift_at(Vector2::new(x, y)).norm());
                still += u32::from(corners.iter().all(|&far| far <= STILL_SHARE * w));
            }
        }
    }
    (steps, [said, still])
}

/// Whether the camera stands still, and where the first frame's ground lies in each frame; `edges_moved` is the share of edge pixels that move, if there are
/// edges; `steps` and in how many frames they are known, and the view lies where it lay, as [`follow`] says.
fn camera(
    frames: &[&Frame],
    grids: &[Image<f32>],
    edges_moved: Option<f64>,
    steps: &[Homography],
    [said, still]: [u32; 2],
) -> (Camera, Vec<Ground>) {
    let n_steps = u32::try_from(frames.len().saturating_sub(1)).unwrap_or(u32::MAX).max(1);
    if edges_stand(edges_moved) || (2 * said >= n_steps && still == said) {
        return (Camera::Fixed, Vec::new());
    }
    // Patches that are followed may be the targets' own; the ground is most of the frame.
    let stands = fixed_blocks::stands(grids);
    if 2 * said >= n_steps && !stands {
        return (Camera::Moving, ground::follow(frames, steps));
    }
    // Too little texture to follow: that targets cross the edges is no motion of the camera.
    let edges_stay = edges_moved.is_some_and(|share| share < 0.2);
    if edges_stay || stands {
        return (Camera::Fixed, Vec::new());
    }
    (Camera::Unknown, ground::follow(frames, steps))
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// The value that half of the weight, the second of each pair, lies at or above.
fn weighted_median(values: &mut [(f64, f64)]) -> f64 {
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * values.iter().map(|v| v.1).sum::<f64>();
    let mut sum = 0.0;
    values.iter().find(|v| (sum += v.1, sum >= half).1).map_or(0.0, |v| v.0)
}

fn measure(scene: &mut Scene, moved: &[Vec<Moved>], info: &SourceInfo) {
    let all = || moved.iter().flatten();
    scene.n_moving = moved.iter().filter(|m| !m.is_empty()).count();
    let n = scene.n_moving.max(1) as f64;
    scene.regions = all().count() as f64 / n;
    scene.size_px = [
        weighted_median(&mut all().map(|m| (m.right - m.left, m.area)).collect::<Vec<_>>()),
        weighted_median(&mut all().map(|m| (m.bottom - m.top, m.area)).collect::<Vec<_>>()),
    ];
    scene.area_px = median(&mut all().map(|m| m.area).collect::<Vec<_>>());
    scene.share = all().map(|m| m.area).sum::<f64>() / (n * (info.width * info.height).max(1) as f64);
}

impl Scene {
    /// Whether so much of what moves is as a shadow that it is things' own darkness: none of it is taken for shadow then.
    pub fn has_dark_things(&self) -> bool {
        self.shadow > MOST_SHADOW
    }

    /// The share of the moving regions in which an isolated blob of a fourth of their box or more has its middle; `frames` are those looked at.
    /// # Errors
    /// Frames of more than one size or pixel type.
    pub fn explained(&self, frames: &[&Frame], info: &SourceInfo, n_threads: usize) -> Result<f64> {
        let moved = &self.moved;
        let moving: Vec<usize> = (0..moved.len()).filter(|&i| !moved[i].is_empty()).collect();
        let isolated = IsolatedConfig {
            polarity: Polarity::Both,
            min_score: BLOB_SCORE,
            max_side_px: super::spots::max_side(info),
            ..IsolatedConfig::default()
        };
        let mut config = DetectorConfig { threshold: ThresholdConfig::Isolated(isolated), ..DetectorConfig::default() };
        config.cluster.min_area_px = Some(3);
        let Some(first) = frames.first() else { return Ok(0.0) };
        // A second look may have another kind of pixels than the source announced.
        let seen = SourceInfo { kind: first.pixels.kind(), ..info.clone() };
        let scans = looks::scans(&config, spread(&moving, LOOKS).map(|&i| frames[i]), &seen, n_threads)?;
        let (mut n, mut hits) = (0usize, 0usize);
        for (scan, &i) in scans.iter().zip(spread(&moving, LOOKS)) {
            let ground = self.places.get(i).map(Homography::inverse);
            for m in &moved[i] {
                let area = (m.right - m.left) * (m.bottom - m.top);
                let hit = scan.detections.iter().any(|d| {
                    let at = ground.map_or(d.position, |ground| ground.apply(d.position));
                    let (x, y) = (at.x, at.y);
                    let within = x >= m.left - 2.0 && x <= m.right + 1.0 && y >= m.top - 2.0 && y <= m.bottom + 1.0;
                    within && 4.0 * d.extent.width_px * d.extent.height_px >= area
                });
                n += 1;
                hits += usize::from(hit);
            }
        }
        Ok(hits as f64 / n.max(1) as f64)
    }
}

#[cfg(test)]
#[path = "scene/tests.rs"]
mod tests;
