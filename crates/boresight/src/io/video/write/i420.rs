//! RGB to the planes an encoder takes: BT.709, video range, chroma of every 2 x 2 pixels averaged.
//!
//! Source: ITU-R BT.709-6 (weights 0.2126, 0.7152, 0.0722; luma 16..235, chroma 16..240), in 16-bit integers.
//! Pictures of odd size are padded to even size by repeating the last column and row, as 4:2:0 needs.

use crate::Image;

/// Planes of one picture, of even size.
#[derive(Clone, Debug, Default)]
pub(super) struct I420 {
    pub width: usize,
    pub height: usize,
    pub y: Vec<u8>,
    pub u: Vec<u8>,
    pub v: Vec<u8>,
}

// Weights times 2^16: e.g. 0.2126 * 219 / 255 * 65536 = 11966.
const Y: [i32; 3] = [11966, 40254, 4064];
const U: [i32; 3] = [-6596, -22189, 28785];
const V: [i32; 3] = [28785, -26145, -2640];

#[inline]
fn luma([r, g, b]: [u8; 3]) -> u8 {
    ((Y[0] * i32::from(r) + Y[1] * i32::from(g) + Y[2] * i32::from(b) + (16 << 16) + (1 << 15)) >> 16) as u8
}

/// Chroma of the sum of four pixels.
#[inline]
fn chroma(w: [i32; 3], sum: [i32; 3]) -> u8 {
    ((w[0] * sum[0] + w[1] * sum[1] + w[2] * sum[2] + (128 << 18) + (1 << 17)) >> 18) as u8
}

impl I420 {
    /// Takes a grey picture as it is: luma of full range, no chroma.
    pub fn fill_gray(&mut self, gray: &Image<u8>) {
        let (w, h) = (gray.width(), gray.height());
        (self.width, self.height) = (w.next_multiple_of(2), h.next_multiple_of(2));
        self.u.clear();
        self.u.resize(self.width * self.height / 4, 128);
        self.v.clone_from(&self.u);
        self.y.clear();
        for row in (0..self.height).map(|y| gray.row(y.min(h.max(1) - 1))) {
            self.y.extend_from_slice(row);
            self.y.extend(row.last().filter(|_| w < self.width));
        }
    }

    /// Converts a picture into this buffer.
    pub fn fill(&mut self, rgb: &Image<[u8; 3]>) {
        let (w, h) = (rgb.width(), rgb.height());
        (self.width, self.height) = (w.next_multiple_of(2), h.next_multiple_of(2));
        let half = self.width / 2;
        self.y.resize(self.width * self.height, 16);
        self.u.resize(half * self.height / 2, 128);
        self.v.resize(half * self.height / 2, 128);
        if w == 0 || h == 0 {
            return;
        }
        let rows = self.y.chunks_exact_mut(2 * self.width);
        let chroma_rows = self.u.chunks_exact_mut(half).zip(self.v.chunks_exact_mut(half));
        for (pair, (y_rows, (u_row, v_row))) in rows.zip(chroma_rows).enumerate() {
            let (top, bottom) = (rgb.row(2 * pair), rgb.row((2 * pair + 1).min(h - 1)));
            let (y_top, y_bottom) = y_rows.split_at_mut(self.width);
            luma_row(top, y_top);
            luma_row(bottom, y_bottom);
            chroma_row(top, bottom, u_row, v_row);
        }
    }
}

widest! {
    fn luma_row(rgb: &[[u8; 3]], out: &mut [u8]) {
        for (o, &p) in out.iter_mut().zip(rgb) {
            *o = luma(p);
        }
        if let (Some(&last), Some(pad)) = (rgb.last(), out.get_mut(rgb.len())) {
            *pad = luma(last);
        }
    }
}

widest! {
    fn chroma_row(top: &[[u8; 3]], bottom: &[[u8; 3]], u: &mut [u8], v: &mut [u8]) {
        let sum = |a: [u8; 3], b: [u8; 3], c: [u8; 3], d: [u8; 3]| {
            let one = |i: usize| i32::from(a[i]) + i32::from(b[i]) + i32::from(c[i]) + i32::from(d[i]);
            [one(0), one(1), one(2)]
        };
        let (t, t_rest) = top.as_chunks::<2>();
        let (b, b_rest) = bottom.as_chunks::<2>();
        for (((u, v), t), b) in u.iter_mut().zip(v.iter_mut()).zip(t).zip(b) {
            let s = sum(t[0], t[1], b[0], b[1]);
            *u = chroma(U, s);
            *v = chroma(V, s);
        }
        if let (&[t], &[b], Some(u), Some(v)) = (t_rest, b_rest, u.last_mut(), v.last_mut()) {
            let s = sum(t, t, b, b);
            *u = chroma(U, s);
            *v = chroma(V, s);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grey_keeps_its_values_and_an_odd_border_is_repeated() {
        let mut planes = I420::default();
        planes.fill(&Image::filled(5, 5, [200, 0, 0]));
        planes.fill_gray(&Image::from_vec(3, 1, vec![0, 100, 255]).unwrap());
        assert_eq!(
            (planes.y, planes.u, planes.v),
            (vec![0, 100, 255, 255, 0, 100, 255, 255], vec![128; 2], vec![128; 2])
        );
    }

    #[test]
    fn the_colours_of_the_standards_bars_come_out() {
        // 100 % bars, BT.709, video range (rounded codes of the standard).
        for (rgb, yuv) in [
            ([255, 255, 255], [235, 128, 128]),
            ([0, 255, 0], [173, 42, 26]),
            ([255, 0, 0], [63, 102, 240]),
            ([0, 0, 255], [32, 240, 118]),
            ([0, 0, 0], [16, 128, 128]),
        ] {
            let mut planes = I420::default();
            planes.fill(&Image::filled(3, 3, rgb));
            assert_eq!((planes.width, planes.height, planes.y.len(), planes.u.len()), (4, 4, 16, 4));
            for (plane, want) in [(&planes.y, yuv[0]), (&planes.u, yuv[1]), (&planes.v, yuv[2])] {
                assert!(plane.iter().all(|p| p.abs_diff(want) <= 1), "{rgb:?}: {plane:?}, not {want}");
            }
        }
    }
}
