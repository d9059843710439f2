//! What `track` and `detect` share: the input, the configuration or its automatic choice, the outcome.

use boresight::FrameSource as _;
use boresight::auto;
use boresight::io::{LengthUnit, Pictures, SequenceInfo};
use boresight::pipeline::Input;
use boresight::{Config, Error, ErrorKind, vision};
use clap::builder::{PossibleValuesParser, TypedValueParser};
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

/// Where frames come from and how they are treated.
#[derive(Debug, clap::Args)]
pub struct InputArgs {
    /// A video, a folder or glob of images, an image stack, `-` for YUV4MPEG2 on standard input, a stream's address, a camera
    /// (/dev/video0), or a table of detections (.csv, .txt).
    #[arg(value_name = "INPUT")]
    pub input: OsString,
    /// Configuration file; without it everything is chosen by looking at the first frames.
    #[arg(short, long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Detector, instead of the one chosen, with the tracker and the rates that fit it: isolated, cfar (small and faint), integrate (below the noise of a frame), bernoulli (the same, turning), moving (fixed camera), steadied (moving camera), spot (particles), local (cells), colour.
    #[arg(long, value_name = "NAME")]
    pub detector: Option<auto::DetectorKind>,
    /// Candidate, by the number that `boresight preview INPUT` gives it, instead of the one chosen: 1 is the choice without options.
    #[arg(long, value_name = "N", conflicts_with = "detector")]
    pub candidate: Option<usize>,
    /// Change one key of the configuration, chosen or given: `tracker.coast-s=1`. Can be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub sets: Vec<String>,
    /// Rate of inputs without times of their own, frames/s.
    #[arg(long, value_name = "HZ")]
    pub rate_hz: Option<f64>,
    /// Columns of a table of detections whose names are not understood: `x=cx,y=cy,frame=t`; numbers count columns from 1.
    #[arg(long, value_name = "PAIRS")]
    pub columns: Option<String>,
    /// Least score of a detection: of a table's rows, or of the detector `isolated`.
    #[arg(long, value_name = "SCORE", allow_negative_numbers = true)]
    pub min_score: Option<f32>,
    /// What a table's positions are counted in: px or m. Without it what its columns' names say (x_m), else px.
    #[arg(long, value_name = "UNIT", value_parser = unit())]
    pub units: Option<LengthUnit>,
    /// Leave out rows of a table that cannot be read, and count them.
    #[arg(long)]
    pub skip_bad_rows: bool,
    /// Frames taken without light, whose mean is taken off: a file, a folder, a pattern. Short for `--set input.sensor.dark=..`.
    #[arg(long, value_name = "INPUT")]
    pub dark: Option<String>,
    /// Frames of even light, by which unequal response is divided out. Short for `--set input.sensor.flat=..`.
    #[arg(long, value_name = "INPUT")]
    pub flat: Option<String>,
    /// Memory that reading one picture (of a file, a video, a stream), or the histories of one scan, may take, MB; half of the machine's if absent.
    #[arg(long, value_name = "MB", value_parser = clap::value_parser!(u64).range(1..))]
    pub max_memory: Option<u64>,
    /// Threads to read, detect and write on; all the machine has if absent. The results are the same for any number.
    #[arg(long, value_name = "N")]
    pub threads: Option<std::num::NonZeroUsize>,
    /// Print nothing but errors, and what is lost of the input.
    #[arg(short, long)]
    pub quiet: bool,
}

impl InputArgs {
    /// The detector asked for by its word or by its number.
    fn detector(&self) -> anyhow::Result<Option<auto::DetectorKind>> {
        Ok(self.candidate.map_or(Ok(self.detector), auto::DetectorKind::of_candidate)?)
    }
}

/// How tracks are made; short for keys of the configuration.
#[derive(Debug, Default, clap::Args)]
pub struct TrackerArgs {
    /// Filter of the tracks; `boresight config --list filters` explains each.
    #[arg(long, value_name = "NAME")]
    pub filter: Option<String>,
    /// How detections are shared out among tracks, or `mht`; `boresight config --list associators` explains each.
    #[arg(long, value_name = "NAME")]
    pub associator: Option<String>,
    /// Give every track an id of its own, even if it continues a target that was lost for a moment.
    #[arg(long)]
    pub no_stitch: bool,
    /// False tracks an hour that are allowed; fewer take longer to confirm. Without it one, or one for a hundred targets that come.
    #[arg(long, value_name = "N", value_parser = positive)]
    pub false_tracks_per_hour: Option<f64>,
}

fn unit() -> impl TypedValueParser<Value = LengthUnit> {
    PossibleValuesParser::new(["px", "m"]).map(|name| if name == "m" { LengthUnit::Metre } else { LengthUnit::Pixel })
}

fn positive(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|v: &f64| *v > 0.0 && v.is_finite()).ok_or_else(|| "a number above 0".to_string())
}

/// What is to be run.
pub struct Plan {
    /// The input with its detector, if it has one.
    pub input: Input,
    /// The configuration.
    pub config: Config,
    /// Why it is what it is.
    pub reasons: Vec<String>,
    /// What is lost of the input already; the source tells the rest.
    pub lost: Vec<String>,
    /// What is known of the source.
    pub info: Option<boresight::SourceInfo>,
    /// What positions are counted in.
    pub unit: LengthUnit,
    /// Where the radar was, of a radar's plots.
    pub radar: Option<boresight::io::RadarPicture>,
    n_scans: Option<u64>,
}

impl Plan {
    /// The plan of a run on frames.
    fn of_frames(input: Input, config: Config, reasons: Vec<String>, info: boresight::SourceInfo) -> Self {
        Self {
            input,
            config,
            reasons,
            lost: Vec::new(),
            info: Some(info),
            unit: LengthUnit::Pixel,
            radar: None,
            n_scans: None,
        }
    }
}

impl Plan {
    /// Number of frames, if known.
    pub fn total(&self) -> Option<u64> {
        self.n_scans.or_else(|| self.info.as_ref().and_then(|i| i.n_frames))
    }
}

/// Opens the input and settles the configuration; `frames` are the pictures of a table.
pub fn plan(args: &InputArgs, tracker: &TrackerArgs, frames: Option<&OsStr>) -> anyhow::Result<Plan> {
    if let Some(mb) = args.max_memory {
        boresight::io::set_memory_budget(mb.saturating_mul(1 << 20));
    }
    let given = args.config.as_deref().map(Config::from_file).transpose()?;
    let asked = args.detector()?;
    let by = match (args.candidate, args.detector) {
        (Some(number), _) => Some(format!("--candidate {number}")),
        (None, kind) => kind.map(|kind| format!("--detector {kind}")),
    };
    if let Some(by) = by {
        let why = match (&given, boresight::io::is_table(&args.input)) {
            (Some(_), _) => "with --config the detector stands in the configuration",
            (None, true) => "a table of detections needs no detector",
            (None, false) => "",
        };
        if !why.is_empty() {
            return Err(Error::new(ErrorKind::Config, why).at(by).hint("leave one of the two out").into());
        }
    }
    if let (Some(_), Some(rate)) = (&given, tracker.false_tracks_per_hour) {
        return Err(Error::new(
            ErrorKind::Config,
            "with --config nothing is learnt, so the rate cannot be turned into a probability",
        )
        .at(format!("--false-tracks-per-hour {rate}"))
        .hint("leave one of the two out, or set tracker.confirmation.existence.confirm-probability")
        .into());
    }
    let mut base = given.clone().unwrap_or_default();
    if let Some(rate) = args.rate_hz {
        base = base.with(&format!("input.rate-hz={rate}"))?;
    }
    let sensor = &mut base.input.sensor;
    sensor.dark = args.dark.clone().or(sensor.dark.take());
    sensor.flat = args.flat.clone().or(sensor.flat.take());
    // How the input is read must be settled before it is opened.
    for set in args.sets.iter().filter(|s| s.starts_with("input.")) {
        base = base.with(set)?;
    }
    if boresight::io::is_table(&args.input) {
        return plan_table(args, tracker, given, base, frames);
    }
    if args.units == Some(LengthUnit::Metre) {
        return Err(Error::new(ErrorKind::Config, "frames are in pixels, only tables can be in metres")
            .at("--units m")
            .into());
    }
    let columns = args.columns.as_ref().map(|c| format!("--columns {c}"));
    let of_tables = columns.or(args.skip_bad_rows.then(|| "--skip-bad-rows".to_string()));
    // A file that is not there is told as that, and may have been a table; a pattern or a stream is none.
    let names_a_file = !args.input.to_string_lossy().contains(['*', '?', '%']) && args.input != "-";
    if let Some(option) = of_tables.filter(|_| !names_a_file || Path::new(&args.input).exists()) {
        let e = Error::new(ErrorKind::Config, "frames have neither columns nor rows, only tables do");
        return Err(e.at(option).hint(format!("leave it out: {} is frames", args.input.display())).into());
    }
    if let Some(frames) = frames {
        return Err(Error::new(ErrorKind::Config, "only a table of detections needs pictures beside it")
            .at(format!("--frames {}", frames.display()))
            .hint("leave --frames out: the input is frames itself")
            .into());
    }
    if given.is_some() {
        let source = base.input.mend(boresight::io::open(&args.input, &base.input.open_options())?)?;
        let mut config = changed(base, args, tracker)?;
        let info = source.info().clone();
        config.fill_in(&info);
        let detector = vision::build(&config.detector, &info)?;
        let mut reasons = vec!["Configuration as given.".to_string()];
        reasons.extend(unused(&config));
        let input = Input::Frames(source, detector);
        return Ok(Plan::of_frames(input, config, reasons, info));
    }
    let request =
        auto::Request { detector: asked, false_tracks_per_hour: tracker.false_tracks_per_hour, threads: args.threads };
    let (mut source, mut choice) = auto::open_and_choose(&args.input, &base, &request)?;
    let info = source.info().clone();
    let detector = auto::learn(&mut source, &mut choice, &request, |config| changed(config, args, tracker))?;
    let config = choice.config;
    let input = Input::Frames(Box::new(source), detector);
    let reasons = choice.reasons.into_iter().chain(unused(&config)).collect();
    Ok(Plan::of_frames(input, config, reasons, info))
}

/// A sentence that names the detector's keys that are set in vain.
pub fn unused(config: &Config) -> Option<String> {
    let keys = config.detector.unused_keys();
    (!keys.is_empty()).then(|| format!("Without effect beside this detector.threshold: {}.", keys.join(", ")))
}

/// The configuration with what the command line changes.
fn changed(mut config: Config, args: &InputArgs, tracker: &TrackerArgs) -> anyhow::Result<Config> {
    if let Some(filter) = &tracker.filter {
        config = config.with(&format!("tracker.filter={filter}")).map_err(|e| e.at(format!("--filter {filter}")))?;
    }
    match tracker.associator.as_deref() {
        Some("mht") => config = config.with("tracker.mht={}")?,
        Some(name) => {
            config = config.with(&format!("tracker.associator.{name}={{}}"))?;
            // Multiple hypotheses would take its place.
            config.tracker.mht = None;
        }
        None => {}
    }
    if tracker.no_stitch {
        config.tracker.reidentification.max_gap_s = 0.0;
    }
    if let Some(score) = args.min_score.filter(|_| !boresight::io::is_table(&args.input)) {
        let name = config.detector.threshold.name();
        if name != "isolated" {
            let e = Error::new(ErrorKind::Config, format!("the detector is {name}, which has no least score"));
            return Err(e
                .at(format!("--min-score {score}"))
                .hint(format!(
                    "`boresight config --explain detector.threshold.{name}` lists its keys; --detector isolated has one"
                ))
                .into());
        }
        config = config.with(&format!("detector.threshold.isolated.min-score={score:?}"))?;
    }
    for set in &args.sets {
        config = config.with(set)?;
    }
    Ok(config)
}

fn plan_table(
    args: &InputArgs,
    tracker: &TrackerArgs,
    given: Option<Config>,
    base: Config,
    frames: Option<&OsStr>,
) -> anyhow::Result<Plan> {
    let mut base = base;
    let sequence = SequenceInfo::beside(Path::new(&args.input));
    if let Some(frames) = frames.filter(|_| given.is_none() && args.rate_hz.is_none()) {
        // A table that says nothing of time is as fast as the video it was made from.
        let info = boresight::io::open(frames, &base.input.open_options())?.info().clone();
        if let Some(rate) = info.rate_hz.filter(|_| info.true_times) {
            base.input.rate_hz = rate;
        }
    }
    let options = &mut base.input.table;
    if let Some(columns) = &args.columns {
        options.columns = boresight::io::Columns::parse(columns)?;
    }
    options.rate_hz = args.rate_hz.or(options.rate_hz);
    options.skip_bad_rows |= args.skip_bad_rows;
    options.unit = args.units.or(options.unit);
    options.min_score = args.min_score.or(options.min_score);
    let table = boresight::io::read_detections(&args.input, &base.input.table_options())?;
    if table.radar.is_some() && (args.min_score.is_some() || args.units.is_some_and(|u| u != table.unit)) {
        let e = Error::new(ErrorKind::Config, "a radar's plots have no scores, and their columns name their units");
        return Err(e.at(args.input.display()).hint("leave --min-score and --units out").into());
    }
    if table.scans.is_empty() {
        return Err(Error::new(ErrorKind::Damaged, "the table has no rows: there is nothing to track")
            .at(args.input.display())
            .into());
    }
    let n_read = table.n_rows - table.n_skipped;
    let mut reasons = vec![match &table.radar {
        Some(radar) => format!(
            "{n_read} plots of range and azimuth in {} scans, one in {:.3} s; positions in {} east and north.",
            table.scans.len(),
            radar.turn_s,
            radar.unit.sign()
        ),
        None => format!(
            "{n_read} detections in {} frames at {} frames/s, read as {}.",
            table.scans.len(),
            boresight::shown_rate(table.rate_hz),
            table.format
        ),
    }];
    reasons.extend(table.warnings.iter().filter(|w| !table.lost.contains(w)).cloned());
    let mut config = base;
    match given {
        Some(_) => reasons.push("Configuration as given.".to_string()),
        None => {
            // The first pass runs with the filter that is asked for.
            config = changed(config, args, tracker)?;
            let allowed = tracker.false_tracks_per_hour;
            match &table.radar {
                Some(radar) => auto::for_radar(&table.scans, radar.turn_s, radar.unit, &mut config, &mut reasons),
                None => {
                    auto::for_detections(&table.scans, table.rate_hz, table.unit, allowed, &mut config, &mut reasons)
                }
            }
            auto::report_whole(table.rate_hz, &mut config, &mut reasons);
        }
    }
    config = changed(config, args, tracker)?;
    let n_scans = Some(table.scans.len() as u64);
    let (input, info) = match frames {
        Some(frames) if table.radar.is_some() => {
            return Err(Error::new(ErrorKind::Config, "a radar's plots have no pictures to be drawn on")
                .at(format!("--frames {}", frames.display()))
                .hint("leave --frames out: the report draws a map")
                .into());
        }
        Some(frames) if table.unit == LengthUnit::Metre => {
            return Err(Error::new(ErrorKind::Config, "positions in metres have no place on pictures")
                .at(format!("--frames {}", frames.display()))
                .hint("leave --frames out, or say --units px")
                .into());
        }
        Some(frames) => {
            let pictures = Pictures::open(frames, &config.input.open_options(), &table, &sequence)?;
            let info = pictures.info().clone();
            reasons.push(format!("Drawn on the pictures of {}, read as {}.", frames.display(), info.reader));
            (Input::Pictured(Box::new(pictures), table.scans), Some(info))
        }
        None => {
            reasons.extend(
                sequence.pictures.map(|p| format!("Its pictures are at hand: --frames {} draws on them.", p.display())),
            );
            (Input::Scans(table.scans), None)
        }
    };
    Ok(Plan { input, config, reasons, lost: table.lost, info, unit: table.unit, radar: table.radar, n_scans })
}

/// INPUT's name beside the working directory, with an ending.
pub fn default_folder(input: impl AsRef<Path>, ending: &str) -> PathBuf {
    let stem = input.as_ref().file_stem().map(OsStr::to_string_lossy);
    let name = stem.filter(|s| !s.is_empty() && s != "-").unwrap_or("boresight".into());
    let name: String = name.chars().map(|c| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' }).collect();
    PathBuf::from(format!("{name}.{ending}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_associator_that_is_asked_for_replaces_multiple_hypotheses() {
        let args = InputArgs {
            input: "-".into(),
            config: None,
            detector: None,
            candidate: None,
            sets: Vec::new(),
            rate_hz: None,
            columns: None,
            min_score: None,
            units: None,
            skip_bad_rows: false,
            dark: None,
            flat: None,
            max_memory: None,
            threads: None,
            quiet: true,
        };
        let associator = |name: &str| TrackerArgs { associator: Some(name.into()), ..TrackerArgs::default() };
        let mht = changed(Config::default(), &args, &associator("mht")).unwrap();
        assert!(mht.tracker.mht.is_some());
        let jpda = changed(mht, &args, &associator("jpda")).unwrap();
        assert!(jpda.tracker.mht.is_none() && jpda.to_toml().unwrap().contains("[tracker.associator.jpda]"));
    }
}
