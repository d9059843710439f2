//! Worker for the comparison with peers, workload W1: threshold, 8-neighbour clusters and weighted centroids of one 8-bit frame.
//!
//! Build: `cargo build --release -p peers --bin peer_w1`; peers entry:
//! `{"name": "boresight", "workload": "W1", "kind": "worker", "command": "target/release/peer_w1"}`.

use boresight::Image;
use boresight::vision::ClusterConfig;
use boresight::vision::Clusterer;
use boresight::vision::threshold::{band_bits, words};
use peers::{Fault, Job, serve};
use serde_json::Value;

struct Segmentation {
    frame: Image<u8>,
    band: (u8, u8),
    clusters: Clusterer,
    bits: Vec<u64>,
    /// x, y, area, sum of each cluster.
    rows: Vec<f64>,
}

impl Job for Segmentation {
    fn run(&mut self) {
        self.clusters.begin(self.frame.width());
        for y in 0..self.frame.height() {
            let row = self.frame.row(y);
            band_bits(row, self.band.0, self.band.1, &mut self.bits);
            self.clusters.row(y, &self.bits, row);
        }
        self.rows.clear();
        for r in self.clusters.regions() {
            self.rows.extend_from_slice(&[r.sum_x / r.sum, r.sum_y / r.sum, f64::from(r.area), r.sum]);
        }
    }

    fn result(&mut self) -> (Vec<f64>, usize) {
        (self.rows.clone(), 4)
    }

    fn units(&self) -> f64 {
        1.0
    }
}

/// Reads a `.npy` of unsigned bytes in C order.
fn read_frame(path: &str) -> Result<Image<u8>, Fault> {
    let bytes = std::fs::read(path)?;
    let length = usize::from(u16::from_le_bytes([*bytes.get(8).ok_or("short")?, *bytes.get(9).ok_or("short")?]));
    let header = std::str::from_utf8(bytes.get(10..10 + length).ok_or("short")?)?;
    if !header.contains("'|u1'") || header.contains("'fortran_order': True") {
        return Err(format!("{path}: expected unsigned bytes in C order, found {header}").into());
    }
    let shape = header.split("'shape': (").nth(1).and_then(|s| s.split(')').next()).ok_or("no shape")?;
    let sizes: Vec<usize> = shape.split(',').filter_map(|s| s.trim().parse().ok()).collect();
    let [h, w] = sizes[..] else { return Err(format!("{path}: expected two dimensions").into()) };
    Image::from_vec(w, h, bytes[10 + length..].to_vec()).ok_or_else(|| "length and shape differ".into())
}

fn load(message: &Value) -> Result<Box<dyn Job>, Fault> {
    let level = |key: &str| message["params"][key].as_u64().and_then(|v| u8::try_from(v).ok()).ok_or("no band");
    let frame = read_frame(message["inputs"]["frame"].as_str().ok_or("no frame")?)?;
    // 8 neighbours.
    let clusters = Clusterer::new(&ClusterConfig { distance_px: 2.0, ..Default::default() });
    let bits = vec![0; words(frame.width())];
    Ok(Box::new(Segmentation { frame, band: (level("lo")?, level("hi")?), clusters, bits, rows: Vec::new() }))
}

fn main() -> Result<(), Fault> {
    serve(load)
}
