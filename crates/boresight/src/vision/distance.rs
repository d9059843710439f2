//! Distance of every cell of a small grid to the nearest cell of the ground.
//!
//! Source: P. Felzenszwalb, D. Huttenlocher, *Distance transforms of sampled functions*, Theory of Computing 8 (2012): squared Euclidean distances are the lower envelope of parabolas, first along columns, then along
//! rows. Here both are whole numbers throughout, so that nothing depends on rounding but the order of envelopes' ends, which is exact for grids of less than 2^15 cells a side.
//! Cost: O(cells). Limits: a grid without ground has [`FAR`] everywhere.

/// Squared distance where there is no ground.
pub(super) const FAR: u64 = 1 << 32;

/// What is reused from grid to grid.
#[derive(Clone, Debug, Default)]
pub(super) struct Distances {
    /// Squared distances, cells², row by row.
    pub(super) squared: Vec<u64>,
    line: Vec<u64>,
    /// Places of the parabolas of the envelope, and where each begins to be the lowest.
    vertex: Vec<usize>,
    from: Vec<f64>,
    /// Their values.
    lowest: Vec<u64>,
}

impl Distances {
    /// Fills `squared` for a grid of that width; ground are the cells for which it says so.
    pub(super) fn fill(&mut self, width: usize, height: usize, is_ground: impl Fn(usize) -> bool) {
        self.squared.clear();
        self.squared.extend((0..width * height).map(|i| if is_ground(i) { 0 } else { FAR }));
        for x in 0..width {
            self.line.clear();
            self.line.extend(self.squared.iter().skip(x).step_by(width));
            self.envelope();
            let column = self.squared.iter_mut().skip(x).step_by(width);
            column.zip(&self.line).for_each(|(to, v)| *to = *v);
        }
        for y in 0..height {
            let row = y * width..(y + 1) * width;
            self.line.clear();
            self.line.extend_from_slice(&self.squared[row.clone()]);
            self.envelope();
            self.squared[row].copy_from_slice(&self.line);
        }
    }

    /// Replaces each value f(p) of `line` by the least of f(q) + (p - q)².
    fn envelope(&mut self) {
        let Self { line, vertex, from, lowest, .. } = self;
        vertex.clear();
        from.clear();
        let height = |q: usize| line[q] as f64 + (q * q) as f64;
        for q in (0..line.len()).filter(|&q| line[q] < FAR) {
            let mut start = f64::NEG_INFINITY;
            while let (Some(&v), Some(&begun)) = (vertex.last(), from.last()) {
                start = (height(q) - height(v)) / (2.0 * (q - v) as f64);
                if start > begun {
                    break;
                }
                vertex.pop();
                from.pop();
                start = f64::NEG_INFINITY;
            }
            vertex.push(q);
            from.push(start);
        }
        if vertex.is_empty() {
            return;
        }
        lowest.clear();
        lowest.extend(vertex.iter().map(|&v| line[v]));
        let mut k = 0;
        for (p, to) in line.iter_mut().enumerate() {
            while from.get(k + 1).is_some_and(|&f| f < p as f64) {
                k += 1;
            }
            let away = p.abs_diff(vertex[k]) as u64;
            *to = lowest[k] + away * away;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn distances_are_those_of_all_pairs(
            (width, ground) in (1usize..14).prop_flat_map(|w| (Just(w), prop::collection::vec(prop::bool::weighted(0.2), w..w * 14))),
        ) {
            let height = ground.len() / width;
            let mut distances = Distances::default();
            distances.fill(width, height, |i| ground[i]);
            for (i, &found) in distances.squared.iter().enumerate() {
                let to = |j: usize| {
                    let (dx, dy) = ((i % width).abs_diff(j % width), (i / width).abs_diff(j / width));
                    (dx * dx + dy * dy) as u64
                };
                let nearest = (0..width * height).filter(|&j| ground[j]).map(to).min();
                prop_assert_eq!(found, nearest.unwrap_or(FAR));
            }
        }
    }
}
