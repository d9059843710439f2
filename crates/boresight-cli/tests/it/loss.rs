//! Nothing is lost in silence: what is missing of an input is said, also with `-q`, and stands beside the results; inputs that hold
//! nothing are errors and leave earlier results alone; a folder of results is one run.

use super::{boresight, root, stderr};
use std::path::Path;
use std::process::Output;

fn at(dir: &Path, line: &str) -> Output {
    boresight().current_dir(dir).args(line.split_whitespace()).output().unwrap()
}

fn ok(dir: &Path, line: &str) -> Output {
    let out = at(dir, line);
    assert!(out.status.success(), "{line}: {}", stderr(&out));
    out
}

fn names(dir: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        std::fs::read_dir(dir).unwrap().map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// A scene as a stream of 24 frames, its configuration, and its detections.
fn scene() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    ok(dir.path(), "simulate ds2 --frames 24 --format y4m -o sim");
    ok(dir.path(), "detect sim/frames.y4m --config sim/track.toml -q -o d.csv");
    dir
}

#[test]
fn a_folder_of_results_holds_one_run() {
    let dir = scene();
    let out = dir.path().join("out");
    ok(dir.path(), "track sim/frames.y4m --config sim/track.toml -q -o out --png --json");
    std::fs::write(out.join("notes.txt"), "mine").unwrap();
    std::fs::write(out.join("frames/mine.png"), "mine").unwrap();
    std::fs::write(out.join("camera.csv"), "mine: no run here says that it made it").unwrap();
    assert_eq!(std::fs::read_dir(out.join("frames")).unwrap().count(), 25);
    // Another input, without pictures: those of the first run would show another scene.
    ok(dir.path(), "track d.csv -q -o out --no-report");
    let kept = ["camera.csv", "config.toml", "detections.csv", "frames", "mot.txt", "notes.txt", "tracks.csv"];
    assert_eq!(names(&out), kept);
    assert_eq!(names(&out.join("frames")), ["mine.png"]);
    // A shorter run with frames clears those it did not make.
    ok(dir.path(), "track sim/frames.y4m --config sim/track.toml -q -o out2 --png --no-video --no-report");
    ok(dir.path(), "simulate ds2 --frames 9 --format y4m -o short");
    ok(dir.path(), "track short/frames.y4m --config sim/track.toml -q -o out2 --png --no-video --no-report");
    assert_eq!(std::fs::read_dir(dir.path().join("out2/frames")).unwrap().count(), 9);
}

#[test]
fn a_scene_of_another_length_or_format_replaces_the_frames() {
    let dir = tempfile::tempdir().unwrap();
    ok(dir.path(), "simulate ds2 --frames 12 -o s");
    std::fs::write(dir.path().join("s/notes.txt"), "mine").unwrap();
    ok(dir.path(), "simulate ds2 --frames 5 --format pgm -o s");
    let frames: Vec<String> = (0..5).map(|k| format!("frame_{k:06}.pgm")).collect();
    assert_eq!(names(&dir.path().join("s/frames")), frames);
    ok(dir.path(), "simulate ds2 --frames 5 --format y4m -o s");
    assert!(!dir.path().join("s/frames").exists() && dir.path().join("s/notes.txt").exists());
    ok(dir.path(), "simulate ds2 --frames 5 -o s");
    assert!(!dir.path().join("s/frames.y4m").exists());
    // An image of somebody else would be read as a frame.
    std::fs::write(dir.path().join("s/frames/photo.jpg"), "mine").unwrap();
    assert_eq!(at(dir.path(), "simulate ds2 --frames 5 -o s").status.code(), Some(5));
}

#[test]
fn an_input_without_anything_in_it_is_an_error_and_leaves_earlier_results_alone() {
    let dir = scene();
    ok(dir.path(), "track d.csv -q -o out");
    let before: Vec<Vec<u8>> =
        names(&dir.path().join("out")).iter().map(|n| std::fs::read(dir.path().join("out").join(n)).unwrap()).collect();
    std::fs::write(dir.path().join("header.csv"), "frame,x,y\n").unwrap();
    std::fs::write(dir.path().join("empty.y4m"), "YUV4MPEG2 W64 H48 F25:1 Cmono\n").unwrap();
    std::fs::write(dir.path().join("broken.y4m"), "YUV4MPEG2 W64 H48 F25:1 Cmono\nFRAME\nxyz").unwrap();
    for (line, says) in [
        ("track header.csv -o out", "no rows"),
        ("track empty.y4m -o out", "no frames"),
        ("track empty.y4m --config sim/track.toml -q -o out", "no frames"),
        ("track broken.y4m --config sim/track.toml -q -o out", "error: "),
        ("detect empty.y4m -q -o out/detections.csv", "no frames"),
    ] {
        let out = at(dir.path(), line);
        assert_eq!(out.status.code(), Some(3), "{line}: {}", stderr(&out));
        assert!(stderr(&out).contains(says), "{line}: {}", stderr(&out));
    }
    let after: Vec<Vec<u8>> =
        names(&dir.path().join("out")).iter().map(|n| std::fs::read(dir.path().join("out").join(n)).unwrap()).collect();
    assert!(before == after);
    // Elsewhere no tracks are an answer, and are said.
    for line in ["smooth header.csv -o s.csv", "stitch header.csv -o t.csv", "convert header.csv c.csv --to csv"] {
        std::fs::write(dir.path().join("header.csv"), "frame,track_id,x,y\n").unwrap();
        assert!(stderr(&ok(dir.path(), line)).contains("warning: header.csv: the table has no rows"), "{line}");
    }
}

#[test]
fn what_is_lost_is_said_with_quiet_too_and_stands_beside_the_results() {
    let dir = scene();
    let whole = std::fs::read(dir.path().join("sim/frames.y4m")).unwrap();
    std::fs::write(dir.path().join("cut.y4m"), &whole[..whole.len() - 1000]).unwrap();
    let out = ok(dir.path(), "track cut.y4m --config sim/track.toml -q -o out --no-video");
    assert!(stderr(&out).starts_with("warning: ") && stderr(&out).contains("1 frame is lost"), "{}", stderr(&out));
    assert!(
        stderr(&ok(dir.path(), "detect cut.y4m --config sim/track.toml -q -o cut.csv")).contains("1 frame is lost")
    );
    let table = std::fs::read_to_string(dir.path().join("d.csv")).unwrap();
    std::fs::write(dir.path().join("cut.csv"), &table[..table.len() - 60]).unwrap();
    let rows = ok(dir.path(), "track cut.csv -q -o rows");
    assert!(stderr(&rows).contains("warning: ") && stderr(&rows).contains("1 row is lost"), "{}", stderr(&rows));
    for folder in ["out", "rows"] {
        let config = std::fs::read_to_string(dir.path().join(folder).join("config.toml")).unwrap();
        let (_, warnings) = config.split_once("# Warnings of this run:\n").expect(folder);
        assert!(warnings.starts_with("# - ") && warnings.contains("is lost"), "{warnings}");
        let report = std::fs::read_to_string(dir.path().join(folder).join("report.html")).unwrap();
        assert!(report.contains("is lost"), "{folder}");
    }
    ok(dir.path(), "config --check out/config.toml");
    assert!(stderr(&ok(dir.path(), "track d.csv -q -o fine")).is_empty());
}

#[test]
fn a_wild_row_costs_its_scan_and_not_the_run() {
    let dir = scene();
    let mut table = String::from("frame,time_s,x,y\n");
    for k in 0..30 {
        table += &format!("{k},{},{},20\n", f64::from(k) * 0.04, 10 + k);
        if k == 15 {
            table += "15,0.6,1e308,1e308\n";
        }
    }
    std::fs::write(dir.path().join("wild.csv"), table).unwrap();
    let out = ok(dir.path(), "track wild.csv -q -o wild");
    assert!(stderr(&out).contains("1 frames are left out") && stderr(&out).contains("1e308"), "{}", stderr(&out));
    let tracks = std::fs::read_to_string(dir.path().join("wild/tracks.csv")).unwrap();
    let has = |k: u32| tracks.lines().any(|l| l.starts_with(&format!("{k},")));
    assert!(has(14) && !has(15) && has(16) && has(29), "{tracks}");
}

#[test]
fn a_table_with_a_zero_byte_is_a_damaged_table_and_no_picture() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("nul.txt"), b"1,1,3,3,5,5,1,-1,-1,-1\n2,1,3,3,\x005,5,1,-1,-1,-1\n").unwrap();
    for line in ["track nul.txt -o out", "detect nul.txt -o d.csv", "smooth nul.txt -o s.csv"] {
        let out = at(dir.path(), line);
        assert_eq!(out.status.code(), Some(3), "{line}: {}", stderr(&out));
        assert!(!stderr(&out).contains("ffmpeg"), "{line}: {}", stderr(&out));
    }
}

#[test]
fn a_missing_number_among_tiff_files_is_a_gap_in_time() {
    let dir = scene();
    // Label images are TIFF files with a number in their names.
    ok(dir.path(), "convert sim/truth.csv f --to ctc --size 64x64");
    for k in [3, 4].into_iter().chain(7..24) {
        std::fs::remove_file(dir.path().join(format!("f/mask{k:03}.tif"))).unwrap();
    }
    let out = ok(dir.path(), "track f --rate-hz 10 -q --no-video --json -o out");
    assert!(stderr(&out).contains("2 numbers are missing"), "{}", stderr(&out));
    let lines = std::fs::read_to_string(dir.path().join("out/tracks.jsonl")).unwrap();
    let times: Vec<&str> =
        lines.lines().map(|l| l.split("\"time_s\":").nth(1).unwrap().split(',').next().unwrap()).collect();
    assert_eq!(times, ["0", "0.1", "0.2", "0.5", "0.6"]);
}

#[test]
fn rates_and_links_that_cannot_be_are_refused_with_their_reason() {
    let dir = scene();
    for rate in ["1e12", "1e-12"] {
        for input in ["d.csv", "sim/frames.y4m"] {
            let out = at(dir.path(), &format!("track {input} --rate-hz {rate} -o out"));
            assert_eq!(out.status.code(), Some(2), "{input} {rate}: {}", stderr(&out));
            assert!(stderr(&out).contains("whole nanoseconds"), "{}", stderr(&out));
        }
    }
    assert!(!dir.path().join("out").exists());
}

#[cfg(unix)]
#[test]
fn links_in_a_circle_and_names_that_are_no_text_end_in_words() {
    use std::os::unix::ffi::OsStrExt;
    let dir = scene();
    std::os::unix::fs::symlink("b", dir.path().join("a")).unwrap();
    std::os::unix::fs::symlink("a", dir.path().join("b")).unwrap();
    for (line, code) in
        [("track a -o out", 3), ("detect a -o d", 3), ("smooth a -o s", 3), ("convert d.csv a --to csv", 5)]
    {
        let out = at(dir.path(), line);
        // The input of `convert` has no tracks; what counts is that the link is neither followed for ever nor replaced.
        assert!(out.status.code() == Some(code) || line.starts_with("convert"), "{line}: {}", stderr(&out));
        assert!(!stderr(&out).contains("panicked") && dir.path().join("a").is_symlink(), "{line}: {}", stderr(&out));
    }
    let odd = std::ffi::OsStr::from_bytes(b"t\xff.csv");
    let tracks = "frame,track_id,x,y\n0,1,2,3\n1,1,2,3\n2,1,3,3\n";
    std::fs::write(dir.path().join(odd), tracks).unwrap();
    let run = |args: &[&std::ffi::OsStr]| boresight().current_dir(dir.path()).args(args).output().unwrap();
    let out =
        run(&["convert".as_ref(), odd, std::ffi::OsStr::from_bytes(b"u\xff.csv"), "--to".as_ref(), "csv".as_ref()]);
    assert_eq!(out.status.code(), Some(0), "{}", stderr(&out));
    assert!(dir.path().join(std::ffi::OsStr::from_bytes(b"u\xff.csv")).exists());
    let out = run(&["convert".as_ref(), odd, odd, "--to".as_ref(), "csv".as_ref()]);
    assert_eq!(out.status.code(), Some(5), "{}", stderr(&out));
}

#[test]
fn pictures_of_two_cameras_in_one_folder_are_said_and_the_pattern_takes_one() {
    let dir = tempfile::tempdir().unwrap();
    ok(dir.path(), "simulate ds2 --frames 8 -o s");
    std::fs::create_dir(dir.path().join("both")).unwrap();
    for k in 0..8 {
        for camera in ["cam1", "cam2"] {
            let to = dir.path().join(format!("both/{camera}_{k:03}.png"));
            std::fs::copy(dir.path().join(format!("s/frames/frame_{k:06}.png")), to).unwrap();
        }
    }
    let out = ok(dir.path(), "track both --config s/track.toml -q -o out --no-video");
    let said = stderr(&out);
    assert!(said.contains("2 sequences (cam1_, cam2_)") && said.contains("'both/cam1_*'"), "{said}");
    let one = at(dir.path(), "track both/cam1_* --config s/track.toml -q -o one --no-video");
    assert!(one.status.success() && stderr(&one).is_empty(), "{}", stderr(&one));
}

#[test]
fn the_same_run_gives_the_same_bytes_in_every_file() {
    let dir = scene();
    for folder in ["one", "two"] {
        let line = "track sim/frames.y4m --config sim/track.toml -q --png --json --camera -o";
        ok(dir.path(), &format!("{line} {folder}"));
    }
    let (one, two) = (dir.path().join("one"), dir.path().join("two"));
    assert_eq!(names(&one), names(&two));
    for name in names(&one).iter().filter(|n| *n != "frames") {
        assert!(std::fs::read(one.join(name)).unwrap() == std::fs::read(two.join(name)).unwrap(), "{name}");
    }
}

#[test]
fn a_picture_beyond_the_budget_or_a_header_that_lies_is_refused_before_memory_is_taken() {
    let dir = tempfile::tempdir().unwrap();
    let images = root().join("crates/boresight/tests/it/images");
    let path = |name: &str| dir.path().join(name);
    std::fs::copy(images.join("smooth.jpg"), path("sound.jpg")).unwrap();
    // 4000 x 4000 grey pixels of a PGM, all of them there, and a JPEG that claims 12288 x 12288.
    std::fs::write(path("large.pgm"), [&b"P5\n4000 4000\n255\n"[..], &vec![7; 16_000_000]].concat()).unwrap();
    let mut jpeg = std::fs::read(path("sound.jpg")).unwrap();
    let frame = jpeg.windows(2).position(|w| w == [0xff, 0xc0] || w == [0xff, 0xc2]).unwrap();
    jpeg[frame + 5..frame + 9].copy_from_slice(&[0x30, 0, 0x30, 0]);
    std::fs::write(path("lies.jpg"), jpeg).unwrap();
    for (line, says) in [
        ("detect large.pgm -o d.csv --max-memory 100", "more than the 100 MB allowed"),
        ("detect lies.jpg -o d.csv", "bytes are too few"),
    ] {
        let out = at(dir.path(), line);
        assert_eq!(out.status.code(), Some(3), "{line}: {}", stderr(&out));
        assert!(stderr(&out).contains(says), "{line}: {}", stderr(&out));
    }
}
