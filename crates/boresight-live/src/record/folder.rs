//! The folder of a record: rolling segments, limits of size and age, one manifest.
//!
//! One run at a time writes a folder (a locked file keeps others out); the next one goes on with the next number. `manifest.json` appears whole at
//! every change of segments. Only files with the names of segments are ever removed.

use super::entry::{ENDINGS, Entry, path};
use super::film::Film;
use super::segment::Segment;
use crate::board::Board;
use crate::output::{LiveOutput, Shown};
use boresight::track::TrackerParameters;
use boresight::{Config, Error, ErrorKind, PixelKind, Result, Scan, io};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};

/// A manifest larger than this is none of ours, bytes.
const MAX_MANIFEST: u64 = 64 << 20;
/// How long a record that cannot be written rests before it is tried again.
const REST: Duration = Duration::from_secs(10);

/// Sizes and ages of a record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RecordOptions {
    /// A segment is closed when it is this large, bytes.
    pub segment_bytes: u64,
    /// Or this old.
    pub segment_age: Duration,
    /// The oldest segments go when all together are larger than this, bytes.
    pub most_bytes: u64,
    /// Segments older than this go.
    pub most_age: Duration,
}

impl Default for RecordOptions {
    fn default() -> Self {
        Self {
            segment_bytes: 64 << 20,
            segment_age: Duration::from_secs(3600),
            most_bytes: 8 << 30,
            most_age: Duration::from_secs(30 * 24 * 3600),
        }
    }
}

#[derive(Serialize, Deserialize)]
struct Manifest {
    schema: String,
    segments: Vec<Entry>,
}

const SCHEMA: &str = "boresight.record/1";

/// A record being written.
pub struct Record {
    dir: PathBuf,
    options: RecordOptions,
    config: String,
    /// What the tracker assumes from the next line on, where it is other than before.
    parameters: Option<TrackerParameters>,
    _lock: File,
    open: Option<(Segment, Instant)>,
    /// Closed segments by their number.
    closed: BTreeMap<u64, Entry>,
    rests_until: Option<Instant>,
    film: Option<Film>,
    /// Size and kind of the pictures: a video has one.
    size: Option<(usize, usize, PixelKind)>,
}

impl Record {
    /// Makes or goes on with a folder.
    /// # Errors
    /// [`ErrorKind::Output`] if it cannot be written, or another run is writing it.
    pub fn create(dir: impl Into<PathBuf>, options: RecordOptions) -> Result<Self> {
        let dir = dir.into();
        let failed =
            |e: std::io::Error| Error::new(ErrorKind::Output, "cannot be written").at(dir.display()).because(e);
        std::fs::create_dir_all(&dir).map_err(failed)?;
        let lock = File::create(dir.join("lock")).map_err(failed)?;
        if matches!(lock.try_lock(), Err(TryLockError::WouldBlock)) {
            return Err(Error::new(ErrorKind::Output, "another run is recording here")
                .at(dir.display())
                .hint("give each run a folder of its own"));
        }
        let mut closed = on_disk(&dir).map_err(failed)?;
        for known in read_manifest(&dir.join("manifest.json")) {
            if let Some(entry) = closed.get_mut(&known.number) {
                *entry = Entry { bytes: entry.bytes, open: false, ..known };
            }
        }
        let (config, open, rests_until, film, size) = (String::new(), None, None, None, None);
        Ok(Self { dir, options, config, parameters: None, _lock: lock, open, closed, rests_until, film, size })
    }

    /// Records the pictures too, as a video beside the tables; `board` counts and says what is left out of it.
    /// # Errors
    /// A system without threads.
    pub fn with_video(mut self, board: &Arc<Board>) -> Result<Self> {
        self.film = Some(Film::start(&self.dir, Arc::clone(board))?);
        Ok(self)
    }

    /// What the manifest says of a segment, with its pictures.
    fn told(&self, entry: &Entry) -> Entry {
        let filmed =
            self.film.as_ref().map(|film| film.of(entry.number)).filter(|filmed| *filmed != Default::default());
        match filmed {
            Some(filmed) => Entry { bytes: entry.bytes + filmed.bytes, video: Some(filmed), ..entry.clone() },
            None => entry.clone(),
        }
    }

    fn roll(&mut self) -> Result<()> {
        self.close();
        let number = self.closed.last_key_value().map_or(1, |(n, _)| n + 1);
        // A number that was begun and failed is passed over.
        self.closed.insert(number, Entry { number, ..Entry::default() });
        let segment = Segment::create(&self.dir, number, &self.config)?;
        self.closed.remove(&number);
        self.open = Some((segment, Instant::now()));
        self.enforce();
        self.write_manifest()
    }

    fn close(&mut self) {
        if let Some((segment, _)) = self.open.take() {
            self.closed.insert(segment.entry.number, Entry { open: false, ..segment.entry });
        }
    }

    /// Removes the oldest segments beyond the limits.
    fn enforce(&mut self) {
        let is_old = |number: u64| {
            let modified = std::fs::metadata(path(&self.dir, number, ENDINGS[0])).and_then(|m| m.modified());
            let age = modified.ok().and_then(|m| SystemTime::now().duration_since(m).ok());
            age.is_some_and(|age| age > self.options.most_age)
        };
        let open = self.open.as_ref().map_or(0, |(s, _)| self.told(&s.entry).bytes);
        while let Some((&oldest, _)) = self.closed.first_key_value() {
            let bytes = open + self.closed.values().map(|e| self.told(e).bytes).sum::<u64>();
            if bytes <= self.options.most_bytes && !is_old(oldest) {
                return;
            }
            self.closed.remove(&oldest);
            self.film.iter().for_each(|film| film.forget(oldest));
            // One that is gone already is as gone as it shall be.
            ENDINGS.iter().for_each(|ending| drop(std::fs::remove_file(path(&self.dir, oldest, ending))));
        }
    }

    fn write_manifest(&self) -> Result<()> {
        let open = self.open.as_ref().map(|(s, _)| &s.entry);
        let segments = self.closed.values().chain(open).map(|entry| self.told(entry)).collect();
        let manifest = Manifest { schema: SCHEMA.into(), segments };
        let text = serde_json::to_vec_pretty(&manifest).unwrap_or_default();
        io::write_whole(self.dir.join("manifest.json"), &text)
    }

    /// Writes, unless the last try failed a moment ago.
    fn unless_it_rests(&mut self, write: impl FnOnce(&mut Self) -> Result<()>) -> Result<()> {
        if self.rests_until.is_some_and(|until| Instant::now() < until) {
            return Err(
                Error::new(ErrorKind::Output, "the record rests: it could not be written").at(self.dir.display())
            );
        }
        let outcome = write(self);
        self.rests_until = outcome.is_err().then(|| Instant::now() + REST);
        if outcome.is_err() {
            // What is half written stays readable; the next try begins a segment of its own.
            self.close();
        }
        outcome
    }

    fn write(&mut self, shown: &Shown<'_>) -> Result<()> {
        let is_full = |(segment, since): &(Segment, Instant)| {
            self.told(&segment.entry).bytes >= self.options.segment_bytes || since.elapsed() >= self.options.segment_age
        };
        let pixels = shown.view.frame.filter(|_| self.film.is_some()).map(|frame| &frame.pixels);
        let size = pixels.map(|p| (p.width(), p.height(), p.kind()));
        let is_other = size.is_some() && self.size.is_some() && size != self.size;
        if is_other || self.open.as_ref().is_none_or(is_full) {
            self.roll()?;
        }
        self.size = size.or(self.size);
        let Some((segment, _)) = &mut self.open else { return Ok(()) };
        segment.put(shown, self.parameters.take().as_ref())?;
        if let (Some(film), Some(pixels)) = (&mut self.film, pixels) {
            film.put(segment.entry.number, pixels, shown.when.time);
        }
        Ok(())
    }
}

/// The segments that lie in a folder, by their number.
fn on_disk(dir: &Path) -> std::io::Result<BTreeMap<u64, Entry>> {
    let mut found = BTreeMap::new();
    for entry in std::fs::read_dir(dir)? {
        let entry = entry?;
        let name = entry.file_name();
        let Some((number, ending)) = name.to_str().and_then(|n| n.split_once('.')) else { continue };
        if number.len() >= 6
            && ENDINGS.contains(&ending)
            && let Ok(number) = number.parse::<u64>()
            && number < u64::MAX
        {
            let known = found.entry(number).or_insert(Entry { number, ..Entry::default() });
            known.bytes += entry.metadata()?.len();
        }
    }
    Ok(found)
}

fn read_manifest(path: &Path) -> Vec<Entry> {
    // One that is damaged only loses the times; the files are what is recorded.
    let small = std::fs::metadata(path).is_ok_and(|m| m.len() <= MAX_MANIFEST);
    let text = if small { std::fs::read(path).unwrap_or_default() } else { Vec::new() };
    serde_json::from_slice::<Manifest>(&text).map(|m| m.segments).unwrap_or_default()
}

impl LiveOutput for Record {
    fn configured(&mut self, config: &Config) {
        self.config = config.to_toml().unwrap_or_default();
        // A segment has one configuration: what follows another goes into the next, and what was learnt before it is in it or overruled by it.
        self.parameters = None;
        self.close();
    }

    fn adapted(&mut self, parameters: &TrackerParameters, config: &Config) {
        // The segment goes on: its lines say from where on. The next one begins with them.
        self.config = config.to_toml().unwrap_or_default();
        self.parameters = Some(*parameters);
    }

    fn put(&mut self, shown: &Shown<'_>) -> Result<()> {
        self.unless_it_rests(|record| record.write(shown))
    }

    fn late(&mut self, scan: &Scan, arrived_unix_s: f64) -> Result<()> {
        self.unless_it_rests(|record| {
            if record.open.is_none() {
                record.roll()?;
            }
            record.open.as_mut().map_or(Ok(()), |(segment, _)| segment.put_late(scan, arrived_unix_s))
        })
    }

    fn finish(&mut self) {
        self.close();
        self.film.iter_mut().for_each(Film::finish);
        let _ = self.write_manifest();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::When;
    use boresight::{Detection, FrameIndex, Scan, Timestamp, View};

    fn put(record: &mut Record, k: u64) -> Result<()> {
        let time = Timestamp::from_ns(k as i64 * 40_000_000);
        let scan = Scan::at(FrameIndex(k), time).with_detections(vec![Detection::point(1.5, 2.0, 0.5)]);
        let when = When { frame: k, time, arrived_unix_s: 1e9 + k as f64 };
        record.put(&Shown { view: View { frame: None, scan: &scan, tracks: &[] }, when, tracks: &[], events: &[] })
    }

    #[test]
    fn what_is_set_overrules_what_was_learnt_before_it() {
        let dir = tempfile::tempdir().unwrap();
        let mut record = Record::create(dir.path(), RecordOptions::default()).unwrap();
        let mut config = Config::default();
        record.configured(&config);
        put(&mut record, 0).unwrap();
        record.adapted(&TrackerParameters::of(&config.tracker), &config);
        put(&mut record, 1).unwrap();
        record.adapted(&TrackerParameters::of(&config.tracker), &config);
        config.tracker.extra_noise_px = 3.0;
        record.configured(&config);
        put(&mut record, 2).unwrap();
        record.finish();
        let said =
            |n: u64| std::fs::read_to_string(path(dir.path(), n, "jsonl")).unwrap().matches("\"parameters\":").count();
        assert_eq!([said(1), said(2)], [1, 0]);
        let second = Config::from_file(&path(dir.path(), 2, "config.toml")).unwrap();
        assert_eq!(second.tracker.extra_noise_px, 3.0);
    }

    #[test]
    fn segments_roll_old_ones_go_and_nothing_else_does() {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("notes.csv"), "mine").unwrap();
        let options = RecordOptions { segment_bytes: 4000, most_bytes: 20_000, ..RecordOptions::default() };
        let mut record = Record::create(dir.path(), options).unwrap();
        assert!(Record::create(dir.path(), options).err().unwrap().to_string().contains("another run"));
        (0..500).for_each(|k| put(&mut record, k).unwrap());
        // As after a kill: the manifest is of the last roll, the files are whole.
        let segments = read_manifest(&dir.path().join("manifest.json"));
        drop(record);
        let (first, last) = (segments[0].number, segments.last().unwrap());
        assert!(first > 1 && last.number > first + 2 && last.open, "{segments:?}");
        assert!(!path(dir.path(), 1, "jsonl").exists() && dir.path().join("notes.csv").exists());
        let bytes: u64 = on_disk(dir.path()).unwrap().values().map(|e| e.bytes).sum();
        assert!(bytes < 25_000, "{bytes}");
        let text = std::fs::read_to_string(path(dir.path(), last.number, "jsonl")).unwrap();
        assert!(text.ends_with("}\n") && text.lines().all(|l| serde_json::from_str::<serde_json::Value>(l).is_ok()));
        // The next run goes on.
        let mut again = Record::create(dir.path(), options).unwrap();
        put(&mut again, 0).unwrap();
        again.finish();
        let segments = read_manifest(&dir.path().join("manifest.json"));
        assert_eq!(segments.last().unwrap().number, last.number + 1);
        assert_eq!(
            segments[0].frames.unwrap()[1] + 1,
            segments[1].frames.unwrap()[0],
            "no frame is lost between segments"
        );
    }

    #[test]
    fn the_pictures_lie_beside_the_tables_of_their_segment_and_go_with_it() {
        let dir = tempfile::tempdir().unwrap();
        let board = Arc::new(Board::new("cam", |_| {}));
        let options = RecordOptions { segment_bytes: 20_000, most_bytes: 60_000, ..RecordOptions::default() };
        let mut record = Record::create(dir.path(), options).unwrap().with_video(&board).unwrap();
        for k in 0..400u64 {
            let side = if k < 300 { 64 } else { 96 };
            let image =
                boresight::Image::from_vec(side, side, (0..side * side).map(|i| (i * 7919 % 251) as u8).collect());
            let time = Timestamp::from_ns(k as i64 * 40_000_000);
            let frame =
                boresight::Frame { index: FrameIndex(k), time, pixels: boresight::Pixels::Gray8(image.unwrap()) };
            let scan = Scan::at(FrameIndex(k), time);
            let when = When { frame: k, time, arrived_unix_s: 1e9 };
            let view = View { frame: Some(&frame), scan: &scan, tracks: &[] };
            record.put(&Shown { view, when, tracks: &[], events: &[] }).unwrap();
            // The pictures of a run come by the clock; here they wait for the coder.
            while waits(&record) {
                std::thread::yield_now();
            }
        }
        record.finish();
        let segments = read_manifest(&dir.path().join("manifest.json"));
        assert!(segments[0].number > 1 && segments.len() > 2, "old ones went: {segments:?}");
        assert!(!path(dir.path(), 1, "mp4").exists());
        for entry in &segments {
            let (file, frames) = (path(dir.path(), entry.number, "mp4"), entry.frames.unwrap());
            let mut video = io::open(file.display().to_string(), &io::OpenOptions::default()).unwrap();
            let mut n = 0;
            while let Some(frame) = video.next_frame().unwrap() {
                assert!((frame.time.ns - (frames[0] + n) as i64 * 40_000_000).abs() < 1000, "{entry:?}");
                n += 1;
            }
            assert_eq!((n, entry.video.unwrap().frames), (frames[1] + 1 - frames[0], n), "{entry:?}");
            assert_eq!(entry.video.unwrap().left_out, 0);
        }
        let bytes: u64 = segments.iter().map(|e| e.bytes).sum();
        let on_disk: u64 = on_disk(dir.path()).unwrap().values().map(|e| e.bytes).sum();
        assert_eq!(bytes, on_disk);
    }

    fn waits(record: &Record) -> bool {
        record.film.as_ref().is_some_and(|film| film.n_waiting() > 4)
    }
}
