//! `boresight evaluate`: how good is a result against the truth, by every measure of the field.

mod cells;
mod compare;
mod html;
mod images;
mod measures;
mod plot;
mod sequences;
mod state;
mod table;
mod values;

use anyhow::{Context, bail};
use boresight::io::tracks::Format;
use boresight::metrics::{KittiClass, MatchOptions, Rules, Similarity};
use clap::ValueEnum;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use measures::Judged;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Judges results against the truth.
#[derive(Debug, clap::Args)]
#[command(long_about = "Judges results against the truth.\n\n\
TRUTH and RESULT are tables (MOTChallenge, KITTI, CSV with named columns, Cell Tracking Challenge folders), told by their \
look. For several sequences give folders (TRUTH/SEQ/gt/gt.txt or TRUTH/SEQ/gt.txt, RESULT/SEQ.txt) or paths with {seq} \
where the names of the sequences stand: 'data/{seq}/gt.txt' 'data/{seq}/result.txt'. Two images, folders of images or \
videos are compared pixel by pixel.")]
#[command(allow_negative_numbers = true)]
#[command(after_help = "Examples:
  boresight evaluate gt.txt result.txt                              every measure of one result
  boresight evaluate 'mot17/{seq}/gt.txt' 'mine/{seq}.txt' --mot-only     CLEAR, identity and HOTA of many sequences
  boresight evaluate gt/ mine/ --compare theirs/ --html report.html  side by side, with confidence intervals and plots
  boresight evaluate gt.txt result.txt --require HOTA=0.4            exit code 1 if it is not met
  boresight evaluate sim/truth.csv out/tracks.csv --detections out/detections.csv --bound 0.5,1e-5
                                                                    state errors, NEES, NIS, ratio to the bound
  boresight evaluate clean.png filtered.png                         MSE, RMSE, MAE, PFE, SNR, PSNR
Each measure is explained in docs/evaluate.md.")]
pub struct Args {
    /// The truth: a table, a folder of sequences, or a path with {seq}.
    truth: String,
    /// The result, likewise.
    result: String,
    /// Further results to compare with the first, with confidence intervals.
    #[arg(long, num_args = 1.., value_name = "RESULT")]
    compare: Vec<String>,
    /// Format of the truth, if its look deceives.
    #[arg(long, value_parser = format())]
    truth_format: Option<Format>,
    /// Format of the results, if their look deceives.
    #[arg(long, value_parser = format())]
    result_format: Option<Format>,
    /// What is left out before counting.
    #[arg(long, value_enum, default_value = "auto")]
    rules: RulesArg,
    /// What makes a truth and a result match: overlap of boxes, or nearness of centres. Points always match by centres.
    #[arg(long = "match", value_enum, default_value = "iou")]
    matching: MatchArg,
    /// Overlap from which a pair matches, in (0, 1].
    #[arg(long, default_value_t = 0.5)]
    threshold: f64,
    /// Distance up to which centres match, px.
    #[arg(long, default_value_t = 5.0)]
    distance: f64,
    /// How CLEAR counts: as TrackEval, or as py-motmetrics and the MATLAB kit.
    #[arg(long, value_enum, default_value = "trackeval")]
    convention: Convention,
    /// Cutoff c of OSPA and GOSPA, px.
    #[arg(long, default_value_t = 10.0)]
    cutoff: f64,
    /// Order p of OSPA and GOSPA.
    #[arg(long, default_value_t = 2.0)]
    order: f64,
    /// Switch cost of trajectory GOSPA, px; half the cutoff if not given.
    #[arg(long)]
    switch_cost: Option<f64>,
    /// Unknowns of a window up to which trajectory GOSPA is computed; with more it takes long.
    #[arg(long, default_value_t = 10_000)]
    max_unknowns: usize,
    /// Detections that the result was made from (boresight's detections.csv, {seq} allowed), for the NIS.
    #[arg(long)]
    detections: Option<String>,
    /// Measurement noise that the tracker added to the detections' own (tracker.extra-noise-px), px, for the NIS.
    #[arg(long, default_value_t = 0.0)]
    extra_noise: f64,
    /// Posterior Cramer-Rao bound of a constant-velocity target: variance of a measurement per axis (px²), density of its
    /// acceleration (px²/s³), and if wanted its probability of detection: R,Q or R,Q,PD.
    #[arg(long, value_name = "R,Q[,PD]", value_parser = bound)]
    bound: Option<[f64; 3]>,
    /// Largest value a pixel can have, for the PSNR of images; 255 or 65535 by their type if not given.
    #[arg(long)]
    peak: Option<f64>,
    /// Window of OSPA(2) and trajectory GOSPA, frames.
    #[arg(long, default_value = "50")]
    window: std::num::NonZeroUsize,
    /// Assign OSPA by plain distances, as Stone Soup does, instead of by their p-th powers.
    #[arg(long)]
    stonesoup_ospa: bool,
    /// Frames per second, for rates per hour and times; taken from seqinfo.ini where there is one.
    #[arg(long)]
    rate: Option<f64>,
    /// Size of the frames as WIDTHxHEIGHT, px, for rates per megapixel; taken from seqinfo.ini where there is one.
    #[arg(long, value_parser = size)]
    size: Option<(f64, f64)>,
    /// Leave out malformed rows and count them.
    #[arg(long)]
    skip_bad_rows: bool,
    /// Count rows of boresight's tables whose status is tentative.
    #[arg(long)]
    tentative: bool,
    /// Frames of MOTChallenge truths count from 0 in the file.
    #[arg(long)]
    truth_from_zero: bool,
    /// Frames of MOTChallenge results count from 0 in the file.
    #[arg(long)]
    result_from_zero: bool,
    /// Demand a score, for instance HOTA=0.4 (at least) or GOSPA=5 (at most); exit code 1 if it is not met.
    #[arg(long, value_name = "MEASURE=VALUE", value_parser = demand)]
    require: Vec<(String, f64)>,
    /// Write the scores of each sequence as CSV.
    #[arg(long)]
    csv: Option<PathBuf>,
    /// Write all scores and curves as JSON.
    #[arg(long)]
    json: Option<PathBuf>,
    /// Write a report with plots.
    #[arg(long)]
    html: Option<PathBuf>,
    /// Draws of the bootstrap.
    #[arg(long, default_value = "1000")]
    draws: std::num::NonZeroUsize,
    /// Seed of the bootstrap.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Print CLEAR, identity and HOTA only, and compute nothing else.
    #[arg(long)]
    mot_only: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum RulesArg {
    /// By the truth's look: KITTI's, MOT17's if it has classes, MOT15's if not.
    Auto,
    /// All rows count.
    None,
    /// Truth rows with 0 in column 7 do not count.
    Mot15,
    /// Distractors as in MOT16 and MOT17.
    Mot17,
    /// Distractors as in MOT20.
    Mot20,
    /// Cars, with DontCare regions.
    KittiCar,
    /// Pedestrians, with DontCare regions.
    KittiPedestrian,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum MatchArg {
    /// Intersection over union.
    Iou,
    /// Distance of the centres.
    Centre,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Convention {
    /// TrackEval.
    Trackeval,
    /// py-motmetrics.
    Motmetrics,
}

/// Takes a format's name; help texts and completions list them.
pub fn format() -> impl TypedValueParser<Value = Format> {
    PossibleValuesParser::new(Format::ALL.map(Format::name))
        .try_map(|name| Format::ALL.into_iter().find(|f| f.name() == name).ok_or("no such format"))
}

/// Parses WIDTHxHEIGHT.
pub fn size(text: &str) -> Result<(f64, f64), String> {
    let (w, h) = text.split_once('x').ok_or("expected WIDTHxHEIGHT, for instance 640x512")?;
    match (w.parse::<f64>(), h.parse::<f64>()) {
        (Ok(w), Ok(h)) if w > 0.0 && h > 0.0 && w.is_finite() && h.is_finite() => Ok((w, h)),
        _ => Err("expected WIDTHxHEIGHT, for instance 640x512".into()),
    }
}

fn bound(text: &str) -> Result<[f64; 3], String> {
    let expected = "expected R,Q or R,Q,PD: R above 0, Q from 0 on, PD in (0, 1], for instance 0.5,1e-5";
    let v: Vec<f64> =
        text.split(',').map(|v| v.trim().parse()).collect::<Result<_, _>>().map_err(|_| expected.to_string())?;
    let [r, q, p_d] = match v[..] {
        [r, q] => [r, q, 1.0],
        [r, q, p_d] => [r, q, p_d],
        _ => return Err(expected.into()),
    };
    let good = r > 0.0 && r.is_finite() && q >= 0.0 && q.is_finite() && p_d > 0.0 && p_d <= 1.0;
    if good { Ok([r, q, p_d]) } else { Err(expected.into()) }
}

fn demand(text: &str) -> Result<(String, f64), String> {
    let (name, value) = text.split_once('=').ok_or("expected MEASURE=VALUE, for instance HOTA=0.4")?;
    let number = value.trim().parse::<f64>().ok().filter(|v| v.is_finite());
    let value = number.ok_or_else(|| format!("expected a number after =, found \"{value}\""))?;
    Ok((name.trim().to_string(), value))
}

impl Args {
    /// The rules by which rows are left out, by the look of the truth where not said.
    fn rules(&self, truth: &boresight::TrackTable, format: Format) -> Rules {
        match self.rules {
            RulesArg::None => Rules::None,
            RulesArg::Mot15 => Rules::Mot15,
            RulesArg::Mot17 => Rules::Mot17,
            RulesArg::Mot20 => Rules::Mot20,
            RulesArg::KittiCar => Rules::Kitti(KittiClass::Car),
            RulesArg::KittiPedestrian => Rules::Kitti(KittiClass::Pedestrian),
            RulesArg::Auto => match format {
                Format::Kitti => Rules::Kitti(KittiClass::Car),
                Format::Mot | Format::MotTruth => {
                    let has_classes = (0..truth.n_rows()).any(|r| truth.class.get(r) != 1);
                    if !has_classes {
                        Rules::Mot15
                    } else if truth.label.to_ascii_uppercase().contains("MOT20") {
                        Rules::Mot20
                    } else {
                        Rules::Mot17
                    }
                }
                _ => Rules::None,
            },
        }
    }

    fn match_options(&self, points: bool) -> MatchOptions {
        if points || self.matching == MatchArg::Centre {
            // Similarity 1 - d / d0 reaches one half at half of d0.
            return MatchOptions {
                similarity: Similarity::Centre { zero_distance_px: 2.0 * self.distance },
                threshold: 0.5,
            };
        }
        MatchOptions { similarity: Similarity::Iou, threshold: self.threshold }
    }
}

/// Runs the command.
/// # Errors
/// Inputs that cannot be read or do not belong together; outputs that cannot be written.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    if !(args.distance > 0.0 && args.distance.is_finite()) {
        bail!(boresight::Error::new(boresight::ErrorKind::Config, "expected a distance above 0 px").at("--distance"));
    }
    if images::are_frames(&args.truth) {
        return images::run(&args);
    }
    let mut results = Vec::with_capacity(1 + args.compare.len());
    for result in std::iter::once(&args.result).chain(&args.compare) {
        let found = sequences::find(&args.truth, result)?;
        let judged = measures::judge_all(&args, result, &found)?;
        for note in &judged.notes {
            eprintln!("note: {note}");
        }
        results.push(judged);
    }
    let comparison = if args.compare.is_empty() { Vec::new() } else { compare::compare(&args, &results)? };
    let mut text = String::new();
    for judged in &results {
        text.push_str(&table::sequences(judged, args.mot_only));
    }
    text.push_str(&compare::table(&results, &comparison));
    super::print(text.as_bytes())?;
    write_files(&args, &results, &comparison)?;
    demands(&args, &results[0])
}

fn put(path: &Path, text: &str) -> boresight::Result<()> {
    std::fs::write(path, text).map_err(|e| {
        boresight::Error::new(boresight::ErrorKind::Output, "cannot be written").at(path.display()).because(e)
    })
}

fn write_files(args: &Args, results: &[Judged], comparison: &[compare::Row]) -> anyhow::Result<()> {
    if let Some(path) = &args.csv {
        put(path, &table::csv(results))?;
    }
    if let Some(path) = &args.json {
        let value = serde_json::json!({
            "results": results.iter().map(Judged::to_json).collect::<Vec<_>>(),
            "comparison": comparison,
        });
        put(path, &serde_json::to_string_pretty(&value).context("scores as JSON")?)?;
    }
    if let Some(path) = &args.html {
        put(path, &html::report(results, comparison))?;
    }
    Ok(())
}

fn demands(args: &Args, judged: &Judged) -> anyhow::Result<ExitCode> {
    met(args, &judged.combined_values())
}

/// Whether the demands are met, as an exit code.
fn met(args: &Args, combined: &[(&'static str, f64)]) -> anyhow::Result<ExitCode> {
    let mut met = true;
    for (name, limit) in &args.require {
        let Some((key, value)) = combined.iter().find(|(k, _)| k.eq_ignore_ascii_case(name)) else {
            let known: Vec<&str> = combined.iter().map(|c| c.0).collect();
            bail!(
                boresight::Error::new(boresight::ErrorKind::Config, "no such measure")
                    .at(format!("--require {name}"))
                    .hint(format!("one of {}", known.join(", ")))
            );
        };
        let at_most = values::lower_is_better(key);
        let ok = if at_most { *value <= *limit } else { *value >= *limit };
        if !ok {
            met = false;
            let word = if at_most { "at most" } else { "at least" };
            eprintln!("not met: {key} = {value:.6}, demanded {word} {limit}");
        }
    }
    Ok(if met { ExitCode::SUCCESS } else { ExitCode::from(1) })
}
