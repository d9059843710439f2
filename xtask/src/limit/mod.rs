//! `cargo xtask limit`: what is reached below the noise of a frame beside what was aimed at, as Markdown, written to docs/limit.md.

mod camera;
mod carried_alarms;
mod cost;
mod crossing;
mod curve;
mod locking;
mod peers;
mod positions;
mod real;
mod scene_j;
mod scenes;
mod spot_frames;
mod turning;
mod white;

use anyhow::Result;
use std::path::PathBuf;

#[derive(clap::Args)]
pub struct Args {
    /// Only the parts whose name holds this: alarms, detection, crossing, turning, turning-alarms, real, scene, cost, positions, camera. The page is then printed, not written.
    #[arg(default_value = "")]
    only: String,
    /// Windows of eight spots for each point of the curves.
    #[arg(long, default_value_t = 25)]
    windows: u64,
    /// Runs of crossing targets.
    #[arg(long, default_value_t = 200)]
    runs: u64,
    /// Frames of noise for the false alarms of long sums; ten times as many for short ones.
    #[arg(long, default_value_t = 20_000)]
    frames: u64,
    /// Fits for each row of positions.
    #[arg(long, default_value_t = 32_000)]
    fits: usize,
    /// Pairs of views for the camera's motion.
    #[arg(long, default_value_t = 2_000)]
    pairs: usize,
    /// Seed of these pairs: those of the page are 0, others were not looked at.
    #[arg(long, default_value_t = 0)]
    seed: u32,
    /// Print the pairs of views whose motion is answered wrongly and not flagged as uncertain: those of the half that may be looked at.
    #[arg(long)]
    wrong: bool,
    /// Keys set for the real clips.
    #[arg(long = "set")]
    sets: Vec<String>,
    /// Test data (default: `BORESIGHT_TEST_DATA`).
    #[arg(long)]
    data: Option<PathBuf>,
    /// Python with NumPy, for the comparison of cost; with SciPy, trackpy and picassosr, for that of positions; with OpenCV, for that of the camera's motion.
    #[arg(long)]
    python: Option<PathBuf>,
}

const HEAD: &str = include_str!("head.txt");

pub fn run(args: &Args) -> Result<()> {
    let wanted = |name: &str| name.contains(&args.only);
    let mut page = HEAD.to_string();
    let mut part = |name: &str, text: &str, fill: &mut dyn FnMut(&mut String) -> Result<()>| -> Result<()> {
        if wanted(name) {
            let mut section = format!("\n{text}\n\n");
            fill(&mut section)?;
            if !args.only.is_empty() {
                println!("{section}");
            }
            page.push_str(&section);
        }
        Ok(())
    };
    let mut curves = Vec::new();
    part("detection", include_str!("detection.txt").trim(), &mut |p| {
        curves = white::table_of_detection(args.windows, p)?;
        Ok(())
    })?;
    part("alarms", include_str!("alarms.txt").trim(), &mut |p| {
        white::table_of_alarms(16, 10 * args.frames, p)?;
        white::table_of_alarms(64, args.frames, p)
    })?;
    part("crossing", include_str!("crossing.txt").trim(), &mut |p| crossing::table(args.runs, p))?;
    part("turning", include_str!("turning.txt").trim(), &mut |p| turning::table((args.runs / 20).max(1), p))?;
    part("turning-alarms", include_str!("turning_alarms.txt").trim(), &mut |p| {
        carried_alarms::table(args.frames / 10, p)
    })?;
    part("scene", include_str!("scene_j.txt").trim(), &mut |p| scene_j::table(p))?;
    let data = args.data.clone().unwrap_or_else(crate::data::test_data);
    part("real", include_str!("real.txt").trim(), &mut |p| real::table(&data, &args.sets, p))?;
    part("cost", include_str!("cost.txt").trim(), &mut |p| cost::table(args.python.as_deref(), p))?;
    part("positions", include_str!("positions.txt").trim(), &mut |p| {
        positions::table(args.fits, &data, args.python.as_deref(), p)
    })?;
    part("camera", include_str!("camera.txt").trim(), &mut |p| {
        camera::table((args.pairs, args.seed), &data, args.python.as_deref(), args.wrong, p)
    })?;
    if args.only.is_empty() {
        page.push_str(concat!("\n", include_str!("pictures.txt")));
        let docs = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../docs");
        std::fs::write(docs.join("limit.md"), page)?;
        std::fs::write(docs.join("images/limit.svg"), curve::svg(&curves))?;
    }
    Ok(())
}
