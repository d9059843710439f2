//! What is drawn on a frame: detections that no track took, tracks with box, number, fading trail and 95 % ellipse, and a line of facts.
//!
//! Confirmed tracks have a solid box, coasting ones a dashed box, tentative ones (if asked for) a thin dashed box without a number. Large boxes are drawn
//! first, small ones above them; labels stand where they cover nothing ([`super::labels`]). Above [`CROWD`] tracks only dots and trails are drawn.
//! Text and lines grow with the picture's height.
//! Ellipses hold the true position with 95 %: k² = 5.991, the chi-square quantile with 2 degrees of freedom; one longer than [`MOST_ELLIPSE`] of the
//! picture says nothing that can be read, and is left out.

use super::canvas::{Canvas, Pen, Rgb};
use super::colours::Colours;
use super::labels::{Labels, Rect};
use super::options::DrawOptions;
use super::reduced::Reduced;
use super::text::Lettering;
use super::tone::Tone;
use crate::palette::track_colour;
use crate::tempo::Pace;
use crate::{CameraMotion, Error, ErrorKind, Image, Result, Timestamp, TrackId, TrackState, TrackStatus, View};
use nalgebra::Vector2;
use std::collections::{BTreeMap, BTreeSet, VecDeque};

/// Standard deviations of the 95 % ellipse: sqrt(5.991), chi-square, 2 degrees of freedom.
const SIGMAS_95: f64 = 2.4477;
/// Most points of a trail; older ones are dropped.
const MAX_TRAIL: usize = 512;
/// More tracks at once than this are drawn as dots with trails.
const CROWD: usize = 60;
/// Longest half axis of an ellipse as a share of the picture's shorter side.
const MOST_ELLIPSE: f64 = 0.08;
/// Opacity of a trail's oldest and newest piece.
const TRAIL_ALPHA: [f32; 2] = [0.25, 1.0];
/// A dark edge keeps lines in sight on ground of their own brightness: its opacity.
const EDGE_ALPHA: f32 = 0.5;

/// Where a track was, px, oldest first.
type Trail = VecDeque<(Timestamp, (f64, f64))>;

/// Draws views, one after the other; remembers the trails and the brightness.
pub struct Annotator {
    options: DrawOptions,
    most: (usize, usize),
    reduced: Reduced,
    tone: Tone,
    lettering: Option<(f32, Lettering)>,
    trails: BTreeMap<TrackId, Trail>,
    pace: Pace,
    points: Vec<(f64, f64)>,
    labels: Labels,
    /// Place of each label in the frame before.
    places: BTreeMap<TrackId, usize>,
    colours: Option<Colours>,
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
        Ok(Self {
            options,
            most: (usize::MAX, usize::MAX),
            reduced: Reduced::default(),
            tone: Tone::default(),
            lettering: None,
            trails: BTreeMap::new(),
            pace: Pace::default(),
            points: Vec::new(),
            labels: Labels::default(),
            places: BTreeMap::new(),
            colours: None,
        })
    }

    /// Draws on the same frames in colour from now on, where they can be had.
    pub fn set_colours(&mut self, colours: Option<Colours>) {
        self.colours = colours;
    }

    /// Makes no picture that is larger than that (longer side, shorter side), px.
    #[cfg(feature = "encode")]
    pub(super) fn set_most(&mut self, most: (usize, usize)) {
        self.most = most;
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
        let (scale, reduce) = self.options.sizes((frame.pixels.width(), frame.pixels.height()), self.most);
        let coloured = self.colours.as_mut().and_then(|c| c.pixels(view.scan.index));
        let coloured = coloured.filter(|p| (p.width(), p.height()) == (frame.pixels.width(), frame.pixels.height()));
        let mut pixels = coloured.unwrap_or(&frame.pixels);
        if reduce > 1 {
            pixels = self.reduced.of(pixels, reduce);
        }
        self.tone.render(pixels, scale, out);
        self.remember(view);
        let height = out.height() as f32;
        let size_px = (height / 54.0).clamp(12.0, 44.0).round();
        if self.lettering.as_ref().is_none_or(|(s, _)| *s != size_px) {
            self.lettering = Some((size_px, Lettering::new(size_px)?));
        }
        let width_px = (height / 600.0).clamp(1.0, 4.0);
        let mut canvas = Canvas::new(out);
        let zoom = Zoom(scale as f64 / reduce as f64);
        let tentative = self.options.tentative;
        let mut tracks: Vec<&TrackState> =
            view.tracks.iter().filter(|t| tentative || t.status != TrackStatus::Tentative).collect();
        // Small ones above large ones.
        let area = |t: &TrackState| t.extent.width_px * t.extent.height_px;
        tracks.sort_by(|a, b| area(b).total_cmp(&area(a)).then(a.id.cmp(&b.id)));
        let is_crowd = tracks.len() > CROWD;
        if self.options.detections && !is_crowd {
            draw_untaken(&mut canvas, view, &tracks, zoom, width_px);
        }
        for track in &tracks {
            self.draw_trail(&mut canvas, track, view.scan.time, zoom, width_px);
        }
        if is_crowd {
            tracks.iter().for_each(|track| draw_dot(&mut canvas, track, zoom, width_px));
        } else {
            tracks.iter().for_each(|track| self.draw_track(&mut canvas, track, zoom, width_px));
            if self.options.labels {
                self.draw_labels(&mut canvas, view, &tracks, zoom, width_px);
            }
        }
        if self.options.caption {
            self.draw_caption(&mut canvas, view);
        }
        Ok(())
    }

    /// Appends to the trails and forgets what is old or ended.
    fn remember(&mut self, view: &View<'_>) {
        let now = view.scan.time;
        self.pace.note(now);
        if view.scan.is_cut() {
            self.trails.clear();
        }
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
        let limit = self.trail_s();
        self.trails.retain(|_, trail| {
            while trail.front().is_some_and(|(t, _)| now.seconds_since(*t) > limit) {
                trail.pop_front();
            }
            !trail.is_empty()
        });
    }

    /// How long trails are here, s.
    fn trail_s(&self) -> f64 {
        self.pace.tempo().stretched(self.options.trail_s)
    }

    fn draw_trail(&mut self, canvas: &mut Canvas<'_>, track: &TrackState, now: Timestamp, zoom: Zoom, width_px: f32) {
        let Some(trail) = self.trails.get(&track.id) else { return };
        let colour = track_colour(track.id);
        self.points.clear();
        self.points.extend(trail.iter().map(|(_, (x, y))| zoom.point(*x, *y)));
        let edge = Pen { alpha: 0.35, ..Pen::solid([0; 3], width_px * 1.2 + 1.5) };
        self.points.windows(2).for_each(|pair| canvas.line(pair[0], pair[1], &edge));
        for (pair, (time, _)) in self.points.windows(2).zip(trail.iter().skip(1)) {
            let age = (now.seconds_since(*time) / self.trail_s()).clamp(0.0, 1.0) as f32;
            let alpha = TRAIL_ALPHA[1] + age * (TRAIL_ALPHA[0] - TRAIL_ALPHA[1]);
            canvas.line(pair[0], pair[1], &Pen { alpha, ..Pen::solid(colour, width_px * 1.2) });
        }
    }

    fn draw_track(&self, canvas: &mut Canvas<'_>, track: &TrackState, zoom: Zoom, width_px: f32) {
        let colour = track_colour(track.id);
        let Some(bounds) = bounds(track, zoom, width_px) else { return };
        let pen = match track.status {
            TrackStatus::Confirmed => Pen::solid(colour, width_px * 1.8),
            TrackStatus::Coasting => {
                Pen { dash_px: Some((6.0 * width_px, 4.0 * width_px)), ..Pen::solid(colour, width_px * 1.8) }
            }
            TrackStatus::Tentative => {
                Pen { alpha: 0.7, dash_px: Some((2.0 * width_px, 4.0 * width_px)), ..Pen::solid(colour, width_px) }
            }
        };
        if self.options.ellipses {
            let (c, mean) = (&track.kinematics.cov, &track.kinematics.mean);
            let cov = [c[(0, 0)], c[(0, 2)], c[(2, 2)]].map(|v| v * zoom.0 * zoom.0);
            let longest = SIGMAS_95 * (cov[0] + cov[2]).sqrt();
            if longest <= MOST_ELLIPSE * canvas.width().min(canvas.height()) as f64 {
                let thin = Pen { alpha: pen.alpha * 0.8, width_px, ..pen };
                canvas.ellipse(zoom.point(mean[0], mean[2]), cov, SIGMAS_95, &thin);
            }
        }
        if self.options.boxes {
            let [left, top, right, bottom] = bounds;
            if track.status != TrackStatus::Tentative {
                let edge = Pen { alpha: EDGE_ALPHA, colour: [0; 3], width_px: pen.width_px + 1.6, ..pen };
                canvas.rectangle(left, top, right, bottom, &edge);
            }
            canvas.rectangle(left, top, right, bottom, &pen);
        }
    }

    /// Numbers, white on dark plates with an edge of the track's colour.
    fn draw_labels(
        &mut self,
        canvas: &mut Canvas<'_>,
        view: &View<'_>,
        tracks: &[&TrackState],
        zoom: Zoom,
        width_px: f32,
    ) {
        let Some((_, lettering)) = &self.lettering else { return };
        let (w, h) = (canvas.width() as f64, canvas.height() as f64);
        self.labels.begin(w, h);
        if self.options.caption {
            let [right, bottom] = caption_size(lettering, &caption(view));
            self.labels.occupy([0.0, 0.0, right, bottom]);
        }
        let all: Vec<Option<Rect>> = tracks.iter().map(|t| bounds(t, zoom, width_px)).collect();
        all.iter().flatten().for_each(|r| self.labels.occupy(*r));
        let mut places = BTreeMap::new();
        for (track, bounds) in tracks.iter().zip(&all).rev() {
            let Some(bounds) = bounds.filter(|_| track.status != TrackStatus::Tentative) else { continue };
            // A target out of the picture has no label at its edge.
            if bounds[2] < 0.0 || bounds[3] < 0.0 || bounds[0] > w || bounds[1] > h {
                continue;
            }
            let text = track.id.0.to_string();
            let edge_px = f64::from(width_px).round().max(1.0);
            let size = [lettering.width_px(&text) + 4.0 + 2.0 * edge_px, lettering.height_px() + 2.0 * edge_px];
            let before = self.places.get(&track.id).copied();
            let Some((place, [x, y])) = self.labels.place(&bounds, size, before) else { continue };
            places.insert(track.id, place);
            let (right, bottom) = (x + size[0], y + size[1]);
            canvas.fill(x, y, right, bottom, track_colour(track.id), 1.0);
            canvas.fill(x + edge_px, y + edge_px, right - edge_px, bottom - edge_px, [18, 18, 18], 1.0);
            lettering.draw(canvas, x + 2.0 + edge_px, y + edge_px, &text, [255; 3], 1.0);
        }
        self.places = places;
    }

    fn draw_caption(&self, canvas: &mut Canvas<'_>, view: &View<'_>) {
        let Some((_, lettering)) = &self.lettering else { return };
        let text = caption(view);
        let [right, bottom] = caption_size(lettering, &text);
        canvas.fill(0.0, 0.0, right, bottom, [0, 0, 0], 0.55);
        lettering.draw(canvas, 5.0, 2.0, &text, [235, 235, 235], 1.0);
    }
}

/// The line of facts.
fn caption(view: &View<'_>) -> String {
    let n = view.tracks.iter().filter(|t| t.status != TrackStatus::Tentative).count();
    let plural = if n == 1 { "track" } else { "tracks" };
    format!("frame {}  {:.2} s  {n} {plural}", view.scan.index.0, view.scan.time.as_secs_f64())
}

/// Width and height of the line of facts, px.
fn caption_size(lettering: &Lettering, text: &str) -> [f64; 2] {
    [lettering.width_px(text) + 10.0, lettering.height_px() + 4.0]
}

/// The box that is drawn around a track, a little larger than the target, so that the target stays in sight, and of a least size; canvas px.
fn bounds(track: &TrackState, zoom: Zoom, width_px: f32) -> Option<Rect> {
    let mean = &track.kinematics.mean;
    let (x, y) = zoom.point(mean[0], mean[2]);
    let least = f64::from(width_px) * 8.0;
    let half = |size_px: f64| {
        let size = if size_px.is_finite() { size_px.clamp(0.0, 1e5) * zoom.0 } else { 0.0 };
        (size / 2.0 + f64::from(width_px) * 2.0).max(least)
    };
    let (hw, hh) = (half(track.extent.width_px), half(track.extent.height_px));
    (x.is_finite() && y.is_finite()).then(|| [(x - hw).round(), (y - hh).round(), (x + hw).round(), (y + hh).round()])
}

/// Crosses on the detections that none of the tracks drawn took.
fn draw_untaken(canvas: &mut Canvas<'_>, view: &View<'_>, tracks: &[&TrackState], zoom: Zoom, width_px: f32) {
    let taken: BTreeSet<usize> = tracks.iter().filter_map(|t| t.detection.map(|d| d as usize)).collect();
    let arm = f64::from(width_px) * 3.0;
    for (_, d) in view.scan.detections.iter().enumerate().filter(|(i, _)| !taken.contains(i)) {
        let (x, y) = zoom.point(d.position.x, d.position.y);
        for (colour, alpha, width_px) in [([0; 3], 0.4, width_px + 1.4), ([255; 3], 0.8, width_px)] {
            let pen = Pen { alpha, ..Pen::solid(colour, width_px) };
            canvas.line((x - arm, y), (x + arm, y), &pen);
            canvas.line((x, y - arm), (x, y + arm), &pen);
        }
    }
}

/// One of many tracks: a dot, hollow while it coasts.
fn draw_dot(canvas: &mut Canvas<'_>, track: &TrackState, zoom: Zoom, width_px: f32) {
    let mean = &track.kinematics.mean;
    let at = zoom.point(mean[0], mean[2]);
    let dot = |canvas: &mut Canvas<'_>, colour, width_px| canvas.line(at, at, &Pen::solid(colour, width_px));
    dot(canvas, [0; 3], width_px * 3.5 + 1.4);
    dot(canvas, track_colour(track.id), width_px * 3.5);
    if track.status == TrackStatus::Coasting {
        dot(canvas, [0; 3], width_px * 1.5);
    }
}

#[cfg(test)]
mod tests;
