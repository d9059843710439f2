//! What a report costs: pixel-velocity sums a second and core, beside the machine's memory and a shift-and-add in NumPy.

use super::scenes::{SIGMA, detector, frame, random};
use anyhow::Result;
use boresight::Scan;
use boresight::vision::integrate::IntegrateConfig;
use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

/// Velocities of the longest sums: the cells of spacing 1.4 σ / (T dt), in a square of whole coarse cells, that touch the disc of speeds.
fn velocities(c: &IntegrateConfig, interval_s: f64) -> usize {
    let coarse = 1.4 * c.sigma_px / interval_s;
    let n = (2.0 * c.max_speed_px_per_s / coarse).ceil().max(1.0) as usize * c.frames as usize;
    let spacing = coarse / f64::from(c.frames);
    let near = |i: usize| (((i as f64 + 0.5 - 0.5 * n as f64) * spacing).abs() - 0.5 * spacing).max(0.0);
    (0..n).map(|i| (0..n).filter(|j| near(i).hypot(near(*j)) <= c.max_speed_px_per_s).count()).sum()
}

/// Bytes a second that one core reads from memory, in order.
fn memory_bandwidth() -> f64 {
    let data = vec![1u64; 64 << 20];
    let once = || {
        let start = Instant::now();
        let sums = data.chunks_exact(8).fold([0u64; 8], |mut s, c| {
            s.iter_mut().zip(c).for_each(|(s, v)| *s = s.wrapping_add(*v));
            s
        });
        std::hint::black_box(sums);
        (8 * data.len()) as f64 / start.elapsed().as_secs_f64()
    };
    (0..5).map(|_| once()).fold(0.0, f64::max)
}

pub fn table(python: Option<&Path>, page: &mut String) -> Result<()> {
    let bandwidth = memory_bandwidth();
    writeln!(
        page,
        "| frame | frames | velocities | ms a report | ms a frame | pixel-velocity sums a second and core | of them additions |"
    )?;
    writeln!(page, "| --- | --- | --- | --- | --- | --- | --- |")?;
    for (size, frames, speed) in [([640, 512], 16u32, 1.2), ([256, 256], 64, 2.0), ([256, 256], 16, 2.0)] {
        let c = IntegrateConfig {
            frames,
            sigma_px: SIGMA,
            max_speed_px_per_s: speed * super::scenes::RATE_HZ,
            ..IntegrateConfig::default()
        };
        let n = velocities(&c, 1.0 / super::scenes::RATE_HZ);
        let mut rng = random(3);
        let mut detector = detector(size, c)?;
        let mut scan = Scan::default();
        let (mut reports, mut others) = (Vec::new(), Vec::new());
        for k in 0..u64::from(frames) * 4 {
            let frame = frame(size, &[], 0.0, k, &mut rng);
            let start = Instant::now();
            detector.detect(&frame, &mut scan)?;
            let list = if scan.blind { &mut others } else { &mut reports };
            list.push(start.elapsed().as_secs_f64());
        }
        // The first report lays everything out.
        reports.remove(0);
        reports.sort_by(f64::total_cmp);
        others.sort_by(f64::total_cmp);
        let (report, other) = (reports[reports.len() / 2], others[others.len() / 2]);
        let sums = (n * size[0] * size[1]) as f64;
        let a_frame = (report - other) / (0.5 * f64::from(frames)) + other;
        writeln!(
            page,
            "| {} x {} | {frames} | {n} | {:.0} | {:.2} | {:.2e} | {:.2e} |",
            size[0],
            size[1],
            1e3 * report,
            1e3 * a_frame,
            sums / report,
            2.0 * sums / report
        )?;
    }
    writeln!(
        page,
        "\nMemory, read in order by one core: {:.1} GB/s, or {:.2e} additions of 2 bytes a second. A direct sum over 64 frames reads 128 bytes for each \
         pixel and velocity, the shared ones 4 to 8, most of them in the second cache.",
        bandwidth / 1e9,
        bandwidth / 2.0
    )?;
    if let Some(python) = python {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scripts/shift_and_add.py");
        let out = Command::new(python).arg(script).output()?;
        writeln!(page, "\nNumPy, the same machine, one thread:\n\n{}", String::from_utf8_lossy(&out.stdout).trim())?;
    }
    Ok(())
}
