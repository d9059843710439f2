//! A thing and its rim: where bright and dark targets are looked for, what touches a clearer one of the other sign belongs to it.
//!
//! Source: our own. A sharpened or compressed image has a dark rim around what is bright, a drone is bright above and dark below: two detections of one thing, of which a tracker makes
//! two tracks. The clearer one stays.
//! Limits: a dark target that flies before a bright one is its rim for that time.

use crate::Detection;

/// Boxes nearer than this touch, px.
const TOUCH_PX: f64 = 1.0;

/// Leaves rims out; keeps its memory.
#[derive(Debug, Default)]
pub(super) struct Rims {
    by_left: Vec<u32>,
    pairs: Vec<(u32, u32)>,
    goes: Vec<bool>,
}

impl Rims {
    /// Takes those out of the detections from `first` on, of which those before `first_dark` are bright, that touch a clearer one of the other sign.
    pub fn leave_out(&mut self, (first, first_dark): (usize, usize), out: &mut Vec<Detection>) {
        let (all, n_bright) = (&out[first..], first_dark - first);
        let right = |d: &Detection| d.extent.left_px + d.extent.width_px + TOUCH_PX;
        self.by_left.clear();
        self.by_left.extend(0..all.len() as u32);
        self.by_left.sort_unstable_by(|a, b| {
            let left = |i: &u32| all[*i as usize].extent.left_px;
            left(a).total_cmp(&left(b)).then(a.cmp(b))
        });
        self.pairs.clear();
        for (k, &i) in self.by_left.iter().enumerate() {
            let a = &all[i as usize];
            for &j in &self.by_left[k + 1..] {
                let b = &all[j as usize];
                if b.extent.left_px > right(a) {
                    break;
                }
                let (top, bottom) = (a.extent.top_px - TOUCH_PX, a.extent.top_px + a.extent.height_px + TOUCH_PX);
                let touches = b.extent.top_px <= bottom && b.extent.top_px + b.extent.height_px >= top;
                if touches && ((i as usize) < n_bright) != ((j as usize) < n_bright) {
                    // The clearer one first; of equals the bright one.
                    let is_clearer = a.score.total_cmp(&b.score).then(j.cmp(&i)).is_gt();
                    self.pairs.push(if is_clearer { (i, j) } else { (j, i) });
                }
            }
        }
        self.pairs.sort_unstable_by(|p, q| {
            let score = |pair: &(u32, u32)| all[pair.0 as usize].score;
            score(q).total_cmp(&score(p)).then(p.cmp(q))
        });
        self.goes.clear();
        self.goes.resize(all.len(), false);
        for &(clearer, other) in &self.pairs {
            self.goes[other as usize] |= !self.goes[clearer as usize];
        }
        let mut k = 0;
        out.retain(|_| {
            k += 1;
            k <= first || !self.goes[k - 1 - first]
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Extent;
    use nalgebra::{Matrix2, Vector2};

    fn boxed(left_px: f64, top_px: f64, side: f64, score: f32) -> Detection {
        let extent = Extent { left_px, top_px, width_px: side, height_px: side };
        Detection::at(Vector2::new(left_px, top_px), Matrix2::identity()).with_extent(extent).with_score(score)
    }

    #[test]
    fn the_clearer_one_of_a_thing_and_its_rim_stays() {
        // Bright: a thing, one that stands alone, and the rim of the rim. Dark: the thing's rim, a thing far away.
        let mut out = vec![boxed(0.0, 0.0, 2.0, 99.0)];
        out.extend([boxed(10.0, 10.0, 6.0, 20.0), boxed(60.0, 10.0, 6.0, 3.0), boxed(23.0, 10.0, 3.0, 2.5)]);
        out.extend([boxed(16.5, 11.0, 6.0, 5.0), boxed(10.0, 40.0, 6.0, 4.0)]);
        Rims::default().leave_out((1, 4), &mut out);
        let scores: Vec<f32> = out.iter().map(|d| d.score).collect();
        assert_eq!(scores, [99.0, 20.0, 3.0, 2.5, 4.0], "what the rim would have hidden stays: the rim is none");
        // Two bright ones that touch are two.
        let mut two = vec![boxed(10.0, 10.0, 6.0, 20.0), boxed(16.0, 10.0, 6.0, 19.0)];
        Rims::default().leave_out((0, 2), &mut two);
        assert_eq!(two.len(), 2);
    }
}
