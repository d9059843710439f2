//! `boresight evaluate`: how good is a result against the truth, by every measure of the field.

mod arguments;
mod demand;
mod html;
mod images;
mod json;
mod judged;
mod output;
mod plot;
mod read;
mod sequences;
mod table;

use crate::console::{self, say};
use anyhow::{Context, bail};
use boresight::metrics::evaluation::{self, Comparison, ResultEvaluation};
use demand::met;
use judged::Judged;
use rayon::prelude::*;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

pub use arguments::{Args, format, size, written_format};

/// Runs the command.
/// # Errors
/// Inputs that cannot be read or do not belong together; outputs that cannot be written.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    if !(args.distance > 0.0 && args.distance.is_finite()) {
        bail!(boresight::Error::new(boresight::ErrorKind::Config, "expected a distance above 0 px").at("--distance"));
    }
    let detections = args.detections.as_ref().map(OsString::from);
    let named = [&args.truth, &args.result].into_iter().chain(&args.compare).chain(&detections);
    named.into_iter().try_for_each(|input| refuse(&args, input))?;
    if images::are_frames(&args.truth) {
        return images::run(&args);
    }
    let mut results = Vec::with_capacity(1 + args.compare.len());
    for result in std::iter::once(&args.result).chain(&args.compare) {
        let found = sequences::find(&args.truth, result)?;
        found.iter().flat_map(|s| [Some(&s.truth), s.result.as_ref()]).flatten().try_for_each(|i| refuse(&args, i))?;
        let read: Vec<_> = found.par_iter().map(|s| read::judge(&args, s)).collect::<boresight::Result<_>>()?;
        let (sequences, notes): (Vec<_>, Vec<Vec<String>>) = read.into_iter().unzip();
        let evaluation = ResultEvaluation::new(result.to_string_lossy(), sequences);
        let notes = named_notes(&evaluation, notes);
        for note in &notes {
            say!("note: {note}");
        }
        results.push(Judged { evaluation, notes });
    }
    let evaluations: Vec<ResultEvaluation> = results.iter().map(|j| j.evaluation.clone()).collect();
    let comparison = if args.compare.is_empty() {
        Vec::new()
    } else {
        evaluation::compare(&evaluations, args.draws.get(), args.seed)?
    };
    let mut text = String::new();
    for judged in &results {
        text.push_str(&table::sequences(&judged.evaluation));
    }
    text.push_str(&table::comparison(&results, &comparison));
    let mut files = output::Files::default();
    write_files(&args, &results, &comparison, &mut files)?;
    files.take(console::print(text.as_bytes()).map(drop));
    files.all_written()?;
    met(&args.require, &results[0].evaluation.values())
}

/// Refuses files of scores in the place of an input.
fn refuse(args: &Args, input: impl AsRef<Path>) -> boresight::Result<()> {
    let outputs = [&args.csv, &args.json, &args.html].into_iter().flatten();
    boresight::io::refuse_to_overwrite(input, outputs.map(PathBuf::as_path))
}

/// The notes of all sequences, with the sequence's name where there are several.
fn named_notes(evaluation: &ResultEvaluation, notes: Vec<Vec<String>>) -> Vec<String> {
    let several = notes.len() > 1;
    let named = |(s, notes): (&evaluation::Evaluation, Vec<String>)| {
        let name = s.name.clone();
        notes.into_iter().map(move |n| if several { format!("{name}: {n}") } else { n })
    };
    evaluation.sequences.iter().zip(notes).flat_map(named).collect()
}

fn write_files(
    args: &Args,
    results: &[Judged],
    comparison: &[Comparison],
    files: &mut output::Files,
) -> anyhow::Result<()> {
    if let Some(path) = &args.csv {
        files.put(path, &table::csv(results));
    }
    if let Some(path) = &args.json {
        let value = serde_json::json!({
            "results": results.iter().map(json::result).collect::<Vec<_>>(),
            "comparison": comparison,
        });
        files.put(path, &serde_json::to_string_pretty(&value).context("scores as JSON")?);
    }
    if let Some(path) = &args.html {
        files.put(path, &html::report(results, comparison));
    }
    Ok(())
}
