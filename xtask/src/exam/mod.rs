//! `cargo xtask exam`: all public data, no options, one table; written to `docs/exam.md`.
//!
//! Clips of a kind belong in turns to half A and half B (by name), and every figure is given for both: what is fitted on one half
//! shows on the other. Held: share of the truth's rows with a reported (confirmed or coasting) track near: in its box grown by a few
//! pixels, or within a distance. False: reported tracks that are near a target in fewer than half of their rows. IDF1 pairs by positions.
//! NIS: mean over the updates of reported tracks, 2 if what the filter believes is true. ms: wall time of choice, decoding, detection
//! and tracking, one run of this machine.

mod aims;
pub mod clips;
mod composed;
mod disturbed;
mod scenes;
pub mod score;
mod tables;
mod variant;
mod variants;

use anyhow::{Result, ensure};
use clips::{Clip, is_wanted};
use score::{Score, mean, score};
use std::fmt::Write as _;
use std::path::PathBuf;

/// Arguments of `exam`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder of the public data.
    #[arg(long)]
    data: Option<PathBuf>,
    /// Only clips whose kind or name contains this, or one of these if given more than once; nothing is written then.
    #[arg(long)]
    only: Vec<String>,
    /// Changes of the configuration chosen, as with `boresight track --set`; nothing is written then.
    #[arg(long = "set")]
    sets: Vec<String>,
    /// False tracks an hour that are allowed, as with `boresight track`; nothing is written then.
    #[arg(long)]
    false_tracks_per_hour: Option<f64>,
    /// A detector by its name, as with `boresight track`; nothing is written then.
    #[arg(long)]
    detector: Option<boresight::auto::DetectorKind>,
    /// A folder of one's own clips in the place of the public ones: `NAME.y4m`, `.mp4`, `.avi` or a folder `NAME`, each with its points `NAME.csv` (frame,id,x,y);
    /// nothing is written then.
    #[arg(long)]
    own: Option<PathBuf>,
    /// How near a track must be to a target of one's own clips, px.
    #[arg(long, default_value_t = 5.0)]
    own_near_px: f64,
    /// The grey clips of 8 bits seen in another way; nothing is written then.
    #[arg(long)]
    variant: Option<variant::Variant>,
    /// Only so many composed clips of one seed: real stills under a moving camera with targets drawn on them; nothing is written to the page then.
    #[arg(long, conflicts_with_all = ["own", "variant"], value_parser = clap::value_parser!(u64).range(1..))]
    composed: Option<u64>,
    /// The seed of these.
    #[arg(long, requires = "composed", default_value_t = composed::SEEDS[0])]
    composed_seed: u64,
    /// Folder where these clips stay, with their points beside them: for `--own`, and to be looked at.
    #[arg(long, requires = "composed")]
    keep: Option<PathBuf>,
    /// Folder with SORT's tracks (`MOT17-02.txt` ...), made by `scripts/sort_peer.py`.
    #[arg(long)]
    sort: Option<PathBuf>,
    /// Print each false track: frames, first and last position.
    #[arg(long)]
    list_false: bool,
}

const HEAD: &str = "| clip | half | contrast | held | targets | precision | IDF1 | ids a target | false tracks | error px | NIS | ms a frame |\n\
                    | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n";

fn percent(v: Option<f64>) -> String {
    v.filter(|v| v.is_finite()).map_or("-".into(), |v| format!("{:.1} %", 100.0 * v))
}

fn row(clip: &Clip, half: char, s: &Score) -> String {
    format!(
        "| {} | {half} | {} | {} | {} of {} | {} | {} | {:.1} | {} | {:.2} | {:.2} | {:.1} |\n",
        clip.name,
        clip.contrast.map_or("-".into(), |c| format!("{c:.1}")),
        percent(Some(s.held)),
        s.found[0],
        s.found[1],
        percent(s.precision),
        percent(s.idf1),
        s.ids_a_target,
        s.false_tracks.as_ref().map_or("-".into(), |f| f.len().to_string()),
        s.error_px,
        s.nis,
        s.ms_a_frame
    )
}

/// The means of a half of a kind; targets of low contrast are left out of what is held.
fn summary(kind: &str, half: char, scores: &[&(Clip, char, Score)]) -> String {
    let visible = |c: &Clip| c.contrast.is_none_or(|c| c > 3.0);
    let minutes: f64 = scores.iter().map(|s| s.2.minutes).sum();
    let n_false: usize = scores.iter().filter_map(|s| Some(s.2.false_tracks.as_ref()?.len())).sum();
    let honest = scores.iter().filter(|s| (1.6..=2.4).contains(&s.2.nis)).count();
    format!(
        "| {kind} | {half} | {} | {} | {} | {} | {} | {:.1} | {:.2} | {honest} of {} | {:.1} |\n",
        scores.len(),
        percent(mean(scores.iter().filter(|s| visible(&s.0)).map(|s| s.2.held))),
        percent(mean(scores.iter().filter(|s| visible(&s.0)).filter_map(|s| s.2.held_long))),
        percent(mean(scores.iter().filter_map(|s| s.2.precision))),
        percent(mean(scores.iter().filter_map(|s| s.2.idf1))),
        mean(scores.iter().map(|s| s.2.ids_a_target)).unwrap_or(f64::NAN),
        n_false as f64 / minutes,
        scores.len(),
        mean(scores.iter().map(|s| s.2.ms_a_frame)).unwrap_or(f64::NAN)
    )
}

/// Runs the exam, prints it and writes `docs/exam.md`.
pub fn run(args: &Args) -> Result<()> {
    let request = boresight::auto::Request {
        detector: args.detector,
        false_tracks_per_hour: args.false_tracks_per_hour,
        ..Default::default()
    };
    let asked = !args.only.is_empty()
        || !args.sets.is_empty()
        || request != boresight::auto::Request::default()
        || args.variant.is_some()
        || args.composed.is_some();
    let data = args.data.clone().unwrap_or_else(crate::data::test_data);
    let mut done: Vec<(Clip, char, Score)> = Vec::new();
    let (mut kind, mut n_of_kind) = ("", 0);
    let mut text = format!("## Clip by clip\n\n{HEAD}");
    print!("{HEAD}");
    let folder = std::env::temp_dir().join(format!("boresight_exam_{}", std::process::id()));
    std::fs::create_dir_all(&folder)?;
    let mut all = Vec::new();
    let mut whole = |clips: Vec<Clip>| all.extend(clips.into_iter().map(|clip| (clip, None)));
    match (&args.own, args.composed) {
        (Some(dir), _) => whole(clips::own(dir, args.own_near_px)?),
        (None, Some(_)) => {}
        (None, None) => {
            whole(clips::clips(&data)?);
            whole(scenes::clips(&folder, &args.only)?);
        }
    }
    if args.own.is_none() {
        let to = args.keep.as_ref().unwrap_or(&folder);
        std::fs::create_dir_all(to)?;
        let (seeds, n) = args
            .composed
            .map_or((&composed::SEEDS[..], composed::N_CLIPS), |n| (std::slice::from_ref(&args.composed_seed), n));
        all.extend(composed::clips(&data, to, seeds, n).into_iter().map(|(clip, plan)| (clip, Some(plan))));
    }
    ensure!(args.composed.is_none() || !all.is_empty(), "{}: no stills to compose clips of", data.display());
    for (clip, plan) in all {
        n_of_kind = if clip.kind == kind { n_of_kind + 1 } else { 0 };
        kind = clip.kind;
        let half = if n_of_kind % 2 == 0 { 'A' } else { 'B' };
        if !(is_wanted(&args.only, &clip.name) || is_wanted(&args.only, clip.kind)) {
            continue;
        }
        let clip = match args.variant {
            Some(_) if plan.is_some() || clip.kind.starts_with("simulated") || !variants::is_possible(&clip) => {
                continue;
            }
            Some(variant) => match variants::clip(&clip, variant, &folder)? {
                Some(clip) => clip,
                None => continue,
            },
            None => clip,
        };
        let is_composed = plan.is_some();
        let clip = match plan {
            Some(plan) => plan.write(clip)?,
            None => clip,
        };
        let s = score(&clip, &args.sets, &request)?;
        if is_composed && args.keep.is_none() {
            std::fs::remove_file(&clip.input)?;
        }
        let row = row(&clip, half, &s);
        print!("{row}");
        if !args.only.is_empty() || args.own.is_some() || args.variant.is_some() || args.composed.is_some() {
            println!("    {}", s.chosen);
        }
        if args.list_false {
            s.false_tracks.iter().flatten().for_each(|t| println!("    {t}"));
        }
        text += &row;
        done.push((clip, half, s));
    }
    std::fs::remove_dir_all(&folder)?;
    let mut head = String::from(
        "| kind | half | clips | held (contrast > 3) | of targets in > 20 frames | precision | IDF1 | ids a target | false tracks a minute | NIS in 1.6..2.4 | ms a frame |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    let mut kinds: Vec<&str> = done.iter().map(|d| d.0.kind).collect();
    kinds.dedup();
    for kind in kinds {
        for half in ['A', 'B'] {
            let of: Vec<_> = done.iter().filter(|d| d.0.kind == kind && d.1 == half).collect();
            if !of.is_empty() {
                head += &summary(kind, half, &of);
            }
        }
    }
    let n_honest = done.iter().filter(|d| (1.6..=2.4).contains(&d.2.nis)).count();
    let mut closing = String::new();
    writeln!(closing, "\nMean NIS within 1.6 to 2.4 on {n_honest} of {} clips.", done.len())?;
    print!("\n{head}{closing}");
    if args.own.is_some() || args.variant.is_some() || args.composed.is_some() {
        return Ok(());
    }
    let (tables, n_above, n_compared) = tables::run(&data, &args.only, args.sort.as_deref())?;
    let aims = aims::table(&done, n_above, n_compared);
    print!("\n{tables}\n{aims}");
    if !asked {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/exam.md");
        std::fs::write(path, format!("{INTRODUCTION}{head}{closing}\n{aims}\n{tables}\n{text}\n{SENSITIVITY}"))?;
    }
    Ok(())
}

/// The last section, written by `scripts/sensitivity`: one build of another kind and hundreds of runs.
const SENSITIVITY: &str = include_str!("sensitivity.md");

const INTRODUCTION: &str = "# The exam\n\n\
    `boresight track` on all public data without any option, as `cargo xtask exam` runs it; the command writes this page, the bad rows too. \
    Clips of a kind belong in turns to half A and half B: a figure that differs between the halves is a warning that it was fitted.\n\n\
    *Held*: share of the truth's rows with a reported track near (in the box grown by 3 px, 5 px in visible light; within 30 px for people and cells, 15 for the mouse, 10 for \
    the car, 3 for particles). *Targets*: those held in at least half of their rows. *False*: reported tracks that are near a target in fewer than half of their rows. *Contrast*: height of the target over the deviation of \
    its surroundings, median over the clip. *Error*: median distance of the nearest reported track from a held target, box centre or point. *NIS*: mean normalised innovation squared of reported tracks; 2 if the filter's covariances are true. \
    The car's truth holds one car of many, so nothing can be called false there. The particles' truth is trackpy's, of which many pieces last a few frames: what is held of targets in more than 20 frames stands beside. The truth of the infrared clips holds what they were filmed for: looked at as pictures, the false tracks of the two clips of a minute are those of eleven small things that fly by themselves (birds or insects, not told apart), and so are those of DRONE_131 and DRONE_143; that of HELICOPTER_051 is glitter on water. *Simulated*: three spots (sigma 1.5 px, 100 counts) that move over a textured ground under a camera that stands, pans, \
    shakes, turns or zooms (numbers per frame; shake: standard deviation), twenty spots of five deviations of white noise, and fifty bright ones in a video; 120 frames, the truth is exact, near is 3 px, A and B are two seeds. \
    *Composed*: a window of 320 x 256 px that stands, drifts, pans, shakes or follows a target goes over a real infrared still, in half of the clips of a moving camera with a nearer part \
    before it that moves by 2 to 30 % more (parallax); one to five spots and ellipses of 2 to 28 px, bright or dark, of 3 to 15 deviations of the ground around them, that enter, cross and leave, and white noise of 1 to 4 counts are drawn; 200 to 300 frames, the truth is exact, near is 5 px, A and B are two seeds.\n\n";
