//! `boresight evaluate` of two images, folders of images or videos: MSE, RMSE, MAE, PFE, SNR, PSNR of each frame.

use super::Args;
use super::table::aligned;
use anyhow::bail;
use boresight::io::{OpenOptions, is_table, open};
use boresight::metrics::image::{ImageMetrics, compare};
use boresight::{Error, ErrorKind, Image, Pixels};
use std::fmt::Write;
use std::path::Path;
use std::process::ExitCode;

/// Whether an input is an image, a folder or glob of images, or a video, rather than a table or a folder of tables.
pub fn are_frames(input: &str) -> bool {
    let path = Path::new(input);
    if input.contains("{seq}") || path.is_dir() && boresight::io::tracks::ctc::is_ctc(path) || is_table(input) {
        return false;
    }
    let no_bytes = path.metadata().is_ok_and(|m| m.is_file() && m.len() == 0);
    !no_bytes && open(input, &OpenOptions::default()).is_ok()
}

const NAMES: [&str; 6] = ["MSE", "RMSE", "MAE", "PFE", "SNR", "PSNR"];

fn values(m: &ImageMetrics) -> [f64; 6] {
    [m.mse, m.rmse, m.mae, m.pfe, m.snr, m.psnr]
}

fn of_colour(image: &Image<[u8; 3]>) -> Image<u8> {
    Image::from_vec(3 * image.width(), image.height(), image.as_slice().concat()).unwrap_or_default()
}

/// Compares two frames; RGB frames as three values a pixel.
fn frame(truth: &Pixels, result: &Pixels, peak: Option<f64>) -> boresight::Result<ImageMetrics> {
    let no_peak = || {
        Error::new(ErrorKind::Config, "float pixels have no largest value of their own")
            .hint("--peak gives it, for instance --peak 1")
    };
    match (truth, result) {
        (Pixels::Gray8(a), Pixels::Gray8(b)) => compare(a, b, peak.unwrap_or(255.0)),
        (Pixels::Gray16(a), Pixels::Gray16(b)) => compare(a, b, peak.unwrap_or(65535.0)),
        (Pixels::GrayF32(a), Pixels::GrayF32(b)) => compare(a, b, peak.ok_or_else(no_peak)?),
        (Pixels::Rgb8(a), Pixels::Rgb8(b)) => compare(&of_colour(a), &of_colour(b), peak.unwrap_or(255.0)),
        _ => Err(Error::new(ErrorKind::Unsupported, "the pixels are of different types: expected the same in both")),
    }
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
    let mut frames: Vec<[f64; 6]> = Vec::new();
    loop {
        let (a, b) = match (truth.next_frame()?, result.next_frame()?) {
            (None, None) => break,
            (Some(a), Some(b)) => (a, b),
            (a, _) => {
                let short = if a.is_none() { &args.truth } else { &args.result };
                let what = format!("ends after {} frames, the other goes on: expected as many in both", frames.len());
                bail!(Error::new(ErrorKind::Damaged, what).at(short));
            }
        };
        let at = format!("{} and {}, frame {}", args.truth, args.result, frames.len());
        frames.push(values(&frame(&a.pixels, &b.pixels, args.peak).map_err(|e| e.at(at))?));
    }
    for warning in truth.warnings().iter().chain(result.warnings()) {
        eprintln!("warning: {warning}");
    }
    let n = frames.len().max(1) as f64;
    let mean: Vec<f64> = (0..NAMES.len()).map(|k| frames.iter().map(|f| f[k]).sum::<f64>() / n).collect();
    let shown = |v: &[f64]| v.iter().map(|v| format!("{v:.4}")).collect::<Vec<_>>();
    let head: Vec<String> = std::iter::once("frame").chain(NAMES).map(String::from).collect();
    let mut rows: Vec<Vec<String>> = Vec::new();
    // Long sequences are summed up on the terminal; the files have every frame.
    if frames.len() <= 20 {
        rows = frames.iter().enumerate().map(|(k, f)| [vec![k.to_string()], shown(f)].concat()).collect();
    }
    if frames.len() != 1 {
        rows.push([vec![format!("mean of {}", frames.len())], shown(&mean)].concat());
    }
    super::super::print(aligned(&head, &rows).as_bytes())?;
    let mut csv = format!("frame,{}\n", NAMES.join(","));
    for (k, f) in frames.iter().enumerate() {
        let _ = writeln!(csv, "{k},{}", f.map(|v| v.to_string()).join(","));
    }
    if let Some(path) = &args.csv {
        super::put(path, &csv)?;
    }
    let combined: Vec<(&'static str, f64)> = NAMES.into_iter().zip(mean).collect();
    if let Some(path) = &args.json {
        let named: serde_json::Map<String, serde_json::Value> =
            combined.iter().map(|(k, v)| ((*k).to_string(), (*v).into())).collect();
        let all = serde_json::json!({"mean": named, "names": NAMES, "frames": frames});
        super::put(path, &serde_json::to_string_pretty(&all)?)?;
    }
    super::met(args, &combined)
}
