//! Runs of set bits: a row of bits becomes the first and last columns of its runs.
//!
//! Source: our own. [`find_runs`] writes both lists without a branch for each bit. Bit `x % 64` of word `x / 64` is column `x`.

/// Rows of bits of a frame, one after the other.
#[derive(Clone, Debug, Default)]
pub(super) struct Mask {
    pub(super) words: Vec<u64>,
    /// Words of a row.
    pub(super) stride: usize,
}

impl Mask {
    /// Whether the pixel is set; none is outside.
    pub(super) fn is_set(&self, x: u32, y: u32) -> bool {
        let word = self.words.get(y as usize * self.stride + x as usize / 64);
        word.is_some_and(|w| w >> (x % 64) & 1 == 1)
    }
}

/// The runs of one row, from the left: first and last column, and the region of each.
#[derive(Clone, Debug, Default)]
pub(super) struct RowRuns {
    pub(super) n: usize,
    /// Longer than `n`: columns are written eight at a time.
    pub(super) start: Vec<u32>,
    pub(super) end: Vec<u32>,
    pub(super) region: Vec<u32>,
    /// For each word of bits: where runs start and end in it, and how many start and end before it.
    pub(super) words: Vec<RunWord>,
}

/// Where runs start and end among 64 pixels.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct RunWord {
    starts: u64,
    ends: u64,
    n_starts: u32,
    n_ends: u32,
}

impl RowRuns {
    /// Number of runs that end left of column `x`.
    #[inline(always)]
    pub(super) fn ending_before(&self, x: u32) -> usize {
        let word = self.words.get(x as usize / 64).copied().unwrap_or_default();
        (word.n_ends + (word.ends & ((1 << (x % 64)) - 1)).count_ones()) as usize
    }

    /// Number of runs that start at column `x` or left of it.
    #[inline(always)]
    pub(super) fn starting_up_to(&self, x: u32) -> usize {
        // The last column's right neighbour may lie past the words: then all runs have started.
        let Some(word) = self.words.get(x as usize / 64) else { return self.n };
        (word.n_starts + (word.starts & (!0 >> (63 - x % 64))).count_ones()) as usize
    }
}

/// Finds the first and last columns of the runs of a row of bits.
///
/// A run starts at a set bit whose left neighbour is not set, and ends at one whose right neighbour is not; the two lists
/// have the same length and order.
#[inline(always)]
pub(super) fn find_runs(bits: &[u64], runs: &mut RowRuns) {
    let (mut n_start, mut n_end) = (0, 0);
    let mut left = 0u64;
    for (w, (&word, run_word)) in bits.iter().zip(&mut runs.words).enumerate() {
        let right = bits.get(w + 1).map_or(0, |next| next << 63);
        let base = w as u32 * 64;
        let (starts, ends) = (word & !(word << 1 | left), word & !(word >> 1 | right));
        *run_word = RunWord { starts, ends, n_starts: n_start as u32, n_ends: n_end as u32 };
        left = word >> 63;
        if word != 0 {
            n_start = columns(starts, base, &mut runs.start, n_start);
            n_end = columns(ends, base, &mut runs.end, n_end);
        }
    }
    runs.n = n_start.min(n_end);
}

/// Appends the columns of the set bits at `n` and returns the new length.
///
/// Eight are written without looking how many there are, and what is too much is written over: a branch for each bit
/// would be guessed wrong about once a word.
#[inline(always)]
fn columns(mut bits: u64, base: u32, out: &mut [u32], n: usize) -> usize {
    let count = bits.count_ones() as usize;
    let mut at = n;
    while bits != 0 {
        let Some(eight) = out.get_mut(at..at + 8) else { return n };
        for column in eight {
            // For no bit left this is `base + 64`, which is not looked at.
            *column = base + bits.trailing_zeros();
            bits &= bits.wrapping_sub(1);
        }
        at += 8;
    }
    n + count
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_cross_words_and_end_at_the_edge() {
        let found = |bits: &[u64]| {
            let n = bits.len() * 32 + 8;
            let mut runs = RowRuns {
                n: 0,
                start: vec![0; n],
                end: vec![0; n],
                region: vec![0; n],
                words: vec![RunWord::default(); bits.len()],
            };
            find_runs(bits, &mut runs);
            (0..runs.n).map(|i| (runs.start[i], runs.end[i])).collect::<Vec<_>>()
        };
        assert_eq!(found(&[1 | 1 << 63, !0, 0b101]), [(0, 0), (63, 128), (130, 130)]);
        assert_eq!(found(&[!0, !0]), [(0, 127)]);
        assert_eq!(found(&[1 << 63, 0, 1 << 63]), [(63, 63), (191, 191)]);
        assert_eq!(found(&[0x5555_5555_5555_5555; 3]).len(), 96);
    }
}
