//! Names that are not UTF-8: read, written and shown by every command; refused only where they would go into a text.
#![cfg(target_os = "linux")] // other systems refuse such names themselves

use super::{boresight, clip, stderr};
use std::ffi::{OsStr, OsString};
use std::os::unix::ffi::OsStrExt;
use std::path::Path;
use std::process::Output;

/// The words of a line, `?` for a byte that no UTF-8 has.
fn words(line: &str) -> Vec<OsString> {
    let odd = |word: &str| {
        let bytes: Vec<u8> = word.bytes().map(|b| if b == b'?' { 0xff } else { b }).collect();
        OsStr::from_bytes(&bytes).to_os_string()
    };
    line.split_whitespace().map(odd).collect()
}

fn at(dir: &Path, line: &str) -> Output {
    boresight().current_dir(dir).args(words(line)).output().unwrap()
}

#[test]
fn names_of_inputs_and_outputs_may_be_any_bytes() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::copy(clip(), dir.path().join(&words("clip?.mp4")[0])).unwrap();
    for line in [
        "simulate ds2 --frames 24 -o sim?",
        "simulate ds2 --frames 24 --format y4m -o y4m?",
        "track sim?/frames --config sim?/track.toml -o out? --summary --no-video",
        "track y4m?/frames.y4m --config sim?/track.toml -o whole?",
        "track clip?.mp4 -o clip?.tracks --no-video -q",
        "track out?/detections.csv --frames sim?/frames -o drawn? -q",
        "detect sim?/frames --config sim?/track.toml -o d?.csv",
        "detect clip?.mp4",
        "preview clip?.mp4 -q",
        "sensor clip?.mp4 -o s?.html",
        "evaluate sim?/gt.txt out?/tracks.csv --csv e?.csv --html e?.html --json e?.json --detections out/none.csv --mot-only",
        "evaluate y4m?/frames.y4m sim?/frames",
        "fuse out?/tracks.csv out?/tracks.csv -o f?.csv",
        "smooth out?/tracks.csv -o smooth?.csv",
        "stitch out?/tracks.csv -o stitch?.csv",
        "convert out?/tracks.csv c?.txt --to mot",
        "simulate sim?/scene.toml -o again?",
        "config --check out?/config.toml",
    ] {
        let out = at(dir.path(), line);
        let text = stderr(&out);
        assert!(out.status.success() && !text.contains("panicked"), "{line}: {text}");
    }
    let read = |name: &str| std::fs::read_to_string(dir.path().join(&words(name)[0])).unwrap();
    assert!(read("out?/report.html").contains("sim\u{fffd}/frames"), "the report names its input");
    assert!(read("out?/summary.json").contains("sim\u{fffd}/frames"));
    // Folder or stream, the same frames: the same tracks.
    assert_eq!(read("out?/tracks.csv"), read("whole?/tracks.csv"));
    // Names that are made from the input's are plain.
    assert!(dir.path().join("clip_.detections.csv").exists() && dir.path().join("clip_.preview.html").exists());
    // The page's commands are those of a shell that takes such bytes.
    assert!(
        read("clip_.preview.html").contains("boresight track $&#39;clip\\xff.mp4&#39;")
            || read("clip_.preview.html").contains("boresight track $'clip\\xff.mp4'")
    );
    let none = at(dir.path(), "track none?.mp4");
    assert!(
        none.status.code() == Some(3) && stderr(&none).contains("none\u{fffd}.mp4: no such file"),
        "{}",
        stderr(&none)
    );
    let same = at(dir.path(), "convert out?/tracks.csv out?/tracks.csv --to mot");
    assert_eq!(same.status.code(), Some(5), "{}", stderr(&same));
}

#[test]
fn where_text_is_needed_such_a_name_is_refused_with_a_way_round() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("d.csv"), "frame,x,y\n0,1,2\n1,2,2\n").unwrap();
    for line in
        ["batch clip?.mp4 -o out", "track d.csv --dark d?rk.png", "detect d.csv --set input.sensor.dark=d?rk.png"]
    {
        let out = at(dir.path(), line);
        let text = stderr(&out);
        assert_eq!(out.status.code(), Some(2), "{line}: {text}");
        assert!(text.contains("\\xff") && text.contains("ln -s"), "{line}: {text}");
    }
}

/// The commands that a run offers, after their words.
fn offered(said: &str) -> Vec<&str> {
    said.lines().filter_map(|l| l.strip_prefix("try next: ").or_else(|| l.strip_prefix("or look:  "))).collect()
}

#[test]
fn the_commands_that_a_run_offers_run_when_they_are_pasted() {
    let dir = tempfile::tempdir().unwrap();
    let named = |name: &[u8]| dir.path().join(OsStr::from_bytes(name));
    std::fs::copy(clip(), named(b"it's \xff $HOME.mp4")).unwrap();
    // Pictures of nothing.
    std::fs::create_dir(named(b"even 'frames'")).unwrap();
    for k in 0..30 {
        let mut picture = b"P5\n64 48\n255\n".to_vec();
        picture.resize(picture.len() + 64 * 48, 100);
        std::fs::write(named(b"even 'frames'").join(format!("{k:03}.pgm")), picture).unwrap();
    }
    let runs: [(&[u8], &[&str]); 3] = [
        (b"it's \xff $HOME.mp4", &["--set", "tracker.min-initiation-score=1e9", "--no-video"]),
        (b"even 'frames'", &["--no-video"]),
        (b"it's \xff $HOME.mp4", &["--set", "tracker.detection-covariance-scale=40", "--no-video"]),
    ];
    let path = Path::new(env!("CARGO_BIN_EXE_boresight")).parent().unwrap().display().to_string();
    for (name, options) in runs {
        let out = boresight()
            .current_dir(dir.path())
            .arg("track")
            .args(options)
            .arg(OsStr::from_bytes(name))
            .output()
            .unwrap();
        let said = stderr(&out);
        let commands = offered(&said);
        assert!(out.status.success() && !commands.is_empty(), "{said}");
        for command in commands {
            let mut shell = std::process::Command::new("bash");
            let pasted = shell
                .args(["-c", command])
                .current_dir(dir.path())
                .env("PATH", format!("{path}:/usr/bin:/bin"))
                .output()
                .unwrap();
            assert!(pasted.status.success(), "{command}: {}", stderr(&pasted));
        }
    }
}
