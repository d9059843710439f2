//! `boresight evaluate` of two images, folders of images or videos: MSE, RMSE, MAE, PFE, SNR, PSNR of each frame.

use super::arguments::Args;
use super::demand::met;
use super::output::Files;
use super::table::aligned;
use crate::console::{self, say};
use anyhow::bail;
use boresight::io::{OpenOptions, is_table, open};
use boresight::metrics::evaluation::Value;
use boresight::metrics::image::{ImageMetrics, compare_pixels, mean_values};
use boresight::{Error, ErrorKind, Pixels};
use std::ffi::OsStr;
use std::fmt::Write;
use std::path::Path;
use std::process::ExitCode;

/// Whether an input is an image, a folder or glob of images, or a video, rather than a table or a folder of tables.
pub fn are_frames(input: &OsStr) -> bool {
    let path = Path::new(input);
    if input.to_str().is_some_and(|t| t.contains("{seq}"))
        || path.is_dir() && boresight::io::tracks::ctc::is_ctc(path)
        || is_table(input)
    {
        return false;
    }
    let no_bytes = path.metadata().is_ok_and(|m| m.is_file() && m.len() == 0);
    !no_bytes && open(input, &OpenOptions::default()).is_ok()
}

/// Compares two frames.
fn frame(truth: &Pixels, result: &Pixels, peak: Option<f64>) -> boresight::Result<ImageMetrics> {
    compare_pixels(truth, result, peak).map_err(|e| match (truth, result) {
        (Pixels::GrayF32(_), Pixels::GrayF32(_)) if peak.is_none() => e.hint("--peak gives it, for instance --peak 1"),
        _ => e,
    })
}

/// Runs the comparison.
/// # Errors
/// Inputs that cannot be read, of different sizes or types, or of different numbers of frames; outputs not written.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    if !args.compare.is_empty() || args.html.is_some() {
        bail!(
            Error::new(ErrorKind::Config, "images are compared one with one, as a table, CSV or JSON")
                .at("--compare, --html")
        );
    }
    let options = OpenOptions::default();
    let (mut truth, mut result) = (open(&args.truth, &options)?, open(&args.result, &options)?);
    let mut frames: Vec<ImageMetrics> = Vec::new();
    loop {
        let (a, b) = match (truth.next_frame()?, result.next_frame()?) {
            (None, None) => break,
            (Some(a), Some(b)) => (a, b),
            (a, _) => {
                let short = if a.is_none() { &args.truth } else { &args.result };
                let what = format!("ends after {} frames, the other goes on: expected as many in both", frames.len());
                bail!(Error::new(ErrorKind::Damaged, what).at(short.display()));
            }
        };
        let at = format!("{} and {}, frame {}", args.truth.display(), args.result.display(), frames.len());
        frames.push(frame(&a.pixels, &b.pixels, args.peak).map_err(|e| e.at(at))?);
    }
    for warning in truth.warnings().iter().chain(result.warnings()) {
        say!("warning: {warning}");
    }
    let mean = mean_values(&frames);
    let shown = |v: &[Value; 6]| v.map(|v| format!("{:.4}", v.value)).to_vec();
    let head: Vec<String> = std::iter::once("frame").chain(mean.map(|v| v.name)).map(String::from).collect();
    let mut rows: Vec<Vec<String>> = Vec::new();
    // Long sequences are summed up on the terminal; the files have every frame.
    if frames.len() <= 20 {
        rows = frames.iter().enumerate().map(|(k, f)| [vec![k.to_string()], shown(&f.values())].concat()).collect();
    }
    if frames.len() != 1 {
        rows.push([vec![format!("mean of {}", frames.len())], shown(&mean)].concat());
    }
    let mut files = Files::default();
    files.take(console::print(aligned(&head, &rows).as_bytes()).map(drop));
    let mut csv = format!("frame,{}\n", mean.map(|v| v.name).join(","));
    for (k, f) in frames.iter().enumerate() {
        let _ = writeln!(csv, "{k},{}", f.values().map(|v| v.value.to_string()).join(","));
    }
    if let Some(path) = &args.csv {
        files.put(path, &csv);
    }
    if let Some(path) = &args.json {
        let named: serde_json::Map<String, serde_json::Value> =
            mean.iter().map(|v| (v.name.to_string(), v.value.into())).collect();
        let numbers: Vec<[f64; 6]> = frames.iter().map(|f| f.values().map(|v| v.value)).collect();
        let all = serde_json::json!({"mean": named, "names": mean.map(|v| v.name), "frames": numbers});
        files.put(path, &serde_json::to_string_pretty(&all)?);
    }
    files.all_written()?;
    met(&args.require, &mean)
}
