//! Noise put on images to test filters: salt and pepper, and Gaussian.
//!
//! Source: `docs/theory/image.md` (thesis eqs 4.4-4.6). The generators take the random numbers (uniforms in [0, 1),
//! standard normals), so that results can be checked against any other program; the seeded forms draw them from
//! ChaCha8, the same on every machine. Gaussian noise is added without clamping, so its result is a float image;
//! quantise it as the scene needs.

use crate::{Error, ErrorKind, Image, Result};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

/// Pixel types that salt and pepper know the black and the white of: 0 and 255.
pub trait SaltPepper: Copy {
    /// Black, 0 counts.
    const PEPPER: Self;
    /// White, 255 counts, as in eq 4.4, whatever the type's own largest value.
    const SALT: Self;
}

macro_rules! salt_pepper {
    ($($t:ty),*) => {$(
        impl SaltPepper for $t {
            const PEPPER: Self = 0 as $t;
            const SALT: Self = 255 as $t;
        }
    )*};
}
salt_pepper!(u8, u16, f32, f64);

/// Puts salt and pepper on an image: 0 where u < density / 2, 255 where u < density, unchanged elsewhere (eq 4.4).
///
/// `uniforms` holds one number in [0, 1) a pixel, row by row.
/// # Errors
/// A density outside [0, 1]; another number of uniforms than pixels.
pub fn salt_and_pepper<T: SaltPepper>(image: &mut Image<T>, density: f64, uniforms: &[f64]) -> Result<()> {
    check_density(density)?;
    check_length(uniforms.len(), image.as_slice().len(), "uniforms")?;
    for (pixel, &u) in image.as_mut_slice().iter_mut().zip(uniforms) {
        if u < density / 2.0 {
            *pixel = T::PEPPER;
        } else if u < density {
            *pixel = T::SALT;
        }
    }
    Ok(())
}

/// Puts salt and pepper on an image, drawn from `seed`.
/// # Errors
/// A density outside [0, 1].
pub fn salt_and_pepper_seeded<T: SaltPepper>(image: &mut Image<T>, density: f64, seed: u64) -> Result<()> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let uniforms: Vec<f64> = (0..image.as_slice().len()).map(|_| rng.random::<f64>()).collect();
    salt_and_pepper(image, density, &uniforms)
}

/// Returns the image with Gaussian noise: x = s + sigma z (eqs 4.5-4.6), not clamped; `sigma` in counts.
///
/// `normals` holds one standard normal number a pixel, row by row.
/// # Errors
/// A sigma that is negative or not finite; another number of normals than pixels.
pub fn gaussian<T: Copy + Into<f64>>(image: &Image<T>, sigma: f64, normals: &[f64]) -> Result<Image<f64>> {
    if !(sigma >= 0.0 && sigma.is_finite()) {
        return Err(Error::new(ErrorKind::Config, "expected a standard deviation of 0 or more")
            .at(format!("noise.sigma = {sigma}"))
            .hint("in counts: 10 blurs an 8-bit image visibly"));
    }
    check_length(normals.len(), image.as_slice().len(), "normals")?;
    let mut out = Image::filled(image.width(), image.height(), 0.0);
    for ((o, &s), &z) in out.as_mut_slice().iter_mut().zip(image.as_slice()).zip(normals) {
        *o = s.into() + sigma * z;
    }
    Ok(out)
}

/// Returns the image with Gaussian noise drawn from `seed`.
/// # Errors
/// A sigma that is negative or not finite.
pub fn gaussian_seeded<T: Copy + Into<f64>>(image: &Image<T>, sigma: f64, seed: u64) -> Result<Image<f64>> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let normals: Vec<f64> = (0..image.as_slice().len()).map(|_| rng.sample(StandardNormal)).collect();
    gaussian(image, sigma, &normals)
}

fn check_density(density: f64) -> Result<()> {
    if (0.0..=1.0).contains(&density) {
        return Ok(());
    }
    Err(Error::new(ErrorKind::Config, "expected a share of the pixels in [0, 1]")
        .at(format!("noise.density = {density}"))
        .hint("0.05 spoils every twentieth pixel"))
}

fn check_length(found: usize, expected: usize, what: &str) -> Result<()> {
    if found == expected {
        return Ok(());
    }
    Err(Error::new(ErrorKind::Config, format!("expected one a pixel, {expected}")).at(format!("{found} {what}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_share_of_salt_and_of_pepper_is_half_the_density_each() {
        let mut image = Image::filled(400, 250, 100u8);
        salt_and_pepper_seeded(&mut image, 0.2, 7).unwrap();
        let share = |v: u8| image.as_slice().iter().filter(|&&p| p == v).count() as f64 / 1e5;
        // Binomial: standard deviation 0.00095, bounds at 5 of them.
        assert!((share(0) - 0.1).abs() < 0.005 && (share(255) - 0.1).abs() < 0.005);
        assert!((share(100) - 0.8).abs() < 0.0065);
    }

    #[test]
    fn seeded_gaussian_noise_has_the_mean_and_deviation_asked_for_and_repeats() {
        let image = Image::filled(300, 300, 50u8);
        let noisy = gaussian_seeded(&image, 10.0, 3).unwrap();
        let n = noisy.as_slice().len() as f64;
        let mean = noisy.as_slice().iter().sum::<f64>() / n;
        let var = noisy.as_slice().iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n;
        // Standard deviations 10 / 300 and 10 / 300 / sqrt(2); bounds at 5 of them.
        assert!((mean - 50.0).abs() < 0.17 && (var.sqrt() - 10.0).abs() < 0.12);
        assert_eq!(noisy, gaussian_seeded(&image, 10.0, 3).unwrap());
        assert_ne!(noisy, gaussian_seeded(&image, 10.0, 4).unwrap());
    }

    #[test]
    fn wrong_parameters_are_refused() {
        let mut image = Image::filled(2, 2, 0u8);
        assert!(salt_and_pepper(&mut image, 1.1, &[0.0; 4]).is_err());
        assert!(salt_and_pepper(&mut image, f64::NAN, &[0.0; 4]).is_err());
        assert!(salt_and_pepper(&mut image, 0.1, &[0.0; 3]).is_err());
        assert!(gaussian(&image, -1.0, &[0.0; 4]).is_err());
        assert!(gaussian(&image, 1.0, &[0.0; 5]).is_err());
    }
}
