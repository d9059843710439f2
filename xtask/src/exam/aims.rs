//! What the exam aims at, beside what was reached on either half, by how much it was missed, and why.
//!
//! Each aim is one figure of some kinds of clips; where an aim says "each", it is that of the worst clip.

use super::clips::Clip;
use super::score::{Score, mean};
use std::fmt::Write as _;

type Done<'a> = &'a (Clip, char, Score);

/// What a figure must be.
#[derive(Clone, Copy)]
enum Goal {
    AtLeast(f64),
    Below(f64),
    /// No more and no less, to the digit that is printed.
    One,
}

impl Goal {
    /// How far a figure lies on the wrong side; none where it is reached.
    fn missed_by(self, v: f64) -> Option<f64> {
        match self {
            Self::AtLeast(least) => (v < least).then_some(least - v),
            Self::Below(limit) => (v >= limit).then_some(v - limit),
            Self::One => (v > 1.0).then_some(v - 1.0),
        }
    }
}

struct Aim {
    what: &'static str,
    goal: Goal,
    /// Digits behind the point, and the unit behind the figure.
    digits: usize,
    unit: &'static str,
    /// Whether a clip counts.
    of: fn(&Clip) -> bool,
    figure: fn(&[Done<'_>]) -> Option<f64>,
    /// Why it is missed, where it is.
    why: &'static str,
}

fn contrast_above_3(c: &Clip) -> bool {
    c.kind == "infrared" && c.contrast.is_none_or(|c| c > 3.0)
}

fn is_one_of(kinds: &[&str], c: &Clip) -> bool {
    kinds.contains(&c.kind)
}

fn steady(c: &Clip) -> bool {
    c.kind.starts_with("simulated: pan")
        || is_one_of(&["simulated: shake 2.5", "simulated: turn 1 deg", "simulated: zoom 1 %"], c)
}

fn percents(values: impl Iterator<Item = f64>) -> Option<f64> {
    mean(values).map(|v| 100.0 * v)
}

fn least(values: impl Iterator<Item = f64>) -> Option<f64> {
    values.min_by(f64::total_cmp)
}

fn held(done: &[Done<'_>]) -> Option<f64> {
    percents(done.iter().map(|d| d.2.held))
}

fn least_held(done: &[Done<'_>]) -> Option<f64> {
    least(done.iter().map(|d| 100.0 * d.2.held))
}

fn held_long(done: &[Done<'_>]) -> Option<f64> {
    percents(done.iter().filter_map(|d| d.2.held_long))
}

fn precision(done: &[Done<'_>]) -> Option<f64> {
    percents(done.iter().filter_map(|d| d.2.precision))
}

fn idf1(done: &[Done<'_>]) -> Option<f64> {
    percents(done.iter().filter_map(|d| d.2.idf1))
}

fn least_idf1(done: &[Done<'_>]) -> Option<f64> {
    least(done.iter().filter_map(|d| Some(100.0 * d.2.idf1?)))
}

fn most_ids(done: &[Done<'_>]) -> Option<f64> {
    done.iter().map(|d| d.2.ids_a_target).max_by(f64::total_cmp)
}

fn found(done: &[Done<'_>]) -> Option<f64> {
    least(done.iter().map(|d| 20.0 * d.2.found[0] as f64 / d.2.found[1] as f64))
}

fn n_false(done: &[Done<'_>]) -> usize {
    done.iter().filter_map(|d| Some(d.2.false_tracks.as_ref()?.len())).sum()
}

fn false_tracks(done: &[Done<'_>]) -> Option<f64> {
    (!done.is_empty()).then(|| n_false(done) as f64)
}

fn false_a_minute(done: &[Done<'_>]) -> Option<f64> {
    (!done.is_empty()).then(|| n_false(done) as f64 / done.iter().map(|d| d.2.minutes).sum::<f64>())
}

fn honest(done: &[Done<'_>]) -> Option<f64> {
    percents(done.iter().map(|d| f64::from(u8::from((1.6..=2.4).contains(&d.2.nis)))))
}

const AIMS: [Aim; 14] = [
    Aim {
        what: "infrared, contrast > 3: held",
        goal: Goal::AtLeast(95.0),
        digits: 1,
        unit: " %",
        of: contrast_above_3,
        figure: held,
        why: "",
    },
    Aim {
        what: "infrared: false tracks a minute",
        goal: Goal::Below(0.5),
        digits: 2,
        unit: "",
        of: |c| c.kind == "infrared",
        figure: false_a_minute,
        why: "two tracks on each half, of 2.7 minutes: one more than the aim allows. Two are birds or insects that the truth leaves out (DRONE_131, DRONE_143), one is glitter \
              on water (HELICOPTER_051), one a thing that moves along the lower edge in the dimmest clip (HELICOPTER_049)",
    },
    Aim {
        what: "infrared, a minute: IDF1, each",
        goal: Goal::AtLeast(90.0),
        digits: 1,
        unit: " %",
        of: |c| c.kind == "infrared, a minute",
        figure: least_idf1,
        why: "other small things that fly by are tracked as well and their rows count as false; A's drone has another id in its last 64 of 1500 frames",
    },
    Aim {
        what: "visible, flying: held",
        goal: Goal::AtLeast(90.0),
        digits: 1,
        unit: " %",
        of: |c| c.kind == "visible, flying",
        figure: held,
        why: "",
    },
    Aim {
        what: "visible, flying: precision",
        goal: Goal::AtLeast(90.0),
        digits: 1,
        unit: " %",
        of: |c| c.kind == "visible, flying",
        figure: precision,
        why: "",
    },
    Aim {
        what: "vtest.avi: IDF1",
        goal: Goal::AtLeast(87.0),
        digits: 1,
        unit: " %",
        of: |c| c.name.contains("vtest"),
        figure: idf1,
        why: "whether two people who pass each other keep their ids decides: over twelve settings of thresholds, distances, areas and memory it is 83 % in the mean, 80 to 87",
    },
    Aim {
        what: "bulk water: held of trajectories > 20 frames",
        goal: Goal::AtLeast(90.0),
        digits: 1,
        unit: " %",
        of: |c| c.kind == "particles",
        figure: held_long,
        why: "",
    },
    Aim {
        what: "cells: held",
        goal: Goal::AtLeast(90.0),
        digits: 1,
        unit: " %",
        of: |c| c.kind == "cells",
        figure: held,
        why: "three of the 25 cells are dim: after the mean of 5 x 5 their middle stands 2 to 6 deviations above the ground, and detection begins at 5; two of them are never found, one in 7 of 24 frames",
    },
    Aim {
        what: "mouse: held by one id (IDF1)",
        goal: Goal::AtLeast(90.0),
        digits: 1,
        unit: " %",
        of: |c| c.kind == "animal",
        figure: idf1,
        why: "",
    },
    Aim {
        what: "spots of SNR 5: tracked of 20",
        goal: Goal::AtLeast(20.0),
        digits: 0,
        unit: "",
        of: |c| c.kind == "simulated: spots of SNR 5",
        figure: found,
        why: "",
    },
    Aim {
        what: "spots of SNR 5: false tracks",
        goal: Goal::Below(1.0),
        digits: 0,
        unit: "",
        of: |c| c.kind == "simulated: spots of SNR 5",
        figure: false_tracks,
        why: "",
    },
    Aim {
        what: "pans, shake, turn 1, zoom 1: held, each",
        goal: Goal::AtLeast(90.0),
        digits: 1,
        unit: " %",
        of: steady,
        figure: least_held,
        why: "",
    },
    Aim {
        what: "pans, shake, turn 1, zoom 1: ids a target, each",
        goal: Goal::One,
        digits: 1,
        unit: "",
        of: steady,
        figure: most_ids,
        why: "pan 10, seed 1: the camera's motion is not yet known in the first three frames; where it is, two tracks begun in them are lost and found again as others",
    },
    Aim {
        what: "NIS within 1.6 to 2.4, of all clips",
        goal: Goal::AtLeast(80.0),
        digits: 0,
        unit: " %",
        of: |_| true,
        figure: honest,
        why: "",
    },
];

/// One line of the table.
fn line(aim: &Aim, done: &[(Clip, char, Score)]) -> Option<String> {
    let of_half = |half: char| (aim.figure)(&done.iter().filter(|d| d.1 == half && (aim.of)(&d.0)).collect::<Vec<_>>());
    let figures = ['A', 'B'].map(of_half);
    let show = |v: f64| format!("{v:.*}{}", aim.digits, aim.unit);
    let goal = match aim.goal {
        Goal::AtLeast(v) => format!(">= {}", show(v)),
        Goal::Below(v) => format!("< {}", show(v)),
        Goal::One => "1".into(),
    };
    // A figure is judged as it is printed.
    let printed = |v: f64| show(v).trim_end_matches(aim.unit).parse().unwrap_or(v);
    let missed = figures.map(|f| f.and_then(|v| aim.goal.missed_by(printed(v))));
    if figures == [None; 2] {
        return None;
    }
    let [a, b] = figures.map(|f| f.map_or("-".into(), show));
    let by: Vec<String> =
        ['A', 'B'].iter().zip(missed).filter_map(|(half, m)| Some(format!("{half} by {}", show(m?)))).collect();
    let verdict = if by.is_empty() { "reached".into() } else { format!("**missed**: {}", by.join(", ")) };
    let why = if by.is_empty() { "" } else { aim.why };
    Some(format!("| {} | {goal} | {a} | {b} | {verdict} | {why} |\n", aim.what))
}

/// The table as Markdown; `n_above` of `n_compared` tables of detections are above SORT in all three.
pub fn table(done: &[(Clip, char, Score)], n_above: usize, n_compared: usize) -> String {
    let mut out = String::from(
        "## Aims\n\nWhat was aimed at, without options and on both halves. Where an aim says \"each\", the figure is that of the worst clip.\n\n\
         | aim | | A | B | | why, where it is missed |\n| --- | --- | --- | --- | --- | --- |\n",
    );
    out.extend(AIMS.iter().filter_map(|aim| line(aim, done)));
    if n_compared > 0 {
        let missed = N_ABOVE.saturating_sub(n_above);
        let (verdict, why) =
            if missed == 0 { ("reached".to_string(), "") } else { (format!("**missed** by {missed}"), TABLES_WHY) };
        let _ = writeln!(
            out,
            "| tables of detections: above SORT in HOTA, IDF1 and MOTA | >= {N_ABOVE} of 9 | {n_above} of {n_compared} | | {verdict} | {why} |"
        );
    }
    out
}

/// Sequences on which SORT's three figures are to be passed.
const N_ABOVE: usize = 8;
const TABLES_WHY: &str =
    "each of the three others lies below in one figure: MOTA of ADL-Rundle-6 and ETH-Sunnyday, IDF1 of TUD-Stadtmitte";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_aim_is_missed_by_what_is_lacking_and_reached_at_its_bound() {
        assert_eq!(Goal::AtLeast(90.0).missed_by(90.0), None);
        assert_eq!(Goal::AtLeast(90.0).missed_by(88.0), Some(2.0));
        assert_eq!(Goal::Below(0.5).missed_by(0.5), Some(0.0));
        assert_eq!(Goal::Below(0.5).missed_by(0.49), None);
        assert_eq!(Goal::One.missed_by(1.0), None);
        assert!(Goal::One.missed_by(1.5).is_some());
    }
}
