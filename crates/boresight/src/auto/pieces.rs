//! Whether a detector finds its targets in pieces: several detections of one, side by side.
//!
//! Source: our own. What confirms tracks by probabilities takes false detections for independent of where targets are. Pieces are not: a person in a band of values is a head and two legs. Near each
//! detection, in a box of [`REACH`] of its longer sides around its own place, the others are counted, and what of them lay there if all were anywhere in the field is taken off.
//! Limits: things that keep close to each other, as a swarm does, count as pieces.

use crate::Scan;

/// Half the side of the box in which the pieces of a thing lie, in longer sides of one of them: a piece of the same size lies beside it, with a gap of half its side.
const REACH: f64 = 1.5;
/// Detections that have another piece beside them, of all, up to which they are no pieces: one in fifty.
const MOST: f64 = 0.02;
/// Scans looked at, spread over all: neighbours stay for many scans, so more tell little more.
const MOST_SCANS: usize = 256;

/// Whether the detections of these scans are pieces of things, in a field of that area, px².
pub fn are_pieces(scans: &[Scan], area_px2: f64) -> bool {
    share(scans, area_px2) > MOST
}

/// Other detections near one, on average, beyond those of chance.
fn share(scans: &[Scan], area_px2: f64) -> f64 {
    let (mut n, mut near, mut by_chance) = (0usize, 0usize, 0.0);
    let mut order: Vec<u32> = Vec::new();
    for scan in scans.iter().step_by(scans.len().div_ceil(MOST_SCANS).max(1)) {
        let all = &scan.detections;
        order.clear();
        order.extend(0..all.len() as u32);
        order.sort_by(|a, b| all[*a as usize].position.x.total_cmp(&all[*b as usize].position.x));
        n += all.len();
        for (k, i) in order.iter().enumerate() {
            let d = &all[*i as usize];
            let side = d.extent.width_px.max(d.extent.height_px);
            let reach = REACH * side;
            let off = |j: &u32| all[*j as usize].position - d.position;
            let left = order[..k].iter().rev().take_while(|j| off(j).x >= -reach);
            let right = order[k + 1..].iter().take_while(|j| off(j).x <= reach);
            near += left.chain(right).filter(|j| off(j).y.abs() <= reach).count();
            // Two of a size do not overlap: none has its middle within a side of this one's.
            let box_px2 = 4.0 * (reach * reach - side * side);
            by_chance += (all.len() - 1) as f64 * (box_px2 / area_px2).clamp(0.0, 1.0);
        }
    }
    (near as f64 - by_chance) / n.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Detection, FrameIndex, Timestamp};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const SIDE_PX: f64 = 1000.0;

    /// A hundred scans of `n` things of 8 px anywhere, not upon each other, each of which comes in two pieces with that probability.
    fn scans(n: usize, in_two: f64) -> Vec<Scan> {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        (0..100)
            .map(|k| {
                let mut all: Vec<Detection> = Vec::new();
                for _ in 0..n {
                    let free = |x: f64, y: f64| {
                        all.iter().all(|d| (d.position.x - x).abs() > 8.0 || (d.position.y - y).abs() > 8.0)
                    };
                    let mut place = || (SIDE_PX * rng.random::<f64>(), SIDE_PX * rng.random::<f64>());
                    let (x, y) = std::iter::repeat_with(&mut place).find(|(x, y)| free(*x, *y)).unwrap();
                    let mut piece = |y: f64| {
                        let mut d = Detection::point(x, y, 0.1);
                        (d.extent.width_px, d.extent.height_px) = (5.0, 8.0);
                        all.push(d);
                    };
                    piece(y);
                    if rng.random::<f64>() < in_two {
                        piece(y + 10.0);
                    }
                }
                Scan::at(FrameIndex(k), Timestamp::default()).with_detections(all)
            })
            .collect()
    }

    #[test]
    fn what_lies_anywhere_is_no_piece_and_a_thing_in_two_is() {
        for n in [1, 50, 300] {
            let whole = share(&scans(n, 0.0), SIDE_PX * SIDE_PX);
            // Twelve deviations of the mean of 100 n things of which one in a hundred has a neighbour.
            assert!(whole.abs() < 0.012, "{n}: {whole}");
            // Of a thing in two both pieces have a neighbour.
            let halved = share(&scans(n, 0.25), SIDE_PX * SIDE_PX);
            assert!((halved - 2.0 * 0.25 / 1.25).abs() < 0.05, "{n}: {halved}");
        }
        assert!(!are_pieces(&[], 1.0) && !are_pieces(&scans(0, 0.0), 1.0));
        assert!(are_pieces(&scans(50, 0.1), SIDE_PX * SIDE_PX) && !are_pieces(&scans(50, 0.0), SIDE_PX * SIDE_PX));
    }
}
