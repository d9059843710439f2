//! Spatial filters: mean, median and Gaussian, n x n, for u8, u16 and f32 frames; general convolution; exact f64 twins.
//!
//! Source: `docs/theory/image.md`. A filter is configured by [`SpatialConfig`] and run by [`SpatialFilter`], which
//! keeps the rows of the window, so that a frame allocates nothing and can be filtered row by row, straight into a
//! threshold. Rounding: integer results round to the nearest (a mean over an odd number of pixels has no ties, so this
//! is what OpenCV's `blur` gives); f32 means are summed in f64. Median of f32: by the total order of IEEE 754.
//! Limits: odd sizes 1 to 255 px (a size above the image's is fine), sigma up to 50 px.

mod border;
mod convolution;
mod exact;
mod gaussian;
mod mean;
mod median;
mod median_histogram;
mod network;
mod pixel;

pub use border::Border;
pub use convolution::{Kernel, convolve};
pub use exact::{convolve_exact, gaussian_exact, mean_exact, median_exact};
pub use pixel::{Key, SpatialPixel};

use crate::{Error, ErrorKind, Image, Result};
use border::RowRing;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Largest window of mean and median, px: sums of 255 x 255 u16 pixels still fit into 32 bits.
pub const MAX_SIZE_PX: usize = 255;
/// Largest sigma of the Gaussian, px.
pub const MAX_SIGMA_PX: f64 = 50.0;

/// The spatial filter before the threshold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub enum SpatialConfig {
    /// The pixels as they are.
    #[default]
    None,
    /// Mean of the window: lowers white noise by the window's size, smears edges.
    Mean(WindowConfig),
    /// Median of the window: removes salt and pepper and single bad pixels, keeps edges, and removes targets that fill
    /// less than half the window.
    Median(WindowConfig),
    /// Gaussian: the matched filter of a Gaussian spot of the same sigma.
    Gaussian(GaussianConfig),
}

/// A square window.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct WindowConfig {
    /// Width and height, px, odd, 1 to 255. Larger smooths more and loses smaller targets.
    pub size: usize,
    /// What lies outside the image.
    pub border: Border,
}

impl Default for WindowConfig {
    fn default() -> Self {
        Self { size: 3, border: Border::Replicate }
    }
}

/// A Gaussian.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct GaussianConfig {
    /// Standard deviation, px, above 0 up to 50. Best near the target's own sigma. The kernel ends at 4 sigma.
    pub sigma_px: f64,
    /// What lies outside the image.
    pub border: Border,
}

impl Default for GaussianConfig {
    fn default() -> Self {
        Self { sigma_px: 1.0, border: Border::Replicate }
    }
}

impl SpatialConfig {
    /// Checks the parameters; `at` is the key of this part, for messages.
    /// # Errors
    /// A size that is even, zero or above [`MAX_SIZE_PX`]; a sigma outside (0, 50].
    pub fn validate(&self, at: &str) -> Result<()> {
        match self {
            Self::None => Ok(()),
            Self::Mean(w) => check_size(w.size, &format!("{at}.mean")),
            Self::Median(w) => check_size(w.size, &format!("{at}.median")),
            Self::Gaussian(g) => check_sigma(g.sigma_px, &format!("{at}.gaussian")),
        }
    }

    /// How far the filter reaches, px: the radius of its window.
    pub fn radius_px(&self) -> usize {
        match self {
            Self::None => 0,
            Self::Mean(w) | Self::Median(w) => w.size / 2,
            Self::Gaussian(g) => gaussian::radius_px(g.sigma_px),
        }
    }
}

pub(crate) fn check_size(size: usize, at: &str) -> Result<()> {
    if size % 2 == 1 && size <= MAX_SIZE_PX {
        return Ok(());
    }
    Err(Error::new(ErrorKind::Config, format!("expected an odd number of pixels from 1 to {MAX_SIZE_PX}"))
        .at(format!("{at}.size = {size}"))
        .hint("3 or 5 removes single noisy pixels; an even window has no middle pixel"))
}

fn check_sigma(sigma_px: f64, at: &str) -> Result<()> {
    if sigma_px > 0.0 && sigma_px <= MAX_SIGMA_PX {
        return Ok(());
    }
    Err(Error::new(ErrorKind::Config, format!("expected a standard deviation in (0, {MAX_SIGMA_PX}] px"))
        .at(format!("{at}.sigma-px = {sigma_px}"))
        .hint("take the target's own blur, about its width / 3; `spatial = \"none\"` filters nothing"))
}

/// A spatial filter with the memory it needs between rows.
///
/// ```
/// use boresight::{Image, vision::spatial::{SpatialConfig, SpatialFilter, WindowConfig}};
/// let frame = Image::from_vec(3, 3, vec![10u8, 20, 30, 40, 50, 60, 70, 80, 90]).unwrap();
/// let mut filter = SpatialFilter::new(SpatialConfig::Median(WindowConfig::default()))?;
/// let mut out = Image::default();
/// filter.apply(&frame, &mut out);
/// assert_eq!(out.as_slice(), [20, 30, 30, 40, 50, 60, 70, 70, 80]); // docs/theory/image.md: median, replicate
/// # Ok::<(), boresight::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct SpatialFilter<T: SpatialPixel> {
    config: SpatialConfig,
    ring: RowRing<T::Key>,
    mean: mean::Scratch,
    median: median::Scratch<T::Key>,
    gaussian: gaussian::Gaussian,
}

impl<T: SpatialPixel> SpatialFilter<T> {
    /// Builds the filter.
    /// # Errors
    /// As [`SpatialConfig::validate`].
    pub fn new(config: SpatialConfig) -> Result<Self> {
        config.validate("spatial")?;
        let sigma_px = if let SpatialConfig::Gaussian(g) = config { g.sigma_px } else { 1.0 };
        Ok(Self {
            config,
            ring: RowRing::default(),
            mean: mean::Scratch::default(),
            median: median::Scratch::default(),
            gaussian: gaussian::Gaussian::new(sigma_px),
        })
    }

    /// The configuration it was built from.
    pub fn config(&self) -> &SpatialConfig {
        &self.config
    }

    /// Filters a whole image into `dst`, whose memory is kept and whose size becomes that of `src`.
    pub fn apply(&mut self, src: &Image<T>, dst: &mut Image<T>) {
        if (dst.width(), dst.height()) != (src.width(), src.height()) {
            dst.reset(src.width(), src.height(), T::default());
        }
        self.begin(src);
        for y in 0..src.height() {
            self.row(src, y, dst.row_mut(y));
        }
    }

    /// Starts a new image; afterwards call [`SpatialFilter::row`] for `y` = 0, 1, 2, ... in order.
    pub fn begin(&mut self, src: &Image<T>) {
        let (w, h, r) = (src.width(), src.height(), self.config.radius_px());
        match self.config {
            SpatialConfig::None => {}
            SpatialConfig::Mean(c) => {
                mean::begin::<T>(w, c.size, &mut self.mean);
            }
            SpatialConfig::Median(c) => {
                self.ring.begin(w, h, r, c.border, T::default().key());
                median::begin(&self.ring, src, &mut self.median);
            }
            SpatialConfig::Gaussian(c) => self.gaussian.begin(w, h, c.border),
        }
    }

    /// Filters row `y`, the next after the last call, into `out`.
    /// # Panics
    /// If `out` is not as long as a row of `src`: a bug of the caller.
    pub fn row(&mut self, src: &Image<T>, y: usize, out: &mut [T]) {
        assert_eq!(out.len(), src.width(), "a row of another length");
        match self.config {
            SpatialConfig::None => out.copy_from_slice(src.row(y)),
            SpatialConfig::Mean(c) => mean::row(src, y, c.size, c.border, &mut self.mean, out),
            SpatialConfig::Median(c) => median::row(&mut self.ring, src, y, c.size, &mut self.median, out),
            SpatialConfig::Gaussian(_) => self.gaussian.row(src, y, out),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const BORDERS: [Border; 3] = [Border::Zero, Border::Replicate, Border::Reflect];

    fn run<T: SpatialPixel>(config: SpatialConfig, src: &Image<T>) -> Image<T> {
        let mut filter = SpatialFilter::new(config).unwrap();
        let mut out = Image::default();
        // Twice with the same filter: what one frame leaves behind must not reach the next.
        filter.apply(&Image::filled(5, 4, T::from_f64(77.0)), &mut out);
        filter.apply(src, &mut out);
        out
    }

    fn agrees<T: SpatialPixel>(src: &Image<T>, size: usize) -> std::result::Result<(), TestCaseError> {
        for border in BORDERS {
            let mean = run(SpatialConfig::Mean(WindowConfig { size, border }), src);
            let exact = mean_exact(src, size, border).unwrap();
            for (a, b) in mean.as_slice().iter().zip(exact.as_slice()) {
                let b = if T::INTEGER { b.round() } else { *b };
                let close = (a.to_f64() - b).abs() <= if T::INTEGER { 0.0 } else { 1e-6 * b.abs().max(1.0) };
                prop_assert!(close, "mean {size} {border:?}: {a:?} instead of {b}");
            }
            let median = run(SpatialConfig::Median(WindowConfig { size, border }), src);
            let exact = median_exact(src, size, border).unwrap();
            for (a, b) in median.as_slice().iter().zip(exact.as_slice()) {
                prop_assert_eq!(a.to_f64(), *b, "median {} {:?}", size, border);
            }
        }
        Ok(())
    }

    fn image<T: SpatialPixel>(w: usize, h: usize, seed: u64, f: impl Fn(u64) -> T) -> Image<T> {
        let mut s = seed;
        let pixels = (0..w * h)
            .map(|_| {
                s = s.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                f(s >> 33)
            })
            .collect();
        Image::from_vec(w, h, pixels).unwrap()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(60))]

        #[test]
        fn mean_and_median_equal_their_plain_twins_on_every_type_border_and_odd_size(
            w in 1usize..90, h in 1usize..12, half in 0usize..10, seed: u64, few in any::<bool>(),
        ) {
            let size = 2 * half + 1;
            agrees(&image(w, h, seed, |v| if few { (v % 3) as u8 * 127 } else { v as u8 }), size)?;
            agrees(&image(w, h, seed, |v| v as u16), size)?;
            agrees(&image(w, h, seed, |v| (v as u32 as f32 - 1e9) * 1e-6), size)?;
        }

        #[test]
        fn the_gaussian_equals_its_plain_twin(
            w in 1usize..70, h in 1usize..20, sigma_px in 0.1f64..6.0, seed: u64,
        ) {
            for border in BORDERS {
                let config = SpatialConfig::Gaussian(GaussianConfig { sigma_px, border });
                let src = image(w, h, seed, |v| v as u8);
                let exact = gaussian_exact(&src, sigma_px, border).unwrap();
                for (a, b) in run(config, &src).as_slice().iter().zip(exact.as_slice()) {
                    prop_assert!((f64::from(*a) - b).abs() <= 0.5001, "{a} instead of {b}");
                }
                let src = image(w, h, seed, |v| v as u16);
                let exact = gaussian_exact(&src, sigma_px, border).unwrap();
                for (a, b) in run(config, &src).as_slice().iter().zip(exact.as_slice()) {
                    prop_assert!((f64::from(*a) - b).abs() <= 0.55, "{a} instead of {b}");
                }
                let src = image(w, h, seed, |v| v as u16 as f32);
                for (a, b) in run(config, &src).as_slice().iter().zip(exact.as_slice()) {
                    prop_assert!((f64::from(*a) - b).abs() <= 0.0656, "{a} instead of {b}");
                }
            }
        }
    }

    #[test]
    fn a_window_larger_than_the_image_and_the_largest_window_are_exact() {
        for (w, h) in [(1, 1), (1, 9), (9, 1), (3, 2), (40, 33)] {
            for size in [17, 33, 255] {
                agrees(&image(w, h, 5, |v| v as u8), size).unwrap();
            }
        }
        agrees(&image(7, 5, 5, |_| u16::MAX), 255).unwrap();
    }

    #[test]
    fn an_image_without_pixels_is_filtered_to_one_without_pixels() {
        for (w, h) in [(0, 0), (0, 5), (5, 0)] {
            for size in [1, 3, 5, 9, 31] {
                agrees(&Image::filled(w, h, 0u8), size).unwrap();
                agrees(&Image::filled(w, h, 0f32), size).unwrap();
            }
            let config = SpatialConfig::Gaussian(GaussianConfig::default());
            assert!(run(config, &Image::filled(w, h, 0u16)).as_slice().is_empty());
        }
    }

    #[test]
    fn one_nan_spoils_only_the_means_and_no_median_of_its_windows() {
        let mut src = Image::filled(40, 9, 2.0f32);
        src.row_mut(4)[20] = f32::NAN;
        let mean = run(SpatialConfig::Mean(WindowConfig { size: 3, border: Border::Zero }), &src);
        assert_eq!(mean.as_slice().iter().filter(|v| v.is_nan()).count(), 9);
        for size in [3, 5, 7, 17] {
            let median = run(SpatialConfig::Median(WindowConfig { size, border: Border::Replicate }), &src);
            assert!(median.as_slice().iter().all(|v| *v == 2.0));
        }
    }

    #[test]
    fn even_zero_and_huge_sizes_are_refused_with_their_place() {
        for size in [0, 2, 4, 256, 257, usize::MAX] {
            let config = SpatialConfig::Median(WindowConfig { size, border: Border::Zero });
            let e = config.validate("detector.spatial").unwrap_err().to_string();
            assert!(e.starts_with(&format!("detector.spatial.median.size = {size}: expected an odd number")), "{e}");
        }
        for sigma_px in [0.0, -1.0, f64::NAN, f64::INFINITY, 51.0] {
            let config = SpatialConfig::Gaussian(GaussianConfig { sigma_px, border: Border::Zero });
            assert!(SpatialFilter::<u8>::new(config).is_err());
        }
        assert!(Kernel::new(2, vec![0.0; 4]).is_err());
        assert!(Kernel::new(3, vec![0.0; 8]).is_err());
        assert!(Kernel::new(1, vec![f64::NAN]).is_err());
    }

    #[test]
    fn the_configuration_is_read_from_its_short_forms_and_refuses_typing_errors() {
        #[derive(Deserialize)]
        struct Part {
            spatial: SpatialConfig,
        }
        let read = |text: &str| toml::from_str::<Part>(text).map(|p| p.spatial);
        assert_eq!(read("spatial = \"none\"").unwrap(), SpatialConfig::None);
        let median = SpatialConfig::Median(WindowConfig { size: 5, border: Border::Replicate });
        assert_eq!(read("[spatial.median]\nsize = 5").unwrap(), median);
        let blur = SpatialConfig::Gaussian(GaussianConfig { sigma_px: 2.0, border: Border::Reflect });
        assert_eq!(read("[spatial.gaussian]\nsigma-px = 2.0\nborder = \"reflect\"").unwrap(), blur);
        assert!(read("[spatial.median]\nsizes = 5").is_err());
    }

    #[test]
    fn convolution_turns_the_kernel_round() {
        // A single bright pixel brings out the kernel itself, a correlation would bring it out turned.
        let mut src = Image::filled(3, 3, 0u8);
        src.row_mut(1)[1] = 1;
        let kernel = Kernel::new(3, (1..=9).map(f64::from).collect()).unwrap();
        let mut out = Image::default();
        convolve(&src, &kernel, Border::Zero, &mut out);
        assert_eq!(out.as_slice(), [1, 2, 3, 4, 5, 6, 7, 8, 9]);
    }
}
