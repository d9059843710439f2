//! How far a filtered image is from the true one: MSE, RMSE, MAE, PFE, SNR, PSNR.
//!
//! Source: `docs/theory/measures.md` (thesis eqs 4.7-4.12, corrected). `psnr` is 10 log10(peak² / MSE);
//! `psnr_as_printed` is eq 4.12 as it stands, too small by 10 log10(n). `pfe` takes the Frobenius norm, `pfe_spectral`
//! the largest singular value as MATLAB's `norm` of a matrix does.
//! Symbols: s truth, y filtered, d = s - y, n pixels. Units: as the pixels; PFE percent; SNR and PSNR dB.
//! Identical images: all errors 0, SNR and PSNR +inf. An all-zero truth with an error: PFE +inf, SNR -inf.
//! Cost of `pfe_spectral`: the smaller side squared times the larger, and an eigenvalue problem of the smaller side.

use super::value::{Better, Value};
use crate::{Error, ErrorKind, Image, Pixels, Result};
use nalgebra::DMatrix;

/// The measures of one image against the truth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImageMetrics {
    /// Mean square error, counts².
    pub mse: f64,
    /// Root of it, counts.
    pub rmse: f64,
    /// Mean absolute error, counts.
    pub mae: f64,
    /// Percentage fit error, Frobenius norm, %.
    pub pfe: f64,
    /// Signal to noise ratio, dB.
    pub snr: f64,
    /// Peak signal to noise ratio, dB.
    pub psnr: f64,
    /// Eq 4.12 as printed, without 1/n, dB.
    pub psnr_as_printed: f64,
}

const EMPTY: ImageMetrics =
    ImageMetrics { mse: 0.0, rmse: 0.0, mae: 0.0, pfe: 0.0, snr: 0.0, psnr: 0.0, psnr_as_printed: 0.0 };

impl ImageMetrics {
    /// The measures by name.
    pub fn values(&self) -> [Value; 6] {
        [
            Value::new("MSE", self.mse, "counts²", Better::Lower),
            Value::new("RMSE", self.rmse, "counts", Better::Lower),
            Value::new("MAE", self.mae, "counts", Better::Lower),
            Value::new("PFE", self.pfe, "%", Better::Lower),
            Value::new("SNR", self.snr, "dB", Better::Higher),
            Value::new("PSNR", self.psnr, "dB", Better::Higher),
        ]
    }
}

/// Compares `filtered` with `truth`; `peak` is the largest value a pixel can have (255 for 8 bits), counts.
///
/// ```
/// use boresight::{Image, metrics::image::{compare, pfe_spectral}};
/// // The worked example of docs/theory/measures.md.
/// let s = Image::from_vec(3, 3, vec![10u8, 20, 30, 40, 50, 60, 70, 80, 90]).unwrap();
/// let y = Image::from_vec(3, 3, vec![11u8, 18, 30, 43, 50, 55, 70, 84, 90]).unwrap();
/// let m = compare(&s, &y, 255.0)?;
/// let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-12 * b.abs(), "{a} {b}");
/// close(m.mse, 6.1111111111111);
/// close(m.rmse, 2.4720661623652);
/// close(m.mae, 1.6666666666667);
/// close(m.pfe, 4.3929768510698);
/// close(m.snr, 27.144821705143);
/// close(m.psnr, 40.26960180813);
/// close(m.psnr_as_printed, 30.727176713737);
/// close(pfe_spectral(&s, &y)?, 3.4785631527583);
/// # Ok::<(), boresight::Error>(())
/// ```
/// # Errors
/// Images of different sizes or without pixels; a pixel that is not finite; a peak that is not above 0.
pub fn compare<T: Copy + Into<f64>>(truth: &Image<T>, filtered: &Image<T>, peak: f64) -> Result<ImageMetrics> {
    check_sizes(truth, filtered)?;
    if !(peak > 0.0 && peak.is_finite()) {
        return Err(Error::new(ErrorKind::Config, "expected a largest pixel value above 0")
            .at(format!("peak = {peak}"))
            .hint("255 for 8-bit images, 65535 for 16-bit ones"));
    }
    let (mut d2, mut d1, mut s2) = (0.0, 0.0, 0.0);
    for (&s, &y) in truth.as_slice().iter().zip(filtered.as_slice()) {
        let s: f64 = s.into();
        let d = s - y.into();
        d2 += d * d;
        d1 += d.abs();
        s2 += s * s;
    }
    check_finite(d2 + s2)?;
    let n = truth.as_slice().len() as f64;
    let mse = d2 / n;
    let ratio_db = |signal: f64, noise: f64| if noise == 0.0 { f64::INFINITY } else { 10.0 * (signal / noise).log10() };
    Ok(ImageMetrics {
        mse,
        rmse: mse.sqrt(),
        mae: d1 / n,
        pfe: percent(d2.sqrt(), s2.sqrt()),
        snr: ratio_db(s2, d2),
        psnr: ratio_db(peak * peak, mse),
        psnr_as_printed: ratio_db(peak * peak, d2),
    })
}

/// Compares two frames; RGB frames as three values a pixel. `peak` is 255 or 65535 by the type where it is not given.
/// # Errors
/// As [`compare`]; frames of different types; float pixels without a peak.
pub fn compare_pixels(truth: &Pixels, filtered: &Pixels, peak: Option<f64>) -> Result<ImageMetrics> {
    let flat = |i: &Image<[u8; 3]>| Image::from_vec(3 * i.width(), i.height(), i.as_slice().concat());
    match (truth, filtered) {
        (Pixels::Gray8(a), Pixels::Gray8(b)) => compare(a, b, peak.unwrap_or(255.0)),
        (Pixels::Gray16(a), Pixels::Gray16(b)) => compare(a, b, peak.unwrap_or(65535.0)),
        (Pixels::GrayF32(a), Pixels::GrayF32(b)) => match peak {
            Some(peak) => compare(a, b, peak),
            None => Err(Error::new(ErrorKind::Config, "float pixels have no largest value of their own")),
        },
        (Pixels::Rgb8(a), Pixels::Rgb8(b)) => {
            compare(&flat(a).unwrap_or_default(), &flat(b).unwrap_or_default(), peak.unwrap_or(255.0))
        }
        _ => Err(Error::new(ErrorKind::Unsupported, "the pixels are of different types: expected the same in both")),
    }
}

/// Mean of each of the measures' [`ImageMetrics::values`] over the frames; zeros without frames.
pub fn mean_values(frames: &[ImageMetrics]) -> [Value; 6] {
    let all: Vec<[Value; 6]> = frames.iter().map(ImageMetrics::values).collect();
    let n = all.len().max(1) as f64;
    std::array::from_fn(|k| Value { value: all.iter().map(|v| v[k].value).sum::<f64>() / n, ..EMPTY.values()[k] })
}

/// The percentage fit error with the largest singular value as the norm, %.
/// # Errors
/// As [`compare`].
pub fn pfe_spectral<T: Copy + Into<f64>>(truth: &Image<T>, filtered: &Image<T>) -> Result<f64> {
    check_sizes(truth, filtered)?;
    let s: Vec<f64> = truth.as_slice().iter().map(|&v| v.into()).collect();
    let d: Vec<f64> = s.iter().zip(filtered.as_slice()).map(|(s, &y)| s - y.into()).collect();
    check_finite(s.iter().chain(&d).map(|v| v * v).sum())?;
    Ok(percent(spectral_norm(d, truth.width()), spectral_norm(s, truth.width())))
}

/// Largest singular value of the matrix with rows of `width`: root of the largest eigenvalue of the smaller Gram matrix.
fn spectral_norm(values: Vec<f64>, width: usize) -> f64 {
    // Column-major storage reads the rows as columns: the transposed matrix has the same singular values.
    let a = DMatrix::from_vec(width, values.len() / width.max(1), values);
    let gram = if a.nrows() <= a.ncols() { &a * a.transpose() } else { a.transpose() * &a };
    gram.symmetric_eigenvalues().max().max(0.0).sqrt()
}

fn percent(error: f64, signal: f64) -> f64 {
    if error == 0.0 { 0.0 } else { 100.0 * error / signal }
}

fn check_sizes<T: Copy>(truth: &Image<T>, filtered: &Image<T>) -> Result<()> {
    let (a, b) = ((truth.width(), truth.height()), (filtered.width(), filtered.height()));
    if a != b || a.0 == 0 || a.1 == 0 {
        return Err(Error::new(ErrorKind::Config, "expected two images of the same size, with pixels")
            .at(format!("{} x {} and {} x {} px", a.0, a.1, b.0, b.1)));
    }
    Ok(())
}

fn check_finite(sum: f64) -> Result<()> {
    if sum.is_finite() {
        return Ok(());
    }
    Err(Error::new(ErrorKind::Numeric, "a pixel is not finite or too large to square")
        .hint("replace NaN and infinite pixels before comparing"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(values: &[f64]) -> Image<f64> {
        Image::from_vec(values.len(), 1, values.to_vec()).unwrap()
    }

    #[test]
    fn identical_images_have_no_error_and_an_infinite_ratio() {
        let s = row(&[3.0, 4.0]);
        let m = compare(&s, &s, 255.0).unwrap();
        assert_eq!((m.mse, m.rmse, m.mae, m.pfe), (0.0, 0.0, 0.0, 0.0));
        assert_eq!((m.snr, m.psnr), (f64::INFINITY, f64::INFINITY));
        assert_eq!(pfe_spectral(&s, &s).unwrap(), 0.0);
        let zero = row(&[0.0, 0.0]);
        let m = compare(&zero, &s, 255.0).unwrap();
        assert_eq!((m.pfe, m.snr), (f64::INFINITY, f64::NEG_INFINITY));
        assert_eq!(compare(&zero, &zero, 255.0).unwrap().pfe, 0.0);
    }

    #[test]
    fn the_fit_error_follows_from_the_signal_to_noise_ratio() {
        // An identity: PFE = 100 * 10^(-SNR / 20).
        let m = compare(&row(&[10.0, 20.0, 35.0]), &row(&[11.0, 18.5, 35.25]), 255.0).unwrap();
        assert!((m.pfe - 100.0 * 10f64.powf(-m.snr / 20.0)).abs() < 1e-12);
    }

    #[test]
    fn images_that_cannot_be_compared_are_refused() {
        assert!(compare(&row(&[1.0]), &row(&[1.0, 2.0]), 255.0).is_err());
        assert!(compare(&row(&[]), &row(&[]), 255.0).is_err());
        assert!(compare(&row(&[f64::NAN]), &row(&[1.0]), 255.0).is_err());
        assert!(compare(&row(&[1.0]), &row(&[1.0]), 0.0).is_err());
        assert!(pfe_spectral(&row(&[f64::INFINITY]), &row(&[1.0])).is_err());
    }

    #[test]
    fn the_spectral_norm_of_a_diagonal_matrix_is_its_largest_entry() {
        assert!((spectral_norm(vec![3.0, 0.0, 0.0, 0.0, -7.0, 0.0], 3) - 7.0).abs() < 1e-12);
    }

    #[test]
    fn frames_are_compared_by_their_type_with_its_largest_value() {
        let gray = |v: Vec<u8>| Pixels::Gray8(Image::from_vec(2, 1, v).unwrap());
        let m = compare_pixels(&gray(vec![10, 20]), &gray(vec![11, 22]), None).unwrap();
        assert_eq!((m.mse, m.mae), (2.5, 1.5));
        assert!((m.psnr - 10.0 * (255.0_f64.powi(2) / 2.5).log10()).abs() < 1e-12);
        let deep = |v: Vec<u16>| Pixels::Gray16(Image::from_vec(2, 1, v).unwrap());
        let m = compare_pixels(&deep(vec![10, 20]), &deep(vec![11, 22]), None).unwrap();
        assert!((m.psnr - 10.0 * (65535.0_f64.powi(2) / 2.5).log10()).abs() < 1e-12);
        let m = compare_pixels(&deep(vec![10, 20]), &deep(vec![11, 22]), Some(100.0)).unwrap();
        assert!((m.psnr - 10.0 * (1e4_f64 / 2.5).log10()).abs() < 1e-12);
        // A colour pixel counts as three values.
        let rgb = |v: [u8; 3]| Pixels::Rgb8(Image::from_vec(1, 1, vec![v]).unwrap());
        assert_eq!(compare_pixels(&rgb([1, 2, 3]), &rgb([1, 2, 6]), None).unwrap().mse, 3.0);
        let wide = |v: [u8; 3]| Pixels::Rgb8(Image::from_vec(2, 1, vec![[0; 3], v]).unwrap());
        assert_eq!(compare_pixels(&wide([1, 2, 3]), &wide([1, 2, 6]), None).unwrap().mse, 1.5);
        let float = || Pixels::GrayF32(Image::from_vec(1, 1, vec![0.5]).unwrap());
        assert!(compare_pixels(&float(), &float(), None).unwrap_err().to_string().contains("no largest value"));
        assert_eq!(compare_pixels(&float(), &float(), Some(1.0)).unwrap().mse, 0.0);
        assert_eq!(compare_pixels(&float(), &rgb([0; 3]), None).unwrap_err().kind(), ErrorKind::Unsupported);
    }

    #[test]
    fn means_are_over_the_frames_and_keep_names_and_units() {
        let one = |mse: f64| ImageMetrics { mse, ..EMPTY };
        let m = mean_values(&[one(2.0), one(5.0)]);
        assert_eq!((m[0].name, m[0].value, m[0].unit, m[5].name), ("MSE", 3.5, "counts²", "PSNR"));
        assert_eq!((m[4].better, m[1].better, mean_values(&[])[0].value), (Better::Higher, Better::Lower, 0.0));
    }
}
