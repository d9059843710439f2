//! What is drawn as a whole: lines of text, and the ground of their boxes.

use super::{BESIDE, CONTRAST, DENSE, GAP, LETTER, Look, STILL};

impl Look {
    /// Fills the rectangles around lines of text: what is left of a digit changes as the digit does.
    pub(super) fn fill_text(&self, drawn: &mut [bool]) {
        let mut left = drawn.to_vec();
        let mut text = Vec::new();
        for start in 0..drawn.len() {
            if !std::mem::take(&mut left[start]) {
                continue;
            }
            text.clear();
            text.push(start);
            self.join(&mut text, &mut left, GAP * self.s);
            let (mut x, mut y) = ([self.w, 0], [self.h, 0]);
            for i in &text {
                x = [x[0].min(i % self.w), x[1].max(i % self.w)];
                y = [y[0].min(i / self.w), y[1].max(i / self.w)];
            }
            let [width, height] = [x, y].map(|v| v[1] + 1 - v[0]);
            // A single letter, or a line of them; not the square that is drawn around a target.
            let is_line =
                height <= 2 * BESIDE * self.s && (width >= 2 * height || width.max(height) <= LETTER * self.s);
            if is_line && text.len() as f64 >= DENSE * (width * height) as f64 {
                (y[0]..=y[1]).for_each(|y| drawn[y * self.w + x[0]..=y * self.w + x[1]].fill(true));
            }
        }
    }

    /// Fills what drawn pixels enclose and what stands as they do: the ground of a box between two words, but nothing that a drawn frame is laid around.
    pub(super) fn fill_quiet(&self, drawn: &mut [bool]) {
        let most = (BESIDE * self.s).pow(2);
        let mut seen = drawn.to_vec();
        let mut region = Vec::new();
        for start in self.inner(1) {
            if seen[start] {
                continue;
            }
            region.clear();
            region.push(start);
            seen[start] = true;
            let (mut next, mut enclosed) = (0, true);
            while let Some(i) = region.get(next).copied() {
                next += 1;
                let (x, y) = (i % self.w, i / self.w);
                if x == 0 || y == 0 || x + 1 == self.w || y + 1 == self.h {
                    enclosed = false;
                    continue;
                }
                // Large regions are walked through once as well, so that none of their pixels begins another.
                let beside = [i - 1, i + 1, i - self.w, i + self.w];
                region.extend(beside.into_iter().filter(|j| !std::mem::replace(&mut seen[*j], true)));
            }
            if enclosed && region.len() <= most && region.iter().all(|i| self.deviation[*i] <= STILL * CONTRAST) {
                region.iter().for_each(|i| drawn[*i] = true);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const W: usize = 60;
    const H: usize = 40;

    /// A frame in which nothing changes but where said.
    fn look(changes: impl Fn(usize, usize) -> bool) -> Look {
        let samples: Vec<Vec<u8>> =
            (0..4).map(|k| (0..W * H).map(|i| if changes(i % W, i / W) { 60 * k } else { 20 }).collect()).collect();
        Look::of(&samples.iter().map(Vec::as_slice).collect::<Vec<_>>(), W, H)
    }

    fn drawn(places: impl Fn(usize, usize) -> bool) -> Vec<bool> {
        (0..W * H).map(|i| places(i % W, i / W)).collect()
    }

    #[test]
    fn a_line_of_text_is_filled_and_a_cross_and_a_high_wall_are_not() {
        let look = look(|_, _| false);
        let filled = |places: &dyn Fn(usize, usize) -> bool| {
            let (before, mut after) = (drawn(places), drawn(places));
            look.fill_text(&mut after);
            after.iter().filter(|d| **d).count() - before.iter().filter(|d| **d).count()
        };
        // Bars of two pixels with gaps of two, eight high.
        assert_eq!(filled(&|x, y| (10..30).contains(&x) && (5..13).contains(&y) && x % 4 < 2), 5 * 16 - 16);
        assert_eq!(filled(&|x, y| (x == 20 && y < 24) || (y == 12 && (8..33).contains(&x))), 0, "a cross");
        assert_eq!(filled(&|x, y| (10..30).contains(&x) && (5..35).contains(&y) && x % 4 < 2), 0, "too high");
        let gate = |x: usize, y: usize| (10..30).contains(&x) && (10..30).contains(&y);
        let gate = move |x: usize, y: usize| gate(x, y) && !((13..27).contains(&x) && (13..27).contains(&y));
        assert_eq!(filled(&gate), 0, "a target's square");
    }

    #[test]
    fn what_is_enclosed_is_filled_only_where_it_stands() {
        let frame = |x: usize, y: usize| (10..=18).contains(&x) && (10..=18).contains(&y) && (x % 8 == 2 || y % 8 == 2);
        for (look, n) in [(look(|_, _| false), 49), (look(|x, y| x == 14 && y == 14), 0)] {
            let mut after = drawn(frame);
            look.fill_quiet(&mut after);
            assert_eq!(after.iter().filter(|d| **d).count(), drawn(frame).iter().filter(|d| **d).count() + n);
        }
    }
}
