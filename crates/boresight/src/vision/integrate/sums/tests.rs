//! Shared sums against direct ones.

use super::*;
use proptest::prelude::*;

/// The same by a direct sum over the frames, pixel by pixel.
fn direct(sums: &Sums, of: &Velocities, times_s: &[f64], phi: &Phi) -> Extremes {
    let Sums { width, height, stride, .. } = *sums;
    let zero = || vec![0i16; stride * height];
    let at = || vec![0u16; stride * height];
    let mut e = Extremes { best: zero(), best_at: at(), worst: zero(), worst_at: at() };
    let mut weights = Vec::new();
    for (n, &(i, j)) in sums.velocities.iter().enumerate() {
        let (px, py) = (of.path(i as usize), of.path(j as usize));
        weights_of(of, (i as usize, j as usize), times_s, phi, &mut weights);
        for y in 0..height {
            for x in 0..width {
                let mut sum = 0i64;
                for (age, frame) in sums.frames().iter().enumerate() {
                    let (x, y) = (x as i64 + i64::from(px[age]), y as i64 + i64::from(py[age]));
                    if (0..width as i64).contains(&x) && (0..height as i64).contains(&y) {
                        sum += i64::from(frame[y as usize * stride + x as usize]);
                    }
                }
                let score = ((sum * i64::from(weights[y / CELL * phi.cells_x + x / CELL])) >> 16) as i16;
                let p = y * stride + x;
                if score > e.best[p] {
                    (e.best[p], e.best_at[p]) = (score, n as u16);
                }
                if score < e.worst[p] {
                    (e.worst[p], e.worst_at[p]) = (score, n as u16);
                }
            }
        }
    }
    e
}

/// A path that leaves a narrow frame within half the memory has nothing to be joined with, in either direction.
#[test]
fn a_shift_longer_than_the_row_joins_nothing() {
    let geometry = Geometry { width: 1, height: 2, stride: CELL };
    let (newer, older) = (vec![3i16; 2 * CELL], vec![5i16; 2 * CELL]);
    for shift in
        [(1 + CELL as i32, 0), (-1 - CELL as i32, 0), (CELL as i32, 1), (i32::MAX, 0), (i32::MIN, 0), (0, i32::MAX)]
    {
        let mut out = vec![0; 2 * CELL];
        join(&newer, &older, shift, geometry, &mut out);
        let met = i16::from(shift.0 == 0 && shift.1 == 0) * 5;
        assert!((0..2).all(|y| out[y * CELL] == 3 + met), "{shift:?}: {out:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn shared_sums_are_the_direct_sums_to_the_last_bit(
        width in 1usize..70, height in 1usize..40, top in 2usize..5, speed in 1.0f64..60.0, seed in 1u64..u64::MAX,
    ) {
        let n = 1 << top;
        let mut state = seed;
        let mut random = move || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            state
        };
        let mut t = 0.0;
        let times_s: Vec<f64> = (0..n).map(|k| {
            t -= if k == 0 { 0.0 } else { 0.04 * (0.5 + (random() % 100) as f64 / 70.0) };
            t
        }).collect();
        let mut of = Velocities::new(top, 1.3, 0.04, speed);
        of.plan(&times_s);
        let mut sums = Sums::new(width, height, top, of.count());
        let stride = width.next_multiple_of(CELL);
        // A path that runs along the border may leave and come back by its rounding, and what is then in it is not summed: the border
        // itself is left empty here.
        let inner = |p: usize, n: usize| (3..n.saturating_sub(3)).contains(&p);
        for frame in sums.frames_mut() {
            for (p, v) in frame.iter_mut().enumerate() {
                let value = (random() % 401) as i16 - 200;
                *v = if inner(p % stride, width) && inner(p / stride, height) { value } else { 0 };
            }
        }
        let cells_x = stride / CELL;
        let phi = Phi {
            cells: (0..cells_x * height.div_ceil(CELL)).map(|_| 0.5 + (random() % 100) as f32 / 100.0).collect(),
            cells_x,
            frames: (0..n).map(|_| 0.5 + (random() % 100) as f32 / 100.0).collect(),
            unit: 1.0,
        };
        sums.search(&of, &times_s, &phi);
        prop_assert_eq!(sums.velocities.len(), of.count());
        let direct = direct(&sums, &of, &times_s, &phi);
        for y in 0..height {
            let row = y * stride..y * stride + width;
            prop_assert_eq!(&sums.extremes.best[row.clone()], &direct.best[row.clone()]);
            prop_assert_eq!(&sums.extremes.best_at[row.clone()], &direct.best_at[row.clone()]);
            prop_assert_eq!(&sums.extremes.worst[row.clone()], &direct.worst[row.clone()]);
            prop_assert_eq!(&sums.extremes.worst_at[row.clone()], &direct.worst_at[row]);
        }
    }
}
