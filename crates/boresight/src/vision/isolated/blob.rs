//! A cluster's place: its box, its area and its first pixel.

/// A cluster at one level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Blob {
    pub area: u32,
    pub left: u32,
    pub right: u32,
    pub top: u32,
    pub bottom: u32,
}

impl Blob {
    /// A blob of no pixel yet.
    pub fn none() -> Self {
        Self { area: 0, left: u32::MAX, right: 0, top: u32::MAX, bottom: 0 }
    }

    /// A blob that fills its box.
    #[cfg(test)]
    pub fn of_box([left, top, right, bottom]: [u32; 4]) -> Self {
        let area = (right - left + 1) * (bottom - top + 1);
        Self { area, left, right, top, bottom }
    }

    /// Adds a pixel.
    #[inline(always)]
    pub fn add(&mut self, x: u32, y: u32) {
        self.area += 1;
        self.left = self.left.min(x);
        self.right = self.right.max(x);
        self.top = self.top.min(y);
        self.bottom = self.bottom.max(y);
    }

    /// Width and height of the box, px.
    pub fn sides(&self) -> (u32, u32) {
        (self.right - self.left + 1, self.bottom - self.top + 1)
    }

    /// `[left, top, right, bottom]`, px.
    pub fn bounds(&self) -> [u32; 4] {
        [self.left, self.top, self.right, self.bottom]
    }

    /// Whether the two boxes hold each other's middles: nested clusters of one thing.
    pub fn overlaps(&self, other: &Self) -> bool {
        let holds_middle = |a: &Self, b: &Self| {
            let (x, y) = (b.left + b.right, b.top + b.bottom);
            2 * a.left <= x && x <= 2 * a.right && 2 * a.top <= y && y <= 2 * a.bottom
        };
        holds_middle(self, other) || holds_middle(other, self)
    }

    /// Whether one of the two boxes lies in the other: the clusters are nested, not merely near.
    pub fn holds(&self, other: &Self) -> bool {
        let inside =
            |a: &Self, b: &Self| a.left <= b.left && b.right <= a.right && a.top <= b.top && b.bottom <= a.bottom;
        inside(self, other) || inside(other, self)
    }
}
