//! Fuzz target: raw frames; the first bytes choose size and type.
#![no_main]

use boresight::io::{OpenOptions, RawFormat, RawType};
use boresight_fuzz::{catch_panics_of_others, frames, options};

libfuzzer_sys::fuzz_target!(init: catch_panics_of_others(), |data: &[u8]| {
    let [w, h, kind, data @ ..] = data else { return };
    let types = [RawType::U8, RawType::U16Le, RawType::U16Be, RawType::F32Le, RawType::Rgb8];
    let pixel = types[usize::from(*kind) % types.len()];
    let raw = RawFormat { width: usize::from(*w), height: usize::from(*h), pixel };
    frames(data, &[], ".raw", &OpenOptions { raw: Some(raw), ..options() });
});
