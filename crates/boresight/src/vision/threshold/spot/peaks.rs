//! The peaks of a response, and how near the nearest other one is.

/// A peak of the response.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Summit {
    pub(super) x: usize,
    pub(super) y: usize,
    /// Response, counts.
    pub(super) v: f32,
    /// Median of the response around and its deviation, counts.
    pub(super) median: f64,
    pub(super) deviation: f64,
    /// Square of the distance to the nearest other peak within reach, px²; the largest number there is without one.
    pub(super) nearest2: usize,
}

/// Says of peaks in raster order how near the nearest other one is, up to `reach` px.
pub(super) fn find_nearest(summits: &mut [Summit], reach: usize) {
    for i in 0..summits.len() {
        for j in i + 1..summits.len() {
            let (a, b) = (summits[i], summits[j]);
            if b.y > a.y + reach {
                break;
            }
            let d2 = a.x.abs_diff(b.x).pow(2) + a.y.abs_diff(b.y).pow(2);
            if d2 <= reach * reach {
                summits[i].nearest2 = summits[i].nearest2.min(d2);
                summits[j].nearest2 = summits[j].nearest2.min(d2);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_is_found_within_reach_whichever_comes_first() {
        let at = |&(x, y): &(usize, usize)| Summit { x, y, v: 1.0, median: 0.0, deviation: 1.0, nearest2: usize::MAX };
        let mut summits: Vec<Summit> = [(10, 5), (14, 5), (40, 5), (13, 9), (40, 25)].iter().map(at).collect();
        find_nearest(&mut summits, 10);
        let nearest: Vec<usize> = summits.iter().map(|s| s.nearest2).collect();
        assert_eq!(nearest, [16, 16, usize::MAX, 17, usize::MAX]);
    }
}
