//! Broken input, wrong usage, outputs in the way: the documented exit code, and a message that says what, where and how to mend.

use super::{boresight, clip, root, stderr};
use std::path::Path;

struct Case {
    /// What is wrong, in the folder of the case.
    args: Vec<String>,
    code: i32,
    says: Vec<&'static str>,
}

fn case(args: &[&str], code: i32, says: &[&'static str]) -> Case {
    Case { args: args.iter().map(ToString::to_string).collect(), code, says: says.to_vec() }
}

fn files(dir: &Path) {
    let write = |name: &str, bytes: &[u8]| std::fs::write(dir.join(name), bytes).unwrap();
    let clip = std::fs::read(clip()).unwrap();
    write("clip.mp4", &clip);
    write("empty.mp4", b"");
    write("cut.mp4", &clip[..200]);
    write("words.png", b"this is no picture");
    write("typo.toml", b"[tracker]\ngate-probabilty = 0.9\n");
    write("type.toml", b"[tracker]\ngate-probability = \"high\"\n");
    write("range.toml", b"[tracker]\ngate-probability = 1.2\n");
    write("syntax.toml", b"[tracker\n");
    write("bad.csv", b"frame,x,y\n0,1,2\n1,a,3\n");
    write("noframe.csv", b"a,b\n1,2\n");
    write("wide.csv", b"frame,x,y\n0,1,5,2,5\n");
    write("zero.txt", b"0,-1,3,3,5,5,1,-1,-1,-1\n");
    write("one.txt", b"1,1,3,3,5,5,1,-1,-1,-1\n");
    write("utf16.csv", b"\xff\xfef\0r\0a\0");
    write("huge.pgm", b"P5\n1000000 1000000\n255\n");
    std::fs::create_dir(dir.join("empty")).unwrap();
    std::fs::copy(root().join("crates/boresight/tests/data/video/hevc.mp4"), dir.join("hevc.mp4")).unwrap();
}

#[test]
fn every_failure_has_its_documented_code_and_names_a_mend() {
    let dir = tempfile::tempdir().unwrap();
    files(dir.path());
    let cases = [
        // 2: usage and configuration
        case(&["trak"], 2, &["'track'"]),
        case(&["track"], 2, &["<INPUT>"]),
        case(
            &["track", "clip.mp4", "--config", "typo.toml"],
            2,
            &["line 2", "gate-probabilty", "did you mean `gate-probability`?"],
        ),
        case(&["track", "clip.mp4", "--config", "type.toml"], 2, &["type.toml", "line 2", "expected f64", "hint:"]),
        case(
            &["track", "clip.mp4", "--config", "range.toml"],
            2,
            &["tracker.gate-probability = 1.2", "(0, 1)", "hint:"],
        ),
        case(&["config", "--check", "syntax.toml"], 2, &["syntax.toml", "line 1", "`]`"]),
        case(
            &["track", "clip.mp4", "--set", "tracker.coast_s=1"],
            2,
            &["--set tracker.coast_s=1", "did you mean `coast-s`?"],
        ),
        case(&["track", "clip.mp4", "--set", "tracker"], 2, &["expected KEY=VALUE", "hint:"]),
        case(&["track", "clip.mp4", "--filter", "udd"], 2, &["--filter udd", "did you mean `ud`?"]),
        case(&["track", "clip.mp4", "--rate-hz=-3"], 2, &["above 0", "hint:"]),
        case(&["track", "clip.mp4", "-o", "-"], 2, &["expected a folder", "hint:"]),
        case(&["convert", "one.txt", "x", "--to", "moot"], 2, &["mot-truth", "trackmate"]),
        case(&["evaluate", "one.txt", "one.txt", "--require", "HOTA=nan"], 2, &["expected a number"]),
        case(&["evaluate", "one.txt", "one.txt", "--cutoff", "-1"], 2, &["above 0 px"]),
        case(&["evaluate", "one.txt", "one.txt", "--window", "0"], 2, &["--window"]),
        // 3: input
        case(&["track", "none.mp4"], 3, &["none.mp4", "no such file", "hint:"]),
        case(&["track", "empty.mp4"], 3, &["empty.mp4", "empty"]),
        case(&["track", "cut.mp4"], 3, &["cut.mp4", "moov", "hint:"]),
        case(&["detect", "words.png"], 3, &["words.png"]),
        case(&["track", "empty"], 3, &["holds no image files"]),
        case(&["track", "none/*.png"], 3, &["none/*.png"]),
        case(&["track", "huge.pgm"], 3, &["huge.pgm"]),
        case(&["track", "bad.csv"], 3, &["bad.csv", "line 3", "column x", "\"a\"", "hint:"]),
        case(&["track", "wide.csv"], 3, &["wide.csv", "line 2", "5 fields, expected 3", "decimal commas"]),
        case(&["track", "zero.txt"], 3, &["line 1", "first-frame=0", "--skip-bad-rows"]),
        case(&["track", "utf16.csv"], 3, &["UTF-16", "hint:"]),
        case(&["evaluate", "one.txt", "utf16.csv"], 3, &["UTF-16", "hint:"]),
        case(&["track", "noframe.csv"], 3, &["noframe.csv", "frame", "hint:"]),
        case(&["track", "clip.mp4", "--config", "none.toml"], 3, &["none.toml", "hint:"]),
        case(&["evaluate", "none.txt", "none.txt"], 3, &["none.txt"]),
        // 5: output
        case(&["track", "clip.mp4", "-o", "typo.toml/x"], 5, &["typo.toml/x", "hint:"]),
        case(&["detect", "clip.mp4", "-q", "-o", "none/d.csv"], 5, &["none/d.csv"]),
        case(&["detect", "clip.mp4", "-q", "-o", "empty"], 5, &["folder"]),
    ];
    for Case { args, code, says } in cases {
        let out = boresight().current_dir(dir.path()).args(&args).output().unwrap();
        let text = stderr(&out);
        assert_eq!(out.status.code(), Some(code), "{args:?}: {text}");
        assert!(text.contains("error: ") && !text.contains("panicked"), "{args:?}: {text}");
        for word in says {
            assert!(text.contains(word), "{args:?} does not say {word:?}: {text}");
        }
        assert!(out.stdout.is_empty(), "{args:?}: errors go to standard error");
    }
}

#[test]
fn a_missing_ffmpeg_is_told_with_what_to_install() {
    let dir = tempfile::tempdir().unwrap();
    files(dir.path());
    let out = boresight().current_dir(dir.path()).env("PATH", "").args(["track", "hevc.mp4"]).output().unwrap();
    assert_eq!(out.status.code(), Some(4), "{}", stderr(&out));
    assert!(stderr(&out).contains("install ffmpeg"), "{}", stderr(&out));
}

#[cfg(unix)]
#[test]
fn a_reader_that_has_enough_ends_the_run_without_complaint() {
    use std::io::Read;
    use std::process::Stdio;
    let clip = clip().to_string_lossy().into_owned();
    for args in [vec!["detect", clip.as_str(), "-q", "-o", "-"], vec!["simulate", "ds2", "-o", "-"]] {
        let mut child = boresight().args(&args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        child.stdout.take().unwrap().read_exact(&mut [0; 10]).unwrap();
        let out = child.wait_with_output().unwrap();
        assert_eq!((out.status.code(), stderr(&out).as_str()), (Some(0), ""), "{args:?}");
    }
}

#[cfg(target_os = "linux")] // /dev/full
#[test]
fn a_full_disk_is_an_error_and_the_device_stays_a_device() {
    use std::os::unix::fs::FileTypeExt;
    let device = || std::fs::metadata("/dev/full").is_ok_and(|m| m.file_type().is_char_device());
    let out = boresight().arg("detect").arg(clip()).args(["-q", "-o", "/dev/full"]).output().unwrap();
    assert_eq!(out.status.code(), Some(5), "{}", stderr(&out));
    assert!(device());
}

#[test]
fn a_damaged_tail_keeps_the_frames_before_it() {
    let dir = tempfile::tempdir().unwrap();
    run_simulate(dir.path());
    let whole = std::fs::read(dir.path().join("ds2.y4m")).unwrap();
    std::fs::write(dir.path().join("cut.y4m"), &whole[..whole.len() - 1000]).unwrap();
    let out = boresight().current_dir(dir.path()).args(["detect", "cut.y4m", "-o", "d.csv"]).output().unwrap();
    let text = stderr(&out);
    assert!(text.contains("19 frames"), "{text}");
    assert!(text.contains("warning: ") && text.contains("1 frame is lost"), "{text}");
    assert!(dir.path().join("d.csv").exists());
}

fn run_simulate(dir: &Path) {
    let out = boresight().current_dir(dir).args(["simulate", "ds2", "--frames", "20", "-o", "-"]).output().unwrap();
    assert!(out.status.success(), "{}", stderr(&out));
    std::fs::write(dir.join("ds2.y4m"), out.stdout).unwrap();
}

#[test]
fn the_help_lists_every_code() {
    let out = boresight().arg("--help").output().unwrap();
    let text = String::from_utf8_lossy(&out.stdout).into_owned();
    for code in ["0 ", "1 ", "2 ", "3 ", "4 ", "5 ", "6 ", "130 "] {
        assert!(text.lines().any(|l| l.trim_start().starts_with(code)), "{code}: {text}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_closed_standard_output_is_an_error_of_the_output_and_one_that_is_thrown_away_is_not() {
    let run = |redirect: &str| {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("d.csv"), "frame,x,y\n0,1,2\n1,2,2\n").unwrap();
        let command = format!("{} detect d.csv -o - {redirect}", env!("CARGO_BIN_EXE_boresight"));
        std::process::Command::new("sh").args(["-c", &command]).current_dir(dir.path()).output().unwrap()
    };
    let closed = run(">&-");
    assert_eq!(closed.status.code(), Some(5), "{}", stderr(&closed));
    assert!(stderr(&closed).contains("standard output: is closed"), "{}", stderr(&closed));
    for kept in [">/dev/null", "1<>/dev/null", "| cat"] {
        assert_eq!(run(kept).status.code(), Some(0), "{kept}");
    }
}
