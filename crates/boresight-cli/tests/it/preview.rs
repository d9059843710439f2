//! `boresight preview`: one page, its commands, the same bytes for any number of threads; and where a run points to it.

use crate::{clip, run, run_ok, stderr};
use std::path::Path;

fn text(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap()
}

#[test]
fn the_page_shows_every_candidate_with_the_command_that_runs_it() {
    let dir = tempfile::tempdir().unwrap();
    let named = dir.path().join("it's one.mp4");
    std::fs::copy(clip(), &named).unwrap();
    let (a, b) = (dir.path().join("a.html"), dir.path().join("b.html"));
    let said = run_ok(["preview", named.to_str().unwrap(), "-o", a.to_str().unwrap()]);
    run_ok(["preview", named.to_str().unwrap(), "-q", "--threads", "1", "-o", b.to_str().unwrap()]);
    let page = text(&a);
    assert!(page == text(&b), "the page depends on the threads");
    for word in ["isolated", "cfar", "integrate", "bernoulli", "moving", "steadied", "spot", "local", "colour"] {
        // The choice itself stands for its detector.
        let chosen = page.contains(&format!("chosen: {word}"));
        assert!(chosen || page.contains(&format!("one.mp4' --detector {word}</code>")), "{word}");
    }
    assert!(
        page.contains(">1 the choice without options<")
            && page.contains(">9 colour<")
            && page.contains(">10 bernoulli<"),
        "their numbers"
    );
    assert!(page.contains("it'\\''s one.mp4'</code>"), "the command without options");
    assert_eq!(page.matches("data:image/png;base64,").count(), 12);
    let shown = page.matches("<div class=\"sheet\">").count();
    assert!(shown >= 4 && page.matches("<figure").count() == 12 * shown, "{shown}");
    assert!(stderr(&said).contains("detections a frame"), "{}", stderr(&said));
}

#[test]
fn a_candidate_asked_for_by_its_number_is_the_one_of_that_row() {
    let dir = tempfile::tempdir().unwrap();
    let run_with = |options: &[&str], name: &str| {
        let out = dir.path().join(name);
        let own = clip();
        let always = ["track", own.to_str().unwrap(), "-q", "--no-video", "--no-report", "-o", out.to_str().unwrap()];
        run_ok([&always, options].concat());
        (text(&out.join("tracks.csv")), text(&out.join("config.toml")))
    };
    let (first, third) = (run_with(&["--candidate", "1"], "1"), run_with(&["--candidate", "3"], "3"));
    assert!(first == run_with(&[], "none"), "1 is the choice without options");
    assert!(third == run_with(&["--detector", "cfar"], "cfar") && third.1 != first.1, "3 is cfar");
    let given = dir.path().join("1/config.toml");
    for (wrong, why) in [
        (&["--candidate", "11"][..], "3 cfar"),
        (&["--candidate", "2", "--detector", "cfar"], "cannot be used with"),
        (&["--candidate", "1", "--config", given.to_str().unwrap()], "--candidate 1"),
    ] {
        let said = run([&["track", clip().to_str().unwrap()], wrong].concat());
        assert!(!said.status.success() && stderr(&said).contains(why), "{wrong:?}: {}", stderr(&said));
    }
}

#[test]
fn a_stream_and_the_input_itself_as_output_are_refused() {
    let stream = run(["preview", "rtsp://127.0.0.1:1/none"]);
    assert!(!stream.status.success() && stderr(&stream).contains("hint: give a file"), "{}", stderr(&stream));
    let dir = tempfile::tempdir().unwrap();
    let own = dir.path().join("own.mp4");
    std::fs::copy(clip(), &own).unwrap();
    let same = run(["preview", own.to_str().unwrap(), "-o", own.to_str().unwrap()]);
    assert!(!same.status.success() && stderr(&same).contains("the input itself"), "{}", stderr(&same));
}

#[test]
fn a_run_that_detects_nothing_points_to_the_preview() {
    let dir = tempfile::tempdir().unwrap();
    let frames = dir.path().join("even");
    std::fs::create_dir(&frames).unwrap();
    for k in 0..30 {
        let mut picture = b"P5\n64 48\n255\n".to_vec();
        picture.resize(picture.len() + 64 * 48, 100);
        std::fs::write(frames.join(format!("{k:03}.pgm")), picture).unwrap();
    }
    let (frames, out) = (frames.to_str().unwrap(), dir.path().join("out"));
    let said = run_ok(["track", frames, "-o", out.to_str().unwrap(), "--no-video"]);
    assert!(stderr(&said).contains(&format!("or look:  boresight preview {frames}")), "{}", stderr(&said));
    assert!(text(&out.join("report.html")).contains("See what each detector finds"));
    run_ok(["preview", frames, "-q", "-o", dir.path().join("p.html").to_str().unwrap()]);
}
