//! Which frames a preview looks at: short runs of frames, spread evenly over the whole input.
//!
//! Source: our own. A run is frames at gaps that grow, so that what is fast and what is slow both show. Where a file can be entered further on (the key frames of
//! an MP4, the files of a folder), a run begins at the last entry before its place, and nothing between the runs is decoded; otherwise all is read up to
//! [`MOST_PX`] pixels, and the runs lie before that.

/// Runs.
pub(super) const RUNS: usize = 12;
/// Places of a run's frames behind its first.
const OFFSETS: [u64; 7] = [0, 1, 2, 3, 5, 8, 13];
/// Pixels of the frames that are decoded at most to come to later ones: 1000 frames of 1920 x 1080 px, about three seconds.
const MOST_PX: u64 = 2_000_000_000;
/// Memory of a look's frames, bytes; a run has at least [`LEAST_FRAMES`].
const MOST_BYTES: u64 = 128 << 20;
/// Frames of the shortest run: two steps of a chain, one frame spare.
const LEAST_FRAMES: usize = 4;

/// The frames of a preview.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Moments {
    /// Numbers of each run's frames, rising.
    pub runs: Vec<Vec<u64>>,
    /// Frames of the input up to which the runs may lie.
    pub n_reached: u64,
}

impl Moments {
    /// Chooses the runs in an input of `n` frames of `frame_px` pixels and `frame_bytes` bytes that can be entered at `entries`.
    pub fn choose(n: u64, frame_px: u64, frame_bytes: u64, entries: &[u64]) -> Self {
        let most_read = Self::most_read(frame_px);
        let n_each = (MOST_BYTES / (RUNS as u64 * frame_bytes.max(1))).clamp(LEAST_FRAMES as u64, OFFSETS.len() as u64);
        let offsets = &OFFSETS[..n_each as usize];
        let spread = |n: u64| -> Vec<u64> {
            let span = offsets.last().copied().unwrap_or(0) + 1;
            let room = n.saturating_sub(span);
            let runs = RUNS as u64;
            (0..runs).map(|k| room * k / (runs - 1)).collect()
        };
        let entry = |at: u64| entries[..entries.partition_point(|e| *e <= at)].last().copied();
        let mut starts = spread(n);
        let entered: Vec<u64> = starts.iter().map(|at| entry(*at).unwrap_or(0)).collect();
        // Two runs of one entry would be the same run.
        let mut n_read = 0;
        for (start, from) in starts.iter_mut().zip(&entered) {
            if entered.iter().filter(|e| *e == from).count() == 1 {
                *start = *from;
            }
            n_read += *start - from + offsets.len() as u64;
        }
        let mut n_reached = n;
        if entries.len() < 2 || n_read > most_read {
            n_reached = n.min(most_read);
            starts = spread(n_reached);
        }
        starts.dedup();
        let run = |start: u64| offsets.iter().map(|o| start + o).filter(|k| *k < n_reached).collect();
        let mut runs: Vec<Vec<u64>> = starts.into_iter().map(run).collect();
        // Runs of a short input overlap: a frame belongs to one.
        for k in 1..runs.len() {
            let next = runs[k].first().copied().unwrap_or(0);
            runs[k - 1].retain(|f| *f < next);
        }
        runs.retain(|run| !run.is_empty());
        Self { runs, n_reached }
    }

    /// The number of frames that are decoded at most where nothing says how many there are.
    pub fn most_read(frame_px: u64) -> u64 {
        (MOST_PX / frame_px.max(1)).max(64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_lie_over_the_whole_file_and_begin_at_its_entries() {
        let entries: Vec<u64> = (0..400).map(|k| k * 50).collect();
        let seen = Moments::choose(20_000, 1920 * 1080, 1920 * 1080, &entries);
        assert_eq!((seen.runs.len(), seen.n_reached), (RUNS, 20_000));
        assert!(seen.runs.iter().all(|r| r.len() == 5 && r[0] % 50 == 0), "{:?}", seen.runs);
        assert!(seen.runs[11][0] >= 19_900);
    }

    #[test]
    fn a_large_file_without_entries_is_looked_at_as_far_as_it_is_read() {
        let seen = Moments::choose(100_000, 1920 * 1080, 1920 * 1080, &[0]);
        assert_eq!(seen.n_reached, 964);
        assert!(seen.runs.last().unwrap().iter().all(|k| *k < 964 && *k > 940));
        assert_eq!(Moments::choose(300, 320 * 256, 320 * 256, &[0]).n_reached, 300);
    }

    #[test]
    fn short_inputs_give_each_frame_once_and_large_frames_shorter_runs() {
        for n in 1..60 {
            let all: Vec<u64> = Moments::choose(n, 100, 100, &[]).runs.concat();
            assert!(
                !all.is_empty() && all.windows(2).all(|w| w[0] < w[1]) && all.iter().all(|k| *k < n),
                "{n}: {all:?}"
            );
        }
        let large = Moments::choose(300, 3840 * 2160, 2 * 3840 * 2160, &[0]);
        assert!(large.runs.iter().all(|r| r.len() == LEAST_FRAMES));
    }
}
