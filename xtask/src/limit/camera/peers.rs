//! OpenCV on the same pairs: written to a folder, run by `scripts/camera_peers.py`, judged as ours.

use super::judge::{Answer, Judged};
use super::pairs::Pair;
use anyhow::{Context, Result, ensure};
use boresight::Image;
use nalgebra::{Matrix3, Vector2};
use std::io::Write as _;
use std::path::Path;
use std::process::Command;

/// What the peers said: by method, of each pair (none where it was not asked), and the time a frame of the film, s.
#[derive(Default)]
pub struct Peers {
    pub pairs: Vec<(String, Vec<Option<Judged>>)>,
    pub film: Vec<(String, f64)>,
}

pub fn run(python: &Path, pairs: &[Pair], film: &[Image<u8>]) -> Result<Peers> {
    let folder = std::env::temp_dir().join(format!("boresight-camera-peers-{}", std::process::id()));
    std::fs::create_dir_all(&folder)?;
    let (mut images, mut index) =
        (std::io::BufWriter::new(std::fs::File::create(folder.join("images.bin"))?), String::new());
    for (group, view) in
        pairs.iter().flat_map(|p| &p.views).map(|v| ("pair", v)).chain(film.iter().map(|v| ("film", v)))
    {
        images.write_all(view.as_slice())?;
        index += &format!("{group},{},{}\n", view.width(), view.height());
    }
    images.flush()?;
    std::fs::write(folder.join("index.csv"), index)?;
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scripts/camera_peers.py");
    let out = Command::new(python).arg(script).arg(&folder).output()?;
    ensure!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let mut peers = Peers::default();
    for row in
        csv::ReaderBuilder::new().has_headers(false).flexible(true).from_path(folder.join("answers.csv"))?.records()
    {
        let row = row?;
        let field = |i: usize| row.get(i).context("a short row");
        let (method, k, time_s) = (field(0)?, field(1)?, field(2)?.parse::<f64>()?);
        if k == "film" {
            peers.film.push((method.to_string(), time_s));
            continue;
        }
        let k: usize = k.parse()?;
        if peers.pairs.last().is_none_or(|(name, _)| name != method) {
            peers.pairs.push((method.to_string(), pairs.iter().map(|_| None).collect()));
        }
        let Some((_, judged)) = peers.pairs.last_mut() else { continue };
        let pair = &pairs[k];
        let answer = if field(3)?.is_empty() {
            None
        } else {
            let numbers = (3..12).map(|i| Ok(field(i)?.parse::<f64>()?)).collect::<Result<Vec<f64>>>()?;
            let m = Matrix3::from_row_slice(&numbers);
            let place = |p: Vector2<f64>| {
                let q = m * p.push(1.0);
                Vector2::new(q.x / q.z, q.y / q.z)
            };
            Some(Answer::of(pair, place, |_| None))
        };
        judged[k] = Some(Judged::of(pair, (answer, time_s)));
    }
    std::fs::remove_dir_all(&folder)?;
    Ok(peers)
}
