//! The camera's motion on real frames.

use crate::needs::{data, real_tests};
use boresight::camera::CameraMotionEstimator;
use boresight::{Image, MotionBasis, Pixels};

real_tests! {
    no_view_that_moved_at_once_is_told_at_rest needs ["ir_drone_svanstrom"];
}

/// Motions of the view, px.
const MOVED: [(usize, usize); 12] =
    [(2, 0), (0, 2), (2, 2), (3, 0), (0, 4), (7, 2), (5, 9), (9, 1), (12, 0), (15, 15), (20, 13), (31, 8)];

fn no_view_that_moved_at_once_is_told_at_rest() {
    let folder = std::fs::read_dir(data("ir_drone_svanstrom")).unwrap();
    let mut clips: Vec<_> = folder.map(|entry| entry.unwrap().path()).collect();
    clips.retain(|path| path.extension().is_some_and(|e| e == "mp4"));
    clips.sort();
    let (mut n, mut wrong) = (0, Vec::new());
    for clip in &clips {
        let mut source = boresight::io::open(clip, &Default::default()).unwrap();
        let Pixels::Gray8(frame) = source.next_frame().unwrap().unwrap().pixels else { panic!("{clip:?} is grey") };
        let (w, h) = (frame.width() - 32, frame.height() - 16);
        let view = |left: usize, top: usize| {
            let rows = (top..top + h).flat_map(|y| frame.row(y)[left..left + w].iter().copied());
            Pixels::Gray8(Image::from_vec(w, h, rows.collect()).unwrap())
        };
        let mut at_rest = CameraMotionEstimator::default();
        let last = (0..6).map(|_| at_rest.step(&view(0, 0))).last().flatten();
        // Of some nothing is known: there is nothing but sky.
        if last.is_none_or(|step| step.basis != MotionBasis::Measured) {
            continue;
        }
        for (left, top) in MOVED {
            n += 1;
            if let Some(step) = at_rest.clone().step(&view(left, top))
                && step.basis == MotionBasis::Measured
                && step.now_from_before.shift_at(nalgebra::Vector2::zeros()).norm() < 0.5
            {
                wrong.push((clip.file_name().unwrap().to_owned(), left, top));
            }
        }
    }
    println!("{} clips, {n} motions, {} told at rest", clips.len(), wrong.len());
    assert!(n > 200, "{n} motions of {} clips", clips.len());
    assert!(wrong.is_empty(), "{wrong:?}");
}
