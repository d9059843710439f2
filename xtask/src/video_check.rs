//! Compares decoded video with ffmpeg's frames, live: count, presentation times, luma bytes (all three colours where a video holds no luma).
//!
//! `ffmpeg -f framecrc` prints time and Adler-32 (started at 0) of every raw luma plane.

use anyhow::{Context, Result, bail};
use boresight::io::{Colour, OpenOptions};
use boresight::{FrameSource, Pixels, Timestamp};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

/// Arguments of `video-check`.
#[derive(clap::Args)]
pub struct Args {
    /// Videos to compare.
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Read through the ffmpeg pipe instead of in process.
    #[arg(long)]
    pipe: bool,
    /// Print a line of the reference table for each file instead (for tests/data/video_reference.txt).
    #[arg(long)]
    reference: bool,
}

/// Time (ns) and Adler-32 of the luma bytes of one frame.
type Row = (i64, u32);

/// What ffmpeg says of a video after a filter: `extractplanes=y` for the luma, `format=rgb24` where there is none.
pub fn ffmpeg_rows(file: &Path, filter: &str) -> Result<Vec<Row>> {
    let output = Command::new("ffmpeg")
        .args(["-hide_banner", "-nostdin", "-loglevel", "error", "-threads", "1"])
        .args(["-copyts", "-noautorotate", "-i"])
        .arg(file)
        .args(["-map", "0:v:0", "-vf", filter, "-fps_mode", "passthrough", "-enc_time_base", "-1"])
        .args(["-f", "framecrc", "-"])
        .output()
        .context("ffmpeg is needed for the comparison")?;
    let text = String::from_utf8_lossy(&output.stdout);
    let mut base = (1i64, 1i64);
    let mut rows = Vec::new();
    for line in text.lines() {
        if let Some(tb) = line.strip_prefix("#tb 0: ") {
            let (n, d) = tb.split_once('/').context("time base")?;
            base = (n.trim().parse()?, d.trim().parse()?);
        } else if !line.starts_with('#') {
            let fields: Vec<&str> = line.split(',').map(str::trim).collect();
            let (Some(pts), Some(crc)) = (fields.get(2), fields.get(5)) else { bail!("odd line {line}") };
            let crc = u32::from_str_radix(crc.trim_start_matches("0x"), 16)?;
            rows.push((Timestamp::from_ticks(pts.parse()?, base.0, base.1).ns, crc));
        }
    }
    Ok(rows)
}

/// Adler-32 (RFC 1950) started at 0 as ffmpeg does.
pub fn adler32(mut bytes: impl Iterator<Item = u8>) -> u32 {
    let (mut a, mut b) = (0u32, 0u32);
    loop {
        let mut n = 0;
        for byte in bytes.by_ref().take(5552) {
            a += u32::from(byte);
            b += a;
            n += 1;
        }
        (a, b) = (a % 65521, b % 65521);
        if n < 5552 {
            return b << 16 | a;
        }
    }
}

/// What boresight reads.
pub fn our_rows(source: &mut dyn FrameSource) -> Result<Vec<Row>> {
    let mut rows = Vec::new();
    while let Some(frame) = source.next_frame()? {
        let crc = match &frame.pixels {
            Pixels::Gray8(i) => adler32(i.as_slice().iter().copied()),
            Pixels::Gray16(i) => adler32(i.as_slice().iter().flat_map(|v| v.to_le_bytes())),
            Pixels::Rgb8(i) => adler32(i.as_slice().iter().flatten().copied()),
            other => bail!("{:?} frames", other.kind()),
        };
        rows.push((frame.time.ns, crc));
        source.recycle(frame);
    }
    Ok(rows)
}

/// FNV-1a of rows, 64 bits.
pub fn fnv(rows: &[Row]) -> u64 {
    let bytes = rows.iter().flat_map(|(t, c)| t.to_le_bytes().into_iter().chain(c.to_le_bytes()));
    bytes.fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3))
}

/// Compares, and fails if anything differs.
pub fn run(args: &Args) -> Result<()> {
    let mut wrong = 0;
    for file in &args.files {
        let start = Instant::now();
        let mut options = OpenOptions::default();
        let mut theirs = ffmpeg_rows(file, "extractplanes=y")?;
        if theirs.is_empty() {
            options.colour = Colour::Rgb;
            theirs = ffmpeg_rows(file, "format=rgb24")?;
        }
        let their_s = start.elapsed().as_secs_f64();
        if args.reference {
            let head = fnv(&theirs[..theirs.len().min(40)]);
            let name: PathBuf = file.iter().rev().take(2).collect::<Vec<_>>().into_iter().rev().collect();
            println!("{} {} {head:016x} {:016x}", name.display(), theirs.len(), fnv(&theirs));
            continue;
        }
        let start = Instant::now();
        let opened = if args.pipe {
            boresight::io::video::open_ffmpeg(file, &options)
        } else {
            boresight::io::open(file, &options)
        };
        let ours = opened.map_err(anyhow::Error::from).and_then(|mut s| {
            let rows = our_rows(s.as_mut())?;
            s.warnings().iter().for_each(|w| println!("  warning: {w}"));
            Ok((rows, s.info().reader.clone(), s.info().n_frames))
        });
        let our_s = start.elapsed().as_secs_f64();
        let verdict = match &ours {
            Err(e) => format!("ERROR {e:#}"),
            Ok((ours, ..)) if *ours == theirs && !theirs.is_empty() => "same".to_string(),
            Ok((ours, ..)) => {
                let at = ours.iter().zip(&theirs).position(|(a, b)| a != b);
                let n = ours.iter().zip(&theirs).filter(|(a, b)| a != b).count();
                let pair = at.map(|i| (i, ours[i], theirs[i]));
                format!("DIFFERS: {} of {} frames, {n} differ, first {pair:?}", ours.len(), theirs.len())
            }
        };
        wrong += usize::from(verdict != "same");
        let detail = ours.as_ref().map(|(o, reader, n)| {
            format!(
                "{} frames ({n:?} announced), {reader}, {:.0} frames/s, ffmpeg -threads 1 {:.0} frames/s",
                o.len(),
                o.len() as f64 / our_s,
                theirs.len() as f64 / their_s
            )
        });
        println!("{}: {verdict}; {}", file.display(), detail.unwrap_or_default());
    }
    if wrong > 0 {
        bail!("{wrong} of {} files differ", args.files.len());
    }
    Ok(())
}
