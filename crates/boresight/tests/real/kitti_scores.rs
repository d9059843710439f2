//! Results on KITTI labels score as in TrackEval's KITTI kit, with neighbour classes and DontCare regions.
//! References: `scripts/metrics_reference.py kitti`; the labels are non-commercial and stay outside the repository.

use crate::lcg::Lcg;
use crate::needs::{data, real_tests};
use boresight::io::tracks::{Format, ReadOptions, read as read_table};
use boresight::metrics::hota::mean;
use boresight::metrics::{KittiClass, MatchOptions, Rules, mot_scores, preprocess};
use std::collections::HashMap;
use std::fmt::Write;

real_tests! {
    kitti_results_score_as_in_trackeval needs ["kitti_ab3dmot"];
}

/// A result for KITTI labels: shaken truths, some lost or renamed, and the detections as tracks of 20 frames.
fn result(labels: &str, detections: &str, seed: u64) -> String {
    let mut r = Lcg::new(seed);
    let mut out = String::new();
    let mut line = |frame: i64, id: i64, name: &str, b: [i64; 4]| {
        writeln!(out, "{frame} {id} {name} 0 0 0 {} {} {} {} 1 1 1 0 0 0 0 1", b[0], b[1], b[2], b[3]).unwrap();
    };
    for f in labels.lines().map(|l| l.split_whitespace().collect::<Vec<_>>()) {
        if f[2] == "DontCare" || r.next(10) == 0 {
            continue;
        }
        let b = std::array::from_fn(|k| f[6 + k].parse::<f64>().unwrap().floor() as i64 + r.next(9) - 4);
        let name = if ["Car", "Van", "Truck"].contains(&f[2]) { "Car" } else { "Pedestrian" };
        let frame: i64 = f[0].parse().unwrap();
        line(frame, f[1].parse::<i64>().unwrap() + if frame % 40 > 30 { 100 } else { 0 }, name, b);
    }
    let mut n: HashMap<&str, i64> = HashMap::new();
    for f in detections.lines().map(|l| l.split(',').collect::<Vec<_>>()) {
        let k = n.entry(f[0]).or_default();
        *k += 1;
        let frame: i64 = f[0].parse().unwrap();
        let b = std::array::from_fn(|k| f[2 + k].parse::<f64>().unwrap().floor() as i64);
        line(frame, 1000 + 20 * (frame / 20) + *k, if f[1] == "2" { "Car" } else { "Pedestrian" }, b);
    }
    out
}

fn kitti_results_score_as_in_trackeval() {
    let data = data("kitti_ab3dmot");
    let path = format!("{}/tests/data/metrics_kitti.csv", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').skip(2).collect();
    for line in lines {
        let fields: Vec<&str> = line.split(',').collect();
        let (seq, class) = (fields[0], fields[1]);
        let read = |name: &str| std::fs::read_to_string(data.join(name)).unwrap();
        let labels = read(&format!("{seq}_label.txt"));
        let detections = read(&format!("{seq}_det_Car.txt")) + &read(&format!("{seq}_det_Pedestrian.txt"));
        let folder = tempfile::tempdir().unwrap();
        let (t, r) = (folder.path().join("t.txt"), folder.path().join("r.txt"));
        std::fs::write(&t, &labels).unwrap();
        std::fs::write(&r, result(&labels, &detections, seq.parse().unwrap())).unwrap();
        let of = |path| read_table(path, Some(Format::Kitti), ReadOptions::default(), false).unwrap().table;
        let truth = of(&t);
        let result = of(&r);
        let class = if class == "car" { KittiClass::Car } else { KittiClass::Pedestrian };
        let (truth, result) = preprocess(&truth, &result, Rules::Kitti(class)).unwrap();
        let s = mot_scores(&truth, &result, &MatchOptions::default()).unwrap();
        let ours = [
            s.clear.tp as f64,
            s.clear.fn_ as f64,
            s.clear.fp as f64,
            s.clear.idsw as f64,
            s.clear.frag as f64,
            s.clear.mt as f64,
            s.clear.ml as f64,
            s.clear.mota(),
            s.clear.motp(),
            s.identity.idtp as f64,
            s.identity.idf1(),
            mean(&s.hota.hota()),
            mean(&s.hota.det_a()),
            mean(&s.hota.ass_a),
            mean(&s.hota.loc_a),
        ];
        assert_eq!(names.len(), ours.len());
        for ((name, v), theirs) in names.iter().zip(ours).zip(&fields[2..]) {
            let theirs: f64 = theirs.parse().unwrap();
            assert!(
                (v - theirs).abs() <= 1e-9 * theirs.abs().max(1.0),
                "{seq} {class:?} {name}: {v}, TrackEval {theirs}"
            );
        }
    }
}
