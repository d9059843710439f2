//! Where a composed clip's window is in each frame: a camera that stands, drifts, pans, shakes or follows a target.
//!
//! A path is the window's top left corner, px of the far plane, each corner within a room: 0 to `room` on both axes. A path that comes
//! to the room's edge turns around there, within half a second.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

/// How a camera moves; speeds in px a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion {
    Still,
    Drift(f64),
    Pan(f64),
    /// Standard deviation, px.
    Shake(f64),
    /// The followed target's largest speed.
    Follow(f64),
}

/// Correlation of the shake from one frame to the next.
const SHAKE_CORRELATION: f64 = 0.7;
/// Frames before and after a corner of the path over which it is turned.
const TURN_FRAMES: i64 = 6;
/// Share of the way to the followed target that the camera goes in a frame.
const FOLLOW_SHARE: f64 = 0.1;

/// A camera's path.
pub struct Path {
    /// The window's corner in each frame.
    pub corner_px: Vec<[f64; 2]>,
    /// Where the corner would have the followed target in the window's middle.
    pub followed_px: Option<Vec<[f64; 2]>>,
}

impl Motion {
    /// In words of the clip's name.
    pub fn name(self) -> String {
        match self {
            Self::Still => "still".into(),
            Self::Drift(v) => format!("drift {v:.1}"),
            Self::Pan(v) => format!("pan {v:.1}"),
            Self::Shake(sd) => format!("shake {sd:.1}"),
            Self::Follow(v) => format!("follow {v:.1}"),
        }
    }

    /// No hand and no motor is quite steady: standard deviation of the shake, px.
    fn shake_px(self) -> f64 {
        match self {
            Self::Still => 0.0,
            Self::Drift(_) => 0.1,
            Self::Pan(_) => 0.2,
            Self::Shake(sd) => sd,
            Self::Follow(_) => 0.8,
        }
    }

    /// Draws a path of `n` frames.
    pub fn path(self, room: [f64; 2], n: usize, rng: &mut ChaCha8Rng) -> Path {
        let shake_px = self.shake_px();
        // Four deviations: the shake seldom comes to the room's edge, where it is cut.
        let edge = room.map(|r| f64::min(4.0 * shake_px, 0.3 * r));
        let inner = [0, 1].map(|i| room[i] - 2.0 * edge[i]);
        let mut followed_px = None;
        let mut corner_px = match self {
            Self::Still | Self::Shake(_) => vec![inner.map(|r| r * rng.random::<f64>()); n],
            Self::Drift(v) => {
                let angle = rng.random_range(0.0..std::f64::consts::TAU);
                turning([v * angle.cos(), v * angle.sin()], inner, n, rng)
            }
            Self::Pan(v) => {
                // Mostly along the horizon.
                let angle: f64 = rng.random_range(-0.35..0.35);
                let side = if rng.random_bool(0.5) { v } else { -v };
                turning([side * angle.cos(), v * angle.sin()], inner, n, rng)
            }
            Self::Follow(v) => {
                let of = wander(v, inner, n, rng);
                let mut at = of[0];
                let corner = of.iter().map(|to| {
                    at = [0, 1].map(|i| at[i] + FOLLOW_SHARE * (to[i] - at[i]));
                    at
                });
                let corner = corner.collect();
                followed_px = Some(of.iter().map(|p| [0, 1].map(|i| p[i] + edge[i])).collect());
                corner
            }
        };
        let mut shake = [0, 1].map(|_| shake_px * rng.sample::<f64, _>(StandardNormal));
        for c in &mut corner_px {
            *c = [0, 1].map(|i| (c[i] + edge[i] + shake[i]).clamp(0.0, room[i]));
            let new = shake_px * (1.0 - SHAKE_CORRELATION * SHAKE_CORRELATION).sqrt();
            shake = shake.map(|s| SHAKE_CORRELATION * s + new * rng.sample::<f64, _>(StandardNormal));
        }
        Path { corner_px, followed_px }
    }
}

/// A constant speed from a place drawn, turned around at the room's edges.
fn turning(speed: [f64; 2], room: [f64; 2], n: usize, rng: &mut ChaCha8Rng) -> Vec<[f64; 2]> {
    let start = room.map(|r| r * rng.random::<f64>());
    let at = |t: i64, i: usize| {
        let v = (start[i] + speed[i] * t as f64).rem_euclid(2.0 * room[i]);
        v.min(2.0 * room[i] - v)
    };
    let mean = |t: i64, i: usize| {
        let sum: f64 = (-TURN_FRAMES..=TURN_FRAMES).map(|k| at(t + k, i)).sum();
        sum / (2 * TURN_FRAMES + 1) as f64
    };
    (0..n as i64).map(|t| [mean(t, 0), mean(t, 1)]).collect()
}

/// A curved way that stays in the room: a swing on each axis, `speed` at most.
fn wander(speed: f64, room: [f64; 2], n: usize, rng: &mut ChaCha8Rng) -> Vec<[f64; 2]> {
    let angle: f64 = rng.random_range(0.3..1.2);
    let shares = [angle.cos(), angle.sin()];
    let swings = [0, 1].map(|i| {
        let reach = 0.5 * room[i] * rng.random_range(0.5..0.95);
        (reach, speed * shares[i] / reach, rng.random_range(0.0..std::f64::consts::TAU))
    });
    let at = |t: usize, i: usize| {
        let (reach, rate, phase) = swings[i];
        0.5 * room[i] + reach * (rate * t as f64 + phase).sin()
    };
    (0..n).map(|t| [at(t, 0), at(t, 1)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn the_window_stays_in_its_room_and_goes_at_its_speed() {
        let room = [310.0, 120.0];
        for seed in 0..40 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let motions =
                [Motion::Still, Motion::Drift(1.0), Motion::Pan(6.0), Motion::Shake(2.5), Motion::Follow(4.0)];
            for motion in motions {
                let path = motion.path(room, 300, &mut rng);
                assert_eq!(path.corner_px.len(), 300);
                let inside = |c: &[f64; 2]| (0..2).all(|i| (0.0..=room[i]).contains(&c[i]));
                assert!(path.corner_px.iter().all(inside), "{motion:?}");
                assert!(path.followed_px.iter().flatten().all(inside), "{motion:?}");
                if let Motion::Pan(v) = motion {
                    let steps = path.corner_px.windows(2).map(|c| (c[1][0] - c[0][0]).hypot(c[1][1] - c[0][1]));
                    let mut steps: Vec<f64> = steps.collect();
                    steps.sort_by(f64::total_cmp);
                    // Half of the steps lie within the shake of the speed: turns are the rare ones.
                    assert!((steps[150] - v).abs() < 0.3, "{}", steps[150]);
                }
            }
        }
    }
}
