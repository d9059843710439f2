//! `boresight sensor`, and frames mended on their way to the detector.

use super::{boresight, read_csv, stderr, stdout};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Poisson, StandardNormal};
use std::collections::HashMap;
use std::path::Path;

const W: usize = 96;
const H: usize = 80;
/// Hot pixels of the sensor.
const HOT: [(usize, usize); 3] = [(20, 30), (70, 11), (45, 60)];

/// 16-bit frames as PGM: shaded light of 20 to 200 electrons if there is any, gain 3, offset 50, read noise 4 counts, hot pixels, a spot of 400 electrons.
fn write(dir: &Path, n: usize, light: bool, seed: u64) {
    std::fs::create_dir_all(dir).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    for k in 0..n {
        let mut bytes = format!("P5\n{W} {H}\n65535\n").into_bytes();
        for i in 0..W * H {
            let (x, y) = (i % W, i / W);
            let d2 = (x as f64 - 15.0 - 0.8 * k as f64).powi(2) + (y as f64 - 45.0).powi(2);
            let mean = if light { 20.0 + 1.8 * x as f64 + 400.0 * (-d2 / 4.0).exp() } else { 0.0 };
            let electrons: f64 = if mean > 0.0 { Poisson::new(mean).unwrap().sample(&mut rng) } else { 0.0 };
            let hot = if HOT.contains(&(x, y)) { 900.0 } else { 0.0 };
            let v = 50.0 + 3.0 * electrons + hot + 4.0 * rng.sample::<f64, _>(StandardNormal);
            bytes.extend((v.round().clamp(0.0, 65535.0) as u16).to_be_bytes());
        }
        std::fs::write(dir.join(format!("{k:03}.pgm")), bytes).unwrap();
    }
}

fn number_after(text: &str, word: &str) -> f64 {
    let rest = text.split(word).nth(1).unwrap_or_else(|| panic!("{word} in {text}"));
    rest.split(|c: char| !(c.is_ascii_digit() || c == '.' || c == '-'))
        .find(|t| !t.is_empty())
        .unwrap()
        .parse()
        .unwrap()
}

#[test]
fn gain_offset_read_noise_and_hot_pixels_put_in_come_out_and_the_options_are_accepted() {
    let dir = tempfile::tempdir().unwrap();
    write(&dir.path().join("light"), 40, true, 1);
    write(&dir.path().join("dark"), 20, false, 2);
    let out = boresight().current_dir(dir.path()).args(["sensor", "light", "--dark", "dark"]).output().unwrap();
    assert!(out.status.success(), "{}", stderr(&out));
    let text = stdout(&out);
    assert!((number_after(&text, "read-counts=") - 4.0).abs() < 0.2, "{text}");
    assert!((number_after(&text, "gain=") - 3.0).abs() < 0.15, "{text}");
    // Hot pixels lie 900 counts above the others: three of 7680 lift the mean by 0.35.
    assert!((number_after(&text, "offset-counts=") - 50.0).abs() < 0.5, "{text}");
    assert!(text.contains("3 bad pixels in the dark frames: (70, 11) (20, 30) (45, 60)"), "{text}");
    let page = std::fs::read_to_string(dir.path().join("light.sensor.html")).unwrap();
    assert!(
        page.contains("<svg") && page.matches("<circle").count() > 10 && page.contains("read-counts="),
        "{page:.400}"
    );
    // What it prints is taken as it stands.
    let options: Vec<String> = text
        .lines()
        .find_map(|l| l.strip_prefix("options: "))
        .unwrap()
        .split("--set ")
        .filter(|o| !o.is_empty())
        .map(|o| o.trim().trim_matches('\'').to_string())
        .collect();
    let mut track = boresight();
    track.current_dir(dir.path()).args([
        "track",
        "light",
        "--dark",
        "dark",
        "-o",
        "out",
        "--no-video",
        "--rate-hz",
        "10",
    ]);
    for o in &options {
        track.args(["--set", o]);
    }
    let out = track.args(["--set", "detector.centroid.fit={}"]).output().unwrap();
    assert!(out.status.success(), "{}", stderr(&out));
    let config = std::fs::read_to_string(dir.path().join("out/config.toml")).unwrap();
    assert!(config.contains("bad-pixels = true") && config.contains("dark = \"dark\""), "{config}");
    assert!(stderr(&out).contains("positions by fitted spots"), "{}", stderr(&out));
    // The spot is tracked, the hot pixels are not detected.
    let rows = read_csv(&dir.path().join("out/detections.csv"));
    let value = |r: &HashMap<String, String>, name: &str| r[name].parse::<f64>().unwrap();
    let near = |r: &HashMap<String, String>, x: f64, y: f64| (value(r, "x_px") - x).hypot(value(r, "y_px") - y) < 1.5;
    let spot = rows.iter().filter(|r| near(r, 15.0 + 0.8 * value(r, "frame"), 45.0)).count();
    assert!(spot > 35, "{spot} of {}", rows.len());
    let hot = rows.iter().filter(|r| HOT.iter().any(|(x, y)| near(r, *x as f64, *y as f64))).count();
    assert_eq!(hot, 0);
}

#[test]
fn what_cannot_be_measured_or_mended_is_said() {
    let dir = tempfile::tempdir().unwrap();
    write(&dir.path().join("one"), 1, true, 3);
    std::fs::create_dir(dir.path().join("small")).unwrap();
    std::fs::write(
        dir.path().join("small/0.pgm"),
        b"P5\n8 8\n255\n0123456701234567012345670123456701234567012345670123456701234567",
    )
    .unwrap();
    let out = boresight().current_dir(dir.path()).args(["sensor", "one"]).output().unwrap();
    assert!(!out.status.success() && stderr(&out).contains("show too little"), "{}", stderr(&out));
    let out = boresight().current_dir(dir.path()).args(["detect", "one", "--dark", "small"]).output().unwrap();
    assert!(!out.status.success() && stderr(&out).contains("input.sensor.dark"), "{}", stderr(&out));
    let out = boresight().current_dir(dir.path()).args(["detect", "one", "--flat", "nothing-there"]).output().unwrap();
    assert!(!out.status.success() && stderr(&out).contains("input.sensor.flat"), "{}", stderr(&out));
}

#[test]
fn of_a_clip_whose_codec_copies_nothing_is_claimed() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::create_dir(dir.path().join("copies")).unwrap();
    // One picture of a few counts' texture, twenty times.
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let mut bytes = format!("P5\n{W} {H}\n255\n").into_bytes();
    bytes.extend((0..W * H).map(|_| rng.random_range(60..64u8)));
    for k in 0..20 {
        std::fs::write(dir.path().join(format!("copies/{k}.pgm")), &bytes).unwrap();
    }
    let out = boresight().current_dir(dir.path()).args(["sensor", "copies"]).output().unwrap();
    assert!(out.status.success(), "{}", stderr(&out));
    let text = stdout(&out);
    assert!(
        text.contains("below the rounding") && text.contains("not looked for") && !text.contains("options"),
        "{text}"
    );
}
