//! The arguments of `boresight evaluate`, and the options of the library that they stand for.

use super::demand::{Demand, demand};
use boresight::TrackTable;
use boresight::io::tracks::Format;
use boresight::metrics::evaluation::{BoundModel, ClearConvention, EvaluateOptions, Matching, MeasureSet};
use boresight::metrics::set::{OspaAssignment, SetOptions};
use boresight::metrics::{KittiClass, Rules};
use clap::ValueEnum;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use std::ffi::OsString;
use std::path::PathBuf;

/// Headings of what is seldom needed.
const READING: &str = "How tables are read";
const MEASURES: &str = "Parameters of measures";

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
    pub truth: OsString,
    /// The result, likewise.
    pub result: OsString,
    /// What makes a truth and a result match: overlap of boxes, or nearness of centres. Points always match by centres.
    #[arg(long = "match", value_enum, default_value = "iou")]
    pub matching: MatchArg,
    /// Overlap from which a pair matches, in (0, 1].
    #[arg(long, default_value_t = 0.5)]
    pub threshold: f64,
    /// Distance up to which centres match, px (m where the tables are in metres, as all distances here).
    #[arg(long, default_value_t = 5.0)]
    pub distance: f64,
    /// Further results to compare with the first, with confidence intervals.
    #[arg(long, num_args = 1.., value_name = "RESULT")]
    pub compare: Vec<OsString>,
    /// Demand a score, for instance HOTA=0.4 (at least), GOSPA=5 (at most) or ANEES=1.5..2.5 (within); exit code 1 if it is
    /// not met.
    #[arg(long, value_name = "MEASURE=VALUE", value_parser = demand)]
    pub require: Vec<Demand>,
    /// Print CLEAR, identity and HOTA only, and compute nothing else.
    #[arg(long)]
    pub mot_only: bool,
    /// Write a report with plots.
    #[arg(long)]
    pub html: Option<PathBuf>,
    /// Write the scores of each sequence as CSV.
    #[arg(long)]
    pub csv: Option<PathBuf>,
    /// Write all scores and curves as JSON.
    #[arg(long)]
    pub json: Option<PathBuf>,
    /// Format of the truth, if its look deceives.
    #[arg(help_heading = READING, long, value_parser = format())]
    pub truth_format: Option<Format>,
    /// Format of the results, if their look deceives.
    #[arg(help_heading = READING, long, value_parser = format())]
    pub result_format: Option<Format>,
    /// Frames of MOTChallenge truths count from 0 in the file.
    #[arg(help_heading = READING, long)]
    pub truth_from_zero: bool,
    /// Frames of MOTChallenge results count from 0 in the file.
    #[arg(help_heading = READING, long)]
    pub result_from_zero: bool,
    /// Frames of the truth count from 1 in the file (for tables that are not MOTChallenge's, as the Svanström clips' CSV).
    #[arg(help_heading = READING, long, conflicts_with = "truth_from_zero")]
    pub truth_from_one: bool,
    /// Frames of the results count from 1 in the file.
    #[arg(help_heading = READING, long, conflicts_with = "result_from_zero")]
    pub result_from_one: bool,
    /// What is left out before counting.
    #[arg(help_heading = READING, long, value_enum, default_value = "auto")]
    pub rules: RulesArg,
    /// Leave out malformed rows and count them.
    #[arg(help_heading = READING, long)]
    pub skip_bad_rows: bool,
    /// Count rows of boresight's tables whose status is tentative.
    #[arg(help_heading = READING, long)]
    pub tentative: bool,
    /// Frames per second, for rates per hour and times; taken from seqinfo.ini where there is one.
    #[arg(help_heading = READING, long)]
    pub rate: Option<f64>,
    /// Size of the frames as WIDTHxHEIGHT, px, for rates per megapixel; taken from seqinfo.ini where there is one.
    #[arg(help_heading = READING, long, value_parser = size)]
    pub size: Option<(f64, f64)>,
    /// How CLEAR counts: as TrackEval, or as py-motmetrics and the MATLAB kit.
    #[arg(help_heading = MEASURES, long, value_enum, default_value = "trackeval")]
    pub convention: Convention,
    /// Cutoff c of OSPA and GOSPA, px.
    #[arg(help_heading = MEASURES, long, default_value_t = 10.0)]
    pub cutoff: f64,
    /// Order p of OSPA and GOSPA.
    #[arg(help_heading = MEASURES, long, default_value_t = 2.0)]
    pub order: f64,
    /// Switch cost of trajectory GOSPA, px; half the cutoff if not given.
    #[arg(help_heading = MEASURES, long)]
    pub switch_cost: Option<f64>,
    /// Unknowns of a window up to which trajectory GOSPA is computed; with more it takes long.
    #[arg(help_heading = MEASURES, long, default_value_t = 10_000)]
    pub max_unknowns: usize,
    /// Detections that the result was made from (boresight's detections.csv, {seq} allowed), for the NIS.
    #[arg(help_heading = MEASURES, long)]
    pub detections: Option<String>,
    /// Measurement noise that the tracker added to the detections' own (tracker.extra-noise-px), px, for the NIS.
    #[arg(help_heading = MEASURES, long, default_value_t = 0.0)]
    pub extra_noise: f64,
    /// The part of it in proportion to a detection's box (tracker.extra-noise-per-height), for the NIS.
    #[arg(help_heading = MEASURES, long, default_value_t = 0.0)]
    pub extra_noise_per_height: f64,
    /// Posterior Cramer-Rao bound of a constant-velocity target: variance of a measurement per axis (px²), density of its
    /// acceleration (px²/s³), and if wanted its probability of detection: R,Q or R,Q,PD.
    #[arg(help_heading = MEASURES, long, value_name = "R,Q[,PD]", value_parser = bound)]
    pub bound: Option<BoundModel>,
    /// Largest value a pixel can have, for the PSNR of images; 255 or 65535 by their type if not given.
    #[arg(help_heading = MEASURES, long)]
    pub peak: Option<f64>,
    /// Window of OSPA(2) and trajectory GOSPA, frames.
    #[arg(help_heading = MEASURES, long, default_value = "50")]
    pub window: std::num::NonZeroUsize,
    /// Assign OSPA by plain distances, as Stone Soup does, instead of by their p-th powers.
    #[arg(help_heading = MEASURES, long)]
    pub stonesoup_ospa: bool,
    /// Draws of the bootstrap.
    #[arg(help_heading = MEASURES, long, default_value = "1000")]
    pub draws: std::num::NonZeroUsize,
    /// Seed of the bootstrap.
    #[arg(help_heading = MEASURES, long, default_value_t = 1)]
    pub seed: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum RulesArg {
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
pub enum MatchArg {
    /// Intersection over union.
    Iou,
    /// Distance of the centres.
    Centre,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Convention {
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

/// Takes the name of a format that is written, among them those that are not read.
pub fn written_format() -> impl TypedValueParser<Value = Format> {
    let all = || Format::ALL.into_iter().chain(Format::EXPORTS);
    PossibleValuesParser::new(all().map(Format::name).collect::<Vec<_>>())
        .try_map(move |name| all().find(|f| f.name() == name).ok_or("no such format"))
}

/// Parses WIDTHxHEIGHT.
pub fn size(text: &str) -> Result<(f64, f64), String> {
    let (w, h) = text.split_once('x').ok_or("expected WIDTHxHEIGHT, for instance 640x512")?;
    match (w.parse::<f64>(), h.parse::<f64>()) {
        (Ok(w), Ok(h)) if w > 0.0 && h > 0.0 && w.is_finite() && h.is_finite() => Ok((w, h)),
        _ => Err("expected WIDTHxHEIGHT, for instance 640x512".into()),
    }
}

fn bound(text: &str) -> Result<BoundModel, String> {
    let expected = "expected R,Q or R,Q,PD: R above 0, Q from 0 on, PD in (0, 1], for instance 0.5,1e-5";
    let v: Vec<f64> =
        text.split(',').map(|v| v.trim().parse()).collect::<Result<_, _>>().map_err(|_| expected.to_string())?;
    let [r, q, p_d] = match v[..] {
        [r, q] => [r, q, 1.0],
        [r, q, p_d] => [r, q, p_d],
        _ => return Err(expected.into()),
    };
    let good = r > 0.0 && r.is_finite() && q >= 0.0 && q.is_finite() && p_d > 0.0 && p_d <= 1.0;
    let model = BoundModel { measurement_var_px2: r, acceleration_density_px2_per_s3: q, p_detection: p_d };
    if good { Ok(model) } else { Err(expected.into()) }
}

impl Args {
    /// The library's options; the truth's look decides what is left out where it is not said.
    pub fn options(&self, truth: &TrackTable, format: Format) -> EvaluateOptions {
        let mut o = EvaluateOptions::default();
        o.rules = self.rules(truth, format);
        o.matching = match self.matching {
            MatchArg::Iou => Matching::Overlap,
            MatchArg::Centre => Matching::Centre,
        };
        o.min_overlap = self.threshold;
        o.max_distance_px = self.distance;
        o.convention = match self.convention {
            Convention::Trackeval => ClearConvention::TrackEval,
            Convention::Motmetrics => ClearConvention::MotMetrics,
        };
        o.measures = if self.mot_only { MeasureSet::Mot } else { MeasureSet::All };
        let assignment = if self.stonesoup_ospa { OspaAssignment::FirstPower } else { OspaAssignment::OrderP };
        o.set = SetOptions { cutoff_px: self.cutoff, order: self.order, assignment };
        o.window_frames = self.window.get();
        o.switch_px = self.switch_cost;
        o.max_unknowns = self.max_unknowns;
        o.extra_noise_px = self.extra_noise;
        o.extra_noise_per_height = self.extra_noise_per_height;
        o.bound = self.bound;
        o.keep_pieces = !self.compare.is_empty();
        o
    }

    fn rules(&self, truth: &TrackTable, format: Format) -> Rules {
        match self.rules {
            RulesArg::None => Rules::None,
            RulesArg::Mot15 => Rules::Mot15,
            RulesArg::Mot17 => Rules::Mot17,
            RulesArg::Mot20 => Rules::Mot20,
            RulesArg::KittiCar => Rules::Kitti(KittiClass::Car),
            RulesArg::KittiPedestrian => Rules::Kitti(KittiClass::Pedestrian),
            RulesArg::Auto => match format {
                Format::Kitti => Rules::Kitti(KittiClass::Car),
                Format::Mot | Format::MotTruth => Rules::of_mot_challenge(truth),
                _ => Rules::None,
            },
        }
    }
}
