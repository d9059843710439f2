//! A thousand small scenes (ties, empty frames, empty results, one frame, ids that swap) score as in TrackEval,
//! py-motmetrics and Stone Soup, and trajectory GOSPA as the paper's linear programme solved by HiGHS. References:
//! `scripts/metrics_reference.py`.

use super::scenes::{compare, reference, scene};
use boresight::TrackTable;
use boresight::metrics::hota::mean;
use boresight::metrics::set::{OspaAssignment, SetDistance, SetOptions};
use boresight::metrics::siap::{nearest_associations, siap};
use boresight::metrics::trajectory_gospa::{TrajectoryOptions, trajectory_gospa};
use boresight::metrics::{MatchOptions, Similarity, clear_classic, mot_scores};

#[test]
fn a_thousand_scenes_score_as_in_trackeval() {
    compare("trackeval", |truth, result| {
        let s = mot_scores(truth, result, &MatchOptions::default()).unwrap();
        let (c, i, h) = (&s.clear, &s.identity, &s.hota);
        vec![
            ("CLR_TP", c.tp as f64),
            ("CLR_FN", c.fn_ as f64),
            ("CLR_FP", c.fp as f64),
            ("IDSW", c.idsw as f64),
            ("MT", c.mt as f64),
            ("PT", c.pt as f64),
            ("ML", c.ml as f64),
            ("Frag", c.frag as f64),
            ("MOTA", c.mota()),
            ("MOTP", c.motp()),
            ("sMOTA", c.smota()),
            ("MOTAL", c.motal()),
            ("MLR", c.mlr()),
            ("IDTP", i.idtp as f64),
            ("IDFN", i.idfn as f64),
            ("IDFP", i.idfp as f64),
            ("IDF1", i.idf1()),
            ("HOTA", mean(&h.hota())),
            ("DetA", mean(&h.det_a())),
            ("AssA", mean(&h.ass_a)),
            ("AssRe", mean(&h.ass_re)),
            ("AssPr", mean(&h.ass_pr)),
            ("LocA", mean(&h.loc_a)),
            ("OWTA", mean(&h.owta())),
            ("HOTA50", h.hota()[9]),
            ("AssA80", h.ass_a[15]),
            ("HOTA(0)", h.hota()[0]),
            ("LocA(0)", h.loc_a[0]),
        ]
    });
}

#[test]
fn a_thousand_scenes_score_as_in_py_motmetrics() {
    compare("motmetrics", |truth, result| {
        let c = clear_classic(truth, result, &MatchOptions::default()).unwrap();
        let i = mot_scores(truth, result, &MatchOptions::default()).unwrap().identity;
        // py-motmetrics divides without a floor: nothing at all is NaN there and 0 in TrackEval.
        let nothing = truth.n_rows() + result.n_rows() == 0;
        vec![
            ("mm_matches", c.matches as f64),
            ("mm_switches", c.switches as f64),
            ("mm_misses", c.misses as f64),
            ("mm_fp", c.false_positives as f64),
            ("mm_frag", c.fragmentations as f64),
            ("mm_mt", c.mostly_tracked as f64),
            ("mm_pt", c.partially_tracked as f64),
            ("mm_ml", c.mostly_lost as f64),
            ("mm_transfer", c.transfers as f64),
            ("mm_ascend", c.ascends as f64),
            ("mm_migrate", c.migrates as f64),
            ("mm_mota", c.mota()),
            ("mm_motp", c.motp()),
            ("mm_idf1", if nothing { f64::NAN } else { i.idf1() }),
        ]
    });
}

fn corners(t: &TrackTable, frame: usize) -> Vec<[f64; 2]> {
    t.boxes[t.rows(frame)].iter().map(|b| [b[0], b[1]]).collect()
}

#[test]
fn a_thousand_scenes_are_as_far_apart_as_in_stone_soup() {
    const NAMES: [[&str; 5]; 3] = [
        ["ospa1", "gospa1", "loc1", "missed1", "false1"],
        ["ospa2", "gospa2", "loc2", "missed2", "false2"],
        ["ospa3", "gospa3", "loc3", "missed3", "false3"],
    ];
    compare("stonesoup", |truth, result| {
        let mut d = SetDistance::default();
        let mut out = Vec::new();
        for (names, (order, cutoff_px)) in NAMES.iter().zip([(1.0, 30.0), (2.0, 12.0), (3.0, 20.0)]) {
            let o = SetOptions { cutoff_px, order, assignment: OspaAssignment::FirstPower };
            let (mut sum, mut used) = ([0.0; 5], 0.0);
            for frame in 0..truth.n_frames() {
                let (t, r) = (corners(truth, frame), corners(result, frame));
                if t.is_empty() && r.is_empty() {
                    continue;
                }
                used += 1.0;
                let g = d.gospa(&t, &r, &o);
                let here = [d.ospa(&t, &r, &o), g.distance, g.localisation, g.missed, g.false_];
                for (s, v) in sum.iter_mut().zip(here) {
                    *s += v;
                }
            }
            out.extend(names.iter().zip(sum).map(|(n, s)| (*n, s / f64::max(used, 1.0))));
        }
        let frames = (0..truth.n_frames()).filter(|&f| !truth.rows(f).is_empty() || !result.rows(f).is_empty()).count();
        let known = truth.n_rows() > 0 && result.n_rows() > 0 && frames > 1;
        let mut a = nearest_associations(truth, result, 15.0, |b| [b[0], b[1]]);
        a.retain(|a| a.last > a.first);
        let s = siap(truth, result, &a, 1.0, |t, r| {
            let (p, q) = (truth.boxes[t], result.boxes[r]);
            ((p[0] - q[0]).hypot(p[1] - q[1]), (p[2] - q[2]).hypot(p[3] - q[3]))
        });
        let v = |x: f64| if known { x } else { f64::NAN };
        out.extend([
            ("siap_c", v(s.completeness)),
            ("siap_a", v(s.ambiguity)),
            ("siap_s", v(s.spuriousness)),
            ("siap_pa", v(s.position_accuracy)),
            ("siap_va", v(s.velocity_accuracy)),
            ("siap_r", v(s.rate_of_track_number_change)),
            ("siap_ls", v(s.longest_track_segment)),
        ]);
        out
    });
}

#[test]
fn a_thousand_scenes_matched_by_centres_score_as_in_trackeval() {
    let options = MatchOptions { similarity: Similarity::Centre { zero_distance_px: 40.0 }, threshold: 0.5 };
    compare("centre", |truth, result| {
        let s = mot_scores(truth, result, &options).unwrap();
        vec![
            ("CLR_TP", s.clear.tp as f64),
            ("IDSW", s.clear.idsw as f64),
            ("Frag", s.clear.frag as f64),
            ("MOTA", s.clear.mota()),
            ("MOTP", s.clear.motp()),
            ("IDF1", s.identity.idf1()),
            ("HOTA", mean(&s.hota.hota())),
            ("DetA", mean(&s.hota.det_a())),
            ("AssA", mean(&s.hota.ass_a)),
            ("LocA", mean(&s.hota.loc_a)),
        ]
    });
}

/// The table with its corners as points, as the reference takes them.
fn corner_points(t: &TrackTable) -> TrackTable {
    let mut t = t.clone();
    t.boxes.iter_mut().for_each(|b| (b[2], b[3]) = (0.0, 0.0));
    t
}

#[test]
#[cfg_attr(not(feature = "trajectory-gospa"), ignore = "needs the feature trajectory-gospa")]
fn a_thousand_scenes_have_the_trajectory_gospa_of_the_papers_programme() {
    let (names, rows) = reference("trajectory");
    assert_eq!((names.len(), rows.len()), (3, 1000));
    for (seed, row) in rows.iter().enumerate() {
        // Each scene with one of the three options in turn: a programme takes some milliseconds.
        let (order, cutoff_px, switch_px) = [(1.0, 20.0, 2.0), (2.0, 30.0, 9.0), (2.0, 12.0, 40.0)][seed % 3];
        let set = SetOptions { cutoff_px, order, ..SetOptions::default() };
        let o = TrajectoryOptions { set, switch_px, ..TrajectoryOptions::default() };
        let (truth, result) = scene(seed as u64);
        let g = trajectory_gospa(&corner_points(&truth), &corner_points(&result), &o).unwrap();
        let r = row[seed % 3];
        assert!((g.distance - r).abs() <= 1e-9 * r.max(1.0), "scene {seed}: {g:?} instead of {r}");
        let sum = g.localisation + g.missed + g.false_ + g.switch;
        assert!((sum - g.distance.powf(order)).abs() <= 1e-9 * sum.max(1.0), "scene {seed}: parts of {g:?}");
    }
}
