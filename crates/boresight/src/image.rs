//! A plain image: rows of pixels without padding, any pixel type.

/// A `width` x `height` image, row by row from the top, no padding; `(x, y)` = (column, row).
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Image<T> {
    width: usize,
    height: usize,
    data: Vec<T>,
}

impl<T: Clone> Clone for Image<T> {
    fn clone(&self) -> Self {
        Self { width: self.width, height: self.height, data: self.data.clone() }
    }

    /// As [`Clone::clone`], into the memory that is there.
    fn clone_from(&mut self, source: &Self) {
        (self.width, self.height) = (source.width, source.height);
        self.data.clone_from(&source.data);
    }
}

impl<T: Copy> Image<T> {
    /// Builds an image filled with one value.
    pub fn filled(width: usize, height: usize, value: T) -> Self {
        Self { width, height, data: vec![value; width * height] }
    }

    /// Takes over a buffer of exactly `width * height` pixels; `None` if the length differs.
    pub fn from_vec(width: usize, height: usize, data: Vec<T>) -> Option<Self> {
        (width.checked_mul(height)? == data.len()).then_some(Self { width, height, data })
    }

    /// Width, px.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height, px.
    pub fn height(&self) -> usize {
        self.height
    }

    /// All pixels, row by row.
    pub fn as_slice(&self) -> &[T] {
        &self.data
    }

    /// All pixels, row by row, to be written.
    pub fn as_mut_slice(&mut self) -> &mut [T] {
        &mut self.data
    }

    /// Gives the buffer back.
    pub fn into_vec(self) -> Vec<T> {
        self.data
    }

    /// Row `y`, `width` pixels.
    /// # Panics
    /// If `y >= height`: a bug of the caller.
    pub fn row(&self, y: usize) -> &[T] {
        &self.data[y * self.width..(y + 1) * self.width]
    }

    /// Row `y` to be written.
    /// # Panics
    /// If `y >= height`: a bug of the caller.
    pub fn row_mut(&mut self, y: usize) -> &mut [T] {
        &mut self.data[y * self.width..(y + 1) * self.width]
    }

    /// The pixel at column `x`, row `y`, or `None` outside.
    pub fn get(&self, x: usize, y: usize) -> Option<T> {
        (x < self.width && y < self.height).then(|| self.data[y * self.width + x])
    }

    /// Makes this image `width` x `height`, keeping the buffer's memory; new pixels hold `value`.
    pub fn reset(&mut self, width: usize, height: usize, value: T) {
        self.width = width;
        self.height = height;
        self.data.clear();
        self.data.resize(width * height, value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_buffer_of_the_wrong_length_is_refused() {
        assert!(Image::from_vec(2, 2, vec![0u8; 3]).is_none());
        assert!(Image::from_vec(usize::MAX, 2, vec![0u8; 3]).is_none());
        let image = Image::from_vec(2, 2, vec![1u8, 2, 3, 4]).unwrap();
        assert_eq!(image.row(1), [3, 4]);
        assert_eq!(image.get(1, 0), Some(2));
        assert_eq!(image.get(2, 0), None);
    }
}
