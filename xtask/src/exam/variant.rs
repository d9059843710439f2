//! The ways in which the exam's clips are seen.

/// Another way to see a clip.
#[derive(Clone, Copy, Debug, PartialEq, clap::ValueEnum)]
pub enum Variant {
    /// Grey, else as it is: what the others are compared with.
    Same,
    /// Left is right.
    Mirrored,
    /// The last frame first.
    Reversed,
    /// From a third of its frames on.
    Late,
    /// Every second frame, at half the rate.
    HalfRate,
    /// Bright is dark.
    Negative,
    /// Means of 2 x 2 pixels.
    HalfSize,
    /// With white noise of three counts.
    Noisy,
    /// The light falls to half and comes back, once in six seconds, as an exposure follows what comes by.
    Dimming,
    /// Rows are columns.
    Transposed,
    /// Each pixel is 2 x 2, interpolated.
    DoubleSize,
    /// Every fifth frame twice, as a recorder brings 25 to 30 frames/s.
    Repeated,
    /// One frame in ten is lost and nothing says so.
    Lost,
    /// The picture stands for half a second in every four, as a link stalls, and goes on where it would be.
    Stalling,
    /// The light changes by a twentieth from frame to frame, as lamps do beside a shutter.
    Flickering,
    /// A clock that counts frames, a cross in the middle and the marks of a frame are drawn on the picture.
    Overlaid,
    /// Black bars above and below.
    Barred,
    /// The camera shakes by a pixel and a half, whole pixels, and shows a part of the picture.
    Jittering,
    /// Half a second of black in the middle.
    Black,
}
