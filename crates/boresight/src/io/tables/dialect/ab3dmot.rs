//! Detections on KITTI as AB3DMOT ships them: frame, class, x1, y1, x2, y2, score, size, location, rotation, alpha; fifteen numbers.
//!
//! Source: X. Weng, J. Wang, D. Held, K. Kitani, *3D Multi-Object Tracking: A Baseline and New Evaluation Metrics*, IROS 2020, and the files of its repository.
//! Separated by commas; frames and pixels count from 0; classes are 1 pedestrian, 2 car, 3 cyclist; scores are logits. Its results are KITTI labels (`kitti`).
//! Limits: the box in the image is used, the box in space is not read.

use crate::io::tables::columns::{Field, Layout};

/// Columns of a row.
const COLUMNS: usize = 15;

/// Where the columns stand.
pub(crate) fn layout() -> Layout {
    use Field::{Bottom, Class, Frame, Left, Right, Score, Top};
    Layout::fixed([Frame, Class, Left, Top, Right, Bottom, Score].into_iter().zip(0..))
}

/// Whether a first line of these numbers is one: so many, a class, and corners in order. MOTChallenge has ten at most.
pub(crate) fn looks_like(numbers: &[Option<f64>]) -> bool {
    let [_, Some(class), Some(left), Some(top), Some(right), Some(bottom), ..] = *numbers else { return false };
    numbers.len() == COLUMNS && (1.0..=9.0).contains(&class) && class.fract() == 0.0 && left < right && top < bottom
}

#[cfg(test)]
mod tests {
    use super::looks_like;

    #[test]
    fn corners_and_a_class_are_told_from_sizes_and_an_identity() {
        let of = |text: &str| looks_like(&text.split(',').map(|f| f.parse().ok()).collect::<Vec<_>>());
        assert!(of("0,2,100,50,140,80,5.5,1.4,1.6,4.4,-4.1,1.8,30.8,0.03,0.16"));
        // A box of 40 x 30 at (100, 50), as MOTChallenge has it, with columns of somebody's own.
        assert!(!of("1,-1,100,50,40,30,0.9,-1,-1,-1,0,0,0,0,0"));
        assert!(!of("1,-1,100,50,40,30,0.9,-1,-1,-1"));
    }
}
