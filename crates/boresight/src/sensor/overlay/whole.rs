//! What is drawn as a whole: lines of text, and the ground of their boxes.

use super::{BESIDE, CONTRAST, DENSE, GAP, Look, STILL};

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
            let mut next = 0;
            let (mut x, mut y) = ([self.w, 0], [self.h, 0]);
            while let Some(i) = text.get(next).copied() {
                next += 1;
                x = [x[0].min(i % self.w), x[1].max(i % self.w)];
                y = [y[0].min(i / self.w), y[1].max(i / self.w)];
                text.extend(self.around(i, GAP * self.s).filter(|j| std::mem::take(&mut left[*j])));
            }
            let area = (x[1] + 1 - x[0]) * (y[1] + 1 - y[0]);
            if text.len() as f64 >= DENSE * area as f64 {
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
