//! Every subcommand has a help text with examples; completions and the manual page know them all.

use super::{run_ok, stdout};

fn subcommands() -> Vec<String> {
    let text = stdout(&run_ok(["--help"]));
    let list = text.split("Commands:").nth(1).and_then(|t| t.split("Options:").next()).expect("a list of commands");
    // A sentence that goes on in the next line is indented further.
    let names = list.lines().filter(|l| !l.starts_with("   ")).filter_map(|l| l.split_whitespace().next());
    names.filter(|n| *n != "help").map(str::to_string).collect()
}

#[test]
fn every_help_text_has_a_sentence_usage_and_examples() {
    let names = subcommands();
    assert!(names.len() >= 9, "{names:?}");
    for name in names {
        let text = stdout(&run_ok([name.as_str(), "--help"]));
        let first = text.lines().next().unwrap_or("");
        assert!(first.len() > 15 && first.starts_with(char::is_uppercase), "{name}: {first}");
        assert!(text.contains("Usage: boresight"), "{name}");
        assert!(text.contains("Example"), "{name} shows no example:\n{text}");
        assert!(text.contains(&format!("  boresight {name}")), "{name}: an example that runs it");
    }
}

#[test]
fn completions_name_every_subcommand() {
    for shell in ["bash", "elvish", "fish", "powershell", "zsh", "man"] {
        let text = stdout(&run_ok(["completions", shell]));
        for name in subcommands() {
            assert!(text.contains(&name), "{shell} lacks {name}");
        }
    }
}

#[test]
fn formats_are_listed_where_they_can_be_chosen() {
    for name in ["convert", "evaluate"] {
        let text = stdout(&run_ok([name, "--help"]));
        assert!(text.contains("[possible values: mot, mot-truth, kitti, csv, trackpy"), "{name}: {text}");
    }
}

#[test]
fn detect_offers_nothing_that_only_tracks_have() {
    let text = stdout(&run_ok(["detect", "--help"]));
    assert!(!text.contains("--filter") && !text.contains("--associator"), "{text}");
}

#[test]
fn the_help_of_evaluate_begins_with_the_usual() {
    let text = stdout(&run_ok(["evaluate", "--help"]));
    let at = |word: &str| text.find(word).unwrap_or_else(|| panic!("{word}: {text}"));
    let (reading, measures) = (at("How tables are read:"), at("Parameters of measures:"));
    for usual in ["--match", "--threshold", "--distance", "--compare", "--require", "--mot-only", "--html", "--csv"] {
        assert!(at(&format!("      {usual}")) < reading, "{usual}");
    }
    assert!(reading < at("--truth-format") && at("--truth-format") < measures && measures < at("--switch-cost"));
}
