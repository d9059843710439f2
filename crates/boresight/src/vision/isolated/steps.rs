//! How many of a frame's levels a pixel reaches: looked up for whole-numbered pixels, searched for others.

use crate::vision::pixel::Pixel;
use crate::vision::threshold::Side;

/// The levels of one side in the pixels' own type.
#[derive(Debug, Default)]
pub struct Steps {
    /// By value, for whole-numbered pixels.
    table: Vec<u16>,
    /// Levels times the sign of the side, rising.
    levels: Vec<f64>,
    sign: f64,
}

impl Steps {
    /// Takes the levels of a side, from the background towards the extreme.
    pub fn take<T: Pixel>(&mut self, levels: &[f64], side: Side, largest: f32) {
        self.sign = if side == Side::Bright { 1.0 } else { -1.0 };
        self.levels.clear();
        self.levels.extend(levels.iter().map(|l| self.sign * l));
        self.table.clear();
        if T::STEP > 0.0 {
            let values = largest.max(0.0) as u32 + 1;
            let mut table = std::mem::take(&mut self.table);
            table.extend((0..values).map(|v| self.search(f64::from(v))));
            self.table = table;
        }
    }

    /// The number of levels that a pixel reaches; 0 if it is not finite.
    #[inline(always)]
    pub fn of<T: Pixel>(&self, pixel: T) -> u16 {
        if T::STEP > 0.0 { self.table.get(pixel.index()).copied().unwrap_or(0) } else { self.search(pixel.value()) }
    }

    /// The value times the sign of the side.
    #[inline(always)]
    pub fn signed<T: Pixel>(&self, pixel: T) -> f64 {
        self.sign * pixel.value()
    }

    /// Level number `reached`, counted from 1, in the pixels' values.
    pub fn level(&self, reached: u16) -> f64 {
        self.sign * self.levels[usize::from(reached) - 1]
    }

    /// The first level above a value, counted from 1; one more than there are if none is.
    pub fn above(&self, value: f64) -> u16 {
        self.levels.partition_point(|l| *l <= value) as u16 + 1
    }

    fn search(&self, value: f64) -> u16 {
        let v = self.sign * value;
        if v.is_finite() { self.levels.partition_point(|l| *l <= v) as u16 } else { 0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_says_what_a_search_says_and_what_is_not_finite_reaches_nothing() {
        for side in [Side::Bright, Side::Dark] {
            let mut levels = vec![3.0, 7.0, 20.0, 90.0];
            if side == Side::Dark {
                levels.reverse();
            }
            let (mut whole, mut real) = (Steps::default(), Steps::default());
            whole.take::<u8>(&levels, side, 255.0);
            real.take::<f32>(&levels, side, 255.0);
            for v in 0..=255u8 {
                let beyond = |l: &&f64| if side == Side::Bright { f64::from(v) >= **l } else { f64::from(v) <= **l };
                let n = levels.iter().filter(beyond).count();
                assert_eq!(usize::from(whole.of(v)), n);
                assert_eq!(usize::from(real.of(f32::from(v))), n);
                if n > 0 {
                    assert_eq!(whole.level(n as u16), levels[n - 1]);
                }
            }
            assert_eq!([f32::NAN, f32::INFINITY, f32::NEG_INFINITY].map(|v| real.of(v)), [0; 3]);
        }
    }
}
