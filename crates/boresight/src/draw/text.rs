//! Text on pictures: the printable ASCII characters of one font at one size, made once, blended fast.
//!
//! Font: Hack (MIT and Bitstream Vera licences), from the crate `epaint_default_fonts`.

use super::canvas::{Canvas, Rgb};
use crate::{Error, ErrorKind, Result};
use ab_glyph::{Font, FontRef, ScaleFont};

/// The picture of one character.
#[derive(Clone, Debug, Default)]
struct Glyph {
    left: i64,
    top: i64,
    width: usize,
    cover: Vec<u8>,
}

/// A font at one size.
#[derive(Clone, Debug)]
pub struct Lettering {
    glyphs: Vec<Glyph>,
    advance_px: f64,
    ascent_px: f64,
    height_px: f64,
}

const FIRST: u8 = b' ';
const LAST: u8 = b'~';

impl Lettering {
    /// Makes the characters `size_px` high (6..=200).
    /// # Errors
    /// [`ErrorKind::Output`] if the bundled font cannot be read.
    pub fn new(size_px: f32) -> Result<Self> {
        let font = FontRef::try_from_slice(epaint_default_fonts::HACK_REGULAR)
            .map_err(|e| Error::new(ErrorKind::Output, "the bundled font cannot be read").because(e))?;
        let scaled = font.as_scaled(size_px.clamp(6.0, 200.0));
        let glyph = |c: u8| {
            let id = scaled.scaled_glyph(char::from(c));
            let Some(outline) = scaled.outline_glyph(id) else { return Glyph::default() };
            let bounds = outline.px_bounds();
            let (width, height) = (bounds.width().ceil() as usize, bounds.height().ceil() as usize);
            let mut cover = vec![0; width * height];
            outline.draw(|x, y, c| {
                if let Some(p) = cover.get_mut(y as usize * width + x as usize) {
                    *p = (c.clamp(0.0, 1.0) * 255.0).round() as u8;
                }
            });
            Glyph { left: bounds.min.x as i64, top: bounds.min.y as i64, width, cover }
        };
        Ok(Self {
            glyphs: (FIRST..=LAST).map(glyph).collect(),
            // The font has one width for all.
            advance_px: f64::from(scaled.h_advance(font.glyph_id('0'))),
            ascent_px: f64::from(scaled.ascent()),
            height_px: f64::from(scaled.height()),
        })
    }

    /// Width of a text, px.
    pub fn width_px(&self, text: &str) -> f64 {
        text.chars().count() as f64 * self.advance_px
    }

    /// Height of a line, px.
    pub fn height_px(&self) -> f64 {
        self.height_px
    }

    /// Draws one line of text with its top-left corner at (x, y); characters beyond ASCII become `?`.
    pub fn draw(&self, canvas: &mut Canvas<'_>, x: f64, y: f64, text: &str, colour: Rgb, alpha: f32) {
        if !(x.abs() < 1e6 && y.abs() < 1e6) {
            return;
        }
        let base = (y + self.ascent_px).round() as i64;
        for (i, c) in text.chars().enumerate() {
            let code = u8::try_from(c).ok().filter(|c| (FIRST..=LAST).contains(c)).unwrap_or(b'?');
            let Some(glyph) = self.glyphs.get(usize::from(code - FIRST)).filter(|g| g.width > 0) else { continue };
            let left = (x + i as f64 * self.advance_px).round() as i64 + glyph.left;
            for (row, line) in glyph.cover.chunks_exact(glyph.width).enumerate() {
                for (column, &cover) in line.iter().enumerate().filter(|(_, c)| **c > 0) {
                    let (px, py) = (left + column as i64, base + glyph.top + row as i64);
                    canvas.blend(px, py, colour, alpha * f32::from(cover) / 255.0);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Image;

    #[test]
    fn text_stays_inside_its_announced_box() {
        let lettering = Lettering::new(14.0).unwrap();
        let mut image = Image::filled(200, 40, [0; 3]);
        lettering.draw(&mut Canvas::new(&mut image), 10.0, 10.0, "Track 42 gjy", [255; 3], 1.0);
        let (right, bottom) = (10.0 + lettering.width_px("Track 42 gjy"), 10.0 + lettering.height_px());
        let mut lit = 0;
        for y in 0..40 {
            for (x, _) in image.row(y).iter().enumerate().filter(|(_, p)| p[0] > 30) {
                lit += 1;
                assert!((9.0..=right + 1.0).contains(&(x as f64)) && (9.0..=bottom + 1.0).contains(&(y as f64)));
            }
        }
        assert!(lit > 200, "{lit}");
    }
}
