//! A 4-state tracker as it would run on a microcontroller: f32, no heap, no std in the tracker, fixed size.
//!
//! `tests/no_std` builds the same tracker as a static library without std and reports its code size.
//! Run: `cargo run -p boresight-filters --example microcontroller`

use boresight_filters::model::ConstantVelocity;
use boresight_filters::{FilterError, GaussianFilter, Measurement, Start, Ud};

/// All the memory of one track.
type Track = Ud<ConstantVelocity<f32>, 4, f32>;

/// One frame of the loop of the firmware: predict, and correct if there was a detection.
fn frame(track: &mut Track, dt_s: f32, detection: Option<[f32; 2]>) -> Result<[f32; 2], FilterError> {
    track.predict(dt_s)?;
    if let Some([x, y]) = detection {
        track.correct(&Measurement::isotropic(x, y, 0.5))?;
    }
    let position = track.predicted().mean;
    Ok([position[0], position[1]])
}

fn main() -> Result<(), FilterError> {
    let model = ConstantVelocity::discrete(20.0)?;
    let mut track = Track::from_point(model, &Measurement::isotropic(10.0, 20.0, 0.5), 50.0)?;
    let mut last = [0.0; 2];
    for k in 1..=100_u8 {
        let t = f32::from(k) * 0.02;
        // Every fifth frame is missed.
        let seen = (k % 5 != 0).then_some([10.0 + 30.0 * t, 20.0 - 10.0 * t]);
        last = frame(&mut track, 0.02, seen)?;
    }
    println!("track: {} bytes of memory, no heap", size_of::<Track>());
    println!("position after 2 s: ({:.2}, {:.2}), truth (70.00, 0.00)", last[0], last[1]);
    Ok(())
}
