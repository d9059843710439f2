//! Counts the pages of a TIFF file by walking its directories, without reading pixels.
//!
//! Source: TIFF 6.0, section 2 (image file directory), and the BigTIFF layout (8-byte offsets). Cost: two small reads a
//! page. The walk stops at what is damaged; a chain that never ends is cut where the file could not hold more pages.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

/// Number of full-size pages, or `None` if the chain of directories is damaged.
pub(crate) fn count_pages(path: &Path) -> Option<u64> {
    let mut file = File::open(path).ok()?;
    let len = file.metadata().ok()?.len();
    let mut head = [0u8; 16];
    let n = file.read(&mut head).ok()?;
    if n < 8 {
        return None;
    }
    let little = head[0] == b'I';
    let big = head[if little { 2 } else { 3 }] == 43;
    let number = |b: &[u8]| {
        let fold = |acc: u64, b: &u8| acc << 8 | u64::from(*b);
        if little { b.iter().rev().fold(0, fold) } else { b.iter().fold(0, fold) }
    };
    let (count_len, entry_len, offset_len) = if big { (8usize, 20usize, 8usize) } else { (2, 12, 4) };
    let mut at = if big { number(&head[8..16]) } else { number(&head[4..8]) };
    let most = len / (count_len + entry_len + offset_len) as u64;
    let mut pages = 0;
    let mut walked = 0;
    let mut buffer = Vec::new();
    while at != 0 {
        walked += 1;
        if walked > most || at >= len {
            return None;
        }
        file.seek(SeekFrom::Start(at)).ok()?;
        let mut count = [0u8; 8];
        file.read_exact(&mut count[..count_len]).ok()?;
        let entries = usize::try_from(number(&count[..count_len])).ok().filter(|n| *n <= 65_535)?;
        buffer.resize(entries * entry_len + offset_len, 0);
        file.read_exact(&mut buffer).ok()?;
        let (entries, next) = buffer.split_at(entries * entry_len);
        // NewSubfileType (254), bit 0: a reduced-size copy of another page. Its value stands at the entry's end.
        let preview = entries.chunks_exact(entry_len).any(|e| {
            let value = &e[entry_len - offset_len..];
            number(&e[..2]) == 254 && number(&value[..4]) & 1 == 1
        });
        if !preview || pages == 0 {
            pages += 1;
        }
        at = number(next);
    }
    Some(pages)
}
