//! The smallest 4-state U-D tracker as firmware would link it: f32, no std, no heap, its own panic handler.
//!
//! Built by `.ci/no_std`. If any crate of the tree linked std, its panic handler would clash with the one below and the
//! build would fail; there is no allocator, so a heap would not link either.
#![no_std]

/// The proof that this check can fail: with `--cfg with_std` it must not build.
#[cfg(with_std)]
extern crate std;

use boresight_filters::model::ConstantVelocity;
use boresight_filters::{GaussianFilter, Measurement, Start, Ud};

/// All the memory of one track.
pub type Track = Ud<ConstantVelocity<f32>, 4, f32>;

#[panic_handler]
fn halt(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {}
}

/// Starts a track at (x, y); false if a value is refused.
#[unsafe(no_mangle)]
pub extern "C" fn track_start(track: &mut Option<Track>, x: f32, y: f32, std_px: f32, speed_px_per_s: f32) -> bool {
    let point = Measurement::isotropic(x, y, std_px);
    *track = ConstantVelocity::discrete(20.0).and_then(|m| Track::from_point(m, &point, speed_px_per_s)).ok();
    track.is_some()
}

/// One frame: predict, then correct by (x, y); false if a value is refused, the track is then unchanged.
#[unsafe(no_mangle)]
pub extern "C" fn track_step(track: &mut Option<Track>, dt_s: f32, x: f32, y: f32, std_px: f32) -> bool {
    let Some(track) = track else { return false };
    let before = *track;
    let done = track.predict(dt_s).and_then(|()| track.correct(&Measurement::isotropic(x, y, std_px)));
    if done.is_err() {
        *track = before;
    }
    done.is_ok()
}

/// Size of a track in bytes, for the report.
#[unsafe(no_mangle)]
pub static TRACK_BYTES: u32 = size_of::<Track>() as u32;
