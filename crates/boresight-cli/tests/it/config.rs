//! `boresight config`: prints, checks, explains, lists; and the ready examples in `configs/`.

use super::{root, run, run_ok, stderr, stdout};

#[test]
fn what_it_prints_it_accepts() {
    let text = stdout(&run_ok(["config"]));
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("my.toml");
    std::fs::write(&file, &text).unwrap();
    let out = run_ok(["config", "--check", file.to_str().unwrap()]);
    assert!(stdout(&out).contains("a sound configuration that changes nothing"));
    std::fs::write(&file, "").unwrap();
    let empty = run_ok(["config", "--check", file.to_str().unwrap()]);
    assert!(stdout(&empty).contains("that changes nothing"), "what a full disk leaves");
    std::fs::write(&file, "tracker.coast-s = 2.0\n").unwrap();
    assert!(!stdout(&run_ok(["config", "--check", file.to_str().unwrap()])).contains("changes nothing"));
    for table in ["[input]", "[detector]", "[tracker]", "gate-probability = 0.99"] {
        assert!(text.contains(table), "{table}");
    }
}

#[test]
fn keys_that_the_detector_does_not_look_at_are_named() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("my.toml");
    std::fs::write(&file, "[detector]\nthreshold.spot = {}\ncluster.distance-px = 4.0\n").unwrap();
    let said = stdout(&run_ok(["config", "--check", file.to_str().unwrap()]));
    assert!(said.contains("Without effect beside this detector.threshold: detector.cluster.distance-px."), "{said}");
}

#[test]
fn every_ready_configuration_is_sound_and_says_how_to_use_it() {
    let mut n = 0;
    for entry in std::fs::read_dir(root().join("configs")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|e| e == "toml") {
            let out = run_ok(["config", "--check", path.to_str().unwrap()]);
            assert!(!stdout(&out).contains("Without effect"), "{}", stdout(&out));
            let text = std::fs::read_to_string(&path).unwrap();
            let name = path.file_name().unwrap().to_str().unwrap();
            assert!(text.starts_with("# ") && text.contains(&format!("--config configs/{name}")), "{name}");
            n += 1;
        }
    }
    assert!(n >= 4, "{n}");
}

#[test]
fn every_list_names_its_choices_with_a_sentence_each() {
    for (list, member) in [
        ("filters", "fuzzy-srif"),
        ("associators", "global-nearest"),
        ("confirmations", "m-of-n"),
        ("initiations", "two-point"),
        ("clutter", "given"),
        ("thresholds", "isolated"),
        ("spatial-filters", "median"),
        ("centroids", "bbox"),
    ] {
        let text = stdout(&run_ok(["config", "--list", list]));
        let line =
            text.lines().find(|l| l.trim_start().starts_with(member)).unwrap_or_else(|| panic!("{list}: {text}"));
        assert!(line.trim().len() > member.len() + 10, "{line}");
    }
    let out = run(["config", "--list", "fliters"]);
    assert!(out.status.code() == Some(2) && stderr(&out).contains("hint: lists: filters"), "{}", stderr(&out));
}

#[test]
fn a_key_is_explained_with_its_default_and_a_wrong_one_gets_a_suggestion() {
    let text = stdout(&run_ok(["config", "--explain", "tracker.gate-probability"]));
    assert!(text.contains("default: 0.99") && text.contains("χ²"), "{text}");
    assert!(stdout(&run_ok(["config", "--explain", "tracker"])).contains("coast-s"));
    let out = run(["config", "--explain", "tracker.coast_s"]);
    assert_eq!(out.status.code(), Some(2));
    assert!(stderr(&out).contains("did you mean `coast-s`?"), "{}", stderr(&out));
}

#[test]
fn the_schema_is_json_and_is_the_one_in_docs() {
    let text = stdout(&run_ok(["config", "--schema"]));
    let schema: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert!(schema.pointer("/$defs/TrackerConfig/properties/gate-probability/description").is_some());
    let kept = std::fs::read_to_string(root().join("docs/boresight.schema.json")).unwrap();
    assert!(kept == text, "docs/boresight.schema.json is out of date: run `cargo xtask docs`");
}
