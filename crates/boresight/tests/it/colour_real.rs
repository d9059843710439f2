//! The coloured ball of two real videos is chosen as the target without being named.

use boresight::Pixels;
use boresight::io::{Colour, OpenOptions, open};
use boresight::vision::colour::choose_reference;
use std::path::PathBuf;

fn chosen_hue(name: &str, n_frames: usize, step: usize) -> Option<f64> {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..");
    let folder = std::env::var_os("BORESIGHT_TEST_DATA").map_or_else(|| root.join("../shared/data"), PathBuf::from);
    let path = folder.join("ball_green_trflorian").join(name);
    if !path.exists() {
        println!("skipped: {} is not here (set BORESIGHT_TEST_DATA)", path.display());
        return None;
    }
    let options = OpenOptions { colour: Colour::Rgb, ..OpenOptions::default() };
    let mut source = match open(&path.display().to_string(), &options) {
        Ok(source) => source,
        Err(e) => {
            // 4:2:2 needs ffmpeg.
            println!("skipped: {e}");
            return None;
        }
    };
    let mut frames = Vec::new();
    for i in 0..n_frames {
        let Some(frame) = source.next_frame().unwrap() else { break };
        if let (0, Pixels::Rgb8(image)) = (i % step, frame.pixels) {
            frames.push(image);
        }
    }
    let chosen = choose_reference(&frames.iter().collect::<Vec<_>>()).expect("a colour stands out");
    println!("{name}: {chosen:?}");
    Some(chosen.hsi.hue_deg)
}

#[test]
fn the_green_ball_is_chosen_in_both_videos() {
    for (name, n_frames, step) in [("ball.mp4", 60, 2), ("ball2.mp4", 240, 8)] {
        if let Some(hue_deg) = chosen_hue(name, n_frames, step) {
            // The ball's pixels lie between 75 and 105 degrees, those of the hand between 0 and 45.
            assert!((70.0..115.0).contains(&hue_deg), "{name}: hue {hue_deg}");
        }
    }
}
