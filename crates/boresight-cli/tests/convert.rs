//! `boresight convert` as a user runs it: there and back between all formats, and what is said of losses.

use std::path::Path;
use std::process::{Command, Output};

fn boresight(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_boresight")).args(args).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Converts, then back into `home`; the text that comes back and what was said on the way there.
fn there_and_back(dir: &Path, input: &str, to: &str, home: &str) -> (String, String) {
    let (there, back) = (dir.join(format!("there-{to}")), dir.join("back"));
    let go = boresight(&["convert", input, there.to_str().unwrap(), "--to", to]);
    assert!(go.status.success(), "to {to}: {}", text(&go.stderr));
    let come = boresight(&["convert", there.to_str().unwrap(), back.to_str().unwrap(), "--to", home]);
    assert!(come.status.success(), "from {to}: {}", text(&come.stderr));
    (std::fs::read_to_string(back).unwrap(), text(&go.stderr))
}

#[test]
fn boxes_on_whole_pixels_survive_every_format_that_has_boxes() {
    let dir = tempfile::tempdir().unwrap();
    let input = dir.path().join("in.txt");
    // MOTChallenge, counted from 1: the box of the top-left pixel is 1,1,1,1.
    let table = "1,3,1,1,4,6,1,-1,-1,-1\n1,8,20,30,5,5,1,-1,-1,-1\n2,3,2,1,4,6,1,-1,-1,-1\n";
    std::fs::write(&input, table).unwrap();
    for to in ["mot", "mot-truth", "kitti", "csv", "ctc"] {
        let (back, said) = there_and_back(dir.path(), input.to_str().unwrap(), to, "mot");
        assert_eq!(back, table, "through {to}: {said}");
        assert!(!said.contains("does not hold"), "{to}: {said}");
    }
}

#[test]
fn points_survive_every_format_that_has_points() {
    let dir = tempfile::tempdir().unwrap();
    let input = dir.path().join("in.csv");
    std::fs::write(&input, "frame,particle,x,y\n0,3,1.5,2.25\n4,3,1.75,3\n4,5,9,9\n").unwrap();
    for to in ["csv", "trackpy", "trackmate", "btrack", "ultrack"] {
        let (back, said) = there_and_back(dir.path(), input.to_str().unwrap(), to, "trackpy");
        // TrackMate's label, number, z and t of each spot are kept as columns of their own.
        let first_four = |l: &str| l.split(',').take(4).collect::<Vec<_>>().join(",") + "\n";
        let back: String = back.lines().map(first_four).collect();
        assert_eq!(back, std::fs::read_to_string(&input).unwrap(), "through {to}: {said}");
        assert!(!said.contains("does not hold"), "{to}: {said}");
    }
    // Label images have no places between pixels, and a pause ends a label.
    let (back, said) = there_and_back(dir.path(), input.to_str().unwrap(), "ctc", "trackpy");
    assert!(said.contains("positions between pixels") && said.contains("gaps (1 tracks"), "{said}");
    assert!(back.contains(",parent\n") && back.lines().count() == 4, "{back}");
}

#[test]
fn every_column_is_kept_or_named_as_lost() {
    let dir = tempfile::tempdir().unwrap();
    let input = dir.path().join("0006.txt");
    let labels = "0 -1 DontCare -1 -1 -10 5 6 15 26 -1 -1 -1 -1 -1 -1 -1\n\
0 2 Van 1 2 0.5 10 20 30 60 1.5 1.6 3.7 1 2 3 0.1\n1 2 Van 0 0 0.5 11 20 30 60 1.5 1.6 3.7 1 2 3 0.1\n";
    std::fs::write(&input, labels).unwrap();
    let out = |to: &str| {
        let o = boresight(&["convert", input.to_str().unwrap(), "-", "--to", to]);
        assert!(o.status.success(), "{}", text(&o.stderr));
        (text(&o.stdout), text(&o.stderr))
    };
    let (shown, said) = out("csv");
    assert!(shown.contains("alpha_rad") && shown.contains("rotation_y_rad"), "{shown}");
    assert!(shown.contains("truncation,occlusion") && said.contains("regions that do not count"), "{shown} {said}");
    let (_, said) = out("mot");
    for lost in ["alpha_rad", "class", "truncation", "occlusion", "regions that do not count"] {
        assert!(said.contains(lost), "{lost}: {said}");
    }
    let (_, said) = out("trackmate");
    assert!(said.contains("width, height") && said.contains("class"), "{said}");
}

#[test]
fn a_loss_that_is_not_allowed_writes_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let (input, output) = (dir.path().join("in.txt"), dir.path().join("out"));
    std::fs::write(&input, "1,3,1,1,4,6,0.5,-1,-1,-1\n").unwrap();
    for to in ["trackpy", "ctc"] {
        let o = boresight(&["convert", input.to_str().unwrap(), output.to_str().unwrap(), "--to", to, "--lossless"]);
        assert_eq!(o.status.code(), Some(3));
        assert!(text(&o.stderr).contains("does not hold") && text(&o.stderr).contains("score"), "{}", text(&o.stderr));
        assert!(!output.exists());
    }
}

#[test]
fn formats_of_other_programs_are_written_whole_and_say_what_they_lose() {
    let dir = tempfile::tempdir().unwrap();
    let input = dir.path().join("in.csv");
    std::fs::write(&input, "frame,track_id,x,y,width,height,score,mood\n0,3,5,6,2,4,0.5,good\n2,3,6,6,2,4,0.5,bad\n")
        .unwrap();
    let to = |name: &str, more: &[&str]| {
        let output = dir.path().join(name);
        let args = ["convert", input.to_str().unwrap(), output.to_str().unwrap(), "--to", name];
        (boresight(&[&args[..], more].concat()), output)
    };
    for (name, lost) in [
        ("geff", "does not hold: mood\n"),
        ("trackmate-xml", "width, height (a disc of the same area), mood"),
        ("cvat", "does not hold: score, mood"),
        ("mot-zip", "does not hold: score, mood"),
        ("napari", "width, height, score, mood"),
        ("mcap", "does not hold: mood, times (the table has none: 25 frames/s)\n"),
        ("vmti", "positions between pixels (they are rounded), mood, the size of the frames"),
    ] {
        let (o, output) = to(name, &["--lossless"]);
        assert!(o.status.code() == Some(3) && !output.exists(), "{name}: {}", text(&o.stderr));
        let (o, output) = to(name, &[]);
        assert!(o.status.success() && output.exists(), "{name}: {}", text(&o.stderr));
        assert!(text(&o.stderr).contains(lost), "{name}: {}", text(&o.stderr));
        // They are written only: who reads them back are others (crates/boresight-py/tests/test_formats.py).
        let o = boresight(&["convert", output.to_str().unwrap(), "-", "--from", name, "--to", "csv"]);
        assert_eq!(o.status.code(), Some(2), "{name}");
    }
    let (o, _) = to("parquet", &[]);
    assert_eq!(o.status.success(), cfg!(feature = "parquet"), "{}", text(&o.stderr));
    assert!(cfg!(feature = "parquet") || text(&o.stderr).contains("--features parquet"));
}

#[test]
fn detections_of_coco_are_a_table() {
    let dir = tempfile::tempdir().unwrap();
    let input = dir.path().join("results.json");
    let rows = "[{\"image_id\": 0, \"category_id\": 3, \"bbox\": [0, 2, 4, 6], \"score\": 0.5, \"track_id\": 7}]";
    std::fs::write(&input, rows).unwrap();
    let o = boresight(&["convert", input.to_str().unwrap(), "-", "--to", "csv"]);
    let want = "frame,track_id,x_px,y_px,width_px,height_px,score,class\n0,7,1.5,4.5,4,6,0.5,3\n";
    assert_eq!(text(&o.stdout), want, "{}", text(&o.stderr));
    let out = dir.path().join("out");
    let o = boresight(&["track", input.to_str().unwrap(), "-o", out.to_str().unwrap(), "--rate-hz", "10"]);
    assert!(o.status.success() && out.join("detections.csv").exists(), "{}", text(&o.stderr));
    std::fs::write(&input, "{\"frame\": 1}\n").unwrap();
    let o = boresight(&["track", input.to_str().unwrap(), "-o", out.to_str().unwrap()]);
    assert!(o.status.code() == Some(3) && text(&o.stderr).contains("not COCO"), "{}", text(&o.stderr));
}

#[test]
fn cells_keep_their_parents_and_a_missing_input_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let input = dir.path().join("cells.csv");
    std::fs::write(&input, "frame,track_id,x,y,width,height,parent\n0,1,3,3,3,3,\n1,2,3,3,3,3,1\n1,4,9,9,3,3,1\n")
        .unwrap();
    let folder = dir.path().join("RES");
    let o =
        boresight(&["convert", input.to_str().unwrap(), folder.to_str().unwrap(), "--to", "ctc", "--size", "12x12"]);
    assert!(o.status.success() && !text(&o.stderr).contains("does not hold"), "{}", text(&o.stderr));
    assert_eq!(std::fs::read_to_string(folder.join("res_track.txt")).unwrap(), "1 0 0 0\n2 1 1 1\n4 1 1 1\n");
    let same = boresight(&[
        "evaluate",
        folder.to_str().unwrap(),
        folder.to_str().unwrap(),
        "--require",
        "TRA=1",
        "--require",
        "DET=1",
    ]);
    assert!(same.status.success(), "{}", text(&same.stderr));
    let o = boresight(&["convert", "no-such.txt", "-", "--to", "csv"]);
    assert_eq!(o.status.code(), Some(3));
    assert!(text(&o.stderr).contains("no-such.txt"), "{}", text(&o.stderr));
}

#[test]
fn the_table_of_trackpy_holds_measured_rows_with_their_mass() {
    let dir = tempfile::tempdir().unwrap();
    let put = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).unwrap();
    put(
        "tracks.csv",
        "frame,time_s,track_id,status,x_px,y_px,detection\n0,0,1,confirmed,5,6,1\n1,0.1,1,coasting,6,6,\n2,0.2,1,confirmed,7,6,0\n",
    );
    put("detections.csv", "frame,time_s,x_px,y_px,sum\n0,0,50,60,9\n0,0,5,6,30.5\n2,0.2,7,6,41\n");
    let columns = |more: &[&str]| -> Vec<Vec<String>> {
        let out = dir.path().join("p.csv");
        let args = [dir.path().join("tracks.csv"), out.clone()];
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_boresight"));
        let run = command.arg("convert").args(args).args(["--to", "trackpy"]).args(more).output().unwrap();
        assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
        let text = std::fs::read_to_string(out).unwrap();
        let rows: Vec<Vec<&str>> = text.lines().map(|l| l.split(',').collect()).collect();
        let at = ["frame", "particle", "x", "y", "mass"].map(|n| rows[0].iter().position(|c| *c == n).expect(n));
        rows[1..].iter().map(|r| at.iter().map(|i| r[*i].to_string()).collect()).collect()
    };
    assert_eq!(columns(&[]), [["0", "1", "5", "6", "30.5"], ["2", "1", "7", "6", "41"]]);
    assert_eq!(columns(&["--predicted"])[1], ["1", "1", "6", "6", ""]);
}
