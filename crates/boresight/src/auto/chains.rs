//! Chains: detections of scans in the order of time that one target explains and chance does not.
//!
//! Source: our own. A chain begins with two detections of neighbouring scans and goes on with the nearest detection within the gate of
//! a constant-velocity filter, one scan without any being allowed. It gains, in nats, the logarithm of what its detections are likelier as one target's than
//! as clutter of the density λ that the scans have there; the first step costs what a neighbour as near costs by chance, so no largest speed is assumed. Of chains that share a
//! detection the one that gains most counts. It moves if its ends lie apart beyond their covariances.
//! Symbols: λ detections per px² and scan, of [`Density`]; S innovation variance per axis, px²; r length of the first step, px.
//! Limits: the [`super::sightings::MOST_A_SCAN`] strongest detections of a scan; targets that overtake their own velocity within [`TURN_S`] are lost to it.

use super::sighting_density::Density;
use super::sightings::{Sighting, Sightings};
use crate::tempo::Tempo;
use nalgebra::Vector2;

/// Within this time a target may change its velocity by as much as it is, s of video.
const TURN_S: f64 = 1.0;
/// χ² with 2 degrees of freedom: a true detection in a thousand lies outside.
const GATE: f64 = 13.8;
/// χ² with 2 degrees of freedom: a thing at rest in ten thousand seems to have moved as far.
const MOVED: f64 = 18.4;
/// Cost of a first step, nats, up to which a chain begins: some seven neighbours as near by chance.
const MOST_FIRST_COST: f64 = 2.0;
/// Detections of the shortest chain.
const LEAST_HITS: usize = 3;
/// Chains of clutter that are expected in all scans together, at most: e to the minus gain.
const FALSE_CHAINS: f64 = 0.01;

/// A chain that was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Chain {
    /// Scan and place of each of its detections.
    pub hits: Vec<(usize, Sighting)>,
    /// What it gains, nats.
    pub gain: f64,
    /// Speeds of its steps, px/s.
    pub speeds_px_per_s: Vec<f64>,
    /// Whether it moves.
    pub moves: bool,
}

impl Chain {
    /// From its first detection to its last one, px.
    pub fn way_px(&self) -> Vector2<f64> {
        self.hits.last().zip(self.hits.first()).map_or(Vector2::zeros(), |(b, a)| b.1.at - a.1.at)
    }

    /// Whether its way may be that one, px, by the covariances of its ends.
    pub fn may_go_by(&self, way_px: Vector2<f64>) -> bool {
        let ends = self.hits.last().zip(self.hits.first());
        ends.is_some_and(|(b, a)| (b.1.at - a.1.at - way_px).norm_squared() <= MOVED * (a.1.variance + b.1.variance))
    }

    /// Whether it goes with another one, as a thing's edge or shadow goes with the thing: in most of the scans with both they touch.
    pub fn goes_with(&self, other: &Self) -> bool {
        let (mut both, mut near) = (0usize, 0usize);
        for (k, a) in &self.hits {
            if let Some((_, b)) = other.hits.iter().find(|h| h.0 == *k) {
                both += 1;
                near += usize::from(a.touches(b));
            }
        }
        2 * near > both
    }
}

/// Scan and number of a detection of a chain, and the place of the one before it among all that were taken.
type Taken = (usize, usize, Option<usize>);

/// A sighting, when it was, and how dense such are where it lies, per px² and scan.
struct Place {
    time_s: f64,
    seen: Sighting,
    density: f64,
}

impl Place {
    /// Squared distance of the farthest neighbour with which a chain begins, px².
    fn reach2(&self) -> f64 {
        MOST_FIRST_COST.exp() / (std::f64::consts::PI * self.density)
    }
}

/// A chain that may go on: place and velocity with the covariance of one axis (the axes are alike).
struct Open {
    /// Its last detection among all that were taken: most chains end with their second, and need no memory of their own.
    last: usize,
    n_hits: usize,
    at: Vector2<f64>,
    velocity: Vector2<f64>,
    /// Variance of the place (px²), covariance (px²/s), variance of the velocity (px²/s²).
    p: [f64; 3],
    time_s: f64,
    gain: f64,
    missed: bool,
}

impl Open {
    /// From two sightings with these numbers; none if chance gives many as near as the second, from that squared distance on.
    fn begin(
        at: [(usize, usize); 2],
        [first, second]: [&Place; 2],
        farthest2: f64,
        taken: &mut Vec<Taken>,
    ) -> Option<Self> {
        let (a, b) = (first.seen, second.seen);
        let dt = second.time_s - first.time_s;
        let step = b.at - a.at;
        // What a neighbour as near, or one within the errors, costs by chance.
        let reach2 = step.norm_squared() + a.variance + b.variance;
        if !(dt > 0.0 && reach2 < farthest2) {
            return None;
        }
        let gain = -(first.density * std::f64::consts::PI * reach2).ln();
        let p = [b.variance, b.variance / dt, (a.variance + b.variance) / (dt * dt)];
        let [(k, i), (l, j)] = at;
        taken.extend([(k, i, None), (l, j, Some(taken.len()))]);
        let last = taken.len() - 1;
        Some(Self { last, n_hits: 2, at: b.at, velocity: step / dt, p, time_s: second.time_s, gain, missed: false })
    }

    /// Scan and number of its detections, in the order of time.
    fn hits(&self, taken: &[Taken]) -> Vec<(usize, usize)> {
        let mut out = Vec::with_capacity(self.n_hits);
        let mut at = Some(self.last);
        while let Some(&(k, i, before)) = at.and_then(|at| taken.get(at)) {
            out.push((k, i));
            at = before;
        }
        out.reverse();
        out
    }

    fn predict(&mut self, time_s: f64, turn_s: f64) {
        let dt = time_s - self.time_s;
        let q = self.velocity.norm_squared() / turn_s;
        let [a, b, c] = self.p;
        self.at += self.velocity * dt;
        self.p = [a + 2.0 * dt * b + dt * dt * c + q * dt.powi(3) / 3.0, b + dt * c + q * dt * dt / 2.0, c + q * dt];
        self.time_s = time_s;
    }

    /// Takes a sighting whose d² and S are known.
    fn update(&mut self, s: &Place, d2: f64, variance: f64) {
        let gain = [self.p[0] / variance, self.p[1] / variance];
        let innovation = s.seen.at - self.at;
        self.at += innovation * gain[0];
        self.velocity += innovation * gain[1];
        let [a, b, c] = self.p;
        self.p = [a - gain[0] * a, b - gain[0] * b, c - gain[1] * b];
        self.gain += -0.5 * d2 - (std::f64::consts::TAU * variance * s.density).ln();
        self.missed = false;
    }
}

/// Scans looked at for chains, in any order of their times: what is known of each sighting whatever the order.
pub struct Field<'a> {
    scans: &'a [Sightings],
    /// [`TURN_S`] in the tempo of the scans, s.
    turn_s: f64,
    /// Of each sighting of each scan, where it lies: sightings per px² and scan.
    density: Vec<Vec<f64>>,
    /// Each scan's sightings by x, px.
    by_x: Vec<Vec<(f64, usize)>>,
    /// The largest variance of each scan, px².
    widest: Vec<f64>,
}

impl<'a> Field<'a> {
    /// Of scans in a field of that area, px².
    pub fn new(scans: &'a [Sightings], area_px2: f64) -> Self {
        let map = Density::of(scans, area_px2);
        Self {
            scans,
            turn_s: Tempo::of_times(scans.iter().map(|s| s.time_s)).stretched(TURN_S),
            density: scans.iter().map(|s| s.all.iter().map(|s| map.at(s.at)).collect()).collect(),
            by_x: scans.iter().map(sorted).collect(),
            widest: scans.iter().map(|s| s.all.iter().map(|s| s.variance).fold(0.0, f64::max)).collect(),
        }
    }

    /// All chains, none sharing a detection with another, if the scan at each place is that of this number; times stay.
    pub fn chains(&self, order: &[usize]) -> Vec<Chain> {
        let n_all: usize = self.scans.iter().map(|s| s.all.len()).sum();
        let place = |(k, i): (usize, usize)| Place {
            time_s: self.scans[k].time_s,
            seen: self.scans[order[k]].all[i],
            density: self.density[order[k]][i],
        };
        // As many starts as there are detections; each may be of clutter.
        let start = -(n_all.max(1) as f64 / FALSE_CHAINS).ln();
        let (mut open, mut next, mut done) = (Vec::<Open>::new(), Vec::new(), Vec::new());
        let mut taken: Vec<Taken> = Vec::new();
        for k in 1..self.scans.len() {
            let (now, by_x, widest) = (&self.scans[order[k]].all, &self.by_x[order[k]], self.widest[order[k]]);
            for mut c in open.drain(..) {
                c.predict(self.scans[k].time_s, self.turn_s);
                let far = (GATE * (c.p[0] + widest)).sqrt();
                let from = by_x.partition_point(|e| e.0 < c.at.x - far);
                let mut best: Option<(f64, f64, usize)> = None;
                for &(_, i) in by_x[from..].iter().take_while(|e| e.0 <= c.at.x + far) {
                    let s = &now[i];
                    if (s.at.y - c.at.y).abs() > far {
                        continue;
                    }
                    let variance = c.p[0] + s.variance;
                    let d2 = (s.at - c.at).norm_squared() / variance;
                    if d2 > GATE {
                        continue;
                    }
                    let cost = d2 + 2.0 * variance.ln();
                    if best.is_none_or(|b| cost < b.0 + 2.0 * b.1.ln()) {
                        best = Some((d2, variance, i));
                    }
                }
                match best {
                    Some((d2, variance, i)) => {
                        c.update(&place((k, i)), d2, variance);
                        taken.push((k, i, Some(c.last)));
                        (c.last, c.n_hits) = (taken.len() - 1, c.n_hits + 1);
                        next.push(c);
                    }
                    None if c.n_hits < LEAST_HITS => {}
                    None if c.missed => done.push(c),
                    None => {
                        c.missed = true;
                        next.push(c);
                    }
                }
            }
            for i in 0..self.scans[order[k - 1]].all.len() {
                let first = place((k - 1, i));
                let far2 = first.reach2();
                let far = far2.sqrt();
                let from = by_x.partition_point(|e| e.0 < first.seen.at.x - far);
                for &(_, j) in by_x[from..].iter().take_while(|e| e.0 <= first.seen.at.x + far) {
                    if (now[j].at.y - first.seen.at.y).abs() <= far {
                        next.extend(Open::begin([(k - 1, i), (k, j)], [&first, &place((k, j))], far2, &mut taken));
                    }
                }
            }
            std::mem::swap(&mut open, &mut next);
        }
        done.append(&mut open);
        done.retain(|c| c.n_hits >= LEAST_HITS && c.gain + start > 0.0);
        let mut done: Vec<_> = done.into_iter().map(|c| (c.gain, c.hits(&taken))).collect();
        done.sort_by(|a, b| b.0.total_cmp(&a.0).then_with(|| a.1.cmp(&b.1)));
        let mut used: Vec<Vec<bool>> = order.iter().map(|&from| vec![false; self.scans[from].all.len()]).collect();
        let mut out = Vec::new();
        for (gain, hits) in done {
            if hits.iter().any(|h| used[h.0][h.1]) {
                continue;
            }
            hits.iter().for_each(|h| used[h.0][h.1] = true);
            let hits: Vec<(usize, Sighting)> = hits.into_iter().map(|h| (h.0, place(h).seen)).collect();
            let speed = |w: &[(usize, Sighting)]| {
                (w[1].1.at - w[0].1.at).norm() / (self.scans[w[1].0].time_s - self.scans[w[0].0].time_s)
            };
            let speeds_px_per_s = hits.windows(2).map(speed).collect();
            let chain = Chain { gain: gain + start, speeds_px_per_s, moves: false, hits };
            out.push(Chain { moves: !chain.may_go_by(Vector2::zeros()), ..chain });
        }
        out
    }
}

fn sorted(s: &Sightings) -> Vec<(f64, usize)> {
    let mut v: Vec<(f64, usize)> = s.all.iter().enumerate().map(|(i, s)| (s.at.x, i)).collect();
    v.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    v
}
