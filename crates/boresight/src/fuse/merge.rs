//! Detections of several sensors become one sequence of scans for one tracker: fusion at the level of measurements for many targets.
//!
//! Each sensor's scans are brought into the common frame of reference and clock and then sorted by time: the tracker corrects its
//! tracks scan after scan with each sensor's own covariance (sequential fusion). Reports that came late are thereby in order.
//! Scans of one time stay apart, in the order of the sensors. Frames are numbered anew. Units: px (or m), s.

use super::plane::PlaneMap;
use super::registration::Registration;
use crate::{FrameIndex, Scan, Timestamp};
use nalgebra::{Rotation2, Vector2};

/// One sensor's detections and how they come into the common frame.
#[derive(Clone, Debug)]
pub struct SensorScans<'a> {
    /// Its scans, in order of time.
    pub scans: &'a [Scan],
    /// Its frame of reference.
    pub map: PlaneMap,
    /// Its registration, applied after the map.
    pub registration: Registration,
}

impl Registration {
    /// Brings a detection of the second sensor into the first one's frame.
    fn detection(&self, d: &crate::Detection) -> crate::Detection {
        let rot = *Rotation2::new(self.rotation_rad).matrix();
        let c = Vector2::from(self.centre_px);
        let mut out = d.clone();
        out.position = rot * (d.position - c) + c + Vector2::from(self.offset_px);
        out.cov = rot * d.cov * rot.transpose();
        out.extent.left_px += out.position.x - d.position.x;
        out.extent.top_px += out.position.y - d.position.y;
        out
    }
}

/// Merges the sensors' scans; also says for each merged scan which sensor it is of.
pub fn merge_scans(sensors: &[SensorScans<'_>]) -> (Vec<Scan>, Vec<usize>) {
    let mut all: Vec<(Timestamp, usize, Scan)> = Vec::new();
    for (i, s) in sensors.iter().enumerate() {
        for scan in s.scans {
            let time = Timestamp::from_secs_f64(scan.time.as_secs_f64() - s.registration.time_s);
            let time = if s.registration.time_s == 0.0 { scan.time } else { time };
            let detections = scan
                .detections
                .iter()
                .filter_map(|d| s.map.detection(d))
                .map(|d| s.registration.detection(&d))
                .collect();
            all.push((time, i, Scan::at(FrameIndex::default(), time).with_detections(detections)));
        }
    }
    all.sort_by_key(|(time, i, _)| (*time, *i));
    let order = all.iter().map(|(_, i, _)| *i).collect();
    let number = |(k, (_, _, scan)): (usize, (_, _, Scan))| Scan { index: FrameIndex(k as u64), ..scan };
    (all.into_iter().enumerate().map(number).collect(), order)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Detection, Extent};
    use nalgebra::Matrix2;

    fn scans(times: &[f64], x: f64) -> Vec<Scan> {
        let d = Detection::at(Vector2::new(x, 0.0), Matrix2::new(4.0, 0.0, 0.0, 1.0))
            .with_extent(Extent { left_px: x - 1.0, top_px: -1.0, width_px: 2.0, height_px: 2.0 })
            .with_area_px(4);
        let one =
            |t: &f64| Scan::at(FrameIndex::default(), Timestamp::from_secs_f64(*t)).with_detections(vec![d.clone()]);
        times.iter().map(one).collect()
    }

    #[test]
    fn scans_come_in_order_of_the_common_clock_and_in_the_common_frame() {
        let (a, b) = (scans(&[0.0, 1.0, 2.0], 5.0), scans(&[0.5, 1.5, 2.5], 3.0));
        let quarter = Registration { rotation_rad: std::f64::consts::FRAC_PI_2, time_s: 0.5, ..Registration::IDENTITY };
        let double = PlaneMap::from_rows(&[2.0, 0.0, 0.0, 0.0, 2.0, 0.0]).unwrap();
        let (all, of) = merge_scans(&[
            SensorScans { scans: &a, map: PlaneMap::IDENTITY, registration: Registration::IDENTITY },
            SensorScans { scans: &b, map: double, registration: quarter },
        ]);
        assert_eq!(of, [0, 1, 0, 1, 0, 1], "one clock behind the other: the same times, sensors in order");
        assert_eq!(all.iter().map(|s| s.index.0).collect::<Vec<_>>(), [0, 1, 2, 3, 4, 5]);
        let d = &all[1].detections[0];
        assert!((d.position - Vector2::new(0.0, 6.0)).norm() < 1e-12);
        assert!((d.cov - Matrix2::new(4.0, 0.0, 0.0, 16.0)).amax() < 1e-12);
        assert!((d.extent.left_px - -2.0).abs() < 1e-12 && d.extent.width_px == 4.0);
    }
}
