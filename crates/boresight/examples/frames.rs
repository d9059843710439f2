//! Lists the frames of any input: number, time, size, pixel type and a checksum; `--raw` writes their bytes instead.
//!
//! `cargo run --example frames -- 'frames/*.png' [--gray|--rgb] [--raw]`

use boresight::io::{Colour, OpenOptions, open};
use boresight::{Pixels, Result};
use std::io::Write;

fn main() {
    if let Err(error) = run() {
        eprintln!("error: {error}");
        std::process::exit(1);
    }
}

fn run() -> Result<()> {
    let mut options = OpenOptions::default();
    let (mut input, mut raw) = (String::from("-"), false);
    for word in std::env::args().skip(1) {
        match word.as_str() {
            "--gray" => options.colour = Colour::Gray,
            "--rgb" => options.colour = Colour::Rgb,
            "--raw" => raw = true,
            _ => input = word,
        }
    }
    let mut source = open(input, &options)?;
    eprintln!("{:?}", source.info());
    let mut out = std::io::stdout().lock();
    while let Some(frame) = source.next_frame()? {
        let bytes: Vec<u8> = match &frame.pixels {
            Pixels::Gray8(i) => i.as_slice().to_vec(),
            Pixels::Gray16(i) => i.as_slice().iter().flat_map(|v| v.to_le_bytes()).collect(),
            Pixels::GrayF32(i) => i.as_slice().iter().flat_map(|v| v.to_le_bytes()).collect(),
            Pixels::Rgb8(i) => i.as_slice().as_flattened().to_vec(),
        };
        let written = if raw {
            out.write_all(&bytes)
        } else {
            // FNV-1a, enough to tell frames apart by eye.
            let sum =
                bytes.iter().fold(0xcbf2_9ce4_8422_2325_u64, |h, b| (h ^ u64::from(*b)).wrapping_mul(0x0100_0000_01b3));
            let (w, h) = (frame.pixels.width(), frame.pixels.height());
            writeln!(out, "{} {} {w}x{h} {:?} {sum:016x}", frame.index.0, frame.time.as_secs_f64(), frame.pixels.kind())
        };
        if written.is_err() {
            return Ok(()); // the reader of our output has gone
        }
        source.recycle(frame);
    }
    for warning in source.warnings() {
        eprintln!("warning: {warning}");
    }
    Ok(())
}
