//! Every filter by name through the command: listed, explained, run over the sample clip; smoothing; errors in words.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn boresight(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_boresight")).args(args).output().expect("the command runs")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Names and texts of `boresight config --list WHAT`.
fn listed(what: &str) -> Vec<(String, String)> {
    let out = boresight(&["config", "--list", what]);
    assert!(out.status.success(), "{}", text(&out.stderr));
    let list = text(&out.stdout);
    let entries = list.lines().skip(2).filter_map(|l| l.trim().split_once("  "));
    entries.map(|(name, meaning)| (name.to_string(), meaning.trim().to_string())).collect()
}

fn sample(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../samples/ir_drone").join(name)
}

/// Centre of the target in each frame, from the clip's own truth (frames and pixels there count from 1).
fn truth() -> BTreeMap<u64, [f64; 2]> {
    let table = std::fs::read_to_string(sample("IR_DRONE_046.gt.csv")).unwrap();
    let rows = table.lines().skip(1).map(|l| {
        let v: Vec<f64> = l.split(',').take(6).map(|c| c.parse().unwrap()).collect();
        (v[0] as u64 - 1, [v[2] + v[4] / 2.0 - 1.5, v[3] + v[5] / 2.0 - 1.5])
    });
    rows.collect()
}

/// Frames after the first second in which some confirmed track lies within 8 px of the target, and frames looked at.
fn covered(tracks: &str, truth: &BTreeMap<u64, [f64; 2]>) -> (usize, usize) {
    let mut near: BTreeMap<u64, bool> = truth.keys().filter(|k| **k >= 30).map(|k| (*k, false)).collect();
    for row in tracks.lines().skip(1) {
        let cells: Vec<&str> = row.split(',').collect();
        let numbers: Vec<f64> = cells[4..20].iter().map(|c| c.parse().unwrap()).collect();
        assert!(numbers.iter().all(|v| v.is_finite()), "{row}");
        assert!(numbers[4] > 0.0 && numbers[11] > 0.0, "a variance of 0 or less: {row}");
        let frame: u64 = cells[0].parse().unwrap();
        if let (Some(hit), Some(t)) = (near.get_mut(&frame), truth.get(&frame)) {
            *hit |= cells[3] != "tentative" && (numbers[0] - t[0]).hypot(numbers[1] - t[1]) < 8.0;
        }
    }
    (near.values().filter(|v| **v).count(), near.len())
}

/// The clip's detections, made once: decoding it for each filter would take most of the time.
fn detections(dir: &Path) -> String {
    let out = dir.join("clip");
    let clip = sample("IR_DRONE_046.mp4");
    let args = ["track", clip.to_str().unwrap(), "-o", out.to_str().unwrap(), "--no-video", "--no-report", "-q"];
    let done = boresight(&args);
    assert!(done.status.success(), "{}", text(&done.stderr));
    out.join("detections.csv").to_str().unwrap().to_string()
}

fn tracks(input: &str, dir: &Path, more: &[&str]) -> String {
    let mut args = vec!["track", input, "-o", dir.to_str().unwrap(), "--no-video", "--no-report", "-q"];
    args.extend(more);
    let out = boresight(&args);
    assert!(out.status.success(), "{more:?}: {}", text(&out.stderr));
    std::fs::read_to_string(dir.join("tracks.csv")).unwrap()
}

#[test]
fn every_filter_model_and_innovation_is_explained() {
    for (what, least) in [("filters", 17), ("forms", 11), ("models", 7), ("innovations", 4)] {
        let all = listed(what);
        assert!(all.len() >= least, "{what}: {all:?}");
        for (name, meaning) in all {
            assert!(meaning.len() > 40 && meaning.ends_with('.'), "{what} {name}: {meaning:?}");
        }
    }
    let wrong = boresight(&["config", "--list", "filtres"]);
    assert!(!wrong.status.success() && text(&wrong.stderr).contains("lists: filters, forms, models, innovations"));
}

#[test]
fn every_filter_by_name_follows_the_target_of_the_sample_clip() {
    let dir = tempfile::tempdir().unwrap();
    let (input, truth) = (detections(dir.path()), truth());
    let mut results: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for (name, _) in listed("filters") {
        let table = tracks(&input, &dir.path().join(&name), &["--filter", &name]);
        let (near, of) = covered(&table, &truth);
        assert!(10 * near > 7 * of, "{name}: near the target in {near} of {of} frames");
        results.entry(table).or_default().push(name);
    }
    // Forms of one estimator may agree to the last bit; what is another estimator must show another result.
    let same = results.values().find(|names| names.len() > 1);
    assert!(results.len() >= 12, "the same tracks by {same:?}");
}

#[test]
fn every_model_innovation_and_option_of_a_filter_follows_the_target() {
    let dir = tempfile::tempdir().unwrap();
    let (input, truth) = (detections(dir.path()), truth());
    let mut options: Vec<String> = Vec::new();
    for (form, model) in
        ["kf", "ud", "srif", "information", "square-root", "ukf", "kf-short"].iter().zip(listed("models"))
    {
        options.push(format!("tracker.filter={{form = \"{form}\", model.{} = {{}}}}", model.0));
    }
    for (name, _) in listed("innovations") {
        options.push(format!("tracker.filter={{form = \"ud\", innovation.{name} = {{}}}}"));
    }
    options.push("tracker.filter={form = \"srif\", adaptive = {}}".into());
    options.push("tracker.filter.adaptive={process-noise = true, measurement-noise = false, windowed = true}".into());
    options.push("tracker.filter.model.constant-velocity.hold-s=0.04".into());
    options.push("tracker.filter.form.imm.form=\"ud\"".into());
    options.push("tracker.filter.form.lms={window = 4, rule = {as-printed = {step-factor = 0}}}".into());
    options.push("tracker.filter={form = \"srif\", innovation.fuzzy.difference-scale = 24}".into());
    for option in &options {
        let table = tracks(&input, &dir.path().join("run"), &["--set", option]);
        let (near, of) = covered(&table, &truth);
        assert!(10 * near > 7 * of, "{option}: near the target in {near} of {of} frames");
    }
}

#[test]
fn a_filter_that_diverges_costs_its_track_not_the_run() {
    let dir = tempfile::tempdir().unwrap();
    let input = detections(dir.path());
    tracks(&input, dir.path(), &["--set", "tracker.filter.form.lms.rule.as-printed.step-factor=1"]);
}

/// Frames, distance of each row from the target, and deviation of each row, of the longest track.
fn longest(table: &str, truth: &BTreeMap<u64, [f64; 2]>) -> Vec<(u64, f64, f64)> {
    let mut tracks: BTreeMap<u64, Vec<(u64, f64, f64)>> = BTreeMap::new();
    for row in table.lines().skip(1) {
        let c: Vec<&str> = row.split(',').collect();
        let number = |at: usize| c[at].parse::<f64>().unwrap();
        let frame: u64 = c[0].parse().unwrap();
        let off = truth.get(&frame).map_or(f64::NAN, |t| (number(4) - t[0]).hypot(number(5) - t[1]));
        tracks.entry(c[2].parse().unwrap()).or_default().push((frame, off, number(8).sqrt()));
    }
    tracks.into_values().max_by_key(Vec::len).unwrap()
}

#[test]
fn smoothing_sharpens_tracks_fills_gaps_and_takes_tables_from_elsewhere() {
    let dir = tempfile::tempdir().unwrap();
    let truth = truth();
    let input = detections(dir.path());
    let run = Path::new(&input).parent().unwrap();
    let filtered = std::fs::read_to_string(run.join("tracks.csv")).unwrap();
    let smooth = |input: &Path, more: &[&str]| {
        let out = dir.path().join("smoothed.csv");
        let mut args = vec!["smooth", input.to_str().unwrap(), "-o", out.to_str().unwrap()];
        args.extend(more);
        let done = boresight(&args);
        assert!(done.status.success(), "{more:?}: {}", text(&done.stderr));
        (std::fs::read_to_string(&out).unwrap(), text(&done.stderr))
    };
    let (table, said) = smooth(&run.join("tracks.csv"), &[]);
    assert!(said.contains("config.toml") && said.contains("median deviation"), "{said}");
    assert_eq!(table.lines().count(), filtered.lines().count());
    let (before, after) = (longest(&filtered, &truth), longest(&table, &truth));
    assert_eq!(before.iter().map(|r| r.0).collect::<Vec<_>>(), after.iter().map(|r| r.0).collect::<Vec<_>>());
    // The newest row has nothing to gain; every other knows more than before.
    assert!(before.iter().zip(&after).all(|(b, a)| a.2 <= b.2 * (1.0 + 1e-9)));
    let deviation = |rows: &[(u64, f64, f64)]| rows.iter().map(|r| r.2).sum::<f64>() / rows.len() as f64;
    assert!(deviation(&after) < 0.9 * deviation(&before), "{} {}", deviation(&before), deviation(&after));
    let (roots, _) = smooth(&run.join("tracks.csv"), &["--method", "square-root"]);
    for (a, b) in longest(&table, &truth).iter().zip(longest(&roots, &truth)) {
        assert!((a.1 - b.1).abs() < 1e-6 || a.1.is_nan(), "frame {}: {} {}", a.0, a.1, b.1);
    }
    let (lagged, _) = smooth(&run.join("tracks.csv"), &["--lag", "5"]);
    let lagged = deviation(&longest(&lagged, &truth));
    assert!(deviation(&after) < lagged && lagged < deviation(&before));
    // Fragments are joined by the motion of the same configuration.
    let stitched = dir.path().join("stitched.csv");
    let stitch = |more: &[&str]| {
        let table = run.join("tracks.csv");
        let args = [&["stitch", table.to_str().unwrap(), "-o", stitched.to_str().unwrap()], more].concat();
        text(&boresight(&args).stderr)
    };
    assert!(stitch(&[]).contains("config.toml"), "{}", stitch(&[]));
    assert!(!stitch(&["--acceleration-density", "50"]).contains("config.toml"));
    // Every fifth row is taken out of a MOTChallenge table; --fill puts one in for each.
    let mot = std::fs::read_to_string(run.join("mot.txt")).unwrap();
    let holed = dir.path().join("holed.txt");
    let keep = |l: &&str| l.split(',').next().and_then(|f| f.parse::<u64>().ok()).is_some_and(|f| f % 5 != 0);
    std::fs::write(&holed, mot.lines().filter(keep).collect::<Vec<_>>().join("\n")).unwrap();
    let (table, said) = smooth(&holed, &["--fill", "--rate-hz", "30", "--acceleration", "28"]);
    assert!(said.contains("filtered first"), "{said}");
    let frames: Vec<u64> = longest(&table, &truth).iter().map(|r| r.0).collect();
    assert!(frames.windows(2).all(|w| w[1] == w[0] + 1), "{frames:?}");
    let missing = boresight(&["smooth", "no-such.csv"]);
    assert!(!missing.status.success() && text(&missing.stderr).contains("no-such.csv"));
}

#[test]
fn a_wrong_name_or_value_says_what_there_is() {
    let dir = tempfile::tempdir().unwrap();
    let table = dir.path().join("d.csv");
    std::fs::write(&table, "frame,x,y\n0,1,1\n1,2,2\n").unwrap();
    let run = |more: [&str; 2]| {
        let out = boresight(&["track", table.to_str().unwrap(), "-o", dir.path().to_str().unwrap(), more[0], more[1]]);
        assert!(!out.status.success(), "{more:?} was taken");
        text(&out.stderr)
    };
    let e = run(["--filter", "kalman"]);
    assert!(e.contains("there is no choice `kalman` here") && e.contains("square-root"), "{e}");
    for (option, key) in [
        ("tracker.filter.form.lms.window=9", "tracker.filter.form.lms.window = 9: expected 2..=5"),
        ("tracker.filter.model.singer.manoeuvre-s=0", "tracker.filter.model.singer.manoeuvre-s = 0"),
        ("tracker.filter.innovation.huber.threshold=-1", "tracker.filter.innovation.huber.threshold = -1"),
        ("tracker.filter.adaptive.memory-updates=1", "tracker.filter.adaptive.memory-updates = 1"),
        (
            "tracker.filter.innovation.fuzzy.output-scale=0",
            "innovation.fuzzy.output-scale = 0: expected a number above 0",
        ),
    ] {
        let e = run(["--set", option]);
        assert!(e.contains(key), "{option}: {e}");
    }
}
