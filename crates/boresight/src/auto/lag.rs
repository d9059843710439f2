//! The lag of steadied movers, by what the first pass shows of them: a target shows whole once it has moved by about its own size.
//!
//! Source: our own. In less time an even target shows the rims only that it covers and uncovers, and one that moves by less than half of its size in the lag shows both: the
//! place it has left is then a second track beside it. A rim is as thick as its target moves in the lag, whatever the target's size, so detections that are thicker than that way say
//! that the lag is too short, and it is doubled.
//! Symbols: a thickness is area over longer side of the box, px; the way that of a chain from a detection to its first one a lag later, on steady ground, px.
//! Limits: what is long and thin and moves along itself is as thick as it is thin; what is too slow for [`LONGEST_S`] keeps its rims.

use super::digits::round;
use super::evidence::Evidence;
use crate::Scan;
use crate::camera::CameraPath;
use crate::tempo::Tempo;
use crate::vision::steadied::SECOND_LAG;
use nalgebra::Vector2;

/// Thickness over way of a disc that moves by just its own diameter: thicker ones, in the median, move by less than their size.
const WHOLE: f64 = std::f64::consts::FRAC_PI_4;
/// The lag is doubled up to this, s of video: frames of four and a half seconds are kept then.
const LONGEST_S: f64 = 1.28;
/// The frames read ahead last so many lags at least: in the first four or so, later frames stand in.
const LEAST_LAGS: f64 = 8.0;
/// Share of the present frame that the older of the two compared with must show, in the mean: nothing is seen in the rest.
const LEAST_COVERED: f64 = 0.5;
/// Of fewer ways the median is not known.
const LEAST_WAYS: usize = 20;

/// The lag to look with in the place of `lag_s`, s, with the reason, if the targets in the scans made with that are too large for it; `shown` is the evidence of these scans, `size_px`
/// the frame's size.
pub(super) fn longer(scans: &[Scan], shown: &Evidence, lag_s: f64, size_px: [f64; 2]) -> Option<(f64, String)> {
    let longer_s = round(2.0 * lag_s);
    let lasts_s = scans.last()?.time.seconds_since(scans[0].time);
    let longest_s = Tempo::of_scans(scans).stretched(LONGEST_S);
    if longer_s > longest_s
        || lasts_s < LEAST_LAGS * longer_s
        || covered(scans, SECOND_LAG * longer_s, size_px) < LEAST_COVERED
    {
        return None;
    }
    let share = thickness_of_way(shown, lag_s)?;
    (share > WHOLE).then(|| {
        let words = format!(
            "Within {lag_s} s what moves goes on by {:.1} times its thickness only: steadied frames twice as long ago are compared with, which show it whole.",
            1.0 / share
        );
        (longer_s, words)
    })
}

/// Share of a frame that one so long ago shows as well, in the mean, by how far the camera came since.
fn covered(scans: &[Scan], ago_s: f64, size_px: [f64; 2]) -> f64 {
    let mut path = CameraPath::default();
    let places: Vec<Vector2<f64>> = scans
        .iter()
        .map(|s| {
            path.step(s.camera_motion.as_ref());
            path.place_px
        })
        .collect();
    let (mut sum, mut n, mut before) = (0.0, 0usize, 0);
    for (i, scan) in scans.iter().enumerate() {
        before += scans[before..i].iter().take_while(|s| scan.time.seconds_since(s.time) > ago_s).count();
        if scan.time.seconds_since(scans[0].time) >= ago_s {
            let far = places[i] - places[before];
            sum += (0..2).map(|axis| (1.0 - far[axis].abs() / size_px[axis]).max(0.0)).product::<f64>();
            n += 1;
        }
    }
    sum / n.max(1) as f64
}

/// Median thickness of the detections in chains that move, as a share of the way that their chain goes in a lag.
fn thickness_of_way(evidence: &Evidence, lag_s: f64) -> Option<f64> {
    let mut shares = Vec::new();
    for chain in &evidence.moving {
        let time_s = |i: usize| evidence.times_s[chain.hits[i].0];
        let mut later = 0;
        for (i, (_, seen)) in chain.hits.iter().enumerate() {
            later += (later..chain.hits.len()).take_while(|l| time_s(*l) < time_s(i) + lag_s).count();
            let Some((_, then)) = chain.hits.get(later) else { break };
            let way_px = (then.at - seen.at).norm() * lag_s / (time_s(later) - time_s(i));
            shares.push(seen.thickness_px / way_px);
        }
    }
    if shares.len() < LEAST_WAYS {
        return None;
    }
    let middle = shares.len() / 2;
    Some(*shares.select_nth_unstable_by(middle, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CameraMotion, Detection, Extent, FrameIndex, Timestamp};
    use nalgebra::Matrix2;

    /// What is said of boxes of this size (px), half of them filled, that go 2 px to the right in each of `n` frames of 40 ms, on ground that goes so many px to the left; the lag is
    /// 0.32 s, 16 px.
    fn said_on(n: u64, size: [f64; 2], ground: f64) -> Option<f64> {
        let motion = CameraMotion::exact_shift(Vector2::new(-ground, 0.0));
        let scans: Vec<Scan> = (0..n)
            .map(|k| {
                let at = Vector2::new(20.0 + (2.0 - ground) * k as f64, 50.0);
                let d = Detection::at(at, Matrix2::identity() * 0.1).with_extent(Extent::around(at, size[0], size[1]));
                let d = d.with_area_px((0.5 * size[0] * size[1]) as u32);
                Scan::at(FrameIndex(k), Timestamp::from_secs_f64(0.04 * k as f64))
                    .with_detections(vec![d])
                    .with_camera_motion(Some(motion))
            })
            .collect();
        let size_px = [400.0, 100.0];
        longer(&scans, &Evidence::of_scans(&scans, size_px[0] * size_px[1]), 0.32, size_px).map(|l| l.0)
    }

    fn said(n: u64, size: [f64; 2]) -> Option<f64> {
        said_on(n, size, 0.0)
    }

    #[test]
    fn what_is_thicker_than_its_way_is_looked_at_with_twice_the_lag() {
        // Thickness: half of the shorter side. π/4 of the way is 12.6 px.
        assert_eq!(said(150, [24.0, 40.0]), None);
        assert_eq!(said(150, [28.0, 40.0]), Some(0.64));
        assert_eq!(said(100, [28.0, 40.0]), None, "4 s are too short");
        assert_eq!(said(150, [28.0, 14.0]), None, "7 px thick");
    }

    #[test]
    fn a_frame_that_shows_too_little_of_the_present_one_is_of_no_use() {
        // In 3 · 0.64 s the camera comes 48 px a px and frame: 192 and 240 of 400 px.
        assert_eq!(said_on(150, [28.0, 40.0], 4.0), Some(0.64));
        assert_eq!(said_on(150, [28.0, 40.0], 5.0), None);
    }
}
