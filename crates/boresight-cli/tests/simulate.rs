//! The chains of the chapters Simulate, Fuse and Reproduce, run from their own text with the binary.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn docs(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs").join(name);
    std::fs::read_to_string(path).unwrap()
}

/// The blocks of a chapter in a language, in order.
fn blocks(text: &str, language: &str) -> Vec<String> {
    let fence = format!("```{language}");
    let of = |rest: &str| rest.split_once('\n').unwrap().1.split("```").next().unwrap().to_string();
    text.split(&fence).skip(1).map(of).collect()
}

/// Runs a line of a chapter in a shell that finds this build's binary first.
fn shell(dir: &Path, line: &str) -> Output {
    let bin = PathBuf::from(env!("CARGO_BIN_EXE_boresight"));
    let path = std::env::var("PATH").unwrap_or_default();
    let path = format!("{}:{path}", bin.parent().unwrap().display());
    Command::new("bash").args(["-o", "pipefail", "-ec", line]).current_dir(dir).env("PATH", path).output().unwrap()
}

fn run(dir: &Path, line: &str) -> String {
    let out = shell(dir, line);
    let (o, e) = (String::from_utf8_lossy(&out.stdout), String::from_utf8_lossy(&out.stderr));
    assert!(out.status.success(), "{line}\n{o}{e}");
    format!("{o}{e}")
}

/// The value under a column of a table that `evaluate` printed.
fn score(text: &str, column: &str) -> f64 {
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        if let Some(i) = line.split_whitespace().position(|w| w == column) {
            let row: Vec<&str> = lines.next().unwrap().split_whitespace().collect();
            return row[i].parse().unwrap();
        }
    }
    panic!("no column {column} in\n{text}");
}

#[test]
fn the_commands_of_the_chapter_simulate_work_and_find_the_targets() {
    let (text, dir) = (docs("simulate.md"), tempfile::tempdir().unwrap());
    std::fs::write(dir.path().join("scene.toml"), &blocks(&text, "toml")[0]).unwrap();
    std::fs::write(dir.path().join("radars.toml"), "[[radars]]\nname = \"far\"\nscan-period-s = 0.5\n").unwrap();
    let mut outputs = Vec::new();
    for block in blocks(&text, "sh") {
        for line in block.lines() {
            // The pictures are the slow part and are tested elsewhere.
            let line = line.replace("boresight track", "boresight track --no-video --no-report");
            outputs.push((line.clone(), run(dir.path(), &line)));
        }
    }
    let of = |what: &str| &outputs.iter().find(|(l, _)| l.contains(what)).unwrap().1;
    // Data set II from nothing: confirmed at scan 3, held to the end, no false track.
    let mot = of("evaluate sim/gt.txt");
    assert!(score(mot, "Recall") > 0.9 && score(mot, "Precision") == 1.0 && score(mot, "IDSW") == 0.0, "{mot}");
    let centre = of("evaluate sim/truth.csv");
    assert!(score(centre, "Recall") > 0.9, "{centre}");
    // The stream gives the same tracks as the files.
    let read = |p: &str| std::fs::read_to_string(dir.path().join(p)).unwrap();
    assert_eq!(read("out/tracks.csv"), read("piped/tracks.csv"));
    let own = of("evaluate own/truth.csv");
    // Behind the blind time too: frames have the numbers of their names.
    assert!(score(own, "Recall") > 0.8 && score(own, "Precision") > 0.9, "{own}");
    assert!(read("radar-only/far.csv").lines().count() > 10);
    assert!(read("own/radar-plots.csv").starts_with("frame,time_s,arrival_s,range_px,azimuth_rad"));
}

#[test]
fn the_commands_of_the_chapter_fuse_work_and_fusing_helps_the_worse_sensor() {
    let (text, dir) = (docs("fuse.md"), tempfile::tempdir().unwrap());
    std::fs::write(dir.path().join("points.csv"), "x,y,X,Y\n0,0,0,0\n60,0,60,0\n0,60,0,60\n60,60,60,60\n").unwrap();
    for block in blocks(&text, "sh") {
        for line in block.lines() {
            run(dir.path(), &line.replace("boresight track", "boresight track --no-video --no-report"));
        }
    }
    let error = |table: &str| {
        let line = format!("boresight evaluate sim/truth.csv {table} --match centre --distance 10");
        let text = run(dir.path(), &line);
        assert!(score(&text, "Recall") > 0.85, "{text}");
        score(&text, "RMSE")
    };
    let (radar, fused, together) = (error("radar/tracks.csv"), error("fused.csv"), error("together.csv"));
    assert!(fused < radar && together < radar, "radar {radar}, fused {fused}, together {together}");
    // The identity, given as numbers and found from points, changes nothing but rounding.
    assert!((error("mapped.csv") - fused).abs() < 1e-6);
}

#[test]
fn the_commands_of_the_chapter_reproduce_work() {
    let (text, dir) = (docs("reproduce.md"), tempfile::tempdir().unwrap());
    for block in blocks(&text, "sh") {
        for line in block.lines() {
            let out = run(dir.path(), &line.replace("--runs 20", "--runs 3").replace("--runs 50", "--runs 3"));
            assert!(!out.is_empty());
        }
    }
    let page = std::fs::read_to_string(dir.path().join("report/index.html")).unwrap();
    assert!(page.contains("Table 4.4") && page.contains("<svg"));
}

#[test]
fn the_same_seed_gives_the_same_bytes_and_another_seed_others() {
    let dir = tempfile::tempdir().unwrap();
    for (name, seed) in [("a", 4), ("b", 4), ("c", 5)] {
        run(
            dir.path(),
            &format!("boresight simulate imager-radar-loss --frames 40 --format y4m --seed {seed} -o {name}"),
        );
    }
    let read = |p: &str| std::fs::read(dir.path().join(p)).unwrap();
    for file in ["frames.y4m", "truth.csv", "gt.txt", "radar.csv", "radar-plots.csv"] {
        assert_eq!(read(&format!("a/{file}")), read(&format!("b/{file}")), "{file}");
    }
    assert_ne!(read("a/frames.y4m"), read("c/frames.y4m"));
    assert_ne!(read("a/radar.csv"), read("c/radar.csv"));
    // Scans 15-25 of the imager are lost: 40 - 11 frames.
    assert_eq!(std::fs::read_to_string(dir.path().join("a/frames.csv")).unwrap().lines().count(), 1 + 29);
}

#[test]
fn what_is_wrong_is_said_with_its_place() {
    let dir = tempfile::tempdir().unwrap();
    let fail = |line: &str| {
        let out = shell(dir.path(), line);
        assert!(!out.status.success(), "{line}");
        String::from_utf8_lossy(&out.stderr).into_owned()
    };
    run(dir.path(), "boresight simulate ds2 --frames 3 -o again && boresight simulate ds2 --frames 3 -o again");
    // A folder is one run: what the run before made and this one does not is gone.
    run(dir.path(), "boresight simulate ds2 --frames 2 -o again");
    let frames = |n: &str| dir.path().join("again/frames").join(n).exists();
    assert!(frames("frame_000001.png") && !frames("frame_000002.png"));
    run(dir.path(), "boresight simulate ds2 --frames 2 --format pgm -o again");
    assert!(frames("frame_000001.pgm") && !frames("frame_000001.png"));
    assert!(fail("boresight simulate ds9 -o x").contains("ds1, ds2"));
    std::fs::write(dir.path().join("bad.toml"), "[[radars]]\nscan-period-s = 0.0\n").unwrap();
    assert!(fail("boresight simulate bad.toml -o x").contains("scan-period-s"));
    std::fs::write(dir.path().join("t.csv"), "frame,track_id,x,y\n0,1,5,5\n").unwrap();
    assert!(fail("boresight simulate t.csv -o x").contains("--radars"));
    assert!(fail("boresight fuse t.csv t.csv --map-b 1,2,3 -o f.csv").contains("6 or 9 numbers"));
    assert!(fail("boresight fuse t.csv t.csv --map-b affine -o f.csv").contains("--common"));
    assert!(fail("boresight reproduce no-such").contains("items"));
    // A bad row in a table of tracks is an error, and no reason to take its estimates for detections.
    std::fs::write(dir.path().join("bad.csv"), "frame,track_id,x,y\n0,1,5,5\n1,1,6,abc\n").unwrap();
    assert!(fail("boresight fuse bad.csv t.csv -o f.csv").contains("line 3"));
    std::fs::write(dir.path().join("d.csv"), "frame,x,y\n0,5,5\n1,6,abc\n").unwrap();
    assert!(fail("boresight fuse t.csv d.csv -o f.csv").contains("line 3"));
}
