//! The box of a dark target and the window to look for it in the next frame.
//!
//! Source: `docs/theory/segmentation.md` (F. Cai, J. Cui 2014, corrected). One stray dark pixel ruins a box that is
//! taken over a whole frame, so the box is taken inside a window around the predicted centre. Δ = d(t-1) - d(t-2), the
//! last displacement per axis.

use super::pixel::Pixel;
use super::probability::PixelRect;
use crate::validate::wrong;
use crate::{Detection, Image, Result};
use nalgebra::Vector2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

impl PixelRect {
    /// The whole image, or `None` for an empty one.
    pub fn of_image<T: Copy>(image: &Image<T>) -> Option<Self> {
        Some(Self { left: 0, top: 0, right: image.width().checked_sub(1)?, bottom: image.height().checked_sub(1)? })
    }

    /// Middle, px.
    pub fn centre(&self) -> Vector2<f64> {
        Vector2::new((self.left + self.right) as f64 / 2.0, (self.top + self.bottom) as f64 / 2.0)
    }

    /// Half the differences of the sides, px.
    pub fn semi_size(&self) -> Vector2<f64> {
        Vector2::new((self.right - self.left) as f64 / 2.0, (self.bottom - self.top) as f64 / 2.0)
    }
}

/// Returns the smallest box around all pixels of `window` with value <= `level` (or < if `exclusive`); `None` without any.
pub fn dark_box<T: Pixel>(image: &Image<T>, level: f64, exclusive: bool, window: PixelRect) -> Option<PixelRect> {
    let dark = |p: &T| if exclusive { p.value() < level } else { p.value() <= level };
    let mut found: Option<PixelRect> = None;
    for y in window.top..=window.bottom.min(image.height().checked_sub(1)?) {
        let row = image.row(y);
        let part = row.get(window.left..=window.right.min(row.len().checked_sub(1)?))?;
        let Some(first) = part.iter().position(dark) else { continue };
        let last = part.iter().rposition(dark).unwrap_or(first);
        let (left, right) = (window.left + first, window.left + last);
        let all = found.get_or_insert(PixelRect { left, top: y, right, bottom: y });
        all.left = all.left.min(left);
        all.right = all.right.max(right);
        all.bottom = y;
    }
    found
}

/// Returns the window to search: half sizes = the box's + |Δ| + margin around the prediction, clipped to the image.
///
/// `None` if it lies wholly outside.
pub fn search_window(
    predicted: Vector2<f64>,
    semi_size: Vector2<f64>,
    displacement: Vector2<f64>,
    margin_px: f64,
    (width, height): (usize, usize),
) -> Option<PixelRect> {
    let side = |axis: usize, n: usize| {
        let half = semi_size[axis] + displacement[axis].abs() + margin_px;
        let (low, high) = ((predicted[axis] - half).floor(), (predicted[axis] + half).ceil());
        // Casts saturate; NaN fails the comparison.
        (low <= high && high >= 0.0 && low < n as f64 && n > 0)
            .then(|| (low.max(0.0) as usize, (high as usize).min(n - 1)))
    };
    let ((left, right), (top, bottom)) = (side(0, width)?, side(1, height)?);
    Some(PixelRect { left, top, right, bottom })
}

/// How a single target is followed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct FollowConfig {
    /// Margin around the predicted box, px, 0...; it grows with every frame in which the target is missed.
    pub margin_px: f64,
    /// Frames without the target after which the whole frame is searched again, 1... .
    pub max_missed: u32,
}

impl Default for FollowConfig {
    fn default() -> Self {
        Self { margin_px: 5.0, max_missed: 10 }
    }
}

impl FollowConfig {
    /// Checks every parameter; `at` is the path of this table.
    /// # Errors
    /// The first parameter out of its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        if !(self.margin_px >= 0.0 && self.margin_px.is_finite()) {
            return Err(wrong(at, "margin-px", self.margin_px, "0 px or more", "5 px allows for a change of course"));
        }
        if self.max_missed == 0 {
            return Err(wrong(at, "max-missed", 0, "at least 1 frame", "10 frames bridge a short gap"));
        }
        Ok(())
    }
}

/// Keeps of each frame's detections the largest whose box reaches into the search window.
///
/// The place is predicted with the last displacement (coordinates extrapolated by `[2 -1]`).
#[derive(Clone, Debug)]
pub struct Follower {
    config: FollowConfig,
    /// Last place, displacement and half size.
    last: Option<(Vector2<f64>, Vector2<f64>, Vector2<f64>)>,
    missed: u32,
}

impl Follower {
    /// Builds a follower that has seen nothing.
    pub fn new(config: FollowConfig) -> Self {
        Self { config, last: None, missed: 0 }
    }

    /// The window for the next frame, or `None` while the whole frame is searched.
    pub fn window(&self, size: (usize, usize)) -> Option<PixelRect> {
        let (place, displacement, semi) = self.last?;
        let frames = f64::from(self.missed + 1);
        search_window(place + displacement * frames, semi, displacement, self.config.margin_px * frames, size)
    }

    /// Leaves the target alone in `detections`.
    pub fn pick(&mut self, detections: &mut Vec<Detection>, size: (usize, usize)) {
        if let Some(w) = self.window(size) {
            detections.retain(|d| {
                let e = &d.extent;
                e.left_px <= w.right as f64
                    && e.left_px + e.width_px >= w.left as f64
                    && e.top_px <= w.bottom as f64
                    && e.top_px + e.height_px >= w.top as f64
            });
        }
        // The first of the largest.
        let best =
            detections.iter().enumerate().max_by_key(|(i, d)| (d.area_px, std::cmp::Reverse(*i))).map(|(i, _)| i);
        let Some(best) = best else {
            self.missed += 1;
            if self.missed > self.config.max_missed {
                (self.last, self.missed) = (None, 0);
            }
            return;
        };
        detections.swap(0, best);
        detections.truncate(1);
        let found = &detections[0];
        let displacement =
            self.last.map_or(Vector2::zeros(), |(place, _, _)| (found.position - place) / f64::from(self.missed + 1));
        let semi = Vector2::new(found.extent.width_px - 1.0, found.extent.height_px - 1.0) / 2.0;
        self.last = Some((found.position, displacement, semi));
        self.missed = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stray_dark_pixel_outside_the_window_does_not_count() {
        let mut image = Image::filled(20, 20, 200u8);
        image.row_mut(0)[0] = 10;
        image.row_mut(10)[11] = 10;
        image.row_mut(11)[12] = 150;
        let window =
            search_window(Vector2::new(11.0, 11.0), Vector2::new(1.0, 1.0), Vector2::zeros(), 2.0, (20, 20)).unwrap();
        assert_eq!(window, PixelRect { left: 8, top: 8, right: 14, bottom: 14 });
        let found = dark_box(&image, 150.0, false, window).unwrap();
        assert_eq!((found.centre(), found.semi_size()), (Vector2::new(11.5, 10.5), Vector2::new(0.5, 0.5)));
        // The paper's text, "less than 150", leaves the pixel on the level out; its program does not.
        assert_eq!(dark_box(&image, 150.0, true, window).unwrap().centre(), Vector2::new(11.0, 10.0));
        assert_eq!(dark_box(&image, 150.0, false, PixelRect::of_image(&image).unwrap()).unwrap().left, 0);
    }

    #[test]
    fn a_window_outside_the_image_is_none() {
        let away = |x: f64| search_window(Vector2::new(x, 3.0), Vector2::zeros(), Vector2::zeros(), 1.0, (10, 10));
        assert!(away(-5.0).is_none() && away(12.0).is_none() && away(f64::NAN).is_none());
        assert_eq!(away(10.5).unwrap().left, 9);
        assert!(search_window(Vector2::zeros(), Vector2::zeros(), Vector2::zeros(), 1.0, (0, 4)).is_none());
    }
}
