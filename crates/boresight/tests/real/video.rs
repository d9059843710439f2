//! Decoded video equals ffmpeg's frames: count, presentation times, luma bytes; colour; what reaches the program.
//!
//! The reference tables were made with `cargo xtask video-check --reference` (ffmpeg 5.1): number of frames, then the
//! FNV-1a hash of (time in ns, Adler-32 of the luma plane) over the first 40 frames and over all of them.
//! `BORESIGHT_WHOLE_VIDEOS=1` checks all frames of the public clips, else the first 40; the small clips are always whole.

use crate::needs::{FFMPEG, Test, data, real_tests};
use boresight::io::video::{open_ffmpeg, open_mp4};
use boresight::io::{Colour, OpenOptions, open};
use boresight::{ErrorKind, FrameSource, Pixels};
use std::path::{Path, PathBuf};

/// Frames of the short check.
const HEAD: usize = 40;

/// The tests of this file, and one for each video of the tables.
pub fn tests() -> Vec<Test> {
    let table = |name: &str| std::fs::read_to_string(data_folder().join(name)).unwrap();
    let whole = std::env::var_os("BORESIGHT_WHOLE_VIDEOS").is_some();
    let mut tests = with_ffmpeg();
    for line in table("reference.txt").lines().map(ToString::to_string) {
        let name = line.split(' ').next().unwrap_or("").to_string();
        let needs: &[&str] = if is_in_process(&name) { &[] } else { &[FFMPEG] };
        tests.push(Test::new(format!("video equals ffmpeg's frames: {name}"), needs, move || {
            check(&line, data_folder().parent().unwrap(), true);
        }));
    }
    for line in table("public.txt").lines().map(ToString::to_string) {
        let name = line.split(' ').next().unwrap_or("").to_string();
        let needs = if is_in_process(&name) { vec![name.as_str()] } else { vec![name.as_str(), FFMPEG] };
        tests.push(Test::new(format!("video equals ffmpeg's frames: {name}"), &needs, move || {
            check(&line, &data(""), whole);
        }));
    }
    tests
}

real_tests! { with_ffmpeg:
    colour_of_the_test_pattern_is_what_ffmpeg_shows needs [FFMPEG];
    inputs_that_look_like_options_are_files needs [FFMPEG];
}

fn adler32(bytes: impl Iterator<Item = u8>) -> u32 {
    // RFC 1950, started at 0 as ffmpeg's framecrc does; sums are reduced before they can overflow.
    let (a, b) = bytes.fold((0u64, 0u64), |(a, b), v| {
        let a = a + u64::from(v);
        (a, b + a)
    });
    ((b % 65521) as u32) << 16 | (a % 65521) as u32
}

fn fnv(rows: &[(i64, u32)]) -> u64 {
    let bytes = rows.iter().flat_map(|(t, c)| t.to_le_bytes().into_iter().chain(c.to_le_bytes()));
    bytes.fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3))
}

fn rows(source: &mut dyn FrameSource, limit: usize) -> Vec<(i64, u32)> {
    let mut rows = Vec::new();
    while let Some(frame) = if rows.len() < limit { source.next_frame().unwrap() } else { None } {
        let sum = match &frame.pixels {
            Pixels::Gray8(i) => adler32(i.as_slice().iter().copied()),
            Pixels::Gray16(i) => adler32(i.as_slice().iter().flat_map(|v| v.to_le_bytes())),
            other => panic!("luma wanted, got {:?}", other.kind()),
        };
        assert_eq!(frame.index.0, rows.len() as u64);
        rows.push((frame.time.ns, sum));
        source.recycle(frame);
    }
    rows
}

fn data_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/video")
}

/// Whether a clip is H.264 as it is decoded in process.
fn is_in_process(name: &str) -> bool {
    !["avi", "444.mp4", "lossless.mp4", "hevc.mp4"].iter().any(|end| name.ends_with(end))
}

/// Checks one row of a table.
fn check(line: &str, root: &Path, whole: bool) {
    let fields: Vec<&str> = line.split_whitespace().collect();
    let [name, n, head, all] = fields[..] else { panic!("odd line {line}") };
    let path = root.join(name);
    let in_process = is_in_process(name);
    let mut source = open(&path, &OpenOptions::default()).unwrap();
    assert_eq!(source.info().reader.starts_with("H.264 in process"), in_process, "{name}: {}", source.info().reader);
    let n: usize = n.parse().unwrap();
    if in_process {
        assert_eq!(source.info().n_frames, Some(n as u64), "{name}");
    }
    let got = rows(source.as_mut(), if whole { usize::MAX } else { HEAD });
    assert_eq!(format!("{:016x}", fnv(&got[..got.len().min(HEAD)])), head, "{name}: the first {HEAD} frames");
    if whole {
        assert_eq!((got.len(), format!("{:016x}", fnv(&got))), (n, all.to_string()), "{name}: all frames");
    }
}

fn colour_of_the_test_pattern_is_what_ffmpeg_shows() {
    // Red, green and blue areas of testsrc2 as `ffmpeg -pix_fmt rgb24` gives them are compared through the pipe.
    let path = data_folder().join("b_frames.mp4");
    let options = OpenOptions { colour: Colour::Rgb, ..OpenOptions::default() };
    let mut ours = open_mp4(&path, &options).unwrap();
    let mut theirs = open_ffmpeg(&path, &options).unwrap();
    while let Some(a) = ours.next_frame().unwrap() {
        let b = theirs.next_frame().unwrap().unwrap();
        let (Pixels::Rgb8(a), Pixels::Rgb8(b)) = (&a.pixels, &b.pixels) else { panic!("colour wanted") };
        let error: u32 = (a.as_slice().as_flattened().iter().zip(b.as_slice().as_flattened()))
            .map(|(a, b)| u32::from(a.abs_diff(*b)))
            .sum();
        let mean = f64::from(error) / (3 * 64 * 48) as f64;
        // ffmpeg's scaler rounds otherwise and interpolates chroma; a wrong matrix or range is off by 8 and more.
        assert!(mean < 3.0, "mean difference {mean}");
    }
    assert!(theirs.next_frame().unwrap().is_none());
}

fn inputs_that_look_like_options_are_files() {
    let dir = tempfile::tempdir().unwrap();
    for name in ["-version", "a:b%03d.mp4"] {
        let path = dir.path().join(name);
        std::fs::copy(data_folder().join("hevc.mp4"), &path).unwrap();
        let mut source = open_ffmpeg(&path, &OpenOptions::default()).unwrap();
        assert_eq!((rows(source.as_mut(), usize::MAX).len(), source.info().rate_hz), (25, Some(25.0)), "{name}");
    }
    let err = open_ffmpeg("-version", &OpenOptions::default()).err().unwrap();
    assert_eq!(err.kind(), ErrorKind::NotFound);
    std::fs::write(dir.path().join("noise.mkv"), [7u8; 5000]).unwrap();
    let err = open_ffmpeg(dir.path().join("noise.mkv"), &OpenOptions::default()).err().unwrap();
    assert!(err.to_string().contains("ffmpeg cannot read it"), "{err}");
    // Dropped before its end, the program must not linger: this would hang if it did.
    let source = open_ffmpeg(data_folder().join("yuv444.mp4"), &OpenOptions::default()).unwrap();
    drop(source);
}
