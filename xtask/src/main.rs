//! Repository chores: `cargo xtask <NAME>`.

mod bench_clips;
mod bench_metrics;
mod bench_run;
mod bench_track;
mod choices;
mod clutter_table;
mod crossing_table;
mod data;
mod detect_exam;
mod detect_scenes;
mod docs;
mod exam;
mod filter_table;
mod limit;
mod link_table;
mod mot;
mod mot_table;
mod mutants;
mod operating_curves;
mod video_check;

use clap::{Parser, Subcommand};

/// Repository chores: exams on public data, benchmarks, generated references.
#[derive(Parser)]
struct Cli {
    #[command(subcommand)]
    chore: Chore,
}

#[derive(Subcommand)]
enum Chore {
    /// Measure the speed of the evaluation from files, beside other tools.
    BenchMetrics(bench_metrics::Args),
    /// What a whole run costs beside decoding alone: the table of docs/speed.md.
    BenchRun(bench_run::Args),
    /// Write the parameter reference and the JSON schema to docs/.
    Docs(docs::Args),
    /// Scale: scans per second from 10 to 100 000 targets, with GOSPA.
    BenchTrack(bench_track::Args),
    /// What the automatic choice says of every public clip.
    Choices(choices::Args),
    /// One target in clutter: share lost by each method, beside the reference's.
    ClutterTable(clutter_table::Args),
    /// Crossing targets: share tracked and identity switches of each method.
    CrossingTable(crossing_table::Args),
    /// The detector of a stated false-alarm rate: alarms, detection, bounds, time.
    DetectExam(detect_exam::Args),
    /// All public data with no options, one table, written to docs/exam.md.
    Exam(exam::Args),
    /// Every filter by name over the sample clip: held, error, NIS.
    FilterTable(filter_table::Args),
    /// Below the noise of a frame: curves, false alarms, crossing targets, real clips, cost; written to docs/limit.md.
    Limit(limit::Args),
    /// Links against trackpy's and btrack's published ones.
    LinkTable(link_table::Args),
    /// Tracks from MOTChallenge detections beside SORT's: HOTA, IDF1, MOTA.
    MotTable(mot_table::Args),
    /// How strong the tests are: mutants of one build, switched on one by one.
    Mutants(mutants::Args),
    /// Delay and share held against the false tracks that are allowed, written to docs/operating-curves.md.
    OperatingCurves(operating_curves::Args),
    /// Compare decoded video with ffmpeg's frames, live.
    VideoCheck(video_check::Args),
}

fn main() -> anyhow::Result<()> {
    match Cli::parse().chore {
        Chore::BenchMetrics(args) => bench_metrics::run(&args),
        Chore::BenchRun(args) => bench_run::run(&args),
        Chore::Docs(args) => docs::run(&args),
        Chore::BenchTrack(args) => bench_track::run(&args),
        Chore::Choices(args) => choices::run(&args),
        Chore::ClutterTable(args) => clutter_table::run(&args),
        Chore::CrossingTable(args) => crossing_table::run(&args),
        Chore::DetectExam(args) => detect_exam::run(&args),
        Chore::Exam(args) => exam::run(&args),
        Chore::FilterTable(args) => filter_table::table(&args),
        Chore::Limit(args) => limit::run(&args),
        Chore::LinkTable(args) => link_table::run(&args),
        Chore::MotTable(args) => mot_table::run(&args),
        Chore::Mutants(args) => mutants::run(&args),
        Chore::OperatingCurves(args) => operating_curves::run(&args),
        Chore::VideoCheck(args) => video_check::run(&args),
    }
}
