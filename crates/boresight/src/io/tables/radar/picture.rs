//! What a radar's table says beside its plots: where the radar was, how far it looks, how fast its antenna turns.

use crate::length_unit::LengthUnit;

/// Where a radar was and how it looks.
#[derive(Clone, Debug, PartialEq)]
pub struct RadarPicture {
    /// Unit of ranges and positions.
    pub unit: LengthUnit,
    /// Time (s) and position (x east, y north) of the radar, in order of time; one entry where it stands still.
    pub own_path: Vec<[f64; 3]>,
    /// Time of a turn of the antenna, or between scans, s.
    pub turn_s: f64,
    /// Longest range of a plot.
    pub longest_range: f64,
}

impl RadarPicture {
    /// Where the radar is at `time_s`: straight between the entries of its path, the nearest one beyond its ends.
    pub fn own_at(&self, time_s: f64) -> [f64; 2] {
        along(&self.own_path, time_s)
    }
}

/// The position of a path `[t, x, y]` at a time: straight in between, the nearest entry beyond its ends, (0, 0) of an empty one.
pub(crate) fn along(path: &[[f64; 3]], time_s: f64) -> [f64; 2] {
    let after = path.partition_point(|p| p[0] <= time_s);
    match (after.checked_sub(1).and_then(|i| path.get(i)), path.get(after)) {
        (Some(a), Some(b)) => {
            let s = (time_s - a[0]) / (b[0] - a[0]);
            [a[1] + s * (b[1] - a[1]), a[2] + s * (b[2] - a[2])]
        }
        (Some(p), None) | (None, Some(p)) => [p[1], p[2]],
        (None, None) => [0.0, 0.0],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_path_is_straight_between_its_entries_and_stands_beyond_them() {
        let path = [[0.0, 0.0, 10.0], [2.0, 4.0, 20.0]];
        assert_eq!(along(&path, 0.5), [1.0, 12.5]);
        assert_eq!((along(&path, -1.0), along(&path, 9.0), along(&[], 1.0)), ([0.0, 10.0], [4.0, 20.0], [0.0, 0.0]));
    }
}
