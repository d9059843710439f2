//! `boresight config`: prints, checks and explains configurations.

use crate::console;
use boresight::track::PRESETS;
use boresight::{Config, Error, ErrorKind};
use std::path::PathBuf;
use std::process::ExitCode;

/// Arguments of `boresight config`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  boresight config                                     every key with its default
  boresight config --check my.toml                     exit code 0 if it is sound
  boresight config --explain tracker.gate-probability  what a key means
  boresight config --explain tracker                   what a table holds
  boresight config --list filters                      the filters: what each is, when to take it, its source
  boresight config --list models                       the motion models that a filter can be given
  boresight config --schema                            a JSON schema for editors")]
pub struct Args {
    /// Check a file and say what is wrong with it.
    #[arg(long, value_name = "FILE")]
    check: Option<PathBuf>,
    /// Explain a key or a table: `tracker.coast-s`, `detector.threshold`.
    #[arg(long, value_name = "KEY")]
    explain: Option<String>,
    /// List what can be chosen: filters, forms, models, innovations, thresholds, associators, confirmations, initiations.
    #[arg(long, value_name = "WHAT")]
    list: Option<String>,
    /// Print a JSON schema of the configuration.
    #[arg(long)]
    schema: bool,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let text = if let Some(path) = &args.check {
        let config = Config::from_file(path)?;
        let unused = super::run_options::unused(&config).map_or(String::new(), |keys| format!("{keys}\n"));
        // What a full disk or a broken copy leaves is sound, too, and is hardly what was meant.
        let changes =
            if config == Config::default() { " that changes nothing: every value is the default" } else { "" };
        format!("{}: a sound configuration{changes}\n{unused}", path.display())
    } else if let Some(key) = &args.explain {
        explain(key)?
    } else if let Some(what) = &args.list {
        list(what)?
    } else if args.schema {
        serde_json::to_string_pretty(&boresight::config::schema())? + "\n"
    } else {
        Config::default().to_toml()?
    };
    console::print(text.as_bytes())?;
    Ok(ExitCode::SUCCESS)
}

/// What `--list` knows, and the key that holds it.
const LISTS: [(&str, &str); 12] = [
    ("filters", "tracker.filter"),
    ("forms", "tracker.filter.form"),
    ("models", "tracker.filter.model"),
    ("innovations", "tracker.filter.innovation"),
    ("associators", "tracker.associator"),
    ("confirmations", "tracker.confirmation"),
    ("initiations", "tracker.initiation"),
    ("clutter", "tracker.clutter"),
    ("association-costs", "tracker.association-cost"),
    ("thresholds", "detector.threshold"),
    ("spatial-filters", "detector.filter"),
    ("centroids", "detector.centroid.method"),
];

fn list(what: &str) -> anyhow::Result<String> {
    let names = LISTS.map(|(name, _)| name).join(", ");
    let (_, key) = LISTS.iter().find(|(name, _)| *name == what).ok_or_else(|| {
        Error::new(ErrorKind::Config, "there is no such list")
            .at(format!("--list {what}"))
            .hint(format!("lists: {names}"))
    })?;
    if what == "filters" {
        return Ok(entries(
            key,
            "Whole filters by name: `filter = \"ud\"`, `--filter ud`.",
            &PRESETS.map(|p| (p.name, p.meaning)),
        ));
    }
    let mut text = explain(key)?;
    if what == "associators" {
        // Its own tracker, so a table of its own; to the user one more way to associate.
        let mht = boresight::config::explain("tracker.mht")?;
        let meaning = mht.meaning.lines().next().unwrap_or_default();
        text += &format!("  {:14}  {meaning} (a table of its own, tracker.mht)\n", "mht");
    }
    Ok(text)
}

fn explain(key: &str) -> anyhow::Result<String> {
    let found = boresight::config::explain(key)?;
    let default = found.default.as_ref().map_or(String::new(), |d| format!("\n  default: {d}"));
    let own: Vec<_> = found.entries.iter().map(|(name, meaning)| (name.as_str(), meaning.as_str())).collect();
    Ok(entries(key, &format!("{}{default}", found.meaning), &own))
}

/// A key, its meaning, and what there is below it, in columns.
fn entries(key: &str, meaning: &str, below: &[(&str, &str)]) -> String {
    let width = below.iter().map(|(name, _)| name.len()).max().unwrap_or(0);
    let mut text = format!("{key}\n  {meaning}\n");
    for (name, meaning) in below {
        text += &format!("  {name:width$}  {meaning}\n");
    }
    text
}
