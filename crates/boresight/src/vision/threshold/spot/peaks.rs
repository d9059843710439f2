//! Which summits of a response are peaks of targets of their own, and how near the nearest other one is.
//!
//! A summit is one if the response falls on the straight way to every stronger summit within reach by [`SPLIT`] deviations of the response below it: what a hill's noise makes of its
//! top does not, and two targets side by side do as soon as there is a valley between them that the noise would not dig. Source: textbook (the prominence of a peak, along straight ways).

use crate::Image;

/// Fall that splits, deviations of the response: three of the difference of two responses, 3 √2, one of 740 by noise alone.
pub(super) const SPLIT: f64 = 4.243;

/// The same as a share of the stronger one: what optics and codecs leave beside a bright spot is a part of it.
const SPLIT_SHARE: f64 = 0.1;

/// A summit of the response.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Summit {
    pub(super) x: usize,
    pub(super) y: usize,
    /// Response, counts.
    pub(super) v: f32,
    /// Median of the response around and its deviation, counts.
    pub(super) median: f64,
    pub(super) deviation: f64,
    /// Least fall that splits it from a stronger one, counts.
    pub(super) least_fall: f64,
    /// Square of the distance to the nearest other peak within reach, px²; the largest number there is without one.
    pub(super) nearest2: usize,
    /// Whether it is a target's own.
    pub(super) is_own: bool,
}

/// Says of summits in raster order which are peaks of their own beside stronger ones up to `beside` px away, and how near the nearest other peak is, up to `reach` px.
pub(super) fn separate(response: &Image<f32>, summits: &mut [Summit], beside: usize, reach: usize) {
    let distance2 = |a: &Summit, b: &Summit| a.x.abs_diff(b.x).pow(2) + a.y.abs_diff(b.y).pow(2);
    for i in 0..summits.len() {
        for j in i + 1..summits.len() {
            let (a, b) = (summits[i], summits[j]);
            if b.y > a.y + beside {
                break;
            }
            // The first of equals is the stronger one.
            let (weaker, strongest) = if a.v >= b.v { (j, a.v) } else { (i, b.v) };
            if summits[weaker].is_own && distance2(&a, &b) <= beside * beside {
                let fall = f64::from(summits[weaker].v - lowest_between(response, &a, &b));
                summits[weaker].is_own = fall >= summits[weaker].least_fall.max(SPLIT_SHARE * f64::from(strongest));
            }
        }
    }
    for i in 0..summits.len() {
        for j in i + 1..summits.len() {
            let (a, b) = (summits[i], summits[j]);
            if b.y > a.y + reach {
                break;
            }
            let d2 = distance2(&a, &b);
            if d2 <= reach * reach && a.is_own && b.is_own {
                summits[i].nearest2 = a.nearest2.min(d2);
                summits[j].nearest2 = b.nearest2.min(d2);
            }
        }
    }
}

/// The least response on the straight way between two summits, at its nearest pixels.
fn lowest_between(response: &Image<f32>, a: &Summit, b: &Summit) -> f32 {
    let n = a.x.abs_diff(b.x).max(a.y.abs_diff(b.y));
    // Rounded to the nearer pixel: (2 n a + 2 k (b - a) + n) / (2 n).
    let at = |a: usize, b: usize, k: usize| (2 * (a * (n - k) + b * k) + n) / (2 * n).max(1);
    let values = (1..n).filter_map(|k| response.get(at(a.x, b.x, k), at(a.y, b.y, k)));
    values.fold(a.v.min(b.v), f32::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Which of the summits of a response are peaks of their own, and the square of the distance to the nearest other one; deviation 1.
    fn separated(response: &Image<f32>, places: &[(usize, usize)], beside: usize, reach: usize) -> Vec<(bool, usize)> {
        let summit = |&(x, y): &(usize, usize)| Summit {
            x,
            y,
            v: response.row(y)[x],
            median: 0.0,
            deviation: 1.0,
            least_fall: SPLIT,
            nearest2: usize::MAX,
            is_own: true,
        };
        let mut summits: Vec<Summit> = places.iter().map(summit).collect();
        separate(response, &mut summits, beside, reach);
        summits.iter().map(|s| (s.is_own, s.nearest2)).collect()
    }

    #[test]
    fn a_summit_is_a_peak_if_the_response_falls_before_every_stronger_one_nearby() {
        const NONE: usize = usize::MAX;
        let mut response = Image::filled(60, 40, 0.0f32);
        // Between the first two it falls by 4.2 deviations below the weaker, between the others by 4.3.
        response.row_mut(5)[10..15].copy_from_slice(&[30.0, 25.0, 15.8, 18.0, 20.0]);
        response.row_mut(5)[40..45].copy_from_slice(&[20.0, 17.0, 15.7, 25.0, 30.0]);
        let places = [(10, 5), (14, 5), (40, 5), (44, 5)];
        assert_eq!(separated(&response, &places, 6, 6), [(true, NONE), (false, NONE), (true, 16), (true, 16)]);
        // Farther away than that nothing is asked, and what is no peak is nobody's neighbour.
        assert_eq!(separated(&response, &places, 3, 3), [(true, NONE); 4]);
        assert_eq!(separated(&response, &places, 4, 30)[0], (true, 900));
        // Beside one of 60 six are asked for.
        response.row_mut(5)[44] = 60.0;
        assert_eq!(separated(&response, &places, 6, 6)[2], (false, NONE));
    }

    #[test]
    fn of_equal_summits_on_one_hill_the_first_is_the_peak_and_a_third_one_belongs_to_it() {
        let response = Image::filled(20, 20, 9.0f32);
        let own = |places: &[(usize, usize)]| -> Vec<bool> {
            separated(&response, places, 4, 8).iter().map(|s| s.0).collect()
        };
        assert_eq!(own(&[(5, 5), (8, 5), (11, 6)]), [true, false, false]);
        assert_eq!(own(&[(5, 5), (5, 9)]), [true, false]);
        assert_eq!(own(&[(5, 5), (5, 10)]), [true, true]);
    }

    #[test]
    fn the_way_between_two_summits_is_straight_whichever_comes_first() {
        let at = |x, y| Summit {
            x,
            y,
            v: 9.0,
            median: 0.0,
            deviation: 1.0,
            least_fall: SPLIT,
            nearest2: usize::MAX,
            is_own: true,
        };
        for (a, b) in [((3, 4), (9, 7)), ((9, 4), (3, 7)), ((5, 2), (5, 9)), ((2, 6), (8, 6)), ((4, 9), (6, 2))] {
            let mut response = Image::filled(12, 12, 9.0f32);
            // Half the way, within half a pixel.
            let (x, y) = (0.5 * (a.0 + b.0) as f64, 0.5 * (a.1 + b.1) as f64);
            for (i, j) in (0..12).flat_map(|j| (0..12).map(move |i| (i, j))) {
                if (i as f64 - x).abs() <= 0.5 && (j as f64 - y).abs() <= 0.5 {
                    response.row_mut(j)[i] = 1.0;
                }
            }
            let (p, q) = (at(a.0, a.1), at(b.0, b.1));
            assert_eq!(
                (lowest_between(&response, &p, &q), lowest_between(&response, &q, &p)),
                (1.0, 1.0),
                "{a:?} {b:?}"
            );
        }
        assert_eq!(lowest_between(&Image::filled(12, 12, 1.0f32), &at(3, 3), &at(4, 3)), 9.0, "nothing lies between");
    }
}
