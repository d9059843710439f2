//! How a video is written.

/// Largest picture that the encoder takes, px (longer side, shorter side).
pub const MAX_SIZE: (usize, usize) = (3840, 2160);

/// How a video is written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mp4Options {
    /// Quantiser of H.264, 10 (nearly lossless, large) to 40 (coarse, small).
    pub quantiser: u8,
    /// Frames between two from which decoding can start.
    pub key_every: u32,
    /// Takes what stands still as it was in the frame before, whatever is left between the two: a quarter less time before a fixed camera. For videos to be looked at, not measured.
    pub still_as_before: bool,
    /// Plays what was not taken at the rate of video so that it can be watched: frames that are farther apart than a third of a second (by the first ten) at three a second, more than 120 a
    /// second at that.
    pub watchable: bool,
    /// Number of frames, if known: their table is then put in front, so that players can start before all is loaded.
    pub expected_frames: Option<u64>,
}

impl Default for Mp4Options {
    fn default() -> Self {
        Self { quantiser: 26, key_every: 60, still_as_before: false, watchable: false, expected_frames: None }
    }
}
