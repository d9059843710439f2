//! A detector that the user asked for: what it needs to know is measured, whether it fits is not asked.
//!
//! Source: our own. Each is configured as where it is chosen; a size that nothing in the frames shows is assumed and said to be.

use super::cells::Pieces;
use super::request::DetectorKind;
use super::scene::{Camera, Scene};
use super::second_look::Second;
use super::{carried, cells, colour, faint, moving, particles, spots, steadied, summed};
use crate::tempo::Tempo;
use crate::{Config, Error, ErrorKind, Frame, Result, SourceInfo};

/// Side of a moving thing of which nothing was seen, as a share of the frame's width.
const ASSUMED_SIDE: f64 = 0.05;

/// What is said where a size is assumed.
const NOTHING_SEEN: &str = "Nothing of that kind is seen in the frames looked at: the size is assumed.";

/// Writes detector and tracker of that kind; `frames` are the first ones, `second` those of the second look, if there are any.
/// # Errors
/// No colour of a moving thing's own; frames of more than one size or pixel type.
pub fn configure(
    kind: DetectorKind,
    frames: &[Frame],
    second: &Second<'_>,
    scene: &Scene,
    interval_s: f64,
    info: &SourceInfo,
    n_threads: usize,
    config: &mut Config,
    reasons: &mut Vec<String>,
) -> Result<()> {
    reasons.push(format!("The detector is the one asked for: {kind}, for {}.", kind.purpose()));
    let tempo = Tempo::of(interval_s);
    match kind {
        DetectorKind::Isolated => {
            spots::configure(&spots::look(frames, &scene.ground, info, n_threads)?, tempo, info, config, reasons);
        }
        DetectorKind::Cfar => {
            spots::configure(
                &spots::look(frames, &scene.ground, info, n_threads)?,
                tempo,
                info,
                config,
                &mut Vec::new(),
            );
            faint::configure_asked(
                &faint::better(faint::count(frames, &scene.ground, info, n_threads)?.0),
                config,
                reasons,
            );
        }
        DetectorKind::Integrate => {
            spots::configure(
                &spots::look(frames, &scene.ground, info, n_threads)?,
                tempo,
                info,
                config,
                &mut Vec::new(),
            );
            summed::configure(scene, interval_s, config, reasons);
        }
        DetectorKind::Bernoulli => {
            spots::configure(
                &spots::look(frames, &scene.ground, info, n_threads)?,
                tempo,
                info,
                config,
                &mut Vec::new(),
            );
            carried::configure(scene, interval_s, info, config, reasons);
        }
        DetectorKind::Moving => {
            let (scene, looked) = second.shaken.clone().unwrap_or_else(|| (scene, second.or(frames)));
            let explained = scene.explained(&looked, info, n_threads)?;
            moving::configure(&seen_or_assumed(scene, info, reasons), explained, tempo, info, config, reasons);
        }
        DetectorKind::Steadied => steadied::configure_asked(frames, scene, tempo, info, config, reasons)?,
        DetectorKind::Spot => {
            let seen = match cells::look(frames, info, n_threads)? {
                Some(Pieces::Spots(seen) | Pieces::FewSpots(seen)) => seen,
                _ => particles::count(frames, info, n_threads)?.seen,
            };
            reasons.extend((seen.per_frame <= 0.0).then(|| NOTHING_SEEN.to_string()));
            particles::configure(&seen, frames, info, n_threads, interval_s, config, reasons)?;
        }
        DetectorKind::Local => {
            let seen = cells::count(frames, info, n_threads)?.0;
            reasons.extend((seen.per_frame <= 0.0).then(|| NOTHING_SEEN.to_string()));
            cells::configure(&seen, info, interval_s, config, reasons);
        }
        DetectorKind::Colour => {
            let Some(reference) = colour::look(&second.coloured, scene, info) else {
                return Err(Error::new(
                    ErrorKind::Config,
                    "no moving thing with a colour of its own was seen before a fixed camera",
                )
                .at("--detector colour")
                .hint("give the colour in a configuration: detector.threshold.colour.reference = [red, green, blue]"));
            };
            colour::configure(&reference, tempo, info, config, reasons);
        }
    }
    Ok(())
}

/// The scene, with an assumed size where nothing was seen to move.
fn seen_or_assumed(scene: &Scene, info: &SourceInfo, reasons: &mut Vec<String>) -> Scene {
    let mut scene = scene.clone();
    if scene.camera == Camera::Moving {
        reasons.push("The camera moves: what it passes over is taken for moving things.".to_string());
    }
    if scene.area_px <= 0.0 {
        let side = ASSUMED_SIDE * info.width as f64;
        scene.size_px = [side, side];
        scene.area_px = side * side;
        reasons.push(format!("Nothing moves in the frames looked at: {side:.0} px are assumed."));
    }
    scene
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vision::threshold::ThresholdConfig;
    use crate::{FrameIndex, Image, PixelKind, Pixels, Timestamp};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// What is written for a kind on 24 frames of noise, with a bright square that moves if `target`.
    fn asked(kind: DetectorKind, target: bool) -> Result<(Config, Vec<String>)> {
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        let frames: Vec<Frame> = (0..24u64)
            .map(|k| {
                let noise = (0..160 * 120).map(|_| 50 + rng.random_range(0..8u8)).collect();
                let mut image = Image::from_vec(160, 120, noise).unwrap();
                if target {
                    (40..48).for_each(|y| image.row_mut(y)[10 + 5 * k as usize..20 + 5 * k as usize].fill(220));
                }
                Frame {
                    index: FrameIndex(k),
                    time: Timestamp::from_secs_f64(0.04 * k as f64),
                    pixels: Pixels::Gray8(image),
                }
            })
            .collect();
        let info = SourceInfo {
            label: String::new(),
            reader: String::new(),
            width: 160,
            height: 120,
            kind: PixelKind::Gray8,
            n_frames: Some(24),
            rate_hz: Some(25.0),
            true_times: true,
        };
        let scene = super::super::scene::look(&frames, &info)?;
        let (mut config, mut reasons) = (Config::default(), Vec::new());
        configure(kind, &frames, &Second::default(), &scene, 0.04, &info, 1, &mut config, &mut reasons)?;
        Ok((config, reasons))
    }

    #[test]
    fn what_is_asked_for_is_written_whatever_the_frames_show() {
        for target in [true, false] {
            for kind in DetectorKind::ALL.into_iter().filter(|k| *k != DetectorKind::Colour) {
                let (config, reasons) = asked(kind, target).unwrap();
                let written = match &config.detector.threshold {
                    ThresholdConfig::Isolated(_) => DetectorKind::Isolated,
                    ThresholdConfig::Cfar(_) => DetectorKind::Cfar,
                    ThresholdConfig::Integrate(_) => DetectorKind::Integrate,
                    ThresholdConfig::Bernoulli(_) => DetectorKind::Bernoulli,
                    ThresholdConfig::Moving(_) => DetectorKind::Moving,
                    ThresholdConfig::Steadied(_) => DetectorKind::Steadied,
                    ThresholdConfig::Spot(_) => DetectorKind::Spot,
                    ThresholdConfig::Local(_) => DetectorKind::Local,
                    other => panic!("{kind}: {other:?}"),
                };
                assert_eq!(written, kind);
                config.validate().unwrap();
                assert!(reasons[0].contains(kind.name()), "{reasons:?}");
                if kind == DetectorKind::Local && !target {
                    assert_eq!(reasons[1], NOTHING_SEEN);
                }
            }
        }
        let size = |target| asked(DetectorKind::Moving, target).unwrap().0.detector.cluster.min_area_px.unwrap();
        assert!(size(true) > 9 && size(true) != size(false), "the size that moves: {} {}", size(true), size(false));
    }

    #[test]
    fn a_colour_that_nothing_has_is_an_error_with_the_way_out() {
        let error = asked(DetectorKind::Colour, true).unwrap_err().to_string();
        assert!(error.contains("--detector colour") && error.contains("reference"), "{error}");
    }
}
