//! Whether the camera stays in its place but shakes or nods, by the motions from frame to frame.
//!
//! Source: our own. A camera that shakes comes back, one that pans goes on: of the variance of where the view's middle lies, a straight line in time explains little or most.
//! Limits: a nod that takes longer than the frames looked at is a pan.

use crate::Homography;
use nalgebra::Vector2;

/// The farthest that a corner of the view lies from where it lay first, as a share of the width: with more than that little would be left of the view.
const MOST_SHARE: f64 = 0.05;
/// Share of the variance that a straight line explains, from which on the camera pans: of a slow nod, half a period of which is seen, it explains all but a hundredth, of a whole period 0.6.
const DRIFT: f64 = 0.5;
/// Deviation of the view's middle, px, with which a camera stands: an edge seems to move when it is half a pixel away.
pub(super) const LEAST_PX: f64 = 0.3;
/// Fewer frames than this tell neither.
pub(super) const LEAST_FRAMES: usize = 12;

/// Whether the camera of frames of `size` px shakes, by the motions from each frame to the next.
pub fn shakes(steps: &[Homography], size: (usize, usize)) -> bool {
    let size = Vector2::new(size.0 as f64, size.1 as f64);
    let mut at = Homography::identity();
    let places: Vec<Homography> = steps
        .iter()
        .map(|step| {
            at = at.then(step);
            at
        })
        .collect();
    places.len() >= LEAST_FRAMES
        && places.iter().all(|place| is_near(place, size))
        && rms_px(&places, size) > LEAST_PX
        && drift(&places, 0.5 * size) <= DRIFT
}

/// Whether the view lies near where it lay first.
pub fn is_near(place: &Homography, size: Vector2<f64>) -> bool {
    let corners = [[0.0, 0.0], [size.x, 0.0], [0.0, size.y], [size.x, size.y]].map(Vector2::from);
    place.is_sound() && corners.iter().all(|c| place.shift_at(*c).norm() <= MOST_SHARE * size.x)
}

/// Deviation of the middle from its mean place, px.
pub fn rms_px(places: &[Homography], size: Vector2<f64>) -> f64 {
    let shifts: Vec<Vector2<f64>> = places.iter().map(|h| h.shift_at(0.5 * size)).collect();
    let n = shifts.len().max(1) as f64;
    let mean = shifts.iter().sum::<Vector2<f64>>() / n;
    (shifts.iter().map(|s| (s - mean).norm_squared()).sum::<f64>() / n).sqrt()
}

/// Share of the variance of the middle's places that a straight line in time explains.
fn drift(places: &[Homography], middle: Vector2<f64>) -> f64 {
    let n = places.len() as f64;
    let shifts: Vec<Vector2<f64>> = places.iter().map(|h| h.shift_at(middle)).collect();
    let mean = shifts.iter().sum::<Vector2<f64>>() / n;
    let (mut own, mut of_time, mut both) = (0.0, 0.0, Vector2::zeros());
    for (k, s) in shifts.iter().enumerate() {
        let (t, s) = (k as f64 - 0.5 * (n - 1.0), s - mean);
        own += s.norm_squared();
        of_time += t * t;
        both += t * s;
    }
    both.norm_squared() / (own * of_time).max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Steps between places along x.
    fn steps(place: impl Fn(f64) -> f64) -> Vec<Homography> {
        let step = |k: usize| if k == 0 { 0.0 } else { place(k as f64) - place(k as f64 - 1.0) };
        (0..48).map(|k| Homography::shift(Vector2::new(step(k), 0.0))).collect()
    }

    #[test]
    fn what_comes_back_shakes_and_what_goes_on_does_not() {
        let shakes = |place: &dyn Fn(f64) -> f64| shakes(&steps(place), (320, 256));
        assert!(shakes(&|k| 5.0 * (1.7 * k).sin()), "a fast shake");
        assert!(shakes(&|k| 5.0 * (k * std::f64::consts::TAU / 24.0).sin()), "a nod of a second");
        assert!(!shakes(&|_| 0.0) && !shakes(&|k| 0.3 * (1.7 * k).sin()), "a camera at rest");
        assert!(!shakes(&|k| 0.2 * k), "a pan");
        assert!(!shakes(&|k| 0.2 * k + (1.7 * k).sin()), "a pan that shakes");
        assert!(!shakes(&|k| 20.0 * (1.7 * k).sin()), "a shake that leaves the view");
        let place = |k: i32| Homography::shift(Vector2::new(5.0 * (1.7 * f64::from(k)).sin(), 0.0));
        let places: Vec<Homography> = (0..480).map(place).collect();
        assert!((rms_px(&places, Vector2::new(320.0, 256.0)) - 5.0 / 2f64.sqrt()).abs() < 0.1);
    }
}
