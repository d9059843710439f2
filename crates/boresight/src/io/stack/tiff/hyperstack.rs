//! Which pages of a TIFF are the frames of one channel and one plane, by what ImageJ or OME wrote into its description.
//!
//! Source: ImageJ's TIFF description (`ImageJ=`, then lines `images=`, `channels=`, `slices=`, `frames=`; pages run through
//! channels, then slices, then frames) and the OME data model (`SizeC`, `SizeZ`, `SizeT`, `DimensionOrder`). Read as frames one
//! after the other, two channels would look like a scene that jumps to and fro.
//! Limits: of OME, files whose time runs slowest (`DimensionOrder` ends with T); others are taken page by page.

/// What a description says of the pages.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Stack {
    /// Pages of the whole stack, where it is said.
    pub n_pages: Option<u64>,
    /// Channels, from 1.
    pub channels: u64,
    /// Planes in depth, from 1.
    pub slices: u64,
    /// Times, from 1.
    pub frames: u64,
}

impl Stack {
    /// Pages from one time to the next, at least 1.
    pub fn step(&self) -> u64 {
        // A stack without times is one that was saved with its times as slices or as channels.
        if self.frames > 1 { self.channels.saturating_mul(self.slices).max(1) } else { 1 }
    }
}

/// Reads a page's description; `None` if it is neither ImageJ's nor OME's.
pub(crate) fn of_description(text: &str) -> Option<Stack> {
    if text.starts_with("ImageJ=") {
        let value = |key: &str| {
            let line = text.lines().find_map(|l| l.strip_prefix(key)?.strip_prefix('='))?;
            line.trim().parse::<u64>().ok().filter(|n| *n > 0)
        };
        let one = |key: &str| value(key).unwrap_or(1);
        let (channels, slices, frames) = (one("channels"), one("slices"), one("frames"));
        return Some(Stack { n_pages: value("images"), channels, slices, frames });
    }
    let pixels = text.split("<Pixels").nth(1)?.split('>').next()?;
    let word = |key: &str| pixels.split(&format!(" {key}=\"")).nth(1)?.split('"').next();
    let size = |key: &str| word(key).and_then(|w| w.parse::<u64>().ok()).filter(|n| *n > 0);
    let (channels, slices, frames) = (size("SizeC")?, size("SizeZ")?, size("SizeT")?);
    word("DimensionOrder")?.ends_with('T').then_some(Stack { n_pages: None, channels, slices, frames })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_found_behind_channels_and_slices() {
        // As tifffile writes them.
        let text = "ImageJ=1.11a\nimages=120\nchannels=2\nslices=3\nframes=20\nhyperstack=true\nmode=grayscale\n";
        let stack = of_description(text).unwrap();
        assert_eq!((stack.step(), stack.n_pages), (6, Some(120)));
        let ome = "<?xml?><OME><Image><Pixels DimensionOrder=\"XYCZT\" ID=\"P:0\" SizeC=\"2\" SizeT=\"5\" SizeX=\"9\" SizeY=\"9\" SizeZ=\"1\" Type=\"uint16\"><TiffData/></Pixels>";
        assert_eq!(of_description(ome).unwrap().step(), 2);
        assert_eq!(of_description(&ome.replace("XYCZT", "XYTCZ")), None);
    }

    #[test]
    fn a_stack_saved_as_slices_is_a_sequence() {
        assert_eq!(of_description("ImageJ=1.53t\nimages=40\nslices=40\n").unwrap().step(), 1);
        for other in ["", "made by hand", "ImageJ", "<Pixels", "<Pixels SizeC=\"x\">"] {
            assert_eq!(of_description(other), None, "{other}");
        }
        assert_eq!(of_description("ImageJ=1\nchannels=99999999999999999999\nframes=-3\n").unwrap().step(), 1);
    }
}
