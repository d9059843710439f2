//! Composed clips of the exam: a real still under a moving camera, with targets drawn on it; their truth is exact.
//!
//! A window of 320 x 256 px goes over an infrared still without a target. Half of the clips of cameras that move have a second, nearer plane before
//! it, so that a camera taken out by one plane does not take out all of the ground. All is drawn from a seed and the clip's number, and
//! each clip is written as YUV4MPEG2 with its truth as a table only when its turn comes.

mod camera;
mod scene;
mod target;

use super::clips::{Clip, Columns, Near};
use super::variants;
use crate::detect_scenes::{images, still};
use anyhow::{Context, Result};
use boresight::Image;
use boresight::sim::{Purpose, Seed};
use camera::Motion;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use scene::{Scene, VIEW_PX};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use target::Target;

/// The seeds of half A and half B, and clips of each.
pub const SEEDS: [u64; 2] = [1, 2];
pub const N_CLIPS: u64 = 10;
const RATE_HZ: f64 = 25.0;
const NEAR_PX: f64 = 5.0;
const KINDS: [&str; 3] = ["composed: camera stands", "composed: camera moves", "composed: camera moves, parallax"];
/// Frames from one to the next of those by which targets' heights and the near plane's share are set.
const SAMPLED: usize = 8;

/// What a clip is made of, but for its ground and its targets.
struct Setting {
    motion: Motion,
    parallax: Option<f64>,
    n_frames: usize,
    /// Deviation of the white noise, counts.
    noise: f64,
}

impl Setting {
    /// Of clip `number`: ten clips hold every kind of camera that moves with and without parallax, and two that stand.
    fn draw(number: u64, rng: &mut ChaCha8Rng) -> Self {
        let motion = match number % 5 {
            0 => Motion::Still,
            1 => Motion::Drift(rng.random_range(0.3..1.0)),
            2 => Motion::Pan(rng.random_range(1.0..6.0)),
            3 => Motion::Shake(rng.random_range(1.0..2.5)),
            _ => Motion::Follow(rng.random_range(0.8..4.0)),
        };
        let parallax = 0.02 * 15f64.powf(rng.random::<f64>());
        Self {
            motion,
            parallax: (motion != Motion::Still && number % 10 >= 5).then_some(parallax),
            n_frames: rng.random_range(200..=300),
            noise: rng.random_range(1.0..4.0),
        }
    }

    fn kind(&self) -> &'static str {
        KINDS[if self.motion == Motion::Still { 0 } else { 1 + usize::from(self.parallax.is_some()) }]
    }
}

/// A clip that is still to be written.
pub struct Plan {
    setting: Setting,
    rng: ChaCha8Rng,
    stills: Vec<PathBuf>,
}

/// `n` clips of each seed, by kind and within a kind in turns of the seeds; none where the stills are missing.
pub fn clips(data: &Path, folder: &Path, seeds: &[u64], n: u64) -> Vec<(Clip, Plan)> {
    let Ok(stills) = images(&data.join("sirst_v2_empty")) else { return Vec::new() };
    let mut out = Vec::new();
    for (number, seed) in (0..n).flat_map(|number| seeds.iter().map(move |seed| (number, *seed))) {
        let mut rng = Seed::new(seed).stream(Purpose::Scenario, number);
        let setting = Setting::draw(number, &mut rng);
        let parallax = setting.parallax.map_or(String::new(), |p| format!(", parallax {p:.2}"));
        let name =
            format!("composed {seed}-{number:02}, {}{parallax}, noise {:.1}", setting.motion.name(), setting.noise);
        let stem: String = name.chars().map(|c| if c.is_alphanumeric() { c } else { '_' }).collect();
        let (input, truth) = (folder.join(format!("{stem}.y4m")), folder.join(format!("{stem}.csv")));
        let (kind, near) = (setting.kind(), Near::Px(NEAR_PX));
        let clip = Clip { kind, name, input, truth, columns: Columns::POINTS, near, whole: true, contrast: None };
        out.push((clip, Plan { setting, rng, stills: stills.clone() }));
    }
    out.sort_by_key(|(clip, _)| KINDS.iter().position(|k| *k == clip.kind));
    out
}

impl Plan {
    /// Writes the clip's frames and truth; the contrast of its targets is known from then on.
    pub fn write(mut self, clip: Clip) -> Result<Clip> {
        let rng = &mut self.rng;
        let mut draw = || -> Result<Image<f32>> {
            let path = &self.stills[rng.random_range(0..self.stills.len())];
            let image = still(path)?;
            // Of a large still every second one is seen from farther away.
            let halve = image.width() >= 1200 && image.height() >= 1000 && rng.random_bool(0.5);
            Ok(scene::plane(&image, halve))
        };
        let far = draw()?;
        let near = if self.setting.parallax.is_some() { Some(draw()?) } else { None };
        let composed = compose(&self.setting, far, near, rng);
        variants::write(&composed.frames, RATE_HZ, &clip.input)?;
        let mut table = String::from("frame,id,x,y\n");
        for (frame, id, [x, y]) in &composed.truth {
            writeln!(table, "{frame},{id},{x:.3},{y:.3}")?;
        }
        std::fs::write(&clip.truth, table)?;
        let mut contrasts: Vec<f64> = composed.targets.iter().map(|t| t.contrast).collect();
        contrasts.sort_by(f64::total_cmp);
        let contrast = Some(*contrasts.get(contrasts.len() / 2).context("a clip without a target")?);
        Ok(Clip { contrast, ..clip })
    }
}

struct Composed {
    frames: Vec<Image<u8>>,
    truth: Vec<(u32, u32, [f64; 2])>,
    targets: Vec<Target>,
}

/// The frames and what is in them; a clip with parallax needs a still for its near plane.
fn compose(setting: &Setting, far: Image<f32>, near: Option<Image<f32>>, rng: &mut ChaCha8Rng) -> Composed {
    let mut room = scene::room(&far);
    let parallax = setting.parallax.unwrap_or(0.0);
    if let Some(near) = &near {
        let of_near = scene::room(near);
        room = [0, 1].map(|i| room[i].min(of_near[i] / (1.0 + parallax)));
    }
    let camera::Path { corner_px: path, followed_px } = setting.motion.path(room, setting.n_frames, rng);
    let share = rng.random_range(0.05..0.3);
    let near = near.map(|still| scene::Near::draw(scene::mirrored(still), parallax, &path, share, rng));
    let scene = Scene { far, near };
    let middle = VIEW_PX.map(|side| 0.5 * (side as f64 - 1.0));
    let mut targets: Vec<Target> = Vec::new();
    let n_targets = rng.random_range(1..=5);
    if let Some(corners) = followed_px {
        targets.push(Target::on(corners.iter().map(|c| [0, 1].map(|i| c[i] + middle[i])).collect(), rng));
    }
    while targets.len() < n_targets {
        let meets = targets.last().filter(|_| rng.random_bool(0.3)).cloned();
        targets.push(Target::draw(&path, meets.as_ref(), rng));
    }
    let sampled: Vec<_> = (0..path.len()).step_by(SAMPLED).map(|t| (t, scene.ground(path[t]))).collect();
    targets.iter_mut().for_each(|t| t.set_height(&path, &sampled, setting.noise, rng));
    let frame = |t: usize| {
        let ground = scene.ground(path[t]);
        let mut frame = ground.clone();
        targets.iter().for_each(|target| target.put(&mut frame, &ground, &path, t));
        let mut out = Image::filled(frame.width(), frame.height(), 0u8);
        for (p, v) in out.as_mut_slice().iter_mut().zip(frame.as_slice()) {
            let noise = setting.noise as f32 * rng.sample::<f32, _>(StandardNormal);
            *p = (v + noise).round().clamp(0.0, 255.0) as u8;
        }
        out
    };
    let frames = (0..path.len()).map(frame).collect();
    Composed { frames, truth: target::truth(&targets, &path), targets }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detect_scenes::{Ground, ground};

    fn composed(seed: u64, number: u64) -> Composed {
        let mut rng = Seed::new(seed).stream(Purpose::Scenario, number);
        let setting = Setting { n_frames: 40, ..Setting::draw(number, &mut rng) };
        let plane = |seed| {
            let mut image = ground(Ground::OneOverF, 640, 512, seed);
            image.as_mut_slice().iter_mut().for_each(|v| *v = 120.0 + 15.0 * *v);
            image
        };
        let near = setting.parallax.map(|_| plane(2));
        compose(&setting, plane(1), near, &mut rng)
    }

    #[test]
    fn a_clip_is_the_same_from_its_seed_and_another_from_another() {
        let [a, b, other] = [(3, 7), (3, 7), (4, 7)].map(|(seed, number)| composed(seed, number));
        assert!(a.frames == b.frames && a.truth == b.truth);
        assert!(a.frames != other.frames && a.truth != other.truth);
    }

    #[test]
    fn every_clip_has_targets_and_they_lie_in_view() {
        for number in 0..10 {
            let clip = composed(5, number);
            assert!(!clip.truth.is_empty(), "{number}");
            let last = VIEW_PX.map(|side| side as f64 - 1.0);
            let inside = |at: [f64; 2]| (0..2).all(|i| (0.0..=last[i]).contains(&at[i]));
            assert!(clip.truth.iter().all(|r| r.0 < 40 && inside(r.2)));
        }
    }
}
