//! The bank of velocities: a grid that doubles with the length of the sum, and the whole-pixel shifts that join two sums to one.
//!
//! Source: our own; sums shared by halving as in the fast Radon transforms: W. A. Götz & H. J. Druckmüller, Pattern Recognit. 29, 711 (1996);
//! M. L. Brady, SIAM J. Comput. 27, 107 (1998). Theirs is for lines in one image, ours for paths through frames at their real times.
//! A sum of level k is over 2^k frames. Its velocities on an axis are v(k, i) = (i + ½) δ_k − V, δ_k = δ_0 / 2^k: each has two on the level
//! above, the midpoints of its halves. Joined to level k + 1 at velocity v are a newer sum n and an older one o, whose paths have mean
//! offsets m and mean times τ; the older one is read d = round(v (τ_o − τ_n) − (m_o − m_n)) pixels on. So no error of rounding is carried
//! on: at every level the halves lie within ½ px of each other. x and y have the same grid and shifts.
//! Spacing: [`STEP`], so that a velocity half a step off leaves the target's middle by at most 0.35 σ an axis at the sum's ends.
//! Symbols: δ spacing px/s; T frames; V largest velocity of the grid, px/s. Limits: T a power of two.

/// Spacing of velocities times half the sum's duration, in σ of the spot (issue: δ T/2 <= 0.7 σ).
const STEP: f64 = 0.7;

/// Mean of a sum's path, relative to its place in its newest frame.
#[derive(Clone, Copy, Debug, Default)]
struct Path {
    /// Mean offset, px.
    offset_px: f64,
    /// Mean time, s.
    time_s: f64,
}

/// The grid and the shifts for one set of frame times.
#[derive(Clone, Debug, Default)]
pub(super) struct Velocities {
    /// log₂ T.
    pub(super) top: usize,
    /// Velocities on an axis of level 0.
    pub(super) roots: usize,
    /// δ_0, px/s.
    spacing0: f64,
    max_speed: f64,
    /// Shifts of level k, block c, axis index i at `shifts[k][c * n + i]`, k >= 1; paths alike.
    shifts: Vec<Vec<i32>>,
    paths: Vec<Vec<Path>>,
}

impl Velocities {
    /// Makes the grid for sums of `2^top` frames that lie `interval_s` apart.
    pub(super) fn new(top: usize, sigma_px: f64, interval_s: f64, max_speed: f64) -> Self {
        let spacing0 = 2.0 * STEP * sigma_px / interval_s;
        let roots = ((2.0 * max_speed / spacing0).ceil() as usize).max(1);
        Self { top, roots, spacing0, max_speed, shifts: vec![Vec::new(); top + 1], paths: vec![Vec::new(); top + 1] }
    }

    /// Number of velocities on an axis of a level.
    pub(super) fn n_axis(&self, level: usize) -> usize {
        self.roots << level
    }

    /// Velocity of an axis index, px/s.
    pub(super) fn velocity(&self, level: usize, i: usize) -> f64 {
        let spacing = self.spacing0 / (1u64 << level) as f64;
        (i as f64 + 0.5) * spacing - 0.5 * self.roots as f64 * self.spacing0
    }

    /// Whether a velocity's cell touches the disc of the speeds looked for.
    pub(super) fn is_wanted(&self, level: usize, i: usize, j: usize) -> bool {
        let half = 0.5 * self.spacing0 / (1u64 << level) as f64;
        let near = |i| (self.velocity(level, i).abs() - half).max(0.0);
        near(i).hypot(near(j)) <= self.max_speed
    }

    /// Number of velocities of the longest sum.
    pub(super) fn count(&self) -> usize {
        let n = self.n_axis(self.top);
        (0..n).map(|i| (0..n).filter(|&j| self.is_wanted(self.top, i, j)).count()).sum()
    }

    /// Takes the frames' times, s, the newest first and 0 there.
    pub(super) fn plan(&mut self, times_s: &[f64]) {
        for k in 0..=self.top {
            let (n, blocks) = (self.roots << k, times_s.len() >> k);
            let (below, here) = self.paths.split_at_mut(k);
            let here = &mut here[0];
            here.clear();
            self.shifts[k].clear();
            for c in 0..blocks {
                for i in 0..n {
                    let Some(below) = below.last() else {
                        here.push(Path { offset_px: 0.0, time_s: times_s[c] });
                        continue;
                    };
                    let spacing = self.spacing0 / (1u64 << k) as f64;
                    let v = (i as f64 + 0.5) * spacing - 0.5 * self.roots as f64 * self.spacing0;
                    let (newer, older) = (below[2 * c * (n / 2) + i / 2], below[(2 * c + 1) * (n / 2) + i / 2]);
                    let d = (v * (older.time_s - newer.time_s) - (older.offset_px - newer.offset_px)).round();
                    self.shifts[k].push(d as i32);
                    here.push(Path {
                        offset_px: 0.5 * (newer.offset_px + d + older.offset_px),
                        time_s: 0.5 * (newer.time_s + older.time_s),
                    });
                }
            }
        }
    }

    /// By how many pixels the older half of block `c` is read on, on one axis.
    pub(super) fn shift(&self, level: usize, c: usize, i: usize) -> i32 {
        self.shifts[level][c * (self.roots << level) + i]
    }

    /// Where the longest sum's line lies in the newest frame, relative to the pixel that it is summed at, px.
    pub(super) fn offset(&self, i: usize) -> f64 {
        let path = self.paths[self.top][i];
        path.offset_px - self.velocity(self.top, i) * path.time_s
    }

    /// Whole-pixel offset of the longest sum's path in each frame, the newest first: what the shifts amount to.
    #[cfg(test)]
    pub(super) fn path(&self, i: usize) -> Vec<i32> {
        fn add(v: &Velocities, level: usize, c: usize, i: usize, from: i32, out: &mut Vec<i32>) {
            if level == 0 {
                out.push(from);
                return;
            }
            add(v, level - 1, 2 * c, i / 2, from, out);
            add(v, level - 1, 2 * c + 1, i / 2, from + v.shift(level, c, i), out);
        }
        let mut out = Vec::new();
        add(self, self.top, 0, i, 0, &mut out);
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean square of a path about the line that it stands for, px², and its largest distance.
    fn misfit(v: &Velocities, times: &[f64], i: usize) -> (f64, f64) {
        let (speed, at) = (v.velocity(v.top, i), v.offset(i));
        let off: Vec<f64> = v.path(i).iter().zip(times).map(|(&p, t)| f64::from(p) - (at + speed * t)).collect();
        assert!(off.iter().sum::<f64>().abs() < 1e-6, "the line runs through the middle");
        (off.iter().map(|d| d * d).sum::<f64>() / off.len() as f64, off.iter().fold(0.0, |m: f64, d| m.max(d.abs())))
    }

    #[test]
    fn paths_stay_near_their_lines_whatever_the_times() {
        let even: Vec<f64> = (0..64).map(|k| -0.04 * f64::from(k)).collect();
        // Every fifth frame is missing, the others jitter by a quarter of an interval.
        let uneven: Vec<f64> =
            (0..64).map(|k| -0.04 * f64::from(k + k / 5) + 0.01 * (f64::from(k * k % 7) / 7.0)).collect();
        for times in [even, uneven] {
            let mut v = Velocities::new(6, 1.3, 0.04, 50.0);
            v.plan(&times);
            let n = v.n_axis(6);
            let all: Vec<_> = (0..n).map(|i| misfit(&v, &times, i)).collect();
            let mean = all.iter().map(|m| m.0).sum::<f64>() / n as f64;
            // Six levels of rounding (1/48 px² each) and of a velocity a quarter of a spacing off (0.017 px²).
            assert!(mean < 0.3, "{mean}");
            assert!(all.iter().all(|m| m.1 < 2.0), "{all:?}");
        }
    }

    #[test]
    fn the_grid_covers_the_speeds_at_the_spacing_of_the_spot() {
        let v = Velocities::new(4, 1.3, 0.04, 50.0);
        let n = v.n_axis(4);
        let spacing = v.velocity(4, 1) - v.velocity(4, 0);
        assert!((spacing * 16.0 * 0.04 / 2.0 - 0.7 * 1.3).abs() < 1e-9);
        assert!(v.velocity(4, 0) - 0.5 * spacing <= -50.0 && v.velocity(4, n - 1) + 0.5 * spacing >= 50.0);
        // Each lies in the middle of one half of its parent's.
        assert!((v.velocity(4, 6) + v.velocity(4, 7) - 2.0 * v.velocity(3, 3)).abs() < 1e-9);
        let disc = std::f64::consts::PI * (50.0 / spacing).powi(2);
        assert!(v.count() as f64 > disc && (v.count() as f64) < 1.5 * disc, "{} {disc}", v.count());
    }
}
