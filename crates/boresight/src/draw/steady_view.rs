//! Views as a camera at rest would have them: the frame warped, its detections and tracks moved, and given to another sink.
//!
//! Source: our own, with the warp of [`crate::warp`].
//! How: the motions that scans carry are added up, so that the ground of the first frame stands still in the picture, upright as it was there. Where the frame's middle leaves
//! the picture's inner half, or the ground has grown or shrunk by [`MOST_ZOOM`], the picture goes along with the frame by as much as is needed: a shake and a turn vanish, a long pan
//! stays one. Around the frame the picture shows, darker, what was last seen there: a mosaic.
//! Symbols: H, picture from image. Limits: one plane; where the motion is unknown the picture begins anew.

use super::colours::Colours;
use crate::warp::{Mix, between};
use crate::{CameraMotion, Frame, Homography, Image, Pixels, Result, Scan, Sink, TrackState, View};
use nalgebra::{Matrix2, Matrix4, Vector2};

/// Share of the picture's side by which the frame's middle may leave the picture's before the picture goes along.
const SLACK: f64 = 0.25;
/// Growth of the ground in the picture, either way, before the picture goes along.
const MOST_ZOOM: f64 = 1.5;
/// Brightness of what is remembered, of 256.
const DIM: u32 = 150;

/// Gives steadied views to a sink.
pub struct SteadyView {
    sink: Box<dyn Sink>,
    colours: Option<Colours>,
    picture_from_image: Homography,
    /// What was last seen at each place of the picture; nothing yet where it is zero.
    seen: Pixels,
    other: Pixels,
    frame: Frame,
    scan: Scan,
    tracks: Vec<TrackState>,
    started: bool,
}

opaque_debug!(SteadyView);

impl SteadyView {
    /// Before that sink.
    pub fn new(sink: Box<dyn Sink>) -> Self {
        let nothing = || Pixels::Gray8(Image::default());
        Self {
            sink,
            colours: None,
            picture_from_image: Homography::identity(),
            seen: nothing(),
            other: nothing(),
            frame: Frame { index: Default::default(), time: Default::default(), pixels: nothing() },
            scan: Scan::default(),
            tracks: Vec::new(),
            started: false,
        }
    }

    /// Shows the same frames in colour.
    #[must_use]
    pub fn with_colours(mut self, colours: Option<Colours>) -> Self {
        self.colours = colours;
        self
    }

    /// Follows the camera; returns how the picture itself goes along, if what was seen before is of use.
    fn follow(&mut self, motion: Option<&CameraMotion>, size: Vector2<f64>) -> Option<Homography> {
        if !std::mem::replace(&mut self.started, true) {
            return None;
        }
        let Some(motion) = motion.filter(|m| !m.is_cut()) else {
            self.picture_from_image = Homography::identity();
            return None;
        };
        let middle = 0.5 * (size - Vector2::new(1.0, 1.0));
        let h = motion.now_from_before.inverse().then(&self.picture_from_image);
        let mut along = Homography::identity();
        let zoom = h.zoom_at(middle);
        if !(1.0 / MOST_ZOOM..=MOST_ZOOM).contains(&zoom) {
            let to = crate::Similarity::about(
                h.apply(middle),
                Vector2::zeros(),
                0.0,
                zoom.clamp(1.0 / MOST_ZOOM, MOST_ZOOM) / zoom,
            );
            along = Homography::of_similarity(&to);
        }
        let off = along.apply(h.apply(middle)) - middle;
        // Whole pixels: what is remembered is then only moved.
        let over = |v: f64, side: f64| (v - v.clamp(-SLACK * side, SLACK * side)).round();
        let back = Vector2::new(-over(off.x, size.x), -over(off.y, size.y));
        if back != Vector2::zeros() {
            along = along.then(&Homography::shift(back));
        }
        self.picture_from_image = h.then(&along);
        self.picture_from_image.is_sound().then_some(along)
    }
}

impl Sink for SteadyView {
    fn put(&mut self, view: &View<'_>) -> Result<()> {
        let Some(frame) = view.frame else { return self.sink.put(view) };
        let motion = view.scan.camera_motion.filter(CameraMotion::is_finite);
        let size = Vector2::new(frame.pixels.width() as f64, frame.pixels.height() as f64);
        let along = self.follow(motion.as_ref(), size);
        let h = self.picture_from_image;
        let coloured = self.colours.as_mut().and_then(|c| c.pixels(frame.index));
        let coloured = coloured.filter(|p| (p.width(), p.height()) == (frame.pixels.width(), frame.pixels.height()));
        let pixels = coloured.unwrap_or(&frame.pixels);
        remember(&mut self.seen, &mut self.other, pixels, along.as_ref());
        warp(pixels, &h, &mut self.seen, &mut self.frame.pixels);
        (self.frame.index, self.frame.time) = (frame.index, frame.time);
        self.scan.clone_from(view.scan);
        self.scan.camera_motion =
            along.map(|along| CameraMotion { now_from_before: along, ..CameraMotion::exact_shift(Vector2::zeros()) });
        self.scan.detections.iter_mut().for_each(|d| d.move_by(&h));
        self.tracks.clear();
        self.tracks.extend(view.tracks.iter().cloned());
        self.tracks.iter_mut().for_each(|t| move_track(t, &h));
        self.sink.put(&View { frame: Some(&self.frame), scan: &self.scan, tracks: &self.tracks })
    }

    fn finish(self: Box<Self>) -> Result<()> {
        self.sink.finish()
    }
}

fn move_track(t: &mut TrackState, h: &Homography) {
    let (mean, cov) = (&mut t.kinematics.mean, &mut t.kinematics.cov);
    let at = Vector2::new(mean[0], mean[2]);
    let (to, velocity) = (h.apply(at), h.turn_at(at, Vector2::new(mean[1], mean[3])));
    if !h.is_shift() {
        let a: Matrix2<f64> = h.linear_at(at);
        let mut by = Matrix4::zeros();
        for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            by[(2 * i, 2 * j)] = a[(i, j)];
            by[(2 * i + 1, 2 * j + 1)] = a[(i, j)];
        }
        *cov = by * *cov * by.transpose();
    }
    (mean[0], mean[1], mean[2], mean[3]) = (to.x, velocity.x, to.y, velocity.y);
    t.extent = t.extent.moved(h);
}

/// A kind of pixel that can be mixed and darkened.
trait Dim: Mix {
    fn dim(self) -> Self;
}

macro_rules! dim_whole {
    ($($kind:ty),*) => {$(
        impl Dim for $kind {
            fn dim(self) -> Self {
                (u32::from(self) * DIM / 256) as Self
            }
        }
    )*};
}
dim_whole!(u8, u16);

impl Dim for f32 {
    fn dim(self) -> Self {
        self * DIM as f32 / 256.0
    }
}

impl Dim for [u8; 3] {
    fn dim(self) -> Self {
        self.map(Dim::dim)
    }
}

/// Runs a function for the images of pixels of one kind.
macro_rules! of_one_kind {
    ($pixels:expr, $seen:expr, $out:expr, $run:expr) => {
        match $pixels {
            Pixels::Gray8(i) => $run(i, one_of!($seen, Gray8), one_of!($out, Gray8)),
            Pixels::Gray16(i) => $run(i, one_of!($seen, Gray16), one_of!($out, Gray16)),
            Pixels::GrayF32(i) => $run(i, one_of!($seen, GrayF32), one_of!($out, GrayF32)),
            Pixels::Rgb8(i) => $run(i, one_of!($seen, Rgb8), one_of!($out, Rgb8)),
        }
    };
}

/// The image of that kind; another kind's makes room for it.
macro_rules! one_of {
    ($pixels:expr, $kind:ident) => {{
        if !matches!($pixels, Pixels::$kind(_)) {
            *$pixels = Pixels::$kind(Image::default());
        }
        match $pixels {
            Pixels::$kind(image) => image,
            // It was made one above.
            _ => return,
        }
    }};
}

/// What was seen goes along with the picture; without a way along it is forgotten.
fn remember(seen: &mut Pixels, other: &mut Pixels, like: &Pixels, along: Option<&Homography>) {
    of_one_kind!(like, seen, other, |i, s, o| go_along(i, s, o, along));
}

fn go_along<T: Mix>(like: &Image<T>, seen: &mut Image<T>, other: &mut Image<T>, along: Option<&Homography>) {
    let size = (like.width(), like.height());
    match along.filter(|_| (seen.width(), seen.height()) == size) {
        None => {
            seen.reset(0, 0, T::default());
            seen.reset(size.0, size.1, T::default());
        }
        Some(along) if along.is_identity() => {}
        Some(along) => {
            std::mem::swap(seen, other);
            let back = along.inverse();
            seen.reset(size.0, size.1, T::default());
            for y in 0..size.1 {
                for (x, v) in seen.row_mut(y).iter_mut().enumerate() {
                    *v = between(other, back.apply(Vector2::new(x as f64, y as f64))).unwrap_or_default();
                }
            }
        }
    }
}

/// Draws the frame into the picture, around it what was seen there, and remembers it.
fn warp(pixels: &Pixels, h: &Homography, seen: &mut Pixels, out: &mut Pixels) {
    of_one_kind!(pixels, seen, out, |i, s, o| draw(i, h, s, o));
}

fn draw<T: Dim>(image: &Image<T>, h: &Homography, seen: &mut Image<T>, out: &mut Image<T>) {
    let back = h.inverse();
    out.reset(image.width(), image.height(), T::default());
    for y in 0..image.height() {
        for (x, (v, seen)) in out.row_mut(y).iter_mut().zip(seen.row_mut(y)).enumerate() {
            *v = match between(image, back.apply(Vector2::new(x as f64, y as f64))) {
                Some(now) => {
                    *seen = now;
                    now
                }
                None => seen.dim(),
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Extent, FrameIndex, Timestamp, TrackId, TrackStatus};
    use boresight_filters::Gaussian;
    use std::sync::mpsc::{Sender, channel};

    /// Sends the picture and where the track is in it.
    struct Seen(Sender<(Image<u8>, f64)>);

    impl Sink for Seen {
        fn put(&mut self, view: &View<'_>) -> Result<()> {
            if let Some(Pixels::Gray8(image)) = view.frame.map(|f| &f.pixels) {
                self.0.send((image.clone(), view.tracks[0].kinematics.mean[0])).unwrap();
            }
            Ok(())
        }

        fn finish(self: Box<Self>) -> Result<()> {
            Ok(())
        }
    }

    /// A ground of columns of their own brightness before a camera that goes right by whole pixels, with a track that stands on it.
    fn film(steps: &[i64]) -> Vec<(Image<u8>, f64)> {
        let (sender, seen) = channel();
        let mut sink = SteadyView::new(Box::new(Seen(sender)));
        let mut camera = 0;
        for (k, step) in steps.iter().enumerate() {
            camera += step;
            let mut image = Image::filled(40, 20, 0u8);
            for y in 0..20 {
                image.row_mut(y).iter_mut().enumerate().for_each(|(x, v)| *v = (x as i64 + camera + 50) as u8);
            }
            let (index, time) = (FrameIndex(k as u64), Timestamp::from_ns(k as i64));
            let motion = (k > 0).then(|| CameraMotion::exact_shift(Vector2::new(-*step as f64, 0.0)));
            let scan = Scan::at(index, time).with_camera_motion(motion);
            let track = TrackState {
                id: TrackId(1),
                status: TrackStatus::Confirmed,
                kinematics: Gaussian { mean: [20.0 - camera as f64, 0.0, 10.0, 0.0].into(), cov: Matrix4::identity() },
                extent: Extent::default(),
                detection: None,
                innovation: None,
                score: 1.0,
            };
            let frame = Frame { index, time, pixels: Pixels::Gray8(image) };
            sink.put(&View { frame: Some(&frame), scan: &scan, tracks: &[track] }).unwrap();
        }
        drop(sink);
        seen.iter().collect()
    }

    #[test]
    fn under_a_shake_ground_and_track_stand_still_and_what_is_out_of_sight_is_remembered_darker() {
        let film = film(&[0, 3, -5, 4, -2]);
        for (image, track) in &film {
            assert!((image.row(9)[20], *track) == (70, 20.0));
        }
        // The second frame begins three columns to the right: the first three are remembered.
        let row = film[1].0.row(5);
        assert_eq!(row[..4], [50, 51, 52, 53].map(|v| if v < 53 { (v * DIM / 256) as u8 } else { v as u8 }));
    }

    #[test]
    fn in_a_long_pan_the_picture_goes_along_at_a_quarter_of_its_width() {
        let film = film(&[0, 4, 4, 4, 4, 4, 4, 4]);
        let (image, track) = &film[7];
        // 28 px to the right: ten of them within the slack, eighteen the picture has gone along.
        assert_eq!((image.row(3)[39], *track), (50 + 39 + 18, 2.0));
        assert_eq!(u32::from(image.row(3)[0]), (50 + 18) * DIM / 256);
    }
}
