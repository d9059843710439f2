//! Decoded video equals ffmpeg's frames: count, presentation times, luma bytes; broken video ends in words.
//!
//! The reference tables were made with `cargo xtask video-check --reference` (ffmpeg 5.1): number of frames, then the
//! FNV-1a hash of (time in ns, Adler-32 of the luma plane) over the first 40 frames and over all of them.
//! `BORESIGHT_WHOLE_VIDEOS=1` checks all frames of the public clips, else the first 40; the small clips are always whole.

use boresight::io::video::{open_ffmpeg, open_mp4};
use boresight::io::{Colour, OpenOptions, open};
use boresight::{ErrorKind, FrameSource, Pixels};
use std::path::{Path, PathBuf};

const HEAD: usize = 40;

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

fn has_ffmpeg() -> bool {
    std::process::Command::new("ffmpeg").arg("-version").output().is_ok()
}

/// Checks one row of a table; `false` if it was skipped.
fn check(line: &str, root: &Path, whole: bool) -> bool {
    let fields: Vec<&str> = line.split_whitespace().collect();
    let [name, n, head, all] = fields[..] else { panic!("odd line {line}") };
    let path = root.join(name);
    let in_process = !["avi", "444.mp4", "lossless.mp4", "hevc.mp4"].iter().any(|end| name.ends_with(end));
    if !path.exists() || (!in_process && !has_ffmpeg()) {
        println!("skipped: {name} (not there, or no ffmpeg)");
        return false;
    }
    let mut source = open(&path.to_string_lossy(), &OpenOptions::default()).unwrap();
    assert_eq!(source.info().reader == "H.264 in process", in_process, "{name}: {}", source.info().reader);
    let n: usize = n.parse().unwrap();
    if in_process {
        assert_eq!(source.info().n_frames, Some(n as u64), "{name}");
    }
    let got = rows(source.as_mut(), if whole { usize::MAX } else { HEAD });
    assert_eq!(format!("{:016x}", fnv(&got[..got.len().min(HEAD)])), head, "{name}: the first {HEAD} frames");
    if whole {
        assert_eq!((got.len(), format!("{:016x}", fnv(&got))), (n, all.to_string()), "{name}: all frames");
    }
    true
}

#[test]
fn small_clips_of_every_kind_equal_ffmpegs_frames() {
    let table = std::fs::read_to_string(data_folder().join("reference.txt")).unwrap();
    let checked = table.lines().filter(|l| check(l, data_folder().parent().unwrap(), true)).count();
    assert!(checked >= 16, "{checked}");
}

#[test]
fn public_videos_equal_ffmpegs_frames() {
    let default = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let root = std::env::var_os("BORESIGHT_TEST_DATA").map_or(default, PathBuf::from);
    if !root.is_dir() {
        println!("skipped: no folder {} (BORESIGHT_TEST_DATA names it)", root.display());
        return;
    }
    let whole = std::env::var_os("BORESIGHT_WHOLE_VIDEOS").is_some();
    let table = std::fs::read_to_string(data_folder().join("public.txt")).unwrap();
    let lines: Vec<&str> = table.lines().collect();
    let checked = lines.iter().filter(|l| check(l, &root, whole)).count();
    println!("{checked} of {} public videos checked", lines.len());
}

#[test]
fn colour_of_the_test_pattern_is_what_ffmpeg_shows() {
    // Red, green and blue areas of testsrc2 as `ffmpeg -pix_fmt rgb24` gives them are compared through the pipe.
    if !has_ffmpeg() {
        println!("skipped: no ffmpeg");
        return;
    }
    let path = data_folder().join("b_frames.mp4");
    let options = OpenOptions { colour: Colour::Rgb, ..OpenOptions::default() };
    let mut ours = open_mp4(&path, &options).unwrap();
    let mut theirs = open_ffmpeg(&path.to_string_lossy(), &options).unwrap();
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

/// Reads to the end or the first error, with frames of at most `max_pixels`.
fn drain(path: &Path, max_pixels: u64) -> Result<(usize, Vec<String>), boresight::Error> {
    let mut source = open_mp4(path, &OpenOptions { max_pixels, ..OpenOptions::default() })?;
    let (mut n, mut last) = (0, i64::MIN);
    while let Some(frame) = source.next_frame()? {
        assert!(frame.time.ns >= last, "times run backwards");
        (n, last) = (n + 1, frame.time.ns);
        assert!(n < 10_000, "no end");
    }
    Ok((n, source.warnings().to_vec()))
}

/// Sum of the lost frames that warnings speak of.
fn lost(text: &str) -> usize {
    let tail = text.lines().filter_map(|l| l.split_once("the last ")).map(|(_, rest)| rest);
    let middle = text.lines().filter(|l| l.contains("frames are damaged or depend"));
    tail.chain(middle).filter_map(|l| l.split(' ').next()?.parse::<usize>().ok()).sum()
}

#[test]
fn a_cut_file_gives_the_frames_before_the_cut_and_counts_the_lost() {
    let dir = tempfile::tempdir().unwrap();
    let whole = std::fs::read(data_folder().join("b_frames.mp4")).unwrap();
    let path = dir.path().join("cut.mp4");
    std::fs::write(&path, &whole[..whole.len() / 2]).unwrap();
    let err = drain(&path, 1 << 20).unwrap_err();
    assert_eq!(err.kind(), ErrorKind::Damaged);
    assert!(err.to_string().contains("moov"), "{err}");
    // With the tables in front (`faststart`), a file cut off in its data gives what there is.
    let n_tables = whole.len() - whole.windows(4).position(|w| w == b"moov").unwrap() + 4;
    let mut front = whole[..40].to_vec();
    let mut tables = whole[whole.len() - n_tables..].to_vec();
    let stco = tables.windows(4).position(|w| w == b"stco").unwrap() + 12;
    let moved = u32::from_be_bytes(tables[stco..stco + 4].try_into().unwrap()) + n_tables as u32;
    tables[stco..stco + 4].copy_from_slice(&moved.to_be_bytes());
    front.extend(&tables);
    front.extend(&whole[40..whole.len() - n_tables]);
    std::fs::write(&path, &front).unwrap();
    assert_eq!(drain(&path, 1 << 20).unwrap(), (25, Vec::new()));
    std::fs::write(&path, &front[..front.len() - 600]).unwrap();
    let (n, warnings) = drain(&path, 1 << 20).unwrap();
    let text = warnings.join("\n");
    assert!((5..25).contains(&n) && text.contains("the file ends before it"), "{n} {text}");
    assert_eq!(n + lost(&text), 25, "{n} {text}");
    // The tables stay whole, the data of the last frames are overwritten by nonsense lengths.
    let mut broken = whole.clone();
    let moov = whole.windows(4).position(|w| w == b"moov").unwrap();
    broken[moov - 650..moov - 4].fill(0xff);
    std::fs::write(&path, &broken).unwrap();
    let (n, warnings) = drain(&path, 1 << 20).unwrap();
    assert!((5..25).contains(&n), "{n}");
    let text = warnings.join("\n");
    assert_eq!(n + lost(&text), 25, "{n} {text}");
}

#[test]
fn headers_that_claim_absurd_sizes_are_refused() {
    let path = data_folder().join("b_frames.mp4");
    let err = drain(&path, 1000).unwrap_err();
    assert!(err.to_string().contains("64 x 48 pixels, more than is accepted"), "{err}");
    let dir = tempfile::tempdir().unwrap();
    let empty = dir.path().join("empty.mp4");
    std::fs::write(&empty, b"").unwrap();
    assert!(drain(&empty, 1 << 20).unwrap_err().to_string().contains("empty"));
    assert_eq!(drain(&dir.path().join("none.mp4"), 1).unwrap_err().kind(), ErrorKind::NotFound);
}

#[test]
fn no_mutation_of_a_clip_panics_or_hangs() {
    use rand::{Rng, SeedableRng};
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(20261121);
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("mutant.mp4");
    let names = ["b_frames.mp4", "fragmented.mp4", "edit_list.mp4", "interlaced.mp4", "slices.mp4"];
    let (mut whole, mut refused) = (0, 0);
    for round in 0..150 {
        let clip = std::fs::read(data_folder().join(names[round % names.len()])).unwrap();
        let mut bytes = clip.clone();
        for _ in 0..=round % 8 {
            let (at, value) = (rng.next_u32() as usize % bytes.len(), rng.next_u32());
            match value % 4 {
                0 => bytes.truncate(at.max(1)),
                1 => bytes[at] = 0xff,
                2 => bytes[at] ^= 1 << (value >> 8 & 7),
                _ => bytes[at] = (value >> 8) as u8,
            }
        }
        std::fs::write(&path, &bytes).unwrap();
        // The pipe is not part of this: `open_mp4` hands over what is not H.264.
        match drain(&path, 1 << 16) {
            Ok(_) => whole += 1,
            Err(_) => refused += 1,
        }
    }
    assert!(whole > 20 && refused > 20, "{whole} read, {refused} refused: the mutations test nothing");
}

#[test]
fn inputs_that_look_like_options_are_files() {
    if !has_ffmpeg() {
        println!("skipped: no ffmpeg");
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    for name in ["-version", "a:b%03d.mp4"] {
        let path = dir.path().join(name);
        std::fs::copy(data_folder().join("hevc.mp4"), &path).unwrap();
        let mut source = open_ffmpeg(&path.to_string_lossy(), &OpenOptions::default()).unwrap();
        assert_eq!((rows(source.as_mut(), usize::MAX).len(), source.info().rate_hz), (25, Some(25.0)), "{name}");
    }
    let err = open_ffmpeg("-version", &OpenOptions::default()).err().unwrap();
    assert_eq!(err.kind(), ErrorKind::NotFound);
    std::fs::write(dir.path().join("noise.mkv"), [7u8; 5000]).unwrap();
    let err = open_ffmpeg(&dir.path().join("noise.mkv").to_string_lossy(), &OpenOptions::default()).err().unwrap();
    assert!(err.to_string().contains("ffmpeg cannot read it"), "{err}");
    // Dropped before its end, the program must not linger: this would hang if it did.
    let source = open_ffmpeg(&data_folder().join("yuv444.mp4").to_string_lossy(), &OpenOptions::default()).unwrap();
    drop(source);
}
