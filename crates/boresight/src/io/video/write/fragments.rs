//! H.264 in fragmented MP4: what was written stays readable, however the writing ends.
//!
//! Source: ISO/IEC 14496-12, 8.8. The head (`ftyp`, `moov`) describes the coding; each fragment (`moof`, `mdat`) has its own table, begins with a picture from
//! which decoding can start, and says its own time (`tfdt`): the frames' times themselves, from 0, in 1/720 000 s, whatever is missing between fragments.
//! A frame enters its fragment when it comes; a fragment is handed out when the first frame after [`FRAGMENT_S`] has come, which says how long the last one stood.
//! Limits: times from 0 on that rise; 8 bits; a fragment of at most 64 MB.

use super::coder::{H264Coder, failed, sample_entry};
use super::encoding::{TIMESCALE, ticks_of};
use super::options::Mp4Options;
use crate::{Error, ErrorKind, Pixels, Result, Timestamp};
use shiguredo_mp4::boxes::{MfhdBox, MoofBox, SampleEntry, TfdtBox, TfhdBox, TrafBox, TrunBox, TrunSample};
use shiguredo_mp4::mux::{Fmp4SegmentMuxer, Sample};
use shiguredo_mp4::{Encode, SampleFlags, TrackKind};
use std::num::NonZeroU32;

/// Length of a fragment, s.
const FRAGMENT_S: i64 = 1;
/// A fragment that is larger is handed out before its time, bytes.
const MOST_BYTES: usize = 64 << 20;
/// The only track's number.
const TRACK: u32 = 1;

/// A frame of the fragment that is being made.
struct Waiting {
    ticks: i64,
    bytes: usize,
    is_key: bool,
}

/// Makes the bytes of a fragmented file.
pub struct Mp4Fragments {
    coder: H264Coder,
    waiting: Vec<Waiting>,
    data: Vec<u8>,
    has_head: bool,
    sequence: u32,
    last_duration: i64,
    last: Option<i64>,
    n_handed_out: u64,
}

opaque_debug!(Mp4Fragments);

impl Mp4Fragments {
    /// Begins a file; the first frame says its size and kind.
    pub fn new(options: Mp4Options) -> Self {
        // The fragments say where the keys are.
        let coder = H264Coder::new(Mp4Options { key_every: u32::MAX >> 1, ..options });
        let last_duration = i64::from(TIMESCALE / 25);
        let (waiting, data) = (Vec::new(), Vec::new());
        Self { coder, waiting, data, has_head: false, sequence: 0, last_duration, last: None, n_handed_out: 0 }
    }

    /// Takes a frame; appends to `out` what is whole now and belongs at the end of the file: nothing, or the head or a fragment.
    /// # Errors
    /// [`ErrorKind::Output`] for a time before 0 or not after the one before, or if the frame cannot be coded; the frame is left out.
    pub fn push(&mut self, pixels: &Pixels, time: Timestamp, out: &mut Vec<u8>) -> Result<()> {
        let ticks = ticks_of(time.ns.into())?;
        if ticks < 0 || self.last.is_some_and(|last| ticks <= last) {
            let what = format!("frame times must rise from 0 on; one is {} s", time.as_secs_f64());
            return Err(Error::new(ErrorKind::Output, what));
        }
        let is_over =
            self.waiting.first().is_some_and(|first| ticks - first.ticks >= FRAGMENT_S * i64::from(TIMESCALE));
        if is_over || self.data.len() >= MOST_BYTES {
            self.hand_out(Some(ticks), out)?;
        }
        let coded = self.coder.code(pixels, self.waiting.is_empty())?;
        if !self.has_head {
            out.extend(head(sample_entry((pixels.width(), pixels.height()), coded)?)?);
            self.has_head = true;
        }
        self.last = Some(ticks);
        self.data.extend_from_slice(&coded.data);
        self.waiting.push(Waiting { ticks, bytes: coded.data.len(), is_key: coded.is_key });
        Ok(())
    }

    /// Appends the fragment that is being made; its last frame stands as long as the one before. Frames may follow.
    /// # Errors
    /// [`ErrorKind::Output`] if its table cannot be made.
    pub fn flush(&mut self, out: &mut Vec<u8>) -> Result<()> {
        self.hand_out(None, out)
    }

    /// Frames that were handed out.
    pub fn n_frames(&self) -> u64 {
        self.n_handed_out
    }

    fn hand_out(&mut self, next: Option<i64>, out: &mut Vec<u8>) -> Result<()> {
        let Some(first) = self.waiting.first() else { return Ok(()) };
        let start = first.ticks as u64;
        let mut samples = Vec::with_capacity(self.waiting.len());
        for (k, frame) in self.waiting.iter().enumerate() {
            let until = self.waiting.get(k + 1).map(|w| w.ticks).or(next);
            let duration = until.map_or(self.last_duration, |until| until - frame.ticks);
            // A frame does not stand for hours; the next fragment says its own time.
            self.last_duration = duration.min(i64::from(u32::MAX));
            // ISO/IEC 14496-12, 8.8.3.1: depends on no other, or depends and no decoding starts there.
            let flags = SampleFlags::from_fields(0, if frame.is_key { 2 } else { 1 }, 0, 0, 0, !frame.is_key, 0);
            samples.push(TrunSample {
                duration: Some(self.last_duration as u32),
                size: Some(u32::try_from(frame.bytes).map_err(|e| failed("a frame is too large", e))?),
                flags: Some(flags),
                composition_time_offset: None,
            });
        }
        let mut moof = MoofBox {
            mfhd_box: MfhdBox { sequence_number: self.sequence.wrapping_add(1) },
            traf_boxes: vec![TrafBox {
                tfhd_box: TfhdBox {
                    track_id: TRACK,
                    base_data_offset: None,
                    sample_description_index: None,
                    default_sample_duration: None,
                    default_sample_size: None,
                    default_sample_flags: None,
                    duration_is_empty: false,
                    default_base_is_moof: true,
                },
                tfdt_box: Some(TfdtBox { version: 1, base_media_decode_time: start }),
                trun_boxes: vec![TrunBox { data_offset: Some(0), first_sample_flags: None, samples }],
                unknown_boxes: Vec::new(),
            }],
            unknown_boxes: Vec::new(),
        };
        let made = |e| failed("a fragment's table cannot be made", e);
        let length = moof.encode_to_vec().map_err(made)?.len() + 8;
        moof.traf_boxes[0].trun_boxes[0].data_offset =
            Some(i32::try_from(length).map_err(|e| failed("a fragment is too large", e))?);
        out.extend(moof.encode_to_vec().map_err(made)?);
        let bytes = u32::try_from(self.data.len() + 8).map_err(|e| failed("a fragment is too large", e))?;
        out.extend(bytes.to_be_bytes());
        out.extend(b"mdat");
        out.append(&mut self.data);
        self.n_handed_out += self.waiting.len() as u64;
        self.waiting.clear();
        self.sequence = self.sequence.wrapping_add(1);
        Ok(())
    }
}

/// The head of a file whose pictures are coded so.
fn head(entry: SampleEntry) -> Result<Vec<u8>> {
    let made = |e| failed("the file's head cannot be made", e);
    // The muxer describes what it has been shown; its tables of fragments, which count the time from 0, are not used.
    let mut muxer = Fmp4SegmentMuxer::new().map_err(made)?;
    let shown = Sample {
        track_kind: TrackKind::Video,
        sample_entry: Some(entry),
        keyframe: true,
        timescale: NonZeroU32::MIN.saturating_add(TIMESCALE - 1),
        duration: 1,
        composition_time_offset: None,
        data_offset: 0,
        data_size: 1,
    };
    muxer.create_media_segment_metadata(&[shown]).map_err(made)?;
    muxer.init_segment_bytes().map_err(made)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Image;
    use crate::io::OpenOptions;
    use crate::io::video::open_mp4;

    fn picture(k: usize) -> Pixels {
        let pixel = |i: usize| ((i % 48) * 4 + k) as u8;
        Pixels::Gray8(Image::from_vec(48, 32, (0..48 * 32).map(pixel).collect()).unwrap())
    }

    /// Uneven times with a gap of nine seconds, from a second after a day.
    fn times() -> Vec<i64> {
        let at =
            |k: i64| 86_401_000_000_000 + k * 40_000_000 + (k % 3) * 1_000_000 + if k > 60 { 9_000_000_000 } else { 0 };
        (0..100).map(at).collect()
    }

    fn read(bytes: &[u8]) -> Vec<(i64, Pixels)> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.mp4");
        std::fs::write(&path, bytes).unwrap();
        let mut source = open_mp4(&path, &OpenOptions::default()).unwrap();
        std::iter::from_fn(|| source.next_frame().unwrap()).map(|f| (f.time.ns, f.pixels)).collect()
    }

    #[test]
    fn every_frame_comes_back_with_its_time_and_what_is_cut_off_costs_its_fragment_alone() {
        let mut made = Mp4Fragments::new(Mp4Options::default());
        let (mut file, mut ends) = (Vec::new(), Vec::new());
        for (k, ns) in times().into_iter().enumerate() {
            let before = file.len();
            made.push(&picture(k), Timestamp::from_ns(ns), &mut file).unwrap();
            if file.len() > before {
                ends.push((file.len(), made.n_frames()));
            }
        }
        made.flush(&mut file).unwrap();
        assert_eq!(made.n_frames(), 100);
        let all = read(&file);
        assert_eq!(all.len(), 100);
        for (k, ((ns, pixels), want)) in all.iter().zip(times()).enumerate() {
            assert!((ns - want).abs() <= 700, "frame {k} at {ns}, not {want}");
            let (Pixels::Gray8(got), Pixels::Gray8(put)) = (pixels, picture(k)) else { panic!("grey wanted") };
            let error: u32 = got.as_slice().iter().zip(put.as_slice()).map(|(a, b)| u32::from(a.abs_diff(*b))).sum();
            // Quantiser 24 keeps the mean error of smooth pictures below 3 levels.
            assert!(error < 3 * 48 * 32, "frame {k}: mean error {}", f64::from(error) / (48.0 * 32.0));
        }
        // After every fragment, and in the middle of the next: the frames handed out before are there.
        assert!(ends.len() > 3, "{ends:?}");
        for (end, n) in ends.iter().skip(1) {
            assert_eq!(read(&file[..*end]).len() as u64, *n);
            for more in [1, 8, 9, 70] {
                assert_eq!(read(&file[..(end + more).min(file.len())]).len() as u64, *n, "{more} bytes more");
            }
            let some = read(&file[..(end + 800).min(file.len())]).len() as u64;
            assert!((*n..=100).contains(&some), "{some} after a cut in the pictures, {n} before");
        }
    }

    #[test]
    fn times_that_do_not_rise_are_left_out_and_the_rest_goes_on() {
        let mut made = Mp4Fragments::new(Mp4Options::default());
        let mut file = Vec::new();
        let mut push = |ns: i64| made.push(&picture(0), Timestamp::from_ns(ns), &mut file).map_err(|e| e.to_string());
        assert!(push(-1_000_000).unwrap_err().contains("rise from 0"));
        push(1_000_000_000).unwrap();
        assert!(push(1_000_000_000).is_err());
        push(1_100_000_000).unwrap();
        made.flush(&mut file).unwrap();
        let early = made.push(&picture(0), Timestamp::from_ns(500_000_000), &mut file);
        assert!(early.is_err(), "nor behind a fragment");
        assert_eq!(read(&file).len(), 2);
    }
}
