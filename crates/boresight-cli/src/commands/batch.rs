//! `boresight batch`: many inputs, each in a process of its own, with a manifest that a kill at any moment leaves whole.

mod all_tracks;
mod child;
mod hash;
mod inputs;
mod job;
mod manifest;
mod page;
mod time_left;
mod verify;

use crate::console::say;
use crate::progress;
use anyhow::Context;
use boresight::{Error, ErrorKind};
use child::Limits;
use clap::Parser;
use inputs::{Input, Shard};
use job::{Job, Made};
use manifest::{Entry, Manifest, Status};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

const EXAMPLES: &str = "Examples:
  boresight batch 'videos/*.mp4' -o results
      tracks every video; results/index.html shows them all, results/tracks.csv holds all rows
  boresight batch 'videos/*.mp4' -o results --resume
      goes on after a kill, and tries again what failed
  boresight batch 'videos/*.mp4' -o results --jobs 4 --timeout 600 --max-memory 2000
      four at once, each at most 10 minutes and 2 GB
  boresight batch 'videos/*.mp4' -o results -- --detector cfar --no-video
      options of `boresight track` behind --
  boresight batch 'videos/*.mp4' -o results --shard 2/8
      the second of eight machines; afterwards --resume without --shard makes the page and the table
  boresight batch --verify -o results
      hashes every input and output again";

/// Arguments of `boresight batch`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// Videos, folders of images, image stacks, tables of detections, or patterns of such in quotes: 'videos/*.mp4'.
    #[arg(value_name = "INPUT", required_unless_present = "verify")]
    inputs: Vec<String>,
    /// Folder for the results of all inputs.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Inputs at once; as many as the machine has processors if absent.
    #[arg(short, long, value_name = "N")]
    jobs: Option<NonZeroUsize>,
    /// Time that one input may take, s.
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    timeout: Option<f64>,
    /// Memory that one input may take, MB.
    #[arg(long, value_name = "MB", value_parser = clap::value_parser!(u64).range(1..))]
    max_memory: Option<u64>,
    /// Go on with the batch in the folder: what is done, with these options, by this version and as its hashes say, stays.
    #[arg(long)]
    resume: bool,
    /// Take one part of N of the inputs, told by their names: one part for each machine, all with one folder.
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
    /// Also write the table of all tracks as Parquet, tracks.parquet (a build with the feature `parquet`).
    #[arg(long)]
    parquet: bool,
    /// Run nothing: hash the inputs and outputs that the manifest names, and say what is missing or differs.
    #[arg(long, conflicts_with_all = ["resume", "shard", "jobs", "timeout", "max_memory", "parquet", "options"])]
    verify: bool,
    /// Print nothing but errors.
    #[arg(short, long)]
    quiet: bool,
    /// Options of `boresight track` for every input.
    #[arg(last = true, value_name = "OPTIONS")]
    options: Vec<String>,
}

fn seconds(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|v: &f64| *v > 0.0 && v.is_finite())
        .ok_or_else(|| "a number of seconds above 0".to_string())
}

/// The options behind `--` as `track` takes them.
#[derive(Debug, Parser)]
#[command(name = "boresight track", no_binary_name = true)]
struct Options {
    #[command(flatten)]
    track: super::track::Args,
}

/// Runs the command.
/// # Errors
/// Wrong options; a folder that cannot be written. An input that fails is no error of the batch.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    if args.output.as_os_str() == "-" {
        return Err(Error::new(ErrorKind::Config, "expected a folder: the results are many files")
            .at("--output -")
            .into());
    }
    if args.parquet && !cfg!(feature = "parquet") {
        return Err(Error::new(ErrorKind::Unsupported, "this build writes no Parquet")
            .at("--parquet")
            .hint("build with the feature: cargo install --path crates/boresight-cli --features parquet")
            .into());
    }
    let mut inputs = inputs::find(&args.inputs)?;
    if args.verify {
        return verify_all(&args.output, &inputs);
    }
    let job = job(&args)?;
    let n_all = inputs.len();
    if let Some(shard) = args.shard {
        inputs.retain(|i| i.is_in(shard));
    }
    std::fs::create_dir_all(&args.output).map_err(|e| {
        Error::new(ErrorKind::Output, "the folder for the results cannot be made").at(args.output.display()).because(e)
    })?;
    let name = match args.shard {
        Some(Shard { number, of }) => format!("manifest-{number}-of-{of}.jsonl"),
        None => "manifest.jsonl".to_string(),
    };
    let manifest = Manifest::open(args.output.join(name), args.resume)?;
    let known = manifest::read_all(&args.output)?;
    known.warnings.iter().for_each(|w| say!("warning: {w}"));
    let stop = Arc::new(AtomicBool::new(false));
    let raised = Arc::clone(&stop);
    ctrlc::set_handler(move || {
        // A second time ends it at once; the children see the end of their standard input.
        if raised.swap(true, Ordering::SeqCst) {
            std::process::exit(130);
        }
    })
    .context("no handler for Ctrl-C could be set")?;
    let all = Batch { job: &job, inputs: &inputs, known: &known, stop: &stop, quiet: args.quiet };
    let entries = all.run(manifest, jobs(&args).min(inputs.len().max(1)))?;
    if stop.load(Ordering::SeqCst) {
        say!("interrupted: {} of {} inputs are done; --resume goes on", entries.len(), inputs.len());
        return Ok(ExitCode::from(130));
    }
    let failed: Vec<&Entry> = entries.iter().filter(|e| e.status == Status::Failed).collect();
    for entry in &failed {
        say!("failed: {}: {}", entry.input, entry.reason.as_deref().unwrap_or_default());
    }
    if args.shard.is_none() {
        let n_rows = all_tracks::write(&args.output, &entries)?;
        #[cfg(feature = "parquet")]
        if args.parquet {
            all_tracks::write_parquet(&args.output, &entries)?;
        }
        boresight::io::write_whole(args.output.join("index.html"), page::page(&args.output, &entries).as_bytes())?;
        if !args.quiet {
            say!("{} inputs, {} failed, {n_rows} rows of tracks", entries.len(), failed.len());
            say!("results: {}", args.output.join("index.html").display());
        }
    } else if !args.quiet {
        say!("{} of {n_all} inputs are of this shard, {} failed", entries.len(), failed.len());
        say!(
            "when all shards are done, the same command with --resume and without --shard makes the page and the table"
        );
    }
    Ok(if failed.is_empty() { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

fn jobs(args: &Args) -> usize {
    let processors = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
    args.jobs.map_or(processors, NonZeroUsize::get)
}

/// What is the same for all inputs.
fn job(args: &Args) -> anyhow::Result<Job> {
    for given in &args.options {
        let name = given.split('=').next().unwrap_or_default();
        if ["-o", "--output", "--end-with-stdin"].contains(&name) || given.starts_with("-o") {
            return Err(Error::new(ErrorKind::Config, "the batch itself says where the results go")
                .at(format!("-- {given}"))
                .hint("leave it out; the folder of the batch is --output")
                .into());
        }
    }
    // Said once, not by every child.
    let words = std::iter::once("INPUT").chain(args.options.iter().map(String::as_str));
    let parsed = Options::try_parse_from(words).map_err(|e| {
        let text = e.render().to_string();
        let text = text.trim_start_matches("error: ").lines().next().unwrap_or_default().to_string();
        Error::new(ErrorKind::Config, text).at("options behind --").hint("`boresight track --help` lists them")
    })?;
    let processors = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
    Job::new(
        args.output.clone(),
        args.options.clone(),
        parsed.track.configuration(),
        args.resume,
        Limits { time_s: args.timeout, memory_mb: args.max_memory },
        (processors / jobs(args)).max(1),
    )
    .map_err(Into::into)
}

fn verify_all(dir: &Path, inputs: &[Input]) -> anyhow::Result<ExitCode> {
    let found = verify::verify(dir, &manifest::read_all(dir)?, inputs)?;
    for line in &found.wrong {
        say!("{line}");
    }
    let failed =
        if found.n_failed == 0 { String::new() } else { format!(" ({} failed when they were run)", found.n_failed) };
    say!("{} files of {} inputs{failed}: {} missing or different", found.n_files, found.n_inputs, found.wrong.len());
    Ok(if found.wrong.is_empty() { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

/// A batch that runs.
struct Batch<'a> {
    job: &'a Job,
    inputs: &'a [Input],
    known: &'a manifest::Known,
    stop: &'a AtomicBool,
    quiet: bool,
}

/// What the threads share.
struct Shared {
    manifest: Manifest,
    made: Vec<Option<Entry>>,
    broken: Option<Error>,
    n_done: usize,
    /// Bytes of inputs that are settled, and of those among them that were run.
    settled_bytes: u64,
    run_bytes: u64,
}

impl Batch<'_> {
    /// Runs all inputs, so many at once; their entries in the inputs' order, without those that an interruption left out.
    /// # Errors
    /// A manifest that cannot be written, a process that cannot be started: the rest is not begun.
    fn run(&self, manifest: Manifest, n_threads: usize) -> boresight::Result<Vec<Entry>> {
        let next = AtomicUsize::new(0);
        let bar = progress::bar(Some(self.inputs.len() as u64), "inputs");
        let made = vec![None; self.inputs.len()];
        let shared = Mutex::new(Shared { manifest, made, broken: None, n_done: 0, settled_bytes: 0, run_bytes: 0 });
        let lock = || shared.lock().unwrap_or_else(PoisonError::into_inner);
        let all_bytes: u64 = self.inputs.iter().map(|i| i.bytes).sum();
        let started = Instant::now();
        let work = || {
            while let Some((k, input)) = self.inputs.iter().enumerate().nth(next.fetch_add(1, Ordering::SeqCst)) {
                if self.stop.load(Ordering::SeqCst) || lock().broken.is_some() {
                    return;
                }
                let outcome = self.job.run(input, self.known.entries.get(&input.name), self.stop);
                let mut all = lock();
                let (entry, is_new) = match outcome {
                    Ok(Made::New(entry)) => (entry, true),
                    Ok(Made::Kept(entry)) => (entry, false),
                    Ok(Made::Stopped) => return,
                    Err(e) => {
                        all.broken.get_or_insert(e);
                        return;
                    }
                };
                if is_new && let Err(e) = all.manifest.append(&entry) {
                    all.broken.get_or_insert(e);
                    return;
                }
                all.n_done += 1;
                all.settled_bytes += input.bytes;
                all.run_bytes += if is_new { input.bytes } else { 0 };
                let left = all_bytes - all.settled_bytes;
                let left = time_left::time_left(started.elapsed(), all.run_bytes, all.run_bytes + left);
                bar.set_message(left.clone().unwrap_or_default());
                bar.set_position(all.n_done as u64);
                if !self.quiet && bar.is_hidden() && is_new {
                    let how = match entry.status {
                        Status::Done => "done",
                        Status::Failed => "failed",
                    };
                    let left = left.map_or(String::new(), |l| format!("; {l}"));
                    let (n, of) = (all.n_done, self.inputs.len());
                    say!("[{n}/{of}] {}: {how} in {:.1} s{left}", entry.input, entry.seconds);
                }
                all.made[k] = Some(entry);
            }
        };
        std::thread::scope(|scope| {
            (0..n_threads).for_each(|_| drop(scope.spawn(work)));
        });
        bar.finish_and_clear();
        let all = shared.into_inner().unwrap_or_else(PoisonError::into_inner);
        all.broken.map_or_else(|| Ok(all.made.into_iter().flatten().collect()), Err)
    }
}
