//! Writes the moving pixels of a raw 8-bit video before a fixed camera, one byte a pixel (0 or 255), and the time it took.
//!
//! `cargo run --release --example moving -- frames.gray WIDTH HEIGHT FRAMES_PER_S OUT [CONFIG.toml]`; the raw frames come
//! from `ffmpeg -i video -vf format=gray -f rawvideo frames.gray`; CONFIG holds the keys of `BackgroundConfig`.

use boresight::Image;
use boresight::vision::background::{Background, BackgroundConfig};
use std::io::{Read, Write};
use std::time::{Duration, Instant};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().collect();
    let [_, input, width, height, rate, output, rest @ ..] = &args[..] else {
        return Err("usage: moving FRAMES WIDTH HEIGHT FRAMES_PER_S OUT [CONFIG.toml]".into());
    };
    let (w, h): (usize, usize) = (width.parse()?, height.parse()?);
    let dt_s = 1.0 / rate.parse::<f64>()?;
    let config: BackgroundConfig = match rest.first() {
        Some(path) => toml::from_str(&std::fs::read_to_string(path)?)?,
        None => BackgroundConfig::default(),
    };
    let mut background = Background::<u8>::new(config)?;
    let mut file = std::io::BufReader::with_capacity(1 << 20, std::fs::File::open(input)?);
    let mut out = std::io::BufWriter::with_capacity(1 << 20, std::fs::File::create(output)?);
    let mut frame = Image::filled(w, h, 0u8);
    let mut mask = vec![0u8; w];
    let (mut n, mut spent) = (0u32, Duration::ZERO);
    while file.read_exact(frame.as_mut_slice()).is_ok() {
        let start = Instant::now();
        background.update(&frame, dt_s)?;
        spent += start.elapsed();
        n += 1;
        for y in 0..h {
            let row = background.row(y);
            for (x, m) in mask.iter_mut().enumerate() {
                *m = if row[x / 64] >> (x % 64) & 1 == 1 { 255 } else { 0 };
            }
            out.write_all(&mask)?;
        }
    }
    out.flush()?;
    println!("{n} frames, {:.3} ms a frame", spent.as_secs_f64() * 1e3 / f64::from(n.max(1)));
    Ok(())
}
