//! What a camera did over a sequence of scans: how far it came, and how often its view was lost.
//!
//! Limits: a scan whose shift is unknown adds nothing to the length of the path; if the background was followed before, it counts as a cut.

use nalgebra::Vector2;

/// What the camera did so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CameraPath {
    /// Length of the background's path in the image, px.
    pub length_px: f64,
    /// Times that a background which was followed for some scans was lost: another view, or a jerk.
    pub cuts: u32,
    followed: u32,
}

impl CameraPath {
    /// Scans that a background must have been followed before its loss is a cut.
    const FOLLOWED: u32 = 10;

    /// Takes the next scan's shift at the image's middle in, px; `None` where it was not measured.
    pub fn step(&mut self, shift_px: Option<Vector2<f64>>) {
        match shift_px.map(|s| s.norm()).filter(|length| length.is_finite()) {
            Some(length) => {
                self.length_px += length;
                self.followed = self.followed.saturating_add(1);
            }
            None => {
                self.cuts = self.cuts.saturating_add(u32::from(self.followed >= Self::FOLLOWED));
                self.followed = 0;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_loss_is_a_cut_only_after_ten_scans_that_were_followed() {
        let mut path = CameraPath::default();
        (0..9).for_each(|_| path.step(Some(Vector2::new(3.0, -4.0))));
        path.step(None);
        assert_eq!((path.length_px, path.cuts), (45.0, 0));
        (0..10).for_each(|_| path.step(Some(Vector2::zeros())));
        path.step(Some(Vector2::new(f64::NAN, 0.0)));
        path.step(None);
        assert_eq!((path.length_px, path.cuts), (45.0, 1), "what is not finite is unknown; a view is lost once");
    }
}
