//! `boresight track` on the real infrared clip.

use super::{boresight, clip, number, read_csv, root, run, run_ok, stderr, tracked};
use std::collections::HashMap;
use std::path::Path;

/// The tables, which may depend on nothing but the input and the configuration.
const TABLES: [&str; 3] = ["tracks.csv", "detections.csv", "mot.txt"];

fn same_tables(a: &Path, b: &Path) {
    for name in TABLES {
        let same = std::fs::read(a.join(name)).unwrap() == std::fs::read(b.join(name)).unwrap();
        assert!(same, "{name} differs between {} and {}", a.display(), b.display());
    }
}

#[test]
fn the_tables_have_the_documented_columns_and_parse() {
    let tracks = std::fs::read_to_string(tracked().join("tracks.csv")).unwrap();
    assert!(
        tracks.starts_with("frame,time_s,track_id,status,x_px,y_px,vx_px_per_s,vy_px_per_s,var_x_px2,"),
        "{}",
        tracks.lines().next().unwrap()
    );
    assert!(tracks.lines().next().unwrap().ends_with(",width_px,height_px,detection"));
    let detections = read_csv(&tracked().join("detections.csv"));
    let mut per_frame: HashMap<String, usize> = HashMap::new();
    for d in &detections {
        *per_frame.entry(d["frame"].clone()).or_default() += 1;
        assert!(number(d, "var_x_px2") > 0.0 && number(d, "var_y_px2") > 0.0 && number(d, "area_px") >= 1.0);
        assert!(number(d, "left_px") >= -0.5 && number(d, "left_px") + number(d, "width_px") <= 319.5);
    }
    for t in read_csv(&tracked().join("tracks.csv")) {
        assert!(["tentative", "confirmed", "coasting"].contains(&t["status"].as_str()));
        let (vx, cov, vy) = (number(&t, "var_x_px2"), number(&t, "cov_x_y_px2"), number(&t, "var_y_px2"));
        assert!(vx > 0.0 && vy > 0.0 && vx * vy > cov * cov, "a covariance is positive definite: {t:?}");
        let time = number(&t, "frame") / 30.0;
        assert!((number(&t, "time_s") - time).abs() < 1e-6, "the clip's own times: {t:?}");
        // The detection is the row's number in that frame; a coasting track has none.
        match t["detection"].parse::<usize>() {
            Ok(row) => assert!(row < per_frame[&t["frame"]]),
            Err(_) => assert!(t["detection"].is_empty() && t["status"] != "confirmed"),
        }
    }
    for line in std::fs::read_to_string(tracked().join("mot.txt")).unwrap().lines() {
        let cells: Vec<f64> = line.split(',').map(|c| c.parse().unwrap()).collect();
        assert!(cells.len() == 10 && cells[0] >= 1.0 && cells[1] >= 1.0, "{line}");
    }
    let lines = std::fs::read_to_string(tracked().join("tracks.jsonl")).unwrap();
    assert_eq!(lines.lines().count(), 302);
    assert!(lines.lines().all(|l| l.starts_with('{') && l.ends_with('}')));
}

/// Truth boxes (left, top, width, height) in pixels from 0; the file counts frames and pixels from 1.
fn truth() -> HashMap<u64, [f64; 4]> {
    read_csv(&root().join("samples/ir_drone/IR_DRONE_046.gt.csv"))
        .iter()
        .map(|r| {
            let n = |c| number(r, c);
            (n("frame") as u64 - 1, [n("bb_left") - 1.0, n("bb_top") - 1.0, n("bb_width"), n("bb_height")])
        })
        .collect()
}

#[test]
fn the_drone_is_held_and_nothing_else_is_reported() {
    let truth = truth();
    let (mut held, mut errors2, mut far) = (0, Vec::new(), 0);
    for t in read_csv(&tracked().join("tracks.csv")).iter().filter(|t| t["status"] != "tentative") {
        let b = truth[&(number(t, "frame") as u64)];
        let (dx, dy) = (number(t, "x_px") - b[0] - b[2] / 2.0, number(t, "y_px") - b[1] - b[3] / 2.0);
        // Held: inside the truth box grown by 3 px.
        if dx.abs() <= b[2] / 2.0 + 3.0 && dy.abs() <= b[3] / 2.0 + 3.0 {
            held += 1;
            errors2.push(dx * dx + dy * dy);
        } else {
            far += 1;
        }
    }
    let rmse = (errors2.iter().sum::<f64>() / errors2.len() as f64).sqrt();
    // Measured: 297 of 302 frames, 1.8 px. Hand-drawn boxes are loose by 1 to 3 px a side and lie about (0.5, 1.1) px off
    // the intensity's centre (the data's SOURCE.md), so 2.5 px is what truth and detector together allow.
    println!("held in {held} of {} frames, {far} rows elsewhere, RMSE {rmse:.2} px", truth.len());
    assert!(held >= 290 && far <= 8 && rmse < 2.5, "held {held}, elsewhere {far}, RMSE {rmse:.2} px");
}

#[test]
fn pictures_and_report_are_whole_files() {
    let video = std::fs::read(tracked().join("annotated.mp4")).unwrap();
    assert_eq!(&video[4..8], b"ftyp");
    assert!(video.windows(4).any(|w| w == b"moov") && video.windows(4).any(|w| w == b"avc1"));
    let report = std::fs::read_to_string(tracked().join("report.html")).unwrap();
    assert!(report.starts_with("<!DOCTYPE html>") && report.trim_end().ends_with("</html>"));
    for part in ["Summary", "Settings and why", "Trajectories", "Tracks", "302"] {
        assert!(report.contains(part), "{part}");
    }
    assert!(!report.contains("src=\"http") && !report.contains("href=\"http"), "the report opens offline");
    let left: Vec<_> = std::fs::read_dir(tracked())
        .unwrap()
        .map(|e| e.unwrap().file_name().to_string_lossy().into_owned())
        .filter(|n| n.ends_with(".part"))
        .collect();
    assert!(left.is_empty(), "{left:?}");
}

#[test]
fn the_written_configuration_gives_the_identical_result() {
    let again = tempfile::tempdir().unwrap();
    let mut command = boresight();
    command.arg("track").arg(clip()).arg("--config").arg(tracked().join("config.toml")).arg("-o").arg(again.path());
    assert!(command.args(["--no-video", "--no-report", "-q"]).status().unwrap().success());
    same_tables(tracked(), again.path());
    let keys = |p: &Path| -> Vec<String> {
        let text = std::fs::read_to_string(p.join("config.toml")).unwrap();
        text.lines().filter(|l| !l.starts_with('#')).map(str::to_string).collect()
    };
    assert_eq!(keys(tracked()), keys(again.path()));
}

#[test]
fn any_number_of_threads_gives_identical_files() {
    for threads in ["1", "2", "8"] {
        let dir = tempfile::tempdir().unwrap();
        let status = boresight()
            .env("RAYON_NUM_THREADS", threads)
            .arg("track")
            .arg(clip())
            .arg("-o")
            .arg(dir.path())
            .args(["-q", "--json", "--threads", threads])
            .status()
            .unwrap();
        assert!(status.success());
        same_tables(tracked(), dir.path());
        for name in ["annotated.mp4", "config.toml", "report.html", "tracks.jsonl"] {
            let same = std::fs::read(tracked().join(name)).unwrap() == std::fs::read(dir.path().join(name)).unwrap();
            assert!(same, "{name} with {threads} threads");
        }
    }
}

#[test]
fn detections_made_before_give_tracks_again() {
    let dir = tempfile::tempdir().unwrap();
    let mut command = boresight();
    command.arg("track").arg(tracked().join("detections.csv")).arg("-o").arg(dir.path()).args(["--rate-hz", "30"]);
    let out = command.output().unwrap();
    assert!(out.status.success(), "{}", stderr(&out));
    let longest = read_csv(&dir.path().join("tracks.csv"))
        .iter()
        .filter(|t| t["status"] != "tentative")
        .fold(HashMap::<String, usize>::new(), |mut n, t| {
            *n.entry(t["track_id"].clone()).or_default() += 1;
            n
        })
        .into_values()
        .max();
    assert!(longest >= Some(280), "{longest:?}");
    assert!(!dir.path().join("annotated.mp4").exists(), "there are no pictures to draw on");
    assert!(dir.path().join("report.html").exists());
}

#[test]
fn one_parameter_can_be_changed_and_is_written_down() {
    let dir = tempfile::tempdir().unwrap();
    let mut command = boresight();
    command.arg("track").arg(clip()).arg("-o").arg(dir.path()).args(["--no-video", "--no-report", "-q"]);
    assert!(command.args(["--set", "tracker.coast-s=0.25", "--filter", "ud"]).status().unwrap().success());
    let config = std::fs::read_to_string(dir.path().join("config.toml")).unwrap();
    assert!(config.contains("coast-s = 0.25") && config.contains("[tracker.filter]\nform = \"ud\""), "{config}");
}

#[test]
fn frames_in_a_folder_are_named_by_the_folder() {
    let dir = tempfile::tempdir().unwrap();
    run_ok(["simulate", "ds2", "--frames", "12", "-o", dir.path().join("sim").to_str().unwrap()]);
    let out =
        boresight().current_dir(dir.path()).args(["track", "sim/frames/", "--rate-hz", "1", "--png"]).output().unwrap();
    assert!(out.status.success(), "{}", stderr(&out));
    let results = dir.path().join("frames.tracks");
    assert!(results.join("tracks.csv").exists());
    assert_eq!(std::fs::read_dir(results.join("frames")).unwrap().count(), 12);
}

#[test]
fn quiet_prints_nothing_and_loud_says_what_was_chosen() {
    let dir = tempfile::tempdir().unwrap();
    let args = |quiet: bool| {
        let mut a = vec!["track".into(), clip().into_os_string(), "-o".into(), dir.path().into()];
        a.extend(["--no-video", "--no-report"].map(Into::into));
        a.extend(quiet.then(|| "-q".into()));
        a
    };
    let out = run(args(true));
    assert!(out.status.success() && out.stdout.is_empty() && out.stderr.is_empty(), "{}", stderr(&out));
    let text = stderr(&run(args(false)));
    for part in
        ["320 x 256", "bright", "302 frames", "confirmed tracks", "frames/s", "results: ", "\nverdict: up to 1 "]
    {
        assert!(text.contains(part), "{part} in {text}");
    }
    assert!(!text.contains('\r') && !text.contains('\u{1b}'), "no progress bar where there is no terminal");
}

#[test]
fn a_run_that_finds_nothing_says_so_and_names_the_next_command() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().join("it's here");
    let out = boresight()
        .args(["track", "--no-video", "--set", "tracker.min-initiation-score=1e9", "-o"])
        .arg(&folder)
        .arg(clip())
        .output()
        .unwrap();
    let said = stderr(&out);
    assert!(out.status.success() && said.contains("\nverdict: doubtful: no track: "), "{said}");
    let next = said.lines().find_map(|l| l.strip_prefix("try next: boresight ")).expect(&said);
    let (_, score) = next.rsplit_once(" --set tracker.min-initiation-score=").expect(next);
    assert!(next.contains("it'\\''s here'") && score.parse::<f64>().is_ok_and(|s| s > 0.0 && s < 100.0), "{next}");
    let report = std::fs::read_to_string(folder.join("report.html")).unwrap();
    assert!(report.contains("Doubtful: ") && report.contains(&format!("min-initiation-score={score}")));
    // What it names is a command that runs.
    let again = boresight()
        .args(["track", "--no-video", "--no-report", "--set", &format!("tracker.min-initiation-score={score}"), "-o"])
        .arg(&folder)
        .arg(clip())
        .output()
        .unwrap();
    assert!(again.status.success(), "{}", stderr(&again));
}

#[test]
fn a_detector_is_asked_for_by_one_word() {
    let dir = tempfile::tempdir().unwrap();
    let track = |more: &[&str]| {
        boresight()
            .args(["track", "--no-video", "--no-report", "-o"])
            .arg(dir.path().join("out"))
            .args(more)
            .output()
            .unwrap()
    };
    let clip = clip().display().to_string();
    let out = track(&[&clip, "--detector", "cfar"]);
    assert!(out.status.success() && stderr(&out).contains("the one asked for: cfar"), "{}", stderr(&out));
    let config = dir.path().join("out/config.toml");
    assert!(std::fs::read_to_string(&config).unwrap().contains("[detector.threshold.cfar]"));
    let refused = |more: &[&str], words: &str| {
        let out = track(more);
        assert!(out.status.code() == Some(2) && stderr(&out).contains(words), "{:?} {}", out.status, stderr(&out));
    };
    refused(&[&clip, "--detector", "movng"], "moving (what moves before a fixed camera)");
    let config = config.display().to_string();
    refused(&[&clip, "--detector", "cfar", "--config", &config], "stands in the configuration");
    refused(&[&clip, "--false-tracks-per-hour", "2", "--config", &config], "nothing is learnt");
    let table = dir.path().join("d.csv");
    std::fs::copy(dir.path().join("out/detections.csv"), &table).unwrap();
    let table = table.display().to_string();
    refused(&[&table, "--detector", "cfar"], "needs no detector");
}

#[test]
fn a_truth_of_the_public_clips_that_counts_from_one_is_told_from_one_that_counts_from_zero() {
    let truth = clip().with_file_name("IR_DRONE_046.gt.csv");
    let judged = |options: &[&str]| {
        let mut args = vec!["evaluate".as_ref(), truth.as_os_str()];
        let table = tracked().join("tracks.csv");
        args.extend([table.as_os_str(), "--match".as_ref(), "centre".as_ref(), "--distance".as_ref(), "10".as_ref()]);
        args.extend(options.iter().map(std::ffi::OsStr::new));
        stderr(&run_ok(args))
    };
    assert!(judged(&[]).contains("try --truth-from-one"), "{}", judged(&[]));
    assert!(!judged(&["--truth-from-one"]).contains("one frame"), "{}", judged(&["--truth-from-one"]));
}

#[test]
fn a_word_sets_the_least_score_the_unit_and_what_the_tables_hold() {
    let dir = tempfile::tempdir().unwrap();
    // A target with a hole of three frames, and weak rows elsewhere.
    let mut table = "frame,x,y,score\n".to_string();
    for k in (0..60).filter(|k| !(30..33).contains(k)) {
        table += &format!("{k},{},20,9\n{k},{},{},2\n", 10 + 2 * k, 50 + (k * 37) % 200, 90 + (k * 91) % 100);
    }
    std::fs::write(dir.path().join("d.csv"), &table).unwrap();
    std::fs::write(dir.path().join("m.csv"), table.replace("x,y", "x_m,y_m")).unwrap();
    let track = |line: &str| {
        let out = boresight().current_dir(dir.path()).args(line.split_whitespace()).output().unwrap();
        assert!(out.status.success(), "{line}: {}", stderr(&out));
        stderr(&out)
    };
    let first =
        |file: &str| std::fs::read_to_string(dir.path().join(file)).unwrap().lines().next().unwrap().to_string();
    let said = track("track d.csv -o out --min-score 5 --json");
    assert!(said.contains("57 of 114 rows have a score below 5"), "{said}");
    assert!(read_csv(&dir.path().join("out/detections.csv")).iter().all(|r| number(r, "score") >= 5.0));
    let rows = read_csv(&dir.path().join("out/tracks.csv"));
    assert!(rows.iter().any(|r| r["detection"].is_empty()), "the hole is predicted over");
    // The configuration holds it: the same again without the word.
    track("track d.csv -o again --config out/config.toml");
    let bytes = |file: &str| std::fs::read(dir.path().join(file)).unwrap();
    assert!(bytes("out/tracks.csv") == bytes("again/tracks.csv"));
    track("track d.csv -o measured --min-score 5 --json --measured");
    let measured = read_csv(&dir.path().join("measured/tracks.csv"));
    assert!(measured.iter().all(|r| !r["detection"].is_empty()));
    assert_eq!(measured.len(), rows.iter().filter(|r| !r["detection"].is_empty()).count());
    assert_eq!(bytes("measured/mot.txt").iter().filter(|b| **b == b'\n').count(), measured.len());
    // Metres: said by the word, or by the names of the columns.
    for line in ["track d.csv --units m -o metres", "track m.csv -o metres"] {
        let said = track(line);
        assert!(!said.contains("px") && said.contains(" m/s"), "{line}: {said}");
        assert!(first("metres/tracks.csv").contains("x_m,") && first("metres/detections.csv").contains("x_m,"));
        assert!(!dir.path().join("metres/mot.txt").exists());
        assert!(std::fs::read_to_string(dir.path().join("metres/report.html")).unwrap().contains("\"unit\":\"m\""));
    }
    track("detect d.csv -o d.csv.m --units m --min-score 5");
    assert!(first("d.csv.m").contains("x_m,"));
    assert!(first("out/tracks.csv").contains("x_px,"));
    let video = clip();
    let score = run_ok([
        "detect".as_ref(),
        video.as_os_str(),
        "--min-score".as_ref(),
        "9".as_ref(),
        "-o".as_ref(),
        "-".as_ref(),
    ]);
    let least = crate::stdout(&score)
        .lines()
        .skip(1)
        .map(|l| l.rsplit(',').next().unwrap().parse::<f64>().unwrap())
        .fold(f64::INFINITY, f64::min);
    assert!((9.0..40.0).contains(&least), "{least}");
    for (options, says) in [
        (["--detector", "cfar"], "which has no least score"),
        (["--units", "m"], "only tables can be in metres"),
        (["--columns", "x=cx"], "frames have neither columns nor rows"),
        (["--skip-bad-rows", "--quiet"], "frames have neither columns nor rows"),
    ] {
        let mut args = vec!["track".as_ref(), video.as_os_str(), "--min-score".as_ref(), "9".as_ref()];
        args.extend(options.map(std::ffi::OsStr::new));
        let out = run(args);
        assert!(out.status.code() == Some(2) && stderr(&out).contains(says), "{}", stderr(&out));
    }
}
