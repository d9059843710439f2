//! Which decoder decodes: the fast one where it is exact, the complete one for everything else, without a picture lost between them.
//!
//! The fast decoder refuses what it does not do, and whatever looks damaged. Then the complete one decodes again from the last refresh,
//! throws away what has been handed out, and its word on the sample is the last one. The next refresh is the fast one's again, unless it
//! refused too often. Order counts compare within a period, from one instantaneous refresh to the next; whichever decodes, the periods are counted here.
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
    /// Instantaneous refreshes and resets so far.
    period: u32,
    /// Step from which the fast one decodes: the last refresh, or the first sample after a reset. `None`: the complete one decodes.
    since: Option<usize>,
    refusals: u32,
    /// After a reset both begin anew.
    is_new: bool,
}

impl Decoders {
    pub fn new(configurations: Vec<Vec<u8>>, max_pixels: u64, may_be_fast: bool) -> Self {
        Self {
            fast: Progressive::new(configurations.clone(), max_pixels),
            complete: AccessUnits::new(configurations, max_pixels),
            may_be_fast,
            period: 0,
            since: None,
            refusals: 0,
            is_new: true,
        }
    }

    /// Reads the parameter sets of a sample description, so that the size is known.
    pub fn configure(&mut self, description: u16) -> Result<(), Refusal> {
        self.complete.configure(description)
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
        let refreshes = self.fast.refreshes(data);
        self.period += u32::from(refreshes);
        let at = (step, self.period);
        let ask_fast = self.may_be_fast && self.refusals < MAX_REFUSALS && !self.fast.unfit;
        if ask_fast && (self.is_new || refreshes) {
            if self.since.is_none() {
                self.fast.reset();
            }
            self.since = Some(step);
        }
        self.is_new = false;
        let Some(since) = self.since else {
            return self.complete.decode(data, sample.description, at, out);
        };
        if self.fast.decode(data, sample.description, at, out).is_ok() {
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
            self.complete.decode(&earlier, sample.description, (k, self.period), &mut again)?;
            again.clear();
        }
        self.complete.decode(data, sample.description, at, out)
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
        self.period += 1;
        self.since = None;
        self.is_new = true;
    }
}

#[cfg(test)]
mod tests {
    use super::super::source::{Opened, open_by};
    use crate::io::{Colour, ColoursBeside, KeepColours, OpenOptions};
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

    /// A clip whose file does not say in which order its pictures are shown: its composition offsets are renamed, and the edit list that goes with them.
    fn without_order(name: &str, dir: &Path) -> PathBuf {
        let mut bytes = std::fs::read(clip(name)).unwrap();
        for kind in [b"ctts", b"edts"] {
            let at = bytes.windows(4).position(|w| w == kind).unwrap();
            bytes[at..at + 4].copy_from_slice(b"free");
        }
        let path = dir.join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    }

    #[test]
    fn pictures_that_their_counts_order_are_the_same_by_both_decoders() {
        let dir = tempfile::tempdir().unwrap();
        for name in ["b_frames.mp4", "open_gop.mp4"] {
            let path = without_order(name, dir.path());
            let (reader, got) = frames(&path, Colour::Native, true);
            let (slower, want) = frames(&path, Colour::Native, false);
            assert!(
                reader.ends_with("fast decoder") && !slower.ends_with("fast decoder"),
                "{name}: {reader}, {slower}"
            );
            // As the file itself says where it does.
            let (_, ordered) = frames(&clip(name), Colour::Native, true);
            let pixels = |all: &[Frame]| all.iter().map(|f| f.pixels.clone()).collect::<Vec<_>>();
            assert!(!got.is_empty() && got == want && pixels(&got) == pixels(&ordered), "{name}");
        }
    }

    #[test]
    fn frames_that_are_wanted_are_whole_where_only_counts_order_them() {
        let dir = tempfile::tempdir().unwrap();
        let path = without_order("b_frames.mp4", dir.path());
        let all = frames(&path, Colour::Native, true).1;
        let Ok(Opened::Source(mut source)) = open_by(&path, &OpenOptions::default(), true) else { panic!("no video") };
        source.want_only(Box::new(|k| [3, 7, 11].contains(&k)));
        let mut seen = 0;
        while let Some(frame) = source.next_frame().unwrap() {
            if [3, 7, 11].contains(&frame.index.0) {
                assert_eq!(frame, all[frame.index.0 as usize]);
                seen += 1;
            }
        }
        assert_eq!(seen, 3);
    }

    #[test]
    fn frames_kept_in_colour_beside_grey_ones_are_those_of_their_numbers_whatever_orders_them() {
        let dir = tempfile::tempdir().unwrap();
        let name = "b_frames.mp4";
        let coloured = frames(&clip(name), Colour::Rgb, true).1;
        for path in [clip(name), without_order(name, dir.path())] {
            let colours = ColoursBeside::new(|_, _| KeepColours { over: 25, most: 25, every_px: 1 });
            let options = OpenOptions { colours_beside: Some(colours.clone()), ..OpenOptions::default() };
            let Ok(Opened::Source(mut source)) = open_by(&path, &options, true) else { panic!("no video") };
            while source.next_frame().unwrap().is_some() {}
            let kept = colours.take(25).unwrap();
            assert!(kept.iter().map(|f| &f.pixels).eq(coloured.iter().map(|f| &f.pixels)), "{}", path.display());
        }
    }

    #[test]
    fn a_damaged_sample_has_the_last_word_of_the_complete_decoder() {
        let dir = tempfile::tempdir().unwrap();
        for path in [clip("b_frames.mp4"), without_order("b_frames.mp4", dir.path())] {
            is_damaged_alike(&std::fs::read(path).unwrap(), dir.path());
        }
    }

    /// Damages a file here and there; both decoders lose the same frames, and some are lost.
    fn is_damaged_alike(sound: &[u8], dir: &Path) {
        let data = sound.windows(4).position(|w| w == b"mdat").unwrap() + 4;
        let end = sound.windows(4).position(|w| w == b"moov").unwrap();
        let mut lost = 0;
        for at in (data + 900..end - 64).step_by((end - data) / 12) {
            let mut damaged = sound.to_vec();
            damaged[at..at + 24].fill(0x55);
            let path = dir.join("damaged.mp4");
            std::fs::write(&path, &damaged).unwrap();
            let [fast, complete] = [true, false].map(|may| frames(&path, Colour::Native, may).1);
            let numbers = |f: &[Frame]| f.iter().map(|f| f.index.0).collect::<Vec<_>>();
            assert_eq!(numbers(&fast), numbers(&complete), "damaged at {at}");
            lost += usize::from(fast.len() < 25);
        }
        assert!(lost > 0, "no damage was seen");
    }
}
