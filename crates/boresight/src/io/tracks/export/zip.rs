//! A ZIP archive of a few files, stored as they are.
//!
//! Source: PKWARE, *.ZIP File Format Specification* 6.3.10, sections 4.3.7, 4.3.12, 4.3.16.
//! Times are 1980-01-01, so that the same files give the same bytes. Limits: 4 GiB in all (no Zip64).

use crate::{Error, ErrorKind, Result};
use crc32fast::hash as crc32;

/// 1980-01-01 in the date of MS-DOS: year since 1980, month, day.
const DATE: u16 = 1 << 5 | 1;

/// The archive with these files, by name and content.
/// # Errors
/// More than 4 GiB.
pub(super) fn archive(files: &[(&str, &[u8])]) -> Result<Vec<u8>> {
    let (mut out, mut directory) = (Vec::new(), Vec::new());
    let small = |n: usize| {
        u32::try_from(n)
            .map_err(|_| Error::new(ErrorKind::Unsupported, "more than 4 GiB, which a ZIP archive cannot hold"))
    };
    for (name, content) in files {
        // Version 2.0, names in UTF-8, stored, time and date.
        let [size, begin] = [small(content.len())?, small(out.len())?];
        let words: [u16; 5] = [20, 1 << 11, 0, 0, DATE];
        let mut common: Vec<u8> = words.iter().flat_map(|w| w.to_le_bytes()).collect();
        common.extend([crc32(content), size, size].iter().flat_map(|v| v.to_le_bytes()));
        common.extend((name.len() as u16).to_le_bytes());
        common.extend(0_u16.to_le_bytes());
        out.extend(b"PK\x03\x04");
        out.extend(&common);
        out.extend(name.as_bytes());
        out.extend(*content);
        directory.extend(b"PK\x01\x02");
        directory.extend(20_u16.to_le_bytes());
        directory.extend(&common);
        // No comment, first disk, no attributes.
        directory.extend([0; 10]);
        directory.extend(begin.to_le_bytes());
        directory.extend(name.as_bytes());
    }
    let [size, begin] = [small(directory.len())?, small(out.len())?];
    out.extend(&directory);
    out.extend(b"PK\x05\x06");
    out.extend([0; 4]);
    out.extend([files.len() as u16; 2].iter().flat_map(|n| n.to_le_bytes()));
    out.extend([size, begin].iter().flat_map(|v| v.to_le_bytes()));
    out.extend([0; 2]);
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_add_up() {
        let zip = archive(&[("a", b"xyz"), ("b/c", b"")]).unwrap();
        let (local, central, end) = (2 * 30 + 4 + 3, 2 * 46 + 4, 22);
        assert_eq!(zip.len(), local + central + end);
        assert_eq!(zip[zip.len() - 6..zip.len() - 2], (local as u32).to_le_bytes());
    }
}
