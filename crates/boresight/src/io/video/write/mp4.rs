//! Writes MP4 with H.264 that browsers and ffmpeg play, with the frames' own times.
//!
//! Frames are encoded on a thread of their own ([`super::encoding`]), so that drawing the next frame and encoding this
//! one overlap. The first frame is at time 0; times are rounded to 1/720 000 s without drift.
//! The file has its name only when it is whole: until then it is `NAME.part`, removed if the writer is dropped.
//! Limits: 8 bit 4:2:0, at most 3840 x 2160 pixels (level 5.2 of the encoder), one hour between two frames.

use super::encoding::{Encoding, Work};
use super::options::{MAX_SIZE, Mp4Options};
use crate::{Error, ErrorKind, Image, Result, Timestamp};
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, SyncSender, channel, sync_channel};
use std::thread::JoinHandle;

/// A video being written.
pub struct Mp4Writer {
    path: PathBuf,
    size: (usize, usize),
    frames: Option<SyncSender<Work>>,
    spare: Receiver<Image<[u8; 3]>>,
    thread: Option<JoinHandle<Result<()>>>,
}

opaque_debug!(Mp4Writer);

impl Mp4Writer {
    /// Starts a video of `width` x `height` pixels.
    /// # Errors
    /// [`ErrorKind::Output`] if the file cannot be created or the size is beyond the encoder's.
    pub fn create(path: impl Into<PathBuf>, width: usize, height: usize, options: Mp4Options) -> Result<Self> {
        let path = path.into();
        let (long, short) = (width.max(height), width.min(height));
        if short == 0 || long > MAX_SIZE.0 || short > MAX_SIZE.1 {
            let what = format!("a video of {width} x {height} pixels cannot be written");
            return Err(Error::new(ErrorKind::Output, what)
                .at(path.display())
                .hint(format!("at most {} x {} pixels can; write a folder of PNG instead", MAX_SIZE.0, MAX_SIZE.1)));
        }
        let encoding = Encoding::new(&path, width, height, options).map_err(|e| e.at(path.display()))?;
        let (frames, frames_out) = sync_channel(2);
        let (spare_in, spare) = channel();
        let work = move || encoding.run(&frames_out, &spare_in);
        let thread = std::thread::Builder::new()
            .name("boresight-encode".into())
            .spawn(work)
            .map_err(|e| Error::new(ErrorKind::Output, "no thread for encoding can be started").because(e))?;
        Ok(Self { path, size: (width, height), frames: Some(frames), spare, thread: Some(thread) })
    }

    /// A picture to be drawn on whose memory is used again, if one is free.
    pub fn spare(&self) -> Option<Image<[u8; 3]>> {
        self.spare.try_recv().ok()
    }

    /// Appends a frame; times must rise.
    /// # Errors
    /// [`ErrorKind::Output`] if the frame has another size or its time does not rise, or the file cannot be written.
    pub fn write(&mut self, frame: Image<[u8; 3]>, time: Timestamp) -> Result<()> {
        if (frame.width(), frame.height()) != self.size {
            let (w, h) = self.size;
            let what = format!("a frame has {} x {} pixels, the video {w} x {h}", frame.width(), frame.height());
            return Err(Error::new(ErrorKind::Output, what).at(self.path.display()));
        }
        let sent = self.frames.as_ref().is_some_and(|f| f.send(Some((frame, time))).is_ok());
        if sent { Ok(()) } else { Err(self.outcome().err().unwrap_or_else(|| self.stopped())) }
    }

    /// Ends the video and gives it its name.
    /// # Errors
    /// [`ErrorKind::Output`] if it cannot be written, or has no frames.
    pub fn finish(mut self) -> Result<()> {
        if let Some(frames) = &self.frames {
            // A thread that no longer listens has an error to tell, which `outcome` fetches.
            let _ = frames.send(None);
        }
        self.outcome()
    }

    fn outcome(&mut self) -> Result<()> {
        self.frames = None;
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(result)) => result.map_err(|e| e.at(self.path.display())),
            _ => Err(self.stopped()),
        }
    }

    fn stopped(&self) -> Error {
        Error::new(ErrorKind::Output, "the encoder stopped").at(self.path.display())
    }
}

impl Drop for Mp4Writer {
    fn drop(&mut self) {
        // Waits until the unfinished file is gone; its fate was asked for by nobody.
        let _ = self.outcome();
    }
}

#[cfg(test)]
mod tests {
    use super::super::i420::I420;
    use super::*;
    use crate::Pixels;
    use crate::io::OpenOptions;
    use crate::io::video::open_mp4;

    fn ramp(width: usize, height: usize, k: usize) -> Image<[u8; 3]> {
        let pixel = |i: usize| [((i % width) * 3 + k * 7) as u8, ((i / width) * 3) as u8, 90];
        Image::from_vec(width, height, (0..width * height).map(pixel).collect()).unwrap()
    }

    #[test]
    fn every_frame_comes_back_with_its_own_time() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("out.mp4");
        // Uneven times, odd size.
        let times: Vec<i64> = vec![5_000_000_000, 5_040_000_000, 5_100_000_000, 5_100_100_000, 7_000_000_000];
        for expected_frames in [None, Some(5)] {
            let options = Mp4Options { expected_frames, ..Mp4Options::default() };
            let mut w = Mp4Writer::create(&path, 35, 27, options).unwrap();
            for (k, t) in times.iter().enumerate() {
                w.write(ramp(35, 27, k), Timestamp::from_ns(*t)).unwrap();
            }
            w.finish().unwrap();
            let mut source = open_mp4(&path, &OpenOptions::default()).unwrap();
            assert_eq!((source.info().width, source.info().n_frames), (36, Some(5)));
            for (k, t) in times.iter().enumerate() {
                let frame = source.next_frame().unwrap().unwrap();
                assert!((frame.time.ns - (t - times[0])).abs() <= 700, "{} {t}", frame.time.ns);
                let Pixels::Gray8(luma) = &frame.pixels else { panic!("luma wanted") };
                let mut want = I420::default();
                want.fill(&ramp(35, 27, k));
                let error: u32 = luma.as_slice().iter().zip(&want.y).map(|(a, b)| u32::from(a.abs_diff(*b))).sum();
                // Quantiser 24 keeps the mean error of smooth pictures below 3 levels.
                assert!(error < 3 * want.y.len() as u32, "mean error {}", error as f64 / want.y.len() as f64);
            }
            assert!(source.next_frame().unwrap().is_none());
        }
    }

    #[test]
    fn what_was_not_taken_at_the_rate_of_video_can_be_watched() {
        let dir = tempfile::tempdir().unwrap();
        // A frame in ten minutes with a pause of a day, and ten thousand a second.
        for (interval_ns, pause_ns, shown_ns) in
            [(600_000_000_000, 86_400_000_000_000, 333_333_333), (100_000, 0, 8_333_333)]
        {
            let path = dir.path().join("out.mp4");
            let options = Mp4Options { watchable: true, ..Mp4Options::default() };
            let mut writer = Mp4Writer::create(&path, 32, 32, options).unwrap();
            for k in 0..14 {
                let ns = k * interval_ns + if k > 11 { pause_ns } else { 0 };
                writer.write(Image::filled(32, 32, [9 * k as u8; 3]), Timestamp::from_ns(ns)).unwrap();
            }
            writer.finish().unwrap();
            let mut video = open_mp4(&path, &OpenOptions::default()).unwrap();
            let mut times = Vec::new();
            while let Some(frame) = video.next_frame().unwrap() {
                times.push(frame.time.ns);
            }
            assert_eq!(times.len(), 14);
            for (k, gap) in times.windows(2).map(|w| w[1] - w[0]).enumerate() {
                let expected = if k == 11 { shown_ns + pause_ns / 1800 } else { shown_ns };
                assert!((gap - expected).abs() < 3000, "frame {k}: {gap} ns, not {expected}");
            }
        }
    }

    #[test]
    fn an_unfinished_video_leaves_nothing_behind() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("out.mp4");
        let mut w = Mp4Writer::create(&path, 32, 32, Mp4Options::default()).unwrap();
        w.write(ramp(32, 32, 0), Timestamp::from_ns(0)).unwrap();
        drop(w);
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    }

    #[test]
    fn times_that_do_not_rise_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let mut w = Mp4Writer::create(dir.path().join("out.mp4"), 32, 32, Mp4Options::default()).unwrap();
        w.write(ramp(32, 32, 0), Timestamp::from_ns(1000)).unwrap();
        let second = w.write(ramp(32, 32, 1), Timestamp::from_ns(0));
        let err = second.and(w.finish()).unwrap_err();
        assert!(err.to_string().contains("must rise"), "{err}");
    }

    #[test]
    fn a_size_beyond_the_encoders_is_refused_with_a_way_out() {
        let dir = tempfile::tempdir().unwrap();
        let err = Mp4Writer::create(dir.path().join("a.mp4"), 5000, 100, Mp4Options::default()).err().unwrap();
        assert!(err.to_string().contains("PNG"), "{err}");
    }
}
