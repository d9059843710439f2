//! `boresight reproduce`: the papers' tables and figures, side by side with ours.

use crate::console::{self, say};
use crate::progress;
use boresight::io::write_whole;
use boresight::{Error, ErrorKind};
use boresight_reproduce::{ITEMS, Item, Options, Output, html};
use std::fmt::Write;
use std::path::PathBuf;
use std::process::ExitCode;

/// Reproduce the papers' tables and figures by Monte Carlo, honestly, including those that do not reproduce.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  boresight reproduce                         all items, 200 runs each
  boresight reproduce srif-1 --runs 1000      one table
  boresight reproduce --list                  what there is
  boresight reproduce -o report               report/index.html with the figures, report/reproduce.json")]
pub struct Args {
    /// Item to reproduce (see --list); all without it.
    item: Option<String>,
    /// Monte Carlo runs of each study.
    #[arg(long, default_value_t = 200)]
    runs: u64,
    /// Seed: the same seed gives the same numbers, for any number of threads.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Folder for the HTML report and the numbers as JSON.
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// List the items and stop.
    #[arg(long)]
    list: bool,
}

/// Runs the command.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    if args.list {
        let text: String = ITEMS.iter().map(|i| format!("{:12} {}\n", i.name, i.what)).collect();
        console::print(text.as_bytes())?;
        return Ok(ExitCode::SUCCESS);
    }
    if args.runs == 0 {
        return Err(Error::new(ErrorKind::Config, "expected a whole number of 1 or more").at("--runs 0").into());
    }
    let chosen: Vec<&Item> = match &args.item {
        None => ITEMS.iter().collect(),
        Some(name) => {
            let item = ITEMS.iter().find(|i| i.name == name).ok_or_else(|| {
                let known: Vec<_> = ITEMS.iter().map(|i| i.name).collect();
                Error::new(ErrorKind::Config, "there is no such item")
                    .at(name)
                    .hint(format!("items: {}", known.join(", ")))
            })?;
            vec![item]
        }
    };
    let total = chosen.iter().map(|i| i.studies * args.runs).sum();
    let bar = progress::bar(Some(total), "runs");
    let tick = |n| bar.inc(n);
    let options = Options { runs: args.runs, seed: args.seed, progress: &tick };
    let (mut outputs, mut printed) = (Vec::new(), Ok(()));
    for item in chosen {
        bar.set_message(item.name);
        let output = (item.make)(&options)?;
        // Numbers that cannot be shown are not lost if they go to a folder as well.
        let shown = bar.suspend(|| console::print(text(&output).as_bytes()));
        if args.output.is_some() {
            printed = printed.and(shown.map(drop));
        } else if !shown? {
            break;
        }
        outputs.push(output);
    }
    bar.finish_and_clear();
    if let Some(dir) = &args.output {
        let fail = |e: std::io::Error| Error::new(ErrorKind::Output, "cannot be written").at(dir.display()).because(e);
        std::fs::create_dir_all(dir).map_err(fail)?;
        let page = write_whole(dir.join("index.html"), html::page(&outputs, args.runs, args.seed).as_bytes());
        let numbers = write_whole(dir.join("reproduce.json"), serde_json::to_string_pretty(&outputs)?.as_bytes());
        page.and(numbers)?;
        say!("report: {}", dir.join("index.html").display());
    }
    printed?;
    Ok(ExitCode::SUCCESS)
}

/// The tables of an item as text.
fn text(output: &Output) -> String {
    let mut out = String::new();
    for s in &output.sections {
        let _ = writeln!(out, "\n{}  [{}]\n  reading {}", s.title, s.item, s.reading);
        let _ = writeln!(
            out,
            "  {:<27}{:<13}{:>9}{:>10}{:>10}{:>12}{:>11}{:>6}",
            "case", "measure", "paper", "mean", "std", "percentile", "reference", "off"
        );
        for r in &s.rows {
            let number = |v: Option<f64>, digits: usize| v.map_or("-".into(), |v| format!("{v:.digits$}"));
            let lost = if r.lost > 0 { format!("  {} runs lost", r.lost) } else { String::new() };
            let _ = writeln!(
                out,
                "  {:<27}{:<13}{:>9}{:>10}{:>10}{:>12}{:>11}{:>6}{lost}",
                r.case,
                r.measure,
                number(r.paper, 4),
                number(r.ours.kept().map(|s| s.mean), 4),
                number(r.ours.kept().map(|s| s.std), 4),
                number(r.ours.percentile, 1),
                number(r.reference.map(|x| x.0), 4),
                number(r.standard_errors_off(), 1)
            );
        }
        let _ = writeln!(out, "  {}", s.sentence);
    }
    if !output.figures.is_empty() {
        let _ = writeln!(out, "\n{} figures (drawn into the report with -o DIR)", output.figures.len());
    }
    out
}
