//! The pixels that a target's cluster can begin at: local maxima above the bar of their cell.
//!
//! Units: px, counts; values times the sign of the side.

use super::bars::{Bar, Bars};
use super::cells::{CELL, Cells};
use crate::Image;
use crate::vision::pixel::Pixel;

/// A local maximum.
#[derive(Clone, Copy, Debug)]
pub struct Peak {
    pub x: u32,
    pub y: u32,
    /// Its cell, in the order of the rows.
    pub cell: usize,
    /// Whether it is the highest of its cell.
    pub highest: bool,
    /// By which peaks are ordered: the highest first, equals in the order of the rows.
    order: u64,
}

/// Finds the peaks of one side above `lowest`, the highest first; equals in the order of the rows.
pub fn find<T: Pixel>(image: &Image<T>, cells: &Cells, bars: &Bars, bar: &Bar, lowest: f64, peaks: &mut Vec<Peak>) {
    peaks.clear();
    let columns = cells.size().0;
    for (cell, high) in cells.highest(bar.sign < 0.0).enumerate() {
        let high = f64::from(high);
        if high < lowest {
            continue;
        }
        let Some(need) = bars.need(cells, bar, cell, true, 1) else { continue };
        if high < need.mean {
            continue;
        }
        // Of the others of the cell only small clusters are looked for.
        let least = bars.need(cells, bar, cell, false, 1).map_or(high, |n| n.mean.min(high)).max(lowest);
        let (left, top) = (cell % columns * CELL, cell / columns * CELL);
        for y in top.max(1)..(top + CELL).min(image.height().saturating_sub(1)) {
            let [above, row, below] = [y - 1, y, y + 1].map(|y| image.row(y));
            for x in left.max(1)..(left + CELL).min(image.width().saturating_sub(1)) {
                let value = bar.sign * row[x].value();
                if value >= least && value.is_finite() && is_highest([above, row, below], bar.sign, x, value) {
                    let order = descending(value as f32) | (y * image.width() + x) as u64;
                    peaks.push(Peak { x: x as u32, y: y as u32, cell, highest: value >= high, order });
                }
            }
        }
    }
    peaks.sort_unstable_by_key(|p| p.order);
}

/// A number that falls with a value, in the upper half.
fn descending(value: f32) -> u64 {
    // The bits of floats are in the order of their values, those of negative ones in the reverse of it.
    let bits = value.to_bits();
    let rising = if bits >> 31 == 0 { bits | 1 << 31 } else { !bits };
    u64::from(!rising) << 32
}

/// Whether no neighbour is higher; of equal neighbours the first counts.
fn is_highest<T: Pixel>([above, row, below]: [&[T]; 3], sign: f64, x: usize, value: f64) -> bool {
    let higher = |p: T, than: f64| {
        let v = sign * p.value();
        v > than && v.is_finite()
    };
    let least = value.next_down();
    !(higher(row[x - 1], least)
        || above[x - 1..x + 2].iter().any(|p| higher(*p, least))
        || higher(row[x + 1], value)
        || below[x - 1..x + 2].iter().any(|p| higher(*p, value)))
}
