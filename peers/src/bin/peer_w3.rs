//! Worker for the comparison with peers, workload W3: predict + update of 4 states and 2 measurements, many tracks.
//!
//! Argument: `batch` (lanes, the default), `kf` (one structured Kalman filter a track), `dense` (its structure hidden),
//! `ud`, `srif`. All step frame by frame over the tracks, as a tracker does. Protocol: the library `peers`.
//! Build: `cargo build --release -p peers --bin peer_w3`; peers entry:
//! `{"name": "boresight-batch", "workload": "W3", "kind": "worker", "command": "target/release/peer_w3 batch"}`.

use boresight_filters::batch::{AxisNoise, Lanes, Variance, step_all_with};
use boresight_filters::model::{ConstantVelocity, Dense};
use boresight_filters::{Gaussian, GaussianFilter, Kf, Measurement, Srif, Start, Ud};
use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};
use peers::{Fault, Job};
use serde_json::Value;

/// Tracks side by side in one pack.
const LANES: usize = 8;

struct Input {
    z: Vec<[f64; 2]>,
    n: usize,
    frames: usize,
    noise: AxisNoise,
    start: Gaussian<4>,
    r: f64,
}

/// The workload's order is x, y, vx, vy; ours is x, vx, y, vy.
const ORDER: [usize; 4] = [0, 2, 1, 3];

fn read(message: &Value) -> Result<Input, Fault> {
    let (values, shape) = peers::read_npy(&std::fs::read(message["inputs"]["z"].as_str().ok_or("no z")?)?)?;
    let [frames, n, 2] = shape[..] else { return Err("z is not [frames, tracks, 2]".into()) };
    let matrix = |key: &str| -> Result<Matrix4<f64>, Fault> {
        let list = message["params"][key].as_array().ok_or("no matrix")?;
        let v: Vec<f64> = list.iter().filter_map(Value::as_f64).collect();
        if v.len() != 16 {
            return Err(format!("{key} is not 4 x 4").into());
        }
        let m = Matrix4::from_row_slice(&v);
        Ok(Matrix4::from_fn(|r, c| m[(ORDER[r], ORDER[c])]))
    };
    let (q, p0) = (matrix("q")?, matrix("p0")?);
    let noise = AxisNoise { q00: q[(0, 0)], q01: q[(0, 1)], q11: q[(1, 1)] };
    Ok(Input {
        z: values.as_chunks::<2>().0.to_vec(),
        n,
        frames,
        noise,
        start: Gaussian { mean: Vector4::zeros(), cov: p0 },
        r: message["params"]["r"].as_f64().ok_or("no r")?,
    })
}

struct Batch {
    input: Input,
    packs: Vec<Lanes<LANES>>,
}

impl Job for Batch {
    fn run(&mut self) {
        let i = &self.input;
        let mut first = Lanes::<LANES>::default();
        for lane in 0..LANES {
            first.set(lane, &i.start).expect("the workload's start is a belief");
        }
        self.packs.clear();
        self.packs.resize(i.n.div_ceil(LANES), first);
        for z in i.z.chunks_exact(i.n) {
            step_all_with(1.0, i.noise, &mut self.packs, z, Variance::Same(i.r)).expect("the workload's numbers");
        }
    }
    fn result(&mut self) -> (Vec<f64>, usize) {
        let beliefs = (0..self.input.n).filter_map(|k| self.packs[k / LANES].get(k % LANES));
        (beliefs.flat_map(|b| ORDER.map(|i| b.mean[i])).collect(), 4)
    }
    fn units(&self) -> f64 {
        (self.input.n * self.input.frames) as f64
    }
}

/// One filter of any form per track.
struct Each<F> {
    input: Input,
    first: F,
    filters: Vec<F>,
}

impl<F: GaussianFilter<4, Real = f64>> Job for Each<F> {
    fn run(&mut self) {
        let i = &self.input;
        self.filters.clear();
        self.filters.resize(i.n, self.first.clone());
        let cov = Matrix2::identity() * i.r;
        for z in i.z.chunks_exact(i.n) {
            for (f, z) in self.filters.iter_mut().zip(z) {
                f.predict(1.0).expect("a step of 1 s");
                f.correct(&Measurement { position: Vector2::from(*z), cov }).expect("the workload's numbers");
            }
        }
    }
    fn result(&mut self) -> (Vec<f64>, usize) {
        (self.filters.iter().flat_map(|f| ORDER.map(|i| f.belief().mean[i])).collect(), 4)
    }
    fn units(&self) -> f64 {
        (self.input.n * self.input.frames) as f64
    }
}

fn each<F: GaussianFilter<4, Real = f64> + 'static>(input: Input, first: F) -> Box<dyn Job> {
    Box::new(Each { input, first, filters: Vec::new() })
}

fn main() -> Result<(), Fault> {
    let form = std::env::args().nth(1).unwrap_or_else(|| "batch".into());
    peers::serve(|message| {
        let i = read(message)?;
        // The workload's Q is given as numbers for its one step of 1 s.
        let cv = ConstantVelocity::for_step(i.noise)?;
        let b = i.start;
        Ok(match form.as_str() {
            "batch" => Box::new(Batch { input: i, packs: Vec::new() }),
            "kf" => each(i, Kf::start(cv, b)?),
            "dense" => each(i, Kf::start(Dense(cv), b)?),
            "ud" => each(i, Ud::start(cv, b)?),
            "srif" => each(i, Srif::start(cv, b)?),
            other => return Err(format!("no form {other}; there are batch, kf, dense, ud, srif").into()),
        })
    })
}
