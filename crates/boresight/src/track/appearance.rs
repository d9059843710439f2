//! What a track looks like: smoothed size and intensity, and its class.
//!
//! Method: exponential smoothing with the gain `appearance-gain`; the class is that of the newest detection that has one.
//! Limits: nothing of the image itself is kept.

use crate::{ClassId, Detection};

/// What a track looks like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Appearance {
    /// Smoothed width and height, px.
    pub size: [f64; 2],
    /// Smoothed sum of the pixels.
    pub sum: f64,
    /// Class of the newest detection that had one.
    pub class: Option<ClassId>,
}

impl Appearance {
    /// Appearance of a detection.
    pub fn of(d: &Detection) -> Self {
        Self { size: [d.extent.width_px, d.extent.height_px], sum: d.sum, class: d.class }
    }

    /// Follows a new detection with gain `gain` (0..=1).
    #[inline]
    pub fn follow(&mut self, d: &Detection, gain: f64) {
        self.size[0] += gain * (d.extent.width_px - self.size[0]);
        self.size[1] += gain * (d.extent.height_px - self.size[1]);
        self.sum += gain * (d.sum - self.sum);
        if d.class.is_some() {
            self.class = d.class;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Extent;
    use nalgebra::{Matrix2, Vector2};

    #[test]
    fn size_and_sum_go_a_share_of_the_way_and_the_class_is_the_newest() {
        let at = Vector2::zeros();
        let d = |w, h| Detection::at(at, Matrix2::identity()).with_extent(Extent::around(at, w, h));
        let mut a = Appearance::of(&Detection { sum: 10.0, class: Some(ClassId(1)), ..d(8.0, 4.0) });
        assert_eq!(a, Appearance { size: [8.0, 4.0], sum: 10.0, class: Some(ClassId(1)) });
        a.follow(&Detection { sum: 30.0, class: None, ..d(12.0, 2.0) }, 0.25);
        assert_eq!(a, Appearance { size: [9.0, 3.5], sum: 15.0, class: Some(ClassId(1)) });
        a.follow(&Detection { sum: 15.0, class: Some(ClassId(3)), ..d(9.0, 3.5) }, 0.25);
        assert_eq!(a, Appearance { size: [9.0, 3.5], sum: 15.0, class: Some(ClassId(3)) });
    }
}
