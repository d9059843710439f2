//! Grey, hue, saturation and intensity of a colour, and how far two colours are apart.
//!
//! Source: `docs/theory/segmentation.md` (BT.601 in integers, bit for bit OpenCV's 8-bit conversion).
//! Symbols: I = (R + G + B) / 3 in 0..1; S = 1 - min / I; H in degrees, 0 <= H < 360, 0 where undefined (greys).
//! D² = (dH / 180)² + (dS / 2)², dH circular; intensity is left out.

use crate::Image;

/// Grey of a colour: (9798 R + 19235 G + 3735 B + 16384) >> 15.
///
/// ```
/// use boresight::vision::colour::grey;
/// assert_eq!(grey([14, 204, 99]), 135); // golden colour.json
/// ```
#[inline]
pub fn grey([r, g, b]: [u8; 3]) -> u8 {
    // The weights sum to 2¹⁵, so the result fits 8 bits.
    ((9798 * u32::from(r) + 19_235 * u32::from(g) + 3735 * u32::from(b) + 16_384) >> 15) as u8
}

/// Turns a colour image into a grey one, whose memory is kept.
pub fn grey_image(colour: &Image<[u8; 3]>, out: &mut Image<u8>) {
    if (out.width(), out.height()) != (colour.width(), colour.height()) {
        out.reset(colour.width(), colour.height(), 0);
    }
    grey_pixels(colour.as_slice(), out.as_mut_slice());
}

widest! {
    fn grey_pixels(colour: &[[u8; 3]], out: &mut [u8]) {
        for (o, &p) in out.iter_mut().zip(colour) {
            *o = grey(p);
        }
    }
}

/// Hue, saturation and intensity.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Hsi {
    /// Hue, degrees, 0..360; 0 for greys.
    pub hue_deg: f64,
    /// Saturation, 0..1.
    pub saturation: f64,
    /// Intensity, 0..1.
    pub intensity: f64,
}

/// Hue, saturation and intensity of a colour.
pub fn hsi([r, g, b]: [u8; 3]) -> Hsi {
    let [r, g, b] = [r, g, b].map(|v| f64::from(v) / 255.0);
    let intensity = (r + g + b) / 3.0;
    let saturation = if intensity == 0.0 { 0.0 } else { 1.0 - r.min(g).min(b) / intensity };
    let root = ((r - g).powi(2) + (r - b) * (g - b)).sqrt();
    if root == 0.0 {
        return Hsi { hue_deg: 0.0, saturation, intensity };
    }
    let theta = (0.5 * ((r - g) + (r - b)) / root).clamp(-1.0, 1.0).acos().to_degrees();
    Hsi { hue_deg: if b <= g { theta } else { 360.0 - theta }, saturation, intensity }
}

/// The colour distance D (no unit) of `docs/theory/segmentation.md`.
pub fn distance(a: &Hsi, b: &Hsi) -> f64 {
    let turn = (a.hue_deg - b.hue_deg).abs();
    let hue = turn.min(360.0 - turn) / 180.0;
    let saturation = (a.saturation - b.saturation) / 2.0;
    (hue * hue + saturation * saturation).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pure_colours_lie_on_the_hue_circle() {
        for (rgb, hue_deg) in [([255, 0, 0], 0.0), ([0, 255, 0], 120.0), ([0, 0, 255], 240.0), ([0, 90, 90], 180.0)] {
            let c = hsi(rgb);
            assert!((c.hue_deg - hue_deg).abs() < 1e-9 && (c.saturation - 1.0).abs() < 1e-12, "{c:?}");
        }
        assert_eq!(hsi([0, 0, 0]), Hsi::default());
        assert_eq!(hsi([9, 9, 9]).hue_deg, 0.0);
    }

    #[test]
    fn the_distance_goes_round_the_circle() {
        let at = |hue_deg| Hsi { hue_deg, saturation: 0.5, intensity: 0.5 };
        assert!((distance(&at(350.0), &at(10.0)) - 20.0 / 180.0).abs() < 1e-12);
    }

    #[test]
    fn white_stays_white_and_the_grey_of_a_row_is_the_grey_of_its_pixels() {
        assert_eq!((grey([255; 3]), grey([0; 3])), (255, 0));
        let pixels: Vec<[u8; 3]> = (0..300u32).map(|i| [(i * 7) as u8, (i * 13) as u8, (i * 29) as u8]).collect();
        let mut out = Image::default();
        grey_image(&Image::from_vec(100, 3, pixels.clone()).unwrap(), &mut out);
        assert!(out.as_slice().iter().zip(pixels).all(|(&o, p)| o == grey(p)));
    }
}
