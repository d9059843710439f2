//! What is drawn, looked at pixel by pixel.

use super::*;
use crate::{Detection, Extent, Frame, FrameIndex, Pixels, Scan};
use boresight_filters::Gaussian;
use nalgebra::{SMatrix, SVector};

/// The ground of a label.
const PLATE: Rgb = [18; 3];

fn track(id: u64, at: [f64; 2], side: f64) -> TrackState {
    let kinematics = Gaussian { mean: SVector::<f64, 4>::new(at[0], 0.0, at[1], 0.0), cov: SMatrix::identity() };
    TrackState {
        id: TrackId(id),
        status: TrackStatus::Confirmed,
        kinematics,
        extent: Extent::around(Vector2::new(at[0], at[1]), side, side),
        detection: None,
        innovation: None,
        score: 1.0,
    }
}

/// What is drawn on an even frame of that size, at scale 1.
fn drawn(size: [usize; 2], tracks: &[TrackState], detections: &[[f64; 2]], options: DrawOptions) -> Image<Rgb> {
    let (index, time) = (FrameIndex(0), Timestamp::default());
    let frame = Frame { index, time, pixels: Pixels::Gray8(Image::filled(size[0], size[1], 200)) };
    let points = detections.iter().map(|[x, y]| Detection::point(*x, *y, 1.0)).collect();
    let scan = Scan::at(index, time).with_detections(points);
    let mut out = Image::default();
    let options = DrawOptions { scale: 1, ..options };
    Annotator::new(options).unwrap().draw(&View { frame: Some(&frame), scan: &scan, tracks }, &mut out).unwrap();
    out
}

fn no_caption() -> DrawOptions {
    DrawOptions { caption: false, ..DrawOptions::default() }
}

fn rows_of(image: &Image<Rgb>, colour: Rgb) -> usize {
    (0..image.height()).filter(|y| image.row(*y).contains(&colour)).count()
}

#[test]
fn the_centre_of_a_pixel_stays_the_centre_of_its_block() {
    let zoom = Zoom(3.0);
    assert_eq!(zoom.point(0.0, 0.0), (1.0, 1.0));
    assert_eq!(zoom.point(-0.5, 1.0), (-0.5, 4.0));
}

#[test]
fn text_grows_with_the_picture() {
    let height = |side: usize| {
        let middle = side as f64 / 2.0;
        rows_of(&drawn([side, side], &[track(1, [middle, middle], 40.0)], &[], no_caption()), PLATE) as f64
    };
    let (small, large) = (height(700), height(2100));
    assert!((large / small - 3.0).abs() < 0.3, "{small} {large}");
}

#[test]
fn a_crowd_is_drawn_as_dots_without_numbers_and_boxes() {
    let all: Vec<TrackState> =
        (0..61).map(|k| track(k + 1, [20.0 + 40.0 * (k % 10) as f64, 20.0 + 40.0 * (k / 10) as f64], 10.0)).collect();
    let crowd = drawn([420, 300], &all, &[[300.0, 290.0]], no_caption());
    assert_eq!(rows_of(&crowd, PLATE), 0);
    assert_eq!(crowd.get(20, 20), Some(track_colour(TrackId(1))), "a dot in its colour");
    assert_eq!((crowd.get(12, 20), crowd.get(300, 290)), (Some([200; 3]), Some([200; 3])), "no box, no cross");
    assert!(rows_of(&drawn([420, 300], &all[..60], &[], no_caption()), PLATE) > 0);
}

#[test]
fn a_small_box_lies_above_a_large_one() {
    let (small, large) = (track(1, [100.0, 50.0], 40.0), track(2, [100.0, 100.0], 96.0));
    // The large box's upper edge runs at y = 50, across the small one's sides at x = 78 and 122.
    let options = DrawOptions { labels: false, ellipses: false, ..no_caption() };
    for tracks in [[small.clone(), large.clone()], [large, small]] {
        let image = drawn([200, 200], &tracks, &[], options.clone());
        assert_eq!(image.get(78, 50), Some(track_colour(TrackId(1))));
        assert_eq!(image.get(90, 50), Some(track_colour(TrackId(2))));
    }
}

#[test]
fn only_detections_that_no_track_took_are_crossed() {
    let taken = TrackState { detection: Some(0), ..track(1, [60.0, 60.0], 30.0) };
    let options = DrawOptions { ellipses: false, ..no_caption() };
    let image = drawn([200, 200], &[taken], &[[60.0, 60.0], [150.0, 150.0]], options);
    assert_eq!(image.get(60, 60), Some([200; 3]));
    assert!(image.get(150, 150).is_some_and(|p| p[0] > 230), "{:?}", image.get(150, 150));
}

#[test]
fn tentative_tracks_are_drawn_where_they_are_asked_for() {
    let tentative = [TrackState { status: TrackStatus::Tentative, ..track(1, [60.0, 60.0], 30.0) }];
    let even =
        |options: DrawOptions| drawn([120, 120], &tentative, &[], options).as_slice().iter().all(|p| *p == [200; 3]);
    assert!(even(no_caption()) && !even(DrawOptions { tentative: true, ..no_caption() }));
}

#[test]
fn an_ellipse_that_covers_the_picture_is_left_out() {
    let of = |variance: f64| {
        let mut t = track(1, [100.0, 100.0], 10.0);
        t.kinematics.cov *= variance;
        let options = DrawOptions { boxes: false, labels: false, ..no_caption() };
        drawn([200, 200], &[t], &[], options).as_slice().iter().filter(|p| **p != [200; 3]).count()
    };
    assert!(of(9.0) > 20 && of(400.0) == 0, "{} {}", of(9.0), of(400.0));
}
