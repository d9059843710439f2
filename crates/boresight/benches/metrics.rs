//! Time of the evaluation: CLEAR + identity + HOTA of 500 frames x 100 tracks, and GOSPA of 1000 targets.

use boresight::metrics::set::{SetDistance, SetOptions};
use boresight::metrics::{MatchOptions, mot_scores};
use boresight::{PixelOrigin, TrackRow, TrackTable};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn main() {
    divan::main();
}

fn field(n: usize) -> Vec<[f64; 2]> {
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    let side = 60.0 * (n as f64).sqrt();
    (0..n).map(|_| [rng.random::<f64>() * side, rng.random::<f64>() * side]).collect()
}

fn tables(frames: u32, n: usize) -> (TrackTable, TrackTable) {
    let (mut rng, start) = (ChaCha8Rng::seed_from_u64(7), field(n));
    let (mut truth, mut result) = (Vec::new(), Vec::new());
    for frame in 0..frames {
        for (k, p) in start.iter().enumerate() {
            let (x, y) = (p[0] + f64::from(frame) * 0.3, p[1]);
            let row = TrackRow { frame, id: k as i64, bbox: [x, y, 20.0, 20.0], ..TrackRow::default() };
            truth.push(row);
            if rng.random::<f64>() < 0.9 {
                let mut shift = || rng.random::<f64>() * 4.0 - 2.0;
                result.push(TrackRow { bbox: [x + shift(), y + shift(), 20.0, 20.0], ..row });
            }
        }
    }
    let table = |rows| TrackTable::from_rows("bench", PixelOrigin::Centre0, rows).expect("finite rows");
    (table(truth), table(result))
}

#[divan::bench]
fn clear_identity_hota_500_frames_x_100_tracks(b: divan::Bencher<'_, '_>) {
    let (t, r) = tables(500, 100);
    b.bench_local(|| mot_scores(&t, &r, &MatchOptions::default()));
}

#[divan::bench]
fn gospa_of_1000_targets(b: divan::Bencher<'_, '_>) {
    let t = field(1000);
    let r: Vec<[f64; 2]> = t.iter().map(|p| [p[0] + 1.0, p[1] - 1.5]).collect();
    let (mut d, o) = (SetDistance::default(), SetOptions::default());
    b.bench_local(|| d.gospa(&t, &r, &o));
}
