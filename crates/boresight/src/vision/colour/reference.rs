//! Choosing the colour of the target from the first frames, when nobody names it.
//!
//! The colour sought moves, is no grey, and comes in one compact piece that lies wholly inside the image: a ball in the air
//! or in a hand does, the arm that throws it reaches in from the border. Our own method:
//! 1. the background is the median of each pixel over the frames, on a grid of at most 320 px width;
//! 2. in every frame the pixels that differ from it and have a saturation of 0.1 or more are sorted by hue;
//! 3. for 24 windows of hue, 45 degrees wide, the largest 8-connected piece of a window counts if it does not touch
//!    the border, fills 45 % of its box, has 6 pixels of the grid and holds half of its window's pixels;
//! 4. the window with the most of it (root of the area times saturation, less what the background has of the hue) wins,
//!    if it was seen in at least 3 frames and half of its pieces' pixels are of places of their own; the reference is the median of red, green and blue over its pieces.

use super::super::ranks::{LANES, Ranked, block};
use super::hsi::{Hsi, hsi};
use crate::Image;

/// A colour chosen for a target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reference {
    /// Red, green, blue.
    pub rgb: [u8; 3],
    /// The same as hue, saturation, intensity.
    pub hsi: Hsi,
    /// Frames in which it was seen as one compact piece.
    pub n_frames: usize,
    /// Its median area in those, px of the full image.
    pub area_px: f64,
}

/// Windows of hue, 15 degrees each.
const WINDOWS: usize = 24;
/// Below this saturation a pixel has no hue worth the name.
const MIN_SATURATION: f64 = 0.1;
/// Pixels of the grid that a piece has at least.
const MIN_PIXELS: usize = 6;
/// Difference of a channel from the background that counts as moving, counts.
const MOVED: u8 = 25;
/// Share of the pieces' pixels that are of places of their own, at least: what moves by half of its size from frame to frame has more.
const LEAST_NEW: f64 = 0.5;

/// Widest grid that is looked at, px: of wider frames every so many-th pixel.
pub const GRID_PX: usize = 320;

/// Proposes the colour of a compact moving target from frames spread over the beginning of a video (10 to 60 do; all of
/// one size, others are left out); `None` if no colour stands out.
pub fn choose_reference(frames: &[&Image<[u8; 3]>]) -> Option<Reference> {
    let first = frames.first()?;
    let (w, h) = (first.width(), first.height());
    let step = w.div_ceil(GRID_PX).max(1);
    let (gw, gh) = (w.div_ceil(step), h.div_ceil(step));
    let grids: Vec<Vec<[u8; 3]>> =
        frames.iter().filter(|f| (f.width(), f.height()) == (w, h)).map(|f| grid(f, step)).collect();
    let background = median_of(&grids)?;
    let static_hues = count_hues(&background);
    let mut found = vec![Found::default(); WINDOWS];
    let mut hues = vec![u8::MAX; gw * gh];
    for pixels in &grids {
        let mut n_of_sector = [0usize; WINDOWS];
        for ((hue, p), b) in hues.iter_mut().zip(pixels).zip(&background) {
            *hue = u8::MAX;
            if (0..3).any(|c| p[c].abs_diff(b[c]) > MOVED) {
                let c = hsi(*p);
                if c.saturation >= MIN_SATURATION {
                    *hue = sector(c.hue_deg);
                    n_of_sector[usize::from(*hue)] += 1;
                }
            }
        }
        for (k, found) in found.iter_mut().enumerate() {
            let in_window = |hue: u8| hue != u8::MAX && near(usize::from(hue), k);
            if (0..WINDOWS).filter(|&s| near(s, k)).map(|s| n_of_sector[s]).sum::<usize>() < MIN_PIXELS {
                continue;
            }
            let Some(piece) = compact_piece(&hues, gw, gh, in_window) else { continue };
            let colours = piece.iter().map(|&i| pixels[i]);
            let saturation = colours.clone().map(|p| hsi(p).saturation).sum::<f64>() / piece.len() as f64;
            found.score += (piece.len() as f64).sqrt() * saturation;
            found.areas.push(piece.len());
            found.colours.extend(colours);
            found.places.extend(&piece);
        }
    }
    let distinct = |k: usize| {
        let same: usize = static_hues.iter().enumerate().filter(|(s, _)| near(*s, k)).map(|(_, n)| n).sum();
        1.0 / (1.0 + 20.0 * same as f64 / background.len() as f64)
    };
    let enough: Vec<usize> = (0..WINDOWS).filter(|&k| found[k].areas.len() >= 3 && found[k].goes_on()).collect();
    let score = |k: usize| found[k].score * distinct(k);
    let best = enough.into_iter().max_by(|&a, &b| score(a).total_cmp(&score(b)))?;
    let Found { areas, colours, .. } = found.swap_remove(best);
    let rgb = median_of(&colours.iter().map(|&c| vec![c]).collect::<Vec<_>>())?.first().copied()?;
    let mut areas = areas;
    areas.sort_unstable();
    let area_px = areas.get(areas.len() / 2).copied()? as f64 * (step * step) as f64;
    Some(Reference { rgb, hsi: hsi(rgb), n_frames: areas.len(), area_px })
}

/// The pieces of a window of hues.
#[derive(Clone, Default)]
struct Found {
    score: f64,
    areas: Vec<usize>,
    colours: Vec<[u8; 3]>,
    places: Vec<usize>,
}

impl Found {
    /// Whether the pieces lie on other ground from frame to frame: the digits of a clock, a lamp that blinks come back to theirs.
    fn goes_on(&self) -> bool {
        let mut places = self.places.clone();
        places.sort_unstable();
        places.dedup();
        places.len() as f64 >= LEAST_NEW * self.places.len() as f64
    }
}

/// The window's own 15 degrees of a hue.
fn sector(hue_deg: f64) -> u8 {
    ((hue_deg / (360.0 / WINDOWS as f64)) as usize % WINDOWS) as u8
}

/// Whether a sector is window `k`'s own or next to it.
fn near(sector: usize, k: usize) -> bool {
    let d = sector.abs_diff(k);
    d.min(WINDOWS - d) <= 1
}

fn grid(frame: &Image<[u8; 3]>, step: usize) -> Vec<[u8; 3]> {
    if step == 1 {
        return frame.as_slice().to_vec();
    }
    let rows = (0..frame.height()).step_by(step);
    rows.flat_map(|y| frame.row(y).iter().step_by(step).copied()).collect()
}

/// The median of each pixel, channel by channel.
fn median_of(frames: &[Vec<[u8; 3]>]) -> Option<Vec<[u8; 3]>> {
    let n = frames.first()?.len();
    let mut out = vec![[0; 3]; n];
    let (mut rows, mut column) = (Vec::with_capacity(frames.len()), vec![0u8; frames.len()]);
    for first in (0..3 * n).step_by(LANES) {
        rows.clear();
        rows.extend(frames.iter().map(|f| block(f.as_flattened(), first)));
        let mut medians = [0; LANES];
        if !u8::rank(&rows, frames.len() / 2, &mut medians) {
            for (i, median) in medians.iter_mut().enumerate() {
                column.iter_mut().zip(&rows).for_each(|(v, r)| *v = r[i]);
                *median = *column.select_nth_unstable(frames.len() / 2).1;
            }
        }
        out.as_flattened_mut()[first..].iter_mut().zip(medians).for_each(|(o, m)| *o = m);
    }
    Some(out)
}

fn count_hues(pixels: &[[u8; 3]]) -> [usize; WINDOWS] {
    let mut counts = [0; WINDOWS];
    for &p in pixels {
        let c = hsi(p);
        if c.saturation >= MIN_SATURATION {
            counts[usize::from(sector(c.hue_deg))] += 1;
        }
    }
    counts
}

/// The pixels of the largest 8-connected piece, if it is compact, inside, and the greater part of all.
fn compact_piece(hues: &[u8], w: usize, h: usize, inside: impl Fn(u8) -> bool) -> Option<Vec<usize>> {
    let mut seen = vec![false; hues.len()];
    let (mut largest, mut all) = (Vec::new(), 0);
    for start in 0..hues.len() {
        if seen[start] || !inside(hues[start]) {
            continue;
        }
        let mut piece = vec![start];
        seen[start] = true;
        let mut next = 0;
        while let Some(&i) = piece.get(next) {
            next += 1;
            let (x, y) = (i % w, i / w);
            for ny in y.saturating_sub(1)..(y + 2).min(h) {
                for nx in x.saturating_sub(1)..(x + 2).min(w) {
                    let j = ny * w + nx;
                    if !seen[j] && inside(hues[j]) {
                        seen[j] = true;
                        piece.push(j);
                    }
                }
            }
        }
        all += piece.len();
        if piece.len() > largest.len() {
            largest = piece;
        }
    }
    let xs = || largest.iter().map(|i| i % w);
    let ys = || largest.iter().map(|i| i / w);
    let (x0, x1, y0, y1) = (xs().min()?, xs().max()?, ys().min()?, ys().max()?);
    let whole = x0 > 0 && y0 > 0 && x1 + 1 < w && y1 + 1 < h;
    let filled = largest.len() as f64 >= 0.45 * ((x1 + 1 - x0) * (y1 + 1 - y0)) as f64;
    (whole && filled && largest.len() >= MIN_PIXELS && 2 * largest.len() >= all).then_some(largest)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(x: usize, ball: [u8; 3]) -> Image<[u8; 3]> {
        let mut f = Image::filled(160, 120, [180u8, 185, 182]);
        for y in 0..120 {
            // Static blue furniture and an orange arm from the right border.
            f.row_mut(y)[..20].fill([40, 60, 160]);
            if (50..70).contains(&y) {
                f.row_mut(y)[x + 20..].fill([200, 120, 90]);
            }
            for px in x..x + 18 {
                if (px as f64 - x as f64 - 8.5).hypot(y as f64 - 60.0) < 8.0 {
                    f.row_mut(y)[px] = ball;
                }
            }
        }
        f
    }

    #[test]
    fn a_ball_is_chosen_rather_than_the_larger_arm_that_holds_it() {
        let frames: Vec<_> = (0..12).map(|t| scene(30 + 9 * t, [90, 150, 80])).collect();
        let chosen = choose_reference(&frames.iter().collect::<Vec<_>>()).unwrap();
        assert_eq!(chosen.rgb, [90, 150, 80]);
        assert!(chosen.n_frames >= 10 && (chosen.area_px - 200.0).abs() < 30.0, "{chosen:?}");
    }

    #[test]
    fn coloured_digits_that_come_and_go_in_their_places_are_no_target() {
        let frame = |k: usize| {
            let mut f = Image::filled(160, 120, [60u8; 3]);
            let x = [20, 32, 100][k % 3];
            (90..100).for_each(|y| f.row_mut(y)[x..x + 7].fill([220, 220, 30]));
            f
        };
        let frames: Vec<_> = (0..24).map(frame).collect();
        assert_eq!(choose_reference(&frames.iter().collect::<Vec<_>>()), None);
        // Three times in three places it is somewhere else each time.
        assert!(choose_reference(&frames[..3].iter().collect::<Vec<_>>()).is_some());
    }

    #[test]
    fn nothing_is_chosen_where_nothing_coloured_moves() {
        let still = scene(40, [90, 150, 80]);
        assert_eq!(choose_reference(&[&still, &still, &still, &still]), None);
        assert_eq!(choose_reference(&[]), None);
        let frames: Vec<_> = (0..9).map(|t| Image::filled(5, 4, [(t * 20) as u8; 3])).collect();
        assert_eq!(choose_reference(&frames.iter().collect::<Vec<_>>()), None);
        let empty = Image::filled(0, 0, [0u8; 3]);
        assert_eq!(choose_reference(&[&empty, &empty]), None);
    }
}
