//! Checks of a scene: the first parameter that is wrong, by its place.
//!
//! Limits: sizes and counts are bounded so that no scene can ask for unbounded memory.

use super::scene::{Background, SceneConfig, Shape};
use crate::Result;
use crate::validate::check_shown;

impl SceneConfig {
    /// Checks every parameter; `at` names the place in messages.
    /// # Errors
    /// [`crate::ErrorKind::Config`] that names the first wrong parameter.
    pub fn validate(&self, at: &str) -> Result<()> {
        let check =
            |ok: bool, key: &str, value: &dyn std::fmt::Debug, want: &str| check_shown(ok, at, key, value, want);
        let spread = |v: f64| v >= 0.0 && v.is_finite();
        let share = |v: f64| (0.0..=1.0).contains(&v);
        check((1..=16384).contains(&self.width_px), "width-px", &self.width_px, "1..=16384")?;
        check((1..=16384).contains(&self.height_px), "height-px", &self.height_px, "1..=16384")?;
        check(self.rate_hz > 0.0 && self.rate_hz <= 1e6, "rate-hz", &self.rate_hz, "a rate above 0, at most 1e6")?;
        check((8..=16).contains(&self.bits), "bits", &self.bits, "8..=16")?;
        match &self.background {
            Background::White(w) => {
                check(spread(w.std) && w.mean.is_finite(), "background.white.std", &w.std, "a number, 0 or more")?
            }
            Background::Correlated(c) => {
                check(spread(c.std) && c.mean.is_finite(), "background.correlated.std", &c.std, "a number, 0 or more")?;
                check(
                    (0.0..=64.0).contains(&c.length_px),
                    "background.correlated.length-px",
                    &c.length_px,
                    "0..=64 px",
                )?;
                check(share(c.coherence), "background.correlated.coherence", &c.coherence, "0..=1")?;
            }
            Background::Gradient(g) => {
                check(spread(g.std) && g.level.is_finite(), "background.gradient.std", &g.std, "a number, 0 or more")?;
                check(
                    g.slope_per_px.iter().all(|v| v.is_finite()),
                    "background.gradient.slope-per-px",
                    &g.slope_per_px,
                    "finite numbers",
                )?;
            }
            Background::Ground(g) => {
                let spreads = [g.std, g.noise_std];
                check(
                    spreads.iter().all(|&v| spread(v)) && g.mean.is_finite(),
                    "background.ground.std",
                    &spreads,
                    "numbers, 0 or more",
                )?;
                let sound = (1.0..=1024.0).contains(&g.length_px);
                check(sound, "background.ground.length-px", &g.length_px, "1..=1024 px")?;
            }
            Background::File(path) => {
                check(!path.is_empty(), "background.file", path, "the path of a picture or a video")?
            }
        }
        let c = &self.camera;
        let speeds = [c.pan_px_per_s[0], c.pan_px_per_s[1], c.rotation_deg_per_s, c.zoom_per_s];
        check(speeds.iter().all(|v| v.is_finite() && v.abs() < 1e6), "camera", &speeds, "finite numbers")?;
        for (i, r) in self.radars.iter().enumerate() {
            r.validate(&format!("{at}.radars[{i}]"))?;
            let again = self.radars.iter().take(i).any(|other| other.name == r.name);
            check(!again, &format!("radars[{i}].name"), &r.name, "a name of its own for each radar")?;
        }
        for (i, t) in self.targets.iter().enumerate() {
            let key = |k: &str| format!("targets[{i}].{k}");
            check(
                t.start_px.iter().all(|v| v.is_finite() && v.abs() < 1e9),
                &key("start-px"),
                &t.start_px,
                "finite numbers",
            )?;
            check(
                t.velocity_px_per_s.iter().all(|v| v.is_finite() && v.abs() < 1e9),
                &key("velocity-px-per-s"),
                &t.velocity_px_per_s,
                "finite numbers",
            )?;
            check(spread(t.appears_s), &key("appears-s"), &t.appears_s, "a time, 0 or more")?;
            check(
                t.vanishes_s.is_none_or(|v| v > t.appears_s),
                &key("vanishes-s"),
                &t.vanishes_s,
                "a time after appears-s",
            )?;
            check(t.growth_per_s.is_finite(), &key("growth-per-s"), &t.growth_per_s, "a finite number")?;
            t.motion.validate(&format!("{at}.{}", key("motion")))?;
            match &t.shape {
                Shape::Rectangle(r) => {
                    check(
                        r.size_px.iter().all(|n| (1..=4096).contains(n)),
                        &key("shape.rectangle.size-px"),
                        &r.size_px,
                        "1..=4096 px each",
                    )?;
                    check(
                        spread(r.std) && r.mean.is_finite(),
                        &key("shape.rectangle.std"),
                        &r.std,
                        "a number, 0 or more",
                    )?;
                }
                Shape::Spot(s) => {
                    check(
                        spread(s.sigma_px) && s.sigma_px <= 1024.0,
                        &key("shape.spot.sigma-px"),
                        &s.sigma_px,
                        "0..=1024 px",
                    )?;
                    check(
                        s.psf_sigma_px > 0.0 && s.psf_sigma_px <= 1024.0,
                        &key("shape.spot.psf-sigma-px"),
                        &s.psf_sigma_px,
                        "above 0, at most 1024 px",
                    )?;
                    check(s.total.is_finite(), &key("shape.spot.total"), &s.total, "a finite number")?;
                }
                Shape::Textured(x) => {
                    check(
                        x.size_px.iter().all(|n| *n > 0.0 && *n <= 4096.0),
                        &key("shape.textured.size-px"),
                        &x.size_px,
                        "above 0, at most 4096 px each",
                    )?;
                    check(
                        spread(x.contrast) && x.mean.is_finite(),
                        &key("shape.textured.contrast"),
                        &x.contrast,
                        "a number, 0 or more",
                    )?;
                    check(
                        x.grain_px > 0.0 && x.grain_px <= 4096.0,
                        &key("shape.textured.grain-px"),
                        &x.grain_px,
                        "above 0, at most 4096 px",
                    )?;
                }
            }
        }
        for (i, o) in self.occluders.iter().enumerate() {
            check(spread(o.std) && o.mean.is_finite(), &format!("occluders[{i}].std"), &o.std, "a number, 0 or more")?;
        }
        let s = &self.sensor;
        check((0.0..=32.0).contains(&s.blur_sigma_px), "sensor.blur-sigma-px", &s.blur_sigma_px, "0..=32 px")?;
        check(
            s.electrons_per_count.is_none_or(|e| e > 0.0 && e.is_finite()),
            "sensor.electrons-per-count",
            &s.electrons_per_count,
            "a number above 0",
        )?;
        for (key, v) in [
            ("read-noise", s.read_noise),
            ("offset-std", s.offset_std),
            ("gain-std", s.gain_std),
            ("jitter-px", s.jitter_px),
        ] {
            check(spread(v), &format!("sensor.{key}"), &v, "a number, 0 or more")?;
        }
        check(share(s.dead_share), "sensor.dead-share", &s.dead_share, "0..=1")?;
        check(share(s.salt_pepper_share), "sensor.salt-pepper-share", &s.salt_pepper_share, "0..=1")?;
        check(
            s.saturation.is_none_or(|v| v > 0.0 && v.is_finite()),
            "sensor.saturation",
            &s.saturation,
            "a number above 0",
        )?;
        check(
            (0.0..1.0).contains(&self.clock.dropped_share),
            "clock.dropped-share",
            &self.clock.dropped_share,
            "0 up to below 1",
        )?;
        check(spread(self.clock.jitter_s), "clock.jitter-s", &self.clock.jitter_s, "a number, 0 or more")
    }
}
