//! Which decoder decodes: the fast one where it is exact, the complete one for everything else, without a picture lost between them.
//!
//! The fast decoder refuses what it does not do, and whatever looks damaged. Then the complete one decodes again from the last refresh,
//! throws away what has been handed out, and its word on the sample is the last one. The next refresh is the fast one's again, unless it
//! refused too often.
//! Limits: after three refusals the fast decoder is not asked again, so a stream's samples are decoded a second time at most three times over.

use super::h264::AccessUnits;
use super::picture::{Picture, PictureDecoder, Refusal};
use super::progressive::Progressive;
use super::sample::Sample;
use rust_h264::nal::SpsInfo;

/// Refusals after which the fast decoder is not asked again.
const MAX_REFUSALS: u32 = 3;

/// Reads the sample of a step into a buffer; `None` if there is no such step.
type ReadAgain<'a> = dyn FnMut(usize, &mut Vec<u8>) -> Option<Result<Sample, Refusal>> + 'a;

/// Both decoders of one track.
pub(super) struct Decoders {
    fast: Progressive,
    complete: AccessUnits,
    /// Whether the fast one may be asked.
    may_be_fast: bool,
    /// Step from which the fast one decodes: the last refresh, or the first sample after a reset. `None`: the complete one decodes.
    since: Option<usize>,
    refusals: u32,
    /// After a reset both begin anew.
    is_new: bool,
}

impl Decoders {
    pub fn new(configurations: Vec<Vec<u8>>, max_pixels: u64) -> Self {
        Self {
            fast: Progressive::new(configurations.clone(), max_pixels),
            complete: AccessUnits::new(configurations, max_pixels),
            may_be_fast: false,
            since: None,
            refusals: 0,
            is_new: true,
        }
    }

    /// Reads the parameter sets of a sample description, so that the size is known.
    pub fn configure(&mut self, description: u16) -> Result<(), Refusal> {
        self.complete.configure(description)
    }

    /// Says that pictures are ordered by the file's times, so that the fast decoder's order counts do not matter.
    pub fn allow_fast(&mut self) {
        self.may_be_fast = true;
    }

    /// The newest sequence parameter set.
    pub fn info(&self) -> Option<SpsInfo> {
        self.since.and(self.fast.info).or(self.complete.info)
    }

    /// Whether nothing that comes after it needs the picture of a sample, which then need not be decoded if nobody wants it.
    pub fn may_leave_out(&self, data: &[u8]) -> bool {
        self.since.is_some() && self.fast.is_needed_by_none(data)
    }

    /// What the frames are read with, for the summary.
    pub fn reader(&self) -> &'static str {
        if self.since.is_some() { "H.264 in process, fast decoder" } else { "H.264 in process, complete decoder" }
    }

    /// Decodes the sample of a step; `read` reads the sample of an earlier one again.
    pub fn decode(
        &mut self,
        (data, sample, step): (&[u8], &Sample, usize),
        read: &mut ReadAgain<'_>,
        out: &mut Vec<Picture>,
    ) -> Result<(), Refusal> {
        let ask_fast = self.may_be_fast && self.refusals < MAX_REFUSALS && !self.fast.unfit;
        if ask_fast && (self.is_new || self.fast.refreshes(data)) {
            if self.since.is_none() {
                self.fast.reset();
            }
            self.since = Some(step);
        }
        self.is_new = false;
        let Some(since) = self.since else {
            return self.complete.decode(data, sample.description, step, out);
        };
        if self.fast.decode(data, sample.description, step, out).is_ok() {
            return Ok(());
        }
        self.refusals += 1;
        self.since = None;
        self.complete.reset();
        let mut earlier = Vec::new();
        let mut again = Vec::new();
        for k in since..step {
            let Some(sample) = read(k, &mut earlier) else { continue };
            let sample = sample?;
            if k == since {
                self.complete.configure(sample.description)?;
                self.complete.feed(self.fast.sets())?;
            }
            self.complete.decode(&earlier, sample.description, k, &mut again)?;
            again.clear();
        }
        self.complete.decode(data, sample.description, step, out)
    }

    /// Ends the stream: gives the picture still held.
    pub fn finish(&mut self, out: &mut Vec<Picture>) {
        if self.since.is_none() {
            self.complete.finish(out);
        }
    }

    /// Forgets all pictures after damage; the next sync sample starts anew.
    pub fn reset(&mut self) {
        self.fast.reset();
        self.complete.reset();
        self.since = None;
        self.is_new = true;
    }
}

#[cfg(test)]
mod tests {
    use super::super::source::{Opened, open_by};
    use crate::io::{Colour, OpenOptions};
    use crate::{Frame, FrameSource};
    use std::path::{Path, PathBuf};

    fn clip(name: &str) -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/video").join(name)
    }

    /// What the first frame was read with, and all frames.
    fn frames(path: &Path, colour: Colour, may_be_fast: bool) -> (String, Vec<Frame>) {
        let options = OpenOptions { colour, ..OpenOptions::default() };
        let Ok(Opened::Source(mut source)) = open_by(path, &options, may_be_fast) else { panic!("{}", path.display()) };
        let mut frames = Vec::new();
        while let Some(frame) = source.next_frame().unwrap() {
            frames.push(frame);
        }
        (source.info().reader.clone(), frames)
    }

    #[test]
    fn both_decoders_give_the_same_frames() {
        let fast = ["b_frames", "slices", "open_gop", "cropped", "edit_list", "fragmented", "variable_rate"];
        let complete = ["interlaced", "ten_bit", "grey", "yuv422"];
        for (name, is_fast) in fast.iter().map(|n| (n, true)).chain(complete.iter().map(|n| (n, false))) {
            for colour in [Colour::Native, Colour::Rgb] {
                let path = clip(&format!("{name}.mp4"));
                let (reader, got) = frames(&path, colour, true);
                let (slower, want) = frames(&path, colour, false);
                assert_eq!(
                    (reader.ends_with("fast decoder"), slower.ends_with("fast decoder")),
                    (is_fast, false),
                    "{name}"
                );
                assert!(!got.is_empty() && got == want, "{name}: {} and {} frames", got.len(), want.len());
            }
        }
    }

    #[test]
    fn a_damaged_sample_has_the_last_word_of_the_complete_decoder() {
        let dir = tempfile::tempdir().unwrap();
        let sound = std::fs::read(clip("b_frames.mp4")).unwrap();
        let data = sound.windows(4).position(|w| w == b"mdat").unwrap() + 4;
        let end = sound.windows(4).position(|w| w == b"moov").unwrap();
        let mut lost = 0;
        for at in (data + 900..end - 64).step_by((end - data) / 12) {
            let mut damaged = sound.clone();
            damaged[at..at + 24].fill(0x55);
            let path = dir.path().join("damaged.mp4");
            std::fs::write(&path, &damaged).unwrap();
            let [fast, complete] = [true, false].map(|may| frames(&path, Colour::Native, may).1);
            let numbers = |f: &[Frame]| f.iter().map(|f| f.index.0).collect::<Vec<_>>();
            assert_eq!(numbers(&fast), numbers(&complete), "damaged at {at}");
            lost += usize::from(fast.len() < 25);
        }
        assert!(lost > 0, "no damage was seen");
    }
}
