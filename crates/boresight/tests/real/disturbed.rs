//! Real clips as a link that stalls and a mast in the wind show them: the default run follows the targets all the same.

use crate::follow::{follow, grey_frames, truth};
use crate::needs::{FFMPEG, real_tests};
use boresight::Image;
use boresight::camera::CameraConfig;

real_tests! {
    a_target_keeps_its_id_while_the_picture_stands needs ["ir_drone_svanstrom"];
    people_are_followed_before_a_camera_that_shakes needs ["pets09_vtest", FFMPEG];
}

fn a_target_keeps_its_id_while_the_picture_stands() {
    let (frames, truth) = (
        grey_frames("ir_drone_svanstrom/IR_AIRPLANE_043.mp4", 300),
        truth("ir_drone_svanstrom/IR_AIRPLANE_043.gt.csv"),
    );
    let plain = follow(&frames, 30, &truth, 3.0);
    // Half a second in every two and a half; the target goes on meanwhile.
    let shown: Vec<Image<u8>> =
        (0..frames.len()).map(|k| frames[if k >= 75 && k % 75 < 15 { k - k % 75 } else { k }].clone()).collect();
    let stalled = follow(&shown, 30, &truth, 3.0);
    for (name, f) in [("as it is", &plain), ("stalling", &stalled)] {
        assert!(
            f.held > 0.9 && f.precise > 0.95,
            "{name}: {:.3} held, {:.3} of the rows are a target's",
            f.held,
            f.precise
        );
    }
    assert!(stalled.one_id > plain.one_id - 0.02, "{:.3} as it is, {:.3}", plain.one_id, stalled.one_id);
}

fn people_are_followed_before_a_camera_that_shakes() {
    const MARGIN: usize = 6;
    let frames = grey_frames("pets09_vtest/vtest.avi", 200);
    // A sum of three sines that have no common period, up to 5.6 px, in whole ones.
    let offset = |k: usize, phase: f64| {
        let t = k as f64;
        let sum: f64 = [1.9, 2.7, 0.8].iter().map(|w| (w * t + phase * w).sin()).sum();
        (MARGIN as f64 + 1.9 * sum).round() as usize
    };
    let offsets: Vec<[usize; 2]> = (0..frames.len()).map(|k| [offset(k, 0.0), offset(k, 2.0)]).collect();
    let part = |frame: &Image<u8>, [dx, dy]: [usize; 2]| {
        let (w, h) = (frame.width() - 2 * MARGIN, frame.height() - 2 * MARGIN);
        let values = (0..h).flat_map(|y| frame.row(y + dy)[dx..dx + w].iter().copied()).collect();
        Image::from_vec(w, h, values).unwrap()
    };
    let shaken: Vec<Image<u8>> = frames.iter().zip(&offsets).map(|(f, o)| part(f, *o)).collect();
    let mut truth = truth("pets09_vtest/gt.txt");
    truth.retain(|r| (r[0] as usize) < frames.len());
    for r in &mut truth {
        let [dx, dy] = offsets[r[0] as usize];
        (r[2], r[3]) = (r[2] - dx as f64, r[3] - dy as f64);
    }
    let f = follow(&shaken, 10, &truth, 10.0);
    assert_eq!(f.detector.camera, CameraConfig::Shaking, "{:?}", f.reasons);
    assert!(f.held > 0.85 && f.precise > 0.85, "{:.3} held, {:.3} of the rows are a person's", f.held, f.precise);
}
