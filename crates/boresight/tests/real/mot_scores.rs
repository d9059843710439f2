//! Scores of published results on MOTChallenge sequences equal those of TrackEval and py-motmetrics, number by number.
//!
//! The data are non-commercial and stay outside the repository; the reference files beside them were made by these tools.

use crate::needs::{data, real_tests};
use boresight::TrackTable;
use boresight::io::tracks::{Format, ReadOptions, read};
use boresight::metrics::hota::{N_ALPHA, mean};
use boresight::metrics::{MatchOptions, MotScores, Rules, clear_classic, mot_scores, preprocess};
use std::collections::HashMap;
use std::path::Path;

real_tests! {
    mot15_with_the_cem_tracker_scores_as_in_trackeval needs ["mot15_text"];
    mot15_with_sort_scores_as_in_trackeval needs ["mot15_text"];
    mot17_with_distractors_scores_as_in_trackeval needs ["mot17_text"];
    the_surveillance_clip_scores_as_in_trackeval_for_both_results needs ["pets09_vtest"];
    mot15_with_the_cem_tracker_scores_as_in_py_motmetrics needs ["mot15_text"];
}

/// A table of MOTChallenge.
fn read_mot(path: &Path) -> TrackTable {
    read(path, Some(Format::Mot), ReadOptions::default(), false).unwrap().table
}

/// Every number of TrackEval's detailed table by its column's name.
fn detailed(s: &MotScores) -> Vec<(String, f64)> {
    let (h, c, i) = (&s.hota, &s.clear, &s.identity);
    let mut out = Vec::new();
    let curves = [
        ("HOTA", h.hota()),
        ("DetA", h.det_a()),
        ("AssA", h.ass_a),
        ("DetRe", h.det_re()),
        ("DetPr", h.det_pr()),
        ("AssRe", h.ass_re),
        ("AssPr", h.ass_pr),
        ("LocA", h.loc_a),
        ("OWTA", h.owta()),
        ("HOTA_TP", h.tp),
        ("HOTA_FN", h.fn_),
        ("HOTA_FP", h.fp),
    ];
    for (name, curve) in curves {
        for a in 0..N_ALPHA {
            out.push((format!("{name}___{}", 5 * (a + 1)), curve[a]));
        }
        out.push((format!("{name}___AUC"), mean(&curve)));
    }
    out.push(("HOTA(0)".into(), h.hota()[0]));
    out.push(("LocA(0)".into(), h.loc_a[0]));
    out.push(("HOTALocA(0)".into(), h.hota()[0] * h.loc_a[0]));
    let clear = [
        ("MOTA", c.mota()),
        ("MOTP", c.motp()),
        ("MODA", c.moda()),
        ("CLR_Re", c.recall()),
        ("CLR_Pr", c.precision()),
        ("MTR", c.mtr()),
        ("PTR", c.ptr()),
        ("MLR", c.mlr()),
        ("sMOTA", c.smota()),
        ("CLR_F1", c.f1()),
        ("FP_per_frame", c.fp_per_frame()),
        ("MOTAL", c.motal()),
        ("MOTP_sum", c.motp_sum),
        ("CLR_TP", c.tp as f64),
        ("CLR_FN", c.fn_ as f64),
        ("CLR_FP", c.fp as f64),
        ("IDSW", c.idsw as f64),
        ("MT", c.mt as f64),
        ("PT", c.pt as f64),
        ("ML", c.ml as f64),
        ("Frag", c.frag as f64),
        ("CLR_Frames", c.frames as f64),
        ("IDF1", i.idf1()),
        ("IDR", i.idr()),
        ("IDP", i.idp()),
        ("IDTP", i.idtp as f64),
        ("IDFN", i.idfn as f64),
        ("IDFP", i.idfp as f64),
        ("Dets", s.n_result_rows as f64),
        ("GT_Dets", s.n_truth_rows as f64),
        ("IDs", s.n_results as f64),
        ("GT_IDs", s.n_truths as f64),
    ];
    out.extend(clear.map(|(n, v)| (n.to_string(), v)));
    out
}

/// The rows of a reference file by sequence.
fn reference(path: &Path) -> HashMap<String, HashMap<String, f64>> {
    let text = std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    lines
        .map(|line| {
            let mut fields = line.split(',');
            let seq = fields.next().unwrap().to_string();
            let values = names[1..].iter().zip(fields).map(|(n, v)| ((*n).to_string(), v.parse().unwrap()));
            (seq, values.collect())
        })
        .collect()
}

fn sequence_length(folder: &Path) -> usize {
    let text = std::fs::read_to_string(folder.join("seqinfo.ini")).unwrap();
    let line = text.lines().find_map(|l| l.strip_prefix("seqLength=")).unwrap();
    line.trim().parse().unwrap()
}

fn score(folder: &Path, result: &str, rules: Rules) -> MotScores {
    let mut truth = read_mot(&folder.join("gt.txt"));
    truth.extend_to(sequence_length(folder));
    let result = read_mot(&folder.join(result));
    let (truth, result) = preprocess(&truth, &result, rules).unwrap();
    mot_scores(&truth, &result, &MatchOptions::default()).unwrap()
}

#[track_caller]
fn compare(ours: &MotScores, reference: &HashMap<String, f64>, what: &str) {
    let mut n = 0;
    for (name, v) in detailed(ours) {
        if let Some(&r) = reference.get(&name) {
            n += 1;
            assert!((v - r).abs() <= 1e-9 * r.abs().max(1.0), "{what} {name}: {v} instead of TrackEval's {r}");
        }
    }
    assert!(n > 250, "{what}: only {n} numbers compared");
}

fn check(set: &str, sequences: &[&str], result: &str, expected: &str, rules: Rules) {
    let data = data("");
    let reference = reference(&data.join(set).join(expected));
    for seq in sequences {
        let scores = score(&data.join(set).join(seq), result, rules);
        let row = reference
            .get(*seq)
            .or_else(|| reference.get(&format!("{seq}-FRCNN")))
            .or_else(|| reference.get("PETS09-S2L1"))
            .unwrap_or_else(|| panic!("{seq}"));
        compare(&scores, row, &format!("{set}/{seq}/{result}"));
    }
}

const MOT15: [&str; 6] = ["ADL-Rundle-6", "ETH-Sunnyday", "KITTI-17", "PETS09-S2L1", "TUD-Campus", "TUD-Stadtmitte"];

fn mot15_with_the_cem_tracker_scores_as_in_trackeval() {
    check("mot15_text", &MOT15, "result_cem.txt", "expected_cem_trackeval_detailed.csv", Rules::Mot15);
}

fn mot15_with_sort_scores_as_in_trackeval() {
    check("mot15_text", &MOT15, "result_sort.txt", "expected_sort_trackeval_detailed.csv", Rules::Mot15);
}

fn mot17_with_distractors_scores_as_in_trackeval() {
    let sequences = ["MOT17-02", "MOT17-05", "MOT17-09"];
    check("mot17_text", &sequences, "result_mott.txt", "expected_pedestrian_detailed.csv", Rules::Mot17);
}

fn the_surveillance_clip_scores_as_in_trackeval_for_both_results() {
    check(
        "pets09_vtest/..",
        &["pets09_vtest"],
        "result_cem.txt",
        "pets09_vtest/expected_cem_trackeval_detailed.csv",
        Rules::Mot15,
    );
    check(
        "pets09_vtest/..",
        &["pets09_vtest"],
        "result_sort.txt",
        "pets09_vtest/expected_sort_trackeval_detailed.csv",
        Rules::Mot15,
    );
}

fn mot15_with_the_cem_tracker_scores_as_in_py_motmetrics() {
    let data = data("mot15_text");
    let reference = reference(&data.join("expected_cem_motmetrics.csv"));
    for seq in MOT15 {
        let mut truth = read_mot(&data.join(seq).join("gt.txt"));
        truth.extend_to(sequence_length(&data.join(seq)));
        let result = read_mot(&data.join(seq).join("result_cem.txt"));
        let (truth, result) = preprocess(&truth, &result, Rules::Mot15).unwrap();
        let c = clear_classic(&truth, &result, &MatchOptions::default()).unwrap();
        let s = mot_scores(&truth, &result, &MatchOptions::default()).unwrap();
        let row = &reference[seq];
        let ours = [
            ("idf1", s.identity.idf1()),
            ("idp", s.identity.idp()),
            ("idr", s.identity.idr()),
            ("num_unique_objects", s.n_truths as f64),
            ("mostly_tracked", c.mostly_tracked as f64),
            ("partially_tracked", c.partially_tracked as f64),
            ("mostly_lost", c.mostly_lost as f64),
            ("num_false_positives", c.false_positives as f64),
            ("num_misses", c.misses as f64),
            ("num_switches", c.switches as f64),
            ("num_fragmentations", c.fragmentations as f64),
            ("mota", c.mota()),
            ("motp", c.motp()),
            ("num_transfer", c.transfers as f64),
            ("num_ascend", c.ascends as f64),
            ("num_migrate", c.migrates as f64),
        ];
        for (name, v) in ours {
            let theirs = row[name];
            assert!((v - theirs).abs() <= 1e-9 * theirs.abs().max(1.0), "{seq} {name}: {v} instead of {theirs}");
        }
    }
}
