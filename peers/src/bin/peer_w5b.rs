//! Worker for the comparison with peers, workload W5b: Monte Carlo of the small scene, generated, segmented and followed.
//!
//! Build: `cargo build --release -p peers --bin peer_w5b`; peers entry:
//! `{"name": "boresight", "workload": "W5b", "kind": "worker", "command": "target/release/peer_w5b"}`.

use boresight_reproduce::bench_scene::BenchScene;
use peers::{Fault, Job};

/// Runs of one repetition, as the bench's own peers do.
const RUNS: u64 = 20;

struct MonteCarlo {
    scene: BenchScene,
    rows: Vec<f64>,
}

impl Job for MonteCarlo {
    fn run(&mut self) {
        self.rows.clear();
        for run in 0..RUNS {
            let (rmse, lost) = self.scene.run(55, run).unwrap_or((f64::NAN, true));
            self.rows.extend([run as f64, rmse, f64::from(u8::from(lost))]);
        }
    }

    fn result(&mut self) -> (Vec<f64>, usize) {
        (self.rows.clone(), 3)
    }

    fn units(&self) -> f64 {
        RUNS as f64
    }
}

fn main() -> Result<(), Fault> {
    peers::serve(|_| Ok(Box::new(MonteCarlo { scene: BenchScene::new()?, rows: Vec::new() })))
}
