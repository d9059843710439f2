//! Which blocks of a row hold a pixel that reaches its level: in most frames few do, and the others are not looked at one by one.

/// Pixels of a row that are compared with their levels at a time.
pub const BLOCK: usize = 64;

widest! {
    /// Notes the blocks of a row in which a pixel above 0 reaches its level.
    pub fn find_reaching(row: &[f32], level: &[f32], out: &mut Vec<usize>) {
        for (i, (row, level)) in row.chunks(BLOCK).zip(level.chunks(BLOCK)).enumerate() {
            let mut any = 0u32;
            for (v, level) in row.iter().zip(level) {
                any |= u32::from(*v >= *level) & u32::from(*v > 0.0);
            }
            if any != 0 {
                out.push(i);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_blocks_with_a_pixel_above_zero_that_reaches_its_level_are_noted() {
        let mut row = vec![1.0f32; 3 * BLOCK + 5];
        let mut level = vec![2.0f32; row.len()];
        let mut found = Vec::new();
        find_reaching(&row, &level, &mut found);
        assert!(found.is_empty());
        (row[BLOCK], row[2 * BLOCK], row[3 * BLOCK + 4]) = (2.0, f32::NAN, 9.0);
        (row[0], level[0]) = (-1.0, -2.0);
        find_reaching(&row, &level, &mut found);
        assert_eq!(found, [1, 3]);
    }
}
