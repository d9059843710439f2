//! CRC-32 of ISO 3309, bits reflected: the sum of ZIP and MCAP.
//!
//! Source: ISO 3309, 8.1.1.6.2; polynomial 0x04c1_1db7, start and end inverted.

/// The sum of some bytes.
pub(super) fn crc32(bytes: &[u8]) -> u32 {
    let mut table = [0_u32; 256];
    for (k, entry) in table.iter_mut().enumerate() {
        *entry = (0..8).fold(k as u32, |c, _| if c & 1 == 1 { 0xedb8_8320 ^ (c >> 1) } else { c >> 1 });
    }
    !bytes.iter().fold(!0, |c: u32, b| table[((c ^ u32::from(*b)) & 0xff) as usize] ^ (c >> 8))
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_sum_is_the_standards() {
        // The check value of CRC-32 in every catalogue.
        assert_eq!(super::crc32(b"123456789"), 0xcbf4_3926);
    }
}
