//! How many of some places of a frame lie near another one.

/// How many of some places lie within a square, by sums over all above and left of each.
pub(super) struct Counts {
    w: usize,
    h: usize,
    sums: Vec<u32>,
}

impl Counts {
    /// Counts places of a frame of `w` x `h` px.
    pub(super) fn of(w: usize, h: usize, places: impl Iterator<Item = usize>) -> Self {
        let mut sums = vec![0; (w + 1) * (h + 1)];
        places.for_each(|i| sums[(i / w + 1) * (w + 1) + i % w + 1] += 1);
        for y in 1..=h {
            let (above, here) = sums.split_at_mut(y * (w + 1));
            let above = &above[(y - 1) * (w + 1)..];
            let mut row = 0;
            for (here, above) in here.iter_mut().zip(above) {
                row += *here;
                *here = row + above;
            }
        }
        Self { w, h, sums }
    }

    /// How many lie at most `reach` from place `i` along both axes.
    pub(super) fn near(&self, i: usize, reach: usize) -> u32 {
        let (x, y) = (i % self.w, i / self.w);
        let [left, top] = [x, y].map(|v| v.saturating_sub(reach));
        let (right, bottom) = ((x + reach + 1).min(self.w), (y + reach + 1).min(self.h));
        let at = |x: usize, y: usize| self.sums[y * (self.w + 1) + x];
        at(right, bottom) + at(left, top) - at(left, bottom) - at(right, top)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn they_are_those_that_are_counted_one_by_one() {
        let (w, h) = (13, 9);
        let places: Vec<usize> = (0..w * h).filter(|i| i * i % 7 < 3).collect();
        let counts = Counts::of(w, h, places.iter().copied());
        for i in 0..w * h {
            let is_near = |j: &&usize| (**j % w).abs_diff(i % w) <= 2 && (**j / w).abs_diff(i / w) <= 2;
            assert_eq!(counts.near(i, 2) as usize, places.iter().filter(is_near).count(), "{i}");
        }
    }
}
