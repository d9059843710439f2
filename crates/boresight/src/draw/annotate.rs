//! What is drawn on a frame: detections, tracks with box, number, fading trail and 95 % ellipse, and a line of facts.
//!
//! Confirmed tracks have a solid box, coasting ones a dashed box, tentative ones a thin dashed box without a number.
//! Ellipses hold the true position with 95 %: k² = 5.991, the chi-square quantile with 2 degrees of freedom.

use super::canvas::{Canvas, Pen, Rgb};
use super::palette::track_colour;
use super::text::Lettering;
use super::tone::{Tone, legible_scale};
use crate::{CameraMotion, Error, ErrorKind, Image, Result, Timestamp, TrackId, TrackState, TrackStatus, View};
use nalgebra::Vector2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, VecDeque};

/// Standard deviations of the 95 % ellipse: sqrt(5.991), chi-square, 2 degrees of freedom.
const SIGMAS_95: f64 = 2.4477;
/// Most points of a trail; older ones are dropped.
const MAX_TRAIL: usize = 512;

/// What is drawn, and how.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct DrawOptions {
    /// Enlargement of the picture, whole number, 1..=8; 0 chooses one at which numbers can be read.
    pub scale: u32,
    /// Length of the trails, s, 0..=3600; 0 draws none.
    pub trail_s: f64,
    /// Whether detections are marked with a small cross.
    pub detections: bool,
    /// Whether tracks that are not confirmed yet are drawn.
    pub tentative: bool,
    /// Whether the 95 % ellipse of the position is drawn.
    pub ellipses: bool,
    /// Whether boxes are drawn.
    pub boxes: bool,
    /// Whether track numbers are drawn.
    pub labels: bool,
    /// Whether a line with frame, time and number of tracks is drawn at the top.
    pub caption: bool,
}

impl Default for DrawOptions {
    fn default() -> Self {
        Self {
            scale: 0,
            trail_s: 2.0,
            detections: true,
            tentative: true,
            ellipses: true,
            boxes: true,
            labels: true,
            caption: true,
        }
    }
}

impl DrawOptions {
    /// Checks the values.
    /// # Errors
    /// [`ErrorKind::Config`] with the key, its value and what is expected.
    pub fn validate(&self, at: &str) -> Result<()> {
        if self.scale > 8 {
            return Err(Error::new(ErrorKind::Config, "expected a whole number from 0 to 8")
                .at(format!("{at}.scale = {}", self.scale))
                .hint("0 chooses an enlargement at which track numbers can be read"));
        }
        if !(0.0..=3600.0).contains(&self.trail_s) {
            return Err(Error::new(ErrorKind::Config, "expected seconds from 0 to 3600")
                .at(format!("{at}.trail-s = {}", self.trail_s))
                .hint("2 shows where a target has come from without hiding the picture"));
        }
        Ok(())
    }
}

/// Where a track was, px, oldest first.
type Trail = VecDeque<(Timestamp, (f64, f64))>;

/// Draws views, one after the other; remembers the trails and the brightness.
pub struct Annotator {
    options: DrawOptions,
    tone: Tone,
    lettering: Option<(f32, Lettering)>,
    trails: BTreeMap<TrackId, Trail>,
    points: Vec<(f64, f64)>,
}

opaque_debug!(Annotator);

/// From image to canvas coordinates.
#[derive(Clone, Copy)]
struct Zoom(f64);

impl Zoom {
    fn point(self, x: f64, y: f64) -> (f64, f64) {
        ((x + 0.5) * self.0 - 0.5, (y + 0.5) * self.0 - 0.5)
    }
}

impl Annotator {
    /// Starts with empty trails.
    /// # Errors
    /// [`ErrorKind::Config`] if an option is out of range.
    pub fn new(options: DrawOptions) -> Result<Self> {
        options.validate("draw")?;
        Ok(Self { options, tone: Tone::default(), lettering: None, trails: BTreeMap::new(), points: Vec::new() })
    }

    /// Draws a view into `out`, which is made as large as needed.
    /// # Errors
    /// [`ErrorKind::Output`] if the view has no frame to draw on.
    pub fn draw(&mut self, view: &View<'_>, out: &mut Image<Rgb>) -> Result<()> {
        let frame = view.frame.ok_or_else(|| {
            Error::new(ErrorKind::Output, "there is no picture to draw on")
                .at(format!("frame {}", view.scan.index.0))
                .hint("give the frames beside the table of detections, or leave pictures out")
        })?;
        let scale = match self.options.scale {
            0 => legible_scale(frame.pixels.width(), frame.pixels.height()),
            n => n as usize,
        };
        self.tone.render(&frame.pixels, scale, out);
        self.remember(view);
        let height = out.height() as f32;
        let size_px = (height / 60.0).clamp(13.0, 32.0).round();
        if self.lettering.as_ref().is_none_or(|(s, _)| *s != size_px) {
            self.lettering = Some((size_px, Lettering::new(size_px)?));
        }
        let width_px = (height / 700.0).clamp(1.0, 3.0);
        let mut canvas = Canvas::new(out);
        let zoom = Zoom(scale as f64);
        if self.options.detections {
            let arm = f64::from(width_px) * 3.0;
            let pen = Pen { alpha: 0.8, ..Pen::solid([255, 255, 255], width_px) };
            for d in &view.scan.detections {
                let (x, y) = zoom.point(d.position.x, d.position.y);
                canvas.line((x - arm, y), (x + arm, y), &pen);
                canvas.line((x, y - arm), (x, y + arm), &pen);
            }
        }
        let tentative = self.options.tentative;
        let drawn = |t: &&TrackState| tentative || t.status != TrackStatus::Tentative;
        for track in view.tracks.iter().filter(drawn) {
            self.draw_trail(&mut canvas, track, view.scan.time, zoom, width_px);
        }
        for track in view.tracks.iter().filter(drawn) {
            self.draw_track(&mut canvas, track, zoom, width_px);
        }
        if self.options.caption {
            self.draw_caption(&mut canvas, view);
        }
        Ok(())
    }

    /// Appends to the trails and forgets what is old or ended.
    fn remember(&mut self, view: &View<'_>) {
        let now = view.scan.time;
        // Where the camera moves, trails stay on the ground.
        if let Some(motion) = view.scan.camera_motion.filter(CameraMotion::is_finite) {
            for (_, (x, y)) in self.trails.values_mut().flatten() {
                let moved = motion.now_from_before.apply(Vector2::new(*x, *y));
                (*x, *y) = (moved.x, moved.y);
            }
        }
        if self.options.trail_s > 0.0 {
            for t in view.tracks {
                let mean = &t.kinematics.mean;
                let trail = self.trails.entry(t.id).or_default();
                if trail.len() == MAX_TRAIL {
                    trail.pop_front();
                }
                trail.push_back((now, (mean[0], mean[2])));
            }
        }
        let limit = self.options.trail_s;
        self.trails.retain(|_, trail| {
            while trail.front().is_some_and(|(t, _)| now.seconds_since(*t) > limit) {
                trail.pop_front();
            }
            !trail.is_empty()
        });
    }

    fn draw_trail(&mut self, canvas: &mut Canvas<'_>, track: &TrackState, now: Timestamp, zoom: Zoom, width_px: f32) {
        let Some(trail) = self.trails.get(&track.id) else { return };
        let colour = track_colour(track.id);
        self.points.clear();
        self.points.extend(trail.iter().map(|(_, (x, y))| zoom.point(*x, *y)));
        for (pair, (time, _)) in self.points.windows(2).zip(trail.iter().skip(1)) {
            let age = now.seconds_since(*time) / self.options.trail_s;
            let alpha = (1.0 - age).clamp(0.05, 1.0) as f32 * 0.9;
            canvas.line(pair[0], pair[1], &Pen { alpha, ..Pen::solid(colour, width_px) });
        }
    }

    fn draw_track(&self, canvas: &mut Canvas<'_>, track: &TrackState, zoom: Zoom, width_px: f32) {
        let colour = track_colour(track.id);
        let mean = &track.kinematics.mean;
        let (x, y) = zoom.point(mean[0], mean[2]);
        if !(x.is_finite() && y.is_finite()) {
            return;
        }
        let dash = f64::from(width_px) as f32;
        let pen = match track.status {
            TrackStatus::Confirmed => Pen::solid(colour, width_px * 1.5),
            TrackStatus::Coasting => {
                Pen { dash_px: Some((6.0 * dash, 4.0 * dash)), ..Pen::solid(colour, width_px * 1.5) }
            }
            TrackStatus::Tentative => {
                Pen { alpha: 0.7, dash_px: Some((2.0 * dash, 4.0 * dash)), ..Pen::solid(colour, width_px) }
            }
        };
        if self.options.ellipses {
            let c = &track.kinematics.cov;
            let cov = [c[(0, 0)], c[(0, 2)], c[(2, 2)]].map(|v| v * zoom.0 * zoom.0);
            let thin = Pen { alpha: pen.alpha * 0.8, width_px, ..pen };
            canvas.ellipse((x, y), cov, SIGMAS_95, &thin);
        }
        // A box a little larger than the target, so that the target stays in sight; small ones are given a least size.
        let e = &track.extent;
        let least = f64::from(width_px) * 8.0;
        let half = |size_px: f64| {
            let size = if size_px.is_finite() { size_px.clamp(0.0, 1e5) * zoom.0 } else { 0.0 };
            (size / 2.0 + f64::from(width_px) * 2.0).max(least)
        };
        let (hw, hh) = (half(e.width_px), half(e.height_px));
        if self.options.boxes {
            canvas.rectangle((x - hw).round(), (y - hh).round(), (x + hw).round(), (y + hh).round(), &pen);
        }
        if let (true, Some((_, lettering))) =
            (self.options.labels && track.status != TrackStatus::Tentative, &self.lettering)
        {
            let text = track.id.0.to_string();
            let (w, h) = (lettering.width_px(&text), lettering.height_px());
            let inside = |v: f64, size: f64, limit: usize| v.clamp(0.0, (limit as f64 - size).max(0.0));
            // Above the box, or below where there is no room above.
            let above = y - hh - h - 3.0;
            let top = if above >= 0.0 { above } else { y + hh + 3.0 };
            // A target out of the picture has no label at its edge.
            if x + hw < 0.0 || y + hh < 0.0 || x - hw > canvas.width() as f64 || y - hh > canvas.height() as f64 {
                return;
            }
            let (left, top) = (inside(x - hw, w + 4.0, canvas.width()), inside(top, h, canvas.height()));
            canvas.fill(left, top, left + w + 4.0, top + h, [0, 0, 0], 0.55);
            lettering.draw(canvas, left + 2.0, top, &text, colour, 1.0);
        }
    }

    fn draw_caption(&self, canvas: &mut Canvas<'_>, view: &View<'_>) {
        let Some((_, lettering)) = &self.lettering else { return };
        let n = view.tracks.iter().filter(|t| t.status != TrackStatus::Tentative).count();
        let plural = if n == 1 { "track" } else { "tracks" };
        let text = format!("frame {}  {:.3} s  {n} {plural}", view.scan.index.0, view.scan.time.as_secs_f64());
        canvas.fill(0.0, 0.0, lettering.width_px(&text) + 10.0, lettering.height_px() + 4.0, [0, 0, 0], 0.55);
        lettering.draw(canvas, 5.0, 2.0, &text, [235, 235, 235], 1.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_option_out_of_range_names_its_key() {
        let err = DrawOptions { trail_s: -1.0, ..DrawOptions::default() }.validate("draw").unwrap_err();
        assert!(err.to_string().starts_with("draw.trail-s = -1: expected seconds"), "{err}");
    }

    #[test]
    fn the_centre_of_a_pixel_stays_the_centre_of_its_block() {
        let zoom = Zoom(3.0);
        assert_eq!(zoom.point(0.0, 0.0), (1.0, 1.0));
        assert_eq!(zoom.point(-0.5, 1.0), (-0.5, 4.0));
    }
}
