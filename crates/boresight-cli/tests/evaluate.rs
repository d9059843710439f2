//! `boresight evaluate` as a user runs it: scores, errors, demands, files.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn boresight(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_boresight")).args(args).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn put(folder: &Path, name: &str, content: &str) -> String {
    let path = folder.join(name);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(&path, content).unwrap();
    path.display().to_string()
}

/// A MOTChallenge table of `n` tracks that move right, from frame `from` of 30.
fn tracks(n: usize, from: usize, offset: f64, truth: bool) -> String {
    let mut out = String::new();
    for f in 0..30 {
        for k in 0..n {
            let (x, y) = (10.0 + 3.0 * f as f64 + offset, 50.0 * k as f64 + 1.0);
            let end = if truth { "1,1,1" } else { "0.9,-1,-1,-1" };
            writeln!(out, "{},{},{x},{y},20,20,{end}", f + from, k + 1).unwrap();
        }
    }
    out
}

fn csv_value(csv: &str, sequence: &str, measure: &str) -> f64 {
    let mut lines = csv.lines();
    let at = lines.next().unwrap().split(',').position(|n| n == measure).unwrap_or_else(|| panic!("{measure}: {csv}"));
    let line = lines.find(|l| l.split(',').nth(1) == Some(sequence)).unwrap();
    line.split(',').nth(at).unwrap().parse().unwrap()
}

#[test]
fn a_perfect_result_scores_one_in_every_table_and_meets_its_demands() {
    let dir = tempfile::tempdir().unwrap();
    let truth = put(dir.path(), "gt.txt", &tracks(3, 1, 0.0, true));
    let result = put(dir.path(), "result.txt", &tracks(3, 1, 0.0, false));
    let csv = dir.path().join("s.csv");
    let (json, html) = (dir.path().join("s.json"), dir.path().join("s.html"));
    let out = boresight(&[
        "evaluate",
        &truth,
        &result,
        "--require",
        "HOTA=0.99",
        "--require",
        "GOSPA=0.001",
        "--csv",
        csv.to_str().unwrap(),
        "--json",
        json.to_str().unwrap(),
        "--html",
        html.to_str().unwrap(),
    ]);
    assert!(out.status.success(), "{}", text(&out.stderr));
    let csv = std::fs::read_to_string(csv).unwrap();
    for one in ["HOTA", "MOTA", "IDF1", "SIAP_C", "particle_alpha", "particle_beta", "JSC", "AP", "Recall"] {
        assert_eq!(csv_value(&csv, "gt", one), 1.0, "{one}");
    }
    for zero in ["OSPA", "OSPA2", "GOSPA", "TGOSPA", "TGOSPA_switch", "RMSPE", "PFE_x", "IDSW", "FP/frame"] {
        assert_eq!(csv_value(&csv, "gt", zero), 0.0, "{zero}");
    }
    let json: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(json).unwrap()).unwrap();
    assert_eq!(json["results"][0]["combined"]["HOTA"], 1.0);
    assert_eq!(json["results"][0]["sequences"][0]["detail"]["gospa"].as_array().unwrap().len(), 30);
    let html = std::fs::read_to_string(html).unwrap();
    assert!(html.contains("HOTA and its parts") && !html.contains("http://") && !html.contains("https://"));
}

#[test]
fn an_unmet_demand_gives_exit_code_one_and_an_unknown_one_names_the_known() {
    let dir = tempfile::tempdir().unwrap();
    let truth = put(dir.path(), "gt.txt", &tracks(3, 1, 0.0, true));
    let result = put(dir.path(), "result.txt", &tracks(2, 1, 1.0, false));
    let out = boresight(&["evaluate", &truth, &result, "--require", "MOTA=0.9"]);
    assert_eq!(out.status.code(), Some(1));
    assert!(text(&out.stderr).contains("not met: MOTA = 0.666667, demanded at least 0.9"), "{}", text(&out.stderr));
    let out = boresight(&["evaluate", &truth, &result, "--require", "MOTTA=0.9"]);
    assert_eq!(out.status.code(), Some(2));
    assert!(text(&out.stderr).contains("one of HOTA, DetA"), "{}", text(&out.stderr));
}

#[test]
fn a_measure_that_is_best_in_between_is_held_to_a_range() {
    let dir = tempfile::tempdir().unwrap();
    let truth = put(dir.path(), "gt.txt", &tracks(2, 1, 0.0, true));
    let result = put(dir.path(), "result.txt", &tracks(2, 1, 1.0, false));
    let require = |demand: &str| {
        let out = boresight(&["evaluate", &truth, &result, "--require", demand]);
        (out.status.code(), text(&out.stderr))
    };
    // One pixel to the right.
    assert_eq!(require("bias_x=0.5..1.5").0, Some(0));
    assert_eq!(require("MOTA=0.9..1").0, Some(0));
    let (code, said) = require("bias_x=-0.5..0.5");
    assert!(code == Some(1) && said.contains("not met: bias_x = 1.000000, demanded -0.5 to 0.5"), "{said}");
    let (code, said) = require("bias_x=0.5");
    assert!(code == Some(2) && said.contains("expected a range") && said.contains("bias_x=0..1"), "{said}");
}

#[test]
fn tables_that_do_not_belong_together_are_told_with_the_cause() {
    let dir = tempfile::tempdir().unwrap();
    let truth = put(dir.path(), "gt.txt", &tracks(3, 1, 0.0, true));
    let case = |name: &str, content: &str, expected: &str, more: &[&str]| {
        let result = put(dir.path(), name, content);
        let out = boresight(&[&["evaluate", &truth, &result, "--mot-only"], more].concat());
        assert!(text(&out.stderr).contains(expected), "{name}: {} {}", text(&out.stderr), text(&out.stdout));
        out.status.code()
    };
    assert_eq!(case("later.txt", &tracks(3, 100, 0.0, false), "no frame in common", &[]), Some(3));
    assert_eq!(case("twice.txt", "1,1,1,1,5,5,1\n1,1,8,8,5,5,1\n", "id 1 stands twice in frame 0", &[]), Some(3));
    assert_eq!(case("zero.txt", &tracks(3, 0, 0.0, false), "--result-from-zero", &[]), Some(3));
    assert_eq!(case("shifted.txt", &tracks(3, 2, 0.0, false), "one frame later", &[]), Some(0));
    assert_eq!(case("large.txt", &tracks(3, 1, 4000.0, false), "are they of", &[]), Some(0));
    assert_eq!(case("empty.txt", "", "has no rows", &[]), Some(0));
    let bad = "1,1,1,1,5,5,1\n2,x,1,1,5,5,1\n";
    assert_eq!(case("bad.txt", bad, "bad.txt line 2: column 2: expected a track id, found", &[]), Some(3));
    assert_eq!(case("bad.txt", bad, "1 malformed rows left out", &["--skip-bad-rows"]), Some(0));
    assert_eq!(case("html.txt", "<html></html>", "no table of tracks known here", &[]), Some(3));
}

#[test]
fn frames_from_zero_on_request_score_the_same() {
    let dir = tempfile::tempdir().unwrap();
    let truth = put(dir.path(), "gt.txt", &tracks(3, 1, 0.0, true));
    let result = put(dir.path(), "zero.txt", &tracks(3, 0, 0.0, false));
    let out = boresight(&["evaluate", &truth, &result, "--result-from-zero", "--require", "MOTA=1", "--mot-only"]);
    assert!(out.status.success(), "{}", text(&out.stderr));
}

#[test]
fn a_truth_that_counts_from_one_is_told_and_read_when_it_is_said() {
    let dir = tempfile::tempdir().unwrap();
    let named = |from: usize| {
        let row = |f: usize| format!("{},1,{},20,12,12\n", f + from, 10.0 + 3.0 * f as f64);
        "frame,track_id,left,top,width,height\n".to_string() + &(0..40).map(row).collect::<String>()
    };
    let (one, zero) = (put(dir.path(), "one.csv", &named(1)), put(dir.path(), "zero.csv", &named(0)));
    for (truth, result, option) in [(&one, &zero, "--truth-from-one"), (&zero, &one, "--result-from-one")] {
        let off = boresight(&["evaluate", truth, result, "--mot-only"]);
        assert!(text(&off.stderr).contains(&format!("try {option}")), "{}", text(&off.stderr));
        let out = boresight(&["evaluate", truth, result, "--mot-only", option, "--require", "HOTA=1"]);
        assert!(out.status.success() && text(&out.stderr).is_empty(), "{option}: {}", text(&out.stderr));
    }
    // The mistake the other way round: MOTChallenge's count from 1, these from 0, without a row that shows it.
    let later = |from| tracks(1, from, 0.0, true).lines().skip(1).map(|l| format!("{l}\n")).collect::<String>();
    let truth = put(dir.path(), "gt.txt", &later(1));
    let result = put(dir.path(), "zero.txt", &later(0));
    let off = boresight(&["evaluate", &truth, &result, "--mot-only", "--rules", "none"]);
    assert!(text(&off.stderr).contains("try --result-from-zero"), "{}", text(&off.stderr));
    let said = boresight(&["evaluate", &result, &truth, "--mot-only", "--rules", "none"]);
    assert!(text(&said.stderr).contains("try --truth-from-zero"), "{}", text(&said.stderr));
}

#[test]
fn tables_in_metres_are_judged_in_metres() {
    let dir = tempfile::tempdir().unwrap();
    let table = |unit: &str, dx: f64| {
        let row = |f: usize| format!("{f},1,{},20\n", 3.0 * f as f64 + dx);
        format!("frame,track_id,x{unit},y{unit}\n") + &(0..40).map(row).collect::<String>()
    };
    let at = |name: &str| dir.path().join(name).display().to_string();
    for (unit, sign, other) in [("_m", "m", "px"), ("_px", "px", "m"), ("", "px", "m")] {
        let truth = put(dir.path(), "truth.csv", &table(unit, 0.0));
        let result = put(dir.path(), "result.csv", &table(unit, 1.5));
        let (json, html) = (at("e.json"), at("e.html"));
        let out = boresight(&["evaluate", &truth, &result, "--json", &json, "--html", &html]);
        assert!(out.status.success(), "{}", text(&out.stderr));
        let json: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(json).unwrap()).unwrap();
        let (units, detail) = (&json["results"][0]["units"], &json["results"][0]["sequences"][0]["detail"]);
        assert_eq!(units["RMSE"], sign, "{units}");
        assert_eq!(units["GOSPA_location"], format!("{sign}^p"));
        assert_eq!(detail["particle"][format!("rmse_{sign}")], 1.5, "{}", detail["particle"]);
        assert!(detail["particle"].get(format!("rmse_{other}")).is_none());
        let page = std::fs::read_to_string(html).unwrap();
        assert!(page.contains(&format!("root mean square, {sign}<")), "{sign}");
        assert!(page.contains(&format!("cost, {sign}^p")) && page.contains(&format!("<small>{sign}</small>")));
        assert!(!page.contains(&format!("<small>{other}</small>")), "{other}");
        assert_eq!(text(&out.stdout).contains("Distances are in m"), sign == "m");
    }
}

#[test]
fn folders_of_sequences_are_found_combined_and_compared() {
    let dir = tempfile::tempdir().unwrap();
    for seq in ["a", "b"] {
        put(dir.path(), &format!("truth/{seq}/gt/gt.txt"), &tracks(3, 1, 0.0, true));
        put(dir.path(), &format!("truth/{seq}/seqinfo.ini"), "frameRate=30\nseqLength=30\nimWidth=640\nimHeight=480\n");
        put(dir.path(), &format!("mine/{seq}.txt"), &tracks(3, 1, 0.0, false));
    }
    put(dir.path(), "theirs/a.txt", &tracks(2, 1, 2.0, false));
    let at = |name: &str| dir.path().join(name).display().to_string();
    let out = boresight(&["evaluate", &at("truth"), &at("mine"), "--compare", &at("theirs")]);
    let (shown, said) = (text(&out.stdout), text(&out.stderr));
    assert!(out.status.success(), "{said}");
    assert!(shown.contains("COMBINED") && shown.contains("FP/hour") && shown.contains("95 % interval"), "{shown}");
    assert!(said.contains("b: the result has no table for this sequence"), "{said}");
    let pattern = at("truth/{seq}/gt/gt.txt");
    let again = boresight(&["evaluate", &pattern, &at("mine/{seq}.txt"), "--mot-only"]);
    assert!(text(&again.stdout).contains("COMBINED"), "{}", text(&again.stderr));
}

/// Data set II by its band of intensities, a frame a second.
const CONFIG: &str = "[input]\nrate-hz = 1.0\n[detector.threshold.band]\nlow = 90.0\nhigh = 110.0\n\
[detector.cluster]\ndistance-px = 2.0\nmin-area-px = 20\n[tracker]\nacceleration-std-px-per-s2 = 0.01\n\
extra-noise-px = 0.5\nmax-speed-px-per-s = 5.0\n";

#[test]
fn simulated_runs_have_state_errors_their_bound_and_consistency_over_runs() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name).display().to_string();
    let config = put(dir.path(), "band.toml", CONFIG);
    let mut seen = Vec::new();
    for run in ["0", "1", "2"] {
        let sim = at(&format!("sim{run}"));
        let made = boresight(&["simulate", "ds2", "--run", run, "--frames", "40", "-o", &sim]);
        assert!(made.status.success(), "{}", text(&made.stderr));
        let tracked = boresight(&[
            "track",
            &format!("{sim}/frames"),
            "--config",
            &config,
            "--no-video",
            "-o",
            &format!("{sim}/out"),
        ]);
        assert!(tracked.status.success(), "{}", text(&tracked.stderr));
        // "mean NIS 0.40 over 38 updates": what the tracker itself saw in its innovations.
        let said = text(&tracked.stderr);
        let words = said.split_once("mean NIS ").unwrap().1.split(' ').collect::<Vec<_>>();
        seen.push((words[0].parse::<f64>().unwrap(), words[2].parse::<f64>().unwrap()));
    }
    let csv = at("s.csv");
    let out = boresight(&[
        "evaluate",
        &at("sim{seq}/truth.csv"),
        &at("sim{seq}/out/tracks.csv"),
        "--detections",
        &at("sim{seq}/out/detections.csv"),
        "--bound",
        "0.5,1e-5",
        "--extra-noise",
        "0.5",
        "--rate",
        "1",
        "--csv",
        &csv,
    ]);
    let (shown, said) = (text(&out.stdout), text(&out.stderr));
    assert!(out.status.success(), "{said}");
    assert!(shown.contains("position NEES over 3 runs") && shown.contains("state NEES"), "{shown}\n{said}");
    let csv = std::fs::read_to_string(csv).unwrap();
    // The NIS found again from states and detections is that of the tracker's innovations, to the digits it shows.
    for (run, (nis, n)) in ["0", "1", "2"].iter().zip(seen) {
        assert!((csv_value(&csv, run, "ANIS") - nis).abs() < 0.00501, "{run}: {nis} over {n}");
        assert!(shown.contains(&format!("over {n} values")), "{n}: {shown}");
    }
    // The bound of 0.5 px² of a target that moves straight: 0.696 √r over 50 scans, more over fewer
    // (docs/theory/measures.md).
    let bound = csv_value(&csv, "0", "bound");
    assert!((0.4..1.0).contains(&bound), "{bound}");
    for name in ["PFE_x", "RMSPE", "RMSVE", "ANEES", "ANEES4", "NCI"] {
        assert!(csv_value(&csv, "0", name) > 0.0, "{name}");
    }
}

fn pgm(folder: &Path, name: &str, pixels: &[u8]) -> String {
    let path: PathBuf = folder.join(name);
    let mut bytes = b"P5\n3 3\n255\n".to_vec();
    bytes.extend_from_slice(pixels);
    std::fs::write(&path, bytes).unwrap();
    path.display().to_string()
}

#[test]
fn two_images_are_compared_by_the_numbers_of_the_worked_example() {
    let dir = tempfile::tempdir().unwrap();
    // The worked example of docs/theory/measures.md.
    let a = pgm(dir.path(), "a.pgm", &[10, 20, 30, 40, 50, 60, 70, 80, 90]);
    let b = pgm(dir.path(), "b.pgm", &[11, 18, 30, 43, 50, 55, 70, 84, 90]);
    let out = boresight(&["evaluate", &a, &b, "--require", "PSNR=40.26", "--require", "MSE=6.2"]);
    assert!(out.status.success(), "{}", text(&out.stderr));
    assert!(text(&out.stdout).contains("6.1111  2.4721  1.6667  4.3930  27.1448  40.2696"), "{}", text(&out.stdout));
    std::fs::write(dir.path().join("c.pgm"), b"P5\n2 2\n255\n\x01\x02\x03\x04").unwrap();
    let c = dir.path().join("c.pgm").display().to_string();
    let out = boresight(&["evaluate", &a, &c]);
    assert_eq!(out.status.code(), Some(2));
    assert!(text(&out.stderr).contains("3 x 3") && text(&out.stderr).contains("2 x 2"), "{}", text(&out.stderr));
}

#[test]
fn a_truth_whose_classes_are_words_is_read() {
    let dir = tempfile::tempdir().unwrap();
    let rows = |class: &str| -> String { (0..20).map(|k| format!("{k},1,{},20,10,8{class}\n", 10 + k)).collect() };
    let (truth, result) = (dir.path().join("gt.csv"), dir.path().join("tracks.csv"));
    std::fs::write(&truth, format!("frame,id,bb_left,bb_top,bb_width,bb_height,class\n{}", rows(",DRONE"))).unwrap();
    std::fs::write(&result, format!("frame,track_id,left,top,width,height\n{}", rows(""))).unwrap();
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_boresight"));
    let run = command.arg("evaluate").args([&truth, &result]).args(["--require", "MOTA=0.99"]).output().unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
}
