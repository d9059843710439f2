//! The coloured ball of two real videos is chosen as the target without being named.

use crate::needs::{data, real_tests};
use boresight::Pixels;
use boresight::io::{Colour, OpenOptions, open};
use boresight::vision::colour::choose_reference;

real_tests! {
    the_green_ball_is_chosen_in_both_videos needs ["ball_green_trflorian/ball.mp4", "ball_green_trflorian/ball2.mp4"];
}

fn chosen_hue(name: &str, n_frames: usize, step: usize) -> f64 {
    let options = OpenOptions { colour: Colour::Rgb, ..OpenOptions::default() };
    let path = data("ball_green_trflorian").join(name);
    let mut source = open(&path, &options).unwrap();
    let mut frames = Vec::new();
    for i in 0..n_frames {
        let Some(frame) = source.next_frame().unwrap() else { break };
        if let (0, Pixels::Rgb8(image)) = (i % step, frame.pixels) {
            frames.push(image);
        }
    }
    let chosen = choose_reference(&frames.iter().collect::<Vec<_>>()).expect("a colour stands out");
    println!("{name}: {chosen:?}");
    chosen.hsi.hue_deg
}

fn the_green_ball_is_chosen_in_both_videos() {
    for (name, n_frames, step) in [("ball.mp4", 60, 2), ("ball2.mp4", 240, 8)] {
        let hue_deg = chosen_hue(name, n_frames, step);
        // The ball's pixels lie between 75 and 105 degrees, those of the hand between 0 and 45.
        assert!((70.0..115.0).contains(&hue_deg), "{name}: hue {hue_deg}");
    }
}
